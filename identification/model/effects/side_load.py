"""The cylinder pushes sideways by a share of its force, with its direction of motion."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Parameter
from identification.model.effects.kinds import OfWrench, SizeAndAngle
from identification.model.load_state import LoadState


class SideLoad(SizeAndAngle, OfWrench):
    """The springs' answer to the force `ratio |F| n sign(dF . e)`: e the load's line with its largest component positive,
    a = e x z_base, n = a cos(angle) + (e x a) sin(angle), dF the change of load since the row before, from zero at each
    pose."""

    name = "side_load"
    family = "load path"
    formula_source = ("engineering judgement: a guide that rubs pushes in proportion to its load, with the sign of its "
                      "motion")
    parameters = (
        Parameter("ratio", "1", 0.032, 0.0, 0.5,
                  source="engineering judgement: 2 to 5 % of the load, their geometric mean",
                  bounds_source="engineering judgement: none, to the friction of dry steel; the sign is the angle's"),
        Parameter("angle_rad", "rad", 1.0, -3.1416, 3.1416, shape=True,
                  source="engineering judgement: no direction is more likely than another",
                  bounds_source="engineering judgement: any direction, a full turn"),
    )
    sentence = "the loading device pushes sideways too, in the direction it moves"
    settles = "read both force sensors, or put a ball between cylinder and tool"

    def true_wrench(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        across, other = self._along(rows)
        aside = values[0] * (np.cos(values[1]) * across + np.sin(values[1]) * other)
        return np.concatenate([rows.wrench[:, :3] + aside, rows.wrench[:, 3:]], axis=1)

    @staticmethod
    def _along(rows: LoadState) -> tuple[Array, Array]:
        """Side forces (n, 3) [N] for a ratio of 1 along a and along e x a."""
        force = rows.wrench[:, :3]
        size = np.linalg.norm(force, axis=1, keepdims=True)
        e = np.divide(force, size, out=np.zeros_like(force), where=size > 0)
        largest = np.take_along_axis(e, np.argmax(np.abs(e), axis=1)[:, None], axis=1)
        e = e * np.where(largest < 0, -1.0, 1.0)
        up = np.where(np.abs(e[:, 2:]) > 0.99, [[1.0, 0.0, 0.0]], [[0.0, 0.0, 1.0]])
        a = np.cross(e, up)
        length = np.linalg.norm(a, axis=1, keepdims=True)
        a = np.divide(a, length, out=np.zeros_like(a), where=length > 0)
        before = np.concatenate([np.zeros((1, 3)), force[:-1]])
        before[rows.starts] = 0.0
        pushed = size * np.sign(np.sum((force - before) * e, axis=1, keepdims=True))
        return pushed * a, pushed * np.cross(e, a)

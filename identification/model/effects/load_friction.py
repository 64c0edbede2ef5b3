"""What acts on the tool is less than the sensor says while the load grows, and more while it is taken off."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Parameter
from identification.model.effects.kinds import NO_LOAD_OFF, OfWrench
from identification.model.load_state import LoadState

# Loads that differ by less than this share are the same; along one line they are down to this cosine.
SAME, SAME_LINE = 0.03, 0.995


class LoadFriction(OfWrench):
    """True force = (1 - m s) reported force, s = 1 while the load grows and -1 while it is taken off."""

    name = "load_friction"
    family = "load path"
    formula_source = ("engineering judgement: Coulomb's friction at a sheave, a guide or a seal: a share of the load, "
                      "against the motion")
    parameters = (Parameter("share", "1", 0.02, -0.3, 0.3,
                            source="engineering judgement: a sheave takes 1 to 5 % of the load",
                            bounds_source="engineering judgement: either way, to a sheave that hardly turns"),)
    sentence = ("the load had friction between its sensor and the tool (a sheave, a guide, a seal): smaller than reported on "
                "the way up, larger on the way down")
    settles = "put the force sensor between the friction and the tool, or tap the rig before each reading"

    def missing(self, rows: LoadState) -> str:
        loaded = np.any(rows.wrench[:, :3] != 0, axis=1)
        return "" if np.any(direction(rows)[loaded] < 0) else NO_LOAD_OFF

    def true_wrench(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        return np.asarray(rows.wrench * (1.0 - values[0] * direction(rows))[:, None])


def direction(rows: LoadState) -> Array:
    """1 where the load of a row (n,) is larger than the last along the same line at the same pose, -1 where it is smaller, as
    before where it is the same; 1 where it comes along another line, since it grew from nothing there."""
    force, now = rows.wrench[:, :3], 1.0
    size, result = np.linalg.norm(force, axis=1), np.ones(len(rows))
    for k in range(1, len(rows)):
        same_line = not rows.starts[k] and force[k] @ force[k - 1] > SAME_LINE * size[k] * size[k - 1] > 0
        step = size[k] - size[k - 1]
        now = 1.0 if not same_line else np.sign(step) if abs(step) > SAME * size[k - 1] else now
        result[k] = now
    return result

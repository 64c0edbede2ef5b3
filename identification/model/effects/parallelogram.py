"""The load path through the parallel rod is not the one the model assumes."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Effect, Parameter, Signature
from identification.model.load_state import LoadState


class Parallelogram(Effect):
    """Gear 2 moves the TCP by `J~_2 - ratio J~_3` and carries `tau~_2 - ratio tau~_3` (serial Jacobian and torques): ratio 1 is
    an ideal rod (`load_path: drive`), 0 none (`serial`). Only for robots with a rod."""

    name = "parallelogram"
    family = "gear"
    of_robot = True
    formula_source = ("docs/architecture.md, Springs, with -ratio as the element of L that couples axis 3 to drive 2; the "
                      "coupling: the paper, eq. 7")
    parameters = (
        Parameter("ratio", "1", 1.0, -0.5, 1.5,
                  source="docs/architecture.md, Springs: 1 is a rod as it is mechanically, 0 the paper's eq. 3 to 5 as "
                         "published",
                  bounds_source="engineering judgement: half beyond either reading"),
    )
    sentence = "the load does not go through the parallel rod as the model assumes"
    settles = "ask the maker where gear 3 sits, or load the forearm at two angles of joint 2"

    def missing(self, rows: LoadState) -> str:
        return "" if rows.robot.rod is not None else "the robot has no parallel rod"

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        driven, driver = rows.robot.rod or (2, 1)
        torque = np.einsum("nri,nr->ni", rows.serial_jacobian, rows.wrench)

        def moved(ratio: float) -> Array:
            column = rows.serial_jacobian[:, :, driver] - ratio * rows.serial_jacobian[:, :, driven]
            return np.asarray(column * (torque[:, driver] - ratio * torque[:, driven])[:, None])

        return np.asarray(rows.compliance[driver] * (moved(float(values[0])) - moved(_assumed(rows))))

    def neutral(self, rows: LoadState) -> Array:
        return np.array([_assumed(rows)])

    def signatures(self, rows: LoadState, joint: int | None) -> list[Signature]:
        assumed = _assumed(rows)
        other = 1.0 - assumed
        signatures = []
        for share in (1.0, 0.3):
            there = self.contribution(rows, joint, np.array([assumed + share * (other - assumed)]))[:, :3, None]
            signatures.append(Signature(there / share, np.ones(1), True, lambda x: assumed + x * (other - assumed), self))
        return signatures


def _assumed(rows: LoadState) -> float:
    """The ratio of the plain model."""
    return 1.0 if rows.robot.load_path == "drive" else 0.0

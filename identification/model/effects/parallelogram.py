"""The load path through the parallel rod is not the one the model assumes."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Effect, Parameter, Signature
from identification.model.load_state import LoadState

# sin^2 of an angle at which no controller lets the parallelogram stand.
FLATTEST = 0.03


class Rod(Effect):
    """The rod and its bearings yield along it: the driven joint turns by `share c tau / sin^2 g`, c the compliance of its gear,
    tau its torque, g the angle between lower arm and crank: that between lower arm and forearm, plus `crank_rad`. The part that
    is the same at all angles is the gear's own."""

    name = "parallelogram"
    law = "rod"
    family = "gear"
    of_robot = True
    stiffens = True
    formula_source = ("engineering judgement: a rod on a crank of length a carries tau / (a sin g) and turns the crank by its "
                      "stretch over (a sin g)")
    parameters = (
        Parameter("share", "1", 0.1, 0.0, 3.0,
                  source="engineering judgement: a tenth of what the driven gear yields by",
                  bounds_source="engineering judgement: rigid, to three times the gear"),
        Parameter("crank_rad", "rad", 0.2, -0.6, 0.6, grid=(-0.4, -0.2, 0.0, 0.2, 0.4), shape=True,
                  source="engineering judgement: cranks stand off the forearm's axis by some ten degrees",
                  bounds_source="engineering judgement: 35 degrees either way"),
    )
    sentence = "the parallel rod yields: joint 3 is softer the flatter the parallelogram stands"
    settles = "the same load on the forearm with the parallelogram square and flat, or a dial gauge along the rod"

    def missing(self, rows: LoadState) -> str:
        return Parallelogram().missing(rows)

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        driven, _ = _rod(rows)
        arm, forearm, z = rows.origins[:, 2] - rows.origins[:, 1], rows.axes[:, 3], rows.axes[:, 1]
        across = np.sum(z * np.cross(arm, forearm), axis=1)
        angle = np.arctan2(across, np.sum(arm * forearm, axis=1)) + values[1]
        column = rows.serial_jacobian[:, :, driven]
        torque = np.einsum("nr,nr->n", column, rows.wrench)
        twist = values[0] * rows.compliance[driven] * torque / np.maximum(np.sin(angle) ** 2, FLATTEST)
        return np.asarray(column * twist[:, None])


class Parallelogram(Effect):
    """Gear 2 moves the TCP by `J~_2 - ratio J~_3` and carries `tau~_2 - ratio tau~_3` (serial Jacobian and torques): ratio 1 is
    an ideal rod (`load_path: drive`), 0 none (`serial`). Only for robots with a rod."""

    name = "parallelogram"
    family = "gear"
    of_robot = True
    other_laws = (Rod(),)
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
        yielding = rows.compliance[_rod(rows)[1]]
        return np.asarray(yielding * (_moved(rows, float(values[0])) - _moved(rows, _assumed(rows))))

    def neutral(self, rows: LoadState) -> Array:
        return np.array([_assumed(rows)])

    def signatures(self, rows: LoadState, joint: int | None) -> list[Signature]:
        """With the gear as soft as the rows' springs have it, and as the prior of the robot has it: where the load path is not
        the assumed one, springs fitted without this effect can make the gear all but rigid."""
        _, driver = _rod(rows)
        assumed, yielding = _assumed(rows), rows.compliance[driver]
        other, now = 1.0 - assumed, yielding * _moved(rows, assumed)
        signatures = []
        for softness in (yielding, 1.0 / rows.robot.prior.stiffness[driver]):
            for share in (1.0, 0.3):
                there = softness * _moved(rows, assumed + share * (other - assumed)) - now
                signatures.append(Signature(there[:, :3, None] / share, np.ones(1), True,
                                            lambda x: assumed + x * (other - assumed), self))
        return [*signatures, *self.of_other_laws(rows, joint)]


def _rod(rows: LoadState) -> tuple[int, int]:
    """The axis that the rod drives, and the one that drives it."""
    assert rows.robot.rod is not None
    return rows.robot.rod


def _moved(rows: LoadState, ratio: float) -> Array:
    """Deviation (n, 6) by gear 2 of unit compliance."""
    driven, driver = _rod(rows)
    torque = np.einsum("nri,nr->ni", rows.serial_jacobian, rows.wrench)
    column = rows.serial_jacobian[:, :, driver] - ratio * rows.serial_jacobian[:, :, driven]
    return np.asarray(column * (torque[:, driver] - ratio * torque[:, driven])[:, None])


def _assumed(rows: LoadState) -> float:
    """The ratio of the plain model."""
    return 1.0 if rows.robot.load_path == "drive" else 0.0

"""A joint's bearing tilts: the two axes across the joint yield too, about a pivot somewhere along its axis."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Parameter
from identification.model.effects.kinds import AtJoint
from identification.model.load_state import LoadState

COMPLIANCE = Parameter(
    "compliance_rad_per_nm", "rad/(N*m)", 9.1e-8, 0.0, 2e-6,
    source="engineering judgement: 1.1e7 N m/rad, two to five times joints 1 to 3 about their own axes (the paper, Table 1)",
    bounds_source="engineering judgement: rigid, to 5e5 N m/rad, softer than joints 1 to 3 about their own axes")

SHARE = Parameter("share", "1", 0.5, 0.1, 0.85, grid=(0.25, 0.5, 0.75), shape=True,
                  source="engineering judgement: the bearing of a column is somewhere in it",
                  bounds_source="engineering judgement: nearer to the frame it is the first law; on the floor it is "
                                "base_rocking")


class Tilt(AtJoint):
    """What both laws have in common."""

    name = "bearing_tilt"
    family = "structure"
    stiffens = True
    formula_source = ("the paper, sect. 1: models that take in the tilting rigidity too; its eq. 3 and 5 about the two axes "
                      "across the joint")
    sentence = "the bearing of joint {joint} tilts under load across its axis"
    settles = "a dial gauge across the bearing while the tool is loaded"


class TiltAlong(Tilt):
    """The column's bearing is not where the convention puts the joint's frame: its pivot lies a share s of the way from there
    to the floor. Joint 4 has no such law: a bearing along the forearm yields as a forearm that bends (link_bending)."""

    law = "along"
    joints = (1,)
    parameters: tuple[Parameter, ...] = (COMPLIANCE, SHARE)

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        return self.tilted(rows, np.array([values[0], values[0]]), values[1])

    @staticmethod
    def tilted(rows: LoadState, compliance: Array, share: float) -> Array:
        """What the column does (n, 6) that yields so about the x and y axes (2,) [rad/(N m)] of joint 1's frame."""
        axis, x, origin = rows.axes[:, 0], rows.link_x[:, 0], rows.origins[:, 0]
        pivot = origin - share * axis * np.sum(axis * origin, axis=1, keepdims=True)
        moment = rows.moment_about(pivot)
        turn = sum(c * across * np.sum(across * moment, axis=1, keepdims=True)
                   for c, across in zip(compliance, (x, np.cross(axis, x)), strict=True))
        return rows.turned(pivot, turn)


class TiltEach(TiltAlong):
    """The same where the column, or what holds its bearing, is softer about one of the axes across it, which turn with it."""

    law = "each"
    parameters = (*(replace(COMPLIANCE, name=f"{axis}_rad_per_nm") for axis in "xy"), replace(SHARE, low=0.0))

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        return self.tilted(rows, values[:2], values[2])


class BearingTilt(Tilt):
    """Sum over both axes across joint i of `J_t (J_t^T w) c_t`, pivot at the origin of the joint's frame. Tilt 4 keeps only its
    x axis, because its y axis is joint 5's own."""

    joints = (1, 2, 3, 4, 5)
    other_laws = (TiltAlong(), TiltEach())
    parameters = (COMPLIANCE,)

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        i = self.index(joint)
        axis, pivot = rows.axes[:, i], rows.origins[:, i]
        moment = rows.moment_about(pivot)
        across = moment - axis * np.sum(axis * moment, axis=1, keepdims=True)
        if joint == 4:
            only = rows.link_x[:, 3]
            across = only * np.sum(only * moment, axis=1, keepdims=True)
        return rows.turned(pivot, values[0] * across)

"""A gear that is softer under small torques: the two-slope torsion curve of harmonic and cycloidal gears, or one that stiffens
all the way."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Parameter, saturated
from identification.model.effects.documents import HARMONIC_DRIVE
from identification.model.effects.kinds import SOFTER_NEAR_ZERO, GearTwist, UnderTheArm, UnderTheTool, of_arm, of_tool
from identification.model.joint_log import JointLog
from identification.model.load_state import LoadState

# K3 / K1 - 1 of strain wave gears (the source of `extra_rad`).
SOFTER = 0.8
# How far [rad] a gear that a T1 of OF_LARGE [N m] is typical of is wound up by it: HARMONIC_DRIVE, table 42 gives 54 to 168 N m
# for sizes 40 to 58; gears of one shape are wound up alike by their T1, whatever their size: engineering judgement.
WOUND, OF_LARGE = 4e-4, 100.0
EXTRA = Parameter("extra_rad", "rad", 4e-5, 0.0, 3e-3,
                  source=f"{HARMONIC_DRIVE}, table 41: K3/K1 is 1.6 to 2.1, so 0.8 T c_i; 4e-5 rad is that at 100 N m with "
                         "joint 1 of the paper's Table 1",
                  bounds_source=f"{HARMONIC_DRIVE}, table 41: the whole twist up to T2 is 6.5 to 13.4 arcmin; 3e-3 rad is "
                                "10.3 arcmin")


def zone_of(*grid: float) -> Parameter:
    """The torque up to which the gear is softer."""
    return Parameter("torque_nm", "N*m", 100.0, 2.0, 1500.0, grid=grid, shape=True,
                     source=f"{HARMONIC_DRIVE}, table 42: T1 is 54 to 168 N m for sizes 40 to 58",
                     bounds_source=f"{HARMONIC_DRIVE}, table 42: T1 is 0.29 N m (size 8) to 843 N m (size 100), T2 up to 3040 "
                                   "N m; 2 to 1500 N m of that is engineering judgement")


class SofterNearZero(GearTwist):
    """What all its laws have in common. A gear with less stiffness is a smaller one, and no longer softer at less torque."""

    of_gravity = True
    law_family = SOFTER_NEAR_ZERO
    sentence = "the gear of joint {joint} is softer under small torques than under large ones"
    settles = "a torque ladder on this joint through zero with small steps"

    def typical(self, rows: LoadState, joint: int | None) -> Array:
        sizes = super().typical(rows, joint)
        torque = [parameter.name for parameter in self.parameters].index("torque_nm")
        sizes[torque] *= self._smaller(rows, joint)
        return sizes

    def grid(self, rows: LoadState, joint: int | None, parameter: Parameter) -> tuple[float, ...]:
        smaller = self._smaller(rows, joint) if parameter.name == "torque_nm" else 1.0
        return tuple(smaller * value for value in parameter.grid)

    def _smaller(self, rows: LoadState, joint: int | None) -> float:
        """By how much smaller the torques of this gear are than those of a large one."""
        return min(1.0, WOUND / (OF_LARGE * float(rows.compliance[self.index(joint)])))


class TwoSlopes(SofterNearZero):
    """The laws of two slopes, whatever preloads the gear."""

    def two_slopes(self, rows: LoadState, i: int, values: Array) -> Array:
        """The further twist (n,) [rad] of a gear that yields by a / T more below T; values: a, T and what its preload takes."""
        extra, torque = values[:2]
        preload = self.preload(rows, i, values)
        return np.asarray(extra * (saturated((preload + rows.torque[:, i]) / torque) - saturated(preload / torque)))

    def typical(self, rows: LoadState, joint: int | None) -> Array:
        sizes = super().typical(rows, joint)
        sizes[0] = SOFTER * sizes[1] * rows.compliance[self.index(joint)]
        return sizes


SHARE = Parameter("share", "1", 0.45, 0.0, 1.0,
                  source=f"{HARMONIC_DRIVE}, table 41: K3/K1 is 1.6 to 2.1: 0.4 to 0.5 less compliance under large torques",
                  bounds_source="engineering judgement: a spring that is all linear, to one that is all cubic")


def knee_of(*grid: float) -> Parameter:
    """The torque about which the gear stiffens."""
    return Parameter("torque_nm", "N*m", 300.0, 3.0, 5000.0, grid=grid, shape=True,
                     source=f"{HARMONIC_DRIVE}, table 42: T2 is 108 to 843 N m for sizes 40 to 80",
                     bounds_source=f"{HARMONIC_DRIVE}, table 42: T2 up to 3040 N m; 3 to 5000 N m is engineering judgement")


class CubicZone(SofterNearZero):
    """`J_i a c_i (T phi((g + tau) / T) - T phi(g / T) - tau)`, phi + phi^3 = u: a share a of the gear's twist is that of a
    spring `c_i^-1 x (1 + (x / (T c_i))^2)`. Gravity's torque is a part of it, so that the joint is stiffer where its weight is
    far out; c_i is the compliance without any torque."""

    name = "soft_zone"
    law = "cubic"
    formula_source = (f"{HARMONIC_DRIVE}, fig. 11: the stiffness rises from K1 over K2 to K3; a cubic spring through these: "
                      "engineering judgement")
    parameters: tuple[Parameter, ...] = (SHARE, knee_of(40.0, 120.0, 360.0, 1000.0))

    def twist(self, rows: LoadState, i: int, values: Array) -> Array:
        share, torque = values[:2]
        preload, load = self.preload(rows, i, values), rows.torque[:, i]
        cubic = torque * (_cubic((preload + load) / torque) - _cubic(preload / torque))
        return np.asarray(share * rows.compliance[i] * (cubic - load))


class WristCubic(UnderTheTool, CubicZone):
    """The cubic law in a wrist of unknown weight."""

    law = "cubic_wrist"
    parameters = (SHARE, knee_of(40.0, 120.0, 360.0), of_tool(every=5))


class ArmCubic(UnderTheArm, CubicZone):
    """The cubic law in an arm of unknown weight."""

    law = "cubic_arm"
    parameters = (SHARE, knee_of(120.0, 360.0, 1000.0), of_arm(every=5))


class WristZone(UnderTheTool, TwoSlopes):
    """The first law in a wrist of unknown weight."""

    name = "soft_zone"
    parameters = (EXTRA, zone_of(12.0, 25.0, 50.0, 90.0, 160.0), of_tool(every=3))

    def twist(self, rows: LoadState, i: int, values: Array) -> Array:
        return self.two_slopes(rows, i, values)


class ArmZone(UnderTheArm, TwoSlopes):
    """The first law in an arm of unknown weight."""

    name = "soft_zone"
    parameters = (EXTRA, zone_of(50.0, 90.0, 160.0, 280.0), of_arm(every=3))

    def twist(self, rows: LoadState, i: int, values: Array) -> Array:
        return self.two_slopes(rows, i, values)


class SoftZone(TwoSlopes):
    """`J_i a (sat((g + tau) / T) - sat(g / T))`: below T the gear yields by a / T more for each newton metre. Its typical size
    follows from the joint: K3/K1 = 1.8 makes a = 0.8 T c_i."""

    name = "soft_zone"
    other_laws = (CubicZone(), WristZone(), ArmZone(), WristCubic(), ArmCubic())
    formula_source = (f"{HARMONIC_DRIVE}, fig. 11: straight lines of stiffness K1, K2, K3 between the torques T1 and T2; "
                      "here two lines, or a cubic spring")
    parameters = (EXTRA, zone_of(12.0, 25.0, 50.0, 90.0, 160.0, 280.0))

    def twist(self, rows: LoadState, i: int, values: Array) -> Array:
        return self.two_slopes(rows, i, values)

    def log_contribution(self, log: JointLog, values: Array) -> Array:
        return np.asarray(values[0] * saturated(log.torque / values[1]))


def _cubic(u: Array) -> Array:
    """phi with phi + phi^3 = u."""
    return np.asarray(2 / np.sqrt(3) * np.sinh(np.arcsinh(1.5 * np.sqrt(3) * u) / 3))

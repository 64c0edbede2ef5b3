"""Free play of a gear: crossed when the torque on it changes its sign against gravity's; friction may hold it where it was."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from identification.common.arrays import Array
from identification.model.effects.base import Parameter, held_over, saturated
from identification.model.effects.documents import NABTESCO
from identification.model.effects.kinds import SOFTER_NEAR_ZERO, GearTwist, UnderTheArm, UnderTheTool, of_arm, of_tool
from identification.model.joint_log import JointLog
from identification.model.load_state import LoadState

# Friction holds the gear in its gap below this torque [N m]: engineering judgement, small against any cutting load's.
FRICTION_NM = 2.0
# A force's direction is trusted to this angle [rad], engineering judgement: a smaller torque may have either sign.
MISALIGNED = 0.03
# A weight that was searched is off by so much: half a step of the grid, and what hangs elsewhere than on its axis.
WEIGHT_OFF = 0.1
HALF_GAP = Parameter("half_gap_rad", "rad", 4.6e-5, 0.0, 1.5e-3,
                     source=f"{NABTESCO}: 0.1 to 0.3 arcmin; half of 0.32",
                     bounds_source="engineering judgement: none, to ten times the 1 arcmin that a new gear's hysteresis loss "
                                   "stays under, a worn-out gear")


class Play(GearTwist):
    """What all its laws have in common."""

    of_gravity = True
    near_laws = ("soft_zone",)
    law_family = SOFTER_NEAR_ZERO
    sentence = "the gear of joint {joint} has free play: it moves by its gap when the torque on it changes sign"
    turning = "crosses its gap"
    settles = "turn the joint to and fro by a lever at the flange with a dial gauge on it: free play shows without force"

    def crossed(self, rows: LoadState, i: int, values: Array) -> Array:
        """What the gear has crossed of its play (n,) [rad] since the load came."""
        preload = self.preload(rows, i, values)
        return np.asarray(values[0] * (_sign(preload + rows.torque[:, i]) - _sign(preload)))

    def side(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        i = self.index(joint)
        return np.trunc(_sign(self.preload(rows, i, values) + rows.torque[:, i]))

    def undecided(self, rows: LoadState, joint: int | None) -> NDArray[np.bool_]:
        i = self.index(joint)
        near = np.abs(rows.gravity[:, i] + rows.torque[:, i]) < self._doubt(rows, i)
        return np.asarray(near & np.any(rows.wrench != 0, axis=1))

    def loose(self, rows: LoadState, joint: int | None, values: Array) -> NDArray[np.bool_]:
        i = self.index(joint)
        preload = self.preload(rows, i, values)
        doubt = self._doubt(rows, i) + self.weighed * WEIGHT_OFF * np.abs(preload)
        return np.asarray(np.abs(preload + rows.torque[:, i]) < doubt)

    @staticmethod
    def _doubt(rows: LoadState, i: int) -> Array:
        """Torque (n,) [N m] under which the teeth may be on either side."""
        lever = np.linalg.norm(rows.jacobian[:, :3, i], axis=1)
        return np.asarray(np.maximum(FRICTION_NM, MISALIGNED * lever * np.linalg.norm(rows.wrench[:, :3], axis=1)))


class HeldPlay(Play):
    """`J_i b (s - s(g))`: where the torque is under the friction threshold the teeth stay at a share of the way to the side
    at which they were last pressed in the visit."""

    name = "backlash"
    law = "held"
    by_visit = True
    formula_source = ("M. Nordin, J. Galic, P.-O. Gutman, New Models for Backlash and Gear Play, Int. J. Adapt. Control "
                      "Signal Process. 11, 1997: the gap's position is a state of its own; held by friction: engineering "
                      "judgement")
    parameters = (
        HALF_GAP,
        Parameter("held", "1", 0.7, 0.0, 1.0, grid=(0.4, 0.8), shape=True,
                  source="engineering judgement: friction stops the teeth anywhere in the gap, seldom in its middle",
                  bounds_source="engineering judgement: back to the middle, to where they were pressed last"),
    )

    def twist(self, rows: LoadState, i: int, values: Array) -> Array:
        side = self._held(rows, i, values[1])
        return np.asarray(values[0] * (side - _sign(rows.gravity[:, i])))

    def of_each_visit(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        """At which end of its gap the way to the pose left a gear that no weight presses on: it shows against the unloaded
        reading that is taken first as soon as a load has crossed the gap."""
        i = self.index(joint)
        at_rest = 1 - np.abs(_sign(rows.gravity[:, i]))
        crossed = self._held(rows, i, 1.0) != 0
        return np.asarray((-values[0] * at_rest * crossed)[:, None, None] * rows.jacobian[:, :, i, None])

    def side(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        return np.trunc(self._held(rows, self.index(joint), 1.0))

    @staticmethod
    def _held(rows: LoadState, i: int, held: float) -> Array:
        """Where the teeth are (n,), -1 to 1."""
        side = _sign(rows.gravity[:, i] + rows.torque[:, i])
        return np.where(np.trunc(side) != 0, np.trunc(side), held * held_over(side, rows.starts))


class WristPlay(UnderTheTool, Play):
    """The first law in a wrist of unknown weight."""

    name = "backlash"
    parameters = (HALF_GAP, of_tool())

    def twist(self, rows: LoadState, i: int, values: Array) -> Array:
        return self.crossed(rows, i, values)


class ArmPlay(UnderTheArm, Play):
    """The first law in an arm of unknown weight."""

    name = "backlash"
    parameters = (HALF_GAP, of_arm())

    def twist(self, rows: LoadState, i: int, values: Array) -> Array:
        return self.crossed(rows, i, values)


class Backlash(Play):
    """`J_i b (s(g + tau) - s(g))`, s the sign, linear within a small friction threshold: a load whose sign the force error
    decides tells nothing. On joints that gravity loads it shows only where the load beats gravity."""

    name = "backlash"
    other_laws = (HeldPlay(), WristPlay(), ArmPlay())
    formula_source = ("M. Nordin, J. Galic, P.-O. Gutman, New Models for Backlash and Gear Play, Int. J. Adapt. Control "
                      "Signal Process. 11, 1997: the classical dead zone, solved for the twist")
    parameters = (HALF_GAP,)

    def twist(self, rows: LoadState, i: int, values: Array) -> Array:
        return self.crossed(rows, i, values)

    def log_contribution(self, log: JointLog, values: Array) -> Array:
        return np.asarray(values[0] * _sign(log.torque))


def _sign(torque: Array) -> Array:
    return saturated(torque / FRICTION_NM)

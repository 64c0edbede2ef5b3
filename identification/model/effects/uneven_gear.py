"""A gear is softer at some angles of its joint than at others; joint 2 has gravity_compensator for that."""

from __future__ import annotations

from functools import partial

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Parameter, Signature
from identification.model.effects.kinds import GearTwist, SofterAtAngles, amplitude_and_phase
from identification.model.load_state import LoadState

NAME, JOINTS = "uneven_gear", (1, 3, 4, 5, 6)
SENTENCE = "the gear of joint {joint} is softer at some of its angles than at others"
SETTLES = "the same load at several angles of that joint, the other joints as they are"
# Where a gear is worn: so many angles, evenly over those of the rows, and half widths [rad] are tried.
PLACES, WIDTHS = 9, (0.25, 0.5)


class _Uneven(SofterAtAngles):
    """What the waves have in common."""

    name = NAME
    joints = JOINTS
    parameters = amplitude_and_phase(
        0.2, "engineering judgement: a wheel out of true, teeth worn where the joint works most; 0.1 to 0.4")
    sentence = SENTENCE
    settles = SETTLES


class TwiceATurn(_Uneven):
    """`J_i tau_i c_i alpha cos(2 q_i + phi)`."""

    law = "twice"
    harmonic = 2
    formula_source = "engineering judgement: the second harmonic of the angle, as a wheel that is oval has it"


class WornAbout(GearTwist):
    """`J_i tau_i c_i a exp(-(q_i - q_0)^2 / 2 w^2)`: softer about one angle, where the joint has worked most."""

    name = NAME
    law = "worn"
    joints = JOINTS
    gear_law = False
    formula_source = "engineering judgement: wear is as the angles at which the joint worked are spread"
    parameters = (
        Parameter("share", "1", 0.3, 0.0, 5.0,
                  source="engineering judgement: as the amplitude of a wave, peak to peak",
                  bounds_source="engineering judgement: none, to a gear that has a sixth of its stiffness left there"),
        Parameter("angle_rad", "rad", 1.0, -6.2832, 6.2832, shape=True,
                  source="engineering judgement: no angle is more likely than another",
                  bounds_source="engineering judgement: any angle that a joint reaches"),
        Parameter("width_rad", "rad", 0.35, 0.1, 1.5, shape=True,
                  source="engineering judgement: 15 to 30 degrees, what one job moves the joint",
                  bounds_source="engineering judgement: a few teeth, to half of the joint's way"),
    )
    sentence = SENTENCE
    settles = SETTLES

    def twist(self, rows: LoadState, i: int, values: Array) -> Array:
        share, angle, width = values
        return np.asarray(rows.torque[:, i] * rows.compliance[i] * share
                          * np.exp(-0.5 * ((rows.theta[:, i] - angle) / width) ** 2))

    def signatures(self, rows: LoadState, joint: int | None) -> list[Signature]:
        angle = rows.theta[:, self.index(joint)]
        found = []
        for shape in ((place, width) for place in np.linspace(angle.min(), angle.max(), PLACES) for width in WIDTHS):
            column = self.contribution(rows, joint, np.array([1.0, *shape]))[:, :3, None]
            found.append(Signature(column, self.typical(rows, joint)[:1], True, partial(np.append, values=shape), self))
        return found


class UnevenGear(_Uneven):
    """`J_i tau_i c_i alpha cos(q_i + phi)`."""

    other_laws = (TwiceATurn(), WornAbout())
    harmonic = 1
    formula_source = "engineering judgement: the first harmonic of the angle, as a wheel out of centre has it"

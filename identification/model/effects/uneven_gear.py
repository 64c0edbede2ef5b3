"""A gear is softer at some angles of its joint than at others; joint 2 has gravity_compensator for that."""

from __future__ import annotations

from identification.model.effects.base import Parameter
from identification.model.effects.kinds import SofterAtAngles


class _Uneven(SofterAtAngles):
    """What both laws have in common: linear in alpha cos phi and alpha sin phi."""

    name = "uneven_gear"
    joints = (1, 3, 4, 5, 6)
    parameters = (
        Parameter("amplitude", "1", 0.2, 0.0, 1.0,
                  source="engineering judgement: a wheel out of true, teeth worn where the joint works most; 0.1 to 0.4",
                  bounds_source="engineering judgement: beyond 1 the joint's compliance would be negative at some angle"),
        Parameter("phase_rad", "rad", 1.0, -3.1416, 3.1416, shape=True,
                  source="engineering judgement: no angle is more likely than another",
                  bounds_source="engineering judgement: any direction, a full turn"),
    )
    sentence = "the gear of joint {joint} is softer at some of its angles than at others"
    settles = "the same load at several angles of that joint, the other joints as they are"


class TwiceATurn(_Uneven):
    """`J_i tau_i c_i alpha cos(2 q_i + phi)`."""

    law = "twice"
    harmonic = 2
    formula_source = "engineering judgement: the second harmonic of the angle, as a wheel that is oval has it"


class UnevenGear(_Uneven):
    """`J_i tau_i c_i alpha cos(q_i + phi)`."""

    other_laws = (TwiceATurn(),)
    harmonic = 1
    formula_source = "engineering judgement: the first harmonic of the angle, as a wheel out of centre has it"

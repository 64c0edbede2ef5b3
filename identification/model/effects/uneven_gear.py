"""A gear is softer at some angles of its joint than at others; joint 2 has gravity_compensator for that."""

from __future__ import annotations

from identification.model.effects.kinds import SofterAtAngles, amplitude_and_phase


class _Uneven(SofterAtAngles):
    """What both laws have in common."""

    name = "uneven_gear"
    joints = (1, 3, 4, 5, 6)
    parameters = amplitude_and_phase(
        0.2, "engineering judgement: a wheel out of true, teeth worn where the joint works most; 0.1 to 0.4")
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

"""A gear is softer at some angles of its joint than at others; joint 2 has gravity_compensator for that."""

from __future__ import annotations

from identification.model.effects.kinds import SofterAbout, SofterAtAngles, amplitude_and_phase

NAME, JOINTS = "uneven_gear", (1, 3, 4, 5, 6)
SENTENCE = "the gear of joint {joint} is softer at some of its angles than at others"
WORN = "the gear of joint {joint} is softer about one of its angles than elsewhere, as where it has worn most"
SETTLES = "the same load at several angles of that joint, the other joints as they are"


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


class WornAbout(SofterAbout):
    """Where the joint has worked most."""

    name = NAME
    joints = JOINTS
    sentence = WORN
    settles = SETTLES


class UnevenGear(_Uneven):
    """`J_i tau_i c_i alpha cos(q_i + phi)`."""

    other_laws = (TwiceATurn(), WornAbout())
    harmonic = 1
    formula_source = "engineering judgement: the first harmonic of the angle, as a wheel out of centre has it"

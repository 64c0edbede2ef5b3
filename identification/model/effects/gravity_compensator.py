"""The spring or cylinder that carries the lower arm makes joint 2's stiffness change with its angle."""

from __future__ import annotations

from identification.model.effects.kinds import SofterAbout, SofterAtAngles, amplitude_and_phase

NAME, JOINTS = "gravity_compensator", (2,)
SENTENCE = "joint 2 is stiffer at some of its angles than at others, as a gravity compensator makes it"
WORN = ("joint 2 is softer about one of its angles than elsewhere, as a gear that has worn most there, or a gravity "
        "compensator, makes it")
SETTLES = ("look whether a spring or cylinder carries the lower arm: where the robot file has no links, a gear that grows "
           "stiffer under the arm's weight looks the same; measure at more angles of joint 2")


class _Compensator(SofterAtAngles):
    """What the waves have in common."""

    carries_weight = True
    name = NAME
    joints = JOINTS
    parameters = amplitude_and_phase(0.27, "engineering judgement: 0.15 to 0.5, their geometric mean")
    sentence = SENTENCE
    settles = SETTLES


class OnceATurn(_Compensator):
    """`J_2 tau_2 c_2 alpha cos(q2 + phi)`: a gear that is uneven itself, or a spring whose anchor lies near the axis."""

    law = "once"
    harmonic = 1
    formula_source = "engineering judgement: the first harmonic of the angle, as uneven_gear"


class WornAbout(SofterAbout):
    """A gear that is worn about one angle, as `uneven_gear.worn`."""

    carries_weight = True
    name = NAME
    joints = JOINTS
    sentence = WORN
    settles = SETTLES


class GravityCompensator(_Compensator):
    """`J_2 tau_2 c_2 alpha cos(2 q2 + phi)`."""

    other_laws = (OnceATurn(), WornAbout())
    harmonic = 2
    formula_source = ("A. Klimchik et al., Identification of geometrical and elastostatic parameters of heavy industrial "
                      "robots, arXiv 1311.6810, 2013: compensators complicate the stiffness model; the second harmonic of "
                      "the angle: engineering judgement")

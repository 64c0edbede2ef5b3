"""An error of gear or encoder repeats with the angle: in a log taken in motion, and from pose to pose of load tests."""

from __future__ import annotations

from functools import partial

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Parameter, Signature
from identification.model.effects.kinds import ONLY_IN_MOTION, AtJoint, InMotion
from identification.model.joint_log import JointLog
from identification.model.load_state import LoadState

SENTENCE = "the gear or an encoder of joint {joint} has an error that repeats with its angle"
LINES = "docs/real-data.md: lines of 1 to 92 urad on three axes of a KUKA KR300"
COARSE_WAVE = "engineering judgement: a code ring of 100 mm radius that sits 5 um off its axis; finer lines are smaller"
LARGEST_LINE = "engineering judgement: 3 arcmin, several times the backlash of a gear for robots"
# Fewer poses to one reference than this are too few for a wave whose length is searched.
FEWEST_POSES = 8


class BetweenPoses(AtJoint):
    """`J_i (s sin(n angle) + c cos(n angle))` in load tests whose poses share a reference: what each pose stands off by. n is
    searched, and fitted from there; a line that is much finer than the poses lie apart shows as re-seating. It is no answer to
    a load, and is not carried on: between the poses that were measured nobody knows it."""

    name = "transmission_error"
    law = "poses"
    family = "gear"
    of_robot = False
    joints = (1, 2, 3, 4, 5, 6)
    formula_source = ("engineering judgement: gears and encoders turn, so what they get wrong repeats with their angle; the "
                      "poses of load tests show the coarse part")
    parameters = (
        *(Parameter(name, "rad", 5e-5, -1e-3, 1e-3, source=COARSE_WAVE, bounds_source=LARGEST_LINE)
          for name in ("sin_rad", "cos_rad")),
        Parameter("cycles_per_turn", "1", 1.0, 0.5, 41.0, shape=True,
                  source="engineering judgement: a wheel or a ring that sits off its axis",
                  bounds_source="engineering judgement: from once in two turns to finer than poses lie apart"),
    )
    sentence = SENTENCE
    settles = "go over the joint's angles without a load, a gauge at the tool, in both directions"
    # Few poses see coarse waves best, and those of a joint that goes through more than a turn need the finer steps.
    cycles_tried = (*np.arange(1.0, 12.0, 0.5).tolist(), *np.arange(12.0, 40.1, 0.75).tolist())

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        i = self.index(joint)
        return np.asarray(rows.jacobian[:, :, i] * (_waves(rows.theta[:, i], values[2]) @ values[:2])[:, None])

    def signatures(self, rows: LoadState, joint: int | None) -> list[Signature]:
        i, scale = self.index(joint), self.typical(rows, joint)[:2]
        move = rows.jacobian[:, :3, i, None]
        return [Signature(move * _waves(rows.theta[:, i], cycles)[:, None], scale, False,
                          partial(np.append, values=cycles), self) for cycles in self.cycles_tried]


def _waves(angle: Array, cycles: float) -> Array:
    """Sine and cosine (n, 2) at the commanded angle (n,)."""
    return np.stack([np.sin(cycles * angle), np.cos(cycles * angle)], axis=1)


class OnceATurn(InMotion):
    """`c cos(angle) + s sin(angle)`: the slowest wave, beside the other causes where the search of TransmissionError found none
    that is found again; it keeps a name from what only follows the angle. A ratio that is a little off is the same over the
    angles that a log visits."""

    name = "transmission_error"
    law = "turn"
    family = "gear"
    of_robot = False
    joints = (1, 2, 3, 4, 5, 6)
    formula_source = "engineering judgement: a wheel or a ring that sits off its axis"
    parameters = tuple(Parameter(name, "rad", 1e-4, -2e-2, 2e-2, source=COARSE_WAVE,
                                 bounds_source="engineering judgement: a ratio in doubt by a per cent or two")
                       for name in ("cos_rad", "sin_rad"))
    sentence = SENTENCE
    settles = "move the joint slowly over the same angles in both directions, at two speeds"

    def log_contribution(self, log: JointLog, values: Array) -> Array:
        return np.asarray(values[0] * np.cos(log.angle) + values[1] * np.sin(log.angle))


class TransmissionError(InMotion):
    """`s sqrt(2) cos(angle) + a cos(n angle + phi)`: a smooth part once a turn of the joint, s its RMS over a turn, and a line
    that repeats n times a turn. A log may show several lines and a smooth part of any low order; they are searched for, not
    taken from a grid, and what is told here is the strongest."""

    name = "transmission_error"
    family = "gear"
    of_robot = True
    joints = (1, 2, 3, 4, 5, 6)
    formula_source = ("engineering judgement: gears and encoders turn, so what they get wrong repeats with their angle; "
                      "gear trains and couplings give other numbers a turn than whole multiples of the motor's")
    parameters = (
        Parameter("smooth_rad", "rad", 1e-4, 0.0, 2e-3,
                  source="engineering judgement: a code ring of 100 mm radius that sits 15 um off its axis, as RMS",
                  bounds_source="engineering judgement: the same ring, 0.3 mm off its axis"),
        Parameter("line_rad", "rad", 1e-5, 0.0, 1e-3, source=LINES, bounds_source=LARGEST_LINE),
        Parameter("cycles_per_turn", "1", 500.0, 2.0, 4000.0, shape=True,
                  source="docs/real-data.md: 413 to 1653 a turn on three axes of a KUKA KR300",
                  bounds_source="engineering judgement: from the ovality of a ring to sixteen times the motor's turns at a "
                                "ratio of 250"),
        Parameter("phase_rad", "rad", 1.0, -3.1416, 3.1416, shape=True,
                  source="engineering judgement: no angle is more likely than another",
                  bounds_source="engineering judgement: any direction, a full turn"),
    )
    sentence = SENTENCE
    other_laws = (BetweenPoses(),)
    settles = "move the joint slowly over the same angles in both directions, at two speeds"

    def missing(self, rows: LoadState) -> str:
        shared = np.bincount(rows.reference[rows.starts])
        return "" if shared.max(initial=0) >= FEWEST_POSES else ONLY_IN_MOTION

    def signatures(self, rows: LoadState, joint: int | None) -> list[Signature]:
        return BetweenPoses().signatures(rows, joint)

    def log_contribution(self, log: JointLog, values: Array) -> Array:
        smooth, size, cycles, phase = values
        return np.asarray(smooth * np.sqrt(2.0) * np.cos(log.angle) + size * np.cos(cycles * log.angle + phase))

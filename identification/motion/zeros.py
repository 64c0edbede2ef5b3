"""ZeroShift: by how much the zero between motor and link encoder differs from one record to another.

Each record has its own zero; what one record says of another is judged without it. The difference is estimated with all records
in one model, so that its interval knows the autocorrelation of the noise and what is not known of the spring. The noise's
spectrum at rest is known badly from a short record: simulated records say by how much the interval must be wider.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.motion.axis import Solved, axis_of, solve
from identification.motion.band import BAND
from identification.motion.dictionary import Shape
from identification.motion.log_file import MotionLog
from identification.motion.prediction import model_columns
from identification.motion.search import Hypothesis
from identification.motion.transmission import Transmission

Array = NDArray[np.float64]
REPLICATES = 60
# Standard deviations from which on a shift is stated as one, of many joints and records.
STATED = 3.29


@dataclass(frozen=True)
class ZeroShift:
    """The deflection (motor minus link angle) in `record` stands `shift` [rad] higher than in `reference`, at equal load; std:
    its standard deviation under autocorrelated noise."""

    joint: int
    reference: str
    record: str
    shift: float
    std: float

    @property
    def moved(self) -> bool:
        """Whether noise does not explain it."""
        return abs(self.shift) > STATED * self.std

    @property
    def sentence(self) -> str:
        """In plain words."""
        half = 1.96e6 * self.std
        return (f"joint {self.joint}: the zero between its encoders differs by {1e6 * self.shift:.0f} urad "
                f"({1e6 * self.shift - half:.0f} ... {1e6 * self.shift + half:.0f}) from {self.reference} to {self.record}, "
                f"{1e3 * abs(self.shift):.2g} mm at 1 m from the axis")

    def as_dict(self) -> dict[str, Any]:
        """JSON values."""
        half = 1.96 * self.std
        return {"reference": self.reference, "record": self.record, "shift_urad": 1e6 * self.shift,
                "interval_95_urad": [1e6 * (self.shift - half), 1e6 * (self.shift + half)], "moved": self.moved}


def zero_shifts(
    joint: int, hypothesis: Hypothesis, transmission: Transmission, records: list[MotionLog]
) -> tuple[ZeroShift, ...]:
    """Of each record against the first that has the joint."""
    having = [record for record in records if joint in record.joints]
    if len(having) < 2:
        return ()
    axis = axis_of(joint, transmission.cleaned(having), BAND, transmission.smooth_over(having))
    axis = replace(axis, dictionary=[[shape] for group in axis.dictionary for shape in group if _among(shape, hypothesis)])
    columns = model_columns(axis, hypothesis)
    solved = solve(axis, columns)
    shift, std = _shifts(solved, len(having))
    size = float(np.sqrt(solved.chi2 / max(1, solved.count - columns.shape[1])))
    rng = np.random.default_rng(0)
    apart = []
    for _ in range(REPLICATES):
        noise = np.concatenate([axis.noise.simulate(size, length, rng) for length in axis.lengths])
        drawn, drawn_std = _shifts(solve(replace(axis, deflection=columns @ solved.coefficients + noise), columns), len(having))
        apart.append((drawn - shift) / drawn_std)
    std = std * np.maximum(1.0, np.std(apart, axis=0))
    return tuple(ZeroShift(joint, having[0].source, record.source, float(one), float(spread))
                 for record, one, spread in zip(having[1:], shift, std, strict=True))


def _among(shape: Shape, hypothesis: Hypothesis) -> bool:
    return any(shape.name == own.name and shape.smear == own.smear and np.array_equal(shape.fixed, own.fixed)
               for own in hypothesis.shapes)


def _shifts(solved: Solved, records: int) -> tuple[Array, Array]:
    """Of each further record against the first (records - 1,), and their standard deviations."""
    offsets, covariance = solved.coefficients[:records], solved.covariance[:records, :records]
    variance = np.diag(covariance)[1:] + covariance[0, 0] - 2 * covariance[0, 1:]
    return offsets[1:] - offsets[0], np.sqrt(np.maximum(variance, 1e-300))

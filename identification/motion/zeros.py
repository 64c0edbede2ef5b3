"""ZeroShift: by how much the zero between motor and link encoder differs from one record to another.

Each record has its own zero; what one record says of another is judged without it. The difference is estimated with all records
in one model, so that its interval knows the autocorrelation of the noise and what is not known of the spring.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from identification.motion.axis import axis_of, solve
from identification.motion.band import BAND
from identification.motion.log_file import MotionLog
from identification.motion.prediction import model_columns
from identification.motion.search import Hypothesis
from identification.motion.transmission import Transmission

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
    solved = solve(axis, model_columns(axis, hypothesis))
    found = []
    for k, record in enumerate(having[1:], start=1):
        variance = solved.covariance[0, 0] + solved.covariance[k, k] - 2 * solved.covariance[0, k]
        found.append(ZeroShift(joint, having[0].source, record.source,
                               float(solved.coefficients[k] - solved.coefficients[0]), float(np.sqrt(max(variance, 0.0)))))
    return tuple(found)

"""AxisDiagnosis: what a log says of one joint."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from identification.common.arrays import read_only
from identification.common.quantities import cause_words, quantity
from identification.motion.axis import Axis
from identification.motion.causes import LogCause
from identification.motion.leaps import Leap
from identification.motion.log_file import MotionLog
from identification.motion.prediction import Gain
from identification.motion.remainder import Remainder
from identification.motion.search import Hypothesis
from identification.motion.stiffness import AxisStiffness
from identification.motion.transmission import Transmission
from identification.motion.zeros import ZeroShift

Array = NDArray[np.float64]
Verdict = Literal["adequate", "named", "ambiguous", "unknown"]
MICRO = 1e6


@dataclass(frozen=True, eq=False, kw_only=True)
class AxisDiagnosis:
    """One joint. named: the hypothesis of the certain causes only, which the gain is about. causes: certain; alternatives:
    others, the likeliest first. explained: share of the misfit's variance that `named` takes away, under the band. deflection
    (n,), residuals (n, 2) [rad]: of plain and extended model, fitted, at full rate. withdrawn: names that do not predict.
    transmission: what repeats with the angle, named or not; leaps: what happened at one moment of a record; zeros: shifts of
    the zero between records; records: what was fitted, without the leaps. damping: of a gear that is damped as gears are, where
    that is all there is beside the spring."""

    axis: Axis
    verdict: Verdict
    p_value: float
    hypotheses: tuple[Hypothesis, ...]
    named: Hypothesis
    left: Remainder
    stiffness: AxisStiffness
    deflection: Array
    residuals: Array
    transmission: Transmission
    records: tuple[MotionLog, ...]
    leaps: tuple[Leap, ...] = ()
    zeros: tuple[ZeroShift, ...] = ()
    causes: tuple[LogCause, ...] = ()
    alternatives: tuple[LogCause, ...] = ()
    withdrawn: tuple[str, ...] = ()
    damping: LogCause | None = None
    explained: float = 0.0
    gain: Gain | None = None

    def __post_init__(self) -> None:
        read_only(self.deflection, self.residuals)

    @property
    def joint(self) -> int:
        """From 1."""
        return self.axis.joint

    @property
    def fitted_std(self) -> tuple[float, float]:
        """Standard deviation [rad] of what the plain and the extended model leave, at full rate."""
        return float(np.std(self.residuals[:, 0])), float(np.std(self.residuals[:, 1]))

    def as_dict(self) -> dict[str, Any]:
        """JSON values."""
        total = float(np.var(self.deflection))
        shares = [1 - float(np.var(self.residuals[:, k])) / total for k in range(2)]
        before, after = self.fitted_std
        return {
            "joint": self.joint, "verdict": self.verdict, "p_value": self.p_value,
            "causes": [cause.label for cause in self.causes], "withdrawn": list(self.withdrawn),
            "fitted": {
                "rms_before_urad": MICRO * before, "rms_after_urad": MICRO * after,
                "variance_explained_before": shares[0], "variance_explained_after": shares[1]},
            "sets": [{"causes": list(hypothesis.names), "probability": hypothesis.probability,
                      "compliance_rad_per_nm": float(hypothesis.solved.coefficients[len(self.axis.lengths)])}
                     for hypothesis in self.hypotheses[:6]],
            "left": self.left.as_dict(), "stiffness": self.stiffness.as_dict(),
            "transmission_error": self.transmission.as_dict(list(self.records)),
            "zero_shifts": [zero.as_dict() for zero in self.zeros],
            "leaps": [leap.as_dict() for leap in self.leaps],
            "damping_lag_s": None if self.damping is None else {
                "estimate": float(self.damping.values[0]), "std": float(self.damping.std[0])},
        }

    def lines(self) -> list[str]:
        """In plain words."""
        total = float(np.var(self.deflection))
        before, after = self.fitted_std
        lines = [f"joint {self.joint}: a straight line through the gear-side torque leaves {MICRO * before:.0f} urad RMS and "
                 f"explains {100 * (1 - before**2 / total):.0f} % of the variance (p = {self.p_value:.2g})", *self._answer()]
        if self.withdrawn:
            lines.append(f"  withdrawn: {', '.join(map(cause_words, self.withdrawn))} fits here but does not predict what was "
                         "not fitted")
        if self.causes:
            lines.append(f"  extended model: {MICRO * after:.0f} urad RMS, {100 * (1 - after**2 / total):.1f} % of the "
                         "variance")
        gain = self.gain
        if gain is not None:
            lines.append(f"  gain where it was not fitted ({gain.held_out}): {MICRO * gain.before:.0f} -> "
                         f"{MICRO * gain.after:.0f} urad RMS, ratio {gain.ratio:.1f} ({gain.interval[0]:.1f} ... "
                         f"{gain.interval[1]:.1f}){self._with_zero(gain)}")
        lines += [f"  {zero.sentence}" for zero in self.zeros if zero.moved]
        return [*lines, f"  {self.stiffness.sentence}"]

    @staticmethod
    def _with_zero(gain: Gain) -> str:
        before, after = gain.with_zero
        if np.isclose(before / after, gain.ratio):
            return ""
        return f"; each record with its own zero, with that of the fitted {before / after:.1f}"

    @property
    def _adequate(self) -> str:
        if self.damping is None:
            return "the plain spring explains the log to its noise"
        lag = quantity(float(self.damping.values[0]), float(self.damping.std[0]), "s")
        return (f"the plain spring and its damping explain the log to its noise; the twist is late by {lag}, as gears are (a "
                "torque recorded so much early would look the same), which does not matter at rest")

    def _answer(self) -> list[str]:
        """The names, certain and not."""
        lines = [f"  adequate: {self._adequate}"] if self.verdict == "adequate" else []
        lines += [f"  named: {cause.sentence} ({cause.label}: {cause.estimates}; probability {cause.probability:.3f})"
                  for cause in self.causes]
        others = [f"{cause_words(cause.label)} {cause.probability:.2f}" for cause in self.alternatives]
        if self.verdict == "ambiguous":
            lines.append("  ambiguous: " + ", ".join(others))
        elif self.verdict == "unknown":
            nearest = f"; the nearest: {', '.join(others[:5])}" if others else ""
            lines.append(f"  unknown: no cause in the dictionary explains it{nearest}")
        elif others:
            lines.append("  beside it perhaps (this log does not settle it): " + ", ".join(others[:5]))
        return lines

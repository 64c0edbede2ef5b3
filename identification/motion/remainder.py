"""What the extended model leaves: does it follow the joint's angle, the motor's speed or torque, or a narrow frequency?

What is left beside a transmission error that was found again has no cause in the dictionary (torque ripple, vibration of the
arm). Residuals of a log are autocorrelated, so whether they follow a quantity is judged against the same residual shifted round
in time.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.motion.axis import Axis

Array = NDArray[np.float64]
SHIFTS = 400
DEGREE = 6
# p-value of a pattern, over all quantities looked at.
PATTERN = 0.01
# Bands [Hz] in which the residual's variance is told.
BANDS = (0.0, 1.0, 3.0, 10.0, 20.0, 40.0, 1e9)


@dataclass(frozen=True, eq=False)
class Remainder:
    """follows: (quantity, share of the residual's variance, p-value) under the band's edge. spectrum: (low, high [Hz], share of
    the full-rate residual's variance). line: the strongest narrow line of the full-rate residual, (Hz, share)."""

    follows: tuple[tuple[str, float, float], ...]
    spectrum: tuple[tuple[float, float, float], ...]
    line: tuple[float, float]

    @property
    def patterns(self) -> tuple[tuple[str, float, float], ...]:
        """What the residual follows more than chance would have it."""
        return tuple(follow for follow in self.follows if follow[2] <= PATTERN / len(self.follows))

    def as_dict(self) -> dict[str, Any]:
        """JSON values."""
        return {"follows": [{"what": name, "share": share, "p_value": p} for name, share, p in self.follows],
                "spectrum": [{"low_hz": low, "high_hz": high, "share": share} for low, high, share in self.spectrum],
                "strongest_line": {"hz": self.line[0], "share": self.line[1]}}


def remainder(axis: Axis, residual: Array, full: list[Array]) -> Remainder:
    """residual (n,) [rad]: under the band; full: the records' residuals at full rate."""
    rng = np.random.default_rng(0)
    follows = []
    for name, quantity in (("the joint's angle", axis.angle), ("the torque", axis.torque)):
        share, p_value = _share(axis, quantity, residual, rng)
        follows.append((name, share, p_value))
    return Remainder(tuple(follows), *_spectrum(full, axis.rates))


def angle_columns(angle: Array, reach: tuple[float, float] | None = None, degree: int = DEGREE) -> Array:
    """Chebyshev polynomials (n, degree) of an angle (or another quantity) within `reach`, its own where None; no constant."""
    low, high = (float(angle.min()), float(angle.max())) if reach is None else reach
    place = np.clip(2 * (angle - low) / max(high - low, 1e-12) - 1, -1, 1)
    return np.asarray(np.polynomial.chebyshev.chebvander(place, degree)[:, 1:], dtype=float)


def _share(axis: Axis, quantity: Array, residual: Array, rng: np.random.Generator) -> tuple[float, float]:
    columns = np.column_stack([axis.plain[:, :-1], angle_columns(quantity)])
    basis = np.linalg.qr(columns)[0]
    offsets = np.linalg.qr(axis.plain[:, :-1])[0]
    lengths = axis.lengths

    def share(values: Array) -> float:
        level = values - offsets @ (offsets.T @ values)
        total = float(level @ level)
        return float(np.sum((basis.T @ level) ** 2) / total) if total > 0 else 0.0

    actual = share(residual)
    parts = axis.parts(residual)
    as_much = 0
    for _ in range(SHIFTS):
        moved = [np.roll(part, int(rng.integers(length // 10, length - length // 10)))[:: rng.choice([-1, 1])]
                 for part, length in zip(parts, lengths, strict=True)]
        as_much += share(np.concatenate(moved)) >= actual
    return actual, (as_much + 1) / (SHIFTS + 1)


def _spectrum(full: list[Array], rates: list[float]) -> tuple[tuple[tuple[float, float, float], ...], tuple[float, float]]:
    totals = np.zeros(len(BANDS) - 1)
    line = (0.0, 0.0)
    for residual, rate in zip(full, rates, strict=True):
        level = (residual - residual.mean()) * np.hanning(len(residual))
        power = np.abs(np.fft.rfft(level)) ** 2
        power /= max(float(power.sum()), 1e-300)
        frequency = np.fft.rfftfreq(len(residual), 1 / rate)
        for k in range(len(totals)):
            totals[k] += power[(frequency >= BANDS[k]) & (frequency < BANDS[k + 1])].sum()
        window = np.convolve(power, np.ones(5), "same")
        window[frequency < BANDS[1]] = 0.0
        top = int(np.argmax(window))
        if window[top] > line[1]:
            line = (float(frequency[top]), float(window[top]))
    top_rate = max(rates) / 2
    shares = totals / len(full)
    return tuple((BANDS[k], min(BANDS[k + 1], top_rate), float(shares[k])) for k in range(len(totals))
                 if BANDS[k] < top_rate), line

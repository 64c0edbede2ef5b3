"""The measured deviation before and after a correction, and how much of it had been predicted.

With b_i, a_i the deviation of place i before and after (vectors of the components measured in both), the ratio of RMS is
R = sqrt(mean |b|^2 / mean |a|^2). ln R has the influence values (|b_i|^2 / mean |b|^2 - |a_i|^2 / mean |a|^2) / 2, one a place,
so pairs stay together; the mean of these along the path gives its interval (batch_means.py).

The scale s makes s p the best fit of the measured m to the predicted p (least squares through the origin: what does not yield
has no deviation). Its influence values are p_i . (m_i - s p_i) n / sum |p|^2. A constant beside it, as from a set-up error, is
fitted only to see whether there is one: then no scale is advised.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np

from compensator.verification.batch_means import Mean, mean_along
from compensator.verification.readings import Readings
from identification.common.arrays import Array

# A place got worse beyond its noise where |after| - |before| is over so many sigmas: by chance 2.3 % of equal places are.
WORSE_SIGMAS, BY_CHANCE = 2.0, 0.0228
# A scale outside this range is not what motion adds to a static deflection.
SANE_SCALE = (0.5, 2.0)
# A 95 % interval is as wide as so many standard errors either way.
HALF_WIDTH = 1.96
# A constant is there when it is so many half intervals from zero, and worth a word from this share of the measured RMS on.
SURE, SMALL = 1.5, 0.05


@dataclass(frozen=True)
class Figures:
    """One pass, micrometres: of the size of the deviation, and for one axis of its value (then `mean` has a sign)."""

    points: int
    rms_um: float
    mean_um: float
    p95_um: float
    max_um: float


@dataclass(frozen=True, eq=False)
class Comparison:
    """Before against after, over paired places. ratio: RMS before over after, None where nothing is left; interval 95 %, None
    where there are too few places. by_axis: name -> (before, after). worse: places that got worse beyond their noise; noise:
    RMS that the readings' own noise makes up [um]. log_ratio: of which the interval comes."""

    before: Figures
    after: Figures
    ratio: float | None
    interval: tuple[float, float] | None
    log_ratio: Mean | None
    by_axis: dict[str, tuple[Figures, Figures]]
    worse: int
    noise_um: float

    @property
    def verdict(self) -> Literal["better", "no difference shown", "worse"]:
        """What the interval of the ratio says."""
        if self.interval is not None and self.interval[0] > 1:
            return "better"
        return "worse" if self.interval is not None and self.interval[1] < 1 else "no difference shown"

    def as_dict(self) -> dict[str, Any]:
        """JSON values."""
        return {
            "verdict": self.verdict, "points": self.before.points, "before": asdict(self.before), "after": asdict(self.after),
            "ratio": self.ratio, "ratio_interval_95": list(self.interval) if self.interval else None,
            "interval_by": "batch means along the path, Student's t" if self.interval else None,
            "blocks": self.log_ratio.blocks if self.log_ratio else None,
            "autocorrelation_points": self.log_ratio.correlation.values if self.log_ratio else None,
            "axes": {name: {"before": asdict(pair[0]), "after": asdict(pair[1])} for name, pair in self.by_axis.items()},
            "worse_points": self.worse, "worse_share": self.worse / self.before.points, "worse_share_by_chance": BY_CHANCE,
            "noise_rms_um": self.noise_um}


def compare(before: Readings, after: Readings) -> Comparison:
    """Paired readings, row by row; components that are not measured in both are left out."""
    both = ~(np.isnan(before.deviation) | np.isnan(after.deviation))
    kept = both.any(axis=1)
    b, a = (np.where(both, readings.deviation, 0.0)[kept] for readings in (before, after))
    sigmas = [np.where(both, readings.sigma, 0.0)[kept] for readings in (before, after)]
    squares = np.array([np.sum(deviation**2, axis=1) for deviation in (b, a)])
    size, power = np.sqrt(squares), squares.mean(axis=1)
    ratio, interval, log_ratio = None, None, None
    if (power > 0).all():
        log_ratio = mean_along((squares[0] / power[0] - squares[1] / power[1]) / 2)
        ratio = float(np.sqrt(power[0] / power[1]))
        if log_ratio.half_width is not None:
            factor = float(np.exp(log_ratio.half_width))
            interval = (ratio / factor, ratio * factor)
    # The noise of a size: that of the components along the deviation itself.
    along = [np.sqrt(np.sum((deviation / np.maximum(length, 1e-15)[:, None] * sigma) ** 2, axis=1))
             for deviation, length, sigma in zip((b, a), size, sigmas, strict=True)]
    worse = int((size[1] - size[0] > WORSE_SIGMAS * np.hypot(*along)).sum())
    by_axis = {name: (_figures(b[measured, axis]), _figures(a[measured, axis]))
               for axis, name in enumerate(before.axes) if (measured := both[kept][:, axis]).any()}
    noise = float(np.sqrt(np.mean(np.sum(sigmas[1] ** 2, axis=1))))
    return Comparison(_figures(size[0]), _figures(size[1]), ratio, interval, log_ratio, by_axis, worse, 1e6 * noise)


def _figures(values: Array) -> Figures:
    um, size = 1e6 * values, 1e6 * np.abs(values)
    return Figures(len(um), float(np.sqrt(np.mean(um**2))), float(um.mean()), float(np.percentile(size, 95)), float(size.max()))


@dataclass(frozen=True)
class Scale:
    """Measured against predicted deviation, over places and components that have both. share: of the mean square of the
    measured deviation that the prediction took away as it stands (negative: it added), share_scaled with the scale.
    with_constant: the scale where a constant per axis is fitted beside it, constant_um that constant; constant_shown: it is
    there, and not small. other_axes: those along which the readings seem to be (identification/common/other_axes.py), "": the
    stated ones."""

    points: int
    scale: float
    interval: tuple[float, float] | None
    share: float
    share_scaled: float
    measured_rms_um: float
    residual_rms_um: float
    with_constant: float | None
    with_constant_interval: tuple[float, float] | None
    constant_um: tuple[float, ...]
    constant_shown: bool
    blocks: int
    short: bool
    other_axes: str = ""

    @property
    def shown(self) -> bool:
        """Whether the measured deviation follows the predicted at all."""
        return self.interval is not None and self.interval[0] > 0

    @property
    def std(self) -> float | None:
        """1 sigma of the scale, None where it has no interval."""
        return None if self.interval is None else (self.interval[1] - self.interval[0]) / (2 * HALF_WIDTH)

    @property
    def option(self) -> str:
        """--scale as `correct` takes it, with its standard error; also where 1 will do, which tells that the moving robot gives
        way as at rest. Empty where none can be told."""
        value = self.advised
        if value is None and self.shown and not self.constant_shown and not self.other_axes and self.interval and (
                self.interval[0] <= 1 <= self.interval[1]):
            value = 1.0
        return "" if value is None or self.std is None else f"--scale {value:g}:{max(self.std, 1e-3):.2g}"

    @property
    def advised(self) -> float | None:
        """The scale to correct with: None where 1 will do, or where none can be advised."""
        if not self.shown or self.constant_shown or self.interval is None or self.interval[0] <= 1 <= self.interval[1]:
            return None
        if self.other_axes:
            return None
        return round(self.scale, 3) if SANE_SCALE[0] <= self.scale <= SANE_SCALE[1] else None

    def as_dict(self) -> dict[str, Any]:
        """JSON values."""
        values = asdict(self)
        del values["short"]
        return {name: list(value) if isinstance(value, tuple) else value for name, value in values.items()} | {
            "advised_scale": self.advised}


def estimate_scale(measured: Array, predicted: Array) -> Scale | None:
    """How many times the predicted deviation (n, C) [m] the measured one (n, C) [m] is, in the order of the path; NaN: not
    known. None where nothing is predicted."""
    known = ~(np.isnan(measured) | np.isnan(predicted))
    kept = known.any(axis=1)
    known = known[kept]
    m, p = (np.where(known, deviation[kept], 0.0) for deviation in (measured, predicted))
    power = float(np.sum(m**2))
    through = _slope(m, p)
    if through is None or power <= 0:
        return None
    scale, mean = through[0], mean_along(through[1])
    number = np.maximum(known.sum(axis=0), 1)
    centred = [np.where(known, deviation - deviation.sum(axis=0) / number, 0.0) for deviation in (m, p)]
    beside = _slope(centred[0], centred[1])
    constant, shown = np.zeros(m.shape[1]), False
    if beside is not None:
        left = m - beside[0] * p
        constant = left.sum(axis=0) / number
        for axis in np.flatnonzero(known.any(axis=0)):
            # The constant is as uncertain as what it leaves, and as the scale beside it.
            influence = left[:, axis] - (p[:, axis].sum() / number[axis]) * beside[1]
            half = mean_along(influence[known[:, axis]]).half_width
            shown |= half is not None and abs(constant[axis]) > max(SURE * half, SMALL * np.sqrt(power / len(m)))
    residual = float(np.sum((m - scale * p) ** 2))
    return Scale(
        len(m), scale, _interval(scale, mean), 1 - float(np.sum((m - p) ** 2)) / power, 1 - residual / power,
        1e6 * float(np.sqrt(power / len(m))), 1e6 * float(np.sqrt(residual / len(m))),
        beside[0] if beside else None, _interval(beside[0], mean_along(beside[1])) if beside else None,
        tuple(float(1e6 * x) for x in constant), bool(shown), mean.blocks, mean.correlation.short)


def _slope(m: Array, p: Array) -> tuple[float, Array] | None:
    """The slope of m on p (n, C) through the origin, and its influence values (n,); None without any p."""
    square = float(np.sum(p**2))
    if square <= len(p) * 1e-18:     # A nanometre RMS is no prediction.
        return None
    slope = float(np.sum(m * p)) / square
    return slope, np.sum(p * (m - slope * p), axis=1) * (len(p) / square)


def _interval(value: float, mean: Mean) -> tuple[float, float] | None:
    return None if mean.half_width is None else (value - mean.half_width, value + mean.half_width)

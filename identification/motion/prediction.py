"""A set of causes fitted on some records, and what it leaves of another."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.common.arrays import rms
from identification.motion.axis import Axis, axis_of, solve, straight_line
from identification.motion.blocks import ratio_interval
from identification.motion.dictionary import ALWAYS
from identification.motion.log_file import MotionLog
from identification.motion.search import Hypothesis
from identification.motion.transmission import Transmission

Array = NDArray[np.float64]
# Blocks of time that are held out in turn where there is no second record.
FOLDS = 5


@dataclass(frozen=True, eq=False)
class Gain:
    """RMS [rad] of all that was not fitted, at full rate, each other record with a zero of its own; interval_95 of the ratio
    from redrawn blocks of a second. explained: share of the variance that plain and extended model explain there. held_out: how
    it was held out. residuals: (n, 2) [rad], plain and extended. with_zero: RMS of both with the zero of the fitted records."""

    before: float
    after: float
    interval: tuple[float, float]
    explained: tuple[float, float]
    held_out: str
    residuals: Array
    with_zero: tuple[float, float]

    @property
    def ratio(self) -> float:
        """How many times smaller the residual is."""
        return self.before / self.after

    def as_dict(self) -> dict[str, object]:
        """As in diagnosis.json."""
        before, after = self.with_zero
        return {"rms_before_urad": 1e6 * self.before, "rms_after_urad": 1e6 * self.after, "ratio": self.ratio,
                "interval": list(self.interval), "variance_explained_before": self.explained[0],
                "variance_explained_after": self.explained[1], "held_out": self.held_out,
                "with_fitted_zero": {"rms_before_urad": 1e6 * before, "rms_after_urad": 1e6 * after, "ratio": before / after}}


def model_columns(axis: Axis, hypothesis: Hypothesis, without: int | None = None) -> Array:
    """Columns (n, p) of a hypothesis on another axis object (another record or band)."""
    parts = [axis.plain]
    for k, (shape, kept) in enumerate(zip(hypothesis.shapes, hypothesis.kept, strict=True)):
        if k != without:
            parts.append(shape.on(axis.logs, axis.rates, axis.band)[:, list(kept)])
    return np.column_stack(parts)


def residual_on(fitted: Array, lengths: int, axis: Axis, columns: Array) -> Array:
    """What a fit with `lengths` offsets leaves (n,) on another axis object, the offsets' mean taken for its own."""
    offset = float(np.mean(fitted[:lengths]))
    own = len(axis.lengths)
    return np.asarray(axis.deflection - offset - columns[:, own:] @ fitted[lengths:])


@dataclass(frozen=True, eq=False)
class Split:
    """Records that are fitted and one that is predicted; apart: it is another record, so its zero is its own."""

    train: list[MotionLog]
    test: MotionLog
    apart: bool


def held_out(
    joint: int, band: float, hypothesis: Hypothesis, transmission: Transmission, records: list[MotionLog],
    validate: MotionLog | None,
) -> tuple[Gain, tuple[bool, ...]]:
    """The gain of a hypothesis and a transmission error where they were not fitted, and of each of the hypothesis' causes
    whether it helps there. Both are judged with a zero that is the other record's own: zeros move between records."""
    splits, how = _splits(joint, records, validate)
    # At full rate: plain, extended, and what was measured; under the band: with all causes, then without each of them.
    models = (None, *range(len(hypothesis.shapes)))
    full: list[list[Array]] = [[], [], []]
    with_zero: list[list[Array]] = [[], []]
    smooth: list[list[Array]] = [[] for _ in models]
    for split in splits:
        plain, measured = axis_of(joint, split.train, band, only=ALWAYS), axis_of(joint, [split.test], np.inf, only=ALWAYS)
        over = transmission.smooth_over(split.train)
        train = axis_of(joint, transmission.cleaned(split.train), band, over)
        test = transmission.predicted(split.train, split.test)
        raw, low = axis_of(joint, [test], np.inf, over), axis_of(joint, [test], band, over)
        offsets = len(train.lengths)
        for parts, without in zip(smooth, models, strict=True):
            fitted = solve(train, model_columns(train, hypothesis, without)).coefficients
            parts.append(_own_zero(residual_on(fitted, offsets, low, model_columns(low, hypothesis, without)), split))
            if without is None:
                both = (residual_on(straight_line(plain), offsets, measured, measured.spring),
                        residual_on(fitted, offsets, raw, model_columns(raw, hypothesis)))
                for k, left in enumerate(both):
                    with_zero[k].append(left)
                    full[k].append(_own_zero(left, split))
                full[2].append(measured.deflection - measured.deflection.mean())
    squares = [float(np.mean(np.concatenate(parts) ** 2)) for parts in smooth]
    helps = tuple(square > squares[0] for square in squares[1:])
    before, after, deflection = (np.concatenate(parts) for parts in full)
    total = float(deflection @ deflection)
    explained = (1 - float(before @ before) / total, 1 - float(after @ after) / total)
    seconds = sum(float(split.test.time[-1] - split.test.time[0]) for split in splits)
    gain = Gain(rms(before), rms(after), ratio_interval(before, after, seconds), explained, how,
                np.column_stack([before, after]), (rms(np.concatenate(with_zero[0])), rms(np.concatenate(with_zero[1]))))
    return gain, helps


def _own_zero(left: Array, split: Split) -> Array:
    return left - left.mean() if split.apart else left


def _splits(joint: int, records: list[MotionLog], validate: MotionLog | None) -> tuple[list[Split], str]:
    """What is fitted and what is predicted with it, and how it was held out in words."""
    having = [record for record in records if joint in record.joints]
    if validate is not None:
        return [Split(having, validate, True)], f"validate: {validate.source}"
    if len(having) > 1:
        return [Split([other for other in having if other is not record], record, True) for record in having], (
            "each record by the others")
    return _folds(having[0]), f"cross-validation by {FOLDS} blocks of time"


def _folds(record: MotionLog) -> list[Split]:
    count = len(record.time)
    edges = np.linspace(0, count, FOLDS + 1).astype(int)
    folds = []
    for k in range(FOLDS):
        ends = ((0, edges[k]), (edges[k + 1], count))
        pieces = [record.cut(start, stop) for start, stop in ends if stop > start]
        folds.append(Split(pieces, record.cut(edges[k], edges[k + 1]), False))
    return folds

"""A set of causes fitted on some records, and what it leaves of another."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.common.arrays import rms
from identification.motion.axis import Axis, axis_of, solve
from identification.motion.dictionary import Shape
from identification.motion.log_file import MotionLog
from identification.motion.search import Hypothesis

Array = NDArray[np.float64]
# Length of the blocks that are held out in turn where there is no second record [s], and of those that are redrawn.
FOLDS = 5
BLOCK = 1.0
REDRAWN = 999


@dataclass(frozen=True, eq=False)
class Gain:
    """RMS [rad] of all that was not fitted, at full rate, offset included; interval_95 of the ratio from redrawn blocks of a
    second. explained: share of the variance that plain and extended model explain there. held_out: how it was held out.
    residuals: (n, 2) [rad], plain and extended."""

    before: float
    after: float
    interval: tuple[float, float]
    explained: tuple[float, float]
    held_out: str
    residuals: Array

    @property
    def ratio(self) -> float:
        """How many times smaller the residual is."""
        return self.before / self.after

    def as_dict(self) -> dict[str, object]:
        """As in diagnosis.json."""
        return {"rms_before_urad": 1e6 * self.before, "rms_after_urad": 1e6 * self.after, "ratio": self.ratio,
                "interval": list(self.interval), "variance_explained_before": self.explained[0],
                "variance_explained_after": self.explained[1], "held_out": self.held_out}


def model_columns(axis: Axis, hypothesis: Hypothesis, without: int | None = None) -> Array:
    """Columns (n, p) of a hypothesis on another axis object (another record or band): its shapes are found again there."""
    parts = [axis.plain]
    for k, (shape, kept) in enumerate(zip(hypothesis.shapes, hypothesis.kept, strict=True)):
        if k != without:
            parts.append(_again(axis, shape)[:, [shape.free[column] for column in kept]])
    return np.column_stack(parts)


def _again(axis: Axis, shape: Shape) -> Array:
    """The shape's columns (n, P) on this axis, by parameter; those it does not show are zero."""
    columns = np.zeros((len(axis.torque), len(shape.fixed)))
    for group in axis.dictionary:
        for other in group:
            if other.name == shape.name and other.smear == shape.smear and np.array_equal(other.fixed, shape.fixed):
                columns[:, list(other.free)] = other.columns
    return columns


def straight_line(axis: Axis) -> Array:
    """Offsets and compliance (records + 1,) of the plain spring by ordinary least squares: the straight line one would draw."""
    return np.asarray(np.linalg.lstsq(axis.plain, axis.deflection, rcond=None)[0], dtype=float)


def residual_on(fitted: Array, lengths: int, axis: Axis, columns: Array) -> Array:
    """What a fit with `lengths` offsets leaves (n,) on another axis object, the offsets' mean taken for its own."""
    offset = float(np.mean(fitted[:lengths]))
    own = len(axis.lengths)
    return np.asarray(axis.deflection - offset - columns[:, own:] @ fitted[lengths:])


def held_out(
    axis: Axis, hypothesis: Hypothesis, records: list[MotionLog], validate: MotionLog | None
) -> tuple[Gain, tuple[bool, ...]]:
    """The gain of a hypothesis where it was not fitted, and of each of its causes whether it helps there."""
    splits, how = _splits(axis, records, validate)
    plain_left, left, measured = [], [], []
    # Under the band: what is left with all causes, then without each of them.
    models = (None, *range(len(hypothesis.shapes)))
    smooth: list[list[Array]] = [[] for _ in models]
    for train, test in splits:
        raw, low = axis_of(axis.joint, [test], np.inf), axis_of(axis.joint, [test], axis.band)
        offsets = len(train.lengths)
        plain_left.append(residual_on(straight_line(train), offsets, raw, raw.plain))
        measured.append(raw.deflection)
        for without, parts in zip(models, smooth, strict=True):
            fitted = solve(train, model_columns(train, hypothesis, without)).coefficients
            parts.append(residual_on(fitted, offsets, low, model_columns(low, hypothesis, without)))
            if without is None:
                left.append(residual_on(fitted, offsets, raw, model_columns(raw, hypothesis)))
    squares = [float(np.mean(np.concatenate(parts) ** 2)) for parts in smooth]
    helps = tuple(square > squares[0] for square in squares[1:])
    before, after, deflection = np.concatenate(plain_left), np.concatenate(left), np.concatenate(measured)
    total = float(np.sum((deflection - deflection.mean()) ** 2))
    explained = (1 - float(before @ before) / total, 1 - float(after @ after) / total)
    return Gain(rms(before), rms(after), _interval(before, after, max(1, int(BLOCK * axis.rates[0]))), explained, how,
                np.column_stack([before, after])), helps


def _splits(
    axis: Axis, records: list[MotionLog], validate: MotionLog | None
) -> tuple[list[tuple[Axis, MotionLog]], str]:
    """What is fitted and what is predicted with it, and how it was held out in words."""
    if validate is not None:
        return [(axis, validate)], f"validate: {validate.source}"
    having = [record for record in records if axis.joint in record.joints]
    splits = [(axis_of(axis.joint, train, axis.band), test) for record in having
              for train, test in _folds(record, [other for other in having if other is not record])]
    return splits, f"cross-validation by {FOLDS} blocks of time"


def _folds(record: MotionLog, others: list[MotionLog]) -> list[tuple[list[MotionLog], MotionLog]]:
    count = len(record.time)
    edges = np.linspace(0, count, FOLDS + 1).astype(int)
    folds = []
    for k in range(FOLDS):
        ends = ((0, edges[k]), (edges[k + 1], count))
        pieces = [record.cut(start, stop) for start, stop in ends if stop - start > count // 6]
        folds.append((pieces + others, record.cut(edges[k], edges[k + 1])))
    return folds


def _interval(before: Array, after: Array, block: int) -> tuple[float, float]:
    """95 % interval of the ratio of RMS, blocks redrawn."""
    rng = np.random.default_rng(0)
    count = max(2, len(before) // block)
    first = np.array([np.sum(part**2) for part in np.array_split(before, count)])
    second = np.array([np.sum(part**2) for part in np.array_split(after, count)])
    drawn = rng.integers(0, count, (REDRAWN, count))
    low, high = np.quantile(np.sqrt(first[drawn].sum(axis=1) / second[drawn].sum(axis=1)), [0.025, 0.975])
    return float(low), float(high)

"""A set of causes fitted on some records, and what it leaves of another."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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


def model_columns(axis: Axis, one: Hypothesis, without: int | None = None) -> Array:
    """Columns (n, p) of a hypothesis on another axis object (another record or band): its shapes are found again there."""
    parts = [axis.plain]
    for k, (shape, kept) in enumerate(zip(one.shapes, one.kept, strict=True)):
        if k != without:
            parts.append(_again(axis, shape)[:, [shape.free[column] for column in kept]])
    return np.column_stack(parts)


def _again(axis: Axis, shape: Shape) -> Array:
    """The shape's columns (n, P) on this axis, by parameter; those it does not show are zero."""
    found = np.zeros((len(axis.torque), len(shape.fixed)))
    for group in axis.dictionary:
        for other in group:
            if other.name == shape.name and other.smear == shape.smear and np.array_equal(other.fixed, shape.fixed):
                found[:, list(other.free)] = other.columns
    return found


def straight_line(axis: Axis) -> Array:
    """Offsets and compliance (records + 1,) of the plain spring by ordinary least squares: the straight line one would draw."""
    return np.asarray(np.linalg.lstsq(axis.plain, axis.deflection, rcond=None)[0], dtype=float)


def residual_on(fitted: Array, lengths: int, axis: Axis, columns: Array) -> Array:
    """What a fit with `lengths` offsets leaves (n,) on another axis object, the offsets' mean taken for its own."""
    offset = float(np.mean(fitted[:lengths]))
    own = len(axis.lengths)
    return np.asarray(axis.deflection - offset - columns[:, own:] @ fitted[lengths:])


def held_out(
    axis: Axis, one: Hypothesis, records: list[MotionLog], validate: MotionLog | None
) -> tuple[Gain, tuple[bool, ...]]:
    """The gain of a hypothesis where it was not fitted, and of each of its causes whether it helps there."""
    joint = axis.joint
    if validate is not None:
        splits = [(axis, validate)]
        how = f"validate: {validate.source}"
    else:
        having = [record for record in records if joint in record.joints]
        splits = [(axis_of(joint, train, axis.band), test) for record in having
                  for train, test in _folds(record, [other for other in having if other is not record])]
        how = f"cross-validation by {FOLDS} blocks of time"
    plain_left, left, measured = [], [], []
    smooth = [np.zeros(0)] * (len(one.shapes) + 1)
    for train, test in splits:
        raw, low = axis_of(joint, [test], np.inf), axis_of(joint, [test], axis.band)
        offsets = len(train.lengths)
        plain = straight_line(train)
        plain_left.append(residual_on(plain, offsets, raw, raw.plain))
        full = solve(train, model_columns(train, one)).coefficients
        left.append(residual_on(full, offsets, raw, model_columns(raw, one)))
        measured.append(raw.deflection)
        for k in range(len(one.shapes) + 1):
            without = k - 1 if k else None
            answer = solve(train, model_columns(train, one, without)).coefficients
            smooth[k] = np.concatenate([smooth[k], residual_on(answer, offsets, low, model_columns(low, one, without))])
    helps = tuple(float(np.mean(smooth[k] ** 2)) > float(np.mean(smooth[0] ** 2)) for k in range(1, len(smooth)))
    before, after, seen = np.concatenate(plain_left), np.concatenate(left), np.concatenate(measured)
    total = float(np.sum((seen - seen.mean()) ** 2))
    explained = (1 - float(before @ before) / total, 1 - float(after @ after) / total)
    rate = axis.rates[0]
    return Gain(_rms(before), _rms(after), _interval(before, after, max(1, int(BLOCK * rate))), explained, how,
                np.column_stack([before, after])), helps


def _folds(record: MotionLog, others: list[MotionLog]) -> list[tuple[list[MotionLog], MotionLog]]:
    count = len(record.time)
    edges = np.linspace(0, count, FOLDS + 1).astype(int)
    found = []
    for k in range(FOLDS):
        ends = ((0, edges[k]), (edges[k + 1], count))
        pieces = [record.cut(start, stop) for start, stop in ends if stop - start > count // 6]
        found.append((pieces + others, record.cut(edges[k], edges[k + 1])))
    return found


def _interval(before: Array, after: Array, block: int) -> tuple[float, float]:
    """95 % interval of the ratio of RMS, blocks redrawn."""
    rng = np.random.default_rng(0)
    count = max(2, len(before) // block)
    first = np.array([np.sum(part**2) for part in np.array_split(before, count)])
    second = np.array([np.sum(part**2) for part in np.array_split(after, count)])
    drawn = rng.integers(0, count, (REDRAWN, count))
    low, high = np.quantile(np.sqrt(first[drawn].sum(axis=1) / second[drawn].sum(axis=1)), [0.025, 0.975])
    return float(low), float(high)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))

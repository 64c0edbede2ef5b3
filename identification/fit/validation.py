"""The validation rows against what the fit predicts for them, each with its own uncertainty: which of them are outliers?

A row is off by `d^2 = r^T (S + o^2 O + D C D^T)^-1 r` in its sensor and force noise, its visit's re-seating and what is
unknown of the springs, held against the Student distribution that rows follow, family-wise; a whole visit by the test of
visits.py. Where the model is wrong everywhere the median of d^2 is large and no single row stands out: then it is said that the
model does not predict them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.common.arrays import read_only, rms
from identification.common.tails import f_median, f_tail
from identification.fit.bad_visits import ALARM, MOST, SCREENING
from identification.fit.fitted_model import response
from identification.fit.load_test import LoadTest
from identification.fit.mending import BadVisit, with_mends
from identification.fit.noise import noise_model, sensor_sigma
from identification.fit.posterior import Posterior
from identification.fit.visits import VisitTest, score_visits, tails
from identification.measurements import Measurements

Array = NDArray[np.float64]
# Rare on purpose, over all rows: such a row changes a figure, not a fit.
ROW_ALARM = 0.001
# Rows without which the common scale is not known.
COMPANY = 5


@dataclass(frozen=True, eq=False)
class OutlyingRow:
    """One validation row: number in the file from 1, line, off (3,) [m]: measured minus predicted, sigmas: its size in the
    prediction's own uncertainty, offset and noise included."""

    row: int
    line: int
    off: Array
    sigmas: float

    def __post_init__(self) -> None:
        read_only(self.off)


@dataclass(frozen=True, eq=False)
class Validation:
    """rms: of all validation rows, rms_without: of those that are left [m]. rows, visits: the outliers, the worst first; a
    row of an outlying visit is not told by itself. count: of the rows; missed: how many of them are off by more than their own
    uncertainty allows, by themselves or as a visit, which is `expected` [m] RMS over all of them. numbers (m,): of all rows
    that are left out of rms_without."""

    rms: float
    rms_without: float
    rows: tuple[OutlyingRow, ...]
    visits: tuple[BadVisit, ...]
    count: int
    missed: int
    expected: float

    @property
    def fails(self) -> bool:
        """Whether so many rows are missed that it is the model that does not predict them, and no row is told by itself."""
        return self.missed > MOST * self.count and not len(self.numbers)

    @property
    def numbers(self) -> NDArray[np.intp]:
        """Row numbers, from 1, of all outliers."""
        of_visits = [bad.score.rows for bad in self.visits]
        return np.concatenate([np.array([row.row for row in self.rows], dtype=np.intp), *of_visits]).astype(np.intp)


def judge_validation(fitted: Posterior, data: LoadTest, seed: int = 0) -> Validation | None:
    """The validation rows among `data`; None where there are none. Where more than a third would be outliers none is: then
    it is the model that does not predict them."""
    rows = data.rows
    if not rows.validate.any():
        return None
    kept = data.with_rows(rows.select(rows.validate))
    residual = fitted.residual_of(kept)
    outlying, missed, expected = _rows(fitted, kept, residual)
    single = _single(kept.rows, np.array([row.row for row in outlying], dtype=np.intp))
    visits = _visits(fitted, data.with_rows(rows.select(~np.isin(rows.row, single))), seed)
    in_visits = np.isin(kept.rows.row, np.concatenate([np.empty(0, dtype=np.intp), *(bad.score.rows for bad in visits)]))
    out = in_visits | np.isin(kept.rows.row, [row.row for row in outlying])
    count = int(np.sum(missed | in_visits))
    if out.sum() > MOST * len(out):
        return Validation(rms(residual), rms(residual), (), (), len(out), count, expected)
    alone = tuple(row for row in outlying if row.row not in kept.rows.row[in_visits])
    return Validation(rms(residual), rms(residual[~out]), alone, visits, len(out), count, expected)


def _single(rows: Measurements, outlying: NDArray[np.intp]) -> NDArray[np.intp]:
    """The outlying rows, by number, whose visit has more that are none."""
    out = np.isin(rows.row, outlying)
    visit = np.unique(rows.visit, return_inverse=True)[1]
    share = np.bincount(visit, out) / np.bincount(visit)
    return np.asarray(rows.row[out & (share[visit] < 0.5)])


def _visits(fitted: Posterior, data: LoadTest, seed: int) -> tuple[BadVisit, ...]:
    """Visits of validation rows that the fit does not predict, though it does the others."""
    rows = data.rows
    used = np.isin(rows.row, fitted.data.rows.row) | rows.validate
    data = data.with_rows(rows.select(used))
    test = score_visits(fitted, data, np.random.default_rng([seed, 1731]), SCREENING)
    held = set(rows.row[rows.validate].tolist())
    bad = sorted((score for score in test.scores if score.p_value <= ALARM and set(score.rows.tolist()) <= held),
                 key=lambda score: -score.surprise)
    return with_mends(VisitTest(test.scores, test.p_value, test.resolution, tuple(bad), scale=test.scale), fitted, data.rows)


def _rows(fitted: Posterior, kept: LoadTest, residual: Array) -> tuple[tuple[OutlyingRow, ...], NDArray[np.bool_], float]:
    """Single rows that are off by more than their prediction's uncertainty allows and than the others are, the worst first;
    which (n,) are off by more than it allows, whatever the others are; and how far off that expects them to be [m] RMS."""
    noise = noise_model(kept, fitted.compliance)
    precision = noise.of_rows_alone(fitted.components)
    design = noise.whitening @ response(kept, fitted.map, fitted.terms)[1]
    seat = noise.whitening * (fitted.components.offset * noise.offset)
    allowed = seat @ np.swapaxes(seat, 1, 2) + design @ fitted.laplace @ np.swapaxes(design, 1, 2)
    measured = noise.measured
    allowed += np.linalg.inv(precision + np.where(measured, 0.0, 1.0)[:, :, None] * np.eye(3))
    off = np.einsum("nij,nj->ni", noise.whitening, np.nan_to_num(residual))
    squared = np.einsum("ni,ni->n", off, np.linalg.solve(allowed, off[:, :, None])[:, :, 0])
    count = np.maximum(measured.sum(axis=1), 1)
    degrees = tails(fitted.components.degrees, len(fitted.data.rows))
    scale = max(1.0, float(np.median(squared / (count * f_median(count, degrees))))) if len(squared) >= COMPANY else 1.0
    p_values, alone = (len(squared) * f_tail(squared / (wide * count), count, degrees) for wide in (scale, 1.0))
    std = sensor_sigma(kept) * np.sqrt(np.diagonal(allowed, axis1=1, axis2=2))
    outlying = tuple(
        OutlyingRow(int(kept.rows.row[k]), int(kept.rows.line[k]), residual[k], float(np.sqrt(squared[k] / scale)))
        for k in np.argsort(p_values, kind="stable") if p_values[k] <= ROW_ALARM)
    return outlying, alone <= ROW_ALARM, rms(np.where(measured, std, np.nan))

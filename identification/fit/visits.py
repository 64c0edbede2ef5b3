"""Do the readings of every pose visit fit the springs that fit the others? One family-wise test over the visits.

Robust weights and the re-seating size take up what is wrong at a whole pose, so that no row stands out by itself. Here each
visit's own response (own_response.py) is held against what the other visits predict for it:

    z = (g - M x)^T (C_g + M C_x M^T + f^2 G G^T + L L^T)^-1 (g - M x) / s

g, C_g: the visit's own response and its covariance; x, C_x: step and covariance of the fit without the visit, M: the response
to a step; f: a force error that all readings of a visit share; L: a share of what the named causes do there, whose real laws
are none of the dictionary's exactly. s is the median of z over the visits, each in units of its
chi-squared's median, and 1 at least: what is wrong everywhere makes no single visit stand out. The largest z gets its
probability from replicates under the noise of the fit, which in the end is a fit without the visits in question
(bad_visits.py).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.common.tails import chi2_above, chi2_surprise
from identification.fit.discrepancy import discrepancies
from identification.fit.fitted_model import WIDE, response
from identification.fit.load_test import LoadTest
from identification.fit.noise import NoiseModel, noise_model
from identification.fit.noise_parts import MEMORY, SETUP
from identification.fit.own_response import LoadColumns, own_response
from identification.fit.posterior import Posterior
from identification.fit.sag import sag_columns
from identification.measurements import Measurements
from identification.model.compliance import compliance_matrix
from identification.model.law_of import LawOf

Array = NDArray[np.float64]
# A force error that all readings of a visit share, in shares of the load: half a per cent, as of the single readings.
SHARED_FORCE = 0.005
# So much of what a named cause of the robot does at a pose its real law may do otherwise there, 1 sigma.
LAW = 0.3
BATCH = 20
# Above so many rows the replicates are left to the chi-squared: the noise is well known there.
MANY_ROWS = 6000
# Tails that replicates have at least: rows do not tell tails well, few of them not at all.
TAILS, FEW_ROWS, TAILS_OF_FEW = 20.0, 100, 6.0
LIGHT = 0.3


@dataclass(frozen=True, eq=False)
class WrongAngle:
    """Visit (its number in the rows), joint (1 to 6), the angle [rad] that is missing in the table with its standard deviation,
    and ln of how much likelier that is than the table."""

    visit: int
    joint: int
    missing: float
    std: float
    log_odds: float

    def as_dict(self) -> dict[str, Any]:
        """JSON values."""
        return {"joint": self.joint, "missing_deg": float(np.degrees(self.missing)), "std_deg": float(np.degrees(self.std)),
                "log_odds": self.log_odds}


@dataclass(frozen=True, eq=False)
class VisitScore:
    """How one visit fits the others. name: the pose's label or its first line; rows (n,): numbers in the file, from 1; line: of
    the first row; light: how many of them count under a third of an ordinary one. surprise: -log10 of the probability of its
    z alone; p_value: family-wise; wrong_angle: one of its angles that differs from the table's, where that is far likelier than
    the table (wrong_angle.py). share: of the whole misfit. offset (3,) [m]: of its readings from the model, its response
    free, with offset_std (3,) [m], what the re-seating that was estimated allows; NaN where it cannot be told apart."""

    name: str
    rows: NDArray[np.intp]
    line: int
    light: int
    surprise: float
    p_value: float
    share: float
    offset: Array
    offset_std: Array
    wrong_angle: WrongAngle | None = None

    @property
    def offset_sigmas(self) -> float:
        """The largest component of the offset in its own standard deviations; NaN where it cannot be told."""
        return float(np.max(np.abs(self.offset) / self.offset_std))

    def as_dict(self) -> dict[str, Any]:
        """JSON values."""
        sigmas = self.offset_sigmas
        return {"pose": self.name, "rows": self.rows.tolist(), "line": self.line, "light_rows": self.light,
                "surprise": self.surprise, "p_value": self.p_value, "share_of_misfit": self.share,
                "wrong_angle": None if self.wrong_angle is None else self.wrong_angle.as_dict(),
                "offset_um": None if np.isnan(sigmas) else (1e6 * self.offset).tolist(),
                "offset_sigmas": None if np.isnan(sigmas) else sigmas}


@dataclass(frozen=True, eq=False)
class VisitTest:
    """The visits (V,) that were looked at, in their order, and the family-wise probability of the largest surprise; resolution:
    the smallest it can be. bad: those that do not fit the others, the worst first. too_many: more than a third of the visits
    would be bad, so none is. rest: the fit without the bad ones, None where there are none. scale: s of z (module)."""

    scores: tuple[VisitScore, ...]
    p_value: float
    resolution: float
    bad: tuple[VisitScore, ...] = ()
    too_many: bool = False
    rest: Posterior | None = None
    scale: float = 1.0


def score_visits(fitted: Posterior, data: LoadTest, rng: np.random.Generator, replicates: int) -> VisitTest:
    """How each visit of these rows, fitted or not, fits the fitted ones; one that was fitted is predicted without itself."""
    rows, cell = data.rows, data.cell
    was_fitted = np.isin(rows.row, fitted.data.rows.row)
    # The rows of a visit that were kept for validation are one of their own.
    apart = np.unique(2 * rows.visit + was_fitted, return_inverse=True)[1].astype(np.intp)
    further = [part for part in (SETUP, MEMORY) if fitted.at_map.noise.active[part]]
    noise = noise_model(data.with_rows(replace(rows, visit=apart)), fitted.compliance).with_parts(
        *further, set_up=fitted.components.set_up)
    shared_force = max(SHARED_FORCE, fitted.components.setup_relative)
    row_weight = np.ones(len(rows))
    row_weight[was_fitted] = _matched(fitted, rows.row[was_fitted])
    position, slope = response(data, fitted.map, fitted.terms)
    residual = np.einsum("nij,nj->ni", noise.whitening, np.nan_to_num(rows.deflection) - position)[:, :, None]
    count = 0 if len(rows) > MANY_ROWS else replicates
    stiff = compliance_matrix(cell.robot, rows.theta, cell.flange_from_tcp, fitted.compliance)[:, :3, :3]
    drawn = _drawn(noise, fitted, rng, count)
    if not noise.active[SETUP]:
        drawn += noise.whitening @ _shared(stiff, rows.wrench[:, :3], noise, rng, count)
    residual = np.concatenate([residual, drawn], axis=2)
    sag = sag_columns(data.load_state(fitted.compliance), noise)
    design = np.concatenate([noise.whitening @ slope, sag], axis=2)
    otherwise = noise.whitening @ _otherwise(fitted, data)
    others = _Others(fitted, noise, row_weight, was_fitted, design, residual)
    precision = noise.of_rows_alone(fitted.components)
    seat = np.maximum(fitted.components.offset * noise.offset, 1e-9)
    misfit = noise.by_visit(np.sum(residual[:, :, 0] ** 2, axis=1))
    found, squares, counts = [], [], []
    for number in range(noise.visits):
        mine = np.flatnonzero(noise.visit == number)
        if not testable(rows, mine):
            continue
        loads = LoadColumns.of(rows.wrench[mine, :3])
        k = loads.columns.shape[2]
        columns = noise.whitening[mine] @ np.concatenate([loads.columns, np.tile(np.eye(3), (len(mine), 1, 1))], axis=2)
        free = loads.has_offset
        prior = np.concatenate([np.zeros(k), np.zeros(3) if free else 1 / seat**2])
        own = own_response(columns, precision[mine], prior, residual[mine])
        weighted = precision[mine] @ columns * own.row_weight[0][:, None, None]
        by_step = own.covariance[0] @ np.einsum("nip,niq->pq", weighted, design[mine])
        step, spread = others.without(number)
        off = own.coefficients[:, :k] - step.T @ by_step[:k].T
        shared = np.kron(np.diag((shared_force * loads.scale) ** 2), stiff[mine[0]] @ stiff[mine[0]].T)
        by_law = own.covariance[0] @ np.einsum("nip,niq->pq", weighted, otherwise[mine])
        allowed = own.covariance[:, :k, :k] + by_step[:k] @ spread @ by_step[:k].T + shared + by_law[:k] @ by_law[:k].T
        squares.append(np.einsum("bp,bp->b", off, np.linalg.solve(allowed, off[:, :, None])[:, :, 0]))
        counts.append(_directions(columns[:, :, :k], precision[mine]))
        offset = own.coefficients[0, k:] if free else np.full(3, np.nan)
        found.append(VisitScore(
            visit_name(rows, mine), rows.row[mine], int(rows.line[mine[0]]), int(np.sum(row_weight[mine] < LIGHT)), 0.0, 1.0,
            float(misfit[number] / max(misfit.sum(), 1e-300)), offset,
            np.sqrt(seat**2 + np.diag(own.covariance[0])[k:])))
    return _judged(found, np.array(squares), np.array(counts), count)


def _otherwise(fitted: Posterior, data: LoadTest) -> Array:
    """What the named causes of the robot may do otherwise in these rows (n, 3, m) [m], 1 sigma at each pose by itself: more or
    less of it, and as their laws of other shapes, also where their own does nothing."""
    state = data.load_state(fitted.compliance)
    of_robot = tuple(replace(term, start=values) for term, values in zip(fitted.terms, fitted.term_values, strict=True)
                     if term.effect.of_robot)
    more = [LAW * term.contribution(state, term.start)[:, :3, None] for term in of_robot]
    others = [WIDE * free.scale * free.effect.columns(state, free.joint, free.start)[:, :3]
              for free in discrepancies(state, of_robot) if isinstance(free.effect, LawOf)]
    begun = [term.effect.of_each_visit(state, term.joint, term.start)[:, :3] for term in of_robot if term.effect.by_visit]
    return np.concatenate([np.zeros((len(data.rows), 3, 0)), *more, *others, *begun], axis=2)


def visit_name(rows: Measurements, mine: NDArray[np.intp]) -> str:
    """The label of a visit's pose, or where its first row stands."""
    label = str(rows.pose[mine[0]])
    return label or f"the pose from line {rows.line[mine[0]]}"


def testable(rows: Measurements, mine: NDArray[np.intp]) -> bool:
    """Whether these rows are one pose under load, and no stretch of a machined pass."""
    still = bool(np.all(rows.theta[mine] == rows.theta[mine[0]])) and rows.machined_pass[mine[0]] == ""
    return still and bool(np.any(rows.wrench[mine, :3] != 0))


class _Others:
    """The fit without one visit, linearised: for the data and each replicate."""

    def __init__(self, fitted: Posterior, noise: NoiseModel, row_weight: Array, inside: NDArray[np.bool_], design: Array,
                 residual: Array) -> None:
        weighted = noise.weights(fitted.components, row_weight).apply(design)
        self._information = noise.products(weighted, design)
        self._pull = noise.products(weighted, residual)
        self._fitted = noise.by_visit(inside.astype(float)) > 0
        self._total = self._information[self._fitted].sum(axis=0)
        parameters = len(fitted.map)
        self._total[:parameters, :parameters] += fitted.prior.precision(fitted.map)
        # What the robot's own weight may do, in usual sizes.
        self._total[parameters:, parameters:] += np.eye(len(self._total) - parameters)
        self._pulled = self._pull[self._fitted].sum(axis=0)
        self._pulled[:parameters, 0] -= fitted.prior.gradient(fitted.map)

    def without(self, number: int) -> tuple[Array, Array]:
        """Step (q, B) and its covariance (q, q) of the fit without visit `number`."""
        mine = float(self._fitted[number])
        spread = np.asarray(np.linalg.inv(self._total - mine * self._information[number]), dtype=float)
        return spread @ (self._pulled - mine * self._pull[number]), spread


def _matched(fitted: Posterior, numbers: NDArray[np.intp]) -> Array:
    """The fitted rows' weights for these row numbers."""
    order = np.argsort(fitted.data.rows.row)
    return np.asarray(fitted.row_weight[order[np.searchsorted(fitted.data.rows.row[order], numbers)]])


def tails(degrees: float, rows: int) -> float:
    """Degrees of freedom that so many rows of estimated ones are judged with."""
    return min(degrees, TAILS if rows >= FEW_ROWS else TAILS_OF_FEW)


def _drawn(noise: NoiseModel, fitted: Posterior, rng: np.random.Generator, count: int) -> Array:
    """Noise (n, 3, count), whitened: Student, with variance components drawn from their own posterior."""
    components, n = fitted.components, len(noise.visit)
    degrees = tails(components.degrees, n)
    parts = [np.empty((n, 3, 0))]
    for start in range(0, count, BATCH):
        some = min(BATCH, count - start)
        logs = rng.multivariate_normal(components.logs, fitted.components_covariance, method="eigh")
        drawn = components.with_logs(np.clip(logs, components.logs - 2.5, components.logs + 1.5))
        heavier = rng.chisquare(degrees, (n, some)) / degrees
        parts.append(noise.draw(np.repeat(drawn.values[None], some, axis=0), heavier, rng))
    return np.concatenate(parts, axis=2)


def _shared(stiff: Array, force: Array, noise: NoiseModel, rng: np.random.Generator, count: int) -> Array:
    """What a force error that all readings of a visit share does (n, 3, count) [m]; stiff (n, 3, 3) [m/N]: G."""
    error = SHARED_FORCE * rng.standard_normal((noise.visits, 3, 3, count))
    return np.asarray(np.einsum("nij,njkb,nk->nib", stiff, error[noise.visit], force, optimize=True))


def _directions(columns: Array, precision: Array) -> int:
    """How many directions of a response the readings tell."""
    square = np.einsum("nip,nij,njq->pq", columns, precision, columns)
    return int(np.linalg.matrix_rank(square, tol=1e-6 * max(float(np.diag(square).max()), 1e-300)))


def _judged(found: list[VisitScore], squares: Array, counts: NDArray[np.int_], replicates: int) -> VisitTest:
    """The test from z (V, 1 + replicates), the data's first, of as many directions (V,)."""
    if not found:
        return VisitTest((), 1.0, 1.0)
    scale = np.maximum(np.median(squares / chi2_above(0.5, counts)[:, None], axis=0), 1.0)
    surprise = chi2_surprise(squares / scale, counts[:, None])
    largest = np.sort(surprise[:, 1:].max(axis=0))
    if replicates:
        p_values = (1 + replicates - np.searchsorted(largest, surprise[:, 0])) / (replicates + 1)
    else:
        p_values = np.minimum(1.0, len(found) * 10.0 ** -surprise[:, 0])
    scores = tuple(replace(score, surprise=float(own), p_value=float(p))
                   for score, own, p in zip(found, surprise[:, 0], p_values, strict=True))
    return VisitTest(scores, float(p_values.min()), 1 / (replicates + 1) if replicates else 0.0, scale=float(scale[0]))

"""What would mend a visit that does not fit the others: one slip in its angles, loads or readings, held against its response.

Slips that people make (slips.py) are tried, kind by kind, and each angle off by any amount. Each gives the response `G F` of
the springs that the other visits found, at the pose that the table should then have; its probability is that of its misfit
among all slips and "none of these", each kind as likely as another beforehand. None of these: the response is off by a part of
itself in any way.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.common.quantities import two_sigma
from identification.common.tails import chi2_tail
from identification.fit.fitted_model import response
from identification.fit.noise import noise_model
from identification.fit.own_response import LoadColumns, OwnResponse, own_response
from identification.fit.posterior import Posterior
from identification.fit.slips import FROM_ANOTHER, Slip, slips_of, written
from identification.fit.visits import SHARED_FORCE, VisitScore, VisitTest, visit_name
from identification.measurements import Measurements
from identification.model.effects_in_force import SPRINGS
from identification.model.kinematics import jacobian

Array = NDArray[np.float64]
# At most so many are kept, each with this probability at least, and a misfit that chance makes so often.
MOST, WORTH_KEEPING, FITS = 3, 0.05, 1e-3
# In words only those of this probability.
WORTH_TELLING = 0.25
# Angles taken from a visit that is right itself, or off by no slip of the pen, are so many times rarer than another slip.
ANY_ANGLE = "angle"
RARER = {FROM_ANOTHER: 10.0, ANY_ANGLE: 3.0}
# How far an angle may be off [deg], 1 sigma, and in what steps that is tried.
OFF_DEG, MOST_OFF_DEG, STEP_DEG = 8.0, 20.0, 0.05
# A slip that moves an axis less changes nothing that could be seen.
LEAST_DEG = 0.5
# Off by one of these parts of itself is a response that none of the slips explains: little as by what sticks or drags, or much.
ANYTHING = (0.03, 0.1, 0.5)
# What the robot's own weight may make of a response where the robot file has no links: the angles are off by some mrad.
OWN_WEIGHT = 0.03


@dataclass(frozen=True)
class Mend:
    """A change of the table with which the visit would fit, in words, and its probability among all that were tried and none
    of them."""

    kind: str
    what: str
    probability: float

    def as_dict(self) -> dict[str, Any]:
        """JSON values."""
        return {"kind": self.kind, "what": self.what, "probability": self.probability}


@dataclass(frozen=True, eq=False)
class BadVisit:
    """A visit that does not fit the others; mends: what would mend it, the likeliest first; copied: another visit whose angles
    are the very same, "" where there is none."""

    score: VisitScore
    mends: tuple[Mend, ...]
    copied: str = ""

    def as_dict(self) -> dict[str, Any]:
        """JSON values."""
        return self.score.as_dict() | {"mends": [mend.as_dict() for mend in self.mends], "same_angles_as": self.copied or None}


def with_mends(test: VisitTest, rest: Posterior, rows: Measurements) -> tuple[BadVisit, ...]:
    """The bad visits of a test with what would mend them; rows: with all visits; rest: the fit of those that are not bad."""
    names = frozenset(score.name for score in test.bad)
    return tuple(BadVisit(score, mends(rest, rows, score, test.scale, names), _copied(rows, score)) for score in test.bad)


def _copied(rows: Measurements, score: VisitScore) -> str:
    """The first visit of another name with the same angles."""
    mine = np.isin(rows.row, score.rows)
    for row in np.flatnonzero(~mine & np.all(rows.theta == rows.theta[mine][0], axis=1)):
        name = visit_name(rows, np.array([row]))
        if name != score.name:
            return name
    return ""


def mends(rest: Posterior, rows: Measurements, score: VisitScore, scale: float, bad: frozenset[str]) -> tuple[Mend, ...]:
    """The likeliest slips that explain a visit which `rest`, the fit of the other visits, does not; rows: with all visits;
    scale: of the test's z; bad: names of all bad visits. None where none does."""
    mine = np.isin(rows.row, score.rows)
    visit = _Visit(rest, rows.select(mine), scale)
    slips = [slip for slip in slips_of(rows, mine, bad, visit.expected) if _new(rest, rows.theta[mine][0], slip)]
    log_weight, fits = visit.judged(slips)
    angles = visit.angles_off()
    slips += [slip for slip, _, _ in angles]
    log_weight = np.append(log_weight, [weight for _, weight, _ in angles])
    fits = np.append(fits, [fit for _, _, fit in angles])
    number = {kind: sum(slip.kind == kind for slip in slips) for kind in {slip.kind for slip in slips}}
    log_weight -= np.log([number[slip.kind] * RARER.get(slip.kind, 1.0) for slip in slips])
    every = np.append(log_weight, visit.anything())
    probability = np.exp(every - every.max())
    probability /= probability.sum()
    told = [k for k in np.argsort(-probability[:-1])[:MOST]
            if probability[k] >= WORTH_KEEPING and chi2_tail(fits[k], visit.directions) >= FITS]
    return tuple(Mend(slips[k].kind, slips[k].what, float(probability[k])) for k in told)


class _Visit:
    """One visit's own response, measured, against that of the springs at some pose."""

    def __init__(self, rest: Posterior, rows: Measurements, scale: float) -> None:
        self._rest, self._rows, self._scale = rest, rows, scale
        data = rest.data.with_rows(rows)
        self._noise = noise_model(data, rest.compliance)
        self._precision = self._noise.of_rows_alone(rest.components)
        self._seat = np.maximum(rest.components.offset * self._noise.offset, 1e-9)
        self._position = response(data, rest.map, rest.terms)[0]
        self._spread = rest.laplace[SPRINGS, SPRINGS]
        self._shared = SHARED_FORCE if rest.data.cell.robot.link_mass is not None else OWN_WEIGHT
        self._loads, self._own = self._response(rows.wrench[:, :3], np.nan_to_num(rows.deflection))
        # What the finite model and its effects have beyond G F at the pose of the table, taken to be the same elsewhere.
        first_order = np.einsum("ij,nj->ni", self._compliance(rows.theta[:1])[0].sum(axis=0), rows.wrench[:, :3])
        _, beyond = self._response(rows.wrench[:, :3], self._position - first_order)
        self._beyond = beyond.coefficients[0, : self._loads.columns.shape[2]]

    @property
    def expected(self) -> Array:
        """The readings (n, 3) [m] that the other visits let expect."""
        return self._position

    @property
    def directions(self) -> int:
        """How many numbers the response has."""
        return int(self._loads.columns.shape[2])

    def judged(self, slips: list[Slip]) -> tuple[Array, Array]:
        """ln likelihood of the visit with each slip mended, and its misfit as a chi-squared."""
        value, misfit = np.empty(len(slips)), np.empty(len(slips))
        as_they_are = np.array([not slip.in_rows for slip in slips])
        theta = np.array([slip.theta for slip in slips])
        value[as_they_are], misfit[as_they_are] = self._against(theta[as_they_are], self._loads, self._own, self._shared)
        for k in np.flatnonzero(~as_they_are):
            slip, rows = slips[k], self._rows
            loads, own = self._response(rows.wrench[:, :3] if slip.force is None else slip.force, np.nan_to_num(
                rows.deflection if slip.readings is None else slip.readings))
            if loads.columns.shape != self._loads.columns.shape:
                # Loads in fewer or more directions than the table's tell another response.
                value[k], misfit[k] = -np.inf, np.inf
                continue
            one, off = self._against(theta[k: k + 1], loads, own, self._shared)
            value[k], misfit[k] = one[0] - 0.5 * (own.left[0] - self._own.left[0]) / self._scale, off[0]
        return value, misfit

    def angles_off(self) -> list[tuple[Slip, float, float]]:
        """Each angle off by any amount, integrated over what it may be: with ln likelihood, and the best fit's misfit as a
        chi-squared."""
        off = np.arange(-MOST_OFF_DEG, MOST_OFF_DEG + STEP_DEG / 2, STEP_DEG)
        prior = -0.5 * (off / OFF_DEG) ** 2
        prior -= np.logaddexp.reduce(prior)
        theta, found = self._rows.theta[0], []
        for axis in range(6):
            moved = theta + np.radians(off)[:, None] * np.eye(6)[axis]
            value, misfit = self._against(moved, self._loads, self._own, self._shared)
            total = float(np.logaddexp.reduce(value + prior))
            share = np.exp(value + prior - total)
            mean = float(share @ off)
            sigma = np.sqrt(share @ (off - mean) ** 2 + STEP_DEG**2 / 12)
            stood = float(np.degrees(theta[axis]))
            words = (f"axis {axis + 1} is {written(stood)} in the table; {stood + mean:.2f} +- {two_sigma(sigma):.2f} would "
                     "fit")
            slip = Slip(ANY_ANGLE, words, theta + np.radians(mean) * np.eye(6)[axis])
            found.append((slip, total, float(misfit.min())))
        return found

    def anything(self) -> float:
        """ln likelihood of a response off in any way."""
        each = [self._against(self._rows.theta[:1], self._loads, self._own, part)[0][0] for part in ANYTHING]
        return float(np.logaddexp.reduce(each) - np.log(len(each)))

    def _against(self, theta: Array, loads: LoadColumns, own: OwnResponse, shared: float) -> tuple[Array, Array]:
        """ln likelihood (m,) and squared distance (m,) of the measured response from the springs' at poses theta (m, 6), with a
        force error of this share."""
        parts = self._compliance(theta)                                                       # (m, 6, 3, 3)
        whole = parts.sum(axis=1)
        by_springs, expected = loads.coefficients(parts), loads.coefficients(whole)            # (m, 6, k), (m, k)
        k = expected.shape[1]
        allowed = own.covariance[0, :k, :k] + np.einsum("mak,ab,mbl->mkl", by_springs, self._spread, by_springs)
        block = np.diag((shared * loads.scale) ** 2)
        square = whole @ np.swapaxes(whole, 1, 2)
        allowed += np.einsum("rs,mij->mrisj", block, square).reshape(len(theta), k, k)
        allowed *= self._scale
        off = own.coefficients[0, :k] - self._beyond - expected
        distance = np.einsum("mk,mk->m", off, np.linalg.solve(allowed, off[:, :, None])[:, :, 0])
        return -0.5 * (distance + np.linalg.slogdet(allowed)[1]), distance

    def _compliance(self, theta: Array) -> Array:
        """Each spring's share (m, 6, 3, 3) [m/N] of the Cartesian compliance at poses theta (m, 6)."""
        cell = self._rest.data.cell
        columns = jacobian(cell.robot, theta, cell.flange_from_tcp)[:, :3]
        return np.asarray(np.einsum("mia,a,mja->maij", columns, self._rest.compliance, columns))

    def _response(self, force: Array, readings: Array) -> tuple[LoadColumns, OwnResponse]:
        """The own response of readings (n, 3) [m] to these forces."""
        loads, whitening = LoadColumns.of(force), self._noise.whitening
        columns = whitening @ np.concatenate([loads.columns, np.tile(np.eye(3), (len(force), 1, 1))], axis=2)
        prior = np.concatenate([np.zeros(loads.columns.shape[2]), np.zeros(3) if loads.has_offset else 1 / self._seat**2])
        whitened = np.einsum("nij,nj->ni", whitening, readings)[:, :, None]
        return loads, own_response(columns, self._precision, prior, whitened)


def _new(rest: Posterior, theta: Array, slip: Slip) -> bool:
    """Whether a slip changes something, to a pose the robot can take."""
    inside = bool(np.all(rest.data.cell.robot.limit_excess(slip.theta[None]) <= 0))
    moved = bool(np.max(np.abs(slip.theta - theta)) >= np.radians(LEAST_DEG))
    return inside and (moved or slip.in_rows)

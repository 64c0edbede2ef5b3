"""For one alignment of a log with the program: the linear regression of the force on what the program says of it.

The force is a constant (the sensor's bias); on moves that cut, behind an air lead-in and before an air lead-out of unknown
lengths, it is besides another constant plus a linear function of the direction of travel, for each kind of cut by itself.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from compensator.forces.program_time import ProgramTime
from identification.common.arrays import Array

# Lead-in and lead-out are taken to be alike to this share of their sum (1 sigma), and at least this length [m].
LEAD_SHARE, LEAD_LEAST = 0.1, 1e-3
# Samples within this share of a bin's width before its edge are on it: evenly taken ones often are, and on which side is not
# for the rounding of the clock's numbers to say.
ON_EDGE = 1e-6


@dataclass(frozen=True, eq=False)
class Bins:
    """A log in even bins of time: middle (n,) [s], mean force (n, 3) [N], weight (n,) 1 or, for an empty bin, 0; width [s]."""

    time: Array
    force: Array
    weight: Array
    width: float

    @cached_property
    def centred(self) -> Array:
        """The force (n, 3) [N] without its mean, 0 in an empty bin."""
        return np.asarray((self.force - np.average(self.force, axis=0, weights=self.weight)) * self.weight[:, None])


def binned(time: Array, force: Array, width: float) -> Bins:
    """Samples at times (M,) [s], ascending, with force (M, 3) [N], in bins."""
    number = ((time - time[0]) / width + ON_EDGE).astype(np.intp)
    count = np.bincount(number)
    mean = np.column_stack([np.bincount(number, column) for column in force.T]) / np.maximum(count, 1)[:, None]
    return Bins(time[0] + (np.arange(len(count)) + 0.5) * width, mean, (count > 0).astype(float), width)


def plateau_share(bins: Bins) -> float:
    """Share of the force's variance that the best single plateau explains: one constant force from one bin to another, and
    another constant before and after."""
    def until(values: Array) -> Array:
        return np.concatenate([np.zeros_like(values[:1]), np.cumsum(values, axis=0)])

    total, weight = until(bins.centred), until(bins.weight)
    explained = 0.0
    for first in range(len(bins.time)):
        inside = weight[first + 1:] - weight[first]
        outside = weight[-1] - inside
        force = total[first + 1:] - total[first]
        share = np.sum(force**2, axis=1) * weight[-1] / np.maximum(inside * outside, 0.5)
        explained = max(explained, float(np.max(share, initial=0.0, where=(inside > 0) & (outside > 0))))
    return explained / max(float(np.sum(bins.centred**2)), 1e-300)


@dataclass(frozen=True, eq=False)
class Fit:
    """Coefficients (1 + 4 kinds of cut, 3) and residual (n, 3) [N] of one alignment."""

    coefficients: Array
    residual: Array


@dataclass(frozen=True, eq=False)
class Seen:
    """What the bins see of the program: engagement (n, 4) of ProgramTime, and the kind (n,) of the move."""

    engagement: Array
    kind: NDArray[np.int8]


class Regression:
    """The regression on fine bins. An alignment x (4,): planned time at the log's middle [s], ln override, lead-in, lead-out
    [m]; slip (n,) [s] is added to the planned time of each bin."""

    def __init__(self, program: ProgramTime, bins: Bins, middle: float) -> None:
        kept = bins.weight > 0
        self.program, self.bins, self.time, self.middle = program, bins, bins.time[kept], middle
        self.force = bins.force[kept] - bins.force[kept].mean(axis=0)
        self.energy = float(np.sum(self.force**2))
        self._columns = 1 + 4 * (int(program.kind.max()) + 1)

    def planned(self, x: Array) -> Array:
        """Planned time (n,) [s] of each bin without slip."""
        return np.asarray(x[0] + np.exp(x[1]) * (self.time - self.middle))

    def seen(self, x: Array, slip: Array | float = 0.0) -> Seen:
        """What each bin sees of the program."""
        engagement, move = self.program.engagement(self.planned(x) + slip, float(x[2]), float(x[3]))
        return Seen(engagement, self.program.kind.take(move).astype(np.int8))

    def design(self, x: Array, slip: Array | float = 0.0) -> Array:
        """What the force (n, 3) is regressed on (n, 1 + 4 kinds)."""
        seen = self.seen(x, slip)
        row = np.arange(len(seen.kind))
        design = np.zeros((len(row), self._columns))
        design[:, 0] = 1.0
        design[:, 1:].reshape(len(row), -1, 4)[row, seen.kind] = seen.engagement
        return design

    def left(self, seen: Seen, coefficients: Array) -> Array:
        """The force (n, 3) [N] less what these coefficients (1 + 4 kinds, 3) make of the program."""
        of_kind = coefficients[1:].reshape(-1, 4, 3).take(seen.kind, axis=0)
        return np.asarray(self.force - coefficients[0] - np.einsum("nj,njc->nc", seen.engagement, of_kind))

    def fit(self, x: Array, slip: Array | float = 0.0) -> Fit:
        """Least squares, with a ridge where the log sees no cut of some kind."""
        design = self.design(x, slip)
        gram = design.T @ design + 1e-6 * len(design) * np.eye(design.shape[1])
        coefficients = np.linalg.solve(gram, design.T @ self.force)
        return Fit(coefficients, self.force - design @ coefficients)

    def force_in_air(self, x: Array, slip: Array) -> float:
        """RMS force on the program's air moves over that on its cuts, the sensor's bias taken off; NaN where the log has none
        of either."""
        planned = self.planned(x) + slip
        inside = (planned >= self.program.time[0]) & (planned <= self.program.time[-1])
        engagement, move = self.program.engagement(planned, float(x[2]), float(x[3]))
        square = np.sum((self.force - self.fit(x, slip).coefficients[0]) ** 2, axis=1)
        air, cut = square[inside & self.program.air[move]], square[inside & (engagement[:, 0] > 0)]
        return float(np.sqrt(air.mean() / max(cut.mean(), 1e-300))) if len(air) and len(cut) else float("nan")

    def value(self, x: Array, slip: Array | float = 0.0, independent: float = 100.0) -> float:
        """Minus the log likelihood over `independent`, with the prior that lead-in and lead-out are alike."""
        spread = LEAD_SHARE * max(float(x[2] + x[3]), 0.0) + LEAD_LEAST
        prior = ((x[2] - x[3]) / spread) ** 2 + np.sum(np.minimum(x[2:] / LEAD_LEAST, 0.0) ** 2)
        return 0.5 * float(np.log(np.sum(self.fit(x, slip).residual ** 2) / self.energy) + prior / independent)

    def refine(self, x: Array, slip: Array | float = 0.0) -> Array:
        """The likeliest alignment near x, lead-in and lead-out included, with this slip (n,) [s] beside it."""
        from scipy.optimize import minimize

        length, period = self.program.length, self.program.period
        typical = np.median([length[b] - length[a] for a, b in self.program.stretches] or [0.0])
        starts = [np.append(x[:2], [lead * typical, lead * typical]) for lead in (0.0, 0.03, 0.1, 0.2, 0.3)]
        best = min((x, *starts), key=lambda start: self.value(start, slip))
        steps = np.array([0.1 * period, 0.1 * period / max(self.time[-1] - self.time[0], 1e-3), 0.05 * typical, 0.05 * typical])
        for _ in range(2):
            simplex = best + np.concatenate([np.zeros((1, 4)), np.diag(steps)])
            best = minimize(self.value, best, (slip,), method="Nelder-Mead",
                            options={"initial_simplex": simplex, "maxfev": 100, "xatol": 1e-6, "fatol": 1e-5}).x
            steps = 0.2 * steps
        return np.asarray(best)

    def covariance(self, x: Array, slip: Array, independent: float) -> Array:
        """Of x (4, 4), from the curvature of the log likelihood by differences about as wide as the answer is uncertain."""
        steps = np.array([0.05, 0.2 / max(self.time[-1] - self.time[0], 1e-3), 1e-3, 1e-3])
        covariance = np.diag(steps**2)
        for _ in range(2):
            hessian = self._hessian(x, steps, slip, independent) * independent
            values, vectors = np.linalg.eigh(hessian * np.outer(steps, steps))
            covariance = (vectors / np.maximum(values, 1e-2)) @ vectors.T * np.outer(steps, steps)
            steps = np.clip(np.sqrt(np.diag(covariance)), 0.3 * steps, 10 * steps)
        return np.asarray(covariance)

    def _hessian(self, x: Array, steps: Array, slip: Array, independent: float) -> Array:
        hessian = np.empty((4, 4))
        for i in range(4):
            for j in range(i, 4):
                a, b = np.zeros(4), np.zeros(4)
                a[i], b[j] = steps[i], steps[j]
                values = [self.value(x + step, slip, independent) for step in (a + b, a - b, b - a, -a - b)]
                hessian[i, j] = hessian[j, i] = (values[0] - values[1] - values[2] + values[3]) / (4 * steps[i] * steps[j])
        return hessian

"""A swinging weight: scatter across the load and in proportion to it, told from every other scatter by its own likelihood.

Within a pose visit the residuals R (m, 3) of its rows are freed of an offset and of whatever goes with the load in the same way
in every row (Q (m, m - 2), orthogonal to 1 and to the load: what a wrong spring, frame or lever does at one pose). What is left
has the covariance

    cov(Q^T R) = s^2 1 x S + a^2 (Q^T L Q) x G G^T + r^2 (Q^T F^2 Q) x G d d^T G^T + alpha^2 (Q^T F^2 Q) x G (1 - d d^T) G^T

with the sensors' stated variances S, the loaded rows L, the loads' sizes F, gravity's direction d and the first-order
compliance G. The likelihood ratio of alpha against none, s free and a and r about what cell.yaml states, is half chi-squared
with one degree of freedom and half nothing where there is no swing.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from identification.common.arrays import Array
from identification.common.tails import chi2_tail
from identification.diagnosis.scatter import Scatter
from identification.fit.load_test import LoadTest
from identification.fit.noise import sensor_sigma
from identification.fit.posterior import Posterior
from identification.model.compliance import compliance_matrix
from identification.model.effects.kinds import hanging, nothing_hangs
from identification.model.effects.swinging_weight import SwingingWeight

EFFECT = SwingingWeight()
# Probability by chance under which scatter is called a swing: rare on purpose, tails heavier than normal raise it.
ALARM = 1e-3
# And that without the visit that speaks most for it: a swing is in every loaded reading, a gross error is not.
WITHOUT_ONE = 0.01
# The force error is known to a factor of two before the rows: 1 sigma of its ln about what is stated.
FORCE_LOG_STD = 0.7
# Force errors where cell.yaml states none: hook and rope that nobody weighed, and the mass on the weight's face.
USUAL_FORCE_N, USUAL_FORCE_RELATIVE = 0.5, 0.005
# Poses that a swing must be seen at.
FEWEST_VISITS = 4
# Sizes are sought from e^-6 times where they start.
SMALLEST_LOG = -6.0


class Swing(Scatter):
    """size [rad]: 1 sigma of the load's direction in each of the two directions across; largest [m]: of the tool's displacement
    under the largest load."""

    effect, code, rows, short = EFFECT, "CS1511", "the rows", "WEIGHTS SWUNG"

    @property
    def sentence(self) -> str:
        """In plain words."""
        return f"{EFFECT.sentence}: readings scatter as side forces of {100 * self.size:.2g} % of the load make them"

    def allowed_for(self, data: LoadTest, fitted: Posterior) -> LoadTest:
        """The same rows with the swing in their own sigmas."""
        across = _across(data, fitted.compliance, fitted.load_state.fall)
        squared = sensor_sigma(data) ** 2 + self.size**2 * np.diagonal(across, axis1=1, axis2=2)
        return data.with_rows(replace(data.rows, sigma=np.sqrt(squared)))


@dataclass(frozen=True, eq=False)
class _Visits:
    """What is left of the residuals of v visits with equally many rows: values (v, p), and the parts of their covariance
    (v, 4, p, p): sensor, absolute, along the load, across it."""

    values: Array
    parts: Array

    def log_likelihood(self, squared: Array) -> Array:
        """Of each visit (v,) for squared sizes (4,), without its constant."""
        root = np.linalg.cholesky(np.einsum("k,vkij->vij", squared, self.parts))
        white = np.linalg.solve(root, self.values[:, :, None])
        return np.asarray(-np.log(np.diagonal(root, axis1=1, axis2=2)).sum(axis=1) - 0.5 * np.sum(white**2, axis=(1, 2)))


@dataclass(frozen=True, eq=False)
class _Sizes:
    """The likelihood of the sizes of the parts as logarithms, those of the force error believed about `start` (4,)."""

    groups: tuple[_Visits, ...]
    start: Array

    def by_visit(self, logs: Array) -> Array:
        """ln likelihood of each visit for the first sizes (k,), the others nothing."""
        squared, start = np.zeros(4), self.start[: len(logs)]
        squared[: len(logs)] = np.exp(2 * np.clip(logs, start + SMALLEST_LOG, start - SMALLEST_LOG))
        return np.concatenate([group.log_likelihood(squared) for group in self.groups])

    def cost(self, logs: Array) -> float:
        """-ln posterior."""
        believed = 0.5 * float(np.sum(((logs[1:3] - self.start[1:3]) / FORCE_LOG_STD) ** 2))
        return believed - float(self.by_visit(logs).sum())

    def least(self, begin: Array) -> tuple[Array, float]:
        """The likeliest sizes, searched from `begin` (k,), and their cost."""
        from scipy.optimize import minimize

        simplex = np.concatenate([begin[None], begin + np.eye(len(begin))])
        found = minimize(self.cost, begin, method="Nelder-Mead",
                         options={"initial_simplex": simplex, "xatol": 1e-2, "fatol": 1e-3, "maxfev": 600})
        return np.asarray(found.x), float(found.fun)

    @cached_property
    def without(self) -> tuple[Array, float]:
        """The likeliest sizes (3,) without a swing, and their cost."""
        return self.least(self.start[:3])

    @cached_property
    def best(self) -> tuple[Array, float]:
        """The likeliest sizes (4,), and their cost."""
        begins = (np.append(self.without[0], self.start[3]), self.start)
        return min((self.least(begin) for begin in begins), key=lambda found: found[1])

    @property
    def by_chance(self) -> float:
        """Probability of so large a likelihood ratio where nothing swings."""
        return 0.5 * float(chi2_tail(2 * max(self.without[1] - self.best[1], 0.0), 1))

    def without_loudest(self) -> _Sizes:
        """Without the visit that speaks most for a swing."""
        loudest = int(np.argmax(self.by_visit(self.best[0]) - self.by_visit(self.without[0])))
        kept, place = [], 0
        for group in self.groups:
            members = np.arange(place, place + len(group.values)) != loudest
            place += len(group.values)
            if members.any():
                kept.append(_Visits(group.values[members], group.parts[members]))
        return _Sizes(tuple(kept), self.start)


def swing_of(fitted: Posterior) -> Swing | None:
    """The swing in the residuals of a fitted model, None where they show none or cannot."""
    state, noise = fitted.load_state, fitted.data.cell.noise
    if nothing_hangs(state):
        return None
    groups = _groups(fitted)
    if sum(len(group.values) for group in groups) < FEWEST_VISITS:
        return None
    sizes = _Sizes(groups, np.log([
        1.0, max(float(noise.force.max()), USUAL_FORCE_N), noise.force_relative or USUAL_FORCE_RELATIVE,
        EFFECT.parameters[0].typical]))
    if sizes.by_chance > ALARM or sizes.without_loudest().by_chance > WITHOUT_ONE:
        return None
    best, least = sizes.best
    step = 0.1 * np.eye(4)[3]
    curvature = (sizes.cost(best + step) - 2 * least + sizes.cost(best - step)) / 0.01
    angle = float(np.exp(best[3]))
    across = _across(fitted.data, fitted.compliance, state.fall)
    largest = angle * np.sqrt(np.trace(across, axis1=1, axis2=2))
    return Swing(angle, float(1 / np.sqrt(max(curvature, 1.0))), sizes.by_chance, float(largest.max()))


def _across(data: LoadTest, compliance: Array, fall: Array) -> Array:
    """Covariance (n, 3, 3) [m^2] that a direction uncertain by 1 rad across gravity makes in each row."""
    force = data.rows.wrench[:, :3]
    down = fall / np.linalg.norm(fall)
    carried = _carried(data, compliance) @ (np.eye(3) - np.outer(down, down))
    return np.asarray((carried @ np.swapaxes(carried, 1, 2)) * np.sum(force**2, axis=1)[:, None, None])


def _carried(data: LoadTest, compliance: Array) -> Array:
    """First-order compliance (n, 3, 3) [m/N]."""
    cell = data.cell
    return np.asarray(compliance_matrix(cell.robot, data.rows.theta, cell.flange_from_tcp, compliance)[:, :3, :3])


def _groups(fitted: Posterior) -> tuple[_Visits, ...]:
    """The visits that tell, those with equally many rows together."""
    data, state = fitted.data, fitted.load_state
    residual = fitted.residual
    usable = ~np.isnan(residual).any(axis=1) & (hanging(state) | ~np.any(state.wrench != 0, axis=1))
    sigma = sensor_sigma(data)
    carried = _carried(data, fitted.compliance)
    down = state.fall / np.linalg.norm(state.fall)
    load = state.wrench[:, :3] @ down
    found: dict[int, list[tuple[Array, Array]]] = {}
    for visit in np.unique(state.visit[usable]):
        rows = np.flatnonzero(usable & (state.visit == visit))
        if len(rows) < 3 or not load[rows].any():
            continue
        visited = _visit(residual[rows], sigma[rows].mean(axis=0), carried[rows].mean(axis=0), load[rows], down)
        found.setdefault(len(visited[0]), []).append(visited)
    return tuple(_Visits(np.stack([values for values, _ in members]), np.stack([parts for _, parts in members]))
                 for members in found.values())


def _visit(residual: Array, sigma: Array, carried: Array, load: Array, down: Array) -> tuple[Array, Array]:
    """Values (p,) and covariance parts (4, p, p) of one visit in units of the sensors' sigmas; residual (m, 3) [m]."""
    common = np.column_stack([np.ones(len(load)), load])
    left = np.linalg.qr(common, mode="complete")[0][:, np.linalg.matrix_rank(common):]
    values = (left.T @ (residual / sigma)).ravel()
    scaled = carried / sigma[:, None]
    along = np.outer(scaled @ down, scaled @ down)
    every = scaled @ scaled.T
    loaded: NDArray[np.float64] = (load != 0).astype(float)
    return values, np.stack([
        np.eye(len(values)), np.kron((left.T * loaded) @ left, every), np.kron((left.T * load**2) @ left, along),
        np.kron((left.T * load**2) @ left, every - along)])

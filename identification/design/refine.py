"""Continuous refinement of a plan: sequential quadratic programming with BFGS (SciPy SLSQP, the paper's solver, eq. 20).

Variables are the controller angles of all runs; slots and positions stay. With Gamma = grad ln Phi(M) (6, 6) the objective's
derivative is `-trace(Gamma dm_r / dtheta)`; dm, dg and dh come from one batch of central differences, in which every run's
six angles are moved at once for all runs together, so that a gradient costs one vectorised call.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.design.criteria import Criterion
from identification.design.domain import TOLERANCE, Domain, Pool
from identification.design.information import Stance, run_information

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
STEP = 1e-5
MOST_ITERATIONS = 80


@dataclass(frozen=True, eq=False)
class Local:
    """Runs about one point: information (N, 6, 6), inequalities (N, q), equalities (N, e), and their derivatives by the angles
    (N, 6, 6, 6), (N, 6, q), (N, 6, e), second index the angle."""

    information: Array
    inequality: Array
    equality: Array
    information_slope: Array
    inequality_slope: Array
    equality_slope: Array


def _values(domain: Domain, theta: Array, slot: Indices, place: Indices) -> tuple[Array, Array, Array]:
    """Information (N, 6, 6), inequalities (N, q) and equalities (N, e) of runs."""
    seen = domain.look(theta)
    information: Array = np.empty((len(theta), 6, 6))
    inequality: Array = np.empty((len(theta), 0))
    for s in np.unique(slot):
        rows = slot == s
        part = Stance(seen.columns[rows], seen.tcp[rows], seen.lever[rows])
        information[rows] = run_information(domain.rig, part.columns, domain.slots[s])
        values = domain.inequalities(theta[rows], part, int(s))
        if not inequality.size:
            inequality = np.empty((len(theta), values.shape[1]))
        inequality[rows] = values
    return information, inequality, domain.equalities(seen, place)


def _local(domain: Domain, theta: Array, slot: Indices, place: Indices) -> Local:
    moves = STEP * np.concatenate([np.zeros((1, 6)), np.eye(6), -np.eye(6)])
    around = (theta[:, None] + moves).reshape(-1, 6)

    def split(values: Array) -> tuple[Array, Array]:
        table = values.reshape(len(theta), 13, *values.shape[1:])
        return table[:, 0], (table[:, 1:7] - table[:, 7:]) / (2 * STEP)

    (m, dm), (g, dg), (h, dh) = map(split, _values(domain, around, np.repeat(slot, 13), np.repeat(place, 13)))
    return Local(m, g, h, dm, dg, dh)


def _block_rows(slope: Array) -> Array:
    """Constraint Jacobian (N q, 6 N) of per-run derivatives (N, 6, q)."""
    count, _, each = slope.shape
    result = np.zeros((count, each, count, 6))
    runs = np.arange(count)
    result[runs, :, runs] = np.swapaxes(slope, 1, 2)
    return result.reshape(count * each, count * 6)


@dataclass(frozen=True, eq=False)
class Refined:
    """runs: the plan. value: what was maximised. feasible: nothing exceeds its limit by more than the tolerance.
    iterations: of the solver."""

    runs: Pool
    value: float
    feasible: bool
    iterations: int


@dataclass(frozen=True, eq=False)
class Objective:
    """What is minimised: a value of the runs' information (N, 6, 6), and its slope (6, 6), the same for every run, by it."""

    value: Callable[[Array], float]
    slope: Callable[[Array], Array]


def _solve(
    domain: Domain, theta: Array, slot: Indices, place: Indices, objective: Objective, iterations: int, accuracy: float
) -> tuple[Array, int]:
    """Minimises the objective over the runs' angles (N, 6) under the domain's constraints; returns angles and iterations."""
    from scipy.optimize import minimize

    shape = theta.shape
    seen: dict[bytes, tuple[Array, Array, Array]] = {}
    felt: dict[bytes, Local] = {}

    def at(x: Array) -> tuple[Array, Array, Array]:
        key = x.tobytes()
        if key not in seen:
            seen.clear()
            seen[key] = _values(domain, x.reshape(shape), slot, place)
        return seen[key]

    def near(x: Array) -> Local:
        key = x.tobytes()
        if key not in felt:
            felt.clear()
            felt[key] = _local(domain, x.reshape(shape), slot, place)
        return felt[key]

    def target(x: Array) -> float:
        return objective.value(at(x)[0])

    def gradient(x: Array) -> Array:
        local = near(x)
        return np.asarray(np.einsum("ij,nqij->nq", objective.slope(local.information), local.information_slope).ravel())

    constraints: list[Any] = [
        {"type": "ineq", "fun": lambda x: -at(x)[1].ravel(), "jac": lambda x: -_block_rows(near(x).inequality_slope)}]
    if domain.positions is not None:
        constraints.append(
            {"type": "eq", "fun": lambda x: at(x)[2].ravel(), "jac": lambda x: _block_rows(near(x).equality_slope)})
    limits: Any = np.tile(domain.limits, (len(theta), 1))
    solver: Any = minimize
    found = solver(target, theta.ravel(), jac=gradient, method="SLSQP", bounds=limits,
                     constraints=constraints, options={"maxiter": iterations, "ftol": accuracy})
    solved = np.where(np.isfinite(found.x), found.x, theta.ravel()).reshape(shape)
    return np.asarray(solved), int(found.nit)


def _finished(domain: Domain, theta: Array, slot: Indices, place: Indices) -> tuple[Pool, bool]:
    """The runs with the TCP exactly in place, and whether they are admissible."""
    theta = np.clip(domain.centred(theta, place), domain.limits[:, 0], domain.limits[:, 1])
    information = _values(domain, theta, slot, place)[0]
    return Pool(theta, slot, place, information), bool(domain.excess(theta, slot, place).max() <= TOLERANCE)


def refine(
    domain: Domain, criterion: Criterion, prior: Array, start: Pool, replicates: int = 1, iterations: int = MOST_ITERATIONS
) -> Refined:
    """The plan `start` improved over continuous angles. prior (6, 6): precision before the runs."""
    theta, total = start.theta, 0
    for power in criterion.powers:
        stage = criterion.smooth_with(power)

        def height(information: Array, stage: Criterion = stage) -> float:
            return -float(np.log(stage.smooth(prior + replicates * information.sum(axis=0))))

        def slope(information: Array, stage: Criterion = stage) -> Array:
            return -replicates * stage.slope(prior + replicates * information.sum(axis=0))

        theta, used = _solve(domain, theta, start.slot, start.place, Objective(height, slope), iterations, 1e-8)
        total += used
    runs, feasible = _finished(domain, theta, start.slot, start.place)
    value = float(criterion.value(prior + replicates * runs.information.sum(axis=0)))
    return Refined(runs, value, feasible, total)


def climb(domain: Domain, weight: Array, start: Pool, iterations: int = 60) -> Refined:
    """One run (a pool of one) moved to where `trace(weight m)` is largest nearby: the certificate's sensitivity function."""
    scale = max(float(np.einsum("ij,nij->", weight, start.information)), 1e-300)

    goal = Objective(lambda information: -float(np.einsum("ij,nij->", weight, information)) / scale, lambda _: -weight / scale)
    theta, used = _solve(domain, start.theta, start.slot, start.place, goal, iterations, 1e-7)
    runs, feasible = _finished(domain, theta, start.slot, start.place)
    return Refined(runs, float(np.einsum("ij,nij->", weight, runs.information)), feasible, used)

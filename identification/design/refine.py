"""Continuous refinement of a plan: sequential quadratic programming with BFGS (SciPy SLSQP, the paper's solver, eq. 20).

Variables are the controller angles of all runs, and the line of the load where that is free (three components, of length
one); slots and positions stay. With Gamma = grad ln Phi(M) (6, 6) the objective's derivative is `-trace(Gamma dm_r)`, analytic
as those of the constraints are.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.design.constraints import inequalities, inequality_slopes
from identification.design.criteria import Criterion
from identification.design.domain import TOLERANCE, Domain, Pool
from identification.design.information import Parts, information_slope, parts_of, run_information
from identification.design.loads import Loads
from identification.design.stance import Stance, by_angles, columns_slope
from identification.design.task import Task
from identification.model.robot import RobotModel

Array = NDArray[np.float64]
MOST_ITERATIONS = 120
# Change of ln Phi at which a search may stop; the matrix means that only lead to the last one stop earlier.
ACCURACY, ON_THE_WAY = 1e-6, 1e-4


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


@dataclass(frozen=True, eq=False)
class _Point:
    """The runs at one point x of the search."""

    x: Array
    robot: RobotModel
    theta: Array
    arm: Stance
    loads: Loads
    parts: Parts
    information: Array

    @cached_property
    def columns_slope(self) -> Array:
        """Derivative (N, 6, 3, 6) of the springs' columns by the angles."""
        return columns_slope(self.robot, self.arm)


class _Problem:
    """The search over the runs of `start`. SLSQP asks for values and slopes piece by piece: the last point is kept."""

    def __init__(self, domain: Domain, start: Pool, objective: Objective) -> None:
        self.domain, self.start, self.objective = domain, start, objective
        self.free = domain.table.free
        self.width = 9 if self.free else 6
        self._last: _Point | None = None

    def split(self, x: Array) -> tuple[Array, Array]:
        """Angles (N, 6) [rad] and lines (N, 3)."""
        rows = x.reshape(len(self.start), self.width)
        return rows[:, :6], rows[:, 6:] if self.free else self.start.line

    def at(self, x: Array) -> _Point:
        """The runs at x."""
        if self._last is None or not np.array_equal(self._last.x, x):
            theta, line = self.split(x)
            arm, loads = self.domain.look(theta), self.domain.table.of(self.start.slot, line)
            rig = self.domain.rig
            parts = parts_of(rig, arm.columns, loads)
            information = run_information(rig, arm.columns, loads, parts)
            self._last = _Point(x.copy(), rig.cell.robot, theta, arm, loads, parts, information)
        return self._last

    def value(self, x: Array) -> float:
        """The objective."""
        return self.objective.value(self.at(x).information)

    def gradient(self, x: Array) -> Array:
        """Its derivative (N width,)."""
        point, rig = self.at(x), self.domain.rig
        by_columns, by_force = information_slope(
            rig, point.arm.columns, point.loads, self.objective.slope(point.information), point.parts)
        count = len(by_columns)
        by_theta = (point.columns_slope.reshape(count, 6, 18) @ by_columns.reshape(count, 18, 1))[:, :, 0]
        by_line = np.einsum("nk,nka->na", point.loads.by_line, by_force)
        return self._joined(by_theta[:, :, None], by_line[:, :, None]).ravel()

    def inequality(self, x: Array) -> Array:
        """-g (N q,), not negative where admissible."""
        point, domain = self.at(x), self.domain
        return -inequalities(domain.rig, domain.margins, domain.box, point.theta, point.arm, point.loads).ravel()

    def inequality_slope(self, x: Array) -> Array:
        """Its derivative (N q, N width)."""
        point, domain = self.at(x), self.domain
        return -_block_rows(self._joined(*inequality_slopes(
            domain.rig, domain.margins, domain.box, point.theta, point.arm, point.loads, point.columns_slope)))

    def equality(self, x: Array) -> Array:
        """TCP in place, and lines of length one; (N e,)."""
        off = self.domain.equalities(self.at(x).arm, self.start.place)
        if self.free:
            off = np.concatenate([off, np.sum(self.split(x)[1] ** 2, axis=1, keepdims=True) - 1], axis=1)
        return off.ravel()

    def equality_slope(self, x: Array) -> Array:
        """Its derivative (N e, N width)."""
        point, count = self.at(x), len(self.start)
        by_theta: Array = np.zeros((count, 6, 0))
        if self.domain.positions is not None:
            by_theta = by_angles(self.domain.rig.cell.robot, point.arm.serial)
        by_line = np.zeros((count, 3, by_theta.shape[2]))
        if self.free:
            by_theta = np.concatenate([by_theta, np.zeros((count, 6, 1))], axis=2)
            by_line = np.concatenate([by_line, 2 * self.split(x)[1][:, :, None]], axis=2)
        return _block_rows(self._joined(by_theta, by_line))

    def _joined(self, by_theta: Array, by_line: Array) -> Array:
        return np.concatenate([by_theta, by_line], axis=1) if self.free else by_theta

    def solved(self, iterations: int, accuracy: float) -> tuple[Pool, int]:
        """The best runs found, not yet checked, and the iterations it took."""
        from scipy.optimize import minimize

        begin = np.concatenate([self.start.theta, self.start.line], axis=1)[:, : self.width].ravel()
        constraints: list[Any] = [{"type": "ineq", "fun": self.inequality, "jac": self.inequality_slope}]
        if self.free or self.domain.positions is not None:
            constraints.append({"type": "eq", "fun": self.equality, "jac": self.equality_slope})
        of_a_run = np.concatenate([self.domain.limits, np.tile([-1.0, 1.0], (3, 1))])[: self.width]
        limits: Any = np.tile(of_a_run, (len(self.start), 1))
        solver: Any = minimize
        answer = solver(self.value, begin, jac=self.gradient, method="SLSQP", bounds=limits, constraints=constraints,
                        options={"maxiter": iterations, "ftol": accuracy})
        theta, line = self.split(np.where(np.isfinite(answer.x), answer.x, begin))
        return Pool(theta, self.start.slot, self.start.place, line, self.start.information), int(answer.nit)


def _block_rows(slope: Array) -> Array:
    """Constraint Jacobian (N q, N v) of per-run derivatives (N, v, q)."""
    count, width, each = slope.shape
    result = np.zeros((count, each, count, width))
    runs = np.arange(count)
    result[runs, :, runs] = np.swapaxes(slope, 1, 2)
    return result.reshape(count * each, count * width)


def _finished(domain: Domain, runs: Pool) -> tuple[Pool, bool]:
    """The runs with the TCP exactly in place and lines of length one, and whether they are admissible."""
    theta = np.clip(domain.centred(runs.theta, runs.place), domain.limits[:, 0], domain.limits[:, 1])
    line = runs.line / np.linalg.norm(runs.line, axis=1, keepdims=True)
    finished = domain.runs(theta, runs.slot, runs.place, line)
    return finished, bool(domain.excess(finished).max() <= TOLERANCE)


def refine(task: Task, start: Pool, accuracy: float = ACCURACY) -> Refined:
    """The plan `start` improved over continuous angles."""
    runs, iterations = start, 0
    for power in task.criterion.powers:
        enough = accuracy if power == task.criterion.powers[-1] else max(accuracy, ON_THE_WAY)
        objective = _of_criterion(task, task.criterion.smooth_with(power))
        runs, used = _Problem(task.domain, runs, objective).solved(MOST_ITERATIONS, enough)
        iterations += used
    runs, feasible = _finished(task.domain, runs)
    return Refined(runs, task.value(runs), feasible, iterations)


def _of_criterion(task: Task, criterion: Criterion) -> Objective:
    """-ln of the smooth criterion."""
    def height(information: Array) -> float:
        return -float(np.log(criterion.smooth(task.prior + task.replicates * information.sum(axis=0))))

    def slope(information: Array) -> Array:
        return -task.replicates * criterion.slope(task.prior + task.replicates * information.sum(axis=0))

    return Objective(height, slope)


def climb(domain: Domain, weight: Array, start: Pool, iterations: int = 60) -> Refined:
    """One run (a pool of one) moved to where `trace(weight m)` is largest nearby: the certificate's sensitivity function."""
    scale = max(float(np.einsum("ij,nij->", weight, start.information)), 1e-300)

    goal = Objective(lambda information: -float(np.einsum("ij,nij->", weight, information)) / scale, lambda _: -weight / scale)
    moved, used = _Problem(domain, start, goal).solved(iterations, 1e-7)
    runs, feasible = _finished(domain, moved)
    return Refined(runs, float(np.einsum("ij,nij->", weight, runs.information)), feasible, used)

"""The optimal design: from a task to a plan with its certificate.

1. A random pool of admissible runs; exchange over it from many starts; the best refined over continuous poses by SLSQP.
2. The approximate optimum by column generation (certificate.py), whose climbs enlarge the pool.
3. Exchange over the enlarged pool, refined again: the approximate optimum's runs are often those of the best plan. Then each
   run of the best plan in turn is put elsewhere and all refined again, until that helps no more.
4. The certificate: the plan found against the bound of 2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.design.certificate import Certificate, certify
from identification.design.domain import Pool, random_pool
from identification.design.exchange import many_exchanges
from identification.design.refine import ACCURACY, Refined, refine
from identification.design.task import Task

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
# Plans are equally good within this share; another place is this far in some joint [rad]; the last refinement's accuracy.
SAME, ELSEWHERE, POLISHED = 1e-3, 0.2, 1e-9


@dataclass(frozen=True)
class Effort:
    """How hard to search: poses of the pool, exchanges, refinements of the first search (twice as many of the second), rounds
    of moving each run elsewhere, climbs of the certificate."""

    poses: int = 4000
    exchanges: int = 100
    refinements: int = 6
    moves: int = 3
    climbs: int = 48


QUICK = Effort(poses=1500, exchanges=30, refinements=3, moves=0, climbs=16)


@dataclass(frozen=True, eq=False)
class Design:
    """runs: the plan (N). information (6, 6): precision of ln c after it. tried, failed, same: refinements, those that did not
    end feasible, and those that ended as good as the plan. single: value of the first exchange alone, before any refinement.
    pool: the random one."""

    task: Task
    runs: Pool
    information: Array
    certificate: Certificate
    tried: int
    failed: int
    same: int
    single: float
    pool: Pool

    @property
    def covariance(self) -> Array:
        """Covariance (6, 6) of ln c, and so of ln k, after the plan."""
        return np.asarray(np.linalg.inv(self.information))


def optimal_design(task: Task, rng: np.random.Generator, effort: Effort | None = None) -> Design:
    """The best plan found. Raises CompstiffError (CS1601) where no run is admissible."""
    effort = effort or Effort()
    pool = random_pool(task.domain, effort.poses, rng)
    first = many_exchanges(task, pool, rng, effort.exchanges)
    single = task.value(pool.take(first[0][0]))
    tried = [refined(task, pool.take(rows)) for rows, _ in first[: effort.refinements]]
    best = _best(tried)
    certificate = certify(task, best.runs, pool, rng, starts=effort.climbs)
    more = _promising(task, certificate).joined(best.runs)
    again = many_exchanges(task, more, rng, effort.exchanges)
    tried += [refined(task, more.take(rows)) for rows, _ in again[: 2 * effort.refinements]]
    tried += _moved_elsewhere(task, _best(tried), more, effort.moves)
    best = _best(tried)
    best = max(best, refined(task, best.runs, POLISHED)[0], key=lambda plan: plan.value)
    same = sum(plan.value >= best.value * (1 - SAME) for plan, _ in tried)
    return Design(task, best.runs, task.information(best.runs), certificate.of_plan(best.value), len(tried),
                  sum(not ended for _, ended in tried), same, single, pool)


def best_refined(task: Task, pool: Pool, plans: Sequence[tuple[Indices, float]]) -> Refined:
    """The best of plans (rows of the pool, value) once they are refined."""
    return _best([refined(task, pool.take(rows)) for rows, _ in plans])


def _best(tried: Sequence[tuple[Refined, bool]]) -> Refined:
    return max((plan for plan, _ in tried), key=lambda plan: plan.value)


def _moved_elsewhere(task: Task, best: Refined, pool: Pool, rounds: int) -> list[tuple[Refined, bool]]:
    """Refinements of the best plan with one run at a time put where, the others staying, it would be worth most: a basin that
    exchanges over a pool miss because the other runs stand where they suit the one that was there."""
    tried: list[tuple[Refined, bool]] = []
    for _ in range(rounds):
        before = best.value
        for i in range(len(best.runs)):
            start = elsewhere(task, best.runs, i, pool)
            if start is None:
                continue
            tried.append(refined(task, start))
            if tried[-1][0].value > best.value:
                best = tried[-1][0]
        if best.value <= before * (1 + SAME):
            break
    return tried


def elsewhere(task: Task, plan: Pool, i: int, pool: Pool) -> Pool | None:
    """The plan with run i put where it is worth most, somewhere else; None where there is nowhere else."""
    rest = task.information(plan) - task.replicates * plan.information[i]
    rows = np.flatnonzero(task.group(pool) == task.demand.wanted[i])
    values = task.criterion.smooth(rest + task.replicates * pool.information[rows])
    far = np.abs(pool.theta[rows] - plan.theta[i]).max(axis=1) > ELSEWHERE
    far |= pool.slot[rows] != plan.slot[i]
    if not far.any():
        return None
    k = rows[far][int(np.argmax(values[far]))]
    keep = np.arange(len(plan)) != i
    # The demand says in which order the groups stand.
    order = np.argsort(np.concatenate([np.flatnonzero(keep), [i]]))
    return plan.take(keep).joined(pool.take(np.array([k]))).take(order)


def refined(task: Task, start: Pool, accuracy: float = ACCURACY) -> tuple[Refined, bool]:
    """An admissible start refined, and whether the solver ended admissible; the start itself where it did not or got worse."""
    after = refine(task, start, accuracy)
    before = task.value(start)
    if after.feasible and after.value >= before:
        return after, True
    return Refined(start, before, True, after.iterations), after.feasible


def _promising(task: Task, certificate: Certificate, count: int = 3000) -> Pool:
    """The known runs with the largest share in the approximate optimum's tangent, and all its support."""
    pool = certificate.pool
    slope = task.criterion.slope(task.approximate_information(certificate.support, certificate.weights))
    gain = np.einsum("ij,nij->n", slope, pool.information)
    rows = np.argsort(-gain, kind="stable")[:count]
    groups = task.group(pool)
    for g in np.unique(groups):         # enough of each group, whatever the others promise
        mine = np.flatnonzero(groups == g)
        rows = np.union1d(rows, mine[np.argsort(-gain[mine], kind="stable")[:300]])
    return pool.take(rows).joined(certificate.support)

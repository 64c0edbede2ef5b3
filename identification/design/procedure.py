"""The design, from a cell and a task to a plan with its certificate.

1. A random pool of admissible runs; exchange over it from many starts; the best refined over continuous poses by SLSQP.
2. The approximate optimum by column generation (certificate.py), whose climbs enlarge the pool.
3. Exchange over the enlarged pool, refined again: the approximate optimum's runs are often those of the best plan. Then each
   run of the best plan in turn is put elsewhere and all refined again, until that helps no more.
4. The certificate: the plan found against the bound of 2.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from identification.design.certificate import Certificate, certify
from identification.design.criteria import Criterion
from identification.design.domain import Domain, Pool, random_pool
from identification.design.exchange import Demand, many_exchanges
from identification.design.refine import ACCURACY, Refined, refine

Array = NDArray[np.float64]
# Plans are equally good within this share; another place is this far in some joint [rad]; the last refinement's accuracy.
SAME, ELSEWHERE, POLISHED = 1e-3, 0.2, 1e-9


@dataclass(frozen=True, eq=False)
class Task:
    """What is asked for. prior (6, 6): precision of ln c before the runs. replicates: visits a run, each re-seated."""

    domain: Domain
    criterion: Criterion
    prior: Array
    demand: Demand
    replicates: int = 1


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


def design(task: Task, rng: np.random.Generator, effort: Effort | None = None) -> Design:
    """The best plan found. Raises CompstiffError (CS1601) where no run is admissible."""
    effort = effort or Effort()
    pool = random_pool(task.domain, effort.poses, rng)
    criterion = task.criterion
    first = many_exchanges(pool, criterion, task.prior, task.demand, rng, effort.exchanges, task.replicates)
    single = float(criterion.value(total_information(task, pool.take(first[0][0]))))
    tried = [refined(task, pool.take(rows)) for rows, _ in first[: effort.refinements]]
    best = max((one for one, _ in tried), key=lambda one: one.value)
    found = certify(task.domain, criterion, task.prior, task.demand, best.runs, pool, rng, replicates=task.replicates,
                    starts=effort.climbs)
    more = _promising(task, found).joined(best.runs)
    again = many_exchanges(more, criterion, task.prior, task.demand, rng, effort.exchanges, task.replicates)
    tried += [refined(task, more.take(rows)) for rows, _ in again[: 2 * effort.refinements]]
    best = max((one for one, _ in tried), key=lambda one: one.value)
    tried += _moved_elsewhere(task, best, more, effort.moves)
    best = max((one for one, _ in tried), key=lambda one: one.value)
    best = max(best, refined(task, best.runs, POLISHED)[0], key=lambda one: one.value)
    same = sum(one.value >= best.value * (1 - SAME) for one, _ in tried)
    return Design(task, best.runs, total_information(task, best.runs), judged(found, best.value), len(tried),
                  sum(not ended for _, ended in tried), same, single, pool)


def judged(found: Certificate, value: float) -> Certificate:
    """The certificate of another plan of the same task, whose Phi is `value`."""
    bound, relaxed = max(found.bound, value), max(found.relaxed, value)
    return replace(found, value=value, bound=bound, relaxed=relaxed, efficiency=value / bound,
                   pool_efficiency=min(found.pool_efficiency * value / found.value, 1.0))


def _moved_elsewhere(task: Task, best: Refined, pool: Pool, rounds: int) -> list[tuple[Refined, bool]]:
    """Refinements of the best plan with one run at a time put where, the others staying, it would be worth most: a basin that
    exchanges over a pool miss because the other runs stand where they suit the one that was there."""
    tried: list[tuple[Refined, bool]] = []
    group = task.demand.groups[pool.slot]
    for _ in range(rounds):
        before = best.value
        for i in range(len(best.runs)):
            rest = total_information(task, best.runs) - task.replicates * best.runs.information[i]
            rows = np.flatnonzero(group == task.demand.wanted[i])
            values = task.criterion.smooth(rest + task.replicates * pool.information[rows])
            far = np.abs(pool.theta[rows] - best.runs.theta[i]).max(axis=1) > ELSEWHERE
            far |= pool.slot[rows] != best.runs.slot[i]
            if not far.any():
                continue
            k = rows[far][int(np.argmax(values[far]))]
            keep = np.arange(len(best.runs)) != i
            # The demand says in which order the groups stand.
            order = np.argsort(np.concatenate([np.flatnonzero(keep), [i]]))
            start = best.runs.take(keep).joined(pool.take(np.array([k]))).take(order)
            one = refined(task, start)
            tried.append(one)
            if one[0].value > best.value:
                best = one[0]
        if best.value <= before * (1 + SAME):
            break
    return tried


def total_information(task: Task, runs: Pool) -> Array:
    """Precision (6, 6) of ln c after the runs."""
    return np.asarray(task.prior + task.replicates * runs.information.sum(axis=0))


def refined(task: Task, start: Pool, accuracy: float = ACCURACY) -> tuple[Refined, bool]:
    """An admissible start refined, and whether the solver ended admissible; the start itself where it did not or got worse."""
    found = refine(task.domain, task.criterion, task.prior, start, task.replicates, accuracy)
    before = float(task.criterion.value(total_information(task, start)))
    if found.feasible and found.value >= before:
        return found, True
    return Refined(start, before, True, found.iterations), found.feasible


def _promising(task: Task, found: Certificate, count: int = 3000) -> Pool:
    """The known runs with the largest share in the approximate optimum's tangent, and all its support."""
    information = found.pool.information
    slope = task.criterion.slope(approximate_information(task, found))
    gain = np.einsum("ij,nij->n", slope, information)
    rows = np.argsort(-gain, kind="stable")[:count]
    groups = task.demand.groups[found.pool.slot]
    for g in np.unique(groups):         # enough of each group, whatever the others promise
        mine = np.flatnonzero(groups == g)
        rows = np.union1d(rows, mine[np.argsort(-gain[mine], kind="stable")[:300]])
    return found.pool.take(rows).joined(found.support)


def approximate_information(task: Task, found: Certificate) -> Array:
    """Precision (6, 6) of ln c of the certificate's approximate optimum."""
    counts = task.demand.counts[task.demand.groups[found.support.slot]]
    share = task.replicates * found.weights * counts
    return np.asarray(task.prior + np.einsum("n,nij->ij", share, found.support.information))

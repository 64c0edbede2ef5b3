"""The design, from a cell and a task to a plan with its certificate.

1. A random pool of admissible runs; exchange over it from many starts; the best refined over continuous poses by SLSQP.
2. The approximate optimum by column generation (certificate.py), whose climbs enlarge the pool.
3. Exchange over the enlarged pool, refined again: the approximate optimum's runs are often those of the best plan.
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
from identification.design.refine import Refined, refine

Array = NDArray[np.float64]


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
    """How hard to search: poses of the pool, exchanges, refinements of each of the two searches, climbs of the certificate."""

    poses: int = 4000
    exchanges: int = 100
    refinements: int = 6
    climbs: int = 48


@dataclass(frozen=True, eq=False)
class Design:
    """runs: the plan (N). information (6, 6): precision of ln c after it. tried, failed: refinements, and those that did not
    end feasible. single: value of the first exchange alone, before any refinement. pool: the random one."""

    task: Task
    runs: Pool
    information: Array
    certificate: Certificate
    tried: int
    failed: int
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
    single = float(criterion.value(_total(task, pool.take(first[0][0]))))
    tried = [_refined(task, pool.take(rows)) for rows, _ in first[: effort.refinements]]
    best = max((one for one, _ in tried), key=lambda one: one.value)
    found = certify(task.domain, criterion, task.prior, task.demand, best.runs, pool, rng, replicates=task.replicates,
                    starts=effort.climbs)
    more = _promising(task, found).joined(best.runs)
    again = many_exchanges(more, criterion, task.prior, task.demand, rng, effort.exchanges, task.replicates)
    tried += [_refined(task, more.take(rows)) for rows, _ in again[: effort.refinements]]
    best = max((one for one, _ in tried), key=lambda one: one.value)
    bound = max(found.bound, best.value)
    certificate = replace(found, value=best.value, bound=bound, efficiency=best.value / bound,
                          pool_efficiency=min(found.pool_efficiency * best.value / found.value, 1.0))
    return Design(task, best.runs, _total(task, best.runs), certificate, len(tried), sum(not ended for _, ended in tried),
                  single, pool)


def _total(task: Task, runs: Pool) -> Array:
    return np.asarray(task.prior + task.replicates * runs.information.sum(axis=0))


def _refined(task: Task, start: Pool) -> tuple[Refined, bool]:
    """An admissible start refined, and whether the solver ended admissible; the start itself where it did not or got worse."""
    found = refine(task.domain, task.criterion, task.prior, start, task.replicates)
    before = float(task.criterion.value(_total(task, start)))
    if found.feasible and found.value >= before:
        return found, True
    return Refined(start, before, True, found.iterations), found.feasible


def _promising(task: Task, found: Certificate, count: int = 3000) -> Pool:
    """The known runs with the largest share in the approximate optimum's tangent, and all its support."""
    information = found.pool.information
    measure = np.linalg.inv(_measure_of(task, found))
    gain = np.einsum("ij,nij->n", measure, information)
    rows = np.argsort(-gain, kind="stable")[:count]
    groups = task.demand.groups[found.pool.slot]
    for g in np.unique(groups):         # enough of each group, whatever the others promise
        mine = np.flatnonzero(groups == g)
        rows = np.union1d(rows, mine[np.argsort(-gain[mine], kind="stable")[:300]])
    return found.pool.take(rows).joined(found.support)


def _measure_of(task: Task, found: Certificate) -> Array:
    counts = task.demand.counts[task.demand.groups[found.support.slot]]
    share = task.replicates * found.weights * counts
    return np.asarray(task.prior + np.einsum("n,nij->ij", share, found.support.information))

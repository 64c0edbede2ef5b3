"""Runs that tell the causes of diagnosis/ apart, and not the stiffnesses alone (criterion C).

A plan that is best for six stiffnesses repeats a few poses, at which many causes look like another spring. Here the parameters
are the six ln c and the size of every cause of the dictionary together, each with its prior, and the criterion is D over all of
them (Bayesian D-optimality: the information that the runs are expected to give, Chaloner and Verdinelli, Statistical Science
1995, sect. 2.2). What a run tells of them is worked out for each run of a random pool; the plan is the best exchange over it,
and the bound that of the equivalence theorem over the whole pool.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.design.approximate import ApproximateDesign, solved_on_pool
from identification.design.certificate import bound_over, certify
from identification.design.criteria import d_criterion
from identification.design.domain import Pool, random_pool
from identification.design.exchange import exchange, many_exchanges
from identification.design.forecast import spread
from identification.design.posture import reaching_back, turned_least
from identification.design.search import Design, Effort
from identification.design.sheet import as_measurements, sheet_of
from identification.design.task import Task
from identification.diagnosis.plan import judge_plan, visit_information
from identification.measurements import Measurements

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
# Rows of the pool: what every cause does in each of them has to be worked out.
ROWS = 7000
# An exchange over so many parameters takes ten times as long as one over six.
FEWER = 10


@dataclass(frozen=True)
class ByCauses:
    """What runs by criterion C are worth. bits: information that they are expected to give of stiffnesses and causes. share:
    what they certainly have of the bits of the best plan out of the pool, which has `pool` runs. largest: std of ln k after
    them. otherwise_named, otherwise_largest: causes of typical size that as many runs out of the pool by
    criterion D name, and the largest std of ln k after those."""

    bits: float
    share: float
    pool: int
    largest: float
    otherwise_named: int
    otherwise_largest: float

    def as_dict(self) -> dict[str, Any]:
        """JSON values."""
        return {"bits": self.bits, "share_of_best_in_pool": self.share, "pool": self.pool, "largest_log_std": self.largest,
                "by_d": {"causes_named": self.otherwise_named, "largest_log_std": self.otherwise_largest}}

    def lines(self) -> list[str]:
        """In plain words."""
        return [f"{self.bits:.0f} bits about stiffnesses and causes, at least {np.floor(1e2 * self.share):.0f} % of what as "
                f"many out of {self.pool} runs drawn at random could tell (equivalence theorem, poses as fractions)",
                f"as many runs by criterion D name {self.otherwise_named} causes of typical size and know the least known "
                f"stiffness {spread(self.otherwise_largest)}; these know it {spread(self.largest)}, their causes stand below"]


def design_for_causes(
    task: Task, measured: Measurements | None, rng: np.random.Generator, effort: Effort | None = None
) -> tuple[Design, ByCauses]:
    """A plan by criterion C, and what it is worth; its certificate is by the task's own criterion. measured: rows that it
    comes after. Raises CompstiffError (CS1601) where no run is admissible."""
    effort = effort or Effort()
    pool = _small(task, random_pool(task.domain, effort.poses, rng), rng)
    before = None if measured is None else measured.select(~measured.validate)
    rig, once = task.domain.rig, replace(task, replicates=1)
    visits = visit_information(rig.cell, _rows(once, pool, before), np.log(rig.compliance))
    told = replace(pool, information=visits.of[-len(pool):])
    everything = replace(task, criterion=d_criterion(), prior=visits.prior + visits.of[:-len(pool)].sum(axis=0))
    starts = max(effort.exchanges // FEWER, 3)
    chosen, value = max((exchange(everything, told, rng) for _ in range(starts)), key=lambda plan: plan[1])
    runs = pool.take(chosen)
    certificate = certify(task, runs, pool, rng, starts=effort.climbs // 2)
    design = Design(task, runs, task.information(runs), certificate, 0, 0, 0, task.value(runs), pool)
    plainly = pool.take(many_exchanges(task, pool, rng, starts)[0][0])
    # det^(1/m) of the precision before and after: half its log2 is the information in bits.
    nothing, most = everything.criterion.value(everything.prior), max(_bound(everything, told, chosen), value)
    bits, best = (0.5 * len(everything.prior) * float(np.log2(phi / nothing)) for phi in (value, most))
    otherwise = judge_plan(rig.cell, _rows(task, plainly, before)).counts["identifiable"]
    return design, ByCauses(bits, bits / best, len(pool), _largest(task, design.information), otherwise,
                            _largest(task, task.information(plainly)))


def _bound(task: Task, pool: Pool, chosen: Indices) -> float:
    """No plan out of the pool has a larger value of the criterion."""
    share = 1.0 / task.demand.counts[task.group(pool.take(chosen))]
    weight = np.bincount(chosen, weights=share, minlength=len(pool)).astype(float)
    best = solved_on_pool(task, ApproximateDesign(pool, np.unique(chosen), weight[weight > 0]))
    return bound_over(task, best.tangent(task), pool)


def _largest(task: Task, information: Array) -> float:
    """Largest std of the ln k that the loads can show."""
    seen = ~np.isin(np.arange(1, 7), task.criterion.left_out)
    return float(np.sqrt(np.diag(np.linalg.inv(information))[seen].max()))


def _small(task: Task, pool: Pool, rng: np.random.Generator) -> Pool:
    """As many runs in ordinary postures as there is time for, some of each group; where a group has none, of any posture."""
    forwards = ~reaching_back(task.domain, pool.theta)
    group = task.group(pool)
    for g in np.unique(group):
        if not forwards[group == g].any():
            forwards |= group == g
    pool = pool.take(forwards)
    most = max(ROWS // max(len(slot.forces) for slot in task.domain.slots), 4 * len(task.demand))
    kept = rng.permutation(len(pool))[:most]
    missing = np.setdiff1d(np.unique(task.group(pool)), task.group(pool)[kept])
    first = [int(np.flatnonzero(task.group(pool) == g)[0]) for g in missing]
    return turned_least(task.domain, pool.take(np.concatenate([kept, np.array(first, dtype=np.intp)])))


def _rows(task: Task, runs: Pool, before: Measurements | None) -> Measurements:
    """The rows of the runs, after those measured before."""
    sheet = sheet_of(runs, task.domain.slots, np.arange(len(runs)), task.replicates, np.zeros(len(runs), dtype=bool), "P")
    return as_measurements(sheet) if before is None else before.followed_by(as_measurements(sheet))

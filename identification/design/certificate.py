"""How far a plan is from the best there could be: the general equivalence theorem over continuous poses.

Every N-run plan has `M* = P + sum m(u_i)`. For any H with `Phi(M*) <= trace(H M*)` (criteria.py)

    Phi(M*) <= trace(H P) + sum_i max_u trace(H m(u)) = bound ,        plan's efficiency >= Phi(M) / bound .

The bound is smallest where H belongs to the approximate optimum: the weights w over runs u that maximise
`Phi(P + N sum w_j m(u_j))` (Kiefer and Wolfowitz 1960; with a prior Pilz 1991). It is found by column generation: solve the
weights over the runs known so far, search for runs with larger `trace(H m(u))` over continuous poses, add them, solve again.

With few runs that bound is loose, because its weights are fractions: half a run along z may be best, and no plan has it. So
the numbers of runs a slot (n_s, sum N) are taken as whole numbers: a plan has one of finitely many splits, and for each

    Phi(M*) <= trace(H P) + sum_s n_s max_(u in s) trace(H m(u))      for every H ,

so that the largest over the splits of the smallest over the H at hand bounds every plan. The split with the largest bound gets
an H of its own (its own approximate optimum) until the largest cannot be lowered any more. The poses remain fractions.

The maxima over u are searched from many starts, not proved: that is the certificate's condition, and it is said with it. A
maximum taken over a sampled pool alone would be false comfort: it certifies against the pool, not against what a robot can do.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations_with_replacement, product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.common.findings import counted
from identification.design.approximate import ApproximateDesign, maximisers, solved_on_pool
from identification.design.domain import Pool
from identification.design.task import Demand, Task

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
MOST_ROUNDS = 25
# Splits of the runs over the slots that are looked at; with more of them the fractions must do. And how many get their own H.
MOST_SPLITS, MOST_SOLVED = 2000, 40
GAP = 1e-3
# A sharper matrix mean than the search needs: the bound of E loses at most 6^(1/p) - 1 by it.
SHARP = 640.0


@dataclass(frozen=True, eq=False)
class Certificate:
    """efficiency: what the plan certainly has of the best N-run plan, if the maxima were found. bound: no plan's Phi is larger.
    value: the plan's. optimum: Phi of the approximate optimum found; relaxed: the bound with fractions of runs a slot.
    pool_efficiency: what a certificate over the sampled pool alone would claim. starts: climbs of the last search; rounds: of
    column generation; splits: numbers of runs a slot that were told apart, 1 where only one is possible, 0 where there are too
    many. support: the approximate optimum's runs with their weights (n,), a share of their group. gap: relaxed / optimum - 1.
    pool: every run known at the end."""

    efficiency: float
    bound: float
    value: float
    optimum: float
    relaxed: float
    pool_efficiency: float
    starts: int
    rounds: int
    splits: int
    support: Pool
    weights: Array
    gap: float
    pool: Pool

    @property
    def sentence(self) -> str:
        """What is certified, with its condition."""
        return (f"at least {_percent(self.efficiency)} % efficient against every plan with as many runs and the same loads and "
                f"place, over continuous poses (equivalence theorem, poses as fractions{self._numbers}; its maxima were "
                f"searched from {counted(self.starts, 'start')}, not proved)")

    @property
    def _numbers(self) -> str:
        if self.splits < 2:
            return ""
        return f", runs an axis as whole numbers; {_percent(self.value / self.relaxed)} % with fractions of these too"

    def of_plan(self, value: float) -> Certificate:
        """The certificate of another plan of the same task, whose Phi is `value`."""
        bound, relaxed = max(self.bound, value), max(self.relaxed, value)
        return replace(self, value=value, bound=bound, relaxed=relaxed, efficiency=value / bound,
                       pool_efficiency=min(self.pool_efficiency * value / self.value, 1.0))

    def as_dict(self) -> dict[str, Any]:
        """JSON values."""
        return {"efficiency": self.efficiency, "words": self.sentence, "value": self.value, "bound": self.bound,
                "gap": self.gap, "starts": self.starts, "rounds": self.rounds, "relaxed_bound": self.relaxed,
                "splits": self.splits, "pool_only_claim": self.pool_efficiency}


def _percent(share: float) -> str:
    return f"{np.floor(1e3 * share) / 10:.1f}"


def splits_of(demand: Demand) -> Indices | None:
    """All numbers of runs a slot (M, S) that a plan can have; None where there are too many."""
    slots = len(demand.groups)
    choices = []
    for g, count in enumerate(demand.counts):
        mine = np.flatnonzero(demand.groups == g)
        rows = []
        for number, taken in enumerate(combinations_with_replacement(mine.tolist(), int(count))):
            rows.append(np.bincount(np.array(taken, dtype=np.intp), minlength=slots))
            if number > MOST_SPLITS:
                return None
        choices.append(rows)
    if np.prod([len(rows) for rows in choices]) > MOST_SPLITS:
        return None
    return np.array([np.sum(parts, axis=0) for parts in product(*choices)], dtype=np.intp)


class _Bounds:
    """The tangents at hand, and what they say of every split with the runs known so far."""

    def __init__(self, task: Task, splits: Indices) -> None:
        self.task, self.splits = task, splits
        self.tangents: list[Array] = []
        self.constant: list[float] = []
        self.largest = np.empty((0, splits.shape[1]))

    def add(self, tangent: Array, known: Pool) -> None:
        """One more tangent, its maxima over the known runs."""
        self.tangents.append(tangent)
        self.constant.append(float(np.sum(tangent * self.task.prior)))
        self.largest = np.vstack([self.largest, np.zeros((1, self.splits.shape[1]))])
        self.see(known)

    def see(self, runs: Pool) -> None:
        """More runs are known."""
        gain = runs.information.reshape(-1, 36) @ np.array(self.tangents).reshape(-1, 36).T
        for s in np.unique(runs.slot):
            self.largest[:, s] = np.maximum(self.largest[:, s], gain[runs.slot == s].max(axis=0))

    @property
    def table(self) -> Array:
        """Bound (T, M) of each split by each tangent."""
        return np.array(self.constant)[:, None] + self.task.replicates * self.largest @ self.splits.T

    @property
    def of_splits(self) -> Array:
        """The smallest bound (M,) of each split."""
        return np.asarray(self.table.min(axis=0))


def certify(
    task: Task, plan: Pool, sample: Pool, rng: np.random.Generator, *, starts: int = 48, gap: float = GAP
) -> Certificate:
    """The certificate of a plan of admissible runs; sample: a random pool, starts: climbs of the last search."""
    value = task.value(plan)
    if task.criterion.kind == "E":
        task = replace(task, criterion=task.criterion.smooth_with(SHARP))
    weight = 1.0 / task.demand.counts[task.group(plan)]
    design = ApproximateDesign(plan.joined(sample), np.arange(len(plan), dtype=np.intp), weight)
    design, pool_bound, rounds = _column_generation(task, design, rng, starts, gap)
    bound = bound_over(task, design.tangent(task), design.known)
    splits = splits_of(task.demand)
    if splits is not None and len(splits) > 1:
        bounds = _Bounds(task, splits)
        bounds.add(design.tangent(task), design.known)
        known, bound = _by_split(bounds, design.known, value, rng, starts, gap)
        design = solved_on_pool(task, replace(design, known=known))
    optimum = float(task.criterion.value(design.information(task)))
    relaxed = max(bound_over(task, design.tangent(task), design.known), value)
    design = design.without_light()
    bound = max(min(bound, relaxed), value)
    return Certificate(value / bound, bound, value, optimum, relaxed, min(value / max(pool_bound, value), 1.0),
                       starts * len(task.demand.counts), rounds, 0 if splits is None else len(splits),
                       design.known.take(design.active), design.weight, relaxed / optimum - 1, design.known)


def _column_generation(
    task: Task, design: ApproximateDesign, rng: np.random.Generator, starts: int, gap: float
) -> tuple[ApproximateDesign, float, int]:
    """The approximate optimum over continuous poses, the bound that the first pool alone would give, and the rounds it took."""
    pool_bound, few = np.inf, max(8, starts // 4)
    for rounds in range(1, MOST_ROUNDS + 1):
        design = solved_on_pool(task, design)
        tangent, optimum = design.tangent(task), float(task.criterion.value(design.information(task)))
        if rounds == 1:
            pool_bound = bound_over(task, tangent, design.known)
        last = rounds == MOST_ROUNDS
        design = _with_maximisers(task, tangent, design, rng, starts if last else few)
        relaxed = bound_over(task, tangent, design.known)
        if relaxed <= optimum * (1 + gap) and not last:
            design = _with_maximisers(task, tangent, design, rng, starts)
            relaxed = bound_over(task, tangent, design.known)
        if relaxed <= optimum * (1 + 2 * gap):
            break
    return design, pool_bound, rounds


def _with_maximisers(
    task: Task, tangent: Array, design: ApproximateDesign, rng: np.random.Generator, starts: int
) -> ApproximateDesign:
    return replace(design, known=design.known.joined(maximisers(task, tangent, design, rng, starts)))


def _by_split(
    bounds: _Bounds, known: Pool, value: float, rng: np.random.Generator, starts: int, gap: float
) -> tuple[Pool, float]:
    """Every run known after it, and the bound with whole numbers of runs a slot."""
    closed: set[int] = set()
    for _ in range(MOST_SOLVED):
        before = bounds.of_splits
        top = int(np.argmax(before))
        if top in closed or before[top] <= value * (1 + gap):
            break
        task, design = _of_split(bounds, top, known)
        for attempt in range(MOST_ROUNDS):
            design = solved_on_pool(task, design)
            tangent = design.tangent(task)
            optimum = float(task.criterion.value(design.information(task)))
            bounds.add(tangent, design.known)
            design = _climbed(bounds, task, tangent, design, rng, max(8, starts // 6))
            lowered = bounds.of_splits[top] < before[top] * (1 - 5 * gap) and attempt > 2
            if lowered or bounds.of_splits[top] <= optimum * (1 + gap):
                break
        if bounds.of_splits[top] <= max(optimum, value) * (1 + 2 * gap):
            closed.add(top)
            if top == int(np.argmax(bounds.of_splits)):      # it decides the bound: a deeper search
                design = _climbed(bounds, task, tangent, design, rng, starts)
        known = design.known
    return known, float(bounds.of_splits.max())


def _of_split(bounds: _Bounds, top: int, known: Pool) -> tuple[Task, ApproximateDesign]:
    """The task with a split's numbers of runs a slot, and where to begin: the runs that its lowest tangent finds best."""
    numbers = bounds.splits[top]
    slots = np.arange(len(numbers))
    demand = Demand(slots, np.repeat(slots, numbers).astype(np.intp))
    tangent, active = bounds.tangents[int(bounds.table[:, top].argmin())], np.empty(0, dtype=np.intp)
    gain = known.information.reshape(-1, 36) @ tangent.ravel()
    for s in np.flatnonzero(numbers):
        mine = np.flatnonzero(known.slot == s)
        active = np.concatenate([active, mine[np.argsort(-gain[mine])[:4]]])
    weight = np.concatenate([np.full(int((known.slot[active] == s).sum()), 1 / (known.slot[active] == s).sum())
                             for s in np.flatnonzero(numbers)])
    return replace(bounds.task, demand=demand), ApproximateDesign(known, active, weight)


def _climbed(
    bounds: _Bounds, task: Task, tangent: Array, design: ApproximateDesign, rng: np.random.Generator, starts: int
) -> ApproximateDesign:
    """The design with more runs known, which the bounds see."""
    climbed = maximisers(task, tangent, design, rng, starts)
    bounds.see(climbed)
    return replace(design, known=design.known.joined(climbed))


def bound_over(task: Task, tangent: Array, known: Pool) -> float:
    """`trace(H P) + sum of each run's largest trace(H m)` over the known runs."""
    gain = known.information.reshape(len(known), -1) @ tangent.ravel()
    group = task.group(known)
    largest = sum(float(count * gain[group == g].max()) for g, count in enumerate(task.demand.counts) if count)
    return float(np.sum(tangent * task.prior) + task.replicates * largest)

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

from dataclasses import dataclass
from itertools import combinations_with_replacement, product

import numpy as np
from numpy.typing import NDArray

from identification.design.approximate import LIGHT, maximisers, measure, solved_on_pool
from identification.design.criteria import Criterion
from identification.design.domain import Domain, Pool
from identification.design.exchange import Demand

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
    def words(self) -> str:
        """What is certified, with its condition."""
        return (f"at least {_percent(self.efficiency)} % efficient against every plan with as many runs and the same loads and "
                f"place, over continuous poses (equivalence theorem, poses as fractions{self._numbers}; its maxima were "
                f"searched from {self.starts} starts, not proved)")

    @property
    def _numbers(self) -> str:
        if self.splits < 2:
            return ""
        return f", runs an axis as whole numbers; {_percent(self.value / self.relaxed)} % with fractions of these too"


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

    def __init__(self, splits: Indices, prior: Array, replicates: int) -> None:
        self.splits, self.prior, self.replicates = splits, prior, replicates
        self.tangents: list[Array] = []
        self.constant: list[float] = []
        self.largest = np.empty((0, splits.shape[1]))

    def add(self, tangent: Array, known: Pool) -> None:
        """One more tangent, its maxima over the known runs."""
        self.tangents.append(tangent)
        self.constant.append(float(np.sum(tangent * self.prior)))
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
        return np.array(self.constant)[:, None] + self.replicates * self.largest @ self.splits.T

    @property
    def of_splits(self) -> Array:
        """The smallest bound (M,) of each split."""
        return np.asarray(self.table.min(axis=0))


def certify(
    domain: Domain, criterion: Criterion, prior: Array, demand: Demand, plan: Pool, sample: Pool, rng: np.random.Generator,
    *, replicates: int = 1, starts: int = 48, gap: float = GAP,
) -> Certificate:
    """The certificate of a plan of admissible runs; sample: a random pool, starts: climbs of the last search."""
    value = float(criterion.value(prior + replicates * plan.information.sum(axis=0)))
    known = plan.joined(sample)
    active = np.arange(len(plan), dtype=np.intp)
    weight = 1.0 / demand.counts[demand.groups[plan.slot]]
    criterion = criterion.smooth_with(SHARP) if criterion.kind == "E" else criterion
    pool_bound, rounds, few = np.inf, 0, max(8, starts // 4)
    while True:
        rounds += 1
        known, active, weight = solved_on_pool(known, active, weight, criterion, prior, demand, replicates)
        information = measure(known, active, weight, prior, demand, replicates)
        tangent = criterion.tangent(information)
        if rounds == 1:
            pool_bound = _bound(tangent, prior, known, demand, replicates)
        last = rounds >= MOST_ROUNDS
        known = known.joined(maximisers(domain, tangent, known, active, demand, rng, starts if last else few))
        relaxed = _bound(tangent, prior, known, demand, replicates)
        optimum = float(criterion.value(information))
        if relaxed <= optimum * (1 + gap) and not last:
            known = known.joined(maximisers(domain, tangent, known, active, demand, rng, starts))
            relaxed = _bound(tangent, prior, known, demand, replicates)
        if relaxed <= optimum * (1 + 2 * gap) or last:
            break
    splits = splits_of(demand)
    bound = relaxed
    if splits is not None and len(splits) > 1:
        bounds = _Bounds(splits, prior, replicates)
        bounds.add(tangent, known)
        known, bound = _by_split(domain, criterion, bounds, known, value, rng, starts, gap)
        known, active, weight = solved_on_pool(known, active, weight, criterion, prior, demand, replicates)
        information = measure(known, active, weight, prior, demand, replicates)
        tangent, optimum = criterion.tangent(information), float(criterion.value(information))
    kept = weight > LIGHT
    support, weight = known.take(active[kept]), weight[kept]
    relaxed = max(_bound(tangent, prior, known, demand, replicates), value)
    bound = max(min(bound, relaxed), value)
    return Certificate(value / bound, bound, value, optimum, relaxed, min(value / max(pool_bound, value), 1.0),
                       starts * len(demand.counts), rounds, 0 if splits is None else len(splits), support, weight,
                       relaxed / optimum - 1, known)


def _by_split(
    domain: Domain, criterion: Criterion, bounds: _Bounds, known: Pool, value: float, rng: np.random.Generator,
    starts: int, gap: float,
) -> tuple[Pool, float]:
    """The bound with whole numbers of runs a slot, and every run known after it."""
    closed: set[int] = set()
    slots = bounds.splits.shape[1]
    for _ in range(MOST_SOLVED):
        now = bounds.of_splits
        top = int(np.argmax(now))
        if top in closed or now[top] <= value * (1 + gap):
            break
        numbers = bounds.splits[top]
        demand = Demand(np.arange(slots), np.repeat(np.arange(slots), numbers).astype(np.intp))
        tangent, active = bounds.tangents[int(bounds.table[:, top].argmin())], np.empty(0, dtype=np.intp)
        gain = known.information.reshape(-1, 36) @ tangent.ravel()
        for s in np.flatnonzero(numbers):
            mine = np.flatnonzero(known.slot == s)
            active = np.concatenate([active, mine[np.argsort(-gain[mine])[:4]]])
        weight = np.concatenate([np.full(int((known.slot[active] == s).sum()), 1 / (known.slot[active] == s).sum())
                                 for s in np.flatnonzero(numbers)])
        for attempt in range(MOST_ROUNDS):
            known, active, weight = solved_on_pool(known, active, weight, criterion, bounds.prior, demand, bounds.replicates)
            information = measure(known, active, weight, bounds.prior, demand, bounds.replicates)
            tangent = criterion.tangent(information)
            bounds.add(tangent, known)
            climbed = maximisers(domain, tangent, known, active, demand, rng, max(8, starts // 6))
            known = known.joined(climbed)
            bounds.see(climbed)
            reached = float(criterion.value(information))
            lowered = bounds.of_splits[top] < now[top] * (1 - 5 * gap) and attempt > 2
            if lowered or bounds.of_splits[top] <= reached * (1 + gap):
                break
        if bounds.of_splits[top] <= max(reached, value) * (1 + 2 * gap):
            closed.add(top)
            if top == int(np.argmax(bounds.of_splits)):      # it decides the bound: a deeper search
                climbed = maximisers(domain, tangent, known, active, demand, rng, starts)
                known = known.joined(climbed)
                bounds.see(climbed)
    return known, float(bounds.of_splits.max())


def _bound(tangent: Array, prior: Array, known: Pool, demand: Demand, replicates: int) -> float:
    """`trace(H P) + sum of each run's largest trace(H m)` over the known runs."""
    gain = known.information.reshape(-1, 36) @ tangent.ravel()
    group = demand.groups[known.slot]
    largest = sum(float(count * gain[group == g].max()) for g, count in enumerate(demand.counts) if count)
    return float(np.sum(tangent * prior) + replicates * largest)

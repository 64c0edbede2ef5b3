"""How far a plan is from the best there could be: the general equivalence theorem over continuous poses.

Every N-run plan has `M* = P + sum m(u_i)`. For any H with `Phi(M*) <= trace(H M*)` (criteria.py)

    Phi(M*) <= trace(H P) + sum_i max_u trace(H m(u)) = bound ,        plan's efficiency >= Phi(M) / bound .

The bound is smallest where H belongs to the approximate optimum: the weights w over runs u that maximise
`Phi(P + N sum w_j m(u_j))` (Kiefer and Wolfowitz 1960; with a prior Pilz 1991). It is found by column generation: solve the
weights over the runs known so far, search for runs with larger `trace(H m(u))` over continuous poses, add them, solve again.

The maximum over u is searched from many starts, not proved: that is the certificate's condition, and it is said with it. A
maximum taken over a sampled pool alone would be false comfort: it certifies against the pool, not against what a robot can do.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.design.criteria import Criterion
from identification.design.domain import Domain, Pool
from identification.design.exchange import Demand
from identification.design.refine import climb

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
MOST_ROUNDS = 25
GAP = 1e-3
LIGHT = 1e-7
# A sharper matrix mean than the search needs: the bound of E loses at most 6^(1/p) - 1 by it.
SHARP = 640.0


@dataclass(frozen=True, eq=False)
class Certificate:
    """efficiency: what the plan certainly has of the best N-run plan, if the maxima were found. bound: no plan's Phi is larger.
    value: the plan's. optimum: Phi of the approximate optimum found. pool_efficiency: what a certificate over the sampled pool
    alone would claim. starts: climbs of the last search; rounds: of column generation. support: the approximate optimum's runs
    with their weights (n,), a share of their group. gap: bound / optimum - 1. pool: every run known at the end."""

    efficiency: float
    bound: float
    value: float
    optimum: float
    pool_efficiency: float
    starts: int
    rounds: int
    support: Pool
    weights: Array
    gap: float
    pool: Pool

    @property
    def words(self) -> str:
        """What is certified, with its condition."""
        share = 100 * np.floor(1e3 * self.efficiency) / 1e3
        return (f"at least {share:.1f} % efficient against every plan with as many runs and the "
                f"same loads and place, over continuous poses (equivalence theorem; its maximum was searched from "
                f"{self.starts} starts, not proved)")


def best_weights(criterion: Criterion, prior: Array, pieces: Array, group: Indices, counts: Indices, start: Array) -> Array:
    """Weights (n,), each group's summing to one, that maximise the smooth criterion of `prior + sum counts w m`.

    pieces (n, 6, 6): the runs' information, replicates included; group (n,); start (n,) weights to begin with.
    """
    from scipy.optimize import minimize

    scaled = pieces * counts[group][:, None, None]
    flat = scaled.reshape(len(scaled), 36)

    def objective(weight: Array) -> tuple[float, Array]:
        information = prior + np.einsum("n,nij->ij", weight, scaled)
        return -float(np.log(criterion.smooth(information))), -flat @ criterion.slope(information).ravel()

    sums = (group[None, :] == np.unique(group)[:, None]).astype(float)
    whole: Any = {"type": "eq", "fun": lambda w: sums @ w - 1.0, "jac": lambda w: sums}
    goal: Any = objective
    found = minimize(goal, start, jac=True, method="SLSQP", bounds=[(0.0, 1.0)] * len(start), constraints=[whole],
                     options={"maxiter": 200, "ftol": 1e-10})
    weight = np.clip(np.where(np.isfinite(found.x), found.x, start), 0.0, None)
    weight /= (sums.T @ (sums @ weight))
    return weight if objective(weight)[0] <= objective(start)[0] else start


def certify(
    domain: Domain, criterion: Criterion, prior: Array, demand: Demand, plan: Pool, sample: Pool, rng: np.random.Generator,
    *, replicates: int = 1, starts: int = 48, gap: float = GAP,
) -> Certificate:
    """The certificate of a plan of admissible runs; sample: a random pool, starts: climbs of the last search."""
    counts = demand.counts
    groups = int(demand.groups.max()) + 1
    value = float(criterion.value(prior + replicates * plan.information.sum(axis=0)))
    known = plan.joined(sample)
    active = np.arange(len(plan), dtype=np.intp)
    weight = 1.0 / counts[demand.groups[plan.slot]]
    criterion = criterion.smooth_with(SHARP) if criterion.kind == "E" else criterion
    pool_bound, rounds = np.inf, 0
    while True:
        rounds += 1
        known, active, weight = _solved_on_pool(known, active, weight, criterion, prior, demand, replicates)
        information = _measure(known, active, weight, prior, demand, replicates)
        tangent = criterion.tangent(information)
        if rounds == 1:
            pool_bound = _bound(tangent, prior, known, demand, replicates)
        last = rounds >= MOST_ROUNDS
        climbed = _maximisers(domain, tangent, known, active, demand, rng, starts if last else max(8, starts // 4))
        bound = _bound(tangent, prior, known.joined(climbed), demand, replicates)
        optimum = float(criterion.value(information))
        if bound <= optimum * (1 + gap) or last:
            if not last:
                deep = _maximisers(domain, tangent, known, active, demand, rng, starts)
                climbed = climbed.joined(deep)
                bound = _bound(tangent, prior, known.joined(climbed), demand, replicates)
            if bound <= optimum * (1 + 2 * gap) or last:
                break
        known = known.joined(climbed)
    known = known.joined(climbed)
    bound = max(bound, value)
    kept = weight > LIGHT
    return Certificate(value / bound, bound, value, optimum, min(value / max(pool_bound, value), 1.0), starts * groups, rounds,
                       known.take(active[kept]), weight[kept], bound / optimum - 1, known)


def _measure(known: Pool, active: Indices, weight: Array, prior: Array, demand: Demand, replicates: int) -> Array:
    """Information (6, 6) of the approximate design."""
    chosen = known.take(active)
    share = replicates * weight * demand.counts[demand.groups[chosen.slot]]
    return np.asarray(prior + np.einsum("n,nij->ij", share, chosen.information))


def _bound(tangent: Array, prior: Array, known: Pool, demand: Demand, replicates: int) -> float:
    """`trace(H P) + sum of each run's largest trace(H m)` over the known runs."""
    gain = known.information.reshape(-1, 36) @ tangent.ravel()
    group = demand.groups[known.slot]
    largest = sum(float(count * gain[group == g].max()) for g, count in enumerate(demand.counts) if count)
    return float(np.sum(tangent * prior) + replicates * largest)


def _solved_on_pool(
    known: Pool, active: Indices, weight: Array, criterion: Criterion, prior: Array, demand: Demand, replicates: int
) -> tuple[Pool, Indices, Array]:
    """The best weights over all known runs: those that promise most join the active ones until none promises more."""
    flat = known.information.reshape(-1, 36)
    group = demand.groups[known.slot]
    for _ in range(40):
        weight = best_weights(criterion, prior, replicates * known.information[active], group[active], demand.counts, weight)
        kept = weight > LIGHT
        active, weight = active[kept], weight[kept]
        gain = flat @ criterion.slope(_measure(known, active, weight, prior, demand, replicates)).ravel()
        joining: list[int] = []
        for g, count in enumerate(demand.counts):
            mine = np.flatnonzero(group == g)
            if count:
                level = float(gain[active[group[active] == g]].max())
                best = mine[np.argsort(-gain[mine])[:6]]
                joining += [int(i) for i in best if gain[i] > level * (1 + 2e-4) and i not in active]
        if not joining:
            break
        active = np.concatenate([active, np.array(joining, dtype=np.intp)])
        weight = np.concatenate([weight * (1 - 1e-3), np.zeros(len(joining))])
        for g in np.unique(group[active]):
            rows = group[active] == g
            fresh = rows & (weight == 0)
            weight[fresh] = (1 - weight[rows].sum()) / max(int(fresh.sum()), 1)
            weight[rows] /= weight[rows].sum()
    return known, active, weight


def _maximisers(
    domain: Domain, tangent: Array, known: Pool, active: Indices, demand: Demand, rng: np.random.Generator, starts: int
) -> Pool:
    """Local maxima of `trace(H m(u))` over continuous poses, climbed to from the best known runs, the support and random ones;
    `starts` a group, spread over slots and positions."""
    gain = known.information.reshape(-1, 36) @ tangent.ravel()
    group = demand.groups[known.slot]
    found: list[Pool] = []
    for g, count in enumerate(demand.counts):
        if not count:
            continue
        mine = np.flatnonzero(group == g)
        level = float(gain[mine].max())
        kinds = known.slot[mine] * domain.places + known.place[mine]
        picked: list[int] = active[group[active] == g].tolist()[: starts // 4]
        each = max(1, (starts - len(picked)) // (2 * len(np.unique(kinds))))
        for kind in np.unique(kinds):
            same = mine[kinds == kind]
            picked += _apart(known, same[np.argsort(-gain[same])], each)
        left = max(0, starts - len(picked))
        promising = mine[gain[mine] >= 0.3 * level]
        picked += rng.choice(promising, min(left, len(promising)), replace=False).tolist()
        for i in dict.fromkeys(picked):
            top = climb(domain, tangent, known.take(np.array([i])))
            if top.feasible:
                found.append(top.runs)
    if not found:
        return known.take(np.zeros(len(known), dtype=bool))
    result = found[0]
    for more in found[1:]:
        result = result.joined(more)
    return result


def _apart(known: Pool, ranked: Indices, count: int) -> list[int]:
    """The first `count` of the ranked runs that are at least 0.3 rad from each other in some joint."""
    picked: list[int] = []
    for i in ranked[:400]:
        if all(np.abs(known.theta[i] - known.theta[j]).max() > 0.3 for j in picked):
            picked.append(int(i))
            if len(picked) == count:
                break
    return picked

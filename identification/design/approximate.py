"""Approximate designs: weights over runs in place of counts, which makes the best plan a concave problem.

The weights over the runs known so far are solved exactly, those of each group summing to one; better runs are then searched
for over continuous poses where the tangent promises them (column generation).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.design.criteria import Criterion
from identification.design.domain import Domain, Pool
from identification.design.exchange import Demand
from identification.design.refine import climb

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
LIGHT = 1e-7


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


def measure(known: Pool, active: Indices, weight: Array, prior: Array, demand: Demand, replicates: int) -> Array:
    """Information (6, 6) of the approximate design."""
    chosen = known.take(active)
    share = replicates * weight * demand.counts[demand.groups[chosen.slot]]
    return np.asarray(prior + np.einsum("n,nij->ij", share, chosen.information))


def solved_on_pool(
    known: Pool, active: Indices, weight: Array, criterion: Criterion, prior: Array, demand: Demand, replicates: int
) -> tuple[Pool, Indices, Array]:
    """The best weights over all known runs: those that promise most join the active ones until none promises more."""
    flat = known.information.reshape(-1, 36)
    group = demand.groups[known.slot]
    for _ in range(40):
        weight = best_weights(criterion, prior, replicates * known.information[active], group[active], demand.counts, weight)
        kept = weight > LIGHT
        active, weight = active[kept], weight[kept]
        gain = flat @ criterion.slope(measure(known, active, weight, prior, demand, replicates)).ravel()
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


def maximisers(
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

"""Approximate designs: weights over runs in place of counts, which makes the best plan a concave problem.

The weights over the runs known so far are solved exactly, those of each group summing to one; better runs are then searched
for over continuous poses where the tangent promises them (column generation).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.design.domain import Pool
from identification.design.refine import climb
from identification.design.task import Task

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
LIGHT = 1e-7


@dataclass(frozen=True, eq=False)
class ApproximateDesign:
    """known: every run looked at so far. active (n,): rows of those with a weight; weight (n,), each group's of sum one."""

    known: Pool
    active: Indices
    weight: Array

    def information(self, task: Task) -> Array:
        """Precision (6, 6) of ln c after it."""
        return task.approximate_information(self.known.take(self.active), self.weight)

    def tangent(self, task: Task) -> Array:
        """H (6, 6) of the equivalence theorem there."""
        return task.criterion.tangent(self.information(task))

    def without_light(self) -> ApproximateDesign:
        """The same without runs whose weight is next to nothing."""
        kept = self.weight > LIGHT
        return ApproximateDesign(self.known, self.active[kept], self.weight[kept])


def best_weights(task: Task, runs: Pool, start: Array) -> Array:
    """Weights (n,), each group's summing to one, that maximise the smooth criterion of `prior + sum counts w m`; start (n,)."""
    from scipy.optimize import minimize

    criterion, group = task.criterion, task.group(runs)
    scaled = task.replicates * runs.information * task.demand.counts[group][:, None, None]
    flat = scaled.reshape(len(scaled), -1)

    def objective(weight: Array) -> tuple[float, Array]:
        information = task.prior + (weight @ flat).reshape(task.prior.shape)
        return -float(np.log(criterion.smooth(information))), -flat @ criterion.slope(information).ravel()

    sums = (group[None, :] == np.unique(group)[:, None]).astype(float)
    whole: Any = {"type": "eq", "fun": lambda w: sums @ w - 1.0, "jac": lambda w: sums}
    goal: Any = objective
    answer = minimize(goal, start, jac=True, method="SLSQP", bounds=[(0.0, 1.0)] * len(start), constraints=[whole],
                      options={"maxiter": 200, "ftol": 1e-10})
    weight = np.clip(np.where(np.isfinite(answer.x), answer.x, start), 0.0, None)
    weight /= (sums.T @ (sums @ weight))
    return weight if objective(weight)[0] <= objective(start)[0] else start


def solved_on_pool(task: Task, design: ApproximateDesign) -> ApproximateDesign:
    """The best weights over all known runs: those that promise most join the active ones until none promises more."""
    known = design.known
    flat = known.information.reshape(len(known), -1)
    group = task.group(known)
    for _ in range(40):
        weight = best_weights(task, known.take(design.active), design.weight)
        design = ApproximateDesign(known, design.active, weight).without_light()
        gain = flat @ task.criterion.slope(design.information(task)).ravel()
        joining = _joining(task, design, group, gain)
        if not joining:
            break
        active = np.concatenate([design.active, np.array(joining, dtype=np.intp)])
        weight = np.concatenate([design.weight * (1 - 1e-3), np.zeros(len(joining))])
        for g in np.unique(group[active]):
            rows = group[active] == g
            fresh = rows & (weight == 0)
            weight[fresh] = (1 - weight[rows].sum()) / max(int(fresh.sum()), 1)
            weight[rows] /= weight[rows].sum()
        design = ApproximateDesign(known, active, weight)
    return design


def _joining(task: Task, design: ApproximateDesign, group: Indices, gain: Array) -> list[int]:
    """Rows of the known runs that promise more than the active ones of their group: the best few."""
    joining: list[int] = []
    for g, count in enumerate(task.demand.counts):
        mine = np.flatnonzero(group == g)
        if count:
            level = float(gain[design.active[group[design.active] == g]].max())
            best = mine[np.argsort(-gain[mine])[:6]]
            joining += [int(i) for i in best if gain[i] > level * (1 + 2e-4) and i not in design.active]
    return joining


def maximisers(task: Task, tangent: Array, design: ApproximateDesign, rng: np.random.Generator, starts: int) -> Pool:
    """Local maxima of `trace(H m(u))` over continuous poses, climbed to from the best known runs, the support and random ones;
    `starts` a group, spread over slots and positions."""
    known, active = design.known, design.active
    gain = known.information.reshape(len(known), -1) @ tangent.ravel()
    group = task.group(known)
    tops: list[Pool] = []
    for g, count in enumerate(task.demand.counts):
        if not count:
            continue
        mine = np.flatnonzero(group == g)
        level = float(gain[mine].max())
        stands = known.slot[mine] * task.domain.places + known.place[mine]
        picked: list[int] = active[group[active] == g].tolist()[: starts // 4]
        each = max(1, (starts - len(picked)) // (2 * len(np.unique(stands))))
        for stand in np.unique(stands):
            same = mine[stands == stand]
            picked += _apart(known, same[np.argsort(-gain[same])], each)
        left = max(0, starts - len(picked))
        promising = mine[gain[mine] >= 0.3 * level]
        picked += rng.choice(promising, min(left, len(promising)), replace=False).tolist()
        for i in dict.fromkeys(picked):
            top = climb(task.domain, tangent, known.take(np.array([i])))
            if top.feasible:
                tops.append(top.runs)
    return Pool.of(tops) if tops else known.take(np.zeros(len(known), dtype=bool))


def _apart(known: Pool, ranked: Indices, count: int) -> list[int]:
    """The first `count` of the ranked runs that are at least 0.3 rad from each other in some joint."""
    picked: list[int] = []
    for i in ranked[:400]:
        if all(np.abs(known.theta[i] - known.theta[j]).max() > 0.3 for j in picked):
            picked.append(int(i))
            if len(picked) == count:
                break
    return picked

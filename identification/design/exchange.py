"""Exchange over a finite pool: which runs to take, one replaced at a time while that helps (Fedorov 1972).

Replacing a run by u gives `Phi(M- + m_u) <= Phi(M-) + trace(grad Phi(M-) m_u)`; only the runs whose bound is largest are
looked at exactly, which is exact as long as the best found beats the next bound, and nearly so otherwise.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from identification.design.domain import Pool
from identification.design.task import Task

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
# So many of six by six; fewer of larger matrices, each of which takes longer.
EXACT = 250
MOST_SWEEPS = 30


def exchange(task: Task, pool: Pool, rng: np.random.Generator, start: Indices | None = None) -> tuple[Indices, float]:
    """Rows (N,) of the pool that make a plan which no single replacement improves, and its value of the smooth criterion.

    start (N,): where to begin, random where None.
    """
    criterion, demand, replicates = task.criterion, task.demand, task.replicates
    group = task.group(pool)
    members = [np.flatnonzero(group == g) for g in range(int(demand.groups.max()) + 1)]
    pieces = [replicates * pool.information[rows] for rows in members]
    flat = [piece.reshape(len(piece), -1) for piece in pieces]
    chosen = np.array([rng.choice(members[g]) for g in demand.wanted]) if start is None else start.copy()
    total = task.information(pool.take(chosen))
    best = float(criterion.smooth(total))
    exact = EXACT * 6 // len(total)
    for _ in range(MOST_SWEEPS):
        before = best
        for i in rng.permutation(len(chosen)):
            g = int(demand.wanted[i])
            rest = total - replicates * pool.information[chosen[i]]
            slope = criterion.slope(rest)
            if criterion.kind == "E":
                slope = slope + 1e-3 * np.linalg.inv(rest)      # a matrix mean's slope looks at one direction only
            promise = flat[g] @ slope.ravel()
            few = np.argpartition(promise, -exact)[-exact:] if len(promise) > exact else np.arange(len(promise))
            values = criterion.smooth(rest + pieces[g][few])
            k = int(np.argmax(values))
            if values[k] > best * (1 + 1e-10):
                best = float(values[k])
                chosen[i] = members[g][few[k]]
                total = rest + pieces[g][few[k]]
        if best <= before * (1 + 1e-9):
            break
    return chosen, best


def many_exchanges(task: Task, pool: Pool, rng: np.random.Generator, starts: int) -> list[tuple[Indices, float]]:
    """Plans (rows of the pool, value) from `starts` random starts, different ones only, best first."""
    wanted = task.demand.wanted
    values: dict[tuple[int, ...], float] = {}
    for _ in range(starts):
        chosen, value = exchange(task, pool, rng)
        order = np.lexsort((chosen, wanted))
        values[tuple(chosen[order].tolist())] = value
    ranked = sorted(values.items(), key=lambda item: -item[1])
    # Back in the demand's order: the groups of a sorted plan stand in ascending order.
    place = np.argsort(np.argsort(wanted, kind="stable"), kind="stable")
    assert np.array_equal(np.sort(wanted)[place], wanted)
    return [(np.array(plan)[place], value) for plan, value in ranked]

"""Exchange over a finite pool: which runs to take, one replaced at a time while that helps (Fedorov 1972).

Replacing a run by u gives `Phi(M- + m_u) <= Phi(M-) + trace(grad Phi(M-) m_u)`; only the runs whose bound is largest are
looked at exactly, which is exact as long as the best found beats the next bound, and nearly so otherwise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.design.criteria import Criterion
from identification.design.domain import Pool

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
EXACT = 250
MOST_SWEEPS = 30


@dataclass(frozen=True, eq=False)
class Demand:
    """What a plan must hold: for each of its N runs the group it comes from. groups (S,): the group of each slot; wanted (N,):
    the group of each run. With one group any run may have any slot; the paper's plan has a group a slot."""

    groups: Indices
    wanted: Indices

    @property
    def counts(self) -> Indices:
        """Runs a group (groups,)."""
        return np.bincount(self.wanted, minlength=int(self.groups.max()) + 1)

    def __len__(self) -> int:
        return len(self.wanted)


def free_demand(slots: int, runs: int) -> Demand:
    """`runs` runs, each with any of the slots."""
    return Demand(np.zeros(slots, dtype=np.intp), np.zeros(runs, dtype=np.intp))


def exchange(
    pool: Pool, criterion: Criterion, prior: Array, demand: Demand, rng: np.random.Generator, start: Indices | None = None,
    replicates: int = 1,
) -> tuple[Indices, float]:
    """Indices (N,) of a plan that no single replacement improves, and its value of the smooth criterion.

    start: where to begin, random where None. prior (6, 6): precision before the runs. replicates: visits a run.
    """
    group = demand.groups[pool.slot]
    members = [np.flatnonzero(group == g) for g in range(int(demand.groups.max()) + 1)]
    pieces = [replicates * pool.information[rows] for rows in members]
    flat = [piece.reshape(len(piece), 36) for piece in pieces]
    chosen = np.array([rng.choice(members[g]) for g in demand.wanted]) if start is None else start.copy()
    total = prior + replicates * pool.information[chosen].sum(axis=0)
    best = float(criterion.smooth(total))
    for _ in range(MOST_SWEEPS):
        before = best
        for i in rng.permutation(len(chosen)):
            g = int(demand.wanted[i])
            rest = total - replicates * pool.information[chosen[i]]
            slope = criterion.slope(rest)
            if criterion.kind == "E":
                slope = slope + 1e-3 * np.linalg.inv(rest)      # a matrix mean's slope looks at one direction only
            promise = flat[g] @ slope.ravel()
            few = np.argpartition(promise, -EXACT)[-EXACT:] if len(promise) > EXACT else np.arange(len(promise))
            values = criterion.smooth(rest + pieces[g][few])
            k = int(np.argmax(values))
            if values[k] > best * (1 + 1e-10):
                best = float(values[k])
                chosen[i] = members[g][few[k]]
                total = rest + pieces[g][few[k]]
        if best <= before * (1 + 1e-9):
            break
    return chosen, best


def many_exchanges(
    pool: Pool, criterion: Criterion, prior: Array, demand: Demand, rng: np.random.Generator, starts: int, replicates: int = 1,
) -> list[tuple[Indices, float]]:
    """Plans from `starts` random starts, different ones only, best first."""
    found: dict[tuple[int, ...], float] = {}
    for _ in range(starts):
        chosen, value = exchange(pool, criterion, prior, demand, rng, replicates=replicates)
        order = np.lexsort((chosen, demand.wanted))
        found[tuple(chosen[order].tolist())] = value
    ranked = sorted(found.items(), key=lambda item: -item[1])
    wanted = np.sort(demand.wanted)
    # Back in the demand's order: the groups of a sorted plan stand in ascending order.
    place = np.argsort(np.argsort(demand.wanted, kind="stable"), kind="stable")
    assert np.array_equal(wanted[place], demand.wanted)
    return [(np.array(plan)[place], value) for plan, value in ranked]

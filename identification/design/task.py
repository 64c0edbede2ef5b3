"""What is asked of a plan: the admissible runs, how many of which, and what they are judged by."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.design.criteria import Criterion
from identification.design.domain import Domain, Pool

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


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


@dataclass(frozen=True, eq=False)
class Task:
    """What is asked for. prior (6, 6): precision of ln c before the runs. replicates: visits a run, each re-seated."""

    domain: Domain
    criterion: Criterion
    prior: Array
    demand: Demand
    replicates: int = 1

    def group(self, runs: Pool) -> Indices:
        """The group (n,) that each run may stand for."""
        return np.asarray(self.demand.groups[runs.slot])

    def information(self, runs: Pool) -> Array:
        """Precision (6, 6) of ln c after the runs."""
        return np.asarray(self.prior + self.replicates * runs.information.sum(axis=0))

    def approximate_information(self, support: Pool, weights: Array) -> Array:
        """Precision (6, 6) of ln c after an approximate design: weights (n,), those of each group of sum one."""
        share = self.replicates * weights * self.demand.counts[self.group(support)]
        return np.asarray(self.prior + np.einsum("n,nij->ij", share, support.information))

    def value(self, runs: Pool) -> float:
        """The criterion's Phi after the runs."""
        return float(self.criterion.value(self.information(runs)))

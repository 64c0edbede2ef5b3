"""The order of the runs: little motion between them, no axis early or late.

A drift of the sensors or of the robot's warmth that grows with time looks like a stiffness where all loads along one axis come
last. The order minimises the travelling time of the slowest joint plus a penalty for axes whose mean place in the order
is off the middle, from many random orders by reversals (2-opt). Later passes of a replicated plan run backwards, which cancels
a linear drift; load cycles change their sign from run to run of an axis.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from identification.design.domain import Pool

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
STARTS = 60
# Seconds of travel a mean place that is off by half the plan is worth.
BALANCE_S = 30.0


def load_axes(runs: Pool) -> Indices:
    """What the order balances (n,): the slots, or the base axis nearest to the line where each run has one of its own."""
    return runs.slot if len(np.unique(runs.slot)) > 1 else np.abs(runs.line).argmax(axis=1).astype(np.intp)


def travel(theta: Array, speed: Array) -> Array:
    """Time (n, n) [s] of the slowest joint between each two of n poses (n, 6) [rad]."""
    return np.asarray((np.abs(theta[:, None] - theta[None]) / speed).max(axis=2))


def imbalance(order: Indices, slot: Indices) -> float:
    """How far the slots' mean places are from the middle, in halves of the plan: 0 balanced, 0.5 all of one slot before all of
    another."""
    place = np.empty(len(order))
    place[order] = np.arange(len(order)) - (len(order) - 1) / 2
    means = [abs(place[slot == s].mean()) for s in np.unique(slot)]
    return float(max(means) / (len(order) / 2)) if len(means) > 1 else 0.0


def run_order(theta: Array, slot: Indices, speed: Array, rng: np.random.Generator) -> Indices:
    """Order (n,) of the runs."""
    count = len(theta)
    time = travel(theta, speed)

    def cost(order: Indices) -> float:
        return float(time[order[:-1], order[1:]].sum()) + BALANCE_S * imbalance(order, slot)

    best, least = np.arange(count), np.inf
    for _ in range(STARTS):
        order = rng.permutation(count)
        now, improved = cost(order), True
        while improved:
            improved = False
            for i in range(count - 1):
                for j in range(i + 1, count):
                    turned = order.copy()
                    turned[i:j + 1] = turned[i:j + 1][::-1]
                    value = cost(turned)
                    if value < now - 1e-9:
                        order, now, improved = turned, value, True
            if count > 20:
                break
        if now < least:
            best, least = order, now
    return best

"""Plans out of a pool of runs of which everything is known: against every other plan, and against optima worked out by hand."""

from __future__ import annotations

from itertools import combinations_with_replacement
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from identification.design.approximate import ApproximateDesign, best_weights, solved_on_pool
from identification.design.criteria import Criterion, a_criterion, d_criterion, e_criterion
from identification.design.domain import Pool
from identification.design.exchange import exchange, many_exchanges
from identification.design.task import Demand, Task

NOWHERE: Any = None
CRITERIA = [d_criterion(), a_criterion(), e_criterion()]


def runs_of(slots: list[int], told: np.ndarray) -> Pool:
    count = len(slots)
    return Pool(np.arange(6.0 * count).reshape(count, 6), np.array(slots), np.zeros(count, dtype=int),
                np.tile([1.0, 0, 0], (count, 1)), told)


def random_runs(slots: list[int], seed: int, rank: int = 2) -> Pool:
    roots = np.random.default_rng(seed).normal(size=(len(slots), 6, rank))
    return runs_of(slots, roots @ np.swapaxes(roots, 1, 2))


def task_of(criterion: Criterion, groups: list[int], wanted: list[int], replicates: int = 1, prior: float = 0.1) -> Task:
    return Task(NOWHERE, criterion, prior * np.eye(6), Demand(np.array(groups), np.array(wanted)), replicates)


def value(task: Task, pool: Pool, chosen: np.ndarray) -> float:
    return float(task.criterion.smooth(task.prior + task.replicates * pool.information[chosen].sum(axis=0)))


@pytest.mark.parametrize("criterion", CRITERIA, ids=["D", "A", "E"])
def test_no_single_replacement_makes_an_exchanged_plan_better(criterion) -> None:
    """Runs of the group that is wanted there, the value that of the plan; from any start, which stays as it was."""
    slots = [0, 1, 2] * 8
    pool, task = random_runs(slots, 1), task_of(criterion, [0, 1, 0], [1, 0, 0, 1], 2)
    group = np.array([0, 1, 0])[slots]
    start = np.array([1, 0, 2, 4])
    for begun in (None, start):
        chosen, found = exchange(task, pool, np.random.default_rng(2), begun)
        assert group[chosen].tolist() == [1, 0, 0, 1]
        assert found == pytest.approx(value(task, pool, chosen), rel=1e-9)
        for place in range(4):
            for other in np.flatnonzero(group == group[chosen[place]]):
                changed = chosen.copy()
                changed[place] = other
                assert value(task, pool, changed) <= found * (1 + 1e-8)
    assert start.tolist() == [1, 0, 2, 4]


def test_of_large_pools_as_many_are_looked_at_exactly_as_promise_most() -> None:
    """A run that tells a hundred times as much as any of two thousand others is found wherever it stands."""
    pool = random_runs([0] * 2000, 3)
    pool.information[[7, 1990]] *= 100
    chosen, _ = exchange(task_of(a_criterion(), [0], [0] * 6), pool, np.random.default_rng(4))
    assert {7, 1990} <= set(chosen.tolist())


@pytest.mark.parametrize("criterion", CRITERIA, ids=["D", "A", "E"])
def test_many_exchanges_find_the_best_of_all_plans(criterion) -> None:
    """Every plan once, the best first, its runs in the order in which their groups are wanted."""
    slots = [0, 1] * 5
    pool, task = random_runs(slots, 5), task_of(criterion, [0, 1], [1, 0, 1, 0, 0])
    best = max(value(task, pool, np.array([*odd, *even])) for odd in combinations_with_replacement(range(1, 10, 2), 2)
               for even in combinations_with_replacement(range(0, 10, 2), 3))
    plans = many_exchanges(task, pool, np.random.default_rng(6), 30)
    assert plans[0][1] == pytest.approx(best)
    assert len({tuple(sorted(chosen.tolist())) for chosen, _ in plans}) == len(plans) < 30
    assert [found for _, found in plans] == sorted((found for _, found in plans), reverse=True)
    for chosen, found in plans:
        assert (np.array(slots)[chosen] == [1, 0, 1, 0, 0]).all()
        assert value(task, pool, chosen) == pytest.approx(found)


SHARES = np.array([1.0, 4, 9, 16, 25, 36])


@pytest.mark.parametrize(("criterion", "power"), [(d_criterion(), 0), (a_criterion(), 1), (e_criterion().smooth_with(40), 40)],
                         ids=["D", "A", "E"])
def test_the_best_weights_are_those_of_theory(criterion, power) -> None:
    """Of runs that tell each of one parameter, by the matrix mean of power p (D: 0, A: 1): shares ^ (-p / (p + 1))."""
    weight = SHARES ** (-power / (power + 1))
    weight /= weight.sum()
    pool = runs_of([0] * 8, np.concatenate([np.array([np.diag(row) for row in np.diag(SHARES)]), np.zeros((2, 6, 6))]))
    task = task_of(criterion, [0], [0] * 3, 2, 1e-9)
    found = best_weights(task, pool, np.full(8, 1 / 8))
    assert_allclose(found, [*weight, 0, 0], atol=2e-4)
    assert found.sum() == pytest.approx(1)
    design = solved_on_pool(task, ApproximateDesign(pool, np.array([6, 0]), np.array([0.5, 0.5])))
    assert sorted(design.active.tolist()) == [0, 1, 2, 3, 4, 5]
    assert_allclose(design.weight[np.argsort(design.active)], weight, atol=2e-4)
    assert_allclose(design.information(task), np.diag(1e-9 + 2 * 3 * design.weight[np.argsort(design.active)] * SHARES))
    assert_allclose(design.tangent(task), criterion.tangent(design.information(task)))


@pytest.mark.parametrize("criterion", CRITERIA, ids=["D", "A", "E"])
def test_a_solved_design_is_the_best_over_its_pool(criterion) -> None:
    """By the equivalence theorem: no run promises more than the active ones of its group. A group's weights make one."""
    slots = [0, 1, 2] * 20
    pool, task = random_runs(slots, 8, 1), task_of(criterion, [0, 1, 2], [0, 0, 0, 2], prior=1e-2)
    group = np.array(slots)
    design = solved_on_pool(task, ApproximateDesign(pool, np.array([0, 2]), np.ones(2)))
    for g in (0, 2):
        mine = group[design.active] == g
        assert design.weight[mine].sum() == pytest.approx(1)
        told = np.einsum("nij,ij->n", pool.information, criterion.slope(design.information(task)))
        assert told[group == g].max() <= told[design.active[mine]].max() * (1 + 3e-4)
    assert set(group[design.active]) == {0, 2}
    counts = np.array([3, 0, 1])[group[design.active]]
    expected = task.prior + np.einsum("n,nij->ij", counts * design.weight, pool.information[design.active])
    assert_allclose(design.information(task), expected)
    before = float(criterion.smooth(ApproximateDesign(pool, np.array([0, 2]), np.ones(2)).information(task)))
    assert float(criterion.smooth(expected)) > 1.5 * before


def test_runs_of_next_to_no_weight_are_left_out() -> None:
    pool = random_runs([0] * 4, 9)
    design = ApproximateDesign(pool, np.array([3, 1, 2]), np.array([0.5, 0.9e-7, 1.1e-7])).without_light()
    assert (design.active.tolist(), design.weight.tolist()) == ([3, 2], [0.5, 1.1e-7])

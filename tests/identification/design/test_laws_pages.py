"""The figures of a plan's report: their numbers worked out once more from the runs, of plans made up."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from identification.common.chart import AXIS_COLOURS
from identification.common.scene import SpaceLine
from identification.design import pages
from identification.design.criteria import d_criterion
from identification.design.domain import Domain, Pool
from identification.design.forecast import Forecast
from identification.design.sheet import Sheet, sheet_of
from identification.design.task import Demand, Task
from identification.model.kinematics import forward


@pytest.fixture(scope="module")
def task(domain: Domain, prior: np.ndarray) -> Task:
    """Two runs along x or y, four along z, each visited three times."""
    return Task(domain, d_criterion(), prior, Demand(np.array([0, 0, 1]), np.array([0, 0, 1, 1, 1, 1])), 3)


@pytest.fixture(scope="module")
def sheet(task: Task, pool: Pool) -> tuple[Pool, Sheet]:
    """Five runs, the fourth kept back."""
    runs = pool.take(np.array([0, 11, 22, 33, 44]))
    held = np.arange(5) == 3
    return runs, sheet_of(runs, task.domain.slots, np.array([4, 2, 0, 1, 3]), 2, held, "P")


def test_a_run_s_share_of_what_is_known_of_a_joint(task: Task, sheet: tuple[Pool, Sheet]) -> None:
    """Of the precision with the others held, the prior's beside it: a bar a visit that is fitted, named by pose and axis."""
    runs, rows = sheet
    design: Any = SimpleNamespace(task=task, runs=runs)
    panel: Any = pages._shares(design, rows).panels[0]
    told = {f"P0{k}": runs.information[run].diagonal() for k, run in enumerate((4, 2, 0, 1), start=1)}
    known = task.prior.diagonal() + 2 * sum(told.values())
    axis = {run: "xyz"[runs.slot[run]] for run in range(5)}
    order = [("P01", 4), ("P02", 2), ("P03", 0), ("P04", 1), ("P04/2", 1), ("P03/2", 0), ("P02/2", 2), ("P01/2", 4)]
    assert [bars.name for bars in panel.series] == [f"{label} {axis[run]}" for label, run in order]
    for bars, (label, _) in zip(panel.series, order, strict=True):
        assert bars.values == pytest.approx(100 * told[label[:3]] / known)
    assert panel.x.categories == ["k1", "k2", "k3", "k4", "k5", "k6"]


def test_runs_are_ranked_by_their_worth_in_runs_of_the_optimum(task: Task, pool: Pool) -> None:
    """Worth is the trace of a run with the inverse of what the optimum knows; the mean of the optimum's own runs is one."""
    known, support = pool.take(np.arange(60)), pool.take(np.array([3, 8, 21, 30, 41]))
    weights = np.array([0.2, 0.3, 0.1, 0.4, 0.7])
    runs = pool.take(np.array([5, 17, 100]))
    share = 3 * weights * np.where(support.slot == 2, 4, 2)
    inverse = np.linalg.inv(task.prior + np.tensordot(share, support.information, 1))

    def worth(some: Pool) -> np.ndarray:
        return np.array([np.trace(inverse @ one) for one in some.information])

    level = worth(support) @ weights / weights.sum()
    certificate = SimpleNamespace(support=support, weights=weights, pool=known)
    design: Any = SimpleNamespace(task=task, runs=runs, certificate=certificate)
    panel: Any = pages._certificate(design).panels[0]
    line, points = panel.series
    ranked = np.sort(worth(known))[::-1] / level
    rank = np.asarray(line.x)
    assert rank[0] == 1
    assert rank[-1] >= 59
    assert (np.diff(rank) >= 0).all()       # those that are worth the same have one rank
    assert np.asarray(line.y) == pytest.approx(ranked[rank.astype(int) - 1], rel=1e-9)
    assert np.asarray(points.y) == pytest.approx(worth(runs) / level, rel=1e-9)
    # Where it would stand among them: behind all that are worth more.
    assert np.asarray(points.x).tolist() == [1 + np.sum(ranked > one * (1 + 1e-9)) for one in worth(runs) / level]


def test_of_many_runs_the_first_and_the_last_are_drawn_and_the_first_ones_all(task: Task, pool: Pool) -> None:
    certificate = SimpleNamespace(support=pool.take(np.arange(5)), weights=np.ones(5), pool=pool.joined(pool))
    design: Any = SimpleNamespace(task=task, runs=pool.take(np.arange(2)), certificate=certificate)
    panel: Any = pages._certificate(design).panels[0]
    rank = np.asarray(panel.series[0].x)
    count = len(certificate.pool)
    assert len(rank) <= 1500 < count
    assert rank[0] == 1
    assert rank[-1] >= count - 3            # twice the same runs, and as many in other units


def test_an_arm_is_drawn_from_its_base_to_the_tool_and_the_line_of_its_loads(
    task: Task, sheet: tuple[Pool, Sheet], monkeypatch: pytest.MonkeyPatch,
) -> None:
    _, rows = sheet
    lines: list[SpaceLine] = []
    monkeypatch.setattr(pages, "scene", lambda title, caption, drawn: lines.extend(drawn))
    pages._arms(task.domain, rows)
    cell = task.domain.rig.cell
    at = forward(cell.robot, rows.theta, cell.flange_from_tcp)
    flange = at.position - at.rotation @ cell.flange_from_tcp.position
    arms, bars = [line for line in lines if line.dots], [line for line in lines if not line.dots]
    assert len(arms) == len(bars) == len(rows.label) == 9
    colours = [AXIS_COLOURS["xyz".index(axis)] if not back else "muted" for axis, back in zip(rows.axes, rows.validate,
                                                                                                  strict=True)]
    for k, (arm, bar) in enumerate(zip(arms, bars, strict=True)):
        assert len(arm.points) == 7
        assert arm.points[[0, 5, 6]] == pytest.approx(np.array([np.zeros(3), flange[k], at.position[k]]), abs=1e-12)
        # Lateral offset, lower arm, then along axis 6 from the wrist centre.
        length = np.linalg.norm(np.diff(arm.points[1:], axis=0), axis=1)
        assert length[:4] == pytest.approx([0.3, 0.7, np.hypot(0.28, 0.893), 0.2])
        assert arm.points[1] == pytest.approx([0, 0, 0.8145])
        assert (arm.colour, bar.colour) == (colours[k], colours[k])
        ends = at.position[k] + 0.15 * np.outer([-1, 1], np.eye(3)["xyz".index(rows.axes[k])])
        assert bar.points[np.argsort(bar.points.sum(axis=1))] == pytest.approx(ends)


@pytest.mark.parametrize(("forces", "count"), [
    ([(0, 0, 0), (3, 0, 0), (-5, 0, 0)], 1), ([(1, 0, 0), (0, 2, 0), (0, 0, 0), (0, -1, 0)], 2), ([(0, 0, 0)], 0),
    ([(1, 0, 0), (np.cos(0.044), np.sin(0.044), 0)], 1), ([(1, 0, 0), (np.cos(0.046), np.sin(0.046), 0)], 2)])
def test_lines_of_loads_are_those_that_differ_by_over_two_and_a_half_degrees(
    forces: list[tuple[float, float, float]], count: int,
) -> None:
    lines = pages._lines(np.array(forces, dtype=float))
    assert len(lines) == count
    assert np.linalg.norm(np.array(lines).reshape(-1, 3), axis=1) == pytest.approx(np.ones(count))
    if count:
        first = next(np.array(force) / np.linalg.norm(force) for force in forces if any(force))
        assert lines[0] == pytest.approx(first)


def test_what_more_or_fewer_runs_would_leave_is_drawn_in_two_sigma() -> None:
    expected = Forecast((), (), {}, (4, 6, 9), (1.0, 2.0, 3.0), (0.1, 0.05, 0.02))
    panel: Any = pages._by_length(expected).panels[0]
    line, points = panel.series
    for series in (line, points):
        assert list(series.x) == [4, 6, 9]
        assert list(series.y) == pytest.approx([20, 10, 4])
    assert [label.split(":")[0] for label in points.labels] == ["4 runs", "6 runs", "9 runs"]
    assert [label.split(": ")[1] for label in points.labels] == ["20 %", "10 %", "4 %"]

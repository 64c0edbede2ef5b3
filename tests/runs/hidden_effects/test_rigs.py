"""What rigs and gauges do in load cycles, hidden in the virtual cell's load tests by hand: each is named."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import compstiff
from tests.runs.hidden_effects.hide_and_diagnose import REPLICATES
from tests.runs.mistakes.planted import Files, right


def sticking(case: Files) -> Files:
    """The gauge of y follows through a play of 12 um to either side, from zero at each pose."""
    moved, read = case.moved.copy(), 0.0
    for k, seen in enumerate(case.moved[:, 1]):
        read = 0.0 if k == 0 or case.pose[k] != case.pose[k - 1] else read
        read = min(max(read, seen - 12.0), seen + 12.0)
        moved[k, 1] = read
    return replace(case, moved=moved)


def over_a_sheave(case: Files) -> Files:
    """What is written down is 4 % more than what pulls while the load grows, and 4 % less while it is taken off: by way of the
    same loads, where the robot stands as before but for the noise."""
    order = [k for start in range(0, len(case.pose), 21) for first in (0, 7, 14)
             for k in start + first + np.array([0, 1, 2, 3, 2, 1, 4, 5, 6, 5])]
    again = np.random.default_rng(9).standard_normal((len(order), 3))
    case = replace(case, theta=case.theta[order], force=case.force[order], moved=case.moved[order] + again,
                   time=10.0 * np.arange(len(order)), dwell=case.dwell[order], pose=[case.pose[k] for k in order])
    force = case.force.copy()
    for k in range(1, len(force)):
        grows = np.linalg.norm(case.force[k]) > np.linalg.norm(case.force[k - 1])
        force[k] *= 1.04 if grows else 1 / 1.04
    return replace(case, force=force)


def heated_and_cooled(case: Files) -> Files:
    """60 um of z to and fro, every fifty minutes."""
    return replace(case, moved=case.moved + np.outer(60 * np.sin(2 * np.pi * case.time / 3000), [0.2, 0.0, 1.0]))


# Long: a drift is named at the desk (test_desk_world.py).
@pytest.mark.parametrize(("hide", "label"), [
    (sticking, "gauge_friction"), (over_a_sheave, "load_friction"),
    pytest.param(heated_and_cooled, "drift", marks=pytest.mark.long)])
def test_it_is_named(hide: Callable[[Files], Files], label: str, tmp_path: Path) -> None:
    cell_file, table = hide(right(2440001)).write(tmp_path)
    cell = compstiff.read_cell(cell_file)
    found = compstiff.diagnose(cell, compstiff.read_measurements(table, cell.robot), replicates=REPLICATES)
    assert found.verdict == "named"
    assert [cause.label for cause in found.causes] == [label]

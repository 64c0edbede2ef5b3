"""The corner chip by chip has the end mill's mean force where the feed is steady, and the time that a chip needs."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from tests.virtual_cell.corner_cut import AT, mill_corner
from tests.virtual_cell.endmill import EndMill
from tests.virtual_cell.milled_part import PLACES, slot_and_pocket, steps_of
from tests.virtual_cell.milling import engagement

STIFF, SOFT = np.zeros((3, 3)), 1e-3 * np.eye(3)
ROUND = EndMill(runout_mm=(0.0, 0.0, 0.0))


def way(*points: tuple[float, float]) -> np.ndarray:
    """A dense way (m, 2) [mm] through points given from the corner."""
    return np.concatenate([AT + np.linspace(a, b, 400) for a, b in itertools.pairwise(points)])


@pytest.mark.parametrize(("allowance", "contact"), [(1.5, 4.0), (0.4, 10.0)])
def test_on_a_straight_wall_the_force_is_that_of_a_steady_feed(allowance: float, contact: float) -> None:
    part = slot_and_pocket(0.5, allowance, contact)
    done = mill_corner(way((-14.0, 0.0), (-9.0, 0.0)), part, ROUND, STIFF)
    steps = steps_of(part)
    i = int(np.flatnonzero(steps.place == PLACES.index("straight wall"))[5])
    coverage, depth = engagement(part, steps, ROUND, i, np.array([*done.stands_mm[-1], -contact]))
    assert np.allclose(steps.feed[i], [1, 0])
    expected = ROUND.mean_force(coverage, depth)
    assert np.linalg.norm(done.force_n[-1] - expected) < 0.04 * np.linalg.norm(expected)


def test_a_stiff_arm_mills_the_corner_as_drawn_and_a_soft_one_leaves_stock() -> None:
    part = slot_and_pocket(0.5)
    corner = way((-12.0, 0.0), (0.0, 0.0), (0.0, 12.0))
    assert np.abs(mill_corner(corner, part, ROUND, STIFF).walls_um).max() < 1
    soft = mill_corner(corner, part, ROUND, SOFT)
    assert soft.walls_um.max() < 0
    assert np.allclose(soft.stands_mm - soft.commanded_mm, 1e-3 * soft.force_n[:, :2], atol=1e-4)


def test_a_tool_that_waits_springs_back_to_its_command() -> None:
    """At the wall, driven slower and slower at the end: no chip, no force."""
    part = slot_and_pocket(0.5)
    steady = way((-14.0, 0.0), (-9.0, 0.0))
    waiting = np.concatenate([steady, steady[-1] + 1e-2 * np.column_stack([np.tile([0.0, 1.0], 300), np.zeros(600)])])
    done = mill_corner(waiting, part, ROUND, SOFT)
    cutting = np.searchsorted(-np.linalg.norm(done.commanded_mm - steady[-1], axis=1), -0.02)
    assert np.linalg.norm(done.force_n[cutting]) > 50
    assert np.linalg.norm(done.force_n[-1]) < 0.35 * np.linalg.norm(done.force_n[cutting])

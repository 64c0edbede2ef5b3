"""Offsets at an inner sharp corner: held towards the wall behind until the logged tool had turned, and nothing else of them."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from compensator.correction.wall_behind import held_before_the_wall
from compensator.toolpath import Move

# Along x to a corner and on along y, a target every 0.2 mm. What is asked for rises towards the wall behind from the seventh
# on, and the tool of the log stood 0.5 mm aside at the corner: two targets behind it were passed before it turned.
CORNER, COUNT, EARLY, SIGMA = 9, 20, 0.5e-3, 4e-6
OFFSET = 1e-6 * np.column_stack([[-60.0] * 6 + [-40.0, 0.0, 60.0, 150.0, 120.0, 90.0, 80.0] + [90.0] * 7,
                                 [-80.0] * 6 + [-300.0] * 5 + [-20.0] + [-80.0] * 8, np.zeros(COUNT)])
PUSHED_BACK = np.array([-90.0, 80.0, 0.0])


@dataclass(frozen=True)
class Lines:
    """Straight moves to stop points."""

    move: np.ndarray
    zone: np.ndarray

    def __len__(self) -> int:
        return len(self.move)


def held(offset: np.ndarray, aside: float, force: np.ndarray, turn: Rotation, leave_out: tuple[int, ...] = (),
         depth: float | np.ndarray = 0.0) -> np.ndarray:
    """The offsets (M, 3) of the path turned about, turned back; only the targets not left out have force. depth (M,) [m]."""
    along = 2e-4 * np.arange(COUNT)
    places = np.column_stack([np.minimum(along, along[CORNER]), np.maximum(along - along[CORNER], 0.0), np.zeros(COUNT)])
    path = SimpleNamespace(
        toolpath=Lines(np.full(COUNT, Move.LINEAR), np.zeros(COUNT)), length=along,
        rest_from_tcp=SimpleNamespace(position=turn.apply(places)), world_position=turn.apply(places))
    targets = np.setdiff1d(np.arange(COUNT), leave_out)
    stood = np.tile([0.0, aside, 0.0], (len(targets), 1))
    forces = np.tile(force, (len(targets), 1))
    found = held_before_the_wall(cast(Any, path), targets, turn.apply(offset[targets]), np.full(len(targets), SIGMA),
                                 turn.apply(stood), turn.apply(forces), np.broadcast_to(depth, len(targets)))
    return np.asarray(turn.inv().apply(found))


@pytest.mark.parametrize("seed", range(4))
def test_towards_the_wall_no_offset_rises_until_the_logged_tool_had_turned(seed: int) -> None:
    """One sigma below what it was before, the sigma along the offset; but half of a deviation's square at most is held."""
    expected = OFFSET.copy()
    low = -60e-6 - SIGMA * 60 / np.hypot(60, 80)
    expected[6:12, 0] = np.maximum(low, expected[6:12, 0] - np.linalg.norm(expected[6:12], axis=1) / np.sqrt(2))
    assert expected[11, 0] > low, "the one of 92 um that is asked to change by 153"
    assert expected[9, 0] == low
    np.testing.assert_allclose(held(OFFSET, EARLY, PUSHED_BACK, Rotation.random(random_state=seed)), expected, atol=1e-12)


def test_scatter_below_sigma_is_no_rise() -> None:
    """On a straight wall offsets scatter: the least of them is looked for past one that is higher by less than sigma."""
    scattered = OFFSET.copy()
    scattered[[2, 4], 0] += np.array([-0.7, 0.2]) * SIGMA
    found = held(scattered, EARLY, PUSHED_BACK, Rotation.identity())
    np.testing.assert_allclose(found[3:11, 0], -60e-6 - 0.7 * SIGMA - 0.6 * SIGMA, atol=0.05 * SIGMA)


@pytest.mark.parametrize(("aside", "force", "leave_out"), [
    pytest.param(-EARLY, PUSHED_BACK, (), id="outer corner"),
    pytest.param(EARLY, np.array([90.0, 80.0, 0.0]), (), id="no wall behind"),
    pytest.param(0.0, PUSHED_BACK, (), id="predicted on the plan"),
    pytest.param(EARLY, PUSHED_BACK, (CORNER + 1,), id="the cut ends at the corner")])
def test_other_corners_keep_what_is_asked_for(aside: float, force: np.ndarray, leave_out: tuple[int, ...]) -> None:
    targets = np.setdiff1d(np.arange(COUNT), leave_out)
    np.testing.assert_array_equal(held(OFFSET, aside, force, Rotation.identity(), leave_out), OFFSET[targets])


def test_a_log_that_is_in_the_cut_behind_already_needs_no_holding_there() -> None:
    """Its second target behind the corner asks for what those behind ask for, although the tool had stood farther aside."""
    early = OFFSET.copy()
    early[11:] = OFFSET[13]
    found = held(early, EARLY, PUSHED_BACK, Rotation.identity())
    np.testing.assert_array_equal(found[11:], early[11:])
    assert np.all(found[6:11, 0] < early[6:11, 0])


def test_a_tool_that_stood_aside_by_less_than_the_cut_is_deep_turned_in_its_stock() -> None:
    depths = (0.0, 0.9 * EARLY, 1.1 * EARLY)
    at_depth = [held(OFFSET, EARLY, PUSHED_BACK, Rotation.identity(), depth=depth) for depth in depths]
    np.testing.assert_array_equal(at_depth[0], at_depth[1])
    np.testing.assert_array_equal(at_depth[2], OFFSET)
    assert not np.array_equal(at_depth[0], OFFSET)


def test_the_least_depth_on_the_way_to_the_corner_decides() -> None:
    """Near the corner the push is that of the wall behind too, and tells too much; behind it nothing is told."""
    depth = np.full(COUNT, np.nan)
    depth[2:6], depth[6:CORNER + 1], depth[CORNER + 1:] = 0.9 * EARLY, 5 * EARLY, 0.1 * EARLY
    held_there = held(OFFSET, EARLY, PUSHED_BACK, Rotation.identity(), depth=depth)
    np.testing.assert_array_equal(held_there, held(OFFSET, EARLY, PUSHED_BACK, Rotation.identity()))
    depth[2:6] = 1.1 * EARLY
    np.testing.assert_array_equal(held(OFFSET, EARLY, PUSHED_BACK, Rotation.identity(), depth=depth), OFFSET)


def test_the_depth_at_the_corner_itself_counts() -> None:
    depth = np.full(COUNT, np.nan)
    depth[CORNER] = 1.1 * EARLY
    np.testing.assert_array_equal(held(OFFSET, EARLY, PUSHED_BACK, Rotation.identity(), depth=depth), OFFSET)


def test_the_last_that_is_held_stays_within_what_the_one_behind_it_has_room_for() -> None:
    """That one is not held: of one that asks for 22 um the step to it is no more than half of its square."""
    offset = OFFSET.copy()
    offset[12, :2] = [10e-6, -20e-6]
    found = held(offset, EARLY, PUSHED_BACK, Rotation.identity())
    assert found[11, 0] == pytest.approx(90e-6 - np.sqrt(0.5) * np.hypot(10e-6, 20e-6), abs=1e-12)
    np.testing.assert_array_equal(found[12:], offset[12:])


def test_what_was_asked_for_before_a_rise_farther_back_tells_nothing_of_the_corner() -> None:
    """On the same line: the least is that since the last rise."""
    offset = OFFSET.copy()
    offset[:3, 0], offset[3, 0] = -200e-6, 0.0
    found = held(offset, EARLY, PUSHED_BACK, Rotation.identity())
    np.testing.assert_array_equal(found[:5], offset[:5])
    np.testing.assert_allclose(found[6:10, 0], -60e-6 - SIGMA * 0.6, atol=1e-12)


@pytest.mark.parametrize(("aside", "turned_in_stock"), [(0.3e-6, True), (0.14e-3, True), (0.17e-3, False)])
def test_where_no_depth_is_told_it_is_one_that_nearly_all_cuts_have(aside: float, turned_in_stock: bool) -> None:
    """The log of a corrected pass, whose tool turns a hair early, has met the corner. 2 sigma below 0.75 mm, sigma 0.8 of the
    logarithm, are 0.151 mm."""
    found = held(OFFSET, aside, PUSHED_BACK, Rotation.identity(), depth=np.nan)
    assert np.array_equal(found, OFFSET) == turned_in_stock


def test_a_stretch_before_a_gap_in_the_cut_tells_nothing_of_the_corner() -> None:
    """The targets before the gap ask for much less; only the line that leads to the corner counts."""
    offset = OFFSET.copy()
    offset[:3, 0] = -500e-6
    found = held(offset, EARLY, PUSHED_BACK, Rotation.identity(), (3,))
    np.testing.assert_allclose(found[5:10, 0], -60e-6 - SIGMA * 0.6, atol=1e-12)


def test_an_outer_corner_does_not_end_the_search_for_inner_ones() -> None:
    """A step in front of the path of the other tests, whose corner has no wall behind it: what is held is the same."""
    places = np.concatenate([[[-1e-3, -2e-4 * k, 0.0] for k in (5, 4, 3, 2, 1)],
                             [[-1e-3 + 2e-4 * k, 0.0, 0.0] for k in range(5)],
                             [[2e-4 * min(k, CORNER), 2e-4 * max(k - CORNER, 0), 0.0] for k in range(COUNT)]])
    count = len(places)
    path = SimpleNamespace(
        toolpath=Lines(np.full(count, Move.LINEAR), np.zeros(count)), rest_from_tcp=SimpleNamespace(position=places),
        length=np.append(0.0, np.cumsum(np.linalg.norm(np.diff(places, axis=0), axis=1))), world_position=places)
    offset = np.concatenate([np.tile([0.0, -80e-6, 0.0], (5, 1)), np.tile(OFFSET[0], (5, 1)), OFFSET])
    stood = np.tile([EARLY, 0.0, 0.0], (count, 1))
    stood[8:] = [0.0, EARLY, 0.0]
    force = np.tile([0.0, 90.0, 0.0], (count, 1))
    force[8:] = PUSHED_BACK
    found = held_before_the_wall(
        cast(Any, path), np.arange(count), offset, np.full(count, SIGMA), stood, force, np.zeros(count))
    np.testing.assert_allclose(found[10:], held(OFFSET, EARLY, PUSHED_BACK, Rotation.identity()), atol=1e-12)
    np.testing.assert_array_equal(found[:10], offset[:10])

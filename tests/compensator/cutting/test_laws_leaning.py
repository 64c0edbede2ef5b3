"""A ball whose tool leans, against an engine that goes edge by edge in time (tests/virtual_cell/leaning_ball.py)."""

from __future__ import annotations

import numpy as np
import pytest

from compensator.cutting.cutter import Cutter
from compensator.cutting.leaning import above_the_ball
from compensator.cutting.removal import Engagement, mill_through
from compensator.cutting.stock import Stock
from tests.compensator.cutting.milled import FLAT, MILL, block, force_of, track_along
from tests.support import long
from tests.virtual_cell.leaning_ball import LeaningBall, mean_force, tilted

LOW, HIGH, RADIUS, CHIP = (-60.0, -40.0, -20.0), (60.0, 40.0, 0.0), MILL.radius_mm, 0.1
BALL = Cutter(1e-3 * RADIUS, MILL.teeth, 1e-3 * RADIUS)


def levels(tip: float) -> tuple[float, ...]:
    """Layers as a program at that height gets them: the rounding in 24."""
    above = tip + RADIUS * (1 - np.cos(np.linspace(0, np.pi / 2, 25)))
    return tuple(above[above < HIGH[2]])


def milled(
    axis: tuple[float, float, float], corner: list[list[float]], stock: Stock
) -> tuple[Engagement, np.ndarray, np.ndarray]:
    """Engagement, force (S, 3) [N] and middles of the steps (S, 3) [mm] of a ball whose lowest point goes along corner."""
    track = track_along(np.array(corner), CHIP)
    leaning = track_along(np.array(corner), CHIP, axis=np.tile(axis, (len(track), 1)))
    engaged, _ = mill_through(stock, leaning, BALL)
    return engaged, force_of(leaning, engaged), 0.5e3 * (track.start + track.end)


@pytest.mark.parametrize(("lead", "tilt"), [(3, 0), long(15, 0), (-15, 0), (0, 15), long(0, -15), (10, -20), long(30, 5)])
@pytest.mark.parametrize("y", [0.0, 41.0, -43.0], ids=["slot", "climb", "conventional"])
def test_the_plateau_is_that_of_the_edges(lead: float, tilt: float, y: float) -> None:
    """A millimetre deep: within 5 % and 3 degrees, as upright tools are; under the tip too, where the edge stands still."""
    axis, tip = tilted(lead, tilt), -1.0
    engaged, force, place = milled(axis, [[-30.0, y, tip], [10.0, y, tip]], block(LOW, HIGH, levels(tip)))
    step = 60
    truth = mean_force(LeaningBall(axis), place[step] + [0.0, 0.0, RADIUS], np.array([CHIP, 0.0, 0.0]), (LOW, HIGH))
    assert not engaged.unknown[step]
    assert np.linalg.norm(truth) > 5
    assert np.linalg.norm(force[step]) == pytest.approx(np.linalg.norm(truth), rel=0.05)
    cosine = force[step] @ truth / np.linalg.norm(force[step]) / np.linalg.norm(truth)
    assert np.degrees(np.arccos(min(cosine, 1.0))) < 3


# Long: rows of a finish, each beside what the last one left, are held against the engine on slopes in test_laws_sloping.py, a
# leaning plateau above.
@pytest.mark.long
def test_rows_beside_each_other() -> None:
    """Rows of a finish, one way and back 0.8 mm on: the second takes what the first left, at entry and exit too."""
    axis, tip = tilted(12, 8), -0.6
    corner = [[-80.0, 10.0, tip], [80.0, 10.0, tip], [80.0, 10.8, tip], [-80.0, 10.8, tip]]
    engaged, force, place = milled(axis, corner, block(LOW, HIGH, levels(tip)))
    up = np.array([0.0, 0.0, RADIUS])
    before = np.array(corner[:2]) + up
    second = np.flatnonzero((place[:, 1] > 10.79) & (np.abs(place[:, 0]) < 70))
    some = second[::29]
    truth = np.array([mean_force(LeaningBall(axis), place[k] + up, np.array([-CHIP, 0.0, 0.0]), (LOW, HIGH), [before])
                      for k in some])
    plateau = np.linalg.norm(truth, axis=1).max()
    off = np.linalg.norm(force[some] - truth, axis=1)
    assert plateau > 15
    assert off.max() < 0.15 * plateau
    assert np.median(off[np.linalg.norm(truth, axis=1) > 0.9 * plateau]) < 0.05 * plateau
    assert not engaged.unknown[some].any()


def test_a_hair_off_the_vertical_is_upright() -> None:
    """Just over the angle from which a tool leans the force is the upright one's but for what the feed turns at the tip: the
    law that leans is the nearer one to the engine."""
    corner, stock = [[-80.0, 3.0, -1.5], [80.0, 3.0, -1.5]], block(LOW, HIGH, levels(-1.5))
    (_, upright, place), (_, leaning, _) = (milled(tilted(0.0, angle), corner, stock) for angle in (0.0, 1.01))
    truth = mean_force(LeaningBall(tilted(0.0, 1.01)), place[160] + [0.0, 0.0, RADIUS], np.array([CHIP, 0.0, 0.0]), (LOW, HIGH))
    size = np.linalg.norm(truth)
    assert leaning[160] == pytest.approx(upright[160], abs=0.05 * size)
    assert np.linalg.norm(leaning[160] - truth) < 0.03 * size < np.linalg.norm(upright[160] - truth)


@pytest.mark.parametrize(("lead", "tip", "known"), [
    (20, -1.0, True), (20, -7.0, False), long(-20, -4.0, True), long(-20, -7.0, True), (57, -0.5, True), (63, -0.5, False),
    (90, -0.5, False)])
def test_above_its_ball_nothing_is_known(lead: float, tip: float, known: bool) -> None:
    """Leaning forward by 20 degrees the shank meets the front of a slot from R (1 - sin 20) = 5.26 mm on; leaning back it is
    the ball that does. Over 60 degrees it is not looked at."""
    axis = (1.0, 0.0, 0.0) if lead == 90 else tilted(lead, 0.0)
    engaged, _, place = milled(axis, [[-80.0, 0.0, tip], [40.0, 0.0, tip]], block(LOW, HIGH, levels(tip)))
    within = (np.abs(place[:, 0]) < 30) & engaged.cuts
    assert within.sum() > 50
    assert engaged.unknown[within].all() != known
    assert engaged.unknown[within].any() != known


def test_a_shank_beside_a_wall() -> None:
    """The ball stays clear of a wall that its shank leans into; leaning away from it nothing is met."""
    low, high = (-60.0, 12.0, -20.0), (60.0, 40.0, 30.0)
    corner, stock = [[-90.0, 3.0, -10.0], [-30.0, 3.0, -10.0]], block(low, high, tuple(np.arange(-10.0, 30.0, 4.0)))
    for tilt, meets in ((25.0, True), (-25.0, False)):
        engaged, _, place = milled(tilted(0.0, tilt), corner, stock)
        assert not engaged.cuts.any()
        assert engaged.unknown[place[:, 0] > -50].all() == meets
        assert engaged.unknown.any() == meets


def test_what_a_shank_took_is_gone() -> None:
    """A wall that it went through once it does not meet again; half a millimetre on it does."""
    low, high, axis = (-60.0, 14.0, -20.0), (60.0, 40.0, 30.0), tilted(0.0, 25.0)
    stock = block(low, high, tuple(np.arange(-10.0, 30.0, 4.0)))
    corner = np.array([[-90.0, 3.0, -10.0], [-30.0, 3.0, -10.0]])
    track = track_along(corner, CHIP)
    leaning = track_along(corner, CHIP, axis=np.tile(axis, (len(track), 1)))
    engaged, left = mill_through(stock, leaning, BALL)
    assert engaged.unknown.sum() > 60
    again, _ = mill_through(left, leaning, BALL)
    assert not again.unknown.any()
    beside = track_along(corner + np.array([0.0, 0.5, 0.0]), CHIP, axis=leaning.axis)
    assert mill_through(left, beside, BALL)[0].unknown.sum() > 60


def test_where_the_ball_ends() -> None:
    """A quarter of the way up a ball of a tool that leans to the left by 20 degrees all is ball to the right; to the left the
    points over the plane through its middle, across the axis, are not."""
    angle, up = np.radians([-90.0, 0.0, 90.0]), np.array([0.25, 0.8, 1.01]) * 8e-3
    axis = np.tile(tilted(0.0, 20.0), (3, 1))
    found = above_the_ball(angle, up, 8e-3, np.tile([1.0, 0.0], (3, 1)), axis)
    assert found.tolist() == [[False, False, False], [False, False, True], [True, True, True]]


@pytest.mark.parametrize(("degrees", "known"), [(0.9, True), (1.1, False)])
def test_of_a_flat_cutter_that_leans_by_over_a_degree_nothing_is_known(degrees: float, known: bool) -> None:
    corner = np.array([[-80.0, 0, -2.0], [40.0, 0, -2.0]])
    track = track_along(corner, CHIP, axis=np.tile(tilted(0.0, degrees), (len(track_along(corner, CHIP)), 1)))
    engaged, _ = mill_through(block(LOW, HIGH, levels(-2.0)), track, FLAT)
    assert engaged.cuts.sum() > 50
    assert engaged.unknown[engaged.cuts].all() != known
    assert engaged.unknown[engaged.cuts].any() != known

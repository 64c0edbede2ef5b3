"""A ball that climbs and descends, against an engine that goes edge by edge in time (tests/virtual_cell/leaning_ball.py)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from compensator.cutting.cutter import Cutter
from compensator.cutting.removal import Engagement, mill_through
from compensator.cutting.sloping import beside_ball, beyond_way, front, rings
from compensator.cutting.stock import Stock
from compensator.cutting.track import Track
from tests.compensator.cutting.milled import FLAT, MILL, block, force_of, track_along
from tests.support import long
from tests.virtual_cell.leaning_ball import LeaningBall, mean_force, tilted

LOW, HIGH, RADIUS, CHIP = (-60.0, -40.0, -20.0), (60.0, 40.0, 0.0), MILL.radius_mm, 0.1
BALL, UP = Cutter(1e-3 * RADIUS, MILL.teeth, 1e-3 * RADIUS), np.array([0.0, 0.0, RADIUS])
UPRIGHT = (0.0, 0.0, 1.0)
STOCK = block(LOW, HIGH, tuple(np.arange(-12.0, 0.0, 0.1)), 0.25)


def milled(corner: np.ndarray, axis: tuple[float, float, float] = UPRIGHT, stock: Stock = STOCK
           ) -> tuple[Track, Engagement, np.ndarray, np.ndarray]:
    """Track, engagement, force (S, 3) [N], middles of the steps (S, 3) [mm] of a ball whose lowest point goes along corner."""
    track = track_along(corner, CHIP)
    track = replace(track, axis=np.tile(axis, (len(track), 1)))
    engaged, _ = mill_through(stock, track, BALL)
    return track, engaged, force_of(track, engaged), 0.5e3 * (track.start + track.end)


def along(slope: float) -> np.ndarray:
    """The feed, up a slope [deg]."""
    return np.array([np.cos(np.radians(slope)), 0.0, np.sin(np.radians(slope))])


def ramp(slope: float, y: float, deep: float, back: float = 8.0, on: float = 3.0) -> np.ndarray:
    """Through (0, y) with `deep` [mm] of stock over the lowest place that cuts."""
    tip = np.array([0.0, y, -deep - (RADIUS * (1 - np.cos(np.radians(slope))) if slope > 0 else 0.0)])
    return np.stack([tip - back * along(slope), tip + on * along(slope)])


def check(force: np.ndarray, truth: np.ndarray) -> None:
    """Within 5 % and 3 degrees."""
    size, own = np.linalg.norm(truth), np.linalg.norm(force)
    assert own == pytest.approx(size, rel=0.05)
    assert np.degrees(np.arccos(np.clip(force @ truth / size / own, -1, 1))) < 3


@pytest.mark.parametrize("slope", [-60, long(-30), -10, long(-3), 3, long(10), 30, long(60)])
@pytest.mark.parametrize("y", [0.0, 41.0, -43.0], ids=["slot", "climb", "conventional"])
def test_the_force_is_that_of_the_edges(slope: float, y: float) -> None:
    """Down with the tip in the cut, and up with a front that goes less far round: within 5 % and 3 degrees."""
    _, engaged, force, place = milled(ramp(slope, y, 1.5))
    truth = mean_force(LeaningBall(UPRIGHT), place[-6] + UP, CHIP * along(slope), (LOW, HIGH))
    assert np.linalg.norm(truth) > 5
    assert not engaged.unknown[-6]
    check(force[-6], truth)


@pytest.mark.parametrize("slope", [-85.0, -75.0])
def test_a_wall_is_finished_downwards_by_the_side_of_a_ball(slope: float) -> None:
    """Its tip stands clear: what is a plunge with the tip in the cut is none here."""
    _, engaged, force, place = milled(ramp(slope, 46.0, 7.9, 7.0, 0.5))
    truth = mean_force(LeaningBall(UPRIGHT), place[-2] + UP, CHIP * along(slope), (LOW, HIGH))
    assert np.linalg.norm(truth) > 100
    assert engaged.cuts[-2]
    assert not engaged.unknown[-2]
    check(force[-2], truth)


@pytest.mark.parametrize("slope", [-40, long(-15), long(-4), long(4), long(15), long(40)])
def test_rows_of_a_finish(slope: float) -> None:
    """A row down or up a slope 0.7 mm beside another takes what that left, to where it leaves the block; with layers of 0.1 mm
    on slopes that rise by 0.03 mm a step too."""
    across = np.array([0.0, 0.7, 0.0])
    low, high = ramp(slope, 0.0, 1.0, 18.0, 12.0)
    row = np.stack([low, high])
    corner = np.concatenate([row, [high + 20 * np.array(UPRIGHT), low + 20 * np.array(UPRIGHT) + across], row + across])
    _, engaged, force, place = milled(corner)
    second = np.flatnonzero((np.abs(place[:, 1] - 0.7) < 1e-6) & (place[:, 2] < corner[4:, 2].max()))
    # Where it came down on its row it has cut by its shank.
    second = second[place[second, 0] > low[0] + RADIUS + 1][:-3:10]
    truth = np.array([mean_force(LeaningBall(UPRIGHT), place[k] + UP, CHIP * along(slope), (LOW, HIGH), [row + UP])
                      for k in second])
    size = np.linalg.norm(truth, axis=1)
    off = np.linalg.norm(force[second] - truth, axis=1)
    assert size.max() > 5
    assert off.max() < 0.15 * size.max()
    assert np.median(off) < 0.05 * size.max()
    assert not engaged.unknown[second].any()


@pytest.mark.parametrize("slope", [-25, 25])
@pytest.mark.parametrize(("lead", "tilt"), [(12, 0), (-12, 0), (5, -15)])
def test_a_ball_that_leans_on_a_slope(slope: float, lead: float, tilt: float) -> None:
    axis = tilted(lead, tilt)
    _, engaged, force, place = milled(ramp(slope, 3.0, 1.0), axis)
    truth = mean_force(LeaningBall(axis), place[-6] + UP, CHIP * along(slope), (LOW, HIGH))
    assert not engaged.unknown[-6]
    check(force[-6], truth)


@pytest.mark.parametrize("slope", [-35.0, 35.0])
def test_what_is_taken_away_is_what_the_chips_are(slope: float) -> None:
    """Width times depth times way is the volume that is gone, on slopes as on the level."""
    corner = ramp(slope, 0.0, 1.0, 12.0, 12.0)
    track = track_along(corner, CHIP)
    engaged, left = mill_through(STOCK, track, BALL)
    # Where it begins it stands in the block.
    begin = mill_through(STOCK, track_along(np.stack([corner[0], corner[0] + 0.01 * along(slope)]), CHIP), BALL)[1]
    gone = begin.volume - left.volume
    assert gone > 1e-8
    assert float(engaged.width * engaged.depth @ track.length) == pytest.approx(gone, rel=0.04)


def test_a_spring_pass_on_a_slope_cuts_nothing() -> None:
    """The way that a ball went once, as one line or as many short ones, is free; back as well. Not at its last step: there the
    round end of the way is known to a layer, and a cut of up to 90 N is seen that is none."""
    corner = ramp(-30.0, 0.0, 1.0)
    bent = np.linspace(corner[0], corner[1], 40)
    _, left = mill_through(STOCK, track_along(corner, CHIP), BALL)
    for again in (corner, corner[::-1], bent):
        track = track_along(again, CHIP)
        engaged, _ = mill_through(left, track, BALL)
        whole, _ = mill_through(STOCK, track, BALL)
        assert np.linalg.norm(force_of(track, engaged)[:-1], axis=1).max() < 0.01 * np.linalg.norm(
            force_of(track, whole), axis=1).max()


@pytest.mark.parametrize(("cutter", "slope", "known"), [
    (BALL, -58, True), (BALL, -62, False), (BALL, 80, True), (FLAT, -4, True), (FLAT, -8, False), (FLAT, 8, True),
    (Cutter(8e-3, 3, 2e-3), 8, False), (Cutter(8e-3, 3, 2e-3), -8, False), (Cutter(8e-3, 3, 2e-3), 4, True)],
    ids=lambda value: str(value.corner) if isinstance(value, Cutter) else str(value))
def test_which_slopes_are_known(cutter: Cutter, slope: float, known: bool) -> None:
    """A ball but on its way down along its axis; flat cutters whose floor does not cut, bull-nose ones next to the level."""
    track = track_along(ramp(slope, 0.0, 3.0), CHIP)
    engaged, _ = mill_through(STOCK, track, cutter)
    assert engaged.cuts[-4]
    assert engaged.unknown[-4] != known


def test_a_flat_cutter_that_climbs_has_the_chips_of_its_way_across() -> None:
    """f cos(slope) a tooth is what its flank meets."""
    slope = 20.0
    climbing, level = (track_along(np.array([[-10.0, 0.0, -6.0], [0.0, 0.0, -6.0 + rise]]), CHIP)
                       for rise in (10 * np.tan(np.radians(slope)), 0.0))
    weights = [mill_through(STOCK, track, FLAT)[0] for track in (climbing, level)]
    shear = [one.weights[-1, :, :3] / one.depth[-1] for one in weights]
    assert shear[0] == pytest.approx(np.cos(np.radians(slope)) * shear[1], abs=0.01 * np.abs(shear[1]).max())


@pytest.mark.parametrize("slope", [-20.0, 20.0])
def test_aside_on_a_slope_is_milled_anew(slope: float) -> None:
    """What a going through tells of the tool moved by 0.1 mm is what another one says, along x, y and up."""
    corner, step = ramp(slope, 41.0, 1.5), 0.1
    track = track_along(corner, CHIP)
    engaged, _ = mill_through(STOCK, track, BALL, 1e-3 * step)
    assert engaged.moved is not None
    some = slice(-8, -2)
    here = force_of(track, engaged)[some]
    for axis in range(3):
        anew = milled(corner + step * np.eye(3)[axis])[2][some] - here
        own = force_of(track, replace(engaged, weights=engaged.moved[axis], moved=None))[some] - here
        assert own == pytest.approx(anew, abs=0.15 * np.abs(anew).max() + 0.02 * np.abs(here).max()), "xyz"[axis]


@pytest.mark.parametrize("way", [(0.0, 0.0, 0.0), (1.0, 0.5, 0.0), (0.8, -0.3, 0.9), (0.8, -0.3, -0.9), (0.0, 0.0, -0.7)])
def test_the_distance_to_a_way_is_the_least_to_its_places(way: tuple[float, float, float]) -> None:
    """And, with a shank, to all that is above them: by looking at 4001 of them."""
    rng = np.random.default_rng(3)
    first, points = rng.normal(size=3), 1.5 * rng.normal(size=(3, 200))
    place = first + np.linspace(0, 1, 4001)[:, None] * np.array(way)
    off = points.T[:, None, :] - place
    for shank in (False, True):
        up = np.maximum(off[..., 2], 0.0) if shank else 0.0
        least = np.sqrt(off[..., 0] ** 2 + off[..., 1] ** 2 + (off[..., 2] - up) ** 2).min(axis=1)
        assert beyond_way(points, first, first + np.array(way), shank) == pytest.approx(least, abs=5e-4)


@pytest.mark.parametrize("slope", [-30.0, 30.0])
def test_a_thick_layer_that_is_empty_is_air_down_to_its_foot(slope: float) -> None:
    """What a layer of 4 mm says holds for all of it: the stock under it is cut as one that ends there, also by a tool that goes
    aside."""
    two = block(LOW, HIGH, (-4.0,), 0.25)
    inside = two.inside.copy()
    inside[1] = -inside.max()
    track = track_along(ramp(slope, 0.0, 6.0, 10.0), CHIP)
    empty, _ = mill_through(replace(two, inside=inside), track, BALL, 1e-4)
    none, _ = mill_through(block(LOW, (HIGH[0], HIGH[1], -4.0), (), 0.25), track, BALL, 1e-4)
    assert empty.cuts.sum() > 10
    np.testing.assert_array_equal(empty.weights, none.weights)
    np.testing.assert_array_equal(empty.moved[:2], none.moved[:2])


def test_the_front_ends_where_the_surface_goes_along_the_feed() -> None:
    """Where n . f is the least that cuts; all round or nowhere where it is that nowhere; half a circle on the level."""
    rng = np.random.default_rng(5)
    count = 400
    sine, rise, turn = rng.uniform(0.02, 1.0, count), rng.uniform(-1.5, 1.5, count), rng.uniform(-3, 3, count)
    rise[::10] = 0.0
    travel = np.column_stack([np.cos(rise) * np.cos(turn), np.cos(rise) * np.sin(turn), np.sin(rise)])
    least = rng.uniform(-0.1, 0.0, count)
    half = front(sine, travel, least)
    assert half[::10] == pytest.approx(np.pi / 2)

    def along(angle: np.ndarray) -> np.ndarray:
        """n . f at an angle to the left of the feed."""
        normal = np.column_stack([sine * np.cos(turn + angle), sine * np.sin(turn + angle), -np.sqrt(1 - sine**2)])
        return np.asarray(np.einsum("ni,ni->n", normal, travel) - np.where(rise == 0, 0.0, least))

    some = (half > 1e-6) & (half < np.pi - 1e-6)
    assert 0.4 < some.mean() < 0.9
    assert along(half)[some] == pytest.approx(0, abs=1e-9)
    assert (along(np.zeros(count))[half <= 1e-6] <= 1e-9).all()
    assert (along(np.full(count, np.pi))[half >= np.pi - 1e-6] >= -1e-9).all()
    assert {0, 1} <= set((half > 1).astype(int)[~some])


def test_layers_of_a_ball_are_looked_at_in_rings_of_two_and_a_half_degrees() -> None:
    """Equal ones, from foot to top, of the layers on the ball that are asked for; others stay whole."""
    radius = 8e-3
    foot = np.array([0.0, 0.5e-3, 3e-3, 7.9e-3, 9e-3, 0.0])
    thick = np.array([0.5e-3, 0.2e-3, 2e-3, 0.2e-3, 1e-3, 8e-6])
    own, low, high = rings(foot, thick, radius, np.array([True, True, True, True, True, True]))
    high = low + high
    for layer in range(6):
        mine = own == layer
        assert low[mine][0] == pytest.approx(foot[layer], abs=1e-15)
        assert high[mine][-1] == pytest.approx(foot[layer] + thick[layer], abs=1e-15)
        assert low[mine][1:] == pytest.approx(high[mine][:-1], abs=1e-15)
        polar = np.degrees(np.arccos(np.clip(1 - np.append(low[mine], high[mine][-1]) / radius, -1, 1)))
        if foot[layer] + thick[layer] < radius:
            assert np.diff(polar) == pytest.approx((polar[-1] - polar[0]) / mine.sum())
            assert (polar[-1] - polar[0]) / 2.5 <= mine.sum() < (polar[-1] - polar[0]) / 2.5 + 1
        else:
            assert mine.sum() == 1
    assert (np.bincount(own) > 1).sum() >= 3
    own, low, high = rings(foot, thick, radius, np.array([False, True, False, False, False, False]))
    assert np.flatnonzero(np.bincount(own) > 1).tolist() == [1]
    np.testing.assert_array_equal(low[own != 1], foot[[0, 2, 3, 4, 5]])
    np.testing.assert_array_equal(high[own != 1], thick[[0, 2, 3, 4, 5]])


def test_points_are_beside_the_steps_before_their_own() -> None:
    """In whatever order they come: of the third step beside the first and second, of the first beside none."""
    rng = np.random.default_rng(2)
    first, way = rng.normal(size=(4, 3)), 0.4 * rng.normal(size=(4, 3))
    step, shank, radius = np.array([2, 0, 3, 1, 2, 0, 3]), np.array([True, False, True, True]), 0.7
    spot = 1.5 * rng.normal(size=(3, len(step), 5))
    found = beside_ball(spot, step, first, first + way, shank, radius)
    for k, own in enumerate(step):
        least = np.ones(5)
        for before in range(own):
            away = beyond_way(spot[:, k], first[before], first[before] + way[before], bool(shank[before])) - radius
            least = np.minimum(least, away)
        assert found[k] == pytest.approx(least, abs=1e-12)

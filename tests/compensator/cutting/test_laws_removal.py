"""A small block milled: the cut's ends, width and force by the circle, aside by milling anew, what is known by its limits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from compensator.cutting.cutter import Cutter
from compensator.cutting.removal import Engagement, mill_through
from compensator.cutting.stock import Stock
from compensator.cutting.track import Track
from tests.compensator.cutting.milled import TRUE, block, force_of, track_along
from tests.virtual_cell.leaning_ball import tilted

LOW, HIGH = (-12.0, -9.0, -6.0), (12.0, 9.0, 0.0)
RADIUS = 4.0
FLAT, BULL, BALL = (Cutter(1e-3 * RADIUS, 3, 1e-3 * corner) for corner in (0.0, 1.0, RADIUS))
UPRIGHT = (0.0, 0.0, 1.0)


def gone(corner: list[list[float]], cutter: Cutter = FLAT, levels: tuple[float, ...] = (-2.0,), cell: float = 0.25,
         axis: tuple[float, float, float] = UPRIGHT, aside: float = 0.0, stock: Stock | None = None
         ) -> tuple[Track, Engagement]:
    """Track and engagement of a way through the block."""
    track = track_along(np.array(corner))
    track = replace(track, axis=np.tile(axis, (len(track), 1)))
    return track, mill_through(stock or block(LOW, HIGH, levels, cell), track, cutter, aside)[0]


@pytest.mark.parametrize("turned", [0.0, 90.0, 180.0, -137.0])
@pytest.mark.parametrize("beside", [-11.0, -7.0, 0.0, 7.0, 11.0])
def test_a_cut_ends_where_the_circle_meets_the_edge(turned: float, beside: float) -> None:
    """A way along an edge of a square block, `beside` its middle to the left of the feed: what of the half circle is within
    9 mm of the middle, its chord as the width, and the mean force of the linear-edge law summed over it."""
    turn = np.radians(turned)
    feed, left = np.array([np.cos(turn), np.sin(turn), 0]), np.array([-np.sin(turn), np.cos(turn), 0])
    tip = beside * left + [0, 0, -2.0]
    square = block((-9, -9, -6), (9, 9, 0), (-2.0,), 0.25) if turned % 90 == 0 else _turned_square(turn)
    track, found = gone([list(tip - 14 * feed), list(tip + 2 * feed)], stock=square)
    # The last step is well within the block.
    low = np.arcsin(np.clip((-9 - beside) / RADIUS, -1, 1))
    high = np.arcsin(np.clip((9 - beside) / RADIUS, -1, 1))
    assert [found.low[-1], found.high[-1]] == pytest.approx([low, high], abs=0.02)
    assert found.depth[-1] == pytest.approx(2e-3, rel=1e-9)
    assert found.width[-1] == pytest.approx(1e-3 * RADIUS * (np.sin(high) - np.sin(low)), rel=0.01)
    phi = low + (np.arange(2000) + 0.5) / 2000 * (high - low)
    h, share = 0.1e-3 * np.cos(phi), 3 * 2e-3 * (high - low) / 2000 / (2 * np.pi)
    along, radial, axial = (TRUE[k] * h + TRUE[k + 3] for k in range(3))
    out = np.cos(phi)[:, None] * feed + np.sin(phi)[:, None] * left
    against = -np.sin(phi)[:, None] * feed + np.cos(phi)[:, None] * left
    truth = share * (along @ against - radial @ out - np.array([0, 0, axial.sum()]))
    assert force_of(track, found)[-1] == pytest.approx(truth, abs=0.01 * np.linalg.norm(truth))
    assert not found.unknown.any()
    assert np.isnan(found.low[0])
    assert np.isnan(found.high[0])
    assert not found.cuts[0]


def _turned_square(turn: float) -> Stock:
    """A block of 18 mm whose sides go along `turn` [rad]."""
    base = block((-14, -14, -6), (14, 14, 0), (-2.0,), 0.25)
    ny, nx = base.inside.shape[1:]
    x, y = np.meshgrid(base.origin[0] + base.cell * np.arange(nx), base.origin[1] + base.cell * np.arange(ny))
    one, other = np.cos(turn) * x + np.sin(turn) * y, -np.sin(turn) * x + np.cos(turn) * y
    within = 9e-3 - np.maximum(np.abs(one), np.abs(other))
    return replace(base, inside=np.broadcast_to(within.astype(np.float32), base.inside.shape))


@pytest.mark.parametrize(("cutter", "slope"), [(FLAT, 0), (BULL, 0), (BALL, 0), (BALL, 15), (BALL, -15), (FLAT, 15)])
def test_width_times_depth_times_way_is_what_is_gone(cutter: Cutter, slope: float) -> None:
    """Of a way with a corner and back beside itself, on the level; through and out of the block, up or down."""
    way = np.array([[-18.0, -2, -2], [6, -2, -2], [7, 3, -2], [-18, 3, -2]])
    if slope:
        x = np.array([-18.0, 0.0])
        way = np.column_stack([x, [1, 1], -2 + np.tan(np.radians(slope)) * x])
    stock = block(LOW, HIGH, (-2.0, *(np.arange(-5.8, 0.0, 0.2) if cutter.corner or slope else ())), 0.3)
    track = track_along(way)
    engaged, left = mill_through(stock, track, cutter)
    taken = stock.volume - left.volume
    assert taken > 5e-8
    each = np.linalg.norm(track.end - track.start, axis=1)
    assert float(engaged.width * engaged.depth @ each) == pytest.approx(taken, rel=0.03)


def cake() -> Stock:
    """A block with a smaller one on it and a step within: layers of several outlines."""
    stock = block(LOW, HIGH, (-4.0, -3.0, -2.0, -1.0), 0.25)
    inside = np.array(stock.inside)
    for layer, by in ((2, 1.5e-3), (3, 1.5e-3), (4, 4e-3)):
        inside[layer] -= by
    return replace(stock, inside=inside)


def same(one: np.ndarray, other: np.ndarray, bound: float) -> None:
    for part in (slice(0, 3), slice(3, 6)):
        assert one[..., part] == pytest.approx(other[..., part], abs=bound * np.abs(other[..., part]).max())


@pytest.mark.parametrize(("cutter", "tip"), [
    (FLAT, -3.0), (FLAT, -2.95), (FLAT, -6.05), (FLAT, -7.0), (BULL, -3.5), (BALL, -3.0)])
def test_aside_it_cuts_as_it_would_a_block_that_stands_the_other_way(cutter: Cutter, tip: float) -> None:
    """In one going through: moved by 0.1 mm along x, y and up, entry and exit too; up through layers whose outlines differ, and
    under the floor, where there is no more of it but from the foot of the tool."""
    stock, corner, aside = cake(), [[-17.0, -8.0, tip], [14.0, -4.0, tip]], 1e-4
    _, found = gone(corner, cutter, stock=stock, aside=aside)
    assert found.moved is not None
    for axis in range(2):
        other = replace(stock, origin=stock.origin - aside * np.eye(2)[axis])
        same(found.moved[axis], gone(corner, cutter, stock=other)[1].weights, 0.006)
        assert np.abs(found.moved[axis] - found.weights).max() > 0.01 * np.abs(found.weights).max()
    if cutter is FLAT:
        same(found.moved[2], gone(corner, cutter, stock=replace(stock, height=stock.height - aside))[1].weights, 1e-6)
    plain, steps = gone(corner, cutter, stock=stock)[1], np.array([40, 3, 41])
    assert plain.moved is plain.some(steps).moved is None
    for name in ("weights", "low", "high", "depth", "width", "unknown"):
        np.testing.assert_array_equal(getattr(found.some(steps), name), getattr(found, name)[steps])
    np.testing.assert_array_equal(found.some(steps).moved, found.moved[:, steps])
    np.testing.assert_array_equal(plain.weights, found.weights)


@pytest.mark.parametrize("side", [-1, 1])
def test_a_tool_that_only_just_misses_cuts_with_the_tool_aside(side: int) -> None:
    """By 0.05 mm beside a wall: moved by 0.1 mm along y it does, or goes off it; along x and up it misses it still."""
    stock, corner, aside = block(LOW, HIGH, (-3.0,), 0.25), [[-9.0, side * 13.05, -3.0], [9.0, side * 13.05, -3.0]], 1e-4
    _, found = gone(corner, stock=stock, aside=aside)
    assert found.moved is not None
    assert not found.cuts.any()
    assert not found.moved[[0, 2]].any()
    anew = gone(corner, stock=replace(stock, origin=stock.origin - [0, aside]))[1]
    assert anew.cuts.any() == (side < 0)
    same(found.moved[1], anew.weights, 0.01)


def test_an_edge_between_two_points_of_a_wide_cutter_is_moved_too() -> None:
    """A radius of 16 mm has points every 3 degrees, 0.84 mm: an edge half way between two is 0.42 mm from both, four times as
    far as the tool goes aside."""
    wide, aside = Cutter(16e-3, 3), 1e-4
    stock, y = block(LOW, HIGH, (-3.0,), 0.25), 9.0 - 16.0 * np.sin(np.radians(1.5))
    corner = [[-30.0, y, -3.0], [-6.0, y, -3.0]]
    _, found = gone(corner, wide, stock=stock, aside=aside)
    assert found.moved is not None
    anew = gone(corner, wide, stock=replace(stock, origin=stock.origin - [0, aside]))[1]
    changed = anew.weights[-1] - found.weights[-1]
    same(found.moved[1, -1] - found.weights[-1], changed, 0.02)
    assert np.abs(changed).max() > 0.001 * np.abs(found.weights[-1]).max()


@pytest.mark.parametrize("above", [False, True])
@pytest.mark.parametrize("slope", [-25.0, 25.0])
def test_a_ball_on_a_slope_aside_is_milled_anew(slope: float, above: bool) -> None:
    """Along x, y and up, entry and plateau; under a thick layer that is empty, too, which is air down to its foot."""
    stock = block(LOW, (*HIGH[:2], 4.0 * above), tuple(np.arange(-5.8, 0.1 * above, 0.2)), 0.25)
    if above:
        inside = np.array(stock.inside)
        inside[-1] = -0.3e-3
        stock = replace(stock, inside=inside)
    aside, rise = 1e-4, np.tan(np.radians(slope))
    ends = [[x, 8.0, -1.5 + rise * (x + 10 - (2.0 if slope > 0 else 0))] for x in (-15.0, -8.0)]
    _, found = gone(ends, BALL, stock=stock, aside=aside)
    assert found.moved is not None
    assert found.cuts.sum() > 6
    for axis in range(3):
        moved = [list(np.array(end) + 1e3 * aside * np.eye(3)[axis]) for end in ends]
        same(found.moved[axis], gone(moved, BALL, stock=stock)[1].weights, 0.05 if above else 0.02)


@pytest.mark.parametrize("side", [(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, 1)])
def test_whatever_a_cutter_touches_is_cut(side: tuple[int, int]) -> None:
    """A tenth of a millimetre within its reach of a side, or of a corner, it cuts; a tenth beyond it does not; nor over the
    top, but a hundredth under it does."""
    way, edge = np.array([*side, 0]), np.array([12.0, 9.0, 0.0])
    along = np.array([-side[1], side[0], 0]) / np.hypot(*side)
    for near, cuts in ((-0.1, True), (0.1, False)):
        reach = (RADIUS + near) / np.hypot(*side)
        tip = way * (edge + reach) * (np.abs(way) > 0) + [0, 0, -1]
        _, found = gone([list(tip - 0.5 * along), list(tip + 0.5 * along)], levels=(-1.0,))
        assert found.cuts.any() == cuts, near
    for high, cuts in ((-0.01, True), (0.01, False)):
        _, found = gone([[0, 0, high], [1, 0, high]])
        assert found.cuts.all() == found.cuts.any() == cuts


BOX = np.array([[-3.0, -2.0, 2.0], [4.0, 3.0, 5.0]])


@pytest.mark.parametrize(("axis", "side"), [(0, -1), (0, 1), (1, -1), (1, 1), (2, 1)])
@pytest.mark.parametrize("way", ["across", "in", "out"])
def test_where_nothing_is_said_of_what_stands_there_no_force_is_known(axis: int, side: int, way: str) -> None:
    """A box: within its bounds and the cutter's radius around it, aside, by a hundredth of a millimetre more or less; of a step
    that goes in or comes out wherever it is nearest."""
    for near, known in ((-0.01, False), (0.01, True)):
        place = BOX.mean(axis=0)
        place[axis] = BOX[(side + 1) // 2, axis] + side * (near + (RADIUS if axis < 2 else 0))
        stock = replace(block(LOW, HIGH, (-2.0,), 1.0), unknown=1e-3 * BOX[None])
        step = 0.25 * np.eye(3)[(axis + 1) % 2] if way == "across" else 0.5 * side * np.eye(3)[axis]
        ends = [list(place - step), list(place + step)] if way == "across" else [list(place + step), list(place)]
        _, found = gone(ends[::-1] if way == "out" else ends, stock=stock)
        assert len(found.unknown) == 1
        assert found.unknown[0] != known


@pytest.mark.parametrize(("aside", "known"), [(-0.01, False), (0.01, True)])
def test_a_tool_under_a_box_reaches_into_it(aside: float, known: bool) -> None:
    """A clamp on the block beside which it mills: its tip is under the clamp, and above that is the rest of it."""
    stock = replace(block(LOW, HIGH, (-2.0,), 1.0), unknown=1e-3 * BOX[None])
    _, found = gone([[BOX[1, 0] + RADIUS + aside, -1.0, -2.0], [BOX[1, 0] + RADIUS + aside, 1.0, -2.0]], stock=stock)
    assert found.cuts.all()
    assert found.unknown.all() == found.unknown.any() != known


@pytest.mark.parametrize(("lead", "near", "known"), [(30.0, -0.01, False), (30.0, 0.01, True), (-30.0, -0.01, True)])
@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("side", [-1, 1])
def test_a_shank_that_leans_reaches_into_a_box_beside_it(lead: float, near: float, known: bool, axis: int, side: int) -> None:
    """At the box's top, 5 mm over the middle of the ball: R / cos 30 and 5 tan 30 beside that; not where it leans away."""
    reach = RADIUS / np.cos(np.radians(30)) + 5.0 * np.tan(np.radians(30)) + near
    tip = np.array([0.5, 0.5, BOX[1, 2] - RADIUS - 5.0])
    tip[axis] = BOX[(side + 1) // 2, axis] + side * reach
    leans = -side * np.sin(np.radians(lead)) * np.eye(3)[axis] + [0, 0, np.cos(np.radians(30))]
    across = 0.25 * np.eye(3)[1 - axis]
    stock = replace(block(LOW, (*HIGH[:2], -5.5), (), 1.0), unknown=1e-3 * BOX[None])
    _, found = gone([list(tip - across), list(tip + across)], BALL, stock=stock, axis=(leans[0], leans[1], leans[2]))
    assert not found.cuts.any()
    assert found.unknown.all() == found.unknown.any() != known


@pytest.mark.parametrize(("cutter", "slope", "known"), [
    (FLAT, -4.9, True), (FLAT, -5.1, False), (FLAT, 30.0, True), (BULL, -4.9, True), (BULL, -5.1, False), (BULL, 4.9, True),
    (BULL, 5.1, False), (BALL, -59.5, True), (BALL, -60.5, False), (BALL, 60.5, True)])
def test_how_steep_a_cut_may_be(cutter: Cutter, slope: float, known: bool) -> None:
    """A flat floor cuts on its way down, a rounding's way is known next to the level, a ball's but down along its axis."""
    rise = np.radians(slope)
    way = np.array([np.cos(rise), 0, np.sin(rise)])
    tip = np.array([0.0, 0.0, -2.5])
    levels = tuple(np.arange(-5.5, 0.0, 0.5))
    _, found = gone([list(tip - 1.5 * way), list(tip)], cutter, levels, 0.4)
    assert found.cuts[-1]
    assert found.unknown[-1] != known


@pytest.mark.parametrize(("over", "known"), [(0.56, False), (0.7, True)])
def test_a_ball_may_go_straight_down_a_wall(over: float, known: bool) -> None:
    """Where it cuts by nothing of what is within 0.15 radii of its tip, 0.6 mm: the block ends `over` [mm] above that."""
    stock = block((-12, -9, -3), (0.0, 9, 6), tuple(np.arange(-2.9, 6.0, 0.1)), 0.2)
    aside = np.sqrt(RADIUS**2 - (RADIUS - over) ** 2)
    _, found = gone([[aside, 0, 1.5], [aside, 0, 0.5]], BALL, stock=stock)
    assert found.cuts[-1]
    assert found.unknown[-1] != known


def test_a_ball_that_leans_too_far_may_cut_wherever_there_is_stock() -> None:
    """By 70 degrees: from where a shank that leans as far as is known, 60 degrees, would meet the grid, two cells wider than
    the block, at the height of its top: R / cos 60 and what is above the tip times tan 60."""
    cell, tip = 0.5, -1.0
    reach = 2 * cell + RADIUS / 0.5 + (0 - tip) * np.sqrt(3)
    for axis, edge in ((0, 12.0), (1, 9.0)):
        for side in (-1, 1):
            for near, known in ((-0.05, False), (0.05, True)):
                place = np.array([0.0, 0.0, tip])
                place[axis] = side * (edge + reach + near)
                across = 0.25 * np.eye(3)[1 - axis]
                _, found = gone([list(place - across), list(place + across)], BALL, (), cell, axis=tilted(70.0, 0.0))
                assert found.unknown.all() == found.unknown.any()
                assert found.unknown.any() != known, (axis, side, near)
    _, above = gone([[0, 0, 0.01], [1, 0, 0.01]], BALL, (), cell, axis=tilted(70.0, 0.0))
    assert not above.unknown.any()


@pytest.mark.parametrize(("lean", "deep", "known"), [(20, 2.55, True), (20, 2.75, False), (-20, 3.9, True)])
def test_a_shank_that_leans_forward_meets_the_front(lean: float, deep: float, known: bool) -> None:
    """From R (1 - sin 20) = 2.63 mm on; leaning back, it is the ball that does."""
    levels = tuple(np.arange(-5.9, 0.0, 0.1))
    _, found = gone([[-10.0, 0, -deep], [-6.0, 0, -deep]], BALL, levels, 0.4, axis=tilted(lean, 0.0))
    assert found.cuts[-1]
    assert found.unknown[-1] != known


@pytest.mark.parametrize(("lean", "away", "meets"), [(25.0, -0.15, True), (25.0, 0.15, False), (-25.0, -0.15, False)])
@pytest.mark.parametrize("slope", [0.0, 3.0])
def test_a_shank_meets_a_wall_beside_it(lean: float, away: float, meets: bool, slope: float) -> None:
    """A wall whose upper edge stands 6 mm over the ball's middle, and the shank's side there; the ball cuts nothing of it."""
    far = RADIUS / np.cos(np.radians(25)) + 6.0 * np.tan(np.radians(25)) + away
    stock = block((-12.0, far, -6.0), (12.0, far + 6, 10.0), (-5, -4, -3, -2, -1, 0, 2, 4, 6, 8, 9, 9.5, 9.8), 0.25)
    rise = np.tan(np.radians(slope)) * 6
    _, found = gone([[-3.0, 0.0, -rise], [3.0, 0.0, 0.0]], BALL, stock=stock, axis=tilted(0.0, lean))
    assert not found.cuts.any()
    assert found.unknown[-1] == meets


@pytest.mark.parametrize("slope", [0.0, 3.0])
def test_what_a_shank_went_through_it_does_not_meet_again(slope: float) -> None:
    """On its way back along a wall that it leans into, a few steps on: a tenth of a millimetre further in it does."""
    far = RADIUS / np.cos(np.radians(25)) + 6.0 * np.tan(np.radians(25)) - 0.15
    stock = block((-12.0, far, -6.0), (12.0, far + 6, 10.0), (-5, -4, -3, -2, -1, 0, 2, 4, 6, 8, 9, 9.5, 9.8), 0.25)
    rise = np.tan(np.radians(slope)) * 3
    for in_by, meets in ((0.0, False), (0.1, True)):
        _, found = gone([[0.0, 0.0, 0.0], [3.0, 0.0, rise], [3.0, in_by, rise], [0.0, in_by, 0.0]], BALL, stock=stock,
                        axis=tilted(0.0, 25.0))
        assert found.unknown[:5].all()
        assert found.unknown[-4:].all() == found.unknown[-4:].any() == meets


@pytest.mark.parametrize(("cutter", "slope", "lean"), [(FLAT, 0, 0), (BALL, 20, 0), (BALL, 0, 20)])
@pytest.mark.parametrize("shift", [[100.0, 60.0, 30.0], [100.0, -70.0, 30.0], [-90.0, 80.0, -40.0]])
def test_it_is_all_the_same_wherever_the_work_object_has_its_origin(
    cutter: Cutter, slope: float, lean: float, shift: list[float]
) -> None:
    """In any quarter around it: two passes beside each other, what they cut, what is known of it, and what is left."""
    rise = 8 * np.tan(np.radians(slope))
    way = np.array([[-15.0, 5, -2], [-7, 5, -2 + rise], [-7, 2, -2 + rise], [-15, 2, -2]])
    stock, found = block(LOW, HIGH, tuple(np.arange(-5.75, 0.0, 0.25)), 0.5), []
    for by in (np.zeros(3), np.array(shift)):
        moved = replace(stock, origin=stock.origin + 1e-3 * by[:2], height=stock.height + 1e-3 * by[2])
        track = track_along(way + by)
        track = replace(track, axis=np.tile(tilted(float(lean), 0.0), (len(track), 1)))
        found.append(mill_through(moved, track, cutter))
    (here, left), (there, left_there) = found
    assert here.cuts.sum() > 10
    np.testing.assert_allclose(there.weights, here.weights, atol=2e-3 * np.abs(here.weights).max())
    np.testing.assert_array_equal(there.unknown, here.unknown)
    np.testing.assert_allclose(*(np.minimum(one.inside, one.cell) for one in (left_there, left)), atol=1e-7)

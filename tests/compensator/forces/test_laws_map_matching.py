"""Samples onto the path: by length, and forwards by position."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from compensator.forces.map_matching import _project_between, _Walk, match_forwards, match_nearest_pass
from compensator.forces.path_segments import Segments
from compensator.path.arc_length import arc_length, nearest_target, polyline
from compensator.toolpath import Move

LINEAR, VIA, END, JOINT = (np.uint8(m) for m in (Move.LINEAR, Move.ARC_VIA, Move.ARC_END, Move.JOINT))


def test_chords_and_arcs() -> None:
    # 3 m, then a half circle of radius 1 m, then 4 m back by joint move.
    position = np.array([[0, 0, 0], [3, 0, 0], [4, 1, 0], [3, 2, 0], [3, 2, 4.0]])
    length = arc_length(position, np.array([JOINT, LINEAR, VIA, END, JOINT]))
    assert_allclose(length, [0, 3, 3 + np.pi / 2, 3 + np.pi, 7 + np.pi])


def test_arcs_longer_than_half_a_circle_and_straight_ones() -> None:
    angle = np.radians([0, 200, 300])
    circle = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(3)])
    assert_allclose(arc_length(circle, np.array([LINEAR, VIA, END])), angle, atol=1e-12)
    line = np.array([[0, 0, 0], [1, 0, 0], [3, 0, 0.0]])
    assert_allclose(arc_length(line, np.array([LINEAR, VIA, END])), [0, 1, 3])


def test_targets_of_unknown_position_are_left_out() -> None:
    position = np.array([[0, 0, 0], [np.nan] * 3, [2, 0, 0.0]])
    assert_allclose(arc_length(position, np.full(3, LINEAR)), [0, np.nan, 2])


def test_half_a_segment_on_either_side() -> None:
    length = np.array([0, 2, np.nan, 3, 3.5])
    places = np.array([-1, 0.99, 1.01, 2.49, 2.51, 3.24, 3.26, 9])
    assert nearest_target(length, places).tolist() == [0, 0, 1, 1, 3, 3, 4, 4]


def follow(points: np.ndarray, samples: np.ndarray) -> np.ndarray:
    return match_forwards(*polyline(points, np.full(len(points), LINEAR)), samples)


def along(points: np.ndarray, places: np.ndarray) -> np.ndarray:
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    return np.column_stack([np.interp(places, length, points[:, i]) for i in range(3)])


def test_crossing_passes_stay_apart() -> None:
    points = np.array([[0, 0, 0], [0.1, 0.1, 0], [0.1, 0, 0], [0, 0.1, 0.0]])
    total = 0.1 * (np.sqrt(2) * 2 + 1)
    places = np.linspace(0, total, 5000)
    noise = 2e-5 * np.random.default_rng(1).standard_normal((5000, 3))
    assert np.max(np.abs(follow(points, along(points, places) + noise) - places)) < 2e-4


def test_to_and_fro_on_one_line() -> None:
    """Down and up again along the same line: which way a sample belongs to is told by the order alone."""
    points = np.array([[0, 0, 0.05], [0, 0, 0], [0, 0, 0.05], [0.02, 0, 0.05], [0.02, 0, 0], [0.02, 0, 0.05]])
    places = np.linspace(0, 0.22, 4000)
    assert np.max(np.abs(follow(points, along(points, places)) - places)) < 4e-4


@pytest.mark.parametrize("noise", [1e-6, 2e-5, 2e-4])
@pytest.mark.parametrize("seed", range(4))
def test_a_closed_contour_begins_at_its_beginning(noise: float, seed: int) -> None:
    """Start and end of a contour are one place, and so are those of the same contour a millimetre deeper, but for the depth."""
    rng = np.random.default_rng(seed)
    angle = np.linspace(0, 4 * np.pi, 301)
    points = 0.05 * np.column_stack([np.cos(angle), np.sin(angle), -0.02 * np.floor(angle / 2 / np.pi - 1e-9)])
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    places = np.arange(0, length[-1], 3e-4)
    samples = along(points, places) + noise * rng.standard_normal((len(places), 3))
    assert np.mean(np.abs(follow(points, samples) - places) < 1e-4 + 5 * noise) > 0.99
    once = points[:151]
    assert np.mean(np.abs(follow(once, samples[places < length[150]]) - places[places < length[150]]) < 1e-4 + 5 * noise) > 0.99


def test_a_corner_cut_by_its_zone_is_not_taken_for_another_pass() -> None:
    """The tool is 2 mm off the corner and just there on the way of a later pass."""
    points = np.array([[0, 0, 0], [0.05, 0, 0], [0.05, 0.05, 0], [0, 0.05, 0], [0.0465, 0.0015, 0.0], [0.05, -0.05, 0.0]])
    cut = np.array([[0, 0, 0], [0.045, 0, 0], [0.0465, 0.0015, 0], [0.05, 0.005, 0], *points[2:]])
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(cut, axis=0), axis=1))])
    places = np.linspace(0, length[-1], 6000)
    found = follow(points, along(cut, places))
    assert np.all(np.abs(found - places)[np.isfinite(found)] < 4e-3)
    assert np.isfinite(found).mean() > 0.99


def test_zigzag_with_dwells_and_changing_speed() -> None:
    rows = np.arange(20) * 1e-3
    points = np.array([[x, y, 0] for i, y in enumerate(rows) for x in ((0, 0.1) if i % 2 == 0 else (0.1, 0))])
    rng = np.random.default_rng(2)
    steps = rng.choice([0, 1e-5, 4e-4, 1e-3], 12_000)
    places = np.cumsum(steps)
    total = 20 * 0.1 + 19 * 1e-3
    places = places[places <= total]
    found = follow(points, along(points, places) + 2e-5 * rng.standard_normal((len(places), 3)))
    assert np.max(np.abs(found - places)) < 2e-3        # never a pass off: those are 100 mm apart along the path
    assert np.quantile(np.abs(found - places), 0.99) < 2e-4


def test_a_log_of_the_cuts_alone() -> None:
    """No samples during the retracts: the match jumps forwards, never back."""
    rows = np.arange(6) * 2e-3
    points = np.array([p for y in rows for p in ([0, y, 0], [0.1, y, 0], [0.1, y, 0.05], [0, y, 0.05])])
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    places = np.concatenate([np.linspace(length[4 * i], length[4 * i + 1], 300) for i in range(6)])
    assert np.max(np.abs(follow(points, along(points, places)) - places)) < 1e-4


def test_a_log_that_starts_where_passes_cross_is_of_the_one_that_it_goes_on_along() -> None:
    """From the first sample on, though by noise that lies on the other pass; of two passes on one line it is the first."""
    points = np.array([[-0.1, 0, 0], [0.1, 0, 0], [0.1, 0.1, 0], [0, 0.1, 0], [0, -0.1, 0.0]])
    places = np.linspace(0.5, 0.58, 400)
    samples = along(points, places)
    samples[0, 0] += 1e-4
    assert_allclose(follow(points, samples), places, atol=1e-9)
    twice = np.array([[0, 0, 0], [0.1, 0, 0], [0.1, 0, 0.05], [0, 0, 0.05], [0, 0, 0], [0.1, 0, 0]])
    assert_allclose(follow(twice, along(twice, places - 0.48)), places - 0.48, atol=1e-9)


@pytest.mark.parametrize("left_out", [1, 2])
def test_what_a_log_leaves_out_between_two_places_that_are_one_is_passed_over(left_out: int) -> None:
    """A way aside and back that the tool did not go: the log walks on, and so little from sample to sample that only a search
    farther ahead finds it there."""
    aside = 0.04 * left_out
    points = np.array([[0, 0, 0], [0.05, 0, 0], [0.05, aside, 0], [0.05, 0, 0], [0.1, 0, 0], [0.1, aside, 0], [0.1, 0, 0],
                       [0.15, 0, 0.0]])
    walked = np.linspace(0, 0.15, 1501)
    found = follow(points, np.column_stack([walked, 0 * walked, 0 * walked]))
    expected = walked + 2 * aside * (walked > 0.05) + 2 * aside * (walked > 0.1)
    # Half a millimetre off the path is still on it, and five misses more are nowhere.
    sure = np.min(np.abs(walked[:, None] - [0.05, 0.1]) > 1.1e-3, axis=1)
    assert_allclose(found[sure], expected[sure], atol=1e-9)
    assert np.isfinite(found).all()


def test_samples_off_the_path_are_not_placed() -> None:
    points = np.array([[0, 0, 0], [0.1, 0, 0.0]])
    samples = along(points, np.linspace(0, 0.1, 100))
    samples[40:50, 2] += 0.2
    found = follow(points, samples)
    assert np.isnan(found[40:50]).all()
    assert_allclose(found[50:], np.linspace(0, 0.1, 100)[50:], atol=1e-9)


def test_a_log_that_starts_in_the_middle() -> None:
    points = np.array([[x, 0, 0] for x in np.linspace(0, 1, 101)])
    places = np.linspace(0.6, 0.8, 500)
    assert_allclose(follow(points, along(points, places)), places, atol=1e-9)


def test_positions_on_arcs() -> None:
    """Two arcs, of 200 and of 90 degrees: samples exactly on them are found at their angle."""
    angle = np.radians([0, 100, 200])
    points = np.column_stack([0.05 * np.cos(angle), 0.05 * np.sin(angle), np.zeros(3)])
    move = np.array([LINEAR, VIA, END])
    along_arc = np.radians(np.linspace(0, 200, 3000))
    samples = np.column_stack([0.05 * np.cos(along_arc), 0.05 * np.sin(along_arc), np.zeros(3000)])
    found = match_forwards(*polyline(points, move), samples)
    assert np.max(np.abs(found - 0.05 * along_arc)) < 2e-5
    corners, length = polyline(points, move)
    assert_allclose(np.linalg.norm(corners, axis=1), 0.05, rtol=1e-12)
    assert_allclose(length[-1], 0.05 * angle[-1])


def teeth(count: int) -> np.ndarray:
    """A long program in layers of teeth 5 mm high, 4 mm apart, ten targets an edge (10 * count + 1, 3)."""
    tooth = np.arange(count + 1)
    row, column = np.divmod(tooth, 20)
    high = 8e-3 * row + 5e-3 * (tooth % 2)
    corners = np.column_stack([4e-3 * np.where(row % 2 == 0, column, 20 - column), high % 0.4, -1e-3 * np.floor(high / 0.4)])
    return np.column_stack([np.interp(np.arange(0, 10 * count + 1) / 10, tooth, axis) for axis in corners.T])


def cut_at_the_corners(points: np.ndarray) -> np.ndarray:
    """A log that goes round each corner of `teeth` more than a millimetre off, and waits there."""
    corners = points[::10]
    before, after = corners[1:-1] + 0.4 * (corners[:-2] - corners[1:-1]), corners[1:-1] + 0.4 * (corners[2:] - corners[1:-1])
    way = np.concatenate([corners[:1], np.stack([before, after], axis=1).reshape(-1, 3), corners[-1:]])
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1))])
    waits = np.repeat((length[1:-2:2] + length[2:-1:2]) / 2, 12)
    return along(way, np.sort(np.concatenate([np.linspace(0, length[-1], 2 * len(points)), waits])))


def test_corners_cut_all_along_the_program_lead_to_no_other_place() -> None:
    """A third of each edge's length is cut off at every corner: nobody is placed on another tooth."""
    points = teeth(150)
    samples = cut_at_the_corners(points)
    found = follow(points, samples)
    assert np.isfinite(found).mean() > 0.99
    there = along(points, np.nan_to_num(found))
    assert np.max(np.linalg.norm(there - samples, axis=1)[np.isfinite(found)]) < 3e-3
    assert np.all(np.diff(found[np.isfinite(found)]) < 8e-3)


def test_a_tool_beside_its_pass_leaves_it_for_no_other_that_is_not_much_nearer() -> None:
    """Passes a millimetre apart, each cut the same way; the logged TCP is 0.58 mm off its own pass, 0.42 off the next one."""
    points = np.array([p for y in 1e-3 * np.arange(3) for p in ([0, y, 0], [1, y, 0], [1, y, 0.05], [0, y + 1e-3, 0.05])])
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    places = np.linspace(0, length[-4], 4000)
    samples = along(points, places)
    samples[(samples[:, 0] > 0.02) & (samples[:, 2] == 0), 1] += 5.8e-4
    found = follow(points, samples)
    assert np.nanmax(np.abs(found - places)) < 2e-3
    assert np.isfinite(found).mean() > 0.97


def test_a_segment_holds_what_is_from_its_start_to_before_its_end() -> None:
    """Asked for by steps, and by a leap beyond what is at hand: the last one that begins there or before, and none before the
    one that was asked from."""
    s = np.arange(3001.0)
    segments = Segments(np.column_stack([s, 0 * s, 0 * s]), s)
    segments._load(0)
    for first in (0, 3, 2040):
        for arc in (first, first + 0.5, first + 1, first + 7, first + 7.5, first + 100, 2999.5):
            assert segments.holding(float(arc), first) == int(arc)
        assert segments.holding(first - 0.5, first) == first
    assert segments.holding(2900.0, 2900) == 2900


def test_a_log_off_the_path_costs_no_more_a_sample_on_a_long_program(monkeypatch: pytest.MonkeyPatch) -> None:
    """Counted: segments that are made plain numbers, projected on or found near, and samples walked."""
    counted = []
    load, projections, within, walk = Segments._load, Segments.projections, Segments.within, _Walk.along

    def counting(function, size):
        def counts(self, *given):
            answer = function(self, *given)
            counted.append(size(self, answer, *given))
            return answer
        return counts

    monkeypatch.setattr(Segments, "_load", counting(load, lambda segments, _, first: segments.end - first))
    monkeypatch.setattr(Segments, "projections", counting(projections, lambda segments, answer, *_: len(answer[0])))
    monkeypatch.setattr(Segments, "within", counting(within, lambda segments, answer, *_: len(answer)))
    monkeypatch.setattr(_Walk, "along", counting(walk, lambda segments, answer, samples: len(samples)))

    def cost(count: int, spoil) -> float:
        points = teeth(count)
        samples = spoil(points)
        counted.clear()
        follow(points, samples)
        return sum(counted) / len(samples)

    def beside(points: np.ndarray) -> np.ndarray:
        """In turn on the path and a metre beside it."""
        samples = points.copy()
        samples[np.arange(len(points)) // 15 % 2 == 1] += [0, 0, 1.0]
        return samples

    for spoil in (cut_at_the_corners, lambda points: points + np.array([0, 0, 1.0]), beside):
        assert cost(800, spoil) < 1.5 * cost(100, spoil) + 5


def test_what_boxes_find_near_a_point_is_what_lies_near() -> None:
    """Every segment within a distance is found, whatever part of the path is asked for; few others are."""
    rng = np.random.default_rng(8)
    for count in (2, 17, 18, 300, 5000):
        points = np.cumsum(rng.normal(0, 1e-2, (count, 3)), axis=0)
        segments = Segments(*polyline(points, np.full(count, LINEAR)))
        start, vector = points[:-1], np.diff(points, axis=0)
        for _ in range(20):
            point = points[rng.integers(count)] + rng.normal(0, 1e-2, 3)
            first, last = np.sort(rng.integers(0, count, 2))
            share = np.clip(np.sum((point - start) * vector, axis=1) / np.sum(vector**2, axis=1), 0, 1)
            off = np.linalg.norm(point - start - share[:, None] * vector, axis=1)
            near = np.flatnonzero(off <= 2e-2)
            found = segments.within(point, 2e-2, first, last)
            assert set(near[(near >= first) & (near < last)]) <= set(found.tolist())
            assert np.all((found >= first) & (found < last))
            assert np.all(off[found] <= 2e-2 + np.linalg.norm(vector[found], axis=1))


@pytest.mark.parametrize("off", [-2.3, -1.8, -0.6, 0.0, 0.7, 1.9])
def test_between_two_keys_a_sample_is_found_two_segments_off_its_share_of_time(off: float) -> None:
    """Segments of 1 mm, keys at both ends of 20 mm; the tool is behind or ahead of an even speed by so many millimetres."""
    along = 1e-3 * np.arange(41)
    points = np.column_stack([along, 0 * along, 0 * along])
    place = 1e-3 * (np.arange(21) + off + 0.3)[4:17]
    samples = np.column_stack([place, np.full(13, 0.2e-3), 0 * place])
    found = _project_between(Segments(points, along), samples, 4, np.array([0, 20]), np.array([0.0, 20e-3]))
    assert found == pytest.approx(place, abs=1e-9)


@pytest.mark.parametrize("aside_mm", [0.0, 1.0, 1.4])
def test_a_few_samples_near_the_end_of_a_path_that_returns_are_no_pass(aside_mm: float) -> None:
    """A program that ends where it begins, and the log of the one before, whose first samples lie nearer to the last move: it
    goes along the path once, and nearly all of it lies there."""
    plan = np.array([[0, 0, 50], [36, 0, 20], [36, 0, 0], [36, 100, 0], [160, 100, 0], [160, 20, 0], [0, 20, 0], [0, 20, 50],
                     [0, 0, 50]]) / 1e3
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(plan, axis=0), axis=1))])
    way = np.arange(0.0, length[-1], 2e-4)
    for across in ([0, 1, 0], [-1, 1, 0]):
        log = np.column_stack([np.interp(way, length, axis) for axis in (plan + 1e-3 * aside_mm * np.array(across)).T])
        place, passes = match_nearest_pass(plan, length, log)
        assert passes == 1
        assert np.isfinite(place).mean() > 0.98


@pytest.mark.parametrize(("share", "counted"), [(0.45, 1), (0.55, 2)])
def test_what_comes_behind_is_a_pass_where_it_is_half_of_one(share: float, counted: int) -> None:
    """A program that is begun again and stopped: the samples behind its end lie on it too."""
    plan = np.array([[0, 0, 50], [36, 0, 20], [36, 0, 0], [36, 100, 0], [160, 100, 0], [160, 20, 0], [0, 20, 0], [0, 20, 50],
                     [0, 0, 50]]) / 1e3
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(plan, axis=0), axis=1))])
    once = np.column_stack([np.interp(np.arange(0.0, length[-1], 2e-4), length, axis) for axis in plan.T])
    place, passes = match_nearest_pass(plan, length, np.vstack([once, once[:int(share * len(once))]]))
    assert passes == counted
    assert np.isfinite(place[:len(once)]).mean() > 0.98

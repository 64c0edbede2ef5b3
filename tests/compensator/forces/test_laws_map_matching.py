"""Samples onto the path: by length, and forwards by position."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from compensator.forces.map_matching import match_forwards
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

"""Lengths of arcs and of the way as it is driven, held against circles and polylines that are drawn."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from compensator.path.arc_length import arc_length, nearest_target, polyline
from compensator.path.driven_path import DrivenPath, driven_path
from compensator.path.robot_path import RobotPath, robot_path
from compensator.rapid import read_rapid
from compensator.toolpath import Move
from identification.model.cell import read_cell
from tests.support import write_cell

L, VIA, END = int(Move.LINEAR), int(Move.ARC_VIA), int(Move.ARC_END)


def moves(*kinds: int) -> np.ndarray:
    return np.array(kinds, dtype=np.uint8)


@pytest.mark.parametrize("seed", range(20))
def test_an_arc_is_as_long_as_its_radius_times_its_angle_however_it_lies(seed: int) -> None:
    """Of any circle in space, up to all but a whole turn; its polyline stays on the circle, in steps of three degrees at most,
    whose lengths are in proportion to the angles. A line leads to it, another away."""
    rng = np.random.default_rng([20, seed])
    radius, (via, end) = 10 ** rng.uniform(-3, 1), np.sort(rng.uniform(0.05, 6.2, 2))
    turn, centre = Rotation.random(rng=rng), rng.normal(size=3)
    circle = centre + turn.apply(radius * np.column_stack([np.cos([0, via, end]), np.sin([0, via, end]), np.zeros(3)]))
    points = np.concatenate([circle[:1] - np.array([0, 0, 0.7]), circle, circle[-1:] + np.array([0.3, 0, 0])])
    kinds = moves(L, L, VIA, END, L)
    expected = np.array([0, 0.7, 0.7 + radius * via, 0.7 + radius * end, 1.0 + radius * end])
    np.testing.assert_allclose(arc_length(points, kinds), expected, rtol=1e-7)
    drawn, s = polyline(points, kinds)
    assert np.isin(points, drawn).all()
    inner = (s >= 0.7 - 1e-12) & (s <= expected[3] + 1e-12)
    angle = np.unwrap(np.arctan2(*turn.inv().apply(drawn[inner] - centre).T[[1, 0]]))
    np.testing.assert_allclose(np.linalg.norm(drawn[inner] - centre, axis=1), radius, rtol=1e-6)
    np.testing.assert_allclose((s[inner] - 0.7) / radius, angle - angle[0], atol=1e-6)
    assert np.diff(angle).min() > 0
    assert np.diff(angle).max() <= np.radians(3.0) * (1 + 1e-9)
    assert len(angle) == 1 + sum(int(np.ceil(part / np.radians(3))) for part in (via, end - via))


def test_what_is_in_line_or_no_arc_is_as_long_as_its_chords() -> None:
    """Three points in line; a via without its end; arcs that follow each other; a target of unknown place in between."""
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 0.0]])
    line = np.array([[0, 0, 0], [3, 0, 4], [6, 0, 8.0]])
    np.testing.assert_allclose(arc_length(line, moves(L, VIA, END)), [0, 5, 10])
    assert len(polyline(line, moves(L, VIA, END))[0]) == 3
    for kinds in (moves(L, VIA, L, END, L), moves(VIA, L, L, END, VIA), moves(VIA, END, L, L, L)):
        np.testing.assert_allclose(arc_length(square, kinds), np.arange(5))
        np.testing.assert_array_equal(polyline(square, kinds)[0], square)
    # Two halves of the circle round the square, each through a corner: the radius is half of its diagonal.
    np.testing.assert_allclose(arc_length(square, moves(L, VIA, END, VIA, END)), np.sqrt(0.5) * np.pi / 2 * np.arange(5))
    unknown = np.insert(square, [1, 3], np.nan, axis=0)
    np.testing.assert_allclose(arc_length(unknown, moves(L, L, L, L, L, L, L)), [0, np.nan, 1, 2, np.nan, 3, 4])
    np.testing.assert_allclose(arc_length(np.full((3, 3), np.nan), moves(L, L, L)), [np.nan] * 3)
    length = np.array([0, np.nan, 1, 2, np.nan, 3, 4])
    assert nearest_target(length, np.array([-9, 0.49, 0.51, 1.49, 1.51, 2.49, 2.51, 3.51, 99])).tolist() == [
        0, 0, 2, 2, 3, 3, 5, 6, 6]


def planned(folder: Path, points: list[list[float] | None]) -> RobotPath:
    """Straight moves to these places [mm], of which one may be known to the controller alone."""
    at = [f"[[{x},{y},{z}],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]" if point else "*"
          for point in points for x, y, z in [point or [0, 0, 0]]]
    text = "MODULE M\nPROC main()\n" + "".join(f"MoveL {one},v100,z1,tSpindle;\n" for one in at) + "ENDPROC\nENDMODULE\n"
    return robot_path(read_rapid(text.encode(), "m.mod").toolpath, read_cell(write_cell(folder)))


POINTS: list[list[float] | None] = [
    [1100, 0, 700], [1140, 0, 700], [1140, 30, 700], None, [1100, 30, 700], [1100, 80, 720], [1180, 80, 720], [1180, 0, 720]]


def test_a_place_on_the_way_as_driven_is_that_of_the_text_where_the_text_goes_that_way(tmp_path: Path) -> None:
    """Two stretches of the text exchanged, one of them driven twice: along a move of the text the very place; on the way from
    one stretch to another the end that is nearer."""
    path = planned(tmp_path, POINTS)
    order = np.array([4, 5, 6, 0, 1, 2, 3, 4, 5, 6, 7])
    driven = driven_path(path, order)
    assert driven is not None
    known = [number for number in order if POINTS[number] is not None]
    place = 1e-3 * np.array([POINTS[number] for number in known], dtype=float)
    step = np.linalg.norm(np.diff(place, axis=0), axis=1)
    text = 1e-3 * np.array([point for point in POINTS if point], dtype=float)
    of_text = np.append(0, np.cumsum(np.linalg.norm(np.diff(text, axis=0), axis=1)))
    length = dict(zip([k for k, point in enumerate(POINTS) if point], of_text, strict=True))
    np.testing.assert_allclose(driven.ends, [step.sum(), of_text[-1]], rtol=1e-12)
    rng, start, seen = np.random.default_rng(4), 0.0, set[int]()
    for k, (before, behind) in enumerate(pairwise(known)):
        share = rng.uniform(0, 1, 20)
        found, first = driven.in_text(start + share * step[k])
        start += step[k]
        if behind == before + 1:
            expected = length[before] + share * (length[behind] - length[before])
        else:
            expected = np.where(share < 0.5, length[before], length[behind])
        np.testing.assert_allclose(found, expected, atol=1e-9)
        new = np.array([before not in seen, behind not in seen | {before}])
        np.testing.assert_array_equal(first, np.where(share < 0.5, new[0], new[1]))
        seen.add(before)
    np.testing.assert_allclose(driven.in_text(np.array([-1.0, 9.0]))[0], [length[4], length[7]])
    assert driven.first.tolist() == [True] * 7 + [False] * 3 + [True]


@pytest.mark.parametrize(("order", "there"), [
    ([1, 0], True), ([1], False), (None, False), ([3, 0, 3, 4], True), ([3, 0, 3], False)])
def test_a_way_as_driven_has_two_targets_of_known_place(tmp_path: Path, order: list[int] | None, there: bool) -> None:
    driven = driven_path(planned(tmp_path, POINTS), None if order is None else np.array(order))
    assert isinstance(driven, DrivenPath) == there

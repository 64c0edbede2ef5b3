"""What is left between targets: where the tool is commanded there, what of it is across the planned curve, where the deviation
jumps, and what is said of it."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from compensator.correction.between_targets import BetweenTargets, _across, _commanded, _findings, _steps
from compensator.correction.settings import CorrectionSettings, Spacing
from identification.model.rotations import Frame
from tests.runs.command_line.user_files import Rotation


def test_along_an_arc_nothing_is_across_and_all_else_is() -> None:
    """An arc far from the origin, in a part that stands otherwise at each target: its tangent by the derivative."""
    rng = np.random.default_rng(41)
    angle, turn = np.linspace(0.0, 1.2, 25), Rotation.random(25, random_state=rng)
    plane = Rotation.random(random_state=rng).as_matrix()
    arc = [1.0, -2.0, 0.5] + 0.1 * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle]) @ plane.T
    tangent = np.column_stack([-np.sin(angle), np.cos(angle), 0 * angle]) @ plane.T
    points = np.array([1, 2, 7, 11, 23])
    path: Any = SimpleNamespace(rest_from_tcp=SimpleNamespace(position=arc), axes=SimpleNamespace(
        turned_to_base=lambda vectors, rows: turn[rows].apply(vectors)))
    along, off = turn[points].apply(tangent[points]), rng.normal(size=(5, 3))
    np.testing.assert_allclose(_across(along, path, points), 0.0, atol=1e-12)
    across = np.cross(along, np.cross(off, along))
    np.testing.assert_allclose(_across(off, path, points), across, atol=1e-12)


def test_its_figures_are_of_what_is_left_and_of_the_scatter_beside_it() -> None:
    left, noise = 1e-6 * np.array([3.0, 0, 4, 0]), 1e-6 * np.array([1.0, 7.0])
    found = BetweenTargets(left, left**2, noise, np.array([5, 5, 8, 9]), np.array([5, 6, 9, 10]), False, ())
    assert found.as_dict() == pytest.approx({"moves": 3, "largest": 4.0, "rms": 2.5, "scatter_rms": 5.0})
    assert found.line() == ("left between targets, by the same model: largest 4.00 um, RMS 2.50 um (3 moves looked at; the "
                            "scatter of the log, 5.00 um RMS a point, not counted)")
    assert replace(found, assumed=True).line().endswith(
        "(3 moves looked at; the log names targets: the force is taken as straight from one to the next)")
    none = BetweenTargets(left[:0], left[:0], noise[:0], np.arange(0), np.arange(0), False, ())
    assert none.as_dict() == {"moves": 0, "largest": 0.0, "rms": 0.0, "scatter_rms": 0.0}


def looked(length: np.ndarray, at: list[int], arcs: list[list[int]], **told: Any) -> Any:
    """A grid of points at these path lengths [m], along x, of which those `at` are targets, and its arcs."""
    axes = SimpleNamespace(turned_to_rest=lambda vectors, rows: vectors, turned_to_base=lambda vectors, rows: vectors)
    path = SimpleNamespace(length=length, axes=axes, rest_from_tcp=SimpleNamespace(position=np.outer(length, [1.0, 0, 0])))
    grid = SimpleNamespace(owner=np.zeros(len(length), dtype=int), **told)
    return SimpleNamespace(at=np.array(at), arcs=np.array(arcs, dtype=int).reshape(-1, 2), fine=SimpleNamespace(path=path),
                           grid=grid, noise=np.zeros(len(length)))


def test_between_targets_the_tool_is_commanded_along_lines_and_arcs() -> None:
    """Point by point: in proportion to the path on a line, to the angle about the circle on each half of an arc, of which the
    orientation turns evenly from one end to the other, whatever its circle point says; an arc that is none is a line."""
    rng = np.random.default_rng(8)
    length = np.cumsum(rng.uniform(0.5e-3, 2e-3, 21))
    at = [0, 3, 5, 7, 10, 12, 14, 16, 18, 20]
    turns = Rotation.random(random_state=rng) * Rotation.from_rotvec(rng.normal(0, 0.2, (10, 3)))
    position = rng.normal(size=(10, 3))
    position[8] = 0.4 * position[7] + 0.6 * position[9]
    points = np.setdiff1d(np.arange(21), at)
    # Arcs from point 3 over 5 to 7, from 10 over 12 to 14, and from 16 over 18 to 20, whose targets lie in line.
    of_arc = {4: (1, 0), 6: (1, 1), 11: (4, 0), 13: (4, 1), 17: (7, 0), 19: (7, 1)}
    found = _commanded(looked(length, at, [[10, 2], [16, 2], [3, 2]]), Frame(turns.as_matrix(), position), points)
    for k, point in enumerate(points.tolist()):
        start = int(np.searchsorted(at, point)) - 1
        begin, end = (start, start + 1) if point not in of_arc else (of_arc[point][0], of_arc[point][0] + 2)
        share, turned = ((length[point] - length[at[a]]) / (length[at[b]] - length[at[a]]) for a, b in (
            (start, start + 1), (begin, end)))
        expected = (1 - share) * position[start] + share * position[start + 1]
        if point in of_arc and point < 16:
            a, b, c = position[begin:end + 1]
            normal = np.cross(b - a, c - a)
            normal /= np.linalg.norm(normal)
            # The centre is as far from all three, in their plane.
            centre = np.linalg.solve([b - a, c - a, normal], [(b @ b - a @ a) / 2, (c @ c - a @ a) / 2, normal @ a])
            first, last = position[start] - centre, position[start + 1] - centre
            angle = np.arctan2(normal @ np.cross(first, last), first @ last) % (2 * np.pi)
            expected = centre + Rotation.from_rotvec(share * angle * normal).apply(first)
        np.testing.assert_allclose(found.position[k], expected, atol=1e-9)
        change = (turns[end] * turns[begin].inv()).as_rotvec()
        there = Rotation.from_rotvec(turned * change) * turns[begin]
        assert (Rotation.from_matrix(found.rotation[k]) * there.inv()).magnitude() < 1e-7
    alone = _commanded(looked(length, at, []), Frame(turns.as_matrix(), position), points[:2])
    np.testing.assert_allclose(alone.position, found.position[:2])


@pytest.mark.parametrize(("may", "half_way", "expected_um"), [
    (True, 0.0, 50.0), (True, 0.5, 50.0), (False, 0.0, 50.0), (False, 0.5, 12.5)])
@pytest.mark.parametrize("added", [10, 11])
def test_between_two_targets_that_may_not_stand_nearer_half_of_a_jump_is_left(
    may: bool, half_way: float, expected_um: float, added: int
) -> None:
    """100 um across from one point to the next, on a line perhaps half of it one point before, beside a deviation that grows
    evenly by the path and one along it; less three sigma of the point. On an arc, whose points are its pieces, half a jump on
    either side leads up to the other half."""
    length = np.cumsum(np.random.default_rng(2).uniform(0.8e-3, 1.2e-3, 24))
    jump = np.where(np.arange(24) > 10, 100e-6, 0.0)
    jump[10] = 100e-6 * half_way
    if half_way and not may:
        length = 1e-3 * np.arange(24)
    deviation = np.outer(length, [0.5, 0.01, -0.02]) + np.outer(jump, [7.0, 0.6, 0.8])
    further = np.zeros(24, dtype=bool)
    further[added] = True
    one = looked(length, [0, 5, 10, 11, 18, 23], [], further=further, may=np.full(24, may))
    one.noise[:] = 1e-6 * np.arange(24)
    prediction: Any = SimpleNamespace(targets=np.arange(24), position=deviation)
    first, beside, left = _steps(one, prediction)
    assert (first.tolist(), beside.tolist()) == ([10], [added])
    assert 1e6 * left == pytest.approx([max(expected_um - 3 * added, 0.0)])
    # Nothing is known where a point around has none, none is so near that was not added, and none is at the ends of the grid.
    for missing in (8, 9, 10, 11, 12):
        rows = np.delete(np.arange(24), missing)
        some: Any = SimpleNamespace(targets=rows, position=deviation[rows])
        assert len(_steps(one, some)[0]) == (not may and missing == 8)
    one.grid.further[:] = False
    assert len(_steps(one, prediction)[0]) == 0
    one.grid.further[:] = True
    one.at = np.array([0, 1, 2, 3, 20, 21, 22, 23])
    assert _steps(one, prediction)[0].tolist() == [2, 20]


@pytest.mark.parametrize("keep", [False, True])
def test_where_the_tolerance_is_not_kept_the_worst_place_and_the_reason_are_told(keep: bool) -> None:
    """Over 5 um and the 0.2 of its own rounding: by a zone's want of room, where two targets stand as near as they may, and on
    a move that takes none."""
    masks = {"beside_zone": [1, 2, 3], "may": [3, 4], "divisible": [5], "crowded": [6]}
    grid = SimpleNamespace(owner=np.array([0, 1, 1, 2, 3, 3, 4, 5, 6]), **{
        name: np.isin(np.arange(9), which) for name, which in masks.items()})
    path = SimpleNamespace(finding=lambda *told: told)
    one: Any = SimpleNamespace(grid=grid, fine=SimpleNamespace(path=path, settings=SimpleNamespace(
        correction=CorrectionSettings(tolerance=5e-6, min_spacing=Spacing(0.5e-3, 8e-3), keep_targets=keep))))
    points = np.arange(1, 9)
    assert _findings(one, points, np.full(8, 5.19e-6)) == ()
    zone, near, whole = _findings(one, points, 1e-6 * np.array([7, 9, 8, 5.1, 6, 11, 5.21, 12.34]))
    words = "between targets the tool stays up to {} um off the plan in {}, more than the tolerance of 5 um: {}"
    assert zone[:4] == (2, "CS3092", "warning", words.format(
        "9.0", "2 moves", "the zone of a corner leaves no room for a target"))
    assert near[:4] == (6, "CS3091", "note", words.format(
        "11.0", "2 moves", "the force changes within 0.5 mm or 8 ms (--min-spacing), or a correction is held back"))
    assert whole[:4] == (8, "CS3091", "warning", words.format(
        "12.3", "2 moves", "no target is added (--keep-targets)" if keep else "no target can be added to the move"))
    assert ("without --keep-targets" in whole[4]) == keep
    [alone] = _findings(one, points[7:], np.array([5.3e-6]))
    assert alone[:3] == (8, "CS3091", "warning")
    assert "in 1 move, more" in alone[3]

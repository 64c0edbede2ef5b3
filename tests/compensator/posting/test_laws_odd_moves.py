"""Slips in the moves of a toolpath are said, and nothing is said of right ones: rows, contours, holes, spring passes, domes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from compensator.posting.apt import read_apt
from compensator.posting.campath import CamPath
from compensator.posting.odd_moves import said_of_moves
from compensator.posting.post import _odd_spindle
from compensator.posting.settings import PostingSettings
from compensator.toolpath import Move
from identification.model.cell import read_cell
from tests.support import CELL, write_cell

UPWARDS = np.array([0.0, 0.0, 1.0])


def path(points_mm: np.ndarray, rapid: np.ndarray, feed_mm_s: float = 20.0) -> CamPath:
    count = len(points_mm)
    return CamPath("part.csv", "CSV", np.full(count, Move.LINEAR, dtype=np.uint8), np.arange(count, dtype=np.int64) + 2,
                   1e-3 * points_mm, np.tile(UPWARDS, (count, 1)), None, rapid, np.where(rapid, np.nan, 1e-3 * feed_mm_s),
                   np.zeros(count, dtype=bool), None, None, {}, ())


def said(cam_path: CamPath, **chosen: float) -> list[str]:
    up = np.tile(UPWARDS, (len(cam_path), 1))
    return [finding.code for finding in said_of_moves(cam_path, up, PostingSettings(**chosen))]


def with_air(cuts_mm: np.ndarray) -> CamPath:
    """Approach and retract 50 mm above the first and the last cut."""
    above = np.array([0, 0, 50.0])
    points = np.concatenate([[cuts_mm[0] + above], cuts_mm, [cuts_mm[-1] + above]])
    rapid = np.zeros(len(points), dtype=bool)
    rapid[[0, -1]] = True
    return path(points, rapid)


def rows(rng: np.random.Generator) -> np.ndarray:
    x = np.arange(0, rng.uniform(40, 200), rng.uniform(0.5, 8))
    return np.concatenate([np.column_stack([x[::1 - 2 * (k % 2)], np.full(len(x), 2.0 * k), np.zeros(len(x))])
                           for k in range(int(rng.integers(3, 12)))])


def contour(rng: np.random.Generator) -> np.ndarray:
    angle = np.linspace(0, 2 * np.pi, int(rng.integers(30, 300)))
    ring = np.column_stack([40 * np.cos(angle), 25 * np.sin(angle), np.zeros(len(angle))])
    levels = [ring - [0, 0, depth] for depth in np.arange(1, int(rng.integers(2, 6)))]
    return np.concatenate([*levels, levels[-1]])         # a spring pass at the last level


def dome(rng: np.random.Generator) -> np.ndarray:
    flat = rows(rng)
    return flat - [0, 0, 1] * (np.linalg.norm(flat - flat.mean(axis=0), axis=1) ** 2 / 400)[:, None]


def corners_only(rng: np.random.Generator) -> np.ndarray:
    y = np.arange(0, 80, rng.uniform(2, 8))
    return np.array([(x, v, 0.0) for k, v in enumerate(y) for x in ((0, 100) if k % 2 == 0 else (100, 0))])


RIGHT = (rows, contour, dome, corners_only)


@pytest.mark.parametrize("kind", RIGHT)
def test_nothing_is_said_of_right_programs(kind) -> None:
    for seed in range(30):
        assert said(with_air(kind(np.random.default_rng([401, seed])))) == []


@pytest.mark.parametrize(("lost", "line"), [(slice(1, None), 3), (slice(None, -1), 0)])
def test_lost_approach_or_retract_is_said(lost: slice, line: int) -> None:
    whole = with_air(rows(np.random.default_rng(5)))
    part = path(1e3 * whole.position[lost], whole.rapid[lost])
    [found] = said_of_moves(part, np.tile(UPWARDS, (len(part), 1)), PostingSettings())
    assert (found.code, found.line) == ("CS4317", 2 if line else len(part) + 1)


def test_rows_that_were_pasted_twice_are_said() -> None:
    whole = with_air(rows(np.random.default_rng(6)))
    assert said(path(1e3 * np.tile(whole.position, (2, 1)), np.tile(whole.rapid, 2))) == ["CS4318"]


@pytest.mark.parametrize("slip", [np.array([0, 0, -18.0]), np.array([450.0, 0, 0]), np.array([0, 60.0, 0])])
def test_a_mistyped_number_is_said_with_its_line(slip: np.ndarray) -> None:
    x = np.arange(0, 100, 4.0)
    cuts = np.concatenate([np.column_stack([x[::1 - 2 * (k % 2)], np.full(len(x), 5.0 * k), np.zeros(len(x))])
                           for k in range(4)])
    cuts[37] += slip
    whole = with_air(cuts)
    [found] = said_of_moves(whole, np.tile(UPWARDS, (len(whole), 1)), PostingSettings())
    assert (found.code, found.line) == ("CS4319", 37 + 1 + 2)


@pytest.mark.parametrize(("chosen", "expected"), [
    ({"rapid_mm_s": 5.0}, ["CS4323"]), ({"rapid_mm_s": 40.0}, []), ({"zone_mm": 0.5}, []), ({"zone_mm": 5.0}, ["CS4324"]),
    ({"zone_mm": 0.0}, [])])
def test_speeds_and_zones_that_no_milling_has(chosen: dict[str, float], expected: list[str]) -> None:
    assert said(with_air(corners_only(np.random.default_rng(7))), **chosen) == expected


def test_a_slow_rapid_is_said_where_there_is_one_beside_cuts_alone() -> None:
    """Of a path that never leaves the cut, or that has no cut of known feed, nothing can be slower."""
    whole = with_air(rows(np.random.default_rng(9)))
    assert "CS4323" in said(whole, rapid_mm_s=5.0)
    assert "CS4323" not in said(replace(whole, rapid=np.zeros(len(whole), dtype=bool), feed=np.full(len(whole), 0.02)),
                                rapid_mm_s=5.0)
    assert "CS4323" not in said(replace(whole, feed=np.full(len(whole), np.nan)), rapid_mm_s=5.0)


@pytest.mark.parametrize(("text", "rpm"), [
    ("SPINDL/9000,RPM,CLW\nGOTO/0,0,0", 9000.0), ("GOTO/0,0,0", 0.0), ("SPINDL/120,SFM,CLW\nGOTO/0,0,0", 0.0),
    ("SPINDL/RPM,7000\nRAPID\nGOTO/0,0,9\nSPINDL/8000\nGOTO/0,0,0\nSPINDL/100\nGOTO/1,0,0", 8000.0)])
def test_the_speed_of_the_first_cut_is_read(tmp_path, text: str, rpm: float) -> None:
    (tmp_path / "part.apt").write_text(f"UNITS/MM\nFEDRAT/600,MMPM\n{text}\n")
    assert read_apt(tmp_path / "part.apt").spindle_rpm == rpm


def test_another_spindle_speed_than_the_cells_is_said(tmp_path) -> None:
    cell = read_cell(write_cell(tmp_path, CELL + "force_log: {spindle_rpm: 9000}\n"))
    there = with_air(rows(np.random.default_rng(8)))
    told = [[one.code for one in _odd_spindle(replace(there, spindle_rpm=rpm), cell)] for rpm in (0.0, 9000.0, 9500.0, 24000.0)]
    assert told == [[], [], [], ["CS4325"]]

"""Along long moves a log is held against its cut in pieces, each with enough of its samples to say something of its own."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from compensator.correction.places_between import _grid
from compensator.path.robot_path import RobotPath, robot_path
from compensator.rapid import read_rapid
from identification.model.cell import read_cell
from tests.support import CELL, write_cell

# A way [mm] along x: five moves of 40 mm, of which the third is one in the air.
ENDS, FEEDS = (0, 40, 80, 120, 160, 200), (20, 20, 20, 500, 20, 20)


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> RobotPath:
    moves = "\n".join(f"MoveL [[{1000 + x},0,700],[0,0,1,0],[-1,-1,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],[{v},500,5000,1000],fine,"
                      "tSpindle;" for x, v in zip(ENDS, FEEDS, strict=True))
    cell = read_cell(write_cell(tmp_path_factory.mktemp("cell"), CELL))
    return robot_path(read_rapid(f"MODULE M\nPROC main()\n{moves}\nENDPROC\nENDMODULE\n".encode(), "m.mod").toolpath, cell)


def predicted(path: RobotPath, samples: tuple[int, ...], forced: tuple[bool, ...] = (True,) * 6, *, named: bool = False) -> Any:
    """A log by path length with so many samples on each move, evenly, the last of each at its end, and the first of all where
    the path begins; some lie off the path."""
    length = path.length
    place = [np.linspace(*ends, count + 1)[1:] for *ends, count in zip(length[:-1], length[1:], samples, strict=True)]
    place[0] = np.linspace(*length[:2], samples[0])
    log = SimpleNamespace(place=np.concatenate([[np.nan, -3e-3, 0.2005], *place]))
    return SimpleNamespace(path=path, program=SimpleNamespace(text=None), forces=SimpleNamespace(
        log=log, named=named, forced=np.array(forced)), settings=SimpleNamespace(correction=SimpleNamespace(tolerance=1e-5)))


def pieces(found: Any) -> list[int]:
    """Of each move."""
    grid = _grid(found)
    return [1] * 5 if grid is None else (1 + np.bincount(grid.owner[grid.further], minlength=6)[1:]).tolist()


def test_a_piece_has_eight_samples_and_two_millimetres_at_least(path: RobotPath) -> None:
    """A move with fewer than two such pieces stays whole, and one in the air; many samples make no shorter pieces."""
    assert pieces(predicted(path, (16, 15, 400, 100, 16))) == [2, 1, 1, 12, 2]
    assert pieces(predicted(path, (15, 400, 16, 15, 15))) == [1, 20, 1, 1, 1]


def test_only_moves_from_or_to_a_target_with_force_are_cut_up(path: RobotPath) -> None:
    forced = (False, True, False, False, False, True)
    assert pieces(predicted(path, (80, 80, 80, 80, 80), forced)) == [10, 10, 1, 1, 10]


def test_a_log_that_tells_nothing_between_targets_is_held_at_them(path: RobotPath) -> None:
    """One that names targets, and that of a program whose branches are not known."""
    many = (80, 80, 80, 80, 80)
    branches: Any = replace(path, toolpath=replace(path.toolpath, ways=(object(),)))
    assert pieces(predicted(path, many)) == [10, 10, 1, 10, 10]
    assert _grid(predicted(path, many, named=True)) is None
    assert _grid(predicted(branches, many)) is None
    assert _grid(predicted(path, (15, 15, 400, 15, 15))) is None

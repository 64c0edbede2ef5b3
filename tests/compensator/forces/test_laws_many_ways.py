"""Of the many ways that loops of unknown turns leave open a quick look at a log by time alone leaves few, the driven one among
them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from compensator.forces.driven_moves import MOST_BY_TIME, _promising
from compensator.forces.log import read_force_log
from compensator.path.robot_path import robot_path
from compensator.posting.read_toolpath import read_toolpath
from identification.model.cell import read_cell
from tests.runs.command_line import user_files as kit
from tests.runs.command_line.test_placement import Path3

UP, FEED, AIR = 20.0, 50.0, 100.0
# Cuts of each stretch of the program; the second and the fourth stand in loops.
CUTS = (3, 2, 3, 2, 3)
LOOPS = (1, 3)


@pytest.fixture(scope="module")
def program() -> tuple[str, np.ndarray, list[range]]:
    """Its text, its targets [mm], and those of each stretch."""
    rng = np.random.default_rng(1)
    points, stretches = [], []
    for count in CUTS:
        first = len(points)
        for _ in range(count):
            length, y = rng.uniform(30, 90), 5.0 * len(points) / 4
            points += [[0, y, UP], [0, y, 0], [length, y, 0], [length, y, UP]]
        stretches.append(range(first, len(points)))
    path = Path3(np.array(points, dtype=float))
    body = []
    for number, stretch in enumerate(stretches):
        moves = "\n".join(kit.move(path.text[k]).replace("v50", "v50" if points[k][2] == 0 else "v100") for k in stretch)
        body.append(f"FOR i FROM 1 TO GInput(gi{number}) DO\n{moves}\nENDFOR" if number in LOOPS else moves)
    head = kit.module([]).split("PROC")[0].rstrip()
    return head + "\nPROC main()\n" + "\n".join(body) + "\nENDPROC\nENDMODULE\n", np.array(points, dtype=float), stretches


@pytest.mark.parametrize("turns", [(1, 2), *(pytest.param(turns, marks=pytest.mark.long) for turns in ((0, 1), (2, 2)))])
def test_a_quick_look_leaves_few_ways_and_the_driven_one(
    program: tuple[str, np.ndarray, list[range]], tmp_path: Path, turns: tuple[int, int]
) -> None:
    text, points, stretches = program
    driven = [k for number, stretch in enumerate(stretches)
              for k in list(stretch) * (turns[LOOPS.index(number)] if number in LOOPS else 1)]
    place = points[driven]
    length = np.linalg.norm(np.diff(place, axis=0), axis=1)
    time = np.concatenate([[0], np.cumsum(length / np.where(place[1:, 2] == 0, FEED, AIR))])
    clock = np.arange(-1.5, time[-1] + 1.5, 0.02)
    move = np.clip(np.searchsorted(time, clock, side="right") - 1, 0, len(length) - 1)
    cuts = ((place[:-1, 2] == 0) & (place[1:, 2] == 0))[move] & (clock >= 0) & (clock < time[-1])
    force = np.where(cuts[:, None], [-60.0, 120, 40], 0) + np.random.default_rng(2).normal(0, 5, (len(clock), 3))
    (tmp_path / "cell.yaml").write_text(kit.cell_text())
    (tmp_path / "part.mod").write_text(text)
    # Driven a tenth slower than programmed.
    (tmp_path / "log.csv").write_text("time_s,fx_n,fy_n,fz_n\n" + "".join(
        f"{7 + at / 0.9:.3f},{x:.3f},{y:.3f},{z:.3f}\n" for at, (x, y, z) in zip(clock, force, strict=True)))
    cell = read_cell(tmp_path / "cell.yaml")
    path = robot_path(read_toolpath(tmp_path / "part.mod", cell).toolpath, cell)
    ways = [way for way in path.toolpath.ways if all(turn is None or turn <= 2 for turn in way.turns)]
    assert len(ways) == 9 > MOST_BY_TIME
    kept = _promising(read_force_log(tmp_path / "log.csv", cell.force_log.form), path, ways)
    assert any(np.array_equal(way.order, driven) for way in kept)
    assert len(kept) <= 5

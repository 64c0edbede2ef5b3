"""What a log's target numbers name, told by how many samples each has: the counts are made here by driving the path in time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from compensator.correction.files import Inputs, predict_files
from tests.runs.command_line.test_placement import Path3
from tests.runs.command_line.user_files import Job, cell_text, module, move
from tests.support import long

NEAREST, AHEAD = "nearest", "ahead"


def job(folder: Path, seed: int, counts: str, stated: str) -> list[str]:
    """The findings CS3132 of a log at 100 Hz of a program of straight moves and two arcs at 50 mm/s, slower at its corners,
    whose numbers are those of `counts`."""
    rng = np.random.default_rng((3132, seed))
    kinds = "LLCLLLCLLL"
    way = [0.0]
    bulge = [0.0]
    for kind in kinds[1:]:
        one = rng.uniform(6, 45)
        # A flat arc: its circle point stands a twentieth of its chord beside that, and is some 1 % longer on the way.
        way += [0.6 * one, 0.4 * one] if kind == "C" else [one]
        bulge += [0.05 * one, 0.0] if kind == "C" else [0.0]
    length = np.cumsum(way)
    path = Path3(np.column_stack([length, bulge, 0 * length]))
    text = iter(path.text)
    lines = [f"    MoveC {next(text)},{next(text)},v50,z1,tMill\\WObj:=wPart;" if kind == "C" else move(next(text))
             for kind in kinds]
    ends = np.flatnonzero(np.array(bulge) > 0) + 1
    fine = np.arange(0.0, length[-1], 0.02)
    away = np.abs(fine[:, None] - length).min(axis=1)
    speed = 50 * np.minimum(1.0, 0.6 + away / 5)
    time = np.concatenate([[0.0], np.cumsum(np.diff(fine) / speed[:-1])])
    at = np.interp(np.arange(0.0, time[-1], 0.01), time, fine)
    ahead = np.minimum(np.searchsorted(length, at), len(length) - 1)
    instruction = np.arange(len(length)) - np.searchsorted(ends, np.arange(len(length)), side="right")
    number = {NEAREST: np.abs(at[:, None] - length).argmin(axis=1), AHEAD: ahead, "from 1": ahead + 1,
              "instructions": instruction[ahead]}[counts]
    number = number[number < len(length)]
    text = "target,fx_n,fy_n,fz_n\n" + "".join(f"{one},20,-10,5\n" for one in number)
    cell = cell_text() + f"force_log: {{frame: base, target: {stated}}}\n"
    Job(folder, cell=cell, program=module(lines), forces=text).write()
    planned = predict_files(Inputs(folder / "cell.yaml", folder / "part.mod", folder / "stiffness.json", folder / "forces.csv"))
    return [finding.message for finding in planned.findings if finding.code == "CS3132"]


@pytest.mark.parametrize("seed", [0, 1, *map(long, range(2, 20))])
@pytest.mark.parametrize(("counts", "stated", "fits"), [
    (NEAREST, NEAREST, ""), (AHEAD, AHEAD, ""), (NEAREST, AHEAD, "the target nearest to the tool"),
    (AHEAD, NEAREST, "the target that the tool moves to"), ("from 1", AHEAD, "counted from 1"),
    ("from 1", NEAREST, "counted from 1"), ("instructions", AHEAD, "a MoveC counted as one"),
    ("instructions", NEAREST, "a MoveC counted as one")])
def test_the_counts_tell_what_the_numbers_name(tmp_path: Path, seed: int, counts: str, stated: str, fits: str) -> None:
    """The right reading is left in peace, though the robot is slower in its corners; each other one is named."""
    said = job(tmp_path, seed, counts, stated)
    assert len(said) == bool(fits)
    assert not fits or fits in said[0].partition(" fits ")[2]

"""Logs by time alone of a program with a branch: placed on what was driven, or refused, never silently on the other."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from benchmarks.time_placement import clock
from benchmarks.time_placement import sample as sample_once
from compensator.correction.correct import Corrected
from compensator.correction.files import Inputs, predict_files
from compensator.correction.settings import Settings

sample_log = cache(sample_once)
FIRST, LAST = "! top, y = 67.5 mm", "! top, y = 87.5 mm"
BRANCHES = {"all": ("IF DInput(diAll)=1 THEN", "ENDIF"), "loop": ("FOR i FROM 1 TO GInput(giTimes) DO", "ENDFOR")}


def branched(text: str, head: str, end: str) -> tuple[str, range]:
    """The sample with some of its passes in a branch, and their targets."""
    lines = text.splitlines()
    low, high = (next(k for k, line in enumerate(lines) if word in line) for word in (FIRST, LAST))
    moves = [k for k, line in enumerate(lines) if line.strip().startswith("Move")]
    targets = range(sum(k < low for k in moves), sum(k < high for k in moves))
    lines = [*lines[:low], head, *lines[low:high], end, *lines[high:]]
    return "\n".join(lines) + "\n", targets


# Long: branches and loops that were not driven are told by place in tests/runs/command_line/test_branches.py.
@pytest.mark.parametrize(("name", "driven"), [
    ("all", True), *(pytest.param(name, False, marks=pytest.mark.long) for name in BRANCHES)])
def test_the_forces_of_a_log_by_time_go_to_what_was_driven(
    sample_inputs: Inputs, sample: Corrected, tmp_path: Path, name: str, driven: bool
) -> None:
    plan, force, place = sample_log()
    text, targets = branched(sample_inputs.toolpath.read_text(), *BRANCHES[name])
    length, time = plan.length, clock(plan, place, 0.9, 5.0, 0.3)
    keep = np.ones(len(place), dtype=bool)
    if not driven:
        keep = (place < length[targets[0] - 1]) | (place > length[targets[-1]])
        behind = np.flatnonzero(place > length[targets[-1]])
        time = time.copy()
        start = plan.world_position[targets[0] - 1]
        way = float(np.linalg.norm(plan.world_position[targets[-1] + 1] - start)) / (0.9 * 0.25)
        time[behind] += time[np.flatnonzero(place < length[targets[0] - 1])[-1]] + way - time[behind[0]]
    program, log = tmp_path / "branch.mod", tmp_path / "time.parquet"
    program.write_text(text)
    pq.write_table(pa.table({"time_s": time[keep]} | {f"f{axis}_n": force[keep, k] for k, axis in enumerate("xyz")}), log)
    predicted = predict_files(Inputs(sample_inputs.cell, program, sample_inputs.stiffness, log), Settings.of(tare=((0, 2),)))
    assert "CS3064" in {finding.code for finding in predicted.findings}
    assert bool(set(targets) & set(predicted.prediction.targets.tolist())) == driven
    both, here, there = np.intersect1d(predicted.prediction.targets, sample.planned.prediction.targets, return_indices=True)
    assert len(both) > (2500 if driven else 1800)
    difference = predicted.prediction.position[here] - sample.planned.prediction.position[there]
    assert np.median(np.linalg.norm(difference, axis=1)) < 10e-6
    assert np.mean(np.abs(difference) <= 1.96 * predicted.prediction.std[here]) > 0.9

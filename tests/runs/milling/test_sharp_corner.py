"""A sharp corner chip by chip: the second pass of a soft arm must not spring into the wall behind it. And where the log tells
how deep the cut is, a tool that stood aside by less is not held there."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.part_jobs import JOBS
from benchmarks.sharp_corner import compliance, corrected, log_of, way
from compensator.correction.least_depth import least_depth
from tests.runs.milling.milling_job import Correction, MillingJob, rms, settings
from tests.virtual_cell.corner_cut import mill_corner
from tests.virtual_cell.milled_part import PLACES

SOFT_ARM, JOB = 400, "0.5 mm, thin"
# Beyond the wall [um]: 186 where nothing is held.
TOO_DEEP = 50.0


def test_a_soft_arm_in_a_thin_cut_does_not_spring_into_the_wall_behind(tmp_path: Path) -> None:
    wanted = replace(JOBS[JOB], cutter=replace(JOBS[JOB].cutter, runout_mm=(0.0, 0.0, 0.0)))
    job = MillingJob(tmp_path, SOFT_ARM, design="poses20", part=wanted.part, cutter=wanted.cutter)
    soft = compliance(job)
    first = mill_corner(way(job.program.read_text()), job.part, job.cutter, soft)
    found = corrected(job, log_of(job, first), depth_of_cut=1e-3 * wanted.depth_mm)
    walls = mill_corner(way(found.job.content.decode()), job.part, job.cutter, soft).walls_um
    assert walls.max() < TOO_DEEP
    assert rms(walls) < 0.42 * rms(first.walls_um), "and more is gone than the 52.5 % without"
    assert "CS4116" in [finding.code for finding in found.job.findings]


def gone_there(job: MillingJob, found: Correction) -> float:
    """Share of the RMS off plan that is gone at the sharp corner."""
    first, after = job.first_with(found.part), job.mill(found.commands, part=found.part)
    there = (first.cutting | after.cutting) & (first.steps.place == PLACES.index("sharp corner"))
    return 1 - rms(after.off_um[there]) / rms(first.off_um[there])


# Long: how deep a corner is by the log is asked in test_milling_loop.py; the corner that was not met stays above.
@pytest.mark.long
def test_a_log_that_has_met_the_corner_is_believed(tmp_path: Path) -> None:
    """A cut of 1.5 mm, of which the tool stood aside by 0.16 mm at the corner, and by 0.04 in the second pass: the material
    tells about how deep it is, and so do two passes."""
    wanted = JOBS["0.5 mm"]
    job = MillingJob(tmp_path, 71314, design="poses20", part=wanted.part)
    stiffness = job.identify()
    log = job.log(job.first, job.planned, "pass1.csv")
    second = job.correct(log, stiffness)
    pass2 = job.log(job.mill(second.commands, part=second.part), second.commands, "pass2.csv", part=second.part)
    third = job.correct(pass2, stiffness, settings(logged_with=job.offsets(second, "offsets1.csv"), first_forces=log))
    for found in (job.correct(log, stiffness, cell=job.cell_with("cut.yaml", wanted.cut_yaml)), third):
        assert "CS4116" not in [finding.code for finding in found.job.findings]
        assert gone_there(job, found) > 0.85, "72 and 73 % where offsets are held"
        # A straight wall; where the tool of the log stood on the plan the depth is that of its push alone.
        predicted = found.job.predicted
        wall = np.flatnonzero(found.part.place[predicted.targets] == PLACES.index("straight wall"))[5:-5]
        told = least_depth(predicted, found.job.logged, np.zeros((len(predicted.targets), 3)))[wall]
        assert 0.4 < 1e3 * np.nanmedian(told) / wanted.depth_mm < 1.0

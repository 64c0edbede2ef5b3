"""A sharp corner chip by chip: the second pass of a soft arm must not spring into the wall behind it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from benchmarks.part_jobs import JOBS
from benchmarks.sharp_corner import compliance, corrected, log_of, way
from tests.runs.milling.milling_job import MillingJob, rms
from tests.virtual_cell.corner_cut import mill_corner

SOFT_ARM, JOB = 400, "0.5 mm, thin"
# Beyond the wall [um]: 186 where nothing is held.
TOO_DEEP = 50.0


def test_a_soft_arm_in_a_thin_cut_does_not_spring_into_the_wall_behind(tmp_path: Path) -> None:
    wanted = replace(JOBS[JOB], cutter=replace(JOBS[JOB].cutter, runout_mm=(0.0, 0.0, 0.0)))
    job = MillingJob(tmp_path, SOFT_ARM, part=wanted.part, cutter=wanted.cutter)
    soft = compliance(job)
    first = mill_corner(way(job.program.read_text()), job.part, job.cutter, soft)
    found = corrected(job, log_of(job, first), depth_of_cut=1e-3 * wanted.depth_mm)
    walls = mill_corner(way(found.job.content.decode()), job.part, job.cutter, soft).walls_um
    assert walls.max() < TOO_DEEP
    assert rms(walls) < 0.42 * rms(first.walls_um), "and more is gone than the 52.5 % without"
    assert "CS4116" in [finding.code for finding in found.job.findings]

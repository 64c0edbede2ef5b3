"""A logger that stands still in the middle of a pass: what it repeats corrects nothing, and all that is written says so."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from compensator.correction.files import Inputs
from tests.runs.command_line import user_files as kit
from tests.runs.command_line.test_placement import Path3

FIRST, LAST = 120_000, 150_000


def test_a_stretch_that_stood_still_is_left_and_said(tmp_path: Path, sample_inputs: Inputs) -> None:
    log = pq.read_table(sample_inputs.forces)
    stood = {name: log[name].to_numpy(zero_copy_only=False).copy() for name in log.column_names}
    for name in ("fx_n", "fy_n", "fz_n"):
        stood[name][FIRST:LAST] = stood[name][FIRST]
    pq.write_table(pa.table(stood), tmp_path / "stood.parquet")
    written: dict[str, list[dict[str, str]]] = {}
    for name, forces in (("right", sample_inputs.forces), ("stood", tmp_path / "stood.parquet")):
        out = {suffix: tmp_path / f"{name}.{suffix}" for suffix in ("mod", "csv", "html")}
        run = kit.run("correct", sample_inputs.cell, sample_inputs.toolpath, "--stiffness", sample_inputs.stiffness, "--forces",
                      forces, "--tare", "0:2", "-o", out["mod"], "--offsets", out["csv"], "--report", out["html"])
        assert run.code == 0, run
        assert ("CS3070" in run.err) is (name == "stood")
        with open(tmp_path / f"{name}.csv", newline="") as file:
            written[name] = list(csv.DictReader(file))
    left = [k for k, row in enumerate(written["stood"]) if row["note"] == "the log stood still"]
    # The tool was in the cut there, and 20 s of the log at 36 to 45 mm/s are some hundreds of targets.
    assert 200 < len(left) < 500
    assert sum(abs(float(written["right"][k]["oy_mm"])) > 0.05 for k in left) > 100
    for k in left:
        row = written["stood"][k]
        assert float(row["ox_mm"]) == float(row["oy_mm"]) == float(row["oz_mm"]) == 0
        assert row["dx_um"] == row["sx_um"] == row["left_um"] == ""
    others = np.setdiff1d(np.arange(len(written["right"])), np.arange(left[0] - 2, left[-1] + 3))
    moved = [abs(float(written["stood"][k][axis]) - float(written["right"][k][axis])) for k in others
             for axis in ("ox_mm", "oz_mm")]
    assert max(moved) < 1e-3, "what is far from the stretch is corrected as before"
    page = (tmp_path / "stood.html").read_text()
    assert "CORRECTED, BUT NOT ALL OF THE CUT" in page
    assert f"{len(left)} targets are not among them: the log stood still there" in page
    assert "NOT ALL OF THE CUT" not in (tmp_path / "right.html").read_text()


def test_a_target_of_the_cut_without_a_sample_states_no_deviation(tmp_path: Path) -> None:
    """A log with a hole: that targets have no sample does not make their deviation zero."""
    path = Path3(np.column_stack([2.0 * np.arange(20), np.zeros(20), np.zeros(20)]))
    numbers = np.repeat(np.delete(np.arange(20), [3, 11, 12, 13, 14]), 3)
    rows = "".join(f"{k},{f[0]},{f[1]},{f[2]}\n" for k in numbers for f in [(30, 120, -50) if k > 5 else (0, 0, 0)])
    job = kit.Job(tmp_path, program=path.program(), forces="target,fx_n,fy_n,fz_n\n" + rows)
    assert "CS3012" in kit.codes(job.correct("--json"))
    left = {row["target"]: (row["dx_um"], row["sx_um"], row["left_um"]) for row in job.offsets() if row["note"] == "no sample"}
    assert left.keys() == {"3", "11", "12", "13", "14"}
    assert left["11"] == ("", "", "")
    assert float(left["3"][0]) == 0, "in the air there is none"

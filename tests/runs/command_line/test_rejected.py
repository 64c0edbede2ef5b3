"""A stiffness file whose own measurements reject it: identify says so, predict and correct refuse it unless they are told."""

from __future__ import annotations

import csv
import json
import re
from pathlib import Path

from tests.desk_world import desk
from tests.support import compstiff
from tests.virtual_cell.cell import Hidden, simulate

SAMPLES = Path(__file__).parents[3] / "samples"


def turned(folder: Path, degrees: float = 8) -> Path:
    """The sample's measurements with another zero of joint 2."""
    rows = [line for line in csv.reader((SAMPLES / "measurements.csv").read_text().splitlines()) if not line[0].startswith("#")]
    place = rows[0].index("q2_deg")
    for row in rows[1:]:
        row[place] = str(float(row[place]) + degrees)
    file = folder / "turned.csv"
    file.write_text("\n".join(",".join(row) for row in rows) + "\n")
    return file


def test_a_rejected_file_is_refused_unless_told(tmp_path: Path) -> None:
    cell, stiffness = SAMPLES / "cell.yaml", tmp_path / "stiffness.json"
    identified = compstiff("identify", cell, turned(tmp_path), "-o", stiffness)
    assert identified.returncode == 0, identified.stderr
    assert "CS1021" in identified.stderr
    assert "next: compstiff diagnose" in identified.stderr
    content = json.loads(stiffness.read_text())
    assert content["fit"]["model_check"]["rejected"] is True
    assert all(parameter["grade"] != "reliable" for parameter in content["parameters"])

    job = (cell, SAMPLES / "insert.mod", "--stiffness", stiffness, "--tare", "0:2",
           "--forces", SAMPLES / "insert.forces.parquet")
    refused = compstiff("predict", *job, "-o", tmp_path / "deviation.csv")
    assert refused.returncode == 3
    assert "CS1022" in refused.stderr
    assert "compstiff diagnose" in refused.stderr
    assert not (tmp_path / "deviation.csv").exists()

    told = compstiff("correct", *job, "-o", tmp_path / "part.mod", "--accept-rejected")
    assert told.returncode == 0, told.stderr
    record = json.loads((tmp_path / "part.mod.json").read_text())
    assert record["settings"]["accept_rejected"] is True
    assert any(finding["code"] == "CS1023" for finding in record["findings"])


def test_what_is_open_is_said_and_does_not_stop_a_correction(tmp_path: Path) -> None:
    """The tilt of one wrist bearing or of its neighbour (docs/effects.md): the likeliest goes on, and every file says so."""
    cell, rows = simulate(1, "ladder6", (Hidden("bearing_tilt", 4, 2.0),), validation=6).write(tmp_path)
    extended = tmp_path / "extended.json"
    done = compstiff("diagnose", cell, rows, "-o", tmp_path / "d.json", "--extended", extended, "--report", tmp_path / "d.html",
                     "--replicates", "39")
    assert done.returncode == 0, done.stderr
    assert "ambiguous: these data cannot tell apart" in done.stdout
    assert "carries the likeliest of these causes, bearing tilt of joint" in done.stderr
    assert "correct refuses" not in done.stderr
    content = json.loads(extended.read_text())
    assert content["fit"]["model_check"]["rejected"] is False
    assert all(parameter["grade"] != "reliable" for parameter in content["parameters"][:6])
    # First or second, by what the choice matters.
    assert re.search("(Or c|C)orrect now with extended.json", (tmp_path / "d.html").read_text())

    # The sample's file as such a diagnosis would have written it.
    stiffness = tmp_path / "stiffness.json"
    assert compstiff("identify", SAMPLES / "cell.yaml", SAMPLES / "measurements.csv", "-o", stiffness).returncode == 0
    told = json.loads(stiffness.read_text())
    told["fit"] |= {"diagnosis": "ambiguous", "model_check": content["fit"]["model_check"]}
    stiffness.write_text(json.dumps(told))
    corrected = compstiff("correct", SAMPLES / "cell.yaml", SAMPLES / "insert.mod", "--stiffness", stiffness, "--tare", "0:2",
                          "--forces", SAMPLES / "insert.forces.parquet", "-o", tmp_path / "part.mod")
    assert corrected.returncode == 0, corrected.stderr
    assert "CS1027" in corrected.stderr
    assert re.search("bearing tilt of joint [45] or bearing tilt of joint [45]", corrected.stderr)


def test_a_small_mistake_that_passes_for_set_ups_is_said(tmp_path: Path) -> None:
    """Four degrees: the noise takes it for forces that were set up anew at each visit, and nothing is left to see."""
    identified = compstiff("identify", SAMPLES / "cell.yaml", turned(tmp_path, 4), "-o", tmp_path / "stiffness.json")
    assert identified.returncode == 0, identified.stderr
    assert "CS1041" in identified.stderr
    assert "the zero of joint 2 seems to be off" in identified.stderr
    assert json.loads((tmp_path / "stiffness.json").read_text())["fit"]["model_check"]["rejected"] is True


def test_an_unknown_cause_is_not_followed_by_a_correction(tmp_path: Path) -> None:
    """The file that diagnose writes all the same is one that correct refuses: nothing leads there."""
    case = simulate(65, "poses20", (Hidden("hose_pull", None, 2.0),), validation=6)
    cell, rows = case.write(tmp_path)
    done = compstiff("diagnose", cell, rows, "-o", tmp_path / "d.json", "--extended", tmp_path / "s.json", "--replicates", "39")
    assert done.returncode == 0, done.stderr
    assert "unknown: " in done.stdout
    said, following = done.stderr.split("next: ")
    assert "correct refuses it" in said
    assert "compstiff correct" not in following
    assert "compstiff design" in following
    assert "--criterion C" in following
    extended = json.loads((tmp_path / "s.json").read_text())
    assert extended["fit"]["model_check"]["rejected"] is True
    assert extended["effects"] == []
    assert json.loads((tmp_path / "d.json").read_text())["gain"] is None


def test_springs_that_changed_while_they_were_measured_are_no_springs_to_mill_with(tmp_path: Path) -> None:
    cell, rows = desk(1623000, "a robot that softens").write(tmp_path)
    done = compstiff("diagnose", cell, rows, "-o", tmp_path / "d.json", "--extended", tmp_path / "s.json", "--report",
                     tmp_path / "d.html", "--replicates", "39")
    assert done.returncode == 0, done.stderr
    assert "softening" in done.stdout
    said, following = done.stderr.split("next: ")
    assert "correct refuses it" in said
    assert following.startswith("warm the robot up")
    assert "compstiff correct" not in following + (tmp_path / "d.html").read_text().partition("<h2")[0]
    content = json.loads((tmp_path / "s.json").read_text())
    assert content["fit"]["model_check"]["rejected"] is True
    assert all(parameter["grade"] != "reliable" for parameter in content["parameters"])

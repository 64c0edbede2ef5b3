"""One load a pose: an angle of the other sign moves all three readings there, as a bumped sensor does, and yet is no bump."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path

from identification.diagnosis.diagnose import Diagnosis, diagnose
from identification.measurements import read_measurements
from identification.model.cell import read_cell
from tests.second_cell.cell import simulate

Row = dict[str, str]


def diagnosed(folder: Path, seed: int, number: int, spoilt: Callable[[Row], None]) -> Diagnosis:
    """Of twenty-four poses with one load each, one row spoilt."""
    cell_file, table = simulate(seed, "single").write(folder)
    lines = [line for line in table.read_text().splitlines() if not line.startswith("#")]
    rows = list(csv.DictReader(lines))
    spoilt(rows[number - 1])
    with table.open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    cell = read_cell(cell_file)
    return diagnose(cell, read_measurements(table, cell), replicates=39)


def test_an_angle_of_the_other_sign_is_the_poses(tmp_path: Path) -> None:
    found = diagnosed(tmp_path, 730303, 20, lambda row: row.update(q4_deg=f"{-float(row['q4_deg'])}"))
    assert (found.verdict, found.causes) == ("named", ())
    (bad,) = found.judgement.bad_visits
    assert bad.score.name == "V20"
    assert bad.mends[0].what == "axis 4 is -137.158 in the table; 137.158 would fit"


def test_a_bumped_sensor_is_no_slip_of_the_pen(tmp_path: Path) -> None:
    """Of a pose with one reading that may be the sensor or the pose: both are asked for, and none of its numbers is mended."""
    bump = {"dx_um": 97.0, "dy_um": 23.0, "dz_um": 91.0}
    found = diagnosed(tmp_path, 740103, 2, lambda row: row.update({k: f"{float(row[k]) + v}" for k, v in bump.items()}))
    (bad,) = found.judgement.bad_visits
    assert (bad.score.name, bad.score.wrong_angle, bad.mends) == ("V2", None, ())
    (told,) = (finding for finding in found.findings if finding.code == "CS1730")
    assert told.hint is not None
    assert "was the tool or a sensor touched?" in told.hint

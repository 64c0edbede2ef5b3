"""Numbers of cell.yaml that no cell has are said (CS0119), each just beyond what cells have and not just within it."""

from __future__ import annotations

from pathlib import Path

import pytest

from identification.model.cell import read_cell
from identification.model.cell_sizes import odd_sizes
from tests.support import write_cell

PLAIN = "robot: irb6660-205-1.90\ntool: {position_mm: [0, 0, 250]}\n"


@pytest.mark.parametrize(("written", "said"), [
    ("tool: {position_mm: [0, 0, 250], mass_kg: 205}", ""),
    ("tool: {position_mm: [0, 0, 250], mass_kg: 206}", "tool.mass_kg is 206, and irb6660-205-1.90 carries 205 kg"),
    ("tool: {position_mm: [1000, 2000, -2000]}", ""),
    ("tool: {position_mm: [1001, 2000, -2001]}", "the TCP is 3001 mm from the flange"),
    ("measurement: {deflection_std_um: [0.02, 2, 200]}", ""),
    ("measurement: {deflection_std_um: [2, 0.019, 2]}", "measurement.deflection_std_um is 0.019 to 2 um"),
    ("measurement: {deflection_std_um: [2, 2, 201]}", "measurement.deflection_std_um is 2 to 201 um"),
    ("force_log: {frame: base, sign: on_tool, spindle_rpm: 60}", ""),
    ("force_log: {frame: base, sign: on_tool, spindle_rpm: 59}", "force_log.spindle_rpm is 59"),
    ("force_log: {frame: base, sign: on_tool, spindle_rpm: 200000}", ""),
    ("force_log: {frame: base, sign: on_tool, spindle_rpm: 201000}", "force_log.spindle_rpm is 201000"),
    ("force_log: {frame: sensor, sign: on_tool, sensor_quaternion: [1, 0, 0, 0], sensor_position_mm: [0, 0, 0]}", ""),
    ("force_log: {frame: sensor, sign: on_tool, sensor_quaternion: [1, 0, 0, 0], sensor_position_mm: [0, 0, 2]}", ""),
    ("force_log: {frame: sensor, sign: on_tool, sensor_quaternion: [1, 0, 0, 0], sensor_position_mm: [0, 0, -1.9]}",
     "force_log.sensor_position_mm is 1.9 mm from the flange"),
    ("force_log: {frame: base, sign: on_tool, payload: {mass_kg: 205, centre_of_mass_mm: [0, 0, 120]}}", ""),
    ("force_log: {frame: base, sign: on_tool, payload: {mass_kg: 206, centre_of_mass_mm: [0, 0, 120]}}",
     "force_log.payload.mass_kg is 206, and irb6660-205-1.90 carries 205 kg")])
def test_a_number_that_no_cell_has_is_said_with_what_it_is(tmp_path: Path, written: str, said: str) -> None:
    text = written + "\n" + PLAIN if not written.startswith("tool") else PLAIN.splitlines()[0] + "\n" + written + "\n"
    file = write_cell(tmp_path, text)
    assert [(one.code, one.level, one.file, one.message) for one in odd_sizes(read_cell(file))] == [
        ("CS0119", "warning", str(file), said)][: bool(said)]

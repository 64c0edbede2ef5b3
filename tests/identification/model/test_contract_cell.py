"""cell.yaml as the program takes it: every number in SI units, what is stated and what is not, the defaults."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from identification.common.findings import CompstiffError
from identification.model.cell import Cell, read_cell
from identification.model.controller import use_of_stiffnesses
from tests.support import robot, write_cell

TOOL = "tool: {position_mm: [120, -10, 250], quaternion: [0, 1, 0, 0], mass_kg: 80, centre_of_mass_mm: [5, -6, 120]}\n"
WHOLE = "robot: irb6660-205-1.90\nserial_number: '6660-107342'\n" + TOOL + """\
base_frame: {position_mm: [1000, -2000, 300], quaternion: [0.6, 0, 0, 0.8]}
workobject: {position_mm: [1400, 500, 800], quaternion: [0.8, 0, 0, 0.6]}
measurement:
  {deflection_std_um: [2, 3, 4], force_std_n: [0.5, 0.6, 0.7], force_relative_std: 0.005, force_gain_std: 0.01,
   pose_offset_std_um: [5, 6, 7]}
prior: {stiffness_nm_per_rad: [1.0e6, 2.0e6, 3.0e6, 4.0e5, 5.0e5, 6.0e5], relative_std: [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]}
force_log:
  {frame: sensor, sign: by_tool, sensor_quaternion: [0.6, 0.8, 0, 0], sensor_position_mm: [1, 2, 140], weight: removed,
   payload: {mass_kg: 12.4, centre_of_mass_mm: [12, -8, 143]}, bias_n: [14, -31, 55], gain_std: 0.02, position_late_ms: 20}
limits: {max_offset_mm: 3.5, max_tilt_deg: 1.5}
modbus: {host: 10.0.0.5, port: 1502, unit: 7}
design: {joint_window_deg: {q1: [-90, 45], q4: [-150, 150]}, reach_mm: [600, 1700]}
motion: {compliance_std: 0.03}
accuracy: {position_um: 350, length_mm: 500, probed_by_robot: true}
"""
PLAIN = "robot: irb6660-205-1.90\ntool: {position_mm: [120, 0, 250]}\n"


def cell(folder: Path, text: str) -> Cell:
    return read_cell(write_cell(folder, text))


def test_every_number_is_taken_in_si_units(tmp_path: Path) -> None:
    one = cell(tmp_path, WHOLE)
    assert (one.robot.name, one.robot.serial_number, one.source) == ("irb6660-205-1.90", "6660-107342", tmp_path / "cell.yaml")
    assert_allclose(one.flange_from_tcp.position, [0.12, -0.01, 0.25])
    assert_allclose(one.flange_from_tcp.rotation, np.diag([1, -1, -1]), atol=1e-12)
    assert_allclose(one.world_from_base.position, [1, -2, 0.3])
    assert_allclose(one.world_from_base.rotation, [[-0.28, -0.96, 0], [0.96, -0.28, 0], [0, 0, 1]], atol=1e-12)
    assert_allclose(one.world_from_object.position, [1.4, 0.5, 0.8])
    assert_allclose(one.world_from_object.rotation[:, 0], [0.28, 0.96, 0], atol=1e-12)
    assert (one.tool_mass, one.object_stated) == (80.0, True)
    assert_allclose(one.tool_centre, [0.005, -0.006, 0.12])
    noise = one.noise
    assert_allclose(noise.deflection, [2e-6, 3e-6, 4e-6])
    assert_allclose(noise.force, [0.5, 0.6, 0.7])
    assert_allclose(noise.pose_offset, [5e-6, 6e-6, 7e-6])
    assert (noise.force_relative, noise.force_gain) == (0.005, 0.01)
    assert_allclose(one.prior.stiffness, [1e6, 2e6, 3e6, 4e5, 5e5, 6e5])
    assert_allclose(one.prior.log_std, np.sqrt(np.log(1 + np.arange(0.1, 0.65, 0.1) ** 2)))
    log = one.force_log
    assert (log.kind, log.sign, log.mass, log.weight) == ("sensor", -1.0, 12.4, "removed")
    assert log.flange_from_sensor is not None
    assert_allclose(log.flange_from_sensor.position, [0.001, 0.002, 0.14])
    assert_allclose(log.flange_from_sensor.rotation[1], [0, -0.28, -0.96], atol=1e-12)
    assert_allclose(log.centre, [0.012, -0.008, 0.143])
    assert_allclose(log.bias, [14, -31, 55, 0, 0, 0])
    assert one.max_offset == pytest.approx(0.0035)
    assert one.max_tilt == pytest.approx(np.radians(1.5))
    assert (one.modbus.host, one.modbus.port, one.modbus.unit) == ("10.0.0.5", 1502, 7)
    assert_allclose(np.degrees(one.joint_window), [[-90, 45], [-np.inf, np.inf], [-np.inf, np.inf], [-150, 150],
                                                   [-np.inf, np.inf], [-np.inf, np.inf]])
    assert one.reach == pytest.approx((0.6, 1.7))
    assert set(one.frames) == {"tool.", "base_frame.", "workobject.", "force_log.sensor_"}


def test_what_is_left_out_is_the_default(tmp_path: Path) -> None:
    one = cell(tmp_path, PLAIN)
    assert_allclose(one.noise.deflection, 2e-6)
    assert not one.noise.force.any()
    assert not one.noise.pose_offset.any()
    assert (one.noise.force_relative, one.noise.force_gain) == (0.0, 0.0)
    for frame in (one.world_from_base, one.world_from_object):
        assert not frame.position.any()
        assert_allclose(frame.rotation, np.eye(3))
    assert (one.prior.stiffness == one.robot.prior.stiffness).all()
    log = one.force_log
    assert (log.kind, log.sign, log.bias, log.mass, log.centre, log.weight, log.flange_from_sensor) == (
        "base", 1.0, None, None, None, None, None)
    assert (log.form.gain_std, log.form.position_late_ms, log.form.mounting_std_deg, log.form.target) == (
        0.01, 0.0, None, "nearest")
    assert (one.max_offset, one.max_tilt) == (pytest.approx(0.002), pytest.approx(np.radians(0.5)))
    assert (one.modbus.host, one.modbus.port, one.modbus.unit) == ("127.0.0.1", 5020, 1)
    assert (one.motion.compliance_std, one.cutting.wear_std, one.robot.serial_number) == (0.02, 0.25, "")
    assert (one.accuracy, one.units, one.pendant, one.reach, one.tool_mass, one.tool_centre) == 6 * (None,)
    assert not one.object_stated
    assert np.isinf(one.joint_window).all()
    assert set(one.frames) == {"tool.", "base_frame.", "workobject."}
    # What hangs on the sensor is the tool where no payload is stated; a part of a bias is the other's zero.
    hung = cell(tmp_path, "robot: irb6660-205-1.90\n" + TOOL + "force_log: {bias_nm: [1, 2, 3]}\n").force_log
    assert hung.mass == 80.0
    assert_allclose(hung.centre, [0.005, -0.006, 0.12])
    assert_allclose(hung.bias, [0, 0, 0, 1, 2, 3])


@pytest.mark.parametrize(("measurement", "stated"), [
    ({}, ""), ({"deflection_std_um": "[2, 2, 2]"}, "deflection"), ({"pose_offset_std_um": "[0, 0, 0]"}, "offset"),
    ({"force_std_n": "[1, 0, 0]"}, "force"), ({"force_relative_std": "0.01"}, "relative"),
    # Either of them as zero with the other left out is no force error at all.
    ({"force_std_n": "[0, 0, 0]"}, "force relative"), ({"force_relative_std": "0"}, "force relative"),
    ({"force_relative_std": "0.01", "force_std_n": "[0, 0, 0]"}, "force relative")])
def test_a_part_of_the_noise_is_stated_or_unknown(tmp_path: Path, measurement: dict[str, str], stated: str) -> None:
    text = ", ".join(f"{key}: {value}" for key, value in measurement.items())
    noise = cell(tmp_path, f"{PLAIN}measurement: {{{text}}}\n").noise
    flags = {"deflection": noise.deflection_stated, "force": noise.force_stated, "relative": noise.force_relative_stated,
             "offset": noise.offset_stated}
    assert {name for name, flag in flags.items() if flag} == set(stated.split())


@pytest.mark.parametrize(("line", "said"), [
    ("tool: {position_mm: [0, 0, 1.99]}", "tool.position_mm is 1.99 mm long, expected 0 or at least 2 mm"),
    ("tool: {position_mm: [0, 0, 2]}", ""), ("tool: {position_mm: [0, 0, 0]}", ""),
    ("tool: {position_mm: [0, 0, 9], mass_kg: 1, centre_of_mass_mm: [0, 3000, 0]}", ""),
    ("tool: {position_mm: [0, 0, 9], mass_kg: 1, centre_of_mass_mm: [0, 3001, 0]}",
     "tool.centre_of_mass_mm is 3001 mm from the flange, expected 0, or 2 to 3000 mm; micrometres"),
    ("tool: {position_mm: [0, 0, 9], mass_kg: 1, centre_of_mass_mm: [0, 0, 1.9]}",
     "tool.centre_of_mass_mm is 1.9 mm from the flange, expected 0, or 2 to 3000 mm; metres"),
    ("tool: {position_mm: [0, 0, 9], mass_kg: 1, centre_of_mass_mm: [0, 0, 0]}", ""),
    ("tool: {position_mm: [0, 0, 9]}\nforce_log: {payload: {mass_kg: 2, centre_of_mass_mm: [0.1, 0, 0]}}",
     "force_log.payload.centre_of_mass_mm is 0.1 mm from the flange, expected 0, or 2 to 3000 mm; metres"),
    ("tool: {position_mm: [0, 0, 9]}\nforce_log: {frame: sensor, sensor_quaternion: [1, 0, 0, 0]}",
     "force_log.frame is 'sensor', but sensor_quaternion and sensor_position_mm are not both given"),
    ("tool: {position_mm: [0, 0, 9]}\nforce_log: {frame: sensor, sensor_position_mm: [0, 0, 50]}",
     "force_log.frame is 'sensor', but sensor_quaternion and sensor_position_mm are not both given"),
    ("tool: {position_mm: [0, 0, 9]}\ncutting: {std_n_per_mm: 5}",
     "cutting.std_n_per_mm is stated without cutting.stiffness_n_per_mm"),
    ("tool: {position_mm: [0, 0, 9]}\ncutting: {std_n_per_mm: 5, stiffness_n_per_mm: 25}", ""),
    ("tool: {position_mm: [0, 0, 9]}\ncutting: {tool_diameter_mm: 16}",
     "cutting.tool_diameter_mm is stated without cutting.material"),
    ("tool: {position_mm: [0, 0, 9]}\ncutting: {tool_diameter_mm: 16, teeth: 2}", ""),
    ("tool: {position_mm: [0, 0, 9]}\ncutting: {contact_mm: 4, teeth: 2}",
     "cutting.contact_mm is stated without cutting.material"),
    ("tool: {position_mm: [0, 0, 9]}\naccuracy: {position_um: 350}", ""),
    ("tool: {position_mm: [0, 0, 9]}\naccuracy: {position_um: 350, length_mm: 500}",
     "accuracy.length_mm is stated without probed_by_robot: true"),
    ("tool: {position_mm: [0, 0, 9]}\naccuracy: {position_um: 350, probed_by_robot: true}",
     "accuracy.probed_by_robot is stated without length_mm")])
def test_what_cannot_be_meant_is_refused_and_what_is_at_its_limit_is_read(tmp_path: Path, line: str, said: str) -> None:
    text = f"robot: irb6660-205-1.90\n{line}\n"
    if not said:
        assert cell(tmp_path, text).robot.name == "irb6660-205-1.90"
        return
    with pytest.raises(CompstiffError) as refused:
        cell(tmp_path, text)
    (finding,) = refused.value.findings
    message, _, unit = said.partition("; ")
    assert (finding.code, finding.file) == ("CS0102", str(tmp_path / "cell.yaml"))
    assert finding.message.startswith(message)
    assert f"is it in {unit}?" in finding.hint or not unit


def test_a_robot_that_is_not_known_is_told_with_those_that_are_near(tmp_path: Path) -> None:
    def told(name: str) -> Any:
        with pytest.raises(CompstiffError) as refused:
            cell(tmp_path, PLAIN.replace("irb6660-205-1.90", name))
        return refused.value.findings[0]

    near = told("IRB 6660-205")
    assert (near.code, near.file) == ("CS0104", str(tmp_path / "cell.yaml"))
    assert near.hint.startswith("near it: irb6660-205-1.90")
    assert told("my robot").hint.startswith("compstiff robots lists")


@pytest.mark.parametrize(("maker", "more", "report", "wanted"), [
    ("ABB", (), False, "correct cell.yaml PART.mod --stiffness s.json --forces PART.forces.csv -o PART_corrected.mod"),
    ("", ("--predict-force", "c.json"), True,
     "correct cell.yaml PART.mod --stiffness s.json --predict-force c.json -o PART_corrected.mod --report correct.html"),
    ("KUKA", (), False, "predict cell.yaml PART.cls --stiffness s.json --forces PART.forces.csv -o PART.deviation.csv"),
    ("KUKA", ("--predict-force", "c.json"), True,
     "predict cell.yaml PART.cls --stiffness s.json --predict-force c.json -o PART.deviation.csv --report predict.html")])
def test_stiffnesses_correct_a_program_that_the_robot_runs_and_else_predict(
    maker: str, more: tuple[str, ...], report: bool, wanted: str
) -> None:
    arm = replace(robot(), manufacturer=maker)
    assert use_of_stiffnesses(arm, "cell.yaml", "s.json", *more, report=report) == f"compstiff {wanted}"

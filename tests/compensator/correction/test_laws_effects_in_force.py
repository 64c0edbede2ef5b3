"""Correcting with effects in force: the loaded tool stands on the plan, on this model and on the independent plant."""

from __future__ import annotations

import csv
import io
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from compensator.correction import correction, prediction
from compensator.correction.correct import Corrected, correct
from compensator.correction.correction import correct_path
from compensator.correction.files import Inputs, predict_files
from compensator.correction.forward import loaded_blocks, loaded_tool, resting_angles, state_changes
from compensator.correction.offsets import deviation_csv, offsets_csv
from compensator.correction.prediction import predict_path
from compensator.rapid import read_rapid
from identification.common.findings import CompstiffError, Finding, Refused
from identification.model.rotations import Frame, rotation_vector
from tests.compensator.correction.virtual_job import (
    AIR,
    CELL,
    FIRST,
    SECOND,
    Path6,
    corrected,
    driven,
    job,
    plant_of,
    rigid,
    there_and_back,
    unloaded,
)
from tests.support import compstiff
from tests.virtual_cell.cell import Hidden

BACKLASH = Hidden("backlash", 1, parameters={"half_gap_rad": 7.3e-5})
HYSTERESIS = Hidden("hysteresis", 1, parameters={"amplitude_rad": 4.4e-5, "torque_nm": 120.0})
SPINDLE = Hidden("spindle_compliance", parameters={"radial_m_per_n": 6.7e-8})
TILT = Hidden("bearing_tilt", 2, parameters={"compliance_rad_per_nm": 1e-7})
CASES = [BACKLASH, HYSTERESIS, SPINDLE, TILT,
         Hidden("soft_zone", 1, parameters={"extra_rad": 4e-5, "torque_nm": 100.0}),
         Hidden("bearing_tilt", 4, parameters={"compliance_rad_per_nm": 1e-6}),
         Hidden("link_bending", 3, parameters={"flexibility_per_nm2": 7.7e-8}),
         Hidden("base_rocking", parameters={"compliance_rad_per_nm": 5e-8}),
         Hidden("force_sensor_compliance", parameters={"tilt_rad_per_nm": 3e-6}),
         Hidden("wrist_coupling", parameters={"compliance_rad_per_nm": 3e-6}),
         Hidden("parallelogram", parameters={"ratio": 0.0})]


def varied() -> Path6:
    """The path with forces that come and go within each cut, through the torques at which gears slip and cross."""
    path = there_and_back()
    wrench = path.wrench * (0.55 - 0.45 * np.cos(np.linspace(0, 9, len(path.wrench))))[:, None]
    return Path6(path.theta, wrench)


def rms(vectors: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.sum(vectors**2, axis=1))))


def commanded(done: Corrected) -> np.ndarray:
    """Angles (N, 6) [rad] of the corrected program's targets."""
    theta = done.predicted.path.theta.copy()
    theta[done.correction.targets] = done.correction.theta
    return theta


@pytest.mark.parametrize("hidden", CASES, ids=lambda hidden: f"{hidden.effect}{hidden.joint or ''}")
def test_the_loaded_tool_stands_on_the_plan(tmp_path: Path, hidden: Hidden) -> None:
    """By the forward model to 1e-8 m; on the independent plant with that effect, far nearer than with the plain model. The plan
    is where the plant stands unloaded: it sags under its weight, loaded or not."""
    path = varied()
    done, plain = corrected(tmp_path / "extended", path, [hidden]), corrected(tmp_path / "plain", path)
    targets, plan = done.correction.targets, done.predicted.path
    assert len(targets) == 24
    assert done.correction.residual.max() < 1e-8
    assert done.residual.max() < 1e-7                           # with the numbers as written
    plant = plant_of([hidden])
    assert_allclose(rigid(plan.theta[targets]), plan.base_from_tcp.position[targets], atol=1e-9)
    goal = unloaded(plant, plan.theta[targets])
    left, left_plain = (rms(driven(plant, commanded(one), path.wrench)[targets] - goal) for one in (done, plain))
    effect = rms(done.predicted.prediction.position - plain.predicted.prediction.position)
    print(f"{hidden.effect}: effect {1e6 * effect:.1f} um; left {1e6 * left:.3f} um, by the plain model {1e6 * left_plain:.1f}")
    assert left_plain > 1e-6
    # The plant's laws of gears are smooth where the dictionary's have corners.
    # Without its rod the plant sags otherwise, which the model of one with it does not know.
    far = {"backlash": 0.2, "soft_zone": 0.2, "hysteresis": 0.2, "parallelogram": 0.01}
    assert left < far.get(hidden.effect, 0.005) * left_plain
    deviation = driven(plant, plan.theta, path.wrench)[targets] - goal
    # How the effect's own part moves the weight is left out.
    assert rms(done.predicted.prediction.position - deviation) < 1.5 * left + 0.005 * effect


def test_several_effects_at_once(tmp_path: Path) -> None:
    hidden = [BACKLASH, SPINDLE, TILT, Hidden("parallelogram", parameters={"ratio": 0.3})]
    path = there_and_back()
    done = corrected(tmp_path, path, hidden)
    targets = done.correction.targets
    plant = plant_of(hidden)
    assert done.correction.residual.max() < 1e-8
    goal = unloaded(plant, done.predicted.path.theta[targets])
    assert rms(driven(plant, commanded(done), path.wrench)[targets] - goal) < 0.3e-6


def test_the_orientation_comes_back_too(tmp_path: Path) -> None:
    done = corrected(tmp_path, varied(), [TILT])
    plan, targets = done.predicted.path, done.correction.targets
    loaded = loaded_tool(done.predicted.loaded, done.correction.theta)
    assert_allclose(loaded.rotation, plan.base_from_tcp.rotation[targets], atol=1e-10)


def test_steep_effects_converge(tmp_path: Path) -> None:
    """Free play of 10 arcmin with forces that pass through zero torque."""
    path = there_and_back()
    wrench = np.zeros_like(path.wrench)
    wrench[1:-1, 1] = np.linspace(-8, 8, len(wrench) - 2)
    wrench[1:-1, 2] = -700.0
    steep = Hidden("backlash", 1, parameters={"half_gap_rad": 1.4e-3})
    inputs = job(tmp_path, Path6(path.theta, wrench), [steep], CELL + "limits: {max_offset_mm: 20, max_tilt_deg: 5}\n")
    assert correct(predict_files(inputs)).correction.residual.max() < 1e-8


@pytest.mark.parametrize(("times", "refused"), [(2.0, False), (3.0, True)])
def test_effects_too_steep_for_any_correction_are_refused(tmp_path: Path, times: float, refused: bool) -> None:
    """Gears that lose 1 mrad each, twenty times as much as in practice, as soon as they wind up by a microradian, the wrong way
    round: under three times the force no commanded pose is found that brings the tool to the plan, under twice it is."""
    path = there_and_back()
    gears = Hidden("lost_motion", parameters={**{f"amplitude_{k}_rad": -1e-3 for k in range(1, 7)}, "wind_up_rad": 1e-6})
    inputs = job(tmp_path, Path6(path.theta, times * path.wrench), [gears],
                 CELL + "limits: {max_offset_mm: 20, max_tilt_deg: 5}\n")
    planned = predict_files(inputs)
    if not refused:
        assert correct(planned).correction.residual.max() < 1e-8
        return
    with pytest.raises(CompstiffError) as stopped:
        correct(planned)
    found = stopped.value.findings[0]
    assert (found.code, found.level, found.file) == ("CS4108", "error", str(inputs.toolpath))
    assert found.line == planned.path.toolpath.line[found.target]
    said = re.match(r"the correction did not converge: the loaded tool stays (\S+) um and \S+ rad off the plan$", found.message)
    assert said
    assert 0.01 < float(said[1]) < 3000
    assert found.hint == ("check the units of the forces; or what the stiffness file has beyond springs is too steep for a "
                          "correction: lost motion")


def test_no_force_no_correction(tmp_path: Path) -> None:
    predicted = predict_files(job(tmp_path, there_and_back(), [BACKLASH, HYSTERESIS, SPINDLE]))
    still = replace(predicted.forces, forced=np.zeros_like(predicted.forces.forced), wrench=0 * predicted.forces.wrench)
    nowhere = replace(predicted.loaded, forces=still, targets=np.zeros(0, dtype=np.intp))
    with pytest.raises(Refused, match="CS3086"):
        correct(replace(predicted, loaded=nowhere, prediction=predict_path(nowhere)))
    unforced = replace(predicted.forces, wrench=0 * predicted.forces.wrench)
    offset = correct_path(replace(predicted.loaded, forces=unforced)).offset
    assert_allclose(offset, 0, atol=1e-12)


def test_moves_without_force_stay_as_they_are(tmp_path: Path) -> None:
    done = corrected(tmp_path, there_and_back(), [HYSTERESIS])
    before, after = done.predicted.program.toolpath, read_rapid(done.content, "corrected.mod").toolpath
    assert_array_equal(np.setdiff1d(np.arange(len(before)), done.correction.targets), AIR)
    assert_array_equal(after.position[AIR], before.position[AIR])


def test_one_forward_model(tmp_path: Path) -> None:
    """What the program's model predicts along the path is what the identified model says of the same rows in a row."""
    done = corrected(tmp_path, varied(), [BACKLASH, HYSTERESIS])
    predicted, targets = done.predicted, done.correction.targets
    theta, wrench = predicted.path.theta, predicted.forces.wrench
    position, rotation, covariance = predicted.model.predict(theta, wrench, predicted.cell.flange_from_tcp)
    assert_allclose(predicted.prediction.position, position[targets], atol=1e-13)
    for block in loaded_blocks(predicted.loaded, theta[targets], weight=True):
        planned = predicted.path.base_from_tcp.rotation[targets[block.places]]
        turned = rotation_vector(block.tool.rotation @ np.swapaxes(planned, 1, 2))
        assert_allclose(turned, rotation[targets[block.places]], atol=1e-13)
    assert_allclose(predicted.prediction.covariance, covariance[targets, :3, :3], rtol=1e-9, atol=1e-22)


# ---- load history ----------------------------------------------------------------------------------------------------------

def step_of(finding: Finding, words: str) -> float:
    """[um]"""
    told = re.match(rf"{words} with force: deviation and correction step there, by up to (\S+) um$", finding.message)
    assert told, finding
    return float(told[1])


def test_where_the_state_changes_is_said(tmp_path: Path) -> None:
    """The second cut turns the force round: the gap is crossed once, before its first target."""
    done = corrected(tmp_path, there_and_back(), [BACKLASH])
    notes = [row["note"] for row in csv.DictReader(io.StringIO(offsets_csv(done).decode()))]
    assert [i for i, note in enumerate(notes) if note.startswith("backlash")] == [SECOND.start]
    assert notes[SECOND.start] == "backlash of joint 1 crosses its gap before this target"
    assert notes[SECOND.start - 1] == "no force"
    assert notes == [row["note"] for row in csv.DictReader(io.StringIO(deviation_csv(done.predicted).decode()))]
    found = [finding for finding in done.findings if finding.code == "CS4111"]
    assert len(found) == 1
    assert found[0].target == SECOND.start
    # Out of the air, where the gear is in the middle of its gap, the tool swings by half of it about axis 1.
    half = 7.3e-5 * 1e6 * np.hypot(*done.predicted.path.base_from_tcp.position[SECOND.start, :2])
    assert step_of(found[0], "backlash of joint 1 crosses its gap before 1 of 24 targets") == pytest.approx(half, abs=0.06)
    path = there_and_back()
    cuts = Path6(np.delete(path.theta, AIR, axis=0), np.delete(path.wrench, AIR, axis=0))
    both = corrected(tmp_path / "both", cuts, [BACKLASH, HYSTERESIS])
    assert both.predicted.prediction.notes[12] == ("backlash of joint 1 crosses its gap before this target; "
                                                   "hysteresis of joint 1 slips the other way before this target")
    gap, _ = [finding for finding in both.findings if finding.code == "CS4111"]
    assert step_of(gap, "backlash of joint 1 crosses its gap before 1 of 24 targets") == pytest.approx(2 * half, abs=0.12)
    plain = corrected(tmp_path / "plain", there_and_back())
    assert not any(plain.predicted.prediction.notes)


def test_air_moves_are_part_of_the_history(tmp_path: Path) -> None:
    """Friction inside a gear sees the load go to zero between two equal cuts: the second begins elsewhere than without."""
    path = there_and_back()
    cut, through = path.wrench.copy(), path.wrench.copy()
    cut[SECOND] = 0.35 * cut[FIRST]
    through[FIRST.stop:SECOND.stop] = cut[SECOND][0]            # the same cuts without the air moves between them
    moved = [corrected(tmp_path / str(i), Path6(path.theta, wrench), [HYSTERESIS]).predicted.prediction
             for i, wrench in enumerate((cut, through))]
    off = moved[0].position[-12:] - moved[1].position[-12:]
    assert np.linalg.norm(off, axis=1).min() > 5e-6


def two_tools(inputs: Inputs, position: str = "120,0,250") -> None:
    """Gives every second move of the program another tool."""
    lines = inputs.toolpath.read_text().split("\n")
    place = next(i for i, line in enumerate(lines) if "tooldata" in line)
    lines.insert(place, lines[place].replace("tMill", "tOther").replace("120.0000000000,0.0000000000,250.0000000000", position))
    moves = [i for i, line in enumerate(lines) if "Move" in line]
    for i in moves[::2]:
        lines[i] = lines[i].replace("tMill", "tOther")
    inputs.toolpath.write_text("\n".join(lines))


def test_history_passes_from_tool_to_tool(tmp_path: Path) -> None:
    """The program order counts, not the tool: two names of one tool that take turns change nothing."""
    inputs = job(tmp_path, varied(), [BACKLASH, HYSTERESIS, SPINDLE])
    one = correct(predict_files(inputs))
    two_tools(inputs)
    other = correct(predict_files(inputs))
    assert len(np.unique(other.predicted.path.toolpath.tool[other.correction.targets])) == 2
    assert_allclose(other.correction.offset, one.correction.offset, atol=1e-12)
    assert_allclose(other.predicted.prediction.covariance, one.predicted.prediction.covariance, rtol=1e-9)


def test_another_tool_is_refused_where_an_effect_depends_on_it(tmp_path: Path) -> None:
    inputs = job(tmp_path, there_and_back(), [SPINDLE])
    two_tools(inputs, "120,0,251")
    with pytest.raises(CompstiffError, match=r"part\.mod:8:.*CS1202.*spindle_compliance was identified with the cell.*tOther"):
        predict_files(inputs)
    geared = job(tmp_path / "geared", there_and_back(), [BACKLASH])
    two_tools(geared, "120,0,251")
    assert correct(predict_files(geared)).correction.residual.max() < 1e-8


def test_a_target_of_unknown_pose_does_not_break_the_history(tmp_path: Path) -> None:
    inputs = job(tmp_path, varied(), [HYSTERESIS, TILT])
    lines = inputs.toolpath.read_text().split("\n")
    moves = [i for i, line in enumerate(lines) if "Move" in line]
    lines[moves[6]] = "    MoveL pFar,v50,z1,tMill\\WObj:=wPart;"
    inputs.toolpath.write_text("\n".join(lines))
    done = correct(predict_files(inputs))
    assert len(done.correction.targets) == 23
    assert done.correction.residual.max() < 1e-8
    assert np.isfinite(done.predicted.prediction.covariance).all()


def test_creep_counts_the_time_since_each_change_of_the_load(tmp_path: Path) -> None:
    """At the programmed feed, 0.22 m of cut at 50 mm/s: what crept in the first cut is on its way back in the second, whose
    force has the other sign."""
    creep = Hidden("creep", parameters={"ratio": 0.02, "time_s": 3.0, "memory": 1.0})
    there = there_and_back()
    with_creep, plain = (corrected(tmp_path / name, there, hidden) for name, hidden in (("creep", [creep]), ("plain", [])))
    position = plain.predicted.path.base_from_tcp.position
    seconds = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(position, axis=0), axis=1))]) / 0.05
    model, path, wrench = plain.predicted.model, plain.predicted.path, np.nan_to_num(plain.predicted.forces.wrench)
    rows = model.load_state(path.theta, wrench, path.flange_from_tcp)
    twist = model.compliance * rows.torque
    expected = np.zeros((len(twist), 3))
    for n in range(1, len(twist)):
        for k in range(1, n + 1):
            grown = 0.02 * np.log1p((seconds[n] - seconds[k - 1]) / 3.0)
            expected[n] += grown * (rows.jacobian[n, :3] @ (twist[k] - twist[k - 1]))
    targets = plain.correction.targets
    added = with_creep.predicted.prediction.position - plain.predicted.prediction.position
    size = np.linalg.norm(expected[targets], axis=1)
    assert np.linalg.norm(expected[SECOND.start - 1]) > 0.2 * size.max()
    assert_allclose(added, expected[targets], atol=0.02 * size.max())
    assert with_creep.correction.residual.max() < 1e-8


def test_the_command_line(tmp_path: Path) -> None:
    inputs = job(tmp_path, there_and_back(), [BACKLASH])
    done = compstiff("correct", inputs.cell, inputs.toolpath, "--stiffness", inputs.stiffness, "--forces", inputs.forces, "-o",
                     tmp_path / "out.mod", "--report", tmp_path / "out.html")
    assert done.returncode == 0, done.stderr
    assert "note CS4111: backlash of joint 1 crosses its gap before 1 of 24 targets" in done.stderr
    assert "CS4111" in (tmp_path / "out.mod.json").read_text()


# ---- gravity ---------------------------------------------------------------------------------------------------------------

def test_gravity_holds_the_gear_to_one_side(tmp_path: Path) -> None:
    """Gear 2 carries the arm: no side force of a cut takes it across its gap. Without the links' masses it would."""
    gear = Hidden("backlash", 2, parameters={"half_gap_rad": 7.3e-5})
    path = there_and_back()
    held, plain = (predict_files(job(tmp_path / name, path, hidden)) for name, hidden in (("held", [gear]), ("plain", [])))
    assert_allclose(held.prediction.position, plain.prediction.position, atol=1e-12)
    assert not any(finding.code == "CS1404" for finding in held.findings)
    inputs = job(tmp_path / "bare", path, [gear])
    robot = inputs.cell.with_name("robot.yaml")
    robot.write_text(robot.read_text().split("links:")[0])
    bare = predict_files(inputs)
    assert rms(bare.prediction.position - plain.prediction.position) > 2e-5
    note = next(finding for finding in bare.findings if finding.code == "CS1404")
    assert note.message == "the robot file has no links: gravity torques are taken as zero in backlash of joint 2"


@pytest.mark.parametrize(("hidden", "base", "asking"), [
    ((BACKLASH, HYSTERESIS), "", ""), ((replace(TILT, joint=3),), "", ""),
    ((replace(BACKLASH, joint=3),), "", "backlash of joint 3"),
    ((BACKLASH,), "base_frame: {position_mm: [0, 0, 0], quaternion: [0.9999, 0.01414, 0, 0]}\n", "backlash of joint 1"),
    ((replace(BACKLASH, joint=3), SPINDLE, replace(BACKLASH, joint=2)), "", "backlash of joint 3, backlash of joint 2")])
def test_whom_unknown_gravity_concerns_is_told(tmp_path: Path, hidden: tuple[Hidden, ...], base: str, asking: str) -> None:
    """Gears whose law asks for what gravity holds them to; about an upright axis 1 it holds none."""
    inputs = job(tmp_path, there_and_back(), hidden)
    robot = inputs.cell.with_name("robot.yaml")
    robot.write_text(robot.read_text().split("links:")[0])
    inputs.cell.write_text(inputs.cell.read_text() + base)
    found = [finding for finding in predict_files(inputs).findings if finding.code == "CS1404"]
    words = f"the robot file has no links: gravity torques are taken as zero in {asking}"
    assert [(one.level, one.file, one.message) for one in found] == [("note", str(robot), words)] * bool(asking)


# ---- what stays as it was --------------------------------------------------------------------------------------------------

def test_without_effects_none_of_it_runs(sample: Corrected, monkeypatch: pytest.MonkeyPatch) -> None:
    def never(*arguments: object) -> None:
        raise AssertionError("effects evaluated")

    for module, name in ((correction, "resting_angles"), (prediction, "load_state_of"), (prediction, "state_changes")):
        monkeypatch.setattr(module, name, never)
    assert correct(sample.planned).content == sample.content


def test_resting_angles_are_the_plan_where_nothing_is_displaced(tmp_path: Path) -> None:
    absent = Hidden("spindle_compliance", parameters={"radial_m_per_n": 0.0})
    predicted = predict_files(job(tmp_path, there_and_back(), [absent]))
    loaded = predicted.loaded
    weightless = replace(loaded.model, robot=replace(loaded.model.robot, link_mass=None, link_centre=None))
    loaded = replace(loaded, model=weightless)
    assert_allclose(resting_angles(loaded), loaded.theta, atol=1e-12)
    assert state_changes(loaded) == []
    again = loaded_tool(loaded, loaded.theta)
    assert isinstance(again, Frame)

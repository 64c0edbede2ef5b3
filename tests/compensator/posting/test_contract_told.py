"""What is said of a posted program: a reserve that is small, and axes that it holds."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from tests.runs.command_line import user_files as kit
from tests.runs.command_line.user_files import IRB6660, TOOL
from tests.runs.milling.carried_job import SLIDE_ZERO, slide_yaml


def posted(folder: Path, joints: list[list[float]], cell: str = "") -> kit.Run:
    """A table of the poses that the independent arm has at these joint angles [deg], in the robot's base."""
    poses = [kit.tcp_pose(IRB6660, np.radians(angles), TOOL) for angles in joints]
    rows = [[*(1e3 * pose.p), *kit.quaternion(pose.r)] for pose in poses]
    (folder / "part.csv").write_text("x_mm,y_mm,z_mm,q1,q2,q3,q4,feed_mm_s\n" + "".join(
        ",".join(f"{value:.9f}" for value in row) + ",20\n" for row in rows))
    (folder / "cell.yaml").write_text(kit.cell_text(base=kit.IDENTITY, extra=cell))
    return kit.run("post", folder / "cell.yaml", folder / "part.csv", "-o", folder / "out.mod", "--json")


@pytest.mark.parametrize(("last", "words"), [
    ([10, 20, 20, 5, 4.9, 10], "4.9 degrees from the wrist singularity at target 2"), ([10, 20, 20, 5, 5.1, 10], ""),
    ([175.1, 20, 20, 5, 30, 10], "4.9 degrees from a limit of joint 1 at target 2"), ([174.9, 20, 20, 5, 30, 10], "")])
def test_under_five_degrees_to_a_limit_or_the_singularity_are_told(tmp_path: Path, last: list[float], words: str) -> None:
    """Of the path's closest target, with its line in the toolpath. A table states how the tool is turned."""
    joints = np.array(last) + np.outer([2, 1, 0], [-1, 0, 0, 0, 1, 0])
    run = posted(tmp_path, joints.tolist())
    assert run.code == 0, run
    found = [one for one in run.json["findings"] if one["code"] == "CS4305"]
    assert [(one["level"], one["message"], one["file"], one["line"], one["target"], one["hint"]) for one in found] == (
        [("warning", words, str(tmp_path / "part.csv"), 4, 2, "move the part")] if words else [])
    record = json.loads((tmp_path / "out.mod.json").read_text())
    assert record["summary"]["assumed"]["smallest_reserve_deg"] == pytest.approx(4.9 if words else 5.1, abs=1e-3)


@pytest.mark.parametrize(("turn", "said"), [(175.1, True), (174.9, False)])
def test_where_the_toolpath_leaves_the_turn_open_another_one_is_advised(tmp_path: Path, turn: float, said: bool) -> None:
    """Down by 20 mm to the pose that the independent arm has there."""
    pose = kit.tcp_pose(IRB6660, np.radians([turn, 20, 20, 5, 30, 10]), TOOL)
    axis, (x, y, z) = -pose.r.apply([0, 0, 1]), 1e3 * pose.p
    (tmp_path / "part.apt").write_text("UNITS/MM\nMULTAX/ON\nFEDRAT/1200,MMPM\n" + "".join(
        f"GOTO/{','.join(f'{value:.9f}' for value in (x, y, z + up, *axis))}\n" for up in (20.0, 0.0)))
    (tmp_path / "cell.yaml").write_text(kit.cell_text(base=kit.IDENTITY))
    run = kit.run("post", tmp_path / "cell.yaml", tmp_path / "part.apt", "-o", tmp_path / "out.mod", "--json", "--tool-x",
                  ",".join(f"{value:.9f}" for value in pose.r.apply([1, 0, 0])))
    assert run.code == 0, run
    found = [one for one in run.json["findings"] if one["code"] == "CS4305"]
    assert [(one["message"].partition(" at ")[0], one["hint"]) for one in found] == (
        [("4.9 degrees from a limit of joint 1", "try another --tool-x, or move the part")] if said else [])


@pytest.mark.parametrize(("units", "words", "written"), [
    ("", "", "[9E9,9E9,9E9,9E9,9E9,9E9]"),
    ("  - {name: STN1, carries: workobject, axes: [{eax: b}]}\n", "", "[9E9,9E9,9E9,9E9,9E9,9E9]"),
    (slide_yaml(limits=f", parked_mm: {SLIDE_ZERO}"), f"eax_a of TRACK_1 at {SLIDE_ZERO:g} mm",
     f"[{SLIDE_ZERO:.1f},9E9,9E9,9E9,9E9,9E9]"),
    (slide_yaml(limits=f", parked_mm: {SLIDE_ZERO}") +
     "  - {name: STN1, carries: workobject, axes: [{eax: b, kind: rotary, parked_deg: -12.5}, {eax: c}]}\n",
     f"eax_a of TRACK_1 at {SLIDE_ZERO:g} mm, eax_b of STN1 at -12.5 deg", f"[{SLIDE_ZERO:.1f},-12.5,9E9,9E9,9E9,9E9]")])
def test_axes_that_a_posted_program_holds_are_told(tmp_path: Path, units: str, words: str, written: str) -> None:
    """Those that cell.yaml parks, with their values, which all moves write."""
    run = posted(tmp_path, [[10, 20, 20, 5, 30, 10], [10, 20, 21, 5, 30, 10]], f"mechanical_units:\n{units}" if units else "")
    assert run.code == 0, run
    found = [one for one in run.json["findings"] if one["code"] == "CS4511"]
    assert [(one["level"], one["message"]) for one in found] == ([
        ("note", f"the program holds {words}, as parked in cell.yaml; workobject stays where it is stated")] if words else [])
    assert (tmp_path / "out.mod").read_text().count(written) == 2


@pytest.mark.parametrize(("step", "code"), [(85, 0), (95, 3)])
def test_a_joint_that_turns_over_ninety_degrees_from_target_to_target_is_a_jump(tmp_path: Path, step: float, code: int) -> None:
    run = posted(tmp_path, [[-45, 20, 20, 5, 30, 10], [step - 45, 20, 20, 5, 30, 10]])
    assert run.code == code, run
    found = [one for one in run.json["findings"] if one["code"] == "CS4303"]
    assert [(one["line"], one["target"]) for one in found] == ([(3, 1)] if code else [])

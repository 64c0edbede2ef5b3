"""Poses of the pendant prove robot and tool: the truth is an arm that shares no code with the program."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from identification.common.findings import CompstiffError
from identification.model.cell import read_cell
from tests.runs.command_line import user_files as kit
from tests.runs.command_line.user_files import Frame
from tests.virtual_cell.arm import ARMS

ROBOT = "irb6640-235-2.55"
TOOL = Frame.mm([110.0, -20.0, 260.0])
ANGLES = ([10, 20, -5, 40, 50, 60], [-30, 5, 20, -60, 40, -100], [25, -10, 30, 100, -45, 15])


def cell(folder: Path, *, robot: str = ROBOT, tool: Frame = TOOL, extra: str = "") -> Path:
    """A cell of this robot and tool, with poses of a pendant whose controller drives ROBOT with TOOL (0.1 mm digits)."""
    shown = [kit.tcp_pose(ARMS[ROBOT], np.radians(np.array(q, float)), TOOL).p for q in ANGLES]
    lines = [f"  - {{joints_deg: {q}, tcp_mm: {np.round(1e3 * p, 1).tolist()}{extra}}}"
             for q, p in zip(ANGLES, shown, strict=True)]
    file = folder / "cell.yaml"
    file.write_text(kit.cell_text(robot, tool, None, "\n".join(["pendant_poses:", *lines, ""])))
    return file


def test_the_right_robot_agrees_to_the_digits_shown(tmp_path: Path) -> None:
    off = read_cell(cell(tmp_path)).pendant_off
    assert off is not None
    assert off < 1e-4


def test_without_poses_nothing_is_proved(tmp_path: Path) -> None:
    (tmp_path / "cell.yaml").write_text(kit.cell_text(ROBOT, TOOL, None, ""))
    assert read_cell(tmp_path / "cell.yaml").pendant_off is None


@pytest.mark.parametrize("robot", ["irb6640-185-2.80", "irb6700-200-2.60", "irb6700-235-2.65"])
def test_another_robot_of_the_family_is_refused_and_the_right_one_named(tmp_path: Path, robot: str) -> None:
    with pytest.raises(CompstiffError) as refused:
        read_cell(cell(tmp_path, robot=robot))
    finding = refused.value.findings[0]
    assert finding.code == "CS0116"
    assert f"the robot {ROBOT} fits" in finding.hint
    assert "a TCP at" not in finding.hint, "no tool explains three poses of another arm"


def test_another_tool_is_refused_and_the_right_one_said(tmp_path: Path) -> None:
    with pytest.raises(CompstiffError) as refused:
        read_cell(cell(tmp_path, tool=Frame.mm([110.0, -20.0, 240.0])))
    finding = refused.value.findings[0]
    assert finding.code == "CS0116"
    assert "20.0 mm away" in finding.message
    assert "a TCP at [110.0, -20.0, 260.0] mm" in finding.hint


def test_a_tolerance_is_the_user_s(tmp_path: Path) -> None:
    """Absolute Accuracy shows other positions than the nominal arm's."""
    tool = Frame.mm([110.0, -20.0, 255.0])
    with pytest.raises(CompstiffError):
        read_cell(cell(tmp_path, tool=tool))
    assert read_cell(cell(tmp_path, tool=tool, extra=", tolerance_mm: 6")).pendant_off == pytest.approx(0.005, abs=1e-4)

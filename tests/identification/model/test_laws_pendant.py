"""Poses of the pendant prove robot and tool: the truth is an arm that shares no code with the program."""

from __future__ import annotations

import re
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
    proof = read_cell(cell(tmp_path)).pendant
    assert proof is not None
    assert proof.off < 1e-4


def test_without_poses_nothing_is_proved(tmp_path: Path) -> None:
    (tmp_path / "cell.yaml").write_text(kit.cell_text(ROBOT, TOOL, None, ""))
    assert read_cell(tmp_path / "cell.yaml").pendant is None


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
    assert read_cell(cell(tmp_path, tool=tool, extra=", tolerance_mm: 6")).pendant.off == pytest.approx(0.005, abs=1e-4)


@pytest.mark.parametrize(("off_mm", "fits"), [(1.9, True), (2.1, False)])
def test_a_tool_is_told_that_stands_off_by_over_two_millimetres(tmp_path: Path, off_mm: float, fits: bool) -> None:
    """Nothing else tells it: at each pose the TCP is off by as much as the tool is, to the digits of the poses."""
    file = cell(tmp_path, tool=Frame.mm([110.0 + off_mm, -20.0, 260.0]))
    if fits:
        proof = read_cell(file).pendant
        assert proof is not None
        assert proof.off == pytest.approx(1e-3 * off_mm, abs=1e-4)
        return
    with pytest.raises(CompstiffError) as refused:
        read_cell(file)
    (finding,) = refused.value.findings
    assert finding.file == str(file)
    assert finding.message.endswith(f"with this tool is {off_mm} mm away from where the pendant shows it, tolerance 2 mm")


def misread_cell(folder: Path, shifts: tuple[float, ...]) -> Path:
    """Poses whose z was misread by so many mm, with tolerances of 2, 2 and 6."""
    lines = []
    for q, shift, tolerance in zip(ANGLES, shifts, (2, 2, 6), strict=True):
        x, y, z = np.round(1e3 * kit.tcp_pose(ARMS[ROBOT], np.radians(np.array(q, float)), TOOL).p, 1)
        lines.append(f"  - {{joints_deg: {q}, tcp_mm: {[float(x), float(y), float(z + shift)]}, tolerance_mm: {tolerance}}}")
    file = folder / "cell.yaml"
    file.write_text(kit.cell_text(ROBOT, TOOL, None, "\n".join(["pendant_poses:", *lines, ""])))
    return file


def test_the_pose_that_is_furthest_off_for_its_tolerance_is_named_and_none_fits_a_pose_misread(tmp_path: Path) -> None:
    """The second by 3 mm of 2, the third by 8 mm of 6."""
    with pytest.raises(CompstiffError) as refused:
        read_cell(misread_cell(tmp_path, (0.0, 3.0, 8.0)))
    (finding,) = refused.value.findings
    assert finding.message == (f"pendant_poses[1]: at these angles the TCP of {ROBOT} with this tool is 3.0 mm away from where "
                               "the pendant shows it, tolerance 2 mm")
    assert finding.hint == "are these the angles and tcp_mm of one pose, in base coordinates, with this tool active?"
    proof = read_cell(misread_cell(tmp_path, (0.0, 1.5, 5.0))).pendant
    assert proof is not None
    assert proof.off == pytest.approx(5e-3, abs=2e-4)
    assert proof.words().startswith("the pendant's poses agree to 5 mm; ")


def tool_about_z(folder: Path, degrees: tuple[float, ...], extra: str = "") -> Path:
    """A cell whose tool is not turned; the pendant shows it turned about its z axis by so much, at no pose where that is 0."""
    lines = []
    for q, angle in zip(ANGLES, degrees, strict=True):
        pose = kit.tcp_pose(ARMS[ROBOT], np.radians(np.array(q, float)), TOOL)
        half = np.radians(angle) / 2
        about = Frame.mm([0, 0, 0], np.array([np.cos(half), 0, 0, np.sin(half)]))
        turn = kit.quaternion(pose.r * about.r)
        lines.append(f"  - {{joints_deg: {q}, tcp_mm: {np.round(1e3 * pose.p, 1).tolist()}"
                     + (f", quaternion: {turn.tolist()}{extra}" if angle else "") + "}")
    file = folder / "cell.yaml"
    file.write_text(kit.cell_text(ROBOT, TOOL, None, "\n".join(["pendant_poses:", *lines, ""])))
    return file


@pytest.mark.parametrize(("degrees", "extra", "worst"), [
    ((0, 0.49, 0.3), "", None), ((0, 0.3, 0.51), "", 2), ((0, 0.51, 0), "", 1), ((0, 0.9, -3.1), ", tolerance_deg: 3", 2),
    ((0, -2.9, 2.9), ", tolerance_deg: 3", None)])
def test_a_turn_of_the_tool_is_told_beyond_its_tolerance_at_its_pose(
    tmp_path: Path, degrees: tuple[float, ...], extra: str, worst: int | None
) -> None:
    if worst is None:
        proof = read_cell(tool_about_z(tmp_path, degrees, extra)).pendant
        assert proof is not None
        assert np.degrees(proof.turn or 0) == pytest.approx(max(map(abs, degrees)), abs=1e-5)
        assert proof.words() == f"the pendant's poses agree to {1e3 * proof.off:.2g} mm and {max(degrees):.2g} deg"
        return
    with pytest.raises(CompstiffError) as refused:
        read_cell(tool_about_z(tmp_path, degrees, extra))
    (finding,) = refused.value.findings
    assert finding.message == (f"pendant_poses[{worst}]: at these angles the tool of {ROBOT} is turned "
                               f"{abs(degrees[worst]):.1f} deg away from what the pendant shows, tolerance "
                               f"{3 if extra else 0.5:g} deg")


@pytest.mark.parametrize(("apart", "one_fits"), [(0.74, True), (0.76, False)])
def test_a_quaternion_of_the_tool_is_offered_where_it_fits_all_poses(tmp_path: Path, apart: float, one_fits: bool) -> None:
    """The poses' own show tools that are turned against each other; their mean is within the half degree of each of them."""
    file = tool_about_z(tmp_path, (40.0, 40 + apart, 40.0))
    with pytest.raises(CompstiffError) as refused:
        read_cell(file)
    hint = refused.value.findings[0].hint
    asked = "is this the quaternion q1 q2 q3 q4 (q1 = w first) of this pose, in base coordinates, with this tool active?"
    assert (hint == asked) != one_fits
    if one_fits:
        offered = re.fullmatch(r"with this robot tool.quaternion (\[.*\]) \(w first\) fits; (.*)", hint)
        assert offered
        assert offered[2] == asked
        file.write_text(re.sub(r"(?m)^(tool: .*quaternion: )\[[^\]]*\]", rf"\g<1>{offered[1]}", file.read_text()))
        proof = read_cell(file).pendant
        assert proof is not None
        assert np.degrees(proof.turn or 0) == pytest.approx(2 * apart / 3, abs=0.01)


def turned_cell(
    folder: Path, quaternion: np.ndarray, *, written: np.ndarray | None = None, shown_in: list[int] | None = None
) -> Path:
    """A cell whose controller's tool is turned by `quaternion` (w x y z), and is written so or as `written`; the pendant's
    quaternions to five digits, their components in the order `shown_in`."""
    tool = Frame.mm([110.0, -20.0, 260.0], quaternion)
    poses = [kit.tcp_pose(ARMS[ROBOT], np.radians(np.array(q, float)), tool) for q in ANGLES]
    shown = [np.round(kit.quaternion(pose.r), 5)[shown_in or [0, 1, 2, 3]] for pose in poses]
    lines = [f"  - {{joints_deg: {q}, tcp_mm: {np.round(1e3 * pose.p, 1).tolist()}, quaternion: {turn.tolist()}}}"
             for q, pose, turn in zip(ANGLES, poses, shown, strict=True)]
    file = folder / "cell.yaml"
    stated = Frame.mm([110.0, -20.0, 260.0], quaternion if written is None else written)
    file.write_text(kit.cell_text(ROBOT, stated, None, "\n".join(["pendant_poses:", *lines, ""])))
    return file


def unit(rng: np.random.Generator) -> np.ndarray:
    """A turn of a tool as cells have them: upright, a quarter or half turn, or anything."""
    tidy = np.array([[1, 0, 0, 0], [0, 0, 0, 1], [0, 1, 0, 0], [0, 0, 1, 0], [1, 0, 1, 0], [1, 1, 0, 0], [1, 0, 0, 1],
                     [0, 1, 0, 1]])
    chosen = tidy[rng.integers(len(tidy))].astype(float) if rng.random() < 0.5 else rng.standard_normal(4)
    return chosen / np.linalg.norm(chosen)


@pytest.mark.parametrize("seed", range(40))
def test_a_tool_that_is_turned_as_the_pendant_shows_is_proved(tmp_path: Path, seed: int) -> None:
    pendant = read_cell(turned_cell(tmp_path, unit(np.random.default_rng(seed)))).pendant
    assert pendant is not None
    assert pendant.turn is not None
    assert pendant.turn < 1e-4


@pytest.mark.parametrize("seed", range(10))
def test_a_quaternion_in_another_order_is_said_of_the_file_that_has_it(tmp_path: Path, seed: int) -> None:
    """w is put last in the tool, or in the poses; the right quaternion of the tool is in the hint."""
    rng = np.random.default_rng(seed)
    right = rng.standard_normal(4)
    right *= np.sign(right[0]) / np.linalg.norm(right)
    with pytest.raises(CompstiffError) as refused:
        read_cell(turned_cell(tmp_path, right, written=right[[1, 2, 3, 0]]))
    finding = refused.value.findings[0]
    assert finding.code == "CS0116"
    assert "tool.quaternion is in the order x y z w" in finding.hint
    written = finding.hint.split("[")[1].split("]")[0]
    np.testing.assert_allclose(np.array(written.split(","), float), right, atol=2e-6)
    with pytest.raises(CompstiffError) as refused:
        read_cell(turned_cell(tmp_path, right, shown_in=[1, 2, 3, 0]))
    assert "these quaternions are in the order x y z w" in refused.value.findings[0].hint


def test_another_turn_of_the_tool_is_refused_and_the_right_one_said(tmp_path: Path) -> None:
    with pytest.raises(CompstiffError) as refused:
        read_cell(turned_cell(tmp_path, np.array([0.6, 0, 0.8, 0]), written=np.array([1.0, 0, 0, 0])))
    finding = refused.value.findings[0]
    assert "turned 106.3 deg away" in finding.message
    assert "tool.quaternion [0.6, 0, 0.8, 0]" in finding.hint


def test_without_a_quaternion_the_turn_is_unproved(tmp_path: Path) -> None:
    proof = read_cell(cell(tmp_path)).pendant
    assert proof is not None
    assert proof.turn is None
    assert "unproved" in proof.words()

"""A log that misses its path is told as what it would lie on it: each mistake is made in the columns, by numbers of its own."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from compensator.forces.misread_places import _on
from compensator.forces.path_segments import Segments
from tests.runs.command_line import user_files as kit
from tests.runs.command_line.test_placement import ORIGIN, TOOL, Path3
from tests.runs.command_line.user_files import Job

# A path without any symmetry, and the positions [mm] and joint angles [deg] of samples on it.
PATH = Path3(np.array([*([7.0 * k, 0, 0] for k in range(12)), *([77, 6.0 * k, 4] for k in range(1, 15)), [60, 84, 40]]))
ALONG = np.concatenate([np.linspace(a, b, 12) for a, b in zip(PATH.xyz[:-1], PATH.xyz[1:], strict=True)])
PLACES = PATH.at(ALONG)
ANGLES = np.degrees(np.concatenate([np.linspace(a, b, 12) for a, b in zip(PATH.q[:-1], PATH.q[1:], strict=True)]))
OBJECT = kit.work_object()
IN_BASE = 1e3 * OBJECT.p + OBJECT.r.apply(PLACES)
IN_WORLD = 1e3 * kit.BASE.p + kit.BASE.r.apply(IN_BASE)
FLANGE = PLACES + 1e3 * (ORIGIN.r * TOOL.r.inv()).apply(-TOOL.p)


def said(folder: Path, header: str, rows: np.ndarray, program: str = "") -> tuple[str, str]:
    """Message and hint of the one error."""
    log = f"{header},fx_n,fy_n,fz_n\n" + "".join(f"{','.join(f'{x:.6f}' for x in row)},90,-50,160\n" for row in rows)
    result = Job(folder, program=program or PATH.program(), forces=log).correct("--json")
    assert result.code == 1, result
    found = [finding for finding in result.json["findings"] if finding["level"] == "error"]
    assert [finding["code"] for finding in found] == ["CS3005"], found
    return found[0]["message"], found[0]["hint"]


@pytest.mark.parametrize(("rows", "words"), [
    (PLACES / 1e3, "in metres:"), (PLACES / 25.4, "in inches:"), (PLACES * 1e3, "in micrometres:"),
    (PLACES[:, [1, 0, 2]], "with x_mm and y_mm exchanged:"), (PLACES[:, [0, 2, 1]], "with y_mm and z_mm exchanged:"),
    (PLACES[:, [1, 2, 0]], "with x y z in the columns z_mm x_mm y_mm:"),
    (IN_WORLD, "as positions in the world:"),
    (IN_BASE, "as positions in the robot's base:"), (IN_WORLD / 1e3, "as positions in the world, in metres:"),
    (FLANGE, "as positions of the flange:")])
def test_positions(tmp_path: Path, rows: np.ndarray, words: str) -> None:
    """Also where the program begins far away, at joint angles, and calls what no file holds, which is no reason here."""
    away = PATH.program().replace("PROC main()\n", "PROC main()\n  MoveAbsJ [[40,20,-20,10,30,15],[9E9,9E9,9E9,9E9,9E9,9E9]]"
                                  "\\NoEOffs,v100,fine,tMill\\WObj:=wPart;\n  SpindleOn 9000;\n")
    for program in (PATH.program(), away):
        message, hint = said(tmp_path, "x_mm,y_mm,z_mm", rows, program)
        assert hint.startswith(f"they do {words}"), (message, hint)
        assert "SpindleOn" not in hint


@pytest.mark.parametrize(("rows", "words"), [
    (np.radians(ANGLES), "in radians:"), (ANGLES[:, [0, 2, 1, 3, 4, 5]], "with q2_deg and q3_deg exchanged:"),
    (ANGLES[:, [0, 1, 2, 5, 4, 3]], "with q4_deg and q6_deg exchanged:")])
def test_joint_angles(tmp_path: Path, rows: np.ndarray, words: str) -> None:
    _, hint = said(tmp_path, ",".join(f"q{joint}_deg" for joint in range(1, 7)), rows)
    assert f" {words}" in hint
    assert "degrees" in hint


def test_what_no_mistake_explains_is_not_named(tmp_path: Path) -> None:
    """Another part's positions, by place and turn."""
    turned = Rotation.from_euler("zyx", [40, 20, 10], degrees=True).apply(PLACES - PLACES.mean(axis=0))
    message, hint = said(tmp_path, "x_mm,y_mm,z_mm", turned + np.array([300.0, 150, 90]))
    assert "none of the" in message
    assert hint == "is it the log of this program, with TCP positions in its work object?"


def test_the_share_on_the_path_is_that_of_the_samples() -> None:
    """A straight metre; of ten samples four lie on it, and those that lie about one place of it tell nothing."""
    segments = Segments(np.array([[0.0, 0, 0], [1.0, 0, 0]]), np.array([0.0, 1.0]))
    samples = np.array([[0.1 * k, 0.0 if k < 4 else 0.2, 0.0] for k in range(10)])
    assert _on(segments, 1.0, samples) == pytest.approx(0.4)
    assert _on(segments, 1.0, samples * [0.01, 1, 1]) == 0.0

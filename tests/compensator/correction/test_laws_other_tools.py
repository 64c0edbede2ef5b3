"""Another tool in the program than in the cell file: another cutter in the same spindle, or a mistake."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from compensator.correction.files import Inputs
from compensator.correction.predict import other_tools
from compensator.path.robot_path import robot_path
from compensator.rapid import read_rapid
from identification.model.cell import read_cell
from tests.compensator.rapid.small_programs import target
from tests.support import write_cell


@pytest.mark.parametrize(("tool", "level", "words"), [
    ("[[120, 0, 230],[1,0,0,0]]", "note", ""),                                      # a shorter cutter in the same spindle
    ("[[120, 0, 230],[0.9238795,0,0,0.3826834]]", "note", ""),                      # whose axes are turned about it
    ("[[120, 20, 250],[1,0,0,0]]", "warning", "20 mm beside it, tilted by 0 deg"),
    ("[[120, 0, 250],[0.9961947,0,0.0871557,0]]", "warning", "0 mm beside it, tilted by 10 deg"),
    ("[[0.12, 0, 0.25],[1,0,0,0]]", "warning", "in metres"),
    ("[[0, 0, 0],[1,0,0,0]]", "warning", "the flange, as that of tool0"),
])
def test_a_tool_that_is_no_other_cutter_is_a_warning(sample_inputs: Inputs, tool: str, level: str, words: str) -> None:
    """The sample's spindle stands 120 mm aside, the tip of its cutter 250 mm before the flange."""
    text = sample_inputs.toolpath.read_text()
    written = "[[120.0000,0.0000,250.0000],[1.00000000,0.00000000,0.00000000,0.00000000]]"
    assert written in text
    path = robot_path(read_rapid(text.replace(written, tool).encode(), "insert.mod").toolpath, read_cell(sample_inputs.cell))
    [finding] = other_tools(path, path.known)
    assert (finding.code, finding.level) == ("CS2055", level)
    assert words in (finding.hint or "")


def turned(degrees: float, axis: int) -> str:
    q = [np.cos(np.radians(degrees) / 2), 0.0, 0.0, 0.0]
    q[axis + 1] = np.sin(np.radians(degrees) / 2)
    return ",".join(f"{x:.10f}" for x in q)


@pytest.mark.parametrize(("tip", "turn", "level", "words"), [
    ("120,0,250.9", turned(0, 0), "", ""), ("120,0,251.1", turned(0, 0), "note", "1.1 mm and 0.0 deg from cell.yaml's"),
    ("120,0,250", turned(0.45, 2), "", ""), ("120,0,250", turned(0.56, 2), "note", "0.0 mm and 0.6 deg from cell.yaml's"),
    ("1.9,0,0", turned(0, 0), "warning", "is its tooldata in metres?"), ("2.1,0,0", turned(0, 0), "warning", "stands 118 mm"),
    ("124.5,0,200", turned(0, 0), "note", ""), ("120,5.6,200", turned(0, 0), "warning", "stands 6 mm beside it, tilted by 0 "),
    ("120,0,200", turned(1.8, 1), "note", ""), ("120,0,200", turned(2.4, 0), "warning", "stands 0 mm beside it, tilted by 2 ")])
def test_a_tool_is_the_cells_within_a_millimetre_and_another_cutter_along_its_axis(
        tmp_path: Path, tip: str, turn: str, level: str, words: str) -> None:
    """And half a degree; up to 5 mm beside the axis and 2 degrees off it; one of less than 2 mm is in metres."""
    text = (f"MODULE M\nPERS tooldata tMine:=[TRUE,[[{tip}],[{turn}]],[1,[0,0,1],[1,0,0,0],0,0,0]];\nPROC main()\n"
            f"MoveL {target(900, 0, 700, '[0,0,1,0]')},v100,z1,tMine;\nENDPROC\nENDMODULE\n")
    path = robot_path(read_rapid(text.encode(), "m.mod").toolpath, read_cell(write_cell(tmp_path)))
    found = other_tools(path, path.known)
    assert [(one.code, one.level) for one in found] == [("CS2055", level)] * bool(level)
    assert all(words in f"{one.message} {one.hint}" for one in found)

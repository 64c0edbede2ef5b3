"""Another tool in the program than in the cell file: another cutter in the same spindle, or a mistake."""

from __future__ import annotations

import pytest

from compensator.correction.files import Inputs
from compensator.correction.predict import other_tools
from compensator.path.robot_path import robot_path
from compensator.rapid import read_rapid
from identification.model.cell import read_cell


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

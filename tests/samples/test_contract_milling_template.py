"""rapid_templates/milling_program.mod.j2: what a rendered module looks like, and that its numbers are well formed."""

from __future__ import annotations

import re
from pathlib import Path

import jinja2
import numpy as np
import pytest

TEMPLATES = Path(__file__).resolve().parents[2] / "rapid_templates"
TOOL = {"name": "tMill", "position": [120, 0, 250], "quaternion": [1, 0, 0, 0], "mass": 80, "cog": [0, 0, 120]}
LINE = {"kind": "MoveL", "position": [-10.00004, 2.0, -0.00004], "quaternion": [0.5, 0.5, -0.5, -1e-12],
        "confdata": [0, -1, 0, 1], "speed": "vCut", "zone": "z1"}


@pytest.fixture(scope="module")
def render():
    env = jinja2.Environment(loader=jinja2.FileSystemLoader(TEMPLATES), trim_blocks=True, lstrip_blocks=True,
                             undefined=jinja2.StrictUndefined, keep_trailing_newline=True)
    return env.get_template("milling_program.mod.j2").render


def test_the_smallest_program(render):
    unused = "[9E9,9E9,9E9,9E9,9E9,9E9]"
    assert render(module="Part", tool=TOOL, rows=[LINE]).split("\n") == [
        "MODULE Part",
        "",
        "  PERS tooldata tMill:=[TRUE,[[120.0000,0.0000,250.0000],[1.00000000,0.00000000,0.00000000,0.00000000]],"
        "[80,[0,0,120],[1,0,0,0],0,0,0]];",
        "",
        "  PROC main()",
        "    ConfL\\Off;",
        "    MoveL [[-10.0000,2.0000,0.0000],[0.50000000,0.50000000,-0.50000000,0.00000000],"
        f"[0,-1,0,1],{unused}],vCut,z1,tMill;",
        "    ConfL\\On;",
        "  ENDPROC",
        "ENDMODULE",
        ""]


def full(render):
    arc = {**LINE, "kind": "MoveC", "via": {**LINE, "position": [1, 2, 3]}, "external": ["100.5"] + ["9E9"] * 5}
    start = {"kind": "MoveAbsJ", "joints": [0, -1e-9, 10, 0, 45.5, 0], "speed": "v500", "zone": "fine"}
    there = {**LINE, "kind": "MoveJ", "speed": "v500", "comment": ["pass 1"], "statements": ["WaitTime 0.5;"]}
    return render(
        module="Part", header=True, comments=["posted by a test"], tool=TOOL, confl="off",
        wobj={"name": "wPart", "uframe": {"position": [1400, 0, 600], "quaternion": [1, 0, 0, 0]}},
        speeds=[{"name": "vCut", "tcp": 45.833333333333336}], zones=[{"name": "zFine", "values": "[TRUE,0,0,0,0,0,0]"}],
        spindle={"on_signal": "doSpindle", "speed_signal": "goSpeed", "speed": 9000, "delay_s": 3},
        before=["AccSet 80,80;"], after=["Stop;"], rows=[start, there, LINE, arc])


def test_everything_in_its_place(render):
    text = full(render)
    assert text.startswith("%%%\n  VERSION:1\n  LANGUAGE:ENGLISH\n%%%\n\nMODULE Part\n  ! posted by a test\n")
    assert "CONST speeddata vCut:=[45.833333333333336,500,5000,1000];" in text
    assert 'TASK PERS wobjdata wPart:=[FALSE,TRUE,"",[[1400.0000,0.0000,600.0000],' in text
    order = ["ConfL\\Off;", "AccSet", "SetGO goSpeed,9000;", "SetDO doSpindle,1;", "MoveAbsJ", "! pass 1",
             "WaitTime 0.5;", "MoveJ", "MoveL", "MoveC", "SetDO doSpindle,0;", "Stop;", "ConfL\\On;", "ENDPROC"]
    at = [text.index(word) for word in order]
    assert at == sorted(at)
    assert text.count("tMill\\WObj:=wPart;") == 4
    assert "MoveAbsJ [[0.000000,0.000000,10.000000,0.000000,45.500000,0.000000],[9E9,9E9,9E9,9E9,9E9,9E9]]" in text
    assert "]]\\NoEOffs,v500,fine,tMill" in text
    assert text.count("[100.5,9E9,9E9,9E9,9E9,9E9]") == 2
    assert not re.search(r"-0\.0+[],]", text)


def test_numbers_come_back(render):
    rng = np.random.default_rng(3)
    position = rng.uniform(-2000, 2000, (50, 3))
    quaternion = rng.normal(size=(50, 4))
    quaternion /= np.linalg.norm(quaternion, axis=1, keepdims=True)
    rows = [{**LINE, "position": p, "quaternion": q} for p, q in zip(position, quaternion, strict=True)]
    text = render(module="Part", tool=TOOL, rows=rows)
    moves = [line for line in text.splitlines() if "MoveL" in line]
    read = np.array([[float(x) for x in re.findall(r"-?\d+\.\d+", line)] for line in moves])
    assert np.abs(read[:, :3] - position).max() <= 0.5001e-4
    assert np.abs(read[:, 3:7] - quaternion).max() <= 0.5001e-8


# rapidchecker 0.1.5 calls pyparsing by its old names; can go when it does not
@pytest.mark.filterwarnings("ignore:.*deprecated.*use:DeprecationWarning")
def test_an_independent_grammar_accepts_it(render):
    check = pytest.importorskip("rapidchecker.check", reason="rapidchecker is not installed: no independent grammar")
    assert check.check_format(full(render).split("%%%")[2].lstrip()) == []

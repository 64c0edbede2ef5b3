"""A written program is read again and held against what it was to say: each number, and all that was to stay."""

from __future__ import annotations

import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from compensator.correction.read_back import _as_meant
from compensator.rapid import read_rapid
from tests.runs.command_line.test_placement import line
from tests.runs.command_line.user_files import Job

# Half a turn about x, written with either sign: one orientation.
HALF = {False: "[0.6,0.8,0,0]", True: "[-0.6,-0.8,0,0]"}
UNUSED = "[9E9,9E9,9E9,9E9,9E9,9E9]"
WOBJ = "PERS wobjdata wOne:=[FALSE,TRUE,\"\",[[0,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];\n"
TOOL = "PERS tooldata tOne:=[TRUE,[[0,0,100],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\n"


def text(negative: bool = False) -> str:
    moves = "".join(f"MoveL [[{x},20,30],{HALF[negative]},[0,0,0,0],{UNUSED}],v50,z1,tOne;\n" for x in (100, 110, 120))
    return f"MODULE M\n{WOBJ}{TOOL}{TOOL.replace('tOne', 'tTwo')}PROC main()\n{moves}ENDPROC\nENDMODULE\n"


def said(before: str, after: str) -> bool:
    """Whether `after` says what was meant: of `before` the middle target is corrected, to (110, 20, 30)."""
    old = read_rapid(before.encode(), "m.mod").toolpath
    correction: Any = SimpleNamespace(targets=np.array([1]), position=np.array([[0.11, 0.02, 0.03]]),
                                      quaternion=np.array([[0.6, 0.8, 0, 0]]), confdata=np.zeros((1, 4), dtype=np.int32))
    return _as_meant(old, read_rapid(after.encode(), "m.mod"), correction)


@pytest.mark.parametrize("negative", [False, True])
def test_what_was_meant_passes_whichever_sign_its_quaternions_have(negative: bool) -> None:
    before = text(negative)
    assert said(before, before)
    assert said(before, before.replace("[110,20,30]", "[110.00005,20,29.99995]"))


@pytest.mark.parametrize(("old", "new"), [
    ("[110,20,30]", "[110.0000501,20,30]"), ("[110,20,30]", "[110,20,29.9999499]"), ("[100,20,30]", "[100.0001,20,30]"),
    ("[120,20,30],[-0.6,", "[120,20,30],[-0.6000001,"), ("[110,20,30],[-0.6,", "[110,20,30],[-0.60000001,"),
    ("[110,20,30],[-0.6,-0.8,", "[110,20,30],[-0.6,0.8,"),
    ("[110,20,30],[-0.6,-0.8,0,0],[0,0", "[110,20,30],[-0.6,-0.8,0,0],[0,-1"),
    ("[120,20,30],[-0.6,-0.8,0,0],[0,0", "[120,20,30],[-0.6,-0.8,0,0],[1,0"),
    ("9E9,9E9]],v50", "9E9,45]],v50"), ("v50", "v100"), ("z1", "z5"), ("MoveL", "MoveJ"), ("z1,tOne;", "z1,tTwo;"),
    ("z1,tOne;", "z1,tOne\\WObj:=wOne;")])
def test_anything_else_than_was_meant_is_noticed(old: str, new: str) -> None:
    """Half a step of the last decimal off, or another word of the corrected move or of one beside it."""
    before = text(negative=True)
    for at in [k for k in range(len(before)) if before.startswith(old, k)]:
        assert not said(before, before[:at] + new + before[at + len(old):])


@pytest.mark.parametrize("name", ["tOne", "wOne"])
def test_another_name_is_noticed(name: str) -> None:
    """Of a tool or a work object, though all numbers are the same."""
    before = text(negative=True).replace("z1,tOne;", "z1,tOne\\WObj:=wOne;")
    assert said(before, before)
    assert not said(before, before.replace(name, "tNew"))


def test_one_target_more_or_less_is_noticed() -> None:
    before = text()
    move = next(line for line in before.splitlines(keepends=True) if "[120,20,30]" in line)
    assert not said(before, before.replace(move, ""))
    assert not said(before, before.replace(move, 2 * move))


def test_a_program_is_corrected_alike_whichever_sign_its_quaternions_have(tmp_path: Path) -> None:
    """And keeps it: posts write q and -q alike."""
    path, written = line(20, 2), []
    force = "".join(f"{k},60,180,-90\n" for k in range(20))
    for sign in (1, -1):
        folder = tmp_path / str(sign)
        folder.mkdir()
        program = path.program()
        for pose in set(re.findall(r"\],\[([^]]+)\],\[(?=[^]]+\],\[9E)", program)):
            program = program.replace(f"[{pose}]", f"[{','.join(str(sign * float(number)) for number in pose.split(','))}]")
        job = Job(folder, program=program, forces="target,fx_n,fy_n,fz_n\n" + force)
        run = job.correct()
        assert run.code == 0, run
        read = read_rapid(job.out.read_bytes(), "out.mod")
        written.append(read.rows.numbers.pose[read.rows.row])
    np.testing.assert_allclose(written[0][:, :3], written[1][:, :3], atol=1e-9)
    np.testing.assert_allclose(written[0][:, 3:], -written[1][:, 3:], atol=1e-9)

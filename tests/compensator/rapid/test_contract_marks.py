"""Marks: a program whose moves switch an output reads as the one without, and says where it switches."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from compensator.rapid import marks_of, read_rapid, rewrite, with_marks
from identification.common.findings import CompstiffError
from tests.compensator.rapid.small_programs import program, target

PROGRAMS = sorted((Path(__file__).parent / "programs").glob("*[!d]"))
READ = ("move", "position", "quaternion", "confdata", "external", "joints", "feed", "zone", "tool", "workobject", "line")


def line(count: int, step: float, tail: str = "v50,z1,tool0") -> str:
    return "\n".join(f"MoveL {target(step * i)},{tail};" for i in range(count))


def without_marks(text: bytes) -> bytes:
    return re.sub(rb"(?i)(Move[LC])DO\b([^;]*),doMark,[01];", rb"\1\2;", text)


@pytest.mark.parametrize("file", PROGRAMS, ids=lambda file: file.name)
def test_a_marked_program_reads_as_it_was(file: Path) -> None:
    """Post-processors' programs: every column of the toolpath, and every byte but the marks."""
    plain = read_rapid(file.read_bytes(), file.name)
    content, findings = with_marks(plain, "doMark")
    again = read_rapid(content, file.name)
    for name in READ:
        np.testing.assert_array_equal(getattr(again.toolpath, name), getattr(plain.toolpath, name), err_msg=name)
    assert without_marks(content) == file.read_bytes()
    marks = marks_of(again)
    assert marks is not None
    assert 2 <= len(marks) <= len(plain.toolpath)
    assert marks.value.tolist() == [(k + 1) % 2 for k in range(len(marks))]
    assert [finding.code for finding in findings] == ["CS2054"]
    assert with_marks(again, "domark")[0] == content, "marked already"


@pytest.mark.parametrize(("step", "feed", "apart"), [(1, 50, 10), (1, 200, 20), (30, 50, 30)])
def test_marks_stand_as_near_as_edges_can_be_told_apart(step: float, feed: float, apart: float) -> None:
    """10 mm, and a tenth of a second at the feed; the first move and the last always."""
    plain = read_rapid(program(line(101, step, f"v{feed},z1,tool0")).encode(), "p.mod")
    marks = marks_of(read_rapid(with_marks(plain, "doMark")[0], "p.mod"))
    assert marks is not None
    assert (marks.target[0], marks.target[-1]) == (0, 100)
    assert set(np.diff(marks.target)[:-1] * step) == {apart}


def test_what_a_move_with_an_output_cannot_say_is_not_marked() -> None:
    tails = ["v50,z1,tool0", "v50\\V:=40,z1,tool0", "v50,z1\\Z:=0.5,tool0", "v50,fine\\Inpos:=inpos20,tool0",
             "v50\\T:=2,z1,tool0", "v50,z1,tool0\\Corr", "v50,z1,tool0"]
    text = "\n".join(f"MoveL {target(20 * i)},{tail};" for i, tail in enumerate(tails))
    text += f"\nMoveAbsJ *,v50,z1,tool0;\nMoveJ {target(9)},v50,z1,tool0;"
    marks = marks_of(read_rapid(with_marks(read_rapid(program(text).encode(), "p.mod"), "doMark")[0], "p.mod"))
    assert marks is not None
    assert marks.target.tolist() == [0, 6]


def test_an_arc_is_marked_at_its_end() -> None:
    text = f"MoveL {target(0)},v50,z1,tool0;\nMoveC {target(20)},{target(40)},v50,z1,tool0;"
    content = with_marks(read_rapid(program(text).encode(), "p.mod"), "doMark")[0]
    assert b"MoveCDO" in content
    marks = marks_of(read_rapid(content, "p.mod"))
    assert marks is not None
    assert (marks.target.tolist(), marks.value.tolist()) == ([0, 2], [1, 0])


def test_a_marked_target_is_corrected_like_any_other() -> None:
    plain = read_rapid(program(line(3, 20)).encode(), "p.mod")
    content = with_marks(plain, "doMark")[0]
    marked = read_rapid(content, "p.mod")
    moved, quaternion = marked.toolpath.position[[2]] + 1e-4, marked.toolpath.quaternion[[2]]
    written = rewrite(marked, [2], moved, quaternion).content
    assert without_marks(written) == rewrite(plain, [2], moved, quaternion).content
    np.testing.assert_allclose(read_rapid(written, "p.mod").toolpath.position[2], moved[0], atol=1e-9)


@pytest.mark.parametrize(("text", "signal", "says"), [
    (line(3, 20), "do Mark", "no name of a signal"), (line(3, 20), "1do", "no name of a signal"),
    (line(1, 20), "doMark", "1 target can be marked"),
    (line(3, 20, "v50\\T:=2,z1,tool0"), "doMark", "0 targets can be marked"),
])
def test_what_cannot_be_marked(text: str, signal: str, says: str) -> None:
    with pytest.raises(CompstiffError, match=f"CS2053.*{says}"):
        with_marks(read_rapid(program(text).encode(), "p.mod"), signal)


def test_which_of_several_outputs_is_not_guessed() -> None:
    text = f"MoveLDO {target(0)},v50,z1,tool0,doCoolant,1;\nMoveLDO {target(20)},v50,z1,tool0,doMark,high;"
    read = read_rapid(program(text).encode(), "p.mod")
    with pytest.raises(CompstiffError, match="CS2053.*docoolant, domark"):
        marks_of(read)
    marks = marks_of(read, "doMark")
    assert marks is not None
    assert marks.target.tolist() == [1]

"""Marks: a program whose moves switch an output reads as the one without, and says where it switches."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from compensator.rapid import marks as marks_module
from compensator.rapid import marks_of, read_rapid, rewrite, with_marks
from compensator.rapid.insertion import marked
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


def greedy(x: list[float], feeds: list[float]) -> list[int]:
    """Each as soon as it is 10 mm and a tenth of a second from the one before; the last in place of one that is too near."""
    chosen = [0]
    for k in range(1, len(x)):
        if abs(x[k] - x[chosen[-1]]) >= max(10, 0.1 * feeds[k]):
            chosen.append(k)
    if chosen[-1] != len(x) - 1:
        chosen = [*(chosen[:-1] or chosen), len(x) - 1]
    return chosen


@pytest.mark.parametrize(("x", "feeds"), [
    ([0, 1], [50, 50]), ([0, 10, 12], [50, 50, 50]), ([0, 9.999, 10, 20], [50] * 4), ([0, 15, 30, 40], [50, 150, 300, 100]),
    ([0, 12, 25, 36], [50, 200, 50, 50]), ([0, 12, 24], [0, 0, 0])])
def test_marks_are_those_that_are_told_apart_one_after_the_other(x: list[float], feeds: list[float]) -> None:
    """By the feed of the move that ends there; a speed that the text does not give asks for the 10 mm alone."""
    text = "\n".join(f"MoveL {target(place)},{f'v{feed:g}' if feed else 'vMine'},z1,tool0;"
                     for place, feed in zip(x, feeds, strict=True))
    speeds = "\n".join(f"CONST speeddata v{feed:g}:=[{feed:g},500,5000,1000];" for feed in {*feeds} - {0})
    content, (told,) = with_marks(read_rapid(program(text, speeds).encode(), "p.mod"), "doMark")
    marks = marks_of(read_rapid(content, "p.mod"))
    assert marks is not None
    assert marks.target.tolist() == greedy(x, feeds)
    assert marks.value.tolist() == [(k + 1) % 2 for k in range(len(marks))]
    assert told.message == f"the program now sets domark at {len(marks)} of {len(x)} targets, from 0 to {len(x) - 1}"


def test_the_way_to_a_place_that_is_not_known_does_not_count() -> None:
    """It is not marked either."""
    places = (target(0), "pThere", target(40), target(45), target(50), target(60))
    text = "\n".join(f"MoveL {place},v50,z1,tool0;" for place in places)
    marks = marks_of(read_rapid(with_marks(read_rapid(program(text).encode(), "p.mod"), "doMark")[0], "p.mod"))
    assert marks is not None
    assert marks.target.tolist() == [0, 4, 5]


@pytest.mark.parametrize(("values", "targets", "levels"), [
    (["0", "0", "1", "high", "LOW", "1"], [2, 4, 5], [1, 0, 1]), (["1", "1", "0"], [0, 2], [1, 0]),
    (["0", "nLevel", "1", "2", "1", "0"], [2, 5], [1, 0]), (["0", "0"], [], [])])
def test_marks_are_where_the_output_changes(values: list[str], targets: list[int], levels: list[int]) -> None:
    """It is low when the program begins; a value that is neither 0 nor 1, low nor high, says nothing."""
    text = "\n".join(f"MoveLDO {target(20 * k)},v50,z1,tool0,doMark,{value};" for k, value in enumerate(values))
    marks = marks_of(read_rapid(program(text).encode(), "p.mod"), "DOMARK")
    assert marks is not None
    assert (marks.target.tolist(), marks.value.tolist(), marks.at.tolist()) == (targets, levels, targets)


def test_marks_alternate_as_their_targets_are_driven() -> None:
    """Routines in another order than the text's, one of which nobody calls; each that is driven twice counts the first time."""
    routine = "PROC {}()\n{}\nENDPROC\n"
    routines = {"rUnused": line(2, 20), "rLate": f"MoveL {target(100)},v50,z1,tool0;", "rEarly": line(2, 20),
                "main": "rEarly;\nrLate;\nrEarly;"}
    text = "MODULE M\n" + "".join(routine.format(name, body) for name, body in routines.items()) + "ENDMODULE\n"
    content = with_marks(read_rapid(text.encode(), "p.mod"), "doMark")[0]
    assert [int(value) for value in re.findall(rb"doMark,(\d)", content)][2:] == [1, 1, 0]
    marks = marks_of(read_rapid(content, "p.mod"))
    assert marks is not None
    assert (marks.target.tolist(), marks.at.tolist(), marks.value.tolist()) == ([3, 4, 2, 4], [0, 1, 2, 4], [1, 0, 1, 0])


def test_a_program_that_sets_the_output_is_given_back_and_told() -> None:
    text = program("\n".join(f"MoveLDO {target(20 * k)},v50,z1,tool0,doMark,{k % 2};" for k in range(4))).encode()
    content, (told,) = with_marks(read_rapid(text, "p.mod"), "doMark")
    assert content == text
    assert (told.code, told.level) == ("CS2054", "note")
    assert told.message == "the program sets already domark at 3 of 4 targets, from 1 to 3"


@pytest.mark.parametrize(("signal", "fits"), [("d" + 31 * "o", True), ("d" + 32 * "o", False), ("dö", False)])
def test_a_signal_has_a_name_of_at_most_32(signal: str, fits: bool) -> None:
    plain = read_rapid(program(line(3, 20)).encode(), "p.mod")
    if fits:
        assert signal.encode() in with_marks(plain, signal)[0]
    else:
        with pytest.raises(CompstiffError, match="CS2053.*no name of a signal"):
            with_marks(plain, signal)


@pytest.mark.parametrize(("was", "now"), [
    (b"doMark,1", b"doOther,1"), (b"MoveLDO [[40", b"MoveLDO [[41"), (b"doMark,0", b"doMark,1"), (b"DO [[20", b" [[20"),
    (b"v50,z1,tool0,doMark,0", b"v60,z1,tool0,doMark,0"), (b"[1,0,0,0],[0,0,0,0]", b"[0,1,0,0],[0,0,0,0]")])
def test_a_marked_program_that_does_not_read_back_is_not_given(monkeypatch: pytest.MonkeyPatch, was: bytes, now: bytes) -> None:
    """A target elsewhere, another speed or orientation, a mark that is missing or says the other level."""
    def spoilt(*given: Any) -> bytes:
        text = marked(*given)
        assert was in text
        text = re.sub(rb",doMark,0", b"", text) if was.startswith(b"DO") else text
        return text.replace(was, now, 1)

    monkeypatch.setattr(marks_module, "marked", spoilt)
    with pytest.raises(CompstiffError, match=r"CS2053.*does not read back"):
        with_marks(read_rapid(program(line(3, 20)).encode(), "p.mod"), "doMark")

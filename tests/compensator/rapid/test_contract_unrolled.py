"""Loops over arrays of targets: read as the moves that they drive, and corrected in the array alone."""

from __future__ import annotations

import re

import numpy as np
import pytest

from compensator.rapid import (
    MoreMoves,
    Pose,
    RapidProgram,
    follows_directly,
    marks_of,
    move_text,
    read_rapid,
    rewrite,
    with_marks,
    with_more_moves,
)
from tests.compensator.rapid.small_programs import target

ARRAY = "CONST robtarget aP{4}:=[" + ",\n  ".join(target(10 + k) for k in range(4)) + "];\n"


def program(body: str, data: str = ARRAY, more: str = "") -> RapidProgram:
    text = f"MODULE M\n{data}CONST num nLast:=4;\nPROC main()\n{body}\nENDPROC\n{more}ENDMODULE\n"
    return read_rapid(text.encode(), "loop.mod")


def move(expression: str, kind: str = "MoveL") -> str:
    return f"{kind} {expression},v100,z1,tool0;"


def numbers(read: RapidProgram) -> list[float]:
    """The x [mm] of its targets, by which small_programs.target tells them."""
    two = f"MODULE M\nPROC p()\n{move(target(0))}\n{move(target(1))}\nENDPROC\nENDMODULE\n"
    first = 1e3 * read_rapid(two.encode()).toolpath.position
    step = first[1] - first[0]
    return [float(np.dot(1e3 * place - first[0], step) / np.dot(step, step)) for place in read.toolpath.position]


def loop(head: str, *expressions: str) -> str:
    return f"FOR {head} DO\n" + "\n".join(move(one) for one in expressions) + "\nENDFOR"


@pytest.mark.parametrize(("body", "driven"), [
    (loop("i FROM 1 TO 4", "aP{i}"), [10, 11, 12, 13]),
    (loop("i FROM nLast TO 1 STEP -1", "aP{i}"), [13, 12, 11, 10]),
    (loop("i FROM 4 TO 1", "aP{i}"), [13, 12, 11, 10]),
    (loop("i FROM 1 TO Dim(aP,1)", "aP{i}"), [10, 11, 12, 13]),
    (loop("i FROM 0 TO nLast/2-1", "aP{2*i+1}", "aP{2*i+2}"), [10, 11, 12, 13]),
    ("\n".join([move(target(1)), loop("i FROM 1 TO 2", "aP{i}"), move(target(2)), loop("i FROM 3 TO 4", "aP{i}"),
                move(target(3))]), [1, 10, 11, 2, 12, 13, 3]),
    (f"IF TRUE THEN\n{loop('i FROM 3 TO 3', 'aP{i}')}\nENDIF", [12]),
])
def test_each_turn_has_its_targets(body: str, driven: list[int]) -> None:
    read = program(body)
    np.testing.assert_allclose(numbers(read), driven, atol=1e-9)
    assert read.runs.order is None
    assert (read.runs.times == 1).all()
    assert not read.toolpath.block.any()


@pytest.mark.parametrize("body", [
    loop("i FROM 1 TO nTurns", "aP{i}"), loop("i FROM 1 TO 4", "aP{j}"),
    loop("i FROM 1 TO 4", "aP{i}", target(3)), f"FOR i FROM 1 TO 4 DO\n{move('aP{i}')}\nn:=n+1;\nENDFOR",
    f"FOR i FROM 1 TO 4 DO\nIF i<3 {move('aP{i}')}\nENDFOR", loop("i FROM 1 TO 4 STEP -1", "aP{i}"),
    loop("i FROM 1 TO 2.5 STEP 0.5", "aP{i}"), loop("i FROM 1 TO 4 STEP 0", "aP{i}"), loop("i FROM 1 TO Dim(aP,2)", "aP{i}"),
    loop("i FROM 1 TO Dim(nLast,1)", "aP{i}"), f"WHILE i<4 DO\n{move('aP{i}')}\ni:=i+1;\nENDWHILE",
])
def test_other_loops_stay_as_they_are(body: str) -> None:
    read = program(body)
    assert len(read.toolpath) == body.count("Move")
    assert any(read.toolpath.block)


def test_a_turn_beyond_the_array_is_said() -> None:
    read = program(loop("i FROM 1 TO 5", "aP{i}"))
    assert "no element {5}" in read.toolpath.block[4]
    assert not read.toolpath.block[:4].any()


def test_what_is_corrected_is_written_into_the_array_and_nothing_else_changes() -> None:
    other = f"PROC rOther()\n{move(target(2))}\nENDPROC\n"
    read = program(f"{move(target(1))}\n{loop('i FROM 1 TO 4', 'aP{i}')}\nrOther;", more=other)
    places = read.toolpath.position + np.outer(np.arange(6), [1e-4, 0, 0])
    which = np.array([1, 2, 4])
    written = rewrite(read, which, places[which], read.toolpath.quaternion[which]).content
    again = read_rapid(written, "loop.mod")
    expected = read.toolpath.position.copy()
    expected[which] = places[which]
    np.testing.assert_allclose(again.toolpath.position, expected, atol=1e-9)
    old, new = read.source.data.decode().split("\n"), written.decode().split("\n")
    assert [k for k, (a, b) in enumerate(zip(old, new, strict=True)) if a != b] == [1, 2, 4]
    assert re.sub(r"-?[\d.]+", "#", written.decode()) == re.sub(r"-?[\d.]+", "#", read.source.data.decode())


@pytest.mark.parametrize("beside", [
    move("aP{2}"), loop("j FROM 2 TO 2", "aP{j}"), "pHere:=aP{2};", "rShow aP{2};", "aCopy:=aP;"])
def test_elements_that_something_else_uses_stay_as_they_are(beside: str) -> None:
    read = program(f"{loop('i FROM 1 TO 4', 'aP{i}')}\n{beside}")
    assert "something else uses it" in read.toolpath.block[1]
    assert {finding.level for finding in read.toolpath.findings if finding.code == "CS2059"} == {"note", "warning"}
    assert len(read.runs.times) == len(read.toolpath)


def test_the_move_in_a_loop_itself_stays() -> None:
    read = program(f"{move(target(1))}\n{loop('i FROM 1 TO 4', 'aP{i}')}\n{move(target(2))}")
    assert [move_text(read, k) is None for k in range(6)] == [False, True, True, True, True, False]
    marks = marks_of(read_rapid(with_marks(read, "doMark")[0], "loop.mod"))
    assert marks is not None
    assert marks.target.tolist() == [0, 5]


def further(read: RapidProgram, more: dict[int, int]) -> RapidProgram:
    """The program with so many linear targets more before some of its own, each at x = 1 + its number [mm], read again."""
    moves = [MoreMoves(at, linear=[Pose([1.0 + k, at, 0, *read.toolpath.quaternion[at].tolist()], [0, 0, 0, 0])
                                   for k in range(count)]) for at, count in more.items()]
    again = read_rapid(with_more_moves(read, moves), "loop.mod")
    kept = np.cumsum([1 + more.get(at, 0) for at in range(len(read.toolpath))]) - 1
    np.testing.assert_allclose(again.toolpath.position[kept], read.toolpath.position, atol=1e-12)
    expected = [[1.0 + k, at, 0] for at, count in sorted(more.items()) for k in range(count)]
    np.testing.assert_allclose(1e3 * np.delete(again.toolpath.position, kept, axis=0), expected, atol=1e-9)
    assert again.runs.order is None
    assert not again.toolpath.block.any()
    return again


@pytest.mark.parametrize(("head", "after"), [
    ("FOR i FROM 1 TO 4 DO", "FOR i FROM 1 TO 9 DO"), ("FOR i FROM 1 TO Dim(aP,1) DO", "FOR i FROM 1 TO Dim(aP,1) DO"),
    ("FOR K FROM 2 TO 3 DO", "FOR K FROM 2 TO 7 DO")])
def test_an_array_grows_with_what_is_added_to_its_loop(head: str, after: str) -> None:
    name, whole = head.split()[1], "FROM 1" in head
    read = program(f"{move(target(1))}\n{head}\n! aP goes on\n{move(f'ap{{{name}}}')}\nENDFOR\n{move(target(2))}")
    count = len(read.toolpath)
    assert [follows_directly(read, k) for k in range(count)] == [False, *(count - 1) * [True]]
    again = further(read, {1: 2, 2: 2} | ({3: 1} if whole else {}) | {count - 1: 1})
    text = again.source.data.decode()
    assert f"\n{after}\n! aP goes on\n" in text
    assert f"CONST robtarget aP{{{9 if whole else 8}}}:=[[" in text
    assert text.count("\n  [[") == 3 + (3 if whole else 4)          # one a line, as that before which they stand


def test_an_array_whose_loop_gains_nothing_stays_to_the_byte() -> None:
    """Its size as it is written, beside one that grows."""
    data = ARRAY.replace("aP{4}", "aP{04}") + ARRAY.replace("aP", "aQ")
    body = f"{loop('i FROM 1 TO 04', 'aP{i}')}\n{loop('i FROM 1 TO 4', 'aQ{i}')}"
    text = further(program(body, data), {5: 2}).source.data.decode()
    assert ARRAY.replace("aP{4}", "aP{04}") in text
    assert "FOR i FROM 1 TO 04 DO" in text
    assert "aQ{6}:=" in text
    assert "FOR i FROM 1 TO 6 DO" in text


def test_loops_over_parts_of_an_array_are_counted_on() -> None:
    body = "\n".join([move(target(1)), loop("i FROM 1 TO 2", "aP{i}"), move(target(2)), loop("i FROM 3 TO 4", "aP{i}")])
    text = further(program(body), {2: 1, 4: 2, 5: 1}).source.data.decode()
    assert "FOR i FROM 1 TO 3 DO" in text
    assert "FOR i FROM 4 TO 8 DO" in text
    assert "aP{8}:=" in text


@pytest.mark.parametrize(("body", "data"), [
    (loop("i FROM 1 TO nLast", "aP{i}"), ARRAY), (loop("i FROM 1 TO 3 STEP 2", "aP{i}"), ARRAY),
    (loop("i FROM 4 TO 1", "aP{i}"), ARRAY), (loop("i FROM 1 TO 2", "aP{i+1}"), ARRAY),
    (f"{loop('i FROM 1 TO 3', 'aP{i}')}\n{move('aP{4}')}", ARRAY),
    (f"{loop('i FROM 1 TO 3', 'aP{i}')}\n{loop('i FROM 3 TO 4', 'aP{i}')}", ARRAY),
    (f"{loop('i FROM 1 TO 4', 'aP{i}')}\nTPWrite \"n\"\\Num:=Dim(aP,1);", ARRAY),
    (f"FOR i FROM 1 TO 4 DO\n{move('aP{i}').replace('v100', 'aV{i}')}\nENDFOR",
     f"CONST speeddata aV{{4}}:=[v50,v50,v50,v60];\n{ARRAY}"),
    (f"FOR i FROM 1 TO 4 DO\n{move('aP{i}').replace('z1', 'fine')}\nENDFOR", ARRAY),
    (f"FOR i FROM 1 TO 4 DO\n{move('aP{i}').replace('v100', chr(92).join(['v100', 'T:=2']))}\nENDFOR", ARRAY),
    (f"FOR i FROM 1 TO 4 DO\n{move('aP{i}')}\nWaitTime 0.1;\nENDFOR", ARRAY),
    (f"FOR i FROM 1 TO 4 DO\n{move('aP{i}', 'MoveJ')}\nENDFOR", ARRAY),
    (f"{loop('i FROM 1 TO 4', 'aP{i}')}\nrElsewhere;", ARRAY),      # which sees the array
])
def test_other_arrays_do_not_grow(body: str, data: str) -> None:
    read = program(body, data)
    assert len(read.toolpath) >= 2
    assert not any(follows_directly(read, k) for k in range(len(read.toolpath)) if k in read.scan.looped)


def test_an_array_that_no_other_file_sees_grows_beside_their_routines() -> None:
    read = program(f"{loop('i FROM 1 TO 4', 'aP{i}')}\nrElsewhere;", f"LOCAL {ARRAY}")
    assert [follows_directly(read, k) for k in range(4)] == [False, True, True, True]


def test_arcs_and_what_stands_behind_keep_their_places() -> None:
    arcs = "FOR i FROM 1 TO 2 DO\nMoveC aP{2*i-1},aP{2*i},v100,z1,tool0;\nENDFOR"
    read = program(f"{arcs}\nPDispSet shift;\n{move(target(3))}\nPDispOff;\n{move(target(4))}")
    assert read.toolpath.move.tolist() == [2, 3, 2, 3, 1, 1]
    assert ["displacement" in why for why in read.toolpath.block] == [False] * 4 + [True, False]


def test_a_routine_with_a_loop_may_be_called_twice() -> None:
    own = f"PROC rA()\n{loop('i FROM 1 TO 2', 'aP{i}')}\nENDPROC\nPROC rB()\n{move(target(5))}\nENDPROC\n"
    read = program("rA;\nrB;\nrA;", more=own)
    assert read.runs.order is not None
    assert read.runs.order.tolist() == [0, 1, 2, 0, 1]


def test_shifts_by_the_turn_have_known_places_and_stay_as_they_are() -> None:
    """x + 10 i of the first, x + 5 of an element of the second."""
    read = program(loop("i FROM 1 TO 3", "Offs(aP{1},10*i,0,0)", "Offs(aP{i},5,0,0)"))
    first = 1e3 * program(move("aP{1}")).toolpath.position[0]
    others = [1e3 * program(move(f"aP{{{turn}}}")).toolpath.position[0] for turn in (1, 2, 3)]
    place = 1e3 * read.toolpath.position
    np.testing.assert_allclose(place[0::2] - first, [[10, 0, 0], [20, 0, 0], [30, 0, 0]], atol=1e-9)
    np.testing.assert_allclose(place[1::2] - np.array(others), 3 * [[5, 0, 0]], atol=1e-9)
    assert all("one move in a loop" in why for why in read.toolpath.block)
    assert [finding.level for finding in read.toolpath.findings if finding.code == "CS2059"] == ["note", "warning"]

"""Targets that calls hand over to a routine: read as the moves that each call drives, and corrected in the call alone."""

from __future__ import annotations

import numpy as np
import pytest

from compensator.rapid import MoreMoves, Pose, RapidProgram, follows_directly, move_text, read_rapid, rewrite, with_more_moves
from tests.compensator.rapid.small_programs import target

DATA = "".join(f"CONST robtarget p{k}:={target(k)};\n" for k in range(10, 14))
CUT = "PROC cut(robtarget p)\nMoveL p,v100,z1,tool0;\nENDPROC\n"


def move(expression: str) -> str:
    return f"MoveL {expression},v100,z1,tool0;\n"


def program(body: str, routines: str = CUT, data: str = DATA) -> RapidProgram:
    return read_rapid(f"MODULE M\n{data}PROC main()\n{body}\nENDPROC\n{routines}ENDMODULE\n".encode(), "handed.mod")


def numbers(read: RapidProgram) -> list[float]:
    """The number by which small_programs.target tells them, of the targets as they are driven."""
    two = read_rapid(f"MODULE M\nPROC p()\n{move(target(0))}{move(target(1))}ENDPROC\nENDMODULE\n".encode()).toolpath.position
    order = read.toolpath.driven
    position = read.toolpath.position if order is None else read.toolpath.position[order]
    return [float(np.dot(place - two[0], two[1] - two[0]) / np.dot(two[1] - two[0], two[1] - two[0])) for place in position]


@pytest.mark.parametrize(("body", "routines", "driven"), [
    ("cut p10;\ncut p12;\ncut p11;", CUT, [10, 12, 11]),
    (f"{move(target(1))}cut p10;\n{move(target(2))}cut p:=p11;\n{move(target(3))}", CUT, [1, 10, 2, 11, 3]),
    (f"cut {target(5)};\ncut p11;", CUT, [5, 11]),
    ('%"cut"% p12;\ncut p11;', CUT, [12, 11]),
    ("line p10,p11;\nline p12,p13;",
     f"PROC line(robtarget a,robtarget b)\n{move('b')}{move('a')}ENDPROC\n", [11, 10, 13, 12]),
    ("two;\ncut p13;\ntwo;", f"{CUT}PROC two()\ncut p10;\ncut p11;\nENDPROC\n", [10, 11, 13, 10, 11]),
    ("FOR i FROM 1 TO 2 DO\ncut p10;\ncut p11;\nENDFOR", CUT, [10, 11, 10, 11]),
    ("IF TRUE cut p13;\nIF FALSE cut p12;\ncut p10;", CUT, [13, 10]),
])
def test_each_call_has_its_targets(body: str, routines: str, driven: list[int]) -> None:
    read = program(body, routines)
    np.testing.assert_allclose(numbers(read), driven, atol=1e-6)
    assert not read.toolpath.block.any()
    assert {finding.code for finding in read.toolpath.findings} >= {"CS2060"}


def test_targets_count_where_their_calls_stand() -> None:
    """As the program drives them, wherever the routine stands; what holds behind a call holds for the moves behind it."""
    body = (f"{move(target(1))}cut p10;\nSoftAct 1,20;\n{move(target(2))}SoftDeact;\ncut p11;\nFOR i FROM 1 TO 2 DO\n"
            f"{move('a{i}')}ENDFOR\nActUnit STN1;\ncut p12;\nDeactUnit STN1;\ncut p13;\n")
    text = f"MODULE M\n{DATA}{ARRAY}{CUT}PROC main()\n{body}ENDPROC\nENDMODULE\n"
    read = read_rapid(text.encode(), "handed.mod")
    assert read.toolpath.driven is None
    assert (np.diff(read.runs.times) == 0).all()
    np.testing.assert_allclose(numbers(read), [1, 10, 2, 11, 10, 11, 12, 13], atol=1e-6)
    lines = [text[:at].count("\n") + 1 for at in (text.index(f"cut p{k}") for k in (10, 11, 12, 13))]
    assert read.toolpath.line[[1, 3, 6, 7]].tolist() == lines
    assert [bool(why) for why in read.toolpath.block] == [False, False, True, *5 * [False]]
    assert read.toolpath.switched == ((6, "stn1", True), (7, "stn1", False))
    assert read.scan.looped == {4, 5}
    assert sorted(read.scan.handed) == [1, 3, 6, 7]


def test_calls_within_a_routine_that_is_handed_its_own_targets() -> None:
    text = (f"PROC layer(robtarget p)\n{move('p')}cut p13;\nENDPROC\n{CUT}")
    read = program(f"layer p10;\n{move(target(1))}layer p11;\ncut p12;", text)
    np.testing.assert_allclose(numbers(read), [10, 13, 1, 11, 13, 12], atol=1e-6)


def further(read: RapidProgram, first: int, *places: tuple[float, float, float]) -> str:
    """The program with linear targets [mm] before one of its own."""
    turn = read.toolpath.quaternion[first].tolist()
    more = MoreMoves(first, linear=[Pose([*place, *turn], [0, 0, 0, 0], None) for place in places])
    return with_more_moves(read, [more]).decode()


@pytest.mark.parametrize(("call", "head", "tail"), [
    (f"cut {target(5)};", "cut ", ";"), ("cut p11;", "cut ", ";"), ("cut p:=p11;", "cut p:=", ";"),
    ('%"cut"% p11;', '%"cut"% ', ";")])
def test_a_call_that_is_one_move_is_repeated_for_further_targets(call: str, head: str, tail: str) -> None:
    read = program(f"{move(target(1))}  {call}\ncut p12;")
    assert [follows_directly(read, at) for at in range(3)] == [False, True, True]
    written = further(read, 1, (1, 2, 3), (4, 5, 6))
    again = read_rapid(written.encode(), "handed.mod")
    np.testing.assert_allclose(1e3 * again.toolpath.position[[1, 2]], [[1, 2, 3], [4, 5, 6]], atol=1e-9)
    np.testing.assert_allclose(again.toolpath.position[[0, 3, 4]], read.toolpath.position, atol=1e-12)
    added = [line for line in written.splitlines() if line not in read.source.data.decode().splitlines()]
    assert len(added) == 2
    assert all(line.startswith(f"  {head}[[") and line.endswith(f"]{tail}") for line in added)
    assert again.toolpath.driven is None
    assert not again.toolpath.block.any()


def test_further_arguments_of_a_call_go_along() -> None:
    cut = "PROC cut(robtarget p,speeddata v,num n)\nMoveL p,v,z1,tool0;\nENDPROC\n"
    read = program("cut p10,v50,3;\ncut p11,v50,4;", cut)
    again = read_rapid(further(read, 1, (1, 2, 3)).encode(), "handed.mod")
    assert "],v50,4;\ncut p11,v50,4;" in again.source.data.decode()


@pytest.mark.parametrize("routines", [
    CUT.replace("z1", "fine"), CUT.replace("z1", "z1\\Inpos:=inpos50"), CUT.replace("v100", "v100\\T:=2"),
    CUT.replace("MoveL p", "WaitTime 0.1;\nMoveL p"), CUT.replace("ENDPROC", "SetDO do1,1;\nENDPROC"),
    CUT.replace("\nMoveL", "\nVAR num n;\nMoveL"), CUT.replace("MoveL", "MoveJ"), CUT.replace("(robtarget", "(VAR robtarget"),
    "PROC cut(robtarget p)\nMoveLDO p,v100,z1,tool0,do1,1;\nENDPROC\n", CUT.replace("ENDPROC", "ERROR\nRETRY;\nENDPROC"),
    f"PROC cut(robtarget p)\n{move('p')}{move('Offs(p,0,0,9)')}ENDPROC\n"])
def test_other_calls_are_not_repeated(routines: str) -> None:
    """A stop at each further target, a second wait, an output set twice: the part would show it."""
    read = program("cut p10;\ncut p11;", routines, DATA.replace("CONST", "PERS"))
    assert len(read.scan.handed) == 2 + 2 * routines.count("Offs")
    assert not any(follows_directly(read, at) for at in range(len(read.toolpath)))


def test_a_move_behind_a_call_that_does_more_than_move_has_no_further_targets() -> None:
    """It may have gone on elsewhere."""
    read = program(f"cut p10;\n{move(target(1))}", CUT.replace("ENDPROC", "home;\nENDPROC\nPROC home()\n" + move(target(3))
                                                              + "ENDPROC"))
    assert not follows_directly(read, 1)


def test_places_beside_a_target_that_is_handed_over_are_known_and_left() -> None:
    read = program("drill p10;\ndrill p12;", f"PROC drill(robtarget p)\n{move('Offs(p,0,0,50)')}{move('p')}ENDPROC\n")
    place = 1e3 * read.toolpath.position
    np.testing.assert_allclose(place[[0, 2]] - place[[1, 3]], [[0, 0, 50], [0, 0, 50]], atol=1e-9)
    assert all("every call" in why for why in read.toolpath.block)
    assert [(finding.level, finding.count) for finding in read.toolpath.findings if finding.code == "CS2060"] == [
        ("note", 4), ("warning", 4)]


@pytest.mark.parametrize("routines", [
    f"PROC cut(robtarget p)\np.trans.z:=5;\n{move('p')}ENDPROC\n",
    f"PROC cut(VAR robtarget p)\n{move('p')}p.trans.z:=5;\nENDPROC\n",
    f"PROC cut(INOUT robtarget p)\n{move('p')}elsewhere p;\nENDPROC\n",
    f"PROC cut(robtarget p)\n{move('p')}{move(target(1))}ENDPROC\n",
    f"PROC cut(robtarget p)\n{move('p')}PDispOn p10,tool0;\n{move('p')}PDispOff;\nENDPROC\n",
])
def test_other_routines_stay_as_they_are(routines: str) -> None:
    read = program("cut p10;\ncut p11;", routines)
    assert len(read.toolpath) == routines.count("MoveL")
    assert any(read.toolpath.block)


def test_data_of_the_caller_are_not_taken_for_those_of_the_routine() -> None:
    read = program(f"CONST robtarget q:={target(3)};\ncut q;\ncut p10;", CUT, f"{DATA}CONST robtarget q:={target(4)};\n")
    assert len(read.toolpath) == 1
    assert "parameter" in read.toolpath.block[0]


@pytest.mark.parametrize(("mode", "storage"), [("VAR", "VAR"), ("PERS", "PERS"), ("INOUT", "PERS"), ("INOUT", "VAR")])
def test_a_target_by_reference_is_followed_and_its_copy_is_of_its_kind(mode: str, storage: str) -> None:
    """A controller refuses to load a call that hands a constant to a reference."""
    read = program("cut p10;\ncut p12;\ncut p10;", CUT.replace("(robtarget", f"({mode} robtarget"),
                   DATA.replace("CONST", storage))
    np.testing.assert_allclose(numbers(read), [10, 12, 10], atol=1e-6)
    written = moved(read, [0, 1]).decode()
    assert f"LOCAL {storage} robtarget p10_c1:=" in written
    assert "CONST" not in written
    assert "cut p10_c1;\ncut p12_c1;\ncut p10;" in written


def moved(read: RapidProgram, which: list[int]) -> bytes:
    """The program with these targets a tenth of a millimetre aside, as it is read again."""
    places = read.toolpath.position.copy()
    places[which] += [1e-4, 0, 0]
    written = rewrite(read, which, places[which], read.toolpath.quaternion[which]).content
    np.testing.assert_allclose(read_rapid(written, "handed.mod").toolpath.position, places, atol=1e-9)
    return written


ARRAY = f"CONST robtarget a{{4}}:=[{','.join(target(k) for k in range(10, 14))}];\n"
GRID = f"CONST robtarget g{{2,2}}:=[[{target(10)},{target(11)}],[{target(12)},{target(13)}]];\n"


@pytest.mark.parametrize(("body", "data", "driven"), [
    ("FOR i FROM 1 TO 4 DO\ncut a{i};\nENDFOR", ARRAY, [10, 11, 12, 13]),
    ("FOR i FROM 4 TO 1 STEP -2 DO\ncut a{i};\nENDFOR\ncut p11;", DATA + ARRAY, [13, 11, 11]),
    (f"FOR i FROM 1 TO Dim(a,1) DO\ncut a{{i}};\nENDFOR\n{move(target(3))}", ARRAY, [10, 11, 12, 13, 3]),
    ("FOR i FROM 1 TO 2 DO\nFOR j FROM 1 TO 2 DO\ncut g{i,j};\nENDFOR\nENDFOR", GRID, [10, 11, 12, 13]),
])
def test_a_loop_hands_over_an_element_each_turn(body: str, data: str, driven: list[int]) -> None:
    """What is corrected is written into the array alone."""
    read = program(body, data=data)
    np.testing.assert_allclose(numbers(read), driven, atol=1e-6)
    looped = [target for target in read.scan.looped if not read.toolpath.block[target]]
    assert looped
    written = moved(read, looped)
    assert f"PROC main()\n{body}\nENDPROC\n{CUT}".encode() in written
    assert b"_c1" not in written


@pytest.mark.parametrize(("body", "data", "driven", "left"), [
    ("FOR i FROM 1 TO 3 DO\nline a{i},a{i+1};\nENDFOR", ARRAY, [10, 11, 11, 12, 12, 13], 4),
    (f"FOR i FROM 1 TO 4 DO\ncut a{{i}};\nENDFOR\n{move('a{2}')}", ARRAY, [10, 11, 12, 13, 11], 1),
    ("FOR i FROM 1 TO 2 DO\ncut a{i};\ncut p11;\nENDFOR", DATA + ARRAY, [10, 11, 11, 11], 2),
    ("FOR i FROM 1 TO 4 DO\ncut a{i};\nENDFOR\nq:=a{1};", f"VAR robtarget q;\n{ARRAY}", [10, 11, 12, 13], 4),
])
def test_an_element_that_something_else_uses_stays(body: str, data: str, driven: list[int], left: int) -> None:
    line = f"PROC line(robtarget b,robtarget c)\n{move('b')}{move('c')}ENDPROC\n"
    read = program(body, CUT + line, data)
    looped = sorted(read.scan.looped)
    np.testing.assert_allclose(numbers(read), driven, atol=1e-6)
    assert sum(bool(read.toolpath.block[target]) for target in looped) == left
    assert any(finding.level == "warning" and finding.code == "CS2059" for finding in read.toolpath.findings)
    free = [target for target in looped if not read.toolpath.block[target]]
    assert body.encode() in moved(read, free) if free else left


@pytest.mark.parametrize("body", [
    "FOR i FROM 1 TO n DO\ncut a{i};\nENDFOR", "FOR i FROM 1 TO 4 DO\nIF i=2 cut a{i};\nENDFOR",
    "FOR n FROM 1 TO 4 DO\ncut a{n};\nENDFOR", "WHILE n<4 DO\ncut a{n};\nENDWHILE"])
def test_other_loops_are_not_followed(body: str) -> None:
    read = program(body, data=f"VAR num n;\n{ARRAY}")
    assert len(read.toolpath) == 1
    assert read.toolpath.block[0]
    assert "CS2056" in {finding.code for finding in read.toolpath.findings}


def two_modules(first: str, second: str, calls: str = "cut p10;\ncut p11;\ncut p10;") -> RapidProgram:
    text = f"MODULE A\n{first}PROC main()\n{calls}\nENDPROC\nENDMODULE\nMODULE B\n{second}ENDMODULE\n"
    return read_rapid(text.encode(), "two.mod")


@pytest.mark.parametrize(("first", "second"), [(DATA, CUT), ("", DATA + CUT)])
def test_calls_of_another_module_are_given_what_both_see(first: str, second: str) -> None:
    """What is declared for the call is seen there, wherever its target stands."""
    read = two_modules(first, second)
    np.testing.assert_allclose(numbers(read), [10, 11, 10], atol=1e-6)
    written = moved(read, [0, 1])
    assert b"\nCONST robtarget p10_c1:=" in written
    assert b"LOCAL" not in written
    assert b"cut p10_c1;\ncut p11_c1;\ncut p10;" in written


@pytest.mark.parametrize(("first", "second"), [
    (DATA.replace("CONST", "LOCAL CONST"), CUT), (DATA, f"LOCAL {CUT}"), (DATA, DATA.replace("CONST", "LOCAL CONST") + CUT)])
def test_what_one_module_alone_sees_is_not_followed_into_another(first: str, second: str) -> None:
    read = two_modules(first, second)
    assert "parameter" in read.toolpath.block[0]


def test_what_is_corrected_is_written_into_the_calls_and_nothing_else_changes() -> None:
    read = program(f"{move('p12')}cut p10;\ncut p11;\ncut p10;\ncut {target(5)};\n{move(target(1))}")
    places = read.toolpath.position + np.outer(np.arange(1, 7), [1e-4, 0, 0])
    which = np.array([1, 2, 3, 4])
    written = rewrite(read, which, places[which], read.toolpath.quaternion[which]).content
    again = read_rapid(written, "handed.mod")
    expected = read.toolpath.position.copy()
    expected[which] = places[which]
    np.testing.assert_allclose(again.toolpath.position, expected, atol=1e-9)
    assert CUT.encode() in written
    assert DATA.encode() in b"".join(line for line in written.splitlines(keepends=True) if b"_c" not in line)
    assert all(move_text(read, target) is None for target in which)

"""Further moves and other zones in the text of a program: what is written where, byte by byte, and where nothing is."""

from __future__ import annotations

import pytest

from compensator.rapid import (
    MoreMoves,
    Pose,
    RapidProgram,
    follows_directly,
    move_text,
    read_rapid,
    with_more_moves,
    with_zones,
)
from tests.compensator.rapid.small_programs import UNUSED, target

CUT = "PROC cut(robtarget p,\\switch slow)\nMoveL p,v100,z1,tool0;\nENDPROC\n"


def pose(x: float) -> Pose:
    return Pose([x, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], None)


def new(x: int, conf: str = "[0,0,0,0]") -> str:
    """As a further target is written: a tenth of a micrometre, eight decimals."""
    return f"[[{x}.0000,0.0000,0.0000],[1.00000000,0.00000000,0.00000000,0.00000000],{conf},{UNUSED}]"


def load(text: str) -> RapidProgram:
    return read_rapid(text.encode(), "p.mod")


def more(text: str, *moves: MoreMoves) -> str:
    return with_more_moves(load(text), moves).decode()


@pytest.mark.parametrize(("name", "tail", "further"), [
    ("MoveL", ",v100,z1,tool0;", ",v100,z1,tool0;"), ("MoveL", ",v100,fine,tool0;", ",v100,z0,tool0;"),
    ("movel", ", v100\\V:=40 , fine\\Inpos:=inpos20 , tool0\\WObj:=wobj0 ;", ", v100\\V:=40 , z0, tool0\\WObj:=wobj0 ;"),
    ("MoveL", ",v100,z10\\Inpos:=inpos20,tool0;", ",v100,z0,tool0;"),
    ("MoveL", ",v100,z1\\Z:=0.5,tool0,\\WObj:=wobj0;", ",v100,z1\\Z:=0.5,tool0,\\WObj:=wobj0;"),
    ("MoveLDO", ",v100,z1,tool0,doX,1;", ",v100,z1,tool0;"),
    ("MoveLDO", ", v100,fine ,tool0\\WObj:=wobj0 , doX,high ;", ", v100,z0,tool0\\WObj:=wobj0 ;"),
])
def test_a_further_move_is_driven_as_its_own_is_but_neither_stops_nor_switches(name: str, tail: str, further: str) -> None:
    """Where the move stops a further one flies by in the smallest zone there is; an output is set by the own alone."""
    start, own = f"PROC p()\n\tMoveL {target(1)},v100,z1,tool0;\n\t", f"{name} {target(4)}{tail} ! here\nENDPROC\n"
    assert more(start + own, MoreMoves(1, linear=[pose(2), pose(3)])) == (
        f"{start}MoveL {new(2)}{further}\n\tMoveL {new(3)}{further}\n\t{own}")


@pytest.mark.parametrize(("before", "gap"), [
    ("", " "), ("\n", "\n"), ("\r", "\r"), ("! a\r\n  ", "\r\n  "), ("! a\r\r\n\t", "\r\r\n\t"), ("! a\r ", "\r "),
    ("VAR num a; ", " "), ("\nVAR num a; ", " ")])
def test_a_further_move_stands_on_a_line_of_its_own_where_its_move_does(before: str, gap: str) -> None:
    own = f"MoveL {target(4)},v100,z1,tool0;"
    text = f"{before}{own}\nMoveL {target(5)},v100,z1,tool0;"
    assert more(text, MoreMoves(0, linear=[pose(2)])) == text.replace(own, f"MoveL {new(2)},v100,z1,tool0;{gap}{own}")


ARC = ("[[10,10,0],[1,0,0,0],[1,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]", "[[20,0,0],[1,0,0,0],[2,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]")


@pytest.mark.parametrize(("tail", "further"), [
    (",v100,z1,tool0;", ",v100,z0,tool0;"), (",v100,z0,tool0;", ",v100,z0,tool0;"), (",v100,fine,tool0;", ",v100,z0,tool0;"),
    (",v100,z5\\Z:=0.3,tool0;", ",v100,z5\\Z:=0.3,tool0;"), (",v100,z5\\Z:=0.31,tool0;", ",v100,z0,tool0;"),
    (",v100,zMine,tool0;", ",v100,z0,tool0;")])
@pytest.mark.parametrize("parts", [1, 2, 3])
def test_an_arc_in_parts_ends_each_where_the_next_begins(tail: str, further: str, parts: int) -> None:
    """Each half in so many: the first half's targets in the circle point's configuration, the second's in the end's. A zone of
    more than 0.3 mm would cut the arc at each joint."""
    start = f"MoveL {target(0)},v100,z1,tool0;\n  "
    one, two = ([pose(k + place) for place in range(2 * parts - 1)] for k in (1, 6))
    first, second = (lambda x: new(x, "[1,0,0,0]")), (lambda x: new(x, "[2,0,0,0]"))
    added = {1: [(first(1), ARC[0])], 2: [(first(1), first(2)), (first(3), ARC[0]), (second(6), second(7))],
             3: [(first(1), first(2)), (first(3), first(4)), (first(5), ARC[0]), (second(6), second(7)), (second(8), second(9))]
             }[parts]
    last = second(4 + 2 * parts)
    assert more(f"{start}MoveC {ARC[0]} , {ARC[1]}{tail}\n", MoreMoves(1, halves=(one, two))) == start + "".join(
        f"MoveC {via},{end}{further}\n  " for via, end in added) + f"MoveC {last} , {ARC[1]}{tail}\n"


def test_a_further_target_of_a_call_is_a_further_call() -> None:
    body = f"cut {target(1)};\n  cut p:={target(4)} \\slow;"
    text = f"PROC main()\n  {body}\nENDPROC\n{CUT}"
    assert more(text, MoreMoves(1, linear=[pose(2), pose(3)])) == text.replace(
        "  cut p:=", f"  cut p:={new(2)} \\slow;\n  cut p:={new(3)} \\slow;\n  cut p:=")


def test_a_further_target_keeps_configuration_and_axes_unless_it_has_its_own() -> None:
    """A number that is 8.9E9 or more, or none, is an axis that is not there; others in all their digits, without exponent."""
    own = "[[4,0,0],[1,0,0,0],[1,-2,3,4],[100.25,9E+09,-8.9E9,8.8E9,1E-05,-7]]"
    text = f"MoveL {own},v100,z1,tool0;"
    kept = "[1,-2,3,4],[100.25,9E9,9E9,8800000000,0.000010000,-7]]"
    assert more(text, MoreMoves(0, linear=[pose(2)])) == f"MoveL {new(2).split(',[0,')[0]},{kept},v100,z1,tool0; {text}"
    other = Pose(pose(2).numbers, [0, 1, -1, 0], [1.5, float("nan"), 9e9, -0.0625, 3.0, 1e-9])
    moved = "[0,1,-1,0],[1.5,9E9,9E9,-0.0625,3,0.000000001]]"
    assert more(text, MoreMoves(0, linear=[other])) == f"MoveL {new(2).split(',[0,')[0]},{moved},v100,z1,tool0; {text}"


@pytest.mark.parametrize(("zone", "radius", "written"), [
    ("z1", 0.5, "z1\\Z:=0.5"), ("z1 \\Z:=3", 0.25, "z1\\Z:=0.25"), ("z1\\Z:=3", 10.0, "z1\\Z:=10"),
    ("zMine", 0.1234, "zMine\\Z:=0.123"), ("Zone:=z50 ", 100.0, "Zone:=z50\\Z:=100"), ("z1\\z:=3 ", 0.0, "z1\\Z:=0")])
@pytest.mark.parametrize(("way", "at"), [(f"MoveL {target(2)}", 1), (f"MoveC {target(5, 5)},{target(2)}", 2)])
def test_a_zone_gets_a_radius_in_micrometres(zone: str, radius: float, written: str, way: str, at: int) -> None:
    """Of a line and of an arc's end, and of no other move."""
    text = f"MoveL {target(1)},v100,z5,tool0;\n{way},v100,{zone},tool0\\WObj:=wobj0; MoveL {target(9)},v100,z5,tool0;"
    read = load(text)
    assert with_zones(read, [at], [radius]).decode() == text.replace(f"v100,{zone},tool0\\", f"v100,{written},tool0\\")


OWN = f"MoveL {target(2)},v100,z1,tool0;"


@pytest.mark.parametrize(("move", "whole"), [
    (OWN, True), (f"MoveC {target(3)},{target(2)},v100,z1,tool0;", True), (f"MOVELDO{target(2)},v100,z1,tool0,doX,1;", True),
    (f"MoveL ToPoint:={target(2)},v100,z1,tool0;", True), (f"MoveC CirPoint := {target(3)},{target(2)},v100,z1,tool0;", True),
    (f"MoveL{' ' * 74}{target(2)},v100,z1,tool0;", True), (f"MoveL{' ' * 76}{target(2)},v100,z1,tool0;", False),
    (f"MoveL ! here\n{target(2)},v100,z1,tool0;", False), (OWN.replace("z1", "z1 ! a; b\n"), False),
    (OWN.replace("MoveL", "MoveJ"), False), (OWN.replace("v100", "v100\\T:=2"), False),
    (OWN.replace("tool0", "tool0\\Corr"), False),
    (OWN.replace("MoveL", "MoveL\\Conc,"), False), (OWN.replace("v100", "\\ID:=10,v100"), False),
    (OWN.replace("tool0", "tool0\\TLoad:=load0"), True),
])
def test_which_move_can_be_repeated(move: str, whole: bool) -> None:
    text = f"MoveL {target(1)},v100,z1,tool0;\n{move}\n{OWN}"
    read = load(text)
    found = move_text(read, 1)
    assert (found is not None, follows_directly(read, 1)) == (whole, whole)
    if found is not None:
        assert text[found.start:found.end] == move
        assert text[found.zone_start:found.zone_end] == "z1"


@pytest.mark.parametrize(("between", "direct"), [
    ("", True), ("\n! a; b\n", True), ("WaitTime 1;", False), ("ENDPROC PROC other()", False)])
def test_further_moves_stand_behind_a_move_alone(between: str, direct: bool) -> None:
    read = load(f"MODULE M\nPROC main()\n{OWN}{between}{OWN}\nENDPROC\nENDMODULE")
    assert [follows_directly(read, k) for k in range(2)] == [False, direct]


@pytest.mark.parametrize(("tail", "own", "flies"), [("v100,z1,tool0", True, True), ("v100,fine,tool0", True, False),
                                                    ("v100,z10\\Inpos:=inpos20,tool0", True, False),
                                                    ("v100,zMine,tool0", True, False)])
def test_a_call_that_stops_is_not_repeated(tail: str, own: bool, flies: bool) -> None:
    """Each of its turns would stop; a move of its own stops at its last target alone."""
    routine = CUT.replace("v100,z1,tool0", tail)
    read = load(f"MODULE M\nPROC main()\ncut {target(1)};\ncut {target(2)};\n{OWN.replace('v100,z1,tool0', tail)}\nENDPROC\n"
                f"{routine}ENDMODULE")
    assert [follows_directly(read, k) for k in range(3)] == [False, flies, own]


def test_moves_calls_loops_and_arcs_of_one_program_all_get_their_further_targets() -> None:
    """Whatever the others are, in whichever order they are asked for."""
    loop = "FOR k FROM 1 TO Dim(pts,1) DO\nMoveL pts{k},v100,z1,tool0;\nENDFOR"
    text = (f"MODULE M\nLOCAL CONST robtarget pts{{2}}:=[{target(5)},{target(6)}];\nPROC main()\n{OWN}\n"
            f"cut {target(3)};\n{OWN}\n{OWN}\nMoveC {ARC[0]},{ARC[1]},v100,z0,tool0;\n{loop}\nENDPROC\n{CUT}ENDMODULE")
    read = load(text)
    assert [follows_directly(read, k) for k in range(8)] == [False, True, True, True, True, False, True, True]
    expected = text.replace(f"cut {target(3)};", f"cut {new(11)};\ncut {target(3)};").replace(
        f"{OWN}\n{OWN}", f"{OWN}\nMoveL {new(12)},v100,z1,tool0;\n{OWN}").replace(
        f"MoveC {ARC[0]}", f"MoveC {new(13, '[1,0,0,0]')},{ARC[0]},v100,z0,tool0;\nMoveC {new(14, '[2,0,0,0]')}").replace(
        f",{target(6)}]", f",{new(15)},{target(6)}]").replace("pts{2}", "pts{3}")
    asked = [MoreMoves(1, linear=[pose(11)]), MoreMoves(7, linear=[pose(15)]), MoreMoves(3, linear=[pose(12)]),
             MoreMoves(4, halves=([pose(13)], [pose(14)]))]
    for order in (asked, asked[::-1]):
        assert more(text, *order) == expected

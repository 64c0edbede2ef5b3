"""Required arguments under their parameters' names: the same moves, and only in the parameters' order."""

import pytest

from compensator.rapid import MoreMoves, Pose, marks_of, read_rapid, with_marks, with_more_moves
from identification.common.findings import CompstiffError
from tests.compensator.rapid.small_programs import load, millimetres, path, program, same, shift, target

DECLARED = f"CONST robtarget p:={target(9)};\nPERS tooldata tMill:=[TRUE,[[0,0,100],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];"
A, B = target(1, 2, 3), target(4, 5, 6)


@pytest.mark.parametrize(("named", "plain"), [
    (f"MoveL {A},v100,z10,tool:=tMill;", f"MoveL {A},v100,z10,tMill;"),
    (f"MoveL {A}, v100, Zone:=fine, Tool:=tool0\\WObj:=wobj0;", f"MoveL {A},v100,fine,tool0\\WObj:=wobj0;"),
    (f"MoveJ ToPoint:={A}, Speed:=v500, Zone:=z50, Tool:=tool0;", f"MoveJ {A},v500,z50,tool0;"),
    ("MoveL\\Conc, ToPoint := p\\ID:=10, Speed:=v5\\V:=20, Zone:=z1\\Z:=3, TOOL:=tMill;",
     "MoveL\\Conc,p\\ID:=10,v5\\V:=20,z1\\Z:=3,tMill;"),
    (f"MoveC CirPoint:={A}, ToPoint:={B}, v100, z1, Tool:=tMill;", f"MoveC {A},{B},v100,z1,tMill;"),
    ("MoveAbsJ ToJointPos:=[[1,2,3,4,5,6],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,z1,tool:=tool0;",
     "MoveAbsJ [[1,2,3,4,5,6],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,z1,tool0;"),
    (f"MoveLDO {A},v100,z1,tool:=tMill,Signal:=do1,Value:=1;", f"MoveLDO {A},v100,z1,tMill,do1,1;"),
    ("MoveL Offs(Point:=p,XOffset:=1,YOffset:=2,ZOffset:=3),v100,z1,tool0;", "MoveL Offs(p,1,2,3),v100,z1,tool0;"),
    ("MoveL RelTool(p,Dx:=1,Dy:=2,Dz:=3\\Rz:=90),v100,z1,tool0;", "MoveL RelTool(p,1,2,3\\Rz:=90),v100,z1,tool0;"),
])
def test_named_arguments_mean_what_the_plain_ones_mean(named, plain):
    same(path(named, DECLARED), path(plain, DECLARED))


@pytest.mark.parametrize("value", ["n DIV 3", "n mod 4 + 93", "a AND b", "NOT a OR b XOR c", "2*(n DIV 1)"])
def test_operators_that_are_words_stand_in_arguments(value):
    """RAPID has DIV, MOD, AND, OR, XOR and NOT beside the marks: the statement is read, and what follows is as ever."""
    same(path(f"MoveL {A},v100\\V:={value},z1,tool0;\nMoveL {B},v100,z1,tool0;"),
         path(f"MoveL {A},v100\\V:=Abs(100),z1,tool0;\nMoveL {B},v100,z1,tool0;"))


@pytest.mark.parametrize(("body", "column", "says"), [
    (f"MoveL {A},v100,tool:=tool0,z1;", 7 + len(A) + 6, "found 'tool', expected 'zone:=' or the value alone"),
    (f"MoveL Target:={A},v100,z1,tool0;", 7, "expected 'topoint:='"),
    (f"MoveC ToPoint:={A},{B},v100,z1,tool0;", 7, "expected 'cirpoint:='"),
    (f"MoveL {A},v100,z1,tool:=;", 7 + len(A) + 15, "found ';', expected a value"),
    (f"MoveL Offs({A},YOffset:=1,2,3),v1,z1,tool0;", 12 + len(A) + 1, "expected 'xoffset:='"),
])
def test_another_name_or_order_is_an_error(body, column, says):
    with pytest.raises(CompstiffError, match="CS2003") as caught:
        path(body)
    finding = caught.value.findings[0]
    assert says in finding.message
    assert (finding.line, finding.column) == (4, column)


def test_names_stay_where_they_are_when_a_target_is_corrected():
    text = program(f"MoveL ToPoint:={A},Speed:=v100,Zone:=z1,tool:=tMill;", DECLARED)
    written = shift(text, [0], [[0.5, 0, 0]]).content.decode()
    assert written == text.replace("[[1,2,3]", "[[1.5000,2,3]")
    through_offs = program(f"MoveL ToPoint:=Offs(Point:={A},XOffset:=1,0,0),v100,z1,tool0;")
    written = shift(through_offs, [0], [[0.5, 0, 0]]).content.decode()
    assert "MoveL ToPoint:=[[2.5" in written
    assert millimetres(read_rapid(written.encode(), "again.mod").toolpath) == [[2.5, 2, 3]]


def test_moves_with_names_can_be_repeated_and_marked():
    moves = load(f"MoveL {A},v100,z1,tMill;\n  MoveL ToPoint:={B},Speed:=v100,Zone:=z1,Tool:=tMill;", DECLARED)
    more = with_more_moves(moves, [MoreMoves(1, (Pose([2.0, 3.0, 4.0, 1.0, 0.0, 0.0, 0.0], None),))])
    assert millimetres(read_rapid(more, "more.mod").toolpath) == [[1, 2, 3], [2, 3, 4], [4, 5, 6]]
    far = load(f"MoveL {A},v100,z1,tMill;\nMoveL ToPoint:={target(99)},Speed:=v100,Zone:=z1,Tool:=tMill;", DECLARED)
    content, _ = with_marks(far, "doMark")
    marks = marks_of(read_rapid(content, "marked.mod"))
    assert marks is not None
    assert marks.target.tolist() == [0, 1]


def test_a_variable_handed_over_by_name_may_be_changed_by_its_routine():
    routine = "PROC move_on(INOUT robtarget where)\nwhere.trans.x:=where.trans.x+1;\nENDPROC"
    declared = f"VAR robtarget q:={A};\n{routine}"
    assert path("move_on where:=q;\nMoveL q,v100,z1,tool0;", declared).block[0]
    assert not path("move_on where:=other;\nMoveL q,v100,z1,tool0;", declared).block[0]

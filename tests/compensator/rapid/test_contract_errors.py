"""Malformed moves are errors that say where, what was found and what was expected."""

import pytest

from compensator.rapid import read_rapid
from identification.common.findings import CompstiffError
from tests.compensator.rapid.small_programs import UNUSED, program, target

GOOD = target(1)


@pytest.mark.parametrize(("body", "code", "column", "message"), [
    ("MoveL [[1,2,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9],v1,z1,tool0;", "CS2003", 73,
     "found ';', expected ',' or ']'"),
    (f"MoveL [[1,2],[1,0,0,0],[0,0,0,0],{UNUSED}],v1,z1,tool0;", "CS2004", 8,
     "position has 2 components, expected 3: [x, y, z]"),
    (f"MoveL [[1,2,3],[1,0,0],[0,0,0,0],{UNUSED}],v1,z1,tool0;", "CS2004", 16, "orientation has 3 components, expected 4"),
    (f"MoveL [[1,2,3],[1,0,0,0],[0,0,0],{UNUSED}],v1,z1,tool0;", "CS2004", 26, "confdata has 3 components, expected 4"),
    ("MoveL [[1,2,3],[1,0,0,0],[0,0,0,0],[9E9]],v1,z1,tool0;", "CS2004", 36, "external axes has 1 components, expected 6"),
    ("MoveL [[1,2,3],[1,0,0,0],[0,0,0,0]],v1,z1,tool0;", "CS2004", 7, "robtarget has 3 components, expected 4"),
    (f"MoveL [[1,2,3],[1,0,0,0],[0,0,0,0],{UNUSED},5],v1,z1,tool0;", "CS2004", 7, "robtarget has 5 components, expected 4"),
    (f'MoveL [[1,"2",3],[1,0,0,0],[0,0,0,0],{UNUSED}],v1,z1,tool0;', "CS2005", 11,
     'found "2", expected a number: y of position'),
    (f"MoveL [[1,[2],3],[1,0,0,0],[0,0,0,0],{UNUSED}],v1,z1,tool0;", "CS2005", 11, "expected a number: y of position"),
    (f"MoveL [[1,2 3,3],[1,0,0,0],[0,0,0,0],{UNUSED}],v1,z1,tool0;", "CS2003", 13, "found '3', expected ',' or ']'"),
    (f"MoveL [[1,,3],[1,0,0,0],[0,0,0,0],{UNUSED}],v1,z1,tool0;", "CS2003", 11, "found ',', expected a value"),
    (f"MoveL [[1,--2,3],[1,0,0,0],[0,0,0,0],{UNUSED}],v1,z1,tool0;", "", 0, ""),
    (f"MoveL [[1,2.3.4,3],[1,0,0,0],[0,0,0,0],{UNUSED}],v1,z1,tool0;", "CS2003", 14, "expected ',' or ']'"),
    (f"MoveL [[1,1E999,3],[1,0,0,0],[0,0,0,0],{UNUSED}],v1,z1,tool0;", "CS2005", 7, "out of range"),
    (f"MoveL [[1,2,3],[1,0,0,0],[1E30,0,0,0],{UNUSED}],v1,z1,tool0;", "CS2005", 7, "out of range"),
    ("MoveL 5,v1,z1,tool0;", "CS2005", 7, "found 5, expected robtarget"),
    (f"MoveL {GOOD},v1,z1;", "CS2003", 7 + len(GOOD) + 1, "expected 3: speed, zone, tool"),
    ("MoveL p,v1,tool0;", "CS2003", 9, "found 2 arguments behind the target, expected 3: speed, zone, tool"),
    (f"MoveL\\Conc,{GOOD},z1,tool0;", "CS2003", 6, "MoveL has 3 arguments, expected 4: target, speed, zone, tool"),
    (f"MoveC {GOOD},v1,z1,tool0;", "CS2003", 7, "MoveC has 4 arguments, expected 5"),
    (f"MoveAbsJ [[0,0,0,0,0],{UNUSED}],v1,z1,tool0;", "CS2004", 11, "robot axes has 5 components, expected 6"),
    (f"MoveL {GOOD} v1,z1,tool0;", "CS2003", 7 + len(GOOD) + 1, "found 'v1', expected ',' or ';'"),
    (f"MoveL {GOOD},v1,z1,tool0,;", "CS2003", 7 + len(GOOD) + 13, "found ';', expected a value"),
    (f"MoveL {GOOD},v1,z1,tool0\\;", "CS2003", 7 + len(GOOD) + 13, "found ';', expected the name of an optional argument"),
    (f"MoveL {GOOD},v1,z1,tool0", "CS2002", 1, "the statement that begins here does not end, expected ';'"),
    (f"MoveL {GOOD},v1,z1,tool0\n MoveL {GOOD},v1,z1,tool0;", "CS2003", 2, "found 'MoveL', expected ',' or ';'"),
    ('MoveL p,v1,z1,"tool;', "CS2002", 15, "string that begins here does not end"),
    (f"Set do1\nMoveL {GOOD},v1,z1,tool0;", "CS2002", 1, "statement before 'MoveL' does not end, expected ';'"),
    (f"MoveL Offs({GOOD},1,2),v1,z1,tool0;", "CS2004", 7, "Offs has 3 arguments, expected 4: target, x, y, z"),
    (f"MoveL {GOOD},[1,2,3],z1,tool0;", "CS2004", 7 + len(GOOD) + 1, "speeddata has 3 components, expected 4"),
    (f"MoveL {GOOD},v1,[5,1,1,1,1,1,1],tool0;", "CS2005", 7 + len(GOOD) + 5, "expected TRUE or FALSE"),
])
def test_malformed_moves(body, code, column, message):
    text = program("  ! first\n" + body)
    if not code:
        assert read_rapid(text.encode(), "bad.mod").toolpath.block[0]       # --2 is an expression
        return
    with pytest.raises(CompstiffError) as caught:
        read_rapid(text.encode(), "bad.mod")
    finding, = caught.value.findings
    assert message in finding.message
    assert (finding.code, finding.level, finding.file) == (code, "error", "bad.mod")
    if column:
        assert (finding.line, finding.column) == (5 + body[:body.rindex("Move")].count("\n"), column)
    assert caught.value.exit_code == 1


@pytest.mark.parametrize(("declaration", "code", "line"), [
    ("CONST robtarget p:=[[1,2,3],[1,0,0,0],[0,0,0,0]];", "CS2004", 2),
    ('CONST robtarget p:=[[1,2,"x"],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];', "CS2005", 2),
    ("CONST robtarget p:=[[1,2,1-],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];", "CS2003", 2),
    ("PERS tooldata t:=[TRUE,[[0,0,1],[1,0,0,0]]];\nCONST robtarget p:=" + GOOD + ";", "CS2004", 2),
])
def test_malformed_data_that_a_move_uses(declaration, code, line):
    with pytest.raises(CompstiffError) as caught:
        read_rapid(program("MoveL p,v1,z1,t;", declaration).encode(), "bad.mod")
    assert (caught.value.findings[0].code, caught.value.findings[0].line) == (code, line)


def test_a_program_cut_off_in_a_move():
    with pytest.raises(CompstiffError, match=r"bad.mod:3:1: error CS2002: the statement that begins here does not end"):
        read_rapid(b"PROC a()\nSet do1;\nMoveL [[1,2,3],[1,0,0", "bad.mod")


def test_hostile_nesting():
    with pytest.raises(CompstiffError, match="nested"):
        read_rapid(b"MoveL " + b"[" * 100_000 + b";", "bad.mod")
    with pytest.raises(CompstiffError, match="nested"):
        read_rapid(b"MoveL " + b"-" * 100_000 + b";", "bad.mod")


@pytest.mark.parametrize(("text", "line", "message"), [
    ("! cut\nMODULE Part\nPROC main()\nMoveL *,v1,z1,tool0;\nENDPROC\n", 2, "'MODULE Part' begins here and has no ENDMODULE"),
    ("MODULE Part\nPROC main()\nMoveL *,v1,z1,tool0;\n", 1, "has no ENDMODULE"),
    ("MODULE Part\nPROC main()\nMoveL *,v1,z1,tool0;\nENDMODULE\n", 2, "'PROC main()' begins here and has no ENDPROC"),
    ("MODULE Part\nPROC a()\nPROC main()\nENDPROC\nENDMODULE\n", 2, "'PROC a()' begins here and has no ENDPROC"),
    ("MODULE A\nENDMODULE\nMODULE B\nMODULE C\nENDMODULE\n", 3, "'MODULE B' begins here and has no ENDMODULE"),
    ("MODULE Part\n! ENDMODULE\n", 1, "has no ENDMODULE"),
    ("MODULE Part\nCONST string a:=\"ENDMODULE\";\n", 1, "has no ENDMODULE"),
])
def test_a_module_that_does_not_end_is_not_read(text: str, line: int, message: str) -> None:
    with pytest.raises(CompstiffError) as stopped:
        read_rapid(text.encode(), "part.mod")
    (finding,) = stopped.value.findings
    assert (finding.code, finding.line) == ("CS2050", line)
    assert message in finding.message


@pytest.mark.parametrize("text", [
    "PROC main()\nMoveL *,v1,z1,tool0;\n", "MODULE m ENDMODULE\x1a",
    "MODULE m\nFUNC num f()\nRETURN 1;\nENDFUNC\nENDMODULE rest",
])
def test_what_has_its_end_or_no_module_is_read(text: str) -> None:
    read_rapid(text.encode(), "part.mod")

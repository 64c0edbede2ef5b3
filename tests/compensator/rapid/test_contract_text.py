"""Encodings, line ends, comments, strings: where the text is what it seems, and where a place in it is."""

import codecs

import pytest

from compensator.rapid import read_rapid, rewrite
from identification.common.findings import CompstiffError
from tests.compensator.rapid.small_programs import found, millimetres, program, target

ENDS = {"LF": "\n", "CRLF": "\r\n", "CR CR LF": "\r\r\n", "CR": "\r"}
TEXT = program(f'! Fräser "größe"; MoveL\nTPWrite "Größe: ü; ! ""x""";\n  MoveL {target(1)},v100,z1,Fräser;'
               f'  MoveJ {target(2)},v100,z1,FRÄSER;\nMoveL pü,v100,z1,tool0;', f"CONST robtarget pü:={target(3)};")


def read(data: bytes):
    return read_rapid(data, "x.mod").toolpath


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1"])
@pytest.mark.parametrize("end", ENDS)
def test_encodings_and_line_ends(encoding, end):
    data = TEXT.replace("\n", ENDS[end]).encode(encoding)
    toolpath = read(data)
    assert millimetres(toolpath) == [[1, 0, 0], [2, 0, 0], [3, 0, 0]]
    assert toolpath.line.tolist() == [6, 6, 7]
    move = TEXT.splitlines()[5]
    assert toolpath.column.tolist() == [9, move.index("MoveJ") + 7, 7]
    assert toolpath.tool.tolist() == [0, 0, 1]
    assert toolpath.tools[0].name == "Fräser"
    assert rewrite(read_rapid(data), [], [], []).content == data


def test_mixed_line_ends_in_one_file():
    data = f"MODULE m\r\nPROC a()\rMoveL {target(1)},v5,fine,tool0;\r\r\n\r\nMoveL {target(2)},v5,fine,tool0;\nMoveL *".encode()
    data += b",v5,z1,tool0;\r\rMoveL *,v5,z1,tool0;ENDPROC\rENDMODULE"
    assert read(data).line.tolist() == [3, 5, 6, 8]


@pytest.mark.parametrize("end", ENDS)
def test_a_comment_ends_with_its_line(end):
    text = f"! MoveL {target(1)},v5,fine,tool0; \"{ENDS[end]}MoveL {target(2)},v5,fine,tool0;! MoveJ *,v5,z1,tool0;"
    assert millimetres(read(text.encode())) == [[2, 0, 0]]


def test_moves_in_strings_are_text():
    text = f'TPWrite "MoveL {target(1)},v5,fine,tool0;";s:="a"";MoveL x""";MoveL {target(2)},v5,fine,tool0;t:="!";'
    assert millimetres(read(text.encode())) == [[2, 0, 0]]


def test_the_first_column_is_behind_the_byte_order_mark():
    toolpath = read(codecs.BOM_UTF8 + f"MoveL {target(1)},v5,fine,tool0;".encode())
    assert (toolpath.line.tolist(), toolpath.column.tolist()) == ([1], [7])


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-be"])
def test_utf16_is_refused(encoding):
    data = TEXT.encode(encoding)
    with pytest.raises(CompstiffError, match=r"x\.mod:1:1: error CS2001: .*UTF-16"):
        read(codecs.BOM_UTF16_BE + data if encoding.endswith("be") else data)


def test_header_placeholders_and_attributes():
    text = f"""%%%
  VERSION:1
  LANGUAGE:ENGLISH
%%%

MODULE Part(SYSMODULE, NOSTEPIN)
  LOCAL RECORD pair
    robtarget p10;
    num n;
  ENDRECORD
  ALIAS num level;
  CONST robtarget p10:={target(1)};
  <DDN>
  LOCAL PROC main ( ) ! comment
    <SMT>
    MoveL p10,v100,z1,tool0;
    MoveL <EXP>,v100,z1,tool0;
  ENDPROC
  <RDN>
ENDMODULE
"""
    toolpath = read(text.encode())
    assert millimetres(toolpath)[0] == [1, 0, 0]
    assert toolpath.line.tolist() == [16, 17]


def test_a_very_long_line():
    body = "".join(f"MoveL {target(i)},v100,z1,tool0; " for i in range(400))
    toolpath = read(program(body).encode())
    assert len(body) > 20_000
    assert len(toolpath) == 400
    assert set(toolpath.line.tolist()) == {4}
    assert toolpath.column[-1] == body.rindex("[[") + 1


@pytest.mark.parametrize("data", [
    b"", b"\n\n", b"! only a comment", b"%%%\nVERSION:1\n%%%", b"MODULE m ENDMODULE\x1a",
    b'MODULE BASE(SYSMODULE, NOSTEPIN, VIEWONLY)\r\n  PERS tooldata tool0:=[TRUE,[[0,0,0],[1,0,0,0]],[0.001,[0,0,0.001],'
    b'[1,0,0,0],0,0,0]];\r\n  PERS wobjdata wobj0:=[FALSE,TRUE,"",[[0,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];\r\nENDMODULE\r\n',
])
def test_files_without_a_move(data):
    toolpath = read(data)
    assert len(toolpath) == 0
    assert toolpath.findings == ()


def test_text_that_is_no_rapid_is_reported():
    toolpath = read(b'<?xml version="1.0"?>\n<Program>\n</Program>\n')
    assert len(toolpath) == 0
    finding, = found(toolpath, "CS2030")
    assert (finding.line, finding.column) == (1, 1)


@pytest.mark.parametrize(("behind", "line"), [("", None), ("\x1a", None), ("! a comment\n", None), ("by the operator\n", 6)])
def test_text_behind_a_module_is_reported_and_its_moves_are_read(behind, line):
    toolpath = read(f"MODULE m\nPROC main()\nMoveL {target(1)},v50,z1,tool0;\nENDPROC\nENDMODULE\n{behind}".encode())
    assert millimetres(toolpath) == [[1, 0, 0]]
    assert [(one.code, one.level, one.line) for one in toolpath.findings] == ([("CS2030", "warning", line)] if line else [])


def test_statements_over_several_lines_with_comments():
    text = program("MoveL\n [ [ 1 , ! x\n 2,3],\n[1,0,0,0] ! turn [9,9]\n,[0,0,0,0],[9E9,9E9,9E9,\n9E9,9E9,9E9]],\n"
                   " v100 ! speed;\n,z1,\ntool0;")
    toolpath = read(text.encode())
    assert millimetres(toolpath) == [[1, 2, 3]]
    assert (toolpath.line[0], toolpath.column[0]) == (5, 2)

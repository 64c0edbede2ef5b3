"""Writing: only the numbers of corrected targets change."""

import numpy as np
import pytest

from compensator.rapid import read_rapid, rewrite
from tests.compensator.rapid.small_programs import UNUSED, found, millimetres, program, same, shift, target

MOVE = "v100,z1,tool0;"
TENTH = [0.1, 0.2, 0.3]


def changed(before: str, after: bytes) -> list[str]:
    """The lines of `after` that are not in `before`."""
    old = before.splitlines()
    return [line for line in after.decode().splitlines() if line not in old]


def test_no_targets_gives_the_same_bytes():
    data = program(f"MoveL p,{MOVE}", f"CONST robtarget p:={target(1)};").encode()
    written = rewrite(read_rapid(data), [], np.empty((0, 3)), np.empty((0, 4)))
    assert written.content == data
    assert (written.findings, written.numbers, written.declarations) == ((), 0, 0)


def test_inline_numbers_are_replaced_and_their_surroundings_kept():
    text = "MoveL [ [10.5, -3 ,\t.25],[1,0, 0,0 ],[0,-1,0,0],[9E9,9E+09,9E9,9E9,9E9,9E9] ] , v100,z1,tool0; ! keep 10.5\r\n"
    written = shift(text, [0], [TENTH])
    wanted = text.replace("10.5,", "10.6000,", 1).replace("-3 ", "-2.8000 ").replace(".25]", "0.5500]")
    assert written.content.decode() == wanted
    assert (written.numbers, written.declarations, written.findings) == (3, 0, ())


@pytest.mark.parametrize(("old", "by", "new"), [
    ("100", 0.00004, "100"), ("100", 0.00006, "100.0001"), ("0", -0.00004, "0"), ("0.5", -0.50002, "0.0000"),
    ("12.345678", 0.1, "12.445678"), ("1.5E2", 0.1, "150.1000"), ("-1.2E-05", 1, "0.999988"), ("+3", 1, "4.0000"),
    ("-0", 1, "1.0000"), ("1e-20", 0.25, "0.250000000000000"), ("5.", 0.1, "5.1000"), ("- 5", 0.1, "-4.9000"),
    ("99999.9999", 0.0001, "100000.0000"), ("- 5", 0, "- 5"),
])
def test_spelling_of_a_coordinate(old, by, new):
    text = f"MoveL [[{old},2,3],[1,0,0,0],[0,0,0,0],{UNUSED}],{MOVE}"
    assert shift(text, [0], [[by, 0, 0]]).content.decode() == text.replace(old, new, 1)


def test_a_quaternion_has_eight_decimals_and_keeps_its_sign():
    text = f"MoveL {target(1, q='[0,-0.70711,0.7071067812345,0]')},{MOVE}"
    read = read_rapid(text.encode())
    wanted = np.array([[0.0, -0.6, 0.8, 0.0]])
    for sign in (1, -1):
        written = rewrite(read, [0], read.toolpath.position, sign * wanted).content.decode()
        assert written == text.replace("[0,-0.70711,0.7071067812345,0]", "[0,-0.60000000,0.8000000000000,0]")


def test_confdata_changes_only_where_it_differs():
    text = f"MoveL {target(1, conf='[ 0,-1, 2,4]')},{MOVE}MoveL {target(2)},{MOVE}"
    written = shift(text, [0, 1], [TENTH] * 2, confdata=[[0, -2, 2, 4], [0, 0, 0, 0]])
    assert b"[ 0,-2, 2,4]" in written.content
    assert written.numbers == 3 + 1 + 3
    finding, = written.findings
    assert (finding.code, finding.level, finding.target, finding.count) == ("CS2042", "warning", 0, 1)


def test_a_named_target_that_is_always_corrected_alike_changes_in_place():
    for kind in ("CONST", "PERS", "LOCAL VAR"):
        text = program(f"MoveL p,{MOVE}\nMoveJ P,{MOVE}", f"{kind} robtarget p := {target(1, 2, 3)}; ! mine")
        written = shift(text, [0, 1], [TENTH] * 2)
        assert changed(text, written.content) == [
            f"{kind} robtarget p := [[1.1000,2.2000,3.3000],[1,0,0,0],[0,0,0,0],{UNUSED}]; ! mine"]
        assert (written.numbers, written.declarations) == (3, 0)


def test_several_corrections_of_one_target():
    text = program(f"MoveL p10,{MOVE}\nMoveL p10,{MOVE}\nMoveL P10,{MOVE}\nMoveC p10,p10,{MOVE}",
                   f"  CONST robtarget p10:={target(1)}; ! first\n  CONST num n:=1;")
    written = shift(text, [0, 1, 2, 4], [[1, 0, 0], [2, 0, 0], [1, 0, 0], [2, 0, 0]])
    assert written.content.decode() == program(
        f"MoveL p10_c1,{MOVE}\nMoveL p10_c2,{MOVE}\nMoveL p10_c1,{MOVE}\nMoveC p10,p10_c2,{MOVE}",
        f"  CONST robtarget p10:={target(1)}; ! first\n  LOCAL CONST robtarget p10_c1:={target('2.0000')};\n"
        f"  LOCAL CONST robtarget p10_c2:={target('3.0000')};\n  CONST num n:=1;")
    assert written.declarations == 2
    finding, = written.findings
    assert (finding.code, finding.level, finding.count) == ("CS2041", "note", 4)


@pytest.mark.parametrize("corrected", [[0, 1, 2, 3, 4], [4, 2, 0], [1, 2, 3]])
def test_what_stands_between_corrected_moves_stays(corrected):
    """However many follow one another, in whichever order they are given."""
    lines = [f"  MoveL {target(x)},{MOVE} ! {x}" for x in (10, 20, 30, 40, 50)]
    written = shift(program("\n".join(lines)), corrected, [[k + 1, 0, 0] for k in corrected])
    wanted = [line.replace(f"[[{10 * (k + 1)},", f"[[{11 * (k + 1)}.0000,") if k in corrected else line
              for k, line in enumerate(lines)]
    assert written.content.decode() == program("\n".join(wanted))
    assert written.numbers == len(corrected)


def test_equal_corrections_to_the_written_digits_are_one():
    text = program(f"MoveL p,{MOVE}MoveL p,{MOVE}", f"CONST robtarget p:={target(1)};")
    written = shift(text, [0, 1], [[0.1, 0, 0], [0.10001, 0, 0]])
    assert (written.declarations, written.numbers) == (0, 1)


def test_a_correction_that_does_not_show_changes_nothing():
    text = program(f"MoveL p,{MOVE}MoveL p,{MOVE}MoveL {target(3)},{MOVE}", f"CONST robtarget p:={target(1)};").encode()
    assert shift(text, [0, 2], [[0.00001, 0, 0]] * 2).content == text


@pytest.mark.parametrize("use", [
    f"MoveL p,{MOVE}", "TriggL p,v100,gun,z1,tool0;", "q:=p;", "x:=p.trans.x;", "cut p;", "d:=Distance(p.trans,q.trans);",
    f"MoveL Offs(p,0,0,5),{MOVE}", "IF p.trans.x > 5 Stop;", "MoveL q,v100\\V:=p.trans.x,z1,tool0;",
])
def test_a_target_used_elsewhere_keeps_its_declaration(use):
    text = program(f"MoveL p,{MOVE}\n{use}", f"CONST robtarget p:={target(1)};\nCONST robtarget q:={target(5)};")
    written = shift(text, [0], [TENTH])
    assert changed(text, written.content) == [
        f"LOCAL CONST robtarget p_c1:=[[1.1000,0.2000,0.3000],[1,0,0,0],[0,0,0,0],{UNUSED}];", f"MoveL p_c1,{MOVE}"]


@pytest.mark.parametrize("spelled", ["p{1,n}", "p{m,2}", "p{m,n}", "p{m+0,2}", "p{1,2}"])
@pytest.mark.parametrize("corrected", [[0], [0, 1], [1, 2]])
def test_an_element_is_corrected_where_it_is_named_and_nowhere_else(spelled, corrected):
    """In whichever way its indices are written: another move to it, and its neighbours, stay where they are."""
    text = program(f"MoveL {spelled},{MOVE}\nMoveL p{{1,2}},{MOVE}\nMoveL p{{2,2}},{MOVE}\nMoveL p{{1,1}},{MOVE}",
                   "CONST num n:=2;\nCONST num m:=1;\nPERS robtarget p{2,2}:="
                   f"[[{target(1)},{target(2)}],[{target(3)},{target(4)}]];")
    wanted = [2.0, 2.0, 4.0, 1.0]
    for k in corrected:
        wanted[k] += 0.1 * (k + 1)
    written = shift(text, corrected, [[0.1 * (k + 1), 0, 0] for k in corrected])
    assert millimetres(read_rapid(written.content).toolpath) == [[x, 0, 0] for x in wanted]


def test_declarations_stand_in_the_order_of_the_moves_that_need_them():
    """The tenth behind the ninth."""
    text = program("\n".join([f"MoveL p,{MOVE}"] * 11), f"CONST robtarget p:={target(1)};")
    written = shift(text, list(range(11)), [[k + 1, 0, 0] for k in range(11)])
    assert changed(text, written.content) == [
        *(f"LOCAL CONST robtarget p_c{k}:={target(f'{k + 1}.0000')};" for k in range(1, 12)),
        *(f"MoveL p_c{k},{MOVE}" for k in range(1, 12))]
    assert (written.numbers, written.declarations) == (11, 11)


def test_a_name_that_only_looks_alike_is_no_use():
    text = program(f"MoveL p,{MOVE}\nx:=q.p;\nTPWrite \"p\"; ! p", f"CONST robtarget p:={target(1)};\n"
                   f"PROC other()\nVAR num p:=3;\np:=p+1;\nENDPROC")
    assert shift(text, [0], [TENTH]).declarations == 0


def test_routine_data_gets_its_declaration_in_the_routine():
    text = f"PROC a()\n\tVAR robtarget p:={target(1)};\n\tMoveL p,{MOVE}\n\tMoveL p,{MOVE}\nENDPROC\n"
    assert changed(text, shift(text, [0], [TENTH]).content) == [
        f"\tCONST robtarget p_c1:=[[1.1000,0.2000,0.3000],[1,0,0,0],[0,0,0,0],{UNUSED}];", f"\tMoveL p_c1,{MOVE}"]


def test_a_target_used_from_another_module_is_not_made_local():
    text = program(f"MoveL p,{MOVE}MoveL p,{MOVE}") + program("", f"CONST robtarget p:={target(1)};").replace("main", "other")
    written = shift(text, [1], [TENTH])
    assert b"\nCONST robtarget p_c1:=" in written.content
    assert millimetres(read_rapid(written.content).toolpath) == [[1, 0, 0], [1.1, 0.2, 0.3]]


def test_new_names_are_unique_and_short():
    long = "a_name_of_exactly_32_characters_"
    assert len(long) == 32
    text = program(f"MoveL {long},{MOVE}\nMoveL {long},{MOVE}\n"
                   "A_NAME_OF_EXACTLY_32_CHARACTE_C1;! A_name_of_exactly_32_characte_c2",
                   f"CONST robtarget {long}:={target(1)};")
    written = shift(text, [0], [TENTH])
    assert b"MoveL a_name_of_exactly_32_characte_c3," in written.content


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r", "\r\r\n"])
@pytest.mark.parametrize("encoding", ["utf-8-sig", "latin-1"])
def test_added_declarations_have_the_line_end_and_encoding_of_the_file(end, encoding):
    text = program(f"MoveL größe,{MOVE}\nMoveL größe,{MOVE}", f"\t CONST robtarget größe:={target(1)};").replace("\n", end)
    written = shift(text.encode(encoding), [1], [TENTH]).content
    new = f"\t LOCAL CONST robtarget größe_c1:=[[1.1000,0.2000,0.3000],[1,0,0,0],[0,0,0,0],{UNUSED}];{end}PROC"
    assert new.encode("utf-8" if encoding == "utf-8-sig" else encoding) in written
    assert written.startswith(b"\xef\xbb\xbf") == (encoding == "utf-8-sig")
    text_back = written.decode(encoding).replace(end, "")
    assert "\r" not in text_back
    assert "\n" not in text_back


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r", "\r\r\n"])
@pytest.mark.parametrize("before", ["", "! a line\n", "! a line\r\n\r\n"])
def test_behind_the_last_line_without_an_end_stands_that_of_the_line_before(end, before):
    text = f"{before}MoveL p,{MOVE} MoveL p,{MOVE}{end} CONST robtarget p:={target(1)};"
    assert shift(text, [1], [[1, 0, 0]]).content.decode() == text.replace("MoveL p,", "MoveL p_c1,").replace(
        "MoveL p_c1,", "MoveL p,", 1) + f"{end} LOCAL CONST robtarget p_c1:={target('2.0000')};"


def test_a_declaration_in_the_middle_of_a_line():
    text = f"PROC a()\nCONST robtarget p:={target(1)}; MoveL p,{MOVE} MoveL p,{MOVE}\nENDPROC"
    assert shift(text, [1], [TENTH]).content.decode() == (
        f"PROC a()\nCONST robtarget p:={target(1)}; CONST robtarget p_c1:={target('1.1000', '0.2000', '0.3000')}; "
        f"MoveL p,{MOVE} MoveL p_c1,{MOVE}\nENDPROC")


def test_a_declaration_at_the_very_end():
    text = f"PROC a()\r\nMoveL p,{MOVE}MoveL p,{MOVE}\r\nENDPROC\r\nCONST robtarget p:={target(1)};"
    assert shift(text, [1], [TENTH]).content.endswith(
        f"{target(1)};\r\nLOCAL CONST robtarget p_c1:={target('1.1000', '0.2000', '0.3000')};".encode())


def test_array_elements():
    declarations = f"CONST robtarget pts{{3}}:=[{target(1)},\n {target(2)}, ! two\n {target(3)}];"
    text = program(f"MoveL pts{{1}},{MOVE}\nMoveL pts{{2}},{MOVE}\n"
                   f"MoveL pts{{ 3 }},{MOVE}\nMoveL pts{{3}},{MOVE}", declarations)
    written = shift(text, [1, 2], [TENTH, [1, 0, 0]])
    assert changed(text, written.content) == [
        " [[2.1000,0.2000,0.3000],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]], ! two",
        f"LOCAL CONST robtarget pts_c1:={target('4.0000')};", f"MoveL pts_c1,{MOVE}"]


def test_elements_by_a_constant_get_declarations_of_their_own():
    text = program(f"MoveL pts{{n}},{MOVE}\nMoveL pts{{2}},{MOVE}\nMoveL pts{{N}},{MOVE}",
                   f"CONST num n:=2;CONST robtarget pts{{2}}:=[{target(1)},{target(2)}];")
    written = shift(text, [0, 1, 2], [TENTH, TENTH, [1, 0, 0]])
    assert written.content.decode().count(f"pts{{2}}:=[{target(1)},{target(2)}];") == 1
    assert millimetres(read_rapid(written.content).toolpath) == [[2.1, 0.2, 0.3]] * 2 + [[3, 0, 0]]


def test_an_array_with_a_variable_index_somewhere_keeps_its_declaration():
    text = program(f"MoveL pts{{1}},{MOVE}\nMoveL pts{{i}},{MOVE}", f"CONST robtarget pts{{1}}:=[{target(1)}];")
    assert changed(text, shift(text, [0], [TENTH]).content)[1] == f"MoveL pts_c1,{MOVE}"


def test_offs_and_reltool_become_targets_in_numbers():
    base = "[[10,20,30],[0,1,0,0],[1,-1,0,4],[100.25,9E+09,9E9,-5,9E9,0.00001]]"
    text = program(f"MoveL Offs(p,0,0,5) ,{MOVE}\nMoveC RelTool(p,0,0,5\\Rz:=90),p,{MOVE}\nMoveL Offs(p,1,1,1),{MOVE}",
                   f"CONST robtarget p:={base};")
    written = shift(text, [0, 1], [TENTH, [0, 0, 0]])
    rest = "[1,-1,0,4],[100.25,9E9,9E9,-5,9E9,0.000010000]]"
    assert changed(text, written.content) == [
        f"MoveL [[10.1000,20.2000,35.3000],[0.00000000,1.00000000,0.00000000,0.00000000],{rest} ,{MOVE}",
        f"MoveC [[10.0000,20.0000,25.0000],[0.00000000,0.70710678,-0.70710678,0.00000000],{rest},p,{MOVE}"]
    finding, = written.findings
    assert (finding.code, finding.level, finding.count, finding.target) == ("CS2040", "note", 2, 0)
    assert written.numbers == 14


def test_an_alias_gets_numbers_of_its_own():
    text = program(f"MoveL p,{MOVE}\nMoveL q,{MOVE}", f"CONST robtarget p:={target(1)};\nCONST robtarget q:=p;")
    written = shift(text, [1], [TENTH])
    assert millimetres(read_rapid(written.content).toolpath) == [[1, 0, 0], [1.1, 0.2, 0.3]]
    assert b"q:=[[1.1000," in written.content
    assert shift(text, [0], [TENTH]).declarations == 1          # q still needs the old p


def test_an_alias_that_became_numbers_is_told_and_its_numbers_are_counted():
    """Alone in the modules of its file, and where others may name it."""
    for reach, codes in (("LOCAL ", ["CS2040"]), ("", ["CS2040", "CS3270"])):
        text = program(f"MoveL p,{MOVE}\nMoveL q,{MOVE}", f"CONST robtarget p:={target(1)};\n{reach}CONST robtarget q:=p;")
        written = shift(text, [1], [TENTH])
        assert (written.numbers, written.declarations) == (7, 0)
        assert [(one.code, one.target, one.count) for one in written.findings] == [(code, 1, 1) for code in codes]


def test_symbols_stay_unless_they_must_change():
    declarations = "CONST pos corner:=[1,2,3];\nCONST confdata conf1:=[0,0,0,0];\nCONST num high:=5;"
    body = (f"MoveL [corner,[1,0,0,0],conf1,{UNUSED}],{MOVE}\nMoveL [[1,2,high],[1,0,0,0],conf1,{UNUSED}],{MOVE}\n"
            f"MoveL [corner,[1,0,0,0],conf1,{UNUSED}],{MOVE}")
    text = program(body, declarations)
    written = shift(text, [0, 1], [[0.5, 0, 0], [0.5, 0, 0]], confdata=[[0, 0, 0, 0], [0, 0, 1, 0]])
    assert changed(text, written.content) == [
        f"MoveL [[1.5000,2.0000,3.0000],[1,0,0,0],conf1,{UNUSED}],{MOVE}",
        f"MoveL [[1.5000,2,high],[1,0,0,0],[0,0,1,0],{UNUSED}],{MOVE}"]
    assert [finding.code for finding in written.findings] == ["CS2042", "CS2043"]


@pytest.mark.parametrize(("conf", "quadrants", "written", "numbers"), [
    ("[ 0,-1 ,2,+3]", [0, -1, 2, 3], "[ 0,-1 ,2,+3]", 1), ("[ 0,-1 ,2,+3]", [1, -2, 2, 3], "[ 1,-2 ,2,+3]", 3),
    ("[0,nOne,2,3]", [0, 1, 2, 3], "[0,nOne,2,3]", 1), ("[0,nOne,2,3]", [0, -1, 2, 4], "[0,-1,2,4]", 3),
    ("conf1", [0, 1, 2, 3], "conf1", 1), ("conf1", [0, 1, 2, 0], "[0,1,2,0]", 5)])
def test_confdata_beside_symbols_change_where_they_differ(conf, quadrants, written, numbers):
    """So does the orientation, number by number; how many numbers are others is counted."""
    text = program(f"MoveL [[1,2,nHigh],turn,{conf},{UNUSED}],{MOVE}",
                   "CONST num nHigh:=5;CONST num nOne:=1;CONST orient turn:=[0,1,0,0];CONST confdata conf1:=[0,1,2,3];")
    got = shift(text, [0], [[0.5, 0, 0]], confdata=[quadrants])
    assert changed(text, got.content) == [f"MoveL [[1.5000,2,nHigh],turn,{written},{UNUSED}],{MOVE}"]
    assert got.numbers == numbers
    turned = shift(text, [0], [[0, 0, 0.25]], confdata=[quadrants], quaternion=np.array([[0, 0.6, 0.8, 0]]))
    assert changed(text, turned.content) == [
        f"MoveL [[1,2,5.2500],[0.00000000,0.60000000,0.80000000,0.00000000],{written},{UNUSED}],{MOVE}"]
    assert turned.numbers == numbers + 4


def test_comments_inside_a_corrected_target_stay():
    text = f"MoveL [[1, ! x 7\n2,3],[1,0,0,0],[0,0,0,0],{UNUSED}],{MOVE}"
    assert shift(text, [0], [TENTH]).content.decode() == text.replace("[1, !", "[1.1000, !").replace("2,3]", "2.2000,3.3000]")


def test_a_declaration_with_symbols_is_copied_in_numbers():
    text = program(f"MoveL p,{MOVE}\nMoveL p,{MOVE}",
                   f"PERS confdata conf1:=[0,0,1,0];\nPERS robtarget p:=[[1,2,3],[1,0,0,0],conf1,{UNUSED}];")
    assert changed(text, shift(text, [0], [[1, 0, 0]]).content)[0] == (
        "LOCAL CONST robtarget p_c1:=[[2.0000,2.0000,3.0000],"
        f"[1.00000000,0.00000000,0.00000000,0.00000000],[0,0,1,0],{UNUSED}];")


@pytest.mark.parametrize("body", [f"MoveL *,{MOVE}", f"MoveAbsJ [[0,0,0,0,0,0],{UNUSED}],{MOVE}",
                                  f"MoveL {target(1)},v5,z1,tool0\\Corr;"])
def test_a_blocked_target_is_never_written(body):
    with pytest.raises(ValueError, match="target 0 cannot be rewritten"):
        rewrite(read_rapid(body.encode()), [0], [[0, 0, 0]], [[1, 0, 0, 0]])


@pytest.mark.parametrize(("targets", "position", "quaternion"), [
    ([0, 0], [[0, 0, 0]] * 2, [[1, 0, 0, 0]] * 2), ([0], [[0, 0, np.nan]], [[1, 0, 0, 0]]), ([0], [[0, 0, 0]] * 2, [[1, 0,
                                                                                                                     0, 0]]),
])
def test_wrong_calls(targets, position, quaternion):
    with pytest.raises(ValueError, match="each once|finite"):
        rewrite(read_rapid(f"MoveL {target(1)},{MOVE}".encode()), targets, position, quaternion)


def test_the_rest_reads_back_as_it_was():
    text = program(f"MoveL p,{MOVE}MoveL {target(5)},{MOVE}MoveL Offs(p,0,0,1),{MOVE}MoveAbsJ j,{MOVE}",
                   f"CONST robtarget p:={target(1)};\nCONST jointtarget j:=[[1,2,3,4,5,6],{UNUSED}];")
    before = read_rapid(text.encode()).toolpath
    written = shift(text, [0, 1, 2], [[0, 0, 0]] * 3)
    after = read_rapid(written.content).toolpath
    same(before, after)
    assert not found(after, "CS2010")

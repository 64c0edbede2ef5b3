"""Tools and work objects of the moves."""

import numpy as np
import pytest

from tests.compensator.rapid.small_programs import found, path, target

MOVE = f"MoveL {target(1)},v100,z1"
LOAD = "[1,[0,0,1],[1,0,0,0],0,0,0]"
TOOL = f"PERS tooldata mill:=[TRUE,[[120,-0.5,250],[0.5,0.5,0.5,0.5]],{LOAD}];"


def test_tool0_and_wobj0_are_predefined():
    toolpath = path(f"{MOVE},tool0;{MOVE},Tool0\\WObj:=WObj0;")
    assert toolpath.tool.tolist() == toolpath.workobject.tolist() == [0, 0]
    for frame in (toolpath.tools[0], toolpath.workobjects[0]):
        assert frame.position.tolist() == [0, 0, 0]
        assert frame.quaternion.tolist() == [1, 0, 0, 0]
        assert (frame.problem, frame.line) == ("", None)


def test_a_declared_tool():
    toolpath = path(f"{MOVE},mill;{MOVE},MILL;", TOOL)
    tool, = toolpath.tools
    assert tool.position.tolist() == [0.12, -0.0005, 0.25]
    assert tool.quaternion.tolist() == [0.5, 0.5, 0.5, 0.5]
    assert (tool.name, tool.line, tool.problem) == ("mill", 2, "")


def test_the_user_frame_carries_the_object_frame():
    # The user frame is turned by 90 deg about z, so the object frame's x = 10 mm is world y.
    table = 'PERS wobjdata table:=[FALSE,TRUE,"",[[1000,200,0],[0.7071067812,0,0,0.7071067812]],[[10,0,5],[0,1,0,0]]];'
    toolpath = path(f"{MOVE},tool0\\WObj:=table;{MOVE},tool0,\\WObj:=table;{MOVE},tool0;", table)
    assert toolpath.workobject.tolist() == [0, 0, 1]
    assert [item.name for item in toolpath.workobjects] == ["table", "wobj0"]
    np.testing.assert_allclose(toolpath.workobjects[0].position, [1.0, 0.21, 0.005], atol=1e-12)
    root = np.sqrt(0.5)                                 # (c + c k) i = c i + c j
    np.testing.assert_allclose(toolpath.workobjects[0].quaternion, [0, root, root, 0], atol=1e-12)


OWN = 'PERS wobjdata wPart:=[FALSE,TRUE,"",[[0,0,0],[1,0,0,0]],[[9,0,0],[1,0,0,0]]];'


@pytest.mark.parametrize(("moves", "data", "line"), [
    (f"{MOVE},tool0\\WObj:=wobj0;\n{MOVE},tool0;", OWN, 5), (f"{MOVE},tool0;\n{MOVE},tool0\\WObj:=wPart;", OWN, None),
    (f"{MOVE},tool0\\WObj:=wobj0;", OWN, None), (f"{MOVE},tool0;", OWN.replace("wPart", "wobj0"), None),
    (f"{MOVE},tool0;", "", None),
    ("MoveAbsJ [[0,0,0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,z1,tool0;", OWN, None),
    (f"{MOVE},tool0;", "PROC other(PERS wobjdata wPart)\nENDPROC", None)])
def test_a_work_object_that_no_move_uses_beside_moves_without_one_is_told(moves: str, data: str, line: int | None) -> None:
    """As it is spelled in the file, at the first move without; not of joint angles, which stand in none, nor of a parameter."""
    told = found(path(moves, data), "CS2052")
    assert [(one.level, one.line, one.target) for one in told] == ([("warning", line, 1)] if line else [])
    assert all(one.message == "moves without \\WObj stand in wobj0, the world; no move uses wPart, which the program declares"
               for one in told)


def test_one_frame_for_each_declared_data_not_for_each_move():
    toolpath = path(f"{MOVE},mill;", f"{TOOL}\nPROC a()\nPERS tooldata mill:=[TRUE,[[1,0,0],[1,0,0,0]],{LOAD}];\n"
                    f"{MOVE},mill;{MOVE},mill;\nENDPROC\nPROC b()\n{MOVE},mill;\nENDPROC")
    assert toolpath.tool.tolist() == [0, 0, 1, 1]
    assert [float(tool.position[0]) for tool in toolpath.tools] == [0.001, 0.12]


def test_frames_written_with_symbols():
    toolpath = path(f"{MOVE},mill;", f"CONST pose frame1:=[[1,2,3],turn];\nCONST orient turn:=[0,0,0,1];\n"
                    f"CONST loaddata heavy:={LOAD};\nPERS tooldata mill:=[TRUE,frame1,heavy];")
    assert toolpath.tools[0].position.tolist() == [0.001, 0.002, 0.003]
    assert toolpath.tools[0].quaternion.tolist() == [0, 0, 0, 1]


def test_a_tool_from_an_array():
    toolpath = path(f"{MOVE},rack{{2}};{MOVE},rack{{n}};",
                    f"PERS tooldata rack{{2}}:=[[TRUE,[[0,0,1],[1,0,0,0]],{LOAD}],[TRUE,[[0,0,2],[1,0,0,0]],{LOAD}]];")
    assert toolpath.tools[0].position.tolist() == [0, 0, 0.002]
    assert "run time" in toolpath.tools[1].problem


@pytest.mark.parametrize("declarations", ["", "PERS tooldata mill;\nPERS wobjdata part;"])
def test_frames_without_numbers_come_from_the_cell(declarations):
    toolpath = path(f"{MOVE},mill\\WObj:=part;{MOVE},mill\\WObj:=part;", declarations)
    assert toolpath.block.tolist() == ["", ""]
    for frame, code in ((toolpath.tools[0], "CS2020"), (toolpath.workobjects[0], "CS2021")):
        assert frame.position is None
        assert frame.quaternion is None
        assert frame.problem == ""
        finding, = found(toolpath, code)
        assert (finding.level, finding.count, finding.target) == ("note", 2, 0)
        assert frame.name in finding.message


@pytest.mark.parametrize(("tool", "body", "why"), [
    (TOOL, "mill.tframe := other;", "assigned at run time"),
    (TOOL, "mill.tframe.trans.z := 5;", "assigned at run time"),
    (TOOL, "Mill:=other;", "assigned at run time"),
    (f"PERS tooldata mill:=[FALSE,[[0,0,1],[1,0,0,0]],{LOAD}];", "", "stationary"),
    (f"PERS tooldata mill:=[TRUE,[[0,0,1],[0,0,0,0]],{LOAD}];", "", "quaternion"),
    (f"PERS tooldata mill:=[TRUE,[[0,0,len],[1,0,0,0]],{LOAD}];", "", "len"),
])
def test_tools_that_cannot_be_corrected_with(tool, body, why):
    toolpath = path(f"{MOVE},mill;{body}", tool)
    assert why in toolpath.tools[0].problem
    finding, = found(toolpath, "CS2022")
    assert (finding.level, finding.line) == ("warning", 4)
    assert toolpath.block[0] == ""


def test_the_load_of_a_tool_does_not_matter():
    assert path(f"mill.tload.mass := 4;{MOVE},mill;", TOOL).tools[0].problem == ""


def test_a_tool_handed_to_a_routine_that_changes_it():
    body = f"calibrate mill;{MOVE},mill;"
    assert path(body, TOOL).tools[0].problem == ""       # a routine elsewhere: taken to use it
    changing = "PROC calibrate(PERS tooldata t)\nt.tframe.trans.z:=3;\nENDPROC"
    assert "assigned at run time" in path(body, f"{TOOL}\n{changing}").tools[0].problem


def test_a_tool_that_is_a_parameter():
    toolpath = path("", f"PROC cut(PERS tooldata t, \\PERS wobjdata w)\n{MOVE},t\\WObj?w;\nENDPROC")
    assert "parameter" in toolpath.tools[0].problem
    assert "parameter" in toolpath.workobjects[0].problem


@pytest.mark.parametrize(("part", "body", "why"), [
    ('[TRUE,TRUE,"",[[0,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]]', "", "robot holds it"),
    ('[FALSE,FALSE,"",[[0,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]]', "", "ufmec names none"),
    ('[FALSE,FALSE,"STN1",[[0,0,9],[1,0,0,0]],[[0,0,0],[1,0,0,0]]]', "", "put the offset into oframe"),
    ('[FALSE,FALSE,"STN1",[[0,0,0],[0,1,0,0]],[[0,0,0],[1,0,0,0]]]', "", "put the offset into oframe"),
    ('[FALSE,TRUE,"",[[0,0,0],[0,0,0,0]],[[0,0,0],[1,0,0,0]]]', "", "quaternion of uframe"),
    ('[FALSE,TRUE,"",[[0,0,0],[1,0,0,0]],[[0,0,0],[2,0,0,0]]]', "", "quaternion of oframe"),
    ('[FALSE,TRUE,"",[[0,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]]', "part.uframe:=DefFrame(a,b,c);", "assigned at run time"),
    ('[FALSE,TRUE,"",[[0,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]]', "part := other;", "assigned at run time"),
])
def test_work_objects_that_cannot_be_corrected_in(part, body, why):
    toolpath = path(f"{MOVE},tool0\\WObj:=part;{body}", f"PERS wobjdata part:={part};")
    assert why in toolpath.workobjects[0].problem
    assert found(toolpath, "CS2023")


def test_a_work_object_on_a_mechanical_unit_is_given_in_the_unit_s_user_frame():
    declared = 'PERS wobjdata part:=[FALSE,FALSE,"STN1",[[0,0,0],[1,0,0,0]],[[10,20,30],[0,1,0,0]]];'
    (item,) = path(f"{MOVE},tool0\\WObj:=part;", declared).workobjects
    assert (item.unit, item.problem) == ("STN1", "")
    np.testing.assert_allclose(item.position, [0.01, 0.02, 0.03])
    np.testing.assert_allclose(item.quaternion, [0, 1, 0, 0])


def test_a_slightly_unnormalised_frame_is_normalised():
    toolpath = path(f"{MOVE},mill;", f"PERS tooldata mill:=[TRUE,[[0,0,1],[0.707,0,0.707,0]],{LOAD}];")
    np.testing.assert_allclose(toolpath.tools[0].quaternion, [np.sqrt(0.5), 0, np.sqrt(0.5), 0], atol=1e-15)
    finding, = found(toolpath, "CS2013")
    assert (finding.line, finding.level) == (2, "note")


FLAGS = ("CONST bool bYes:=TRUE; CONST bool bNo:=FALSE; CONST bool bAlso:=bYes; CONST bool bMany{2}:=[FALSE,TRUE];\n"
         "VAR bool bLater; VAR bool bVar:=TRUE; PERS bool bPers:=FALSE;\n")
NOWHERE, LOAD = "[[0,0,0],[1,0,0,0]]", "[5,[0,0,90],[1,0,0,0],0,0,0]"


@pytest.mark.parametrize(("flag", "held"), [
    ("TRUE", True), ("bYes", True), ("bAlso", True), ("bMany{2}", True), ("FALSE", False), ("bNo", False), ("bMany{1}", False),
    ("bLater", None), ("bElsewhere", None), ("bVar", None), ("bPers", None)])
def test_constants_stand_for_true_and_false_in_a_frame(flag, held):
    """As numbers' constants do, and nothing that may have changed meanwhile: a tool that is held,
    a work object that is not, one whose user frame a unit moves."""
    def said(what, code, data):
        move = f"MoveL {target(1)},v100,fine,{'tX;' if what == 'tool' else 'tool0' + chr(92) + 'WObj:=wX;'}"
        toolpath = path(move, FLAGS + data)
        own = toolpath.tools[0] if what == "tool" else toolpath.workobjects[0]
        return own.position, [one.message.partition(": ")[2] for one in found(toolpath, code)], own

    for what, code, data, wanted, otherwise in (
            ("tool", "CS2022", f"PERS tooldata tX:=[{flag},[[1,2,3],[1,0,0,0]],{LOAD}];", True,
             "it is stationary (robhold is FALSE)"),
            ("work object", "CS2023", f'PERS wobjdata wX:=[{flag},TRUE,"",[[1,2,3],[1,0,0,0]],{NOWHERE}];', False,
             "the robot holds it (robhold is TRUE)")):
        position, messages, _ = said(what, code, data)
        assert (position is not None) == (held is wanted)
        assert messages == ([] if held is wanted else [otherwise if held is not None else
                                                       f"robhold of the {what} is known only at run time"])
        if position is not None:
            assert np.round(1e3 * position, 9).tolist() == [1, 2, 3]
    position, messages, own = said("work object", "CS2023", f'PERS wobjdata wX:=[FALSE,{flag},"STN1",{NOWHERE},{NOWHERE}];')
    assert messages == (["ufprog of the work object is known only at run time"] if held is None else [])
    assert (own.unit == "STN1") == (held is False)


def test_constants_that_name_each_other_are_no_answer():
    """CONST bool a:=b, and b:=a."""
    toolpath = path(f"MoveL {target(1)},v100,fine,tX;", "CONST bool a:=b; CONST bool b:=a;\n"
                    f"PERS tooldata tX:=[a,{NOWHERE},{LOAD}];")
    assert ["known only at run time" in one.message for one in found(toolpath, "CS2022")] == [True]


@pytest.mark.parametrize(("data", "why"), [
    (f"VAR pose p; PERS tooldata tX:=[TRUE,p,{LOAD}];", "tframe: p has no initial value"),
    (f'VAR pose p; PERS wobjdata wX:=[FALSE,TRUE,"",p,{NOWHERE}];', "uframe: p has no initial value"),
    (f'VAR pose p; PERS wobjdata wX:=[FALSE,TRUE,"",{NOWHERE},p];', "oframe: p has no initial value"),
    (f'VAR string s; PERS wobjdata wX:=[FALSE,FALSE,s,{NOWHERE},{NOWHERE}];',
     "a mechanical unit moves its user frame (ufprog is FALSE), and ufmec names none")])
def test_which_part_of_a_frame_is_not_known_is_told(data, why):
    """A pose by a constant is."""
    move = f"MoveL {target(1)},v100,fine,{'tX;' if 'tX' in data else 'tool0' + chr(92) + 'WObj:=wX;'}"
    toolpath = path(move, data)
    (said,) = found(toolpath, "CS2022" if "tX" in data else "CS2023")
    assert (said.level, said.message.partition(": ")[2]) == ("warning", why)
    known = path(move, data.replace("VAR pose p;", "CONST pose p:=[[1,2,3],[1,0,0,0]];").replace(
        "VAR string s;", 'CONST string s:="STN1";'))
    assert not found(known, "CS2022")
    assert not found(known, "CS2023")

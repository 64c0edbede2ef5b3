"""Tools and work objects that calls hand over: followed within the file, said where another file has them."""

from __future__ import annotations

import numpy as np
import pytest

from compensator.rapid import read_rapid
from compensator.toolpath import Toolpath
from tests.compensator.rapid.small_programs import target

OTHER = "[FALSE,TRUE,\"\",[[10,20,30],[1,0,0,0]],[[0,0,0],[1,0,0,0]]]"
DATA = (f"PERS wobjdata wPart:={OTHER};\nPERS wobjdata wOther:={OTHER.replace('10', '50')};\nPERS wobjdata wIdle:={OTHER};\n"
        "PERS tooldata tMill:=[TRUE,[[1,2,3],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\n")


def path(**routines: str) -> Toolpath:
    """A module of these routines, whose names may have parameters behind them; @w is a move by tMill in wPart."""
    text = "".join(f"PROC {name.replace('__', '(').replace('_', ' ') + (')' if '__' in name else '()')}\n{body}\nENDPROC\n"
                   for name, body in routines.items())
    for word, tail in (("@w", "tMill\\WObj:=wPart"), ("@x", "tMill\\WObj:=wx"), ("@y", "tx\\WObj:=wPart")):
        text = text.replace(word, f"MoveL {target(0)},v100,z1,{tail};")
    return read_rapid(f"MODULE M\n{DATA}{text}ENDMODULE\n".encode()).toolpath


def codes(toolpath: Toolpath) -> list[str]:
    return [finding.code for finding in toolpath.findings if finding.code in ("CS2023", "CS2022", "CS2057", "CS2058")]


@pytest.mark.parametrize(("routines", "said"), [
    ({"main": "rSetup wPart; @w"}, ["CS2058"]),
    ({"main": '@w %"rSetup"% wPart;'}, ["CS2058"]),
    ({"main": "@w %name% wPart;"}, ["CS2058"]),
    ({"main": "rSetup tMill,wPart; @w"}, ["CS2058", "CS2058"]),
    ({"main": "rSetup wIdle; @w"}, []),                                                     # no move stands in it
    ({"main": "p:=CRobT(\\Tool:=tMill\\WObj:=wPart); SearchL di,p,q,v10,tMill\\WObj:=wPart; @w"}, []),
    ({"main": "rMine wPart; @w", "rMine__PERS_wobjdata_w": "TPWrite text;"}, []),
    ({"main": "rMine wPart; @w", "rMine__PERS_wobjdata_wx": "rMeasure wx;"}, ["CS2058"]),
    ({"main": "rMine wPart; @w", "rMine__PERS_wobjdata_wx": "wx.uframe.trans.x:=1;"}, ["CS2023"]),
    ({"main": '%"rMine"% wPart; @w', "rMine__PERS_wobjdata_wx": "wx.uframe.trans.x:=1;"}, ["CS2023"]),
    ({"main": "rMine wPart;", "rMine__PERS_wobjdata_wx": "@x"}, ["CS2057"]),
    ({"main": "rMine wPart; rMine wOther;", "rMine__PERS_wobjdata_wx": "@x"}, ["CS2023"]),
    ({"main": "rMine wPart; rMine wObjects{2};", "rMine__PERS_wobjdata_wx": "@x"}, ["CS2023"]),
    ({"main": "rMine wPart; %name% wOther;", "rMine__PERS_wobjdata_wx": "@x"}, ["CS2023"]),
    ({"rMine__PERS_wobjdata_wx": "@x"}, ["CS2023"]),                                        # called from another file alone
    ({"main": "rMine tMill;", "rMine__PERS_tooldata_tx": "@y"}, ["CS2057"]),
    ({"main": "rMine tMill;", "rMine__PERS_loaddata_tx": "@y"}, ["CS2022"]),                # no tool by its type
])
def test_what_is_said_of_what_a_call_hands_over(routines: dict[str, str], said: list[str]) -> None:
    assert codes(path(**routines)) == said


def test_a_parameter_is_what_all_calls_hand_over() -> None:
    toolpath = path(main="@w rOuter wPart; rOuter wPart;", rOuter__PERS_wobjdata_wo="rInner wo;", rInner__PERS_wobjdata_wx="@x")
    assert [one.name for one in toolpath.workobjects] == ["wPart"]
    assert toolpath.workobjects[0].position is not None
    np.testing.assert_allclose(toolpath.workobjects[0].position, [0.01, 0.02, 0.03])
    assert codes(toolpath) == ["CS2057"]


def test_an_element_of_an_array_is_none_of_the_first_parameters() -> None:
    """Whose declarations are the first two of the file."""
    move = f"MoveL {target(0)},v100,z1,"
    tool = "[TRUE,[[1,2,3],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]]"
    text = (f"MODULE A\nPROC rMine(PERS tooldata tx,PERS wobjdata wx)\n{move}tx\\WObj:=wx;\nENDPROC\nENDMODULE\n"
            f"MODULE B\n{DATA}"
            f"PERS tooldata tAll{{2}}:=[{tool.replace('[1,2', '[7,2')},{tool.replace('[1,2', '[8,2')}];\n"
            f"PERS wobjdata wAll{{2}}:=[{OTHER.replace('10', '70')},{OTHER.replace('10', '80')}];\n"
            f"PROC main()\nrMine tMill,wPart;\n{move}tAll{{1}}\\WObj:=wAll{{1}};\n{move}tAll{{2}}\\WObj:=wAll{{2}};\n"
            "ENDPROC\nENDMODULE\n")
    toolpath = read_rapid(text.encode()).toolpath
    for frames, used, expected in ((toolpath.tools, toolpath.tool, [1, 7, 8]),
                                   (toolpath.workobjects, toolpath.workobject, [10, 70, 80])):
        assert [frames[k].position[0] * 1e3 for k in used] == pytest.approx(expected)


@pytest.mark.parametrize(("frame", "why"), [
    ("PoseInv(pAny)", "tframe: function PoseInv is evaluated at run time"),
    ("pAny", "tframe: pAny is not declared in this file")])
def test_a_tool_whose_frame_is_worked_out_is_not_known(frame: str, why: str) -> None:
    text = (f"PERS tooldata tNew:=[TRUE,{frame},[1,[0,0,1],[1,0,0,0],0,0,0]];\nPROC main()\n"
            f"MoveL {target(0)},v100,z1,tNew;\nENDPROC\n")
    [tool] = read_rapid(text.encode()).toolpath.tools
    assert (tool.problem, tool.position) == (why, None)


def test_the_routine_is_named_as_it_is_written() -> None:
    finding = next(finding for finding in path(main="rMeasurePart wPart; @w").findings if finding.code == "CS2058")
    assert "work object wPart is handed to rMeasurePart, which is not in this file" in finding.message
    assert finding.line == 2


@pytest.mark.parametrize(("call", "said"), [
    ("rLog tMill;", True), ("rLog 5,tMill;", True), ("rLog (tMill);", False), ("rLog 5+tMill.tload.mass;", False),
    ("rLog -tMill.tload.mass;", False), ("nMass:=tMill.tload.mass;", False), ("nMass:=(tMill.tload.mass);", False),
    ("rLog\\Of:=tMill;", True), ("rLog\\Of?tMill;", True), ("IF tMill.robhold rLog 5;", False),
    ("rLog nLoads{tMill.tload.mass};", False)])
def test_a_value_that_is_worked_out_is_no_tool_that_is_handed_over(call: str, said: bool) -> None:
    """A routine of another file can change what it is given by its name, and nothing that it is given the value of."""
    assert codes(path(main=f"{call} @w")) == ["CS2058"] * said


@pytest.mark.parametrize("first", [
    "5", "nAny", '"text"', "TRUE", "[1,2]", "(1+2)", "fOther(1,2)", "fOther([1,2],3)", "aSome{1}", "-5", "fOther()", "a.b",
    "NOT bAny", "[[1,2],[3,4]]", "((1))", "1\\Opt:=2", "1\\Opt", "aSome{1,2}", "\\Opt:=[2],5", "5,\\Opt", "\\Opt,(5)"])
@pytest.mark.parametrize("form", [
    "rSet {},{};", "IF fSet({},{}) rOther;", "rOther 1+fSet({},{}),wIdle;", "nIt:=2*(1+fSet({},{}));",
    "rOther\\A:=fSet({},{}),wIdle;"])
def test_the_second_argument_is_the_second_whatever_the_first_is(first: str, form: str) -> None:
    """A routine that moves the second tool which it is given, and leaves the first as it is."""
    given = "(num a,PERS tooldata b)\nb.tframe.trans.z:=5;\n"
    routines = f"PROC rSet{given}ENDPROC\nFUNC bool fSet{given}RETURN TRUE;\nENDFUNC\n"
    move = f"MoveL {target(0)},v100,z1,tMill\\WObj:=wPart;"
    for second, problem in (("tMill", True), ("tNone", False), (f"tNone),fOther({first},tMill", False)):
        if ")" in second and "fSet" not in form:
            continue
        text = f"MODULE M\n{DATA}{routines}PROC main()\n{form.format(first, second)}\n{move}\nENDPROC\nENDMODULE\n"
        assert bool(read_rapid(text.encode()).toolpath.tools[0].problem) == problem, text

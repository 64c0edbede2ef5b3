"""Where a target's numbers come from: names and their scopes, arrays, Offs and RelTool, symbols, run time."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.compensator.rapid.small_programs import UNUSED, found, millimetres, path, target

MOVE = "v100,z1,tool0;"


@pytest.mark.parametrize("declaration", ["CONST", "PERS", "VAR", "LOCAL CONST", "TASK PERS", "const", "Local Pers"])
def test_named_targets(declaration):
    toolpath = path(f"MoveL P10,{MOVE}MoveJ p10,{MOVE}", f"{declaration} robtarget p10 := {target(1, 2, 3)};")
    assert millimetres(toolpath) == [[1, 2, 3]] * 2
    assert not toolpath.findings


def test_routine_data_hides_module_data():
    text = (f"CONST robtarget p:={target(1)};\nPROC other()\nCONST robtarget p:={target(2)};\nMoveL p,{MOVE}\nENDPROC\n"
            f"PROC third()\nVAR robtarget P:={target(3)};\nMoveL p,{MOVE}\nENDPROC")
    assert millimetres(path(f"MoveL p,{MOVE}", text)) == [[2, 0, 0], [3, 0, 0], [1, 0, 0]]


def test_an_array_may_have_many_signs_and_brackets_beside_each_other():
    """Forty levels may lie within each other; so many may follow each other as there is data."""
    places = [[-float(k), -2.0 * k, -3.0 * k] for k in range(30)]
    listed = ",".join(target(*place) for place in places)
    toolpath = path("".join(f"MoveL p{{{k}}},{MOVE}" for k in (1, 30)), f"CONST robtarget p{{30}}:=[{listed}];")
    assert millimetres(toolpath) == [places[0], places[29]]
    assert not toolpath.findings


def two_modules(first: str, second: str) -> str:
    from tests.compensator.rapid.small_programs import program

    return program(f"MoveL p,{MOVE}", first) + program(f"MoveL p,{MOVE}", second).replace("main", "second")


def read(text: str):
    from compensator.rapid import read_rapid

    return read_rapid(text.encode(), "two.mod").toolpath


def test_a_local_target_is_invisible_in_another_module():
    toolpath = read(two_modules(f"LOCAL CONST robtarget p:={target(1)};", ""))
    assert millimetres(toolpath)[0] == [1, 0, 0]
    assert np.isnan(toolpath.position[1]).all()
    assert "not declared in this file" in toolpath.block[1]
    assert [finding.code for finding in toolpath.findings] == ["CS2011", "CS2051"]
    said, text = toolpath.findings[1], two_modules(f"LOCAL CONST robtarget p:={target(1)};", "").splitlines()
    assert (said.level, said.message.partition(":")[0]) == ("warning", "the file holds 2 modules")
    assert [k + 1 for k, row in enumerate(text) if row.startswith("MODULE")][1] == said.line


def test_a_global_target_is_visible_in_another_module_unless_hidden():
    assert millimetres(read(two_modules("", f"CONST robtarget p:={target(1)};"))) == [[1, 0, 0]] * 2
    own = read(two_modules(f"LOCAL CONST robtarget p:={target(2)};", f"CONST robtarget p:={target(1)};"))
    assert millimetres(own) == [[2, 0, 0], [1, 0, 0]]


def test_routine_data_of_another_routine_is_invisible():
    toolpath = path(f"MoveL p,{MOVE}", f"PROC a()\nCONST robtarget p:={target(1)};\nENDPROC")
    assert "not declared" in toolpath.block[0]


def test_a_name_declared_twice_is_not_guessed():
    toolpath = path(f"MoveL p,{MOVE}", f"CONST robtarget p:={target(1)};\nCONST robtarget p:={target(2)};")
    assert "more than once" in toolpath.block[0]
    assert found(toolpath, "CS2018")


def test_moves_behind_endmodule_and_without_any_module():
    text = f"CONST robtarget p:={target(1)};\nPROC a()\nMoveL p,{MOVE}\nENDPROC\n"
    assert millimetres(read(text)) == [[1, 0, 0]]
    assert millimetres(read("MODULE m\nENDMODULE\n" + text)) == [[1, 0, 0]]


def test_arrays_of_one_to_three_dimensions():
    declarations = (
        f"CONST robtarget one{{2}}:=[{target(1)},{target(2)}];\n"
        f"CONST robtarget two{{2,2}}:=[[{target(3)},{target(4)}],[{target(5)},{target(6)}]];\n"
        f"CONST robtarget three{{1,1,2}}:=[[[{target(7)},{target(8)}]]];"
    )
    body = f"MoveL one{{2}},{MOVE}MoveL two{{1,2}},{MOVE}MoveL two{{2, 1}},{MOVE}MoveL three{{1,1,2}},{MOVE}"
    assert millimetres(path(body, declarations)) == [[2, 0, 0], [4, 0, 0], [5, 0, 0], [8, 0, 0]]


ARRAY = (f"CONST robtarget pts{{2}}:=[{target(1)},{target(2)}];\nCONST num n:=2;\nPERS num may:=1;\nCONST num c:=nums{{c}};\n"
         "CONST num nums{2}:=[1,2];\nCONST robtarget other:=pts{N};\n")


@pytest.mark.parametrize(("used", "code", "why"), [
    ("pts{i}", "CS2056", "the index of pts is known only at run time: one move for several positions"),
    ("pts{may}", "CS2056", "index"), ("pts{nums{1}}", "CS2056", "index"), ("pts{c}", "CS2056", "index"),
    ("pts{3}", "CS2010", "pts has no element {3} in its declaration"),
    ("pts{n+1}", "CS2010", "pts has no element {3} in its declaration"),
    ("pts{n/4}", "CS2010", "pts has no element {0.5}: an index is a whole number"),
    ("pts", "CS2010", "pts has 1 dimensions, 0 indices stand here"),
    ("pts{0}", "CS2010", "pts has no element {0}"), ("pts{1,1}", "CS2010", "pts has 1 dimensions, 2 indices stand here"),
])
def test_array_elements_that_are_not_known(used, code, why):
    toolpath = path(f"MoveL {used},{MOVE}", ARRAY)
    assert why in toolpath.block[0]
    assert [finding.code for finding in toolpath.findings] == [code]
    assert np.isnan(toolpath.position).all()


@pytest.mark.parametrize(("used", "x"), [("pts{n}", 2), ("pts{n-1}", 1), ("Pts{(N)}", 2), ("other", 2), ("pts{n/2}", 1),
                                         ("Offs(pts{n},1,0,0)", 3)])
def test_a_constant_is_an_index_as_its_number_is(used, x):
    toolpath = path(f"MoveL {used},{MOVE}", ARRAY)
    assert (millimetres(toolpath), toolpath.findings) == ([[x, 0, 0]], ())


def test_offs_moves_along_the_object_frame():
    declarations = f"CONST robtarget p:={target(10, 20, 30, '[0,1,0,0]')};\nCONST num up:=7;"
    body = (f"MoveL Offs(p,1,-2,3.5),{MOVE}MoveL offs(Offs(p, 1,0,0),0,+1,-1),{MOVE}MoveL Offs({target(5)},0,0,1),{MOVE}"
            f"MoveL Offs(p,0,0,up),{MOVE}")
    toolpath = path(body, declarations)
    assert millimetres(toolpath) == [[11, 18, 33.5], [11, 21, 29], [5, 0, 1], [10, 20, 37]]
    assert toolpath.quaternion[0].tolist() == [0, 1, 0, 0]
    assert toolpath.block.tolist() == [""] * 4


def test_reltool_moves_along_the_tool_and_turns_about_it():
    flipped = "CONST robtarget p:=" + target(10, 20, 30, "[0,1,0,0]") + ";"        # tool z down
    toolpath = path(f"MoveL RelTool(p,1,2,3),{MOVE}MoveL RelTool(p,0,0,0\\Rz:=90),{MOVE}", flipped)
    assert millimetres(toolpath) == [[11, 18, 27], [10, 20, 30]]
    # (0,1,0,0) times a quarter turn about z, (c,0,0,c): i (c + c k) = c i - c j
    assert toolpath.quaternion[1] == pytest.approx([0, np.sqrt(0.5), -np.sqrt(0.5), 0], abs=1e-15)


@pytest.mark.parametrize("seed", range(6))
def test_reltool_is_a_displacement_of_rotation_matrices(seed: int) -> None:
    """Of any target by any displacement and turns; a work object carries its object frame likewise."""
    rng = np.random.default_rng((2017, seed))
    first, second = (Rotation.from_quat(rng.normal(size=4)) for _ in range(2))
    place, shift, angles, origin = rng.uniform(-180, 180, (4, 3))

    def spelled(turn: Rotation) -> str:
        return "[" + ",".join(f"{part:.12f}" for part in turn.as_quat()[[3, 0, 1, 2]]) + "]"

    options = "".join(f"\\R{axis}:={angle:.12f}" for axis, angle in zip("xyz", angles, strict=True))
    data = (f"CONST robtarget p:={target(*(f'{x:.12f}' for x in place), spelled(first))};\nPERS wobjdata w:=[FALSE,TRUE,\"\",["
            f"[{','.join(f'{x:.12f}' for x in origin)}],{spelled(second)}],[[{','.join(f'{x:.12f}' for x in place)}],"
            f"{spelled(first)}]];")
    found = path(f"MoveL RelTool(p,{','.join(f'{x:.12f}' for x in shift)}{options}),v100,z1,tool0\\WObj:=w;", data)
    turn = first * Rotation.from_euler("XYZ", angles, degrees=True)
    np.testing.assert_allclose(1e3 * found.position[0], place + first.apply(shift), atol=1e-9)
    np.testing.assert_allclose(Rotation.from_quat(found.quaternion[0][[1, 2, 3, 0]]).as_matrix(), turn.as_matrix(), atol=1e-9)
    frame, = found.workobjects
    assert frame.position is not None
    assert frame.quaternion is not None
    np.testing.assert_allclose(1e3 * frame.position, origin + second.apply(place), atol=1e-9)
    np.testing.assert_allclose(Rotation.from_quat(frame.quaternion[[1, 2, 3, 0]]).as_matrix(), (second * first).as_matrix(),
                               atol=1e-9)


def test_reltool_turns_about_x_then_the_new_y_then_the_new_z():
    toolpath = path(f"MoveL RelTool({target()},0,0,0\\Rx:=90\\Ry:=90),{MOVE}"
                    f"MoveL RelTool({target()},0,0,0 \\Ry:=90, \\Rz:=-90),{MOVE}")
    # Rx(90) Ry(90) = (1+i)(1+j)/2 = (1+i+j+k)/2; Ry(90) Rz(-90) = (1+j)(1-k)/2 = (1-i+j-k)/2
    assert toolpath.quaternion[0] == pytest.approx([0.5, 0.5, 0.5, 0.5], abs=1e-15)
    assert toolpath.quaternion[1] == pytest.approx([0.5, -0.5, 0.5, -0.5], abs=1e-15)


def test_symbols_inside_inline_targets():
    declarations = ("CONST confdata conf1:=[-1,0,1,0];\nCONST pos corner:=[1,2,3];\nPERS orient down:=[0,0,1,0];\n"
                    f"CONST extjoint none:={UNUSED};\nCONST num high:=50;")
    body = (f"MoveL [[1,2,3],[1,0,0,0],conf1,{UNUSED}],{MOVE}MoveL [corner,down,CONF1,none],{MOVE}"
            f"MoveL [[1,2,high],down,[0,0,0,0],none],{MOVE}")
    toolpath = path(body, declarations)
    assert millimetres(toolpath) == [[1, 2, 3], [1, 2, 3], [1, 2, 50]]
    assert toolpath.confdata.tolist() == [[-1, 0, 1, 0], [-1, 0, 1, 0], [0, 0, 0, 0]]
    assert toolpath.quaternion[1].tolist() == [0, 0, 1, 0]
    assert np.isnan(toolpath.external).all()
    assert toolpath.block.tolist() == [""] * 3


def test_a_symbol_that_is_not_declared_leaves_the_rest_known():
    toolpath = path(f"MoveL [[1,2,3],[0,1,0,0],conf1,{UNUSED}],{MOVE}")
    assert millimetres(toolpath) == [[1, 2, 3]]
    assert toolpath.quaternion.tolist() == [[0, 1, 0, 0]]
    assert not toolpath.has_confdata[0]
    assert "conf1" in toolpath.block[0]
    finding, = found(toolpath, "CS2017")
    assert (finding.level, finding.line, finding.target) == ("warning", 4, 0)


def test_a_symbol_made_only_of_e_is_not_a_number():
    toolpath = path(f"MoveL [[e,2,3],[1,0,0,0],[0,0,0,0],{UNUSED}],{MOVE}", "CONST num E:=4;")
    assert millimetres(toolpath) == [[4, 2, 3]]
    named = path(f"MoveL p,{MOVE}", f"CONST num e:=4;\nCONST robtarget p:=[[1,e,3],[1,0,0,0],[0,0,0,0],{UNUSED}];")
    assert millimetres(named) == [[1, 4, 3]]


def test_an_alias_of_a_target():
    toolpath = path(f"MoveL q,{MOVE}", f"CONST robtarget p:={target(1)};\nCONST robtarget q:=p;")
    assert millimetres(toolpath) == [[1, 0, 0]]


def test_data_declared_by_itself_ends():
    assert "by itself" in path(f"MoveL p,{MOVE}", "CONST robtarget p:=p;").block[0]


@pytest.mark.parametrize(("body", "declarations", "why"), [
    (f"MoveL CRobT(),{MOVE}", "", "CRobT"),
    (f"MoveL mine(p),{MOVE}", f"CONST robtarget p:={target(1)};", "mine"),
    (f"MoveL *,{MOVE}", "", "stored in the controller"),
    (f"MoveL p,{MOVE}", "VAR robtarget p;", "no initial value"),
    (f"MoveL p,{MOVE}p:=CRobT();", f"VAR robtarget p:={target(1)};", "assigned at run time"),
    (f"MoveL p,{MOVE}P.trans.z := p.trans.z + 5;", f"PERS robtarget p:={target(1)};", "assigned at run time"),
    (f"IF a=1 p:=other;MoveL p,{MOVE}", f"VAR robtarget p:={target(1)};", "assigned at run time"),
    (f"MoveL pts{{1}},{MOVE}pts{{2}} := p;", f"VAR robtarget pts{{2}}:=[{target(1)},{target(2)}];", "assigned at run time"),
    (f"MoveL pts{{1}},{MOVE}pts{{i+1}}.trans.x := 4;", f"VAR robtarget pts{{2}}:=[{target(1)},{target(2)}];",
     "assigned at run"),
    (f"SearchL\\Stop,di1,p,q,v100,tool0;MoveL p,{MOVE}", f"VAR robtarget p:={target(1)};", "assigned at run time"),
    (f"Teach p;MoveL p,{MOVE}", f"PERS robtarget p:={target(1)};", "assigned at run time"),
    (f"ok:=StrToVal(text, p);MoveL p,{MOVE}", f"VAR robtarget p:={target(1)};", "assigned at run time"),
    (f"SetDataVal \"p\", value;MoveL p,{MOVE}", f"VAR robtarget p:={target(1)};", "assigned at run time"),
    (f"MoveL Offs(p,0,0,height),{MOVE}", f"CONST robtarget p:={target(1)};VAR num height:=5;", "not a constant"),
    (f"MoveL Offs(p,0,0,2*Sqrt(5)),{MOVE}", f"CONST robtarget p:={target(1)};", "evaluated at run time"),
    (f"MoveL RelTool(p,0,0,0\\Rz:=angle),{MOVE}", f"CONST robtarget p:={target(1)};", "angle"),
    (f"MoveL [[1,2,3+n],[1,0,0,0],[0,0,0,0],{UNUSED}],{MOVE}", "", "evaluated at run time"),
    (f"MoveL [p.trans,[1,0,0,0],[0,0,0,0],{UNUSED}],{MOVE}", f"CONST robtarget p:={target(1)};", "evaluated at run time"),
    (f"MoveL <EXP>,{MOVE}", "", "evaluated at run time"),
    (f"MoveAbsJ CJointT(),{MOVE}", "", "CJointT"),
    (f"MoveAbsJ home,{MOVE}", "", "not declared"),
    (f"MoveL home,{MOVE}", f"CONST jointtarget home:=[[0,0,0,0,0,0],{UNUSED}];", "jointtarget"),
])
def test_targets_computed_at_run_time_count_and_are_left(body, declarations, why):
    toolpath = path(f"MoveL {target(9)},{MOVE}\n  {body}\nMoveL {target(8)},{MOVE}", declarations)
    assert len(toolpath) == 3
    assert why in toolpath.block[1]
    assert toolpath.block[[0, 2]].tolist() == ["", ""]
    assert np.isnan(toolpath.joints).all()
    finding = toolpath.findings[0]
    assert (finding.level, finding.line, finding.target) == ("warning", 5, 1)
    assert finding.column == 3 + body.index("Move") + (9 if "MoveAbsJ" in body else 6)
    assert finding.code in ("CS2010", "CS2011", "CS2017")
    assert why in finding.message


def test_a_routine_parameter_is_known_only_at_run_time():
    text = f"CONST robtarget p:={target(1)};\nPROC cut(robtarget p, \\switch fast | num slow)\nMoveL p,{MOVE}\nENDPROC"
    toolpath = path(f"cut p;MoveL p,{MOVE}", text)
    assert "parameter" in toolpath.block[0]
    assert millimetres(toolpath)[1] == [1, 0, 0]


@pytest.mark.parametrize(("mode", "body", "changes"), [
    ("", "", False), ("INOUT", "", False), ("INOUT", "t.trans.z:=5;", True), ("VAR", "deeper t;", True), ("", "t:=u;", False),
    ("PERS", "deeper t;", True),
])
def test_a_target_changed_by_a_routine_it_is_handed_to(mode, body, changes):
    text = (f"VAR robtarget p:={target(1)};\nPROC lift(num n, {mode} robtarget t)\n{body}\nENDPROC\n"
            "PROC deeper(INOUT robtarget t)\nt:=CRobT();\nENDPROC")
    toolpath = path(f"lift 1, p;\nMoveL p,{MOVE}", text)
    assert bool(toolpath.block[0]) == changes


def test_named_joint_targets():
    toolpath = path(f"MoveAbsJ home\\NoEOffs,{MOVE}MoveAbsJ rest{{1}},{MOVE}",
                    f"CONST jointtarget home:=[[90,0,0,0,0,0],[100,9E9,9E9,9E9,9E9,9E9]];\n"
                    f"CONST jointtarget rest{{1}}:=[[[0,0,0,0,180,0],{UNUSED}]];")
    assert toolpath.joints[:, 0].tolist() == pytest.approx([np.pi / 2, 0])
    assert toolpath.joints[1, 4] == pytest.approx(np.pi)
    assert toolpath.external[0, 0] == 100
    assert toolpath.block.tolist() == ["", ""]


def test_an_unusable_quaternion():
    toolpath = path(f"MoveL {target(1, q='[0,0,0,0]')},{MOVE}MoveL {target(2, q='[1,0.33,0,0]')},{MOVE}"
                    f"MoveL {target(3, q='[1,0.31,0,0]')},{MOVE}", f"CONST robtarget spare:={target(4, q='[0,0,0,0]')};")
    assert np.isnan(toolpath.quaternion[:2]).all()
    assert millimetres(toolpath) == [[1, 0, 0], [2, 0, 0], [3, 0, 0]]
    assert ["quaternion" in block for block in toolpath.block] == [True, True, False]
    finding, = found(toolpath, "CS2012")
    assert (finding.level, finding.count, finding.target) == ("warning", 2, 0)
    assert np.linalg.norm(toolpath.quaternion[2]) == pytest.approx(1, abs=1e-15)


def test_a_slightly_unnormalised_quaternion_is_normalised():
    toolpath = path(f"MoveL {target(1, q='[0.7071,0,0.7071,0]')},{MOVE}MoveL {target(2, q='[0.7071068,0,0.7071068,0]')},{MOVE}")
    root = np.sqrt(0.5)
    np.testing.assert_allclose(toolpath.quaternion, [[root, 0, root, 0]] * 2, rtol=0, atol=1e-15)
    finding, = found(toolpath, "CS2013")
    assert (finding.level, finding.count, finding.target) == ("note", 1, 0)
    assert toolpath.block.tolist() == ["", ""]


def test_placeholders_no_move_uses_say_nothing():
    toolpath = path(f"MoveL {target(1)},{MOVE}", f"CONST robtarget p:={target(q='[0,0,0,0]')};\nCONST robtarget bad:=[[1],2];")
    assert not toolpath.findings


def test_reltool_from_an_unusable_quaternion():
    toolpath = path(f"MoveL RelTool({target(q='[0,0,0,0]')},1,0,0),{MOVE}")
    assert "quaternion" in toolpath.block[0]
    assert np.isnan(toolpath.position).all()


@pytest.mark.parametrize(("off", "code"), [(0.9e-5, ""), (1.1e-5, "CS2013"), (-1.1e-5, "CS2013"), (0.095, "CS2013"),
                                           (0.105, "CS2012"), (-0.095, "CS2013"), (-0.105, "CS2012")])
def test_a_sum_of_squares_is_one_within_a_tenth_and_not_told_within_a_hundred_thousandth(off, code) -> None:
    """Of a target, of one that RelTool shifts from, and of a tool."""
    q = f"[{np.sqrt(1 + off):.12f},0,0,0]"
    toolpath = path(f"MoveL {target(1, q=q)},{MOVE}MoveL RelTool({target(2, q=q)},1,0,0),{MOVE}")
    unusable = code == "CS2012"
    assert np.isnan(toolpath.quaternion).any(axis=1).tolist() == [unusable, unusable]
    assert np.isnan(toolpath.position).any(axis=1).tolist() == [False, unusable]
    assert {one.code for one in toolpath.findings if one.code in ("CS2012", "CS2013")} == ({code} if code else set())
    tool = f"PERS tooldata tMine:=[TRUE,[[1,2,3],{q}],[1,[0,0,1],[1,0,0,0],0,0,0]];"
    [read] = path(f"MoveL {target(1)},v100,z1,tMine;", tool).tools
    assert (read.position is None) == unusable

"""Which instructions count as moves, and their arguments."""

import numpy as np
import pytest

from compensator.toolpath import Move
from tests.compensator.rapid.small_programs import UNUSED, found, millimetres, path, target


def test_targets_count_in_the_order_of_the_text():
    toolpath = path(
        f"MoveJ {target(1)},v100,z1,tool0;\nMoveL {target(2)},v100,z1,tool0;\n"
        f"MoveC {target(3)},{target(4)},v100,z1,tool0;\n"
        f"MoveAbsJ [[0,10,20,-30,180,90],{UNUSED}]\\NoEOffs,v100,z1,tool0;\nMoveL {target(5)},v100,z1,tool0;"
    )
    assert toolpath.move.tolist() == [Move.JOINT, Move.LINEAR, Move.ARC_VIA, Move.ARC_END, Move.ABSOLUTE, Move.LINEAR]
    assert toolpath.position[[0, 1, 2, 3, 5], 0].tolist() == [0.001, 0.002, 0.003, 0.004, 0.005]
    assert np.isnan(toolpath.position[4]).all()
    np.testing.assert_allclose(toolpath.joints[4], [0, np.pi / 18, np.pi / 9, -np.pi / 6, np.pi, np.pi / 2], rtol=1e-15)
    assert np.isnan(toolpath.joints[[0, 1, 2, 3, 5]]).all()
    assert toolpath.block.tolist() == [""] * 6
    assert toolpath.has_confdata.tolist() == [True, True, True, True, False, True]


def test_a_loop_does_not_multiply_and_every_branch_counts():
    body = f"""FOR i FROM 1 TO 5 DO
        MoveL {target(1)},v100,z1,tool0;
    ENDFOR
    WHILE running DO MoveL {target(2)},v100,z1,tool0; ENDWHILE
    IF a = 1 AND NOT b THEN MoveL {target(3)},v100,z1,tool0;
    ELSEIF c THEN MoveL {target(4)},v100,z1,tool0; ELSE MoveL {target(5)},v100,z1,tool0; ENDIF
    TEST n CASE 1,2: MoveL {target(6)},v100,z1,tool0; DEFAULT: MoveL {target(7)},v100,z1,tool0; ENDTEST
    again: MoveL {target(8)},v100,z1,tool0; GOTO again;
    IF DOutput(do1) = 1 MoveL {target(9)},v100,z1,tool0;
    IF (a > 1) MoveC {target(10)},{target(11)},v100,z1,tool0;
    <SMT>
    %"part_000:Main"%;
    ERROR (ERR_A, ERR_B)
    MoveL {target(12)},v100,z1,tool0; RETRY;
    UNDO MoveJ {target(13)},v100,z1,tool0;"""
    assert (path(body).position[:, 0] * 1e3).tolist() == pytest.approx(list(range(1, 14)))


def test_trap_and_function_routines_have_moves_too():
    text = f"TRAP t\nMoveL {target(1)},v5,fine,tool0;\nENDTRAP\nFUNC num f(num a)\nMoveL {target(2)},v5,fine,tool0;\nENDFUNC"
    assert millimetres(path("", text)) == [[1, 0, 0], [2, 0, 0]]


@pytest.mark.parametrize("tail", [
    "v100,z10,tool0\\WObj:=wobj0", "v100 , z10 , tool0 , \\WObj := wobj0", "v100\\V:=100,z10,tool0",
    "v5\\V:=100,z10\\Inpos:=inpos20,tool0", "v100,z1\\Z:=10,tool0\\WObj:=wobj0\\TLoad:=load1", "V100,Z10,TOOL0",
    "[100,500,5000,1000],[FALSE,10,15,15,1.5,15,1.5],tool0",
])
def test_tails(tail):
    toolpath = path(f"MoveL {target(1)},{tail};\nMoveL {target(1)}\\ID:=10,{tail};\nMoveL \\Conc, {target(1)},{tail};")
    assert len(toolpath) == 3
    assert toolpath.feed.tolist() == pytest.approx([0.1] * 3)
    assert toolpath.zone.tolist() == pytest.approx([0.0 if "Inpos" in tail else 0.01] * 3)
    assert len(toolpath.tools) == len(toolpath.workobjects) == 1
    assert not toolpath.findings


def test_conc_without_comma_counts_alike():
    assert millimetres(path(f"MoveL\\Conc,{target(7)},v100,z1,tool0;MoveJ\\Conc,{target(8)}\\ID:=3,v100,z1,tool0;")) == [
        [7, 0, 0], [8, 0, 0]]


def test_time_in_place_of_speed_is_no_speed():
    toolpath = path(f"MoveL {target(1)},v100\\T:=0.15,z1,tool0;")
    assert np.isnan(toolpath.feed).all()
    assert not toolpath.findings


def test_corr_blocks_the_move():
    toolpath = path(f"MoveL {target(1)},v100,z1,tool0;MoveL {target(2)},v100,z1,tool0\\Corr;"
                    f"MoveL {target(3)},v100,z1,tool0\\WObj:=wobj0\\Corr;")
    assert toolpath.block[0] == ""
    assert "\\Corr" in toolpath.block[1]
    finding, = found(toolpath, "CS2014")
    assert (finding.level, finding.target, finding.count, finding.line) == ("warning", 1, 2, 4)
    assert millimetres(toolpath)[2] == [3, 0, 0]        # still part of the path


def test_program_displacement_does_not_move_joint_targets():
    assert path(f"PDispSet f;MoveAbsJ [[0,0,0,0,0,0],{UNUSED}],v100,z1,tool0;").block[0] == ""


def test_program_displacement_blocks_until_it_is_off():
    move = f"MoveL {target(1)},v100,z1,tool0;"
    toolpath = path(f"{move}PDispSet frame1;{move}{move}PDispOff;{move}PDispOn\\Rot, p1, tool0;{move}pdispoff;{move}")
    assert [bool(block) for block in toolpath.block] == [False, True, True, False, True, False]
    finding, = found(toolpath, "CS2015")
    assert (finding.count, finding.target, finding.level) == (3, 1, "warning")


@pytest.mark.parametrize("instruction", [
    "TriggL p1,v100,gun,z1,tool0", "TriggC p1,p2,v100,gun,z1,tool0", "SearchL\\Stop,di1,sp,p1,v100,tool0",
    "MoveLAO p1,v100,z1,tool0,ao1,1", "MoveJSync p1,v100,z1,tool0,\"proc\"", "ArcLStart p1,v100,s1,w1,z1,tool0",
    "EGMMoveL e,p1,v100,z1,tool0", "SpotL p1,v100,g1,sp1,tool0",
])
def test_other_motion_instructions_are_reported_not_counted(instruction):
    toolpath = path(f"MoveL {target(1)},v100,z1,tool0;\n  {instruction};\nMoveL {target(2)},v100,z1,tool0;")
    assert millimetres(toolpath) == [[1, 0, 0], [2, 0, 0]]
    finding, = found(toolpath, "CS2016")
    assert (finding.line, finding.column, finding.level) == (5, 3, "warning")
    assert instruction.split()[0].split("\\")[0] in finding.message


def test_a_routine_of_the_program_is_not_a_motion_instruction():
    toolpath = path("MoveLStart;", f"PROC MoveLStart()\nMoveL {target(1)},v100,z1,tool0;\nENDPROC")
    assert not found(toolpath, "CS2016")
    assert len(toolpath) == 1


def test_external_axes_and_confdata():
    toolpath = path("MoveL [[1,2,3],[1,0,0,0],[-1,0,2,4],[1500.5,9E9,9E+09,9e+09,-90,9E09]],v100,z1,tool0;")
    assert toolpath.confdata.tolist() == [[-1, 0, 2, 4]]
    np.testing.assert_array_equal(toolpath.external, [[1500.5, np.nan, np.nan, np.nan, -90, np.nan]])


def test_numbers_in_any_spelling():
    toolpath = path("MoveL [[.5,5.,+3],[1.0E+00,-0,0.e1,-1.2E-05],[0,-1,0,0],[9E9,9E+09,9e+09,9E9,9E9,9e9]],v100,z1,tool0;"
                    "MoveL [[ - 1.5 , + 2 , 1E2],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,z1,tool0;")
    assert millimetres(toolpath) == [[0.5, 5, 3], [-1.5, 2, 100]]
    assert toolpath.quaternion[0] == pytest.approx([1, 0, 0, -1.2e-5], abs=1e-9)
    assert toolpath.confdata[0].tolist() == [0, -1, 0, 0]


def test_no_move_at_all():
    toolpath = path("TPWrite \"hello\";")
    assert len(toolpath) == 0
    assert toolpath.position.shape == (0, 3)
    assert toolpath.tools == ()
    assert toolpath.findings == ()

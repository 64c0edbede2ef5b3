"""The order in which a program drives its moves, held against programs unrolled by hand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from compensator.rapid import read_rapid
from compensator.rapid.runs import Runs
from tests.compensator.rapid.small_programs import target


def runs(data: str = "", **routines: str) -> Runs:
    """A module of these routines in this order; m moves once, and counts by its place in the text. data: what it declares."""
    number, text = 0, []
    for name, body in routines.items():
        while "m;" in body:
            body = body.replace("m;", f"MoveL {target(number)},v100,z1,tool0;\n", 1)
            number += 1
        text.append(f"PROC {name}()\n{body}\nENDPROC\n")
    return read_rapid(f"MODULE M\n{data}\n{''.join(text)}ENDMODULE\n".encode()).runs


def unrolled(run: Runs) -> list[int]:
    return [number for stretch in run.driven for number in range(stretch.first, stretch.stop)]


@pytest.mark.parametrize(("routines", "driven"), [
    ({"main": "m;m;"}, [0, 1]),
    ({"rCut": "m;m;", "main": "rCut;"}, [0, 1]),
    ({"rCut": "m;m;", "main": "rCut; rCut;"}, [0, 1, 0, 1]),
    ({"rCut": "m;", "main": "m; rCut; m;"}, [1, 0, 2]),
    ({"MAIN": "rA; rB;", "rB": "m;", "ra": "m;"}, [1, 0]),
    ({"main": "rA; rB;", "rA": "m;", "rB": "m; rC;", "rC": "m;"}, [0, 1, 2]),
    ({"main": "m; FOR i FROM 1 TO 9 DO m; rA; ENDFOR m;", "rA": "m;"}, [0, 1, 3, 1, 3, 2]),
    ({"main": "FOR i FROM 1 TO 2 DO FOR j FROM 1 TO 2 DO m; ENDFOR m; ENDFOR"}, [0, 0, 1, 0, 0, 1]),
    ({"main": "WHILE TRUE DO rA; ENDWHILE", "rA": "m;"}, [0]),
    ({"main": "IF a THEN rA; ELSEIF b THEN rB; ELSE rA; ENDIF", "rA": "m;", "rB": "m;"}, [0, 1]),
    ({"main": "TEST n CASE 1: rA; CASE 2: rA; rB; ENDTEST rB;", "rA": "m;", "rB": "m;"}, [0, 1, 1]),
    ({"main": "IF a rA; IF NOT a rA;", "rA": "m;"}, [0]),
    ({"rA": "m; rA;", "main": "rA;"}, [0]),
    ({"rA": "m;", "rB": "m;"}, [0, 1]),
    ({"main": "rA; m;", "rA": "m; ERROR m; RETRY;"}, [1, 0]),
    ({"main": "FOR i FROM 1 TO 2 DO m; ENDFOR m; UNDO m;"}, [0, 0, 1]),
    ({"main": 'rA; %"RB"%;', "rB": "m;", "rA": "m;"}, [1, 0]),
    ({"main": "WHILE i<9 DO m; i:=i+1; ENDWHILE m;"}, [0, 0, 1]),
    ({"main": "WHILE i<9 DO WHILE wait DO m; ENDWHILE Incr i; ENDWHILE"}, [0, 0]),
    ({"main": "WHILE i<9 DO m; i:=GInput(giPart); n:=n+1; ENDWHILE"}, [0]),
    ({"main": "WHILE DInput(di)=1 DO m; RETURN; ENDWHILE m;"}, [0, 1]),
    ({"main": "WHILE TRUE DO m; RETURN; ENDWHILE m;"}, [0]),
])
def test_the_moves_as_they_are_driven(routines: dict[str, str], driven: list[int]) -> None:
    run = runs(**routines)
    assert unrolled(run) == driven
    assert run.times.tolist() == [driven.count(number) for number in range(run.count)]


@pytest.mark.parametrize(("routines", "order"), [
    ({"main": "m; m;"}, None),
    ({"main": "rA; rB;", "rB": "m;", "rA": "m; m;"}, [1, 2, 0]),
    ({"main": "rA;", "rB": "m;", "rA": "m; ERROR m;"}, [1]),
    ({"main": "rB; rA; rB;", "rA": "m;", "rB": "m;"}, [1, 0, 1]),
    ({"rA": "m; ERROR m;", "rB": "m;"}, [0, 2]),
    ({"main": "FOR i FROM 1 TO n DO rB; ENDFOR rA;", "rA": "m;", "rB": "m;"}, None),    # how often is not said
    ({"main": '%"r"+name%; rA;', "rB": "m;", "rA": "m;"}, None),                        # nor which
    ({"main": 'CallByVar "r",n; rA;', "rB": "m;", "rA": "m;"}, None),
    ({"main": "FOR i FROM 3 TO 1 STEP -2 DO rB; ENDFOR rA;", "rA": "m;", "rB": "m;"}, [1, 1, 0]),
    ({"main": "FOR i FROM 2 TO 1 DO IF i=1 rB; ENDFOR rA;", "rA": "m;", "rB": "m;"}, [1, 0]),
    ({"main": "VAR num n:=0; WHILE n<2 DO rB; Incr n; IF n=2 rA; ENDWHILE", "rA": "m;", "rB": "m;"}, [1, 1, 0]),
    ({"main": "VAR num n; Add n,3; TEST n CASE 1,2: rA; CASE 3: rB; DEFAULT: rA; ENDTEST rA;", "rA": "m;", "rB": "m;"}, [1, 0]),
    ({"main": "IF FALSE THEN rA; ELSEIF TRUE THEN RETURN; ENDIF rB;", "rA": "m;", "rB": "m; m;"}, None),    # nothing is driven
    ({"main": "rB; IF TRUE RETURN; rA;", "rA": "m;", "rB": "m; m;"}, [1, 2]),
    ({"main": "rB; EXIT; rA;", "rA": "m;", "rB": "m; m;"}, [1, 2]),
    ({"main": "rB; IF DInput(di)=1 RAISE; rA;", "rA": "m;", "rB": "m;"}, [1, 0]),      # a pass that fails is none
    ({"main": "rB; GOTO last; rA; last: m;", "rA": "m;", "rB": "m;"}, None),
    ({"main": "VAR num n:=1; TPReadNum n,name; IF n=1 rA; rB;", "rA": "m;", "rB": "m;"}, None),
    ({"main": "VAR num n:=1; IF DInput(di)=1 n:=2; IF n=1 rB; rA;", "rA": "m;", "rB": "m;"}, None),
])
def test_the_order_is_told_where_the_text_settles_it(routines: dict[str, str], order: list[int] | None) -> None:
    found = runs(**routines).order
    assert (None if found is None else found.tolist()) == order


def test_parameters_have_the_values_that_are_handed_over() -> None:
    moves = [f"MoveL {target(number)},v100,z1,tool0;" for number in range(3)]
    text = f"MODULE M\nPROC main()\nrPass 2;\nrPass nPass:=1;\nENDPROC\nPROC rPass(num nPass)\nIF nPass=1 THEN\n{moves[0]}\n" \
           f"ELSE\n{moves[1]}\nENDIF\n{moves[2]}\nENDPROC\nENDMODULE\n"
    found = read_rapid(text.encode()).runs.order
    assert found is not None
    assert found.tolist() == [1, 2, 0, 2]


def test_a_routine_may_be_called_as_a_word_of_the_language_is_not() -> None:
    """`handler` begins nothing, and a variable has its value in its own routine alone."""
    assert unrolled(runs(main="handler; m;", handler="m;")) == [1, 0]
    run = runs(main="VAR num n:=1; rB; IF n=2 rA;", rA="m;", rB="VAR num n:=1; m; n:=n+1; IF n=3 rA;")
    assert unrolled(run) == [1]
    assert run.order is not None


def test_branches_that_ask_for_the_same_go_together() -> None:
    ways = runs(main="IF bRough m; IF NOT bRough m; IF bRough m;").ways
    assert {tuple(way.order.tolist()) for way in ways} == {(0, 2), (1,)}


SKIPPED, BOTH, ALL = {(0, 2)}, {(0, 1, 2), (0, 2)}, {(0, 1, 2)}


@pytest.mark.parametrize(("data", "main", "ways"), [
    # What changes data by its name in a string may change any.
    ("LOCAL VAR bool bTry;", "m; IF bTry m; m;", SKIPPED),
    ("LOCAL VAR bool bTry;", 'm; SetDataVal "bTry",bSet; IF bTry m; m;', BOTH),
    ("LOCAL VAR bool bTry;", 'm; IF DInput(di)=1 SetDataVal "bTry",bSet; IF bTry m; m;', BOTH),
    ("LOCAL VAR num n;", 'm; n:=1; SetAllDataVal "num",nSet; IF n=2 m; m;', BOTH),
    ("CONST bool bTry:=FALSE;", 'm; SetDataVal "bTry",bSet; IF bTry m; m;', SKIPPED),
    # A routine of another file may know what is not local, where it is called at all.
    ("VAR num n;", "m; n:=1; rOther; IF n=2 m; m;", BOTH),
    ("VAR num n;", "m; n:=1; IF DInput(di)=1 rOther; IF n=2 m; m;", BOTH),
    ("LOCAL VAR num n;", "m; n:=1; IF DInput(di)=1 rOther; IF n=2 m; m;", SKIPPED),
    ("", 'm; n:=1; SetDataVal "n",nSet; rOther; IF n=2 m; m;', BOTH),           # a file that declares nothing
    # What the last run has left is not known, nor data that no controller would load.
    ("PERS num n:=5;", "m; IF n=5 m; n:=1; m;", BOTH),
    ("CONST num n:=[1];", "m; IF n=1 m; m;", BOTH),
    ("LOCAL VAR num n:=5;", "m; Clear n; IF n=0 m; m;", ALL),
    ("LOCAL VAR num n:=5;", "m; Add n; IF n=5 m; m;", BOTH),                    # nor what adds nobody knows how much
    ("LOCAL VAR num n:=5;", "m; FOR n FROM 1 TO 1 DO n:=2; IF n=2 m; ENDFOR IF n=5 m;", ALL),
])
def test_data_are_known_as_far_as_nothing_else_can_have_changed_them(data: str, main: str, ways: set[tuple[int, ...]]) -> None:
    assert {tuple(way.order.tolist()) for way in runs(data, main=main).ways} == ways


def test_what_a_trap_assigns_is_not_known() -> None:
    text = f"MODULE M\nLOCAL VAR num n;\nPROC main()\nIF n=0 MoveL {target(0)},v100,z1,tool0;\n" \
           f"MoveL {target(1)},v100,z1,tool0;\nENDPROC\nTRAP tStop\nn:=1;\nENDTRAP\nENDMODULE\n"
    for program, ways in ((text, {(0, 1), (1,)}), (text.replace("n:=1", "k:=1"), {(0, 1)})):
        assert {tuple(way.order.tolist()) for way in read_rapid(program.encode()).runs.ways} == ways


@pytest.mark.parametrize(("main", "ways"), [
    ("WHILE n<2 DO m; k:=n+1; n:=k; ENDWHILE m;", {(0, 0, 1)}),                 # what it asks for changes by a detour
    ("WHILE n<9 DO m; Incr n; IF n=2 RETURN; ENDWHILE m;", {(0, 0)}),
    ("WHILE n<9 DO m; n:=n+1; IF n=3 EXIT; ENDWHILE m;", {(0, 0, 0)}),
    ("FOR i FROM 1 TO 5 DO m; IF i=2 RETURN; ENDFOR m;", {(0, 0)}),
    ("WHILE DInput(di)=1 DO m; RETURN; ENDWHILE m;", {(0,), (1,)}),             # before its first turn, or in it
    ("m; WHILE DInput(di)=1 DO Incr n; ENDWHILE IF n=0 m;", {(0, 1), (0,)}),    # it moves nothing, and counts
    ("WHILE n>=0 DO m; n:=n+1; ENDWHILE m;", set()),                            # without an end
    # What it asks for is settled by what a turn does to something else, or in a routine; or it is left so.
    ("WHILE NOT b DO m; Incr n; IF n=3 b:=TRUE; ENDWHILE m;", {(0, 0, 0, 1)}),
    ("WHILE b=FALSE DO m; n:=n+1; b:=n>=2; ENDWHILE m;", {(0, 0, 1)}),
    ("WHILE TRUE DO m; n:=n+1; IF n=3 RETURN; ENDWHILE m;", {(0, 0, 0)}),
    ("WHILE TRUE DO m; n:=n+1; IF n=2 EXIT; ENDWHILE m;", {(0, 0)}),
    # The cell: it asks somebody, or nothing that its turns change ends it.
    ("WHILE TRUE DO m; n:=n+1; ENDWHILE m;", {(0, 1)}),
    ("WHILE TRUE DO m; n:=n+1; IF DInput(di)=1 RETURN; ENDWHILE m;", {(0,), (0, 1)}),
    ("WHILE NOT b DO m; n:=0; IF n=2 b:=TRUE; ENDWHILE m;", {(0, 1)}),
    ("WHILE NOT b DO m; Incr n; b:=DInput(di)=1; ENDWHILE m;", {(0, 1)}),
])
def test_loops_are_driven_until_they_end(main: str, ways: set[tuple[int, ...]]) -> None:
    run = runs("LOCAL VAR num n; LOCAL VAR num k; LOCAL VAR bool b;", main=main)
    assert {tuple(way.order.tolist()) for way in run.ways} == ways
    if len(ways) == 1:
        [way] = ways
        assert [bool(times > 1) for times in run.times] == [way.count(number) > 1 for number in range(run.count)]


@pytest.mark.parametrize(("main", "own", "order"), [
    ("WHILE n<2 DO rCut; ENDWHILE m;", "m; Incr n;", [1, 1, 0]),
    ("WHILE NOT b DO rCut; ENDWHILE m;", "m; Incr n; IF n=3 b:=TRUE;", [1, 1, 1, 0]),
    ("WHILE TRUE DO rCut; ENDWHILE m;", "m; Incr n; IF n=2 EXIT;", [1, 1]),
    ("WHILE TRUE DO rCut; ENDWHILE m;", "m; Incr n; IF n=2 RETURN;", [1, 0]),       # from the routine alone
])
def test_a_routine_may_end_the_loop_that_calls_it(main: str, own: str, order: list[int]) -> None:
    run = runs("LOCAL VAR num n; LOCAL VAR bool b;", main=main, rCut=own)
    assert [way.order.tolist() for way in run.ways] == [order]
    assert [bool(times > 1) for times in run.times] == [order.count(number) > 1 for number in range(2)]


def test_what_ends_a_loop_may_be_a_parameter_or_declared_elsewhere() -> None:
    run = runs(main="b:=FALSE; n:=0; WHILE NOT b DO m; n:=n+1; IF n=3 b:=TRUE; ENDWHILE m;")
    assert [way.order.tolist() for way in run.ways] == [[0, 0, 0, 1]]
    move = f"MoveL {target()},v100,z1,tool0;"
    text = f"MODULE M\nPROC main()\nrCut 3;\nrCut 2;\nENDPROC\nPROC rCut(num k)\nWHILE TRUE DO\n{move}\nk:=k-1;\n" \
           "IF k=0 RETURN;\nENDWHILE\nENDPROC\nENDMODULE\n"
    assert [way.order.tolist() for way in read_rapid(text.encode()).runs.ways] == [[0] * 5]


def test_a_variable_of_a_routine_begins_anew_with_each_call() -> None:
    run = runs(main="rA; rA;", rA="VAR num n:=1; m; n:=n+1; IF n=3 m;")
    assert {tuple(way.order.tolist()) for way in run.ways} == {(0, 0)}


@pytest.mark.parametrize("bounds", ["1 TO 5 STEP 0", "TRUE TO 5", "1 TO 40000"])
def test_a_loop_whose_turns_cannot_be_counted_may_have_any_number(bounds: str) -> None:
    run = runs(main=f"m; FOR i FROM {bounds} DO m; ENDFOR m;")
    assert {(0, 2), (0, 1, 2), (0, 1, 1, 2), (0, 1, 1, 1, 2)} <= {tuple(way.order.tolist()) for way in run.ways}


@pytest.mark.parametrize("deep", [1, 2, 3])
@pytest.mark.parametrize("down", [True, False])
def test_calls_that_lead_to_moves_are_followed_like_moves(deep: int, down: bool) -> None:
    """Routines of which the last alone moves, in either order in the text; one that leads to no move is no other way."""
    chain = {f"r{k}": f"r{k + 1};" if k < deep else "m;" for k in range(1, deep + 1)}
    idle = {"rIdle": "rNone;", "rNone": "WaitTime 1;"}
    routines = {"main": "m; IF DInput(di)=1 r1; m;", **(chain if down else dict(reversed(chain.items()))), **idle}
    assert {tuple(way.order.tolist()) for way in runs(**routines).ways} == {(0, 2, 1), (0, 1)}
    routines["main"] = "m; WHILE DInput(di)=1 DO r1; ENDWHILE m;"
    assert {(0, 1), (0, 2, 1), (0, 2, 2, 1)} <= {tuple(way.order.tolist()) for way in runs(**routines).ways}
    routines["main"] = "m; IF DInput(di)=1 rIdle; m;"
    assert {tuple(way.order.tolist()) for way in runs(**routines).ways} == {(0, 1)}


def test_too_many_branches_are_no_ways() -> None:
    run = runs(main="IF DInput(di)=1 m; " * 12)
    assert (run.ways, run.open) == ((), True)


def test_a_function_that_moves_leaves_the_order_open() -> None:
    moves = f"MoveL {target(0)},v100,z1,tool0;"
    text = f"MODULE M\nPROC main()\nrA;\nn:=fCut();\nENDPROC\nFUNC num fCut()\n{moves}\nRETURN 1;\nENDFUNC\n" \
           f"PROC rA()\n{moves}\nENDPROC\nENDMODULE\n"
    assert read_rapid(text.encode()).runs.order is None


@pytest.mark.parametrize(("routines", "displaced"), [
    ({"rCut": "m;", "main": "m; PDispSet shift; rCut; PDispOff; m;"}, [True, False, False]),
    ({"main": "m; PDispOn p,t; rCut; PDispOff; m;", "rCut": "m;"}, [False, False, True]),
    ({"main": "PDispSet shift; rCut;", "rCut": "m; PDispOff; m;"}, [True, False]),
    ({"rOff": "PDispOff;", "rOn": "PDispSet shift;", "main": "rOn; m; rOff; m;"}, [True, False]),
    ({"rCut": "m;", "main": "rCut; PDispSet shift; rCut; PDispOff;"}, [True]),
    ({"rCut": "m;", "main": "PDispSet shift; PDispOff; rCut;"}, [False]),
    # A further turn begins with what the one before has switched.
    ({"rCut": "m;", "main": "FOR i FROM 1 TO 2 DO rCut; PDispSet shift; ENDFOR PDispOff; m;"}, [True, False]),
    ({"rCut": "m;", "main": "FOR i FROM 1 TO 1 DO rCut; PDispSet shift; ENDFOR PDispOff; m;"}, [False, False]),
    ({"rCut": "m;", "main": "WHILE n<2 DO rCut; PDispSet shift; Incr n; ENDWHILE"}, [True]),
    ({"rCut": "m;", "main": "WHILE DInput(di)=1 DO rCut; PDispSet shift; ENDWHILE"}, [True]),
    ({"rCut": "m;", "main": "FOR i FROM 1 TO 2 DO rCut; PDispSet shift; PDispOff; ENDFOR"}, [False]),
    ({"rCut": "m;", "main": "WHILE DInput(di)=1 DO rCut; PDispSet shift; RETURN; ENDWHILE"}, [False]),
    # What one of several branches has switched, or a loop that may have no turn.
    ({"rCut": "m;", "main": "IF DInput(di)=1 THEN PDispSet shift; ELSE PDispOff; ENDIF rCut; PDispOff; m;"}, [True, False]),
    ({"rCut": "m;", "main": "PDispSet shift; IF DInput(di)=1 PDispOff; rCut;"}, [True]),
    ({"rCut": "m;", "main": "PDispSet shift; IF DInput(di)=1 THEN PDispOff; ELSE PDispOff; ENDIF rCut;"}, [False]),
    ({"rCut": "m;", "main": "IF DInput(di)=1 THEN PDispSet shift; RETURN; ENDIF rCut;"}, [False]),
    ({"rCut": "m;", "rB": "m;", "main": "IF DInput(di)=1 THEN PDispSet shift; rB; ELSE rCut; ENDIF"}, [False, True]),
    ({"rCut": "m;", "main": "IF DInput(di)=1 THEN rCut; ELSE PDispSet shift; rCut; PDispOff; ENDIF"}, [True]),
    ({"rCut": "m;", "rB": "m;", "rOn": "PDispSet s;", "main": "IF DInput(di)=1 THEN rOn; rB; PDispOff; ELSE rOn; rCut; ENDIF"},
     [True, True]),
    ({"rCut": "m;", "main": "PDispSet shift; FOR i FROM 1 TO nAny DO PDispOff; ENDFOR rCut;"}, [True]),
    ({"rCut": "m;", "main": "PDispSet shift; FOR i FROM 1 TO 3 DO PDispOff; ENDFOR rCut;"}, [False]),
])
def test_a_displacement_goes_along_with_the_calls(routines: dict[str, str], displaced: list[bool]) -> None:
    assert runs(**routines).under("displaced").tolist() == displaced


@pytest.mark.parametrize(("routines", "soft"), [
    ({"main": "m; SoftAct 1,50; m; SoftDeact; m;"}, [False, True, False]),
    ({"rCut": "m;", "main": "m; SoftAct \\MechUnit:=ROB_1,2,30\\Ramp:=100; rCut; SoftDeact;"}, [True, False]),
    ({"main": "m; FCAct t; m; FCDeact; m;"}, [False, True, False]),
    ({"rCut": "m;", "main": "FOR i FROM 1 TO 2 DO rCut; SoftAct 1,50; ENDFOR SoftDeact; m;"}, [True, False]),
    ({"main": "m; CSSAct CSS_X; m; CSSDeactMoveL p0,v5,tool0; m;"}, [False, True, False]),
])
def test_what_is_driven_with_a_soft_servo_stays_as_it_is(routines: dict[str, str], soft: list[bool]) -> None:
    number, text = 0, ""
    for name, body in routines.items():
        text += f"PROC {name}()\n{body}\nENDPROC\n"
    while "m;" in text:
        text = text.replace("m;", f"MoveL {target(number)},v100,z1,tool0;\n", 1)
        number += 1
    toolpath = read_rapid(f"MODULE M\n{text}ENDMODULE\n".encode()).toolpath
    assert ["soft servo" in why for why in toolpath.block] == soft
    assert {finding.code for finding in toolpath.findings if finding.level == "warning"} == {"CS2019"}


@pytest.mark.parametrize("last", ["m;", ""])
def test_routines_that_call_each_other_twice_forty_times_over_end(last: str) -> None:
    """2 to the power of 40 calls: the order is followed no further than people would."""
    run = runs(**{f"r{k}": f"r{k + 1}; r{k + 1};" for k in range(40)}, r40=last)
    assert (run.times > 1).all()


@pytest.mark.parametrize("deep", [3, pytest.param(40, marks=pytest.mark.long), 1200])
def test_loops_within_loops_are_driven_as_one(deep: int) -> None:
    """Each move twice or more; three loops are followed turn by turn, of more the order is open: forty had taken all memory
    there is, thousands had ended as a defect."""
    loops = "".join(f"FOR i{k} FROM 1 TO 2 DO\n" + "m; " * (k % 500 == 0) for k in range(deep))
    run = runs(main=f"{loops} m; {'ENDFOR ' * deep} m;")
    inside = sum(k % 500 == 0 for k in range(deep)) + 1
    assert (len(run.ways) == 1) is (deep == 3)
    assert (run.times[:inside] > 1).all()
    assert run.times[inside:].tolist() == [1]
    assert len(run.driven) < 200_000


def test_calls_within_calls_are_followed_as_far_as_a_controller_would() -> None:
    """A chain of routines, each with a move of its own: a hundred are followed, three thousand are not, and it is not sure."""
    for deep, sure in ((100, True), (3000, False)):
        chain = {f"r{k}": f"m; r{k + 1};" for k in range(deep)} | {f"r{deep}": "m;"}
        run = runs(main="r0;", **chain)
        assert (len(run.ways) == 1) == sure
        assert run.times[:100].tolist() == [1] * 100


@pytest.mark.parametrize(("order", "kept"), [
    ([0, 1, 2, 3], {(-1, 0), (1, 2)}), ([1, 2, 1, 2], {(0, 1), (2, 3)}), ([3, 2, 1, 0], set()),
    ([0, 2, 1, 3, 1, 2], {(-1, 0), (4, 5)}), ([2, 0], set())])
def test_moves_that_are_not_counted_go_with_the_two_targets_they_lie_between(
        order: list[int], kept: set[tuple[int, int]]) -> None:
    """A way along other targets before the first one and between the second and the third: on a path through the same targets
    in another order it is wherever these two follow each other so, and the path begins with it where that one does."""
    text = "".join(f"MoveL {target(number)},v100,z1,tool0;\n" for number in range(4))
    toolpath = replace(read_rapid(f"MODULE M\nPROC main()\n{text}ENDPROC\nENDMODULE\n".encode()).toolpath,
                       uncounted=((-1, 0), (1, 2)))
    taken = toolpath.taken(np.array(order))
    assert set(taken.uncounted) == kept
    np.testing.assert_array_equal(taken.position, toolpath.position[order])
    assert replace(toolpath, uncounted=()).taken(np.array(order)).uncounted == ()


@pytest.mark.parametrize(("deep", "followed"), [(140, True), (160, False)])
@pytest.mark.parametrize("kind", ["branches", "calls"])
def test_a_hundred_and_fifty_blocks_within_blocks_are_followed(kind: str, deep: int, followed: bool) -> None:
    if kind == "branches":
        run = runs(main="IF TRUE THEN\n" * deep + "m;" + "ENDIF\n" * deep)
    else:
        run = runs(main="r0;", **{f"r{k}": f"r{k + 1};" for k in range(deep)}, **{f"r{deep}": "m;"})
    assert [way.order.tolist() for way in run.ways] == [[0]] * followed


@pytest.mark.parametrize(("main", "cut", "driven"), [
    ("FOR i FROM 1 TO 9700 DO rCut; rCut; ENDFOR", 1, 19_400), ("FOR i FROM 1 TO 10300 DO rCut; rCut; ENDFOR", 1, 0),    # calls
    ("FOR i FROM 1 TO 9700 DO rCut; ENDFOR", 10, 97_000), ("FOR i FROM 1 TO 10300 DO rCut; ENDFOR", 10, 0),             # moves
    ("FOR i FROM 1 TO 10 DO rCut; ENDFOR", 10_500, 105_000), ("FOR i FROM 1 TO 11 DO rCut; ENDFOR", 10_500, 0)])
def test_what_is_driven_is_followed_to_twenty_thousand_calls_and_a_hundred_thousand_moves(main: str, cut: int, driven) -> None:
    """Of a program that is larger itself each move may be driven ten times."""
    moves = f"MoveL {target()},v100,z1,tool0;\n" * cut
    text = f"MODULE M\nPROC main()\n{main}\nENDPROC\nPROC rCut()\n{moves}ENDPROC\nENDMODULE\n"
    order = read_rapid(text.encode()).runs.order
    assert (0 if order is None else len(order)) == driven


@pytest.mark.parametrize(("turns", "ways"), [(19_500, {19_500}), (20_500, {0, 1, 2, 3, 4, 5, 6, 7, 8})])
def test_a_loop_is_followed_for_twenty_thousand_turns(turns: int, ways: set[int]) -> None:
    """Of more it may have any number."""
    assert {len(way.order) - 1 for way in runs(main=f"m; FOR i FROM 1 TO {turns} DO m; ENDFOR").ways} == ways


@pytest.mark.parametrize("branches", [6, 7])
def test_sixty_four_ways_are_followed(branches: int) -> None:
    run = runs(main="IF DInput(di)=1 m; " * branches)
    assert (len(run.ways), run.open) == ((64, False) if branches == 6 else (0, True))


@pytest.mark.parametrize(("loops", "turns"), [(1, range(9)), (2, range(5)), (3, range(3)), (4, ())])
def test_loops_that_nobody_counts_have_up_to_eight_turns_of_more_of_them_fewer(loops: int, turns: Sequence[int]) -> None:
    """Every number of turns of the one goes with every one of the others; of four loops there would be too many."""
    run = runs(main="FOR i FROM 1 TO nTurns DO m; ENDFOR " * loops)
    found = {tuple(way.order.tolist().count(number) for number in range(loops)) for way in run.ways}
    assert found == (set(product(turns, repeat=loops)) if turns else set())
    assert run.open is not bool(turns)


@pytest.mark.parametrize("routines", [{"rIdle": "WaitTime 1;"}, {"rIdle": "rNone;", "rNone": "WaitTime 1;"}])
def test_any_number_of_branches_that_drive_nothing_are_one_way(routines: dict[str, str]) -> None:
    """Of sixty-five there would be more ways than are followed."""
    run = runs(main="m; " + "IF DInput(di)=1 rIdle; " * 65 + "m;", **routines)
    assert ([way.order.tolist() for way in run.ways], run.open) == ([[0, 1]], False)


@pytest.mark.parametrize(("data", "order"), [
    ("VAR bool bBack:=TRUE;", [1, 0]), ("VAR bool bBack:=FALSE;", None), ("", None)])
def test_of_several_ways_that_of_the_values_in_the_file_is_the_order(data: str, order: list[int] | None) -> None:
    """A module's data, which somebody may have changed: there are two ways, and theirs comes first; the text's own is none."""
    run = runs(data, main="IF bBack THEN rB; rA; ELSE rA; rB; ENDIF", rA="m;", rB="m;")
    assert {tuple(way.order.tolist()) for way in run.ways} == {(0, 1), (1, 0)}
    assert (None if run.order is None else run.order.tolist()) == order


@pytest.mark.parametrize("word", ["FOR i FROM 1 TO 2 DO\n{}ENDFOR\n", "IF DInput(di)=1 THEN\n{}ENDIF\n"])
def test_what_stands_behind_blocks_too_deep_to_follow_is_driven(word: str) -> None:
    """A routine called behind a hundred and sixty blocks within blocks, of which the innermost hold a move."""
    text = "m;"
    for _ in range(160):
        text = word.format(text)
    run = runs(main=f"{text} rCut;", rCut="m;")
    assert run.times[1] == 1
    assert run.ways == ()


@pytest.mark.parametrize(("main", "ways"), [
    ("WHILE bReady DO rCut; rCut; ENDWHILE", {(0, 0)}), ("WHILE bReady DO rCut; m; rCut; ENDWHILE", {(1, 0, 1)})])
def test_a_cell_that_calls_a_routine_twice_waits_for_the_next_part_too(main: str, ways: set[tuple[int, ...]]) -> None:
    assert {tuple(way.order.tolist()) for way in runs(main=main, rCut="m;").ways} == ways


@pytest.mark.parametrize(("routine", "ways"), [("rOwn", SKIPPED), ("rOther", BOTH)])
def test_a_routine_of_the_file_changes_what_it_assigns_alone(routine: str, ways: set[tuple[int, ...]]) -> None:
    run = runs("VAR num n;", main=f"m; n:=1; {routine}; IF n=2 m; m;", rOwn="WaitTime 1;")
    assert {tuple(way.order.tolist()) for way in run.ways} == ways

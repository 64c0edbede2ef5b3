"""What reading a program says: the sentence, how many targets, and where the first of them stands."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
import pytest

from compensator.rapid import JOINED, read_rapid
from compensator.toolpath import Toolpath
from tests.compensator.rapid.small_programs import program, target

MOVE = "v100,z1,tool0;"


def read(body: str, declarations: str = "", held: Mapping[str, frozenset[str]] | None = None,
         beside: Mapping[str, str] | None = None) -> Toolpath:
    """A program whose statements stand a line each, from line 4 on. held: what each file beside it declares; beside: the file
    of each routine."""
    def declares(names: Iterable[str]) -> Mapping[str, frozenset[str]]:
        return {file: both for file, own in (held or {}).items() if (both := frozenset(own) & frozenset(names))}

    def routines(names: Iterable[str]) -> Mapping[str, str]:
        return {name: file for name, file in (beside or {}).items() if name in names}

    return read_rapid(program(body.replace("; ", ";\n"), declarations).encode(), "job/part.mod", routines, declares).toolpath


def told(toolpath: Toolpath, code: str) -> list[tuple[str, str, int | None, int | None, int]]:
    """Level, sentence, line, target and count of the findings of a code."""
    return [(one.level, one.message, one.line, one.target, one.count) for one in toolpath.findings if one.code == code]


NAMED = "MoveL {},v100,z1,tool0; "


@pytest.mark.parametrize(("names", "held", "said", "give"), [
    (["pA"], {}, "pA is not declared in this file: 1 target is not known and stays as it is", "OTHER.mod"),
    (["pA", "PA"], {}, "pA is not declared in this file: 2 targets are not known and stay as they are", "OTHER.mod"),
    (["pB", "pA", "pB"], {}, "pB and 1 more name are not declared in this file: 3 targets are not known", "OTHER.mod"),
    (["pA", "pB", "pC"], {}, "pA and 2 more names are not declared in this file: 3 targets", "OTHER.mod"),
    (["pA", "pB"], {"b.mod": {"pa", "pb"}}, "declared in this file, but in b.mod beside it: 2", "give both: @ b.mod"),
    (["pA", "pB"], {"b.mod": {"pa", "pb"}, "c.mod": {"pa"}}, "in this file, but in b.mod beside it: 2", "give both: @ b.mod"),
    (["pA", "pB"], {"b.mod": {"pa", "pb"}, "c.mod": {"pa", "pb"}}, "file, but in each of b.mod, c.mod beside it: 2 targets",
     "give it with the one that belongs to it: @ OTHER.mod"),
    (["pA", "pB"], {"b.mod": {"pa"}, "c.mod": {"pb"}}, "in this file, but in b.mod, c.mod beside it: 2 targets",
     "give all of them: @ b.mod c.mod"),
    (["pA", "pB", "pC"], {"b.mod": {"pa"}, "c.mod": {"pb"}}, "in this file; 2 of them are in b.mod, c.mod beside it: 3",
     "give all of them: @ b.mod c.mod"),
    (["pA", "pB"], {"b.mod": {"pb"}}, "in this file; 1 of them is in b.mod beside it: 2 targets", "give both: @ b.mod"),
    (["pA", "pB", "pC", "pD"], {f"{name}.mod": {f"p{name}"} for name in "abcd"},
     "but in a.mod, b.mod, c.mod and 1 more beside it: 4 targets", "give all of them: @ a.mod b.mod c.mod"),
])
def test_names_of_other_files_are_one_finding(
    names: list[str], held: dict[str, frozenset[str]], said: str, give: str
) -> None:
    """At the first of their moves; what to give with it."""
    toolpath = read(NAMED.format(target()) + "".join(NAMED.format(name) for name in names), held=held)
    (level, message, line, number, count), = told(toolpath, "CS2011")
    assert said in message
    assert (level, line, number, count) == ("warning", 5, 1, 1)
    hint, = (one.hint for one in toolpath.findings if one.code == "CS2011")
    given = give.replace("@", "compstiff correct CELL part.mod")
    assert f"{given if ': ' in give else f'part.mod {give}'} --forces LOG -o FOLDER/ takes them as one job" in hint
    assert [why.lower() for why in toolpath.block] == ["", *(f"{name.lower()} is not declared in this file" for name in names)]


@pytest.mark.parametrize(("held", "files"), [({"b.mod": {"pa", "pb"}}, ("b.mod",)), ({"b.mod": {"pa"}}, ()),
                                             ({"b.mod": {"pa"}, "c.mod": {"pb", "pa"}}, ("b.mod", "c.mod"))])
def test_the_files_that_declare_all_targets_are_known(held: dict[str, frozenset[str]], files: tuple[str, ...]) -> None:
    assert read(NAMED.format("pA") + NAMED.format("pB"), held=held).others.targets == files


@pytest.mark.parametrize(("calls", "shown", "listed"), [
    ({"rA": "a.mod"}, "rA in a.mod, beside this file, drives", "a.mod"),
    ({"rA": "a.mod", "rB": "a.mod"}, "rA, rB in a.mod, beside this file, drive", "a.mod"),
    ({"rA": "a.mod", "rB": "b.mod", "rC": "c.mod"}, "rA, rB, rC in a.mod, b.mod, c.mod, beside", "a.mod b.mod c.mod"),
    ({f"r{name.upper()}": f"{name}.mod" for name in "abcd"}, "rA, rB, rC and 1 more in a.mod, b.mod, c.mod and 1 more, beside "
     "this file, drive", "a.mod b.mod c.mod ...")])
def test_routines_that_drive_beside_it_are_one_finding(calls: dict[str, str], shown: str, listed: str) -> None:
    toolpath = read(NAMED.format(target()) + "".join(f"{name}; " for name in calls) + f"rNobody; {next(iter(calls))};",
                    beside={name.lower(): file for name, file in calls.items()})
    (level, message, line, number, count), = told(toolpath, "CS2016")
    assert message.startswith(shown)
    assert message.endswith(": nothing of that is counted or corrected here")
    assert (level, line, number, count) == ("warning", 5, None, len(calls) + 1)
    hint, = (one.hint for one in toolpath.findings if one.code == "CS2016")
    assert f"compstiff post CELL part.mod {listed} -o job.mod;" in hint


def test_what_moves_otherwise_is_told_by_its_name() -> None:
    """Each instruction and each routine of another file that is given a target; not a routine of the program of such a name."""
    body = (f"TriggL {target(1)},v100,tOpen,z1,tool0; triggl pA,v100,tOpen,z1,tool0; rFar {target(2)}; "
            "SearchL di1,p,pA,v10,tool0; ")
    toolpath = read(NAMED.format(target()) + body + f"rFar {target(3)}; rNear 5;")
    assert told(toolpath, "CS2016") == [
        ("warning", "TriggL moves along targets too, but they are neither counted nor corrected", 5, None, 2),
        ("warning", "SearchL moves along targets too, but they are neither counted nor corrected", 8, None, 1),
        ("warning", "rFar is a routine of another file, and is given a target: where it drives is not known, and nothing of it "
         "is counted or corrected", 7, None, 2)]
    text = program(f"{NAMED.format(target())}TriggL;") + f"PROC TriggL()\n{NAMED.format(target(1))}\nENDPROC\n"
    assert told(read_rapid(text.encode()).toolpath, "CS2016") == []


@pytest.mark.parametrize(("more", "joined"), [(1, False), (2, False), (1, True)])
def test_several_modules_are_told_at_the_second(more: int, joined: bool) -> None:
    first = program(NAMED.format(target()))
    between = JOINED.decode() + "b.mod\n" if joined else ""
    text = first + "".join(f"{between}MODULE M{k}\nENDMODULE\n" for k in range(more))
    (level, message, line, number, count), = told(read_rapid(text.encode()).toolpath, "CS2051")
    assert message == (f"the file holds {1 + more} modules: their targets are counted one module after the other, and their "
                       "tools and work objects are all used")
    assert (level, line, number, count) == ("note" if joined else "warning", first.count("\n") + 1 + joined, None, 1)
    assert told(read_rapid(first.encode()).toolpath, "CS2051") == []


def test_a_speed_and_a_zone_that_the_text_does_not_give_are_told_as_written() -> None:
    """Once for each, by what stands for it, 40 letters of it; a move by time has no speed that would be missing."""
    long = "[" + ",".join(f"v{k}{'x' * 8}" for k in range(4)) + "]"
    one = NAMED.format(target())
    body = "".join(one.replace("v100", speed).replace("z1", zone) for speed, zone in (
        ("v100", "z1"), ("vMine", "z1"), ("v100\\V:=nMine", "zMine"), ("vMine", "z1\\Z:=nWide"), ("vOther\\T:=2", "zMine"),
        (long, "z1"), ("vMine\\V:=50", "z1"), ("vMine", "zMine\\Z:=0.5")))
    assert told(read(body), "CS2024") == [
        ("note", "the speed vMine is not known from this file", 5, 1, 3),
        ("note", "the speed nMine is not known from this file", 6, 2, 1),
        ("note", f"the speed {long[:40]} is not known from this file", 9, 5, 1),
        ("note", "the zone zMine is not known from this file", 6, 2, 2),
        ("note", "the zone nWide is not known from this file", 7, 3, 1)]


@pytest.mark.parametrize(("statement", "said"), [
    ("VelSet 100,5000;", ""), ("VelSet 100,100;", ""), ("velset 100, nMost;", ""), ("VelSet Override:=100,Max:=300;", ""),
    ("VelSet 99.9,5000;", "VelSet 99.9,5000"), ("VelSet 100,99.9;", "VelSet 100,99.9"),
    ("VelSet nHalf,5000;", "VelSet nHalf,5000"),
    ("VelSet nOpen , nMost;", "VelSet nOpen,nMost"), ("VelSet 100,nOpen;", "VelSet 100,nOpen"),
    ("VelSet Override:=50,Max:=300;", "VelSet 50,300"), ("IF bSlow VelSet 150,5000;", "VelSet 150,5000"),
    ("SpeedRefresh 100;", ""), ("speedrefresh 99.9;", "SpeedRefresh 99.9"), ("SpeedRefresh nHalf;", "SpeedRefresh nHalf"),
    ("SpeedRefresh nOpen;", "SpeedRefresh nOpen"), ("VelSet 100;", "VelSet 100"),
    ("SpeedRefresh 100,5000;", "SpeedRefresh 100,5000")])
def test_a_speed_that_is_changed_for_all_moves_is_told(statement: str, said: str) -> None:
    """The fastest move has 100 mm/s; a speed that is not known bounds nothing."""
    data = "CONST num nMost:=300;\nCONST num nHalf:=50;\nVAR num nOpen:=100;"
    body = f"{NAMED.format(target())}{statement}\n{NAMED.format(target(1)).replace('v100', 'vMine')}VelSet 100,5000;"
    toolpath = read(body, data)
    assert told(toolpath, "CS2061") == ([(
        "warning", f"{said} changes the speed of moves, which is taken as they state it", 7, None, 1)] if said else [])
    if said:
        again = read(body + f"\n{statement}", data)
        assert [one.count for one in again.findings if one.code == "CS2061"] == [2]


def test_a_routine_of_the_program_may_be_called_as_the_instruction_is() -> None:
    text = program(f"{NAMED.format(target())}VelSet 50,300;\nSpeedRefresh 50;") + "PROC VelSet(num a,num b)\nENDPROC\n"
    assert [one[1] for one in told(read_rapid(text.encode()).toolpath, "CS2061")] == [
        "SpeedRefresh 50 changes the speed of moves, which is taken as they state it"]
    assert told(read_rapid((text + "PROC speedrefresh(num a)\nENDPROC\n").encode()).toolpath, "CS2061") == []


def test_quaternions_that_are_off_are_told_by_the_largest() -> None:
    turns = ["[1,0,0,0]", "[1.02,0,0,0]", "[1.1,0,0,0]", "[1.001,0,0,0]", "[0.5,0,0,0]", "[1.2,0,0,0]"]
    toolpath = read("".join(NAMED.format(target(q=turn)) for turn in turns))
    assert told(toolpath, "CS2012") == [("warning", "the quaternion's sum of squares is off 1 by up to 0.75; above 0.1 the "
                                         "controller refuses it", 6, 2, 3)]
    assert told(toolpath, "CS2013") == [
        ("note", "the quaternion's sum of squares is off 1 by up to 0.0404; it was normalised", 5, 1, 2)]
    why = "the quaternion is not a unit quaternion (its sum of squares is off 1 by {})"
    assert toolpath.block.tolist() == ["", "", why.format(0.21), "", why.format(0.75), why.format(0.44)]


@pytest.mark.parametrize("offset", ["EOffsSet eA", "EOffsOn \\ExeP:=pB, pA"])
def test_what_moves_a_target_at_run_time_is_told_for_each_and_the_first_reason_holds_it(offset: str) -> None:
    axes = target().replace("[9E9,", "[5,", 1)
    along = NAMED.format(target(2)).replace("tool0", "tool0\\Corr")
    toolpath = read(f"{NAMED.format(target(1))}PDispOn pA,tool0; {along}"
                    f"SoftAct 1,20; {NAMED.format('pB')}PDispOff; {offset}; {NAMED.format(axes)}SoftDeact; "
                    f"{NAMED.format(axes)}{NAMED.format(target(3))}")
    left = "the target is left as it is: "
    corr, disp, soft, axis = (
        "the move has \\Corr: the controller adds path corrections at run time",
        "a program displacement (PDispOn, PDispSet) shifts the move at run time",
        "a soft servo or force control (SoftAct, CSSAct, FCAct) lets the robot give way by itself",
        "an offset of the external axes (EOffsOn, EOffsSet) shifts their values at run time")
    assert told(toolpath, "CS2014") == [("warning", left + corr, 6, 1, 1)]
    assert told(toolpath, "CS2015") == [("warning", left + disp, 6, 1, 2)]
    assert told(toolpath, "CS2019") == [("warning", left + soft, 8, 2, 2)]
    assert told(toolpath, "CS4501") == [("warning", left + axis, 11, 3, 2)]
    assert toolpath.block.tolist() == ["", corr, "pB is not declared in this file", soft, axis, ""]


@pytest.mark.parametrize(("main", "told_of"), [
    ("EOffsSet eA; rCut; EOffsOff; rFree;", [1]), ("EOffsSet eA; EOffsOff; rCut; rFree;", []),
    ("rFree; EOffsSet eA; rCut;", [1]), ("FOR i FROM 1 TO 2 DO rCut; EOffsOn pA; ENDFOR", [1])])
def test_an_offset_of_the_axes_goes_along_with_the_calls(main: str, told_of: list[int]) -> None:
    """To the routine that a program calls while it is on; a target without an external axis is not concerned."""
    axes = target(1).replace("[9E9,", "[5,", 1)
    routines = (f"PROC rCut()\n{NAMED.format(target(0))}{NAMED.format(axes)}ENDPROC\n"
                f"PROC rFree()\n{NAMED.format(axes)}ENDPROC\n")
    toolpath = read_rapid(f"MODULE M\n{routines}PROC main()\n{main}\nENDPROC\nENDMODULE\n".encode()).toolpath
    found = told(toolpath, "CS4501")
    assert [(level, place[1:]) for level, _, *place in found] == [("warning", [1, 1])] * bool(told_of)
    assert [bool(why) for why in toolpath.block] == [number in told_of for number in range(3)]


def test_frames_are_told_with_their_moves() -> None:
    """Those without numbers here, those that no correction serves, each with its first move and how many."""
    body = "".join(f"MoveL {target(k)},v100,z1,{tail}; " for k, tail in enumerate((
        "tool0", "tFar", "tFar\\WObj:=wFar", "tHeld\\WObj:=wFar", "tFar\\WObj:=wHeld")))
    data = ("PERS tooldata tHeld:=[FALSE,[[0,0,1],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\n"
            'PERS wobjdata wHeld:=[TRUE,TRUE,"",[[0,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];')
    toolpath = read(body, data)
    assert told(toolpath, "CS2020") == [("note", "tool tFar is not declared with numbers in this file", 6, 1, 3)]
    assert told(toolpath, "CS2021") == [("note", "work object wFar is not declared with numbers in this file", 7, 2, 2)]
    assert told(toolpath, "CS2022") == [("warning", "targets with tool tHeld cannot be corrected: it is stationary (robhold is "
                                         "FALSE)", 8, 3, 1)]
    assert told(toolpath, "CS2023") == [("warning", "targets with work object wHeld cannot be corrected: the robot holds it "
                                         "(robhold is TRUE)", 9, 4, 1)]


def test_each_kind_of_target_that_is_not_known_is_told_once_in_the_order_of_the_text() -> None:
    body = "".join(NAMED.format(name) for name in ("pts{i}", "*", target(), "pts{j}", "pts{3}", "*", "pOpen"))
    found = read(body, f"CONST robtarget pts{{2}}:=[{target(1)},{target(2)}];\nVAR robtarget pOpen;").findings
    assert [(one.code, one.line, one.target, one.count) for one in found] == [
        ("CS2056", 5, 0, 2), ("CS2010", 6, 1, 2), ("CS2010", 9, 4, 1), ("CS2010", 11, 6, 1)]
    assert [one.hint.split(",")[0] for one in found] == [
        "write a move for each position", *3 * ["write it as a robtarget with numbers"]]


FRAMES = ("PERS tooldata tMill:=[TRUE,[[0,0,1],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\n"
          'TASK PERS wobjdata wPart := [FALSE,TRUE,"",[[0,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];')


def test_frames_that_are_handed_over_are_told_by_their_names_as_written() -> None:
    """Where they are declared; of parameters, where the routine has them."""
    moves = f"MoveL {target()},v100,z1,tMill\\WObj:=wPart;\nrMeasure wPart;\n%name% tMill;\nrMEASURE wPart;"
    assert told(read(moves, FRAMES), "CS2058") == [
        ("note", "tool tMill is handed to a routine whose name is made at run time: taken as it is declared here", 2, None, 1),
        ("note", "work object wPart is handed to rMeasure, which is not in this file: taken as it is declared here", 3, None,
         1)]
    routine = f"\nPROC rCut(PERS tooldata tx,PERS wobjdata wx)\nMoveL {target()},v100,z1,tx\\WObj:=wx;\nENDPROC"
    assert told(read("rCut tMill,wPart;", FRAMES + routine), "CS2057") == [
        ("note", "tool or work object tx, wx, a parameter: taken as what every call in this file hands over", 4, None, 2)]


@pytest.mark.parametrize(("text", "line"), [
    ("&&& no RAPID", 1), ("\n  &&& no RAPID", 2), ("MODULE M\nENDMODULE\n&&&", 3), ("", 0), ("MODULE M\nENDMODULE\n! &\n", 0)])
def test_text_that_is_no_statement_is_told_where_it_begins(text: str, line: int) -> None:
    found = told(read_rapid(text.encode()).toolpath, "CS2030")
    said = "the text from here to the end of the file is no RAPID statement and was skipped"
    assert found == ([("warning", said, line, None, 1)] if line else [])


@pytest.mark.parametrize(("text", "started"), [
    ("MODULE M\nPROC {}()\n{}ENDPROC\nENDMODULE\n", False), ("PROC {}()\n{}ENDPROC\n", False), ("! {}\n{}", True)])
def test_a_program_starts_in_a_file_with_main_or_with_moves_alone(text: str, started: bool) -> None:
    """Of one with other routines the file that calls them is not at hand."""
    for name, here in (("rCut", started), ("Main", True)):
        assert read_rapid(text.format(name, NAMED.format(target(1))).encode()).toolpath.others.started == here


@pytest.mark.parametrize(("share", "codes"), [("50+50", []), ("50+40", ["CS2061"])])
def test_a_share_of_the_speed_may_be_worked_out(share: str, codes: list[str]) -> None:
    toolpath = read(f"VelSet {share},5000; {NAMED.format(target(1))}")
    found = [one for one in toolpath.findings if one.code == "CS2061"]
    assert [one.code for one in found] == codes
    assert all(f"VelSet {share},5000" in one.message for one in found)


def test_the_variable_of_a_loop_hides_a_constant_of_its_name() -> None:
    """A call keeps the loop from being followed turn by turn: where its move goes is not known, and not five millimetres on."""
    toolpath = read("FOR n FROM 1 TO 3 DO MoveL Offs(p1,n,0,0),v100,z1,tool0; rOther; ENDFOR ",
                    f"CONST num n:=5;\nCONST robtarget p1:={target(1)};")
    assert toolpath.block[0] != ""
    assert np.isnan(toolpath.position[0, 0])

"""Routines and data in the files beside a program."""

from __future__ import annotations

from pathlib import Path

import pytest

from compensator.posting.read_toolpath import read_toolpath
from identification.model.cell import read_cell
from tests.support import write_cell

TARGET = "MoveL [[0,0,0],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,z1,tool0;"


def told(folder: Path, name: str, before: int) -> list[str]:
    """What is said of a program that calls `rHome`, which drives in `name`, beside so many others whose names come first."""
    for number in range(before):
        (folder / f"a{number:03d}.mod").write_text("MODULE A\nENDMODULE\n")
    (folder / name).write_text(f"MODULE Z\nPROC rHome()\n{TARGET}\nENDPROC\nENDMODULE\n")
    (folder / "part.mod").write_text(f"MODULE Part\nPROC main()\n{TARGET}\nrHome;\nENDPROC\nENDMODULE\n")
    read = read_toolpath(folder / "part.mod", read_cell(write_cell(folder)))
    return [one.message for one in read.toolpath.findings if one.code == "CS2016"]


@pytest.mark.parametrize(("name", "before", "found"), [
    ("zz.mod", 199, True), ("zz.mod", 200, False), ("rHome.mod", 200, True), ("rhome.Mod", 250, True)])
def test_two_hundred_files_beside_a_program_are_looked_through_the_one_of_the_routines_name_first(
        tmp_path: Path, name: str, before: int, found: bool) -> None:
    said = told(tmp_path, name, before)
    assert len(said) == found
    assert all(f"rHome in {name}, beside this file, drives" in message for message in said)


@pytest.mark.parametrize(("megabytes", "found"), [(1, True), (65, False)])
def test_64_megabytes_beside_a_program_are_looked_through(tmp_path: Path, megabytes: int, found: bool) -> None:
    with (tmp_path / "a.mod").open("wb") as other:
        other.truncate(megabytes << 20)
    assert len(told(tmp_path, "zz.mod", 0)) == found


@pytest.mark.parametrize(("body", "drives"), [
    (TARGET, True), (f"IF bReady {TARGET}", True), (f"IF bReady THEN {TARGET} ENDIF", True), (f"again: {TARGET}", True),
    (f"TEST n CASE 1: {TARGET} ENDTEST", True), (f"MoveL\n{TARGET[6:]}", True), (TARGET.upper(), True),
    ("IF bReady SearchL di1,p,q,v10,tool0;", True), ("rCut;", True),
    ("IF bReady rCut;", True), ("IF bReady THEN rCut; ENDIF", True), ("FOR k FROM 1 TO 2 DO rCut; ENDFOR", True),
    ("rCut nDeep:=5;", True), ("rCut\n  5;", True), ("again: RCUT 5;", True), ('%"rCut"%;', True), ("rLeads;", True),
    ("", False), ("rIdle;", False), (f"! {TARGET}", False), (f"n:=1; ! {TARGET}", False), ('TPWrite "MoveL now";', False),
    ("nMoveL:=1;", False), ("! rCut;", False), ('TPWrite "rCut; next";', False), ('TPWrite "5 % rCut";', False),
    ("rCutNot;", False), ("AccSet 50,50;", False),
    ("VAR num rCut:=5;\nSet do1,rCut;", False), ('%"rIdle"%; TPWrite "rCut";', False)])
def test_a_routine_beside_drives_that_moves_or_calls_one_that_does_wherever_on_its_line(
    tmp_path: Path, body: str, drives: bool
) -> None:
    """Behind IF, THEN, DO, a label or a CASE too; not in a comment or in a text."""
    (tmp_path / "other.mod").write_text(
        f"MODULE Other\nPROC rHome()\n{body}\nENDPROC\nPROC rLeads()\nIF bReady rCut;\nENDPROC\nPROC rIdle()\nSet do1;\n"
        f"ENDPROC\nPROC rCut(num n)\n{TARGET}\nENDPROC\nENDMODULE\n")
    (tmp_path / "part.mod").write_text(f"MODULE Part\nPROC main()\n{TARGET}\nrHome;\nENDPROC\nENDMODULE\n")
    read = read_toolpath(tmp_path / "part.mod", read_cell(write_cell(tmp_path)))
    said = [one.message for one in read.toolpath.findings if one.code == "CS2016"]
    assert ["rHome in other.mod, beside this file, drives" in message for message in said] == [True] * drives

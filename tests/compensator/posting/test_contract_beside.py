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

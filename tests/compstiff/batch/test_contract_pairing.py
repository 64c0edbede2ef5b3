"""Toolpaths of other systems in a folder: known by their ending, paired by their stem."""

import json
import shutil
from pathlib import Path

import pytest

from compstiff import read_cell
from compstiff.batch.pairing import Folders, no_log, paired, programs_in
from identification.common.findings import CompstiffError
from tests.compensator.cutting.test_contract_asked import job, stiff, told
from tests.runs.command_line import user_files as kit


def test_every_ending_that_is_read_is_found_with_its_log(tmp_path):
    for name in ("a.mod", "b.ncl.3", "c.aptsource", "d.CLS", "e.ncl", "f.mod.1", "g.txt", "b.forces.csv", "c.forces.csv",
                 ".h.ncl.1"):
        (tmp_path / name).write_text("")
    programs = programs_in(tmp_path)
    assert [path.name for path in programs] == ["a.mod", "b.ncl.3", "c.aptsource", "d.CLS", "e.ncl"]
    files = {one.program.name: one for one in paired(programs, None, Folders(Path("out"), Path("out"), Path("out")))}
    assert [log.name for log in files["b.ncl.3"].logs] == ["b.forces.csv"]
    assert [path.name for path in files["b.ncl.3"].outputs.files()][:3] == ["b.mod", "b.mod.json", "b.offsets.csv"]
    assert files["e.ncl"].logs == ()


def test_two_versions_of_one_file_are_rivals(tmp_path):
    for name in ("a.ncl.1", "a.ncl.2"):
        (tmp_path / name).write_text("")
    assert all(one.rival for one in paired(programs_in(tmp_path), None, Folders(Path("out"))))


@pytest.mark.parametrize(("second", "predicted"), [
    ("stock.npz", True), ("stock.yml", True), ("stock.yaml.bak", True), ("stock.npz", False)])
def test_a_program_with_two_stock_files_is_not_corrected(tmp_path: Path, second: str, predicted: bool) -> None:
    """Nor is the other one of the folder left out for it; where no forces are predicted stocks are no matter."""
    folder, out = tmp_path / "in", tmp_path / "out"
    folder.mkdir()
    program = job(tmp_path)
    (tmp_path / "stiffness.json").write_text(json.dumps(stiff(read_cell(tmp_path / "cell.yaml")).as_dict()))
    for name in ("one", "two"):
        shutil.copy(program, folder / f"{name}.mod")
        shutil.copy(tmp_path / "stock.yaml", folder / f"{name}.stock.yaml")
    (folder / f"two.{second}").write_text("another")
    run = kit.run("correct", tmp_path / "cell.yaml", folder, "--stiffness", tmp_path / "stiffness.json", "--json", "-o",
                  f"{out}/", *(["--predict-force", told(tmp_path)] if predicted else []))
    said = {Path(line["program"]).stem: line for line in map(json.loads, run.out.splitlines())}
    double = predicted and second != "stock.yaml.bak"
    assert {name: line["status"] for name, line in said.items()} == (
        {"one": "ok", "two": "failed" if double else "ok"} if predicted else {"one": "left", "two": "left"}), run
    found = [(name, one) for name, line in said.items() for one in line["findings"] if one["code"] == "CS4736"]
    assert [(name, one["level"], one["message"], one["file"]) for name, one in found] == ([
        ("two", "error", f"has 2 stock files: two.stock.yaml, two.{second}", str(folder / "two.mod"))] if double else [])
    assert (run.code, (out / "two.mod").exists()) == ((1, False) if double else (0, predicted))


@pytest.mark.parametrize("name", ["output", "offsets", "report"])
def test_a_file_where_a_folder_is_to_be_made_is_told(tmp_path: Path, name: str) -> None:
    places = {each: tmp_path / each / "deeper" for each in ("output", "offsets", "report")}
    Folders(**places).make()
    assert all(place.is_dir() for place in places.values())
    Folders(**places).make()
    (tmp_path / "taken").write_text("mine")
    with pytest.raises(CompstiffError) as stopped:
        Folders(**places | {name: tmp_path / "taken"}).make()
    assert [(one.code, one.file, bool(one.hint)) for one in stopped.value.findings] == [
        ("CS0004", str(tmp_path / "taken"), True)]
    assert (tmp_path / "taken").read_text() == "mine"


def test_a_folder_that_is_none_is_told(tmp_path: Path) -> None:
    for folder in (tmp_path / "away", tmp_path / "file.mod"):
        (tmp_path / "file.mod").write_text("")
        with pytest.raises(CompstiffError) as stopped:
            programs_in(folder)
        assert [(one.code, one.file) for one in stopped.value.findings] == [("CS0005", str(folder))]


@pytest.mark.parametrize(("beside", "near"), [
    (("part1_forces.csv",), "part1_forces.csv"), (("Part1.Forces.CSV",), "Part1.Forces.CSV"),
    (("part1.force.csv",), "part1.force.csv"), ((), ""),
    (("part1.csv",), ""), (("forces.csv",), ""), (("other.forces.csv",), ""), (("part1_forces.txt",), ""),
    (("part10.mod", "part10.forces.csv"), ""), (("PART10.MOD", "part10_forces.csv"), ""),
    (("part10.forces.csv",), "part10.forces.csv"),
    (("part10.mod", "part10.forces.csv", "part1-force.parquet"), "part1-force.parquet")])
@pytest.mark.parametrize("watched", [True, False])
def test_a_log_of_nearly_the_program_s_name_is_asked_about(
        tmp_path: Path, beside: tuple[str, ...], near: str, watched: bool) -> None:
    """Not the log of another program that lies beside it, whose name begins as this one's: renamed, its forces would be taken
    for those of this one."""
    for name in ("part1.mod", *beside):
        (tmp_path / name).write_text("")
    found = no_log(tmp_path / "part1.mod", None, "it waits", watched=watched)
    assert (found.code, found.level, found.file) == ("CS6000", "warning", str(tmp_path / "part1.mod"))
    assert found.message == f"has no force log part1.forces.csv (or .parquet) in {tmp_path}; it waits"
    assert found.hint == (f"is it {near}? Then rename it, capitals too; else " if near else "") + (
        "log the forces of a first pass, and put the log beside the program" if watched
        else "log the forces of a first pass, or name the folder of the logs with --forces")


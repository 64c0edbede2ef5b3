"""Toolpaths of other systems in a folder: known by their ending, paired by their stem."""

import json
import shutil
from collections import deque
from concurrent.futures import BrokenExecutor, Future
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from compstiff import read_cell
from compstiff.batch.pairing import Folders, logs_without_program, no_log, paired, programs_in, share_of
from compstiff.batch.processes import handed_out
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



def files(folder: Path, *names: str) -> list[Path]:
    folder.mkdir(exist_ok=True)
    for name in names:
        (folder / name).write_text(name)
    return [folder / name for name in names]


def test_a_program_has_one_log_of_its_own(tmp_path: Path) -> None:
    """Beside it, or in the folder that is named; of several logs, and of one that two programs would take, none is guessed."""
    programs = files(tmp_path, "a.mod", "b.mod", "b.apt", "c.mod")
    files(tmp_path, "a.forces.csv", "a.forces.pq", "c.forces.parquet")
    logs = tmp_path / "logs"
    files(logs, "a.forces.csv", "b.forces.csv")
    one, two, three, four = paired(programs, None, Folders(tmp_path / "out"))
    with pytest.raises(CompstiffError, match=r"a.mod: error CS6001: has 2 force logs: a.forces.csv, a.forces.pq"):
        _ = one.forces
    for program, rival in ((two, "b.apt"), (three, "b.mod")):
        with pytest.raises(CompstiffError, match=f"{program.program.name}: error CS6002: and {tmp_path / rival} have the same"):
            _ = program.forces
    assert (four.forces, four.own) == (tmp_path / "c.forces.parquet", (tmp_path / "c.mod", tmp_path / "c.forces.parquet"))
    elsewhere = paired([programs[0], programs[3], programs[0]], logs, Folders(tmp_path / "out"))
    assert [one.forces for one in elsewhere] == [logs / "a.forces.csv", None]
    # Of one folder into another of the same name of file: by log, not by output, they are rivals.
    other, = files(tmp_path / "second", "a.mod")
    assert [one.rival for one in paired([programs[0], other], logs, Folders(tmp_path / "out"))] == [other, programs[0]]


def test_a_log_beside_which_no_program_lies_is_told(tmp_path: Path) -> None:
    files(tmp_path, "a.mod", "a.forces.csv", "A.forces.csv", "b.forces.pq", "c.apt", "c.forces.parquet", "d.forces.txt")
    found = [(one.code, one.level, one.file, one.message.partition(" (or")[0]) for one in logs_without_program(tmp_path)]
    said = "is a force log, and no program {}.mod"
    assert found == [("CS6013", "warning", str(tmp_path / f"{stem}.forces.{suffix}"), said.format(stem))
                     for stem, suffix in (("A", "csv"), ("b", "pq"))]


@pytest.mark.parametrize("parts", [1, 2, 5])
def test_each_program_is_in_one_part_by_what_stands_in_it(tmp_path: Path, parts: int) -> None:
    """One that cannot be read is in the first, which says so."""
    programs = files(tmp_path, *(f"p{k}.mod" for k in range(20)))
    batch = paired([*programs, tmp_path / "none.mod"], None, Folders(tmp_path / "out"))
    shares = [[one.program.name for one in share_of(batch, (part, parts))] for part in range(1, parts + 1)]
    assert sorted(name for share in shares for name in share) == sorted(one.program.name for one in batch)
    assert shares[0][-1] == "none.mod"
    alone = [share_of(batch[k:k + 1], (part, parts)) for k in range(20) for part in range(1, parts + 1)]
    assert sum(map(len, alone)) == 20


@pytest.mark.parametrize("seed", range(6))
def test_programs_come_back_in_order_and_none_begins_before_its_turn(seed: int) -> None:
    """Whichever of those under way is done first; none is begun after a stop, or where no more are taken."""
    rng = np.random.default_rng((6030, seed))
    count, at_once = int(rng.integers(5, 15)), int(rng.integers(1, 5))
    last = count if seed % 3 == 0 else int(rng.integers(1, count))
    begun: list[Future[int]] = []

    def submit(program: Any) -> Future[int]:
        under_way = [future for future in begun if not future.done()]
        assert len(under_way) < at_once
        if seed % 3 == 2 and len(begun) == last:
            raise BrokenExecutor
        future = Future[int]()
        begun.append(future)
        if len(under_way) + 1 == at_once or len(begun) == last:       # nobody waits for ever
            for done in rng.permutation(len(under_way) + 1)[:None if len(begun) == last else 1]:
                [*under_way, future][done].set_result(0)
        return future

    left = deque(range(count))
    found = handed_out(cast(Any, left), submit, at_once, lambda: seed % 3 == 1 and len(begun) == last)
    assert [program for program, future in found if future.done()] == list(range(last))
    assert list(left) == list(range(last, count))

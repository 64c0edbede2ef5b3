"""What is said of each program of a batch, what the call ends with, and what makes a program another one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Any

import pytest

from compensator.correction.files import Outputs
from compensator.correction.settings import Settings
from compensator.cutting.settings import CuttingSettings
from compstiff.batch import running
from compstiff.batch.pairing import Folders, ProgramFiles, paired
from compstiff.batch.programs import ProgramResult, Shared, content_key, worst
from compstiff.batch.running import correct_programs
from compstiff.outcome import Outcome
from identification.common.files import sha256
from identification.common.findings import Finding
from tests.support import write_cell

# From bad to good: an interrupt, a defect, what could not be done, a refusal, and what was done.
CODES = [130, 70, 1, 3, 0]


def test_the_worst_of_the_programs_is_what_the_call_ends_with() -> None:
    for size in range(1, 6):
        for codes in combinations(CODES, size):
            assert worst(codes) == worst(codes[::-1]) == codes[0]
    assert worst([]) == 0


@pytest.fixture
def shared(tmp_path: Path) -> Shared:
    (tmp_path / "stiffness.json").write_text("{}")
    return Shared(write_cell(tmp_path), tmp_path / "stiffness.json")


def files_in(folder: Path, *more: str) -> ProgramFiles:
    for name in ("part.mod", *more):
        (folder / name).write_text(f"{name}\n")
    (files,) = paired([folder / "part.mod"], None, Folders(folder / "out"), predicted=True)
    return files


@pytest.mark.parametrize(("added", "said"), [(0, ""), (2, " (2 of them added)")])
def test_a_program_that_was_corrected_is_told_in_one_line(tmp_path: Path, added: int, said: str) -> None:
    """What is left is told at two sigma, as everywhere."""
    files = ProgramFiles(tmp_path / "part.mod", (), Outputs(tmp_path / "out" / "part.mod"))
    result = {"corrected": 5, "corrected_added": added, "offset_mm": {"largest": 0.43216}, "cutting_stiffness": None,
              "expected_left_um": {"rms": 10.0, "cut": 5.0}}
    assert ProgramResult(files, 0, "ok", (), {"result": result}).lines() == [
        f"{files.program} -> {files.outputs.program}: 5 targets corrected{said}, largest 0.4322 mm; expected to be left on the "
        "part, 2 sigma: 20.0 um RMS"]


@pytest.mark.parametrize(("status", "code", "said"), [
    ("failed", 1, "failed (exit 1), CS0005"), ("refused", 3, "refused (exit 3), CS0005"), ("left", 0, "has a note"),
    ("waiting", 0, "has a note")])
def test_a_program_that_was_not_is_told_with_its_first_error(
    tmp_path: Path, shared: Shared, status: str, code: int, said: str
) -> None:
    files = files_in(tmp_path, "part.forces.csv", "part.stock.yaml")
    findings = (Finding("CS0204", "note", "has a note"), Finding("CS0005", "error", "one"), Finding("CS0003", "error", "two"))
    result = ProgramResult.of(files, shared, Outcome(findings=findings), status, code)
    assert result.lines() == [f"{files.program}: {said}"]
    document = result.as_dict()
    assert (document["program"], document["output"], document["exit_code"]) == (str(files.program), None, code)
    assert [Path(one["file"]).name for one in document["inputs"]] == [
        "cell.yaml", "part.mod", "stiffness.json", "part.forces.csv", "part.stock.yaml"]
    more = result.with_finding(Finding("CS6012", "warning", "and this"))
    assert [one["code"] for one in more.as_dict()["findings"]] == ["CS0204", "CS0005", "CS0003", "CS6012"]
    assert more.findings[-1].code == "CS6012"
    assert len(result.as_dict()["findings"]) == 3
    done = ProgramResult.of(files, shared, Outcome(), "ok", 0)
    assert done.as_dict()["output"] == str(files.outputs.program)


@pytest.mark.parametrize("has_log", [True, False])
@pytest.mark.parametrize("has_stock", [True, False])
def test_forces_are_predicted_with_a_program_s_own_stock_and_the_tare_is_for_its_log(
    tmp_path: Path, shared: Shared, has_log: bool, has_stock: bool
) -> None:
    settings = replace(Settings.of(tare=((0, 2),)), cutting=CuttingSettings(predict_force=tmp_path / "coefficients.json"))
    settings = replace(settings, log=replace(settings.log, spindle_rpm=9000.0))
    shared = replace(shared, settings=settings)
    files = files_in(tmp_path, *["part.forces.csv"] * has_log, *["part.stock.yaml"] * has_stock)
    found = shared.of(files)
    assert (found.cutting.stock, found.cutting.predict_force) == (
        (tmp_path / "part.stock.yaml", tmp_path / "coefficients.json") if has_stock else (None, None))
    assert (found.log.tare, found.log.spindle_rpm) == (settings.log.tare if has_log else Settings().log.tare, 9000.0)
    assert found.correction == settings.correction
    assert (shared.predicted, replace(shared, settings=Settings()).predicted) == (True, False)


CHANGES: dict[str, Callable[[Path, ProgramFiles, Shared], tuple[ProgramFiles, Shared]]] = {
    "its text": lambda folder, files, shared: (_written(files, folder / "part.mod"), shared),
    "its log": lambda folder, files, shared: (_written(files, folder / "part.forces.csv"), shared),
    "its stock": lambda folder, files, shared: (_written(files, folder / "part.stock.yaml"), shared),
    "the cell": lambda folder, files, shared: (_written(files, folder / "cell.yaml"), shared),
    "the springs": lambda folder, files, shared: (_written(files, folder / "stiffness.json"), shared),
    "an option": lambda folder, files, shared: (files, replace(shared, settings=Settings.of(tare=((0, 3),)))),
    "a file that is named": lambda folder, files, shared: (_written(files, folder / "learned.json"), shared),
    "a rival": lambda folder, files, shared: (replace(files, rival=folder / "part.apt"), shared),
    "its name": lambda folder, files, shared: (replace(files, program=folder / "other.mod"), shared)}


def _written(files: ProgramFiles, file: Path) -> ProgramFiles:
    file.write_text(file.read_text() + "# more\n")
    return files


@pytest.mark.parametrize("what", ["nothing", *CHANGES])
def test_a_program_is_another_one_by_what_it_is_made_from(tmp_path: Path, shared: Shared, what: str) -> None:
    """Its own files, and what all share; where it lies, and where it is written to, is no matter."""
    files = files_in(tmp_path, "part.forces.csv", "part.stock.yaml")
    (tmp_path / "learned.json").write_text("{}\n")
    (tmp_path / "other.mod").write_text("part.mod\n")
    settings = replace(shared.settings, correction=replace(shared.settings.correction, learned=tmp_path / "learned.json"))
    shared = replace(shared, settings=settings)

    def key(files: ProgramFiles, shared: Shared) -> str:
        return content_key(files, shared, [sha256(path) for path in files.own])

    before = key(files, shared)
    if what == "nothing":
        assert key(replace(files, outputs=Outputs(tmp_path / "elsewhere.mod")), shared) == before
    else:
        assert key(*CHANGES[what](tmp_path, files, shared)) != before


@pytest.mark.parametrize("after", [0, 1, 3])
def test_once_stopped_no_further_program_is_begun(
    tmp_path: Path, shared: Shared, monkeypatch: pytest.MonkeyPatch, after: int
) -> None:
    begun: list[str] = []

    def corrected(files: ProgramFiles, _: Shared) -> Any:
        begun.append(files.program.name)
        return files.program.name

    monkeypatch.setattr(running, "correct_program", corrected)
    batch = [ProgramFiles(tmp_path / f"p{k}.mod", (), Outputs(tmp_path / f"q{k}.mod")) for k in range(3)]
    found = list(correct_programs(batch, shared, stopped=lambda: len(begun) == after))
    assert found == begun == [f"p{k}.mod" for k in range(after)]

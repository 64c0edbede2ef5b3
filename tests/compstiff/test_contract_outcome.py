"""What a job leaves to say: its inputs by their content, and files that an earlier call left where its own would stand."""

from __future__ import annotations

import hashlib
from pathlib import Path

import pytest

import compstiff
from compstiff.outcome import DONE, REFUSED, Outcome, Session, attempt, document
from identification.common import files
from identification.common.findings import error


def test_inputs_are_told_by_their_content(tmp_path: Path) -> None:
    """Those that can be read."""
    file = tmp_path / "a.csv"
    file.write_bytes(b"1,2\n")
    session = Session("verify", inputs=[file, tmp_path / "gone.csv"])
    shown = document(session, Outcome({"a": 1}), "ok", DONE)
    assert shown == {"format": "compstiff-verify", "version": 1, "status": "ok", "exit_code": 0, "findings": [],
                     "inputs": [{"file": str(file), "sha256": hashlib.sha256(b"1,2\n").hexdigest()}], "result": {"a": 1}}
    assert document(session, Outcome(), "ok", DONE)["result"] == {}
    assert document(session, Outcome(), "failed", 1)["result"] is None


@pytest.mark.parametrize(("there", "words"), [
    ("a", "a.mod stands there still"), ("ab", "a.mod and b.mod stand there still"),
    ("abc", "a.mod, b.mod and c.mod stand there still"), ("", "")])
@pytest.mark.parametrize("refused", [False, True])
def test_files_of_an_earlier_call_are_told_where_nothing_was_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, there: str, words: str, refused: bool
) -> None:
    """Of outputs that are still there: one that this call wrote before it stopped is its own."""
    outputs = [tmp_path / f"{name}.mod" for name in "abc"]
    for name in there:
        (tmp_path / f"{name}.mod").write_text("")
    own = tmp_path / "own.mod"
    own.write_text("")
    monkeypatch.setattr(files, "earlier", [tmp_path / "of_another.mod"])
    monkeypatch.setattr(files, "written", [])

    def body() -> Outcome:
        files.earlier.extend([*outputs, outputs[0]])
        if refused:
            return Outcome(exit_code=REFUSED)
        files.earlier.append(own)
        files.written.append(own)
        raise error("CS0202", "no column x_mm", file="a.csv")

    outcome, status, code = attempt(Session("correct"), body)
    assert (status, code) == (("refused", 3) if refused else ("failed", 1))
    said = [finding for finding in outcome.findings if finding.code == "CS0014"]
    assert [(one.level, one.message) for one in said] == (
        [("warning", f"{words}, of an earlier call: nothing was written now")] if words else [])


def test_a_job_that_is_done_says_nothing_of_what_it_wrote_over(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a.mod").write_text("")
    monkeypatch.setattr(files, "earlier", [])
    monkeypatch.setattr(files, "written", [])

    def body(code: int, written: bool) -> Outcome:
        files.earlier.append(tmp_path / "a.mod")
        files.written.extend([tmp_path / "a.mod"] * written)
        return Outcome(exit_code=code)

    for code, written in ((DONE, True), (REFUSED, True)):
        assert attempt(Session("verify"), lambda code=code, written=written: body(code, written))[0].findings == ()


def test_a_new_cell_makes_its_folder_or_takes_one_that_is_there(tmp_path: Path) -> None:
    answers = compstiff.CellAnswers("irb6660-205-1.90", (120, 0, 250), tool_mass=80)
    (tmp_path / "there" / "programs").mkdir(parents=True)
    for folder in (tmp_path / "shop" / "cell", tmp_path / "there"):
        made = compstiff.new_cell(folder, answers)
        assert all(file.is_file() for file in made.files)
        assert (folder / "programs").is_dir()
        with pytest.raises(compstiff.CompstiffError, match="CS0003"):
            compstiff.new_cell(folder, answers)

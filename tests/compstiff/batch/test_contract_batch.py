"""`correct` on many programs: each as if alone, one JSON line each, the exit code of the worst."""

from __future__ import annotations

import json
import os
import shlex
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from compensator.correction.files import Outputs
from compstiff.batch import programs
from compstiff.batch.pairing import Folders, ProgramFiles, no_log, paired
from compstiff.batch.programs import ProgramResult, Shared
from compstiff.cli import correct_batch
from compstiff.outcome import Session
from tests.compstiff.batch.programs import HARMLESS, Shop, shop
from tests.support import started


@pytest.fixture
def place(tmp_path: Path) -> Shop:
    return shop(tmp_path)


def test_each_program_comes_out_as_if_alone(place: Shop) -> None:
    place.put("a", "b")
    place.put("c", log=False)
    out = place.folder / "out"
    done = place.correct(place.source / "a.mod", place.source / "b.mod", place.source / "c.mod", "-o", f"{out}/", "--json")
    assert done.exit_code == 0, done.output
    lines = [json.loads(line) for line in done.stdout.splitlines()]
    assert [Path(line["program"]).name for line in lines] == ["a.mod", "b.mod", "c.mod"]
    assert [line["status"] for line in lines] == ["ok", "ok", "left"]
    assert lines[2]["output"] is None
    left = lines[2]["findings"][0]
    assert (left["code"], left["message"]) == (
        "CS6000", f"has no force log c.forces.csv (or .parquet) in {place.source}; it is left alone")
    # Nor is anything said of stocks where no force is to be predicted.
    assert not any(finding["code"] in ("CS6000", "CS4737") for line in lines[:2] for finding in line["findings"])
    alone = place.alone()
    assert alone != place.part.read_bytes()
    assert (out / "a.mod").read_bytes() == (out / "b.mod").read_bytes() == alone
    assert sorted(path.name for path in out.iterdir()) == ["a.mod", "a.mod.json", "b.mod", "b.mod.json"]
    record = json.loads((out / "b.mod.json").read_text())
    assert (record["input"]["file"], record["forces"]["file"]) == ("b.mod", "b.forces.csv")


def test_one_that_fails_does_not_stop_the_others_and_the_worst_counts(place: Shop) -> None:
    a, b, c = place.put("a", "b", "c")
    (place.source / "a.forces.csv").write_text("target,fx_n\n1,2\n")
    out = place.folder / "out"
    done = place.correct(a, b, c, "-o", out)
    assert done.exit_code == 1
    assert "CS0202" in done.stderr
    assert "3 programs: 1 failed, 2 corrected" in done.stdout
    assert (out / "b.mod").exists()
    assert not (out / "a.mod").exists()
    # What this very call wrote is refused as input, whatever its name: 3, and with a failure beside it 1.
    shutil.copy(out / "b.mod", place.source / "again.mod")
    shutil.copy(place.log, place.source / "again.forces.csv")
    refused = place.correct(place.source / "again.mod", *place.put("d"), "-o", out, "--json")
    assert refused.exit_code == 3
    assert [json.loads(line)["exit_code"] for line in refused.stdout.splitlines()] == [3, 0]
    assert place.correct(a, place.source / "again.mod", *place.put("e"), "-o", out).exit_code == 1


@pytest.mark.parametrize("quiet", [True, False])
def test_what_is_said_of_each_program_is_on_stderr_and_of_quiet_calls_errors_alone(place: Shop, quiet: bool) -> None:
    a, left = place.put("a"), place.put("left", log=False)
    (place.source / "a.forces.csv").write_text("target,fx_n\n1,2\n")
    done = place.correct(*a, *left, "-o", place.folder / "out", *(["-q"] if quiet else []))
    assert done.exit_code == 1
    assert "CS0202" in done.stderr
    assert ("CS6000" in done.stderr) is not quiet


def test_a_folder_with_logs_elsewhere_in_two_processes(place: Shop) -> None:
    place.put("a", "b")
    (place.source / "notes.txt").write_text("no program")
    logs, out = place.folder / "logs", place.folder / "out"
    logs.mkdir()
    for name in ("a", "b"):
        shutil.move(place.source / f"{name}.forces.csv", logs)
    done = place.correct(place.source, "--forces", logs, "-o", out, "--offsets", out, "--report", place.folder / "r",
                         "--jobs", 2, "--json")
    assert done.exit_code == 0, done.output
    assert [Path(json.loads(line)["program"]).name for line in done.stdout.splitlines()] == ["a.mod", "b.mod"]
    assert (out / "a.mod").read_bytes() == (out / "b.mod").read_bytes() == place.alone()
    assert {path.name for path in out.iterdir()} == {f"{n}{s}" for n in "ab" for s in (".mod", ".mod.json", ".offsets.csv")}
    assert {path.name for path in (place.folder / "r").iterdir()} == {"a.html", "b.html"}


def test_the_options_of_correct_count_for_every_program(place: Shop) -> None:
    programs = place.put("a", "b")
    out = place.folder / "out"
    tared = place.correct(place.part, "--forces", place.log, "-o", place.folder / "tared.mod", "--tare", "1:3", "--trust-tare")
    assert tared.exit_code == 0, tared.output
    assert place.correct(*programs, "-o", out, "--tare", "1:3", "--trust-tare").exit_code == 0
    assert (out / "b.mod").read_bytes() == (place.folder / "tared.mod").read_bytes() != place.alone()


def test_what_does_not_pair_is_refused(place: Shop) -> None:
    a, b = place.put("a", "b")
    shutil.copy(a, place.source / "a.prg")
    (place.source / "b.forces.parquet").write_bytes(b"")
    (place.source / "empty").mkdir()
    out = place.folder / "out"
    done = place.correct(a, place.source / "a.prg", b, *place.put("c"), "-o", out, "--json")
    assert done.exit_code == 1
    told = [json.loads(line)["findings"] for line in done.stdout.splitlines()]
    assert [[finding["code"] for finding in findings] for findings in told[:3]] == [["CS6002"], ["CS6002"], ["CS6001"]]
    assert [findings[0]["message"].partition(" have ")[0] for findings in told[:2]] == [
        f"and {place.source / name}" for name in ("a.prg", "a.mod")]
    assert told[2][0]["message"] == "has 2 force logs: b.forces.csv, b.forces.parquet"
    assert [path.name for path in sorted(out.iterdir())] == ["c.mod", "c.mod.json"]
    empty = place.correct(place.source / "empty", "-o", out, "--json")
    assert empty.exit_code == 1
    assert json.loads(empty.stdout)["findings"][0]["code"] == "CS6003"
    # Into the folder of the programs themselves: never over an input, not even with --force.
    before = a.read_bytes()
    assert place.correct(a, "-o", f"{place.source}/", "--force").exit_code == 1
    assert a.read_bytes() == before


@pytest.mark.parametrize("processes", [1, 2])
def test_ctrl_c_finishes_what_is_under_way(place: Shop, processes: int) -> None:
    names = [f"p{number:02}" for number in range(40)]
    place.put(*names)
    out = place.folder / "out"
    words = ["correct", place.cell, place.source, "--stiffness", place.stiffness, "-o", f"{out}/", "--json", "--jobs",
             processes]
    # A process group of its own, as a terminal gives: Ctrl-C reaches the workers too.
    with started(sys.executable, "-m", "compstiff", *words, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                 text=True) as running:
        assert running.stdout is not None
        assert running.stderr is not None
        first = running.stdout.readline()
        os.killpg(running.pid, signal.SIGINT)
        stdout = running.stdout.read()
        assert running.stderr.read() == ""
        assert running.wait(timeout=300) == 130
    *reported, whole = [json.loads(line) for line in [first, *stdout.splitlines()]]
    assert {line["status"] for line in reported} == {"ok"}
    assert (whole["status"], whole["exit_code"]) == ("interrupted", 130)
    [finding] = whole["findings"]
    assert (finding["code"], finding["level"]) == ("CS6011", "error")
    assert finding["message"] == f"interrupted: {len(reported)} of 40 programs dealt with, no further one was begun"
    assert len(reported) < len(names)
    # Every program that was written was reported, and the other way round.
    assert {Path(line["output"]).name for line in reported} == {path.name for path in out.glob("*.mod")}
    assert not list(out.glob(".*"))


def test_a_reader_that_goes_away_leaves_no_program_undone(place: Shop) -> None:
    """`| head -1`: it had ended as a defect behind the first."""
    place.put("a", "b", "c")
    words = map(str, [sys.executable, "-m", "compstiff", "correct", place.cell, place.source, "--stiffness", place.stiffness,
                      "-o", place.folder / "out", "--json"])
    done = subprocess.run(["bash", "-c", f"{shlex.join(words)} | true; echo ${{PIPESTATUS[0]}}"], capture_output=True,
                          text=True, timeout=300)
    assert (done.stdout, done.stderr) == ("0\n", "")
    assert sorted(path.name for path in (place.folder / "out").glob("*.mod")) == ["a.mod", "b.mod", "c.mod"]


@pytest.mark.parametrize("after", [1, 2, 3])
def test_ctrl_c_is_told_where_programs_are_left(place: Shop, monkeypatch: pytest.MonkeyPatch, after: int) -> None:
    """Not where it comes after the last one: then all is done."""
    place.put("a", "b", "c")
    shown, show = [], correct_batch._show

    def interrupted(session: Session, result: ProgramResult) -> None:
        shown.append(result)
        show(session, result)
        if len(shown) == after:
            os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(correct_batch, "_show", interrupted)
    done = place.correct(place.source, "-o", f"{place.folder / 'out'}/")
    assert (done.exit_code, len(shown)) == (130 if after < 3 else 0, after)
    told = f"CS6011: interrupted: {after} of 3 programs dealt with, no further one was begun"
    assert (told in done.stderr, "CS6011" in done.stderr) == (after < 3, after < 3)


def test_outputs_of_an_earlier_call_are_kept_unless_force_is_asked_for(place: Shop) -> None:
    """Of one program, and the others are corrected."""
    place.put("a", "b")
    out = place.folder / "out"
    out.mkdir()
    (out / "a.mod").write_text("earlier")
    done = place.correct(place.source, "-o", f"{out}/", "--json")
    first, second = map(json.loads, done.stdout.splitlines())
    assert (done.exit_code, first["status"], second["status"], first["output"]) == (1, "failed", "ok", None)
    assert [finding["code"] for finding in first["findings"] if finding["level"] == "error"] == ["CS0003"]
    assert (out / "a.mod").read_text() == "earlier"
    assert place.correct(place.source, "-o", f"{out}/", "--force").exit_code == 0
    assert (out / "a.mod").read_bytes() == (out / "b.mod").read_bytes()


@pytest.mark.parametrize("written", [False, True])
def test_an_interrupt_within_a_program_says_whether_that_was_written(
    place: Shop, monkeypatch: pytest.MonkeyPatch, written: bool
) -> None:
    """Of that one, whatever others of the same call were."""
    folders = Folders(place.folder / "out")
    folders.make()
    [files] = paired(place.put("a"), None, folders)
    shared = Shared(place.cell, place.stiffness, session=Session("correct", jobs=True))

    def stop(*_: object) -> Any:
        raise KeyboardInterrupt

    if written:
        monkeypatch.setattr(programs, "_alone", stop)
    result = programs.correct_program(files, shared, before_writing=None if written else stop)
    [finding] = result.findings
    assert (result.status, result.code, finding.code, finding.message, files.outputs.program.exists()) == (
        ("ok", 0, "CS0011", "interrupted after the output was complete", True) if written else
        ("interrupted", 130, "CS0010", "interrupted; nothing was written", False))


def test_a_lost_process_does_not_stop_the_others(place: Shop) -> None:
    """One worker is killed, as the kernel does where memory runs out: what it worked on is a defect, the rest is corrected."""
    names = [f"p{number:02}" for number in range(16)]
    place.put(*names)
    out = place.folder / "out"
    words = ["correct", place.cell, place.source, "--stiffness", place.stiffness, "-o", f"{out}/", "--json", "--jobs", 2]
    with started(sys.executable, "-m", "compstiff", *words, stdout=subprocess.PIPE, text=True) as running:
        assert running.stdout is not None
        first = running.stdout.readline()
        children = Path(f"/proc/{running.pid}/task/{running.pid}/children").read_text().split()
        workers = [int(child) for child in children if b"spawn_main" in Path(f"/proc/{child}/cmdline").read_bytes()]
        os.kill(workers[0], signal.SIGKILL)
        stdout = running.stdout.read()
        running.wait(timeout=300)
    lines = [json.loads(line) for line in [first, *stdout.splitlines()]]
    lost = [line for line in lines if line["status"] == "defect"]
    assert len(lost) <= 2
    assert running.returncode == (70 if lost else 0)
    # None where the worker was between two programs.
    assert {finding["code"] for line in lost for finding in line["findings"]} <= {"CS6010"}
    assert [Path(line["program"]).stem for line in lines] == names
    assert {line["status"] for line in lines} <= {"ok", "defect"}


def test_a_single_program_is_as_ever(place: Shop) -> None:
    missing = place.correct(place.part, "-o", place.folder / "x.mod")
    assert missing.exit_code == 2
    assert "Missing option '--forces'" in missing.stderr
    assert place.correct(place.part, "--forces", place.folder, "-o", place.folder / "x.mod").exit_code == 2
    one = (place.part, "--forces", place.log, "-o", place.folder / "x.mod")
    assert place.correct(*one, "--report", place.source).exit_code == 2
    document = json.loads(place.correct(*one, "--json").stdout)
    assert (document["format"], document["status"], "program" in document) == ("compstiff-correct", "ok", False)
    # One program and a folder that is not there yet: the stroke says that it is one.
    (place.source / "e.mod").write_text(HARMLESS)
    assert place.correct(*place.put("a"), "-o", f"{place.folder / 'new'}/").exit_code == 0
    assert (place.folder / "new" / "a.mod").is_file()
    assert place.correct(*place.put("a", "b"), "-o", place.folder / "x.mod").exit_code == 2


@pytest.mark.parametrize(("cut", "stated", "said"), [(90.0, False, True), (40.0, False, False), (90.0, True, False)])
def test_a_program_of_many_says_what_nobody_stated(tmp_path: Path, cut: float, stated: bool, said: bool) -> None:
    """Its one line had only the size of what is left, a newcomer's largest riddle."""
    result = {"corrected": 5, "corrected_added": 0, "offset_mm": {"largest": 0.4},
              "expected_left_um": {"rms": 100.0, "cut": cut}, "cutting_stiffness": {"n_per_mm": 9.0} if stated else None}
    files = ProgramFiles(tmp_path / "part.mod", (), Outputs(tmp_path / "out" / "part.mod"))
    (line,) = ProgramResult(files, 0, "ok", (), {"result": result}).lines()
    assert "2 sigma: 200.0 um RMS" in line
    assert ("which nobody stated" in line) == said


def test_a_watched_program_is_not_told_of_an_option_that_watch_lacks(tmp_path: Path) -> None:
    assert "--forces" in no_log(tmp_path / "a.mod", None, "it is left alone").hint
    hint = no_log(tmp_path / "a.mod", None, "it waits", watched=True).hint
    assert "--forces" not in hint
    assert "beside the program" in hint

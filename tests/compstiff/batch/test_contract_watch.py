"""A watched folder: each finished program once, over restarts and kills; never a half-written file, never its own output."""

from __future__ import annotations

import contextlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result

from compensator.correction.settings import Settings
from compstiff.batch import watch as watching
from compstiff.batch.finished_files import Settled
from compstiff.batch.journal import LOCK, NAME, Journal
from compstiff.batch.pairing import Folders
from compstiff.batch.programs import ProgramResult, Shared
from compstiff.batch.watch import Watch
from compstiff.cli.main import compstiff
from compstiff.cli.watch import _log
from compstiff.outcome import Session
from identification.common.findings import CompstiffError, Finding, Level
from tests.compstiff.batch.programs import Shop, shop
from tests.support import started


@pytest.fixture
def place(tmp_path: Path) -> Shop:
    return shop(tmp_path)


class Clock:
    """Seconds that pass when the test says so."""

    now = 0.0

    def __call__(self) -> float:
        return self.now


class Watched:
    """A watch of the shop's folder into OUT, with files that are finished after five seconds of the clock."""

    def __init__(self, place: Shop) -> None:
        self.clock, self.out = Clock(), place.folder / "out"
        self.out.mkdir(exist_ok=True)
        self.journal = Journal(self.out)
        shared = Shared(place.cell, place.stiffness, Settings(), Session("watch", jobs=True))
        self.watch = Watch(place.source, Folders(self.out), shared, self.journal, Settled(5.0, self.clock))

    def after(self, seconds: float) -> list[ProgramResult]:
        """What a look finds when so many seconds have passed."""
        self.clock.now += seconds
        return list(self.watch.look())

    def settled(self) -> list[tuple[str, str]]:
        """Program and status of what is dealt with once nothing changes any more."""
        return [(result.files.program.name, result.status) for seconds in (0, 6, 6) for result in self.after(seconds)]


def entries(out: Path, event: str = "done") -> list[dict]:
    return [entry for line in (out / NAME).read_text().splitlines() if (entry := json.loads(line))["event"] == event]


def arguments(place: Shop, out: Path, *more: object) -> list[str]:
    words = ["watch", place.source, out, "--cell", place.cell, "--stiffness", place.stiffness, *more]
    return [str(word) for word in words]


def once(place: Shop, out: Path, *more: object) -> Result:
    return CliRunner().invoke(compstiff, arguments(place, out, "--once", "--settle", 0.05, *more))


def test_each_program_is_taken_once(place: Shop) -> None:
    watched = Watched(place)
    a, b = place.put("a", "b")
    assert watched.after(0) == []
    assert watched.after(4) == []
    assert {result.files.program.name for result in watched.after(1.5)} == {"a.mod", "b.mod"}
    assert watched.settled() == []
    assert (watched.out / "a.mod").read_bytes() == (watched.out / "b.mod").read_bytes() == place.alone()
    # The corrected program is taken away to the machine: no reason to make it again. Nor is a copy with another time.
    (watched.out / "a.mod").unlink()
    os.utime(b)
    assert watched.settled() == []
    # Another name, another content, and the first content back again are jobs; the last one's log is still the same.
    a.rename(place.source / "c.mod")
    (place.source / "a.forces.csv").rename(place.source / "c.forces.csv")
    assert watched.settled() == [("c.mod", "ok")]
    text = b.read_text()
    b.write_text(text + "! a comment\n")
    assert watched.settled() == [("b.mod", "ok")]
    assert (watched.out / "b.mod").read_text().endswith("! a comment\n")
    assert entries(watched.out)[-1]["findings"][-1]["code"] == "CS6012"
    b.write_text(text)
    assert watched.settled() == [("b.mod", "ok")]
    assert (watched.out / "b.mod").read_bytes() == place.alone("again.mod")
    # Another stiffness file: all again.
    place.stiffness.write_text(place.stiffness.read_text() + "\n")
    assert sorted(watched.settled()) == [("b.mod", "ok"), ("c.mod", "ok")]


@pytest.mark.parametrize(("program", "log", "said"), [
    (True, False, True), (True, True, False), (False, True, False), (False, False, False)])
def test_a_program_that_changed_without_its_log_is_told(place: Shop, program: bool, log: bool, said: bool) -> None:
    """Not where it was milled anew too, nor where the cell is another: then the forces are its own."""
    watched = Watched(place)
    (file,) = place.put("a")
    assert watched.settled() == [("a.mod", "ok")]
    for path, changed, mark in ((file, program, "! a comment\n"), (place.source / "a.forces.csv", log, "# a comment\n"),
                                (place.cell, not (program or log), "# a comment\n")):
        if changed:
            path.write_text(path.read_text() + mark)
    assert watched.settled() == [("a.mod", "ok")]
    told = [(one["level"], one["message"]) for one in entries(watched.out)[-1]["findings"] if one["code"] == "CS6012"]
    assert told == [("warning", "changed since it was last corrected, its force log did not: the forces are taken for those of "
                     "the new program")] * said


def test_a_restart_goes_on_where_the_last_run_ended(place: Shop) -> None:
    place.put("a")
    first = Watched(place)
    assert first.settled() == [("a.mod", "ok")]
    with pytest.raises(CompstiffError, match="CS6005"):
        Journal(first.out)
    first.journal.close()
    place.put("b")
    second = Watched(place)
    assert second.settled() == [("b.mod", "ok")]
    second.journal.close()
    # A crash tore the last line: what it stood for is done again, over its own outputs.
    text = (first.out / NAME).read_bytes()
    (first.out / NAME).write_bytes(text[:-40])
    third = Watched(place)
    assert [(found.code, found.level, found.message) for found in third.journal.findings] == [
        ("CS6007", "warning", "1 line cannot be read; what stood there is done again")]
    assert third.settled() == [("b.mod", "ok")]
    third.journal.close()
    assert Watched(place).settled() == []


def test_a_half_written_file_is_never_taken(place: Shop) -> None:
    watched = Watched(place)
    text = place.part.read_text()
    half, rest = text[: len(text) // 2], text[len(text) // 2:]
    shutil.copy(place.log, place.source / "a.forces.csv")
    with open(place.source / "a.mod", "w") as writer:
        # A writer that pauses for longer than files take to settle, and holds the file open.
        writer.write(half)
        writer.flush()
        assert watched.settled() == []
        writer.write(rest)
        writer.flush()
        assert watched.settled() == []
    assert [done.status for done in watched.after(0)] == ["ok"]
    # One that closes it in between: the module has no end yet.
    (place.source / "b.mod").write_text(half)
    shutil.copy(place.log, place.source / "b.forces.csv")
    assert watched.settled() == [("b.mod", "waiting")]
    (place.source / "b.mod").write_text(text)
    assert watched.settled() == [("b.mod", "ok")]
    # A log that grows all the time, opened anew for each line.
    (c,) = place.put("c", log=False)
    lines = place.log.read_text().splitlines(keepends=True)
    for line in lines:
        with open(place.source / "c.forces.csv", "a") as log:
            log.write(line)
        assert [done.status for done in watched.after(4.9)] in ([], ["waiting"])
    assert watched.settled() == [("c.mod", "ok")]
    alone = place.alone()
    assert all((watched.out / name).read_bytes() == alone for name in ("a.mod", "b.mod", c.name))
    # Renamed in: whole from the start, taken when it has settled.
    temporary = place.folder / "d.mod.part"
    temporary.write_text(text)
    shutil.copy(place.log, place.source / "d.forces.csv")
    temporary.rename(place.source / "d.mod")
    assert watched.settled() == [("d.mod", "ok")]


@pytest.mark.parametrize(("end", "waits"), [
    ("ENDMODULE", False), ("ENDPROC endmodule ! the end", False), ("", True), ("ENDMODULES", True), ("! ENDMODULE", True),
    ('TPWrite "Done!"; ENDPROC ENDMODULE', False)])
def test_a_module_without_its_end_waits_and_is_told(place: Shop, end: str, waits: bool) -> None:
    (program,) = place.put("a")
    body, _, _ = program.read_text().rpartition("ENDMODULE")
    if "ENDPROC" in end:
        body = body.rpartition("ENDPROC")[0]
    program.write_text(body + end + "\n")
    done = once(place, place.folder / "out", "--json")
    [line] = [json.loads(line) for line in done.stdout.splitlines()]
    assert (done.exit_code, line["status"]) == (0, "waiting" if waits else "ok")
    assert [(finding["code"], finding["level"], finding["file"]) for finding in line["findings"]
            if finding["code"] == "CS6009"] == ([("CS6009", "warning", str(program))] if waits else [])


def test_a_file_that_changes_under_the_correction_is_taken_again(place: Shop, monkeypatch: pytest.MonkeyPatch) -> None:
    watched = Watched(place)
    (program,) = place.put("a")
    correct_program = watching.correct_program

    def changing(*given: object, before_writing: Callable[[], None], **more: object) -> ProgramResult:
        def late() -> None:
            program.write_text(program.read_text() + "! late\n")
            before_writing()

        return correct_program(*given, before_writing=late, **more)      # type: ignore[arg-type]

    monkeypatch.setattr(watching, "correct_program", changing)
    watched.after(0)
    (done,) = watched.after(6)
    assert (done.code, done.findings[0].code) == (1, "CS6004")
    assert not (watched.out / "a.mod").exists()
    monkeypatch.undo()
    assert watched.settled() == [("a.mod", "ok")]
    assert (watched.out / "a.mod").read_text().endswith("! late\n")


def test_a_failure_waits_for_another_content(place: Shop) -> None:
    (a,) = place.put("a")
    log = place.source / "a.forces.csv"
    log.write_text("target,fx_n\n1,2\n")
    watched = Watched(place)
    assert watched.settled() == [("a.mod", "failed")]
    watched.journal.close()
    out = watched.out
    assert once(place, out).exit_code == 0      # Known: not tried again.
    assert once(place, out, "--retry").exit_code == 1
    shutil.copy(place.log, log)
    done = once(place, out, "--json")
    assert done.exit_code == 0, done.output
    assert [json.loads(line)["status"] for line in done.stdout.splitlines()] == ["ok"]
    # What was corrected is refused, under whatever name it comes back; and a file of somebody else's is not overwritten.
    shutil.copy(out / "a.mod", place.source / "b.mod")
    shutil.copy(place.log, place.source / "b.forces.csv")
    assert once(place, out).exit_code == 3
    (out / "c.mod").write_text("mine")
    place.put("c")
    assert once(place, out).exit_code == 1
    assert (out / "c.mod").read_text() == "mine"
    assert [entry["exit_code"] for entry in entries(out)] == [1, 1, 0, 3, 1]
    assert a.exists()


def test_a_link_to_nothing_is_not_written_over(place: Shop) -> None:
    """Somebody put it there: it is as little this watch's as a file would be."""
    out = place.source.parent / "linked"
    out.mkdir()
    (out / "a.mod").symlink_to(out / "elsewhere.mod")
    place.put("a")
    assert once(place, out).exit_code == 1
    assert (out / "a.mod").is_symlink()
    assert not (out / "elsewhere.mod").exists()


def test_a_program_waits_for_its_log_and_is_said_once(place: Shop) -> None:
    watched = Watched(place)
    place.put("a", log=False)
    assert watched.settled() == [("a.mod", "waiting")]
    assert watched.settled() == []
    shutil.copy(place.log, place.source / "a.forces.csv")
    assert watched.settled() == [("a.mod", "ok")]


def test_calls_that_are_refused(place: Shop) -> None:
    for out in (place.source, place.source / "out"):
        refused = once(place, out, "--json")
        assert refused.exit_code == 1
        assert json.loads(refused.stdout)["findings"][0]["code"] == "CS6006"
        assert not (place.source / "out").exists()
    place.stiffness.write_text("{}")
    assert once(place, place.folder / "out").exit_code == 1
    assert once(place, place.folder / "out", "--cell", place.folder / "none.yaml").exit_code == 2


def start(place: Shop, out: Path) -> contextlib.AbstractContextManager[subprocess.Popen[str]]:
    return started(sys.executable, "-m", "compstiff", *arguments(place, out, "--settle", 0.1, "--interval", 0.05, "--json"),
                   stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def test_killed_at_any_moment_nothing_is_lost_and_nothing_is_half(place: Shop) -> None:
    names = [f"p{i}" for i in range(8)]
    place.put(*names)
    out = place.folder / "out"
    alone = place.alone()
    rng = np.random.default_rng(2)
    for _ in range(3):
        known = len((out / NAME).read_bytes()) if out.exists() else 0
        if known and len(entries(out)) == len(names):
            break
        with start(place, out) as running:
            deadline = time.monotonic() + 60
            while not ((out / NAME).exists() and len((out / NAME).read_bytes()) > known):
                assert time.monotonic() < deadline, "no program was done"
                time.sleep(0.005)
            time.sleep(rng.uniform(0, 0.25))
            running.kill()
            running.communicate(timeout=20)
        assert all(path.read_bytes() == alone for path in out.glob("p*.mod"))
        assert all(json.loads(path.read_text()) for path in out.glob("p*.json"))
    assert once(place, out).exit_code == 0
    assert {path.name for path in out.iterdir()} == {NAME, LOCK, *(f"{n}{end}" for n in names for end in (".mod", ".mod.json"))}
    assert all((out / f"{name}.mod").read_bytes() == alone for name in names)
    # No kill fell into a journal line here, so each program was done exactly once.
    assert sorted(entry["program"] for entry in entries(out)) == sorted(f"{name}.mod" for name in names)


@pytest.mark.parametrize(("number", "code"), [(signal.SIGTERM, 0), (signal.SIGINT, 130)])
def test_it_ends_cleanly_when_asked(place: Shop, number: int, code: int) -> None:
    place.put("a")
    with start(place, place.folder / "out") as running:
        assert running.stdout is not None
        assert json.loads(running.stdout.readline())["status"] == "ok"
        running.send_signal(number)
        stdout, stderr = running.communicate(timeout=300)
    assert (running.returncode, stdout, stderr) == (code, "", "")


@pytest.mark.parametrize(("options", "shown"), [
    ({}, ["line", "error", "warning"]), ({"quiet": True}, ["line", "error"]),
    ({"verbose": True}, ["line", "error", "warning", "note"]),
    ({"quiet": True, "done": True}, []), ({"done": True}, ["line"])])
def test_what_is_said_of_a_program_follows_quiet_and_verbose(
    capsys: pytest.CaptureFixture[str], options: dict[str, bool], shown: list[str]
) -> None:
    """On stderr; of one that is done and has nothing to say its line alone, and that not with --quiet."""
    done = options.pop("done", False)
    levels: list[Level] = [] if done else ["error", "warning", "note"]
    findings = tuple(Finding(f"CS900{k}", level, f"this is the {level}") for k, level in enumerate(levels))
    said: Any = SimpleNamespace(code=int(not done), findings=findings, lines=lambda: ["Part.mod: this is the line"])
    _log(Session("watch", **options), said)
    assert re.findall(r"this is the (\w+)", capsys.readouterr().err) == shown

"""What a watch says and does where the disk or the folder gives trouble, and how it goes on afterwards."""

from __future__ import annotations

import builtins
import errno
import os
from pathlib import Path
from typing import Any

import pytest

from compensator.correction.settings import Settings
from compstiff.batch import watch as watching
from compstiff.batch.finished_files import Settled, open_for_writing
from compstiff.batch.journal import LOCK, NAME, Journal
from compstiff.batch.pairing import Folders
from compstiff.batch.programs import Shared
from compstiff.batch.watch import Rhythm, watch_folder
from compstiff.outcome import INTERRUPTED, Outcome, Session
from identification.common.findings import CompstiffError
from tests.compstiff.batch.programs import Shop, shop
from tests.compstiff.batch.test_contract_watch import Watched, entries, once


@pytest.fixture
def place(tmp_path: Path) -> Shop:
    return shop(tmp_path)


@pytest.mark.parametrize("name", [NAME, LOCK])
def test_a_journal_that_cannot_be_opened_is_said_and_leaves_the_folder_free(tmp_path: Path, name: str) -> None:
    (tmp_path / name).mkdir()
    with pytest.raises(CompstiffError) as raised:
        Journal(tmp_path)
    (finding,) = raised.value.findings
    assert (finding.code, finding.file) == ("CS0004", str(tmp_path / NAME))
    assert finding.message == f"cannot be written: {os.strerror(errno.EISDIR)}"
    (tmp_path / name).rmdir()
    Journal(tmp_path).close()       # not CS6005: the failed one holds no lock


def test_lines_that_cannot_be_read_are_told_at_the_next_start_alone(place: Shop) -> None:
    """They stay in the journal, each; a line that is torn later is news."""
    watched = Watched(place)
    place.put("a")
    assert watched.settled() == [("a.mod", "ok")]
    watched.journal.close()
    journal = watched.out / NAME
    said = []
    for torn in (b"", b'{"event": "beg\n[3]\n', b"", b'{"event": "done"}\n\n{"event"', b"", b""):
        journal.write_bytes(journal.read_bytes() + torn)
        started = once(place, watched.out)
        assert started.exit_code == 0
        said.append([line for line in started.stderr.splitlines() if "CS6007" in line])
    assert [[line.partition("CS6007: ")[2].partition(" cannot be read")[0] for line in lines] for lines in said] == [
        [], ["2 lines"], [], ["2 lines"], [], []]
    text = journal.read_bytes()
    assert (text[-1:], text.count(b'"event": "done", "program"')) == (b"\n", 1), "nothing was done again"
    assert text.count(b'{"format": "compstiff-watch", "version": 1, "time": "') == 4       # begun, done, and twice told


@pytest.mark.parametrize("call", ["write", "fsync"])
def test_a_full_disk_stops_the_watch_before_a_program_is_taken(place: Shop, monkeypatch: pytest.MonkeyPatch, call: str) -> None:
    """Half a line is torn, not lost: the next watch takes the program, once."""
    watched = Watched(place)
    place.put("a")
    write = os.write

    def no_sync(handle: int) -> None:
        raise OSError(errno.ENOSPC, "no space left")

    def half(handle: int, line: bytes) -> int:
        return write(handle, line[:20])

    monkeypatch.setattr(os, call, half if call == "write" else no_sync)
    with pytest.raises(CompstiffError) as raised:
        watched.settled()
    monkeypatch.undo()
    (finding,) = raised.value.findings
    assert (finding.code, finding.file) == ("CS0004", str(watched.out / NAME))
    assert finding.message == "cannot be written: no space left; without it a program could be taken twice"
    assert not (watched.out / "a.mod").exists()
    watched.journal.close()
    again = once(place, watched.out)
    assert (again.exit_code, "CS6007" in again.stderr) == (0, call == "write")
    assert (watched.out / "a.mod").read_bytes() == place.alone()


def test_a_program_that_is_as_before_a_job_which_did_not_end_is_taken_again(place: Shop) -> None:
    """The power went when the files of a changed program stood there, and it was not said to be done; then it was put back."""
    watched = Watched(place)
    place.put("a")
    assert watched.settled() == [("a.mod", "ok")]
    watched.journal.begun("a.mod", "of the changed one", ["a.mod", "a.mod.json"])
    (watched.out / "a.mod").write_text("of the changed one")
    watched.journal.close()
    again = Watched(place)
    assert again.settled() == [("a.mod", "ok")]
    assert (again.out / "a.mod").read_bytes() == place.alone()
    again.journal.close()
    assert Watched(place).settled() == []


def test_a_folder_that_is_gone_for_a_while_is_said_once_each_time(place: Shop) -> None:
    said: list[str] = []
    calls = iter(range(100))
    away = place.folder / "away"

    def stopped() -> bool:
        """Asked before and after each look: the folder is away for the 2nd to the 4th and for the 6th, then has a program."""
        look, after = divmod(next(calls), 2)
        if not after and look in (1, 5):
            place.source.rename(away)
        if not after and look in (4, 6):
            away.rename(place.source)
        if not after and look == 6:
            place.put("a")
        return look == 9

    shared = Shared(place.cell, place.stiffness, Settings(), Session("watch", jobs=True))
    results = watch_folder(place.source, Folders(place.folder / "out"), shared, Rhythm(settle=0.0, interval=-1.0),
                           stopped=stopped, say=said.append)
    assert [result.status for result in results] == ["ok"]
    assert said[0] == f"watching {place.source}; Ctrl-C ends it"
    assert ["CS0005" in line and str(place.source) in line for line in said[1:]] == [True, True]


def test_what_is_no_trouble_of_the_folder_ends_the_watch(place: Shop, monkeypatch: pytest.MonkeyPatch) -> None:
    place.put("a")

    def full(*_: object, **__: object) -> Any:
        raise OSError(errno.ENOSPC, "no space left")

    shared = Shared(place.cell, place.stiffness, Settings(), Session("watch", jobs=True))
    asked = iter(range(100))
    watch = watch_folder(place.source, Folders(place.folder / "out"), shared, Rhythm(settle=0.0, interval=0.0),
                         stopped=lambda: next(asked) > 20)
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(CompstiffError, match="CS0004"):
        list(watch)


def test_a_watch_that_is_stopped_after_a_program_takes_no_other(place: Shop) -> None:
    place.put("a", "b")
    stop: list[str] = []
    shared = Shared(place.cell, place.stiffness, Settings(), Session("watch", jobs=True))
    for result in watch_folder(place.source, Folders(place.folder / "out"), shared, Rhythm(settle=0.0, interval=0.0),
                               stopped=lambda: bool(stop)):
        stop.append(result.files.program.name)
    assert stop == ["a.mod"]
    assert [entry["program"] for entry in entries(place.folder / "out")] == ["a.mod"]


def test_a_program_that_goes_while_it_is_looked_at_is_taken_when_it_is_back(
        place: Shop, monkeypatch: pytest.MonkeyPatch) -> None:
    watched = Watched(place)
    place.put("a")

    def gone(path: Path) -> str:
        raise FileNotFoundError(path)

    monkeypatch.setattr(watching, "sha256", gone)
    assert watched.settled() == []
    assert (watched.out / NAME).read_text() == ""
    monkeypatch.undo()
    assert watched.settled() == [("a.mod", "ok")]


@pytest.mark.parametrize("shut", ["a.mod", "a.forces.csv", "cell.yaml"])
def test_a_program_with_a_file_that_may_not_be_read_waits_and_is_said_once(
        place: Shop, monkeypatch: pytest.MonkeyPatch, shut: str) -> None:
    """Permissions change and the file's time does not: it is taken once they do. Root may read everything, hence no chmod."""
    file = (place.folder if shut == "cell.yaml" else place.source) / shut
    watched = Watched(place)
    opening = os.open

    def refused(path: Any, *given: Any, **more: Any) -> int:
        if Path(path) == file:
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))
        return opening(path, *given, **more)

    place.put("a")
    monkeypatch.setattr(os, "open", refused)
    assert watched.after(0) == watched.after(4.9) == []       # it may be of somebody who still writes it
    (waiting,) = watched.after(0.2)
    (said,) = waiting.findings
    assert (waiting.status, waiting.code, said.code, said.level, said.file) == ("waiting", 0, "CS6014", "warning", str(file))
    assert said.message == f"{shut} cannot be read: {os.strerror(errno.EACCES)}; the program waits"
    assert watched.settled() == []
    monkeypatch.undo()
    assert watched.settled() == [("a.mod", "ok")]


def test_a_disk_that_fails_within_a_file_is_said_of_its_program(place: Shop, monkeypatch: pytest.MonkeyPatch) -> None:
    watched = Watched(place)
    place.put("a")

    def broken(path: Path) -> str:
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    monkeypatch.setattr(watching, "sha256", broken)
    assert watched.settled() == [("a.mod", "waiting")]
    assert watched.settled() == []
    monkeypatch.undo()
    assert watched.settled() == [("a.mod", "ok")]


def test_ctrl_c_in_a_correction_ends_the_watch_and_the_program_is_taken_again(
        place: Shop, monkeypatch: pytest.MonkeyPatch) -> None:
    watched = Watched(place)
    place.put("a")

    def interrupted(files: Any, shared: Any, **_: object) -> Any:
        return watching.ProgramResult.of(files, shared, Outcome(), "failed", INTERRUPTED)

    monkeypatch.setattr(watching, "correct_program", interrupted)
    with pytest.raises(KeyboardInterrupt):
        watched.settled()
    monkeypatch.undo()
    assert (len(entries(watched.out, "begun")), entries(watched.out)) == (1, [])
    assert watched.settled() == [("a.mod", "ok")]


def test_coefficients_that_cannot_be_read_are_no_program_s_failure(place: Shop) -> None:
    place.put("a")
    bad = place.folder / "coefficients.json"
    bad.write_text("{}")
    done = once(place, place.folder / "out", "--predict-force", bad)
    assert (done.exit_code, str(bad) in done.stderr) == (1, True), done.output
    assert not (place.folder / "out").exists()


def test_a_file_that_was_gone_settles_anew(tmp_path: Path) -> None:
    """Back with the same bytes, time and number, as after a network folder was away: it may just be coming again."""
    now = [0.0]
    settled, file, away = Settled(5.0, lambda: now[0]), tmp_path / "a.mod", tmp_path / "away"
    file.write_text("MODULE a\nENDMODULE\n")
    for seconds, there, finished in ((0, True, False), (5, True, True), (1, False, False), (1, True, False), (4.9, True, False),
                                     (0.2, True, True)):
        now[0] += seconds
        if not there:
            file.rename(away)
        elif away.exists():
            away.rename(file)
        assert (settled.look([file]) is not None) == finished, now


def test_who_has_a_file_open_is_asked_on_windows_by_renaming_it_to_itself(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "a.mod"
    file.write_text("as it was")
    assert open_for_writing(tmp_path / "none")
    importing = builtins.__import__

    def no_fcntl(name: str, *given: Any, **more: Any) -> Any:
        if name == "fcntl":
            raise ImportError(name)
        return importing(name, *given, **more)

    def shared_by_nobody(*_: object) -> None:
        raise PermissionError(errno.EACCES, "in use by another process")

    monkeypatch.setattr(builtins, "__import__", no_fcntl)
    before = os.stat(file)
    assert not open_for_writing(file)
    assert (os.stat(file), file.read_text()) == (before, "as it was")
    monkeypatch.setattr(os, "rename", shared_by_nobody)
    assert open_for_writing(file)

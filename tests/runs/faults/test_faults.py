"""Faults while a command works: nothing half written, a clear error, and the next call completes.

A share of the table that `python benchmarks/faults.py` tries whole.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from identification.common import files as writing
from identification.common.files import Content
from identification.common.findings import CompstiffError, Finding
from identification.common.locks import folders_locked
from tests.runs.faults.faults import FAULTS, killed_at_steps, undisturbed
from tests.runs.faults.jobs import COMMANDS

# Of each kind of writing one command: several files with a record, one file, a table beside a log, a folder with a journal.
TRIED = [
    *((fault, "correct") for fault in FAULTS if not fault.startswith("killed")),
    ("file size limit", "push"), ("read-only folder", "convert"), ("folder vanishes", "watch"),
    ("input replaced", "correct many"), ("input replaced", "watch"), ("clock set back", "watch"), ("links", "tare"),
    ("killed at random", "watch"),
]


@pytest.mark.parametrize(("fault", "command"), TRIED)
def test_fault(tmp_path: Path, fault: str, command: str) -> None:
    assert FAULTS[fault](COMMANDS[command], tmp_path / "place") == []


@pytest.mark.parametrize("command", ["correct", "convert", "watch"])
def test_killed_at_some_steps(tmp_path: Path, command: str) -> None:
    assert killed_at_steps(COMMANDS[command], tmp_path / "place", most=4) == []


# Long: a test of these tests: what they see where a file is written in place.
@pytest.mark.long
def test_a_fault_that_is_not_dealt_with_is_seen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Written in place, and the program before its record: both are named."""
    def in_place(files: dict[Path, Content], **_: object) -> None:
        for path, blocks in reversed(files.items()):
            content = blocks if isinstance(blocks, bytes) else b"".join(blocks)
            handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
            for half in (content[:len(content) // 2], content[len(content) // 2:]):
                os.write(handle, half)
            os.close(handle)

    from compensator.correction import files as of_correction

    undisturbed("correct")
    monkeypatch.setattr(of_correction, "write_whole", in_place)
    said = killed_at_steps(COMMANDS["correct"], tmp_path / "place", most=6)
    assert any("half written" in each for each in said)
    assert any("without its record" in each for each in said)
    assert FAULTS["input replaced"](COMMANDS["correct"], tmp_path / "place")


def test_one_call_at_a_time_in_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    held = subprocess.Popen([sys.executable, "-c", "import fcntl, os, sys, time\nhandle = os.open(sys.argv[1], os.O_RDONLY)\n"
                             "fcntl.flock(handle, fcntl.LOCK_EX)\nprint(1, flush=True)\ntime.sleep(60)", tmp_path],
                            stdout=subprocess.PIPE)
    try:
        assert held.stdout is not None
        held.stdout.readline()
        monkeypatch.setattr("identification.common.locks.PATIENCE_S", 0.2)
        with pytest.raises(CompstiffError) as stopped:
            writing.write_whole({tmp_path / "a": b"1"})
        assert stopped.value.findings[0].code == "CS0081"
    finally:
        held.kill()
        held.communicate()
    writing.write_whole({tmp_path / "a": b"1"})
    assert [file.name for file in tmp_path.iterdir()] == ["a"]


def test_two_folders_are_locked_in_one_order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """However they are named: by a link, by a way through another; one locked twice would wait for itself and be Taken."""
    monkeypatch.setattr("identification.common.locks.PATIENCE_S", 0.2)
    one, two = tmp_path / "one", tmp_path / "two"
    one.mkdir()
    two.symlink_to(one)
    with folders_locked([one, two, one / ".." / "one"]) as alone:
        assert alone


def test_temporary_files_of_killed_calls_are_swept_and_no_others(tmp_path: Path) -> None:
    left, other = tmp_path / ".a[1].mod.12345678.part", tmp_path / ".b.mod.12345678.part"
    for file in (left, other, tmp_path / "a[1].mod.part"):
        file.write_bytes(b"half")
    writing.write_whole({tmp_path / "a[1].mod": b"whole"})
    assert sorted(file.name for file in tmp_path.iterdir()) == [other.name, "a[1].mod", "a[1].mod.part"]


def test_content_that_comes_in_blocks_is_written_whole_or_not_at_all(tmp_path: Path) -> None:
    def blocks(fails: bool) -> Iterator[bytes]:
        yield b"first "
        if fails:
            raise ValueError("no second block")
        yield b"second"

    (tmp_path / "b").write_bytes(b"mine")
    with pytest.raises(ValueError, match="no second block"):
        writing.write_whole({tmp_path / "a": b"1", tmp_path / "b": blocks(fails=True)})
    assert {file.name: file.read_bytes() for file in tmp_path.iterdir()} == {"b": b"mine"}
    writing.write_whole({tmp_path / "a": b"1", tmp_path / "b": blocks(fails=False)})
    assert {file.name: file.read_bytes() for file in tmp_path.iterdir()} == {"a": b"1", "b": b"first second"}


def test_what_came_to_be_there_meanwhile_is_not_overwritten(tmp_path: Path) -> None:
    (tmp_path / "b").write_bytes(b"mine")
    with pytest.raises(CompstiffError) as stopped:
        writing.write_whole({tmp_path / "a": b"1", tmp_path / "b": b"2"}, overwrite=False)
    assert stopped.value.findings[0].code == "CS0003"
    assert [file.name for file in tmp_path.iterdir()] == ["b"]


def test_a_file_s_name_forges_no_line_and_obeys_no_terminal() -> None:
    said = str(Finding("CS0005", "error", "cannot \x1b[2Jbe read\u202e", file="a\nb.mod: note CS0001: fine"))
    assert said == "a\\nb.mod: note CS0001: fine: error CS0005: cannot \\x1b[2Jbe read\\u202e"

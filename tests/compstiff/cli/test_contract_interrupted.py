"""Ctrl-C before and after the files of a command are in place: what is said is what is there."""

from __future__ import annotations

import gc
import importlib
import os
import signal
import sys
from pathlib import Path
from typing import Any

import pytest

import compstiff
from benchmarks.fuzz_files import LVM
from compstiff.__main__ import run
from identification.common import files
from tests.runs.command_line import user_files as kit

SAMPLES = ("README.md", "cell.yaml", "insert.forces.parquet", "insert.mod", "measurements.csv")


def call(folder: Path) -> tuple[object, ...]:
    """A sensor's own log, to be made a table."""
    log = folder / "log.lvm"
    log.write_text(LVM)
    return "convert", log, "--form", "lvm", "-o", folder / "table.csv"


def stopped(*arguments: object, **named: object) -> None:
    raise KeyboardInterrupt


@pytest.mark.parametrize("overwritten", [False, True])
def test_before_the_output_is_in_place_nothing_was_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, overwritten: bool
) -> None:
    """Both temporary files are there when Ctrl-C comes; a file of an earlier call stays as it was."""
    arguments, output = call(tmp_path), tmp_path / "table.csv"
    if overwritten:
        output.write_text("old")
    monkeypatch.setattr(files, "_into_place", stopped)
    done = kit.run(*arguments, "--force")
    assert (done.code, done.out, done.err) == (130, "", "error CS0010: interrupted; nothing was written\n")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["log.lvm", "table.csv"][: 1 + overwritten]
    assert not overwritten or output.read_text() == "old"


def test_when_the_output_is_in_place_it_is_complete(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    arguments, output = call(tmp_path), tmp_path / "table.csv"
    assert kit.run(*arguments).code == 0
    whole = output.read_bytes()
    output.unlink()
    write = files.write_whole

    def written(contents: dict[Path, bytes], **named: Any) -> None:
        write(contents, **named)
        raise KeyboardInterrupt

    monkeypatch.setattr(files, "write_whole", written)
    done = kit.run(*arguments)
    assert (done.code, done.out) == (0, "")
    assert done.err == "note CS0011: interrupted after the output was complete\n"
    assert output.read_bytes() == whole
    # The next call of this process has written nothing yet.
    monkeypatch.setattr(files, "write_whole", stopped)
    assert "CS0010: interrupted; nothing was written" in kit.run(*arguments, "--force").err


@pytest.mark.parametrize("step", ["fit_stiffness", "correct_files"])
def test_the_demo_does_not_say_that_nothing_is_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: str) -> None:
    """It writes in steps: what stands there stops the next call, unless --force is given, as the message says."""
    folder = tmp_path / "demo"
    monkeypatch.setattr(compstiff, step, stopped, raising=False)
    done = kit.run("demo", folder)
    there = {path.name for path in folder.iterdir()}
    assert there == {*SAMPLES, *(() if step == "fit_stiffness" else ("stiffness.json", "identify.html"))}
    assert (done.code, done.err) == (
        130, "error CS0010: interrupted; its folder may have a part of the files; --force runs it over them\n")
    assert "CS0003" in kit.run("demo", folder).err
    assert "CS0010" in kit.run("demo", folder, "--force").err


@pytest.mark.parametrize(("loaded", "written", "code"), [
    (True, [Path("table.csv")], 0), (True, [], 130), (False, [], 130)])
def test_ctrl_c_outside_of_a_command_says_by_its_code_whether_the_output_is_there(
    monkeypatch: pytest.MonkeyPatch, loaded: bool, written: list[Path], code: int
) -> None:
    """loaded: whether what writes files was imported by then."""
    monkeypatch.setattr(files, "written", written)
    if not loaded:
        monkeypatch.delitem(sys.modules, files.__name__)
    assert ended_with(monkeypatch, KeyboardInterrupt()) == ("at once", code)


@pytest.mark.parametrize(("code", "how"), [(0, "in order"), (1, "in order"), (3, "in order"), (130, "at once")])
def test_the_exit_code_of_a_command_is_that_of_the_process(monkeypatch: pytest.MonkeyPatch, code: int, how: str) -> None:
    """By then a Ctrl-C changes nothing; that of an interrupted one is not left to the end of the interpreter."""
    assert ended_with(monkeypatch, SystemExit(code)) == (how, code)


def ended_with(monkeypatch: pytest.MonkeyPatch, reason: BaseException) -> tuple[str, object]:
    """How the process ends, and with which code, where the command line is left by `reason`."""
    def main() -> None:
        raise reason

    def at_once(code: int) -> None:
        raise LookupError(code)

    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    monkeypatch.setenv("ARROW_DEFAULT_MEMORY_POOL", "system")
    monkeypatch.setattr(gc, "set_threshold", lambda count: None)
    monkeypatch.setattr(importlib.import_module("compstiff.cli.main"), "main", main)
    monkeypatch.setattr(os, "_exit", at_once)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)      # a shell has its background jobs ignore it
    try:
        with pytest.raises((LookupError, SystemExit)) as ended:
            run()
        assert (signal.getsignal(signal.SIGINT) == signal.SIG_IGN) == isinstance(reason, SystemExit)
    finally:
        signal.signal(signal.SIGINT, before)
    return "at once" if isinstance(ended.value, LookupError) else "in order", ended.value.args[0]

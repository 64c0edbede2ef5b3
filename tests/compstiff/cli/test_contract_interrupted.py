"""Ctrl-C before and after the files of a command are in place: what is said is what is there."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import compstiff
from benchmarks.fuzz_files import LVM
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

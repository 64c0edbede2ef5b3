"""`import compstiff`: every name is there, typed, documented and shown by an example that runs; and loads only what it must."""

from __future__ import annotations

import ast
import doctest
import inspect
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import compstiff
from benchmarks.same_outputs import prepare
from compstiff import writing
from compstiff.cli.main import COMMANDS
from compstiff.cli.main import compstiff as command_line
from tests.identification.formats.test_contract_force_logs import VALUES, lvm
from tests.identification.motion import simulated_joint


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The sample files, as the examples name them, with the stiffnesses and offsets made from them."""
    place = tmp_path_factory.mktemp("front_door")
    prepare(place)
    (place / "log.lvm").write_text(lvm([(0.0, VALUES[:20, :3]), (0.002, VALUES[20:, :3])]))
    for name, seed in (("log_a.csv", 1), ("log_b.csv", 2)):
        simulated_joint.write(place / name, simulated_joint.columns(seed, {"channel_delay": 1.0}))
    cell = compstiff.read_cell(place / "cell.yaml")
    fit = compstiff.fit_stiffness(cell, compstiff.read_measurements(place / "measurements.csv", cell.robot))
    compstiff.write({place / "stiffness.json": fit.model.as_dict()})
    settings = compstiff.Settings.of(tare=((0, 2),))
    compstiff.correct_files(
        compstiff.Inputs(place / "cell.yaml", place / "insert.mod", place / "stiffness.json", place / "insert.forces.parquet"),
        compstiff.Outputs(place / "insert_corrected.mod", place / "offsets.csv"), settings, overwrite=False)
    return place


@pytest.mark.parametrize("name", compstiff.__all__)
def test_the_example_of_each_name_runs(name: str, folder: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    shutil.copytree(folder, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    thing = getattr(compstiff, name)
    text = inspect.getdoc(thing) or ""
    examples = doctest.DocTestParser().get_doctest(text, {"compstiff": compstiff, "np": np}, name, None, 0)
    assert examples.examples, f"{name} shows no example"
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
    said: list[str] = []
    runner.run(examples, out=said.append)
    assert not runner.summarize(verbose=False).failed, "".join(said)


def test_the_table_says_what_the_type_checker_is_told() -> None:
    tree = ast.parse(Path(compstiff.__file__).read_text())
    block = next(node for node in tree.body if isinstance(node, ast.If))
    told = {alias.name: node.module for node in block.body if isinstance(node, ast.ImportFrom) for alias in node.names}
    assert told == compstiff._FILE_OF
    assert set(compstiff.__all__) == set(told) <= set(dir(compstiff))
    # Whoever imports a module, as unpickling does, sets the package's attribute of its name.
    assert not {f"compstiff.{name}" for name in told} & set(told.values())
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        compstiff.nothing  # noqa: B018


def test_every_report_is_found() -> None:
    from importlib import import_module

    for where in writing.REPORTS.values():
        module, _, name = where.partition(":")
        assert callable(getattr(import_module(module), name))
    with pytest.raises(TypeError, match="no report of int"):
        compstiff.report(1)


def test_the_help_says_what_the_commands_say() -> None:
    context = command_line.make_context("compstiff", ["robots"])
    assert sorted(COMMANDS) == list(COMMANDS) == command_line.list_commands(context)
    for name, sentence in COMMANDS.items():
        command = command_line.get_command(context, name)
        assert command is not None
        first = " ".join((command.help or "").split("\n\n")[0].split())
        assert first == sentence, name


@pytest.mark.parametrize("columns", ["80", "120"])
def test_the_help_lists_each_command_once_with_its_whole_sentence(columns: str) -> None:
    """In the order of the work, the new cell first; nothing is cut off at the width of the terminal."""
    done = subprocess.run([sys.executable, "-m", "compstiff", "--help"], capture_output=True, text=True, check=True,
                          env=os.environ | {"COLUMNS": columns})
    listed = re.findall(r"^  ([a-z]+)  +[A-Z]", done.stdout, re.M)
    assert sorted(listed) == sorted(COMMANDS)
    assert listed[0] == "init"
    assert listed.index("identify") < listed.index("correct") < listed.index("verify")
    assert max(map(len, done.stdout.splitlines())) <= int(columns)
    told = " ".join(done.stdout.split())
    assert [name for name, sentence in COMMANDS.items() if sentence not in told] == []


@pytest.mark.parametrize("code", ["import compstiff", "from compstiff.cli.main import compstiff; compstiff(['--help'], None, "
                                  "None, False)"])
def test_the_door_opens_before_anything_is_loaded(code: str) -> None:
    """Neither the import nor the help loads a package that takes time: numpy alone is over the 60 ms that both may take."""
    slow = ("numpy", "scipy", "pandas", "pyarrow", "pydantic", "pymodbus", "toppra", "rich", "yaml", "jinja2")
    done = subprocess.run([sys.executable, "-c", f"{code}\nimport sys; print([n for n in {slow!r} if n in sys.modules])"],
                          capture_output=True, text=True, check=True, env=os.environ)
    assert done.stdout.splitlines()[-1] == "[]"

"""No command writes two outputs to one path, or an output over an input: every pair of paths of every command is tried."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path

import click
import pytest

from compstiff.cli.console import Named
from compstiff.cli.main import COMMANDS
from compstiff.cli.main import compstiff as group
from tests.runs.command_line import user_files as kit

SAME = "same.dat"


def command(name: str) -> click.Command:
    found = group.get_command(click.Context(group), name)
    assert found is not None
    return found


def kinds(parameter: click.Parameter) -> list[click.ParamType]:
    return list(parameter.type.types) if isinstance(parameter.type, click.Tuple) else [parameter.type]


def role(parameter: click.Parameter) -> str:
    return next((kind.role for kind in kinds(parameter) if isinstance(kind, Named)), "")


def word(kind: click.ParamType, path: str) -> str:
    """A value that the type takes, the path where it is one."""
    if isinstance(kind, Named):
        return path
    if isinstance(kind, click.Choice):
        return str(kind.choices[0])
    return "1"


def words(parameter: click.Parameter, path: str) -> list[str]:
    values = [word(kind, path) for kind in kinds(parameter)]
    return values if isinstance(parameter, click.Argument) else [parameter.opts[0], *values]


def pairs() -> list[tuple[str, str, str]]:
    """Command and the names of two of its paths, one of which it writes."""
    found = []
    for name in COMMANDS:
        paths = [parameter for parameter in command(name).params if role(parameter) in ("input", "output", "either")]
        found += [(name, str(a.name), str(b.name)) for a, b in combinations(paths, 2) if {role(a), role(b)} != {"input"}]
    return found


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_every_path_says_what_it_is(name: str) -> None:
    for parameter in command(name).params:
        for kind in kinds(parameter):
            assert not isinstance(kind, click.Path) or isinstance(kind, Named), f"{name}: {parameter.name} is a bare click.Path"


# `watch` writes into folders alone, which must lie outside the one it reads (CS6006).
@pytest.mark.parametrize(("name", "first", "second"), [pair for pair in pairs() if pair[0] != "watch"])
def test_one_path_for_two_files_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, first: str, second: str
) -> None:
    """Also with --force, where a command has that, and before anything is read: the files hold nothing."""
    monkeypatch.chdir(tmp_path)
    Path(SAME).write_text("kept")
    call = []
    for parameter in command(name).params:
        chosen = parameter.name in (first, second)
        # The log of a program is an option, and yet `correct` needs one.
        if chosen or parameter.required or isinstance(parameter, click.Argument) or parameter.name == "forces_file":
            path = ("./" if parameter.name == second else "") + SAME if chosen else f"{parameter.name}.dat"
            if role(parameter) == "input" and not chosen:
                Path(path).write_text("")
            call += words(parameter, path)
    forced = ["--force"] if any("--force" in parameter.opts for parameter in command(name).params) else []
    result = kit.run(name, *call, *forced)
    assert (result.code, "CS0006" in result.err) == (1, True), result
    assert Path(SAME).read_text() == "kept"
    assert not list(tmp_path.glob("output*"))

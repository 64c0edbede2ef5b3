"""The house stands as docs/architecture.md says: its table of rooms is read, and every import of the three packages held
against it."""

from __future__ import annotations

import ast
import graphlib
import re
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs/architecture.md").read_text()
PACKAGES = ("identification", "compensator", "compstiff")
Rooms = dict[str, tuple[set[str], set[str]]]        # name -> the rooms it may import, the files it shows to others


def rooms() -> Rooms:
    """Of the table. A room that may be imported stands there by the last part of its name."""
    table = re.findall(r"^\| `([\w.]+)` \|[^|]*\| ([^|]*) \| ([^|]*) \|$", PAGE, re.M)
    full = {room.rpartition(".")[2]: room for room, _, _ in table}
    assert len(full) == len(table)
    return {room: ({full[name] for name in re.findall(r"`([\w.]+)`", below)}, set(re.findall(r"`([\w.]+)`", shown)))
            for room, below, shown in table}


def sources() -> dict[str, str]:
    files = [path for package in PACKAGES for path in (ROOT / package).rglob("*.py") if "_data" not in path.parts]
    return {".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path.read_text()
            for path in files}


@cache
def named(code: str) -> list[tuple[str, str]]:
    """The modules that a file imports, wherever in it, and what from them ("" for the module itself)."""
    found = []
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.Import):
            found += [(alias.name, "") for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.module is not None, "no file imports relative to itself"
            assert node.level == 0, "no file imports relative to itself"
            found += [(node.module, alias.name) for alias in node.names]
    return found


def imports(code: str, modules: dict[str, str]) -> set[str]:
    """What a file imports: modules of the house by their full name, others by their package."""
    found = {full if (full := f"{module}.{name}") in modules else module for module, name in named(code)}
    return {name if name in modules else name.partition(".")[0] for name in found}


def faults(modules: dict[str, str], table: Rooms) -> list[str]:
    """Every import that the table does not allow, and a circle of files if there is one."""
    def room(module: str) -> str:
        return max((name for name in table if f"{module}.".startswith(f"{name}.")), key=len, default="")

    graph = {module: imports(code, modules) for module, code in modules.items()}
    found = [f"{module} is in no room of docs/architecture.md" for module in modules if not room(module)
             and module not in PACKAGES]
    for module, targets in graph.items():
        below, _ = table.get(room(module), (set(), set()))
        for target in targets:
            if target == "click" and not module.startswith("compstiff"):
                found.append(f"{module} knows click")
            if target not in modules or room(target) == room(module):
                continue
            if room(target) not in below:
                found.append(f"{module} imports {target}: not below it")
            elif not shows(table[room(target)][1], target.removeprefix(room(target)).lstrip(".")):
                found.append(f"{module} imports {target}: an inner part")
    try:
        graphlib.TopologicalSorter({module: targets & modules.keys() for module, targets in graph.items()}).prepare()
    except graphlib.CycleError as circle:
        found.append(f"a circle: {' -> '.join(circle.args[1])}")
    return found


def shows(shown: set[str], file: str) -> bool:
    """Whether a room shows this file of it; "" is its front."""
    return not shown or file in shown or not file


def test_every_import_goes_down() -> None:
    assert faults(sources(), rooms()) == []


def test_the_rooms_themselves_go_down() -> None:
    """A room imports only rooms that stand above it in the table, and the compensator three of identification alone; but
    learning from a measured part fits, and names causes, as load tests do."""
    order = list(rooms())
    for place, (room, (below, _)) in enumerate(rooms().items()):
        assert below <= set(order[:place]), room
        if room.startswith("compensator"):
            shared = {"identification.common", "identification.formats", "identification.model"}
            if room == "compensator.learning":
                shared |= {"identification.fit", "identification.diagnosis"}
            assert {name for name in below if name.startswith("identification")} <= shared


@pytest.mark.parametrize(("module", "planted", "fault"), [
    ("identification.common.findings", "from compensator.toolpath import Toolpath", "not below it"),
    ("identification.fit.priors", "def late():\n    from identification.diagnosis import record", "not below it"),
    ("compensator.path.route", "import identification.fit.posterior", "not below it"),
    ("identification.fit.noise", "from identification.fit.posterior import posterior", "a circle"),
    ("compensator.correction.job", "import click", "knows click"),
    ("compensator.correction.job", "from compensator.rapid import scanner", "an inner part"),
    ("identification.attic", "", "in no room"),
])
def test_a_planted_fault_is_found(module: str, planted: str, fault: str) -> None:
    modules = sources()
    modules[module] = modules.get(module, "") + f"\n{planted}\n"
    assert any(fault in line for line in faults(modules, rooms()))


def test_the_page_lists_every_file() -> None:
    """And none that is gone."""
    listed, folder = set(), ""
    for line in PAGE[PAGE.index("## The files"):PAGE.index("## RAPID")].splitlines():
        if line and line[0] not in " `#T":
            folder = line
        elif match := re.match(r"  (\S+)", line):
            listed.add(folder.rstrip("/") + "/" + match[1] if folder.endswith("/") else folder)
    files = {str(path.relative_to(ROOT)) for package in PACKAGES for path in (ROOT / package).rglob("*.py")
             if path.name != "__init__.py" and not path.relative_to(ROOT).match("identification/model/effects/*.py")}
    rooms_of_one_file = {room.replace(".", "/") + ".py" for room in rooms()}
    assert {path for path in listed if path.endswith(".py")} == files - rooms_of_one_file

"""The house stands as docs/architecture.md says: its table of rooms is read, and every import of the three packages held
against it."""

from __future__ import annotations

import ast
import graphlib
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("identification", "compensator", "compstiff")
Rooms = dict[str, tuple[set[str], set[str]]]        # name -> the rooms it may import, the files it shows to others


def rooms() -> Rooms:
    table = re.findall(r"^\| `([\w.]+)` \|[^|]*\| ([^|]*) \| ([^|]*) \|$", (ROOT / "docs/architecture.md").read_text(), re.M)
    return {room: (set(re.findall(r"`([\w.]+)`", below)), set(re.findall(r"`([\w.]+)`", doors))) for room, below,
            doors in table}


def sources() -> dict[str, str]:
    files = [path for package in PACKAGES for path in (ROOT / package).rglob("*.py") if "_data" not in path.parts]
    return {".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path.read_text()
            for path in files}


def imports(module: str, code: str, modules: dict[str, str]) -> set[str]:
    """What a file imports, wherever in it: modules of the house by their full name, others by their package."""
    found = set()
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            assert not node.level, f"{module} imports relative to itself"
            found |= {full if (full := f"{node.module}.{alias.name}") in modules else node.module for alias in node.names}
    return {name if name in modules else name.partition(".")[0] for name in found}


def faults(modules: dict[str, str], table: Rooms) -> list[str]:
    """Every import that the table does not allow, and a circle of files if there is one."""
    def room(module: str) -> str:
        return max((name for name in table if f"{module}.".startswith(f"{name}.")), key=len, default="")

    graph = {module: imports(module, code, modules) for module, code in modules.items()}
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
            elif target.removeprefix(room(target)).lstrip(".") not in (table[room(target)][1] or {""}):
                found.append(f"{module} imports {target}: an inner part")
    try:
        graphlib.TopologicalSorter({module: targets & modules.keys() for module, targets in graph.items()}).prepare()
    except graphlib.CycleError as circle:
        found.append(f"a circle: {' -> '.join(circle.args[1])}")
    return found


def test_every_import_goes_down() -> None:
    assert faults(sources(), rooms()) == []


def test_the_rooms_themselves_go_down() -> None:
    """A room imports only rooms that stand above it in the table, and the compensator three of identification alone."""
    order = list(rooms())
    for place, (room, (below, _)) in enumerate(rooms().items()):
        assert below <= set(order[:place]), room
        if room.startswith("compensator"):
            shared = {"identification.common", "identification.formats", "identification.model"}
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

"""Which test reaches which line of the packages, and how long it takes: a plugin of pytest, for benchmarks/mutants.py.

    python benchmarks/reached.py FOLDER [what pytest takes]            # Python 3.12 or newer: sys.monitoring
    python benchmarks/reached.py FOLDER --slowest                      # what was measured, by file and by test

A line is reported once a test and then no more, so that a run with the map takes little longer than one without. What a
fixture of a module or of the session reaches belongs to every test that asks for it, and its time too; what a command in a
process of its own reaches belongs to the test that started it (a process that is killed, or ends without its handlers, tells
nothing). Lines outside functions are reached by whoever imports the file first, and are left out. Seconds are of the
processor, of children too. A line of JSON a test, written when it ends; tests that do not pass are left out of the map, which
is read from all files of the folder.
"""

from __future__ import annotations

import argparse
import atexit
import collections
import inspect
import json
import os
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("identification", "compensator", "compstiff")
FOLDER = "COMPSTIFF_REACHED"                        # the variable of the environment that names the folder
Lines = dict[str, set[int]]                         # file, from the root -> line numbers


class Watched:
    """The lines that run, in the set that is on top."""

    def __init__(self) -> None:
        self.stack: list[set[tuple[str, int]]] = [set()]
        self.prefixes = tuple(f"{ROOT / package}{os.sep}" for package in PACKAGES)
        # From Python 3.12 on, and types are checked on 3.11 too.
        monitoring = sys.monitoring                                            # type: ignore[attr-defined,unused-ignore]
        self.done, self.again = monitoring.DISABLE, monitoring.restart_events
        monitoring.use_tool_id(monitoring.COVERAGE_ID, "reached")
        monitoring.register_callback(monitoring.COVERAGE_ID, monitoring.events.LINE, self.line)
        monitoring.set_events(monitoring.COVERAGE_ID, monitoring.events.LINE)

    def close(self) -> None:
        """No more calls: what runs while Python ends is nobody's."""
        sys.monitoring.set_events(sys.monitoring.COVERAGE_ID, 0)               # type: ignore[attr-defined,unused-ignore]

    def line(self, code: Any, number: int) -> Any:
        """Called once for a line until `again`."""
        if code.co_flags & inspect.CO_OPTIMIZED and code.co_filename.startswith(self.prefixes):
            self.stack[-1].add((code.co_filename, number))
        return self.done

    def push(self) -> None:
        self.stack.append(set())
        self.again()

    def pop(self) -> set[tuple[str, int]]:
        self.again()
        return self.stack.pop()


def by_file(lines: set[tuple[str, int]]) -> dict[str, list[int]]:
    """File from the root -> its lines in order."""
    found: dict[str, list[int]] = collections.defaultdict(list)
    for file, line in sorted(lines):
        found[Path(file).relative_to(ROOT).as_posix()].append(line)
    return dict(found)


def spent() -> float:
    """Seconds of the processor, this process and its children that ended."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


class Plugin:
    """Writes a line a test into `reached-PROCESS.jsonl`."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.watched = folder, Watched()
        self.fixtures: dict[int, tuple[set[tuple[str, int]], float]] = {}
        self.file = folder / f"reached-{os.getpid()}.jsonl"
        self.apart = 0.0                            # seconds of fixtures that were set up within this test
        self.passed = True

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef: Any, request: Any) -> Iterator[None]:
        if fixturedef.scope == "function":
            return (yield)
        before, apart = spent(), self.apart
        self.watched.push()
        try:
            return (yield)
        finally:
            own = spent() - before - (self.apart - apart)
            self.apart += own
            self.fixtures[id(fixturedef)] = (self.watched.pop(), own)

    def pytest_runtest_logreport(self, report: Any) -> None:
        self.passed = self.passed and report.passed

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: Any, nextitem: Any) -> Iterator[None]:
        before, begun, self.apart, self.passed = spent(), time.monotonic(), 0.0, True
        self.watched.push()
        try:
            return (yield)
        finally:
            lines, shared = self.watched.pop(), 0.0
            own = spent() - before - self.apart
            for name in item.fixturenames:
                for fixture in item._fixtureinfo.name2fixturedefs.get(name, ()):
                    more, seconds = self.fixtures.get(id(fixture), (set(), 0.0))
                    lines |= more
                    shared += seconds
            with self.file.open("a", encoding="utf-8") as stream:
                stream.write(json.dumps({"test": item.nodeid, "seconds": round(own, 3), "shared": round(shared, 3),
                                         "set_up": round(self.apart, 3), "wall": round(time.monotonic() - begun, 3),
                                         "passed": self.passed, "lines": by_file(lines)}) + "\n")

    def pytest_unconfigure(self) -> None:
        self.watched.close()


def pytest_configure(config: Any) -> None:
    """A process of pytest that runs tests."""
    if os.environ.get(FOLDER) and (hasattr(config, "workerinput") or not config.getoption("numprocesses", None)):
        config.pluginmanager.register(Plugin(Path(os.environ[FOLDER])), "reached-lines")


def of_a_child() -> None:
    """Called by a process that a test starts: its lines, at its end, for the test that the environment names."""
    watched = Watched()
    test = os.environ["PYTEST_CURRENT_TEST"].rsplit(" (", 1)[0]

    def told() -> None:
        lines = watched.pop()
        file = Path(os.environ[FOLDER]) / f"child-{os.getpid()}-{time.monotonic_ns()}.jsonl"
        file.write_text(json.dumps({"test": test, "lines": by_file(lines)}) + "\n", encoding="utf-8")

    atexit.register(told)


@dataclass(frozen=True)
class Map:
    """Tests that pass, what each costs, and who reaches a line."""

    seconds: dict[str, float]                       # alone: with the fixtures it asks for
    reach: dict[str, dict[int, list[str]]]          # file -> line -> tests

    @classmethod
    def read(cls, folder: Path) -> Map:
        """From the files of the folder."""
        seconds: dict[str, float] = {}
        reach: dict[str, dict[int, list[str]]] = collections.defaultdict(lambda: collections.defaultdict(list))
        for file in sorted(folder.glob("*.jsonl")):
            for entry in map(json.loads, file.read_text(encoding="utf-8").splitlines()):
                if entry.get("passed"):
                    seconds[entry["test"]] = entry["seconds"] + entry["shared"]
                for name, lines in entry["lines"].items():
                    for line in lines:
                        reach[name][line].append(sys.intern(entry["test"]))
        return cls(seconds, reach)

    def reaching(self, places: Iterable[tuple[str, int]]) -> list[str]:
        """The tests that reach one of the lines, the cheapest first."""
        tests = {test for file, line in places for test in self.reach.get(file, {}).get(line, ()) if test in self.seconds}
        return sorted(tests, key=lambda test: (self.seconds[test], test))


def slowest(folder: Path) -> None:
    """Seconds of the processor by file, and the slowest tests."""
    entries = [entry for file in sorted(folder.glob("reached-*.jsonl"))
               for entry in map(json.loads, file.read_text(encoding="utf-8").splitlines())]
    files: collections.Counter[str] = collections.Counter()
    for entry in entries:
        files[entry["test"].split("::")[0]] += entry["seconds"] + entry["set_up"]
    print(f"{len(entries)} tests, {sum(files.values()):.0f} s of the processor")
    for name, seconds in files.most_common(60):
        print(f"{seconds:8.1f}  {name}")
    for entry in sorted(entries, key=lambda entry: -entry["seconds"] - entry["set_up"])[:100]:
        print(f"{entry['seconds']:8.1f} + {entry['set_up']:6.1f}  {entry['test']}")


def main() -> int:
    """Runs pytest with the plugin."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0], allow_abbrev=False)     # --slow is for pytest
    parser.add_argument("folder", type=Path)
    parser.add_argument("--slowest", action="store_true")
    chosen, rest = parser.parse_known_args()
    if chosen.slowest:
        slowest(chosen.folder)
        return 0
    site = chosen.folder / "site"
    site.mkdir(parents=True, exist_ok=True)
    (site / "sitecustomize.py").write_text(
        "import os\nif os.environ.get('COMPSTIFF_REACHED') and os.environ.get('PYTEST_CURRENT_TEST'):\n"
        "    from benchmarks import reached\n    reached.of_a_child()\n", encoding="utf-8")
    paths = [str(site.resolve()), str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])]
    environment = {**os.environ, FOLDER: str(chosen.folder.resolve()), "PYTHONPATH": os.pathsep.join(paths)}
    return subprocess.call([sys.executable, "-m", "pytest", "-p", "benchmarks.reached", *rest], cwd=ROOT, env=environment)


if __name__ == "__main__":
    raise SystemExit(main())

"""A pytest that has collected all tests once and runs some of them in forks, each with one change of the packages.

For mutants.py. A change is made in the fork alone, so that nothing is imported or collected again: within a function in the
code of the functions as they are loaded, outside in the values of the modules (loaded_modules.py). Processes that a test starts
read the changed file. What was computed while the tests were collected is computed without the change.
"""

from __future__ import annotations

import contextlib
import gc
import importlib
import json
import os
import pkgutil
import select
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
import types
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from benchmarks.loaded_modules import Loaded

PACKAGES = ("identification", "compensator", "compstiff")
SOCKET = "COMPSTIFF_FORKED"                         # the variable of the environment that names the socket's number
COMMAND = (sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", "-p", "no:xdist", "-p", "benchmarks.forked",
           "-o", "addopts=")


class Forked:
    """A tree whose tests are collected and wait; `ran` has some of them run on a change of one file."""

    def __init__(self, tree: Path, tests: list[str]) -> None:
        ours, theirs = socket.socketpair()
        environment = {**os.environ, "PYTHONPATH": str(tree), "OPENBLAS_NUM_THREADS": "1", SOCKET: str(theirs.fileno())}
        environment.pop("PYTHONDONTWRITEBYTECODE", None)            # tests are compiled once
        self.process = subprocess.Popen([*COMMAND, *tests], cwd=tree, env=environment, pass_fds=[theirs.fileno()],
                                        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        theirs.close()
        self.stream = ours.makefile("rw", encoding="utf-8")
        self.tests = set(self._answer()["tests"])

    def _answer(self) -> dict[str, Any]:
        line = self.stream.readline()
        if not line:
            raise RuntimeError(f"pytest has ended: {self.process.wait()}")
        return dict(json.loads(line))

    def ran(self, tests: list[str], seconds: float, file: Path | None = None) -> tuple[str, str]:
        """passed, failed (and which test first), hung, or apart (the change cannot be made in a loaded function)."""
        self.stream.write(json.dumps({"tests": tests, "seconds": seconds, "file": str(file) if file else ""}) + "\n")
        self.stream.flush()
        answer = self._answer()
        return answer["verdict"], answer["by"]

    def close(self) -> None:
        """Ends the process."""
        self.process.kill()
        self.process.wait()


def _codes(code: types.CodeType) -> Iterator[types.CodeType]:
    for part in code.co_consts:
        if isinstance(part, types.CodeType):
            yield part
            yield from _codes(part)


def _key(code: types.CodeType) -> tuple[str, int, int | None]:
    """Where a function stands: its name, its line, the column of its first instruction that has one."""
    column = next((position[2] for position in code.co_positions() if position[2]), None)
    return code.co_qualname, code.co_firstlineno, column if code.co_name == "<lambda>" else None


class Plugin:
    """Serves instead of running what was collected."""

    def __init__(self, number: int) -> None:
        asked = socket.socket(fileno=number)
        asked.set_inheritable(False)
        self.stream = asked.makefile("rw", encoding="utf-8")
        self.functions: dict[str, list[types.FunctionType]] = {}

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """Until nobody asks any more."""
        for package in PACKAGES:
            for module in pkgutil.walk_packages(importlib.import_module(package).__path__, f"{package}."):
                with contextlib.suppress(ImportError, SystemExit):
                    importlib.import_module(module.name)
        gc.unfreeze()                           # tests/conftest.py freezes what was collected, functions among it
        gc.collect()
        for each in gc.get_objects():
            if isinstance(each, types.FunctionType):
                self.functions.setdefault(each.__code__.co_filename, []).append(each)
        self.loaded = Loaded.of(*PACKAGES, "tests", "benchmarks")
        gc.freeze()
        items = {item.nodeid: item for item in session.items}
        self._tell(tests=list(items))
        for line in self.stream:
            asked = json.loads(line)
            self._tell(**self._judged(session, [items[test] for test in asked["tests"]], asked["file"], asked["seconds"]))
        return True

    def _tell(self, **what: object) -> None:
        self.stream.write(json.dumps(what) + "\n")
        self.stream.flush()

    def _judged(self, session: pytest.Session, items: list[pytest.Item], file: str, seconds: float) -> dict[str, str]:
        reading, writing = os.pipe()
        folder = tempfile.mkdtemp(prefix="forked-")
        child = os.fork()
        if not child:
            try:
                os.setsid()
                os.close(reading)
                said = self._in_a_fork(session, items, file, Path(folder))
                os.write(writing, f"{json.dumps(said)}\n".encode())
            finally:
                os._exit(0)
        os.close(writing)
        said = _within(reading, seconds)
        with contextlib.suppress(ProcessLookupError):
            os.killpg(child, signal.SIGKILL)
        os.waitpid(child, 0)
        os.close(reading)
        shutil.rmtree(folder, ignore_errors=True)
        return {"verdict": "hung", "by": ""} if said is None else json.loads(said) if said else {
            "verdict": "failed", "by": "the process ended"}

    def _in_a_fork(self, session: pytest.Session, items: list[pytest.Item], file: str, folder: Path) -> dict[str, str]:
        if file and not self._changed(file):
            return {"verdict": "apart", "by": ""}
        os.environ["PYTHONDONTWRITEBYTECODE"] = "1"
        os.environ["PYTEST_DEBUG_TEMPROOT"] = str(folder)           # where tmp_path of these tests will be
        for item, after in zip(items, [*items[1:], None], strict=True):
            item.config.hook.pytest_runtest_protocol(item=item, nextitem=after)
            if session.testsfailed:
                return {"verdict": "failed", "by": item.nodeid}
        return {"verdict": "passed", "by": ""}

    def _changed(self, file: str) -> bool:
        """Gives loaded functions the code that the file has now, or modules the values; whether there was a difference to
        give."""
        if self.loaded.given(file):
            return True
        new = {_key(code): code for code in _codes(compile(Path(file).read_text(encoding="utf-8"), file, "exec"))}
        changed = False
        for function in self.functions.get(file, []):
            code = new.get(_key(function.__code__))
            if code is not None and code != function.__code__:
                try:
                    function.__code__ = code
                except ValueError:                  # it closes over other names
                    return False
                changed = True
        return changed


def _within(reading: int, seconds: float) -> bytes | None:
    """The line that the child says, empty where it ends without; None where it takes longer."""
    until, said = time.monotonic() + seconds, b""
    while not said.endswith(b"\n"):
        ready, _, _ = select.select([reading], [], [], max(until - time.monotonic(), 0.0))
        if not ready:
            return None
        part = os.read(reading, 1 << 16)
        if not part:
            break
        said += part
    return said


def pytest_configure(config: pytest.Config) -> None:
    """A process that mutants.py started."""
    if os.environ.get(SOCKET):
        config.pluginmanager.register(Plugin(int(os.environ.pop(SOCKET))), "forked")

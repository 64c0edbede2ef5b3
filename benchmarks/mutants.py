"""Mutation testing: single tokens of the packages changed at random, each judged by the cheapest tests that reach its line.

    python benchmarks/reached.py STATE/map -q                          # once: who reaches what; Python 3.12 or newer
    python benchmarks/mutants.py [--each 6] [--seed 0] [--only REGEX] [--since COMMIT] [--state STATE] [--budget 60]
                                    [--processes 1] [--limits] [--tests FILES] [--again] [--report]

What is changed: operators, comparisons, `and`/`or`, `min`/`max`, `all`/`any`, signs, numbers, True and False, a return of
nothing, `continue`/`break`, a `not`. As many are drawn from each room, in turns, so that a run that is cut short is even too;
with --since only of lines that the commit did not have, with --limits only numbers outside functions.
Each is made in a copy of the tree, in a fork of a pytest that has collected all tests (forked.py); where it reaches into a
class, in a process of its own. Tests that reach its statement judge it, those of its own room first, then all others, the
cheapest first, until they would take --budget seconds of the processor; for a statement outside functions (a limit, a table)
those that reach a line which names what it sets, and those of tables; with --tests all of these files. A test that fails
notices it; on the tree as it is it must pass, which is tried once in a call. What takes five times as long as the map says has
hung. What was judged stands in a file of JSON lines, and is not judged again: the same call goes on. With --again those that
survived are judged once more, with a greater budget: whether a test of the suite notices that is not among the cheapest.
Printed: by room.
Survivors whose change nobody can see are in equivalent_mutants.tsv, each with its reason.
"""

from __future__ import annotations

import argparse
import ast
import collections
import compileall
import functools
import io
import json
import os
import py_compile
import queue
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import tokenize
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.forked import Forked
from benchmarks.reached import Map

ROOT = Path(__file__).parents[1]
EQUIVALENT = Path(__file__).with_name("equivalent_mutants.tsv")
PACKAGES = ("identification", "compensator", "compstiff")
PAIRS = (("+", "-"), ("*", "/"), ("<", "<="), (">", ">="), ("==", "!="), ("and", "or"), ("min", "max"), ("all", "any"),
         ("True", "False"), ("continue", "break"), ("minimum", "maximum"), ("argmin", "argmax"), ("floor", "ceil"),
         ("+=", "-="), ("|", "&"), ("sin", "cos"))
SWAPS = {**dict(PAIRS), **{other: one for one, other in PAIRS}, "**": "*", "//": "/", "%": "*", "@": "*", "not": "",
         "is": "is not"}
PYTEST = (sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", "-p", "no:xdist", "-o", "addopts=")
# Tests that hold what stands outside functions against tables written by hand: they reach no line that names it.
TABLES = ("tests/identification/model/test_contract_registry.py::", "tests/test_file_limits.py::",
          "tests/compstiff/cli/test_contract_limits.py::",
          "tests/compensator/modbus/test_contract_wire.py::test_the_documented_map_is_the_map")
# A test costs so much besides what it does itself [s].
EACH_TEST = 0.003
# Where a change is of no behaviour: words for people, types, what is imported for the type checker alone.
NO_CODE = re.compile(r"^\s*(@|from |import |def |class |if TYPE_CHECKING|raise error|hint=|f?\"|\w+: [A-Z][\w\[\], .|]*$)")


@dataclass(frozen=True)
class Mutant:
    """A token at a line and column (from 1 and 0) of a file, and what stands there instead."""

    file: str
    line: int
    column: int
    token: str
    other: str
    text: str

    @property
    def key(self) -> str:
        return f"{self.file}:{self.line}:{self.column} {self.token} -> {self.other}"

    @property
    def room(self) -> str:
        return ".".join(Path(self.file).parts[:2]).removesuffix(".py")


def mutants_of(file: Path) -> list[Mutant]:
    """All single changes of one file."""
    text = file.read_text(encoding="utf-8")
    lines, name = text.split("\n"), file.relative_to(ROOT).as_posix()
    silent = _silent(ast.parse(text))
    found, before = [], None
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        line, column = token.start
        other = SWAPS.get(token.string)
        if token.type == tokenize.NUMBER and not re.fullmatch(r"0x.*|.*j", token.string):
            other = "1" if token.string in ("0", "0.0") else "0" if token.string in ("1", "1.0") else f"({token.string} * 2)"
        if token.string == "return" and lines[line - 1].strip() not in ("return", "return None"):
            other = "return None and"
        usual = token.type in (tokenize.OP, tokenize.NAME, tokenize.NUMBER)
        # A star before an argument, the `in` of a loop, the bar between two types, strict of a zip of what is equally long.
        no_operator = (token.string in ("*", "**", "/") and before in ("(", ",", "=", "[", ":")) or (
            token.string == "in" and "for " in lines[line - 1]) or (token.string == "|" and ":" in lines[line - 1]) or (
            lines[line - 1][:column].endswith("strict="))
        if usual and other is not None and not no_operator and line not in silent and not NO_CODE.match(lines[line - 1]):
            found.append(Mutant(name, line, column, token.string, other, lines[line - 1].strip()))
        if token.string == "not" and before == "is" and found and found[-1].token in ("is", "not"):
            found = found[:-1 - (len(found) > 1 and found[-1].token == "not" and found[-2].token == "is")]     # `is not` is one
        if token.string.strip():
            before = token.string
    return found


def _silent(tree: ast.Module) -> set[int]:
    """Lines of docstrings, annotations, complaints' words and decorators."""
    lines: set[int] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.ClassDef | ast.Module) and ast.get_docstring(node) is not None:
            first = node.body[0]
            lines |= set(range(first.lineno, (first.end_lineno or first.lineno) + 1))
        if isinstance(node, ast.FunctionDef):
            lines |= set(range(node.lineno, node.body[0].lineno))
        said = isinstance(node, ast.Call) and getattr(node.func, "id", "") in ("error", "Finding")
        if isinstance(node, ast.JoinedStr | ast.Call) and (said or isinstance(node, ast.JoinedStr)):
            lines |= set(range(node.lineno + isinstance(node, ast.Call), (node.end_lineno or node.lineno) + 1))
    return lines


def written(tree: Path, mutant: Mutant) -> str:
    """Makes the change in the copy; returns what stood there."""
    file = tree / mutant.file
    before = file.read_text(encoding="utf-8")
    lines = before.split("\n")
    line = lines[mutant.line - 1]
    lines[mutant.line - 1] = line[:mutant.column] + mutant.other + line[mutant.column + len(mutant.token):]
    file.write_text("\n".join(lines), encoding="utf-8")
    return before


def statement(text: str, line: int) -> tuple[int, int, bool]:
    """First and last line of the innermost statement (of a compound one its head), and whether it stands in a function."""
    first, last, inside = line, line, False
    ahead: list[tuple[ast.AST, bool]] = [(ast.parse(text), False)]
    while ahead:
        node, within = ahead.pop()
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.stmt | ast.excepthandler | ast.match_case):
                begins, ends = getattr(child, "lineno", 0), getattr(child, "end_lineno", 0) or 0
                body = getattr(child, "body", None)
                if begins <= line <= ends:
                    first, last, inside = begins, min(ends, max(body[0].lineno - 1, begins)) if body else ends, within
                    if last < line:
                        first, last = line, line
                ahead.append((child, within or isinstance(node, ast.FunctionDef) or isinstance(child, ast.FunctionDef)))
    return first, last, inside


def names_of(text: str, line: int) -> list[str]:
    """What an assignment outside functions sets, and what others of its module make of it."""
    head = re.match(r"\s*(\w+)\b", text.split("\n")[line - 1])
    names = {head[1]} if head else set()
    for node in ast.parse(text).body:
        if isinstance(node, ast.Assign | ast.AnnAssign):
            used = {each.id for each in ast.walk(node) if isinstance(each, ast.Name)}
            if node.lineno <= line <= (node.end_lineno or 0) or names & used:
                names |= {each.id for target in (node.targets if isinstance(node, ast.Assign) else [node.target])
                          for each in ast.walk(target) if isinstance(each, ast.Name)}
    return sorted(names)


def judges(mutant: Mutant, known: Map, budget: float) -> list[str]:
    """The tests that reach it: of its own room (those of a file that is named after its file first), then of others, the
    cheapest first, for `budget` seconds together."""
    text = (ROOT / mutant.file).read_text(encoding="utf-8")
    first, last, inside = statement(text, mutant.line)
    tests = known.reaching((mutant.file, line) for line in range(first, last + 1)) if inside else []
    if not tests and not inside:
        name = re.compile(rf"\b(?:{'|'.join(map(re.escape, names_of(text, first)))})\b")
        tests = known.reaching((file, k) for file in known.reach if (ROOT / file).is_file()
                               for k, line in enumerate((ROOT / file).read_text(encoding="utf-8").split("\n"), 1)
                               if name.search(line))
    tables = [] if inside else [test for test in known.seconds if test.startswith(TABLES)]
    tests = list(dict.fromkeys([*tables, *tests]))
    package, *rooms, own = Path(mutant.file).with_suffix("").parts
    room = f"tests/{package}/{rooms[0]}/" if rooms else f"tests/{package}/test_"
    chosen: list[str] = []
    spent = 0.0
    for test in sorted(tests, key=lambda test: (test not in tables, not test.startswith(room),
                                             own not in test.split("::")[0].split("/")[-1])):
        cost = known.seconds[test] + EACH_TEST
        if spent + cost <= budget or not chosen:
            chosen.append(test)
            spent += cost
    return chosen


def ran(tree: Path, tests: list[str], seconds: float) -> tuple[int | None, str]:
    """Exit of pytest on the tree (nothing: it took too long), and what failed first."""
    environment = {**os.environ, "PYTHONPATH": str(tree), "OPENBLAS_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": "1"}
    asked = tree / ".asked"
    asked.write_text("\n".join(tests), encoding="utf-8")
    with subprocess.Popen([*PYTEST, f"@{asked.name}"], cwd=tree, env=environment, stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT, text=True, start_new_session=True) as process:
        try:
            told, _ = process.communicate(timeout=seconds)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            return None, ""
    first = re.search(r"^(?:FAILED|ERROR) (.+?)(?: - |$)", told, re.MULTILINE)
    return process.returncode, first[1] if first else told[-200:]


def copied(tree: Path) -> None:
    """The project into a folder of its own, compiled: a file that is changed is told by what it says, not by its time."""
    shutil.rmtree(tree, ignore_errors=True)
    shutil.copytree(ROOT, tree, ignore=shutil.ignore_patterns(".git", "__pycache__", ".*_cache", ".hypothesis"))
    for package in PACKAGES:
        compileall.compile_dir(tree / package, quiet=1, invalidation_mode=py_compile.PycInvalidationMode.CHECKED_HASH)


class Judge:
    """A copy of the tree, and a pytest that waits there."""

    def __init__(self, tree: Path, known: Map, chosen: argparse.Namespace, passing: set[str]) -> None:
        copied(tree)
        self.tree, self.known, self.budget, self.passing = tree, known, chosen.budget, passing
        self.forked = Forked(tree, chosen.tests)
        self.tests = sorted(self.forked.tests) if chosen.tests else []

    def verdict(self, mutant: Mutant, tests: list[str], limit: float) -> tuple[str, str]:
        """noticed, survived, unreached, hung, broken (no Python) or unsure (who noticed fails without the change too), by whom.

        Tests that pass without a change are added to `passing`."""
        text = (self.tree / mutant.file).read_text(encoding="utf-8")
        try:
            ast.parse(text)
        except SyntaxError:
            return "broken", ""
        if not tests:
            return "unreached", ""
        outcome, by = self.forked.ran(tests, limit, self.tree / mutant.file)
        if outcome == "apart":
            code, by = ran(self.tree, tests, limit)
            outcome = "hung" if code is None else "failed" if code else "passed"
            by = by if "::" in by else tests[0]
        return {"failed": "noticed", "passed": "survived"}.get(outcome, outcome), by if outcome == "failed" else ""

    def judged(self, mutant: Mutant) -> dict[str, object]:
        """The entry of the file of what was judged."""
        tests = self.tests or [test for test in judges(mutant, self.known, self.budget) if test in self.forked.tests]
        limit = 60.0 + 5.0 * sum(self.known.seconds.get(test, 1.0) for test in tests)
        before, begun = written(self.tree, mutant), time.monotonic()
        try:
            verdict, by = self.verdict(mutant, tests, limit)
        finally:
            (self.tree / mutant.file).write_text(before, encoding="utf-8")
        if verdict == "noticed" and by in self.forked.tests and by not in self.passing:
            if self.forked.ran([by], limit)[0] == "passed":
                self.passing.add(by)
            else:
                verdict = "unsure"
        return {"key": mutant.key, "room": mutant.room, "text": mutant.text, "verdict": verdict, "by": by, "tests": len(tests),
                "seconds": round(time.monotonic() - begun, 1)}


def new_lines(commit: str) -> dict[str, set[int]]:
    """File -> lines that stand in the tree and not in the commit."""
    told = subprocess.run(["git", "diff", "-U0", "--no-renames", commit, "--", *PACKAGES], cwd=ROOT, check=True,
                          capture_output=True, text=True).stdout
    lines: dict[str, set[int]] = collections.defaultdict(set)
    name = ""
    for file, first, count in re.findall(r"^\+\+\+ b/(.*)$|^@@ .*?\+(\d+)(?:,(\d+))? @@", told, re.MULTILINE):
        name = file or name
        if first:
            lines[name] |= set(range(int(first), int(first) + int(count or 1)))
    return lines


def _outside(tree: ast.Module) -> set[int]:
    """Lines of assignments outside functions."""
    lines: set[int] = set()
    ahead: list[ast.stmt] = list(tree.body)
    while ahead:
        node = ahead.pop()
        if isinstance(node, ast.ClassDef):
            ahead += node.body
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            lines |= set(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    return lines


def drawn(chosen: argparse.Namespace) -> list[Mutant]:
    """`each` of every room, the first of each, then the second of each, and so on."""
    files = [file for package in PACKAGES for file in sorted((ROOT / package).rglob("*.py"))]
    every = [mutant for file in files for mutant in mutants_of(file) if re.search(chosen.only, mutant.file)]
    if chosen.since:
        new = new_lines(chosen.since)
        every = [mutant for mutant in every if mutant.line in new.get(mutant.file, ())]
    if chosen.limits:
        outside = {file.relative_to(ROOT).as_posix(): _outside(ast.parse(file.read_text(encoding="utf-8"))) for file in files}
        every = [mutant for mutant in every if mutant.token[0] in "0123456789." and mutant.line in outside[mutant.file]]
    rooms: dict[str, list[Mutant]] = collections.defaultdict(list)
    for k in np.random.default_rng(chosen.seed).permutation(len(every)):
        rooms[every[k].room].append(every[k])
    turns = [rooms[room][turn] for turn in range(chosen.each) for room in sorted(rooms) if turn < len(rooms[room])]
    print(f"{len(every)} mutants in {len(files)} files of {len(rooms)} rooms; seed {chosen.seed}, {len(turns)} drawn",
          flush=True)
    return turns


def main() -> int:
    """Draws and judges."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--each", type=int, default=6, help="of each room")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=1e9, help="begin no further mutant after this time")
    parser.add_argument("--only", default="")
    parser.add_argument("--since", default="", metavar="COMMIT", help="only of lines that are new since")
    parser.add_argument("--limits", action="store_true", help="only numbers outside functions")
    parser.add_argument("--tests", nargs="*", default=[], metavar="FILE", help="judge by all tests of these, without a map")
    parser.add_argument("--budget", type=float, default=60.0)
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--state", type=Path, default=Path(tempfile.gettempdir()) / "compstiff-mutants")
    parser.add_argument("--again", action="store_true", help="those that survived, once more")
    parser.add_argument("--report", action="store_true", help="judge none, print what was judged")
    chosen = parser.parse_args()
    chosen.state.mkdir(parents=True, exist_ok=True)
    lines = chosen.state / "judged.jsonl"
    judged_before = [json.loads(line) for line in lines.read_text().splitlines()] if lines.exists() else []
    told_of = {entry["key"]: entry for entry in judged_before}
    if not chosen.report:
        left = {key for key, entry in told_of.items() if entry["verdict"] == "survived" and not argued(entry)}
        ahead = [mutant for mutant in drawn(chosen) if (mutant.key in left if chosen.again else mutant.key not in told_of)]
        known, until = Map.read(chosen.state / "map"), time.monotonic() + chosen.seconds
        waiting: queue.Queue[Judge] = queue.Queue()
        passing: set[str] = set()
        for k in range(chosen.processes):
            waiting.put(Judge(chosen.state / f"tree-{k}", known, chosen, passing))

        def one(mutant: Mutant) -> None:
            judge = waiting.get()
            try:
                if time.monotonic() < until:
                    entry = judge.judged(mutant)
                    told_of[mutant.key] = entry
                    with lines.open("a") as stream:
                        stream.write(json.dumps(entry) + "\n")
                    print(f"{entry['verdict']:9}{entry['seconds']:6.1f} s {entry['tests']:4} tests  {mutant.key}\n"
                          f"    {mutant.text}", flush=True)
            finally:
                waiting.put(judge)

        with ThreadPoolExecutor(chosen.processes) as pool:
            list(pool.map(one, ahead))
        while not waiting.empty():
            waiting.get().forked.close()
    return told(told_of)


@functools.cache
def equivalent() -> set[tuple[str, ...]]:
    """File, line and change of those whose change nobody can see."""
    return {tuple(line.split("\t")[:3]) for line in EQUIVALENT.read_text(encoding="utf-8").splitlines()}


def argued(entry: dict[str, Any]) -> bool:
    """Whether what was judged is argued to be equivalent."""
    place, change = entry["key"].split(" ", 1)
    return (place.split(":")[0], entry["text"], change) in equivalent()


def told(known: dict[str, dict[str, Any]]) -> int:
    """By room; exit 1 where one survived that is not argued to be equivalent."""
    rooms: dict[str, collections.Counter[str]] = collections.defaultdict(collections.Counter)
    for entry in known.values():
        same = entry["verdict"] in ("survived", "unreached") and argued(entry)
        rooms[entry["room"]]["equivalent" if same else entry["verdict"]] += 1
    total: collections.Counter[str] = collections.Counter()
    for room, counts in sorted(rooms.items()):
        total.update(counts)
        print(f"{room:34}" + "  ".join(f"{name} {counts[name]}" for name in sorted(counts)))
    print(f"{sum(total.values())} judged: " + ", ".join(f"{name} {count}" for name, count in total.most_common()))
    return int(total["survived"] + total["unreached"] > 0)


if __name__ == "__main__":
    raise SystemExit(main())

"""Mutation testing: single tokens of the packages changed at random, each judged by the tests nearest to it.

    python benchmarks/mutants.py [--count 60] [--seed 0] [--only REGEX] [--state DIR] [--timeout 240] [--report]

Drawn evenly over the tokens that can be changed: operators, comparisons, `and`/`or`, `min`/`max`, `all`/`any`, signs, numbers,
True and False, a return of nothing, `continue`/`break`, a `not`. Each is made in a copy of the tree. First the tests of its own
room judge it, then files of tests that import its module by name, the smallest first, `--more` of them. A test that fails kills
it; where a group of files takes longer than --timeout nothing is known of it. What was judged stands in a file of JSON lines,
and is not judged again: the same call goes on. Printed: killed and surviving by room. Survivors whose change nobody can see are
in EQUIVALENT, each with its reason.
"""

from __future__ import annotations

import argparse
import ast
import collections
import io
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import tokenize
from dataclasses import dataclass
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[1]
PACKAGES = ("identification", "compensator", "compstiff")
PAIRS = (("+", "-"), ("*", "/"), ("<", "<="), (">", ">="), ("==", "!="), ("and", "or"), ("min", "max"), ("all", "any"),
         ("True", "False"), ("continue", "break"), ("minimum", "maximum"), ("argmin", "argmax"), ("floor", "ceil"),
         ("+=", "-="), ("|", "&"), ("sin", "cos"))
SWAPS = {**dict(PAIRS), **{other: one for one, other in PAIRS}, "**": "*", "//": "/", "%": "*", "@": "*", "not": "",
         "is": "is not"}
PYTEST = (sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", "-p", "no:xdist", "-o", "addopts=")
# Where a change is of no behaviour: words for people, types, what is imported for the type checker alone.
NO_CODE = re.compile(r"^\s*(@|from |import |def |class |if TYPE_CHECKING|raise error|hint=|f?\"|\w+: [A-Z][\w\[\], .|]*$)")
# Survivors whose change nobody can see: file, line's text, change, and why.
EQUIVALENT: tuple[tuple[str, str, str, str], ...] = ()


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
        if token.type == tokenize.NAME and token.string == "return" and lines[line - 1].strip() != "return":
            other = "return None and"
        usual = token.type in (tokenize.OP, tokenize.NAME, tokenize.NUMBER)
        # A star before an argument, the `in` of a loop, the bar between two types.
        no_operator = (token.string in ("*", "**", "/") and before in ("(", ",", "=", "[", ":")) or (
            token.string == "in" and "for " in lines[line - 1]) or (token.string == "|" and ":" in lines[line - 1])
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


def judges(mutant: Mutant, more: int) -> list[list[str]]:
    """Groups of test files: of the mutant's own room, then `more` that name its module, the smallest first."""
    parts = Path(mutant.file).with_suffix("").parts
    room = ROOT / "tests" / Path(*parts[:2])
    own = sorted(room.glob("test_*.py")) if room.is_dir() else sorted((ROOT / "tests" / parts[0]).glob("test_*.py"))
    if len(parts) > 2 and (room / parts[2]).is_dir():
        own = sorted((room / parts[2]).rglob("test_*.py")) or own
    stem, module = parts[-1], ".".join(parts)
    named = re.compile(rf"\b{re.escape(module)}\b|\b{re.escape('.'.join(parts[:-1]))} import .*\b{stem}\b")
    others = [file for file in (ROOT / "tests").rglob("test_*.py")
              if file not in own and named.search(file.read_text(encoding="utf-8"))]
    runs = [ROOT / "tests/runs/command_line" / f"test_{name}.py" for name in ("landing", "refusals", "unchanged", "identify")]
    late = [*sorted(others, key=lambda file: file.stat().st_size), *runs][:more]
    # Those that name the module come first: they are the likeliest to see it.
    own.sort(key=lambda file: (not named.search(file.read_text(encoding="utf-8")), file.stat().st_size))
    return [[str(file.relative_to(ROOT)) for file in group] for group in (own, late) if group]


def judged(tree: Path, mutant: Mutant, timeout: float, more: int) -> tuple[str, str, float]:
    """("killed" | "timeout" | "survived" | "broken": no Python, by which test, seconds)."""
    before, begun = written(tree, mutant), time.monotonic()
    environment = {**os.environ, "PYTHONPATH": str(tree), "OPENBLAS_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": "1"}
    try:
        try:
            ast.parse((tree / mutant.file).read_text(encoding="utf-8"))
        except SyntaxError:
            return "broken", "", 0.0
        for group in judges(mutant, more):
            try:
                done = subprocess.run([*PYTEST, *group], cwd=tree, env=environment, capture_output=True, text=True, check=False,
                                      timeout=timeout, start_new_session=True)
            except subprocess.TimeoutExpired:
                return "timeout", group[0], time.monotonic() - begun
            if done.returncode > 2:
                raise RuntimeError(f"pytest could not run: {done.stdout[-500:]}{done.stderr[-500:]}")
            if done.returncode:
                first = re.search(r"^(?:FAILED|ERROR) (\S+)", done.stdout, re.MULTILINE)
                return "killed", first[1] if first else f"exit {done.returncode}", time.monotonic() - begun
        return "survived", "", time.monotonic() - begun
    finally:
        (tree / mutant.file).write_text(before, encoding="utf-8")


def main() -> int:
    """Draws and judges."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=1e9, help="draw no further mutant after this time")
    parser.add_argument("--only", default="")
    parser.add_argument("--more", type=int, default=3)
    parser.add_argument("--timeout", type=float, default=240.0)
    parser.add_argument("--state", type=Path, default=Path(tempfile.gettempdir()) / "compstiff-mutants")
    parser.add_argument("--report", action="store_true", help="judge none, print what was judged")
    chosen = parser.parse_args()
    files = [file for package in PACKAGES for file in sorted((ROOT / package).rglob("*.py"))]
    every = [mutant for file in files for mutant in mutants_of(file) if re.search(chosen.only, mutant.file)]
    drawn = np.random.default_rng(chosen.seed).permutation(len(every))[:chosen.count]
    chosen.state.mkdir(parents=True, exist_ok=True)
    lines = chosen.state / "judged.jsonl"
    known = {entry["key"]: entry for entry in map(json.loads, lines.read_text().splitlines())} if lines.exists() else {}
    print(f"{len(every)} mutants in {len(files)} files; seed {chosen.seed}, {len(drawn)} drawn, {len(known)} judged before",
          flush=True)
    until = time.monotonic() + chosen.seconds
    if not chosen.report:
        tree = chosen.state / "tree"
        shutil.rmtree(tree, ignore_errors=True)
        shutil.copytree(ROOT, tree, ignore=shutil.ignore_patterns(".git", "__pycache__", ".*_cache", ".hypothesis"))
        for mutant in (every[k] for k in drawn):
            if mutant.key in known or time.monotonic() > until:
                continue
            verdict, by, took = judged(tree, mutant, chosen.timeout, chosen.more)
            entry = {"key": mutant.key, "room": mutant.room, "text": mutant.text, "verdict": verdict, "by": by,
                     "seconds": round(took, 1)}
            known[mutant.key] = entry
            with lines.open("a") as stream:
                stream.write(json.dumps(entry) + "\n")
            print(f"{verdict:9}{took:6.1f} s  {mutant.key}\n    {mutant.text}", flush=True)
    return told(known)


def told(known: dict[str, dict[str, str]]) -> int:
    """By room; exit 1 where one survived that is not argued to be equivalent."""
    equivalent = {f"{file} {text} {change}" for file, text, change, _ in EQUIVALENT}
    rooms: dict[str, collections.Counter[str]] = collections.defaultdict(collections.Counter)
    for entry in known.values():
        place, change = entry["key"].split(" ", 1)
        same = f"{place.split(':')[0]} {entry['text']} {change}" in equivalent
        rooms[entry["room"]]["equivalent" if same and entry["verdict"] == "survived" else entry["verdict"]] += 1
    total: collections.Counter[str] = collections.Counter()
    for room, counts in sorted(rooms.items()):
        total.update(counts)
        print(f"{room:34}" + "  ".join(f"{name} {counts[name]}" for name in sorted(counts)))
    print(f"{sum(total.values())} judged: " + ", ".join(f"{name} {count}" for name, count in total.most_common()))
    return int(total["survived"] > 0)


if __name__ == "__main__":
    raise SystemExit(main())

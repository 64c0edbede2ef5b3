"""The house in figures: files, lines, imports, the way of a program through it, CPU of the first answer.

    python benchmarks/house.py CHECKOUT [CHECKOUT ...]

Each checkout is measured by its own code (this Python needs compstiff's requirements). The way of a program: `correct` on the
sample, every call followed. `files passed` are those in which a function ran. The stages are the calls of functions in other
files that the files of the job make, one after the other; those `climb back` that go to a file deeper in the order of imports
than the stage before: a flow that is read from top to bottom has few.
"""

from __future__ import annotations

import ast
import itertools
import json
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

PACKAGES = ("identification", "compensator", "compstiff")
FOLLOW = r"""
import json, os, sys, threading
from pathlib import Path
root, job_names, arguments = Path(sys.argv[1]), set(sys.argv[2].split(",")), sys.argv[3:]
here = {str(root / name) for name in ("identification", "compensator", "compstiff")}
passed, flow, job_files = [], [], set()
def follow(frame, event, _):
    if event != "call" or not frame.f_code.co_filename.startswith(tuple(here)) or frame.f_code.co_name == "<module>":
        return
    file = frame.f_code.co_filename
    if frame.f_code.co_name in job_names and file.startswith(str(root / "compensator")) and "commands" not in file:
        job_files.add(file)
    if file not in passed: passed.append(file)
    back = frame.f_back
    stage = "." not in frame.f_code.co_qualname and "/common/" not in file
    if stage and back and back.f_code.co_filename in job_files and file not in (back.f_code.co_filename, *flow[-1:]):
        flow.append(file)
try:
    from compstiff.cli.main import compstiff
except ImportError:
    from compensator.cli import compstiff
sys.setprofile(follow)
try:
    compstiff.main(["correct", *arguments], standalone_mode=False)
except SystemExit:
    pass
sys.setprofile(None)
print("FLOW" + json.dumps([passed, flow, sorted(job_files)]))
"""


def modules(root: Path) -> dict[str, Path]:
    """Every file of the packages by its module's name."""
    return {".".join(file.relative_to(root).with_suffix("").parts).removesuffix(".__init__"): file
            for package in PACKAGES if (root / package).is_dir() for file in sorted((root / package).rglob("*.py"))}


def imports(files: dict[str, Path]) -> dict[str, set[str]]:
    """What each module imports of the others, wherever in it."""
    graph: dict[str, set[str]] = {}
    for name, file in files.items():
        graph[name] = set()
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.ImportFrom) and node.module:
                full = {f"{node.module}.{alias.name}" for alias in node.names}
                graph[name] |= {one if one in files else node.module for one in full} & files.keys()
    return graph


def depths(graph: dict[str, set[str]]) -> dict[str, int]:
    """The longest chain of imports below each module; a circle counts once."""
    return {name: _depth(name, graph, {}, ()) for name in graph}


def _depth(name: str, graph: dict[str, set[str]], known: dict[str, int], above: tuple[str, ...]) -> int:
    if name not in known:
        known[name] = max((1 + _depth(other, graph, known, (*above, name)) for other in graph[name]
                           if other not in above and other != name), default=0)
    return known[name]


def circles(graph: dict[str, set[str]]) -> int:
    """Strongly connected groups of more than one module (Tarjan)."""
    import numpy as np
    from scipy.sparse.csgraph import connected_components

    names = list(graph)
    matrix = np.array([[other in graph[name] for other in names] for name in names])
    _, label = connected_components(matrix, directed=True, connection="strong")
    return int((np.bincount(label) > 1).sum())


def flow(root: Path, files: dict[str, Path]) -> tuple[int, int, int]:
    """Files passed, steps between files that the job makes, and how many of them climb back."""
    samples = root / "samples"
    with tempfile.TemporaryDirectory() as folder:
        where: dict[str, Any] = {"env": os.environ | {"PYTHONPATH": str(root)}, "cwd": root}
        start = [sys.executable, "-c", "import sys; from importlib import import_module\nfor name in ('compstiff.cli.main', "
                 "'compensator.cli'):\n    try:\n        group = import_module(name).compstiff\n        break\n"
                 "    except ImportError:\n        pass\ngroup.main(sys.argv[1:], standalone_mode=False)"]
        stiffness = f"{folder}/stiffness.json"
        subprocess.run([*start, "identify", str(samples / "cell.yaml"), str(samples / "measurements.csv"), "-o", stiffness,
                        "-q"], **where, stdout=subprocess.DEVNULL, check=False)
        done = subprocess.run(
            [sys.executable, "-c", FOLLOW, str(root), "predict_program,correct_program,predict_files,predict,correct",
             str(samples / "cell.yaml"), str(samples / "insert.mod"), "--stiffness", stiffness, "--forces",
             str(samples / "insert.forces.parquet"), "--tare", "0:2", "-o", f"{folder}/out.mod", "-q"],
            **where, capture_output=True, text=True, check=True)
    passed, steps, _ = json.loads(next(line for line in done.stdout.splitlines() if line.startswith("FLOW"))[4:])
    names = {str(file): name for name, file in files.items()}
    depth = depths(imports(files))
    way = [depth[names[file]] for file in steps]
    return len(passed), len(steps), sum(after < before for before, after in itertools.pairwise(way))


def cpu(root: Path, *call: str) -> float:
    """CPU [ms] of a call of Python, user and system, the least of nine."""
    code = ("import resource, subprocess, sys; subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL, check=True); "
            "used = resource.getrusage(resource.RUSAGE_CHILDREN); print(used.ru_utime + used.ru_stime)")
    where: dict[str, Any] = {"env": os.environ | {"PYTHONPATH": str(root)}, "cwd": root}
    runs = [subprocess.run([sys.executable, "-c", code, sys.executable, *call], **where, capture_output=True, text=True,
                           check=True) for _ in range(9)]
    return 1e3 * min(float(run.stdout) for run in runs)


def main() -> None:
    """Prints the figures of each checkout."""
    for name in sys.argv[1:]:
        root = Path(name).resolve()
        files = modules(root)
        graph = imports(files)
        lengths = {module: len(file.read_text().splitlines()) for module, file in files.items()}
        largest = max(lengths, key=lengths.__getitem__)
        tests = list((root / "tests").rglob("*.py"))
        print(f"{root}\n  {len(files)} files, {sum(lengths.values())} lines (tests: {len(tests)} files, "
              f"{sum(len(file.read_text().splitlines()) for file in tests)} lines)")
        print(f"  median file {statistics.median(lengths.values()):g} lines, largest {lengths[largest]} ({largest})")
        print(f"  circles of imports: {circles(graph)}")
        print("  one program through correct: {} files passed, {} stages, {} climb back".format(*flow(root, files)))
        entry = "compstiff" if "compstiff" in files else "compensator"
        print(f"  CPU: python {cpu(root, '-c', 'pass'):.0f} ms, import {entry} {cpu(root, '-c', f'import {entry}'):.0f} ms, "
              f"import click {cpu(root, '-c', 'import click'):.0f} ms, --help {cpu(root, '-m', entry, '--help'):.0f} ms")


if __name__ == "__main__":
    main()

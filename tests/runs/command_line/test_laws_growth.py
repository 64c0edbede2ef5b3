"""What `correct` costs grows with the program and no faster, and it starts without what it does not need."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks.correct_time import write_job

# What the few take beyond the start is over twice what the start itself varies by from run to run.
FEW, MANY = 12_000, 96_000
# CPU time grows by more than the targets do, which are 8 times as many: caches, and other work on the machine. A part that
# grows with their square and takes a twentieth of the time at first makes it 11.
MOST_GROWTH = 10.0
# Peak memory a further target [bytes]; it was 1550 when this was last written. What is held a target and read by nobody is
# found here: seventy numbers are.
MOST_BYTES = 2100
RUN = """
import os, sys
child = os.fork()
if not child:
    os.execv(sys.executable, [sys.executable, "-m", "compstiff", *sys.argv[1:]])
_, status, used = os.wait4(child, 0)
print(status, used.ru_utime + used.ru_stime, used.ru_maxrss)
"""
LOADED = """
import json, sys
from compstiff.__main__ import run
try:
    run()
except SystemExit as done:
    print(json.dumps([done.code, sorted({name.partition(".")[0] for name in sys.modules})]))
"""


def arguments(folder: Path, *more: str) -> list[str]:
    cell, program, stiffness, forces, out = (
        str(folder / name) for name in ("cell.yaml", "long.mod", "stiffness.json", "long.forces.csv", "out.mod"))
    return ["correct", cell, program, "--stiffness", stiffness, "--forces", forces, "-o", out, *more]


def cost(folder: Path) -> tuple[float, float]:
    """CPU time [s] and peak memory [bytes] of the whole command."""
    more = ["--offsets", str(folder / "offsets.csv"), "--force"]
    done = subprocess.run([sys.executable, "-c", RUN, *arguments(folder, *more)], capture_output=True, text=True, check=True)
    status, seconds, kilobytes = done.stdout.split()[-3:]
    assert status == "0", done.stderr
    return float(seconds), 1024 * float(kilobytes)


@pytest.mark.skipif(
    not hasattr(os, "wait4") or sys.platform == "darwin",
    reason="a child's own peak memory in kilobytes is os.wait4's on Linux: Windows has no wait4, macOS counts bytes")
def test_time_and_memory_grow_with_the_targets(tmp_path: Path) -> None:
    """Ratios, never absolute times: of the work beyond the start, which a program of a hundred targets shows. Each is the least
    of some runs, the more the less sure it is: what else the machine does only ever adds, also to the start."""
    jobs = [tmp_path / f"{count}" for count in (100, FEW, MANY)]
    for job in jobs:
        job.mkdir()
        write_job(job, int(job.name), "target")
    runs: list[list[tuple[float, float]]] = []
    for _ in range(6):
        runs.append([cost(job) for job in (jobs[0], jobs[0], jobs[1], jobs[2])])
        (start, _), (again, _), (few, few_bytes), (many, many_bytes) = np.min(runs, axis=0)
        start = min(start, again)
        growth, a_target = (many - start) / (few - start), (many_bytes - few_bytes) / (MANY - FEW)
        if growth < MOST_GROWTH and a_target < MOST_BYTES:
            break
    assert growth < MOST_GROWTH
    assert a_target < MOST_BYTES


def test_a_plain_job_starts_without_pandas_scipy_and_toppra(tmp_path: Path) -> None:
    write_job(tmp_path, 100, "target")
    more = ["--offsets", str(tmp_path / "offsets.csv")]
    command = [sys.executable, "-c", LOADED, *arguments(tmp_path, *more)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    code, loaded = json.loads(done.stdout.splitlines()[-1])
    assert code == 0, done.stderr
    assert "numpy" in loaded
    assert not {"pandas", "scipy", "toppra", "openpyxl", "httpx", "pymodbus"} & set(loaded)

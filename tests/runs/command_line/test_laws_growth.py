"""What `correct` costs grows with the program and no faster, and it starts without what it does not need."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks.correct_time import write_job

FEW, MANY = 4_000, 32_000
# CPU time grows by less than the targets do, which are 8 times as many: 6.7 when this was last written, since a part is the
# same for all. One that grows with their square and takes a twentieth of the time at first makes it 9.4.
MOST_GROWTH = 9.0
# Peak memory a further target [bytes]; it was 1550 when this was last written. What is held a target and read by nobody is
# found here: seventy numbers are.
MOST_BYTES = 2100
# Every job in a child of one process that has done a small one: what is loaded at the start is not counted.
RUN = """
import json, os, sys
from compstiff.__main__ import run
def done(words):
    sys.argv = ["compstiff", *words]
    try:
        run()
    except SystemExit as told:
        return told.code or 0
first, *jobs = json.loads(sys.argv[1])
assert done(first) == 0
costs = []
for words in jobs:
    child = os.fork()
    if not child:
        os._exit(done(words))
    _, status, used = os.wait4(child, 0)
    costs.append([status, used.ru_utime + used.ru_stime, 1024 * used.ru_maxrss])
print(json.dumps(costs))
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


def costs(*jobs: Path) -> np.ndarray:
    """(jobs, 2): CPU time [s] and peak memory [bytes] of each command, after the first one was done in the same process."""
    words = [arguments(job, "--offsets", str(job / "offsets.csv"), "--force") for job in jobs]
    done = subprocess.run([sys.executable, "-c", RUN, json.dumps(words)], capture_output=True, text=True, check=True)
    told = np.array(json.loads(done.stdout.splitlines()[-1]))
    assert not told[:, 0].any(), done.stderr
    return told[:, 1:]


@pytest.mark.skipif(
    not hasattr(os, "wait4") or sys.platform == "darwin",
    reason="a child's own peak memory in kilobytes is os.wait4's on Linux: Windows has no wait4, macOS counts bytes")
def test_time_and_memory_grow_with_the_targets(tmp_path: Path) -> None:
    """Ratios, never absolute times: of what a program of a hundred targets does not take. Each is the least of some runs, the
    more the less sure it is: what else the machine does only ever adds."""
    jobs = [tmp_path / f"{count}" for count in (100, FEW, MANY)]
    for job in jobs:
        job.mkdir()
        write_job(job, int(job.name), "target")
    runs: list[np.ndarray] = []
    for _ in range(6):
        runs.append(costs(jobs[0], *jobs))
        (start, _), (few, few_bytes), (many, many_bytes) = np.min(runs, axis=0)
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

"""One job described otherwise in all ways at once: another zero and other axes of world, work object, tool and sensor, another
sign, bias and order of columns, RAPID in other letters, lines, names and numbers. The offsets are the same; the benchmark of
this name tries each way by itself, and more jobs."""

from __future__ import annotations

import copy
from pathlib import Path

import numpy as np
import pytest

from benchmarks.described_job import read
from benchmarks.described_otherwise import answered, differences, make
from benchmarks.descriptions import CORRECT

# What needs other readers than the rest, or says nothing of these logs.
LEFT = ("nothing", "scope", "dialect", "parquet", "clock", "milliseconds")
# The others read RAPID as the job's post writes it.
LAST = ("letters", "lines", "notation")


@pytest.mark.parametrize("number", [11, 19])
def test_a_job_described_otherwise_has_the_same_offsets(number: int, tmp_path: Path) -> None:
    make(95030, number, tmp_path / "job")
    job = read(tmp_path / "job")
    was = answered(copy.deepcopy(job), tmp_path / "was")
    assert was.exits == {"identify": 0, "correct": 0}
    rng = np.random.default_rng(number)
    other = copy.deepcopy(job)
    for name in sorted(set(CORRECT) - set(LEFT), key=lambda name: (name in LAST, name)):
        other = CORRECT[name](other, rng)
    now = answered(other, tmp_path / "now")
    assert differences(was, now, other.turned) == []
    assert was.offsets is not None
    assert np.abs(was.offsets[["ox_mm", "oy_mm", "oz_mm"]].to_numpy()).max() > 0.05

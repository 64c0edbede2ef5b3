"""The same job described otherwise has the same answers: a shop's jobs, each written anew in ways that change nothing.

    python benchmarks/described_otherwise.py N SEED FOLDER [--only REGEX] [--diagnose] [--part]

shop_jobs.py writes N jobs. Each is corrected as it is, and once in every other description: RAPID in other letters, numbers,
lines and signs of quaternions; work object, tool, robot base and sensor put elsewhere together with what is told in them; logs
and load tests in other dialects, orders, units, signs and clocks; the load tests of an arm turned about axis 1, about its
flange, and mirrored. Offsets, what is left and the codes of what is said must be the same, and so must stiffnesses (with
--diagnose the verdict; with --part the figures of learn and verify, of readings made of the offsets). Printed: what differs.
Nothing of the program is imported.
"""

from __future__ import annotations

import argparse
import collections
import copy
import json
import os
import re
import subprocess
import sys
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT), str(Path(__file__).parent)]
from shop_jobs import make

from benchmarks.described_job import Job, measured, read
from benchmarks.descriptions import CORRECT, IDENTIFY, PARTS

# Offsets [um] and what is left [um]: what is written in a file has four decimals, and springs are fitted anew. Where targets
# are added is chosen on a grid whose places are often alike: so many more or fewer are, and what is left there differs.
SAME_UM, SAME_LEFT, SAME_SHARE, MORE_TARGETS = 1.0, 3.0, 0.02, 0.2
# A log by time alone is placed to some milliseconds; where the last digit of a target moves it by one sample, a target at the
# end of a cut has more or less of it, as what is left there tells.
# Springs [sigma]: a force's relative error belongs to each component, so that an arm turned about axis 1 has other weights.
SAME_SPRINGS, TURNED_SPRINGS = 0.02, 0.5
# Figures of learn and verify, share and at least, in their units.
SAME_FIGURE, SAME_LITTLE = 0.01, 0.05
# Descriptions in which the part is measured along other axes, and figures that are along them, or counted in draws along them.
OTHER_AXES = ("work_object", "normals_turned_over")
OF_AXES = "axes|axis|constant|mean_um|setup|causes|by_chance"
# What `learn` takes of the options of `correct`.
LEARNS = ("--tare", "--spindle-rpm")


@dataclass
class Answer:
    """exits and codes by command; springs and their 1 sigma; offsets as a table, None where none were written; verdict;
    figures of the part by name."""

    exits: dict[str, int]
    codes: dict[str, list[str]]
    springs: np.ndarray | None = None
    sigma: np.ndarray | None = None
    offsets: pd.DataFrame | None = None
    verdict: str = ""
    figures: dict[str, float] = field(default_factory=dict)


def called(folder: Path, *words: str) -> tuple[int, dict[str, Any]]:
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run([sys.executable, "-m", "compstiff", *words, "--json"], cwd=folder, env=environment, text=True,
                          capture_output=True, check=False)
    try:
        return done.returncode, json.loads(done.stdout)
    except json.JSONDecodeError:
        return done.returncode, {"findings": [{"code": "no JSON", "message": done.stderr[-300:], "level": "error"}]}


def answered(
    job: Job, folder: Path, *, diagnose: bool = False, correct: bool = True, springs: Path | None = None
) -> Answer:
    """springs: a stiffness file that need not be made anew."""
    job.write(folder)
    end = "parquet" if job.parquet else "csv"
    answer = Answer({}, {})
    steps = [("identify", ["identify", "cell.yaml", f"measurements.{end}", "-o", "stiffness.json"])]
    if springs is not None:
        (folder / "stiffness.json").write_bytes(springs.read_bytes())
        steps = []
    elif diagnose:
        steps.append(("diagnose", ["diagnose", "cell.yaml", f"measurements.{end}", "-o", "diagnosis.json"]))
    if correct:
        out = "out.mod" if len(job.modules) == 1 else "out/"
        steps.append(("correct", ["correct", "cell.yaml", *job.modules, "--stiffness", "stiffness.json", "--forces",
                                  f"forces.{end}", "--accept-rejected", *job.options, "-o", out, "--offsets", "offsets.csv"]))
    if job.part and correct:
        tables = [f"{name}.{end}" for name in ("before", "after")]
        steps.append(("verify", ["verify", "cell.yaml", *tables, "--predicted", "offsets.csv", "--frame", "workobject"]))
        options = [word for name, value in pairwise(job.options) if name in LEARNS for word in (name, value)]
        if len(job.modules) == 1:
            steps.append(("learn", ["learn", "cell.yaml", *job.modules, tables[0], "--stiffness", "stiffness.json", "--forces",
                                    f"forces.{end}", "--accept-rejected", *options, "-o", "learned.json"]))
    for name, words in steps:
        answer.exits[name], told = called(folder, *words)
        if name in ("learn", "verify"):
            answer.figures |= figures(told.get("result"), name)
        answer.codes[name] = sorted(f"{found['code']} {found['level']}" for found in told.get("findings", []))
        if answer.exits[name] == 70:
            print("    defect:", told)
    if (folder / "stiffness.json").exists():
        found = json.loads((folder / "stiffness.json").read_text())
        answer.springs, answer.sigma = np.array([[one["estimate"], one["std"]] for one in found["parameters"]]).T
    if (folder / "diagnosis.json").exists():
        found = json.loads((folder / "diagnosis.json").read_text())
        answer.verdict = f"{found['verdict']} {[(cause['effect'], cause['joint']) for cause in found['causes']]}"
    if (folder / "offsets.csv").exists():
        answer.offsets = pd.read_csv(folder / "offsets.csv", dtype={"added": str, "note": str})
    return answer


def figures(value: Any, name: str) -> dict[str, float]:
    """The numbers within JSON values by their path."""
    if isinstance(value, dict):
        return {key: number for inner, one in value.items() for key, number in figures(one, f"{name}.{inner}").items()}
    if isinstance(value, list):
        return {key: number for inner, one in enumerate(value) for key, number in figures(one, f"{name}.{inner}").items()}
    return {name: float(value)} if isinstance(value, int | float) else {}


def differences(
    was: Answer, now: Answer, turned: np.ndarray, springs: float = SAME_SPRINGS, *, by_time: bool = False,
    same_axes: bool = True,
) -> list[str]:
    """What is not the same, in words. turned: from the axes of the first offsets to those of the second. by_time: the log has
    time alone. same_axes: the part was measured along the same axes."""
    told = [f"{name}: exit {was.exits[name]} became {code}" for name, code in now.exits.items() if code != was.exits[name]]
    for name, codes in now.codes.items():
        # Who else may see a target (CS3270) depends on where it is declared.
        counts = [collections.Counter(code for code in some if code[:6] != "CS3270") for some in (was.codes[name], codes)]
        less, more = counts[0] - counts[1], counts[1] - counts[0]
        if less or more:
            told.append(f"{name}: no longer {sorted(less)}, now {sorted(more)}")
    if was.springs is not None and now.springs is not None and was.sigma is not None:
        off = np.abs(now.springs - was.springs) / was.sigma
        if off.max() > springs:
            told.append(f"springs off by {off.max():.3f} sigma")
    if now.figures:
        both = {name for name in was.figures.keys() & now.figures.keys() if same_axes or not re.search(OF_AXES, name)}
        off = {name: (was.figures[name], now.figures[name]) for name in sorted(both) if abs(
            was.figures[name] - now.figures[name]) > SAME_LITTLE + SAME_FIGURE * abs(was.figures[name])}
        told += [f"{len(off)} figures differ: {dict(list(off.items())[:4])}"] * bool(off)
        alone = sorted(was.figures.keys() ^ now.figures.keys())
        told += [f"figures of one alone: {alone[:4]}"] * bool(alone)
    if now.verdict and was.verdict != now.verdict:
        told.append(f"verdict {was.verdict} became {now.verdict}")
    if "correct" in now.exits and (was.offsets is None) != (now.offsets is None):
        told.append("offsets are not written in both")
    if was.offsets is None or now.offsets is None:
        return told
    if len(was.offsets) != len(now.offsets):
        return [*told, f"{len(was.offsets)} rows of offsets became {len(now.offsets)}"]
    shift = ["ox_mm", "oy_mm", "oz_mm"]
    off = 1000 * np.linalg.norm(was.offsets[shift].to_numpy() @ turned.T - now.offsets[shift].to_numpy(), axis=1)
    left, again = (one.offsets["left_um"].to_numpy(float) for one in (was, now))
    if not np.all(off < (SAME_UM + np.fmax(np.fmax(left, again), 0.0) if by_time else SAME_UM)):
        told.append(f"offsets off by up to {np.nanmax(off):.2f} um, at target {int(np.nanargmax(off))}")
    if by_time:
        return told
    if (np.isnan(left) != np.isnan(again)).any():
        told.append("what is left is known of other targets")
    elif np.any(np.abs(left - again) > SAME_LEFT + SAME_SHARE * left):
        told.append(f"what is left is off by up to {np.nanmax(np.abs(left - again)):.2f} um")
    if (was.offsets["note"].fillna("") != now.offsets["note"].fillna("")).any():
        told.append("other notes: " + str([(a, b) for a, b in zip(was.offsets["note"], now.offsets["note"], strict=True)
                                           if a != b and not (a != a and b != b)][:3]))
    added = [one.offsets["added"].fillna("").str.split().str.len() for one in (was, now)]
    if abs(added[0].sum() - added[1].sum()) > 2 + MORE_TARGETS * added[0].sum():
        told.append(f"{int(added[0].sum())} added targets became {int(added[1].sum())}")
    return told


def main() -> int:
    """Writes jobs, describes each otherwise, and prints what differs."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("jobs", type=int)
    parser.add_argument("seed", type=int)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", default="", help="descriptions whose name matches")
    parser.add_argument("--diagnose", action="store_true")
    parser.add_argument("--part", action="store_true")
    chosen = parser.parse_args()
    count: collections.Counter[str] = collections.Counter()
    for number in range(chosen.jobs):
        folder = chosen.folder / f"job{number:02d}"
        make(chosen.seed, number, folder)
        job = read(folder)
        was = answered(copy.deepcopy(job), folder / "as_it_is", diagnose=chosen.diagnose)
        if chosen.part and was.offsets is not None and was.exits["correct"] == 0:
            measured(job, was.offsets, np.random.default_rng([chosen.seed, number]))
            was = answered(copy.deepcopy(job), folder / "measured", diagnose=chosen.diagnose)
        print(f"{folder.name}: {job.cell['robot']} {job.moved} exits {was.exits} {was.verdict}", flush=True)
        for name, change in [*CORRECT.items(), *(PARTS.items() if job.part else ()), *IDENTIFY.items()]:
            if not re.search(chosen.only, name):
                continue
            other = change(copy.deepcopy(job), np.random.default_rng([chosen.seed, number, len(name)]))
            same = (other.tests.equals(job.tests) and (other.dialect, other.parquet) == (
                job.dialect, job.parquet) and all(other.cell[key] == job.cell[key] for key in ("tool", "base_frame")))
            # What a program says of the arm would be another.
            now = answered(other, folder / name, diagnose=chosen.diagnose, correct=name not in IDENTIFY,
                           springs=folder / "as_it_is" / "stiffness.json" if same else None)
            told = differences(was, now, other.turned,
                               TURNED_SPRINGS if name == "arm_about_axis_1" else SAME_SPRINGS,
                               by_time="target" not in job.moved and len(job.moved) == 4, same_axes=name not in OTHER_AXES)
            count[name] += bool(told)
            for words in told:
                print(f"    {name}: {words}", flush=True)
    print(f"{chosen.jobs} jobs, seed {chosen.seed}; that differ: {dict(count)}")
    return int(sum(count.values()) > 0)


if __name__ == "__main__":
    raise SystemExit(main())

"""Where `correct` spends its time and memory, stage by stage.

    OMP_NUM_THREADS=1 python benchmarks/correct_time.py [TARGETS ...] [--by target|position] [--profile]

The sample's moves repeated to so many inline targets and a CSV log with four samples a target, placed by target number or by
TCP position; each size in a process of its own. CPU time, which other work on the machine stretches less than the clock's.
Peak: the process's resident memory at its highest within the stage (Linux). What a stage calls inside another one counts for
the inner one alone. --profile: the functions with the longest own time.
"""

from __future__ import annotations

import argparse
import contextlib
import cProfile
import json
import multiprocessing
import os
import pstats
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from functools import wraps
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
# As `compstiff` starts (compstiff/__main__.py).
os.environ.setdefault("ARROW_DEFAULT_MEMORY_POOL", "system")

from compensator.correction import correct as correct_module
from compensator.correction import files as files_module
from compensator.correction import predict as predict_module
from compensator.correction.files import Inputs
from compensator.rapid import read_rapid
from identification.common.shipped import shipped
from identification.fit.fit import fit_stiffness
from identification.measurements import read_measurements
from identification.model.cell import read_cell

# What the pipeline calls, and the stage it belongs to.
STAGES = {
    "read_cell": "read cell, stiffness", "read_stiffness": "read cell, stiffness", "read_toolpath": "read program",
    "read_force_log": "read log", "robot_path": "plan: poses and joint angles", "place_forces": "place the log",
    "targets_to_correct": "predict", "predict_path": "predict", "with_zones": "corners",
    "with_intermediate_targets": "intermediate targets", "correct_path": "correct", "rewrite": "write program text",
    "read_back": "read back", "logged_pass": "force that follows the cut", "following_the_cut": "force that follows the cut",
    "left_between": "what is left", "foreseen": "what is left", "expected_left": "what is left",
    "risk_of": "what is left",
    "record": "offsets.csv, record, files", "write_whole": "offsets.csv, record, files",
}
MODULES = (predict_module, correct_module, files_module)
OTHER = "between the stages"


def write_job(folder: Path, count: int, by: str) -> Inputs:
    """The sample's program and log, made so long."""
    samples = shipped("samples")
    cell = read_cell(samples / "cell.yaml")
    stiffness = folder / "stiffness.json"
    fit = fit_stiffness(cell, read_measurements(samples / "measurements.csv", cell.robot))
    stiffness.write_text(json.dumps(fit.model.as_dict()))
    base = folder / "cell.yaml"
    base.write_text((samples / "cell.yaml").read_text().replace("frame: tool ", "frame: base "))
    lines = (samples / "insert.mod").read_bytes().split(b"\r\n")
    moves = [line for line in lines if line.lstrip().startswith(b"Move")]
    start, end = lines.index(moves[0]), max(i for i, line in enumerate(lines) if line == moves[-1])
    # The sample's first targets are its air moves: they stay in front, once.
    air, cut = moves[:3], moves[3:]
    program = folder / "long.mod"
    program.write_bytes(b"\r\n".join([*lines[:start], *(air + cut * (count // len(cut) + 1))[:count], *lines[end + 1:]]))
    rng = np.random.default_rng(count)
    along = np.linspace(0, 40 * np.pi, count)
    force = np.column_stack([60 * np.sin(along), 80 + 30 * np.cos(along), -40 + 10 * np.sin(3 * along)])
    force[:3] = 0
    position = read_rapid(program.read_bytes(), str(program)).toolpath.position * 1e3
    log = folder / "long.forces.csv"
    with log.open("w") as stream:
        stream.write(f"{'target' if by == 'target' else 'x_mm,y_mm,z_mm'},fx_n,fy_n,fz_n\n")
        for first in range(0, count, 10_000):
            rows = slice(first, min(first + 10_000, count))
            samples_n = np.repeat(force[rows], 4, axis=0) + rng.standard_normal((4 * (rows.stop - first), 3))
            place = np.arange(first, rows.stop)[:, None] if by == "target" else position[rows]
            form = "%d" if by == "target" else "%.3f,%.3f,%.3f"
            np.savetxt(stream, np.column_stack([np.repeat(place, 4, axis=0), samples_n]), delimiter=",",
                       fmt=f"{form},%.3f,%.3f,%.3f".split(","))
    return Inputs(base, program, stiffness, log)


def peak_mb() -> float:
    """Highest resident memory since `forget_peak`."""
    status = Path("/proc/self/status").read_text()
    return float(status.split("VmHWM:")[1].split()[0]) / 1024


def forget_peak() -> None:
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")


class Clock:
    """Own CPU time and peak memory of named stages, which may call each other."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = defaultdict(float)
        self.peak: dict[str, float] = defaultdict(float)
        self._open: list[list[Any]] = []

    @contextlib.contextmanager
    def stage(self, name: str) -> Iterator[None]:
        if self._open:
            self._note()
        self._open.append([name, time.process_time()])
        forget_peak()
        yield
        self._note()
        self._open.pop()
        if self._open:
            self._open[-1][1] = time.process_time()

    def _note(self) -> None:
        name, since = self._open[-1]
        self.seconds[name] += time.process_time() - since
        self.peak[name] = max(self.peak[name], peak_mb())

    def wrap(self, name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(function)
        def timed(*positional: Any, **named: Any) -> Any:
            with self.stage(name):
                return function(*positional, **named)

        return timed


def job(folder: Path, inputs: Inputs) -> None:
    """What the command does, but for its messages."""
    corrected = files_module.correct(files_module.predict_files(inputs))
    output = folder / "out.mod"
    files_module.write_whole({
        output: corrected.content, folder / "offsets.csv": files_module.offset_blocks(corrected),
        folder / "out.mod.json": json.dumps(files_module.record(corrected, {output: corrected.content})).encode()})


def measure(count: int, by: str, profiled: bool) -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        maker = multiprocessing.Process(target=_make, args=(folder, count, by))
        maker.start()
        maker.join()
        assert maker.exitcode == 0
        inputs = Inputs(*(folder / file for file in ("cell.yaml", "long.mod", "stiffness.json", "long.forces.csv")))
        if profiled:
            profile = cProfile.Profile()
            profile.runcall(job, folder, inputs)
            pstats.Stats(profile).sort_stats("tottime").print_stats(35)
            return
        clock = Clock()
        for function, stage in STAGES.items():
            for module in MODULES:
                if hasattr(module, function):
                    setattr(module, function, clock.wrap(stage, getattr(module, function)))
        started = time.perf_counter()
        with clock.stage(OTHER):
            job(folder, inputs)
        total = sum(clock.seconds.values())
        size = [inputs.toolpath.stat().st_size / 1e6, inputs.forces.stat().st_size / 1e6]
        elapsed, highest = time.perf_counter() - started, max(clock.peak.values())
        print(f"\n{count} targets ({size[0]:.0f} MB), log of {4 * count} rows by {by} ({size[1]:.0f} MB): {total:.2f} s of CPU "
              f"({elapsed:.2f} s on the clock), {1e6 * total / count:.0f} us a target, peak {highest:.0f} MB")
        print("| stage | s | share | us a target | peak [MB] |\n|---|---|---|---|---|")
        for stage in dict.fromkeys([*STAGES.values(), OTHER]):
            if stage in clock.seconds:
                own = clock.seconds[stage]
                print(f"| {stage} | {own:.2f} | {100 * own / total:.0f} % | {1e6 * own / count:.1f} | "
                      f"{clock.peak[stage]:.0f} |")


def _make(folder: Path, count: int, by: str) -> None:
    write_job(folder, count, by)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("targets", type=int, nargs="*")
    parser.add_argument("--by", choices=["target", "position"], default="target")
    parser.add_argument("--profile", action="store_true")
    options = parser.parse_args()
    for count in options.targets or [10_000, 100_000]:
        process = multiprocessing.Process(target=measure, args=(count, options.by, options.profile))
        process.start()
        process.join()
        if process.exitcode:
            sys.exit(process.exitcode)


if __name__ == "__main__":
    main()

"""Accuracy of the sample's correction, and time and memory for long programs.

    python benchmarks/end_to_end.py [TARGETS ...]

Accuracy: distance between loaded tool and plan before and after, with the model that made the correction (which cannot fail),
with robots drawn from the stated posterior, with the sample's true stiffnesses, and with all stiffnesses wrong by 30 %.
Scale: the sample's moves repeated to so many targets, a log with four samples a target, through the command line.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from compensator.correction.correct import Corrected, correct
from compensator.correction.files import Inputs, predict_files
from compensator.correction.settings import Estimate, Settings
from identification.common.shipped import shipped
from identification.fit.fit import fit_stiffness
from identification.measurements import read_measurements
from identification.model.cell import read_cell
from identification.model.compliance import loaded_pose
from samples.make_samples import TRUE_STIFFNESS

DRAWS = 200


def sample(folder: Path) -> Corrected:
    """The shipped job."""
    samples = shipped("samples")
    cell = read_cell(samples / "cell.yaml")
    fit = fit_stiffness(cell, read_measurements(samples / "measurements.csv", cell.robot))
    stiffness = folder / "stiffness.json"
    stiffness.write_text(json.dumps(fit.model.as_dict()))
    inputs = Inputs(samples / "cell.yaml", samples / "insert.mod", stiffness, samples / "insert.forces.parquet")
    # The robots here mill with the force that was logged.
    return correct(predict_files(inputs, Settings.of(tare=((0, 2),), cutting_stiffness=Estimate(0.0, 0.0))))


def accuracy(job: Corrected) -> None:
    """Prints the accuracy table."""
    predicted, targets = job.predicted, job.correction.targets
    model, plan, tool = predicted.model, predicted.path, predicted.cell.flange_from_tcp
    wrench, goal = predicted.forces.wrench[targets], plan.base_from_tcp.position[targets]

    def off(theta: np.ndarray, compliance: np.ndarray) -> np.ndarray:
        return np.linalg.norm(loaded_pose(model.robot, theta, tool, wrench, compliance).position - goal, axis=1)

    def line(name: str, before: np.ndarray, after: np.ndarray) -> None:
        print(f"{name:<44}{1e6 * before.max():>9.1f}{1e6 * np.sqrt(np.mean(before**2)):>9.1f}"
              f"{1e6 * after.max():>11.3f}{1e6 * np.sqrt(np.mean(after**2)):>11.3f}"
              f"{100 * (1 - np.sqrt(np.mean(after**2) / np.mean(before**2))):>9.2f} %")

    print(f"{len(targets)} targets with force of {len(plan.toolpath)}\n{'distance from plan [um]':<44}{'before':>9}{'':>9}"
          f"{'after':>11}\n{'':<44}{'max':>9}{'RMS':>9}{'max':>11}{'RMS':>11}{'gone':>11}")
    planned = plan.theta[targets]
    line("same model, numbers as written", off(planned, model.compliance), job.residual)
    truth = 1 / TRUE_STIFFNESS
    line("the sample's true stiffnesses", off(planned, truth), off(job.correction.theta, truth))
    for factor in (0.7, 1.3):
        other = factor * model.compliance
        line(f"compliances {factor:g} times the identified", off(planned, other), off(job.correction.theta, other))
    covariance = model.deviation_covariance(planned, wrench, tool)
    stated = np.sqrt(np.trace(covariance[:, :3, :3], axis1=1, axis2=2))
    rng = np.random.default_rng(1)
    left, worse, before_all = [], 0, []
    for _ in range(DRAWS):
        drawn = np.exp(rng.multivariate_normal(model.mean, model.covariance))
        before, after = off(planned, drawn), off(job.correction.theta, drawn)
        worse += int(np.sum(after > before + 2 * stated))
        left.append(after)
        before_all.append(before)
    line(f"{DRAWS} robots drawn from the posterior", np.array(before_all), np.array(left))
    print(f"RMS after correction over the drawn robots {1e6 * np.sqrt(np.mean(np.square(left))):.3f} um; stated by the "
          f"covariance {1e6 * np.sqrt(np.mean(stated**2)):.3f} um")
    print(f"targets made worse by more than 2 sigma: {worse} of {DRAWS * len(targets)}")


def scale(job: Corrected, folder: Path, count: int) -> None:
    """Prints time and peak memory of `correct` for `count` targets."""
    predicted = job.predicted
    lines = predicted.program.text.source.data.split(b"\r\n")
    moves = [line for line in lines if b"Move" in line and line.lstrip().startswith(b"Move")]
    start = next(i for i, line in enumerate(lines) if line in moves[:1])
    end = max(i for i, line in enumerate(lines) if line == moves[-1])
    repeated = (moves * (count // len(moves) + 1))[:count]
    program = folder / f"long{count}.mod"
    program.write_bytes(b"\r\n".join([*lines[:start], *repeated, *lines[end + 1:]]))
    wrench = (np.tile(predicted.forces.wrench, (count // len(moves) + 1, 1)))[:count]
    log = folder / f"long{count}.forces.csv"
    with log.open("w") as stream:
        stream.write("target,fx_n,fy_n,fz_n\n")
        for target, (fx, fy, fz) in enumerate(wrench[:, :3]):
            stream.write(f"{target},{fx:.3f},{fy:.3f},{fz:.3f}\n" * 4)
    cell = folder / "cell.yaml"
    cell.write_text(predicted.cell.source.read_text().replace("frame: tool ", "frame: base "))
    before = time.perf_counter()
    process = subprocess.Popen(
        [sys.executable, "-m", "compstiff", "correct", cell, program, "--stiffness", predicted.model.source, "--forces", log,
         "-o", folder / f"out{count}.mod", "--offsets", folder / f"offsets{count}.csv", "-q"], stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    seconds = time.perf_counter() - before
    assert status == 0, status
    print(f"{count:>9} targets ({program.stat().st_size / 1e6:.0f} MB): {seconds:.1f} s, "
          f"{1e6 * seconds / count:.0f} us a target, peak memory {usage.ru_maxrss / 1024:.0f} MB")


def main() -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        job = sample(folder)
        accuracy(job)
        for count in [int(argument) for argument in sys.argv[1:]] or [10_000, 100_000]:
            scale(job, folder, count)


if __name__ == "__main__":
    main()

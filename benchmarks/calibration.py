"""Is the stated uncertainty true? Coverage and simulation-based calibration of the posterior, beside two baselines.

    OMP_NUM_THREADS=1 python benchmarks/calibration.py [DATA_SETS] [FIRST_SEED]

Each data set: true stiffnesses drawn from the prior, poses drawn at random, noise drawn, identified as a user would. Coverage
counts how often the 50, 80 and 95 % intervals of a stiffness hold the truth, and the 95 % ellipsoid of all six; the ranks of
the truth in its posterior must be uniform (largest distance of their distribution function from the diagonal, and the 95 %
band for so many data sets), also for the deflection predicted at a task pose.

Designs: `loads5` 5 poses with one load each; `poses20` 20 poses, one load each; `ladder12` 12 poses, load cycle 0 +100 +200
+300 0 -150 -300 N along one axis each. Noise: `white` 2 um and nothing else, as the cell file states; otherwise sensor 2 um
Student with 4 degrees of freedom, 1 % force error, 5 um re-seating a pose, which the cell file states (`stated`) or of which it
states the sensor's 2 um alone (`unstated`). Baselines: unweighted least squares in k, and the paper's MAP in k (Gaussian prior,
its symmetric interval).
"""

from __future__ import annotations

import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import chi2, norm

sys.path.insert(0, str(Path(__file__).parents[1]))

from identification.cell import Cell, read_cell
from identification.fit import fit_stiffness
from identification.measurements import Measurements
from identification.model.compliance import equilibrium
from tests.support import random_poses

LEVELS = (0.5, 0.8, 0.95)
CYCLE = (0.0, 100.0, 200.0, 300.0, 0.0, -150.0, -300.0)
DESIGNS = {"loads5": (5, (300.0,)), "poses20": (20, (300.0,)), "ladder12": (12, CYCLE)}
PRIOR_RELATIVE_STD = 1.0


STATED = {
    "white": "force_relative_std: 0, pose_offset_std_um: [0, 0, 0]",
    "stated": "force_relative_std: 0.01, pose_offset_std_um: [5, 5, 5]",
    "unstated": "",
}


def write_cells(folder: Path) -> None:
    """One cell file a noise, by its name."""
    for noise, stated in STATED.items():
        more = f", {stated}" if stated else ""
        (folder / f"{noise}.yaml").write_text(
            "robot: irb6660-205-1.90\ntool: {position_mm: [120, 0, 250]}\n"
            f"measurement: {{deflection_std_um: [2, 2, 2]{more}}}\n"
            "prior: {stiffness_nm_per_rad: [2.03e6, 6.02e6, 1.91e6, 0.45e6, 0.22e6, 0.07e6], "
            f"relative_std: {PRIOR_RELATIVE_STD}}}\n")


def simulate(cell: Cell, design: str, noise: str, truth: np.ndarray, rng: np.random.Generator) -> Measurements:
    """One data set with these true stiffnesses."""
    poses, loads = DESIGNS[design]
    theta = np.repeat(random_poses(cell.robot, poses, rng, share=0.6), len(loads), axis=0)
    count = len(theta)
    visit = np.repeat(np.arange(poses), len(loads))
    wrench = np.zeros((count, 6))
    axis = rng.permutation(np.arange(poses) % 3)[visit]
    wrench[np.arange(count), axis] = np.tile(loads, poses) * (rng.choice([-1, 1], poses)[visit] if len(loads) == 1 else 1)
    applied, offset = wrench.copy(), np.zeros((poses, 3))
    reading = 2e-6 * rng.standard_normal((count, 3))
    if noise != "white":
        applied[:, :3] *= 1 + 0.01 * rng.standard_normal((count, 1))
        offset = 5e-6 * rng.standard_normal((poses, 3))
        reading = 2e-6 * rng.standard_t(4, (count, 3)) / np.sqrt(2)
    deflection = equilibrium(cell.robot, theta, cell.flange_from_tcp, applied, 1 / truth).position + reading + offset[visit]
    nothing = np.full(count, np.nan)
    return Measurements(
        source="simulated", theta=theta, wrench=wrench, deflection=deflection, sigma=np.full((count, 3), np.nan), time=nothing,
        dwell=nothing, visit=visit, reference=np.zeros(count, dtype=np.intp), validate=np.zeros(count, dtype=bool),
        machined_pass=np.full(count, "", dtype=object),
        pose=np.full(count, "", dtype=object), row=np.arange(1, count + 1), line=np.arange(count) + 2, findings=())


@dataclass(frozen=True)
class Case:
    """One data set's answer: z (6,) standardised error of ln k, distance (squared Mahalanobis), rank of the task deflection,
    for both baselines whether the 95 % interval of each k holds the truth (2, 6), and whether a subset conflict was raised."""

    z: np.ndarray
    distance: float
    task_rank: float
    baselines: np.ndarray
    conflict: bool


def one(arguments: tuple[str, str, int, str]) -> Case:
    design, noise, seed, folder = arguments
    cell = read_cell(Path(folder) / f"{noise}.yaml")
    rng = np.random.default_rng(seed)
    truth = cell.prior.stiffness * np.exp(cell.prior.log_std * rng.standard_normal(6))
    rows = simulate(cell, design, noise, truth, rng)
    fit = fit_stiffness(cell, rows)
    model = fit.model
    off = model.mean + np.log(truth)
    theta = np.radians([[5.0, 10, 30, 20, 55, 10]])
    wrench = np.array([[80.0, 200, -120, 0, 0, 0]])

    def task(c: np.ndarray) -> float:
        return float(np.linalg.norm(equilibrium(cell.robot, theta, cell.flange_from_tcp, wrench, c).position))

    draws = np.exp(rng.multivariate_normal(model.mean, model.covariance, 100))
    rank = float(np.mean([task(c) < task(1 / truth) for c in draws]))
    paper = fit_stiffness(cell, rows, prior_kind="gaussian").model
    half = 1.96 * np.sqrt(np.diag(paper.covariance)) * paper.stiffness
    baselines = np.array([least_squares_in_k(cell, rows, truth), np.abs(paper.stiffness - truth) <= half])
    return Case(off / model.log_std, float(off @ np.linalg.solve(model.covariance, off)), rank, baselines,
                any(conflict.is_conflict for conflict in fit.conflicts))


def least_squares_in_k(cell: Cell, rows: Measurements, truth: np.ndarray) -> np.ndarray:
    """Unweighted least squares in k from the table's values, symmetric 95 % interval from the residual's variance."""
    def residual(share: np.ndarray) -> np.ndarray:
        k = share * cell.prior.stiffness
        return 1e6 * (rows.deflection - equilibrium(cell.robot, rows.theta, cell.flange_from_tcp, rows.wrench, 1 / k,
                                                    rounds=1).position).ravel()

    found = least_squares(residual, np.ones(6), bounds=(1e-3, 1e4))
    variance = 2 * found.cost / max(len(found.fun) - 6, 1)
    covariance = variance * np.linalg.pinv(found.jac.T @ found.jac)
    return np.abs(found.x * cell.prior.stiffness - truth) <= 1.96 * np.sqrt(np.diag(covariance)) * cell.prior.stiffness


def report(design: str, noise: str, cases: list[Case]) -> None:
    """One line; * marks a mean outside the 99 % binomial band of one joint, `out` counts single joints' figures outside it."""
    z = np.array([case.z for case in cases])
    count = len(cases)

    def mark(share: float, level: float, trials: int) -> str:
        return "*" if abs(share - level) > 2.58 * np.sqrt(level * (1 - level) / trials) + 0.5 / trials else " "

    covered = [np.mean(np.abs(z) <= norm.ppf(0.5 + level / 2), axis=0) for level in LEVELS]
    line = f"{design:<9}{noise:<10}"
    for level, shares in zip(LEVELS, covered, strict=True):
        line += f"{100 * shares.mean():>7.1f}{mark(float(shares.mean()), level, count)}"
        line += f"({100 * shares.min():.0f}-{100 * shares.max():.0f})"
    inside = float(np.mean([case.distance <= chi2.ppf(0.95, 6) for case in cases]))
    line += f"{100 * inside:>8.1f}{mark(inside, 0.95, count)}"
    outside = sum(mark(float(share), level, count) == "*" for level, shares in zip(LEVELS, covered, strict=True)
                  for share in shares)
    line += f"{outside:>4d}/18"
    band = 1.36 / np.sqrt(count)
    ranks = np.sort(norm.cdf(z), axis=0)
    grid = (np.arange(count) + 0.5) / count
    worst = float(np.max(np.abs(ranks - grid[:, None])))
    task = np.sort([case.task_rank for case in cases])
    line += f"{worst:>9.3f}{float(np.max(np.abs(task - grid))):>8.3f}{band:>8.3f}"
    baselines = np.mean([case.baselines for case in cases], axis=(0, 2))
    line += f"{100 * baselines[0]:>10.1f}{100 * baselines[1]:>9.1f}{100 * np.mean([case.conflict for case in cases]):>10.1f}"
    print(line, flush=True)


def main() -> None:
    count, first = [*(int(argument) for argument in sys.argv[1:]), *(400, 0)[len(sys.argv) - 1:]]
    print(f"{count} data sets a line, seeds from {first}; * outside the 99 % binomial band; in brackets the lowest and highest "
          "joint\n"
          f"{'design':<9}{'noise':<10}{'50 %':>7}{'':8}{'80 %':>7}{'':8}{'95 %':>7}{'':8}{'ellipsoid':>8}"
          f"{'out':>7}{'rank k':>8}"
          f"{'task':>8}{'band':>8}{'least sq.':>10}{'paper':>9}"
          f"{'conflicts':>10}")
    with tempfile.TemporaryDirectory() as folder, ProcessPoolExecutor(2) as pool:
        write_cells(Path(folder))
        for design in DESIGNS:
            for noise in STATED:
                jobs = [(design, noise, seed, folder) for seed in range(first, first + count)]
                report(design, noise, list(pool.map(one, jobs, chunksize=10)))


if __name__ == "__main__":
    main()

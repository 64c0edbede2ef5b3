"""Is the stated uncertainty true? Coverage and simulation-based calibration of the posterior, beside two baselines.

    OMP_NUM_THREADS=1 python benchmarks/calibration.py [DATA_SETS] [FIRST_SEED] [--baselines]

Each data set: true stiffnesses drawn from the prior, poses drawn at random, noise drawn, identified as a user would. Coverage
counts how often the 50, 80 and 95 % intervals of a stiffness hold the truth, and the ellipsoids of all six; the ranks of the
truth in its posterior must be uniform (largest distance of their distribution function from the diagonal), also for the
deflection predicted at a task pose. `predict`: how often mean +- 1.96 std of a component of that deflection holds it, as
`predict` and `correct` state it from stiffness.json.

Designs: `loads5` 5 poses with one load each; `poses20` 20 poses, one load each; `ladder12` 12 poses, load cycle 0 +100 +200
+300 0 -150 -300 N along one axis each.

Noise at fixed sizes: `white` 2 um and nothing else, as the cell file states; otherwise sensor 2 um Student with 4 degrees of
freedom (each component on its own), 1 % force error, 5 um re-seating a pose, which the cell file states (`stated`) or of which
it states the sensor's 2 um alone (`unstated`); nothing hangs on the arm, which the robot file does not say, so that intervals
are to be wider than need be there. Proper simulation-based calibration: sizes and degrees of freedom, and what the arm's own
weight does, are drawn from their own priors too, about what the cell file states (`drawn`), or states of the sensor alone
(`drawn bare`); a miss there is a defect of the computation. Baselines: unweighted least squares in k, and the paper's MAP in k
(Gaussian prior, its symmetric interval). --scheduler: on a cluster (pool.py).
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.pool import pool, pool_options
from identification.common.findings import CompstiffError
from identification.fit.fit import fit_stiffness
from identification.measurements import Measurements
from identification.model.cell import Cell, read_cell
from identification.model.compliance import compliance_matrix, equilibrium, joint_torque, loaded_angles
from identification.model.kinematics import forward
from tests.support import random_poses

LEVELS = (0.5, 0.8, 0.95)
CYCLE = (0.0, 100.0, 200.0, 300.0, 0.0, -150.0, -300.0)
DESIGNS = {"loads5": (5, (300.0,)), "poses20": (20, (300.0,)), "ladder12": (12, CYCLE)}
PRIOR_RELATIVE_STD = 1.0
ALL_STATED = "force_relative_std: 0.01, pose_offset_std_um: [5, 5, 5]"
STATED = {"white": "force_relative_std: 0, pose_offset_std_um: [0, 0, 0]", "stated": ALL_STATED, "unstated": "",
          "drawn": ALL_STATED, "drawn bare": ""}
TASK_POSE = np.radians([[5.0, 10, 30, 20, 55, 10]])
TASK_WRENCH = np.array([[80.0, 200, -120, 0, 0, 0]])
TASK_DRAWS = 100
# As sag.py has it: torques of the arm's own weight at joints 2 and 3 and of what its flange carries, 1 sigma.
WEIGHT_NM, FLANGE_NM = 4000.0, 250.0


@dataclass(frozen=True)
class Weight:
    """Torques [N m]: constant at joints 2 and 3 (2,), at joint 2 with the sine and cosine of its angle (2,), and what those two
    change as a spring (2,). First moments [N m] of forearm and flange, in their frames (3,)."""

    constant: np.ndarray
    wave: np.ndarray
    spring: np.ndarray
    forearm: np.ndarray
    flange: np.ndarray

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> Weight:
        constant, wave, spring, forearm = WEIGHT_NM * rng.standard_normal((4, 2))
        return cls(constant, wave, spring, np.append(forearm, 0.0), FLANGE_NM * rng.standard_normal(3))

    def torque(self, cell: Cell, theta: np.ndarray, commanded: np.ndarray) -> np.ndarray:
        """Torques at the springs (n, 6) at controller angles (n, 6): how the moments' heights fall as the springs turn."""
        robot = cell.robot

        def height(turns: np.ndarray) -> np.ndarray:
            """Potential energy (n,) [J] at the springs' further turns (6,)."""
            serial = robot.serial_angles(theta + robot.uncoupling @ robot.load_matrix @ turns)
            turned = Rotation.identity(len(theta))
            energy = np.zeros(len(theta))
            for joint in range(6):
                turned = turned * Rotation.from_rotvec([robot.alpha[joint], 0, 0]) * Rotation.from_rotvec(
                    serial[:, joint, None] * [0, 0, 1])
                moment = {2: self.forearm, 5: self.flange}.get(joint)
                energy += 0.0 if moment is None else turned.apply(moment)[:, 2]
            return energy

        step = 1e-4
        torque = np.stack([(height(-step * axis) - height(step * axis)) / (2 * step) for axis in np.eye(6)], axis=1)
        torque[:, 1:3] += self.constant
        torque[:, 1] += np.stack([np.sin(commanded[:, 1]), np.cos(commanded[:, 1])], axis=1) @ self.wave
        return torque


@dataclass(frozen=True)
class Sizes:
    """True noise: sensor [m] and force error (relative), Student with `degrees` for a component or, `by_row`, for a whole row,
    as the method takes it; re-seating [m]. weight: what the arm's own weight does."""

    sensor: float = 2e-6
    force: float = 0.0
    offset: float = 0.0
    degrees: float = np.inf
    by_row: bool = False
    weight: Weight | None = None


def write_cells(folder: Path) -> None:
    """One cell file a noise, by its name."""
    for noise, stated in STATED.items():
        more = f", {stated}" if stated else ""
        (folder / f"{noise}.yaml").write_text(
            "robot: irb6660-205-1.90\ntool: {position_mm: [120, 0, 250]}\n"
            f"measurement: {{deflection_std_um: [2, 2, 2]{more}}}\n"
            "prior: {stiffness_nm_per_rad: [2.03e6, 6.02e6, 1.91e6, 0.45e6, 0.22e6, 0.07e6], "
            f"relative_std: {PRIOR_RELATIVE_STD}}}\n")


def draw_sizes(noise: str, rng: np.random.Generator) -> Sizes:
    """The true noise. Drawn: as variance_prior.py and noise.py take it beforehand, written out again here."""
    if noise == "white":
        return Sizes()
    if not noise.startswith("drawn"):
        return Sizes(2e-6, 0.01, 5e-6, 4.0)

    def about_stated() -> float:
        # The normal side below 1 has sqrt(pi / 2) of the mass, the Student side above it 4 / 3.
        below = rng.random() < np.sqrt(np.pi / 2) / (np.sqrt(np.pi / 2) + 4 / 3)
        return float(np.exp(0.3 * (-abs(rng.standard_normal()) if below else abs(rng.standard_t(4)))))

    tried = np.array([3.0, 4, 6, 10, 20, 50, 100])
    degrees = float(rng.choice(tried, p=tried / tried.sum()))
    degrees = np.inf if degrees == 100 else degrees
    sensor, weight = 2e-6 * about_stated(), Weight.drawn(rng)
    if noise == "drawn":
        return Sizes(sensor, 0.01 * about_stated(), 5e-6 * about_stated(), degrees, True, weight)
    return Sizes(sensor, 0.01 * rng.standard_exponential(), 6e-6 * rng.standard_exponential(), degrees, True, weight)


def deflected(
    cell: Cell, theta: np.ndarray, wrench: np.ndarray, compliance: np.ndarray, weight: Weight | None,
) -> np.ndarray:
    """Deflection (n, 3) [m] of an arm that hangs by this weight before it is loaded, and under the load."""
    if weight is None:
        return equilibrium(cell.robot, theta, cell.flange_from_tcp, wrench, compliance).position
    soft = np.tile(compliance, (len(theta), 1))
    soft[:, 1] *= 1.0 + compliance[1] * (np.sin(theta[:, 1]) * weight.spring[0] + np.cos(theta[:, 1]) * weight.spring[1])

    def tcp(load: np.ndarray) -> np.ndarray:
        stood = theta
        for _ in range(8):
            turns = compliance * weight.torque(cell, stood, theta) + soft * joint_torque(
                cell.robot, stood, cell.flange_from_tcp, load)
            stood = loaded_angles(cell.robot, theta, turns)
        return forward(cell.robot, stood, cell.flange_from_tcp).position

    return tcp(wrench) - tcp(np.zeros_like(wrench))


def simulate(cell: Cell, design: str, size: Sizes, truth: np.ndarray, rng: np.random.Generator) -> Measurements:
    """One data set with these true stiffnesses."""
    poses, loads = DESIGNS[design]
    theta = np.repeat(random_poses(cell.robot, poses, rng, share=0.6), len(loads), axis=0)
    count = len(theta)
    visit = np.repeat(np.arange(poses), len(loads))
    wrench = np.zeros((count, 6))
    axis = rng.permutation(np.arange(poses) % 3)[visit]
    wrench[np.arange(count), axis] = np.tile(loads, poses) * (rng.choice([-1, 1], poses)[visit] if len(loads) == 1 else 1)
    sensor, force = rng.standard_normal((count, 3)), rng.standard_normal((count, 1))
    if np.isfinite(size.degrees):
        stretch = np.sqrt(size.degrees / rng.chisquare(size.degrees, (count, 1 if size.by_row else 3)))
        # By component the sensor's standard deviation is meant, by row the method's scale.
        sensor *= stretch if size.by_row else stretch * np.sqrt((size.degrees - 2) / size.degrees)
        force *= stretch if size.by_row else 1.0
    error = wrench * size.force * force
    carried = compliance_matrix(cell.robot, theta, cell.flange_from_tcp, 1 / truth)[:, :3]
    deflection = (deflected(cell, theta, wrench, 1 / truth, size.weight) + size.sensor * sensor
                  + np.einsum("nij,nj->ni", carried, error) + size.offset * rng.standard_normal((poses, 3))[visit])
    nothing = np.full(count, np.nan)
    return Measurements(
        source="simulated", theta=theta, wrench=wrench, deflection=deflection, sigma=np.full((count, 3), np.nan), time=nothing,
        dwell=nothing, visit=visit, reference=np.zeros(count, dtype=np.intp), validate=np.zeros(count, dtype=bool),
        machined_pass=np.full(count, "", dtype=object),
        pose=np.full(count, "", dtype=object), row=np.arange(1, count + 1), line=np.arange(count) + 2, findings=())


@dataclass(frozen=True)
class Case:
    """One data set's answer: rank (6,) of the truth in its posterior, of its squared Mahalanobis distance and of the task's
    deflection; whether the stated interval of each component of that deflection holds it (3,); for both baselines whether the
    95 % interval of each k holds the truth (2, 6); whether a subset conflict was raised."""

    rank: np.ndarray
    distance_rank: float
    task_rank: float
    predicted: np.ndarray
    baselines: np.ndarray
    conflict: bool


def one(arguments: tuple[str, str, int, str, bool]) -> Case | None:
    """None where the fit is refused."""
    design, noise, seed, folder, with_baselines = arguments
    cell = read_cell(Path(folder) / f"{noise}.yaml")
    rng = np.random.default_rng([seed, list(DESIGNS).index(design), list(STATED).index(noise)])
    truth = cell.prior.stiffness * np.exp(cell.prior.log_std * rng.standard_normal(6))
    size = draw_sizes(noise, rng)
    rows = simulate(cell, design, size, truth, rng)
    try:
        fit = fit_stiffness(cell, rows)
    except CompstiffError as refused:
        print(f"seed {seed}: {refused}", file=sys.stderr)
        return None
    model, draws = fit.model, fit.posterior.draws
    x = -np.log(truth)

    def distance(x: np.ndarray) -> np.ndarray:
        return np.einsum("...i,ij,...j->...", x - model.mean, np.linalg.inv(model.covariance), x - model.mean)

    picked = rng.choice(len(draws.x), TASK_DRAWS, p=draws.weight)
    task = np.linalg.norm(deflections(cell, np.exp(draws.x[picked])), axis=1)
    true_task = deflections(cell, 1 / truth[None])[0]
    predicted, _, covariance = model.predict(TASK_POSE, TASK_WRENCH)
    half = 1.96 * np.sqrt(np.diag(covariance[0])[:3])
    hung = deflected(cell, TASK_POSE, TASK_WRENCH, 1 / truth, size.weight)[0]
    baselines = np.zeros((2, 6))
    if with_baselines:
        paper = fit_stiffness(cell, rows, prior_kind="gaussian").model
        about = 1.96 * np.sqrt(np.diag(paper.covariance)) * paper.stiffness
        baselines = np.array([least_squares_in_k(cell, rows, truth), np.abs(paper.stiffness - truth) <= about])
    return Case((draws.x < x).T @ draws.weight, float((distance(draws.x) < distance(x)) @ draws.weight),
                float(np.mean(task < np.linalg.norm(true_task))), np.abs(predicted[0] - hung) <= half, baselines,
                any(conflict.is_conflict for conflict in fit.conflicts))


def deflections(cell: Cell, compliance: np.ndarray) -> np.ndarray:
    """Deflection (D, 3) [m] at the task pose for each set of compliances (D, 6)."""
    return np.concatenate([equilibrium(cell.robot, TASK_POSE, cell.flange_from_tcp, TASK_WRENCH, c).position
                           for c in compliance])


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


def report(design: str, noise: str, tried: list[Case | None]) -> None:
    """One line; * marks a figure outside its 99 % binomial band (of a mean: the band of one joint), `out` counts the figures of
    single joints outside theirs; of data sets that were refused there is no figure."""
    cases = [case for case in tried if case is not None]
    count = len(cases)

    def mark(share: float, level: float) -> str:
        return "*" if abs(share - level) > 2.58 * np.sqrt(level * (1 - level) / count) + 0.5 / count else " "

    rank = np.array([case.rank for case in cases])
    covered = [np.mean(np.abs(rank - 0.5) <= 0.5 * level, axis=0) for level in LEVELS]
    line = f"{design:<9}{noise:<11}"
    for level, shares in zip(LEVELS, covered, strict=True):
        line += f"{100 * shares.mean():>6.1f}{mark(float(shares.mean()), level)}"
        line += f"({100 * shares.min():3.0f}-{100 * shares.max():3.0f})"
    distance = np.array([case.distance_rank for case in cases])
    for level in LEVELS:
        inside = float(np.mean(distance <= level))
        line += f"{100 * inside:>6.1f}{mark(inside, level)}"
    line += f"{sum(mark(float(s), level) == '*' for level, shares in zip(LEVELS, covered, strict=True) for s in shares):>3d}/18"
    grid = (np.arange(count) + 0.5) / count

    def off(ranks: np.ndarray) -> float:
        return float(np.max(np.abs(np.sort(ranks) - grid)))

    task = np.array([case.task_rank for case in cases])
    line += f"{max(off(column) for column in rank.T):>8.3f}{off(distance):>7.3f}{off(task):>7.3f}"
    predicted = float(np.mean([case.predicted for case in cases]))
    line += f"{100 * predicted:>8.1f}{mark(predicted, 0.95)}"
    baselines = np.mean([case.baselines for case in cases], axis=(0, 2))
    line += f"{100 * baselines[0]:>8.1f}{100 * baselines[1]:>7.1f}{100 * np.mean([case.conflict for case in cases]):>7.1f}"
    line += f"{len(tried) - count:>9d}"
    print(line, flush=True)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("count", nargs="?", type=int, default=200)
    parser.add_argument("first", nargs="?", type=int, default=500_000)
    parser.add_argument("--baselines", action="store_true")
    pool_options(parser)
    parser.add_argument("--designs", nargs="+", choices=DESIGNS, default=list(DESIGNS))
    parser.add_argument("--noises", nargs="+", choices=STATED, default=list(STATED))
    wanted = parser.parse_args()
    count, first = wanted.count, wanted.first
    band = 1.63 / np.sqrt(count)
    print(f"{count} data sets a line, seeds from {first}; * outside the 99 % binomial band; in brackets the lowest and highest "
          f"joint; 99 % band of one rank distance {band:.3f}\n"
          f"{'design':<9}{'noise':<11}{'50 %':>6}{'':10}{'80 %':>6}{'':10}{'95 %':>6}{'':10}{'ellipsoid 50 80 95':>21}"
          f"{'out':>6}{'rank k':>8}{'ell.':>7}{'task':>7}{'predict':>9}{'l. sq.':>8}{'paper':>7}{'confl.':>7}{'refused':>9}")
    with tempfile.TemporaryDirectory() as folder, pool(wanted) as workers:
        write_cells(Path(folder))
        for design in wanted.designs:
            for noise in wanted.noises:
                jobs = [(design, noise, seed, folder, wanted.baselines) for seed in range(first, first + count)]
                report(design, noise, list(workers.map(one, jobs, chunksize=10)))


if __name__ == "__main__":
    main()

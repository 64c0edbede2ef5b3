"""The paper reproduced on simulated data; writes docs/paper.md.

    python benchmarks/paper.py

The physics below is written out once more, apart from the package: modified Denavit-Hartenberg chain (eq. 1, 2, 7), joint
torques and springs (eq. 3-5), deviation (eq. 6), MAP with the Gaussian prior in k (eq. 11, 12), its covariance (eq. 13, 14),
the A criterion (eq. 16, 17), and the physical effects that section 5 adds to the simulated readings. From the package come
the robot's limits, the inverse kinematics, and `fit_stiffness`, whose answers are tabulated beside.
"""

from __future__ import annotations

import os
import sys
import tempfile
import textwrap
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

# One thread: the same bytes however many cores are free, and faster on matrices this small.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import numpy as np
from scipy.optimize import minimize

sys.path.insert(0, str(Path(__file__).parents[1]))

from identification.fit.fit import fit_stiffness
from identification.measurements import Measurements
from identification.model.cell import Cell, read_cell
from identification.model.compliance import equilibrium
from identification.model.inverse import inverse
from identification.model.robot import BUILT_IN, read_robot
from identification.model.rotations import Frame

PAGE = Path(__file__).parents[1] / "docs" / "paper.md"
ROBOT = read_robot(BUILT_IN / "irb6660-205-1.90.yaml")

# Modified Denavit-Hartenberg of the IRB 6660-205/1.9; the paper prints none of it.
ALPHA = np.radians([0.0, -90, 0, -90, 90, -90])
A = np.array([0.0, 0.3, 0.7, 0.28, 0.0, 0.0])
D = np.array([0.8145, 0.0, 0.0, 0.893, 0.0, 0.2])
OFFSET = np.radians([0.0, -90, 0, 0, 0, 180])
ROD = np.eye(6)
ROD[2, 1] = -1.0                                       # eq. 7

TABLE_1 = 1e6 * np.array([2.03, 6.02, 1.91, 0.45, 0.22, 0.07])
TABLE_2 = {
    "all": 1e6 * np.array([0.96, 6.023, 1.569, 2.965, 0.271, 0.041]),
    "Y": 1e6 * np.array([0.312, 6.017, 0.596, 1.761, 0.313, 1.297]),
    "X": 1e6 * np.array([1.998, 6.038, 2.473, 0.418, 0.195, 0.07]),
}
FORCE_N = 300.0
SENSOR_M = 1e-6
PHI_MAX = np.radians(80)
# Standard deviations of the prior, sqrt(Gamma_0 / gamma): not printed. "equal" is Gamma_0 = 1 in Table 2's unit and gamma = 1.
PRIORS = {"equal": np.full(6, 1e6), "relative": TABLE_1}
SETS = ("X", "Y", "all")

# What the paper leaves open and is assumed here.
POSITION = np.array([1.4, 0.0, 0.8])
TOOL = np.array([0.3, 0.0, 0.25])
TRUTH = 1e6 * np.array([1.4, 4.5, 1.5, 0.35, 0.25, 0.09])
TRUTH_LOG_STD = 0.5


def frames(serial: np.ndarray, tool: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Joint axes and frame origins (..., 6, 3), TCP (..., 3), flange rotation (..., 3, 3) of theta~ (..., 6) (eq. 1)."""
    shape = serial.shape[:-1]
    x, y, z = (np.broadcast_to(column, (*shape, 3)) for column in np.eye(3))
    origin, axes, origins = np.zeros((*shape, 3)), np.empty((*shape, 6, 3)), np.empty((*shape, 6, 3))
    for i in range(6):
        origin = origin + A[i] * x
        y, z = np.cos(ALPHA[i]) * y + np.sin(ALPHA[i]) * z, np.cos(ALPHA[i]) * z - np.sin(ALPHA[i]) * y
        c, s = np.cos(serial[..., i, None]), np.sin(serial[..., i, None])
        x, y = c * x + s * y, c * y - s * x
        origin = origin + D[i] * z
        axes[..., i, :], origins[..., i, :] = z, origin
    rotation = np.stack([x, y, z], axis=-1)
    return axes, origins, origin + rotation @ tool, rotation


def serial_angles(theta: np.ndarray) -> np.ndarray:
    """theta~ of controller angles (eq. 7)."""
    return theta @ ROD.T + OFFSET


def lever(axes: np.ndarray, origins: np.ndarray, tcp: np.ndarray) -> np.ndarray:
    """Columns (..., 6, 3) of the position Jacobian."""
    return np.cross(axes, tcp[..., None, :] - origins)


def one_step(theta: np.ndarray, force: np.ndarray, c: np.ndarray, tool: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """eta(k, u) as published (eq. 2-6) and its derivative by c: (S, N, 3), (S, N, 6, 3) of theta and force (N, .), c (S, 6)."""
    serial = serial_angles(theta)
    axes, origins, tcp, _ = frames(serial, tool)
    torque = np.einsum("nic,nc->ni", lever(axes, origins, tcp), force)
    loaded = frames(serial + c[:, None] * torque, tool)
    return loaded[2] - tcp, lever(*loaded[:3]) * torque[..., None]


def signed_phi(theta: np.ndarray, tool: np.ndarray) -> np.ndarray:
    """phi [rad]: base x-y plane, from (TCP - base origin) to (TCP - joint-6 origin); 0 where the latter is vertical."""
    _, origins, tcp, _ = frames(serial_angles(theta), tool)
    out = tcp - origins[..., 5, :]
    angle = np.arctan2(out[..., 1], out[..., 0]) - np.arctan2(tcp[..., 1], tcp[..., 0])
    return np.where(np.hypot(out[..., 0], out[..., 1]) < 1e-3, 0.0, (angle + np.pi) % (2 * np.pi) - np.pi)


# --- design -----------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Design:
    """theta (5, 6) [rad], force (5, 3) [N], orientation (5,) number: rows Y, Y, Y, X, X; the first Y shares the first X's."""

    theta: np.ndarray
    force: np.ndarray
    orientation: np.ndarray
    tool: np.ndarray

    def rows(self, name: str) -> np.ndarray:
        """Row numbers of the set "X", "Y" or "all"."""
        return {"X": np.array([3, 4]), "Y": np.array([0, 1, 2]), "all": np.arange(5)}[name]


def orientations(
    position: np.ndarray, tool: np.ndarray, count: int, rng: np.random.Generator, in_plane: bool = False
) -> np.ndarray:
    """Joint angles (n, 6), one branch an orientation: reachable, inside limits and window, |phi| <= 80 deg.

    in_plane: arm, wrist and tool in the base x-z plane, so that a force along x gives joints 1, 4 and 6 no torque.
    """
    if in_plane:
        pitch = rng.uniform(-np.pi, np.pi, count)
        zero = np.zeros(count)
        quaternion = np.stack([np.cos(pitch / 2), zero, np.sin(pitch / 2), zero], axis=1)
        half = rng.random(count) < 0.5                  # and turned by 180 deg about the flange axis
        quaternion[half] = np.stack([zero, np.sin(pitch / 2), zero, np.cos(pitch / 2)], axis=1)[half]
    else:
        quaternion = rng.standard_normal((count, 4))
        quaternion /= np.linalg.norm(quaternion, axis=1, keepdims=True)
    w, x, y, z = quaternion.T
    rotation = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y), 2 * (x * y + w * z),
                         1 - 2 * (x * x + z * z), 2 * (y * z - w * x), 2 * (x * z - w * y), 2 * (y * z + w * x),
                         1 - 2 * (x * x + y * y)], axis=1).reshape(-1, 3, 3)
    solutions = inverse(ROBOT, Frame(rotation, position - rotation @ tool))
    good = solutions.reachable & (ROBOT.limit_excess(solutions.theta) == 0).all(axis=-1)
    good &= np.abs(signed_phi(solutions.theta, tool)) <= PHI_MAX
    if in_plane:
        # The shoulder straight ahead and the wrist not turned over sideways; at joint 5 = 0 the branch does not matter.
        good &= np.abs(np.sin(solutions.theta[..., [0, 3]])).max(axis=-1) < 1e-9
    found = np.flatnonzero(good.any(axis=1))
    return solutions.theta[found, good.argmax(axis=1)[found]]


def information(theta: np.ndarray, tool: np.ndarray, axis: int, k: np.ndarray, sigma: float = SENSOR_M) -> np.ndarray:
    """J^T Sigma^-1 J (n, 6, 6) of eq. 13 for one reading with 300 N along a base axis, first order, per (1e6 N m/rad)^2."""
    columns = lever(*frames(serial_angles(theta), tool)[:3])
    slope = -1e6 * columns * (FORCE_N * columns[..., axis])[..., None] / k[:, None] ** 2
    return np.einsum("nic,njc->nij", slope, slope) / sigma**2


def search(first: np.ndarray, second: np.ndarray, tool: np.ndarray, prior_std: np.ndarray, rng: np.random.Generator) -> Design:
    """Four orientations by exchange, smallest trace of eq. 17 at Table 1: X forces take theirs from `first`."""
    pools = [first, second, second, first]              # Y and X, Y, Y, X
    of_x, of_y = (information(first, tool, axis, TABLE_1) for axis in (0, 1))
    of_y_only = information(second, tool, 1, TABLE_1)
    pieces = [of_x + of_y, of_y_only, of_y_only, of_x]
    prior = np.diag((1e6 / prior_std) ** 2)
    best, chosen = np.inf, np.zeros(4, dtype=int)
    for _ in range(8):
        index = np.array([rng.integers(len(pool)) for pool in pools])
        value = np.inf
        while True:
            before = value
            for slot in range(4):
                others = [other for other in range(4) if other != slot]
                rest = prior + sum(pieces[other][index[other]] for other in others)
                trace = np.trace(np.linalg.inv(rest + pieces[slot]), axis1=1, axis2=2)
                trace[[index[other] for other in others if pools[other] is pools[slot]]] = np.inf
                index[slot] = int(np.argmin(trace))
                value = float(trace[index[slot]])
            if value >= before * (1 - 1e-9):
                break
        if value < best:
            best, chosen = value, index.copy()
    order = np.array([0, 1, 2, 0, 3])
    theta = np.array([pools[slot][chosen[slot]] for slot in order])
    force = np.zeros((5, 3))
    force[:3, 1], force[3:, 0] = FORCE_N, FORCE_N
    return Design(theta, force, order, tool)


def make_design(
    plane: bool, prior: str = "equal", position: np.ndarray = POSITION, tool: np.ndarray = TOOL, seed: int = 1
) -> Design:
    """plane: the orientations of the X forces lie in the arm's plane, as Table 2's X-only set requires; else all are free."""
    rng = np.random.default_rng(seed)
    free = orientations(position, tool, 1500, rng)
    first = orientations(position, tool, 1500, rng, in_plane=True) if plane else free
    return search(first, free, tool, PRIORS[prior], rng)


def covariance(design: Design, name: str, k: np.ndarray, prior_std: np.ndarray) -> np.ndarray:
    """C_post (6, 6) of eq. 13, (1e6 N m/rad)^2."""
    rows = design.rows(name)
    total = np.diag((1e6 / prior_std) ** 2)
    for axis in (0, 1):
        of_axis = rows[design.force[rows, axis] != 0]
        total = total + information(design.theta[of_axis], design.tool, axis, k).sum(axis=0)
    return np.linalg.inv(total)


# --- the paper's fit --------------------------------------------------------------------------------------------------------


def fit(
    theta: np.ndarray, force: np.ndarray, z: np.ndarray, tool: np.ndarray, prior_std: np.ndarray, *,
    start: np.ndarray = TABLE_1, sigma: float = SENSOR_M, steps: int = 150,
) -> tuple[np.ndarray, np.ndarray]:
    """MAP of eq. 12 with the published one-step model for S data sets z (S, N, 3) at once: k (S, 6) and cost (S,).

    Levenberg-Marquardt in ln k, which keeps k positive and changes nothing else.
    """
    count = len(z)
    x = np.broadcast_to(np.log(start), (count, 6)).copy()

    def state(x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        eta, slope = one_step(theta, force, np.exp(-x), tool)
        residual = (z - eta) / sigma
        share = (np.exp(x) - TABLE_1) / prior_std
        cost = 0.5 * np.sum(residual**2, axis=(1, 2)) + 0.5 * np.sum(share**2, axis=1)
        return cost, residual, -slope * np.exp(-x)[:, None, :, None] / sigma

    cost, residual, slope = state(x)
    damping = np.full(count, 1e-3)
    for _ in range(steps):
        prior_slope = np.exp(x) / prior_std
        curvature = np.einsum("snic,snjc->sij", slope, slope)
        diagonal = np.einsum("sii->si", curvature)
        diagonal += prior_slope**2
        gradient = np.einsum("snic,snc->si", slope, residual) - prior_slope * (np.exp(x) - TABLE_1) / prior_std
        system = curvature.copy()
        np.einsum("sii->si", system)[:] += damping[:, None] * diagonal
        step = np.linalg.solve(system, gradient[..., None])[..., 0]
        step /= np.maximum(np.abs(step).max(axis=1, keepdims=True), 1.0)
        trial_cost, trial_residual, trial_slope = state(x + step)
        better = trial_cost <= cost
        x[better] += step[better]
        cost = np.where(better, trial_cost, cost)
        residual[better], slope[better] = trial_residual[better], trial_slope[better]
        damping = np.where(better, 0.2 * damping, np.minimum(8 * damping, 1e12)) + 1e-15
        if np.all(np.abs(step).max(axis=1) < 1e-9):
            break
    return np.exp(x), cost


def fit_sets(design: Design, z: np.ndarray, prior_std: np.ndarray, **options: object) -> dict[str, np.ndarray]:
    """k (S, 6) of the three data sets of Table 2."""
    found = {}
    for name in SETS:
        rows = design.rows(name)
        found[name] = fit(design.theta[rows], design.force[rows], z[:, rows], design.tool, prior_std, **options)[0]
    return found


# --- what nature does -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class World:
    """What the simulated readings contain beyond the published model. Sizes are drawn anew for every data set."""

    noise_m: float = SENSOR_M
    reseating_m: float = 0.0                            # one offset an orientation
    force_noise: float = 0.0                            # relative, each reading
    at_equilibrium: bool = True
    rod: bool = False                                   # springs at the drives, gear 3 behind the rod
    base: float = 0.0                                   # times 1/2e7 rad/(N m) rocking and 1/2e7 m/N shift
    spindle: float = 0.0                                # times 1/3.3e5 rad/(N m) of the force sensor and 1/1.5e7 m/N radial
    misalignment_deg: tuple[float, float] = (0.0, 0.0)
    side_load: tuple[float, float] = (0.0, 0.0)
    backlash_arcmin: tuple[float, float] = (0.0, 0.0)   # half gap of joints 1, 4, 5, 6; gravity closes those of 2 and 3
    tool_mm: float = 0.0


def readings(design: Design, k: np.ndarray, world: World, rng: np.random.Generator) -> np.ndarray:
    """Simulated sensor readings (S, N, 3) [m] of robots with stiffnesses k (S, 6)."""
    count, rows = len(k), len(design.theta)
    force = np.broadcast_to(design.force, (count, rows, 3)).copy()
    if world.side_load[1]:
        share, angle = rng.uniform(*world.side_load, count), rng.uniform(0, 2 * np.pi, count)
        side = np.zeros_like(force)
        along_x = design.force[:, 0] != 0
        side[:, along_x, 1] = np.cos(angle)[:, None]
        side[:, ~along_x, 0] = np.cos(angle)[:, None]
        side[:, :, 2] = np.sin(angle)[:, None]
        force += side * (share[:, None] * np.linalg.norm(design.force, axis=1))[..., None]
    if world.misalignment_deg[1]:
        axis = rng.standard_normal((count, 3))
        axis *= np.radians(rng.uniform(*world.misalignment_deg, count) / np.linalg.norm(axis, axis=1))[:, None]
        force += np.cross(axis[:, None], force)
    force *= 1 + world.force_noise * rng.standard_normal((count, rows, 1))
    tool = design.tool                                  # the measured point; the load acts `beside` it
    beside = 1e-3 * world.tool_mm * rng.uniform(-1, 1, (count, 1, 3))
    load = ROD if world.rod else np.eye(6)
    serial = np.broadcast_to(serial_angles(design.theta), (count, rows, 6))
    axes, origins, tcp, rotation = frames(serial, tool)
    turned = np.zeros((count, rows, 6))
    for _ in range(12 if world.at_equilibrium else 1):
        now_axes, now_origins, now_tcp, now_rotation = frames(serial + turned @ load.T, tool)
        at = now_tcp + np.einsum("snij,snj->sni", now_rotation, np.broadcast_to(beside, tcp.shape))
        torque = np.einsum("snic,snc->sni", lever(now_axes, now_origins, at), force) @ load
        turned = torque / k[:, None]
    z = frames(serial + turned @ load.T, tool)[2] - tcp
    if world.backlash_arcmin[1]:
        gap = np.radians(rng.uniform(*world.backlash_arcmin, (count, 6)) / 60) * np.array([1, 0, 0, 1, 1, 1])
        sign = np.where(np.abs(torque) > 3.0, np.sign(torque), 0.0)
        z = z + np.einsum("snij,sni->snj", lever(axes, origins, tcp), gap[:, None] * sign)
    if world.base:
        size = world.base * rng.uniform(0.5, 1.5, (count, 1, 1)) / 2e7
        rocking = np.cross(tcp, force) * np.array([1, 1, 0])
        z = z + size * (np.cross(rocking, tcp) + force * np.array([1, 1, 0]))
    if world.spindle:
        size = world.spindle * rng.uniform(0.5, 1.5, (count, 1, 1))
        arm = tcp - origins[..., 5, :]
        out = rotation[..., 2]
        moment = np.cross(arm, force)
        moment = moment - out * np.sum(out * moment, axis=-1, keepdims=True)
        radial = force - out * np.sum(out * force, axis=-1, keepdims=True)
        z = z + size * (np.cross(moment, arm) / 3.3e5 + radial / 1.5e7)
    seat = world.reseating_m * rng.standard_normal((count, 4, 3))[:, design.orientation]
    return z + seat + world.noise_m * rng.standard_normal(z.shape)


def truths(count: int, rng: np.random.Generator) -> np.ndarray:
    """True stiffnesses (count, 6): Table 1 times a log-normal factor each, 1 sigma a factor 1.65."""
    return TABLE_1 * np.exp(TRUTH_LOG_STD * rng.standard_normal((count, 6)))


# --- the package on the same data -------------------------------------------------------------------------------------------


def serial_cell(folder: Path, tool: np.ndarray = TOOL, load_path: str = "serial", relative_std: float = 1.0) -> Cell:
    """The cell as the paper has it: serial reading, Table 1, 1 um sensors and nothing else."""
    text = (BUILT_IN / "irb6660-205-1.90.yaml").read_text(encoding="utf-8")
    (folder / "robot.yaml").write_text(text.replace("load_path: drive", f"load_path: {load_path}"), encoding="utf-8")
    (folder / "cell.yaml").write_text(
        f"robot: robot.yaml\ntool: {{position_mm: {[float(x) for x in 1e3 * tool]}}}\n"
        "measurement: {deflection_std_um: [1, 1, 1], force_relative_std: 0, pose_offset_std_um: [0, 0, 0]}\n"
        f"prior: {{relative_std: {relative_std}}}\n", encoding="utf-8")
    return read_cell(folder / "cell.yaml")


def as_measurements(design: Design, z: np.ndarray, rows: np.ndarray) -> Measurements:
    """Rows of one data set z (N, 3) [m] as the package reads them from a file."""
    count = len(rows)
    nothing = np.full(count, np.nan)
    return Measurements(
        source="simulated", theta=design.theta[rows], wrench=np.pad(design.force[rows], ((0, 0), (0, 3))),
        deflection=z[rows], sigma=np.full((count, 3), np.nan), time=nothing, dwell=nothing, visit=np.arange(count),
        reference=np.zeros(count, dtype=np.intp), validate=np.zeros(count, dtype=bool),
        machined_pass=np.full(count, "", dtype=object), pose=np.full(count, "", dtype=object), row=rows + 1, line=rows + 2,
        findings=())


# --- the page ---------------------------------------------------------------------------------------------------------------


def text(paragraph: str) -> list[str]:
    """A paragraph and the empty line after it."""
    return [*textwrap.wrap(" ".join(paragraph.split()), 125, break_long_words=False, break_on_hyphens=False), ""]


def table(head: list[str], rows: list[list[str]]) -> list[str]:
    """A Markdown table."""
    return ["| " + " | ".join(head) + " |", "|" + "---|" * len(head), *("| " + " | ".join(row) + " |" for row in rows), ""]


def in_millions(k: np.ndarray) -> list[str]:
    return [f"{value / 1e6:.3f}" for value in k]


JOINTS = [f"k{i}" for i in range(1, 7)]
EVERYTHING = World(noise_m=10e-6, reseating_m=20e-6, force_noise=0.02, base=1.0, spindle=1.0, misalignment_deg=(1.0, 2.0),
                   side_load=(0.02, 0.05), backlash_arcmin=(0.05, 0.5), tool_mm=10.0)
WORLDS = {
    "(a) 1 µm noise as stated, model exact": World(at_equilibrium=False),
    "(a) the same, torque at equilibrium": World(),
    "(b) noise 10 µm": World(noise_m=10e-6),
    "(b) noise 50 µm": World(noise_m=50e-6),
    "(b) re-seating 20 µm an orientation": World(reseating_m=20e-6),
    "(b) force error 5 % a reading": World(force_noise=0.05),
    "(d) springs at the drives, rod (`drive`)": World(rod=True),
    "(e) base rocks and shifts": World(base=1.0),
    "(e) force sensor and spindle yield": World(spindle=1.0),
    "(e) force direction off by 1-2°": World(misalignment_deg=(1.0, 2.0)),
    "(e) side load 2-5 %": World(side_load=(0.02, 0.05)),
    "(e) backlash, free play 0.1-1 arcmin": World(backlash_arcmin=(0.05, 0.5)),
    "(e) load up to 10 mm beside the TCP": World(tool_mm=10.0),
    "all of (e), 10 µm noise, 20 µm re-seating, 2 % force error": EVERYTHING,
    "the same and the rod": replace(EVERYTHING, rod=True),
}


def factor(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """How far apart two stiffnesses are, as a factor >= 1."""
    return np.exp(np.abs(np.log(one / other)))


def ratios(found: dict[str, np.ndarray]) -> np.ndarray:
    """(S, 4): k6, k1, k3 of Y against all, k3 of X against Y."""
    return np.stack([factor(found["Y"][:, 5], found["all"][:, 5]), factor(found["Y"][:, 0], found["all"][:, 0]),
                     factor(found["Y"][:, 2], found["all"][:, 2]), factor(found["X"][:, 2], found["Y"][:, 2])], axis=1)


PUBLISHED_SETS = {name: k[None] for name, k in TABLE_2.items()}
PUBLISHED = ratios(PUBLISHED_SETS)[0]


def y_disagreement(design: Design, found: dict[str, np.ndarray]) -> np.ndarray:
    """How far the predictions of Y and all are apart over the Y readings, both of them fitted to these (S,) [µm], RMS."""
    rows = design.rows("Y")
    eta = [one_step(design.theta[rows], design.force[rows], 1 / found[name], design.tool)[0] for name in ("Y", "all")]
    return 1e6 * np.sqrt(np.mean(np.sum((eta[0] - eta[1]) ** 2, axis=2), axis=1))


def spread(values: np.ndarray) -> str:
    """Median (5-95 %)."""
    low, middle, high = (f"{value:.2f}" if value < 10 else f"{value:.0f}" if value < 1000 else "> 1000"
                         for value in np.percentile(values, [5, 50, 95]))
    return f"{middle} ({low}-{high})"


def ratio_row(name: str, seen: np.ndarray, apart: np.ndarray, last: str) -> list[str]:
    """One row of section 5."""
    share = [np.mean(seen[:, 0] >= 0.99 * PUBLISHED[0]), np.mean(np.all(seen >= 0.99 * PUBLISHED, axis=1))]
    return [name, *(spread(column) for column in seen.T), spread(apart), *(f"{100 * value:.0f} %" for value in share), last]


def validation_poses(count: int, rng: np.random.Generator, tool: np.ndarray = TOOL) -> Design:
    """Poses over the work space in front of the robot, any orientation with |phi| <= 80 deg; forces along X and Y."""
    theta = np.empty((0, 6))
    while len(theta) < count:
        position = np.array([rng.uniform(1.2, 1.7), rng.uniform(-0.5, 0.5), rng.uniform(0.5, 1.2)])
        theta = np.concatenate([theta, orientations(position, tool, 8, rng)[:1]])
    force = np.zeros((count, 3))
    force[np.arange(count), np.arange(count) % 2] = FORCE_N * np.where(np.arange(count) % 4 < 2, 1, -1)
    return Design(theta, force, np.arange(count) % 4, tool)


def validation_errors(
    found: dict[str, np.ndarray], k: np.ndarray, world: World, rng: np.random.Generator
) -> dict[str, np.ndarray]:
    """RMS error (S, 3) [m] by axis of the predicted deviation over 40 other poses, by parameter set."""
    poses = validation_poses(40, np.random.default_rng(77))
    measured = readings(poses, k, world, rng)
    sets = {"literature": np.broadcast_to(TABLE_1, k.shape), **found}
    error = {name: one_step(poses.theta, poses.force, 1 / values, poses.tool)[0] - measured for name, values in sets.items()}
    result = {name: np.sqrt(np.mean(value**2, axis=1)) for name, value in error.items()}
    result["deviation itself"] = np.sqrt(np.mean(measured**2, axis=1))
    return result


def section_model() -> list[str]:
    """Section 1."""
    rng = np.random.default_rng(11)
    poses = validation_poses(200, rng)
    c = 1 / TABLE_1
    with tempfile.TemporaryDirectory() as folder:
        cell = serial_cell(Path(folder))
        drive = serial_cell(Path(folder), load_path="drive")
    wrench = np.pad(poses.force, ((0, 0), (0, 3)))
    of_package = {name: equilibrium(who.robot, poses.theta, who.flange_from_tcp, wrench, c, rounds=rounds).position
                  for name, who, rounds in (("one", cell, 1), ("many", cell, None), ("drive", drive, None))}
    eta = one_step(poses.theta, poses.force, c[None], poses.tool)[0][0]
    nature = readings(poses, TABLE_1[None], World(noise_m=0.0), rng)[0]
    rod = readings(poses, TABLE_1[None], World(noise_m=0.0, rod=True), rng)[0]

    def apart(one: np.ndarray, other: np.ndarray) -> np.ndarray:
        return np.linalg.norm(one - other, axis=1)

    def exact(one: np.ndarray, other: np.ndarray) -> str:
        worst = apart(one, other).max()
        return "< 1e-12 m" if worst < 1e-12 else f"{worst:.1e} m"

    size = np.linalg.norm(nature, axis=1)
    return [
        "## 1. The model, eq. 1-7", "",
        *text(f"""
            Table 1 is the prior in the robot file. Largest difference over 200 random poses, ±300 N along X or Y, Table 1's
            stiffnesses; deviations {1e6 * size.min():.0f} to {1e6 * size.max():.0f} µm:"""),
        *table(["compared", "difference"], [
            ["eq. 1-6 written out, package `load_path: serial`, one step", exact(eta, of_package["one"])],
            ["torque at equilibrium written out, package `serial`", exact(nature, of_package["many"])],
            ["rod, torque at equilibrium written out, package `drive`", exact(rod, of_package["drive"])],
            ["eq. 3-6 as published (torque of the unloaded pose) against equilibrium",
             f"{1e6 * apart(eta, nature).max():.1f} µm, {100 * (apart(eta, nature) / size).max():.2f} % at worst"],
            ["serial reading against the rod, both at equilibrium",
             f"{1e6 * apart(nature, rod).max():.0f} µm, {100 * np.median(apart(nature, rod) / size):.1f} % in the median, "
             f"{100 * (apart(nature, rod) / size).max():.0f} % at worst"]]),
        *text("""
            Eq. 2 turns each frame by Δθ_i after its shift d_i along the same axis. The two commute: it is eq. 1 at θ~_i +
            Δθ_i. Written once more as 4x4 matrices in tests/identification/fit/test_laws_paper.py."""),
    ]


def section_design() -> list[str]:
    """Section 2a: designs and covariances."""
    rows, heights = [], []
    for name, plane in (("X in the arm's plane", True), ("all free", False)):
        for prior, std in PRIORS.items():
            design = make_design(plane, prior)
            found = [covariance(design, data, TABLE_1, std) for data in SETS]
            unseen = [" ".join(f"k{joint + 1}" for joint in np.flatnonzero(np.sqrt(np.diag(matrix)) * 1e6 / std > 0.7))
                      for matrix in found]
            degrees = np.round(np.degrees(signed_phi(design.theta, TOOL)))[[0, 4, 1, 2]] + 0.0
            phi = ", ".join(f"{value:.0f}" for value in degrees)
            rows.append([name, prior, phi, *(f"{np.trace(matrix):.3g}" for matrix in found), *unseen])
    for height in (0.6, 0.8, 1.0, 1.2, 1.4):
        for prior, std in PRIORS.items():
            design = make_design(True, prior, np.array([1.4, 0.0, height]))
            found = [covariance(design, data, TABLE_1, std) for data in SETS]
            trace = [np.trace(matrix) for matrix in found]
            heights.append([f"{height:g}", prior, *(f"{np.sqrt(matrix[1, 1]) * 1e6 / std[1]:.2f}" for matrix in found),
                            f"{trace[0] / trace[2]:.1f}", f"{trace[0] / trace[1]:.1f}", f"{trace[1] / trace[2]:.1f}"])
    searched = np.array([[np.trace(covariance(make_design(True, seed=seed), data, TABLE_1, PRIORS["equal"])) for data in SETS]
                         for seed in range(20)])
    between = [(searched[:, one] / searched[:, other]) for one, other in ((0, 2), (0, 1), (1, 2))]
    ranges = ", ".join(f"{name} {ratio.min():.1f} to {ratio.max():.1f}"
                       for name, ratio in zip(("X:all", "X:Y", "Y:all"), between, strict=True))
    return [
        "## 2. The three data sets of Table 2", "",
        *text(f"""
            Five readings of 300 N (Y, Y, Y, X, X) in four orientations of one TCP position,
            ({", ".join(f"{x:g}" for x in POSITION)}) m; the first Y and the first X share one. Orientations by exchange
            over up to 1500 sampled ones: smallest trace of eq. 17 (A criterion, raw k, at Table 1), |φ| ≤ 80°, signed
            angle. That is a simple search, not the paper's SQP (eq. 20). Covariance: eq. 13 at Table 1, Σ = (1 µm)², in
            (10⁶ N m/rad)². Prior "equal": Γ_0/γ = 1 (10⁶ N m/rad)² for every joint; "relative": standard deviation = Table
            1's value. Unseen: posterior standard deviation over 0.7 of the prior's."""),
        *table(["orientations", "prior", "φ [°]: YX, X, Y, Y", "trace X", "Y", "all", "unseen by X", "by Y", "by all"], rows),
        *text("""
            **Comes out** with the X orientations in the arm's plane and y = 0: X leaves joints 1, 4 and 6 at the prior, Y
            leaves joint 2, and k2 is prior-dominated in all three sets where the TCP is about as high as axis 2 (0.81 m).
            If the fits converged, Table 2's X set (k1 -1.6 %, k4 -7 %, k6 unchanged) says the same of the real X
            orientations: nearly in the plane, y nearly 0."""),
        *text("""
            **Does not come out** of the A criterion alone: over free orientations it turns the X readings out of the plane,
            and X then sees joints 4 and 6. Why the paper's lay in the plane, it does not say."""),
        *text("Height of the TCP, in-plane design: posterior over prior standard deviation of k2, ratios of the traces:"),
        *table(["z [m]", "prior", "k2 by X", "by Y", "by all", "trace X:all", "X:Y", "Y:all"], heights),
        *text(f"""
            **Half comes out:** "lower by the factor 10". A trace of X an order over that of all comes out off axis 2's
            height, but then X does tell k2, and Y is not close to all. With k2 at its prior and equal prior variances no
            design can give ten: the traces of Y and all keep one prior variance, X has at most six; with "relative" less
            still, k2's variance being nearly all of the trace. Four to one is what comes out, with Y close to all in most
            searches (20 searches at 0.8 m: {ranges}). Which values of the matrices the paper compares, it does not say."""),
        *text("""
            Y-only "a little lower" than all is impossible at one k, since eq. 13 only adds. At Table 2's own values, each
            set its own, it can be so, with equal prior variances:"""),
        *published_covariances(),
    ]


def published_covariances() -> list[str]:
    """Eq. 13 at the published sets."""
    rows = []
    for name, plane in (("X in the arm's plane", True), ("all free", False)):
        for prior, std in PRIORS.items():
            design = make_design(plane, prior)
            traces = [np.trace(covariance(design, data, TABLE_2[data], std)) for data in SETS]
            rows.append([name, prior, *(f"{value:.3g}" for value in traces), f"{traces[0] / traces[2]:.1f}",
                         f"{traces[1] / traces[2]:.3f}"])
    return table(["orientations", "prior", "trace X at its k", "Y", "all", "X:all", "Y:all"], rows)


def section_fits(seed: int = 5) -> list[str]:
    """Section 2b: k of the three sets, by eq. 12 and by the package."""
    design = make_design(True)
    z = readings(design, TRUTH[None], World(), np.random.default_rng(seed))
    rows = [["simulated truth", "", *in_millions(TRUTH)], ["Table 1, prior", "", *in_millions(TABLE_1)]]
    for prior, std in PRIORS.items():
        found = fit_sets(design, z, std)
        rows += [[f"eq. 12, prior \"{prior}\"", data, *in_millions(found[data][0])] for data in reversed(SETS)]
    with tempfile.TemporaryDirectory() as folder:
        cell = serial_cell(Path(folder))
    for kind, name in (("gaussian", "package, `--prior gaussian`"), ("lognormal", "package, log-normal")):
        for data in reversed(SETS):
            model = fit_stiffness(cell, as_measurements(design, z[0], design.rows(data)), prior_kind=kind).model
            mark = {"reliable": "", "tentative": " (t)", "not identifiable": " (-)"}
            rows.append([name, data, *(number + mark[grade] for number, grade in zip(
                in_millions(model.stiffness), model.grades, strict=True))])
    rows += [["published, Table 2", data, *in_millions(k)] for data, k in TABLE_2.items()]
    return [
        "### Stiffnesses, 10⁶ N m/rad", "",
        *text("""
            One simulated robot, in-plane design, torque at equilibrium, 1 µm noise. The package's priors are relative ones
            (standard deviation / mean 1); it estimates the size of the noise with the fit, eq. 12 takes 1 µm as known. (-):
            graded not identifiable by the package, (t) tentative."""),
        *table(["fit", "data", *JOINTS], rows),
    ]


def section_pattern(count: int = 300) -> list[str]:
    """Section 2c: the pattern over many robots."""
    rng = np.random.default_rng(21)
    design = make_design(True)
    k = truths(count, rng)
    z = readings(design, k, World(), rng)
    rows = []
    for prior, std in {**PRIORS, "relative, γ = 100": TABLE_1 / 10}.items():
        found = fit_sets(design, z, std)
        for data in reversed(SETS):
            moved = np.median(factor(found[data], TABLE_1), axis=0) - 1
            missed = np.median(factor(found[data], k), axis=0) - 1
            rows.append([prior, data, *(f"{100 * a:.1f} / {100 * b:.1f}" for a, b in zip(moved, missed, strict=True))])
    return [
        *text(f"""
            {count} simulated robots (Table 1 times a log-normal factor a joint, σ = {TRUTH_LOG_STD:g}), eq. 12. Distance of
            k from Table 1 / from the truth in %, medians:"""),
        *table(["prior", "data", *JOINTS], rows),
        *text("""
            Table 2's k2 (6.017 to 6.038 against 6.02) goes with "equal", where k2 moves by about a per cent or less, or
            with "relative" and a γ far over 1; which, Table 2 does not tell. A k2 this near Table 1 is no measurement of
            it: the simulated truth is some 40 % away. k3 from Y alone is weak too, 10 % off."""),
    ]


def section_validation(count: int = 200) -> list[str]:
    """Section 3."""
    design, rows = make_design(True), []
    for name, world in (("true model, 1 µm", World()), ("every effect of section 5", replace(EVERYTHING, rod=True))):
        rng = np.random.default_rng(31)
        k = truths(count, rng)
        found = fit_sets(design, readings(design, k, world, rng), PRIORS["equal"])
        errors = validation_errors(found, k, world, rng)
        whole = {data: np.sum(value**2, axis=1) for data, value in errors.items()}
        for data in ("deviation itself", "literature", "X", "Y", "all"):
            share = "" if data in ("deviation itself", "all") else f"{100 * np.mean(whole[data] < whole['all']):.0f} %"
            rows.append([name, data, *(f"{1e6 * value:.1f}" for value in np.median(errors[data], axis=0)), share])
    return [
        "## 3. Validation at other poses, as Fig. 4", "",
        *text(f"""
            40 simulated poses, x 1.2-1.7, y ±0.5, z 0.5-1.2 m, ±300 N along X or Y. RMS error of the predicted deviation by
            axis in µm, median over {count} simulated robots; in-plane design, eq. 12, prior "equal". "beats all": share of
            the robots."""),
        *table(["simulated robot", "parameters", "X", "Y", "Z", "beats all"], rows),
        *text("""
            **Comes out:** literature worst, X hardly better, Y and all far better; relative to the deviation Y is predicted
            better than X. **Does not:** "Y matches the most" - with a true model all beats Y nearly always; section 5 has
            by which effects Y wins more often (last column)."""),
    ]


def section_open() -> list[str]:
    """Section 4."""
    rng = np.random.default_rng(3)
    new, old = rng.standard_normal((2, 1000, 3))
    square = np.sum((new - old) ** 2, axis=1)
    printed = np.degrees(np.arccos(1 - square / (square + square)))
    return [
        "## 4. What the paper does not print, and what was assumed", "",
        *table(["not printed, or not usable", "here"], [
            ["α, a, d of the robot, offsets of θ~", "public sources, identification/model/robots/irb6660-205-1.90.yaml"],
            ["TCP position, orientations, tool", f"({', '.join(f'{x:g}' for x in POSITION)}) m; TCP {1e3 * TOOL[0]:.0f} mm "
             f"beside and {1e3 * TOOL[2]:.0f} mm in front of the flange; orientations by search"],
            ["forces within ±300 N, their signs", "300 N; to first order the sign only turns the deviation round"],
            ["γ, Γ_0", "two readings, \"equal\" and \"relative\", γ = 1"],
            ["Σ", "(1 µm)², the stated accuracy of the sensors; drift, force error and re-seating are not in it"],
            ["eq. 21", f"as printed both terms of the denominator equal the numerator: arccos(1/2), {printed.min():.3f} to "
             f"{printed.max():.3f}° over 1000 random pairs. Signed angle in the base x-y plane from (TCP - base origin) to "
             "(TCP - joint-6 origin)"],
            ["where the springs of a parallel-rod robot sit", "eq. 3-5 literally: each serial axis (`serial`). Eq. 7 couples "
             "angles, not torques; section 1 has the difference to the rod"],
            ["covariance values, and which of them fell by ten", "traces of eq. 13, section 2"],
            ["solver of eq. 12, start, stopping rule", "Levenberg-Marquardt from Table 1 to convergence; 5 (c) stops early"],
            ["measured deflections; Fig. 4's numbers and poses", "none: no number of Table 2 can be checked against data"]]),
    ]


def disagreement() -> list[str]:
    """What the published sets predict of the same Y readings, over TCP positions and tools."""
    rows = []
    for beside in (0.1, 0.3, 0.4, 0.5, 0.6, 0.8):
        closest, third, middle = np.inf, np.inf, []
        for x, y, z, ahead in product((1.2, 1.4, 1.6, 1.8), (0.0, 0.4), (0.5, 0.8, 1.1), (0.1, 0.3, 0.5)):
            tool = np.array([beside, 0.0, ahead])
            theta = orientations(np.array([x, y, z]), tool, 500, np.random.default_rng(9))
            if len(theta) < 20:
                continue
            force = np.tile([0.0, FORCE_N, 0.0], (len(theta), 1))
            eta = [one_step(theta, force, 1 / TABLE_2[data][None], tool)[0][0] for data in ("Y", "all")]
            apart = np.sort(1e6 * np.linalg.norm(eta[0] - eta[1], axis=1))
            closest, third = min(closest, apart[0]), min(third, apart[2])
            middle.append(np.median(apart))
        rows.append([f"{1e3 * beside:.0f}", f"{np.median(middle):.0f}", f"{closest:.0f}", f"{third:.0f}"])
    return table(["TCP beside the flange axis [mm]", "median [µm]", "smallest anywhere",
                  "smallest third of one position and tool"], rows)


def stopped_early(design: Design, name: str, world: World, options: tuple[str, int, float], count: int = 60) -> list[str]:
    """(c): first-order model, solver in raw k (10⁶ N m/rad): method, most iterations, factor on the cost."""
    method, iterations, scale = options
    rng = np.random.default_rng(42)
    z = readings(design, truths(count, rng), world, rng)
    columns = lever(*frames(serial_angles(design.theta), design.tool)[:3])
    shape = columns * np.einsum("nic,nc->ni", columns, design.force)[..., None]
    start = TABLE_1 / 1e6

    def solve(rows: np.ndarray, reading: np.ndarray) -> np.ndarray:
        matrix = shape[rows].transpose(0, 2, 1).reshape(-1, 6) / SENSOR_M / 1e6
        wanted = reading[rows].ravel() / SENSOR_M

        def cost(k: np.ndarray) -> tuple[float, np.ndarray]:
            residual, off = matrix @ (1 / k) - wanted, k - start
            return 0.5 * scale * float(residual @ residual + off @ off), scale * (off - (matrix.T @ residual) / k**2)

        return minimize(cost, start, jac=True, method=method, bounds=[(1e-3, None)] * 6, options={"maxiter": iterations}).x

    found = {data: 1e6 * np.array([solve(design.rows(data), reading) for reading in z]) for data in SETS}
    return ratio_row(f"(c) {name}", ratios(found), y_disagreement(design, found), "")


def close_orientations(degrees: float, count: int = 20) -> list[Design]:
    """(f): random designs whose Y orientations lie within so many degrees of the in-plane one they share with X."""
    rng = np.random.default_rng(4)
    in_plane = orientations(POSITION, TOOL, 400, rng, in_plane=True)
    free = orientations(POSITION, TOOL, 20000, rng)
    turned = frames(serial_angles(free), TOOL)[3]
    force = np.zeros((5, 3))
    force[:3, 1], force[3:, 0] = FORCE_N, FORCE_N
    designs: list[Design] = []
    while len(designs) < count:
        first, second = rng.choice(len(in_plane), 2, replace=False)
        trace = np.einsum("ij,nij->n", frames(serial_angles(in_plane[first]), TOOL)[3], turned)
        near = np.flatnonzero(trace > 1 + 2 * np.cos(np.radians(degrees)))
        if len(near) >= 2:
            others = free[rng.choice(near, 2, replace=False)]
            theta = np.array([in_plane[first], *others, in_plane[first], in_plane[second]])
            designs.append(Design(theta, force, np.array([0, 1, 2, 0, 3]), TOOL))
    return designs


def pooled_row(name: str, designs: list[Design], world: World, robots: int = 20) -> list[str]:
    """One row of section 5 over several designs."""
    rng = np.random.default_rng(44)
    seen, apart = [], []
    for design in designs:
        found = fit_sets(design, readings(design, truths(robots, rng), world, rng), PRIORS["equal"])
        seen.append(ratios(found))
        apart.append(y_disagreement(design, found))
    return ratio_row(name, np.concatenate(seen), np.concatenate(apart), "")


def other_minima(design: Design, world: World, count: int = 60) -> str:
    """How often converged fits from Table 2's own values and from other starts end elsewhere."""
    rng, parts = np.random.default_rng(43), []
    z = readings(design, truths(count, rng), world, rng)
    for data in SETS:
        rows = design.rows(data)
        arguments = (design.theta[rows], design.force[rows], z[:, rows], design.tool, PRIORS["equal"])
        reference, least = fit(*arguments, steps=400)
        elsewhere = []
        for start in (TABLE_2[data], *(TABLE_1 * np.exp(1.5 * rng.standard_normal(6)) for _ in range(5))):
            k, cost = fit(*arguments, start=start, steps=400)
            elsewhere.append((factor(k, reference).max(axis=1) > 1.05) & (np.abs(cost - least) > 1e-6 * least))
        parts.append(f"{data} {100 * np.mean(elsewhere):.1f} %")
    return ", ".join(parts)


def world_row(design: Design, name: str, world: World, prior: str = "equal", count: int = 200) -> list[str]:
    """One kind of simulated robot in section 5."""
    rng = np.random.default_rng(41)
    k = truths(count, rng)
    found = fit_sets(design, readings(design, k, world, rng), PRIORS[prior])
    errors = {data: np.sum(value**2, axis=1) for data, value in validation_errors(found, k, world, rng).items()}
    return ratio_row(name, ratios(found), y_disagreement(design, found), f"{100 * np.mean(errors['Y'] < errors['all']):.0f} %")


def section_published() -> list[str]:
    """Section 5."""
    design = make_design(True)
    untrue = replace(EVERYTHING, rod=True)
    rows = [["**published, Table 2**", *(f"**{value:.1f}**" for value in PUBLISHED),
             f"**{y_disagreement(design, PUBLISHED_SETS)[0]:.0f}**", "", "", ""]]
    rows += [world_row(design, name, world) for name, world in WORLDS.items()]
    rows.append(world_row(make_design(True, "relative"), 'the same, design and fit with prior "relative"', untrue, "relative"))
    rows += [stopped_early(design, *arguments) for arguments in (
        ("SQP with BFGS (SLSQP), default stop, data as (a)", World(), ("SLSQP", 1000, 1.0)),
        ("the same, all effects and the rod", untrue, ("SLSQP", 1000, 1.0)),
        ("the same, cost scaled by 10⁻³, data as (a)", World(), ("SLSQP", 1000, 1e-3)),
        ("the same, by 10⁻⁶, 10 iterations, data as (a)", World(), ("SLSQP", 10, 1e-6)),
        ("L-BFGS-B to convergence, data as (a)", World(), ("L-BFGS-B", 15000, 1.0)))]
    searched, close, closer, random = ([make_design(True, seed=seed) for seed in range(20)], close_orientations(20),
                                       close_orientations(10), close_orientations(180))
    rows += [pooled_row(*arguments) for arguments in (
        ("(f) 20 searched designs, data as (a)", searched, World()),
        ("(f) 20 searched designs, all effects and the rod", searched, untrue),
        ("(f) random orientations, all effects and the rod", random, untrue),
        ("(f) Y orientations within 20°, all effects and the rod", close, untrue),
        ("(f) Y orientations within 10°, data as (a)", closer, World()),
        ("(f) Y orientations within 10°, all effects and the rod", closer, untrue))]
    return [
        "## 5. What Table 2 says about the published model", "",
        *text("""
            X-only k1, k4, k6 are the prior: no evidence, as it should be. Odd: Y-only and all differ 31.6 times in k6, 3.1
            in k1, 2.6 in k3, although all is Y plus two X readings that say nothing of joint 6; and X and Y differ 4.1
            times in k3."""),
        *text("""
            Simulated: in-plane design, eq. 12 with Σ = (1 µm)², prior "equal", from Table 1 to convergence; 200 robots a
            row, 60 in (c), 20 designs of 20 robots in (f). Where SLSQP ends depends on the processor's rounding; its rows
            hold as to size. Factors between the sets, median (5-95 %). "Y readings": how far the predictions of the Y set
            and the all set are apart over the three Y readings both were fitted to, RMS in µm (published: Table 2's values
            on this design). "k6", "all four": robots whose k6 factor, or all four, are at least as published. "Y beats
            all": at the poses of section 3."""),
        *table(["simulated", "k6 Y:all", "k1 Y:all", "k3 Y:all", "k3 X:Y", "Y readings", "k6", "all four", "Y beats all"],
               rows),
        *text(f"""
            Other minima of eq. 12: converged fits from Table 2's own values and from five random starts that end over 5 %
            away in some k: {other_minima(design, World())} (data as (a)); {other_minima(design, untrue)} (all effects and
            the rod)."""),
        *text("""
            The published Y and all sets on the same 300 N along Y, over 72 TCP positions and tool lengths (x 1.2-1.8, y
            0-0.4, z 0.5-1.1, 0.1-0.5 m before the flange) and the reachable ones of 500 orientations at each; distance of
            the two predictions, proportional to the force:"""),
        *disagreement(),
        *conclusions(),
    ]


def conclusions() -> list[str]:
    """What the table of section 5 allows to say."""
    return [
        "### What follows", "",
        *text("""
            - **Noise of 1 µm alone cannot give it** on orientations that are spread: k6 and k1 of Y and all then agree
            within two per cent, k3 within 30 % (on this design; within a factor 1.8 on 20 others)."""),
        *text("""
            - **k3 (2.6 and 4.1)** is consistent with any larger disturbance: noise of tens of µm, re-seating, force error,
            backlash, several effects at once. Y tells k3 weakly, and the stated 1 µm overrates what it tells. Rod, base,
            spindle, turned force, side load of these sizes did not give it by themselves. No cause can be named from it."""),
        *text("""
            - **k6 (31.6) and k1 (3.1)** came out of no converged fit on spread orientations, whatever was simulated, alone
            or together. Consistent with them: a solver that ends before the minimum - SLSQP with the cost weighted by 1 µm,
            unscaled, does, and exceeds 31.6 in k6 in about a tenth of the robots, all four factors in one of 60 - and, in a
            few per cent of the robots, Y orientations within 20° of each other together with several unmodelled effects.
            Other minima are no explanation, hardly any were found; the wrong load path by itself cannot give them."""),
        *text("""
            - **The Y set and the all set contradict each other on the data they share.** At 300 N they are 1.1 mm apart on
            this design, and among the sampled poses never closer than 0.2 mm in three orientations of one position; one of
            the two misses the readings by at least half of that. Of the simulated converged fits 95 % are within 0.06 mm,
            with every effect at once. So an unconverged fit, other data behind one of the sets, much smaller forces, or a
            slip in the printed table are consistent with it (the last three not simulated); sensor noise, the rod and the
            other effects, of these sizes, are not by themselves."""),
        *text("- Which of these happened cannot be told without the readings, and the paper does not print them."),
    ]


def page() -> str:
    """The whole page."""
    parts = [
        ["# The paper, reproduced on simulated data", ""],
        text("""
            Regenerated by `python benchmarks/paper.py`: the same bytes each run on one machine. The paper is *Optimal
            design for compliance modeling of industrial robots with bayesian inference of stiffnesses* (2023), robot ABB
            IRB 6660-205/1.9. **Every data set on this page is simulated**; the paper prints no measured deflection."""),
        section_model(), section_design(), section_fits(), section_pattern(), section_validation(), section_open(),
        section_published(),
    ]
    return "\n".join(line for part in parts for line in part).rstrip() + "\n"


def main() -> None:
    PAGE.write_text(page(), encoding="utf-8")
    print(f"wrote {PAGE}")


if __name__ == "__main__":
    main()

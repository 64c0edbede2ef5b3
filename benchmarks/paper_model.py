"""The paper's model, written out once more, apart from the package: chain, springs, design, fit, and what nature does.

Modified Denavit-Hartenberg chain (eq. 1, 2, 7), joint torques and springs (eq. 3-5), deviation (eq. 6), MAP with the Gaussian
prior in k (eq. 11, 12), its covariance (eq. 13, 14), the A criterion (eq. 16, 17), and the physical effects that section 5 adds
to the simulated readings. From the package come the robot's limits, its inverse kinematics, and where loads come to rest.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identification.model.inverse import inverse
from identification.model.robot import BUILT_IN, read_robot
from identification.model.rotations import Frame

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

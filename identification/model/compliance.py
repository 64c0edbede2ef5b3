"""Wrench -> joint torque -> joint deflection -> TCP deviation, and its derivatives.

The plain model (docs/architecture.md, Springs; paper eq. 2-6): six linear torsion springs with compliances `c` [rad/(N m)].
With L the robot's load matrix (the coupling where the springs sit at the drives) the springs yield by `dq`,

    tau = L^T J~(theta~ + L dq)^T w ,    dq = c * tau ,    deviation = FK(theta~ + L dq) - FK(theta~) ,

the torque taken at equilibrium, where the load still acts at the TCP that has moved. The wrench `w = (F, M)` is given
in the base frame, acts on the tool at the TCP, and keeps its direction while the robot yields.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.common.findings import error
from identification.model.kinematics import chain, chunks, forward, jacobian, quarter_turns, spring_columns, turned_back
from identification.model.robot import RobotModel
from identification.model.rotations import Frame, rotation_vector

Array = NDArray[np.float64]

# Each round shrinks the error by the ratio of geometric to joint stiffness, under 0.01 for any load a robot survives.
MAX_ROUNDS = 60
TOLERANCE_RAD = 1e-12
# Poses a step of the torque recursion: many enough that NumPy's call overhead does not show, few enough for the cache.
CHUNK = 8192
# Of matrices of two axes: the first after the second, and not before it.
LOWER, NOT_ABOVE = np.tril_indices(6, -1), np.tril_indices(6)


class _Arm:
    """The torque recursion on a chunk of n poses, on buffers that are allocated once a call. Across a joint's axis a vector is
    a complex number (`kinematics.turned_back`).

    Temporaries of this size would each be fetched from and returned to the system, which costs more than the arithmetic.
    """

    def __init__(self, robot: RobotModel, flange_from_tcp: Frame, size: int) -> None:
        self.twists = [quarter_turns(alpha) for alpha in robot.alpha]
        self.a, self.d = robot.a.tolist(), robot.d.tolist()
        self.tcp = flange_from_tcp.position
        self.turns, self.arms = np.empty((2, 6, size), dtype=np.complex128)
        self.torque = np.empty((6, size))
        self.point, self.vector, self.product = np.empty((3, size), dtype=np.complex128)
        self.height, self.along, self.spare = np.empty((3, size))

    def set_angles(self, serial: Array) -> None:
        """Serial angles (6, n) [rad], and the TCP's lever arms."""
        self._lever_arms(turned_back(serial, self.turns[:, : serial.shape[1]]))

    def _lever_arms(self, turns: NDArray[np.complex128]) -> None:
        """Inwards from the tool: the TCP seen from each joint frame [m], x - i y in `arms`, and last from the base
        (`position`)."""
        n = turns.shape[1]
        point, height = self.point[:n], self.height[:n]
        point[:], height[:] = complex(self.tcp[0], -self.tcp[1]), self.tcp[2]
        for i in range(5, -1, -1):
            arm = np.multiply(turns[i], point, out=self.arms[i, :n])
            np.add(arm.real, self.a[i], out=point.real)
            if self.d[i]:
                height += self.d[i]
            sine, cosine = self.twists[i]
            if sine == 0.0:
                np.multiply(arm.imag, cosine, out=point.imag)
                if cosine < 0:
                    np.negative(height, out=height)
            elif cosine == 0.0:
                np.multiply(height, sine, out=point.imag)
                np.multiply(arm.imag, -sine, out=height)
            else:
                point.imag[:], height[:] = cosine * arm.imag + sine * height, cosine * height - sine * arm.imag
        self.position = point.real, np.negative(point.imag, out=self.spare[:n]), height

    def torques(self, wrench: Array) -> Array:
        """Torques (6, n) [N m] about the serial axes; wrench (6, n) or, where there is no moment, (3, n) in the base frame."""
        n = wrench.shape[1]
        torque, product = self.torque[:, :n], self.product[:n]
        for axis, across, _ in self._carried(wrench[:3]):
            torque[axis] = np.multiply(self.arms[axis, :n], across, out=product).imag
        if len(wrench) == 6:
            for axis, _, along in self._carried(wrench[3:]):
                torque[axis] += along
        return torque

    def _carried(self, vector: Array) -> Iterator[tuple[int, NDArray[np.complex128], Array]]:
        """A vector (3, n) of the base frame, outwards from joint frame to joint frame, each before its joint turns: x + i y
        across its axis, and the part along it."""
        n = vector.shape[1]
        across, along, spare = self.vector[:n], self.along[:n], self.spare[:n]
        across.real, across.imag, along[:] = vector
        for i in range(6):
            sine, cosine = self.twists[i]
            if sine == 0.0:
                if cosine < 0:
                    np.negative(across.imag, out=across.imag)
                    np.negative(along, out=along)
            elif cosine == 0.0:
                np.multiply(across.imag, -sine, out=spare)
                np.multiply(along, sine, out=across.imag)
                along, spare = spare, along
            else:
                y = across.imag.copy()
                across.imag[:], along[:] = cosine * y + sine * along, cosine * along - sine * y
            yield i, across, along
            np.multiply(across, self.turns[i, :n], out=across)


def _components(wrench: Array, part: slice) -> Array:
    """A chunk's wrench, components first: (6, n), or (3, n) where no row of the chunk has a moment."""
    piece = wrench[part]
    used = piece if piece[:, 3:].any() else piece[:, :3]
    return np.ascontiguousarray(used.T)


def _serial(robot: RobotModel, theta: Array) -> Array:
    """Serial angles, components first (6, n) [rad], of controller angles (n, 6) [rad]."""
    return np.asarray(robot.coupling @ theta.T + robot.offset[:, None])


def joint_torque(robot: RobotModel, theta: Array, flange_from_tcp: Frame, wrench: Array) -> Array:
    """Torques (N, 6) [N m] of a TCP wrench at the springs, in the pose `theta` itself (paper eq. 4 and 5).

    theta (N, 6) controller angles [rad]; wrench (N, 6) [N, N m] in the base frame. Where the springs sit at the drives
    this is `J^T w` with `J = J~ C`.
    """
    arm = _Arm(robot, flange_from_tcp, min(len(theta), CHUNK))
    result = np.empty_like(theta, dtype=float)
    for part in chunks(len(theta), CHUNK):
        arm.set_angles(_serial(robot, theta[part]))
        result[part] = (robot.load_matrix.T @ arm.torques(_components(wrench, part))).T
    return result


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """The loaded robot: spring deflection (N, 6) [rad], TCP deviation in the base frame, position (N, 3) [m]."""

    deflection: Array
    position: Array


def equilibrium(
    robot: RobotModel, theta: Array, flange_from_tcp: Frame, wrench: Array, compliance: Array, rounds: int | None = None
) -> Equilibrium:
    """Deflection and TCP deviation under load (paper eq. 2-6), torque at equilibrium (docs/architecture.md, Springs).

    theta (N, 6) [rad], wrench (N, 6) [N, N m], compliance (6,) [rad/(N m)]. rounds: stop after so many torque
    evaluations (1: the published one-step form, up to 3e-3 off); None: iterate until a round changes less than 1e-12 rad.
    Raises CompstiffError (CS1101) where the load is so large that the springs find no equilibrium.
    """
    arm = _Arm(robot, flange_from_tcp, min(len(theta), CHUNK))
    load, soften = robot.load_matrix, compliance[:, None] * robot.load_matrix.T
    deflection, position = np.empty((len(theta), 6)), np.empty((len(theta), 3))
    buffers = np.empty((3, 6, min(len(theta), CHUNK)))
    for part in chunks(len(theta), CHUNK):
        serial, piece = _serial(robot, theta[part]), _components(wrench, part)
        angles, yielded, previous = buffers[:, :, : serial.shape[1]]
        arm.set_angles(serial)
        for axis in range(3):
            position[part, axis] = arm.position[axis]
        np.matmul(soften, arm.torques(piece), out=yielded)
        for _ in range(1, rounds or MAX_ROUNDS):
            arm.set_angles(np.add(serial, np.matmul(load, yielded, out=angles), out=angles))
            previous, yielded = yielded, previous
            np.matmul(soften, arm.torques(piece), out=yielded)
            previous -= yielded
            change = max(float(previous.max()), -float(previous.min()))
            if rounds is None and change <= TOLERANCE_RAD:
                break
        else:
            if rounds is None:
                raise error(
                    "CS1101", f"no equilibrium under this load after {MAX_ROUNDS} rounds: the joints still move "
                    f"by {change:.2g} rad", hint="check the units of forces [N], moments [N m] and stiffnesses")
        arm.set_angles(np.add(serial, np.matmul(load, yielded, out=angles), out=angles))
        deflection[part] = yielded.T
        for axis in range(3):
            np.subtract(arm.position[axis], position[part, axis], out=position[part, axis])
    return Equilibrium(deflection, position)


def loaded_pose(
    robot: RobotModel, theta: Array, flange_from_tcp: Frame, wrench: Array, compliance: Array
) -> Frame:
    """base_from_tcp (N) of the robot commanded to `theta`, yielding under `wrench` (eq. 2); arguments as `equilibrium`."""
    state = equilibrium(robot, theta, flange_from_tcp, wrench, compliance)
    return forward(robot, loaded_angles(robot, theta, state.deflection), flange_from_tcp)


def loaded_angles(robot: RobotModel, theta: Array, deflection: Array) -> Array:
    """Controller angles (N, 6) [rad] at which an unloaded robot stands where the loaded one is."""
    return np.asarray(theta + deflection @ (robot.uncoupling @ robot.load_matrix).T)


def deviation(
    robot: RobotModel, theta: Array, flange_from_tcp: Frame, wrench: Array, compliance: Array
) -> tuple[Array, Array]:
    """TCP deviation in the base frame: position (N, 3) [m] and rotation vector (N, 3) [rad], finite, at equilibrium (eq. 6)."""
    loaded = loaded_pose(robot, theta, flange_from_tcp, wrench, compliance)
    return displacement(loaded, forward(robot, theta, flange_from_tcp))


def displacement(loaded: Frame, planned: Frame) -> tuple[Array, Array]:
    """From planned to loaded poses (N): position (N, 3) [m] and rotation vector (N, 3) [rad] in the base frame (eq. 6)."""
    return loaded.position - planned.position, rotation_vector(loaded.rotation @ np.swapaxes(planned.rotation, 1, 2))


def regressor(robot: RobotModel, theta: Array, flange_from_tcp: Frame, wrench: Array) -> Array:
    """Regressor A (N, 6, 6) of the first-order model `deviation = A c` (paper eq. 3-6 linearised): column i is `J_i tau_i`.

    Rows: position [m per rad/(N m)], then rotation [rad per rad/(N m)].
    """
    columns = jacobian(robot, theta, flange_from_tcp)
    return np.asarray(columns * np.einsum("nri,nr->ni", columns, wrench)[:, None, :])


def compliance_matrix(robot: RobotModel, theta: Array, flange_from_tcp: Frame, compliance: Array) -> Array:
    """First-order Cartesian compliance `J diag(c) J^T` (N, 6, 6), symmetric and positive semidefinite (Maxwell-Betti)."""
    columns = jacobian(robot, theta, flange_from_tcp)
    return np.asarray(np.einsum("nri,i,nsi->nrs", columns, compliance, columns))


def position_compliance(robot: RobotModel, theta: Array, flange_from_tcp: Frame, compliance: Array) -> Array:
    """The part (N, 3, 3) [m/N] of `compliance_matrix` by which a force moves the TCP; in pieces, for any number of poses."""
    result = np.empty((len(theta), 3, 3))
    for part in chunks(len(theta)):
        result[part] = carried_by(spring_columns(robot, theta[part], flange_from_tcp), compliance).T
    return result


def carried_by(columns: Array, compliance: Array) -> Array:
    """The same (3, 3, n), components first, out of the Jacobian's columns (6, 6, n)."""
    return symmetric(columns[:, :3], compliance[:, None, None] * columns[:, :3])


def symmetric(a: Array, b: Array) -> Array:
    """The matrices (k, k, n) `sum over i of a_i b_i^T` of vectors (m, k, n), components first, where these are symmetric."""
    size = a.shape[1]
    result = np.empty((size, size, a.shape[2]))
    for row in range(size):
        for column in range(row, size):
            result[row, column] = result[column, row] = np.einsum("in,in->n", a[:, row], b[:, column])
    return result


def cross(a: Array, b: Array) -> Array:
    """a x b of vectors (..., 3, n), components first."""
    x, y, z = (a[..., i, :] for i in range(3))
    u, v, w = (b[..., i, :] for i in range(3))
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=-2)


def _products(a: Array, b: Array) -> Array:
    """a_i . b_j (6, 6, n) of vectors (6, 3, n), components first."""
    result = a[:, None, 0] * b[:, 0]
    for component in (1, 2):
        result += a[:, None, component] * b[:, component]
    return np.asarray(result)


def sensitivity(
    robot: RobotModel, theta: Array, flange_from_tcp: Frame, wrench: Array, compliance: Array, state: Equilibrium | None = None
) -> tuple[Array, Array]:
    """Deviation of the TCP's position (N, 3) [m] and its exact derivative by `c` (N, 3, 6) [m per rad/(N m)] (eq. 14).

    Differentiating `dq = c * tau(dq)` gives `d dq / d c_i = (1 - diag(c) H)^-1 e_i tau_i` with the geometric stiffness
    `H = d tau / d q = L^T (d J~^T w / d theta~) L`, all at the loaded pose; then `d x / d c = J d dq / d c`. state: the
    equilibrium, where it is at hand.
    """
    state = equilibrium(robot, theta, flange_from_tcp, wrench, compliance) if state is None else state
    slope = np.empty((len(theta), 3, 6))
    loaded = loaded_angles(robot, theta, state.deflection)
    load = robot.load_matrix
    for part in chunks(len(theta)):
        frames = chain(robot, np.ascontiguousarray(robot.serial_angles(loaded[part]).T))
        arms = frames.origins[5] + np.einsum("ijn,j->in", frames.rotation, flange_from_tcp.position) - frames.origins
        force, moment = wrench[part, :3].T, wrench[part, 3:].T
        columns = cross(frames.axes, arms)                                         # [axis, component, pose]
        torque = np.einsum("icn,cn->in", columns, force) + np.einsum("icn,cn->in", frames.axes, moment)
        # d tau_j / d theta_i = F . (z_i x (z_j x r_j)) for i <= j, with i and j exchanged for i > j, plus M . (z_i x z_j)
        # for i < j: only the joints before j turn its axis. A triple product takes any two of its factors as the pair.
        geometric = _products(cross(force, frames.axes), columns)
        geometric[LOWER] = geometric.transpose(1, 0, 2)[LOWER]
        if moment.any():
            turned = _products(cross(moment, frames.axes), frames.axes)
            turned[NOT_ABOVE] = 0.0
            geometric += turned
        stiffening = (load.T @ geometric.transpose(2, 1, 0)) @ load                # [pose, spring, spring]
        system = np.eye(6) - compliance[:, None] * stiffening
        moved = np.linalg.solve(system, np.eye(6) * (torque.T @ load)[:, None, :])
        slope[part] = columns.transpose(2, 1, 0) @ load @ moved
    return state.position, slope

"""Wrench -> joint torque -> joint deflection -> TCP deviation, and its derivatives.

The plain model (DESIGN.md, physics 1 and 2; paper eq. 2-6): six linear torsion springs with compliances `c` [rad/(N m)].
With L the robot's load matrix (the coupling where the springs sit at the drives) the springs yield by `dq`,

    tau = L^T J~(theta~ + L dq)^T w ,    dq = c * tau ,    deviation = FK(theta~ + L dq) - FK(theta~) ,

the torque taken at equilibrium, where the load still acts at the TCP that has moved. The wrench `w = (F, M)` is given
in the base frame, acts on the tool at the TCP, and keeps its direction while the robot yields.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.findings import error
from identification.model.kinematics import chain, chunks, forward, jacobian, quarter_turns, sine_cosine
from identification.model.robot import RobotModel
from identification.model.rotations import Frame, rotation_vector

Array = NDArray[np.float64]

# Each round shrinks the error by the ratio of geometric to joint stiffness, under 0.01 for any load a robot survives.
MAX_ROUNDS = 60
TOLERANCE_RAD = 1e-14


class _Arm:
    """The constants of the torque recursion, unpacked once a call."""

    def __init__(self, robot: RobotModel, flange_from_tcp: Frame) -> None:
        self.twists = [quarter_turns(alpha) for alpha in robot.alpha]
        self.a, self.d = robot.a.tolist(), robot.d.tolist()
        self.tcp = flange_from_tcp.position.tolist()

    def lever_arms(self, sines: Array, cosines: Array) -> tuple[list[tuple[Array, Array]], tuple[Array, Array, Array]]:
        """Inwards from the tool: the TCP seen from each joint frame, x and y (n,) [m], and the TCP in the base frame."""
        arms: list[tuple[Array, Array]] = []
        x, y, z = self.tcp
        for i in range(5, -1, -1):
            z = z + self.d[i]
            s, c = sines[i], cosines[i]
            turned_x, turned_y = c * x - s * y, s * x + c * y
            arms.append((turned_x, turned_y))
            x = turned_x + self.a[i] if self.a[i] else turned_x
            y, z = _twist(self.twists[i], turned_y, z)
        return arms[::-1], (x, y, z)

    def torques(self, sines: Array, cosines: Array, wrench: Array) -> tuple[Array, tuple[Array, Array, Array]]:
        """Torques (6, n) [N m] about the serial axes and the TCP (3 x (n,)) [m]; wrench (6, n) or, without moment, (3, n)."""
        arms, tcp = self.lever_arms(sines, cosines)
        torque = np.empty_like(sines)
        force = wrench[0], wrench[1], wrench[2]
        moment = (wrench[3], wrench[4], wrench[5]) if len(wrench) == 6 else None
        for i in range(6):
            arm_x, arm_y = arms[i]
            s, c = sines[i], cosines[i]
            sine, cosine = self.twists[i]
            force_y, force_z = _twist((-sine, cosine), force[1], force[2])
            np.multiply(arm_x, force_y, out=torque[i])
            torque[i] -= arm_y * force[0]
            if moment is not None:
                moment_y, moment_z = _twist((-sine, cosine), moment[1], moment[2])
                torque[i] += moment_z
                moment = c * moment[0] + s * moment_y, c * moment_y - s * moment[0], moment_z
            if i < 5:
                force = c * force[0] + s * force_y, c * force_y - s * force[0], force_z
        return torque, tcp


def _twist(twist: tuple[float, float], y: Array, z: Array) -> tuple[Array, Array]:
    """RotX of (y, z), without arithmetic for the twists 0 and +-90 degrees that arms are built with."""
    sine, cosine = twist
    if cosine == 0.0:
        return (-z, y) if sine > 0 else (z, -y)
    if sine == 0.0:
        return (y, z) if cosine > 0 else (-y, -z)
    return cosine * y - sine * z, sine * y + cosine * z


def _components(wrench: Array, part: slice) -> Array:
    """A chunk's wrench, components first: (6, n), or (3, n) where no row of the chunk has a moment."""
    piece = wrench[part]
    used = piece if piece[:, 3:].any() else piece[:, :3]
    return np.ascontiguousarray(used.T)


def joint_torque(robot: RobotModel, theta: Array, flange_from_tcp: Frame, wrench: Array) -> Array:
    """Torques (N, 6) [N m] of a TCP wrench at the springs, in the pose `theta` itself (paper eq. 4 and 5).

    theta (N, 6) controller angles [rad]; wrench (N, 6) [N, N m] in the base frame. Where the springs sit at the drives
    this is `J^T w` with `J = J~ C`.
    """
    arm = _Arm(robot, flange_from_tcp)
    result = np.empty_like(theta, dtype=float)
    for part in chunks(len(theta)):
        serial = np.ascontiguousarray(robot.serial_angles(theta[part]).T)
        torque, _ = arm.torques(*sine_cosine(serial), _components(wrench, part))
        result[part] = torque.T @ robot.load_matrix
    return result


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """The loaded robot: spring deflection (N, 6) [rad], TCP deviation in the base frame, position (N, 3) [m]."""

    deflection: Array
    position: Array


def equilibrium(
    robot: RobotModel, theta: Array, flange_from_tcp: Frame, wrench: Array, compliance: Array, rounds: int | None = None
) -> Equilibrium:
    """Deflection and TCP deviation under load, torque at equilibrium.

    theta (N, 6) [rad], wrench (N, 6) [N, N m], compliance (6,) [rad/(N m)]. rounds: stop after so many torque
    evaluations (1: the published one-step form, up to 3e-3 off); None: iterate to 1e-14 rad.
    Raises CompstiffError (CS1101) where the load is so large that the springs find no equilibrium.
    """
    arm = _Arm(robot, flange_from_tcp)
    load = robot.load_matrix
    identity = bool(np.array_equal(load, np.eye(6)))
    gain = compliance[:, None]
    deflection, position = np.empty((len(theta), 6)), np.empty((len(theta), 3))
    for part in chunks(len(theta)):
        serial = np.ascontiguousarray(robot.serial_angles(theta[part]).T)
        piece = _components(wrench, part)
        torque, unloaded = arm.torques(*sine_cosine(serial), piece)
        yielded = gain * (torque if identity else load.T @ torque)
        for _ in range(1, rounds or MAX_ROUNDS):
            torque, _tcp = arm.torques(*sine_cosine(serial + (yielded if identity else load @ yielded)), piece)
            previous, yielded = yielded, gain * (torque if identity else load.T @ torque)
            change = np.max(np.abs(yielded - previous), initial=0.0)
            if rounds is None and not change > TOLERANCE_RAD:
                break
        else:
            if rounds is None and change > 1e3 * TOLERANCE_RAD:
                raise error(
                    "CS1101", f"no equilibrium under this load after {MAX_ROUNDS} rounds: the joints still move "
                    f"by {change:.2g} rad", hint="check the units of forces [N], moments [N m] and stiffnesses")
        _, loaded = arm.lever_arms(*sine_cosine(serial + (yielded if identity else load @ yielded)))
        deflection[part] = yielded.T
        for axis in range(3):
            np.subtract(loaded[axis], unloaded[axis], out=position[part, axis])
    return Equilibrium(deflection, position)


def loaded_pose(
    robot: RobotModel, theta: Array, flange_from_tcp: Frame, wrench: Array, compliance: Array
) -> Frame:
    """base_from_tcp (N) of the robot that is commanded to `theta` and yields under `wrench`; arguments as `equilibrium`."""
    state = equilibrium(robot, theta, flange_from_tcp, wrench, compliance)
    return forward(robot, loaded_angles(robot, theta, state.deflection), flange_from_tcp)


def loaded_angles(robot: RobotModel, theta: Array, deflection: Array) -> Array:
    """Controller angles (N, 6) [rad] at which an unloaded robot stands where the loaded one is."""
    return np.asarray(theta + deflection @ (robot.uncoupling @ robot.load_matrix).T)


def deviation(
    robot: RobotModel, theta: Array, flange_from_tcp: Frame, wrench: Array, compliance: Array
) -> tuple[Array, Array]:
    """TCP deviation in the base frame: position (N, 3) [m] and rotation vector (N, 3) [rad], finite, at equilibrium."""
    loaded = loaded_pose(robot, theta, flange_from_tcp, wrench, compliance)
    planned = forward(robot, theta, flange_from_tcp)
    return loaded.position - planned.position, rotation_vector(loaded.rotation @ np.swapaxes(planned.rotation, 1, 2))


def signature(robot: RobotModel, theta: Array, flange_from_tcp: Frame, wrench: Array) -> Array:
    """A (N, 6, 6) of the first-order model `deviation = A c` (DESIGN.md, physics 3): column i is `J_i tau_i`.

    Rows: position [m per rad/(N m)], then rotation [rad per rad/(N m)].
    """
    columns = jacobian(robot, theta, flange_from_tcp)
    return np.asarray(columns * np.einsum("nri,nr->ni", columns, wrench)[:, None, :])


def compliance_matrix(robot: RobotModel, theta: Array, flange_from_tcp: Frame, compliance: Array) -> Array:
    """First-order Cartesian compliance `J diag(c) J^T` (N, 6, 6), symmetric and positive semidefinite (Maxwell-Betti)."""
    columns = jacobian(robot, theta, flange_from_tcp)
    return np.asarray(np.einsum("nri,i,nsi->nrs", columns, compliance, columns))


def sensitivity(
    robot: RobotModel, theta: Array, flange_from_tcp: Frame, wrench: Array, compliance: Array
) -> tuple[Array, Array]:
    """Deviation of the TCP's position (N, 3) [m] and its exact derivative by `c` (N, 3, 6) [m per rad/(N m)].

    Differentiating `dq = c * tau(dq)` gives `d dq / d c_i = (1 - diag(c) H)^-1 e_i tau_i` with the geometric stiffness
    `H = d tau / d q = L^T (d J~^T w / d theta~) L`, all at the loaded pose; then `d x / d c = J d dq / d c`.
    """
    state = equilibrium(robot, theta, flange_from_tcp, wrench, compliance)
    slope = np.empty((len(theta), 3, 6))
    loaded = loaded_angles(robot, theta, state.deflection)
    load = robot.load_matrix
    for part in chunks(len(theta)):
        frames = chain(robot, np.ascontiguousarray(robot.serial_angles(loaded[part]).T))
        arms = frames.origins[5] + np.einsum("ijn,j->in", frames.rotation, flange_from_tcp.position) - frames.origins
        force, moment = wrench[part, :3].T, wrench[part, 3:].T
        columns = np.cross(frames.axes, arms, axis=1)                               # [axis, component, pose]
        torque = np.einsum("icn,cn->in", columns, force) + np.einsum("icn,cn->in", frames.axes, moment)
        # d tau_j / d theta_i = F . (z_i x (z_j x r_j)) for i <= j, with i and j exchanged for i > j, plus M . (z_i x z_j)
        # for i < j: only the joints before j turn its axis.
        geometric = np.einsum("icjn,cn->ijn", np.cross(frames.axes[:, :, None], columns.transpose(1, 0, 2)[None],
                                                       axisa=1, axisb=1, axisc=1), force)
        lower = np.tril_indices(6, -1)
        geometric[lower] = geometric.transpose(1, 0, 2)[lower]
        turned = np.einsum("icjn,cn->ijn", np.cross(frames.axes[:, :, None], frames.axes.transpose(1, 0, 2)[None],
                                                    axisa=1, axisb=1, axisc=1), moment)
        turned[np.tril_indices(6)] = 0.0
        stiffening = np.einsum("jim,jkn,kl->nil", load[:, :, None], (geometric + turned).transpose(1, 0, 2), load)
        system = np.eye(6) - compliance[:, None] * stiffening
        moved = np.linalg.solve(system, np.eye(6) * (torque.T @ load)[:, None, :])
        slope[part] = np.einsum("icn,ij,njk->nck", columns, load, moved)
    return state.position, slope

"""The virtual cell against the package's plain model: the same robot, told by two codes that share nothing.

Decides which reading of the springs is right on a parallel-rod robot, and how much gravity matters.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from identification.measurements import read_measurements
from identification.model.cell import read_cell
from identification.model.compliance import deviation
from identification.model.kinematics import forward, jacobian
from identification.model.robot import RobotModel, read_robot
from identification.model.rotations import Frame
from tests.support import random_poses
from tests.virtual_cell.arm_model import DRIVES, Tool, compile_model, placed
from tests.virtual_cell.cell import simulate
from tests.virtual_cell.files import PRIOR, robot_yaml
from tests.virtual_cell.plant import Plant
from tests.virtual_cell.statics import State, statics

TOOL = Tool()
FLANGE_FROM_TCP = Frame(np.eye(3), np.array(TOOL.tcp))
STIFFNESS = np.array(PRIOR) * [0.8, 1.3, 0.6, 1.5, 0.7, 1.2]
FREE_FALL = 9.80665


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> RobotModel:
    path = tmp_path_factory.mktemp("robot") / "robot.yaml"
    path.write_text(robot_yaml())
    return read_robot(path)


def loads(rng: np.random.Generator, count: int, largest: float) -> np.ndarray:
    """Wrenches (count, 6) with random forces up to `largest` [N]."""
    force = rng.standard_normal((count, 3))
    force *= rng.uniform(0, largest, (count, 1)) / np.linalg.norm(force, axis=1, keepdims=True)
    return np.concatenate([force, np.zeros((count, 3))], axis=1)


def cell_deflection(theta: np.ndarray, wrench: np.ndarray, gravity: bool) -> np.ndarray:
    """Loaded minus unloaded TCP (N, 3) [m] of the virtual cell with nothing hidden."""
    plant = Plant(STIFFNESS, TOOL, gravity)
    result = []
    for q, w in zip(theta, wrench, strict=True):
        def at_rest(force: np.ndarray, q: np.ndarray = q) -> State:
            return plant.solver.solve(q, lambda torque: plant.compliance @ torque, force)
        result.append(at_rest(w[:3]).tcp - at_rest(np.zeros(3)).tcp)
    return np.array(result)


def test_both_codes_place_the_tool_alike(robot: RobotModel) -> None:
    theta = random_poses(robot, 40, np.random.default_rng(1))
    solver, pose = statics(TOOL), forward(robot, theta, FLANGE_FROM_TCP)
    for i, q in enumerate(theta):
        position, rotation = solver.tcp_pose(solver.place(q))
        np.testing.assert_allclose(position, pose.position[i], atol=1e-13)
        np.testing.assert_allclose(rotation, pose.rotation[i], atol=1e-13)


def test_springs_at_the_drives_agree_and_serial_springs_do_not(robot: RobotModel) -> None:
    rng = np.random.default_rng(2)
    theta, wrench = random_poses(robot, 100, rng), loads(rng, 100, 1000.0)
    truth = cell_deflection(theta, wrench, gravity=False)
    size = np.linalg.norm(truth, axis=1)
    drive, _ = deviation(robot, theta, FLANGE_FROM_TCP, wrench, 1 / STIFFNESS)
    serial, _ = deviation(replace(robot, load_path="serial"), theta, FLANGE_FROM_TCP, wrench, 1 / STIFFNESS)
    assert (np.linalg.norm(drive - truth, axis=1) <= np.maximum(1e-6 * size, 1e-8)).all()
    wrong = np.linalg.norm(serial - truth, axis=1) / size
    print(f"drive: {1e6 * np.abs(drive - truth).max():.1e} um at most; serial: {np.median(wrong):.1%} in the median, "
          f"{wrong.max():.0%} at most")
    assert np.median(wrong) > 0.03


def potential(robot: RobotModel, theta: np.ndarray) -> float:
    """Potential energy [N m] of the robot file's links and the tool at controller angles (6,), from the paper's eq. 1."""
    assert robot.link_mass is not None
    assert robot.link_centre is not None
    base_from_link, energy = np.eye(4), 0.0
    for i, angle in enumerate(robot.coupling @ theta + robot.offset):
        (ca, sa), (ct, st) = ((np.cos(x), np.sin(x)) for x in (robot.alpha[i], angle))
        base_from_link = base_from_link @ np.array([
            [ct, -st, 0, robot.a[i]], [ca * st, ca * ct, -sa, -sa * robot.d[i]], [sa * st, sa * ct, ca, ca * robot.d[i]],
            [0, 0, 0, 1]])
        energy += robot.link_mass[i] * FREE_FALL * (base_from_link @ [*robot.link_centre[i], 1])[2]
    return float(energy + TOOL.mass * FREE_FALL * (base_from_link @ [*TOOL.centre, 1])[2])


def gravity(robot: RobotModel, theta: np.ndarray) -> np.ndarray:
    """Gravity torques (6,) [N m] at the drives, by differences of the potential energy."""
    step = 1e-4 * np.eye(6)
    return np.array([potential(robot, theta - h) - potential(robot, theta + h) for h in step]) / 2e-4


def at_rest(robot: RobotModel, theta: np.ndarray, wrench: np.ndarray) -> np.ndarray:
    """TCP (3,) [m] of the plain model with gravity: `k dq = C^T J~^T w + g` at `theta + dq`."""
    yielded = np.zeros(6)
    for _ in range(12):
        loaded = theta + yielded
        yielded = (jacobian(robot, loaded[None], FLANGE_FROM_TCP)[0].T @ wrench + gravity(robot, loaded)) / STIFFNESS
    return forward(robot, (theta + yielded)[None], FLANGE_FROM_TCP).position[0]


def test_gravity_changes_deflections_by_what_the_plain_model_predicts(robot: RobotModel) -> None:
    rng = np.random.default_rng(3)
    theta, wrench = random_poses(robot, 15, rng), loads(rng, 15, 1000.0)
    truth = cell_deflection(theta, wrench, gravity=True)
    predicted = np.array([at_rest(robot, q, w) - at_rest(robot, q, 0 * w) for q, w in zip(theta, wrench, strict=True)])
    np.testing.assert_allclose(predicted, truth, atol=1e-8)
    plain, _ = deviation(robot, theta, FLANGE_FROM_TCP, wrench, 1 / STIFFNESS)
    share = np.linalg.norm(plain - truth, axis=1) / np.linalg.norm(truth, axis=1)
    print(f"without gravity the plain model is off by {np.median(share):.2%} in the median, {share.max():.2%} at most")
    assert 5e-4 < np.median(share) < 6e-3
    assert share.max() < 2e-2


def mujoco_at_rest(q: np.ndarray, forces: list[np.ndarray], constraint: str) -> list[np.ndarray]:
    """TCP [m] where MuJoCo's own dynamics, with its soft loop constraint and strong damping, come to rest."""
    closure = f'<equality><connect site1="rod_end" site2="lever" {constraint}/></equality>'
    model = compile_model(TOOL, rigid=True, extra=closure)
    data = mujoco.MjData(model)
    model.opt.timestep, model.opt.integrator = 1e-3, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    model.dof_damping[:] = 2e4
    for name, angle in placed(q).items():
        data.qpos[model.joint(name).qposadr[0]] = angle
    for name, angle, k in zip(DRIVES, q, STIFFNESS, strict=True):
        joint = model.joint(name)
        model.jnt_stiffness[joint.id], model.qpos_spring[joint.qposadr[0]] = k, angle
        model.dof_damping[joint.dofadr[0]] = 0.03 * k
    jacobian_tcp, found = np.zeros((3, model.nv)), []
    for force in forces:
        for _ in range(4000):
            mujoco.mj_jacSite(model, data, jacobian_tcp, None, model.site("tcp").id)
            data.qfrc_applied[:] = force @ jacobian_tcp
            mujoco.mj_step(model, data)
        assert np.abs(data.qvel).max() < 1e-7
        found.append(data.site("tcp").xpos.copy())
    return found


def test_error_of_mujocos_own_soft_constraint() -> None:
    """Left to itself MuJoCo's loop gives way by more than the gears; made stiff, its dynamics come to rest where we do."""
    q, force = np.radians([20, 30, 45, 40, 60, -30.0]), np.array([300.0, 200, -250])
    truth = cell_deflection(q[None], force[None], gravity=True)[0]
    unloaded, loaded = mujoco_at_rest(q, [np.zeros(3), force], "")
    default = np.linalg.norm(loaded - unloaded - truth)
    unloaded, loaded = mujoco_at_rest(q, [np.zeros(3), force], 'solref="0.004 1" solimp="0.9999 0.9999 0.001"')
    stiff = np.linalg.norm(loaded - unloaded - truth)
    print(f"MuJoCo's soft rod: {1e6 * default:.0f} um off with its default constraint, {1e6 * stiff:.2f} um with a stiff one")
    assert default > 0.1 * np.linalg.norm(truth)
    assert stiff < 0.2e-6


@pytest.mark.parametrize("design", ["paper5", "poses20", "ladder12"])
def test_written_files_are_what_the_package_reads(design: str, tmp_path: Path) -> None:
    case = simulate(5, design, validation=3)
    cell_path, measurements_path = case.write(tmp_path)
    cell = read_cell(cell_path)
    measured = read_measurements(measurements_path, cell.robot)
    assert len(measured.theta) == len(case.theta)
    np.testing.assert_allclose(measured.theta, case.theta, atol=1e-9)
    pose = forward(cell.robot, measured.theta, FLANGE_FROM_TCP)
    np.testing.assert_allclose(pose.position, case.tcp, atol=1e-8)

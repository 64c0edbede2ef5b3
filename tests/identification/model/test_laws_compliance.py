"""The compliance model: an independent simulation, and the laws it must obey."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from identification.common.findings import CompstiffError
from identification.model.compliance import (
    compliance_matrix,
    deviation,
    equilibrium,
    joint_torque,
    loaded_angles,
    regressor,
    sensitivity,
)
from identification.model.kinematics import forward
from identification.model.robot import built_in_robots, read_robot
from identification.model.rotations import Frame, rotation_matrix
from tests.support import random_poses, robot
from tests.virtual_cell.arm import ARMS

TOOL = Frame.from_quaternion([0.12, 0.02, 0.25], [0.9, 0.1, -0.3, 0.2])
STIFFNESS = np.array([1.1e6, 3.2e6, 1.5e6, 0.4e6, 0.25e6, 0.11e6])


def loads(count: int, rng: np.random.Generator, size: float = 1000.0) -> np.ndarray:
    return np.concatenate([rng.uniform(-size, size, (count, 3)), rng.uniform(-0.2 * size, 0.2 * size, (count, 3))], axis=1)


@pytest.fixture(params=["drive", "serial"])
def either(request, tmp_path):
    """The IRB 6660 with either load path."""
    text = built_in_robots()["irb6660-205-1.90"].read_text().replace("load_path: drive", f"load_path: {request.param}")
    (tmp_path / "robot.yaml").write_text(text)
    return read_robot(tmp_path / "robot.yaml")


@pytest.mark.parametrize("name", sorted(ARMS))
def test_deviation_agrees_with_the_independent_arm(name: str) -> None:
    rng = np.random.default_rng(1)
    model = robot(name)
    theta, wrench = random_poses(model, 6, rng), loads(6, rng)
    position, turned = deviation(model, theta, TOOL, wrench, 1 / STIFFNESS)
    for row in range(6):
        wanted, rotated = ARMS[name].deviation(theta[row], TOOL.position, wrench[row], STIFFNESS)
        assert_allclose(position[row], wanted, atol=1e-11, rtol=1e-7)
        assert_allclose(turned[row], rotated, atol=1e-11, rtol=1e-7)


def test_one_step_is_off_by_what_the_design_page_says() -> None:
    rng = np.random.default_rng(2)
    model = robot()
    theta, wrench = random_poses(model, 500, rng), loads(500, rng)
    exact = equilibrium(model, theta, TOOL, wrench, 1 / STIFFNESS).position
    one_step = equilibrium(model, theta, TOOL, wrench, 1 / STIFFNESS, rounds=1).position
    relative = np.linalg.norm(one_step - exact, axis=1) / np.linalg.norm(exact, axis=1)
    assert 1e-5 < np.median(relative) < np.max(relative) < 3e-2


@pytest.mark.parametrize("tilt_deg", [-35.0, 20.0, 90.0, 180.0])
def test_a_tilted_arm_yields_as_it_does_in_its_own_frame(either, tilt_deg: float) -> None:
    """A twist before joint 1, of any angle, turns the base: loads and deviations turn with it."""
    tilt = np.radians(tilt_deg)
    turn = np.array([[1, 0, 0], [0, np.cos(tilt), -np.sin(tilt)], [0, np.sin(tilt), np.cos(tilt)]])
    rng = np.random.default_rng(11)
    theta, wrench = random_poses(either, 20, rng), loads(20, rng)
    tilted = replace(either, alpha=either.alpha + tilt * np.eye(6)[0])
    both = np.kron(np.eye(2), turn)
    for found, wanted in zip(deviation(tilted, theta, TOOL, wrench @ both.T, 1 / STIFFNESS),
                             deviation(either, theta, TOOL, wrench, 1 / STIFFNESS), strict=True):
        assert_allclose(found, wanted @ turn.T, atol=1e-11, rtol=1e-9)


@pytest.mark.parametrize("joint", [1, 2, 3, 4, 5])
def test_an_axis_counted_the_other_way_round_is_the_same_arm(either, joint: int) -> None:
    """RotX(a) RotZ(q) TransZ(d) = RotX(a + 180) RotZ(-q) TransZ(-d) RotX(-180): twists of 180, and quarter turns either way."""
    k, one = joint - 1, np.eye(6)[joint - 1]
    turned = replace(either, alpha=either.alpha + np.pi * (one - np.eye(6)[k + 1]), d=either.d * (1 - 2 * one),
                     offset=either.offset * (1 - 2 * one), coupling=either.coupling * (1 - 2 * one)[:, None])
    rng = np.random.default_rng(12)
    theta, wrench = random_poses(either, 20, rng), loads(20, rng)
    assert_allclose(forward(turned, theta, TOOL).position, forward(either, theta, TOOL).position, atol=1e-12)
    # A spring at an axis yields to the torque about it, however that is counted.
    for found, wanted in zip(deviation(turned, theta, TOOL, wrench, 1 / STIFFNESS),
                             deviation(either, theta, TOOL, wrench, 1 / STIFFNESS), strict=True):
        assert_allclose(found, wanted, atol=1e-11, rtol=1e-9)


def test_first_order_compliance_is_symmetric_and_positive(either) -> None:
    theta = random_poses(either, 200, np.random.default_rng(3))
    matrix = compliance_matrix(either, theta, TOOL, 1 / STIFFNESS)
    scale = np.abs(matrix).max()
    assert_allclose(matrix, np.swapaxes(matrix, 1, 2), atol=1e-14 * scale)
    assert np.linalg.eigvalsh(matrix).min() > -1e-12 * scale


def test_small_loads_follow_the_first_order_form(either) -> None:
    rng = np.random.default_rng(4)
    theta, wrench = random_poses(either, 50, rng), loads(50, rng, 1e-3)
    linear = np.einsum("nij,nj->ni", compliance_matrix(either, theta, TOOL, 1 / STIFFNESS), wrench)
    by_regressor = regressor(either, theta, TOOL, wrench) @ (1 / STIFFNESS)
    position, turned = deviation(either, theta, TOOL, wrench, 1 / STIFFNESS)
    assert_allclose(by_regressor, linear, atol=1e-20, rtol=1e-9)
    # The deviation is a difference of poses of 2 m: exact to 1e-15 m, here 1e-6 of it.
    assert_allclose(position, linear[:, :3], atol=5e-15, rtol=1e-5)
    assert_allclose(turned, linear[:, 3:], atol=5e-15, rtol=1e-5)


def test_energy_law(either) -> None:
    """The load's work along a slowly growing force is the energy in the springs (the load path is conservative)."""
    rng = np.random.default_rng(5)
    theta = np.repeat(random_poses(either, 1, rng), 2001, axis=0)
    force = rng.uniform(-1000, 1000, 3)
    wrench = np.concatenate([np.linspace(0, 1, 2001)[:, None] * force, np.zeros((2001, 3))], axis=1)
    state = equilibrium(either, theta, TOOL, wrench, 1 / STIFFNESS)
    middle = 0.5 * (wrench[1:, :3] + wrench[:-1, :3])
    work = np.sum(middle * np.diff(state.position, axis=0))
    assert_allclose(work, 0.5 * np.sum(STIFFNESS * state.deflection[-1] ** 2), rtol=1e-6)


def test_the_load_path_matters_only_with_a_rod(either) -> None:
    rng = np.random.default_rng(6)
    drive = robot()
    theta, wrench = random_poses(drive, 100, rng), loads(100, rng)
    here = equilibrium(either, theta, TOOL, wrench, 1 / STIFFNESS).position
    there = equilibrium(drive, theta, TOOL, wrench, 1 / STIFFNESS).position
    difference = np.linalg.norm(here - there, axis=1) / np.linalg.norm(there, axis=1)
    assert (np.median(difference) > 0.02) == (either.load_path == "serial")


@pytest.mark.parametrize("either", ["serial"], indirect=True)
def test_torque_on_the_paper_s_reading_is_lever_times_force(either) -> None:
    """Paper eq. 4-5 by hand, about the serial axes, from the independent arm's points."""
    q = np.radians([0.0, 10, 20, 0, 60, 0])
    wrench = np.array([[100.0, 0, 0, 0, 0, 0]])
    torque = joint_torque(either, q[None], Frame.identity(), wrench)[0]
    arm = ARMS["irb6660-205-1.90"]
    tcp, _ = arm.pose(q, np.zeros(3))
    shoulder = np.array([0.3, 0, 0.8145])
    elbow = shoulder + 0.7 * np.array([np.sin(q[1]), 0, np.cos(q[1])])
    # Axes 2 and 3 point along base +y: a force along x turns about them with the height of the TCP over the axis.
    assert_allclose(torque[:3], [0, 100 * (tcp - shoulder)[2], 100 * (tcp - elbow)[2]], atol=1e-9)


def test_a_turned_base_changes_nothing(either) -> None:
    rng = np.random.default_rng(7)
    theta, wrench = random_poses(either, 20, rng), loads(20, rng)
    shifted = theta.copy()
    shifted[:, 0] += 0.3
    turn = rotation_matrix([0, 0, 0.3])
    turned = np.concatenate([wrench[:, :3] @ turn.T, wrench[:, 3:] @ turn.T], axis=1)
    here, there = (equilibrium(either, q, TOOL, w, 1 / STIFFNESS) for q, w in ((theta, wrench), (shifted, turned)))
    assert_allclose(there.deflection, here.deflection, atol=1e-15)
    assert_allclose(there.position, here.position @ turn.T, atol=1e-14)


def test_no_force_no_deviation(either) -> None:
    theta = random_poses(either, 10, np.random.default_rng(8))
    position, turned = deviation(either, theta, TOOL, np.zeros((10, 6)), 1 / STIFFNESS)
    assert not position.any()
    assert not turned.any()


def test_sensitivity_is_the_derivative_by_compliance(either) -> None:
    rng = np.random.default_rng(9)
    theta, wrench = random_poses(either, 30, rng), loads(30, rng)
    compliance = 1 / STIFFNESS
    _, slope = sensitivity(either, theta, TOOL, wrench, compliance)
    for i in range(6):
        step = np.zeros(6)
        step[i] = 1e-3 * compliance[i]
        ahead = equilibrium(either, theta, TOOL, wrench, compliance + step).position
        behind = equilibrium(either, theta, TOOL, wrench, compliance - step).position
        scale = np.abs(slope[:, :, i]).max()
        assert_allclose(slope[:, :, i], (ahead - behind) / (2 * step[i]), atol=2e-6 * scale)


def test_loaded_angles_stand_where_the_loaded_robot_stands(either) -> None:
    rng = np.random.default_rng(10)
    theta, wrench = random_poses(either, 30, rng), loads(30, rng)
    state = equilibrium(either, theta, TOOL, wrench, 1 / STIFFNESS)
    there = forward(either, loaded_angles(either, theta, state.deflection), TOOL).position
    assert_allclose(there - forward(either, theta, TOOL).position, state.position, atol=1e-14)


def test_batches_and_chunks_change_nothing(either) -> None:
    rng = np.random.default_rng(11)
    theta, wrench = random_poses(either, 5000, rng), loads(5000, rng)
    whole = equilibrium(either, theta, TOOL, wrench, 1 / STIFFNESS)
    some = slice(2040, 2060)
    part = equilibrium(either, theta[some], TOOL, wrench[some], 1 / STIFFNESS)
    assert_allclose(part.position, whole.position[some], atol=1e-15)


def test_absurd_loads_are_refused() -> None:
    theta = random_poses(robot(), 5, np.random.default_rng(12))
    with pytest.raises(CompstiffError, match=r"CS1101: no equilibrium under this load after \d+ rounds: the joints"):
        equilibrium(robot(), theta, TOOL, np.full((5, 6), 1e7), 1 / STIFFNESS)
    # Ten times what such a robot carries bends it by centimetres, and is one.
    heavy = np.concatenate([np.full((5, 3), 10e3), np.zeros((5, 3))], axis=1)
    state = equilibrium(robot(), theta, TOOL, heavy, 1 / STIFFNESS)
    assert np.isfinite(state.position).all()
    assert np.abs(state.position).max() > 0.01

"""Forward and inverse kinematics against an independent arm, another library, and their own inverse."""

import re

import numpy as np
import pytest
from numpy.testing import assert_allclose

from identification.common.findings import CompstiffError
from identification.model.inverse import (
    configuration,
    configured_solution,
    inverse,
    nearest_angles,
    nearest_solution,
    wrist_distance,
)
from identification.model.kinematics import forward, jacobian
from identification.model.robot import RobotModel, built_in_robots, read_robot
from identification.model.rotations import Frame, quaternion_to_matrix, rotation_matrix, rotation_vector
from tests.support import random_poses, robot
from tests.virtual_cell.arm import ARMS

TOOL = Frame.from_quaternion([0.12, -0.03, 0.25], [0.9, 0.1, -0.3, 0.2])


def test_zero_pose_is_the_documented_one() -> None:
    flange = forward(robot(), np.zeros((1, 6)), Frame.identity())
    assert_allclose(flange.position[0], [1.393, 0, 1.7945], atol=1e-15)
    assert_allclose(flange.rotation[0][:, 2], [1, 0, 0], atol=1e-15)      # flange z along base x
    assert_allclose(flange.rotation[0][:, 0], [0, 0, -1], atol=1e-15)     # flange x downwards


@pytest.mark.parametrize("name", sorted(ARMS))
def test_forward_agrees_with_the_independent_arm(name: str) -> None:
    theta = random_poses(robot(name), 50, np.random.default_rng(1))
    tcp = forward(robot(name), theta, TOOL)
    for q, position, rotation in zip(theta, tcp.position, tcp.rotation, strict=True):
        wanted, flange = ARMS[name].pose(q, TOOL.position)
        assert_allclose(position, wanted, atol=1e-14)
        assert_allclose(rotation, flange.as_matrix() @ TOOL.rotation, atol=1e-14)


@pytest.mark.parametrize("name", sorted(ARMS))
def test_jacobian_is_the_derivative_of_the_pose(name: str) -> None:
    model, step = robot(name), 1e-6
    theta = random_poses(model, 20, np.random.default_rng(2))
    columns = jacobian(model, theta, TOOL, "drive")
    for i in range(6):
        ahead, behind = theta.copy(), theta.copy()
        ahead[:, i] += step
        behind[:, i] -= step
        first, last = forward(model, ahead, TOOL), forward(model, behind, TOOL)
        assert_allclose(columns[:, :3, i], (first.position - last.position) / (2 * step), atol=1e-8)
        turned = rotation_vector(first.rotation @ np.swapaxes(last.rotation, 1, 2))
        assert_allclose(columns[:, 3:, i], turned / (2 * step), atol=1e-8)


@pytest.mark.parametrize("name", sorted(ARMS))
def test_inverse_returns_the_pose_on_every_branch(name: str) -> None:
    model = robot(name)
    flange = forward(model, random_poses(model, 30_000, np.random.default_rng(3)), Frame.identity())
    solutions = inverse(model, flange)
    assert solutions.reachable[:, 0].all()
    for branch in range(8):
        rows = solutions.reachable[:, branch]
        again = forward(model, solutions.theta[rows, branch], Frame.identity())
        assert np.max(np.abs(again.position - flange.position[rows])) < 1e-9
        assert np.max(np.abs(again.rotation - flange.rotation[rows])) < 1e-9


@pytest.mark.parametrize("name", sorted(ARMS))
def test_inverse_finds_the_joint_angles_again(name: str) -> None:
    model = robot(name)
    theta = random_poses(model, 30_000, np.random.default_rng(4))
    flange = forward(model, theta, Frame.identity())
    solutions = inverse(model, flange)
    # The pose shows an angle sharply except where branches meet: wrist in line, arm stretched or folded, wrist over axis 1.
    elbow = model.serial_angles(solutions.theta[:, 0])[:, 2] - model.serial_angles(solutions.theta[:, 2])[:, 2]
    outside = np.hypot(*(flange.position - model.d[5] * flange.rotation[:, :, 2]).T[:2]) > 1e-3
    sharp = (np.abs(np.sin(elbow / 2)) > 1e-3) & outside & (wrist_distance(model, theta) > 1e-3)
    assert sharp.mean() > 0.99
    nearest, branch = nearest_solution(model, solutions, theta)
    assert np.max(np.abs(nearest - theta)[sharp]) < 1e-9
    confdata = configuration(model, theta)
    assert np.array_equal(branch[sharp], confdata[sharp, 3])
    configured, found = configured_solution(model, solutions, confdata)
    assert found.all()
    assert np.max(np.abs(configured - theta)[sharp]) < 1e-9


def test_inverse_agrees_with_another_library() -> None:
    opw = pytest.importorskip("py_opw_kinematics")
    model = robot("irb6700-200-2.60")
    kinematics = opw.KinematicModel(a1=0.32, a2=-0.2, b=0, c1=0.78, c2=1.125, c3=1.1425, c4=0.2,
                                    offsets=(0, 0, -np.pi / 2, 0, 0, 0), flip_axes=(False,) * 6)
    other = opw.Robot(kinematics, degrees=False)
    theta = random_poses(model, 100, np.random.default_rng(5), share=0.6)
    flange = forward(model, theta, Frame.identity())
    ours = inverse(model, flange)
    for row, q in enumerate(theta):
        pose = other.forward(tuple(q))
        assert_allclose(pose.as_matrix()[:3, 3], flange.position[row], atol=1e-12)
        assert_allclose(pose.as_matrix()[:3, :3], flange.rotation[row], atol=1e-12)
        for theirs in other.inverse(pose):
            # Each of its solutions is one of our branches, up to whole turns.
            difference = np.angle(np.exp(1j * (ours.theta[row] - np.asarray(theirs))))
            assert np.abs(difference).max(axis=1).min() < 1e-6


def test_confdata_quadrants_are_the_rapid_manuals() -> None:
    degrees = [[10, 0, 0, 95, 30, -10], [-10, 0, 0, -95, 30, 200], [179, 0, 0, 271, -30, -350]]
    assert configuration(robot(), np.radians(degrees)).tolist() == [[0, 1, -1, 0], [-1, -2, 2, 0], [1, 3, -4, 1]]


def test_singular_wrist_keeps_the_reference() -> None:
    model = robot()
    theta = np.radians([[10.0, 20, 30, 40, 0, 50]])
    flange = forward(model, theta, Frame.identity())
    found, _ = nearest_solution(model, inverse(model, flange, theta), theta)
    assert_allclose(found, theta, atol=1e-12)


@pytest.mark.parametrize(("joint", "key", "value", "condition"), [
    (5, "alpha_deg", 89, "alpha of joints 2, 4, 5 and 6 must be +-90 degrees"),
    (3, "alpha_deg", 5, "alpha of joints 1 and 3 must be 0 or 180 degrees"),
    (5, "a_mm", 40, "a of joints 1, 5 and 6 must be zero"), (3, "d_mm", 40, "d of joints 2, 3 and 5 must be zero"),
    (3, "a_mm", 0, "the lower arm (a of joint 3) and the forearm must have a length"),
    (4, "a_mm", 0, ""), (2, "a_mm", 0, ""), (6, "d_mm", 0, ""), (3, "alpha_deg", 180, "")])
def test_other_arms_are_refused(tmp_path, joint, key, value, condition) -> None:
    """What the closed form needs; without an offset of the forearm, the shoulder or the flange, and mirrored, it is there."""
    lines = built_in_robots()["irb6640-235-2.55"].read_text().splitlines()
    row = [number for number, line in enumerate(lines) if "alpha_deg:" in line][joint - 1]
    lines[row] = re.sub(rf"\b{key}: [^,]*,", f"{key}: {value},", lines[row])
    path = tmp_path / "other.yaml"
    path.write_text("\n".join(lines) + "\n")
    model: RobotModel = read_robot(path)
    theta = np.radians([[10.0, 20, -30, 40, 50, 60]])
    flange = forward(model, theta, Frame.identity())
    if not condition:
        assert_allclose(nearest_solution(model, inverse(model, flange, theta), theta)[0], theta, atol=1e-9)
        return
    with pytest.raises(CompstiffError) as refused:
        inverse(model, flange)
    (said,) = refused.value.findings
    assert (said.code, said.file) == ("CS1102", str(path))
    assert said.message == f"no inverse kinematics for robot irb6640-235-2.55: {condition}"


def test_rotations_round_trip() -> None:
    rng = np.random.default_rng(6)
    vectors = rng.normal(size=(1000, 3))
    vectors *= (rng.uniform(0, np.pi - 1e-6, 1000) / np.linalg.norm(vectors, axis=1))[:, None]
    vectors[:300] *= 1e-9
    matrices = rotation_matrix(vectors)
    assert_allclose(rotation_vector(matrices), vectors, rtol=1e-7, atol=1e-16)
    assert_allclose(quaternion_to_matrix(Frame(matrices, np.zeros(3)).quaternion), matrices, atol=1e-14)


@pytest.mark.parametrize("name", sorted(ARMS))
@pytest.mark.parametrize("step", [
    0.0, pytest.param(1e-6, marks=pytest.mark.long), 1e-3, pytest.param(0.3, marks=pytest.mark.long), 3.0])
def test_nearest_angles_are_the_nearest_of_all_branches(name: str, step: float) -> None:
    """The short way, one branch alone, never misses a nearer one: at stretched arms, wrists in line and far references too."""
    model, rng = robot(name), np.random.default_rng(7)
    theta = random_poses(model, 20_000, rng)
    theta[:4000, 4] *= 10.0 ** rng.uniform(-12, 0, 4000)                          # towards the wrist in line
    upright = -np.arctan2(-np.sin(model.alpha[3]) * model.d[3], model.a[3])       # serial angle 3 of a stretched arm
    stretched = (upright - model.offset[2] - model.coupling[2, 1] * theta[4000:8000, 1]) / model.coupling[2, 2]
    theta[4000:8000, 2] = stretched + 10.0 ** rng.uniform(-9, 0, 4000) * rng.choice([-1, 1], 4000)
    flange = forward(model, theta, Frame.identity())
    reference = theta + step * rng.uniform(-1, 1, theta.shape)
    reference[::1000] = np.nan
    every, _ = nearest_solution(model, inverse(model, flange, reference), reference)
    assert_allclose(nearest_angles(model, flange, reference), every, atol=1e-12, rtol=0)


@pytest.mark.parametrize("nothing", [0.0, -0.0])
@pytest.mark.parametrize("name", sorted(ARMS))
def test_a_wrist_above_axis_1_is_found_among_other_poses(name: str, nothing: float) -> None:
    """By every branch that reaches it, also those that have it behind axis 1; the poses beside it are solved as they are
    alone."""
    model = robot(name)
    others = forward(model, random_poses(model, 3, np.random.default_rng(5)), Frame.identity())
    height = model.d[0] + np.hypot(model.a[2], np.hypot(model.a[3], model.d[3]))
    above = Frame(np.eye(3), np.array([nothing, 0.0, height + abs(model.d[5])]))
    poses = Frame(np.concatenate([others.rotation[:2], above.rotation[None], others.rotation[2:]]),
                  np.concatenate([others.position[:2], above.position[None], others.position[2:]]))
    found = inverse(model, poses)
    assert np.isfinite(found.theta).all()
    for row in range(4):
        alone = inverse(model, poses[[row]])
        assert_allclose(found.theta[row], alone.theta[0], rtol=0, atol=1e-12)
        assert found.reachable[row].tolist() == alone.reachable[0].tolist()
    assert found.reachable[2].any()
    for theta in found.theta[2][found.reachable[2]]:
        again = forward(model, theta[None], Frame.identity())
        assert_allclose(again.position[0], poses.position[2], atol=1e-12)
        assert_allclose(again.rotation[0], np.eye(3), atol=1e-12)

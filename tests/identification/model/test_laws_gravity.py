"""A robot's own weight: its torques are the slope of a potential, and what it adds under load is what the balance says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from identification.model.compliance import displacement, equilibrium
from identification.model.gravity import FREE_FALL, fall_in_base, gravity_torque, sagged_angles
from identification.model.kinematics import forward, jacobian
from identification.model.load_state import load_state
from identification.model.robot import RobotModel
from identification.model.rotations import Frame
from tests.support import random_poses, robot

MASS = np.array([600.0, 420, 310, 110, 45, 25])
CENTRE = np.random.default_rng(8).uniform(-0.3, 0.4, (6, 3))
FALL = np.array([1.5, -2.0, -9.4])
SOFT = 1 / np.array([1.6e6, 2.1e6, 1.5e6, 0.5e6, 0.2e6, 0.08e6])
TOOL = Frame.from_quaternion([0.12, -0.03, 0.25], [0.9, 0.1, -0.3, 0.2])


@pytest.fixture(scope="module", params=[("irb6660-205-1.90", "drive"), ("irb6660-205-1.90", "serial"),
                                        ("irb6700-200-2.60", "drive")])
def heavy(request) -> RobotModel:
    name, path = request.param
    return replace(robot(name), link_mass=MASS, link_centre=CENTRE, load_path=path)


def potential(arm: RobotModel, serial: np.ndarray, mass: float, centre: np.ndarray) -> float:
    """Work [J] that gravity has done, body by body, through frames multiplied out."""
    turn, place, work = np.eye(3), np.zeros(3), 0.0
    for i in range(6):
        place = place + turn @ Rotation.from_rotvec([arm.alpha[i], 0, 0]).apply([arm.a[i], 0, 0])
        turn = turn @ (Rotation.from_rotvec([arm.alpha[i], 0, 0]) * Rotation.from_rotvec([0, 0, serial[i]])).as_matrix()
        place = place + turn @ [0, 0, arm.d[i]]
        work += MASS[i] * FALL @ (place + turn @ CENTRE[i])
    return work + mass * FALL @ (place + turn @ centre)


@pytest.mark.parametrize(("mass", "centre"), [(None, None), (80.0, None), (80.0, np.array([0.05, -0.1, 0.3]))])
def test_the_torque_of_gravity_is_the_slope_of_its_work(heavy, mass, centre) -> None:
    """By the springs' own angles; a tool of which no centre is stated weighs at the flange."""
    theta, step = random_poses(heavy, 3, np.random.default_rng(2)), 1e-5
    found = gravity_torque(heavy, theta, FALL, mass, centre)
    for row, serial in zip(found, heavy.serial_angles(theta), strict=True):
        by_hand = [np.subtract(*(potential(heavy, serial + way * step * heavy.load_matrix[:, spring], mass or 0.0,
                                           np.zeros(3) if centre is None else centre) for way in (1, -1))) / (2 * step)
                   for spring in range(6)]
        assert_allclose(row, by_hand, atol=1e-4)


def test_a_robot_of_no_stated_weight_has_no_torques_and_sags_not() -> None:
    arm = robot("irb6700-200-2.60")
    light, theta = replace(arm, link_mass=None, link_centre=None), random_poses(arm, 2, np.random.default_rng(2))
    assert (gravity_torque(light, theta, FALL, 80.0) == np.zeros((2, 6))).all()
    assert sagged_angles(light, theta, SOFT, FALL, 80.0) is theta


def test_a_robot_sags_until_its_springs_carry_it(heavy) -> None:
    """To a millionth of the sag; with the torque at hand too."""
    theta = random_poses(heavy, 4, np.random.default_rng(3), 0.8)
    sagged = sagged_angles(heavy, theta, SOFT, FALL, 80.0, CENTRE[0])
    springs = SOFT * gravity_torque(heavy, sagged, FALL, 80.0, CENTRE[0])
    assert_allclose(heavy.serial_angles(sagged), heavy.serial_angles(theta) + springs @ heavy.load_matrix.T,
                    rtol=0, atol=1e-6 * np.abs(springs).max())
    at_hand = gravity_torque(heavy, theta, FALL, 80.0, CENTRE[0])
    assert_allclose(sagged_angles(heavy, theta, SOFT, FALL, 80.0, CENTRE[0], at_hand), sagged, atol=1e-15)


@pytest.mark.parametrize(("turned", "fall"), [
    ([0, 0, 0], [0, 0, -1]), ([np.pi, 0, 0], [0, 0, 1]), ([0, np.pi / 2, 0], [1, 0, 0]), ([np.pi / 2, 0, 0], [0, -1, 0])])
def test_things_fall_down_whatever_way_the_base_hangs(turned, fall) -> None:
    frame = Frame(Rotation.from_rotvec(turned).as_matrix(), np.ones(3))
    assert_allclose(fall_in_base(frame), 9.80665 * np.array(fall), atol=1e-12)
    assert FREE_FALL == 9.80665


def balance(arm: RobotModel, theta: np.ndarray, wrench: np.ndarray, before: np.ndarray) -> np.ndarray:
    """Spring deflections (n, 6) [rad] under the wrench and the weight, of which the springs carried `before` at theta."""
    yielded = np.zeros_like(theta)
    for _ in range(30):
        loaded = theta + yielded @ (arm.uncoupling @ arm.load_matrix).T
        torque = np.einsum("nri,nr->ni", jacobian(arm, loaded, TOOL), wrench)
        yielded = SOFT * (torque + gravity_torque(arm, loaded, FALL, 80.0, CENTRE[0]) - before)
    return yielded


def test_the_weight_adds_to_a_load_s_deflection_what_the_balance_of_both_says(heavy) -> None:
    """At the pose in which the robot hangs already: the load moves the weight, and that turns the springs once more."""
    rng = np.random.default_rng(4)
    theta = random_poses(heavy, 5, rng, 0.8)
    wrench = rng.uniform(-2000, 2000, (5, 6)) * [1, 1, 1, 0.1, 0.1, 0.1]
    rows = load_state(heavy, TOOL, theta, wrench, SOFT, fall=FALL, tool_mass=80.0, tool_centre=CENTRE[0])
    yielded = balance(heavy, theta, wrench, rows.gravity)
    planned, link = forward(heavy, theta, TOOL), (heavy.uncoupling @ heavy.load_matrix).T
    with_weight = np.hstack(displacement(forward(heavy, theta + yielded @ link, TOOL), planned))
    plain = equilibrium(heavy, theta, TOOL, wrench, SOFT)
    without = np.hstack(displacement(forward(heavy, theta + plain.deflection @ link, TOOL), planned))
    share = with_weight - without
    assert np.abs(share[:, :3]).max() > 1e-6
    for part in (slice(0, 3), slice(3, 6)):
        assert_allclose(rows.of_weight[:, part], share[:, part], atol=0.03 * np.abs(share[:, part]).max())
    assert not rows.of_sag.any()


def test_along_a_toolpath_the_load_acts_where_the_weight_has_brought_the_robot(heavy) -> None:
    """The planned pose is the one without weight: what the robot yields there less what it would have without any."""
    rng = np.random.default_rng(5)
    theta = random_poses(heavy, 5, rng, 0.8)
    wrench = rng.uniform(-2000, 2000, (5, 6)) * [1, 1, 1, 0.1, 0.1, 0.1]
    named = {"fall": FALL, "tool_mass": 80.0, "tool_centre": CENTRE[0], "at_load": True}
    rows = load_state(heavy, TOOL, theta, wrench, SOFT, **named)

    def yields(at: np.ndarray) -> np.ndarray:
        columns = jacobian(heavy, at, TOOL)
        return np.einsum("nri,i,nsi,ns->nr", columns, SOFT, columns, wrench)

    here = jacobian(heavy, theta, TOOL)
    sagged = sagged_angles(heavy, theta, SOFT, FALL, 80.0, CENTRE[0])
    assert_allclose(rows.elastic, yields(theta), rtol=1e-9, atol=1e-15)
    there = jacobian(heavy, sagged, TOOL)
    assert_allclose(rows.of_sag, np.einsum("nri,i,nsi,ns->nr", here, SOFT, there, wrench) - yields(theta), atol=1e-12)
    before = theta - (SOFT * np.einsum("nri,nr->ni", here, wrench)) @ (heavy.uncoupling @ heavy.load_matrix).T
    change = gravity_torque(heavy, theta, FALL, 80.0, CENTRE[0]) - gravity_torque(heavy, before, FALL, 80.0, CENTRE[0])
    assert_allclose(rows.of_sag + rows.of_weight,
                    yields(sagged) - yields(theta) + np.einsum("nri,ni->nr", here, SOFT * change), atol=1e-12)

"""Laws against answers of their own: creep by superposed steps, a stiffening gear by the roots of its cubic, play that friction
holds by a walk through the loads."""

from __future__ import annotations

import itertools
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from identification.model.effects import effects
from identification.model.effects_in_force import EffectInForce
from identification.model.law_of import LawOf, known
from identification.model.load_state import LoadState, load_state
from identification.model.rotations import Frame, rotation_vector
from identification.model.stiffness import IdentifiedModel
from tests.support import random_poses, robot

TOOL = Frame(np.eye(3), np.array([0.1, 0.0, 0.2]))
RATIO, T0 = 0.02, 3.0


def cycle(pause: float) -> LoadState:
    """Two visits of one pose: loads up and back, each held for a while, `pause` seconds of the load before between them."""
    arm, rng = robot(), np.random.default_rng(4)
    held = np.array([6.0, 20.0, 11.0, 40.0, 5.0] * 2)
    force = np.zeros((10, 6))
    force[:, 1] = [100, 300, 0, -200, 0] * 2
    rows = load_state(arm, TOOL, np.repeat(random_poses(arm, 2, rng, 0.6), 5, axis=0), force, np.full(6, 1e-6), dwell=held)
    time = np.cumsum(held + pause) + 300.0 * np.repeat([0, 1], 5)
    return replace(rows, visit=np.repeat(np.array([0, 1]), 5), time=time)


@pytest.mark.parametrize("pause", [0.0, 4.0])
def test_creep_is_the_sum_of_its_steps(pause: float) -> None:
    """Each change of the load creeps on from when it came, each visit from rest."""
    rows = cycle(pause)
    twist = rows.compliance * rows.torque
    expected = np.zeros((10, 6))
    for n in range(10):
        first = 5 * (n // 5)
        for k in range(first, n + 1):
            step = twist[k] - (twist[k - 1] if k > first else 0.0)
            age = rows.time[n] - (rows.time[k] - rows.dwell[k])
            expected[n] += RATIO * np.log1p(age / T0) * (rows.jacobian[n] @ step)
    creep = effects()["creep"].contribution(rows, None, np.array([RATIO, T0, 1.0]))
    assert_allclose(creep, expected, atol=0.004 * np.abs(expected).max())


def test_creep_without_memory_counts_each_load_by_itself() -> None:
    rows = cycle(0.0)
    plain = np.einsum("nri,ni->nr", rows.jacobian, rows.compliance * rows.torque)
    creep = effects()["creep"].contribution(rows, None, np.array([RATIO, T0, 0.0]))
    assert_allclose(creep, RATIO * np.log1p(rows.dwell / T0)[:, None] * plain, atol=1e-15)
    half = effects()["creep"].contribution(rows, None, np.array([RATIO, T0, 0.5]))
    whole = effects()["creep"].contribution(rows, None, np.array([RATIO, T0, 1.0]))
    assert_allclose(half, (creep + whole) / 2, atol=1e-15)


@pytest.mark.parametrize("joint", [2, 5])
def test_a_cubic_gear_is_the_root_of_its_cubic(joint: int) -> None:
    """All of it: the spring x + x^3 / (T c)^2 = c torque, preloaded by the arm's weight."""
    arm, rng = robot("irb6660-205-1.90"), np.random.default_rng(5)
    heavy = replace(arm, link_mass=np.array([500, 400, 300, 100, 40, 20.0]), link_centre=np.full((6, 3), 0.2))
    force = np.concatenate([rng.uniform(-400, 400, (8, 3)), np.zeros((8, 3))], axis=1)
    rows = load_state(heavy, TOOL, random_poses(arm, 8, rng, 0.6), force, np.full(6, 1e-6))
    i, c, torque = joint - 1, 1e-6, 300.0
    assert np.abs(rows.gravity[:, i]).max() > 20

    def spring(load: float) -> float:
        roots = np.roots([1 / (torque * c) ** 2, 0.0, 1.0, -c * load])
        return float(roots[np.argmin(np.abs(roots.imag))].real)

    law = known("soft_zone.cubic")
    assert law is not None
    moved = law.contribution(rows, joint, np.array([1.0, torque]))
    for n in range(8):
        g, tau = rows.gravity[n, i], rows.torque[n, i]
        assert_allclose(moved[n], rows.jacobian[n, :, i] * (spring(g + tau) - spring(g) - c * tau), rtol=1e-7, atol=1e-15)
    assert_allclose(law.contribution(rows, joint, np.array([0.4, torque])), 0.4 * moved, rtol=1e-12)
    # The same under a weight that nobody stated, and that is searched.
    where, hung = ("arm", rows.hung_on_forearm) if joint < 4 else ("wrist", rows.hung_on_flange)
    under = known(f"soft_zone.cubic_{where}")
    assert under is not None
    assert under.missing(rows)
    light = replace(rows, robot=arm)
    assert not under.missing(light)
    if joint in under.joints:
        moved = under.contribution(light, joint, np.array([1.0, torque, 700.0]))
        for n in range(8):
            g, tau = 700.0 * hung[n, i], rows.torque[n, i]
            assert_allclose(moved[n], rows.jacobian[n, :, i] * (spring(g + tau) - spring(g) - c * tau), rtol=1e-6, atol=1e-15)


def test_held_play_stays_where_it_was_pressed() -> None:
    """Walked through load by load: under 2 N m the teeth keep a share of their last side, from the middle at each visit."""
    rows = cycle(0.0)
    side, expected = 0.0, []
    for n, torque in enumerate(rows.torque[:, 0]):
        if n in (0, 5):
            side = 0.0
        side = float(np.sign(torque)) if abs(torque) > 2.0 else side
        expected.append(3e-5 * (side if abs(torque) > 2.0 else 0.6 * side) * rows.jacobian[n, :, 0])
    assert abs(rows.torque[:, 0]).max() > 50
    law = known("backlash.held")
    assert law is not None
    assert_allclose(law.contribution(rows, 1, np.array([3e-5, 0.6])), expected, atol=1e-15)
    plain = effects()["backlash"].contribution(rows, 1, np.array([3e-5]))
    assert_allclose(law.contribution(rows, 1, np.array([3e-5, 0.0])), plain, atol=1e-15)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_an_error_of_the_force_decides_on_which_side_teeth_stand_that_little_torque_presses(side: float) -> None:
    """Up to 2 N m, or to what a force leads to that points elsewhere by 0.03 rad, half a metre beside the axis: 6 N m of 400 N.
    Where nothing pulls the way to the pose left them anywhere, and no reading without a load is told by the load's error. A
    weight that was searched is off by a tenth."""
    force = np.array([[0.0, 240.0, -320.0], [0, 240, -320], [100, 0, 0], [100, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0]])
    wrench, jacobian = np.zeros((7, 6)), np.full((7, 6, 6), 9.0)
    wrench[:, :3], wrench[[1, 5], 4] = force, 300.0
    jacobian[:, :3, 2] = [0.3, 0.0, -0.4]
    together = side * np.array([5.9, 6.1, 1.9, 2.1, 1.9, 1.9, 2.1])
    gravity, hung = np.full((7, 6), 50.0), np.full((7, 6), 9.0)
    gravity[:, 2], hung[:, 2] = 40.0, 0.25
    torque = np.full((7, 6), 50.0)
    torque[:, 2] = together - 40.0
    rows: Any = SimpleNamespace(wrench=wrench, jacobian=jacobian, gravity=gravity, torque=torque, hung_on_forearm=hung)
    known_weight, arm = effects()["backlash"], known("backlash.arm")
    assert arm is not None
    loose = [True, False, True, False, True, True, False]
    assert known_weight.undecided(rows, 3).tolist() == [True, False, True, False, False, True, False]
    assert known_weight.loose(rows, 3, np.array([5e-5])).tolist() == loose
    assert known_weight.side(rows, 3, np.array([5e-5])).tolist() == [side, side, 0, side, 0, 0, side]
    # 160 of a quarter of a metre: the same 40 N m, known to 4.
    torque[:, 2] = side * (np.abs(together) + 4.0) - 40.0
    assert arm.loose(rows, 3, np.array([5e-5, 160.0])).tolist() == loose
    torque[:, 2] += 80.0
    gravity[:, 2] = -40.0
    assert arm.loose(rows, 3, np.array([5e-5, -160.0])).tolist() == loose
    torque[:, 2] = together + 40.0
    assert known_weight.loose(rows, 3, np.array([5e-5])).tolist() == loose


@pytest.mark.parametrize("end", [-1.0, 1.0])
def test_play_that_the_way_to_a_pose_left_at_one_end_is_off_once_it_is_crossed(end: float) -> None:
    """Walked load by load with the teeth at one end at first, against the unloaded reading taken there: all that differs from
    teeth in the middle is half a gap the other way, from the load on that first presses them."""
    rows = cycle(0.0)
    wanted = np.zeros((10, 6))
    for visit in (0, 5):
        begun, middle, crossed = end, 0.0, False
        for n in range(visit, visit + 5):
            torque = rows.torque[n, 0]
            if abs(torque) > 2.0:
                begun, middle, crossed = np.sign(torque), np.sign(torque), True
            assert crossed or n == visit
            wanted[n] = 3e-5 * ((begun - end) - middle) * rows.jacobian[n, :, 0]
    law = known("backlash.held")
    assert law is not None
    assert_allclose(end * law.of_each_visit(rows, 1, np.array([3e-5, 1.0]))[:, :, 0], wanted, atol=1e-15)
    # A weight that presses the teeth to one side leaves nothing open.
    heavy = replace(rows.robot, link_mass=np.full(6, 200.0), link_centre=np.full((6, 3), 0.2))
    pressed = replace(rows, robot=heavy, fall=np.array([9.0, -9.0, 0.0]))
    assert np.abs(pressed.gravity[:, 0]).min() > 50
    assert not law.of_each_visit(pressed, 1, np.array([3e-5, 1.0])).any()


def test_what_real_laws_may_add_is_a_share_of_what_the_effects_add() -> None:
    """Without any other uncertainty: 5 % of the size of each effect's own displacement, alike in every direction."""
    arm, rng = robot(), np.random.default_rng(6)
    tilt = EffectInForce(effects()["bearing_tilt"], 3)
    mean = np.concatenate([np.log(np.full(6, 1e-6)), [4e-7]])
    model = IdentifiedModel(arm, TOOL, mean, np.zeros((7, 7)), effects=(tilt,), unknown_weight=0.0)
    theta = random_poses(arm, 5, rng, 0.6)
    wrench = np.concatenate([rng.uniform(-300, 300, (5, 3)), np.zeros((5, 3))], axis=1)
    _, _, covariance = model.predict(theta, wrench)
    alone = tilt.contribution(model.load_state(theta, wrench, TOOL), np.array([4e-7]))
    expected = 0.05**2 * np.repeat((alone**2).reshape(5, 2, 3).sum(axis=2) / 3, 3, axis=1)
    assert_allclose(np.diagonal(covariance, axis1=1, axis2=2), expected, rtol=1e-9)
    assert not replace(model, unknown_law=0.0).predict(theta, wrench)[2].any()


def test_a_ball_met_beside_its_pole_leans_as_a_turned_sensor() -> None:
    """By the circle itself: how fast its depth changes 0.2 mm beside the pole, of a ball of 8 mm."""
    radius, step = 0.008, 1e-7
    depth = radius - np.sqrt(radius**2 - (2e-4 + np.array([-step, step])) ** 2)
    brought = effects()["target_curvature"].brings(np.array([20.0, -1 / radius, 50.0]))
    assert set(brought) == {"deflection_sensor_rotation", "deflection_sensor_crosstalk"}
    assert_allclose(list(brought.values()), [np.diff(depth)[0] / (2 * step)] * 2, rtol=1e-3)
    assert not effects()["deflection_sensor_rotation"].brings(np.ones(3))


def test_what_differs_from_pose_to_pose_moves_the_tool_as_other_forces_would() -> None:
    """The scatter of the equilibrium under forces that are off by a share of their size, in any direction, drawn."""
    arm, rng = robot(), np.random.default_rng(8)
    mean = np.log(np.array([6e-7, 3e-7, 5e-7, 2e-6, 3e-6, 5e-6]))
    model = IdentifiedModel(arm, TOOL, mean, np.zeros((6, 6)), unknown_weight=0.0, differs=0.01)
    theta, force = random_poses(arm, 1, rng, 0.6), rng.uniform(-300, 300, 3)
    drawn = force + 0.01 * np.linalg.norm(force) * rng.standard_normal((20000, 3))
    wrench = np.concatenate([drawn, np.zeros_like(drawn)], axis=1)
    place = model.loaded_pose(np.repeat(theta, len(wrench), axis=0), wrench, TOOL)
    turned = rotation_vector(place.rotation @ place.rotation[0].T)
    expected = np.cov(np.concatenate([place.position, turned], axis=1).T)
    _, _, covariance = model.predict(theta, np.concatenate([force, np.zeros(3)])[None])
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    assert_allclose(covariance[0] / scale, expected / scale, atol=0.04)
    assert not replace(model, differs=0.0).predict(theta, wrench[:1])[2].any()


def test_a_column_s_bearing_turns_the_tool_about_where_it_is() -> None:
    """A point of the axis that far down from the shoulder stays, and the rotation is the moment about it, level."""
    arm, rng = robot(), np.random.default_rng(7)
    wrench = np.concatenate([rng.uniform(-300, 300, (4, 3)), np.zeros((4, 3))], axis=1)
    rows = load_state(arm, TOOL, random_poses(arm, 4, rng, 0.6), wrench, np.full(6, 1e-6))
    law = known("bearing_tilt.along")
    assert law is not None
    moved = law.contribution(rows, 1, np.array([1e-7, 0.3]))
    height = rows.origins[0, 0, 2]
    assert height > 0.3
    arms = rows.tcp - np.array([0.0, 0.0, 0.7 * height])
    rotation = 1e-7 * np.cross(arms, wrench[:, :3]) * [1.0, 1.0, 0.0]
    assert_allclose(moved[:, 3:], rotation, atol=1e-15)
    assert_allclose(moved[:, :3], np.cross(rotation, arms), atol=1e-15)
    each = known("bearing_tilt.each")
    assert each is not None
    # Across the column's own axes, which turn with joint 1.
    turn, back = Rotation.from_euler("z", rows.loaded[:, :1]), Rotation.from_euler("z", -rows.loaded[:, :1])
    assert_allclose(each.contribution(rows, 1, np.array([1e-7, 4e-8, 0.3]))[:, 3:],
                    turn.apply(back.apply(rotation) * [1.0, 0.4, 1.0]), atol=1e-15)


def test_a_structure_stiffens_along_the_arm_across_it_and_upright() -> None:
    """Alike everywhere and along: what of the linear law lies in the arm's plane, level; the three together are the law."""
    arm, rng = robot(), np.random.default_rng(8)
    theta = random_poses(arm, 6, rng, 0.6)
    wrench = np.concatenate([rng.uniform(-300, 300, (6, 3)), np.zeros((6, 3))], axis=1)
    rows = replace(load_state(arm, TOOL, theta, wrench, np.full(6, 1e-6)), at_load=True)
    law, rocking = known("law_of_base_rocking"), effects()["base_rocking"]
    assert law is not None
    linear = rocking.contribution(rows, None, rocking.typical(rows, None))[:, :3]

    def by(*places: int) -> np.ndarray:
        return law.contribution(rows, None, np.isin(np.arange(18), places).astype(float))[:, :3]

    plane = np.column_stack([np.cos(theta[:, 0]), np.sin(theta[:, 0]), np.zeros(6)])
    assert_allclose(by(0), plane * np.sum(plane * linear, axis=1)[:, None], atol=1e-15)
    assert_allclose(by(0, 6, 12), linear, atol=1e-15)
    assert_allclose(by(1, 7, 13), linear * np.sin(theta[:, 1])[:, None], atol=1e-15)
    assert_allclose(by(2, 8, 14), linear * np.cos(theta[:, 1])[:, None], atol=1e-15)
    assert_allclose(by(3, 9, 15), linear * np.sin(theta[:, 2])[:, None], atol=1e-15)
    assert_allclose(by(4, 10, 16), linear * np.cos(theta[:, 2])[:, None], atol=1e-15)
    assert_allclose(by(5, 11, 17), linear * np.linalg.norm(wrench[:, :3], axis=1)[:, None] / 300, atol=1e-15)


def test_a_force_sensor_of_struts_yields_in_its_ways_and_no_others() -> None:
    """Six struts in rows of three, any heights and radii: the tilt, its three further ways and joint 6's own twist give all
    that such a sensor does to the tool; the tilt and the twist alone do not."""
    arm, rng = robot(), np.random.default_rng(9)
    theta = random_poses(arm, 8, rng, 0.6)
    wrench = np.concatenate([rng.uniform(-300, 300, (8, 3)), np.zeros((8, 3))], axis=1)
    rows = load_state(arm, TOOL, theta, wrench, np.full(6, 1e-6))
    sensor = effects()["force_sensor_compliance"]
    law = LawOf(sensor)
    for low, high, height in ((0.06, 0.05, 0.05), (0.05, 0.09, 0.12)):
        below, above = (radius * np.column_stack([np.cos(turn), np.sin(turn), 0 * turn]) for radius, turn in (
            (low, np.radians([0, 120, 120, 240, 240, 360])), (high, np.radians([60, 60, 180, 180, 300, 300]))))
        above[:, 2] = height
        along = (above - below) / np.linalg.norm(above - below, axis=1, keepdims=True)
        struts = np.concatenate([along, np.cross(above, along)], axis=1)
        compliance = np.linalg.inv(struts.T @ struts)       # of the upper plate, at the flange, in its frame
        moved = np.empty((8, 3))
        for k, (flange, lever) in enumerate(zip(rows.flange, rows.tcp - rows.origins[:, 5], strict=True)):
            force, moment = flange.T @ wrench[k, :3], flange.T @ np.cross(lever, wrench[k, :3])
            slide, turn = np.split(compliance @ np.concatenate([force, moment]), 2)
            moved[k] = flange @ slide + np.cross(flange @ turn, lever)
        twist = rows.jacobian[:, :3, 5] * rows.torque[:, 5, None]
        tilt = sensor.contribution(rows, None, np.array([3e-6]))[:, :3]

        def left(*columns: np.ndarray, moved: np.ndarray = moved) -> float:
            columns = np.column_stack([column.ravel() / np.linalg.norm(column) for column in columns])
            found = np.linalg.lstsq(columns, moved.ravel(), rcond=None)[0]
            return float(np.linalg.norm(columns @ found - moved.ravel()) / np.linalg.norm(moved))

        assert left(tilt, twist) > 0.02
        ways = np.moveaxis(law.columns(rows, None, np.zeros(len(law.parameters)))[:, :3, :3], 2, 0)
        assert left(tilt, twist, *ways) < 1e-9
        # What the columns say the law does.
        shares = np.concatenate([[0.3, -1.2, 0.7], np.zeros(18)])
        assert_allclose(law.contribution(rows, None, shares)[:, :3], np.tensordot(shares[:3], ways, 1), atol=1e-15)


@pytest.mark.parametrize("name", ["uneven_gear", "gravity_compensator"])
def test_an_uneven_gear_may_have_any_wave_of_up_to_three_a_turn(name: str) -> None:
    """Its further ways are these waves of the gear's own twist, each part of them a fifth of its size, and no others."""
    arm, rng = robot(), np.random.default_rng(10)
    wrench = np.concatenate([rng.uniform(-300, 300, (30, 3)), np.zeros((30, 3))], axis=1)
    rows = load_state(arm, TOOL, random_poses(arm, 30, rng, 0.6), wrench, np.full(6, 1e-6))
    joint = effects()[name].joints[0]
    for law in (effects()[name], *effects()[name].other_laws):
        i, values = joint - 1, np.array([0.4, 0.7, 0.3])[: len(law.parameters)]
        ways = law.further_ways(rows, joint, values)
        twist = rows.jacobian[:, :, i] * (rows.torque[:, i] * 1e-6)[:, None]
        for turns, told in ((1, True), (2, True), (3, True), (4, False)):
            wave = 0.4 * 0.2 * twist * np.cos(turns * rows.theta[:, i] + 1.1)[:, None]
            weight, left = np.linalg.lstsq(ways.reshape(-1, ways.shape[2]), wave.ravel(), rcond=None)[:2]
            assert bool(np.isclose(np.linalg.norm(weight), 1.0)) is told
            assert (float(left[0]) < 1e-20) is told


def test_a_smaller_gear_is_softer_up_to_less_torque() -> None:
    """Gears of one shape are wound up alike: of one with a tenth of the stiffness a tenth of the torque is expected, and what
    it may yield more in all stays the same; a stiffer one is taken for a large one."""
    rows = cycle(0.0)
    for law in (effects()["soft_zone"], *effects()["soft_zone"].other_laws):
        at = [parameter.name for parameter in law.parameters].index("torque_nm")
        large, soft, stiff = (law.typical(replace(rows, compliance=np.full(6, value)), 5) for value in (4e-6, 4e-5, 4e-7))
        assert_allclose([soft[at] / large[at], stiff[at] / large[at]], [0.1, 1.0], rtol=1e-12)
        if law.parameters[0].unit == "rad":
            assert_allclose(soft[0], large[0], rtol=1e-12)
            # K3 is 1.8 times K1: below T it yields by 0.8 of what it does above it more.
            assert_allclose([large[0], stiff[0]], 0.8 * 100 * np.array([4e-6, 4e-7]), rtol=1e-12)
        grids = [law.grid(replace(rows, compliance=np.full(6, value)), 5, law.parameters[at]) for value in (4e-6, 4e-5, 4e-7)]
        assert_allclose(grids, np.outer([1.0, 0.1, 1.0], law.parameters[at].grid), rtol=1e-12)


# Of two slopes the corner is seen, so that their weights are tried more closely than those of the smooth law.
@pytest.mark.parametrize(("law", "most"), [("cubic_wrist", 0.13), ("cubic_arm", 0.13), ("wrist", 0.16), ("arm", 0.2)])
def test_a_weight_between_those_that_are_tried_is_nearly_one_of_them(law: str, most: float) -> None:
    """Of the squares that a free spring leaves of the twist under such a weight, which turns the axis otherwise at each pose,
    most are taken by the same law under one of its neighbours, whatever its own knee."""
    (one,) = (other for other in effects()["soft_zone"].other_laws if other.law == law)
    knees, weights = (parameter.grid for parameter in one.parameters[1:])
    load, lever = np.tile(np.linspace(-1.5, 1.5, 81) * weights[-1] / 8, 9), np.repeat(np.linspace(-1, 1, 9), 81)

    def twist(weight: float, knee: float) -> np.ndarray:
        held, both = weight * lever / knee, (weight * lever + load) / knee
        if law in ("wrist", "arm"):
            moved = np.clip(both, -1, 1) - np.clip(held, -1, 1)
        else:
            x = np.linspace(-30.0, 30.0, 60_001)
            moved = np.interp(both, x + x**3, x) - np.interp(held, x + x**3, x)
        return np.asarray(moved - load * (load @ moved) / (load @ load))

    for knee in knees:
        for near in itertools.pairwise(weights):
            between = twist(np.sqrt(near[0] * near[1]), knee)
            tried = [twist(weight, other) for weight in near for other in knees]
            alike = max((between @ each) ** 2 / (each @ each) for each in tried)
            assert alike > (1 - most) * (between @ between), (knee, near)

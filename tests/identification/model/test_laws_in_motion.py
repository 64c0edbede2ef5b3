"""What effects add to a log in motion: the deflection as it is logged with each of them, less the spring's."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from identification.model.effects import Effect, effects
from identification.model.effects.channel_delay import ChannelDelay
from identification.model.effects.torque_crosstalk import TorqueCrosstalk
from identification.model.effects.transmission_error import OnceATurn
from identification.model.joint_log import JointLog
from identification.model.law_of import known
from identification.model.load_state import load_state
from identification.model.rotations import Frame
from tests.support import random_poses, robot

SOFT = 3e-7
TIME = np.arange(1500) * 0.004


def torque(time: np.ndarray) -> np.ndarray:
    return np.asarray(400 * np.sin(2.0 * time + 0.3) + 60 * np.sin(7.0 * time))


def link(time: np.ndarray) -> np.ndarray:
    return np.asarray(0.4 * np.sin(1.3 * time) + 0.05 * np.cos(3.0 * time))


def log(*, torque_late: float = 0.0, link_late: float = 0.0, deflection: np.ndarray | None = None) -> JointLog:
    """A spring that the torque turns at once, and an arm that is where its link is; channels late by so many seconds."""
    motor = link(TIME) + SOFT * torque(TIME)
    speed = np.gradient(motor, TIME)
    recorded = motor - link(TIME - link_late) if deflection is None else deflection
    return JointLog(2, TIME, torque(TIME - torque_late), speed, recorded, motor, SOFT, {5: np.cos(TIME)})


def law(name: str) -> Effect:
    found = known(name)
    assert found is not None
    return found


@pytest.mark.parametrize("late", [0.006, -0.006])
def test_a_link_encoder_that_is_late_is_off_by_what_the_link_turned_since(late: float) -> None:
    added = ChannelDelay("link").log_contribution(log(link_late=late), np.array([late]))
    assert_allclose(added[5:-5], (link(TIME) - link(TIME - late))[5:-5], atol=6e-8)     # of 3e-3, to the third order


@pytest.mark.parametrize("late", [0.02, -0.02])
def test_a_torque_that_is_recorded_late_is_not_the_one_that_turned_the_spring(late: float) -> None:
    added = ChannelDelay("torque").log_contribution(log(torque_late=late), np.array([late]))
    assert_allclose(added[8:-8], SOFT * (torque(TIME) - torque(TIME - late))[8:-8], atol=1e-9)


def test_a_motor_s_torque_loses_friction_and_what_turns_its_rotor_before_the_gear() -> None:
    """Coulomb's in full from two milliradians a second on, viscous in proportion."""
    one = log()
    lost = 120.0 * np.clip(one.speed / 2e-3, -1, 1) + 300.0 * one.speed
    assert_allclose(law("joint_friction").log_contribution(one, np.array([120.0, 300.0])), -SOFT * lost, atol=1e-15)
    turned = law("motor_inertia").log_contribution(one, np.array([80.0]))
    exact = -0.4 * 1.69 * np.sin(1.3 * TIME) - 0.45 * np.cos(3 * TIME) + SOFT * (
        -1600 * np.sin(2 * TIME + 0.3) - 2940 * np.sin(7 * TIME))
    assert turned is not None
    assert_allclose(turned[5:-5], -SOFT * 80.0 * exact[5:-5], atol=SOFT * 80 * 2e-4)


def test_a_damped_gear_twists_later_than_its_torque() -> None:
    added = law("gear_damping").log_contribution(log(), np.array([0.002]))
    assert added is not None
    assert_allclose(added[2:-2], SOFT * (torque(TIME - 0.002) - torque(TIME))[2:-2], atol=4e-9)


def test_play_and_a_soft_zone_are_crossed_and_full_beyond() -> None:
    one = log()
    play = law("backlash").log_contribution(one, np.array([3e-5]))
    zone = law("soft_zone").log_contribution(one, np.array([4e-5, 150.0]))
    assert play is not None
    assert zone is not None
    far = np.abs(one.torque) > 30
    assert_allclose(play[far], 3e-5 * np.sign(one.torque[far]))
    near = np.abs(one.torque) < 150
    assert near.any()
    assert_allclose(zone[near], 4e-5 * one.torque[near] / 150)
    assert_allclose(zone[~near], 4e-5 * np.sign(one.torque[~near]))


def test_what_begins_at_a_time_and_what_another_joint_adds() -> None:
    assert_allclose(law("encoder_slip").log_contribution(log(), np.array([7e-5, TIME[700]])), 7e-5 * (np.arange(1500) >= 700))
    assert_allclose(TorqueCrosstalk(5).log_contribution(log(), np.array([2e-8])), 2e-8 * np.cos(TIME))
    assert_allclose(TorqueCrosstalk(3).log_contribution(log(), np.array([2e-8])), 0.0)


@pytest.mark.parametrize("rows", [5, -5])
def test_samples_of_the_link_that_were_lost_or_written_twice_are_put_back(rows: int) -> None:
    """From row 700 on the link stands in the log as it was five rows before, or after. What no row has is bridged."""
    one, first = log(), 700
    row = np.arange(1500)
    recorded = link(TIME - np.where(row < first, 0, rows) * 0.004)
    if rows > 0:        # until the first row of the new count has come nothing is known
        recorded[first: first + rows] = 0.123
    wrong = log(deflection=one.angle - recorded)
    added = law("lost_samples").log_contribution(wrong, np.array([0.004 * rows, TIME[first]]))
    assert added is not None
    true = wrong.deflection - added
    whole = np.ones(1500, dtype=bool)
    whole[1500 - rows if rows > 0 else 1500:] = False
    whole[first: first + max(-rows, 0)] = False
    assert_allclose(true[whole], one.deflection[whole], atol=1e-12)
    if rows < 0:
        assert_allclose(true[first - 1: first + 6], np.interp(np.arange(7), [0, 6], one.deflection[[first - 1, first + 5]]))


def test_a_smooth_error_is_its_rms_over_a_turn_and_a_line_repeats_with_its_phase() -> None:
    turn = 2 * np.pi * np.arange(1500) / 1500
    one = JointLog(2, TIME, torque(TIME), np.gradient(turn, TIME), 0 * TIME, turn, SOFT)
    smooth = law("transmission_error").log_contribution(one, np.array([1e-4, 0.0, 7.0, 0.5]))
    line = law("transmission_error").log_contribution(one, np.array([0.0, 2e-5, 7.0, 0.5]))
    assert smooth is not None
    assert line is not None
    assert np.sqrt(np.mean(smooth**2)) == pytest.approx(1e-4)
    assert smooth[0] == smooth.max()
    assert_allclose(line, 2e-5 * np.cos(7 * turn + 0.5), atol=1e-18)
    assert_allclose(OnceATurn().log_contribution(one, np.array([3e-5, -2e-5])), 3e-5 * np.cos(turn) - 2e-5 * np.sin(turn))


def test_effects_of_no_log_add_nothing_to_one() -> None:
    in_motion = {effect.name for effect in effects().values()
                 if effect.log_contribution(log(), np.array([p.typical for p in effect.parameters])) is not None}
    assert in_motion == {"backlash", "channel_delay", "encoder_slip", "gear_damping", "hysteresis", "joint_friction",
                         "lost_samples", "motor_inertia", "soft_zone", "torque_crosstalk", "transmission_error"}


@pytest.mark.parametrize(("name", "values", "brought"), [
    ("drift", [3e-9, 4e-9, 0.0], {"sensor_step": 5e-9 * 3600}),
    ("drift.settling", [3e-6, 0.0, 4e-6, 900.0], {"sensor_step": 5e-6}),
    ("drift.cycling", [3e-6, 0.0, 4e-6, 1.0, 900.0], {"sensor_step": 1e-5}),
    ("drift.growing", [3e-5, 900.0], {"sensor_step": 0.0}),
    ("softening", [0.3], {"drift": 2e-3 * 0.3 / 3600, "drift.settling": 6e-4}),
    ("softening.settling", [-0.3, 600.0], {"drift": 1e-6, "drift.settling": 6e-4})])
def test_what_comes_with_a_drift_or_a_warm_up_is_no_cause_of_its_own(
    name: str, values: list[float], brought: dict[str, float],
) -> None:
    """The zero that was taken before it; two millimetres of sag that soften as the springs do."""
    assert law(name).brings(np.array(values)) == pytest.approx(brought)


@pytest.mark.parametrize(("fall", "along_x", "along_y"), [
    ((0, 0, -9.81), (1, 0, 0), (0, 1, 0)), ((0, 0, 9.81), (1, 0, 0), (0, -1, 0)), ((-9.81, 0, 0), (0, 1, 0), (0, 0, 1)),
    ((-5.886, 0, -7.848), (0.8, 0, -0.6), (0, 1, 0))])
def test_a_weight_hangs_beside_the_tool_point_level_whichever_way_the_base_stands(
    fall: tuple[float, ...], along_x: tuple[float, ...], along_y: tuple[float, ...],
) -> None:
    """The hook's x is base x made level, base y where that is plumb; its y is up times that. A push has no hook."""
    arm, rng = robot("irb6700-200-2.60"), np.random.default_rng(3)
    down = np.array(fall) / 9.81
    wrench = np.zeros((4, 6))
    wrench[:, :3] = np.outer([100, 200, 300, 0], down)
    wrench[3, :3] = 50 * np.roll(down, 1) + 20 * down
    rows = load_state(arm, Frame.identity(), random_poses(arm, 4, rng), wrench, 1 / arm.prior.stiffness, fall=np.array(fall))
    true = law("hook_offset").true_wrench(rows, None, np.array([0.03, -0.02]))
    assert true is not None
    lever = 0.03 * np.array(along_x) - 0.02 * np.array(along_y)
    wanted = wrench.copy()
    wanted[:3, 3:] = np.cross(lever, wrench[:3, :3])
    assert_allclose(true, wanted, atol=1e-12)

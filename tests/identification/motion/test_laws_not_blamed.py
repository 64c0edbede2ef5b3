"""What is in every record and no fault of the gear, and what only looks like another cause: nothing else is named for it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from identification.motion.axis import axis_of
from identification.motion.causes import cause_of
from identification.motion.inner_friction import without_torque_noise
from identification.motion.log_file import MotionLog, read_motion_log
from identification.motion.procedure import _averaged, _needed, _told, detection, diagnose_axes
from identification.motion.search import survey
from identification.motion.smooth import smooth_over
from identification.motion.transmission import find_transmission
from tests.identification.motion.simulated_joint import RATE, columns, smooth_noise, waves, write


def log_of(path: Path, values: dict[str, np.ndarray]) -> MotionLog:
    return read_motion_log(write(path, values))


def resting(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Time and the path of a joint that goes to and fro and rests in between, 16 s [s, rad]."""
    rng = np.random.default_rng(seed)
    time = np.arange(16 * int(RATE)) / RATE
    knots = np.arange(0.0, 17.0, 1.0)
    path = np.interp(time, knots, np.repeat(rng.uniform(-0.4, 0.4, 9), 2)[:17])
    soft = np.hanning(101) / np.hanning(101).sum()
    return time, np.convolve(np.pad(path, 50, "edge"), soft, "valid")


def test_a_gear_follows_no_noise_of_the_torque_channel(tmp_path: Path) -> None:
    """Nor has it friction inside for that: a noise of 40 N m that lasts 20 ms, of a gear of 5e6 N m/rad."""
    rng = np.random.default_rng(5)
    time, link = resting(5)
    carried = 900 * np.gradient(np.gradient(link, time), time) + 2500 * np.cos(link)
    motor = link + carried / 5e6
    logged = link + 5e-7 * rng.standard_normal(len(time))
    torque = carried + smooth_noise(rng, len(time), 40.0, 0.02)
    log = log_of(tmp_path / "log.csv", {"time_s": time, "q2_motor_deg": np.degrees(motor), "q2_link_deg": np.degrees(logged),
                                        "q2_torque_nm": torque})
    axis = axis_of(2, [log])
    assert "hysteresis" in survey(axis)[0].names                 # what the torque alone would have it
    axis = without_torque_noise(axis)
    assert "hysteresis" not in [group[0].name for group in axis.dictionary]
    assert detection(axis, 19, rng) > 0.05


def test_a_damped_gear_is_not_called_a_clock_that_is_wrong(tmp_path: Path) -> None:
    """A twist that is 2 ms late behind the torque: the records cannot tell a damper from a torque recorded early."""
    values = columns(7, {}, seconds=12)
    values["q2_torque_nm"] = np.interp(values["time_s"] + 2e-3, values["time_s"], values["q2_torque_nm"])
    first, second, *_ = survey(axis_of(2, [log_of(tmp_path / "log.csv", values)]))
    assert {first.names, second.names} == {("gear_damping",), ("channel_delay (torque)",)}
    np.testing.assert_allclose(first.probability, second.probability, rtol=0.2)


@pytest.mark.parametrize(("lag", "verdict"), [(4e-4, "adequate"), (2e-3, "ambiguous")])
def test_a_gear_that_is_damped_as_gears_are_is_adequate(tmp_path: Path, lag: float, verdict: str) -> None:
    """Its lag is told; a lag that no ordinary gear has is left open."""
    values = columns(8, {}, noise=3e-7)
    values["q2_torque_nm"] = np.interp(values["time_s"] + lag, values["time_s"], values["q2_torque_nm"])
    one = diagnose_axes([log_of(tmp_path / "log.csv", values)], replicates=19)[0]
    assert one.verdict == verdict
    assert (one.damping is not None) == (verdict == "adequate")
    if one.damping is not None:
        assert abs(one.damping.values[0] - lag) < 4 * one.damping.std[0] < lag
        assert one.alternatives == one.causes == ()
    else:
        assert {"gear_damping", "channel_delay (torque)"} <= {cause.shape.name for cause in one.alternatives}


def test_lines_are_found_that_most_samples_see_folded(tmp_path: Path) -> None:
    """1400 cycles a turn at 50 samples a second, by which a joint at 0.2 rad/s shows it less than twice a cycle."""
    logs = []
    for seed in (1, 2):
        values = columns(seed, {})
        values["q2_link_deg"] = values["q2_link_deg"] + np.degrees(5e-5 * np.sin(1400 * np.radians(values["q2_link_deg"])))
        logs.append(log_of(tmp_path / f"{seed}.csv", {name: column[::5] for name, column in values.items()}))
    found = find_transmission(2, logs[:1], logs[1])
    np.testing.assert_allclose(found.cycles, [1400], atol=1.0)


def test_a_law_is_the_same_on_a_record_with_smaller_torques(tmp_path: Path) -> None:
    """The slip torque that one record tells is beyond the grid of the other; its state there is the elastic one."""
    log = log_of(tmp_path / "log.csv", columns(3, {}, seconds=6))
    smaller = replace(log, joints={2: replace(log.joints[2], torque=0.1 * log.joints[2].torque)})
    axis, other = axis_of(2, [log]), axis_of(2, [smaller], np.inf)
    shape = next(group[-1] for group in axis.dictionary if group[0].name == "hysteresis")
    told = shape.on(other.logs, other.rates, other.band)[:, 0]
    np.testing.assert_allclose(np.diff(told), np.diff(other.torque) / shape.fixed[1], atol=1e-9)


def test_a_record_whose_torque_only_accelerates_tests_the_smooth_part_of_another(tmp_path: Path) -> None:
    """In it the motor's inertia is the torque's own column, and so no effect."""
    first, second = columns(1, {}), columns(2, {})
    motor = np.radians(second["q2_motor_deg"])
    second["q2_torque_nm"] = 900 * np.gradient(np.gradient(motor, second["time_s"]), second["time_s"])
    second["q2_link_deg"] = np.degrees(motor - second["q2_torque_nm"] / 5e6)
    for values in (first, second):
        values["q2_link_deg"] = values["q2_link_deg"] + np.degrees(3e-4 * np.sin(np.radians(values["q2_motor_deg"])))
    found = find_transmission(2, [log_of(tmp_path / "1.csv", first)], log_of(tmp_path / "2.csv", second))
    assert found.smooth_test is not None


def test_a_recorder_is_not_late_by_a_microsecond(tmp_path: Path) -> None:
    """Recorders are off by milliseconds. A share of the speed that is worth 1 us, and shows by 4 of its standard deviations, is
    less likely theirs than nothing; one of 100 us is."""
    values = columns(9, {}, noise=3e-7)
    speed = np.gradient(values["q2_motor_deg"], values["time_s"])
    plain = survey(axis_of(2, [log_of(tmp_path / "log.csv", values)]))
    link = next(one for one in plain if one.names == ("channel_delay (link)",))
    std = np.sqrt(link.solved.covariance[-1, -1])
    chances = []
    for late in (4 * std - link.solved.coefficients[-1], 1e-4):
        late_link = values | {"q2_link_deg": values["q2_link_deg"] - late * speed}
        sets = survey(axis_of(2, [log_of(tmp_path / "log.csv", late_link)]))
        chances.append(sum(one.probability for one in sets if "channel_delay (link)" in one.names))
    assert std < 1e-6
    assert chances[0] < 0.5 < 0.99 < chances[1]


def test_viscous_friction_does_not_blow_up_a_delay(tmp_path: Path) -> None:
    """Of a stiff gear they are one column but for a thousandth: the delay stands for both, and is known as well as that one."""
    values = columns(16, {"channel_delay": 0.05, "joint_friction": 1.0}, stiffness=5e7, noise=6e-7)
    best = survey(axis_of(2, [log_of(tmp_path / "log.csv", values)]))[0]
    assert set(best.names) == {"channel_delay (link)", "joint_friction"}
    compliance, delay, coulomb = best.solved.coefficients[1:4]
    assert delay == pytest.approx(150e-6 - 900.0 / 5e7, abs=4e-6)
    assert coulomb / compliance == pytest.approx(300.0, rel=0.05)
    assert np.sqrt(best.solved.covariance[2, 2]) < 2e-6


def hanging(path: Path, seed: int, *, soft: float, ring: float) -> MotionLog:
    """An arm under its weight, whose torque is nearly a function of the angle. soft [rad]: of its gear about no torque; ring
    [rad]: of its encoder."""
    rng = np.random.default_rng(seed)
    time = np.arange(16 * int(RATE)) / RATE
    link = waves(rng, time, 0.25, 0.08, 0.3)
    carried = 1500 * np.sin(link) + waves(rng, time, 60.0, 0.2, 2.0)
    motor = link + carried / 5e6 + soft * np.tanh(carried / 250)
    logged = link - ring * np.sin(link + 0.3) + 2e-6 * rng.standard_normal(len(time))
    return log_of(path, {"time_s": time, "q2_motor_deg": np.degrees(motor), "q2_link_deg": np.degrees(logged),
                         "q2_torque_nm": carried + 2.0 * rng.standard_normal(len(time))})


@pytest.mark.parametrize(("soft", "ring"), [
    *(pytest.param(*one, marks=pytest.mark.long) for one in ((4e-5, 0.0), (0.0, 1e-4))), (4e-5, 1e-4)])
def test_a_soft_gear_under_a_weight_is_no_error_over_the_angle(tmp_path: Path, soft: float, ring: float) -> None:
    """It predicts as one, by waves of either kind; the gear's law does it as well, but not what a ring does."""
    logs = [hanging(tmp_path / f"{seed}.csv", seed, soft=soft, ring=ring) for seed in (1, 2)]
    found = find_transmission(2, logs[:1], logs[1])
    test = found.smooth_test
    assert test is not None
    assert test.confirmed, "the case must be one"
    whole_turn = smooth_over(logs[0].joints[2].angle, 1e-4)
    assert test.smooth.bend > 1 >= whole_turn.bend
    for smooth in (test.smooth, whole_turn):
        kept = _needed(replace(found, smooth_test=replace(test, smooth=smooth)), logs[:1])
        assert (kept.smooth is not None) == (ring > 0)


def test_what_is_not_certain_beside_a_cause_is_in_its_spread(tmp_path: Path) -> None:
    """Friction alone and friction beside a delay, as likely as one another, differ by 30 %: it lies between, and its sigma has
    half of the difference. One that lies as far from nothing as it is uncertain is no name."""
    axis = axis_of(2, [log_of(tmp_path / "log.csv", columns(10, {"joint_friction": 1.0}))])
    place = [group[0].name for group in axis.dictionary].index("joint_friction")
    alone = next(one for one in survey(axis) if one.names == ("joint_friction",))
    coulomb = axis.plain.shape[1]
    both = []
    for share in (0.7, -0.9):
        other = alone.solved.coefficients.copy()
        other[coulomb:] *= share
        moved = replace(alone, solved=replace(alone.solved, coefficients=other))
        both.append([replace(one, probability=0.5) for one in (alone, moved)])
    first, second = (cause_of(axis, one, 0, 1.0).values[0] for one in both[0])
    cause = _averaged(axis, tuple(both[0]), place, cause_of(axis, alone, 0, 1.0))
    assert cause.values[0] == pytest.approx((first + second) / 2)
    assert abs(first - second) / 2 < cause.std[0] < 0.7 * abs(first - second)
    assert [_told(axis, tuple(sets), place) for sets in both] == [True, False]


@pytest.mark.parametrize(("late", "named"), [(2e-5, False), (1e-4, True)])
def test_an_encoder_is_not_late_by_a_hundredth_of_a_sample(tmp_path: Path, late: float, named: bool) -> None:
    """Clocks of 4 ms do not tell so little apart, however sure the share of the speed is."""
    values = columns(9, {}, noise=3e-7)
    values["q2_link_deg"] = values["q2_link_deg"] - late * np.gradient(values["q2_motor_deg"], values["time_s"])
    axis = axis_of(2, [log_of(tmp_path / "log.csv", values)])
    sets = survey(axis)
    place = [group[0].name for group in axis.dictionary].index("channel_delay (link)")
    assert sum(one.probability for one in sets if place in one.entries) > 0.95
    assert _told(axis, sets, place) == named

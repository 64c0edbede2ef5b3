"""What follows the motion as the torque does: the torque of another joint, a cause; and what only stands for a noisy torque."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from identification.motion.axis import axis_of
from identification.motion.crosstalk import crosstalk
from identification.motion.log_file import MotionLog, read_motion_log
from identification.motion.procedure import diagnose_axes
from identification.motion.proxies import stands_for_torque, without_proxies
from identification.motion.search import survey
from identification.motion.smooth import smooth_over
from identification.motion.transmission import find_transmission
from tests.identification.motion.simulated_joint import RATE, STIFFNESS, columns, write

# rad/(N m): what the torque of joint 3 bends under the encoder of joint 2.
BENDS = 6e-8


def both(folder: Path, seed: int, bends: float, faults: dict[str, float]) -> MotionLog:
    """Joints 2 and 3 in one record, each with a motion of its own."""
    two, three = columns(seed, faults), columns(seed + 50, {}, joint=3)
    two["q2_link_deg"] = two["q2_link_deg"] - np.degrees(bends * three["q3_torque_nm"])
    return read_motion_log(write(folder / f"{seed}.csv", two | three))


@pytest.mark.parametrize("faults", [
    {}, pytest.param({"channel_delay": 1.0, "joint_friction": 1.0}, marks=pytest.mark.long)])
def test_the_torque_of_another_joint_is_named(tmp_path: Path, faults: dict[str, float]) -> None:
    record, other = both(tmp_path, 500, BENDS, faults), both(tmp_path, 501, BENDS, faults)
    two, three = diagnose_axes([record], other, replicates=19)
    (cause,) = [cause for cause in two.causes if cause.shape.effect.name == "torque_crosstalk"]
    assert "torque of joint 3" in cause.sentence
    assert abs(cause.values[0] - BENDS) < 4 * cause.std[0] < BENDS
    assert two.gain is not None
    assert two.gain.ratio > 1.2
    assert "torque_crosstalk" not in [cause.shape.effect.name for cause in (*three.causes, *three.alternatives)]
    for one in (two, three):
        low, high = one.stiffness.interval_95
        assert low < STIFFNESS < high


def test_joints_that_only_move_together_have_none(tmp_path: Path) -> None:
    record = both(tmp_path, 502, 0.0, {"channel_delay": 1.0})
    for joint in (2, 3):
        assert crosstalk(axis_of(joint, [record])) == []


def test_each_part_of_the_log_has_the_same_of_it(tmp_path: Path) -> None:
    """Each half of a single record, and each of two records, by itself and of one size; else it is something else."""
    two, three = columns(500, {}, seconds=8), columns(550, {}, seconds=8, joint=3)

    def seen(*bends: float | tuple[float, float]) -> bool:
        """Whether it is a cause; of each record what bends, of a pair that of its halves."""
        records = []
        for k, each in enumerate(bends):
            shares = np.repeat(each, len(two["time_s"]) // np.size(each))
            link = two["q2_link_deg"] - np.degrees(shares * three["q3_torque_nm"])
            records.append(read_motion_log(write(tmp_path / f"{k}.csv", two | three | {"q2_link_deg": link})))
        return crosstalk(axis_of(2, records)) != []

    assert seen((BENDS, BENDS))
    assert not seen((BENDS, 0.0))
    assert not seen((0.5 * BENDS, BENDS))
    assert seen(BENDS, BENDS)
    assert not seen(BENDS, 0.5 * BENDS)


def swinging(seed: int, *, torque_noise: float, inertia: float = 0.0, ring: float = 0.0) -> dict[str, np.ndarray]:
    """To and fro under a weight, encoders of 0.4 urad: the angle knows what the torque is."""
    rng = np.random.default_rng(seed)
    time = np.arange(25 * int(RATE)) / RATE
    link = 0.4 * np.sin(2.1 * time)
    carried = 900 * np.gradient(np.gradient(link, time), time) + 1500 * np.cos(link)
    motor = link + carried / STIFFNESS
    told = carried + inertia * np.gradient(np.gradient(motor, time), time)
    return {"time_s": time, "q2_motor_deg": np.degrees(motor),
            "q2_link_deg": np.degrees(link - ring * np.cos(link) + 4e-7 * rng.standard_normal(len(time))),
            "q2_torque_nm": told + torque_noise * rng.standard_normal(len(time))}


def test_a_noisy_torque_is_no_error_over_the_angle(tmp_path: Path) -> None:
    """2 % of noise: the angle in place of the spring betters the fit by far."""
    log = read_motion_log(write(tmp_path / "log.csv", swinging(0, torque_noise=40.0)))
    axis = axis_of(2, [log])
    assert "transmission_error" in survey(axis)[0].names, "the case must be one"
    kept = [group[0].name for group in without_proxies(axis).dictionary]
    assert "transmission_error" not in kept
    assert "channel_delay (link)" in kept
    assert diagnose_axes([log], replicates=19)[0].causes == ()
    assert find_transmission(2, [log], None).smooth is not None, "it was found again, too"


@pytest.mark.parametrize(("cause", "size"), [("motor_inertia", {"inertia": 300.0}), ("transmission_error", {"ring": 4e-5})])
def test_a_cause_beside_a_noisy_torque_is_kept(tmp_path: Path, cause: str, size: dict[str, float]) -> None:
    log = read_motion_log(write(tmp_path / "log.csv", swinging(1, torque_noise=40.0, **size)))
    axis = axis_of(2, [log])
    assert cause in [group[0].name for group in without_proxies(axis).dictionary]


def test_an_axis_without_doubtful_causes_is_the_same(tmp_path: Path) -> None:
    axis = axis_of(2, [read_motion_log(write(tmp_path / "log.csv", columns(503, {}, seconds=8)))], only=("backlash",))
    assert without_proxies(axis) is axis
    assert without_proxies(replace(axis, dictionary=[])).dictionary == []


@pytest.mark.parametrize(("ring", "stands"), [(0.0, True), (1e-5, False)])
def test_whether_an_error_over_the_angle_is_the_torque_s_hangs_on_no_unit(tmp_path: Path, ring: float, stands: bool) -> None:
    """From nN m to GN m, whatever the encoders' zeros."""
    logs = []
    for seed in (1, 2):
        values = swinging(seed, torque_noise=40.0, ring=ring)
        values["q2_link_deg"] = values["q2_link_deg"] - np.degrees(1e-4 * seed)
        logs.append(read_motion_log(write(tmp_path / f"{seed}.csv", values)))
    axis = axis_of(2, logs)
    smooth = smooth_over(np.concatenate([log.joints[2].angle for log in logs]), 4e-5)
    for unit in (1e-9, 1e-3, 1.0, 1e3, 1e9):
        assert stands_for_torque(replace(axis, torque=axis.torque / unit), smooth) == stands

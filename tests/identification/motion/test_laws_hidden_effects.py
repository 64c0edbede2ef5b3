"""An effect is hidden in simulated logs (simulated_joint.py): it is named, or a set with it in, and never another alone."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

from identification.motion.axis_diagnosis import AxisDiagnosis
from identification.motion.band import BAND, low_pass
from identification.motion.log_file import read_motion_log
from identification.motion.procedure import diagnose_axes
from identification.motion.stiffness import axis_stiffness
from tests.identification.motion.simulated_joint import FAULTS, RATE, STIFFNESS, columns, write

NAMES = {"channel_delay": "channel_delay (link)", "torque_delay": "channel_delay (torque)"}
IN_MOTION = {"channel_delay": 1.0, "joint_friction": 1.0, "motor_inertia": 1.0}


@cache
def of_case(seed: int, *faults: tuple[str, float]) -> AxisDiagnosis:
    """The answer to one case, which several tests ask for."""
    with TemporaryDirectory() as name:
        fitted = read_motion_log(write(Path(name) / "fitted.csv", columns(seed, dict(faults))))
        other = read_motion_log(write(Path(name) / "other.csv", columns(1000 + seed, dict(faults))))
        return diagnose_axes([fitted], other, replicates=49)[0]


def diagnosed(seed: int, faults: dict[str, float]) -> AxisDiagnosis:
    return of_case(seed, *faults.items())


@pytest.mark.parametrize("fault", FAULTS)
def test_one_effect(fault: str) -> None:
    found = diagnosed(0, {fault: 1.0})
    truth = NAMES.get(fault, fault)
    named = [cause.shape.name for cause in found.causes]
    if found.verdict == "named":
        assert named == [truth]
        assert found.gain is not None
        assert found.gain.ratio > 1.1
    else:
        assert found.verdict == "ambiguous"
        assert truth in [cause.shape.name for cause in found.alternatives]


def test_backlash_is_not_called_a_soft_zone_alone() -> None:
    found = diagnosed(0, {"backlash": 1.0})
    assert [cause.shape.name for cause in found.causes] in ([], ["backlash"])


# Long: each of them is named alone above, and all three lie in the records of test_laws_leaps.py and
# test_laws_not_the_torque.py.
@pytest.mark.long
def test_several_effects_of_motion_together() -> None:
    found = diagnosed(2, IN_MOTION)
    assert found.verdict == "named"
    assert {cause.shape.name for cause in found.causes} == {"channel_delay (link)", "joint_friction", "motor_inertia"}
    inertia = next(cause for cause in found.causes if cause.shape.name == "motor_inertia")
    assert inertia.values[0] == pytest.approx(700, rel=0.06)


def test_sizes_are_recovered() -> None:
    delay = diagnosed(0, {"channel_delay": 1.0}).causes[0]
    assert abs(delay.values[0] - 3e-3) < 4 * delay.std[0]
    friction = diagnosed(0, {"joint_friction": 1.0}).causes[0]
    assert friction.values == pytest.approx([300, 900], rel=0.15)


def test_a_cause_explains_what_it_takes_of_the_misfit_under_the_band() -> None:
    """Of the variance that a straight line leaves, both as residuals are under the band."""
    for fault in ("channel_delay", "joint_friction"):
        found = diagnosed(0, {fault: 1.0})
        line, model = np.var(low_pass(found.residuals, RATE, BAND), axis=0)
        assert 1 - found.explained == pytest.approx(model / line, rel=0.2)


def test_a_torque_that_advances_is_not_friction() -> None:
    # Deflection that grows with speed against the sign of friction: only a delay makes it.
    found = diagnosed(0, {"channel_delay": 1.0})
    assert "joint_friction" not in [cause.shape.name for cause in found.causes]


def test_plain_spring_is_adequate() -> None:
    assert diagnosed(20, {}).verdict == "adequate"


# Long: one seed is asked above; of more one in twenty may be open.
@pytest.mark.long
def test_plain_springs_are_seldom_anything_else() -> None:
    verdicts = [diagnosed(seed, {}).verdict for seed in range(20, 25)]
    assert verdicts.count("adequate") >= 4
    assert "named" not in verdicts


def test_an_error_that_follows_the_angle() -> None:
    """25 cycles a turn with a record to find them again in; """
    alone = diagnosed(0, {"angle_error": 1.0})
    assert [cause.shape.name for cause in alone.causes] == ["transmission_error"]
    assert alone.transmission.cycles == pytest.approx([25], abs=0.5)


# Long: a ring's error is named beside that delay in test_laws_transmission.py.
@pytest.mark.long
def test_an_error_that_follows_the_angle_beside_a_delay() -> None:
    beside = diagnosed(0, {"angle_error": 1.0, "channel_delay": 1.0})
    assert [cause.shape.name for cause in beside.causes] == ["channel_delay (link)", "transmission_error"]


def test_intervals_of_the_stiffness_hold(tmp_path: Path) -> None:
    """With coloured noise and everything that motion brings, 95 % intervals cover, and are not idle."""
    hit, width = 0, []
    for seed in range(10):
        values = columns(100 + seed, IN_MOTION, seconds=10, noise=2e-5)
        one = axis_stiffness(2, [read_motion_log(write(tmp_path / "log.csv", values))])
        low, high = one.interval_95
        hit += low <= STIFFNESS <= high
        width.append((high - low) / STIFFNESS)
    assert hit >= 8          # 95 %: fewer in one of eighty such tens
    assert np.median(width) < 0.25


def test_white_noise_would_be_the_wrong_assumption(tmp_path: Path) -> None:
    one = axis_stiffness(2, [read_motion_log(write(tmp_path / "log.csv", columns(1, {})))])
    assert one.worth < 0.02 * one.samples


def test_records_that_disagree_are_said_to(tmp_path: Path) -> None:
    logs = [read_motion_log(write(tmp_path / f"{k}.csv", columns(k, {}, stiffness=k * 1e6))) for k in (5, 8)]
    one = axis_stiffness(2, logs)
    assert one.apart > 5
    assert one.grade == "tentative" or one.refused
    low, high = one.interval_95
    assert low < 5.2e6
    assert high > 7.8e6


def test_torque_that_only_accelerates_is_refused(tmp_path: Path) -> None:
    values = columns(3, {})
    speed = np.gradient(np.radians(values["q2_motor_deg"]), values["time_s"])
    values["q2_torque_nm"] = 4000 * speed + 900 * np.gradient(speed, values["time_s"])
    one = axis_stiffness(2, [read_motion_log(write(tmp_path / "log.csv", values))])
    assert one.refused
    assert "torque follows speed" in one.reason

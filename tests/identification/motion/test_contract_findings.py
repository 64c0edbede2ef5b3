"""What `identify` and `diagnose` say of joint deflection logs beside their answers, on both sides of what makes them say so."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from identification.common.findings import CompstiffError
from identification.model.cell import read_cell
from identification.model.effects import effects
from identification.motion.axis_diagnosis import AxisDiagnosis
from identification.motion.causes import LogCause, group_as_dict, over_joints
from identification.motion.diagnosis import JointLogDiagnosis, diagnose_joint_logs
from identification.motion.dictionary import Shape
from identification.motion.fit import fit_joint_logs, identified_model
from identification.motion.lines import Line
from identification.motion.log_file import MotionLog, read_motion_log
from identification.motion.prediction import _splits
from identification.motion.remainder import Remainder
from tests.identification.motion.simulated_joint import columns, write
from tests.support import write_cell

ANGLE, TORQUE = "the joint's angle", "the torque"


def log_of(folder: Path, **changed: np.ndarray) -> MotionLog:
    folder.mkdir(exist_ok=True)
    return read_motion_log(write(folder / "log.csv", columns(3, {}, seconds=10) | changed))


def test_a_log_that_does_not_tell_a_stiffness_says_so(tmp_path: Path) -> None:
    """A torque that only accelerates; the same motion with a load of its own tells it, to 5 %."""
    cell = read_cell(write_cell(tmp_path))
    values = columns(3, {}, seconds=10)
    speed = np.gradient(np.radians(values["q2_motor_deg"]), values["time_s"])
    mute = log_of(tmp_path, q2_torque_nm=4000 * speed + 900 * np.gradient(speed, values["time_s"]))
    fit = fit_joint_logs(cell, [mute])
    said, = [one for one in fit.findings if one.code == "CS1502"]
    assert (said.level, said.file) == ("warning", str(tmp_path / "log.csv"))
    assert said.message.startswith("k2 is not identifiable from this log, its value is the prior's: torque follows speed and "
                                   "acceleration too closely: ")
    assert said.hint == "load the joint while it stands still or moves slowly"
    assert fit.model.grades[1] == "not identifiable"
    assert fit.model.stiffness[1] == pytest.approx(cell.prior.stiffness[1])
    told = fit_joint_logs(cell, [log_of(tmp_path)])
    assert "CS1502" not in {one.code for one in told.findings}
    assert told.model.stiffness[1] == pytest.approx(5e6, rel=0.05)


def test_a_single_record_is_held_out_in_five_blocks_of_its_time(tmp_path: Path) -> None:
    """Each sample is predicted once, by the others; of several records each by the others, and none by itself."""
    one, other = log_of(tmp_path), log_of(tmp_path / "b")
    splits, how = _splits(2, [one], None)
    assert how == "cross-validation by 5 blocks of time"
    np.testing.assert_array_equal(np.concatenate([split.test.time for split in splits]), one.time)
    for split in splits:
        fitted = np.concatenate([piece.time for piece in split.train])
        assert len(fitted) == len(one.time) - len(split.test.time)
        assert not np.isin(split.test.time, fitted).any()
        assert not split.apart
    both, how = _splits(2, [one, other], None)
    assert (how, [(split.train, split.test, split.apart) for split in both]) == (
        "each record by the others", [([other], one, True), ([one], other, True)])


def test_a_record_to_validate_with_has_the_same_joints(tmp_path: Path) -> None:
    other = read_motion_log(write(tmp_path / "other.csv", {
        name.replace("q2_", "q3_"): column for name, column in columns(4, {}, seconds=10).items()}))
    with pytest.raises(CompstiffError) as stopped:
        diagnose_joint_logs(read_cell(write_cell(tmp_path)), [log_of(tmp_path)], other, replicates=19)
    (finding,) = stopped.value.findings
    assert (finding.code, finding.file) == ("CS1501", str(tmp_path / "other.csv"))
    assert finding.message == "has no motor and link angle of joint 2"


@pytest.fixture(scope="module")
def unknown(tmp_path_factory: pytest.TempPathFactory) -> JointLogDiagnosis:
    """A link angle that is off by a wave of the torque, which no gear does."""
    folder = tmp_path_factory.mktemp("unknown")
    values = columns(8, {}, noise=3e-6)
    off = np.degrees(6e-5 * np.cos(3 * values["q2_torque_nm"] / 800))
    log = read_motion_log(write(folder / "log.csv", values | {"q2_link_deg": values["q2_link_deg"] + off}))
    return diagnose_joint_logs(read_cell(write_cell(folder)), [log], replicates=19)


def told(found: JointLogDiagnosis, code: str, **changed: Any) -> list[tuple[str, str]]:
    """Level and words of the findings of this code, with other things found at the joint; they name the log."""
    axis = cast(AxisDiagnosis, replace(found.axes[0], **changed))
    findings = [one for one in replace(found, axes=(axis,)).findings if one.code == code]
    assert {one.file for one in findings} <= {found.logs[0].source}
    return [(one.level, one.message) for one in findings]


def test_a_log_whose_law_is_in_no_dictionary_says_what_is_left(unknown: JointLogDiagnosis) -> None:
    """Four fifths of it, by the p-value that four hundred shifts can have; it is said where no cause explains it."""
    assert unknown.verdict == "unknown"
    (level, message), = told(unknown, "CS1505")
    assert level == "warning"
    start, share, end = message.partition("80 %")
    assert (start, share) == ("joint 2: what is left follows the torque (", "80 %")
    assert end == " of it, p = 0.0025); no cause in the dictionary has that law"
    assert told(unknown, "CS1401") == [("warning", "something is wrong that no cause in the dictionary explains")]
    assert told(unknown, "CS1401", verdict="named") == told(unknown, "CS1401", verdict="adequate") == []
    hints = {one.code: one.hint for one in unknown.findings}
    assert "--report" in hints["CS1401"]


@pytest.mark.parametrize(("p_values", "follows"), [
    ((0.005, 0.0051), ["the joint's angle (30 % of it, p = 0.005)"]), ((0.0051, 0.5), []),
    ((0.004, 0.002), ["the joint's angle (30 % of it, p = 0.004)", "the torque (20 % of it, p = 0.002)"])])
def test_what_is_left_follows_what_chance_makes_once_in_a_hundred(
    unknown: JointLogDiagnosis, p_values: tuple[float, float], follows: list[str]
) -> None:
    """Over both quantities. What open causes explain, or the gear's damping, is not said to have no cause."""
    left = Remainder(((ANGLE, 0.3, p_values[0]), (TORQUE, 0.2, p_values[1])), (), (1.0, 0.1))
    said = [("warning", f"joint 2: what is left follows {' and '.join(follows)}; no cause in the dictionary has that law")]
    assert told(unknown, "CS1505", left=left) == said[: bool(follows)]
    assert told(unknown, "CS1505", left=left, verdict="named") == said[: bool(follows)]
    assert [told(unknown, "CS1505", left=left, verdict=other) for other in ("ambiguous", "adequate")] == [[], []]


def test_what_was_not_found_again_is_said_with_its_waves(unknown: JointLogDiagnosis) -> None:
    """And not of a line that was."""
    again, once, other = (Line(cycles, 0.1, 1e-4, p, (5.0, 6.0)) for cycles, p in ((25.04, 1e-4), (700.0, 0.4), (413.27, 0.9)))

    def found(*lines: Line) -> list[tuple[str, str]]:
        return told(unknown, "CS1611", transmission=SimpleNamespace(lines=lines, again_on="other.csv"))

    assert found() == found(again) == []
    assert found(again, once, other) == [
        ("note", "joint 2: what repeats 700.0, 413.3 times a turn is not found again in other.csv: it is not named")]


def cause(kind: str, joint: int, values: list[float], std: list[float], probability: float = 0.9) -> LogCause:
    effect = effects()[kind]
    return LogCause(Shape(effect, np.array(values), (), np.empty((0, 0)), False, ()), joint, probability, np.array(values),
                    np.array(std))


@pytest.mark.parametrize(("values", "std", "mean", "spread"), [
    ((1e-3, 2e-3), (1e-3, 2e-3), 1.2e-3, 8e-7**0.5),     # within theirs: 1/s^2 = 1e6 + 0.25e6
    ((1e-3, 9e-3), (1e-3, 2e-3), 2.6e-3, 3.2e-3)])                   # apart by 12.8 = 3.58^2 variances: so much wider
def test_a_cause_of_no_joint_is_one_over_the_joints_that_show_it(
    values: tuple[float, float], std: tuple[float, float], mean: float, spread: float
) -> None:
    """Weighted by 1 / variance: (1 a + 0.25 b) / 1.25, and sqrt(8e-7) = 8.9e-4 by that; by Birge's ratio where they differ by
    more. Each joint's own stand beside; it is as sure as where it is least so."""
    of_joints = [cause("channel_delay", joint, [value], [one], p) for joint, value, one, p in zip(
        (2, 3), values, std, (0.9, 0.7), strict=True)]
    (group,) = over_joints(of_joints)
    found = group_as_dict(group)
    assert (found["joint"], found["probability"]) == (None, 0.7)
    (parameter,) = found["parameters"].values()
    assert parameter["estimate"] == pytest.approx(mean)
    assert parameter["std"] == pytest.approx(spread)
    assert {joint: list(each.values()) for joint, each in found["by_joint"].items()} == {
        str(joint): [{"estimate": value, "std": one}] for joint, value, one in zip((2, 3), values, std, strict=True)}
    alone = group_as_dict(group[:1])
    assert "by_joint" not in alone
    assert next(iter(alone["parameters"].values())) | {"unit": ""} == {"estimate": values[0], "std": std[0], "unit": ""}


def test_a_cause_of_a_joint_is_one_at_each() -> None:
    assert [[one.joint for one in group] for group in over_joints(
        [cause("hysteresis", joint, [0.1, 0.1], [0.01, 0.01]) for joint in (2, 3)])] == [[2], [3]]


def test_names_that_a_log_cannot_tell_apart_are_told_with_their_probability(unknown: JointLogDiagnosis) -> None:
    """Each name once in the finding, whatever joints show it; five of them at most beside an answer."""
    others = tuple(cause(kind, 2, [0.1], [0.01], p) for kind, p in (("hysteresis", 0.5), ("soft_zone", 0.3)))
    axis = unknown.axes[0]
    open_ = replace(unknown, axes=(replace(axis, verdict="ambiguous", alternatives=others),) * 2)
    assert [(one.level, one.message) for one in open_.findings if one.code == "CS1402"] == [
        ("warning", "the log cannot tell several causes apart: hysteresis of joint 2, soft zone of joint 2")]
    assert "  ambiguous: hysteresis of joint 2 0.50, soft zone of joint 2 0.30" in open_.lines()
    none = replace(unknown, axes=(replace(axis, alternatives=()),))
    assert "  unknown: no cause in the dictionary explains it" in none.lines()
    many = replace(unknown, axes=(replace(axis, alternatives=others * 3),))
    assert [line.count("hysteresis") + line.count("soft zone") for line in many.lines() if "; the nearest: " in line] == [5]
    beside = replace(unknown, axes=(replace(axis, verdict="named", alternatives=others * 3),))
    (line,) = [line for line in beside.lines() if line.startswith("  beside it perhaps (this log does not settle it): ")]
    assert line.endswith(": " + ", ".join(["hysteresis of joint 2 0.50", "soft zone of joint 2 0.30"] * 2
                                          + ["hysteresis of joint 2 0.50"]))
    withdrawn = replace(unknown, axes=(replace(axis, withdrawn=("soft_zone [2]",)),))
    assert "  withdrawn: soft zone of joint 2 fits here but does not predict what was not fitted" in withdrawn.lines()


def test_damping_as_gears_have_it_is_no_fault(unknown: JointLogDiagnosis) -> None:
    axis = replace(unknown.axes[0], verdict="adequate", alternatives=())
    assert "  adequate: the plain spring explains the log to its noise" in axis.lines()
    damped = replace(axis, damping=cause("gear_damping", 2, [0.0021], [0.0001]))
    (line,) = [one for one in damped.lines() if one.startswith("  adequate: ")]
    assert "the twist is late by 2.1" in line
    assert axis.as_dict()["damping_lag_s"] is None
    assert damped.as_dict()["damping_lag_s"] == {"estimate": 0.0021, "std": 0.0001}


def test_what_the_robot_shows_at_rest_is_carried_on_with_its_spread(tmp_path: Path) -> None:
    """Of a lag by friction inside the gear: its size as the log tells it, its torque from a grid, known to a fifth. What only
    the log shows is left out."""
    cell = read_cell(write_cell(tmp_path))
    fit = fit_joint_logs(cell, [log_of(tmp_path)])
    causes = [cause("hysteresis", 2, [5e-5, 400.0], [3e-6, np.nan]), cause("channel_delay", 2, [1e-3], [1e-4])]
    model = identified_model(cell, fit.joints, fit.logs, causes)
    assert [effect.label for effect in model.effects] == ["hysteresis[2]"]
    assert model.mean[6:].tolist() == [5e-5, 400.0]
    np.testing.assert_allclose(model.covariance[6:, 6:], np.diag([3e-6**2, 80.0**2]))
    np.testing.assert_array_equal(model.covariance[:6, :6], fit.model.covariance)

"""Errors that repeat with the joint's angle, and zeros that move: hidden in simulated logs by formulas of their own."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from identification.motion import diagnosis
from identification.motion.axis import axis_of, solve
from identification.motion.axis_diagnosis import AxisDiagnosis
from identification.motion.lines import Line
from identification.motion.log_file import MotionLog, read_motion_log
from identification.motion.procedure import diagnose_axes
from identification.motion.search import Hypothesis
from identification.motion.smooth import smooth_over
from identification.motion.stiffness import axis_stiffness
from identification.motion.transmission import SIZES, Transmission, _tested, find_transmission
from identification.motion.zeros import zero_shifts
from tests.identification.motion.simulated_joint import STIFFNESS, columns, write

MOTION = {"channel_delay": 1.0, "joint_friction": 1.0, "motor_inertia": 1.0}


def record(folder: Path, seed: int, faults: dict[str, float], *, lines: dict[float, float] | None = None, phase: float = 0.0,
           ring: float = 0.0, zero_deg: float = 0.0, noise: float = 2e-5, name: str = "log") -> MotionLog:
    """10 s. lines: size [rad] by cycles a turn; ring [rad]: what a ring off its axis reads, not a sine but an arctangent;
    zero_deg: of the link encoder."""
    values = columns(seed, faults, seconds=10, noise=noise)
    turn = np.radians(values["q2_motor_deg"])
    error = sum((size * np.sin(cycles * turn + phase) for cycles, size in (lines or {}).items()), np.zeros_like(turn))
    if ring:
        error = error + np.arctan2(ring * np.sin(turn - 0.7), 1 + ring * np.cos(turn - 0.7))
    values["q2_link_deg"] = values["q2_link_deg"] - np.degrees(error) + zero_deg
    return read_motion_log(write(folder / f"{name}_{seed}.csv", values))


def names(one: AxisDiagnosis) -> set[str]:
    return {cause.shape.name for cause in one.causes}


@pytest.mark.parametrize(("cycles", "again"), [(413.2, 2.5), (1017.7, 0.0), (267.43, -1.0)])
def test_a_hidden_line_is_found_at_its_frequency(tmp_path: Path, cycles: float, again: float) -> None:
    """Also where the phase is another in the other record, and where the number a turn is no whole one."""
    fitted = record(tmp_path, 300, MOTION, lines={cycles: 2e-5})
    other = record(tmp_path, 301, MOTION, lines={cycles: 2e-5}, phase=again)
    found = find_transmission(2, [fitted], other)
    (line,) = found.confirmed
    assert abs(line.cycles - cycles) < 4 * line.std
    assert line.std < 1.0
    assert line.phase_holds == (again == 0.0)
    assert np.abs(found.amplitudes([fitted])) == pytest.approx([2e-5], rel=0.15)


@pytest.mark.parametrize(("again", "replicates", "smallest"), [(0.002, 49, 0.002), (0.5, 49, 0.02), (0.002, 999, 0.001)])
def test_no_p_value_is_smaller_than_what_is_said_to_be_the_smallest(
    monkeypatch: pytest.MonkeyPatch, again: float, replicates: int, smallest: float,
) -> None:
    """A line that is found again is held against 499 searches of noise, what else is wrong against the replicates."""
    strong, weak = (Line(400.0, 0.1, p_value, again, (30.0, 30.0)) for p_value in (0.002, 0.004))
    joints = tuple(SimpleNamespace(transmission=Transmission(k, lines)) for k, lines in ((1, ()), (2, (strong, weak))))
    monkeypatch.setattr(diagnosis, "diagnose_axes", lambda logs, held_out, **others: joints)
    cell: Any = None
    assert diagnosis.diagnose_joint_logs(cell, [], replicates=replicates).p_resolution == pytest.approx(smallest)


def test_a_ring_off_its_axis_is_a_smooth_part(tmp_path: Path) -> None:
    fitted, other = (record(tmp_path, seed, {"channel_delay": 1.0}, ring=1e-3, name=f"{seed}") for seed in (310, 311))
    one = diagnose_axes([fitted], other, replicates=49)[0]
    assert one.verdict == "named"
    assert names(one) == {"channel_delay (link)", "transmission_error"}
    assert one.transmission.smooth is not None
    assert one.gain is not None
    assert one.gain.after < 4e-5


def test_a_smooth_part_is_tested_on_records_with_zeros_of_their_own(tmp_path: Path) -> None:
    """By 0.03 degrees from one to the next: it predicts as well as where they have one in common, by a ratio within its
    interval."""
    fitted, *others = (record(tmp_path, seed, {}, ring=2e-4, noise=1e-5) for seed in (310, 311, 312))
    moved = record(tmp_path, 312, {}, ring=2e-4, noise=1e-5, zero_deg=0.03, name="moved")
    one, other = (_tested(2, [fitted], [others[0], second], SIZES, (1.0,)) for second in (others[1], moved))
    assert one is not None
    assert other is not None
    assert [other.before, other.after, other.line, *other.interval] == pytest.approx(
        [one.before, one.after, one.line, *one.interval], rel=1e-6)
    assert one.interval[0] < one.before / one.after < one.interval[1]
    assert one.after < 0.7 * one.before


def test_a_small_ring_is_no_less_likely_for_being_small(tmp_path: Path) -> None:
    """20 urad, under noise of 1 urad, by the waves of the whole turn alone: the sizes that are tried reach down to it."""
    fitted, other = (record(tmp_path, seed, {}, ring=2e-5, noise=1e-6) for seed in (310, 311))
    found = _tested(2, [fitted], [other], SIZES, (1.0,))
    assert found is not None
    assert found.confirmed


def test_a_line_in_one_record_only_is_not_named(tmp_path: Path) -> None:
    fitted, other = record(tmp_path, 320, {}, lines={700.0: 4e-5}), record(tmp_path, 321, {})
    found = find_transmission(2, [fitted], other)
    assert [round(line.cycles) for line in found.lines] == [700]
    assert found.lines[0].again > 0.02, "noise shows as much at that frequency more often than once in fifty times"
    assert not found.named
    one = diagnose_axes([fitted], other, replicates=49)[0]
    assert "transmission_error" not in names(one)


def test_a_single_record_must_agree_with_its_other_end(tmp_path: Path) -> None:
    found = find_transmission(2, [record(tmp_path, 330, MOTION, lines={700.0: 4e-5})], None)
    assert [round(line.cycles) for line in found.confirmed] == [700]
    assert "the same record" in found.again_on


def test_coloured_noise_has_no_lines(tmp_path: Path) -> None:
    """Of 8 pairs of records with nothing hidden (noise that lasts, another gear's law left out in every other one) the search
    alone may find a line in one; none is named, smooth or sharp."""
    found = [find_transmission(2, [record(tmp_path, 340 + k, faults)], record(tmp_path, 380 + k, faults))
             for k, faults in enumerate(4 * [MOTION, {"hysteresis": 1.0}])]
    assert sum(bool(one.lines) for one in found) <= 1
    assert not any(one.named for one in found)


def test_a_stiffness_stands_beside_a_smooth_error_and_lines(tmp_path: Path) -> None:
    """A ring off its axis biases the stiffness of logs over a part of the turn; beside the named error the truth is inside, and
    the interval is narrower than without the name."""
    logs = [record(tmp_path, seed, MOTION, lines={500.0: 3e-5}, ring=1.5e-3) for seed in (350, 351)]
    found = find_transmission(2, logs, None)
    assert found.named
    beside, without = axis_stiffness(2, logs, found), axis_stiffness(2, logs)
    low, high = beside.interval_95
    assert low < STIFFNESS < high
    assert beside.std < without.std


# Long: beside another law.
@pytest.mark.parametrize("faults", [{"channel_delay": 1.0}, pytest.param({"hysteresis": 1.0}, marks=pytest.mark.long)])
def test_a_zero_that_moves_changes_no_name(tmp_path: Path, faults: dict[str, float]) -> None:
    fitted, other, moved = (record(tmp_path, seed, faults, zero_deg=zero, noise=8e-6)
                            for seed, zero in ((360, 0.0), (361, 0.0), (361, 0.14)))
    before, after = (diagnose_axes([fitted], one, replicates=49)[0] for one in (other, moved))
    assert names(before) == names(after) == {"channel_delay (link)" if "channel_delay" in faults else "hysteresis"}
    assert before.verdict == after.verdict == "named"
    assert before.gain is not None
    assert after.gain is not None
    assert after.gain.ratio == pytest.approx(before.gain.ratio, rel=1e-6)
    plain, extended = after.gain.with_zero
    assert plain / extended < 0.5 * before.gain.ratio
    assert not before.zeros[0].moved
    shift = after.zeros[0]
    assert shift.moved
    assert abs(shift.shift + np.radians(0.14)) < 4 * shift.std


# Long: one shift within what it states is asked above.
@pytest.mark.long
def test_the_interval_of_a_zero_s_shift_holds(tmp_path: Path) -> None:
    """95 % intervals of 10 pairs of records under noise that lasts."""
    hit = 0
    for k in range(10):
        pair = [record(tmp_path, 400 + k, {}, noise=4e-5), record(tmp_path, 440 + k, {}, zero_deg=0.01, noise=4e-5)]
        axis = axis_of(2, pair)
        (shift,) = zero_shifts(2, Hypothesis((), (), (), solve(axis, axis.plain), 0.0), Transmission(2), pair)
        hit += abs(shift.shift + np.radians(0.01)) < 1.96 * shift.std
    assert hit >= 8


@pytest.mark.parametrize("cycles", [60.0, pytest.param(110.0, marks=pytest.mark.long)])
def test_an_error_of_a_few_waves_in_few_degrees_is_a_smooth_part(tmp_path: Path, cycles: float) -> None:
    """One or two cycles in 6 degrees: too few for a line, too fine for the waves of the whole turn."""
    logs = []
    for seed in (330, 331):
        values = columns(seed, {}, seconds=20, noise=4e-6)
        # A joint that stays within few degrees under the same torques.
        shrunk = 0.1 * np.radians(values["q2_motor_deg"])
        twist = np.radians(values["q2_motor_deg"] - values["q2_link_deg"])
        error = 4e-5 * np.sin(cycles * shrunk + 0.4)
        values |= {"q2_motor_deg": np.degrees(shrunk), "q2_link_deg": np.degrees(shrunk - twist - error)}
        del values["q2_speed_deg_s"]
        logs.append(read_motion_log(write(tmp_path / f"{seed}.csv", values)))
    one = diagnose_axes([logs[0]], logs[1], replicates=19)[0]
    assert names(one) == {"transmission_error"}
    assert one.transmission.smooth is not None
    assert one.transmission.smooth.bend > 1
    assert one.gain is not None
    assert one.gain.ratio > 1.5


def test_finer_waves_are_as_long_as_the_angles_visited() -> None:
    """Angles four times as wide and waves four times as long: the same errors are as likely, sample by sample."""
    angle = 0.3 + 0.1 * np.random.default_rng(0).uniform(size=80)
    narrow, wide = smooth_over(angle, 1e-4, 60.0), smooth_over(4 * angle, 1e-4, 15.0)
    near, far = narrow.columns(angle), wide.columns(4 * angle)
    np.testing.assert_allclose(near @ near.T, far @ far.T, atol=1e-9 * np.abs(near @ near.T).max())
    assert narrow.cycles.min() == pytest.approx(2 * np.pi / (4 * np.ptp(angle)))

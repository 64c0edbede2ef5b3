"""Each side of the limits of joint deflection logs: what is read, when a stiffness is stated, what counts as found again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from identification.common.findings import CompstiffError
from identification.model.effects.encoder_slip import EncoderSlip
from identification.model.effects.lost_samples import LostSamples
from identification.motion import crosstalk, inner_friction, leaps, lines, procedure, stiffness, transmission, zeros
from identification.motion.band import low_pass
from identification.motion.leaps import Leap
from identification.motion.lines import Line
from identification.motion.log_file import read_motion_log
from identification.motion.remainder import _spectrum
from identification.motion.stiffness import AxisStiffness, axis_stiffness
from identification.motion.transmission import SmoothTest, Transmission, find_transmission
from identification.motion.zeros import ZeroShift
from tests.identification.motion.simulated_joint import RATE, STIFFNESS, columns, write


@pytest.mark.parametrize("seconds", [2.9, 3.1])
def test_a_log_lasts_three_seconds(tmp_path: Path, seconds: float) -> None:
    path = write(tmp_path / "a.csv", columns(0, {}, seconds=seconds))
    if seconds > 3:
        assert read_motion_log(path).time[-1] == pytest.approx(seconds, abs=0.01)
    else:
        with pytest.raises(CompstiffError, match="lasts 2.90 s, expected 3 s or more"):
            read_motion_log(path)


@pytest.mark.parametrize(("longer", "even"), [(0.18, True), (0.22, False), (-0.18, True), (-0.22, False)])
def test_steps_of_a_log_differ_by_a_fifth_at_most(tmp_path: Path, longer: float, even: bool) -> None:
    """One step of 4 ms, to line 102, so much longer than the others."""
    values = columns(0, {}, seconds=4)
    values["time_s"][100:] += longer / RATE
    path = write(tmp_path / "a.csv", values)
    if even:
        assert read_motion_log(path).rate == pytest.approx(RATE, rel=1e-3)
    else:
        with pytest.raises(CompstiffError, match=rf":102: error CS1501: time_s steps by {(1 + longer) / RATE:.6g} s where the "
                                                 "log steps by 0.004 s"):
            read_motion_log(path)


def estimate(compliance: float = 2e-7, std: float = 1e-9, share: float = 0.5) -> AxisStiffness:
    return AxisStiffness(2, compliance, 0.6 * std, 0.8 * std, share, np.nan, (0.0, 0.0), "", "", 1000, 100.0)


@pytest.mark.parametrize(("sigmas", "share", "grade"), [
    (6.2, 0.5, "reliable"), (5.8, 0.5, "tentative"), (3.1, 0.5, "tentative"), (2.9, 0.5, "not identifiable"),
    (50.0, 0.022, "reliable"), (50.0, 0.018, "not identifiable")])
def test_a_stiffness_of_a_log_is_stated_from_three_sigmas_and_reliable_from_six(
        sigmas: float, share: float, grade: str) -> None:
    """Of a compliance whose noise and law have three and four fifths of its sigma; a torque of which less than 2 % is its own
    tells none."""
    found = stiffness._judged(estimate(std=2e-7 / sigmas, share=share))
    assert found.grade == grade
    assert found.refused is (grade == "not identifiable")
    assert ("1.8 % of its variance is its own, 2 % are needed" in found.reason) is (share < 0.02)


@pytest.mark.parametrize(("samples", "grade"), [(10, "tentative"), (14, "tentative"), (15, "reliable"), (50, "reliable")])
def test_a_stiffness_is_reliable_from_ten_samples_on_beyond_those_that_are_fitted(
        tmp_path: Path, samples: int, grade: str) -> None:
    """One every 0.34 s: the band takes none away. An offset, the compliance, friction, inertia and a delay are fitted."""
    values = {name: column[::85][:samples] for name, column in columns(3, {}).items()}
    found = axis_stiffness(2, [read_motion_log(write(tmp_path / "a.csv", values))])
    assert found.compliance / found.std > 12
    assert found.grade == grade
    said = f"; {samples - 5} samples beyond the coefficients that are fitted, reliable from 10 on"
    assert found.reason.endswith(said) is (samples < 15)


@pytest.mark.parametrize("hz", [0.0, 7.5, 13.5])
def test_a_stiffness_is_as_sure_as_it_is_alike_under_four_six_and_nine_hertz(tmp_path: Path, hz: float) -> None:
    """A torque of this frequency to which the joint yields half as much again: at 7.5 Hz it shows under 9 Hz alone, at 13.5 Hz
    nowhere. The law is off by the root mean square of three straight lines from that under 6 Hz."""
    values = columns(7, {}, seconds=12, noise=1e-6)
    more = 600 * np.sin(2 * np.pi * hz * values["time_s"])
    values["q2_torque_nm"] = values["q2_torque_nm"] + more
    values["q2_link_deg"] = values["q2_link_deg"] - np.degrees(1.5 * more / STIFFNESS)
    log = read_motion_log(write(tmp_path / "a.csv", values))
    one = log.joints[2]
    lines = []
    for band in (4.0, 6.0, 9.0):
        torque, deflection = low_pass(np.column_stack([one.torque, one.deflection]), log.rate, band).T
        lines.append(np.polyfit(torque, deflection, 1)[0] * STIFFNESS)
    found = axis_stiffness(2, [log])
    assert found.compliance * STIFFNESS == pytest.approx(1.0, abs=0.003)
    told = np.sqrt(np.mean((np.array(lines) - lines[1]) ** 2))
    assert bool(told > 0.03) is (hz == 7.5)
    assert found.law_std * STIFFNESS == pytest.approx(told, rel=0.1, abs=0.001)


@pytest.mark.parametrize(("apart", "grade"), [(2.5, "reliable"), (2.7, "tentative")])
def test_records_disagree_that_chance_makes_so_once_in_a_hundred(
        monkeypatch: pytest.MonkeyPatch, apart: float, grade: str) -> None:
    """Two, each known to 1 %, so many standard deviations of their difference apart: from 2.58 of a normal distribution on.
    What they scatter goes into the uncertainty of both together."""
    each = iter([2e-7, 2e-7, 2e-7 + apart * np.sqrt(2) * 2e-9])
    monkeypatch.setattr(stiffness, "_from", lambda *of: stiffness._judged(estimate(next(each), 2e-9)))
    monkeypatch.setattr(stiffness, "axis_of", lambda *of, **more: None)
    monkeypatch.setattr(stiffness, "straight_line", lambda axis: np.array([0.0, 2e-7]))
    records: Any = [SimpleNamespace(joints={2: None}, source=name) for name in ("a.csv", "b.csv")]
    found = axis_stiffness(2, records, Transmission(2))
    assert found.apart == pytest.approx(apart)
    assert found.law_std == pytest.approx(max(1.6e-9, apart * 2e-9 / np.sqrt(2)))
    assert found.grade == grade


def test_of_three_records_the_two_that_are_farthest_apart_count(monkeypatch: pytest.MonkeyPatch) -> None:
    each = iter([2e-7, 2e-7, 2.05e-7, 1.9e-7])
    monkeypatch.setattr(stiffness, "_from", lambda *of: stiffness._judged(estimate(next(each), 2e-9)))
    monkeypatch.setattr(stiffness, "axis_of", lambda *of, **more: None)
    monkeypatch.setattr(stiffness, "straight_line", lambda axis: np.array([0.0, 2e-7]))
    records: Any = [SimpleNamespace(joints={2: None}, source=name) for name in ("a.csv", "b.csv", "c.csv")]
    found = axis_stiffness(2, records, Transmission(2))
    assert found.apart == pytest.approx(15 / np.sqrt(8))
    assert found.law_std == pytest.approx(np.std([200, 205, 190], ddof=1) / np.sqrt(3) * 1e-9)


@dataclass(frozen=True)
class Rest_:
    """Two records of 30 samples, each at rest in noise that is white."""

    deflection: Any
    lengths: tuple[int, ...] = (30, 30)
    noise: Any = None
    dictionary: Any = ()


@pytest.mark.parametrize("stated", [0.25, 1.0, 9.0])
def test_a_zero_s_shift_is_as_sure_as_simulated_records_have_it(monkeypatch: pytest.MonkeyPatch, stated: float) -> None:
    """A variance that was stated too small is widened to what sixty records scatter by, one too large is left as it is."""
    columns = np.repeat(np.eye(2), 30, axis=0)
    measured = np.random.default_rng(3).normal(0, 1e-5, 60) + columns @ [1e-4, 3e-4]
    sizes = []

    def simulate(size: float, count: int, rng: np.random.Generator) -> Any:
        sizes.append(size)
        return size * rng.standard_normal(count)

    axis = Rest_(measured, noise=SimpleNamespace(simulate=simulate))

    def solve(axis: Any, columns: Any) -> Any:
        told = columns.T @ axis.deflection / 30
        left = axis.deflection - columns @ told
        return SimpleNamespace(coefficients=told, covariance=stated * (left @ left / 58) * np.eye(2) / 30, chi2=left @ left,
                               count=60)

    monkeypatch.setattr(zeros, "axis_of", lambda *of: axis)
    monkeypatch.setattr(zeros, "model_columns", lambda *of: columns)
    monkeypatch.setattr(zeros, "solve", solve)
    records: Any = [SimpleNamespace(joints={2: None}, source=name) for name in ("a.csv", "b.csv")]
    nothing: Any = None
    (found,) = zeros.zero_shifts(2, nothing, Transmission(2), records)
    first, second = measured[:30], measured[30:]
    assert found.shift == pytest.approx(second.mean() - first.mean())
    variance = (first.var() + second.var()) / 58
    assert sizes == pytest.approx([np.sqrt(30 * variance)] * 120)       # sixty times two records
    expected = np.sqrt(2 * variance * max(1.0, stated))
    # The scatter of sixty is known to a tenth.
    assert found.std == pytest.approx(expected, rel=1e-9 if stated > 4 else 0.3)
    assert (found.reference, found.record) == ("a.csv", "b.csv")


@pytest.mark.parametrize(("before", "line", "low", "confirmed"), [
    (1.27, 2.0, 1.01, True), (1.23, 2.0, 1.01, False), (2.0, 1.23, 1.01, False), (2.0, 2.0, 0.99, False)])
def test_a_smooth_part_betters_the_prediction_by_a_quarter(before: float, line: float, low: float, confirmed: bool) -> None:
    """Of the causes of any motion, and of a straight line; and no chance of the blocks that are redrawn."""
    nothing: Any = None
    assert SmoothTest(nothing, 9.0, before, 1.0, (low, 3.0), line).confirmed is confirmed


@pytest.mark.parametrize(("seconds", "searched"), [(5.8, False), (6.2, True)])
def test_a_record_of_six_seconds_is_searched_for_lines_in_its_first_part_and_its_last(
        monkeypatch: pytest.MonkeyPatch, seconds: float, searched: bool) -> None:
    """45 % at either end."""
    asked: list[tuple[float, float]] = []

    class Record:
        def __init__(self, time: Any) -> None:
            self.time, self.joints, self.source = time, {2: None}, "a.csv"

        def cut(self, start: int, stop: int) -> Record:
            return Record(self.time[start:stop])

    def session(joint: int, records: list[Record]) -> None:
        asked.extend((float(one.time[0]), float(one.time[-1])) for one in records)

    monkeypatch.setattr(transmission, "session", session)
    monkeypatch.setattr(transmission, "search", lambda *of: [])
    monkeypatch.setattr(transmission, "found_again", lambda *of: [])
    monkeypatch.setattr(transmission, "_smooth_test", lambda *of: None)
    record: Any = Record(np.arange(round(seconds * RATE) + 1) / RATE)
    found = find_transmission(2, [record], None)
    assert asked == ([(0.0, pytest.approx(0.45 * seconds, abs=0.01)), (pytest.approx(0.55 * seconds, abs=0.01), seconds)]
                     if searched else [])
    assert found.again_on == ("the last 45 % of the same record" if searched else "")


@pytest.mark.parametrize(("sigmas", "moved"), [(3.2, False), (3.4, True), (-3.4, True)])
def test_a_zero_has_moved_that_chance_moves_so_once_in_a_thousand(sigmas: float, moved: bool) -> None:
    """3.29 of a normal distribution's standard deviations either way."""
    assert ZeroShift(2, "a.csv", "b.csv", sigmas * 2e-6, 2e-6).moved is moved


@pytest.mark.parametrize(("again", "larger", "confirmed"), [(0.009, 1.0, True), (0.011, 1.0, False), (0.009, -1.0, False)])
def test_a_line_is_found_again_that_chance_finds_so_once_in_a_hundred(again: float, larger: float, confirmed: bool) -> None:
    assert Line(100.0, 0.1, 0.002, again, (larger, 2.0)).confirmed is confirmed


@pytest.mark.parametrize(("sizes", "again"), [
    ((4.1, 4.1), True), ((3.9, 4.1), False), ((4.1, -4.1), False), ((6.0, 6.0 + 2.9 * 2**0.5), True),
    ((6.0, 6.0 + 3.1 * 2**0.5), False)])
def test_each_half_of_a_log_has_another_torque_to_four_sigmas_and_both_the_same_to_three(
        monkeypatch: pytest.MonkeyPatch, sizes: tuple[float, float], again: bool) -> None:
    """Sizes in sigmas, which are 1 and independent: of their difference the square root of two."""
    solved = SimpleNamespace(coefficients=np.array([0.0, *sizes]), covariance=np.eye(3))
    monkeypatch.setattr(crosstalk, "solve", lambda axis, columns: solved)
    axis: Any = SimpleNamespace(lengths=(10,))
    assert crosstalk._found_again(axis, np.ones((10, 1)), np.ones(10)) is again


@pytest.mark.parametrize(("hz", "band"), [
    (0.8, 0), (1.2, 1), (2.8, 1), (3.2, 2), (9.5, 2), (10.5, 3), (19.0, 3), (21.0, 4), (38.0, 4), (42.0, 5)])
def test_what_is_left_is_told_by_these_bands(hz: float, band: int) -> None:
    """One sine: all of its variance lies between two of 0, 1, 3, 10, 20, 40 Hz and half the rate."""
    residual = 1e-5 * np.sin(2 * np.pi * hz * np.arange(5000) / RATE)
    spectrum, (line, share) = _spectrum([residual], [RATE])
    assert [(low, high) for low, high, _ in spectrum] == [(0, 1), (1, 3), (3, 10), (10, 20), (20, 40), (40, 125)]
    assert [of_band > 0.98 for _, _, of_band in spectrum] == [number == band for number in range(6)]
    if band:
        assert line == pytest.approx(hz, abs=0.06)
        assert share > 0.9


def sets(*of: tuple[tuple[int, ...], float], names: Sequence[str]) -> tuple[Any, ...]:
    """Sets of entries with their probabilities."""
    return tuple(SimpleNamespace(entries=entries, probability=probability, names=tuple(names[k] for k in entries),
                                 columns=lambda axis: None) for entries, probability in of)


def dictionary(*names: str) -> Any:
    """An axis recorded at 250 and 100 Hz, with these effects in its dictionary, one shape each."""
    return Axis_(dictionary=[[SimpleNamespace(name=name)] for name in names])


@dataclass(frozen=True)
class Axis_:
    dictionary: Any
    rates: tuple[float, ...] = (100.0, 250.0)
    smooth: Any = None


@pytest.mark.parametrize(("bend", "odds", "at_work", "kept"), [
    (2.0, 21.0, 0.0, True), (2.0, 19.0, 1.0, False), (1.0, 1.0, 0.55, True), (1.0, 1.0, 0.45, False)])
def test_a_smooth_part_is_needed_that_is_twenty_times_likelier_than_other_causes_or_as_likely_as_not(
        monkeypatch: pytest.MonkeyPatch, bend: float, odds: float, at_work: float, kept: bool) -> None:
    """Finer waves are held against the likeliest causes without an error over the angle; one wave is in the dictionary."""
    axis = dictionary("hysteresis", "transmission_error")
    hypotheses = sets(((1,), at_work), ((0,), 1 - at_work), names=("hysteresis", "transmission_error"))
    for name, answer in (("axis_of", axis), ("stands_for_torque", False), ("with_crosstalk", axis), ("survey", hypotheses),
                         ("evidence_beside", np.log([odds]))):
        monkeypatch.setattr(procedure, name, lambda *of, answer=answer: answer)
    test: Any = SimpleNamespace(smooth=SimpleNamespace(size=1e-4, bend=bend), confirmed=True)
    monkeypatch.setattr(Transmission, "smooth_over", lambda self, records: test.smooth)
    assert (procedure._needed(Transmission(2, (), test), []).smooth_test is not None) is kept


@pytest.mark.parametrize(("name", "values", "std", "told"), [
    ("hysteresis", [2.1], [1.0], True), ("hysteresis", [1.9], [1.0], False), ("hysteresis", [1.9, -2.1], [1.0, 1.0], True),
    ("hysteresis", [1.9, 99.0], [1.0, np.nan], False), ("channel_delay (link)", [4.4e-5], [1e-6], True),
    ("channel_delay (link)", [3.6e-5], [1e-6], False), ("joint_friction", [3.6e-5], [1e-6], True)])
def test_a_cause_is_two_sigmas_from_nothing_and_a_delay_a_hundredth_of_a_sample(
        monkeypatch: pytest.MonkeyPatch, name: str, values: list[float], std: list[float], told: bool) -> None:
    """Of 250 Hz, the fastest record: 40 us."""
    cause = SimpleNamespace(values=np.array(values), std=np.array(std))
    monkeypatch.setattr(procedure, "_likeliest", lambda *of: None)
    monkeypatch.setattr(procedure, "_averaged", lambda *of: cause)
    assert procedure._told(dictionary(name), (), 0) is told


@pytest.mark.parametrize(("lag_s", "others", "damped"), [(0.00058, 0.3, True), (0.00063, 0.3, False), (0.00058, 0.9, False)])
def test_a_gear_is_damped_as_gears_are_up_to_0_6_ms(
        monkeypatch: pytest.MonkeyPatch, lag_s: float, others: float, damped: bool) -> None:
    monkeypatch.setattr(procedure, "cause_of", lambda *of: SimpleNamespace(values=np.array([lag_s])))
    hypotheses = sets(((0,), 1 - others), ((1,), others), names=("gear_damping", "hysteresis"))
    found = procedure._damped(dictionary("gear_damping", "hysteresis"), hypotheses)
    assert (found is hypotheses[0]) is damped


def test_other_causes_are_told_from_one_in_fifty_on(monkeypatch: pytest.MonkeyPatch) -> None:
    names = ("hysteresis", "soft_zone", "backlash")
    hypotheses = sets(((0,), 0.957), ((1,), 0.022), ((2,), 0.018), names=names)
    monkeypatch.setattr(procedure, "_averaged", lambda axis, hypotheses, entry, cause: cause)
    monkeypatch.setattr(procedure, "cause_of", lambda axis, hypothesis, k, probability: (hypothesis.names[k], probability))
    told: Any = procedure._causes(dictionary(*names), hypotheses, hypotheses[0])
    assert told == ((("hysteresis", 0.957),), (("soft_zone", 0.022),))


@pytest.mark.parametrize(("probability", "certain"), [(0.955, True), (0.945, False)])
def test_a_cause_of_a_log_is_certain_to_nineteen_in_twenty(
        monkeypatch: pytest.MonkeyPatch, probability: float, certain: bool) -> None:
    names = ("hysteresis", "soft_zone")
    hypotheses = sets(((0,), probability), ((1,), 1 - probability), ((), 0.0), names=names)
    axis = dictionary(*names)
    monkeypatch.setattr(procedure, "_told", lambda *of: True)
    monkeypatch.setattr(procedure, "held_out", lambda *of: (None, [True]))
    monkeypatch.setattr(Axis_, "joint", 2, raising=False)
    monkeypatch.setattr(Axis_, "band", 6.0, raising=False)
    found, withdrawn = procedure._predictive(axis, hypotheses, hypotheses[2], Transmission(2), [], None)
    assert found is hypotheses[0 if certain else 2]
    assert withdrawn == ()


@pytest.mark.parametrize(("causes", "explained", "patterns", "named"), [
    (1, 0.951, 1, True), (1, 0.949, 1, False), (1, 0.2, 0, True), (0, 0.99, 0, False), (2, 0.95, 3, True)])
def test_causes_are_named_that_leave_no_pattern_or_a_twentieth_of_the_misfit(
        causes: int, explained: float, patterns: int, named: bool) -> None:
    assert procedure.enough(causes * ("cause",), explained, patterns * ("the torque",)) is named


def leap(effect: Any, size: float = 1e-4) -> Any:
    return Leap(effect, 2, "a.csv", size, 1e-6, 5.0, 0.005)


def moving(stands: float = 9.0) -> Any:
    """A record of ten seconds at 250 Hz, which moves but for one sample so long after the middle."""
    time = np.arange(2500) / RATE
    speed = np.where(np.abs(time - 5.0 - stands) < 1e-6, 0.0, 0.3)
    return SimpleNamespace(joints={2: SimpleNamespace(time=time, speed=speed)})


@pytest.mark.parametrize(("larger", "seen"), [(2.1, True), (1.9, False)])
def test_lost_samples_leave_twice_as_much_from_then_on(monkeypatch: pytest.MonkeyPatch, larger: float, seen: bool) -> None:
    record = moving()
    after = record.joints[2].time >= 5.0
    left = iter([np.where(after, larger, 9.0), np.ones(2500)])
    monkeypatch.setattr(leaps, "_left", lambda joint, record: next(left))
    monkeypatch.setattr(leaps, "_less", lambda record, leap: record)
    assert leaps._seen(leap(LostSamples()), record) is seen


@pytest.mark.parametrize(("stands", "size", "seen"), [(0.096, 1e-4, False), (0.104, 1e-4, True), (-0.096, 1e-4, False),
                                                     (9.0, 0.9e-5, False), (9.0, 1.1e-5, True)])
def test_a_zero_leaps_in_motion_of_a_tenth_of_a_second_either_way(
        monkeypatch: pytest.MonkeyPatch, stands: float, size: float, seen: bool) -> None:
    """And by more than the samples scatter, which is 10 urad."""
    monkeypatch.setattr(leaps, "_left", lambda joint, record: np.full(2500, 1e-5))
    monkeypatch.setattr(leaps, "_less", lambda record, leap: record)
    assert leaps._seen(leap(EncoderSlip(), size), moving(stands)) is seen


@pytest.mark.parametrize(("chance", "aside", "found"), [
    (0.011, 0.0, False), (0.009, 0.0, True), (0.009, 0.28, True), (0.009, 0.32, False)])
def test_a_leap_is_rarer_than_one_in_a_hundred_where_the_record_is_most_abrupt(
        monkeypatch: pytest.MonkeyPatch, chance: float, aside: float, found: bool) -> None:
    """Both looks see it within 0.3 s: a step that is larger elsewhere is not it."""
    time = np.arange(0.0, 8.0, 0.02)
    def steps(axis: Any, record: Any, moments: Any) -> Any:
        along = np.tile(np.where(np.abs(moments - (4.0 + aside)) < 0.005, 9.0, 0.0), 2)
        return SimpleNamespace(along=along, by_chance=lambda largest, rng: chance if largest else 1.0)

    it = leap(EncoderSlip())
    for name, answer in (("axis_of", SimpleNamespace(time=time)), ("session", SimpleNamespace(axis=1)), ("_most_abrupt", 4.0),
                         ("_at", it), ("_seen", True)):
        monkeypatch.setattr(leaps, name, lambda *of, answer=answer: answer)
    monkeypatch.setattr(leaps, "_steps", steps)
    nothing: Any = None
    assert leaps._largest(2, nothing, nothing) is (it if found else None)


@pytest.mark.parametrize(("span", "reached", "found"), [(0.022, 4, True), (0.022, 5, False), (0.018, 0, False)])
def test_a_line_is_found_that_one_in_a_hundred_of_499_residuals_reaches(
        monkeypatch: pytest.MonkeyPatch, span: float, reached: int, found: bool) -> None:
    """By a joint that moves by 20 mrad."""
    axis = SimpleNamespace(angle=np.linspace(0.0, span, 50), logs=[SimpleNamespace(time=np.arange(50) / RATE)])
    session: Any = SimpleNamespace(axis=axis, resolution=300.0, speed=np.ones(50))
    cycles = 600.0 + 10.0 * np.arange(9)
    spectrum = SimpleNamespace(gain=lambda: np.where(cycles == 640, 9.0, 1.0), by_chance=lambda count, rng: np.where(
        np.arange(count) < reached, 9.5, 2.0)[:, None] * np.ones(9))
    monkeypatch.setattr(lines, "fitted", lambda one, of: SimpleNamespace(left=None, noise=None, session=session))
    monkeypatch.setattr(lines, "frequencies", lambda *of: SimpleNamespace(cycles=cycles))
    monkeypatch.setattr(lines, "angle_spectrum", lambda *of: spectrum)
    monkeypatch.setattr(lines, "_refined", lambda fits, cycles, apart: (cycles, 0.1))
    told = lines.search([session], np.random.default_rng(0))
    assert [(line.cycles, line.p_value) for line in told] == [(640.0, (1 + reached) / 500)] * found


@pytest.mark.parametrize(("same", "holds"), [(0.52, True), (0.48, False)])
def test_a_line_s_phase_holds_that_predicts_half_as_well_as_the_record_s_own(same: float, holds: bool) -> None:
    assert Line(100.0, 0.1, 0.002, 0.002, (4.0, 4.0 * same)).phase_holds is holds


@pytest.mark.parametrize(("alone", "beside", "told"), [(3.2, 3.2, True), (2.8, 9.0, False), (9.0, 2.8, False)])
def test_another_joint_s_torque_is_a_cause_that_is_e_3_times_likelier(
        monkeypatch: pytest.MonkeyPatch, alone: float, beside: float, told: bool) -> None:
    """Beside all causes of the dictionary, and beside the likeliest of them."""
    shape = SimpleNamespace(name="torque_crosstalk", columns=np.ones((9, 1)))
    best = SimpleNamespace(shapes=(), columns=lambda axis: "best")
    monkeypatch.setattr(crosstalk, "shapes", lambda *of: [[shape]])
    monkeypatch.setattr(crosstalk, "survey", lambda axis: (best,))
    monkeypatch.setattr(crosstalk, "turned", lambda axis, tried: SimpleNamespace(plain=np.ones((9, 1))))
    monkeypatch.setattr(crosstalk, "evidence", lambda axis, shape, base: (
        {"widest": alone, "best": beside}[base] if isinstance(base, str) else 1.0))
    monkeypatch.setattr(crosstalk, "_found_again", lambda *of: True)
    axis: Any = SimpleNamespace(logs=[SimpleNamespace(others={3: None})], rates=None, band=6.0, widest="widest")
    assert crosstalk.crosstalk(axis) == [shape] * told


@pytest.mark.parametrize(("evidence", "kept"), [(3.2, True), (2.8, False)])
def test_friction_inside_a_gear_is_looked_for_where_the_twist_has_it_by_e_3(
        monkeypatch: pytest.MonkeyPatch, evidence: float, kept: bool) -> None:
    monkeypatch.setattr(inner_friction, "_more_than_noise", lambda axis, inside: False)
    monkeypatch.setattr(inner_friction, "_evidence", lambda axis, inside: evidence)
    axis = inner_friction.without_torque_noise(dictionary("joint_friction", "hysteresis"))
    assert [group[0].name for group in axis.dictionary] == ["joint_friction", "hysteresis"][:2 if kept else 1]

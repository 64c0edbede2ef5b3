"""Sets of causes of a joint's log and what they predict, piece by piece: least squares of the samples, sums by hand."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from identification.model.effects import effects
from identification.model.effects.channel_delay import ChannelDelay
from identification.motion import causes, dictionary, procedure, search
from identification.motion.axis import Axis, Solved, axis_of, solve
from identification.motion.band import BAND, low_pass
from identification.motion.blocks import ratio_interval
from identification.motion.causes import LogCause, cause_of
from identification.motion.dictionary import EXCLUSIVE, LINK_DELAY, Shape
from identification.motion.inner_friction import _no_twist
from identification.motion.leaps import KINDS, Leap
from identification.motion.lines import Line
from identification.motion.log_file import MotionLog
from identification.motion.prediction import Gain, _folds, _splits, held_out, model_columns, residual_on
from identification.motion.products import products
from identification.motion.proxies import evidence, turned
from identification.motion.remainder import _share, angle_columns
from identification.motion.search import Hypothesis, survey
from identification.motion.transmission import Transmission
from tests.identification.motion.test_laws_transmission import record


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> MotionLog:
    return record(tmp_path_factory.mktemp("sets"), 300, {"channel_delay": 1.0, "joint_friction": 1.0})


@pytest.fixture(scope="module")
def axis(log: MotionLog) -> Axis:
    return axis_of(2, [log])


@pytest.fixture(scope="module")
def sets(axis: Axis) -> tuple[Hypothesis, ...]:
    return survey(axis, 2)


def test_every_set_is_answered_as_least_squares_of_the_samples(axis: Axis, sets: tuple[Hypothesis, ...]) -> None:
    """Its answer, its evidence by the information criterion, and its probability among all: one cause in seven beforehand."""
    plain = solve(axis, axis.plain)
    logs = []
    for one in sets:
        own = solve(axis, one.columns(axis))
        assert_allclose(one.solved.coefficients, own.coefficients, rtol=1e-5, atol=1e-9 * np.abs(own.coefficients).max())
        assert one.solved.chi2 == pytest.approx(own.chi2, rel=1e-6)
        assert_allclose(one.columns(axis), model_columns(axis, one), atol=1e-12)
        price = 0.0
        for name, kept, shape in zip(one.names, one.kept, one.shapes, strict=True):
            for column in kept:
                place = axis.plain.shape[1] + sum(map(len, one.kept[:one.shapes.index(shape)])) + kept.index(column)
                usual = 0.5 * np.log(own.count)
                if name == LINK_DELAY:       # known beforehand to some milliseconds
                    std = np.sqrt(own.covariance[place, place])
                    usual = max(usual, np.log(2 * 0.004 / (np.sqrt(2 * np.pi) * std)))
                price += usual
                sign = shape.signs[column]
                assert sign * own.coefficients[place] >= 0
        gain = 0.5 * own.count * np.log(plain.chi2 / own.chi2) - price
        if not {LINK_DELAY, "joint_friction"} <= set(one.names):
            assert one.log_evidence == pytest.approx(gain, abs=1e-3)
        logs.append(one.log_evidence + len(one.entries) * np.log(0.15 / 0.85))
    weight = np.exp(np.array(logs) - max(logs))
    assert_allclose([one.probability for one in sets], weight / weight.sum(), atol=1e-12)
    assert logs == sorted(logs, reverse=True)
    assert set(sets[0].names) == {LINK_DELAY, "joint_friction"}         # what is hidden there
    assert not any({"backlash", "soft_zone"} <= set(one.names) for one in sets)
    found, names = {one.entries for one in sets}, [group[0].name for group in axis.dictionary]
    alone = sorted(entries[0] for entries in found if len(entries) == 1)
    # One whose sign is wrong is none; the pairs behind two that exclude each other are looked at all the same.
    assert {names[k] for k in alone} >= {LINK_DELAY, "backlash", "soft_zone", "transmission_error"}
    pairs = [pair for pair in combinations(alone, 2) if {names[k] for k in pair} not in EXCLUSIVE]
    assert pairs[-1] in found
    assert len(found & set(pairs)) > 0.8 * len(pairs)
    assert max(len(one.entries) for one in sets) == 2
    assert sum(one.entries == () for one in sets) == 1


def test_the_widest_model_has_the_middle_shape_of_each_effect_and_no_damping(axis: Axis) -> None:
    """The plain spring first; a damped gear's column is that of a torque that is late."""
    width = axis.plain.shape[1]
    assert_allclose(axis.widest[:, :width], np.column_stack([np.ones(len(axis.torque)), axis.torque]))
    groups = [group for group in axis.dictionary if group[0].name != "gear_damping"]
    assert len(groups) == len(axis.dictionary) - 1
    assert max(len(group) for group in groups) > 4
    for group in groups:
        middle = group[round((len(group) - 1) / 2 + 0.1)].columns
        assert_allclose(axis.widest[:, width: width + middle.shape[1]], middle)
        width += middle.shape[1]
    assert width == axis.widest.shape[1]


@pytest.mark.parametrize(("reach", "tried"), [
    (700.0, [12.5, 25.0, 50.0, 100.0, 200.0]), (1200.0, [12.5, 25.0, 50.0, 100.0, 200.0, 400.0, 800.0 / 2]),
    (5000.0, [50.0, 100.0, 200.0, 400.0, 800.0]), (300.0, [6.25, 12.5, 25.0, 50.0, 100.0]), (4.0, [6.25])])
def test_a_law_is_tried_at_torques_that_the_log_reaches(reach: float, tried: list[float]) -> None:
    """A grid of 100 and 200 N m for gears of every size: sixteen times more and 64 times less by fours, from a hundredth of the
    largest torque and what the law begins at (6 N m) up to half of it and where it ends (1000 N m); one at least."""
    linear, bent = SimpleNamespace(grid=()), SimpleNamespace(grid=(100.0, 200.0), low=6.0, high=1000.0)
    effect: Any = SimpleNamespace(parameters=[linear, bent])
    found = np.array(dictionary._grid(effect, reach))
    assert np.isnan(found[:, 0]).all()
    assert found[:, 1].tolist() == list(dict.fromkeys(tried))


@pytest.mark.parametrize(("name", "reach", "off"), [
    ("backlash", 1e5, (0.0, 30.0, 100.0)), ("backlash", 1000.0, (0.0, 15.0, 60.0)), ("backlash", 1800.0, (0.0, 27.0, 100.0)),
    ("soft_zone", 1e5, (0.0, 150.0)), ("hysteresis", 1e5, (0.0,))])
def test_free_play_is_crossed_early_or_late_and_a_soft_zone_ends_over_a_range(
        name: str, reach: float, off: tuple[float, ...]) -> None:
    """By 30 and 100 N m, on small joints 1.5 and 6 % of the largest torque; over 0.6 of the torque (250 N m) it ends at."""
    effect: Any = SimpleNamespace(name=name)
    assert dictionary._smears(effect, np.array([np.nan, 250.0]), reach) == pytest.approx(off)


def test_leaps_of_a_kind_are_one_cause_with_the_size_of_the_largest() -> None:
    """As sure as the least sure of them; slips of an encoder and lost samples are two."""
    slip, lost = KINDS
    leaps = (Leap(slip, 2, "a.csv", 1e-4, 1e-6, 3.0, 0.005), Leap(lost, 2, "a.csv", -0.012, 1e-4, 5.0, 0.01),
             Leap(slip, 2, "b.csv", -3e-4, 2e-6, 7.0, 0.002), Leap(slip, 2, "b.csv", 2e-4, 3e-6, 9.0, 0.008))
    slips, losses = causes.leap_causes(leaps)
    assert (slips.shape.effect, slips.joint, slips.probability) == (slip, 2, 1 - 0.008)
    assert slips.values.tolist() == [-3e-4, 7.0]
    assert_allclose(slips.std, [2e-6, np.nan])
    assert slips.estimates == ("+100 urad (+- 2) at 3.00 s of a.csv; -300 urad (+- 4) at 7.00 s of b.csv; "
                               "+200 urad (+- 6) at 9.00 s of b.csv")
    assert (losses.values.tolist(), losses.probability) == ([-0.012, 5.0], 0.99)
    assert losses.estimates == "12 ms of the link's channel missing at 5.00 s of a.csv"
    assert causes.leap_causes(leaps[:1])[0].shape.effect is slip
    assert causes.leap_causes(()) == ()


@pytest.mark.parametrize("smooth", [False, True])
@pytest.mark.parametrize("confirmed", [0, 1, 2])
def test_a_transmission_error_is_its_strongest_line_and_the_size_of_its_smooth_part(confirmed: int, smooth: bool) -> None:
    """The mean of the two records' sizes, the phase of the first record; a smooth part that swings to 40 urad has an RMS of
    that over the angles visited. As sure as the line that was found again the most clearly."""
    if not confirmed + smooth:
        return
    lines = [Line(413.26, 0.04, 0.002, 0.004), Line(60.0, 0.02, 0.002, 0.006)][:confirmed]
    sizes = {"a.csv": 1e-6 * np.exp(0.5j) * np.array([21.0, 50.0]), "b.csv": 1e-6 * np.exp(-0.2j) * np.array([23.0, 80.0])}
    records: Any = [SimpleNamespace(source=name, joints={joint: None}) for name, joint in (("a.csv", 2), ("c.csv", 3),
                                                                                         ("b.csv", 2))]
    found: Any = SimpleNamespace(confirmed=lines, again_on="d.csv",
                                 amplitudes=lambda several: sizes[several[0].source][:confirmed])
    angle = np.linspace(0.0, np.radians(90.0), 5)
    plain = np.column_stack([np.ones(5), np.arange(5.0), [1.0, -1.0, 1.0, -1.0, 0.0], [0.0, 0.0, 0.0, 0.0, 2.0]])
    axis: Any = SimpleNamespace(joint=2, smooth=smooth or None, spring=plain[:, :2], plain=plain, angle=angle)
    hypothesis: Any = SimpleNamespace(solved=SimpleNamespace(coefficients=np.array([7.0, 8.0, 4e-5, 2e-5, 9.0])))
    cause = causes.transmission_cause(axis, hypothesis, found, records)
    rms = float(np.std([4e-5, -4e-5, 4e-5, -4e-5, 4e-5])) if smooth else 0.0
    line = [(22e-6, 413.26, 0.5), (65e-6, 60.0, 0.5)][confirmed - 1] if confirmed else (0.0, np.nan, np.nan)
    assert_allclose(cause.values, [rms, *line])
    assert_allclose(cause.std, [np.nan, np.nan, [0.04, 0.02][confirmed - 1] if confirmed else np.nan, np.nan])
    assert (cause.joint, cause.shape.name) == (2, "transmission_error")
    assert cause.probability == pytest.approx(1 - 0.004 if confirmed else 0.975)
    words = ["", "1 line, the strongest 22.0 urad at 413.3 +- 0.1 cycles a turn",
             "2 lines, the strongest 65.0 urad at 60.0 +- 0.0 cycles a turn"][confirmed]
    waves = f"a smooth part of {1e6 * rms:.0f} urad RMS over 90 deg"
    assert cause.estimates == " and ".join([words] * bool(confirmed) + [waves] * smooth) + ", found again in d.csv"


def test_products_know_which_columns_double_each_other(axis: Axis) -> None:
    known = products(axis)
    shapes = [shape for group in axis.dictionary for shape in group]
    for shape in shapes:
        places = known.places([shape], [range(shape.columns.shape[1])])
        unit = np.column_stack([axis.plain, shape.columns])
        unit = unit / np.linalg.norm(unit, axis=0)
        least = np.linalg.svd(unit, compute_uv=False)[-1]
        assert known.doubled(places, least * 1.01)
        assert not known.doubled(places, least * 0.99)
    assert known.plain == axis.plain.shape[1]


def test_a_coefficient_on_the_wrong_side_of_nothing_is_the_first_to_go() -> None:
    """The one that is furthest, in its own standard deviations."""
    shape: Any = SimpleNamespace(signs=(1, 0, -1))
    other: Any = SimpleNamespace(signs=(1,))
    answer = Solved(np.array([9.0, -2.0, -5.0, 1.0, -3.0]), np.diag([1.0, 4.0, 1.0, 0.01, 9.0]), 1.0, 10)
    # -1 sigma, free, 10 sigma of a negative one, -1 sigma.
    assert search._wrong_sign(answer, 1, (shape, other), [[0, 1, 2], [0]]) == (0, 2)
    right = replace(answer, coefficients=np.array([9.0, 2.0, -5.0, -1.0, -3.0]))
    assert search._wrong_sign(right, 1, (shape, other), [[0, 1, 2], [0]]) == (1, 0)
    alone = Solved(right.coefficients[:4], right.covariance[:4, :4], 1.0, 10)
    assert search._wrong_sign(alone, 1, (shape,), [[0, 1, 2]]) is None
    kept = [[0, 1], [0], [0]]
    assert search._drop_doubled(kept)
    assert kept == [[0], [0], [0]]
    assert not search._drop_doubled(kept)


def test_a_parameter_that_acts_through_the_spring_is_a_ratio_with_its_spread() -> None:
    """Of the coefficient and the compliance, drawn together."""
    effect = effects()["joint_friction"]
    shape = Shape(effect, np.zeros(2), (0, 1), np.zeros((5, 2)), True, (1, 1))
    delay = Shape(ChannelDelay("link"), np.zeros(1), (0,), np.zeros((5, 1)), False, (0,))
    rng = np.random.default_rng(0)
    root = rng.standard_normal((5, 5)) * np.array([1, 2e-10, 1e-5, 3e-8, 1e-8])[:, None] * 0.1
    mean = np.array([0.01, 2e-7, 3e-3, 6e-5, 4e-5])
    answer = Solved(mean, root @ root.T, 1.0, 100)
    found = Hypothesis((0, 1), (delay, shape), ((0,), (0, 1)), answer, 1.0)
    axis: Any = SimpleNamespace(lengths=(5,), plain=np.zeros((5, 2)), joint=4)
    cause = cause_of(axis, found, 1, 0.9)
    draws = rng.multivariate_normal(mean, root @ root.T, 200_000)
    ratio = draws[:, 3:] / draws[:, 1:2]
    assert_allclose(cause.values, mean[3:] / mean[1])
    assert_allclose(cause.std, ratio.std(axis=0), rtol=0.02)
    late = cause_of(axis, found, 0, 0.9)
    assert (late.values[0], late.label) == (3e-3, "channel_delay (link) [4]")
    assert late.std[0] == pytest.approx(np.sqrt((root @ root.T)[2, 2]))
    assert late.sentence.startswith("the link encoders were recorded behind the motor encoders")
    assert replace(late, values=-late.values).sentence.startswith("the link encoders were recorded ahead of the motor")
    alone = cause_of(axis, replace(found, kept=((0,), (1,)), solved=Solved(mean[[0, 1, 2, 4]], np.eye(4), 1.0, 9)), 1, 0.5)
    assert_allclose(alone.values, [0.0, 200.0])
    assert np.isnan(alone.std[0])


@pytest.mark.parametrize(("values", "pooled"), [
    ([(1.0, 0.1), (1.2, 0.1)], (1.1, 0.1)), ([(1.0, 0.1), (1.01, 0.2)], (1.002, (125) ** -0.5)), ([(3.0, 0.5)], (3.0, 0.5)),
    ([(1.0, 0.1), (2.0, np.nan)], (1.5, 0.1)), ([(1.0, np.nan)], (1.0, None))])
def test_joints_are_pooled_by_their_spread_which_widens_where_they_differ(
    values: list[tuple[float, float]], pooled: tuple[float, float | None],
) -> None:
    """Two that are 0.2 apart, each known to 0.1: Birge's ratio is the root of two."""
    mean, std = causes._pooled(values)
    assert mean == pytest.approx(pooled[0])
    assert std == (None if pooled[1] is None else pytest.approx(pooled[1]))


def test_causes_of_no_joint_are_one_over_joints_and_told_by_the_least_sure() -> None:
    delay = Shape(ChannelDelay("link"), np.zeros(1), (0,), np.zeros((5, 1)), False, (0,))
    gear = Shape(effects()["motor_inertia"], np.zeros(1), (0,), np.zeros((5, 1)), True, (1,))
    found = [LogCause(delay, 1, 0.99, np.array([0.002]), np.array([1e-4])), LogCause(gear, 1, 0.9, np.ones(1), np.ones(1)),
             LogCause(delay, 2, 0.97, np.array([0.004]), np.array([1e-4])), LogCause(gear, 2, 0.8, np.ones(1), np.ones(1))]
    groups = causes.over_joints(found)
    assert [[cause.joint for cause in group] for group in groups] == [[1, 2], [1], [2]]
    told = causes.group_as_dict(groups[0])
    assert (told["joint"], told["probability"], told["channel"]) == (None, 0.97, "link")
    assert told["parameters"]["delay_s"]["estimate"] == pytest.approx(0.003)
    assert told["by_joint"]["2"] == {"delay_s": {"estimate": 0.004, "std": 1e-4}}
    assert "by_joint" not in causes.group_as_dict(groups[1])
    assert causes.group_as_dict(groups[1])["joint"] == 1


def test_the_other_side_of_a_joint_is_its_torque_by_its_twist(axis: Axis) -> None:
    shape = axis.dictionary[0][0]
    back = turned(axis, [shape])
    assert back.deflection is axis.torque
    assert back.torque is axis.deflection
    assert [group[0] for group in back.dictionary] == [shape]
    with_it = np.column_stack([back.plain, shape.columns])
    chi2 = [solve(back, columns).chi2 for columns in (back.plain, with_it)]
    count = solve(back, back.plain).count
    assert evidence(back, shape, back.plain) == pytest.approx(
        0.5 * count * np.log(chi2[0] / chi2[1]) - 0.5 * shape.columns.shape[1] * np.log(count))


def test_an_angle_s_polynomials_reach_from_end_to_end() -> None:
    angle = np.array([2.0, 2.5, 3.0, 4.0])
    place = np.array([-1.0, -0.5, 0.0, 1.0])
    assert_allclose(angle_columns(angle, degree=3), np.column_stack([place, 2 * place**2 - 1, 4 * place**3 - 3 * place]))
    assert_allclose(angle_columns(np.array([1.0, 5.0]), (2.0, 4.0), 2), [[-1, 1], [1, 1]])


def test_what_is_left_follows_the_angle_where_it_is_a_curve_over_it(axis: Axis) -> None:
    rng = np.random.default_rng(0)
    place = (axis.angle - axis.angle.mean()) / np.ptp(axis.angle)
    share, p_value = _share(axis, axis.angle, 3.0 + place**2 - place, rng)
    assert share == pytest.approx(1.0)
    assert p_value == 1 / 401
    curve, noise = place**2 - np.mean(place**2), rng.standard_normal(len(place))
    part, _ = _share(axis, axis.angle, curve / np.std(curve) + noise / np.std(noise), rng)
    assert part == pytest.approx(0.5, abs=0.1)
    _, by_chance = _share(axis, axis.angle, noise, rng)
    assert by_chance > 0.02


@pytest.mark.parametrize(("waves", "followed"), [(6, True), (7, False)])
def test_what_is_left_follows_curves_of_up_to_the_sixth_degree(axis: Axis, waves: int, followed: bool) -> None:
    place = 2 * (axis.angle - axis.angle.min()) / np.ptp(axis.angle) - 1
    share, _ = _share(axis, axis.angle, np.cos(waves * np.arccos(np.clip(place, -1, 1))), np.random.default_rng(0))
    assert (share > 1 - 1e-6) is followed
    assert followed or share < 0.9


def test_no_twist_of_the_gear_are_zeros_errors_over_the_angle_and_delays_of_the_link() -> None:
    """Columns of two records' zeros, the torque, two waves over the angle, then hysteresis (one), a transmission error (two)
    and the link's delay (one): what each of ours makes, added up."""
    rng = np.random.default_rng(3)
    beside, coefficients = rng.normal(size=(5, 9)), rng.normal(size=9)
    axis: Any = SimpleNamespace(lengths=(3, 2), spring=beside[:, :3], plain=beside[:, :5])
    others: Any = [SimpleNamespace(name=name, columns=np.empty((5, width)))
                   for name, width in (("hysteresis", 1), ("transmission_error", 2), (LINK_DELAY, 1))]
    made = sum(coefficients[k] * beside[:, k] for k in (0, 1, 3, 4, 6, 7, 8))
    assert_allclose(_no_twist(axis, others, beside, coefficients), made)


def test_what_is_held_out_and_what_it_is_predicted_by(log: MotionLog) -> None:
    other = replace(log, source="other.csv")
    splits, how = _splits(2, [log, other], None)
    assert how == "each record by the others"
    assert [(one.train, one.test, one.apart) for one in splits] == [([other], log, True), ([log], other, True)]
    splits, how = _splits(2, [log], other)
    assert (how, splits[0].train, splits[0].test, splits[0].apart) == ("validate: other.csv", [log], other, True)
    splits, how = _splits(2, [log], None)
    assert how == "cross-validation by 5 blocks of time"
    blocks = _folds(log)
    assert [len(one.test.time) for one in blocks] == [500] * 5
    assert [[len(piece.time) for piece in one.train] for one in blocks] == [
        [2000], [500, 1500], [1000, 1000], [1500, 500], [2000]]
    assert not any(one.apart for one in blocks)
    assert blocks[1].train[1].time[0] == log.time[1000]


def test_a_gain_is_that_of_a_straight_line_and_the_causes_on_a_record_with_a_zero_of_its_own(
        log: MotionLog, sets: tuple[Hypothesis, ...]) -> None:
    """Another record of the same motion, its zero 50 urad higher: the line of what passes the band, at full rate; what a model
    explains is one less its share of the squares about the record's mean."""
    one = log.joints[2]
    other = replace(log.less(2, np.full(len(log.time), -5e-5)), source="other.csv")
    gain, helps = held_out(2, BAND, sets[0], Transmission(2), [log], other)
    torque, deflection = low_pass(np.column_stack([one.torque, one.deflection]), log.rate).T
    slope, offset = np.polyfit(torque, deflection, 1)
    left = one.deflection - slope * one.torque
    about = np.sum((one.deflection - one.deflection.mean()) ** 2)
    assert gain.before == pytest.approx(np.std(left), rel=1e-6)
    assert_allclose(gain.residuals[:, 0], left - left.mean(), atol=1e-12)
    assert gain.with_zero[0] == pytest.approx(np.sqrt(np.mean((left + 5e-5 - offset) ** 2)), rel=1e-6)
    assert gain.after == pytest.approx(np.sqrt(np.mean(gain.residuals[:, 1] ** 2)))
    assert gain.explained == pytest.approx([1 - np.sum(column**2) / about for column in gain.residuals.T])
    assert gain.ratio > 1.5
    # What is hidden there helps, and would not where it is left out: the record is the same.
    assert helps == (True,) * len(sets[0].entries)
    assert gain.held_out == "validate: other.csv"
    # Of 9.996 s, in whole blocks of a second or little more; the same where the clock began elsewhere.
    assert gain.interval == ratio_interval(*gain.residuals.T, 9.996)
    later = replace(other, time=other.time + 1000.0)
    assert held_out(2, BAND, sets[0], Transmission(2), [log], later)[0].interval == pytest.approx(gain.interval)
    assert gain.interval[0] < gain.ratio < gain.interval[1]


def test_a_fit_is_carried_to_another_record_with_the_mean_of_its_zeros(axis: Axis) -> None:
    fitted = np.array([1e-3, 3e-3, 2e-7, 5.0])
    columns = np.column_stack([axis.spring, np.linspace(0, 1, len(axis.torque))])
    assert_allclose(residual_on(fitted, 2, axis, columns),
                    axis.deflection - 2e-3 - 2e-7 * axis.torque - 5.0 * np.linspace(0, 1, len(axis.torque)))


def test_a_gain_is_written_with_the_ratio_of_both_zeros() -> None:
    gain = Gain(4e-4, 1e-4, (3.5, 4.6), (0.2, 0.9), "other.csv", np.zeros((2, 2)), (5e-4, 2.5e-4))
    assert gain.as_dict() == {
        "rms_before_urad": pytest.approx(400), "rms_after_urad": pytest.approx(100), "ratio": pytest.approx(4.0),
        "interval": [3.5, 4.6], "variance_explained_before": 0.2, "variance_explained_after": 0.9, "held_out": "other.csv",
        "with_fitted_zero": {"rms_before_urad": pytest.approx(500), "rms_after_urad": pytest.approx(250),
                             "ratio": pytest.approx(2.0)}}


def test_a_cause_has_the_values_of_the_sets_that_hold_it_each_as_likely_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 0.6, 0.15 and 0.05 that hold it in this shape; one of another shape, one without it and one of under a thousandth do
    not count. What they differ by is in the spread."""
    own: Any = SimpleNamespace(name="own")
    other: Any = SimpleNamespace(name="other")
    said = {0.6: (own, [2.0, 5.0], [0.3, 1.0]), 0.15: (own, [4.0, 5.0], [0.1, 2.0]), 0.05: (own, [3.0, 9.0], [0.2, 0.0]),
            0.1: (other, [99.0, 99.0], [1.0, 1.0]), 0.0009: (own, [77.0, 77.0], [1.0, 1.0])}
    hypotheses: Any = [SimpleNamespace(entries=(4, 1), probability=each) for each in said]
    hypotheses.append(SimpleNamespace(entries=(4,), probability=0.2))

    def cause_of(_: object, one: Any, place: int, probability: float) -> LogCause:
        shape, values, std = said[one.probability]
        assert place == 1
        return LogCause(shape, 2, probability, np.array(values), np.array(std))

    monkeypatch.setattr(procedure, "cause_of", cause_of)
    first = cause_of(None, hypotheses[0], 1, 0.9)
    found = procedure._averaged(SimpleNamespace(), hypotheses, 1, first)
    weight = np.array([0.6, 0.15, 0.05]) / 0.8
    values, std = np.array([[2.0, 5], [4, 5], [3, 9]]), np.array([[0.3, 1], [0.1, 2], [0.2, 0]])
    mean = (weight[:, None] * values).sum(axis=0)
    assert_allclose(found.values, mean)
    assert_allclose(found.std, np.sqrt((weight[:, None] * (std**2 + values**2)).sum(axis=0) - mean**2))
    assert (found.shape, found.probability) == (own, 0.9)
    assert procedure._averaged(SimpleNamespace(), hypotheses[-1:], 1, first) is first

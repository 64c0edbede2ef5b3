"""Lines and smooth errors over a joint's angle piece by piece, against least squares, normal densities and sums of waves."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import multivariate_normal

from identification.motion import lines, transmission
from identification.motion.angle_spectrum import AngleSpectrum, angle_spectrum, frequencies
from identification.motion.autoregression import Autoregression, fitted_autoregression
from identification.motion.band import low_pass, passed_step, thinned
from identification.motion.blocks import ratio_interval
from identification.motion.lines import Line, LineFit, Session, fitted, found_again, lines_at, search, session, shared
from identification.motion.log_file import MotionLog
from identification.motion.smooth import Smooth, log_evidence, smooth_over
from identification.motion.transmission import SmoothTest, Transmission, find_transmission
from tests.identification.motion.test_laws_transmission import record

HIDDEN = {413.2: 4e-5, 150.0: 2e-5}
PHASE = 0.6


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> MotionLog:
    return record(tmp_path_factory.mktemp("lines"), 300, {"channel_delay": 1.0}, lines=HIDDEN, phase=PHASE)


@pytest.fixture(scope="module")
def other(tmp_path_factory: pytest.TempPathFactory) -> MotionLog:
    """The first line is where it was, the second one where it likes."""
    folder = tmp_path_factory.mktemp("others")
    first = record(folder, 301, {"channel_delay": 1.0}, lines={413.2: 4e-5}, phase=PHASE)
    angle = first.joints[2].angle
    return first.less(2, -2e-5 * np.sin(150.0 * angle + PHASE + 2.0))


@pytest.fixture(scope="module")
def one(log: MotionLog) -> Session:
    return session(2, [log])


@pytest.fixture(scope="module")
def beside(one: Session) -> LineFit:
    """With the weaker of the two lines beside the base."""
    return fitted(one, np.array([150.0]))


def sine(size: float, phase: float) -> complex:
    """The amplitude whose Re(A exp(i x)) is size sin(x + phase)."""
    return size * np.exp(1j * (phase - np.pi / 2))


@pytest.mark.parametrize("bend", [0.7, 1.0, 90.0])
def test_a_smooth_error_is_a_sum_of_waves_that_fall(bend: float) -> None:
    """Before the data the covariance of two angles is that of their waves: of a turn, falling as the square of their number; or
    of four times the angles visited, up to the bend alike."""
    angle = 0.3 + 0.2 * np.random.default_rng(0).uniform(size=60)
    number = np.arange(1, 25) * (1.0 if bend <= 1 else 2 * np.pi / (4 * np.ptp(angle)))
    size = np.maximum(number / bend, 1.0) ** -2.0
    covariance = np.sum(size**2 * np.cos(number * (angle[:, None, None] - angle[:, None])), axis=2)
    smooth = smooth_over(angle, 1e-4, bend)
    mine = smooth.columns(angle)
    apart = np.eye(60) - 1 / 60
    assert_allclose(apart @ mine @ mine.T @ apart, apart @ covariance @ apart, atol=60 * 1.1e-6)
    assert (smooth.size, smooth.bend) == (1e-4, bend)
    # As many as vary over the angles by a thousandth of the size: a constant is none. They vary unlike each other.
    assert mine.shape[1] == np.sum(np.linalg.eigvalsh(apart @ covariance @ apart) > 60 * 1e-6)
    alike = mine.T @ apart @ mine
    assert_allclose(alike, np.diag(np.diag(alike)), atol=1e-9)
    # Away from the angles visited they go on as the waves do.
    assert_allclose(np.concatenate([smooth.columns(angle[:1] + 2 * np.pi / number[0]), mine[:1]])[0], mine[0], atol=1e-9)


def test_the_evidence_for_a_smooth_error_is_that_of_normal_densities() -> None:
    """Of what is left beside a base that is free: the density with a prior of each size over that without."""
    rng = np.random.default_rng(3)
    columns, base, y = rng.standard_normal((30, 4)), rng.standard_normal((30, 3)), rng.standard_normal(30)
    rest = np.linalg.svd(base)[0][:, 3:].T
    sizes, variance = np.array([0.1, 0.7, 3.0]), 0.6

    def density(size: float) -> float:
        spread = rest @ columns
        return float(multivariate_normal.logpdf(rest @ y, cov=variance * np.eye(27) + size**2 * spread @ spread.T))

    assert_allclose(log_evidence(columns, base, y, variance, sizes), [density(size) - density(0.0) for size in sizes])


def test_noise_is_whitened_to_what_it_was_made_of() -> None:
    noise = Autoregression(np.array([0.6, -0.3, 0.1]))
    made = noise.simulate(0.5, 400, np.random.default_rng(5))
    white = 0.5 * np.random.default_rng(5).standard_normal(600)[200:]
    assert_allclose(noise.whiten(made[:, None])[:, 0], white[3:], atol=1e-9)
    found = fitted_autoregression([noise.simulate(0.5, 4000, np.random.default_rng(seed)) for seed in (6, 7)])
    assert_allclose(found.phi, noise.phi, atol=4 / 8000**0.5)
    assert len(fitted_autoregression([white]).phi) == 0
    # Up to ten samples back, and of short noise not more than one for each fifteen.
    tenth = Autoregression(np.append(np.zeros(9), 0.9))
    far = fitted_autoregression([tenth.simulate(0.5, 3000, np.random.default_rng(8))]).phi
    assert_allclose(far, tenth.phi, atol=0.08)
    assert len(fitted_autoregression([tenth.simulate(0.5, 149, np.random.default_rng(seed)) for seed in range(9)]).phi) < 10


@pytest.mark.parametrize(("phi", "share"), [(0.5, 1 / 3), (0.0, 1.0), (0.9, 0.1 / 1.9), (-0.5, 1.0)])
def test_samples_of_lasting_noise_are_worth_fewer(phi: float, share: float) -> None:
    """(1 - phi) / (1 + phi) of them, for their mean; never more than they are."""
    assert Autoregression(np.array([phi])).worth(120) == pytest.approx(120 * share, rel=1e-6)


@pytest.mark.parametrize(("rate", "step"), [(250.0, 17), (15.0, 1), (28.7, 1), (28.9, 2), (14.9, 0)])
def test_a_low_pass_keeps_what_is_slow_in_its_place(rate: float, step: int) -> None:
    """Under 6 Hz, at 2.4 samples a period or more; what is slower than 15 Hz as it is."""
    time = np.arange(int(20 * rate)) / rate
    kept = thinned(time, rate)
    assert_allclose(np.diff(kept), max(step, 1) / rate)
    assert kept[0] == pytest.approx(np.ceil(2 * rate / 6) / rate if step else 0.0)
    slow, fast = np.sin(2 * np.pi * 0.5 * time + 0.3), np.sin(2 * np.pi * 0.49 * rate * time)
    passed = low_pass(np.column_stack([3.0 + 2.0 * time, slow, fast]), rate)
    assert_allclose(passed[:, 0], 3.0 + 2.0 * kept, atol=1e-9)
    assert_allclose(passed[:, 1], np.sin(2 * np.pi * 0.5 * kept + 0.3), atol=2e-3 if step else 0)
    assert np.abs(passed[:, 2]).max() < 0.03 or rate < 20
    at = time[len(time) // 2]
    assert_allclose(low_pass((time >= at).astype(float)[:, None], rate)[:, 0], passed_step(kept - at, rate), atol=1e-9)


def test_a_ratio_s_interval_is_what_blocks_of_a_second_leave_open() -> None:
    rng = np.random.default_rng(2)
    after = rng.standard_normal(900)
    assert ratio_interval(2.5 * after, after, 30.0) == pytest.approx((2.5, 2.5))
    before = 2.0 * rng.standard_normal(900)
    low, high = ratio_interval(before, after, 30.0)
    # Thirty blocks of thirty independent samples each: the logarithm of the ratio scatters by about (1 / 900)^(1/2).
    assert np.log(high / low) == pytest.approx(2 * 1.96 / 30, rel=0.3)
    assert low < np.std(before) / np.std(after) < high
    # Of less than two seconds there are two blocks all the same: either twice, or both.
    halves = [np.std(before[k: k + 450]) / np.std(after[k: k + 450]) for k in (0, 450)]
    assert ratio_interval(before, after, 1.9) == pytest.approx((min(halves), max(halves)), rel=1e-2)


def test_a_line_is_fitted_with_its_size_and_phase(one: Session, log: MotionLog) -> None:
    found = fitted(one, np.array(list(HIDDEN))).amplitudes
    assert_allclose(found, [sine(size, PHASE) for size in HIDDEN.values()], atol=3e-6)
    angle = log.joints[2].angle
    assert_allclose(lines_at(angle, np.array([413.2, 150.0]), np.array([sine(4e-5, 0.6), sine(2e-5, -1.0)])),
                    4e-5 * np.sin(413.2 * angle + 0.6) + 2e-5 * np.sin(150 * angle - 1.0), atol=1e-15)


def test_what_a_line_gains_is_what_least_squares_leave_less(one: Session, beside: LineFit) -> None:
    angle = one.axis.angle
    columns = np.column_stack([one.base, np.cos(150 * angle), np.sin(150 * angle)])
    for cycles, gain in zip((413.2, 380.0), beside.gain(np.array([413.2, 380.0])), strict=True):
        line = np.column_stack([np.cos(cycles * angle), np.sin(cycles * angle)])
        left = []
        for each in (columns, np.column_stack([columns, line])):
            white = one.whitened(beside.noise, each / np.linalg.norm(each, axis=0))
            deflection = one.whitened(beside.noise, one.axis.deflection[:, None])[:, 0]
            left.append(float(np.sum((deflection - white @ np.linalg.lstsq(white, deflection, rcond=None)[0]) ** 2)))
        assert beside.variance == pytest.approx(left[0] / len(beside.left), rel=1e-6)
        assert gain == pytest.approx((left[0] - left[1]) / beside.variance, rel=1e-5)


def test_what_a_given_line_gains_is_what_it_leaves_less(one: Session, beside: LineFit) -> None:
    """With its own phase, and with one that is off by a right angle; beside what is fitted."""
    def gained(amplitude: complex) -> float:
        white = one.whitened(beside.noise, lines_at(one.axis.angle, np.array([413.2]), np.array([amplitude]))[:, None])[:, 0]
        white = white - beside.known @ (beside.known.T @ white)
        return float(np.sum(beside.left**2) - np.sum((beside.left - white) ** 2)) / beside.variance

    own = beside.session.whitened(beside.noise, lines.line_columns(one.axis.angle, np.array([413.2])))
    own = own - beside.known @ (beside.known.T @ own)
    cosine, sine_part = np.linalg.lstsq(own, beside.left, rcond=None)[0]
    phase = np.angle(cosine - 1j * sine_part)
    for turned in (0.0, np.pi / 2):
        amplitude = 3e-5 * np.exp(1j * (phase + turned))
        with_own, with_given = beside.better_by(413.2, complex(amplitude))
        assert with_own == pytest.approx(gained(3e-5 * np.exp(1j * phase)), rel=1e-6)
        assert with_given == pytest.approx(gained(amplitude), rel=1e-6)


def test_the_spectrum_over_the_angle_is_the_likelihood_s_gain(one: Session, beside: LineFit) -> None:
    """A matched filter in bins of the angle, against the exact projection of each line, about one that is there."""
    step = 1 / 250.0
    wanted = frequencies(float(np.ptp(one.axis.angle)), 380.0, 440.0)
    spectrum = angle_spectrum(beside.left, beside.noise, one.axis.angle, one.speed, step, wanted)
    exact, mine = beside.gain(wanted.cycles), spectrum.gain()
    assert abs(wanted.cycles[np.argmax(mine)] - 413.2) < one.resolution / 2
    strong = exact > 0.3 * exact.max()
    assert_allclose(mine[strong], exact[strong], rtol=0.12)
    assert mine.max() == pytest.approx(exact.max(), rel=0.06)


def test_frequencies_are_a_quarter_of_what_angles_tell_apart() -> None:
    wanted = frequencies(0.5, 30.0, 1000.0)
    assert wanted.bin == pytest.approx(2 * np.pi / 12000)
    apart = np.diff(wanted.cycles)
    assert_allclose(apart, apart[0])
    assert 1 / 8 < apart[0] / (2 * np.pi / 0.5) <= 1 / 4
    assert 0 <= wanted.cycles[0] - 30.0 < apart[0]
    assert 0 < 1000.0 - wanted.cycles[-1] <= apart[0]
    assert apart[0] == pytest.approx(2 * np.pi / (wanted.length * wanted.bin))
    assert wanted.first == round(wanted.cycles[0] / apart[0])


def test_by_chance_a_block_adds_what_it_has() -> None:
    """With signs that are drawn, the blocks' squares are what a sum has on the average."""
    rng = np.random.default_rng(0)
    blocks, norms = rng.standard_normal((6, 3)) + 1j * rng.standard_normal((6, 3)), np.array([1.0, 2.0, 5.0])
    spectrum = AngleSpectrum(blocks, norms)
    assert_allclose(spectrum.gain(), np.abs(blocks.sum(axis=0)) ** 2 / norms)
    drawn = spectrum.by_chance(20000, np.random.default_rng(1))
    assert_allclose(drawn.mean(axis=0), np.sum(np.abs(blocks) ** 2, axis=0) / norms, rtol=0.05)
    assert_allclose(drawn.max(axis=0), np.abs([max(abs(np.array(signs) @ blocks[:, k]) for signs in np.ndindex(*6 * (2,))
                                                   for signs in [2 * np.array(signs) - 1]) for k in range(3)]) ** 2 / norms)


def test_by_chance_a_line_has_the_signs_of_blocks_of_0_4_s() -> None:
    """What samples 0 to 99 and from 100 on have of a line at 250 Hz counts with signs of their own, over the noise's
    variance."""
    def drawn(*samples: tuple[int, float]) -> set[float]:
        products = np.zeros((250, 2, 2))
        for sample, size in samples:
            products[sample, 1, 0] += size
        fit: Any = SimpleNamespace(products=lambda cycles: products, variance=0.5, session=SimpleNamespace(
            axis=SimpleNamespace(rates=[250.0])))
        chance = lines._by_chance(fit, np.array([3.0, 7.0]), np.random.default_rng(0))
        assert chance.shape == (499, 2)
        assert not chance[:, 0].any()
        return set(np.round(chance[:, 1], 9).tolist())

    assert drawn((0, 3.0)) == drawn((249, 3.0)) == {18.0}
    assert drawn((0, 3.0), (99, 2.0)) == drawn((100, 3.0), (199, 2.0)) == {50.0}
    assert drawn((99, 3.0), (100, 2.0)) == drawn((199, 2.0), (200, 3.0)) == {50.0, 2.0}


@pytest.mark.parametrize(("at", "std", "found"), [
    (400.3, 0.4, (400.3, 0.4)), (399.7, 0.4, (399.7, 0.4)), (400.0, 9.0, (400.0, 2.0)), (400.96, 0.4, (400.96, None)),
    (401.0, 0.4, None), (398.9, 0.4, None)])
def test_a_peak_is_where_its_parabola_is_highest_and_as_sure_as_that_is_sharp(
    at: float, std: float, found: tuple[float, float | None] | None,
) -> None:
    """Within half of what two angles tell apart, here 2, of where the spectrum has it; else it is another's shoulder."""
    parabola: Any = [SimpleNamespace(gain=lambda cycles: 50.0 - 0.25 * ((cycles - at) / std) ** 2),
                     SimpleNamespace(gain=lambda cycles: 70.0 - 0.75 * ((cycles - at) / std) ** 2)]
    peak = lines._refined(parabola, 400.0, 2.0)
    assert (peak is None) == (found is None)
    if peak and found:
        assert peak[0] == pytest.approx(found[0], abs=0.05 if found[1] is None else 1e-6)
        assert found[1] is None or peak[1] == pytest.approx(found[1], rel=1e-6)


def test_where_the_likelihood_is_no_hill_the_frequency_is_known_to_what_the_angles_tell_apart() -> None:
    """Highest just within the lower end, and beyond that as high everywhere."""
    slope: Any = [SimpleNamespace(gain=lambda cycles: 10.0 + 5 * (np.abs(cycles - 399.05) < 0.01) + 4 * (cycles < 399.01))]
    assert lines._refined(slope, 400.0, 2.0) == pytest.approx((399.1, 2.0))


@pytest.mark.parametrize(("again", "larger", "confirmed", "holds"), [
    (0.01, (5.0, 2.6), True, True), (0.0101, (5.0, 2.6), False, True), (0.01, (0.0, 1.0), False, True),
    (0.002, (5.0, 2.5), True, False), (np.nan, (np.nan, np.nan), False, False)])
def test_a_line_is_found_again_by_its_p_value_and_by_what_it_gains(
    again: float, larger: tuple[float, float], confirmed: bool, holds: bool,
) -> None:
    line = Line(400.0, 0.1, 0.002, again, larger)
    assert (line.confirmed, line.phase_holds) == (confirmed, holds)


def test_records_share_a_size_and_what_phase_they_have_in_common() -> None:
    assert_allclose(shared([np.array([2.0 + 0j, 1j]), np.array([4j, 3j])]),
                    [3.0 * np.exp(1j * np.arctan2(4, 2)), 2j])


def test_the_strongest_line_is_found_first_and_both_as_sure_as_chance_can_say(one: Session, other: MotionLog) -> None:
    found = search([one], np.random.default_rng(1))
    assert len(found) == 2
    for line, cycles in zip(found, HIDDEN, strict=True):
        assert abs(line.cycles - cycles) < 4 * line.std
        assert 0.002 < line.std < 1.0
        assert line.p_value == 1 / 500
        assert np.isnan(line.again)
        assert not line.confirmed
    told = found_again(found, [one], [session(2, [other])], np.random.default_rng(2))
    assert [line.again for line in told] == [1 / 500, 1 / 500]
    assert [line.confirmed for line in told] == [True, True]
    assert [line.phase_holds for line in told] == [True, False]
    assert [(line.cycles, line.p_value) for line in told] == [(line.cycles, line.p_value) for line in found]
    (lost,) = found_again([Line(700.0, 0.1, 0.002)], [one], [session(2, [other])], np.random.default_rng(3))
    assert lost.again > 0.02
    assert found_again([], [one], [one], np.random.default_rng(0)) == []
    shrunk = 0.0199 * (one.axis.angle - one.axis.angle.min()) / np.ptp(one.axis.angle)
    still = replace(one, axis=replace(one.axis, angle=shrunk))
    assert search([still], np.random.default_rng(0)) == []


def test_which_of_two_records_comes_first_hides_no_line(log: MotionLog, tmp_path: Path) -> None:
    """One at 250 Hz and one of which every tenth sample was logged, where a line of 2000 cycles a turn is folded over."""
    coarse = record(tmp_path, 301, {"channel_delay": 1.0}, lines=HIDDEN, phase=PHASE)
    both = [one.less(2, -3e-5 * np.sin(2000.3 * one.joints[2].angle)) for one in (log, coarse)]
    own = both[1].joints[2]
    names = ("time", "torque", "speed", "deflection", "angle")
    thin = replace(own, others={}, **{name: getattr(own, name)[::10] for name in names})
    sessions = [session(2, [both[0]]), session(2, [replace(both[1], time=own.time[::10], joints={2: thin})])]
    found = [search(order, np.random.default_rng(1)) for order in (sessions, sessions[::-1])]
    for lines_of_order in found:
        assert sorted(line.cycles for line in lines_of_order) == pytest.approx([150.0, 413.2, 2000.3], abs=1.0)


def named(*kept: Line, smooth: SmoothTest | None = None) -> Transmission:
    return Transmission(2, kept, smooth, "other.csv")


STRONG, WEAK = Line(413.2, 0.1, 0.004, 0.002, (90.0, 80.0)), Line(150.0, 0.2, 0.002, 0.006, (30.0, -20.0))
LOST = Line(700.0, 0.2, 0.002, 0.3, (-1.0, -20.0))
SMOOTH = SmoothTest(Smooth(np.ones(1), np.ones((2, 1)), 3e-4, 1.0), 5.0, 3e-5, 2e-5, (1.2, 1.8), 2.6e-5)


def test_what_is_named_of_a_transmission_in_words() -> None:
    assert named(STRONG, LOST).words == "a transmission error (1 line over the angle, found again in other.csv)"
    assert named(STRONG, WEAK, smooth=SMOOTH).words == (
        "a transmission error (2 lines and a smooth part over the angle, found again in other.csv)")
    assert named(LOST, smooth=SMOOTH).words == "a transmission error (a smooth part over the angle, found again in other.csv)"
    assert (named(LOST).words, named(LOST).named, named(WEAK).named) == ("", False, True)
    assert (named(STRONG, WEAK).p_value, named(STRONG, LOST).p_value, named(LOST).p_value) == (0.002, 0.004, 1.0)
    assert (named(STRONG).p_resolution, named(LOST).p_resolution) == (1 / 500, 1.0)


@pytest.mark.parametrize(("changed", "confirmed"), [
    ({}, True), ({"interval": (1.0, 1.8)}, False), ({"interval": (1.001, 1.8)}, True), ({"after": 2.07e-5}, True),
    ({"after": 2.09e-5}, False), ({"before": 2.49e-5}, False), ({"before": 2.51e-5}, True)])
def test_a_smooth_part_predicts_by_a_quarter_more_than_nothing_and_a_straight_line(
    changed: dict[str, Any], confirmed: bool,
) -> None:
    """After it 20 um are left, without it 30, beside a straight line 26."""
    test = replace(SMOOTH, **changed)
    assert test.confirmed == confirmed
    assert named(smooth=test).named == confirmed
    assert (named(smooth=test).smooth is test.smooth) == confirmed


def test_a_record_without_its_lines_has_none_and_another_s_are_taken_off_as_they_were_fitted(
    log: MotionLog, other: MotionLog,
) -> None:
    found, cycles = named(STRONG, LOST, WEAK), np.array([413.2, 150.0])
    assert_allclose(found.cycles, cycles)
    (clean,) = found.cleaned([log])
    sizes = found.amplitudes([log])
    assert np.abs(found.amplitudes([clean])).max() < 1e-3 * np.abs(sizes).min()
    off = log.joints[2].deflection - clean.joints[2].deflection
    assert_allclose(off, lines_at(log.joints[2].angle, cycles, sizes), atol=1e-12)
    # A piece of the record has the record's own; another record the first's size and, where it holds, phase.
    piece = log.cut(1000, 1500)
    off = piece.joints[2].deflection - found.predicted([log], piece).joints[2].deflection
    assert_allclose(off, lines_at(piece.joints[2].angle, cycles, sizes), atol=1e-12)
    off = other.joints[2].deflection - found.predicted([log], other).joints[2].deflection
    own = found.amplitudes([other])
    assert_allclose(off, lines_at(other.joints[2].angle, cycles, np.array([
        sizes[0], abs(sizes[1]) * np.exp(1j * np.angle(own[1]))])), atol=1e-12)
    assert abs(np.angle(own[1] / sizes[1]) - 2.0) < 0.3
    nothing = named(LOST)
    assert nothing.cleaned([log]) == [log]
    assert nothing.predicted([log], other) is other


def test_what_is_written_of_a_transmission(log: MotionLog) -> None:
    found = named(LOST, WEAK, smooth=SMOOTH)
    (size,) = found.amplitudes([log])
    assert found.as_dict([log]) == {
        "named": True, "not_fitted": "other.csv",
        "smooth": {"size_rad": 3e-4, "found_again": True, "rms_before_urad": pytest.approx(30.0),
                   "rms_after_urad": pytest.approx(20.0), "interval": [1.2, 1.8]},
        "lines": [
            {"cycles_per_turn": 700.0, "std": 0.2, "p_value": 0.002, "found_again": False, "p_value_again": 0.3},
            {"cycles_per_turn": 150.0, "std": 0.2, "p_value": 0.002, "found_again": True, "p_value_again": 0.006,
             "phase_holds": False, "records": [{"record": log.source, "amplitude_rad": pytest.approx(abs(size)),
                                                "phase_rad": pytest.approx(np.angle(size))}]}]}
    untried = named(replace(LOST, again=np.nan)).as_dict([log])
    assert untried["lines"][0]["p_value_again"] is None
    assert untried["smooth"] is None


@pytest.mark.parametrize(("records", "held_out", "searched", "again", "words"), [
    (2, True, [2500, 2500], [2500], "{0}"), (2, False, [2500], [2500], "{0}"),
    (1, False, [1125], [1125], "the last 45 % of the same record"), (1, True, [2500], [2500], "{0}")])
def test_what_is_searched_and_what_has_to_agree(
    log: MotionLog, other: MotionLog, monkeypatch: pytest.MonkeyPatch, records: int, held_out: bool, searched: list[int],
    again: list[int], words: str,
) -> None:
    seen: dict[str, list[int]] = {}

    def note(several: list[Session], key: str) -> None:
        seen[key] = [len(one.axis.angle) for one in several]

    monkeypatch.setattr(transmission, "search", lambda sessions, rng: note(sessions, "searched") or [])
    monkeypatch.setattr(transmission, "found_again", lambda lines, sessions, fresh, rng: note(fresh, "again") or [STRONG])
    monkeypatch.setattr(transmission, "_smooth_test", lambda *of: SMOOTH)
    found = find_transmission(2, [log, other][:records], other if held_out else None)
    assert (seen["searched"], seen["again"]) == (searched, again)
    assert found.again_on == words.format(other.source)
    assert (found.lines, found.smooth_test) == ((STRONG,), SMOOTH)
    # The first part of a record of less than six seconds is too short.
    for count, lines_found in ((1495, ()), (1510, (STRONG,))):
        assert find_transmission(2, [log.cut(0, count)], None).lines == lines_found


@pytest.mark.parametrize(("coarse", "finer", "taken"), [
    (None, None, None), ((True, 5.0), None, "coarse"), ((True, 5.0), (False, 9.0), "coarse"),
    ((True, 5.0), (True, 4.9), "coarse"), ((True, 5.0), (True, 5.1), "finer"),
    ((False, 9.0), (True, 5.0), "finer"), (None, (True, 5.0), "finer"),
    ((False, 9.0), (False, 5.0), "coarse")])
def test_of_waves_of_the_turn_and_finer_ones_the_likelier_is_taken_that_predicts(
    log: MotionLog, monkeypatch: pytest.MonkeyPatch, coarse: tuple[bool, float] | None, finer: tuple[bool, float] | None,
    taken: str | None,
) -> None:
    asked: dict[str, Any] = {}

    def tested(joint: int, searched: list[MotionLog], others: list[MotionLog], sizes: Any, bends: tuple[float, ...]) -> Any:
        kind, found = ("coarse", coarse) if bends == (1.0,) else ("finer", finer)
        asked[kind] = bends
        return found and SimpleNamespace(kind=kind, confirmed=found[0], log_odds=found[1])

    monkeypatch.setattr(transmission, "_tested", tested)
    told: Any = transmission._smooth_test(2, [log], [log])
    assert (told and told.kind) == taken
    span = np.ptp(log.joints[2].angle)
    assert asked["finer"] == pytest.approx(tuple(2 * np.pi * share / span for share in (0.5, 1.0, 2.0)))


@pytest.mark.parametrize(("span", "finer"), [(0.0201, True), (0.0199, False)])
def test_finer_waves_are_looked_for_where_a_joint_moves(
    log: MotionLog, monkeypatch: pytest.MonkeyPatch, span: float, finer: bool,
) -> None:
    asked: list[int] = []
    monkeypatch.setattr(transmission, "_tested", lambda joint, searched, others, sizes, bends: asked.append(len(bends)))
    joint = log.joints[2]
    small = replace(log, joints={2: replace(joint, angle=span * (joint.angle - joint.angle.min()) / np.ptp(joint.angle))})
    transmission._smooth_test(2, [small], [small])
    assert asked == [1, 3][: 1 + finer]

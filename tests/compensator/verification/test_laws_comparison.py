"""The arithmetic of `verify`: intervals cover under autocorrelated noise, figures and scales are those of plain sums."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import norm, t

from compensator.verification.batch_means import mean_along
from compensator.verification.comparison import Scale, compare, estimate_scale
from compensator.verification.readings import Readings, read_readings
from compensator.verification.verify import _comparison_text, _scale_findings, _scale_text
from compensator.verification.verify import verify as verify_files
from identification.model.cell import read_cell
from tests.compensator.verification.measured_passes import SIGMAS, csv, of_code, remembering, verify
from tests.support import long, write_cell


@pytest.mark.parametrize("phi", [long(0.0), long(0.5), 0.9])
def test_intervals_cover_under_autocorrelated_noise(phi: float) -> None:
    """400 simulated pairs of passes: the true ratio and the true scale lie in their 95 % intervals as often as stated, and
    intervals that took the places as independent would not hold them."""
    rng = np.random.default_rng(7)
    runs, count, scale = 400, 1200, 1.3
    held_ratio = held_scale = naive = 0
    for _ in range(runs):
        predicted = 1e-6 * remembering(rng, count, 0.8, 100.0)
        before = scale * predicted + 1e-6 * remembering(rng, count, phi, 30.0)
        after = 0.1 * predicted + 1e-6 * remembering(rng, count, phi, 20.0)
        # Variances of the generator, three components alike.
        ratio = np.sqrt((130.0**2 + 30.0**2) / (10.0**2 + 20.0**2))
        found = compare(*(Readings("", "target", np.arange(count)[:, None], one, np.full((count, 3), 1e-6), None)
                          for one in (before, after)))
        assert found.interval is not None
        assert found.ratio is not None
        held_ratio += found.interval[0] <= ratio <= found.interval[1]
        z = np.sum(before**2 / np.sum(before**2) - after**2 / np.sum(after**2), axis=1) / 2 * count
        naive += abs(np.log(found.ratio / ratio)) <= 1.96 * z.std() / np.sqrt(count)
        fitted = estimate_scale(before, predicted)
        assert fitted is not None
        assert fitted.interval is not None
        held_scale += fitted.interval[0] <= scale <= fitted.interval[1]
    # Three standard errors of a binomial share of 400 are 3.3 %.
    assert 0.915 <= held_ratio / runs <= 0.985
    assert 0.915 <= held_scale / runs <= 0.985
    assert naive / runs < 0.87


def test_where_nothing_was_measured_or_predicted_there_is_no_scale() -> None:
    some, none = np.ones((40, 3)), np.zeros((40, 3))
    assert estimate_scale(none, some) is estimate_scale(some, none) is None
    assert estimate_scale(some, some) is not None
    for nanometres in (0.9, 1.1):       # RMS
        told = np.tile([[2e-9 * nanometres / np.sqrt(2)], [0.0]], (20, 1))
        assert (estimate_scale(some[:, :1], told) is None) == (nanometres < 1)


def test_the_interval_of_a_ratio_is_as_wide_as_that_of_chance() -> None:
    """Of n places, each of three components that are Gaussian and remember nothing, the logarithm of the ratio has the
    variance 1 / (3 n)."""
    rng, count = np.random.default_rng(5), 3000
    before, after = (Readings("", "target", np.arange(count)[:, None], 1e-6 * size * rng.normal(size=(count, 3)),
                              np.full((count, 3), 1e-6), None) for size in (60.0, 20.0))
    found = compare(before, after)
    assert found.interval is not None
    assert 0.7 < np.log(found.interval[1] / found.interval[0]) / (2 * 1.96 / np.sqrt(3 * count)) < 1.4
    assert found.interval[0] < 3 < found.interval[1]


def test_a_comparison_is_that_of_its_places_one_by_one() -> None:
    """In a loop over places, of which components are missing: sizes, what got worse by over two sigma of both sizes, the noise
    of what is left, and the interval of the means of sixteen blocks (of the logarithm of the ratio, to first order)."""
    rng, count = np.random.default_rng(31), 480
    both = [1e-6 * size * rng.normal(size=(count, 3)) for size in (12.0, 10.0)]
    sigmas = [1e-6 * rng.uniform(1.0, 6.0, (count, 3)) for _ in range(2)]
    for deviation in both:
        deviation[rng.random((count, 3)) < 0.2] = np.nan
    found = compare(*(Readings("", "target", np.arange(count)[:, None], deviation, sigma, None)
                      for deviation, sigma in zip(both, sigmas, strict=True)))
    size, noise, worse = [], [], 0
    for k in range(count):
        some = [axis for axis in range(3) if np.isfinite(both[0][k, axis]) and np.isfinite(both[1][k, axis])]
        if not some:
            continue
        own = [float(np.linalg.norm(deviation[k, some])) for deviation in both]
        along = [float(np.sqrt(sum((deviation[k, axis] / length * sigma[k, axis]) ** 2 for axis in some)))
                 for deviation, length, sigma in zip(both, own, sigmas, strict=True)]
        worse += own[1] - own[0] > 2 * np.hypot(*along)
        size.append(own)
        noise.append(sum(sigmas[1][k, axis] ** 2 for axis in some))
    before, after = np.array(size).T
    assert (found.before.points, found.worse) == (len(before), worse)
    assert worse > 20
    assert found.noise_um == pytest.approx(1e6 * np.sqrt(np.mean(noise)))
    for figures, own in ((found.before, before), (found.after, after)):
        assert (figures.rms_um, figures.mean_um, figures.max_um) == pytest.approx(
            (1e6 * np.sqrt(np.mean(own**2)), 1e6 * own.mean(), 1e6 * own.max()))
        assert figures.p95_um == pytest.approx(1e6 * np.quantile(own, 0.95))
    ratio = np.sqrt(np.mean(before**2) / np.mean(after**2))
    told = 0.5 * (before**2 / np.mean(before**2) - after**2 / np.mean(after**2))
    blocks = np.array([np.mean(part) for part in np.array_split(told, 16)])
    half = t.ppf(0.975, 15) * blocks.std(ddof=1) / 4
    assert found.ratio == pytest.approx(ratio)
    assert found.interval == pytest.approx((ratio * np.exp(-half), ratio * np.exp(half)))
    assert (found.verdict, found.log_ratio.blocks if found.log_ratio else 0) == ("better", 16)
    both[0], both[1] = both[1], both[0]
    assert compare(*(Readings("", "target", np.arange(count)[:, None], deviation, sigma, None)
                     for deviation, sigma in zip(both, sigmas, strict=True))).verdict == "worse"


@pytest.mark.parametrize(("interval", "verdict"), [
    ((1.01, 2.0), "better"), ((1.0, 2.0), "no difference shown"), ((0.5, 1.0), "no difference shown"), ((0.5, 0.99), "worse"),
    (None, "no difference shown")])
def test_a_part_is_better_or_worse_where_the_interval_has_no_one(interval: tuple[float, float] | None, verdict: str) -> None:
    one = Readings("", "target", np.arange(9.0)[:, None], np.full((9, 3), 4e-6), np.full((9, 3), 1e-6), None)
    assert replace(compare(one, one), interval=interval).verdict == verdict


def test_where_nothing_is_left_there_is_no_ratio() -> None:
    """Nor where nothing was off before; sizes are told all the same."""
    off, nothing = (Readings("", "target", np.arange(40.0)[:, None], np.full((40, 1), size), np.full((40, 1), 2e-6), None)
                    for size in (-3e-6, 0.0))
    for before, after, worse in ((off, nothing, 0), (nothing, off, 0), (nothing, nothing, 0)):
        found = compare(before, after)
        assert (found.ratio, found.interval, found.log_ratio, found.worse) == (None, None, None, worse)
        assert (found.before.rms_um, found.after.max_um) == pytest.approx((3.0 * (before is off), 3.0 * (after is off)))
        assert found.by_axis["normal"][0].mean_um == pytest.approx(-3.0 * (before is off))


def test_the_scale_beside_a_constant_is_that_of_the_components_that_were_measured() -> None:
    """Against least squares with a constant for each axis over what is known of either, and with none."""
    rng = np.random.default_rng(18)
    predicted = 1e-5 * rng.normal(3.0, 1.0, (60, 3))
    measured = 1.2 * predicted + [2e-5, -1e-5, 0.0] + 1e-6 * rng.normal(size=(60, 3))
    measured[rng.random((60, 3)) < 0.3] = np.nan
    predicted[rng.random((60, 3)) < 0.1] = np.nan
    measured[7] = np.nan
    row, axis = np.nonzero(np.isfinite(measured) & np.isfinite(predicted))
    m, p = measured[row, axis], predicted[row, axis]
    found = estimate_scale(measured, predicted)
    assert found is not None
    beside, *constants = np.linalg.lstsq(np.column_stack([p, *(axis == k for k in range(3))]), m, rcond=None)[0]
    assert found.scale == pytest.approx(float(m @ p / (p @ p)), rel=1e-9)
    assert found.with_constant == pytest.approx(beside, rel=1e-9)
    assert found.constant_um == pytest.approx(1e6 * np.array(constants), rel=1e-6)
    assert found.points == len(set(row))


def test_a_scale_is_that_of_plain_sums_with_the_interval_of_its_blocks() -> None:
    """Place by place, of which components are missing; the influence of a place is what it moves the slope by, and sixteen
    blocks of thirty places tell how the mean of these scatters. Beside a constant the same of what is centred axis by axis."""
    rng, count = np.random.default_rng(41), 480
    predicted = 1e-6 * rng.normal(20.0, 60.0, (count, 3))
    measured = 1.3 * predicted + 1e-6 * rng.normal(0.0, 15.0, (count, 3)) + [0, 2e-6, 0]
    measured[rng.random((count, 3)) < 0.2] = np.nan
    predicted[5] = np.nan
    found = estimate_scale(measured, predicted)
    assert found is not None
    known = np.isfinite(measured) & np.isfinite(predicted)
    places = [k for k in range(count) if known[k].any()]

    def slope(m: np.ndarray, p: np.ndarray) -> tuple[float, tuple[float, float]]:
        along = sum(float(np.sum(m[k, known[k]] * p[k, known[k]])) for k in places)
        square = sum(float(np.sum(p[k, known[k]] ** 2)) for k in places)
        best = along / square
        each = len(places) / square * np.array([
            np.sum(p[k, known[k]] * (m[k, known[k]] - best * p[k, known[k]])) for k in places])
        blocks = np.array([part.mean() for part in np.array_split(each, 16)])
        half = t.ppf(0.975, 15) * blocks.std(ddof=1) / 4
        return best, (best - half, best + half)

    scale, interval = slope(measured, predicted)
    middle = [np.array([part[known[:, axis], axis].mean() for axis in range(3)]) for part in (measured, predicted)]
    beside, its_interval = slope(measured - middle[0], predicted - middle[1])
    m, p = measured[known], predicted[known]
    size = np.sum(m**2)
    assert (found.points, found.blocks, found.short) == (len(places), 16, False)
    assert (found.scale, *(found.interval or ())) == pytest.approx((scale, *interval), rel=1e-9)
    assert (found.with_constant, *(found.with_constant_interval or ())) == pytest.approx((beside, *its_interval), rel=1e-9)
    assert (found.share, found.share_scaled) == pytest.approx(
        (1 - np.sum((m - p) ** 2) / size, 1 - np.sum((m - scale * p) ** 2) / size), rel=1e-9)
    assert (found.measured_rms_um, found.residual_rms_um) == pytest.approx(
        (1e6 * np.sqrt(size / len(places)), 1e6 * np.sqrt(np.sum((m - scale * p) ** 2) / len(places))), rel=1e-9)
    assert found.std == pytest.approx((interval[1] - interval[0]) / 3.92, rel=1e-9)
    written = found.as_dict()
    assert (written["interval"], written["advised_scale"], "short" in written) == (
        [*(found.interval or ())], round(found.scale, 3), False)


SURE = Scale(100, 1.2, (1.1, 1.3), 0.9, 0.95, 100.0, 20.0, None, None, (0.0,) * 3, False, 16, False)


@pytest.mark.parametrize(("change", "option"), [
    ({}, "--scale 1.2:0.051"), ({"interval": (0.9, 1.3)}, "--scale 1:0.1"), ({"interval": None}, ""),
    ({"interval": (-0.1, 2.0)}, ""), ({"interval": (0.0, 0.9)}, ""), ({"interval": (0.8, 1.0)}, "--scale 1:0.051"),
    ({"interval": (1.0, 1.2)}, "--scale 1:0.051"), ({"interval": (1.19, 1.19 + 1e-4)}, "--scale 1.2:0.001"),
    ({"interval": (0.9, 1.3), "constant_shown": True}, ""), ({"constant_shown": True}, ""),
    ({"interval": (0.9, 1.3), "other_axes": "x y exchanged"}, ""), ({"other_axes": "x y exchanged"}, ""),
    ({"scale": 9.0, "interval": (8.0, 10.0)}, "")])
def test_a_scale_is_handed_on_where_it_is_one(change: dict[str, object], option: str) -> None:
    """A half width of the interval is 1.96 sigma. Nothing where a constant shows beside it, other axes, or a size that no robot
    has; where 1 will do, 1."""
    assert replace(SURE, **change).option == option


@pytest.mark.parametrize(("x", "y", "apart"), [
    ((1.0, 1.2), (1.3, 1.5), True), ((1.3, 1.5), (1.0, 1.2), True), ((1.0, 1.3), (1.2, 1.5), False),
    ((1.2, 1.5), (1.0, 1.3), False), ((1.0, 1.6), (1.2, 1.4), False), ((1.2, 1.4), (1.0, 1.6), False),
    (None, (1.3, 1.5), False), ((1.0, 1.2), None, False)])
@pytest.mark.parametrize("share", [0.045, 0.055])
def test_axes_are_told_apart_whose_intervals_have_nothing_in_common(
    x: tuple[float, float] | None, y: tuple[float, float] | None, apart: bool, share: float
) -> None:
    """Where one scale leaves over a twentieth of the measured beyond what is left with each its own, by the sum of squares."""
    own = {axis: replace(SURE, scale=1.0 if interval is None else float(np.mean(interval)), interval=interval, points=points,
                         residual_rms_um=left) for axis, interval, points, left in (("x", x, 80, 8.0), ("y", y, 100, 12.0))}
    squares = 80 * 8.0**2 + 100 * 12.0**2 + 100 * (100 * share) ** 2
    found = [one for one in _scale_findings(replace(SURE, residual_rms_um=float(np.sqrt(squares / 100))), own, "before.csv")
             if one.code == "CS6030"]
    assert len(found) == (apart and share > 0.05)
    for one in found:
        assert one.message.startswith(f"along x the measured deviation is {own['x'].scale:.3f} times")
        assert f"one scale leaves {100 * share:.1f} um RMS that would not be left with each its own" in one.message


@pytest.mark.parametrize(("interval", "inside"), [((0.9, 1.1), True), ((1.0, 1.2), True), ((0.8, 1.0), True),
                                                  ((1.01, 1.2), False), ((0.8, 0.99), False)])
def test_a_scale_is_advised_where_one_lies_outside(interval: tuple[float, float], inside: bool) -> None:
    """And where it lies inside that is said, and no scale advised. A robot at rest gives way less than one in motion, not
    more."""
    scale = Scale(100, float(np.mean(interval)), interval, 0.9, 0.95, 100.0, 20.0, None, None, (0.0,) * 3, False, 16, False)
    text = _scale_text(scale)
    assert ("1 lies inside: no scale is needed" in text) == inside
    assert ("Advice: correct" in text) != inside
    assert ("So it is where the load tests were taken at standstill" in text) == (not inside and scale.scale > 1)
    assert "No scale is advised" not in text
    assert "No scale is advised" in _scale_text(replace(scale, interval=None))


def test_the_interval_is_student_s_with_one_less_than_the_blocks() -> None:
    """Blocks of 100 values whose means are known: t(0.975; 15) = 2.1314, of the tables."""
    rng = np.random.default_rng(8)
    values = rng.normal(3.0, 1.0, 1600)
    mean = mean_along(values)
    assert mean.blocks == 16
    error = values.reshape(16, 100).mean(axis=1).std(ddof=1) / 4
    assert mean.half_width == pytest.approx(2.1314 * error, rel=1e-4)


def test_figures_by_hand(tmp_path: Path) -> None:
    cell = read_cell(write_cell(tmp_path))
    before = csv(tmp_path, "b.csv", "target,dx_um,dy_um", np.array([[3, 30, 40], [1, 0, 20], [2, np.nan, 10], [9, 5, 5]]))
    after = csv(tmp_path, "a.csv", "target,dx_um,dy_um", np.array([[1, 3, 4], [2, 1, 30], [3, 0, np.nan], [10, 1, 1]]))
    result = verify(tmp_path / "cell.yaml", before, after, "--json")
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)["result"]
    # Pairs 1, 2, 3, and not 9 with its neighbour; of 2 only y, of 3 only x is measured in both.
    assert (found["points"], found["unpaired_before"], found["unpaired_after"]) == (3, 1, 1)
    assert found["before"]["rms_um"] == pytest.approx(np.sqrt((20**2 + 10**2 + 30**2) / 3))
    assert found["after"]["rms_um"] == pytest.approx(np.sqrt((5**2 + 30**2 + 0) / 3))
    assert found["after"]["max_um"] == pytest.approx(30)
    assert found["after"]["mean_um"] == pytest.approx(35 / 3)
    assert found["ratio"] == pytest.approx(np.sqrt(1400 / 925))
    assert found["ratio_interval_95"] is None       # Three places say nothing of their scatter.
    assert found["worse_points"] == 1
    assert found["axes"]["y"]["before"]["mean_um"] == pytest.approx(15)
    assert "z" not in found["axes"]
    assert _comparison_text(verify_files(cell, before, after).comparison).endswith("too few places to say how sure that is.")
    assert {one["code"] for one in json.loads(result.stdout)["findings"]} == {"CS6022", "CS6024", "CS6025"}
    assert read_readings(before, cell).place[:, 0].tolist() == [1, 2, 3, 9]


def test_places_that_got_worse_by_chance_are_as_many_as_stated(tmp_path: Path) -> None:
    """The same deviation twice with the stated noise: 2.3 % of the places look worse."""
    rng = np.random.default_rng(3)
    cell = read_cell(write_cell(tmp_path))
    true = 100.0 + np.zeros((4000, 3))
    sigma = np.tile([2.0, 5.0, 9.0], (4000, 1))
    readings = [true + sigma * rng.normal(size=true.shape) for _ in range(2)]
    passes = [csv(tmp_path, f"{number}.csv", SIGMAS, np.column_stack([np.arange(4000), one, sigma]))
              for number, one in enumerate(readings)]
    comparison = compare(*(read_readings(path, cell) for path in passes))
    assert comparison.worse / 4000 == pytest.approx(0.0228, abs=0.008)
    assert comparison.verdict == "no difference shown"
    assert comparison.noise_um == pytest.approx(np.sqrt(4 + 25 + 81))


@pytest.mark.parametrize(("count", "phi", "words"), [
    (7, 0.0, "7 places too few for an interval"), (8, 0.0, ""), (40, 0.95, "places with deviations that are alike over"),
    (1200, 0.5, "")])
def test_a_comparison_of_too_few_places_is_told(tmp_path: Path, count: int, phi: float, words: str) -> None:
    """Of independent ones under eight; of 40 that are alike over a dozen the interval is what it is, and said to be narrow."""
    rng, cell, target = np.random.default_rng(6024), read_cell(write_cell(tmp_path)), np.arange(count)
    before, after = (csv(tmp_path, name, "target,dx_um,dy_um,dz_um", np.column_stack([
        target, remembering(rng, count, phi, size)])) for name, size in (("before.csv", 60.0), ("after.csv", 9.0)))
    found = verify_files(cell, before, after)
    told = [one for one in found.findings if one.code == "CS6024"]
    assert [(one.level, one.file, words in one.message) for one in told] == [("warning", str(after), True)] * bool(words)
    assert (found.comparison.interval is None) == (count < 8)
    if count == 40:
        places = re.search(r"alike over ([\d.]+) of them: the interval is rather too narrow", told[0].message)
        assert places
        assert 1.2 < float(places[1]) < 40


@pytest.mark.parametrize(("after_um", "said"), [(30.0, False), (40.5, False), (45.0, True)])
def test_a_pass_is_worse_where_chance_does_not_make_it_so(tmp_path: Path, after_um: float, said: bool) -> None:
    """40 um before, of 120 readings whose sizes scatter by a third: 45 are worse, 40.5 may be chance. The sentence has both."""
    rng, cell = np.random.default_rng(6027), write_cell(tmp_path)
    header, each = "target,dx_um,sx_um,sy_um,sz_um", np.arange(120)

    def measured(name: str, size: float) -> Path:
        off = size * rng.choice([-1, 1], 120) * (1 + rng.permutation(np.linspace(-0.3, 0.3, 120)))
        return csv(tmp_path, name, header, np.column_stack([each, off, np.ones((120, 3))]))

    before, after = measured("before.csv", 40.0), measured("after.csv", after_um)
    size = [np.sqrt(np.mean(np.loadtxt(file, delimiter=",", skiprows=1)[:, 1] ** 2)) for file in (before, after)]
    told = of_code(verify(cell, before, after, "--json"), "CS6027")
    assert [(one["message"], one["file"]) for one in told] == [
        (f"the deviation grew from {size[0]:.1f} to {size[1]:.1f} um RMS", str(after))] * said


@pytest.mark.parametrize(("share", "noise", "said"), [
    (0.03, 0.02, False), (0.045, 0.02, False), (0.06, 0.02, True), (0.06, 1.0, False)])
def test_a_constant_beside_the_predicted_is_told_from_a_twentieth_on(
    tmp_path: Path, share: float, noise: float, said: bool
) -> None:
    """Of the RMS measured, along y; not one that the scatter may be. The numbers are those of least squares with a constant."""
    rng, count = np.random.default_rng(6029), 300
    at = np.arange(count)
    told = np.column_stack([80 + 20 * np.sin(at / 5), 30 + 60 * np.cos(at / 7), 50 * np.sin(at / 3)])
    rms = np.sqrt(np.mean(np.sum((1.3 * told) ** 2, axis=1)))
    off = 1.3 * told + [0, share * rms, 0] + noise * rms * rng.normal(size=told.shape)
    predicted, measured = (csv(tmp_path, name, "target,dx_um,dy_um,dz_um", np.column_stack([at, what]))
                           for name, what in (("told.csv", told), ("off.csv", off)))
    result = verify(write_cell(tmp_path), measured, measured, "--predicted", predicted, "--json")
    found = of_code(result, "CS6029")
    through = np.sum(told * off) / np.sum(told**2)
    columns = np.column_stack([told.ravel(), np.tile(np.eye(3), (count, 1))])
    beside, *constant = np.linalg.lstsq(columns, off.ravel(), rcond=None)[0]
    assert [one["message"] for one in found] == [
        f"a part of ({', '.join(f'{x:.0f}' for x in constant)}) um does not follow the force; with it the scale would be "
        f"{beside:.3f} in place of {through:.3f}"] * said
    assert not said or json.loads(result.stdout)["result"]["predicted"]["advised_scale"] is None


def test_equal_values_have_no_correlation_whatever_their_last_digits() -> None:
    """0.1 as it comes out of two ways of adding: what rounding leaves of it is alternating, or slow, and means nothing."""
    exactly = mean_along(np.full(64, 0.1))
    for size in (1.0, 1e6):
        two = size * np.array([0.1, np.nextafter(0.1, 1)])
        for rounded in (np.repeat(two, 32), np.tile(two, 32)):
            mean = mean_along(rounded)
            assert (mean.blocks, mean.correlation) == (exactly.blocks, exactly.correlation)
            assert mean.half_width == pytest.approx(0.0, abs=1e-15 * size)
    assert exactly.blocks == 16
    # A difference that is small against the values, and far above rounding, is one.
    assert mean_along(np.repeat([1.0, 1.0 + 1e-9], 32)).correlation != exactly.correlation


def test_a_place_got_worse_where_it_did_by_two_sigma_of_both_readings(tmp_path: Path) -> None:
    """Of 3 and 4 um, 5 together: 11 um more count, 9 do not. By chance it is a Gaussian's share beyond two sigma."""
    before, after = np.full(40, 50.0), np.full(40, 20.0)
    after[[3, 9, 14]] = [61, -61, 59]
    passes = [csv(tmp_path, name, "target,dn_um,sn_um", np.column_stack([np.arange(40), off, np.full(40, sigma)]))
              for name, off, sigma in (("b.csv", before, 3), ("a.csv", after, 4))]
    result = verify_files(read_cell(write_cell(tmp_path)), *passes)
    assert result.comparison.worse == 2
    assert result.as_dict()["worse_share_by_chance"] == pytest.approx(norm.sf(2), abs=1e-4)
    assert "2 places (5.0 %) got worse by more than 2 sigma of the readings" in " ".join(result.lines())


@pytest.mark.parametrize(("halves", "share", "shown"), [
    (1.65, 0.0, True), (1.35, 0.0, False), (0, 0.055, True), (0, 0.045, False)])
def test_a_constant_is_there_at_one_and_a_half_half_widths_and_a_twentieth_of_the_whole(halves: float, share, shown) -> None:
    """Beside a prediction of mean 0, and noise of mean 0 that has nothing of it: its blocks of 100 give the half width with
    t(0.975; 15) = 2.1314. Where there is next to no noise the twentieth counts."""
    rng = np.random.default_rng(6029)
    predicted = np.tile([1.0, -1.0], 800) * rng.normal(size=1600)
    predicted -= predicted.mean()
    noise = rng.normal(size=1600)
    noise -= noise.mean() + predicted * (noise @ predicted) / (predicted @ predicted)
    if share:
        noise *= 1e-3
    else:
        predicted *= 0.3
    half = 2.1314 * noise.reshape(16, 100).mean(axis=1).std(ddof=1) / 4
    constant = halves * half if halves else share * float(np.sqrt(np.mean(predicted**2)))
    found = estimate_scale(1e-6 * (predicted + noise + constant)[:, None], 1e-6 * predicted[:, None])
    assert found is not None
    assert found.blocks == 16
    assert found.constant_um == pytest.approx((constant,), rel=1e-6)
    assert found.constant_shown == shown


@pytest.mark.parametrize(("ratio", "interval", "said"), [
    (4.0, (3.5, 4.57), " It is 4.00 times smaller (95 %: 3.50 to 4.57)."),
    (0.5, (0.4, 0.62), " It became larger: before over after is 0.50 (95 %: 0.40 to 0.62). Do not use this correction."),
    (1.1, (0.9, 1.3), " Before over after is 1.10 (95 %: 0.90 to 1.30): no difference is shown."),
    (1.1, None, " These are too few places to say how sure that is.")])
def test_a_comparison_is_told_in_a_sentence(ratio: float, interval: tuple[float, float] | None, said: str) -> None:
    one = Readings("", "target", np.arange(2.0)[:, None], np.array([[3e-6], [-4e-6]]), np.full((2, 1), 1e-6), None)
    other = replace(one, deviation=np.array([[1e-6], [1e-6]]))
    assert _comparison_text(replace(compare(one, other), ratio=ratio, interval=interval)) == (
        "At 2 places measured before and after the correction the deviation went from 3.5 to 1.0 um RMS, the largest from 4.0 "
        f"to 1.0 um.{said}")


@pytest.mark.parametrize(("scale", "said"), [
    (SURE, "1.200 times (95 %: 1.100 to 1.300) the predicted. So it is where the load tests were taken at standstill. Advice: "
     "correct --scale 1.2:0.051, which would explain 95.0 % and leave 20.0 um RMS."),
    (replace(SURE, scale=0.7, interval=(0.65, 0.75)), "0.700 times (95 %: 0.650 to 0.750) the predicted. Advice: correct "
     "--scale 0.7:0.026, which would explain 95.0 % and leave 20.0 um RMS."),
    (replace(SURE, scale=1.01, interval=(0.98, 1.04)), "1.010 times (95 %: 0.980 to 1.040) the predicted. 1 lies inside: no "
     "scale is needed; correct --scale 1:0.015 tells that motion adds nothing beyond that."),
    (replace(SURE, scale=1.01, interval=(0.98, 1.04), constant_shown=True), "1.010 times (95 %: 0.980 to 1.040) the predicted. "
     "1 lies inside: no scale is needed."),
    (replace(SURE, interval=None), "1.200 times the predicted. No scale is advised; the findings say why.")])
def test_a_scale_is_told_in_a_sentence(scale: Scale, said: str) -> None:
    assert _scale_text(scale) == (
        "The prediction as it stands explains 90.0 % of the mean square measured before at the 100 places where it says "
        f"something; there the measured deviation is {said}")

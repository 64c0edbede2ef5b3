"""What `identify` says of joints that are known roughly and of readings that remember each other, on both sides."""

from __future__ import annotations

import html
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2

from identification.common.chart import Band, Bars, Points
from identification.common.findings import CompstiffError, Finding
from identification.fit.fit import Fit, _against_prior, _light_rows, _other_noise, fit_stiffness
from identification.fit.load_test import LoadTest
from identification.fit.mending import BadVisit, Mend
from identification.fit.mistakes.judge import common_factor_findings
from identification.fit.noise import noise_model
from identification.fit.report import _by_pose, _residuals, identification_report
from identification.fit.visits import VisitScore
from tests.identification.fit.test_laws_posterior import NOISY, simulate
from tests.virtual_cell.arm import IRB6660


def told(fit: Fit, code: str) -> list[tuple[str, str, str]]:
    findings = [one for one in fit.findings if one.code == code]
    assert {one.file for one in findings} <= {fit.measurements.source}
    return [(one.level, one.message, one.hint) for one in findings]


@pytest.mark.parametrize("directions", ["z", "xz"])
def test_joints_that_are_known_to_a_fifth_only_are_said(tmp_path: Path, directions: str) -> None:
    """1 sigma of ln k over 0.2; each by itself, with why, and a load that helps. Four loads leave joints on either side; one
    that was not seen is said otherwise (CS1012)."""
    cell, rows = simulate(tmp_path, np.random.default_rng(5), poses=2, loads=2, directions=directions)
    fit = fit_stiffness(cell, rows)
    std = fit.model.log_std
    unseen = {int(message[1]) for _, message, _ in told(fit, "CS1012")}
    rough = [joint for joint in range(1, 7) if std[joint - 1] > 0.2 and joint not in unseen]
    assert [message[:15] for _, message, _ in told(fit, "CS1014")] == [f"k{joint} is tentative" for joint in rough]
    assert rough
    assert len(rough) + len(unseen) < 6
    for level, message, hint in told(fit, "CS1014"):
        assert level == "note"
        assert "trade off (correlation" in message or "times the sensor's sigma" in message
        assert re.match(r"one load of 300 N along base [xyz] at joints \(.*\) deg would bring the uncertainty of "
                        f"{message[:2]} to", hint)


def test_joints_of_a_model_that_is_rejected_are_said_in_one_line(tmp_path: Path) -> None:
    """Twice as soft as the poses that are kept back: what the loads tell of a joint does not count."""
    cell, rows = simulate(tmp_path, np.random.default_rng(5), poses=6)
    good = fit_stiffness(cell, rows)
    assert not good.model.rejected
    sure = [joint for joint in range(1, 7) if good.grades[joint - 1].grade == "reliable"]
    assert len(sure) > 3
    assert not [message for _, message, _ in told(good, "CS1014") if "rejected" in message]
    kept = rows.visit > 3
    soft = np.where(kept, 1.0, 2.0)[:, None] * rows.deflection
    bad = fit_stiffness(cell, replace(rows, deflection=soft, validate=kept))
    assert bad.model.rejected
    names = ", ".join(f"k{joint}" for joint in range(1, 7) if bad.model.log_std[joint - 1] <= 0.2)
    said, = [one for one in told(bad, "CS1014") if "rejected" in one[1]]
    assert said == ("note", f"{names} are tentative: the model of all joints is rejected, whatever the loads tell of one",
                    "compstiff diagnose looks for what the model lacks")


@pytest.mark.parametrize("more", [False, True])
@pytest.mark.parametrize(("memory", "remembered"), [(0.8, True), (0.0, False)])
def test_readings_that_remember_each_other_are_said(tmp_path: Path, memory: float, remembered: bool, more: bool) -> None:
    """Noise of the sensor alone, of its stated size, each reading's with this share of the one before it in the same visit: the
    correlation that is told is that one. Readings on their own are not spoken of, and neither are they where the cell states
    more noise than there is (more), which takes some for its own: each such set was told a correlation of about 0.1."""
    rng = np.random.default_rng(3)
    alone = NOISY if more else NOISY.replace("0.01,", "0,").replace("[1, 1, 1]", "[0, 0, 0]").replace("[4, 4, 4]", "[0, 0, 0]")
    cell, rows = simulate(tmp_path, rng, poses=8, loads=6, quiet=True, text=alone)
    noise = cell.noise.deflection * rng.standard_normal(rows.deflection.shape)
    for row in range(1, len(rows)):
        if rows.visit[row] == rows.visit[row - 1]:
            noise[row] = memory * noise[row - 1] + np.sqrt(1 - memory**2) * noise[row]
    fit = fit_stiffness(cell, replace(rows, deflection=rows.deflection + noise))
    said = told(fit, "CS1040")
    assert len(said) == remembered
    for level, message, hint in said:
        assert level == "note"
        start, _, rest = message.partition("(correlation ")
        told_memory, _, end = rest.partition(")")
        assert start == "neighbouring readings of a visit are alike beyond what they share "
        assert float(told_memory) == pytest.approx(memory, abs=0.25 if more else 0.15)
        assert end == ": they tell less than so many readings of their own"
        assert hint == "wait longer between readings, or take more poses"


@pytest.fixture(scope="module")
def fit(tmp_path_factory: pytest.TempPathFactory) -> Fit:
    cell, rows = simulate(tmp_path_factory.mktemp("fit"), np.random.default_rng(5), poses=8)
    return fit_stiffness(cell, rows)


@pytest.mark.parametrize("ratio", [9900.0, 10100.0])
def test_a_force_error_that_no_double_holds_beside_the_sensor_s_is_refused_at_its_row(fit: Fit, ratio: float) -> None:
    """One per cent of a load in z, as far as it moves the independent arm, over the sensor's 2 um."""
    rows, prior, row = fit.measurements, fit.cell.prior.stiffness, 7
    one_newton = IRB6660.deviation(rows.theta[row], fit.cell.flange_from_tcp.position, np.array([0, 0, 1.0, 0, 0, 0]), prior)[0]
    assert np.all(fit.cell.noise.deflection == 2e-6)
    wrench = rows.wrench.copy()
    wrench[row] = [0, 0, ratio * 2e-6 / (0.01 * np.abs(one_newton).max()), 0, 0, 0]
    data = LoadTest.of(fit.cell, replace(rows, wrench=wrench))
    if ratio < 1e4:
        noise_model(data, 1 / prior)
        return
    with pytest.raises(CompstiffError) as stopped:
        noise_model(data, 1 / prior)
    (said,) = stopped.value.findings
    assert (said.code, said.file, said.line) == ("CS1081", rows.source, rows.line[row])
    told = re.match(r"the force error moves the tool by (\S+) times the sensor's 1 sigma, at most 10000 can be computed",
                    said.message)
    assert told
    assert float(told[1]) == pytest.approx(ratio, rel=0.01)


@pytest.mark.parametrize(("ratio", "readings", "code", "said"), [
    (0.24, 36, "CS1042", "the residual is 0.24 times what the stated noise allows; the intervals use the estimated noise, "
     "which does not trust so small a one"),
    (0.26, 36, "", ""), (0.24, 30, "CS1042", ""), (0.24, 29, "", ""), (1.0, 36, "", ""), (1.98, 36, "", ""),
    (2.04, 36, "CS1013", "the residual is 2.0 times what the stated noise allows; estimated: sensor 1.5 times the stated, "
     "re-seating 8 um a pose; the intervals use the estimated noise")])
def test_a_residual_that_the_stated_noise_does_not_explain_is_said(
    fit: Fit, ratio: float, readings: int, code: str, said: str,
) -> None:
    """Chi-squared under the stated noise, a reading that is left beside the six springs; a small one where there are enough."""
    source = fit.measurements.source
    found = _other_noise(SimpleNamespace(
        data=fit.posterior.data, chi2=ratio**2 * (readings - 6), readings=readings, components=SimpleNamespace(
            sensor=1.5, offset=2.0), at_map=SimpleNamespace(noise=SimpleNamespace(offset=np.array([3e-6, 4e-6, 5e-6])))))
    assert [(one.code, one.level, one.file) for one in found] == [(code, "warning", source)][: bool(code)]
    assert not said or found[0].message == said


@pytest.mark.parametrize("count", [0, 20, 21])
def test_many_rows_that_count_little_are_one_finding_with_the_worst_in_front(fit: Fit, count: int) -> None:
    """Under 30 % of an ordinary row each; twenty are told one by one."""
    order = np.random.default_rng(0).permutation(len(fit.measurements))
    weight, lines = np.full(len(order), 0.31), fit.measurements.line[order]
    weight[order[:count]] = np.linspace(0.02, 0.29, count)
    told = _light_rows(SimpleNamespace(data=fit.posterior.data, row_weight=weight))
    assert {(one.code, one.level, one.file) for one in told} <= {("CS1015", "warning", fit.measurements.source)}
    if count == 21:
        assert [(one.message, one.line) for one in told] == [
            (f"21 of {len(weight)} rows do not fit the others and count less than 30 % of an ordinary one each; the worst in "
             f"lines {', '.join(map(str, lines[:20]))}", lines[0])]
    else:
        assert [one.line for one in told] == lines[:count].tolist()
        assert [one.message for one in told[:1]] == [
            "this row does not fit the others and counts 2 % of an ordinary one"][:count]


@pytest.mark.parametrize(("factors", "said"), [
    ((1.0,) * 6, ""), ((11.4,) * 6, ""), ((11.9,) * 6, "a factor 11.9 to 11.9 off"),
    ((1 / 30,) * 5 + (1.0,), "a factor 0.0333 to 1 off"),
    ((99.0,) * 6, "a factor 99 to 99 off"), ((101.0,) * 6, "refused"), ((101.0,) * 5 + (99.0,), "a factor 99 to 101 off"),
    ((1 / 99,) * 6, "a factor 0.0101 to 0.0101 off"), ((1 / 101,) * 6, "refused")])
def test_springs_far_off_the_prior_are_said_and_a_common_factor_of_a_hundred_is_a_unit(
    fit: Fit, factors: tuple[float, ...], said: str,
) -> None:
    """By the chance that the prior gives them: of six springs 11.6 times its medians, each of a relative standard deviation of
    two, that is one in a thousand."""
    prior, expected = fit.posterior.prior, -np.log(fit.cell.prior.stiffness)
    assert np.allclose(fit.cell.prior.relative_std, 2.0)
    assert np.log(5) == pytest.approx(prior.log_std[0] ** 2)
    off = SimpleNamespace(data=fit.posterior.data, prior=prior, mean=expected - np.log(factors), covariance=1e-4 * np.eye(6))
    grades = tuple(replace(grade, grade="reliable") for grade in fit.grades)
    if said == "refused":
        with pytest.raises(CompstiffError) as stopped:
            _against_prior(off, grades)
        (finding,) = stopped.value.findings
        assert (finding.code, finding.level) == ("CS1018", "error")
        assert "state its prior in cell.yaml" in finding.hint
        return
    p_value = float(chi2.sf(np.sum(np.log(factors) ** 2) / np.log(5), 6))
    assert (p_value < 1e-3) == bool(said)
    told = f"the stiffnesses lie {said} the prior's medians, which it gives a probability of {p_value:.1g}"
    assert [(one.code, one.level, one.message) for one in _against_prior(off, grades)] == [
        ("CS1017", "warning", told)][: bool(said)]


@pytest.mark.parametrize(("weak", "warned", "headline", "says"), [
    (6, False, "NO STIFFNESS IS RELIABLE", "These measurements tell no joint well; "),
    (5, True, "USE WITH CARE", "k1, k2, k3, k4, k5 are not known well from these measurements, the others are reliable; "),
    (1, True, "USE WITH CARE", "k1 is not known well from these measurements, the others are reliable; "),
    (0, True, "IDENTIFIED, WITH 1 WARNING TO READ FIRST", "All six stiffnesses are graded reliable; "),
    (0, False, "RELIABLE", "All six stiffnesses are known; ")])
def test_the_report_s_headline_is_what_the_grades_are(fit: Fit, weak: int, warned: bool, headline: str, says: str) -> None:
    grades = ("tentative",) * weak + ("reliable",) * (6 - weak)
    page = identification_report(replace(fit, model=replace(fit.model, grades=grades), findings=(
        Finding("CS1015", "warning", "w", file="m.csv"),) * warned))
    left = f"{fit.model.fit['residual_rms_um']:.1f} µm RMS of the measured deflections are left unexplained"
    told = html.unescape(re.sub(r"<[^>]+>", "", page)).replace("\xa0", " ")
    assert headline in told
    assert says + left in told


def test_the_report_lists_what_counts_less_and_what_was_left_out(fit: Fit) -> None:
    """The lightest row first, twenty at most; a pose with its share and what would mend it."""
    count = len(fit.measurements)
    assert "Rows that count less" not in identification_report(replace(fit, row_weight=np.ones(count)))
    weight = np.ones(count)
    weight[[2, 9]] = 0.4, 0.07
    score = VisitScore("P7", np.array([4, 5]), 44, 0, 5.0, 0.002, 0.75, np.zeros(3), np.ones(3))
    bad = BadVisit(score, (Mend("angle", "axis 4 off by 5 deg", 0.9),), "")
    page = identification_report(replace(fit, row_weight=weight, bad_visits=(bad,)))
    table = re.sub(r"<[^>]+>", " ", page.split("Rows that count less")[-1].split("</table>")[0]).replace("\xa0", " ")
    line = fit.measurements.line.astype(str)
    assert re.findall(r"(\d+)\s+(\d+ %)", table) == [(line[9], "7 %"), (line[2], "40 %")]
    table = page.split("Poses left out: their readings fit no stiffness")[-1].split("</table>")[0].replace("\xa0", " ")
    for words in ("P7", "44", "p = 0.002", "75 %", "axis 4 off by 5 deg (90 % of what was tried)"):
        assert words in table
    many = identification_report(replace(fit, row_weight=np.linspace(0.1, 0.9, count)))
    assert many.split("Rows that count less")[-1].split("</table>")[0].count("<tr>") == 21


def test_the_residuals_lie_in_the_band_that_holds_95_per_cent_of_their_noise(fit: Fit) -> None:
    """Of each axis at its line [um], the band that of z, half of it up and half of it down; how many of all components lie in
    their own is counted, of those that were read."""
    count = len(fit.measurements)
    std = np.tile([1e-6, 2e-6, 3e-6], (count, 1)) * np.linspace(1, 2, count)[:, None]
    residual = 1.95 * std
    residual[::2] *= -1
    residual[:4], residual[4, 0] = 1.97 * std[:4], np.nan
    figure = _residuals(fit.measurements, replace(fit, std=std, residual=residual))
    band, *points = figure.panels[0].series
    assert isinstance(band, Band)
    edge = 1.959964 * 3.0 * np.linspace(1, 2, count)
    assert np.asarray(band.high) == pytest.approx(edge, rel=1e-3)
    assert np.asarray(band.low) == pytest.approx(-edge, rel=1e-3)
    for axis, each in enumerate(points):
        assert isinstance(each, Points)
        assert (each.name, list(each.x)) == ("xyz"[axis], fit.measurements.line.tolist())
        assert np.asarray(each.y) == pytest.approx(1e6 * residual[:, axis], nan_ok=True)
    assert f"{100 * (3 * count - 13) / (3 * count - 1):.0f} % of all components are inside their own." in figure.caption


def test_a_pose_s_bars_are_of_the_readings_that_it_has(fit: Fit) -> None:
    """Of two poses one has a component in two of its rows only, the other in none."""
    residual = fit.residual.copy()
    rows = [np.flatnonzero(fit.measurements.visit == number) for number in (0, 1)]
    residual[rows[0]], residual[rows[0][2:], 1], residual[rows[1], 2] = 6e-6, np.nan, np.nan
    figure = _by_pose(fit.measurements, replace(fit, residual=residual))
    bars = {each.name: each.values for each in figure.panels[0].series if isinstance(each, Bars)}
    assert [bars[axis][0] for axis in "xyz"] == pytest.approx([6.0] * 3)
    assert bars["z"][1] == 0.0
    assert bars["x"][1] == pytest.approx(1e6 * np.sqrt(np.mean(residual[rows[1], 0] ** 2)))


@pytest.mark.parametrize(("count", "words"), [(0, "no pose left out"), (1, "1 pose left out"), (2, "2 poses left out")])
def test_poses_left_out_are_counted_in_the_report(fit: Fit, count: int, words: str) -> None:
    score = VisitScore("P7", np.array([4, 5]), 44, 0, 5.0, 0.002, 0.75, np.zeros(3), np.ones(3))
    page = identification_report(replace(fit, bad_visits=(BadVisit(score, (), ""),) * count))
    assert words in page.replace("\xa0", " ")


@pytest.mark.parametrize(("times", "said"), [
    (2.9, ""), (3.1, "3.1 times stiffer"), (1 / 2.9, ""),
    (1 / 3.1, "3.1 times softer than the prior's medians, as they would with forces in lbf, not in N"),
    (1 / 4.44822, "4.45 times softer than the prior's medians, as they would with forces in lbf, not in N"),
    (20.0, "20 times stiffer than the prior's medians, as they would with deflections in mil, not in um"),
    (180.0, "180 times stiffer")])
def test_a_factor_common_to_all_joints_is_said_with_the_unit_it_looks_like(fit: Fit, times: float, said: str) -> None:
    """Newtons written as pounds of force are fewer, and make the springs look softer; micrometres as mil make them stiffer."""
    prior = fit.posterior.prior
    off = SimpleNamespace(data=fit.posterior.data, prior=prior, mean=-np.log(times * prior.prior.stiffness),
                          covariance=0.01 * np.eye(6))
    found = common_factor_findings(off)
    assert [(one.code, one.level, one.file) for one in found] == [("CS1702", "warning", fit.measurements.source)][: bool(said)]
    if said:
        end = "" if "prior" in said else " than the prior's medians"
        assert found[0].message == f"all joints come out {said}{end}"
        assert found[0].hint is not None
        assert "state prior.stiffness_nm_per_rad in cell.yaml" in found[0].hint

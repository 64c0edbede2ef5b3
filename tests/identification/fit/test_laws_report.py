"""The figures and keys of `identify`'s report: what is drawn is what the fit says, in the units of its axes."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from identification.common.chart import Band, Bars, Cells, Line, Points, Rule
from identification.common.findings import Finding
from identification.fit import report
from identification.fit.profile import Profile
from identification.fit.report import (
    _against,
    _by_pose,
    _correlations,
    _intervals,
    _keys,
    _profiles,
    _residuals,
    _spectrum,
    _steps,
)
from tests.support import robot

K = np.geomspace(1e5, 3.2e6, 6)


def rows_of(visit: np.ndarray, deflection: np.ndarray, validate: np.ndarray | None = None) -> Any:
    """Rows of these visits; the first stands in line 11."""
    class Rows(SimpleNamespace):
        def __len__(self) -> int:
            return len(visit)

    return Rows(visit=visit, deflection=deflection, line=11 + np.arange(len(visit)), source="m.csv", weights=(),
                validate=np.zeros(len(visit), dtype=bool) if validate is None else validate)


def test_each_stiffness_is_drawn_with_its_interval_and_what_was_known_before() -> None:
    """Log-normal before: 95 % lie within 1.96 standard deviations of ln k."""
    cell: Any = SimpleNamespace(prior=SimpleNamespace(stiffness=2 * K, log_std=np.linspace(0.5, 1.0, 6)))
    fit: Any = SimpleNamespace(model=SimpleNamespace(stiffness=K, interval_95=np.column_stack([0.9 * K, 1.2 * K]), grades=(
        "reliable", "tentative", *["reliable"] * 4)))
    assert _intervals(cell, fit).panels[0].y.log
    before, now = _intervals(cell, fit).panels[0].series
    assert isinstance(before, Points)
    assert isinstance(now, Points)
    for points, middle, factors in ((before, 2 * K, (np.exp(-1.959964 * np.linspace(0.5, 1.0, 6)),
                                                     np.exp(1.959964 * np.linspace(0.5, 1.0, 6)))),
                                    (now, K, (0.9 / np.ones(6), 1.2 * np.ones(6)))):
        assert_allclose(points.x, np.arange(6))
        assert_allclose(points.y, middle)
        assert points.interval is not None
        for end, factor in zip(points.interval, factors, strict=True):
            assert_allclose(end, middle * factor, rtol=1e-4)
    assert now.labels[1] == "k2: 2e+05 N m/rad, 95 % 1.8e+05 to 2.4e+05, tentative"


@pytest.mark.parametrize(("count", "every"), [(3000, 1), (3001, 2), (6000, 2), (6001, 3)])
def test_of_more_than_three_thousand_rows_as_many_are_drawn_evenly(count: int, every: int) -> None:
    """Residuals in their own band of two of three sigmas; what is counted is of all rows."""
    std = np.full((count, 3), 2e-6)
    residual = np.tile([1e-6, -5e-6, 3e-6], (count, 1))
    fit: Any = SimpleNamespace(std=std, residual=residual)
    figure = _residuals(rows_of(np.arange(count), residual), fit)
    band, *points = figure.panels[0].series
    assert isinstance(band, Band)
    shown = np.arange(0, count, every)
    assert len(shown) <= 3000
    assert_allclose(band.x, 11 + shown)
    assert_allclose(band.high, 3.92 * np.ones(len(shown)), rtol=1e-3)
    assert_allclose(band.low, -3.92 * np.ones(len(shown)), rtol=1e-3)
    for each, size in zip(points, (1.0, -5.0, 3.0), strict=True):
        assert isinstance(each, Points)
        assert_allclose(each.x, 11 + shown)
        assert_allclose(each.y, size)
    told = "" if every == 1 else f" {len(shown)} of {count} rows are drawn, evenly spaced."
    assert figure.caption.endswith(f"drawn for z; 67 % of all components are inside their own.{told}")


@pytest.mark.parametrize("poses", [60, 61])
def test_of_more_than_sixty_poses_those_with_the_largest_residuals_have_bars(poses: int) -> None:
    """RMS of each axis [um], in the order of the file; a pose is named by the line of its first row."""
    visit = np.repeat(np.arange(poses), 2)
    residual = np.tile(1e-6 * np.array([[3.0, 4.0, 1.0], [4.0, 3.0, 1.0]]), (poses, 1)) * np.repeat(
        np.linspace(2, 1, poses), 2)[:, None]
    smallest = 20
    residual[2 * smallest: 2 * smallest + 2] *= 0.1
    fit: Any = SimpleNamespace(residual=residual)
    figure = _by_pose(rows_of(visit, residual), fit)
    kept = np.arange(poses) if poses == 60 else np.delete(np.arange(poses), smallest)
    assert list(figure.panels[0].x.categories) == [f"{11 + 2 * pose}" for pose in kept]
    sizes = (np.linspace(2, 1, poses) * np.where(np.arange(poses) == smallest, 0.1, 1.0))[kept]
    for bars, rms in zip(figure.panels[0].series, (np.sqrt(12.5), np.sqrt(12.5), 1.0), strict=True):
        assert isinstance(bars, Bars)
        assert_allclose(bars.values, rms * sizes)
    assert ("The 60 of 61 poses with the largest are drawn." in figure.caption) is (poses == 61)


def test_measured_deflections_are_drawn_against_what_the_model_predicts_of_them() -> None:
    """Fitted rows as dots, validation rows as crosses, all axes [um]; the line of those that agree reaches a little beyond."""
    rng = np.random.default_rng(2)
    deflection, residual = 1e-4 * rng.standard_normal((9, 3)), 1e-6 * rng.standard_normal((9, 3))
    residual[3, 1] = np.nan
    validate = np.arange(9) % 3 == 2
    fit: Any = SimpleNamespace(residual=residual)
    line, *points = _against(rows_of(np.arange(9), deflection, validate), fit).panels[0].series
    reach = 1.05e6 * np.nanmax(np.abs(deflection - residual))
    assert isinstance(line, Line)
    assert_allclose([line.x, line.y], [[-reach, reach]] * 2)
    assert [each.name for each in points if isinstance(each, Points)] == [
        f"{axis}, {kind}" for kind in ("fitted", "validation") for axis in "xyz"]
    for k, each in enumerate(points):
        assert isinstance(each, Points)
        rows = np.flatnonzero(validate if k > 2 else ~validate)
        assert each.symbol == ("cross" if k > 2 else "dot")
        assert_allclose(each.x, 1e6 * (deflection - residual)[rows, k % 3])
        assert_allclose(each.y, 1e6 * deflection[rows, k % 3])
    assert len(_against(rows_of(np.arange(9), deflection), fit).panels[0].series) == 4


def test_correlations_the_spectrum_and_profiles_are_drawn_as_they_are() -> None:
    """A profile up to a drop of ten, with the bound of 95 %; what is nothing of a logarithmic axis as a millionth."""
    std, root = np.linspace(0.1, 0.6, 6), np.random.default_rng(4).standard_normal((6, 6))
    correlation = np.corrcoef(root)
    fit: Any = SimpleNamespace(
        model=SimpleNamespace(covariance=correlation * np.outer(std, std), log_std=std),
        ellipsoid=SimpleNamespace(sentence="least certain: k3"), spectrum=np.array([900.0, 40.0, 1.0, 0.3, 1e-3, 0.0]),
        profiles=(Profile(2, K, np.array([20.0, 4.0, 0.0, 1.0, 9.0, 11.0]), "bounded", (None, None)),))
    figure = _correlations(fit)
    (cells,) = figure.panels[0].series
    assert isinstance(cells, Cells)
    assert_allclose(cells.values, correlation)
    assert figure.caption == "Least certain: k3."
    assert _spectrum(fit).panels[0].y.log
    assert _profiles(fit).panels[0].x.log
    assert _profiles(fit).panels[0].y.from_zero
    bars, rule = _spectrum(fit).panels[0].series
    assert isinstance(bars, Bars)
    assert isinstance(rule, Rule)
    assert_allclose(bars.values, [900.0, 40.0, 1.0, 0.3, 1e-3, 1e-6])
    assert rule.at == 1.0
    line, rule = _profiles(fit).panels[0].series
    assert isinstance(line, Line)
    assert isinstance(rule, Rule)
    assert line.name == "k2: bounded"
    assert_allclose([line.x, line.y], [K, [10.0, 4.0, 0.0, 1.0, 9.0, 10.0]])
    assert rule.at == pytest.approx(0.5 * 1.959964**2, abs=2e-3)


def told(held_out: tuple[float, float] | None = None, grades: tuple[str, ...] = ("reliable",) * 6, rejected: str = "",
         bad: int = 0) -> Any:
    model = SimpleNamespace(fit={"noise": {"sensor_scale": 1.234}, "residual_rms_um": 3.456, "rows": 42},
                            log_std=np.array([0.02, 0.03, 0.05, 0.16, 0.04, 0.01]), grades=grades, rejected=rejected)
    cell = SimpleNamespace(source="cell.yaml", robot=robot())
    return SimpleNamespace(model=model, cell=cell, measurements=SimpleNamespace(source="m.csv", weights=()), held_out=held_out,
                           bad_visits=(None,) * bad)


def test_the_keys_are_the_fit_s_numbers() -> None:
    """The least certain joint with two sigma: 0.32 in ln k is a factor of 1.4."""
    grades = ("reliable", "tentative", "not identifiable", "reliable", "reliable", "reliable")
    keys = [(key.label, key.value, key.unit, key.note) for key in _keys(told((12.34e-6, 5.67e-6), grades, bad=2))]
    assert keys == [("left unexplained", "3.5", "µm", "RMS of 42 rows; sensor noise 1.23 times the stated"),
                    ("on rows not fitted", "12.3 → 5.7", "µm", "RMS, with what was known before and now"),
                    ("least certain joint", "k4", "", "2 sigma: a factor 1.4"),
                    ("reliable joints", "4 of 6", "", "2 poses left out")]
    assert [key.label for key in _keys(told())] == ["left unexplained", "least certain joint", "reliable joints"]


@pytest.mark.parametrize(("grades", "rejected", "commands"), [
    (("reliable",) * 6, "", ["diagnose", "correct"]), (("reliable",) * 6, "they conflict", ["diagnose"]),
    (("reliable",) * 5 + ("tentative",), "", ["design", "diagnose", "correct"])])
def test_what_to_do_next_is_what_the_grades_ask_for(grades: tuple[str, ...], rejected: str, commands: list[str]) -> None:
    assert [step.command.split()[1] for step in _steps(told(grades=grades, rejected=rejected))] == commands


def test_two_sigma_are_told_in_per_cent_up_to_thirty() -> None:
    assert [report._two_sigma(std) for std in (0.149, 0.151, 0.5)] == ["29.8 %", "a factor 1.4", "a factor 2.7"]


@pytest.mark.parametrize(("grades", "rejected", "levels", "said"), [
    (("reliable",) * 6, "", ("note",), ("good", "RELIABLE", "All six stiffnesses are known; ")),
    (("reliable",) * 6, "", ("warning", "note", "warning"), (
        "caution", "IDENTIFIED, WITH 2 WARNINGS TO READ FIRST", "All six stiffnesses are graded reliable; ")),
    (("reliable",) * 5 + ("tentative",), "", ("warning",), (
        "caution", "USE WITH CARE", "k6 is not known well from these measurements, the others are reliable; ")),
    (("tentative", *("reliable",) * 4, "not identifiable"), "", (), (
        "caution", "USE WITH CARE", "k1, k6 are not known well from these measurements, the others are reliable; ")),
    (("tentative",) * 6, "", (), ("bad", "NO STIFFNESS IS RELIABLE", "These measurements tell no joint well; ")),
    (("tentative",) * 6, "they bend", (), ("bad", "DO NOT USE YET", "Six springs do not explain these measurements "
                                           "(they bend): find out why first."))])
def test_the_headline_is_what_the_grades_allow(
        grades: tuple[str, ...], rejected: str, levels: tuple[Any, ...], said: tuple[str, str, str]) -> None:
    fit = told(grades=grades, rejected=rejected)
    fit.findings = tuple(Finding(f"CS101{k}", level, "x") for k, level in enumerate(levels, 2))
    verdict = report._verdict(fit)
    left = "" if rejected else "3.5 µm RMS of the measured deflections are left unexplained."
    assert (verdict.level, verdict.word, verdict.sentence) == (said[0], said[1], said[2] + left)


def page_of(monkeypatch: pytest.MonkeyPatch, **changed: Any) -> Any:
    """The page of a fit of 30 rows, the third and the last of which count less, with one bad visit."""
    fit = told(changed.pop("held_out", None), ("reliable", *("tentative",) * 5))
    model, weight = fit.model, np.ones(30)
    weight[[2, 29]], weight[10] = (0.456, 0.0123), np.nan
    model.fit["noise"]["pose_offset_um"] = [1.0, 2.0, 6.0]
    model.stiffness, model.interval_95 = K, np.column_stack([0.9 * K, 1.2 * K])
    fit.cell = SimpleNamespace(source="cell.yaml", robot=robot(), prior=SimpleNamespace(stiffness=2 * K, log_std=np.ones(6)))
    fit.measurements = SimpleNamespace(source="runs/m.csv", line=101 + np.arange(30))
    helps = ("", "load it", report.LOOK_FOR_IT, "", "", "")
    fit.grades = tuple(SimpleNamespace(grade=grade, reason=f"reason {i}", helpful=help_) for i, (grade, help_) in enumerate(
        zip(model.grades, helps, strict=True), 1))
    fit.conflicts = tuple(SimpleNamespace(part=part, rest="the rest", distance=4.56, directions=3, corrected=p,
                                          is_conflict=p < 0.05) for part, p in (
                                              ("loads along x", 0.00123), ("positive loads", 0.5)))
    fit.bad_visits, fit.row_weight, fit.profiles = (), weight, ()
    fit.ellipsoid, fit.findings, fit.as_dict = SimpleNamespace(sentence="least certain: k4"), (), dict
    for name, value in changed.items():
        setattr(fit, name, value)
    for figure in ("_intervals", "_against", "_residuals", "_by_pose", "_correlations", "_spectrum", "_profiles", "_steps"):
        monkeypatch.setattr(report, figure, lambda *of, figure=figure: figure)
    monkeypatch.setattr(report, "render", lambda page: page)
    return report.identification_report(fit)


def test_the_report_tells_stiffnesses_conflicts_and_light_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    """Numbers to the right; the lightest row first; what would help beside the reason, but for what is said elsewhere."""
    page = page_of(monkeypatch)
    assert page.title == "Identified stiffnesses: m.csv"
    lead, conflict = page.words
    assert lead == (f"Six joint stiffnesses of {robot().name} from 42 rows (reliable: k1; tentative: k2, k3, k4, k5, k6). The "
                    "model leaves 3.46 um RMS of the measured deflections unexplained. Noise, estimated: sensor 1.23 times "
                    "what cell.yaml states, re-seating 3.0 um a pose; the intervals use it. Least certain: k4.")
    assert conflict == ("One set of linear springs does not explain all rows: loads along x and the rest want different "
                        "stiffnesses. See the table of subsets.")
    stiffnesses, agree, light = page.tables
    assert stiffnesses.rows[:3] == [
        ["k1", "1e+05", "9e+04 ... 1.2e+05", "4.0 %", "2e+05", "reliable", "reason 1"],
        ["k2", "2e+05", "1.8e+05 ... 2.4e+05", "6.0 %", "4e+05", "tentative", "reason 2; load it"],
        ["k3", "4e+05", "3.6e+05 ... 4.8e+05", "10.0 %", "8e+05", "tentative", "reason 3"]]
    assert stiffnesses.rows[3][3] == "a factor 1.4"
    assert (len(stiffnesses.rows), stiffnesses.numbers) == (6, (1, 2, 3, 4))
    assert agree.rows == [["loads along x", "the rest", "4.6", "3", "0.0012", "conflict"],
                          ["positive loads", "the rest", "4.6", "3", "0.5", "agree"]]
    assert agree.numbers == (2, 3, 4)
    assert (light.rows, light.numbers) == ([["130", "1 %"], ["103", "46 %"]], (0, 1))
    assert page.first == ["_intervals", "_against"]
    assert page.others == ["_residuals", "_by_pose", "_correlations", "_spectrum"]
    assert page_of(monkeypatch, profiles=(None,)).others[0] == "_profiles"


def test_the_report_tells_poses_left_out_and_what_was_not_fitted(monkeypatch: pytest.MonkeyPatch) -> None:
    score = SimpleNamespace(name="P7", line=88, share=0.456)
    monkeypatch.setattr(report, "evidence", lambda of: f"evidence of {of.name}")
    monkeypatch.setattr(report, "mending", lambda bad: f"mend {bad.score.name}")
    page = page_of(monkeypatch, held_out=(12.34e-6, 5.67e-6), bad_visits=(SimpleNamespace(score=score),), conflicts=(),
                   row_weight=np.append(np.full(29, 0.9991), 0.9989))
    assert page.words[1:] == ["On the validation rows, which were not fitted: 12.3 um RMS with the prior's stiffnesses, 5.7 um "
                              "with the identified ones."]
    left_out, light = page.tables[2:]
    assert (left_out.rows, left_out.numbers) == ([["P7", "88", "evidence of P7", "46 %", "mend P7"]], (1, 3))
    assert light.rows == [["130", "100 %"]]
    assert len(page_of(monkeypatch, row_weight=np.ones(30)).tables) == 2
    assert len(page_of(monkeypatch, row_weight=np.linspace(0.1, 0.9, 30)).tables[-1].rows) == 20

"""What is stated of a joint's log, in numbers: stiffness and its interval, a zero's shift, the gain over all joints."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import quad

from identification.model.robot import Prior
from identification.motion import pages, stiffness
from identification.motion.axis import Axis, Solved, answered
from identification.motion.diagnosis import JointLogDiagnosis
from identification.motion.prediction import Gain
from identification.motion.remainder import _spectrum
from identification.motion.stiffness import AxisStiffness, _averaged, _judged, _own_share, log_posterior
from identification.motion.transmission import Transmission
from identification.motion.zeros import ZeroShift, _shifts
from tests.identification.motion.test_laws_transmission import record

FOUND = AxisStiffness(2, 2e-7, 3e-9, 4e-9, 0.25, 2.5e-7, (0.002, 1e-4), "reliable", "well", 5000, 321.4,
                      (("a.csv", 2.1e-7, 4e-9), ("b.csv", 1.9e-7, 5e-9)), "a transmission error", 3.1)
PRIOR = Prior(np.array([1e6, 4e6, 2e6, 5e5, 2e5, 1e5]), np.array([2.0, 0.5, 2, 2, 2, 2]))


def test_a_stiffness_has_the_interval_of_its_compliance() -> None:
    """Three and four sevenths ... of a right triangle: 5e-9 in all."""
    assert FOUND.std == pytest.approx(5e-9)
    low, high = FOUND.interval_95
    assert (low, high) == pytest.approx((1 / 2.098e-7, 1 / 1.902e-7))
    assert FOUND.sentence == "k2 = 5e+06 N m/rad (4.77e+06 ... 5.26e+06), reliable"
    assert FOUND.as_dict() == {
        "joint": 2, "grade": "reliable", "reason": "well", "compliance_rad_per_nm": 2e-7, "noise_std": 3e-9, "law_std": 4e-9,
        "stiffness_nm_per_rad": pytest.approx(5e6), "interval_95": [pytest.approx(low), pytest.approx(high)],
        "straight_line_nm_per_rad": pytest.approx(4e6), "torque_share_of_its_own": 0.25, "samples": 5000,
        "worth_independent": 321.4, "link_delay_s": {"estimate": 0.002, "std": 1e-4},
        "records": [{"record": "a.csv", "compliance_rad_per_nm": 2.1e-7, "std": 4e-9},
                    {"record": "b.csv", "compliance_rad_per_nm": 1.9e-7, "std": 5e-9}],
        "beside": "a transmission error", "records_apart_sigmas": 3.1}
    assert FOUND.lines() == [
        "k2: well; 5000 samples, worth 321 independent ones; beside a transmission error",
        "  a.csv: k = 4.76e+06 N m/rad (c = 2.10e-07 +- 8.0e-09)", "  b.csv: k = 5.26e+06 N m/rad (c = 1.90e-07 +- 1.0e-08)"]
    # Where the compliance may be nothing the stiffness has no upper end, and where it may not be positive no lower one either.
    assert replace(FOUND, compliance=9.7e-9).interval_95 == (pytest.approx(1 / 1.95e-8), np.inf)
    assert replace(FOUND, compliance=-1e-8).interval_95 == (np.inf, np.inf)
    alone = replace(FOUND, records=(), compliance=9.7e-9, beside="").as_dict()
    assert (alone["interval_95"][1], alone["records_apart_sigmas"]) == (None, None)


@pytest.mark.parametrize(("share", "std", "grade"), [
    (0.0199, 1e-9, "not identifiable"), (0.5, 2e-7 / 2.99, "not identifiable"), (0.5, 1e-9, "reliable")])
def test_a_stiffness_says_why_it_is_stated_or_not(share: float, std: float, grade: str) -> None:
    judged = _judged(replace(FOUND, share=share, noise_std=std, law_std=0.0, apart=0.0))
    assert judged.grade == grade
    assert judged.refused == (grade == "not identifiable")
    if share < 0.02:
        assert judged.reason == ("torque follows speed and acceleration too closely: 2.0 % of its variance is its own, 2 % are "
                                 "needed")
    else:
        assert judged.reason == ("the log does not fix it: " if judged.refused else "") + (
            f"c = 2.00e-07 rad/(N m), {std:.1e} by the noise and 0.0e+00 by how the log is read; {100 * share:.1f} % of the "
            "torque's variance is not that of speed and acceleration")


@pytest.mark.parametrize(("compliance", "std"), [(2e-7, 5e-9), (3e-7, 9e-8)])
def test_a_log_s_stiffness_and_the_prior_are_weighed_by_their_densities(compliance: float, std: float) -> None:
    """The prior is one of ln c, the log one of c."""
    found = replace(FOUND, compliance=compliance, noise_std=std, law_std=0.0)
    mean, width = -np.log(4e6), float(PRIOR.log_std[1])

    def density(x: float) -> float:
        return float(np.exp(-0.5 * ((x - mean) / width) ** 2 - 0.5 * ((np.exp(x) - compliance) / std) ** 2))

    limits = (mean - 6 * width, np.log(compliance + 8 * std))
    whole, first, second = (quad(lambda x, power=power: x**power * density(x), *limits, limit=400)[0] for power in range(3))
    got = log_posterior(found, PRIOR, 2)
    assert got == pytest.approx((first / whole, second / whole - (first / whole) ** 2), rel=1e-3)
    for nothing in (None, replace(found, grade="not identifiable")):
        assert log_posterior(nothing, PRIOR, 2) == pytest.approx((mean, width**2))


def solved(value: float, std: float, chi2: float, count: int, size: int = 2) -> Solved:
    return Solved(np.full(size, value), std**2 * np.eye(size), chi2, count)


def test_answers_are_averaged_by_how_likely_they_are() -> None:
    """A model with a parameter more and the same sum of squares is 1 / sqrt(n) times as likely."""
    mean, std = _averaged([solved(1.0, 0.1, 50.0, 100), solved(2.0, 0.2, 50.0, 100, 3)], 1)
    weight = np.array([10, 1]) / 11
    assert mean == pytest.approx(weight @ [1, 2])
    assert std**2 == pytest.approx(weight @ (np.array([0.01, 0.04]) + (np.array([1, 2]) - mean) ** 2))
    better, _ = _averaged([solved(1.0, 0.1, 50.0, 100), solved(2.0, 0.2, 45.0, 100)], 0)
    likelier = (50 / 45) ** 50
    assert better == pytest.approx((1 + 2 * likelier) / (1 + likelier))


def test_a_torque_s_own_share_is_what_other_columns_leave_of_it() -> None:
    rng = np.random.default_rng(0)
    basis = np.linalg.qr(np.column_stack([np.ones(50), rng.standard_normal((50, 3))]))[0]
    torque = 3.0 * basis[:, 1] + 4.0 * basis[:, 2] + 7.0 * basis[:, 0]
    assert _own_share(np.column_stack([basis[:, 0], torque, basis[:, 2]]), 1) == pytest.approx(9 / 25)


def test_a_stiffness_s_law_is_how_far_it_moves_with_the_way_the_log_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    """In bands to 4, 6 and 9 Hz, each with and without a deviation that follows the angle: about what the middle one says."""
    log = record(tmp_path, 3, {})
    told = iter([1.0, 1.2, 1.1, 1.5, 0.9, 1.0])

    def answer(axis: Axis, columns: np.ndarray) -> Solved:
        found = np.full(columns.shape[1], 0.004)
        found[len(axis.lengths)] = next(told)
        return Solved(found, 0.01 * np.eye(columns.shape[1]), 1.0, 1000)

    monkeypatch.setattr(stiffness, "solve", answer)
    monkeypatch.setattr(stiffness, "_laws", lambda axis, base: [[]])
    monkeypatch.setattr(stiffness, "crosstalk", lambda axis: [])
    found = stiffness._from(2, [log], Transmission(2))
    assert (found.compliance, found.noise_std) == pytest.approx((1.1, 0.1))
    assert found.law_std == pytest.approx(np.sqrt(np.mean((np.array([1.0, 1.2, 1.1, 1.5, 0.9, 1.0]) - 1.1) ** 2)))
    assert found.delay == pytest.approx((0.004, 0.1))
    assert found.samples == len(log.time) == 2500
    assert 0 < found.share < 1
    assert next(told, None) is None


def test_what_is_left_is_told_by_its_power_in_bands_and_by_its_strongest_line() -> None:
    """Two waves of two and one: four fifths of the power and one; the slow one is no line. Of two records the mean."""
    time = np.arange(2500) / 250
    waves = 2.0 * np.sin(2 * np.pi * 0.5 * time) + np.sin(2 * np.pi * 5.0 * time)
    bands, line = _spectrum([1e-6 * waves], [250.0])
    assert [band[:2] for band in bands] == [(0.0, 1.0), (1.0, 3.0), (3.0, 10.0), (10.0, 20.0), (20.0, 40.0), (40.0, 125.0)]
    assert [band[2] for band in bands] == pytest.approx([0.8, 0, 0.2, 0, 0, 0], abs=1e-3)
    assert line == pytest.approx((5.0, 0.2), abs=1e-3)
    both, _ = _spectrum([waves, np.sin(2 * np.pi * 30.0 * time)], [250.0, 250.0])
    assert [band[2] for band in both] == pytest.approx([0.4, 0, 0.1, 0, 0.5, 0], abs=1e-3)


def test_normal_equations_answer_as_least_squares_do() -> None:
    """Without a prior; with one the coefficients shrink as a further row of each would make them."""
    rng = np.random.default_rng(1)
    columns, y = rng.standard_normal((40, 3)) * [1, 10, 0.1], rng.standard_normal(40)
    scale = np.linalg.norm(columns, axis=0)
    white = columns / scale
    penalty = np.array([0.0, 30.0, 0.0])
    got = answered(white.T @ white, white.T @ y, float(y @ y), 40, penalty, scale, 2)
    more = np.vstack([columns, np.diag(np.sqrt(penalty))])
    whole = np.concatenate([y, np.zeros(3)])
    answer, squares = np.linalg.lstsq(more, whole, rcond=None)[:2]
    assert_allclose(got.coefficients, answer)
    assert got.chi2 == pytest.approx(squares[0])
    normal = np.linalg.inv(more.T @ more)
    free = 3 - penalty @ np.diag(normal)
    assert_allclose(got.covariance, normal * squares[0] / (40 - free - 2))
    assert got.count == 40


def test_a_zero_s_shift_is_told_with_its_interval() -> None:
    zero = ZeroShift(3, "a.csv", "b.csv", 1e-4, 1e-5)
    assert zero.sentence == ("joint 3: the zero between its encoders differs by 100 urad (80 ... 120) from a.csv to b.csv, 0.1 "
                             "mm at 1 m from the axis")
    assert zero.as_dict() == {"reference": "a.csv", "record": "b.csv", "shift_urad": pytest.approx(100.0),
                              "interval_95_urad": pytest.approx([80.4, 119.6]), "moved": True}
    assert "differs by -100 urad (-120 ... -80)" in replace(zero, shift=-1e-4).sentence
    assert "0.1 mm at 1 m" in replace(zero, shift=-1e-4).sentence


def test_a_zero_s_shift_is_the_difference_of_two_offsets() -> None:
    covariance = np.diag([4.0, 9.0, 16.0, 1.0])
    covariance[0, 1] = covariance[1, 0] = 2.0
    shift, std = _shifts(Solved(np.array([1.0, 4.0, 0.5, 7.0]), covariance, 1.0, 10), 3)
    assert_allclose(shift, [3.0, -0.5])
    assert_allclose(std, [np.sqrt(4 + 9 - 4), np.sqrt(4 + 16)])


def gain(before: float, after: float, low: float, high: float) -> Gain:
    made: Any = object.__new__(Gain)
    for name, value in {"before": before, "after": after, "interval": (low, high), "held_out": "other.csv"}.items():
        object.__setattr__(made, name, value)
    found: Gain = made
    return found


def test_the_gain_of_all_joints_is_that_of_all_their_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    """3 and 4 um, 1 and 1 um: their root mean squares; the widest of their intervals."""
    monkeypatch.setattr(Gain, "as_dict", lambda self: {"ratio": self.before / self.after})
    axes: Any = tuple(SimpleNamespace(joint=joint, gain=one) for joint, one in (
        (1, gain(3e-6, 1e-6, 2.0, 4.0)), (2, None), (3, gain(4e-6, 1e-6, 1.5, 5.0))))
    cell: Any = None
    told = JointLogDiagnosis(cell, (), axes, 0.002)._gain()
    assert told == {"rms_before_urad": pytest.approx(12.5**0.5), "rms_after_urad": pytest.approx(1.0),
                    "ratio": pytest.approx(12.5**0.5), "interval": [1.5, 5.0], "held_out": "other.csv",
                    "by_joint": {"1": {"ratio": pytest.approx(3.0)}, "3": {"ratio": pytest.approx(4.0)}}}
    assert JointLogDiagnosis(cell, (), axes[1:2], 0.002)._gain() is None


@pytest.mark.parametrize(("verdicts", "over_all"), [
    (("adequate", "ambiguous", "unknown", "named"), "named"), (("adequate", "ambiguous", "unknown"), "unknown"),
    (("adequate", "ambiguous"), "ambiguous"), (("adequate", "adequate"), "adequate")])
def test_what_is_certain_at_one_joint_is_so_over_all(verdicts: tuple[str, ...], over_all: str) -> None:
    axes: Any = tuple(SimpleNamespace(verdict=verdict) for verdict in verdicts)
    cell: Any = None
    assert JointLogDiagnosis(cell, (), axes, 0.002).verdict == over_all


def test_the_report_shows_deflections_against_torques_as_measured_and_beside_the_spring() -> None:
    """In microradians, all records one after the other; what is left stands on the spring's line."""
    torque, deflection = np.array([10.0, -30.0, 50.0]), np.array([2e-6, -6e-6, 13e-6])
    left = np.column_stack([[9e-6, 9e-6, 9e-6], [1e-6, -2e-6, 3e-6]])
    diagnosis: Any = SimpleNamespace(joint=2, deflection=deflection, residuals=left, stiffness=SimpleNamespace(compliance=2e-7),
                                     axis=SimpleNamespace(logs=[SimpleNamespace(torque=torque[:1]), SimpleNamespace(
                                         torque=torque[1:])]))
    (panel,) = pages._torque(diagnosis).panels
    (measured, beside) = panel.series
    assert (measured.x.tolist(), beside.x.tolist()) == (torque.tolist(), torque.tolist())
    assert measured.y == pytest.approx([-1, -9, 10])
    assert beside.y == pytest.approx([0.2 * (10 - 10) + 1, 0.2 * (-30 - 10) - 2, 0.2 * (50 - 10) + 3])


def shown(joint: int, verdict: str, *causes: Any, others: tuple[Any, ...] = ()) -> Any:
    """A joint of a diagnosis, as the report sees it: 3200 samples in two records."""
    count = 3200
    left = np.column_stack([np.full(count, 1e-6 * joint), np.linspace(0.0, 2e-6, count)])
    logs = [SimpleNamespace(torque=np.arange(part) * 1.0, time=np.arange(part) * 0.01) for part in (1200, 2000)]
    spectrum = ((0.0, 1.0, 0.25), (1.0, 3.0, 0.75))
    return SimpleNamespace(joint=joint, verdict=verdict, causes=causes, alternatives=others, residuals=left,
                           deflection=np.arange(count) * 1e-6, stiffness=replace(FOUND, joint=joint),
                           axis=SimpleNamespace(logs=logs), left=SimpleNamespace(spectrum=spectrum, line=(12.34, 0.256)))


def named(name: str, probability: float) -> Any:
    return SimpleNamespace(shape=SimpleNamespace(name=name), sentence=f"there is {name}", estimates=f"{name} 3 urad",
                           probability=probability)


def page_of(diagnosis: Any, monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.setattr(pages, "render", lambda page: page)
    return pages.diagnosis_report(diagnosis)


def diagnosis_of(verdict: str, *axes: Any, gain: Any = None, logs: tuple[str, ...] = ("runs/a b.csv", "b.csv")) -> Any:
    misfit = {"rms_urad": 86.4, "left_rms_urad": 11.6}
    return SimpleNamespace(verdict=verdict, axes=axes, as_dict=lambda: {"misfit": misfit, "gain": gain}, findings=("found",),
                           logs=tuple(SimpleNamespace(source=name) for name in logs), lines=lambda: ["said"],
                           cell=SimpleNamespace(source="cell.yaml"))


def test_the_report_tells_causes_and_stiffnesses_and_shows_first_where_something_is_wrong(
        monkeypatch: pytest.MonkeyPatch) -> None:
    """Figures of the joint whose cause is named, then of an unknown, an ambiguous and an adequate one: the tables in the
    joints' order, numbers to the right. What is left, in percent of its variance; the commands to copy name all logs."""
    axes = (shown(1, "adequate"), shown(2, "ambiguous", others=(named("soft_zone", 0.4567),)), shown(3, "unknown"),
            shown(4, "named", named("backlash", 0.9991), others=(named("hysteresis", 0.05),)))
    page = page_of(diagnosis_of("named", *axes, gain={"rms_before_urad": 70.6, "rms_after_urad": 9.51,
                                                      "held_out": "record: /far/away/c.csv"}), monkeypatch)
    causes, stiffnesses = page.tables
    assert causes.rows == [["joint 2", "soft_zone", "there is soft_zone", "soft_zone 3 urad", "0.457"],
                           ["joint 4", "backlash", "there is backlash", "backlash 3 urad", "0.999"],
                           ["joint 4", "hysteresis", "there is hysteresis", "hysteresis 3 urad", "0.050"]]
    assert (causes.header[4], causes.numbers) == ("probability", (4,))
    # 1 / 2e-7, and within 1.96 times 5e-9 of that compliance.
    assert stiffnesses.rows[3] == ["k4", "5e+06", "4.77e+06 ... 5.26e+06", "reliable", "well"]
    assert [row[0] for row in stiffnesses.rows] == ["k1", "k2", "k3", "k4"]
    assert (stiffnesses.header[1], stiffnesses.numbers) == ("k [N m/rad]", (1,))
    kinds = ("deflection against torque", "what is left, over time", "spectrum of what is left")
    assert [figure.title for figure in (*page.first, *page.others)] == [
        f"Joint {joint}: {kind}" for joint in (4, 3, 2, 1) for kind in kinds]
    assert len(page.first) == 1
    (time,), (spectrum,) = page.others[0].panels, page.others[1].panels
    assert [series.name for series in time.series] == ["plain spring", "extended model"]
    # Every second of 3200 samples, in microradians.
    assert time.series[0].y == pytest.approx(np.full(1600, 4.0))
    assert time.series[1].y == pytest.approx(np.linspace(0.0, 2.0, 3200)[::2])
    assert time.series[0].x[599:601] == pytest.approx([11.98, 0.0])
    assert (list(spectrum.x.categories), spectrum.series[0].values) == (["0-1 Hz", "1-3 Hz"], pytest.approx([25.0, 75.0]))
    assert page.others[1].caption == "Strongest narrow line: 12.3 Hz with 26 % of the variance."
    assert page.title == "Diagnosis: a b.csv"
    assert [step.command for step in page.steps] == [
        "compstiff identify cell.yaml 'runs/a b.csv' --also b.csv -o stiffness.json"]
    assert [(key.label, key.value, key.unit, key.note) for key in page.keys] == [
        ("left by plain springs", "86 → 12", "µrad", "RMS; with the named causes"),
        ("on rows not fitted", "71 → 10", "µrad", "RMS, record: c.csv"), ("joint 1", "adequate", "", ""),
        ("joint 2", "ambiguous", "", ""), ("joint 3", "unknown", "", "")]
    assert (page.words, page.findings) == (["said"], ("found",))


@pytest.mark.parametrize(("verdict", "level", "word", "sentence"), [
    ("adequate", "good", "ADEQUATE", "Plain springs explain the logs to their noise."),
    ("named", "caution", "CAUSE NAMED", "The logs show more than springs, and its cause has a name: there is a; there is b; "
     "there is c."),
    ("ambiguous", "caution", "AMBIGUOUS", "The logs show more than springs; several causes would explain it."),
    ("unknown", "bad", "UNKNOWN", "The logs show more than springs, and no cause in the dictionary explains it.")])
def test_the_report_s_headline_is_the_verdict_with_at_most_three_names(
        monkeypatch: pytest.MonkeyPatch, verdict: str, level: str, word: str, sentence: str) -> None:
    """A cause of two joints is told once."""
    causes = [named(name, 0.99) for name in "aabcd"] if verdict == "named" else []
    page = page_of(diagnosis_of(verdict, shown(1, verdict, *causes), logs=("a.csv",)), monkeypatch)
    assert (page.verdict.level, page.verdict.word, page.verdict.sentence) == (level, word, sentence)
    assert [key.label for key in page.keys] == ["left by plain springs", "joint 1"]
    assert page.steps[0].command == "compstiff identify cell.yaml a.csv -o stiffness.json"


@pytest.mark.parametrize(("refused", "level", "word", "sentence"), [
    ((2, 3), "bad", "NOT ALL STIFFNESSES CAN BE STATED", "k2, k3 refused: these logs do not tell the stiffness from what else "
     "moves with the load; stated: none."),
    ((3,), "caution", "NOT ALL STIFFNESSES CAN BE STATED", "k3 refused: these logs do not tell the stiffness from what else "
     "moves with the load; stated: k2."),
    ((), "caution", "2 OF 6 STIFFNESSES IDENTIFIED", "k2, k3 come from these logs; the other joints stay at what was known "
     "before.")])
def test_the_report_of_stiffnesses_says_which_of_them_these_logs_state(
        monkeypatch: pytest.MonkeyPatch, refused: tuple[int, ...], level: str, word: str, sentence: str) -> None:
    """The keys have the file's own values, of joints 2 and 3, and the table all six."""
    monkeypatch.setattr(pages, "render", lambda page: page)
    joints = tuple(replace(FOUND, joint=joint, grade="not identifiable" if joint in refused else "reliable")
                   for joint in (2, 3))
    page = stiffnesses_of(joints, ("a.csv", "b.csv"))
    assert (page.verdict.level, page.verdict.word, page.verdict.sentence) == (level, word, sentence)
    assert [(key.label, key.value, key.unit, key.note) for key in page.keys] == [
        (f"k{joint}", "refused", "", "not identifiable") if joint in refused else
        (f"k{joint}", f"{joint}e+06", "N m/rad", "reliable") for joint in (2, 3)]
    (table,) = page.tables
    assert table.rows == [[f"k{k}", f"{k}e+06", f"{k}e+05 ... {k}e+07", f"grade {k}"] for k in range(1, 7)]
    assert table.numbers == (1,)
    assert page.steps[0].command == "compstiff diagnose cell.yaml a.csv --also b.csv -o diagnosis.json"
    assert page.words == [line for joint in joints for line in joint.lines()]


@pytest.mark.parametrize(("count", "level", "sentence"), [
    (6, "good", "k1, k2, k3, k4, k5, k6 come from these logs."),
    (1, "caution", "k1 comes from these logs; the other joints stay at what was known before.")])
def test_the_report_of_all_six_stiffnesses_has_no_others(
        monkeypatch: pytest.MonkeyPatch, count: int, level: str, sentence: str) -> None:
    monkeypatch.setattr(pages, "render", lambda page: page)
    page = stiffnesses_of(tuple(replace(FOUND, joint=joint) for joint in range(1, count + 1)), ("a.csv",))
    assert (page.verdict.level, page.verdict.word) == (level, f"{count} OF 6 STIFFNESSES IDENTIFIED")
    assert page.verdict.sentence == sentence
    assert page.steps[0].command == "compstiff diagnose cell.yaml a.csv -o diagnosis.json"


def stiffnesses_of(joints: tuple[AxisStiffness, ...], logs: tuple[str, ...]) -> Any:
    k = np.arange(1.0, 7.0)
    model = SimpleNamespace(stiffness=1e6 * k, interval_95=np.column_stack([1e5 * k, 1e7 * k]),
                            grades=tuple(f"grade {joint}" for joint in range(1, 7)))
    fit: Any = SimpleNamespace(joints=joints, model=model, cell=SimpleNamespace(source="cell.yaml"), findings=(),
                               logs=tuple(SimpleNamespace(source=name) for name in logs), as_dict=dict)
    return pages.stiffness_report(fit)

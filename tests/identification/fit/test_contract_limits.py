"""From where on `identify` says what, just beyond and just within: rows of springs to first order by the independent arm, under
small loads, with errors beside them of exactly that size."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import chi2, norm

from identification.common.findings import CompstiffError, Finding
from identification.fit.fit import Fit, _light_rows, fit_stiffness
from identification.fit.identifiability import told_by_one_visit
from identification.fit.load_test import LoadTest
from identification.fit.mistakes.judge import Mistakes
from identification.fit.posterior import Posterior, posterior
from identification.measurements import Measurements
from identification.model.cell import Cell
from tests.identification.fit.exact_rows import beside, by_compliance
from tests.identification.fit.test_laws_posterior import NOISY, TRUE, simulate

Array = NDArray[np.float64]
SIGMA = 2e-8
ALONE = NOISY.replace("0.01,", "0,").replace("[1, 1, 1]", "[0, 0, 0]").replace("[4, 4, 4]", "[0, 0, 0]").replace(
    "[2, 2, 2]", "[0.02, 0.02, 0.02]")


@pytest.fixture(scope="module")
def exact(tmp_path_factory: pytest.TempPathFactory) -> tuple[Cell, Measurements, Array]:
    """Twelve poses with three loads of some newtons each, whose only noise is the sensor's; and what each spring does [m]."""
    cell, rows = simulate(tmp_path_factory.mktemp("limits"), np.random.default_rng(5), text=ALONE, quiet=True)
    wrench = 0.02 * rows.wrench
    each = by_compliance(rows.theta, cell.flange_from_tcp.position, wrench[:, :3]) / TRUE
    return cell, replace(rows, wrench=wrench, deflection=each.sum(axis=2)), each


def told(fit: Fit, code: str) -> list[Finding]:
    return [one for one in fit.findings if one.code == code]


def off_by(rows: Measurements, each: Array, times: float) -> Measurements:
    """Readings off by so many times what the stated noise allows: the root of their squared errors over sigma, of as many as
    are left once six springs are fitted."""
    left = rows.deflection.size - 6
    return replace(rows, deflection=rows.deflection + times * SIGMA * np.sqrt(left / rows.deflection.size) * beside(each))


@pytest.mark.parametrize("times", [0.22, 0.28, 1.8, 2.2])
def test_noise_twice_as_large_or_four_times_smaller_than_stated_is_said(
        exact: tuple[Cell, Measurements, Array], times: float) -> None:
    cell, rows, each = exact
    fit = fit_stiffness(cell, off_by(rows, each, times))
    said = [one.message.partition(" times")[0] for one in (*told(fit, "CS1013"), *told(fit, "CS1042"))]
    assert said == ([f"the residual is {times:.2g}"] if not 0.25 < times < 2 else [])


@pytest.mark.parametrize("readings", [29, 30])
def test_small_noise_is_said_of_thirty_readings(exact: tuple[Cell, Measurements, Array], readings: int) -> None:
    cell, rows, each = exact
    few = np.arange(len(rows)) % 3 == 0
    few[np.flatnonzero(few)[10:]] = False
    deflection = rows.deflection + 0.05 * SIGMA * beside(each)
    deflection[0, 2] = deflection[0, 2] if readings == 30 else np.nan
    fit = fit_stiffness(cell, replace(rows, deflection=deflection).select(few))
    assert fit.posterior.readings == readings
    assert bool(told(fit, "CS1042")) is (readings == 30)


def with_prior(cell: Cell, factor: Array, log_std: float) -> Cell:
    """The prior's medians so many times smaller than what the rows tell."""
    wide = np.full(6, np.sqrt(np.expm1(log_std**2)))
    return replace(cell, prior=replace(cell.prior, stiffness=TRUE / factor, relative_std=wide))


@pytest.mark.parametrize("chance", [1.25e-3, 0.8e-3])
def test_stiffnesses_that_the_prior_gives_a_thousandth_are_said(
        exact: tuple[Cell, Measurements, Array], chance: float) -> None:
    """By the chi-squared of six joints, three stiffer and three softer than the prior's medians."""
    cell, rows, each = exact
    off = np.sqrt(chi2.isf(chance, 6) / 6) * 0.5
    factor = np.exp(off * np.array([1, -1, 1, -1, 1, -1]))
    fit = fit_stiffness(with_prior(cell, factor, 0.5), off_by(rows, each, 0.5))
    assert {"not identifiable", "tentative"}.isdisjoint(fit.model.grades)
    assert [one.message for one in told(fit, "CS1017")] == [
        f"the stiffnesses lie a factor {factor.min():.3g} to {factor.max():.3g} off the prior's medians, which it gives a "
        "probability of 0.0008"] * (chance < 1e-3)


@pytest.mark.parametrize(("factor", "refused"), [(90.0, False), (110.0, True), (1 / 90.0, False), (1 / 110.0, True)])
def test_a_hundred_times_off_in_all_joints_is_a_unit(
        exact: tuple[Cell, Measurements, Array], factor: float, refused: bool) -> None:
    """A factor that no known unit is near."""
    cell, rows, each = exact
    other = with_prior(cell, np.full(6, factor), 1.3)
    if refused:
        with pytest.raises(CompstiffError, match="CS1018") as caught:
            fit_stiffness(other, off_by(rows, each, 0.5))
        (finding,) = caught.value.findings
    else:
        (finding,) = told(fit_stiffness(other, off_by(rows, each, 0.5)), "CS1017")
    said = re.match(r"the stiffnesses lie a factor (\S+) to (\S+) off the prior's medians", finding.message)
    assert said
    assert [float(word) for word in said.groups()] == pytest.approx([factor, factor], rel=2e-3)


@pytest.mark.parametrize("ratio", [0.95, 1.05, 1.4, 1.6])
def test_validation_rows_that_reject_the_springs_are_half_further_off_than_with_the_prior_s(
        exact: tuple[Cell, Measurements, Array], ratio: float) -> None:
    """The last three poses, kept back, read as no springs would: so many times as far from what the others' tell as from what
    the prior's do, whose springs are a quarter stiffer."""
    cell, rows, each = exact
    validate = rows.visit >= 9
    by_fit, by_prior = each.sum(axis=2), 0.8 * each.sum(axis=2)
    # In line with both, on the prior's side; between the two where the fit is nearer.
    further = by_prior + (by_prior - by_fit) / (ratio - 1) if ratio > 1 else by_prior + (by_fit - by_prior) / (1 + ratio)
    deflection = np.where(validate[:, None], further, off_by(rows, each, 0.9).deflection)
    fit = fit_stiffness(with_prior(cell, np.full(6, 0.8), 0.4), replace(rows, deflection=deflection, validate=validate))
    assert fit.held_out is not None
    assert fit.held_out[1] / fit.held_out[0] == pytest.approx(ratio, rel=0.02)
    assert bool(told(fit, "CS1019")) is (ratio > 1)
    assert bool(told(fit, "CS1021")) is bool(fit.model.rejected) is (ratio > 1.5)




@pytest.mark.parametrize(("count", "part", "share", "alone"), [
    (3, 1.0, 0.965, False), (3, 1.0, 0.975, True), (2, 1.0, 0.975, False), (3, 0.9e-3, 0.975, False), (3, 1.1e-3, 0.975, True)])
def test_a_joint_is_told_by_one_visit_alone_that_has_more_than_97_percent_of_its_motion(
        exact: tuple[Cell, Measurements, Array], count: int, part: float, share: float, alone: bool) -> None:
    """Three poses with three loads each, or two of them: the first has this share of the squares that a joint moves, and of the
    others no more; the last is loaded at all where it moves a thousandth of the squares that the first does."""
    cell, rows, each = exact
    visits = each[:9].reshape(3, 9, 6)
    squares = np.sum(visits**2, axis=1)[:count]
    scale = np.ones(count)
    if part < 1:
        scale[2] = part * squares[0].sum() / squares[2].sum()
    # As large as makes the joint of the largest share just so.
    low, high = 1e-3, 1e6
    for _ in range(80):
        scale[0] = np.sqrt(low * high)
        if part < 1:
            scale[2] = part * scale[0] * squares[0].sum() / squares[2].sum()
        of_joints = scale[0] * squares[0] / (scale @ squares)
        low, high = (scale[0], high) if of_joints.max() < share else (low, scale[0])
    times = np.repeat(np.sqrt(np.append(scale, 0.0)[:3]), 3)[:3 * count]
    few = rows.select(np.arange(len(rows)) < 3 * count)
    few = replace(few, wrench=times[:, None] * few.wrench, deflection=times[:, None] * few.deflection)
    told_by = told_by_one_visit(posterior(LoadTest.of(cell, few)))
    assert told_by == ({int(np.argmax(of_joints)) + 1: 0} if alone else {})


@pytest.mark.parametrize("times", [4.3, 4.85])
def test_a_sensor_four_times_as_noisy_as_stated_rejects_the_springs(
        exact: tuple[Cell, Measurements, Array], times: float) -> None:
    """With 95 % confidence, by the normal distribution of the logarithm of what is estimated of it."""
    cell, rows, each = exact
    fit = fit_stiffness(cell, off_by(rows, each, times))
    noise = fit.model.fit["noise"]
    needed = float(noise["sensor_scale"] / (4.0 * np.exp(norm.isf(0.05) * noise["sensor_log_std"])))
    assert needed == pytest.approx(1.0, abs=0.12)
    assert bool(fit.model.rejected) is (needed > 1) is (times > 4.5)
    assert [one.message.split(": ")[1].split(";")[0] for one in told(fit, "CS1021")] == [
        f"the sensor noise would have to be {noise['sensor_scale']:.1f} times the stated"] * (needed > 1)


@pytest.mark.parametrize("squares", [1.93, 2.07])
def test_mistakes_are_looked_for_from_twice_the_squares_that_the_stated_noise_has(
        monkeypatch: pytest.MonkeyPatch, exact: tuple[Cell, Measurements, Array], squares: float) -> None:
    """A reading, on average."""
    cell, rows, each = exact
    asked: list[float] = []

    def mistakes_in(fitted: Posterior) -> Mistakes:
        asked.append(fitted.chi2 / fitted.readings)
        return Mistakes()

    monkeypatch.setattr("identification.fit.fit.mistakes_in", mistakes_in)
    count = rows.deflection.size
    fit_stiffness(cell, off_by(rows, each, np.sqrt(squares * count / (count - 6))))
    assert asked == pytest.approx([squares] * (squares > 2), rel=0.01)


@pytest.mark.parametrize("count", [20, 21])
def test_rows_that_count_less_than_thirty_per_cent_are_told_one_by_one_up_to_twenty(count: int) -> None:
    weight = np.append(np.full(count, 0.29), np.full(9, 0.31))
    rows = type("Rows", (SimpleNamespace,), {"__len__": lambda self: len(weight)})(
        line=np.arange(2, 2 + len(weight)), source="m.csv")
    fitted: Any = SimpleNamespace(data=SimpleNamespace(rows=rows), row_weight=weight)
    messages = [one.message for one in _light_rows(fitted)]
    if count == 20:
        assert messages == ["this row does not fit the others and counts 29 % of an ordinary one"] * 20
    else:
        (message,) = messages
        assert message.startswith("21 of 30 rows do not fit the others and count less than 30 % of an ordinary one each")

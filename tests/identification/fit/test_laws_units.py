"""From where on a factor common to all joints is told, which unit it is, and times that no load test takes: just beyond each
limit and just within, worked out by hand."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from identification.fit.load_test import LoadTest
from identification.fit.mistakes.axes import axes_mistakes
from identification.fit.mistakes.units import common_factor, time_mistake, unit_mistake, unit_of
from tests.identification.fit.test_laws_posterior import simulate

MEDIAN = np.array([1e6, 2e6, 1e6, 5e5, 4e5, 1e5])


def fitted(times: float, *, told: int = 6, log_std: float = 0.1, prior_log_std: float = 1.0, joint_1: float = 1.0) -> Any:
    """A fit with stiffnesses so many times the prior's medians, of which the first `told` are known to this (ln k)."""
    std = np.where(np.arange(6) < told, log_std, 0.9)
    prior = SimpleNamespace(stiffness=MEDIAN, log_std=np.full(6, prior_log_std))
    return SimpleNamespace(mean=-np.log(MEDIAN * times * np.append(joint_1, np.ones(5))), covariance=np.diag(std**2),
                           prior=SimpleNamespace(prior=prior))


@pytest.mark.parametrize(("times", "options", "told"), [
    # A factor three, of six joints or three, which scatter by a factor e^0.5 each.
    (2.8, {}, False), (3.2, {}, True), (1 / 2.8, {}, False), (1 / 3.2, {}, True), (2.8, {"told": 3}, False),
    (3.2, {"told": 3}, True),
    # 3.5 standard deviations of that, ln: 1.24 of two joints (3.45 times), 1.75 of one (5.75 times).
    (3.2, {"told": 2}, False), (3.6, {"told": 2}, True), (5.2, {"told": 1}, False), (6.3, {"told": 1}, True),
    # Joints known to ln 0.3.
    (6.3, {"log_std": 0.33}, False), (6.3, {"log_std": 0.27}, True),
    # One joint on the other side is no common factor.
    (6.3, {"joint_1": 1 / 6.0}, True), (6.3, {"joint_1": 1 / 6.6}, False)])
def test_a_factor_common_to_all_joints_is_told_from_three_and_what_joints_scatter(
        times: float, options: dict[str, Any], told: bool) -> None:
    found = common_factor(fitted(times, **options))
    assert (found is not None) is told
    if found is not None and "joint_1" not in options:
        assert found.times == pytest.approx(times)
        # Of the prior's own spread half is common to all.
        count = 6 if options.get("told") is None else options["told"]
        assert found.log_std == pytest.approx(np.hypot(0.5 / np.sqrt(count), 0.5 * 1.0))


UNITS = [("force", 4.44822, "in lbf, not in N", 0.02), ("force", 9.80665, "in kgf, not in N (or deflections in 0.1 um)", 0.05),
         ("force", 1000.0, "in kN, not in N (or deflections in nm)", 0.02), ("deflection", 10.0, "in 0.01 mm, not in um", 0.05),
         ("deflection", 25.4, "in mil, not in um", 0.02), ("deflection", 1000.0, "in mm, not in um", 0.05),
         ("deflection", 25400.0, "in inches, not in um", 0.01)]


@pytest.mark.parametrize("likelier", [0.9, 1.1])
@pytest.mark.parametrize(("quantity", "by", "words", "share"), UNITS)
def test_a_unit_is_the_mistake_from_as_likely_as_not(
        quantity: str, by: float, words: str, share: float, likelier: float) -> None:
    """This share of load tests is written so; a robot that is off by the unit's very factor is exp(-ln^2 / 2 s^2) as likely as
    one that is as its prior says, s of half the prior's spread and of what six joints scatter by."""
    variance = np.log(by) ** 2 / 2 / np.log(likelier / share)
    times = 1 / by if quantity == "force" else by
    one = fitted(times, prior_log_std=2 * np.sqrt(variance - 0.25 / 6))
    factor = common_factor(one)
    unit = factor and unit_of(factor)
    assert unit
    assert (unit.quantity, unit.by, unit.words) == (quantity, by, words)
    assert unit.probability == pytest.approx(likelier / (1 + likelier))
    found = unit_mistake(one)
    assert (found is not None) is (likelier > 1)
    if found is not None:
        assert found[0].sentence.startswith(f"{quantity}s seem to be {words}, in {{rows}}: all joints come out {by:.3g} times ")


@pytest.mark.parametrize(("off", "near"), [(-0.55, False), (-0.45, True), (0.45, True), (0.55, False)])
def test_a_unit_is_named_within_a_factor_of_one_and_a_half(off: float, near: bool) -> None:
    """Half a ln about mm, where no other unit is near."""
    factor = common_factor(fitted(1000.0 * np.exp(off)))
    assert factor
    assert (unit_of(factor) is not None) is near


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> LoadTest:
    cell, rows = simulate(tmp_path_factory.mktemp("units"), np.random.default_rng(4), poses=3, loads=4, quiet=True)
    return LoadTest.of(cell, rows)


@pytest.mark.parametrize(("step", "dwell", "said"), [
    (3400.0, np.nan, ""),
    (3800.0, np.nan, "time_s seems to be in ms in {rows}: rows of one visit follow each other after 1.1 hours"),
    (3800.0, 330.0, "time_s seems to be in ms in {rows}"), (3800.0, 390.0, "time_s and dwell_s seem to be in ms in {rows}"),
    (100.0, 280.0, ""), (1.0, 3.2, "time_s seems to be in minutes in {rows}: loads were on 3 times as long"),
    (1.0, 93.0, "time_s seems to be in minutes in {rows}: loads were on 93 times as long"),
    (1.0, 107.0, "dwell_s seems to be in ms in {rows}: loads were on 107 times as long")])
def test_times_are_of_another_unit_where_rows_lie_an_hour_apart_or_loads_last_three_times_as_long(
        data: LoadTest, step: float, dwell: float, said: str) -> None:
    count = len(data.rows)
    rows = replace(data.rows, time=np.linspace(0.0, step * (count - 1), count), dwell=np.full(count, dwell))
    mistake = time_mistake(data.with_rows(rows))
    assert (mistake.sentence if mistake else "").startswith(said)
    assert (mistake is not None) is bool(said)
    if mistake is not None:
        mended = mistake.mended(data.with_rows(rows)).rows
        time, lasts = (60.0, 1.0) if "minutes" in said else (1.0, 1e-3) if said.startswith("dwell") else (
            1e-3, 1e-3 if "and" in said else 1.0)
        np.testing.assert_allclose(mended.time, time * rows.time)
        np.testing.assert_allclose(mended.dwell, lasts * rows.dwell)


@pytest.mark.parametrize("steps", [2, 3])
def test_times_of_fewer_than_three_steps_tell_no_unit(data: LoadTest, steps: int) -> None:
    few = replace(data.rows.select(np.arange(len(data.rows)) <= steps), time=np.linspace(0.0, 7200.0 * steps, steps + 1))
    assert (time_mistake(data.with_rows(few)) is not None) is (steps == 3)


def test_a_column_in_another_unit_is_mended_by_what_the_unit_is(data: LoadTest) -> None:
    """In newtons and in micrometres, by the definitions of the units."""
    newtons = {"in kN, not in N": 1e3, "ten times too small": 10.0, "ten times too large": 0.1, "in kgf, not in N": 9.80665,
               "in lbf, not in N": 0.45359237 * 9.80665, "in mN, not in N": 1e-3}
    microns = {"in mm, not in um": 1e3, "ten times too small": 10.0, "ten times too large": 0.1, "in mil, not in um": 25.4,
               "in nm, not in um": 1e-3}
    moments = np.random.default_rng(1).normal(0, 50, (len(data.rows), 3))
    data = data.with_rows(replace(data.rows, wrench=np.column_stack([data.rows.wrench[:, :3], moments])))
    mistakes = {each.sentence: each for each in axes_mistakes(data) if "_unit" in each.key}
    for quantity, column, names, units in (("wrench", "forces", ("fx", "fy", "fz"), newtons),
                                           ("deflection", "deflections", ("dx", "dy", "dz"), microns)):
        before = getattr(data.rows, quantity)
        for words, factor in units.items():
            every = mistakes.pop(f"{column} seem to be {words}, in {{rows}}")
            np.testing.assert_allclose(getattr(every.mended(data).rows, quantity), factor * before, rtol=1e-5)
            for axis, name in enumerate(names):
                mended = getattr(mistakes.pop(f"{name} seems to be {words}, in {{rows}}").mended(data).rows, quantity)
                scale = np.ones(before.shape[1])
                scale[axis] = factor
                np.testing.assert_allclose(mended, scale * before, rtol=1e-5)
    assert not mistakes

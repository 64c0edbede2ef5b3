"""A log beside what its stock and known coefficients let expect: the cause that was put into it is named, with its size."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from compensator.cutting.disagreement import Disagreement, _fits, _solved, disagreement
from compensator.cutting.posterior import ForceRows
from tests.compensator.cutting.test_laws_misread import MEAN, coefficients, cuts, rows_of

STEP = 1e-4
EDGE, CHIP = np.repeat([0.0, 1.0], 3), np.repeat([1.0, 0.0], 3)


def log(share: np.ndarray, alike: bool = False) -> ForceRows:
    """Forces of some hundred newtons, of coefficients that are so many shares larger, with the noise that is stated; alike: of
    chips alone."""
    weight = 20 * cuts()[0] * (CHIP if alike else 1.0)
    force = weight @ (MEAN * (1 + share))
    return rows_of(weight, force + np.random.default_rng(7).normal(0, 0.4, force.shape))


def told(rows: ForceRows) -> Disagreement:
    return disagreement(rows, coefficients(0.03), STEP, STEP)


@pytest.mark.parametrize(("share", "causes", "words"), [
    (0.8 * EDGE, ("wear",), "worn edges"), (-0.5 * EDGE, ("wear",), "sharper edges"),
    (0.5 * CHIP, ("chip",), r"the chips are \+50 % thick, as with a spindle at 67 % of its speed, or a feed of 150 %"),
    (-0.4 * CHIP, ("chip", "strength"), "chips are -40 % thick, as with a spindle at 167 % of its speed, or a feed of 60 %"),
    (0.3 * (EDGE + CHIP), ("strength", "chip"), r"all forces are \+30 %"),
    (-0.3 * (EDGE + CHIP), ("strength", "chip"), "all forces are -30 %")])
def test_a_cause_that_is_there_is_told_first_with_its_size(share: np.ndarray, causes: tuple[str, ...], words: str) -> None:
    """Where the edges have little of the force, all of it and the chip's are told apart by little."""
    found = told(log(share))
    assert (found.verdict, found.causes) == ("named" if len(causes) == 1 else "ambiguous", causes)
    assert found.size == pytest.approx([share[np.argmax(np.abs(share))]], abs=0.02)
    assert found.left < 1.0 < 10 < found.expected < found.force
    assert re.search(words, found.words())
    assert ("this log does not tell which" in found.words()) == (len(causes) == 2)


def test_a_stock_that_stands_aside_is_named_by_where_it_stands() -> None:
    """By 0.8 mm in x and -0.5 in y of a file that says a tenth: the tool went to the other side."""
    rows = log(np.zeros(6))
    stands = np.array([8e-4, -5e-4, 0.0])
    found = told(replace(rows, force=rows.force - rows.aside @ stands / STEP))
    assert (found.verdict, found.causes) == ("named", ("stock",))
    assert found.size == pytest.approx(stands, abs=2e-5)
    assert re.search(r"by \+0\.[78]\d mm in x, -0\.[45]\d mm in y, [+-]0\.0\d mm in z", found.words())


def test_where_all_is_as_expected_they_agree_and_what_no_cause_explains_is_unknown() -> None:
    assert (told(log(np.zeros(6))).verdict, told(log(np.zeros(6))).causes) == ("adequate", ())
    rows = log(np.zeros(6))
    turned = replace(rows, force=rows.force @ np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]).T)
    found = told(turned)
    assert found.verdict == "unknown"
    assert "no cause that is known" in found.words()


def test_of_coefficients_that_are_known_badly_a_log_far_off_is_not_said_to_agree() -> None:
    """Known to a factor of two, and half as large again: nothing is contradicted, and nothing is told. How wide it is comes
    from drawing coefficients."""
    rows, known = log(0.5 * (EDGE + CHIP)), coefficients(0.03)
    wide = replace(known, covariance=np.diag((0.7 * MEAN) ** 2))
    found = disagreement(rows, wide, STEP, STEP)
    assert (found.verdict, found.causes) == ("adequate", ())
    assert "they agree" not in found.words()
    drawn = np.random.default_rng(5).normal(0, 0.7 * np.abs(MEAN), (2000, 6))
    spread = np.sqrt(np.mean(np.sum(np.einsum("nij,dj->dni", rows.weight[::7], drawn) ** 2, axis=2)))
    (told_to,) = map(float, re.findall(r"known to (\d+) N \(1 sigma\)", found.words()))
    assert told_to == pytest.approx(spread, rel=0.06)


@pytest.mark.parametrize(("share", "agrees"), [(0.32, True), (0.35, False)])
def test_a_log_agrees_that_is_off_by_a_quarter_of_its_force(share: float, agrees: bool) -> None:
    """Forces that are larger by a third: a quarter of those of the log."""
    known = coefficients(0.03)
    found = disagreement(log(share * (EDGE + CHIP)), replace(known, covariance=np.diag((0.7 * MEAN) ** 2)), STEP, STEP)
    assert found.verdict == "adequate"
    assert ("they agree" in found.words()) == agrees


def test_causes_that_do_the_same_are_all_told() -> None:
    """Where chips alone have force, all forces and the chip's are the same."""
    found = told(log(0.4 * CHIP, alike=True))
    assert found.verdict == "ambiguous"
    assert set(found.causes[:2]) == {"chip", "strength"}
    assert "this log does not tell which" in found.words()


@pytest.mark.parametrize("memory", [1.0, 3.0])
def test_a_cause_is_as_likely_as_the_normal_density_says(memory: float) -> None:
    """Of numbers that columns times standard normal ones and scatter make: differences of the densities' logarithms, and the
    mean of the columns' numbers given them."""
    rng = np.random.default_rng(41)
    off, scale = rng.normal(0, 3, (7, 3)), rng.uniform(0.5, 2, (7, 3))
    some, more = rng.normal(0, 2, (7, 3, 2)), rng.normal(0, 2, (7, 3, 3))
    density, solved = [], []
    for columns in ([some], [some, more]):
        design = np.concatenate(columns, axis=2).reshape(21, -1)
        covariance = design @ design.T + memory * np.diag(scale.ravel() ** 2)
        density.append(stats.multivariate_normal(np.zeros(21), covariance).logpdf(off.ravel()))
        likelihood, x, left = _solved(off, scale, columns, memory)
        solved.append(likelihood)
        np.testing.assert_allclose(x, design.T @ np.linalg.solve(covariance, off.ravel()), rtol=1e-9)
        np.testing.assert_allclose(left.ravel(), off.ravel() - design @ x, rtol=1e-9, atol=1e-12)
    assert solved[1] - solved[0] == pytest.approx(density[1] - density[0], rel=1e-9)


@pytest.mark.parametrize(("left", "force", "fits"), [
    (2.98, 1.0, True), (3.02, 1.0, False), (6.0, 100.5, True), (6.0, 99.5, False), (2.98, 1e4, True)])
def test_what_is_left_is_half_as_much_again_as_is_stated_or_six_hundredths_of_the_force(
        left: float, force: float, fits: bool) -> None:
    """Where 2 N are stated; by the middle of what is left, [N] 1 sigma, a third of it gross and a third next to nothing."""
    rows = 0.6745 * left * np.tile([1.0, -0.1, 50.0], (30, 1))
    assert _fits(rows, np.full((30, 3), 2.0), force) == fits


@pytest.mark.parametrize(("position_std", "verdict"), [(8e-4, "adequate"), (1e-4, "named")])
def test_a_stock_within_what_its_file_says_is_no_cause(position_std: float, verdict: str) -> None:
    rows = log(np.zeros(6))
    aside = replace(rows, force=rows.force - rows.aside @ np.array([8e-4, -5e-4, 0.0]) / STEP)
    found = disagreement(aside, coefficients(0.03), position_std, STEP)
    assert found.verdict == verdict
    assert (found.odds > np.log(20)) == (verdict == "named")


def test_no_cause_has_a_size_that_is_none() -> None:
    """Chips of a tenth of their thickness are no other speed."""
    assert told(log(-0.9 * CHIP - 0.9 * EDGE)).verdict == "unknown"
    assert told(log(3.5 * CHIP)).verdict == "unknown"

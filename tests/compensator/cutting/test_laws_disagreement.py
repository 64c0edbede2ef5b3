"""A log beside what its stock and known coefficients let expect: the cause that was put into it is named, with its size."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from compensator.cutting.disagreement import Disagreement, disagreement
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


def test_causes_that_do_the_same_are_all_told() -> None:
    """Where chips alone have force, all forces and the chip's are the same."""
    found = told(log(0.4 * CHIP, alike=True))
    assert found.verdict == "ambiguous"
    assert set(found.causes[:2]) == {"chip", "strength"}
    assert "this log does not tell which" in found.words()

"""What is said of visits and validation rows that do not fit: the words and numbers, each side of where they are said."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from identification.fit.mending import BadVisit, Mend
from identification.fit.noise_parts import SetUp, VarianceComponents
from identification.fit.validation import OutlyingRow, Validation
from identification.fit.visit_findings import (
    evidence,
    kinds_apart,
    mending,
    not_independent,
    sentence,
    validation_findings,
    visit_findings,
)
from identification.fit.visits import VisitScore, VisitTest, WrongAngle
from identification.model.rotations import Frame

WRONG = WrongAngle(4, 5, np.radians(-3.217), np.radians(0.0614), 12.4)
NEITHER = ("is its pose written rightly? No single slip in its angles or loads is likely; does something drag or stick there, "
           "was the tool or a sensor touched?")


def bad(rows: Sequence[int], wrong: WrongAngle | None = None, mends: tuple[Mend, ...] = (), copied: str = "", line: int = 44,
        ) -> BadVisit:
    return BadVisit(VisitScore("P7", np.array(rows), line, 0, 5.0, 0.00234, 0.5, np.zeros(3), np.ones(3), wrong), mends, copied)


@pytest.mark.parametrize(("count", "words"), [
    (1, "the reading of P7 does not fit"), (2, "the two readings of P7 do not fit"),
    (12, "the twelve readings of P7 do not fit"),
    (13, "the 13 readings of P7 do not fit")])
def test_a_visit_that_does_not_fit_is_told_with_its_evidence(count: int, words: str) -> None:
    beyond = "any stiffness that fits the other poses"
    assert sentence(bad(range(count))) == f"{words} {beyond} (p = 0.0023)"
    angle = "odds of e^12 that axis 5 stood -3.22 +- 0.12 degrees from where the table has it"
    assert sentence(bad(range(count), WRONG)) == f"{words} {beyond} ({angle})"
    assert evidence(bad(range(count), WRONG).score) == angle


@pytest.mark.parametrize(("one", "told"), [
    (bad([1]), NEITHER),
    (bad([1], WRONG), "drive there again and read axis 5: no slip of the pen is likelier than others"),
    (bad([1], WRONG, (Mend("a", "axis 2 is 10", 0.24),)),
     "drive there again and read axis 5: no slip of the pen is likelier than others"),
    (bad([1], WRONG, (Mend("a", "axis 2 is 10", 0.25),)), "axis 2 is 10 (25 % of what was tried)"),
    (bad([1], None, (Mend("a", "one", 0.6), Mend("b", "another", 0.3), Mend("c", "no", 0.1))),
     "one (60 % of what was tried); or another (30 % of what was tried)"),
    (bad([1], None, (), "P3"), f"its angles are those of P3: were they copied? {NEITHER}"),
    (bad([1], None, (Mend("a", "one", 0.6),), "P3"),
     "its angles are those of P3: were they copied? one (60 % of what was tried)")])
def test_what_would_mend_a_visit_is_told_or_what_to_look_for(one: BadVisit, told: str) -> None:
    assert mending(one) == told


def test_bad_visits_are_a_finding_each_and_too_many_one() -> None:
    test = VisitTest((), 0.001, 0.001)
    found = visit_findings(test, (bad([1, 2], line=9), bad([5], WRONG, line=12)), "m.csv", "they were left out")
    assert [(one.code, one.level, one.file, one.line, one.hint) for one in found] == [
        ("CS1730", "warning", "m.csv", 9, NEITHER),
        ("CS1730", "warning", "m.csv", 12, "drive there again and read axis 5: no slip of the pen is likelier than others")]
    assert [one.message for one in found] == [
        f"{sentence(each)}; they were left out" for each in (bad([1, 2]), bad([5], WRONG))]
    assert visit_findings(test, (), "m.csv", "") == []
    (many,) = visit_findings(VisitTest((), 0.001, 0.001, too_many=True), (bad([1]),), "m.csv", "they were left out")
    assert (many.code, many.level, many.file) == ("CS1731", "warning", "m.csv")
    assert many.message == ("more than a third of the poses do not fit the stiffnesses of the others: no pose was left out, "
                            "since these are no single mistakes")


ABOUT_X = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
DOWN, SIDE, NONE = [0.0, 0, -200], [0.0, 150, 0], [0.0, 0, 0]


def apart(out: Sequence[int], loads: Sequence[Sequence[float]], visits: int | None = None, base: np.ndarray | None = None,
          ) -> list[tuple[str, str, int | None, str]]:
    """What is said where the rows of these numbers (of so many visits) do not fit, of these forces in the world."""
    rotation = np.eye(3) if base is None else base
    force = np.array(loads) @ rotation
    rows = SimpleNamespace(row=np.arange(len(loads)), wrench=np.hstack([force, np.zeros_like(force)]), source="m.csv")
    data: Any = SimpleNamespace(rows=rows, cell=SimpleNamespace(world_from_base=Frame(rotation, np.zeros(3))))
    visits = len(out) if visits is None else visits
    each = [bad(part, line=9 + k) for k, part in enumerate(np.array_split(np.array(out), visits))]
    return [(one.code, one.level, one.line, one.message) for one in kinds_apart(each, data)]


@pytest.mark.parametrize("base", [None, ABOUT_X])
@pytest.mark.parametrize(("out", "loads", "visits", "said"), [
    ([0, 1], [SIDE, SIDE, DOWN, DOWN, DOWN], 2, "all 2 poses that do not fit are loaded sideways, and none of those that hang"),
    ([2, 3, 4], [SIDE, SIDE, DOWN, DOWN, DOWN], 3,
     "all 3 poses that do not fit are loaded by what hangs, and none of those that are loaded sideways"),
    # Rows without a load are of neither kind.
    ([0, 1, 2], [NONE, SIDE, SIDE, DOWN, DOWN, NONE], 2,
     "all 2 poses that do not fit are loaded sideways, and none of those that hang"),
    # One alone, one that fits all the same, one that is of the other kind, and rows of one kind only.
    ([0], [SIDE, DOWN, DOWN], 1, ""), ([0, 1], [SIDE, SIDE, SIDE, DOWN], 2, ""), ([0, 1, 3], [SIDE, SIDE, DOWN, DOWN], 3, ""),
    ([0, 1], [SIDE, SIDE, NONE], 2, ""), ([0, 1], [DOWN, DOWN, NONE], 2, "")])
def test_one_kind_of_load_that_contradicts_the_other_is_said(
        out: list[int], loads: list[list[float]], visits: int, said: str, base: np.ndarray | None) -> None:
    """Whichever way the robot hangs."""
    found = apart(out, loads, visits, base)
    end = ": one kind of load contradicts the other"
    assert found == ([("CS1736", "warning", 9, said + end)] if said else [])


def judged(rows: tuple[OutlyingRow, ...] = (), visits: tuple[BadVisit, ...] = (), missed: int = 0) -> Validation:
    return Validation(31.24e-6, 12.36e-6, rows, visits, 9, missed, 8.04e-6)


def test_validation_rows_that_are_off_are_said_with_what_they_do_to_the_figure() -> None:
    """A row by its largest component that was read; then the visits."""
    off = np.array([20e-6, -71.4e-6, np.nan])
    said = validation_findings(judged((OutlyingRow(17, 21, off, 8.6),), (bad([3, 4], line=5),)), "m.csv")
    figure = "the validation figure is 31.2 um RMS with all rows, 12.4 um without the outliers"
    assert [(one.code, one.level, one.file, one.line, one.message) for one in said] == [
        ("CS1732", "warning", "m.csv", 21, f"validation row 17 is 71 um off its prediction, 9 times its uncertainty; {figure}"),
        ("CS1733", "warning", "m.csv", 5, f"validation: {sentence(bad([3, 4]))}; {figure}")]
    assert said[1].hint == NEITHER
    assert validation_findings(judged(), "m.csv") == []
    assert validation_findings(None, "m.csv") == []


@pytest.mark.parametrize(("missed", "fails"), [(3, False), (4, True)])
def test_more_than_a_third_of_the_validation_rows_that_are_missed_are_the_model_s(missed: int, fails: bool) -> None:
    """Of nine; but where the outliers are told one by one they are not the model's."""
    said = validation_findings(judged(missed=missed), "m.csv")
    told = ("4 of 9 validation rows are off by more than chance allows, too many to be single mistakes: 31.2 um RMS over all "
            "of them, where their uncertainty expects 8.0 um")
    assert [(one.code, one.level, one.file, one.message) for one in said] == [("CS1737", "warning", "m.csv", told)] * fails
    told_apart = judged((OutlyingRow(17, 21, np.ones(3), 8.6),), missed=missed)
    assert not told_apart.fails
    assert told_apart.numbers.tolist() == [17]
    assert [one.code for one in validation_findings(told_apart, "m.csv")] == ["CS1732"]


@pytest.mark.parametrize(("kind", "words"), [
    (SetUp.SIZED, "larger or smaller"), (SetUp.STRETCHED, "stretched"), (SetUp.TURNED, "stretched and turned")])
@pytest.mark.parametrize("memory", [False, True])
@pytest.mark.parametrize("set_up", [False, True])
def test_what_rows_share_beyond_their_zero_is_said(kind: SetUp, words: str, memory: bool, set_up: bool) -> None:
    """Set-ups of twelve thousandths of the load; a memory of three usual odds of a tenth is a correlation of 3 / 13."""
    fitted: Any = SimpleNamespace(
        data=SimpleNamespace(rows=SimpleNamespace(source="m.csv")), at_map=SimpleNamespace(noise=SimpleNamespace(
            active=(True, True, True, True, set_up, memory))),
        components=VarianceComponents(setup=12.0, memory=3.0, set_up=kind))
    found = {one.code: one for one in not_independent(fitted)}
    assert list(found) == ["CS1040"] * memory + ["CS1041"] * set_up
    assert {(one.level, one.file) for one in found.values()} <= {("note", "m.csv")}
    if memory:
        assert "(correlation 0.23)" in found["CS1040"].message
    if set_up:
        assert found["CS1041"].message == (
            f"the forces of one visit are {words} against those of the next, by 1.2 % of the load")
        assert {SetUp.SIZED: "zero the load cell", SetUp.STRETCHED: "another share", SetUp.TURNED: "align the loading device"}[
            kind] in (found["CS1041"].hint or "")

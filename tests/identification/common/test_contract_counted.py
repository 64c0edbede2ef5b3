"""Numbers in what is said: one is not told in the plural."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest

from identification.common.findings import Finding, counted, fold, verb

ROOT = Path(__file__).parents[3]
# A count whose verb is written behind it and stays in the plural: "1 correction are held back".
STAYS = re.compile(r"counted\([^{}]*'\)\}( [a-z]+){0,3} (are|were|have|do)\b")
# "one of several", whose verb goes with the whole, and what ends a part of the sentence between the two.
ELSEWHERE = re.compile(r"\}( [a-z]+){0,2} (that|which|whose|among|over|between|with deviations)\b")


@pytest.mark.parametrize(("number", "said"), [(0, "0 moves are"), (1, "1 move is"), (2, "2 moves are")])
def test_a_count_takes_its_verb(number: int, said: str) -> None:
    assert counted(number, "move", "are") == said
    assert f"{counted(number, 'move')} {verb(number, 'are')}" == said


@pytest.mark.parametrize(("plural", "singular"), [("were", "was"), ("have", "has"), ("do", "does"), ("show", "shows")])
def test_the_verb_of_one(plural: str, singular: str) -> None:
    assert (verb(1, plural), verb(2, plural)) == (singular, plural)


def test_no_count_has_a_verb_that_stays_in_the_plural() -> None:
    found = [f"{path.relative_to(ROOT)}: {match[0]}" for package in ("compensator", "identification", "compstiff")
             for path in (ROOT / package).rglob("*.py") for match in STAYS.finditer(path.read_text())
             if not ELSEWHERE.search(match[0])]
    assert not found


def test_findings_alike_are_one_with_their_number_at_the_place_of_the_first() -> None:
    one, other = Finding("CS0001", "note", "a", file="f", line=3, count=3), Finding("CS0001", "note", "b", file="f", line=4)
    differing = [replace(one, code="CS0002"), replace(one, level="warning"), replace(one, file="g")]
    assert fold([one, other, replace(one, line=9, count=2), *differing, replace(one, count=1)]) == (
        replace(one, count=6), other, *differing)

"""Faults of the measurement, hidden one at a time and told from what looks most like them."""

from __future__ import annotations

import pytest

from tests.runs.hidden_effects.hide_and_diagnose import Place, check_answer, run
from tests.runs.hidden_effects.places import (
    IN_MOTION,
    MEASUREMENT,
    NEVER_SEEN,
    check_confounder,
    check_named,
    each,
    each_confounded,
)
from tests.virtual_cell.cell import Hidden


@each(*MEASUREMENT)
def test_hidden_is_named(where: Place) -> None:
    check_named(where)


@each_confounded(*MEASUREMENT, *NEVER_SEEN)
def test_confounder_is_not_taken_for_it(where: Place) -> None:
    check_confounder(where)


@each(*NEVER_SEEN)
def test_what_no_deflection_shows_is_not_named(where: Place) -> None:
    assert run(where.seed, where.hidden).content["verdict"] == "adequate"


@pytest.mark.parametrize("name", IN_MOTION)
def test_what_shows_in_motion_only_is_said_not_to_be_offered(name: str) -> None:
    """Joint deflection logs show these (tests/identification/motion); load tests at rest must not seem to rule them out."""
    assert run(1).content["not_offered"][name] == "it shows only in logs taken in motion"


def test_a_stand_that_goes_back_and_a_base_that_gives_way_are_one() -> None:
    """To any load test: the gauge at the foot of the base tells them apart. A load a pose, which is searched quickly."""
    found = run(2, Hidden("stand_compliance", factor=1.5), design="poses20")
    check_answer(found.content)
    assert found.outcome == "ambiguous in", found.answer
    assert "base_shift" in found.answer.alternatives


def test_what_a_gear_gets_wrong_between_poses_is_not_carried() -> None:
    """It is the gear's, but no answer to a load, and nobody knows it where nothing was measured."""
    where = next(place for place in MEASUREMENT if place.hidden.effect == "transmission_error")
    found = run(where.seed, where.hidden)
    assert [cause["of_robot"] for cause in found.content["causes"]] == [False]
    assert found.extended["effects"] == []

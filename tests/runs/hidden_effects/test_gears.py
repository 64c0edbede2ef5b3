"""Effects of the gears, hidden one at a time and told from what looks most like them."""

from __future__ import annotations

import pytest

from tests.runs.hidden_effects.hide_and_diagnose import Place, run
from tests.runs.hidden_effects.places import GEARS, check_confounder, check_named, each, each_confounded
from tests.virtual_cell.cell import Hidden


@each(*GEARS)
def test_hidden_is_named(where: Place) -> None:
    check_named(where)


# Long: one confounder is hidden in test_measurement.py; each is named at its own place here or at the desk, and so taken for
# nothing else.
@each_confounded(*GEARS)
def test_confounder_is_not_taken_for_it(where: Place) -> None:
    check_confounder(where)


# Long: play and a soft zone at the desk (test_desk_world.py) are told from each other or stand together.
@pytest.mark.long
def test_play_that_every_load_crosses_may_look_like_a_soft_zone() -> None:
    """A soft zone of 50 N m is the nearest to it; which loads are small enough to tell decides."""
    assert run(1, Hidden("backlash", 1)).outcome in ("right", "ambiguous in")


def test_a_run_says_what_it_found() -> None:
    where = next(place for place in GEARS if not place.long)
    found = where.run
    assert found.outcome == "right"
    assert found.oracle is not None


# Long: lost motion is named above.
@pytest.mark.long
def test_lost_motion_is_named_where_it_is_found_late() -> None:
    """Of six seeds the one whose search takes longest."""
    assert run(9101, Hidden("lost_motion")).outcome == "right"

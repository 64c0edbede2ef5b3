"""Effects of the gears, hidden one at a time and told from what looks most like them."""

from __future__ import annotations

from tests.hidden_effects.kit import Place
from tests.hidden_effects.places import GEARS, check_ambiguous, check_confounder, check_named, each
from tests.virtual_cell.cell import Hidden


@each(*GEARS)
def test_hidden_is_named(where: Place) -> None:
    check_named(where)


@each(*GEARS)
def test_confounder_is_not_taken_for_it(where: Place) -> None:
    check_confounder(where)


def test_play_that_every_load_crosses_looks_like_a_soft_zone() -> None:
    check_ambiguous(1, Hidden("backlash", 1), Hidden("soft_zone", 1))

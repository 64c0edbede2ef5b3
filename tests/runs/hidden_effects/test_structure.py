"""Effects of structure, base and tool, hidden one at a time and told from what looks most like them."""

from __future__ import annotations

import pytest

from tests.runs.hidden_effects.hide_and_diagnose import Place
from tests.runs.hidden_effects.places import (
    STRUCTURE,
    check_ambiguous,
    check_confounder,
    check_named,
    each,
    each_confounded,
)
from tests.virtual_cell.cell import Hidden


@each(*STRUCTURE)
def test_hidden_is_named(where: Place) -> None:
    check_named(where)


# Long: one confounder is hidden in test_measurement.py; each is named at its own place here or at the desk, and so taken for
# nothing else.
@each_confounded(*STRUCTURE)
def test_confounder_is_not_taken_for_it(where: Place) -> None:
    check_confounder(where)


# Long: what cannot be told apart is asked of wrist bearings in tests/runs/command_line/test_rejected.py.
@pytest.mark.long
def test_a_straight_tool_cannot_tell_sensor_from_spindle() -> None:
    check_ambiguous(1, Hidden("spindle_compliance", factor=2.0), Hidden("force_sensor_compliance"), straight_tool=True)


# Long: the same pair, from the command line to a corrected program: tests/runs/command_line/test_rejected.py.
@pytest.mark.long
@pytest.mark.parametrize(("hidden", "twin"), [(4, 5), (5, 4)])
def test_wrist_bearings_cannot_be_told_apart(hidden: int, twin: int) -> None:
    """Tilt 5 is tilt 4 and a softer joint 4."""
    check_ambiguous(1, Hidden("bearing_tilt", hidden, 2.0), Hidden("bearing_tilt", twin))

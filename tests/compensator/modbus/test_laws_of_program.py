"""Offsets held against the program that the robot runs: the same targets at the same places, and not the corrected ones."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from compensator.modbus.of_program import check_program
from compensator.modbus.offset_file import Offsets
from identification.common.findings import Refused

# Of targets 3 ... 6 of a program of seven, in lines 2 ... 5.
PROGRAM = np.column_stack([0.1 * np.arange(7), np.zeros(7), np.linspace(0.2, 0.3, 7)])
SENT = np.array([[1e-4, 0, 0], [0, 2e-4, 0], [0, 0, -3e-4], [1e-5, 0, 0]])
OFFSETS = Offsets("offsets.csv", 3, SENT, np.zeros(4), np.arange(4) + 2, (), planned=PROGRAM[3:])


def told(position: np.ndarray, offsets: Offsets = OFFSETS, written: str = "") -> tuple[str, str, int | None]:
    """Code, sentence and line of what is refused; nothing where it is not."""
    try:
        found = check_program(offsets, position, "part.mod", written)
    except Refused as refused:
        found = refused.findings
    assert len(found) <= 1
    return (found[0].code, found[0].message, found[0].line) if found else ("", "", None)


def moved(row: int, by: float, axis: int = 1) -> np.ndarray:
    program = PROGRAM.copy()
    program[row, axis] += by
    return program


NOT_OF = "these are not the offsets of part.mod: "
TWICE = "part.mod is a corrected program (record part.mod.json)"


def test_the_same_targets_at_the_same_places_pass() -> None:
    assert told(PROGRAM) == ("", "", None)
    assert told(moved(1, 0.5)) == ("", "", None)          # not among those of the file
    unknown = np.where(np.arange(7)[:, None] == 5, np.nan, PROGRAM)
    assert told(unknown, dataclasses.replace(OFFSETS, planned=unknown[3:])) == ("", "", None)


@pytest.mark.parametrize(("by", "said"), [(1.9e-6, ""), (2.1e-6, "target 5 is 0.0021 mm from where the program has it"),
                                          (-0.25, "target 5 is 250 mm from where the program has it")])
def test_a_place_is_the_same_within_two_micrometres(by: float, said: str) -> None:
    """The first that is not is named, whichever axis."""
    for axis in range(3):
        assert told(moved(5, by, axis)) == (("CS5022", NOT_OF + said, 4) if said else ("", "", None))
    assert told(moved(5, by) + moved(6, 2 * by) - PROGRAM)[2] == (4 if said else 5)


@pytest.mark.parametrize("of_program", [True, False])
def test_a_place_that_one_of_the_two_does_not_know_is_another(of_program: bool) -> None:
    gap = np.where(np.arange(7)[:, None] == 4, np.nan, PROGRAM)
    offsets = OFFSETS if of_program else dataclasses.replace(OFFSETS, planned=gap[3:])
    assert told(gap if of_program else PROGRAM, offsets) == (
        "CS5022", f"{NOT_OF}target 4 is not where the program has it", 3)


@pytest.mark.parametrize(("program", "count"), [(PROGRAM[:6], 6), (np.vstack([PROGRAM, [[1, 0, 0]]]), 8), (PROGRAM[:2], 2)])
@pytest.mark.parametrize("placed", [True, False])
def test_another_number_of_targets_is_another_program(program: np.ndarray, count: int, placed: bool) -> None:
    offsets = OFFSETS if placed else dataclasses.replace(OFFSETS, planned=None)
    assert told(program, offsets) == ("CS5022", f"{NOT_OF}they are for 7 targets, the program has {count}", 2)


def test_the_corrected_program_has_them_already() -> None:
    """Each place by its offset, as far as that is written; by its record alone, where its places are no more the file's."""
    corrected = PROGRAM.copy()
    corrected[3:] += SENT
    already = ("CS5023", "part.mod has these offsets already: it is the corrected program", None)
    assert told(corrected) == already
    assert told(corrected + 1.9e-6 * np.eye(3)[0]) == already
    assert told(corrected + 2.1e-6 * np.eye(3)[0])[0] == "CS5022"
    gap = np.where(np.arange(7)[:, None] == 6, np.nan, corrected)
    assert told(gap, dataclasses.replace(OFFSETS, planned=np.where(np.isnan(gap), np.nan, PROGRAM)[3:])) == already
    assert told(corrected[:6])[0] == "CS5022"
    assert told(corrected, written="part.mod.json") == already
    assert told(moved(5, 0.1), written="part.mod.json") == ("CS5023", TWICE, None)
    assert told(np.vstack([PROGRAM, [[1, 0, 0]]]), written="part.mod.json") == ("CS5023", TWICE, None)
    assert told(PROGRAM, written="part.mod.json") == ("", "", None)      # its offsets were all held back


def test_offsets_of_nothing_are_of_the_program_itself() -> None:
    """The corrected program is the planned one then."""
    assert told(PROGRAM, dataclasses.replace(OFFSETS, offset=0 * SENT)) == ("", "", None)
    assert told(PROGRAM, dataclasses.replace(OFFSETS, offset=np.full((4, 3), 1e-6))) == ("", "", None)


def test_without_places_the_number_of_targets_is_held_alone() -> None:
    offsets = dataclasses.replace(OFFSETS, planned=None)
    assert told(moved(5, 0.1), offsets) == ("CS5024", "that part.mod is their program is held by its number of targets alone: "
                                            "the file has no columns x_mm y_mm z_mm", None)
    assert told(PROGRAM, offsets, "part.mod.json") == ("CS5023", TWICE, None)

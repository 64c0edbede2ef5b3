"""What is said of the external axes that moves with force write: which, how many, where, and only where it counts."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from compensator.correction.driven_axes import said_of_axes, unknown_axes
from identification.common.findings import Finding
from identification.model.mechanical_units import ExternalAxis, MechanicalUnit
from identification.model.rotations import Frame


def unit(name: str, carries: Any, *columns: int, rotary: bool = False, known: bool = True) -> MechanicalUnit:
    return MechanicalUnit(name, carries, Frame.identity(), tuple(ExternalAxis(
        column, rotary, np.eye(3)[0] if known else None, np.zeros(3), 0.0, None, None, None) for column in columns),
        Frame.identity())


def path_of(
    written: list[tuple[float, ...]], units: tuple[MechanicalUnit, ...] | None = (), carrier: list[int] | None = None,
    **told: Any
) -> Any:
    """Targets that write so many of their first axes, NaN: not; carrier: the unit that carries each work object, -1: none."""
    count = len(written)
    external = np.full((count, 6), np.nan)
    for row, values in zip(external, written, strict=True):
        row[:len(values)] = values
    problem = np.full(count, "", dtype=object)
    for target, why in told.get("problem", {}).items():
        problem[target] = why
    standing = np.where(np.isnan(external), 7.5, external)
    return SimpleNamespace(
        toolpath=SimpleNamespace(external=external, together=told.get("together")), cell=SimpleNamespace(units=units),
        axes=SimpleNamespace(problem=problem, values=standing, carrier=np.array(carrier or [-1] * count)),
        finding=lambda target, code, level, message, hint="": Finding(code, level, message, target=target, hint=hint))


def short(found: list[Finding]) -> list[tuple[str, str, int | None, int, str]]:
    return [(one.code, one.level, one.target, one.count, one.message) for one in found]


FORCED = np.array([1, 2, 3])
TRACK, TABLE = unit("T1", "robot", 0), unit("STN1", "workobject", 0, 1, rotary=True)
BLIND = unit("STN2", "workobject", 0, known=False)


def test_a_cell_that_does_not_say_what_an_axis_carries_is_asked() -> None:
    """One finding an axis, of the moves that write it, at the first; those without force are nobody's."""
    path = path_of([(5, 5), (np.nan, 1), (0, 1), (20, np.nan)], None)
    assert short(unknown_axes(path, FORCED)) == [
        ("CS4104", "error", 2, 2, "2 moves with force drive the external axis eax_a (from 0 to 20), and cell.yaml does not say "
                                  "what it carries"),
        ("CS4104", "error", 1, 2, "2 moves with force hold the external axis eax_b (at 1), and cell.yaml does not say what it "
                                  "carries")]
    [one, other] = unknown_axes(path, FORCED)
    assert ("axes: [{eax: a}]" in one.hint, "axes: [{eax: b}]" in other.hint) == (True, True)
    assert unknown_axes(path_of([(5,), (), (), ()], None), FORCED) == []


@pytest.mark.parametrize(("values", "said"), [
    ((0, 0, 0), ""), ((1, 1, 1), "3 moves with force hold the external axis eax_a (at 1), "),
    ((0, 0.5e-4, 0), ""), ((0, 2e-4, 0), "3 moves with force drive the external axis eax_a (from 0 to 0.0002), "),
    ((np.nan, np.nan, 4), "1 move with force holds the external axis eax_a (at 4), ")])
def test_an_axis_of_no_unit_is_written_as_nothing_or_zero(values: tuple[float, ...], said: str) -> None:
    """At zero nobody says that there is one: it is told, and passes."""
    path = path_of([(9,), *((value,) for value in values)])
    found = short(unknown_axes(path, FORCED))
    assert [message for *_, message in found] == (
        [f"{said}and no unit of mechanical_units in cell.yaml has it"] if said else [])
    [told] = said_of_axes(path, FORCED)
    assert (told.code, told.level, told.count, told.hint) == ("CS4502", "warning", int(np.isfinite(values).sum()), "write 9E9")
    assert told.message.endswith(", and by cell.yaml no unit has it: the controller does not use the value")


@pytest.mark.parametrize(("one", "values", "asked"), [
    (TRACK, (0, 50, 0), False), (TABLE, (0, 50, 0), False), (BLIND, (5, 5, 5), False), (BLIND, (5, 50, 5), True),
    (unit("S", "nothing", 0, known=False), (5, 50, 5), False)])
def test_a_unit_that_turns_the_part_must_say_how(one: MechanicalUnit, values: tuple[float, ...], asked: bool) -> None:
    path = path_of([(9,), *((value,) for value in values)], (one,))
    assert short(unknown_axes(path, FORCED)) == ([
        ("CS4104", "error", 1, 3, "3 moves with force drive the external axis eax_a (from 5 to 50 mm), which carries the work "
                                  "object, and cell.yaml does not say how STN2 moves it")] if asked else [])


def test_what_the_path_does_not_understand_is_told_once_a_reason() -> None:
    path = path_of([()] * 4, problem={0: "it is nobody's", 1: "no such unit", 3: "no such unit", 2: "it has no base"})
    assert short(unknown_axes(path, FORCED)) == [
        ("CS4104", "error", 1, 2, "a move with force: no such unit"),
        ("CS4104", "error", 2, 1, "a move with force: it has no base")]


@pytest.mark.parametrize("together", [[True, False, False, False], [True, False, True, True]])
def test_moves_that_are_synchronised_with_other_robots_are_told_where_they_have_force(together: list[bool]) -> None:
    found = short(unknown_axes(path_of([()] * 4, together=np.array(together)), FORCED))
    assert [one[:4] for one in found] == ([("CS4505", "error", 2, 2)] if together[2] else [])


@pytest.mark.parametrize(("values", "carrier", "code", "words"), [
    ((5, 5, 5), (0, 0, 0), "", ""), ((5, 50, 5), (0, 0, 0), "", ""),
    ((5, 5, 5), (-1, -1, -1), "CS4503", "3 moves with force hold the external axis eax_a of STN1 (at 5 deg), and the work "
                                        "object is fixed (ufprog TRUE): it is corrected in that as it is declared"),
    ((5, 50, 50), (0, -1, -1), "CS4503", "2 moves with force hold the external axis eax_a of STN1 (at 50 deg), and"),
    ((5, 50, 5), (-1, -1, 0), "CS4504", "2 moves with force drive the external axis eax_a of STN1 (from 5 to 50 deg), and the "
                                        "work object is fixed (ufprog TRUE): the path over the part is not the program's")])
def test_a_fixed_work_object_does_not_go_with_its_unit(
    values: tuple[float, ...], carrier: tuple[int, ...], code: str, words: str
) -> None:
    """Of the moves in it alone."""
    turning = unit("STN1", "workobject", 0, rotary=True)
    path = path_of([(9,), *((value,) for value in values)], (turning,), [0, *carrier])
    found = said_of_axes(path, FORCED)
    assert [(one.code, one.level, one.target) for one in found] == ([
        (code, "note" if code == "CS4503" else "warning", 1 + carrier.index(-1))] if code else [])
    assert all(one.message.startswith(words) and one.count == carrier.count(-1) for one in found)
    assert said_of_axes(path_of([(9,), *((value,) for value in values)], (TRACK,)), FORCED) == []


def test_a_unit_that_counts_and_is_not_written_is_taken_to_stand_where_it_was_left() -> None:
    """One that carries the robot, or a work object of these moves; where one of its axes is not written."""
    words = ("2 moves with force do not drive STN1: taken to stand where it was left, or is parked (eax_a at {} deg, eax_b at "
             "7.5 deg)")
    path = path_of([(9, 9), (4, np.nan), (4, 4), ()], (TABLE,), [0, 0, 0, 0])
    assert short(said_of_axes(path, FORCED)) == [("CS4507", "note", 1, 2, words.format(4))]
    assert said_of_axes(path_of([(), (4, 4), (4, 4), (4, 4)], (TABLE,), [0, 0, 0, 0]), FORCED) == []
    assert said_of_axes(path_of([()] * 4, (TABLE,), [0, -1, -1, -1]), FORCED) == []
    [track] = said_of_axes(path_of([(), (), (3,), (3,)], (TRACK,)), FORCED)
    assert (track.code, track.target, track.count) == ("CS4507", 1, 1)
    assert track.message.startswith("1 move with force does not drive T1: taken to stand where it was left")
    [second] = said_of_axes(path_of([()] * 4, (unit("S", "nothing", 3), TABLE), [1, 1, 1, 1]), FORCED)
    assert (second.code, second.count, "STN1" in second.message) == ("CS4507", 3, True)
    assert said_of_axes(path_of([()] * 4, None), FORCED) == []

"""A log that names the targets of a corrected program, to which some were added: where its samples stand, worked out here."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from compensator.correction.log_numbers import by_given_targets
from compensator.forces.log import ForceLog
from identification.common.added_targets import AddedTargets
from identification.common.findings import Refused

# Two were added on the move to target 2, at a third and at two thirds of its way.
ADDED = AddedTargets("folder/offsets.csv", np.array([0, 1, 2, 2, 2, 3, 4]), np.array([1, 1, 1 / 3, 2 / 3, 1, 1, 1]))
LENGTH = 1e-3 * np.array([0.0, 10, 22, 50, 60])
WRITTEN = [0.0, 10, 14, 18, 22, 50, 60]


class Lines:
    """Five targets, and the order in which they are driven, if that is not theirs."""

    def __init__(self, driven: list[int] | None) -> None:
        self.driven = None if driven is None else np.array(driven)

    def __len__(self) -> int:
        return 5


def path(target: str = "nearest", driven: list[int] | None = None) -> Any:
    return SimpleNamespace(toolpath=Lines(driven), length=LENGTH, cell=SimpleNamespace(
        force_log=SimpleNamespace(form=SimpleNamespace(target=target))))


def log(numbers: list[int]) -> ForceLog:
    count = len(numbers)
    force = np.arange(3.0 * count).reshape(count, 3)
    return ForceLog("log.csv", force, np.zeros((count, 3)), False, "target", np.array(numbers, dtype=float),
                    np.arange(count) + 2, np.ones(count), 0.01 * np.arange(count), 100.0, None, force.copy(),
                    np.zeros(count, dtype=bool))


def evenly(stretches: list[tuple[float, float]]) -> np.ndarray:
    """Two samples on each: at a quarter, and at three."""
    return np.array([low + share * (high - low) for low, high in stretches for share in (0.25, 0.75)])


@pytest.mark.parametrize(("target", "stretches"), [
    ("nearest", [(0, 5), (5, 12), (12, 16), (16, 20), (20, 36), (36, 55), (55, 60)]),
    ("ahead", [(0, 0), (0, 10), (10, 14), (14, 18), (18, 22), (22, 50), (50, 60)])])
@pytest.mark.parametrize("driven", [None, [0, 1, 2, 3, 4]])
def test_samples_stand_on_the_stretch_of_the_target_that_they_name(
    target: str, stretches: list[tuple[float, float]], driven: list[int] | None
) -> None:
    """The one nearest to the tool: half way to its neighbours in the written program; or the one it moves to."""
    found = by_given_targets(log([k for k in range(7) for _ in range(2)]), path(target, driven), ADDED)
    np.testing.assert_allclose(1e3 * found.place, evenly(stretches), atol=1e-9)
    assert (found.key, found.on_path) == ("path_mm", True)
    assert found.time is not None
    [said] = found.findings
    assert (said.code, said.level, said.file) == ("CS4127", "note", "log.csv")
    assert said.message == ("its target numbers are those of the corrected program (7 targets, 2 of them added, by "
                            "offsets.csv): placed so along the planned one")


@pytest.mark.parametrize(("target", "stretches"), [
    ("nearest", {0: (0, 0), 5: (50, 55), 6: (55, 60), 1: (10, 12), 2: (12, 16), 3: (16, 20), 4: (20, 22)}),
    ("ahead", {0: (0, 0), 5: (50, 50), 6: (50, 60), 1: (10, 10), 2: (10, 14), 3: (14, 18), 4: (18, 22)})])
def test_no_sample_stands_on_a_way_that_is_not_driven(target: str, stretches: dict[int, tuple[float, float]]) -> None:
    """Driven are 0, then 3 and 4, then 1 and 2: from 0 to 1 in the text no tool went, nor from 2 to 3. The rows come in the
    order of the path, without their time."""
    numbers = [k for k in stretches for _ in range(2)]
    found = by_given_targets(log(numbers), path(target, [0, 3, 4, 1, 2]), ADDED)
    order = np.argsort([WRITTEN[k] for k in numbers], kind="stable")
    placed = np.array([evenly([stretches[k]]) for k in stretches]).ravel()
    np.testing.assert_allclose(1e3 * found.place, np.sort(placed), atol=1e-9)
    np.testing.assert_allclose(found.force[:, 0], 3.0 * order)
    assert found.time is None


@pytest.mark.parametrize(("highest", "whose"), [
    (1, "planned"), (2, None), (3, None), (4, "planned"), (5, "written"), (6, "written"), (7, "planned")])
def test_numbers_are_the_written_programs_where_they_can_be_no_other(highest: int, whose: str | None) -> None:
    """Under the first that was added they are alike, and at the planned program's last that was driven; above it they are the
    written one's, as far as that goes. Between them nobody knows."""
    given = log(list(range(highest + 1)))
    if whose is None:
        with pytest.raises(Refused) as stopped:
            by_given_targets(given, path(), ADDED)
        [found] = stopped.value.findings
        assert (found.code, found.file) == ("CS4128", "log.csv")
        assert found.message == (f"the log names targets up to {highest}; the planned program has 5, the corrected one 7: from "
                                 "target 2 on a number means different targets in the two, and the log does not tell which was "
                                 "driven")
        return
    assert (by_given_targets(given, path(), ADDED) is given) == (whose == "planned")


def test_other_logs_and_other_programs_stay_as_they_are() -> None:
    """A log by path length, one that was placed already, one without rows, offsets of a program of other targets."""
    given = log([0, 6])
    for other in (replace(given, key="path_mm"), replace(given, on_path=True), given.without_rows()):
        assert by_given_targets(other, path(), ADDED) is other
    fewer = AddedTargets("offsets.csv", ADDED.given[:-1], ADDED.share[:-1])
    assert by_given_targets(given, path(), fewer) is given

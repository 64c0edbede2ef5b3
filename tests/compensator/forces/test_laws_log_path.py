"""Where a log says that it lies, against the path: beside it, in another unit, over several passes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from compensator.forces.log import ForceLog, read_force_log
from compensator.forces.log_path import on_path
from compensator.forces.one_pass import said_of_lost, targets_of
from compensator.path.robot_path import RobotPath
from identification.common.findings import CompstiffError
from tests.compensator.forces.test_contract_placement import log_text, plan

REACH = 400.0


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> RobotPath:
    """41 targets 10 mm apart along x, from (1000, 0, 700) mm on."""
    return plan(tmp_path_factory.mktemp("plan"), count=41)


def by_position(folder: Path, place: np.ndarray) -> ForceLog:
    file = folder / "forces.csv"
    file.write_text(log_text("x_mm,y_mm,z_mm,fx_n,fy_n,fz_n", np.column_stack([place, np.tile([9.0, 8, 7], (len(place), 1))])))
    return read_force_log(file)


def along(count: int = 201) -> np.ndarray:
    return np.linspace([1000.0, 0, 700], [1000 + REACH, 0, 700], count)


@pytest.mark.parametrize(("off", "said"), [
    ((0, 0.49, 0), ""), ((0, 0.51, 0), "by 0.51 mm in the middle (+0.00, +0.51, +0.00 mm, world frame)"),
    ((0, 0.3, -0.45), "by 0.54 mm in the middle (+0.00, +0.30, -0.45 mm, world frame)")])
def test_samples_beside_the_path_are_told_by_the_middle_of_them(
    path: RobotPath, tmp_path: Path, off: tuple[float, float, float], said: str
) -> None:
    """Four tenths of them as far on the other side are no matter."""
    place = along() + off
    place[1::5] -= 2 * np.array(off)
    place[2::5] -= 2 * np.array(off)
    placed = on_path(by_position(tmp_path, place), path)
    found = [one for one in placed.findings if one.code == "CS3120"]
    assert [(one.level, one.file, one.message) for one in found] == ([(
        "warning", str(tmp_path / "forces.csv"), f"the samples lie beside the path, {said}")] if said else [])
    np.testing.assert_allclose(1e3 * placed.place, np.linspace(0, REACH, 201), atol=1e-6)
    assert placed.beside is not None
    np.testing.assert_allclose(1e3 * placed.beside[[10, 12]], [off, -np.array(off)], atol=1e-9)


@pytest.mark.parametrize("number", [1, 4, 5, 6])
@pytest.mark.parametrize(("off", "lost"), [(0.4, False), (0.6, False), (4.9, False), (5.1, True)])
@pytest.mark.parametrize("end", [False, True])
def test_samples_at_either_end_lie_where_they_are_nearest_or_are_told(
    path: RobotPath, tmp_path: Path, number: int, off: float, lost: bool, end: bool
) -> None:
    """Some of them beside the path, 4 mm apart along it: beyond 5 mm they are not used, and said."""
    place = along(101)
    beside = np.arange(101) >= 101 - number if end else np.arange(101) < number
    place[beside, 2] += off
    placed = on_path(by_position(tmp_path, place), path)
    expected = np.where(beside & lost, np.nan, np.linspace(0, REACH, 101))
    np.testing.assert_allclose(1e3 * placed.place, expected, atol=1e-6)
    said = said_of_lost(placed, targets_of(placed, path) >= 0)
    assert [(one.code, one.message, one.line) for one in said] == (
        [("CS3007", f"{number} of 101 samples not on the path, not used", 103 - number if end else 2)] if lost else [])


@pytest.mark.parametrize(("unit", "factor"), [("metres", 1e3), ("inches", 25.4), ("micrometres", 1e-3)])
@pytest.mark.parametrize(("share", "told"), [(0.79, False), (0.81, True), (1.24, True), (1.26, False)])
def test_path_lengths_that_reach_as_far_but_for_a_unit_are_in_that(
    path: RobotPath, tmp_path: Path, unit: str, factor: float, share: float, told: bool
) -> None:
    """From 0.8 to 1.25 times as far, since a log may begin late or end early; its samples are not used."""
    reach = REACH / factor / share
    rows = np.column_stack([np.linspace(0, reach, 50), np.tile([9.0, 8, 7], (50, 1))])
    (tmp_path / "forces.csv").write_text(log_text("path_mm,fx_n,fy_n,fz_n", rows))
    log = read_force_log(tmp_path / "forces.csv")
    if not told:
        assert on_path(log, path).key == "path_mm"
        return
    with pytest.raises(CompstiffError) as stopped:
        on_path(log, path)
    [found] = stopped.value.findings
    assert (found.code, found.file) == ("CS3005", str(tmp_path / "forces.csv"))
    assert found.message == (
        f"50 samples do not lie on this path: all are within {reach:.3g} mm, the program reaches over 400 mm")
    assert found.hint == f"the log seems to be in {unit}: path_mm is in millimetres"


@pytest.mark.parametrize(("late_ms", "shift"), [(0.0, 0.0), (50.0, 5.0), (-30.0, -3.0)])
def test_positions_that_come_late_stand_where_the_tool_was(tmp_path: Path, late_ms: float, shift: float) -> None:
    """At 100 mm/s; behind the last place that is logged so much later nothing is known, nor before the first one earlier."""
    form = f"force_log: {{position_late_ms: {late_ms:g}, rate_hz: 100}}\n"
    here = plan(tmp_path, "robot: irb6660-205-1.90\ntool: {position_mm: [120, 0, 250]}\n" + form, count=41)
    rows = np.column_stack([np.arange(0, 400.5), np.tile([9.0, 8, 7], (401, 1))])
    (tmp_path / "forces.csv").write_text(log_text("path_mm,fx_n,fy_n,fz_n", rows))
    placed = on_path(read_force_log(tmp_path / "forces.csv", here.cell.force_log.form), here)
    expected = np.arange(0, 400.5) + shift
    expected[(expected < -1e-9) | (expected > 400 + 1e-9)] = np.nan
    np.testing.assert_allclose(1e3 * placed.place, expected, atol=1e-6)


@pytest.mark.parametrize(("first", "second", "taken"), [
    (0.0, 0.0, 1), (0.4, 0.19, 2), (0.4, 0.21, 1), (0.1, 0.4, 1), (0.15, 0.02, 1)])
def test_of_two_layers_the_one_that_is_nearer_by_half_is_taken(
    path: RobotPath, tmp_path: Path, first: float, second: float, taken: int
) -> None:
    """Each 201 rows, so many millimetres above the path, with a way in the air between; else the first. Under a tenth of a
    millimetre both are on it."""
    lift = np.linspace([1000 + REACH, 0, 750], [1000, 0, 750], 30)
    lower, upper = (along() + np.array([0, 0, height]) for height in (first, second))
    place = np.concatenate([lower, lift, upper])
    placed = on_path(by_position(tmp_path, place), path)
    [found] = [one for one in placed.findings if one.code == "CS3128"]
    rows = (2, 202) if taken == 1 else (233, 433)
    assert found.message == ("the log goes along this path 2 times, as layer upon layer does: that of rows "
                             f"{rows[0]} to {rows[1]} is taken, {first if taken == 1 else second:.2f} mm off it in the middle")
    assert (found.level, found.line) == ("warning", rows[0])
    on = np.flatnonzero(~np.isnan(placed.place))
    assert (placed.line[on[0]], placed.line[on[-1]]) == rows

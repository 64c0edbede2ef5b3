"""The speed at which a log was driven, against the program's: told by times and places, in peace where it is right."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from compensator.forces.placement import place_forces, read_force_log
from compensator.path.robot_path import robot_path
from compensator.rapid import read_rapid
from identification.common.findings import Refused
from identification.model.cell import read_cell
from tests.compensator.forces.test_contract_placement import CELL, place, plan

FEED, RATE, COUNT = 100.0, 500.0, 40


def driven(folder: Path, speed: np.ndarray, column: str = "path_mm", unit: float = 1.0, count: int = COUNT) -> set[str]:
    """What is said of a log of a straight cut of 390 mm that is driven at `speed` (n,) [mm/s], n equal parts of the way.
    unit: how many of the log's time a second has; count: of targets, 10 mm apart."""
    ends = np.linspace(0, 10.0 * (count - 1), len(speed) + 1)
    time = np.append(0.0, np.cumsum(np.diff(ends) / speed))
    t = np.arange(0, time[-1], 1 / RATE)
    way = np.interp(t, time, ends)
    force = np.array([-40.0, 90, 60]) + np.random.default_rng(2).normal(0, 2, (len(t), 3))
    where = "{:.4f}" if column == "path_mm" else "{:.4f},0,700"
    rows = [f"{unit * a:.4f},{where.format(b if column == 'path_mm' else 1000 + b)},{x:.3f},{y:.3f},{z:.3f}"
            for a, b, (x, y, z) in zip(t, way, force, strict=True)]
    text = f"time_s,{column},fx_n,fy_n,fz_n\n" + "\n".join(rows) + "\n"
    (folder / "forces.csv").write_text(text)
    path = plan(folder, count=count)
    found = place_forces(read_force_log(folder / "forces.csv"), path, path.cell).findings
    return {finding.message for finding in found if finding.code == "CS3072"}


@pytest.mark.parametrize("column", ["path_mm", "x_mm,y_mm,z_mm"])
@pytest.mark.parametrize(("share", "said"), [(1.0, ""), (0.9, ""), (1.1, ""), (0.5, "at 50 %"), (1.6, "at 160 %")])
def test_the_override_is_told(tmp_path: Path, column: str, share: float, said: str) -> None:
    found = driven(tmp_path, np.array([share * FEED]), column)
    assert [said in message for message in found] == ([True] if said else [])


@pytest.mark.parametrize(("share", "count", "told"), [
    (0.74, COUNT, True), (0.76, COUNT, False), (1.24, COUNT, False), (1.26, COUNT, True), (0.5, 22, True), (0.5, 21, False)])
def test_an_override_is_one_under_three_quarters_or_over_five_of_twenty_moves(
    tmp_path: Path, share: float, count: int, told: bool
) -> None:
    """The log ends within the last move, whose time is not known."""
    found = driven(tmp_path, np.array([share * FEED]), count=count)
    percent = f"{100 * share:.0f} %"
    named = f"driven at {percent} of their feed (nine in ten under {percent}): the force is that of another feed"
    assert [message.endswith(named) for message in found] == [True] * told


@pytest.mark.parametrize(("slow", "told"), [(31, True), (28, False)])
def test_nine_tenths_of_the_cut_by_time_are_driven_slower_where_an_override_is_on(
    tmp_path: Path, slow: int, told: bool
) -> None:
    """Moves of 10 mm at a third of the feed, and the rest of 39 at the feed: 92 % of the time, or 88 %."""
    feed = np.where(np.arange(39) < slow, FEED / 3, FEED)
    found = driven(tmp_path, feed)
    assert [message.split("driven at ")[1].split(": ")[0] for message in found] == [
        "33 % of their feed (nine in ten under 33 %)"] * told


@pytest.mark.parametrize(("fast", "told"), [(25, True), (20, False)])
def test_half_of_the_cut_by_time_is_driven_faster_where_an_override_is_on(tmp_path: Path, fast: int, told: bool) -> None:
    """At one and a half times the feed, so that 25 moves of 39 take 54 % of the time and 20 take 41 %."""
    assert bool(driven(tmp_path, np.where(np.arange(39) < fast, 1.5 * FEED, FEED))) == told


@pytest.mark.parametrize(("unit", "named"), [(1e3, "milliseconds"), (1e6, "microseconds")])
def test_a_time_in_another_unit_is_told_as_such_and_not_as_an_override(tmp_path: Path, unit: float, named: str) -> None:
    [message] = driven(tmp_path, np.array([0.8 * FEED]), unit=unit)
    assert f"it seems to be in {named}" in message


def test_of_few_moves_a_unit_is_told_and_no_override(tmp_path: Path) -> None:
    [message] = driven(tmp_path, np.array([FEED]), unit=1e3, count=6)
    assert "it seems to be in milliseconds" in message
    assert driven(tmp_path, np.array([0.5 * FEED]), count=6) == set()


def test_of_few_long_moves_the_override_is_told(tmp_path: Path) -> None:
    """Five cuts of 110 mm each, as rows of a pocket are: long enough to be driven at the feed."""
    x = 1000 + 110.0 * np.arange(6)
    rest = "[1,0,0,0],[-1,-1,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,z1,tSpindle;"
    moves = "\n".join(f"MoveL [[{place:g},0,700],{rest}" for place in x)
    (tmp_path / "cell.yaml").write_text(CELL)
    cell = read_cell(tmp_path / "cell.yaml")
    path = robot_path(read_rapid(f"MODULE M\nPROC main()\n{moves}\nENDPROC\nENDMODULE\n".encode(), "m.mod").toolpath, cell)

    def said(share: float) -> list[str]:
        way = np.arange(0, 550.0, share * FEED / RATE)
        rows = [f"{k / RATE:.4f},{1000 + s:.4f},0,700,-40,90,60" for k, s in enumerate(way)]
        (tmp_path / "forces.csv").write_text("time_s,x_mm,y_mm,z_mm,fx_n,fy_n,fz_n\n" + "\n".join(rows) + "\n")
        found = place_forces(read_force_log(tmp_path / "forces.csv"), path, cell).findings
        return [finding.message for finding in found if finding.code == "CS3072"]

    assert said(1.0) == []
    [message] = said(0.6)
    assert "at 60 % of their feed" in message


@pytest.mark.parametrize(("unit", "end", "said"), [
    (25.4, 1500.0, "path_mm seems to be in inches"),            # of the first part of the program
    (1.0, 1500.0, "at 4 % of their feed"),                      # in millimetres, at an override of 4 %
])
def test_a_part_of_a_program_whose_path_is_in_inches_is_told(tmp_path: Path, unit: float, end: float, said: str) -> None:
    """Thirty short moves, then long ones to and fro: all of the path is 2 m."""
    x = np.concatenate([1000 + 2.0 * np.arange(30), np.tile([1450.0, 1060.0], 3)])
    moves = "\n".join(f"MoveL [[{place:g},0,{700 + 5 * max(k - 29, 0)}],[1,0,0,0],[-1,-1,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,"
                      "fine,tSpindle;" for k, place in enumerate(x))
    (tmp_path / "cell.yaml").write_text(CELL)
    cell = read_cell(tmp_path / "cell.yaml")
    path = robot_path(read_rapid(f"MODULE M\nPROC main()\n{moves}\nENDPROC\nENDMODULE\n".encode(), "m.mod").toolpath, cell)
    t = np.arange(0, end / (FEED if unit > 1 else FEED / 25.4), 1 / RATE)
    way = np.linspace(0, end, len(t)) / unit
    rows = [f"{a:.4f},{b:.5f},-40,90,60" for a, b in zip(t, way, strict=True)]
    (tmp_path / "forces.csv").write_text("time_s,path_mm,fx_n,fy_n,fz_n\n" + "\n".join(rows) + "\n")
    found = place_forces(read_force_log(tmp_path / "forces.csv"), path, cell).findings
    [message] = [finding.message for finding in found if finding.code == "CS3072"]
    assert said in message


@pytest.mark.parametrize(("share", "named"), [(0.25, False), (0.4, True), (2.5, True), (4.0, False)])
def test_a_unit_is_named_within_a_factor_of_three(tmp_path: Path, share: float, named: bool) -> None:
    """Farther off it is told as the share of the feed that it is, whatever made it."""
    [message] = driven(tmp_path, np.array([share * FEED]), unit=1e3)
    assert ("milliseconds" in message) is named


def test_a_log_that_says_it_took_a_century_costs_no_more_than_another(tmp_path: Path) -> None:
    """Time in nanoseconds, 4e9 of what should be seconds: as many bins of 20 ms would not fit into any memory."""
    [message] = driven(tmp_path, np.array([FEED]), unit=1e9)
    assert "were driven at 0 % of their feed" in message


def test_a_robot_that_slows_down_for_corners_is_left_in_peace(tmp_path: Path) -> None:
    """Two thirds of the way at a third of the feed, the rest at the feed itself."""
    assert driven(tmp_path, FEED * np.where(np.arange(39) % 3 == 0, 1.0, 0.33)) == set()


def test_a_log_without_time_says_nothing(tmp_path: Path) -> None:
    rows = "\n".join(f"{k},{-40 + k % 3},90,60" for k in range(10 * (COUNT - 1)))
    forces = place(tmp_path, f"path_mm,fx_n,fy_n,fz_n\n{rows}\n")
    assert "CS3072" not in {finding.code for finding in forces.findings}


@pytest.mark.parametrize(("share", "unit", "named"), [
    (1.0, 1.0, ""), (0.2, 1.0, ""), (1.0, 1e3, "milliseconds"), (0.6, 1e3, "milliseconds"), (1.0, 1e6, "microseconds")])
@pytest.mark.parametrize("key", ["x_mm,y_mm,z_mm", "path_mm", "target"])
def test_the_unit_is_told_where_calls_drive_in_another_order(
    tmp_path: Path, key: str, share: float, unit: float, named: str
) -> None:
    """The retreat stands first in the text and is driven last, so that rows in the order of the path are in none of time."""
    x = 1000 + 10.0 * np.arange(COUNT)
    moves = [f"MoveL [[{place:g},{y},700],[1,0,0,0],[-1,-1,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,tSpindle;"
             for place, y in [(1000, 30), *((place, 0) for place in x)]]
    (tmp_path / "cell.yaml").write_text(CELL)
    cell = read_cell(tmp_path / "cell.yaml")
    text = (f"MODULE M\nPROC main()\nrCut;\nrHome;\nENDPROC\nPROC rHome()\n{moves[0]}\nENDPROC\nPROC rCut()\n"
            + "\n".join(moves[1:]) + "\nENDPROC\nENDMODULE\n")
    path = robot_path(read_rapid(text.encode(), "m.mod").toolpath, cell)
    way = np.arange(0, 10.0 * (COUNT - 1), share * FEED / RATE)
    where = {"x_mm,y_mm,z_mm": [f"{1000 + s:.4f},0,700" for s in way], "path_mm": [f"{s:.4f}" for s in way],
             "target": [f"{1 + round(s / 10)}" for s in way]}
    rows = [f"{unit * k / RATE:.4f},{place},-40,90,60" for k, place in enumerate(where[key])]
    (tmp_path / "forces.csv").write_text(f"time_s,{key},fx_n,fy_n,fz_n\n" + "\n".join(rows) + "\n")
    found = place_forces(read_force_log(tmp_path / "forces.csv"), path, cell).findings
    messages = [finding.message for finding in found if finding.code == "CS3072" and "seems to be in" in finding.message]
    assert len(messages) == bool(named)
    assert all(f"it seems to be in {named}" in message for message in messages)


@pytest.mark.parametrize(("unit", "named", "begins"), [
    (1.0, "", 0.0), (1e3, "milliseconds", 0.0), (1.0, "", 500.0),
    pytest.param(1e6, "microseconds", 0.0, marks=pytest.mark.long)])
def test_the_unit_of_a_log_with_time_alone_is_asked_about(tmp_path: Path, unit: float, named: str, begins: float) -> None:
    """Noise over as long as the program takes is not placed; by its unit it is told only where that is another, whatever the
    clock shows when the log begins, in times of what the program takes."""
    path = plan(tmp_path, count=COUNT)
    seconds = path.length[-1] / (1e-3 * FEED)
    noise = np.random.default_rng(3).normal(0, 50, (400, 3))
    rows = "\n".join(f"{unit * seconds * (begins + k / 400):.6f},{x:.3f},{y:.3f},{z:.3f}" for k, (x, y, z) in enumerate(noise))
    (tmp_path / "forces.csv").write_text(f"time_s,fx_n,fy_n,fz_n\n{rows}\n")
    with pytest.raises(Refused) as refused:
        place_forces(read_force_log(tmp_path / "forces.csv"), path, path.cell)
    (finding,) = refused.value.findings
    assert finding.code == "CS3061"
    assert (f"is time_s in {named}?" in finding.hint) if named else ("time_s" not in finding.hint)

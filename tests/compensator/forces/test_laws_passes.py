"""Passes beside each other: what their order tells of the force's direction, and whether forces stand at their places."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.passes import drawn, late, said, turned, written
from compensator.correction.files import Inputs
from compensator.forces.log import read_force_log
from compensator.forces.placement import place_forces
from compensator.forces.program_time import moves_in_air
from compensator.forces.stock_side import stock_side
from compensator.path.robot_path import robot_path
from compensator.rapid import read_rapid
from identification.model.cell import read_cell


@pytest.fixture(scope="module")
def jobs(tmp_path_factory: pytest.TempPathFactory) -> list:
    folder = tmp_path_factory.mktemp("passes")
    generators = [np.random.default_rng((19, number)) for number in range(5)]
    return [written(drawn(rng), folder, rng) for rng in generators]


def test_right_logs_are_left_in_peace_and_wrong_ones_are_told(jobs: list, tmp_path: Path) -> None:
    """Rasters and spirals of an end mill, chip by chip: benchmarks/passes.py has the figures over many."""
    told = {"late": [], "turned": [], "sign": []}
    for path, time, place, force in jobs:
        assert not {"CS3068", "CS3073", "CS3074", "CS3077"} & set(said(path, time, place, force, tmp_path))
        told["late"].append("CS3073" in said(path, time, place, late(force, 0.1), tmp_path))
        told["turned"] += [bool({"CS3068", "CS3074"} & set(said(path, time, place, turned(force, by), tmp_path)))
                           for by in (90, -90)]
        told["sign"].append(bool({"CS3068", "CS3074"} & set(said(path, time, place, -force, tmp_path))))
    assert np.mean(told["late"]) >= 0.25
    assert np.mean(told["turned"]) >= 0.5
    assert np.mean(told["sign"]) >= 0.75


def test_a_pass_in_the_air_is_told(jobs: list, tmp_path: Path) -> None:
    """Nothing but the sensor's noise, and a drift of some tenths of a newton."""
    told = 0
    for number, (path, time, place, force) in enumerate(jobs):
        rng = np.random.default_rng((77, number))
        drift = np.column_stack([np.interp(time, np.linspace(0, time[-1], 40), rng.normal(0, 0.2, 40)) for _ in range(3)])
        if (~moves_in_air(path.toolpath)).sum() > 60:
            assert "CS3077" in said(path, time, place, rng.normal(0, 2, force.shape) + drift, tmp_path)
            told += 1
    assert told > 2


@pytest.mark.parametrize(("climbs", "side"), [(True, 1), (False, -1)])
def test_the_side_of_the_stock_by_the_order_of_the_passes(climbs: bool, side: int) -> None:
    """Five passes along x, each further to the right of the feed, or to the left: between two others the stock is there."""
    x = np.linspace(0, 0.05, 26)
    rows = [np.column_stack([x, np.full(26, (-1 if climbs else 1) * 0.004 * row), np.zeros(26)]) for row in range(5)]
    feed = np.tile([1.0, 0, 0], (130, 1))
    up = np.tile([0, 0, 1.0], (130, 1))
    length = (np.arange(5)[:, None] * 0.1 + x).ravel()
    found = stock_side(np.concatenate(rows), length, feed, np.cross(up, feed), up).reshape(5, 26)
    assert (found[[0, 4]] == 0).all()
    assert (found[1:4] == side).all()


# Long: such logs are followed in tests/runs/command_line/test_followed_calls.py, late ones told above.
@pytest.mark.long
def test_a_log_of_routines_in_another_order_is_late_or_slow_all_the_same(sample_inputs: Inputs) -> None:
    """The way home stands in the text before the cut; the same log, as it is, late, and at half the feed."""
    lines = sample_inputs.toolpath.read_text().splitlines()
    moves = [k for k, line in enumerate(lines) if line.lstrip().startswith("Move")]
    head, cut, home = lines[:moves[0]], lines[moves[0]:moves[-1]], lines[moves[-1]]
    rest = lines[moves[-1] + 1:]
    text = [*head, "Cut;", "Home;", "ENDPROC", "PROC Home()", home, "ENDPROC", "PROC Cut()", *cut, *rest]
    cell = read_cell(sample_inputs.cell)
    path = robot_path(read_rapid("\n".join(text).encode(), "insert.mod").toolpath, cell)
    log = read_force_log(sample_inputs.forces, cell.force_log.form)
    assert log.time is not None
    late = np.roll(log.force, 150, axis=0)
    told = []
    for other in (log, replace(log, force=late, plain=late), replace(log, time=2 * log.time)):
        codes = {finding.code for finding in place_forces(other, path, cell, tare=(1, 3)).findings}
        assert "CS3122" in codes
        told.append(codes & {"CS3072", "CS3073"})
    assert told == [set(), {"CS3073"}, {"CS3072"}]


# Long: other jobs, late and turned, above.
@pytest.mark.long
def test_the_samples_log_late_and_turned(sample_inputs: Inputs) -> None:
    cell = read_cell(sample_inputs.cell)
    path = robot_path(read_rapid(sample_inputs.toolpath.read_bytes(), "insert.mod").toolpath, cell)
    log = read_force_log(sample_inputs.forces, cell.force_log.form)
    shift, x, y = 150, log.force[:, 0], log.force[:, 1]
    read = {"right": log.force, "late": np.roll(log.force, shift, axis=0),
            "a quarter": np.column_stack([-y, x, log.force[:, 2]]), "swapped": log.force[:, [1, 0, 2]]}
    found = {}
    for name, force in read.items():
        findings = place_forces(replace(log, force=force, plain=force), path, cell, tare=(0, 2)).findings
        found[name] = {finding.code: finding.hint for finding in findings if finding.code in ("CS3068", "CS3073", "CS3074")}
    assert found["right"] == {}
    assert set(found["late"]) == {"CS3073"}
    assert "position_late_ms: -1" in found["late"]["CS3073"]
    assert set(found["a quarter"]) == set(found["swapped"]) == {"CS3074"}

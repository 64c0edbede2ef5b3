"""What is said of mistakes in the files, in numbers and units, and what of readings and loads tells that one may be there."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from identification.fit.load_test import LoadTest
from identification.fit.mistakes.judge import NamedMistake
from identification.fit.mistakes.readings import reading_mistakes
from identification.fit.mistakes.search import FoundSize
from identification.fit.mistakes.sizes import SIZES, JointZero, ReferenceLoad, Size, ToolOffset
from identification.measurements import read_measurements
from identification.model.cell import read_cell
from tests.runs.mistakes.planted import TCP_MM, right


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> LoadTest:
    """TCP at (120, 0, 250) mm; rows with numbers of their own."""
    cell_file, table = right(31).write(tmp_path_factory.mktemp("mistakes"))
    cell = read_cell(cell_file)
    return LoadTest.of(cell, read_measurements(table, cell.robot))


def said(data: LoadTest, size: Size, joint: int | None, values: list[float], std: list[float]) -> str:
    return size.mistake(data, joint, np.array(values), np.array(std)).sentence.format(rows="all rows")


def test_a_size_is_said_with_two_sigmas_in_the_units_of_the_files(data: LoadTest) -> None:
    """And the cell file's own place of the tool: 120 + 12 mm, 250 - 34.5 mm."""
    assert TCP_MM == (120.0, 0.0, 250.0)
    assert said(data, ToolOffset("xz"), None, [0.012, -0.0345], [0.001, 0.0004]).endswith(
        ", +12.0 +- 2.0 mm along x, -34.5 +- 0.8 mm along z: at (132.0, 0.0, 215.5) mm in the flange frame")
    assert said(data, ToolOffset("y"), None, [0.0071], [0.0002]).endswith(
        ", +7.1 +- 0.4 mm along y: at (120.0, 7.1, 250.0) mm in the flange frame")
    turned = said(data, JointZero(), 1, [np.radians(-1.25)], [np.radians(0.02)])
    assert "the zero of joint 1 seems to be off: the robot stood at q1 -1.25 +- 0.04 degrees" in turned
    assert "(or forces and deflections are turned about base z by so much) in all rows" in turned
    assert said(data, JointZero(), 4, [np.radians(2.0)], [np.radians(0.1)]).endswith("q4 +2.00 +- 0.20 degrees in all rows")
    assert "under a load of (50, -120, 7) +- (2, 6, 1) N" in said(
        data, ReferenceLoad(), None, [50.0, -120.0, 7.0], [1.0, 3.0, 0.5])


@pytest.mark.parametrize(("size", "values", "shown", "moved"), [
    (ToolOffset("xz"), [0.006, -0.008], {"x": 6.0, "z": -8.0}, 5.0), (ReferenceLoad(), [30.0, 0.0, -40.0], {
        "x": 30.0, "y": 0.0, "z": -40.0}, 5.0), (JointZero(), [np.radians(-0.7)], {"delta": -0.7}, 7.0)])
def test_a_size_is_written_in_millimetres_degrees_and_newtons(
        size: Size, values: list[float], shown: dict[str, float], moved: float) -> None:
    """Its standard deviations too, a tenth of what is written here; how many times the smallest worth a name (2 mm, 10 N,
    0.1 degrees) it is; over its own uncertainty sqrt(sum of 10^2) where all are known alike."""
    own = np.array(values)
    std = np.where(own == 0, 1e-6, 0.1 * np.abs(own))
    model: Any = SimpleNamespace(covariance=np.diag(np.concatenate([np.ones(6), std**2])))
    found = FoundSize(size, 2, own, model)
    assert {name: value for name, (value, _) in found.shown().items()} == pytest.approx(shown)
    assert {name: spread for name, (value, spread) in found.shown().items() if value} == pytest.approx(
        {name: 0.1 * abs(value) for name, value in shown.items() if value})
    assert found.moved == pytest.approx(moved)
    assert found.sigmas == pytest.approx(10 * np.sqrt(np.count_nonzero(own)))


def test_sizes_are_looked_for_from_what_is_usual_to_what_is_seen_by_eye() -> None:
    """As engineers judge it: a tool 20 mm off to half a metre, a zero 0.03 rad off to 20 degrees, 50 N to two kilonewtons."""
    judged = {"tcp": (0.02, 0.5), "joint_zero": (0.03, 0.35), "reference_load": (50.0, 2000.0)}
    assert {(size.name, one.typical, one.high) for size in SIZES for one in size.parameters} == {
        (name, *judged[name]) for name in judged}


@pytest.mark.parametrize("signs", [False, True])
def test_forces_are_without_signs_that_have_none(data: LoadTest, signs: bool) -> None:
    """Where a third of them has the sign that works against the tool: of forces all above nothing that is a slip, of forces of
    which some are below it is none."""
    rows = data.rows
    wrench = np.where(np.arange(len(rows))[:, None] % 3 == 0, -1.0, 1.0) * rows.wrench
    spoiled = data.with_rows(replace(rows, wrench=wrench if signs else np.abs(rows.wrench)))
    assert ("forces_unsigned" in {each.key for each in reading_mistakes(spoiled)}) is not signs


@pytest.mark.parametrize("apart", [5.9, 6.1])
def test_gauges_end_alike_that_end_within_six_sigmas(data: LoadTest, apart: float) -> None:
    """Two at their end in two visits each, which are three between them; one that ends elsewhere has too few of its own."""
    sigma = data.cell.noise.deflection[0]
    visits = np.unique(data.rows.visit)
    deflection = np.clip(data.rows.deflection, -1e-5, 1e-5)
    for axis, end, where in ((0, 4e-4, visits[:2]), (1, 4e-4 + apart * sigma, visits[1:3])):
        for visit in where:
            deflection[np.flatnonzero(data.rows.visit == visit)[1:3], axis] = end
    found = [each for each in reading_mistakes(data.with_rows(replace(data.rows, deflection=deflection)))
             if each.key == "readings_clipped"]
    assert bool(found) is (apart < 6)
    if found:
        assert found[0].sentence.startswith("4 readings of dx of 400 um and 4 readings of dy of ")


def test_the_rows_of_a_mistake_are_told_and_written(data: LoadTest) -> None:
    """By their numbers in the file, in all or from one to another; the gain in micrometres."""
    candidate: Any = SimpleNamespace(data=data, rows=None, found=None, mistake=SimpleNamespace(
        key="k", of="table", sentence="dx is odd in {rows}", settles="look"))
    named = NamedMistake(candidate, 0.97, 31.4, 0.93, 2.25e-5, 3.5e-6, 412)
    count = len(data.rows)
    numbers = data.rows.row
    assert named.lines() == [
        f"mistake in the table: dx is odd in all {count} rows", "  every pose predicted from the others: 22.50 -> 3.50 um RMS "
        "with it mended; ln Bayes factor 31 against the files as they are, 412 mistakes tried"]
    assert replace(named, support=0.0).lines() == named.lines()[:1]
    assert named.as_dict() == {
        "mistake": "k", "of": "table", "sentence": f"dx is odd in all {count} rows", "probability": 0.97, "rows": count,
        "first_row": numbers[0], "last_row": numbers[-1], "parameters": {}, "log_bayes_factor": 31.4, "explained": 0.93,
        "tried": 412, "held_out_rms_um": pytest.approx([22.5, 3.5]), "settles": "look"}
    part = np.isin(np.arange(count), [5, 6, 9])
    size: Any = SimpleNamespace(size=ToolOffset("y"), shown=lambda: {"y": (4.0, 0.2)})
    some = replace(named, candidate=SimpleNamespace(data=data, rows=part, found=size, mistake=candidate.mistake))
    written = some.as_dict()
    assert (written["rows"], written["first_row"], written["last_row"]) == (3, numbers[5], numbers[9])
    assert written["parameters"] == {"y": {"estimate": 4.0, "std": 0.2, "unit": "mm"}}
    assert some.sentence == f"dx is odd in rows {numbers[5]} to {numbers[9]}"

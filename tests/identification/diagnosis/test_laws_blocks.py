"""Rows of machined passes as blocks: each is the mean of its own rows, told by a loop over all, and counts for its worth."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from identification.diagnosis import blocks
from identification.diagnosis.blocks import Thinning, in_blocks, residual_memory
from identification.fit.load_test import LoadTest
from identification.fit.posterior import posterior
from identification.measurements import Measurements
from identification.model.cell import Cell
from identification.model.compliance import joint_torque
from tests.identification.diagnosis.test_laws_diagnosis import machined, pass_file

# Load tests before the passes, which are no pass.
BEFORE = 12


@pytest.fixture(scope="module", params=[(0.0, 430), (0.8, 220)])
def passes(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
           ) -> tuple[float, Cell, Measurements, Measurements, Thinning]:
    """Three passes of so many rows, one of five to validate, and noise with this memory, as they are and in blocks; some
    readings, and most of the sigmas, are missing."""
    memory, count = request.param
    case, design = machined(3, [], memory, count, 3)
    cell, rows = pass_file(case, design, tmp_path_factory.mktemp("passes"), count)
    place = np.arange(len(rows))
    deflection, sigma = rows.deflection.copy(), np.full((len(rows), 3), np.nan)
    deflection[100:300:7, 1], deflection[450:520, 2] = np.nan, np.nan
    sigma[200:240] = 7e-6
    first = place < BEFORE
    rows = replace(
        rows, deflection=deflection, sigma=sigma, machined_pass=np.where(first, "", rows.machined_pass),
        visit=np.where(first, place // 4, rows.visit + BEFORE // 4), validate=~first & (place % 5 == 3),
        pose=np.where(first, "P", ""), dwell=np.where(place < 40, np.nan, 0.1 * place))
    averaged, thinning = in_blocks(cell, rows)
    assert thinning
    return memory, cell, rows, averaged, thinning


def members(cell: Cell, rows: Measurements, length: int) -> list[list[int]]:
    """The rows of each block, in the order of their first ones: so many neighbours of one pass and purpose between which no
    torque of over 5 N m changes its sign, is taken off or comes on."""
    torque = joint_torque(cell.robot, rows.theta, cell.flange_from_tcp, rows.wrench)
    blocks: list[list[int]] = []
    seen: dict[tuple[int, bool], int] = {}
    last: dict[tuple[int, bool], tuple[object, list[int]]] = {}
    for row, each in enumerate(torque):
        if not rows.machined_pass[row]:
            blocks.append([row])
            continue
        key = int(rows.visit[row]), bool(rows.validate[row])
        state = (seen.get(key, 0) // length, tuple(0 if abs(t) <= 5 else 1 if t > 0 else -1 for t in each))
        if key not in last or last[key][0] != state:
            blocks.append([])
            last[key] = state, blocks[-1]
        last[key][1].append(row)
        seen[key] = seen.get(key, 0) + 1
    return blocks


def test_a_block_is_the_mean_of_neighbours_of_one_pass_and_purpose(
        passes: tuple[float, Cell, Measurements, Measurements, Thinning]) -> None:
    """Rows to validate stand between those that are fitted: none goes into a block of these, nor the other way."""
    memory, cell, rows, averaged, thinning = passes
    # (1 + r) / (1 - r) of that noise, less its slow part, which is taken for the model's; as many rows as make 1200 blocks.
    assert 5 < thinning.autocorrelation_time < 9.5 if memory else thinning.autocorrelation_time < 1.2
    length = int(np.ceil(5 * thinning.autocorrelation_time)) if memory else 2
    blocks = members(cell, rows, length)
    assert (thinning.rows, thinning.blocks, len(averaged)) == (len(rows) - BEFORE, len(blocks) - BEFORE, len(blocks))
    firsts = np.array([block[0] for block in blocks])
    for name in ("visit", "validate", "line", "row", "machined_pass", "reference"):
        assert getattr(averaged, name).tolist() == getattr(rows, name)[firsts].tolist()

    def means(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.array([[np.nanmean(column) if not np.isnan(column).all() else np.nan for column in values[block].T]
                         for block in blocks])

    for name in ("theta", "wrench", "deflection"):
        np.testing.assert_allclose(getattr(averaged, name), means(getattr(rows, name)), rtol=1e-12, atol=1e-18)
    for name in ("time", "dwell"):
        np.testing.assert_allclose(getattr(averaged, name), means(getattr(rows, name)[:, None])[:, 0], rtol=1e-12)
    # Of n readings that share their noise over tau the mean is as good as that of n / tau; none is worse than one reading.
    stated = means(np.where(np.isnan(rows.sigma), cell.noise.deflection, rows.sigma))
    read = np.array([(~np.isnan(rows.deflection[block])).sum(axis=0) for block in blocks])
    assert any(0 < few < len(block) for block, each in zip(blocks, read, strict=True) for few in each), "some are missing"
    worth = np.maximum(read / min(thinning.autocorrelation_time, length), 1)
    np.testing.assert_allclose(averaged.sigma, stated / np.sqrt(worth), rtol=1e-12)


def memory_of(series: NDArray[np.float64], window: int) -> float:
    """1 + 2 sum of the autocorrelations up to the first that its own scatter hides, of what a running mean leaves."""
    before, after = window // 2, (window + 1) // 2
    fast = np.array([series[k] - np.mean(series[k - before: k + after]) for k in range(before, len(series) - after)])
    fast = fast - fast.mean()
    total = 1.0
    for lag in range(1, window // 2 + 1):
        alike = np.sum(fast[lag:] * fast[:-lag]) / np.sum(fast**2)
        if alike < 2 / np.sqrt(len(fast)):
            break
        total += 2 * alike
    return float(total)


def test_the_length_of_the_memory_is_the_longest_of_all_passes_and_axes(
        passes: tuple[float, Cell, Measurements, Measurements, Thinning]) -> None:
    """Of what is left of the six springs, a quarter of the readings that an axis has in a pass at a time."""
    _, cell, rows, _, thinning = passes
    data = LoadTest.of(cell, rows.select(rows.machined_pass != ""))
    residual, found = posterior(data).residual_of(data), []
    for name in ("A0", "A1", "A2"):
        mine = residual[data.rows.machined_pass == name]
        found += [memory_of(series, len(series) // 4) for series in (axis[~np.isnan(axis)] for axis in mine.T)]
    assert thinning.autocorrelation_time == pytest.approx(max(1.0, *found), rel=1e-9)


@pytest.mark.parametrize(("counts", "fitted"), [
    ((1000, 700, 90), 1790), ((799, 810), 1609), ((2999,), 2999), ((3000,), 1500), ((2000, 2600), 1534), ((31, 31), 62),
    ((32,), 32)])
def test_the_memory_is_that_of_what_a_mean_over_two_hundred_rows_leaves(
        counts: tuple[int, ...], fitted: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Or over a quarter of a pass, of eight rows at least, that is shorter; the model is fitted to 1500 to 3000 rows, evenly
    spread, and says what is left of all. What was not read is left out."""
    rng, count = np.random.default_rng(sum(counts)), sum(counts)
    visit = np.repeat(np.arange(len(counts)), counts)
    noise = rng.standard_normal((count + 8, 3))
    # Each axis remembers so many rows; slow waves, of 250 and 900 rows, are the model's.
    left = np.stack([np.convolve(noise[:, k], np.ones(2 + k), mode="valid")[:count] for k in range(3)], axis=1)
    left += np.outer(np.sin(np.arange(count) / 40), [1.0, 0.0, 1.0]) + np.outer(np.sin(np.arange(count) / 143), [3.0, 0.0, 5.0])
    left[np.flatnonzero(visit == 0)[5:12], 1] = np.nan
    seen = []

    def fit(data: Any) -> Any:
        seen.append(data)
        return SimpleNamespace(residual_of=lambda whole: left)

    class Rows(SimpleNamespace):
        def __len__(self) -> int:
            return count

    monkeypatch.setattr(blocks, "posterior", fit)
    rows = Rows(visit=visit, select=lambda kept: np.flatnonzero(kept).tolist())
    data: Any = SimpleNamespace(rows=rows, with_rows=lambda kept: kept)
    found, lengths = residual_memory(data), []
    for number in range(len(counts)):
        series = [axis[~np.isnan(axis)] for axis in left[visit == number].T]
        lengths += [memory_of(each, min(200, len(each) // 4)) for each in series if len(each) >= 32]
    assert found.values == pytest.approx(max(1.0, *lengths, 1.0), rel=1e-9)
    step = round(count / fitted)
    assert seen == [list(range(0, count, step))]
    assert len(seen[0]) == fitted


@pytest.mark.parametrize("lost", [0, 1, 3])
def test_a_pass_that_lost_a_reading_remembers_as_long(lost: int, tmp_path: Path) -> None:
    """Of every axis: 400 rows whose noise is as good as that of a seventh of them."""
    case, design = machined(3, [], 0.8, 400, 2)
    cell, rows = pass_file(case, design, tmp_path, 400)
    deflection = rows.deflection.copy()
    deflection[100: 100 + lost], deflection[600: 600 + lost] = np.nan, np.nan
    _, thinning = in_blocks(cell, replace(rows, deflection=deflection))
    assert thinning
    assert 5 < thinning.autocorrelation_time < 9.5


@pytest.mark.parametrize(("count", "told"), [(31, False), (44, True)])
def test_a_pass_of_a_few_rows_tells_no_memory(count: int, told: bool, tmp_path: Path) -> None:
    """Under 32 rows, of which a quarter is less than eight; readings that creep by a little from row to row."""
    case, design = machined(3, [], 0.0, count, 2)
    cell, rows = pass_file(case, design, tmp_path, count)
    creeping = 3e-6 * np.sin(np.arange(2 * count) / 1.5)[:, None] * np.ones(3)
    data = LoadTest.of(cell, replace(rows, deflection=rows.deflection + creeping))
    assert (residual_memory(data).values > 1.0) is told


def test_a_pass_is_held_out_in_tenths(
        passes: tuple[float, Cell, Measurements, Measurements, Thinning]) -> None:
    """Of the rows of one purpose each; load tests keep their pose."""
    _, _, rows, averaged, _ = passes
    for first, pose in zip(np.searchsorted(rows.row, averaged.row), averaged.pose, strict=True):
        alike = np.flatnonzero((rows.visit == rows.visit[first]) & (rows.validate == rows.validate[first]))
        tenth = 10 * int(np.searchsorted(alike, first)) // len(alike)
        assert pose == (f"{rows.machined_pass[first]} part {tenth + 1}" if rows.machined_pass[first] else "P")


@pytest.mark.parametrize(("count", "length"), [(1200, 1), (1201, 2)])
def test_of_independent_rows_no_more_than_make_twelve_hundred_blocks_are_averaged(
        count: int, length: int, tmp_path: Path) -> None:
    """One newton all along: no torque ends a block."""
    case, design = machined(3, [], 0.0, count, 1)
    cell, rows = pass_file(case, design, tmp_path, count)
    calm = replace(rows, wrench=np.tile([1.0, 0, 0, 0, 0, 0], (count, 1)),
                   deflection=np.random.default_rng(0).normal(0, 3e-6, (count, 3)))
    averaged, thinning = in_blocks(cell, calm)
    assert thinning
    assert thinning.rows == count
    assert len(averaged) == thinning.blocks == -(-count // length)

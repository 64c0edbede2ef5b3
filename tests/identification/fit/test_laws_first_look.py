"""What a first look says of a table, just beyond each limit and just within: readings of the independent arm under small loads,
spoiled by exactly so much."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import nnls

from identification.common.findings import CompstiffError
from identification.fit.load_test import LoadTest
from identification.fit.mistakes.cell_file import cell_mistakes
from identification.fit.mistakes.first_look import first_look, refuse_absurd
from identification.fit.mistakes.odd_rows import odd_rows
from tests.identification.fit.exact_rows import beside, by_compliance
from tests.identification.fit.test_laws_posterior import simulate

Array = NDArray[np.float64]
ROWS = 20


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> tuple[LoadTest, Array]:
    """20 rows of as many poses whose springs are the prior's, each of the same size (20 um), all but without noise; and what
    each joint by itself (n, 3, 6) moves in them [m], by the independent arm."""
    rng = np.random.default_rng(4)
    cell, rows = simulate(tmp_path_factory.mktemp("arm"), rng, poses=ROWS, loads=1, quiet=True)
    noise = replace(cell.noise, deflection=np.full(3, 1e-12), pose_offset=np.zeros(3))
    wrench = np.zeros((ROWS, 6))
    wrench[:, :3] = rng.normal(0.0, 1.0, (ROWS, 3))
    each = by_compliance(rows.theta, cell.flange_from_tcp.position, wrench[:, :3]) / cell.prior.stiffness
    alike = 2e-5 / np.linalg.norm(each.sum(axis=2), axis=1)
    wrench, each = wrench * alike[:, None], each * alike[:, None, None]
    data = LoadTest.of(replace(cell, noise=noise), replace(rows, wrench=wrench, deflection=each.sum(axis=2)))
    assert first_look(data) is None
    return data, each


def read(data: LoadTest, deflection: Array) -> LoadTest:
    return data.with_rows(replace(data.rows, deflection=deflection))


def said(data: LoadTest) -> str:
    found = first_look(data)
    return found.message if found else ""


def with_share(each: Array, share: float) -> Array:
    """Readings (n, 3) of which this share of the squares fits no springs, all rows alike on the whole."""
    readings = each.sum(axis=2)
    size = np.sqrt(share / (1 - share) * np.mean(readings**2))
    return np.asarray(readings + size * beside(each))


@pytest.mark.parametrize(("smaller", "unit"), [
    (1 / 5.4, None), (1 / 6.6, "forces in lbf or forces in kgf"), (5.4, None), (6.6, "deflections in 0.01 mm"),
    (9.5, "deflections in 0.01 mm"), (10.9, "deflections in 0.01 mm or deflections in mil"),
    (23.0, "deflections in 0.01 mm or deflections in mil"), (27.0, "deflections in mil"), (58.0, "deflections in mil"),
    (69.0, ""), (365.0, ""), (440.0, "deflections in mm"), (2300.0, "deflections in mm"), (2700.0, ""), (9300.0, ""),
    (11000.0, "deflections in inches"), (58000.0, "deflections in inches"), (69000.0, ""),
    (1 / 10.2, "forces in lbf or forces in kgf"), (1 / 12.2, "forces in kgf"), (1 / 22.5, "forces in kgf"), (1 / 27.0, ""),
    (1 / 365.0, ""), (1 / 440.0, "forces in kN"), (1 / 2300.0, "forces in kN"), (1 / 2700.0, "")])
def test_readings_of_another_size_are_said_from_a_factor_of_six_with_the_units_within_two_and_a_half(
        arm: tuple[LoadTest, Array], smaller: float, unit: str | None) -> None:
    data, each = arm
    times = f"{smaller:.3g} times smaller" if smaller > 1 else f"{1 / smaller:.3g} times larger"
    start = f"the readings are {times} than the prior's stiffnesses make them under these loads"
    message = re.sub(r", not in \w+( \(or [^)]*\))?", "", said(read(data, each.sum(axis=2) / smaller)))
    assert message == ("" if unit is None else start + (f": {unit}?" if unit else ""))


@pytest.mark.parametrize(("smaller", "unit"), [
    (1.1e5, ""), (3.6e5, ""), (4.4e5, ": deflections in m, not in um?"), (2.3e6, ": deflections in m, not in um?"), (2.7e6, ""),
    (1 / 1.1e5, "")])
def test_readings_a_hundred_thousand_times_off_are_refused(arm: tuple[LoadTest, Array], smaller: float, unit: str) -> None:
    data, each = arm
    refuse_absurd(read(data, each.sum(axis=2) / (9e4 if smaller > 1 else 1 / 9e4)))
    with pytest.raises(CompstiffError, match="CS1018") as caught:
        refuse_absurd(read(data, each.sum(axis=2) / smaller))
    assert caught.value.findings[0].message.endswith(f"make them under these loads{unit}")


@pytest.mark.parametrize(("part", "told"), [(0.45, False), (0.55, True)])
def test_a_tool_that_moves_without_a_load_is_said_from_half_of_what_it_does_under_one(
        arm: tuple[LoadTest, Array], part: float, told: bool) -> None:
    """Four rows without a load that read this part of the others' 20 um each."""
    data, each = arm
    wrench, deflection = data.rows.wrench.copy(), each.sum(axis=2)
    wrench[3:7], deflection[3:7] = 0.0, part * deflection[3:7]
    assert said(data.with_rows(replace(data.rows, wrench=wrench, deflection=deflection))) == (
        f"the tool moves in rows without a load, too, by {20 * part:.3g} um in the middle" if told else "")


@pytest.mark.parametrize(("share", "noise", "told"), [
    (0.09, 0.0, ""), (0.11, 0.0, "11%"), (0.14, 0.05, ""), (0.16, 0.05, "11%")])
def test_directions_that_no_springs_allow_are_said_from_a_tenth_of_the_squares_beyond_the_noise(
        arm: tuple[LoadTest, Array], share: float, noise: float, told: str) -> None:
    data, each = arm
    deflection = with_share(each, share)
    std = np.sqrt(noise * np.mean(deflection**2))
    data = replace(data, cell=replace(data.cell, noise=replace(data.cell.noise, deflection=np.full(3, std))))
    assert said(read(data, deflection)) == (
        f"the tool moves in directions in which no springs let it go: {told} of the readings fit none" if told else "")


def left_of(each: Array, deflection: Array) -> float:
    """Share of the squares that no springs explain."""
    columns, readings = each.reshape(-1, 6), deflection.ravel()
    return float(nnls(columns / np.abs(columns).max(axis=0), readings)[1] ** 2 / (readings @ readings))


@pytest.mark.parametrize("part", [0.22, 0.28])
def test_a_mistake_is_named_that_leaves_under_a_quarter_of_the_misfit(arm: tuple[LoadTest, Array], part: float) -> None:
    """dx with the other sign, and beside it as much that no springs explain as leaves this part of what the rows leave."""
    data, each = arm
    low, high = 0.0, 0.5
    for _ in range(40):
        share = 0.5 * (low + high)
        deflection = with_share(each, share) * [-1, 1, 1]
        low, high = (share, high) if share < part * left_of(each, deflection) else (low, share)
    left = left_of(each, deflection)
    assert said(read(data, deflection)) == (
        f"dx seems to have the other sign in all rows: as they stand {left:.0%} of the readings fit no springs, so mended "
        f"{share:.2%}" if part < 0.25 else
        f"the tool moves in directions in which no springs let it go: {left:.0%} of the readings fit none")


@pytest.mark.parametrize("part", [0.45, 0.55])
def test_rows_that_fit_no_springs_are_said_where_without_them_half_is_left(arm: tuple[LoadTest, Array], part: float) -> None:
    """One row whose reading points across, beside what no springs explain in any."""
    data, each = arm
    across = np.linalg.svd(each[7])[0][:, 2]
    low, high = 0.0, 0.3
    for _ in range(40):
        share = 0.5 * (low + high)
        deflection = with_share(each, share)
        deflection[7] = 2e-5 * across
        others = np.arange(ROWS) != 7
        rest, left = left_of(each[others], deflection[others]), left_of(each, deflection)
        low, high = (share, high) if rest < part * left else (low, share)
    told = said(read(data, deflection))
    assert ("1 of 20 rows with a load (line 9) fit no springs that fit the others" in told) is (part < 0.5), told


def small_reading(each: Array, share: float, fits: Callable[[float, float, float], bool]) -> Array:
    """Readings of which one row's is as much too small as `fits` begins to hold at: of what is left of the rows as they stand,
    with its reading ten times as large, and with its force a tenth."""
    low, high = 0.0, 0.0999
    for _ in range(40):
        times = 0.5 * (low + high)
        deflection = with_share(each, share)
        deflection[7] *= times
        larger, lighter = deflection.copy(), each.copy()
        larger[7] *= 10.0
        lighter[7] *= 0.1
        further = fits(left_of(each, deflection), left_of(each, larger), left_of(lighter, deflection))
        low, high = (times, high) if further else (low, times)
    return deflection


@pytest.mark.parametrize(("share", "times", "alike"), [
    (0.0, 0.009, True), (0.0, 0.011, False), (0.004, 1.35, True), (0.004, 1.65, False)])
def test_mistakes_are_told_apart_from_a_hundredth_of_the_misfit_or_half_more_than_the_best_leaves(
        arm: tuple[LoadTest, Array], share: float, times: float, alike: bool) -> None:
    """A row's force ten times too large leaves all but nothing, its deflection ten times too small so much."""
    data, each = arm
    deflection = small_reading(each, share, lambda left, larger, lighter: larger > times * (lighter if share else left))
    told = said(read(data, deflection))
    assert told.startswith("1 of 20 rows with a load (line 9) fit no springs that fit the others: forces seem to be ten times "
                           "too large in them")
    assert (", or deflections seem to be ten times too small in them" in told) is alike


def off(data: LoadTest, each: Array, rows: list[int], times: float, count: int = ROWS) -> list[int]:
    """The rows that are odd of the first so many, with these readings so many times what they are."""
    deflection = each.sum(axis=2)
    deflection[rows] *= times
    few = data.with_rows(replace(data.rows, deflection=deflection).select(np.arange(ROWS) < count))
    return [int(row) for row in np.flatnonzero(odd_rows(few))]


@pytest.mark.parametrize(("times", "told"), [(0.55, False), (0.45, True), (1.8, False), (2.2, True)])
def test_a_row_is_odd_where_half_of_it_is_left(arm: tuple[LoadTest, Array], times: float, told: bool) -> None:
    """Of the larger of what was read and what springs make of it."""
    assert off(*arm, [7], times) == [7] * told


@pytest.mark.parametrize("seed", [0, 1, 3])
@pytest.mark.parametrize(("large", "small"), [(8, 0), (0, 8), (5, 3)])
def test_eight_rows_of_twenty_are_odd_that_are_ten_times_too_large_or_too_small(
        arm: tuple[LoadTest, Array], seed: int, large: int, small: int) -> None:
    """By either of two sizes that keep one kind of them down: what was read, and what the prior's springs make of the load."""
    data, each = arm
    rows = np.random.default_rng(seed).choice(ROWS, large + small, replace=False)
    deflection = each.sum(axis=2)
    deflection[rows[:large]] *= 10.0
    deflection[rows[large:]] /= 10.0
    assert np.flatnonzero(odd_rows(read(data, deflection))).tolist() == sorted(rows.tolist())


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_rows_under_next_to_no_load_do_not_decide_which_are_odd(arm: tuple[LoadTest, Array], seed: int) -> None:
    """Eight of twenty that move the tool by 0.6 um and scatter by as much again; four of the others ten times too large or too
    small."""
    data, each = arm
    rng = np.random.default_rng(seed)
    size = np.where(np.arange(ROWS) < 8, 0.03, 1.0)[:, None]
    deflection = each.sum(axis=2) * size
    deflection[:8] += rng.normal(0, 8e-7, (8, 3))
    rows = rng.choice(np.arange(8, ROWS), 4, replace=False)
    deflection[rows] *= rng.choice([10.0, 0.1], 4)[:, None]
    found = odd_rows(data.with_rows(replace(data.rows, wrench=size * data.rows.wrench, deflection=deflection)))
    assert np.flatnonzero(found).tolist() == sorted(rows.tolist())


@pytest.mark.parametrize(("size", "noise_um", "told"), [
    (0.115, 0.0, False), (0.135, 0.0, True), (0.46, 4.0, False), (0.54, 4.0, True)])
def test_small_readings_are_held_against_half_of_the_middle_one_and_ten_sigmas(
        arm: tuple[LoadTest, Array], size: float, noise_um: float, told: bool) -> None:
    """A load that moves the tool by this part of the 20 um of the others, and a reading that is just opposite: twice that is
    left, of 10 um at least, and of 40 um where one sigma of three axes is 4 um."""
    data, each = arm
    wrench, deflection = data.rows.wrench.copy(), each.sum(axis=2)
    wrench[7], deflection[7] = size * wrench[7], -size * deflection[7]
    cell = replace(data.cell, noise=replace(data.cell.noise, deflection=np.full(3, 1e-6 * noise_um / np.sqrt(3))))
    found = odd_rows(replace(data, cell=cell).with_rows(replace(data.rows, wrench=wrench, deflection=deflection)))
    assert np.flatnonzero(found).tolist() == [7] * told


@pytest.mark.parametrize(("count", "rows", "told"), [
    (4, [1], False), (5, [1], True), (20, list(range(10)), True), (20, list(range(11)), False)])
def test_odd_rows_are_told_from_four_others_on_and_up_to_half(
        arm: tuple[LoadTest, Array], count: int, rows: list[int], told: bool) -> None:
    """Readings against their loads, which no springs allow."""
    assert off(*arm, rows, -1.0, count) == rows * told


@pytest.mark.parametrize(("length", "units"), [
    (0.7, []), (0.85, ["inches"]), (1.8, ["inches"]), (2.2, ["centimetres", "inches"]), (54.0, ["centimetres", "inches"]),
    (64.0, ["centimetres"]), (135.0, ["centimetres"]), (165.0, []), (18e3, []), (22e3, ["micrometres"]),
    (1.35e6, ["micrometres"]), (1.65e6, [])])
def test_a_tool_s_unit_is_one_with_which_it_is_two_to_a_hundred_and_fifty_centimetres_long(
        arm: tuple[LoadTest, Array], length: float, units: list[str]) -> None:
    """By the numbers of the cell file, taken for mm: what they are in each unit is what the mended cell has."""
    data, _ = arm
    frame = data.cell.flange_from_tcp
    position = 1e-3 * length * np.array([0.6, 0.0, 0.8])
    other = replace(data, cell=replace(data.cell, flange_from_tcp=replace(frame, position=position)))
    found = {mistake.key[9:-1]: mistake.mended(other).cell for mistake in cell_mistakes(other)}
    assert sorted(found) == units
    for unit, mended in found.items():
        factor = {"inches": 25.4, "centimetres": 10.0, "micrometres": 0.001}[unit]
        np.testing.assert_allclose(mended.flange_from_tcp.position, factor * position)

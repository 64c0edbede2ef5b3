"""What would mend a single bad reading: each slip is found in readings that have it, and hardly one where none was made."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from identification.fit.mending import Mend
from identification.fit.row_slips import row_mend

STD = 4e-6
TURN = 2e-4


def told(seed: int, slip: str) -> tuple[Mend | None, int]:
    """What is said of one row of a visit of six, and that row: readings of up to half a millimetre, noise of 4 um, the slip."""
    rng = np.random.default_rng([seed, 58])
    expected = rng.uniform(-5e-4, 5e-4, (6, 3))
    readings = expected + STD * rng.standard_normal((6, 3))
    row, axis = int(rng.integers(6)), int(np.argmax(np.abs(expected[0])))
    if slip == "readings exchanged":
        readings[[row, (row + 1) % 6]] = readings[[(row + 1) % 6, row]]
    elif slip == "sign":
        readings[row] *= -1
    elif slip == "decimal point":
        readings[row, axis] *= 10 if seed % 2 else 0.1
    elif slip == "whole turns":
        readings[row, axis] += TURN * (2 if seed % 2 else -1)
    elif slip == "one axis":
        readings[row, axis] += rng.uniform(5e-5, 1e-3) * rng.choice([-1, 1])
    else:
        readings[row] += rng.uniform(5e-5, 1e-3, 3) * rng.choice([-1, 1], 3)
    rows = SimpleNamespace(deflection=readings, visit=np.zeros(6, dtype=int), row=np.arange(1, 7), line=np.arange(2, 8))
    return row_mend(rows, readings - expected, np.full((6, 3), STD), row), row


@pytest.mark.parametrize("slip", ["readings exchanged", "sign", "decimal point", "whole turns"])
def test_a_slip_of_the_pen_is_told(slip: str) -> None:
    found = [told(seed, slip) for seed in range(40)]
    right = [mend is not None and mend.kind == slip for mend, _ in found]
    assert np.mean(right) >= 0.9
    if slip == "readings exchanged":
        assert all(f"row {(row + 1) % 6 + 1} (line {(row + 1) % 6 + 2})" in mend.what for mend, row in found if mend)


@pytest.mark.parametrize(("slip", "most"), [("one axis", 0.25), ("all axes", 0.0)])
def test_a_knock_is_hardly_ever_taken_for_one(slip: str, most: float) -> None:
    """Of an axis knocked by up to a millimetre a turn of a dial may happen to be as much; of three none is."""
    found = [told(seed, slip)[0] for seed in range(200)]
    assert np.mean([mend is not None for mend in found]) <= most


def test_what_is_told_comes_true_as_often_as_it_says() -> None:
    """Slips and knocks of one axis as often as it counts with: each of the four kinds, and none of them. Rather more often: of
    the four dials that are tried all turns here are of one."""
    said = [(mend.probability, mend.kind == slip) for slip in ("readings exchanged", "sign", "decimal point", "whole turns",
                                                              "one axis")
            for seed in range(200, 300) if (mend := told(seed, slip)[0])]
    probability, right = np.array(said).T
    assert probability.mean() - 0.03 < right.mean() < probability.mean() + 0.12


def test_an_axis_that_nobody_read_tells_nothing() -> None:
    readings = np.array([[2e-4, np.nan, -1e-4], [1e-4, np.nan, 3e-4]])
    off = np.array([[4e-4, np.nan, 0.0], [0.0, np.nan, 0.0]])
    rows = SimpleNamespace(deflection=readings, visit=np.zeros(2, dtype=int), row=np.array([1, 2]), line=np.array([2, 3]))
    mend = row_mend(rows, off, np.full((2, 3), STD), 0)
    assert mend is not None
    assert "dx" in mend.what


def test_readings_of_unlike_axes_were_not_exchanged() -> None:
    """By a gauge that stood elsewhere for one of the rows."""
    readings = np.array([[2e-4, np.nan, -1e-4], [1e-4, 3e-4, 3e-4]])
    off = np.array([[1e-4, np.nan, -4e-4], [-1e-4, 0.0, 4e-4]])
    rows = SimpleNamespace(deflection=readings, visit=np.zeros(2, dtype=int), row=np.array([1, 2]), line=np.array([2, 3]))
    assert row_mend(rows, off, np.full((2, 3), STD), 0) is None
    rows.deflection[0, 1], off[0, 1] = 3.2e-4, 2e-5
    rows.deflection[1, 1], off[1, 1] = 3e-4, -2e-5
    mend = row_mend(rows, off, np.full((2, 3), STD), 0)
    assert mend is not None
    assert mend.kind == "readings exchanged"


@pytest.mark.parametrize(("read_um", "expected_um", "fit", "of", "what"), [
    (-63.0, 63.0, 2, 4, "dx with the other sign would fit"), (630.0, 63.0, 2, 8, "dx a tenth as large would fit"),
    (6.3, 63.0, 2, 8, "dx ten times as large would fit"),
    (263.0, 63.0, 2, 72, "dx with 2 whole turns of 100 um less would fit"),
    (-237.0, 63.0, 1, 72, "dx with 3 whole turns of 100 um more would fit")])
def test_a_slip_is_as_likely_as_the_share_of_its_kind_that_explains_the_reading(
        read_um: float, expected_um: float, fit: int, of: int, what: str) -> None:
    """x alone was read, to 2 um. One sign, or a decimal point to either side, of an axis or of all; three turns of four dials
    to either side of each axis. Else x, or all, is off by about as much as it is, or y or z alone, which is none."""
    rows = SimpleNamespace(deflection=np.array([[1e-6 * read_um, np.nan, np.nan]]), visit=np.zeros(1, dtype=int),
                           row=np.array([1]), line=np.array([2]))
    off = read_um - expected_um
    mend = row_mend(rows, np.array([[1e-6 * off, np.nan, np.nan]]), np.array([[2e-6, np.nan, np.nan]]), 0)
    spread = np.hypot(2.0, off)
    none = 0.5 * np.exp(-0.5 * (off / spread) ** 2) * 2.0 / spread
    probability = 1 / of / (fit / of + none)
    assert (mend is not None) == (probability >= 0.25)
    if mend:
        assert (mend.what, mend.probability) == (what, pytest.approx(probability))


@pytest.mark.parametrize(("off_std", "fits"), [(3.2, True), (3.4, False)])
def test_a_slip_fits_whose_rest_chance_makes_in_one_of_a_thousand(off_std: float, fits: bool) -> None:
    """3.29 sigmas of one component."""
    rows = SimpleNamespace(deflection=np.array([[-4e-4 + off_std * 2e-6, np.nan, np.nan]]), visit=np.zeros(1, dtype=int),
                           row=np.array([1]), line=np.array([2]))
    off = np.array([[-8e-4 + off_std * 2e-6, np.nan, np.nan]])
    assert (row_mend(rows, off, np.array([[2e-6, np.nan, np.nan]]), 0) is not None) is fits

"""A log with time alone on a program of six cuts, whose clock, override and slips are known: where its samples are put, and how
well that is said to be known."""

from __future__ import annotations

import numpy as np
import pytest

from compensator.forces.alignment_regression import binned, plateau_share
from compensator.forces.time_alignment import TimeAlignment, align
from identification.common.arrays import Array
from tests.compensator.forces.test_laws_alignment_search import AIR, LASTING, TIME, log, program

SPEED, NOISE = 0.05, 4.0
# The middle of the air behind the fourth cut: the last two come so much later than planned; of the third the force is another.
LATE, LAG, ODD = 17.5, 0.15, (9.0, 13.0)


@pytest.fixture(scope="module")
def whole() -> tuple[TimeAlignment, Array, Array]:
    """The alignment, the times of its samples and their forces; the program starts at 4 s, at an override of 0.9."""
    samples = log(0.9, 4.0, 0.04, 1000, noise=NOISE)
    return align(program(), samples.time, samples.force), samples.time, samples.force


@pytest.fixture(scope="module")
def part() -> tuple[TimeAlignment, Array]:
    """Of a log at an override of 1.1 that begins 5 s behind the program's start and ends before its end."""
    time = 20.0 + 0.04 * (np.arange(500) + 0.5)
    planned = 1.1 * (time - 20.0) + 5.0
    late = np.where(planned > LATE + LAG, LAG, 0.0)
    move = np.clip(np.searchsorted(TIME, planned - late), 1, len(TIME) - 1)
    force = np.where(~AIR[move][:, None], 80.0 + 60.0 * program().direction[move], 0.0) + np.array([5.0, -3, 9])
    rng = np.random.default_rng(9)
    odd = (planned > ODD[0]) & (planned < ODD[1])
    force[odd] = rng.normal(0, 120, (int(odd.sum()), 3))
    return align(program(), time, force + rng.normal(0, NOISE, force.shape)), planned - late


def test_a_log_is_placed_by_its_clock_and_its_override(whole: tuple[TimeAlignment, Array, Array]) -> None:
    """To a fiftieth of a second, a millimetre of the way; what is before the program and behind it has no place."""
    found, time, force = whole
    assert found.believed
    assert found.start == pytest.approx(4.0, abs=0.02)
    assert found.override == pytest.approx(0.9, abs=1e-3)
    planned = 0.9 * (time - 4.0)
    inside = (planned > 0.02) & (planned < 27.98)
    np.testing.assert_allclose(found.length[inside], SPEED * planned[inside], atol=1e-3)
    assert np.isnan(found.length[(planned < -0.02) | (planned > 28.02)]).all()
    assert found.slip < 0.02
    assert (found.odd, found.leaps) == ((), ())
    assert found.covered == pytest.approx(1.0, abs=3e-3)
    # What is left is the noise, and a sharp edge that is taken for one of 4 mm.
    energy = np.sum((force - force.mean(axis=0)) ** 2)
    assert found.share == pytest.approx(1 - 3 * NOISE**2 * len(time) / energy, abs=6e-3)
    assert found.in_air == pytest.approx(np.sqrt(3) * NOISE / np.sqrt(np.mean(np.sum(
        (force[np.linalg.norm(force, axis=1) > 40] - [5, -3, 9]) ** 2, axis=1))), rel=0.1)
    # The best elsewhere is a stretch and more away on average.
    assert found.rival > 0.5 * np.median(LASTING)
    assert found.score > 100
    assert found.plateau == pytest.approx(plateau_share(binned(time, force, 39.96 / int(8 * 39.96 / (28 / 6)))))


def test_how_well_a_sample_is_placed_is_said(whole: tuple[TimeAlignment, Array, Array]) -> None:
    """Not better than a bin of 20 ms lets it be; as a place by the speed, 50 mm/s; on cuts, their middle."""
    found, time, _ = whole
    planned = 0.9 * (time - 4.0)
    inside = ~np.isnan(found.length)
    assert found.std.min() > 0.9 * 0.02 / np.sqrt(12)
    assert np.median(found.std) < 0.02
    np.testing.assert_allclose(found.spread[inside], SPEED * found.std[inside], rtol=1e-6)
    assert np.isnan(found.spread[~inside]).all()
    move = np.clip(np.searchsorted(TIME, planned), 1, len(TIME) - 1)
    assert found.spread_on_cuts == pytest.approx(np.median(found.spread[inside & ~AIR[move]]), rel=0.01)
    late = found.length[inside] / SPEED - planned[inside]
    assert np.sqrt(np.mean(late**2)) < 2 * np.sqrt(np.mean(found.std[inside] ** 2))


def test_stretches_that_come_late_and_one_that_is_another_are_told(part: tuple[TimeAlignment, Array]) -> None:
    """The samples of the odd one have no place, from half way through the air before it to half way behind it; the late ones
    lie where they are."""
    found, planned = part
    assert found.override == pytest.approx(1.1, abs=0.02)
    [(first, last)] = found.odd
    assert (first, last) == pytest.approx((8.0, 14.0))
    left_out = (planned > 8.3) & (planned < 13.7)
    assert np.isnan(found.length[left_out]).all()
    known = (planned < 7.7) | ((planned > 14.3) & (planned < 17.0)) | (planned > 18.6)
    np.testing.assert_allclose(found.length[known], SPEED * planned[known], atol=3e-3)
    assert found.leaps == ()
    assert 0.03 < found.slip < 0.2
    assert found.covered == pytest.approx((planned[-1] - planned[0]) / 28, abs=5e-3)

"""The autocorrelation time: that of a process for which it is known, by every rule for the end of the sum."""

import numpy as np
import pytest
from scipy.signal import lfilter

from identification.common.autocorrelation import FEWEST_BLOCKS, AutocorrelationTime, autocorrelation_time


def autoregression(phi: float, count: int, columns: int = 1, seed: int = 1) -> np.ndarray:
    """x_k = phi x_(k-1) + white noise (count, columns), stationary, about zero; its time is (1 + phi) / (1 - phi)."""
    rng = np.random.default_rng(seed)
    noise = rng.standard_normal((count, columns))
    series = lfilter([np.sqrt(1 - phi**2)], [1, -phi], noise, axis=0, zi=phi * rng.standard_normal((1, columns)))[0]
    return series - series.mean(axis=0)


@pytest.mark.parametrize("phi", [0.0, 0.5, 0.8, 0.9])
@pytest.mark.parametrize("floor", [None, 0.05, "noise"])
def test_the_time_of_an_autoregression(phi, floor):
    count = 20_000
    given = 2 / np.sqrt(count) if floor == "noise" else floor
    time = autocorrelation_time(autoregression(phi, count)[:, 0], given, None if floor is None else 200)
    assert time.values == pytest.approx((1 + phi) / (1 - phi), rel=0.2)
    assert (time.count, time.short) == (count, False)


def test_sokals_window_has_no_bias_on_average():
    times = [autocorrelation_time(autoregression(0.9, 3000, seed=seed)[:, 0]).values for seed in range(40)]
    assert np.mean(times) == pytest.approx(19, rel=0.12)


def test_columns_share_one_time_and_the_scale_does_not_matter():
    columns = autoregression(0.8, 5000, 3)
    time = autocorrelation_time(columns, 0.05).values
    assert time == pytest.approx(9, rel=0.2)
    assert autocorrelation_time(1e-6 * columns, 0.05).values == pytest.approx(time, rel=1e-6)
    alone = autocorrelation_time(columns[:, 0])
    assert autocorrelation_time(columns[:, :1]) == alone


@pytest.mark.parametrize("phi", [0.0, 0.9])
def test_a_series_that_is_too_short_for_its_memory_says_so(phi):
    for count in (1, FEWEST_BLOCKS - 1, 20, 2000):
        time = autocorrelation_time(autoregression(phi, count)[:, 0])
        assert time.short == (count < FEWEST_BLOCKS * time.block)
        assert time.short or count >= 20


def test_a_hundred_values_are_mostly_too_few_for_a_time_of_nineteen():
    times = [autocorrelation_time(autoregression(0.9, 100, seed=seed)[:, 0]) for seed in range(40)]
    assert np.mean([time.short for time in times]) > 0.9


def test_no_residual_at_all_has_the_time_of_independent_values():
    assert autocorrelation_time(np.zeros(100)).values == autocorrelation_time(np.zeros(100), 0.05).values == 1.0


@pytest.mark.parametrize("columns", [1, 3])
@pytest.mark.parametrize("count", [8, 9, 64, 301])
@pytest.mark.parametrize(("floor", "most"), [(None, None), (0.05, None), (0.2, 5), (-2.0, 4), (0.2, None)])
def test_the_time_is_one_and_twice_the_correlations_up_to_the_end_of_the_sum(columns, count, floor, most):
    """Of sums of products, lag by lag: up to the first lag of five times the sum so far or more, or up to before the first that
    is under the floor, of at most so many."""
    series = autoregression(0.7, count, columns)
    rho = [np.sum(series[lag:] * series[:count - lag]) / np.sum(series**2) for lag in range(count)]
    expected = 1.0
    for lag in range(1, count):
        if floor is not None and (rho[lag] < floor or (most is not None and lag > most)):
            break
        expected += 2 * rho[lag]
        if floor is None and lag >= 5 * expected:
            break
    if floor is None:
        expected = max(expected, 1.0)
    found = autocorrelation_time(series if columns > 1 else series[:, 0], floor, most)
    assert found.values == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(("time", "block"), [(1.0, 1), (1.19, 1), (1.21, 7), (2.0, 10), (2.01, 11)])
def test_a_block_is_five_times_long_and_a_series_eight_blocks(time, block):
    """But for what cannot be told from independent values."""
    assert AutocorrelationTime(time, 500).block == block
    assert [AutocorrelationTime(time, 8 * block + more).short for more in (-1, 0)] == [True, False]

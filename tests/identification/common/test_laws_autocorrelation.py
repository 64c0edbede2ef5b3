"""The autocorrelation time: that of a process for which it is known, by every rule for the end of the sum."""

import numpy as np
import pytest
from scipy.signal import lfilter

from identification.common.autocorrelation import FEWEST_BLOCKS, autocorrelation_time


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

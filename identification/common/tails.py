"""Tails and medians of the distributions that tests ask for, by SciPy's special functions: its `stats` alone takes longer to
import than a small fit."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

# The least probability that is told apart from none, as its log10.
LEAST_LOG10 = -300.0


def chi2_tail(value: ArrayLike, degrees: ArrayLike) -> NDArray[np.float64]:
    """Probability that chi-squared of so many degrees is above a value >= 0."""
    from scipy.special import chdtrc

    return np.asarray(chdtrc(_floats(degrees), _floats(value)))


def chi2_surprise(value: ArrayLike, degrees: ArrayLike) -> NDArray[np.float64]:
    """-log10 of that, at most 300."""
    return np.asarray(-np.log10(np.maximum(chi2_tail(value, degrees), 10.0**LEAST_LOG10)))


def chi2_above(probability: float, degrees: ArrayLike) -> NDArray[np.float64]:
    """The value that chi-squared of so many degrees exceeds with this probability."""
    from scipy.special import chdtri

    return np.asarray(chdtri(_floats(degrees), probability))


def f_tail(value: ArrayLike, numerator: ArrayLike, denominator: ArrayLike) -> NDArray[np.float64]:
    """Probability that F of so many degrees is above a value >= 0."""
    from scipy.special import fdtrc

    return np.asarray(fdtrc(_floats(numerator), _floats(denominator), _floats(value)))


def f_median(numerator: ArrayLike, denominator: ArrayLike) -> NDArray[np.float64]:
    """The median of F of so many degrees."""
    from scipy.special import fdtri

    return np.asarray(fdtri(_floats(numerator), _floats(denominator), 0.5))


def normal_above(probability: float) -> float:
    """How many standard deviations a normal value exceeds with this probability."""
    from scipy.special import ndtri

    return -float(ndtri(probability))


def _floats(values: ArrayLike) -> NDArray[np.float64]:
    return np.asarray(values, dtype=float)

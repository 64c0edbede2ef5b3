"""The noise as an autoregression AR(p), and the whitening that comes from it.

Samples of a log share their noise. A fit that takes them as independent states intervals several times too narrow; generalised
least squares whitens both sides with the autoregression of the residual first.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from identification.common.arrays import read_only

Array = NDArray[np.float64]
MOST_ORDER = 10
# Samples for each coefficient of the autoregression, at least.
SAMPLES_A_COEFFICIENT = 15
ROUNDS = 4
# Samples after which simulated noise has forgotten that it began at zero.
RUN_IN = 200
# Squares that a fit leaves, over those of least squares, from which on it has taken the signal for noise.
FAR_MORE = 4.0


@dataclass(frozen=True, eq=False)
class Autoregression:
    """e_t = sum_k phi_k e_(t-k) + white noise. phi (p,)."""

    phi: Array

    def whiten(self, columns: Array) -> Array:
        """Columns (n, p) without what the samples before say of them, (n - order, p)."""
        p = len(self.phi)
        result = columns[p:].copy()
        for k, weight in enumerate(self.phi, start=1):
            result -= weight * columns[p - k: len(columns) - k]
        return result

    def simulate(self, size: float, count: int, rng: np.random.Generator) -> Array:
        """Noise (count,) of this autoregression, the white part of standard deviation `size`."""
        white = size * rng.standard_normal(count + RUN_IN)
        # The recursion from zero, as a product of spectra.
        room = 2 * len(white)
        filtered = np.fft.irfft(np.fft.rfft(white, room) * np.fft.rfft(_response(self.phi, len(white)), room), room)
        return np.asarray(filtered[RUN_IN: len(white)])

    def worth(self, count: int) -> float:
        """How many independent samples `count` of them are worth for their mean."""
        return float(count * _variance_ratio(self.phi))


def _variance_ratio(phi: Array) -> float:
    """Variance of the noise over its spectrum at zero frequency."""
    return float(min(1.0, np.sum(_response(phi, 2048) ** 2) * (1 - phi.sum()) ** 2))


def _response(phi: Array, count: int) -> Array:
    """What a single white sample leaves in itself and those after it (count,)."""
    return _known_response(tuple(phi.tolist()), count)


@lru_cache(maxsize=64)
def _known_response(phi: tuple[float, ...], count: int) -> Array:
    backwards, values = phi[::-1], [0.0] * len(phi) + [1.0]
    for _ in range(count - 1):
        values.append(sum(w * v for w, v in zip(backwards, values[len(values) - len(phi):], strict=True)))
    response = np.array(values[len(phi):])
    read_only(response)
    return response


def fitted_autoregression(residuals: list[Array]) -> Autoregression:
    """The autoregression of one or more residuals (n,), its order by the Bayesian information criterion (Burg's method)."""
    shortest = min(map(len, residuals))
    most = max(1, min(MOST_ORDER, shortest // SAMPLES_A_COEFFICIENT))
    forward = [residual - residual.mean() for residual in residuals]
    backward = [errors.copy() for errors in forward]
    count = sum(map(len, residuals))
    power = sum(float(errors @ errors) for errors in forward) / count
    phi = np.zeros(0)
    best, least = phi, count * np.log(power + 1e-300)
    for order in range(1, most + 1):
        f, b = [errors[1:] for errors in forward], [errors[:-1] for errors in backward]
        below = sum(float(x @ x + y @ y) for x, y in zip(f, b, strict=True))
        if below <= 0:
            break
        k = 2 * sum(float(x @ y) for x, y in zip(f, b, strict=True)) / below
        phi = np.concatenate([phi - k * phi[::-1], [k]])
        power *= 1 - k**2
        forward = [x - k * y for x, y in zip(f, b, strict=True)]
        backward = [y - k * x for x, y in zip(f, b, strict=True)]
        value = count * np.log(power + 1e-300) + order * np.log(count)
        if value < least:
            best, least = phi, value
    return Autoregression(best)


def noise_beside(columns: list[Array], deflection: list[Array]) -> Autoregression:
    """The noise's autoregression where the model's columns (n, p) are fitted to the deflections (n,) of each record.

    A few waves are an autoregression as well as any noise: a fit that leaves far more than least squares do has taken the
    signal for noise, and is not followed.
    """
    noise, least = Autoregression(np.zeros(0)), np.inf
    for _ in range(ROUNDS):
        white_columns = np.concatenate([noise.whiten(part) for part in columns])
        white_deflection = np.concatenate([noise.whiten(part[:, None])[:, 0] for part in deflection])
        coefficients = np.linalg.lstsq(white_columns, white_deflection, rcond=1e-10)[0]
        left = [y - x @ coefficients for x, y in zip(columns, deflection, strict=True)]
        squares = sum(float(part @ part) for part in left)
        if squares > FAR_MORE * least:
            break
        least = min(least, squares)
        noise = fitted_autoregression(left)
    return noise

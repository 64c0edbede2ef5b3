"""The memory of the noise: an autoregression AR(p), and the whitening that comes from it.

Samples of a log share their noise. A fit that takes them as independent states intervals several times too narrow; generalised
least squares whitens both sides with the autoregression of the residual first.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
MOST_ORDER = 10
# Samples for each coefficient of the autoregression, at least.
SAMPLES_A_COEFFICIENT = 15
ROUNDS = 4


@dataclass(frozen=True, eq=False)
class Memory:
    """e_t = sum_k phi_k e_(t-k) + white noise. phi (p,)."""

    phi: Array

    def whiten(self, columns: Array) -> Array:
        """Columns (n, p) without what the samples before told of them, (n - order, p)."""
        p = len(self.phi)
        result = columns[p:].copy()
        for k, weight in enumerate(self.phi, start=1):
            result -= weight * columns[p - k: len(columns) - k]
        return result

    def simulate(self, size: float, count: int, rng: np.random.Generator) -> Array:
        """Noise (count,) with this memory, the white part of standard deviation `size`."""
        p, run_in = len(self.phi), 200
        noise = (size * rng.standard_normal(count + run_in)).tolist()
        weights = self.phi[::-1].tolist()
        values = [0.0] * p
        for value in noise:
            values.append(value + sum(w * v for w, v in zip(weights, values[len(values) - p:], strict=True)))
        return np.array(values[-count:])

    def worth(self, count: int) -> float:
        """How many independent samples `count` of them are worth for their mean."""
        return float(count * _variance_ratio(self.phi))


def _variance_ratio(phi: Array) -> float:
    """Variance of the noise over its spectrum at zero frequency."""
    response = np.zeros(2048)
    response[0] = 1.0
    for n in range(1, len(response)):
        reach = min(n, len(phi))
        response[n] = phi[:reach] @ response[n - reach: n][::-1]
    return float(min(1.0, np.sum(response**2) * (1 - phi.sum()) ** 2))


def autoregression(residuals: list[Array]) -> Memory:
    """The autoregression of one or more residuals (n,), its order by the Bayesian information criterion (Burg's method)."""
    shortest = min(len(one) for one in residuals)
    most = max(1, min(MOST_ORDER, shortest // SAMPLES_A_COEFFICIENT))
    ahead = [one - one.mean() for one in residuals]
    back = [one.copy() for one in ahead]
    count = sum(len(one) for one in residuals)
    power = sum(float(one @ one) for one in ahead) / count
    phi = np.zeros(0)
    best, least = phi, count * np.log(power + 1e-300)
    for order in range(1, most + 1):
        f, b = [one[1:] for one in ahead], [one[:-1] for one in back]
        below = sum(float(x @ x + y @ y) for x, y in zip(f, b, strict=True))
        if below <= 0:
            break
        k = 2 * sum(float(x @ y) for x, y in zip(f, b, strict=True)) / below
        phi = np.concatenate([phi - k * phi[::-1], [k]])
        power *= 1 - k**2
        ahead = [x - k * y for x, y in zip(f, b, strict=True)]
        back = [y - k * x for x, y in zip(f, b, strict=True)]
        value = count * np.log(power + 1e-300) + order * np.log(count)
        if value < least:
            best, least = phi, value
    return Memory(best)


def memory_of(columns: list[Array], deflection: list[Array]) -> Memory:
    """The noise's memory where the model's columns (n, p) are fitted to the deflections (n,) of each record."""
    memory = Memory(np.zeros(0))
    for _ in range(ROUNDS):
        wide = np.concatenate([memory.whiten(one) for one in columns])
        seen = np.concatenate([memory.whiten(one[:, None])[:, 0] for one in deflection])
        solved = np.linalg.lstsq(wide, seen, rcond=1e-10)[0]
        memory = autoregression([y - x @ solved for x, y in zip(columns, deflection, strict=True)])
    return memory

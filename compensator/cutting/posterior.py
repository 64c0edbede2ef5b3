"""Linear Gaussian posterior of force coefficients from the mean forces along a path, beside what else is not known of them.

    y_i = A_i K + c + B_i u + e_i,    K by its prior,  c ~ N(0, ZERO^2),  u ~ N(0, 1),  e_i ~ N(0, v_i)

c is the sensor's zero, B_i u what the force changes by where the stock stands aside by its standard deviation. Of the variance
v_i there are the scatter of the mean, a floor s0^2, a share rho of the force (the model's error) and the error of the place
where the force changes along the path. s0 and rho are found from the residuals. Neighbours remember each other: with tau the
integrated autocorrelation time of the residuals, n rows tell as much as n / tau. A row that stands out of the middling ones
counts less, the further the less (Cauchy): in a sharp corner of a heavy cut a tool that yields meets another force than the
model says, in up to a fifth of the rows, all to one side.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identification.common.arrays import Array, read_only
from identification.common.autocorrelation import autocorrelation_time

# 1 sigma of a sensor's zero after a tare [N], and of the place of a log's sample along the path [m]; engineering judgement.
ZERO, PLACE = 2.0, 0.2e-3
# Rows count half where they are off by so many times the scatter of the middling row; of z so much makes a memory.
HALF, CLIPPED, ROUNDS = 2.5, 2.5, 20
# sqrt(median) of the mean of three squared standard normal numbers.
MIDDLING = 0.888
# No force is known better [N], and no model of a cut is better than this share: run-out of the teeth alone changes a light cut
# by more than a heavy one. Engineering judgement.
LEAST, LEAST_MODEL = 0.2, 0.03


@dataclass(frozen=True, eq=False)
class ForceRows:
    """n places of a path in its order. weight A (n, 3, 6), force y (n, 3) [N], error (n, 3) [N]: 1 sigma of the mean by its
    scatter; aside B (n, 3, J) [N]; place (n,) [m] along the path. All in the base frame."""

    weight: Array
    force: Array
    error: Array
    aside: Array
    place: Array

    def slope(self, coefficients: Array) -> Array:
        """How steeply the force changes along the path (n, 3) [N/m], the steeper side."""
        force = self.weight @ coefficients
        steep = np.abs(np.diff(force, axis=0)) / np.maximum(np.diff(self.place), 1e-6)[:, None]
        nothing = np.zeros((1, 3))
        return np.asarray(np.maximum(np.concatenate([nothing, steep]), np.concatenate([steep, nothing])))


@dataclass(frozen=True, eq=False)
class ForcePosterior:
    """mean (6,) and covariance (6, 6) of the coefficients; zero (3,) [N]; aside (J,): of the stock, in standard deviations;
    model_error: rho; floor: s0 [N]; memory: tau, in rows; residual (n, 3) [N]; error (n, 3) [N]: 1 sigma of it; gain (6, n, 3):
    what the coefficients change by for each newton more in a row."""

    mean: Array
    covariance: Array
    zero: Array
    aside: Array
    model_error: float
    floor: float
    memory: float
    residual: Array
    error: Array
    gain: Array

    def __post_init__(self) -> None:
        read_only(self.mean, self.covariance, self.zero, self.aside, self.residual, self.error, self.gain)


def fit_coefficients(rows: ForceRows, prior_mean: Array, prior_covariance: Array) -> ForcePosterior:
    """Rounds of weighted least squares, with the sizes of the error anew in each."""
    count, more = len(rows.force), rows.aside.shape[2]
    design = np.concatenate([rows.weight, np.broadcast_to(np.eye(3), (count, 3, 3)), rows.aside], axis=2).reshape(3 * count, -1)
    scale = np.sqrt(np.diag(prior_covariance))
    before = np.zeros((9 + more, 9 + more))
    before[:6, :6] = np.linalg.inv(prior_covariance / np.outer(scale, scale))
    before[6:, 6:] = np.diag(np.concatenate([np.full(3, ZERO**-2), np.ones(more)]))
    unit = np.concatenate([scale, np.ones(3 + more)])
    start = np.concatenate([prior_mean, np.zeros(3 + more)])
    x, floor, model, memory = start.copy(), LEAST, 0.05, 1.0
    y = rows.force.reshape(-1)
    for turn in range(ROUNDS):
        size = np.linalg.norm(rows.weight @ x[:6], axis=1)
        residual = (y - design @ x).reshape(count, 3)
        known = rows.error**2 + (PLACE * rows.slope(x[:6])) ** 2
        if turn:
            floor, model = _sizes(residual, known, size)
        error = np.sqrt(known + floor**2 + (model * size)[:, None] ** 2 / 3)
        z = residual / error
        if turn > 1:
            memory = max(autocorrelation_time(np.clip(z, -CLIPPED, CLIPPED), floor=0.05).values, 1.0)
        square = np.mean(z**2, axis=1)
        middling = max(np.sqrt(np.median(square)) / MIDDLING, 1e-12)
        weight = ((1 / (1 + square / (HALF * middling) ** 2))[:, None] / error**2).reshape(-1) / memory
        scaled = design * unit
        information = (scaled * weight[:, None]).T @ scaled + before
        gain = unit[:, None] * np.linalg.solve(information, (scaled * weight[:, None]).T)
        x = start + gain @ (y - design @ start)
    covariance = np.linalg.inv(information)[:6, :6] * np.outer(scale, scale)
    residual = (y - design @ x).reshape(count, 3)
    return ForcePosterior(x[:6].copy(), covariance, x[6:9].copy(), x[9:].copy(), model, floor, memory,
                          residual, error, gain[:6].reshape(6, count, 3))


def _sizes(residual: Array, known: Array, size: Array) -> tuple[float, float]:
    """Floor [N] and the model's error, a share, from residuals (n, 3) [N] whose known part is known (n, 3) [N^2]: least squares
    in the squares, each weighed by its own size, gross ones cut off."""
    from scipy.optimize import nnls

    square = np.mean(residual**2, axis=1)
    beyond = np.minimum(square, 9 * np.median(square)) - known.mean(axis=1)
    columns = np.column_stack([np.ones(len(size)), size**2 / 3])
    weight = 1 / np.maximum(known.mean(axis=1) + 0.25 * np.median(square) + 1e-12, 1e-12)
    floor, share = nnls(columns * weight[:, None], np.maximum(beyond, -1e9) * weight)[0]
    return float(np.sqrt(max(floor, LEAST**2))), float(np.sqrt(max(share, LEAST_MODEL**2)))

"""How each stretch of a program slips against the log's clock: a random walk from stretch to stretch, as far as the samples of
each stretch say so."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from compensator.forces.alignment_regression import Regression
from compensator.forces.program_time import ProgramTime
from identification.common.arrays import Array
from identification.common.autocorrelation import autocorrelation_time

# The slip of a stretch against the straight line: at most REACH periods, WALK periods (1 sigma) from stretch to stretch, on so
# many states; stretches are cut into pieces of at most LONGEST [s].
REACH, WALK, STATES, LONGEST, ROUNDS = 0.4, 0.03, 61, 10.0, 3
# Where the slips lie in so small a part of their reach they are looked for in that alone, down to steps of this [s].
NARROWER, FINEST = 4, 5e-3
# A stretch is odd whose residual is more than this share of the energy of its force and of what the program predicts.
ODD = 0.5


@dataclass(frozen=True, eq=False)
class Slips:
    """An alignment whose stretches slip: slip (n,) [s] of each fine bin and its 1 sigma (n,), planned (n,) [s] with it. value:
    minus the log likelihood over `independent`, the number of independent values of the residual. share: of the force's
    variance that is explained. odd: stretches, from and to which planned time [s], whose force does not follow the program."""

    slip: Array
    std: Array
    planned: Array
    value: float
    independent: float
    share: float
    odd: tuple[tuple[float, float], ...]


def stretch_slips(regression: Regression, x: Array) -> Slips:
    """The slips about the alignment x: the states of the walk weighed by the residual of each stretch alone (forward and
    backward), the regression with the slips in turn."""
    return _slips_within(regression, x, REACH * regression.program.period)


def fine_slips(regression: Regression, x: Array, slips: Slips) -> Slips:
    """The same, which `slips` are, with states as fine as they are known."""
    reach = REACH * regression.program.period
    while 2 * reach / STATES > FINEST and np.max(np.abs(slips.slip) + 4 * slips.std, initial=0.0) < reach / NARROWER:
        reach /= NARROWER
        slips = _slips_within(regression, x, reach)
    return slips


def _slips_within(regression: Regression, x: Array, reach: float) -> Slips:
    """The slips of at most `reach` [s]."""
    period, borders = regression.program.period, stretch_borders(regression.program)
    states = np.linspace(-reach, reach, STATES)
    step = -0.5 * ((states[:, None] - states) / (WALK * period)) ** 2
    start = -0.5 * (states / (0.5 * REACH * period)) ** 2
    planned = regression.planned(x)
    slip, std = np.zeros(len(planned)), np.zeros(len(planned))
    number = np.searchsorted(borders, planned, side="right") - 1
    inside = (number >= 0) & (number < len(borders) - 1)
    middles = 0.5 * (borders[1:] + borders[:-1])

    def energies(force: Array) -> Array:
        """Energy (k,) of a force (n, 3) over each stretch."""
        return np.asarray(np.bincount(number[inside], np.sum(force**2, axis=1)[inside], minlength=len(middles)))

    seen = [regression.seen(x, state) for state in states]
    for _ in range(ROUNDS):
        fit = regression.fit(x, slip)
        noise = np.sum(fit.residual**2) / independent_values(fit.residual)
        errors = np.array([energies(regression.left(each, fit.coefficients)) for each in seen])
        mean, spread = _smoothed(-0.5 * errors.T / noise, step, start, states)
        slip, std = np.interp(planned, middles, mean), np.interp(planned, middles, spread)
    fit = regression.fit(x, slip)
    independent = independent_values(fit.residual)
    left = float(np.sum(fit.residual**2)) / regression.energy
    penalty = 0.5 * float(np.sum((np.diff(mean) / (WALK * period)) ** 2))
    force = regression.force - fit.coefficients[0]
    energy = energies(force) + energies(force - fit.residual)
    odd = np.flatnonzero((energies(fit.residual) > ODD * energy) & (energy > 0.1 * np.median(energy)))
    return Slips(slip, std, planned + slip, 0.5 * float(np.log(left)) + penalty / independent, independent, 1 - left,
                 tuple((float(borders[k]), float(borders[k + 1])) for k in odd))


def stretch_borders(program: ProgramTime) -> Array:
    """Planned times [s] half way through the air between stretches: what lies between two of them slips together."""
    time = program.time
    between = [0.5 * (time[b] + time[a]) for (_, b), (a, _) in pairwise(program.stretches)]
    # A program of one long stretch slips piece by piece all the same.
    pieces = [np.linspace(low, high, 1 + max(int((high - low) / LONGEST), 1))[:-1] for low, high in zip(
        [time[0], *between], [*between, time[-1]], strict=True)]
    return np.append(np.concatenate(pieces), time[-1])


def independent_values(residual: Array) -> float:
    """How many independent values the residual (n, 3) has: its bins over its autocorrelation time."""
    return len(residual) / autocorrelation_time(residual, 0.05).values


def _smoothed(likelihood: Array, step: Array, start: Array, states: Array) -> tuple[Array, Array]:
    """Posterior mean and std (k,) of a walk over states (m,) with log likelihoods (k, m), log steps (m, m), log start (m,)."""
    count = len(likelihood)
    ahead, behind = np.zeros_like(likelihood), np.zeros_like(likelihood)
    ahead[0] = start + likelihood[0]
    for k in range(1, count):
        ahead[k] = likelihood[k] + _log_sum(ahead[k - 1][:, None] + step)
    for k in range(count - 2, -1, -1):
        behind[k] = _log_sum((likelihood[k + 1] + behind[k + 1])[:, None] + step)
    total = ahead + behind
    weight = np.exp(total - total.max(axis=1, keepdims=True))
    weight /= weight.sum(axis=1, keepdims=True)
    mean = weight @ states
    variance = np.einsum("km,km->k", weight, (states - mean[:, None]) ** 2) + (states[1] - states[0]) ** 2 / 12
    return np.asarray(mean), np.sqrt(variance)


def _log_sum(values: Array) -> Array:
    """ln of the sum of exp over the first axis."""
    largest = values.max(axis=0)
    return np.asarray(largest + np.log(np.sum(np.exp(values - largest), axis=0)))

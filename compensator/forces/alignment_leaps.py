"""Where the program stood still for longer than stretches slip: a leap of the log against the program between two stretches.

The slips of alignment_slips.py are a walk of small steps; a stop of seconds is spread over many of them and takes the
override with it. Here the likeliest path of slips is looked for (Viterbi) in which a step costs as in that walk, or, however
large, LEAP.
"""

from __future__ import annotations

import numpy as np

from compensator.forces.alignment_regression import Regression
from compensator.forces.alignment_slips import WALK, independent_values, stretch_borders
from identification.common.arrays import Array

# A leap costs so much log likelihood, as much as an alignment must have over another one; less than LARGE steps of the walk
# (1 sigma) is none. Slips are looked for up to REACH periods, and LONGEST [s], on so many states. Right logs show no leap,
# stops of 2 s and more do (benchmarks/time_placement.py).
LEAP, LARGE, REACH, LONGEST, STATES, ROUNDS = 15.0, 4.0, 2.5, 8.0, 161, 2


def leaps(regression: Regression, x: Array, slip: Array) -> tuple[tuple[float, float], ...]:
    """Planned time [s] and size [s] of each leap about the alignment x with slips (n,) [s]; negative: it stood still."""
    period, borders = regression.program.period, stretch_borders(regression.program)
    planned = regression.planned(x)
    number = np.searchsorted(borders, planned, side="right") - 1
    inside = (number >= 0) & (number < len(borders) - 1)
    if not inside.any():
        return ()
    middles = 0.5 * (borders[1:] + borders[:-1])
    reach = max(REACH * period, LONGEST)
    states = np.linspace(-reach, reach, STATES)
    step = np.minimum(0.5 * ((states[:, None] - states) / (WALK * period)) ** 2, LEAP)
    seen = [regression.seen(x, state) for state in states]
    for _ in range(ROUNDS):
        fit = regression.fit(x, slip)
        noise = np.sum(fit.residual**2) / independent_values(fit.residual)
        cost = np.column_stack([
            np.bincount(number[inside], np.sum(regression.left(each, fit.coefficients) ** 2, axis=1)[inside],
                        minlength=len(middles)) for each in seen]) * 0.5 / noise
        path = states[_likeliest(cost, step)]
        slip = np.interp(planned, middles, path)
    size = np.diff(path)
    return tuple((float(borders[k + 1]), float(size[k])) for k in np.flatnonzero(np.abs(size) > LARGE * WALK * period))


def _likeliest(cost: Array, step: Array) -> Array:
    """State (k,) of each stretch on the path of least cost (k, m), with the cost (m, m) of a step."""
    total, before = cost[0], []
    for here in cost[1:]:
        all_ways = total[:, None] + step
        before.append(all_ways.argmin(axis=0))
        total = all_ways.min(axis=0) + here
    path = [int(total.argmin())]
    for came_from in reversed(before):
        path.append(int(came_from[path[-1]]))
    return np.array(path[::-1])

"""Where a log with time alone may lie in the program: every start on a coarse grid by FFT, for every override."""

from __future__ import annotations

import numpy as np

from compensator.forces.alignment_regression import Bins
from compensator.forces.program_time import ProgramTime
from identification.common.arrays import Array

# Feed overrides looked for.
SLOWEST, FASTEST = 0.4, 1.5
# How many best places are kept.
CANDIDATES = 5
# The columns of the engagement, two and two.
PAIRS = [(i, j) for i in range(4) for j in range(i, 4)]


def candidates(program: ProgramTime, bins: Bins) -> list[tuple[float, float]]:
    """Start [s] and override of the alignments that explain most, each a stretch away from those before it."""
    n, width = len(bins.time), bins.width
    step = width / max(program.duration, n * width)
    scored: list[tuple[float, float, float]] = []
    for override in np.exp(np.arange(np.log(SLOWEST), np.log(FASTEST), step)):
        share = _explained(program, bins, override)
        lag = np.arange(len(share))
        lag[lag > n] -= len(share)      # the bin of the log at which the program starts
        for index in np.argsort(share)[::-1][:CANDIDATES * 3]:
            scored.append((float(share[index]), float(bins.time[0] + (lag[index] - 0.5) * width), float(override)))
    scored.sort(reverse=True)
    kept: list[tuple[float, float]] = []
    ends = np.array([bins.time[0], bins.time[-1]])
    for _, start, override in scored:
        here = override * (ends - start)
        if all(np.mean(np.abs(here - other_override * (ends - other))) > 0.5 * program.typical_stretch
               for other, other_override in kept):
            kept.append((start, override))
            if len(kept) == CANDIDATES:
                break
    return kept


def promise(program: ProgramTime, bins: Bins) -> float:
    """The largest share of the force's variance that the program explains anywhere, stretches and leads as planned: what a
    quick look tells of it."""
    step = bins.width / max(program.duration, len(bins.time) * bins.width)
    return max(float(_explained(program, bins, override).max())
               for override in np.exp(np.arange(np.log(SLOWEST), np.log(FASTEST), step)))


def _explained(program: ProgramTime, bins: Bins, override: float) -> Array:
    """Share of the force's variance that the program explains when it starts at each bin, cyclically (size,)."""
    from scipy.fft import irfft, next_fast_len, rfft

    count, energy = bins.weight.sum(), float(np.sum(bins.centred**2))
    moves = int(np.ceil(program.duration / override / bins.width)) + 1
    size = next_fast_len(len(bins.time) + moves, real=True)
    planned = program.time[0] + override * bins.width * (np.arange(moves) + 0.5)
    engagement, _ = program.engagement(planned, 0.0, 0.0)
    products = np.column_stack([engagement, *(engagement[:, i] * engagement[:, j] for i, j in PAIRS)])
    of_program = np.conj(rfft(products, size, axis=0))
    of_log = rfft(np.column_stack([bins.weight, bins.centred]), size, axis=0)
    sums = irfft(of_program * of_log[:, :1], size, axis=0)
    cross = irfft(of_program[:, :4, None] * of_log[:, None, 1:], size, axis=0)
    gram = np.empty((size, 4, 4))
    for k, (i, j) in enumerate(PAIRS):
        gram[:, i, j] = gram[:, j, i] = sums[:, 4 + k] - sums[:, i] * sums[:, j] / count
    ridge = 1e-3 * np.trace(gram, axis1=1, axis2=2) + 1e-9 * count
    gram += ridge[:, None, None] * np.eye(4)
    return np.asarray(np.einsum("nic,nic->n", cross, np.linalg.solve(gram, cross)) / energy)

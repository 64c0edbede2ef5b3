"""Where on the path the samples of a force log were taken when the log has nothing but time.

The log's clock starts anywhere, and the feed override scales the program's time: planned time = override * (t - start). Both
are estimated from what the program says of the force, without a model of the engagement (alignment_regression.py): for every
start and override that is a linear regression. All are tried on a coarse grid (alignment_search.py), the best ones refined with
the lead lengths. Then each stretch of the program may slip a little against the clock (alignment_slips.py). Passes of a raster
resemble each other, so the answer is believed only if it beats the best alignment elsewhere by far: the score is the difference
of their log likelihoods.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from compensator.forces.alignment_regression import Regression, binned
from compensator.forces.alignment_search import candidates
from compensator.forces.alignment_slips import Slips, stretch_slips
from compensator.forces.program_time import ProgramTime
from identification.common.arrays import Array, read_only

# Bins of the coarse and of the fine search, at most.
COARSE, FINE = 1000, 3000
# The smallest score, and share of the force's variance explained, that are believed (docs/benchmarks.md: logs of the right
# program score 26 and more, others 5 at most). Where the program stood still for longer than stretches may slip, several are
# odd.
LOWEST_SCORE, LOWEST_SHARE, MOST_ODD = 15.0, 0.5, 1


@dataclass(frozen=True, eq=False)
class TimeAlignment:
    """Arc length (M,) [m] of each sample, NaN before the start and after the end of the program.

    start [s]: the log's clock at the program's start; override: actual over planned speed; slip [s]: the largest departure from
    these two. score: log likelihood over that of the best other alignment; share: of the force's variance that is explained;
    rival [s]: how far, in planned time, the best other alignment is. odd: stretches, from and to which planned time [s], whose
    force does not follow the program. std (M,) [s]: 1 sigma of a sample's planned time.
    """

    length: Array
    start: float
    override: float
    slip: float
    score: float
    share: float
    rival: float
    odd: tuple[tuple[float, float], ...]
    std: Array

    def __post_init__(self) -> None:
        read_only(self.length, self.std)

    @property
    def believed(self) -> bool:
        """The score and the share are high enough, and no more than one stretch is odd."""
        return self.score >= LOWEST_SCORE and self.share >= LOWEST_SHARE and len(self.odd) <= MOST_ODD


def align(program: ProgramTime, time: Array, force: Array) -> TimeAlignment:
    """Places samples at times (M,) [s], ascending, with force (M, 3) [N]."""
    span = float(time[-1] - time[0])
    coarse = int(np.clip(8 * span / max(program.period, 1e-3), 64, COARSE))
    middle = 0.5 * float(time[0] + time[-1])
    regression = Regression(program, binned(time, force, max(span / FINE, 0.02)), middle)
    refined = [_refined(regression, np.array([override * (middle - start), np.log(override), 0.0, 0.0]))
               for start, override in candidates(program, binned(time, force, span / coarse))]
    values = np.array([slips.value for _, slips in refined])
    likeliest = int(np.argmin(values))
    x, slips = refined[likeliest]
    # An alignment is another one if it puts the samples elsewhere by more than half a stretch on average.
    apart = np.array([float(np.mean(np.abs(other.planned - slips.planned))) for _, other in refined])
    others = np.flatnonzero(apart > 0.5 * program.typical_stretch)
    score = rival = np.inf
    if len(others):
        second = int(others[np.argmin(values[others])])
        score, rival = slips.independent * float(values[second] - values[likeliest]), float(apart[second])
    override = float(np.exp(x[1]))
    away = override * (time - middle)
    planned = x[0] + away + np.interp(time, regression.time, slips.slip)
    inside = (planned >= program.time[0]) & (planned <= program.time[-1])
    covariance = regression.covariance(x, slips.slip, slips.independent)
    variance = covariance[0, 0] + 2 * away * covariance[0, 1] + away**2 * covariance[1, 1]
    std = np.sqrt(np.maximum(variance, 0.0) + np.interp(time, regression.time, slips.std) ** 2)
    return TimeAlignment(
        np.where(inside, np.interp(planned, program.time, program.length), np.nan), middle - float(x[0]) / override, override,
        float(np.max(np.abs(slips.slip), initial=0.0)), score, slips.share, rival, slips.odd, np.asarray(std))


def _refined(regression: Regression, x: Array) -> tuple[Array, Slips]:
    """The likeliest alignment near x, and its slips."""
    x = regression.refine(x)
    # With the stretches in their places the leads show, and with the leads the places.
    x = regression.refine(x, stretch_slips(regression, x).slip)
    return x, stretch_slips(regression, x)

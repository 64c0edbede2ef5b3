"""Where on the path the samples of a force log were taken when the log has nothing but time.

The log's clock starts anywhere, and the feed override scales the program's time: planned time = override * (t - start). Both
are estimated from what the program says of the force, without a model of the engagement (alignment_regression.py): for every
start and override that is a linear regression. All are tried on a coarse grid (alignment_search.py), the best ones refined with
the lead lengths. Then each stretch of the program may slip a little against the clock (alignment_slips.py). Passes of a raster
resemble each other, so the answer is believed only if it beats the best alignment elsewhere by far: the score is the difference
of their log likelihoods. Without another alignment to beat nothing was shown. Nor was it by a force that is merely there while
the program runs, as in the log of any job: the program must tell of its changes what no single plateau of force tells.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from compensator.forces.alignment_leaps import leaps
from compensator.forces.alignment_regression import Regression, binned, plateau_share
from compensator.forces.alignment_search import FASTEST, SLOWEST, candidates
from compensator.forces.alignment_slips import Slips, fine_slips, stretch_slips
from compensator.forces.program_time import ProgramTime
from identification.common.arrays import Array, read_only

# Bins of the coarse search at most, and of the fine one: so many, more where a program has so many stretches that as many bins
# each are more, which its leads and the air between them are seen by; and never more than the last, so that memory is bounded.
COARSE, FINE, BINS_A_STRETCH, FINEST = 1000, 3000, 12, 40_000
# The smallest score, and share of the force's variance explained, that are believed (docs/benchmarks/forces.md: logs of the
# right program score 26 and more, others 5 at most). Where the program stood still for longer than stretches may slip, several
# are odd.
LOWEST_SCORE, LOWEST_SHARE, MOST_ODD = 15.0, 0.5, 1
# Of what a single plateau of force leaves unexplained the program explains at least this share. On the program's air moves the
# force (RMS) is at most this share of that on its cuts, and 1 sigma of the place on its cuts at most this [m], a tool's radius:
# over more, entries and corners are not told from what lies between them (engineering judgement; right logs have 0.8, 0.1 and
# 5 mm or better, docs/benchmarks/forces.md).
BEYOND_PLATEAU, MOST_IN_AIR, MOST_SPREAD = 0.5, 0.25, 10e-3
# How much a robot speeds up and brakes no data sheet says: shares of the time that the program's timing takes for it, which are
# looked at beside that, and how unlikely one may be that still counts as possible.
SLOWINGS, POSSIBLE = (0.0, 0.25, 0.5, 0.75, 1.5, 2.0), 0.01
# A log that begins and ends inside the program has less to tell it from others: it must be of this share of it. All three logs
# of other rasters that were placed once were of less than half (benchmarks/foreign_logs.py, seed 41).
LEAST_COVERED = 0.55


@dataclass(frozen=True, eq=False)
class TimeAlignment:
    """Arc length (M,) [m] of each sample, NaN before the start and after the end of the program, and on odd stretches.

    start [s]: the log's clock at the program's start; override: actual over planned speed; slip [s]: the largest departure from
    these two. score: log likelihood over that of the best other alignment; share: of the force's variance that is explained;
    rival [s]: how far, in planned time, the best other alignment is; both infinite where there is none. odd: stretches, from
    and to which planned time [s], whose force does not follow the program. plateau: share of the force's variance that the best
    single plateau explains, which knows nothing of the program. in_air: RMS force on the program's air moves over that on its
    cuts, NaN where the log has none of either. std (M,) [s]: 1 sigma of a sample's planned time; spread (M,) [m]: of its place,
    NaN outside; spread_on_cuts [m]: its median on moves that cut. leaps: where, in planned time [s], the log leaps against the
    program, and by how much [s] of it. covered: share of the program's time from the first sample on it to the last.
    """

    length: Array
    start: float
    override: float
    slip: float
    score: float
    share: float
    rival: float
    odd: tuple[tuple[float, float], ...]
    plateau: float
    in_air: float
    std: Array
    spread: Array
    spread_on_cuts: float
    leaps: tuple[tuple[float, float], ...] = ()
    covered: float = 1.0

    def __post_init__(self) -> None:
        read_only(self.length, self.std, self.spread)

    @property
    def beyond_plateau(self) -> float:
        """Share that the program explains of what a single plateau of force leaves."""
        return 1 - (1 - self.share) / max(1 - self.plateau, 1e-9)

    @property
    def believed(self) -> bool:
        """Nothing speaks against it."""
        return not self.against

    @property
    def against(self) -> tuple[str, ...]:
        """What speaks against it, for people; what there is of odd stretches is the last."""
        reasons = []
        if self.share < LOWEST_SHARE:
            reasons.append(f"{100 * self.share:.0f} % of the force follows the program, at least "
                           f"{100 * LOWEST_SHARE:.0f} % must")
        elif self.beyond_plateau < BEYOND_PLATEAU:
            reasons.append(f"the force follows the program hardly better ({100 * self.share:.0f} %) than a single stretch of "
                           f"steady force does ({100 * self.plateau:.0f} %), as in the log of any job")
        if np.isinf(self.score):
            reasons.append("there is no other place to compare with, so nothing shows that this one is right")
        elif self.score < LOWEST_SCORE:
            reasons.append(f"its score is {self.score:.1f} against the best other place {self.rival:.1f} s away, at least "
                           f"{LOWEST_SCORE:g} is needed")
        if not SLOWEST <= self.override <= FASTEST:
            reasons.append(f"the override would be {100 * self.override:.0f} %, looked for are {100 * SLOWEST:.0f} to "
                           f"{100 * FASTEST:.0f} %")
        if self.in_air > MOST_IN_AIR:
            reasons.append(f"the force on air moves would be {100 * self.in_air:.0f} % of that on cuts, at most "
                           f"{100 * MOST_IN_AIR:.0f} % may be")
        if self.spread_on_cuts > MOST_SPREAD:
            reasons.append(f"1 sigma of the place would be {1e3 * self.spread_on_cuts:.0f} mm, at most "
                           f"{1e3 * MOST_SPREAD:.0f} mm may be")
        if self.covered < LEAST_COVERED:
            reasons.append(f"it would be {100 * self.covered:.0f} % of the program alone, at least {100 * LEAST_COVERED:.0f} % "
                           "are needed")
        if self.leaps:
            shown = ", ".join(f"{abs(size):.1f} s {'lost' if size < 0 else 'gained'} at {at:.0f} s of the program"
                              for at, size in self.leaps[:3])
            reasons.append(f"the log does not keep pace with the program, as where it stood still: {shown}")
        if len(self.odd) > MOST_ODD:
            reasons.append(f"in {len(self.odd)} stretches the force does not follow the program, at most {MOST_ODD} may be so")
        return tuple(reasons)


def align(program: ProgramTime, time: Array, force: Array) -> TimeAlignment:
    """Places samples at times (M,) [s], ascending, with force (M, 3) [N]."""
    span = float(time[-1] - time[0])
    coarse = int(np.clip(8 * span / max(program.period, 1e-3), 64, COARSE))
    middle = 0.5 * float(time[0] + time[-1])
    fine = min(max(FINE, BINS_A_STRETCH * span / max(program.period, 1e-3)), FINEST)
    regression = Regression(program, binned(time, force, max(span / fine, 0.02)), middle)
    refined = [_refined(regression, np.array([override * (middle - start), np.log(override), 0.0, 0.0]))
               for start, override in candidates(program, binned(time, force, span / coarse))]
    values = np.array([slips.value for _, slips in refined])
    likeliest = int(np.argmin(values))
    slips = refined[likeliest][1]
    # An alignment is another one if it puts the samples elsewhere by more than half a stretch on average.
    apart = np.array([float(np.mean(np.abs(other.planned - slips.planned))) for _, other in refined])
    others = np.flatnonzero(apart > 0.5 * program.typical_stretch)
    score = rival = np.inf
    if len(others):
        second = int(others[np.argmin(values[others])])
        score, rival = slips.independent * float(values[second] - values[likeliest]), float(apart[second])
    regression, x, slips, others_of_speed = _by_slowing(regression, refined[likeliest][0])
    program, override = regression.program, float(np.exp(x[1]))
    away = override * (time - middle)
    planned = x[0] + away + np.interp(time, regression.time, slips.slip)
    inside = (planned >= program.time[0]) & (planned <= program.time[-1])
    for first, last in slips.odd:
        inside &= (planned < first) | (planned >= last)
    covariance = regression.covariance(x, slips.slip, slips.independent)
    variance = covariance[0, 0] + 2 * away * covariance[0, 1] + away**2 * covariance[1, 1]
    # A bin is not seen into.
    variance = (np.maximum(variance, 0.0) + np.interp(time, regression.time, slips.std) ** 2
                + (override * regression.bins.width) ** 2 / 12)
    place = np.interp(planned, program.time, program.length)
    move = np.clip(np.searchsorted(program.time, planned), 1, len(program.time) - 1)
    beside = sum((weight * (other - place) ** 2 for weight, other in _places(others_of_speed, time, middle)),
                 np.zeros(len(place)))
    spread = np.where(inside, np.sqrt(variance * program.speed[move] ** 2 + beside), np.nan)
    std = np.sqrt(variance + beside / np.maximum(program.speed[move], 1e-6) ** 2)
    on_cuts = spread[inside & ~program.air[move]]
    return TimeAlignment(
        np.where(inside, place, np.nan), middle - float(x[0]) / override, override,
        float(np.max(np.abs(slips.slip), initial=0.0)), score, slips.share, rival, slips.odd,
        plateau_share(binned(time, force, span / coarse)), regression.force_in_air(x, slips.slip), np.asarray(std),
        np.asarray(spread), float(np.median(on_cuts)) if len(on_cuts) else np.inf, leaps(regression, x, slips.slip),
        float(np.ptp(planned[inside])) / program.duration if inside.any() else 0.0)


Alternative = tuple[float, Regression, Array, Slips]


def _by_slowing(regression: Regression, x: Array) -> tuple[Regression, Array, Slips, list[Alternative]]:
    """The alignment near x of the share of the time for speeding up and braking that is the likeliest, and the others that are
    possible, each with its probability against that."""
    found = [(regression, *_finely(regression, x))]
    program = regression.program
    for share in SLOWINGS if program.slowed is not None and program.slowed[-1] > 0 else ():
        other = program.with_slowing(share)
        start = x.copy()
        start[0] = np.interp(x[0], program.time, other.time)
        start[1] += np.log(other.duration / program.duration)
        there = Regression(other, regression.bins, regression.middle)
        found.append((there, *_finely(there, start)))
    best = min(found, key=lambda one: one[2].value)
    likely = [float(np.exp(-best[2].independent * (one[2].value - best[2].value))) for one in found]
    return (*best, [(weight / sum(likely), *one) for weight, one in zip(likely, found, strict=True)
                    if one is not best and weight > POSSIBLE])


def _finely(regression: Regression, x: Array) -> tuple[Array, Slips]:
    x, slips = _refined(regression, x)
    return x, fine_slips(regression, x, slips)


def _places(found: list[Alternative], time: Array, middle: float) -> Iterator[tuple[float, Array]]:
    """The probability of each alignment and where (M,) [m] it puts samples at these times (M,) [s]."""
    for weight, regression, x, slips in found:
        planned = x[0] + np.exp(x[1]) * (time - middle) + np.interp(time, regression.time, slips.slip)
        yield weight, np.interp(planned, regression.program.time, regression.program.length)


def _refined(regression: Regression, x: Array) -> tuple[Array, Slips]:
    """The likeliest alignment near x, and its slips."""
    x = regression.refine(x)
    # With the stretches in their places the leads show, and with the leads the places.
    x = regression.refine(x, stretch_slips(regression, x).slip)
    return x, stretch_slips(regression, x)

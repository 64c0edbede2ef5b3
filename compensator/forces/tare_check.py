"""Whether the targets that --tare names are in air, judged by the whole log.

Where the program has moves at an air feed they tell: all of them but the tare. Where it has next to none there are witnesses
that are in air as a rule - samples before and after the program, its first and its last target, the bias that the cell
states - and two signs: air is calmer than a cut, and the bulk of a program's targets is far from air but not from a point
inside a cut. The tare is held against the largest group of witnesses that contradict it; it must have more for it than they
have.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from compensator.forces.target_rows import TargetRows
from identification.common.arrays import Array
from identification.common.findings import Finding, counted

Range = tuple[int, int]
# A target of --tare is not in air where its mean is off the others' by this share of the largest force, by this force [N], and
# by so many standard errors.
IN_AIR, LEAST_FORCE, SURELY = 0.2, 5.0, 8.0
# It is not in air either where not even a quarter of the other moves at the air feed, at least so many, lie within the largest
# of LEAST_FORCE, OF_AIR times their own middle distance from their middle, and three standard errors of it. Drift, the inertia
# of what hangs on the sensor and a weight that turns spread the air moves by as much as they keep them from the tare: a steady
# drift takes a tare at the start to 1.0 of that distance (engineering judgement for the rest). Where the tare is quieter than
# the air moves by more than QUIETER it is they that cut.
QUARTER, FEWEST_AIR, OF_AIR, QUIETER = 0.25, 3, 3.0, 2.0
# A witness agrees with a tare within LEAST_FORCE and this share of the largest force; the bulk of the targets is farther from
# air by this factor. A tare whose samples scatter by more than RESTLESS of the largest force, by more than twice LEAST_FORCE
# and by half of what the others do, is as restless as a cut (benchmarks/tares.py has what these lead to).
AGREES, FARTHER, RESTLESS, BULK = 0.1, 2.0, 0.15, 0.7
# The first and the last so many targets are a program's ends; fewer rows than this witness nothing.
END, FEWEST_ROWS = 1, 3


@dataclass(frozen=True, eq=False)
class TaredLog:
    """The rows of a log on their targets. force (m, 3) [N] without the payload's weight; air (N,): moves at the air feed;
    before, after (k, 3) [N]: rows before and after the program; stated (3,) [N] or None: the cell's bias."""

    source: str
    force: Array
    rows: TargetRows
    air: NDArray[np.bool_]
    before: Array
    after: Array
    stated: Array | None

    def mean(self) -> Array:
        """Mean force (N, 3) [N] of each target."""
        return self.rows.mean(self.force)

    def scatter(self, mean: Array) -> Array:
        """Mean square scatter (N,) [N^2] about it."""
        off = ((self.force - mean[self.rows.target]) ** 2).sum(axis=1)
        return self.rows.sum(off) / np.maximum(self.rows.samples, 1)


def doubts(tared: TaredLog, tare: Sequence[Range]) -> list[Finding]:
    """What speaks against the tare, as errors: CS3039 it holds a cut, CS3066 nothing shows that it does not."""
    return _differs_within(tared, tare) or _against_air_moves(tared, tare)


def _differs_within(tared: TaredLog, tare: Sequence[Range]) -> list[Finding]:
    """The targets of a stretch show forces that differ as those of a cut do: by a fifth of the largest of the whole log."""
    rows, mean = tared.rows, tared.mean()
    seen = np.flatnonzero(rows.samples)
    spread, mean = tared.scatter(mean)[seen], mean[seen]
    error_of = np.sqrt(np.maximum(spread, np.median(spread)) / rows.rows[seen])
    for first, last in tare:
        inside = (seen >= first) & (seen <= last)
        if not (~inside).any():
            continue
        off = np.linalg.norm(mean - np.median(mean[inside], axis=0), axis=1)
        worst = int(np.argmax(np.where(inside, off, -1.0)))
        if off[worst] > max(IN_AIR * off.max(), LEAST_FORCE, SURELY * error_of[worst]):
            if inside.sum() == 2:
                # Both are as far from their middle: which of them cuts is not known.
                (one, other), apart = seen[inside], np.linalg.norm(np.diff(mean[inside], axis=0))
                return [_holds_a_cut(tared, f"the targets {one} and {other} of --tare are not both in air: their forces are "
                                     f"{apart:.1f} N apart, the largest force of the log is {off.max():.1f} N")]
            return [_holds_a_cut(tared, f"the targets {first} to {last} of --tare are not all in air: target {seen[worst]} "
                                 f"shows {off[worst]:.1f} N more than the middle of them, the largest force of the log is "
                                 f"{off.max():.1f} N")]
    return []


def _against_air_moves(tared: TaredLog, tare: Sequence[Range]) -> list[Finding]:
    """A cut under the whole of a stretch does not show within it: it shows in that all air moves have the opposite of its
    force; the witnesses are asked where there are too few of them."""
    rows, air = tared.rows, tared.air
    named = _named(len(air), tare)
    possible = air & ~named & (rows.samples > 0)
    # The stretch of a target reaches into the move behind it: best are those with air on either side.
    between = possible & np.append(air[1:], True)
    others = np.flatnonzero(between if between.sum() >= FEWEST_AIR else possible)
    if len(others) < FEWEST_AIR:
        return [finding for stretch in dict.fromkeys(tare) for finding in _against_witnesses(tared, stretch, tare, between)]
    mean = tared.mean()
    scatter = tared.scatter(mean)
    middle = np.median(mean[others], axis=0)
    spread = OF_AIR * float(np.median(np.linalg.norm(mean[others] - middle, axis=1)))
    for first, last in tare:
        inside = np.flatnonzero(rows.samples[first:last + 1]) + first
        bias = np.average(mean[inside], axis=0, weights=rows.samples[inside])
        off = np.linalg.norm(mean[others] - bias, axis=1)
        noise = 3.0 * float(np.sqrt(np.median(scatter[others]) / rows.rows[inside].sum()))
        allowed = max(LEAST_FORCE, spread, noise)
        quiet = QUIETER**2 * np.median(scatter[inside]) < np.median(scatter[others])
        if float(np.quantile(off, QUARTER)) > allowed and not quiet:
            return [_holds_a_cut(tared, f"the targets {first} to {last} of --tare are not in air: with their mean as the bias, "
                                 f"{int(np.sum(off > allowed))} of {counted(len(others), 'move')} at the air feed would show a "
                                 f"force, {np.median(off):.1f} N in the middle, at most {allowed:.1f} N are drift and noise",
                                 f", such as --tare {others[0]}:{_run(others)}")]
    return []


@dataclass(frozen=True, eq=False)
class _Witness:
    """Rows that are in air as a rule. name: for people; mean (3,) [N]; scatter [N^2] of one row, count of them."""

    name: str
    mean: Array
    scatter: float
    count: int


def _against_witnesses(
    tared: TaredLog, stretch: Range, tare: Sequence[Range], air: NDArray[np.bool_]
) -> list[Finding]:
    """A stretch of the tare against the largest group of witnesses that contradict it and agree with each other."""
    rows, mean = tared.rows, tared.mean()
    scatter = tared.scatter(mean)
    first, last = stretch
    inside = np.flatnonzero(rows.samples[first:last + 1]) + first
    others = np.flatnonzero((rows.samples > 0) & ~_named(rows.count, tare))
    if not len(others):
        return []
    bias = np.average(mean[inside], axis=0, weights=rows.samples[inside])
    calm = float(np.average(scatter[inside], weights=rows.samples[inside]))
    largest = float(np.quantile(np.linalg.norm(mean[others] - bias, axis=1), 0.95))
    allowed = max(LEAST_FORCE, AGREES * largest)

    own_noise = calm / int(rows.rows[inside].sum())
    witnesses = _witnesses(tared, mean, scatter, others, air)
    witnesses += [_stretch_witness(tared, mean, scatter, other) for other in dict.fromkeys(tare) if other != stretch]
    off = [float(np.linalg.norm(w.mean - bias)) for w in witnesses]
    sigma = [3 * float(np.sqrt(w.scatter / w.count + own_noise)) for w in witnesses]
    with_it = [w for w, far, noise in zip(witnesses, off, sigma, strict=True) if far <= allowed and noise <= 2 * allowed]
    against = [w for w, far, noise in zip(witnesses, off, sigma, strict=True) if far > max(allowed, noise)]
    groups = [[w for w in against if np.linalg.norm(w.mean - one.mean) <= allowed] for one in against]
    group = max(groups, key=len, default=[])
    # A program begins and ends in air as a rule; that alone is enough for a tare there where the log reaches over both ends, or
    # where the bulk of the targets is about as far from it as any.
    whole = rows.samples[:END + 1].any() and rows.samples[-1 - END:].any()
    bulk_far = float(np.quantile(np.linalg.norm(mean[others] - bias, axis=1), QUARTER)) > BULK * largest
    ends = (first <= END or last >= rows.count - 1 - END) and (whole or bulk_far)
    usual = float(np.median(scatter[others]))
    restless = np.sqrt(calm) > max(RESTLESS * largest, 2 * LEAST_FORCE) and QUIETER**2 * calm > usual
    # Moves at the air feed that the tare names are in air as a rule, as others are that it does not.
    at_air = bool((tared.air & np.append(tared.air[1:], True))[inside].all())
    for_it = len(with_it) + ends + at_air + (QUIETER**2 * calm < usual)
    speaks = len(group) + restless
    shown = "no other sample of the log is in air for certain"
    if group:
        zero = np.average([w.mean for w in group], axis=0, weights=[w.count for w in group])
        near, far_off = (float(np.quantile(np.linalg.norm(mean[others] - point, axis=1), QUARTER)) for point in (zero, bias))
        for_it += far_off > max(FARTHER * near, allowed)
        speaks += near > max(FARTHER * far_off, allowed)
        shown = (f"with their mean as the bias, {' and '.join(w.name for w in group)} would show a force of "
                 f"{np.linalg.norm(zero - bias):.1f} N, at most {allowed:.1f} N are drift and noise")
    elif restless:
        shown = f"their samples scatter by {np.sqrt(calm):.1f} N, as those of a cut do"
    if for_it > speaks:
        return []
    if speaks > for_it:
        return [_holds_a_cut(tared, f"the targets {first} to {last} of --tare are not in air: {shown}")]
    return [_not_shown(tared, stretch, shown)]


def _witnesses(
    tared: TaredLog, mean: Array, scatter: Array, others: NDArray[np.intp], air: NDArray[np.bool_]
) -> list[_Witness]:
    """mean (N, 3), scatter (N,) of each target; others: targets with samples outside the tare; air (N,): air on either side."""
    found = [_Witness(f"the {counted(len(load), 'row')} of the log {name} the program", load.mean(axis=0),
                      float(load.var(axis=0).sum()), len(load))
             for name, load in (("before", tared.before), ("after", tared.after)) if len(load) >= FEWEST_ROWS]
    last = tared.rows.count - 1
    for k in others:
        name = ("the first target" if k == 0 else "the last target" if k == last
                else f"target {k}, an air move," if air[k] else "")
        if name:
            found.append(_Witness(name, mean[k], float(scatter[k]), int(tared.rows.rows[k])))
    if tared.stated is not None:
        found.append(_Witness("the bias stated in cell.yaml", tared.stated, 0.0, 1))
    return found


def _stretch_witness(tared: TaredLog, mean: Array, scatter: Array, stretch: Range) -> _Witness:
    """Another stretch of the tare: the user says that it is in air."""
    samples = tared.rows.samples[stretch[0]:stretch[1] + 1]
    inside = slice(stretch[0], stretch[1] + 1)
    return _Witness(f"the targets {stretch[0]} to {stretch[1]} of --tare", np.average(mean[inside], axis=0, weights=samples),
                    float(np.average(scatter[inside], weights=samples)), int(tared.rows.rows[inside].sum()))


def _named(count: int, tare: Sequence[Range]) -> NDArray[np.bool_]:
    """The targets (count,) that the tare names."""
    named = np.zeros(count, dtype=bool)
    for first, last in tare:
        named[first:last + 1] = True
    return named


def _holds_a_cut(tared: TaredLog, message: str, such_as: str = "") -> Finding:
    return Finding("CS3039", "error", message, file=tared.source,
                   hint=f"name targets during which the tool touches nothing{such_as}; if you saw that it touches nothing "
                   "there, --trust-tare")


def _not_shown(tared: TaredLog, stretch: Range, why: str) -> Finding:
    return Finding("CS3066", "error", f"nothing in the log shows that the targets {stretch[0]} to {stretch[1]} of --tare are "
                   f"in air: {why}", file=tared.source,
                   hint="log some seconds before and after the program, or name the approach; state a payload that turns in "
                   "cell.yaml; if you saw that the tool touches nothing there, --trust-tare takes it")


def _run(numbers: NDArray[np.intp]) -> int:
    """The last of the numbers (n,) that follow the first without a gap."""
    gaps = np.flatnonzero(np.diff(numbers) > 1)
    return int(numbers[gaps[0] if len(gaps) else -1])

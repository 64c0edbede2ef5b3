"""The force that deflects the robot is the mean over whole spindle revolutions: tooth passing and run-out go, edges stay.

The moving mean over exactly one revolution T has the response sinc(f T): zero at 1/T, 2/T, ..., where run-out and tooth passing
have all their lines, and a step becomes a ramp from half a revolution before it to half a revolution after. A sample stands for
the time up to the next, so that a window need not be a whole number of samples.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.common.arrays import Array

Indices = NDArray[np.intp]
# A line of the spectrum stands so far over the median of its neighbours. A comb of lines is believed when it holds so much of
# their amplitude, chance taken off, NEARLY as much as the best one does, and its strongest stands out so far; of a force in
# random steps no line does.
OVER_FLOOR, CLEAR, NEARLY, OUTSTANDING = 30.0, 0.8, 0.02, 300.0
NEIGHBOURS = 129
MOST_TEETH = 24
# Teeth that pass faster than this [Hz], four at 24 000 rpm, spindles that turn faster than this [Hz], 40 000 rpm, and cutters
# of more teeth are not looked for behind a line that may be folded back (engineering judgement: robots do not mill so). A
# comb's multiples are followed to half the rate; beyond, that many and up to BROADEST [Hz].
FASTEST_TEETH, FASTEST, MOST_FOLDED_TEETH, MULTIPLES, BROADEST = 1600.0, 667.0, 8, 40, 5000.0
# A comb on which lines fall by chance more often than one in so many e-folds, over all that were tried, is none.
BY_CHANCE = 3.0
# The slowest spindle looked for [Hz], and how many bins of the spectrum it must be from zero.
SLOWEST, FEWEST_BINS = 4.0, 8
# A stated speed is taken from the spectrum where that has it within this share.
SLIP = 0.03


def moving_mean(load: Array, window: float, first: int, stop: int, *, starts: bool, ends: bool) -> Array:
    """Means (stop - first, c) over `window` samples about each of the samples first ... stop - 1 of load (n, c).

    starts, ends: nothing lies before or behind load; there the window stays inside, one-sided.
    """
    count = len(load)
    if window >= count:
        return np.broadcast_to(load.mean(axis=0), (stop - first, load.shape[1]))
    total = np.zeros((count + 1, load.shape[1]), order="F")
    np.cumsum(load, axis=0, out=total[1:])
    lag = 0.5 - 0.5 * window
    # Where nothing is clipped a window begins and ends at the same fraction of a sample everywhere: slices do.
    low = min(max(int(np.ceil(-lag)), first), stop) if starts else first
    high = max(min(int(np.floor(count - window - lag)), stop), low) if ends else stop

    def integral(place: Array) -> Array:
        whole = np.clip(np.floor(place).astype(np.intp), 0, count - 1)
        return np.asarray(total[whole] + (place - whole)[:, None] * load[whole])

    def steady(offset: float) -> Array:
        whole = int(np.floor(low + offset))
        inside = slice(whole, whole + high - low)
        return np.asarray(total[inside] + (low + offset - whole) * load[inside])

    means = np.empty((stop - first, load.shape[1]), order="F")
    if high > low:
        np.subtract(steady(lag + window), steady(lag), out=means[low - first:high - first])
    for part in (slice(first, low), slice(high, stop)):
        begin = np.clip(np.arange(part.start, part.stop) + lag, 0.0, count - window)
        means[part.start - first:part.stop - first] = integral(begin + window) - integral(begin)
    means /= window
    return means


def averaged(
    pieces: Iterator[tuple[Array, Indices]], window: float
) -> Iterator[Array]:
    """The moving mean of a log that comes in blocks: as many rows in all, each as soon as its window is complete.

    pieces: load (n, c) and the places (g,) before which the log has a gap: no window reaches over one.
    """
    reach = int(np.ceil(0.5 * window)) + 1
    held: Array | None = None
    done, fresh = 0, True           # rows of `held` that were given out; whether `held` begins at a gap
    for load, gaps in pieces:
        borders = [0, *(int(gap) for gap in gaps), len(load)]
        for number in range(len(borders) - 1):
            if number and held is not None:
                if done < len(held):
                    yield moving_mean(held, window, done, len(held), starts=fresh, ends=True)
                held, done, fresh = None, 0, True
            part = load[borders[number]:borders[number + 1]]
            held = part if held is None else np.concatenate([held, part])
            stop = len(held) - reach
            # The first windows are one-sided, and so need a whole one.
            if stop > done and len(held) > window + 1:
                yield moving_mean(held, window, done, stop, starts=fresh, ends=False)
                done = stop
                cut = max(done - reach, 0)
                if cut:
                    held, done, fresh = held[cut:], done - cut, False
    if held is not None and done < len(held):
        yield moving_mean(held, window, done, len(held), starts=fresh, ends=True)


@dataclass(frozen=True)
class Spindle:
    """frequency [Hz] of the spindle, or of what repeats most slowly. share: of the lines' amplitude at its multiples, chance
    taken off. strongest [Hz]: the strongest line; over_floor: its power over the noise about it. left [N s]: what all lines
    leave in a plain mean, at most and as a root of squares, times the time that is averaged. rivals [Hz]: other speeds that
    fit the lines as well, none a multiple or a fraction of it. faster [Hz]: a whole multiple that would hold the lines as well,
    those below it folded back at half the rate; None: there is none."""

    frequency: float
    share: float
    strongest: float
    over_floor: float
    left: float
    rivals: tuple[float, ...] = ()
    faster: float | None = None


def spectrum(
    stretches: Callable[[Sequence[float], int], Iterator[Array]], rate: float, rows: int
) -> tuple[Array, Array] | None:
    """Frequencies (m,) [Hz] and power (m,), the mean over the livelier half of up to 12 stretches of the log.

    stretches(shares, n): n samples from each of several places in the log. None where the log is too short.
    """
    length = int(2 ** np.clip(np.round(np.log2(0.6 * rate)), 10, 14))
    if rows < length:
        return None
    powers = []
    taper = np.hanning(length)[:, None]
    shares = np.linspace(0, 1, int(np.clip(rows // length, 1, 12)))
    for load in stretches([float(share) for share in shares], length + length // 8):
        if len(load) < length:
            continue
        load = load[:length, :3]
        line = np.linspace(-1, 1, length)[:, None]
        load = load - load.mean(axis=0)
        load = load - line * ((load * line).sum(axis=0) / (line**2).sum())
        powers.append((np.abs(np.fft.rfft(load * taper, axis=0)) ** 2).sum(axis=1))
    if not powers:
        return None
    powers.sort(key=lambda power: -float(power.sum()))
    power: Array = np.mean(powers[: (len(powers) + 1) // 2], axis=0)
    return np.asarray(np.fft.rfftfreq(length, 1 / rate), dtype=float), power


def find_spindle(frequency: Array, power: Array, stated: float | None = None) -> Spindle | None:
    """The spindle's speed from the comb of lines it makes; None where there is none that is clear.

    stated [Hz]: looked for near it alone. Of all combs that hold nearly as much as the best the widest is taken: whatever
    repeats faster than the spindle without run-out repeats each tooth, and then a tooth is a period too. Lines above half the
    rate of the log show folded back below it, so that another speed may make the same lines: a rival. Where the strongest line
    is not folded, lines below the widest comb's own frequency are its own only if they are; where a whole fraction of it holds
    them as they stand, they are run-out's, and the widest comb that of the teeth that pass. The fraction is taken: a mean over
    the longer period is one over whole periods of both.
    """
    step, rate = frequency[1], 2 * frequency[-1]
    lines, height, over = lines_of(power)
    fast = lines * step >= max(FEWEST_BINS * step, SLOWEST)
    lines, height, over = lines[fast] * step, height[fast], over[fast]
    if not len(lines) or over.max() < (OUTSTANDING if stated is None else OVER_FLOOR):
        return None
    strongest = int(np.argmax(height))
    top = float(lines[strongest])
    slowest = max(FEWEST_BINS * step, SLOWEST)
    if stated is None:
        tried = [top / teeth for teeth in range(1, MOST_TEETH + 1)]
        folds = np.arange(1, int((FASTEST_TEETH + top) / rate) + 1) * rate
        tried += [fold / teeth for fold in (*(folds - top), *(folds + top)) if fold <= FASTEST_TEETH
                  for teeth in range(1, MOST_FOLDED_TEETH + 1) if fold / teeth <= FASTEST]
        tried = [first for first in tried if first >= slowest]
    else:
        near = max(int(np.round(top / stated)), 1)
        tried = [top / near] if abs(top / near / stated - 1) <= SLIP else [stated]
    # A Hann window halves the sum of what it weighs, and half of a line's amplitude stands at each sign of its frequency. A
    # sine's mean over a time t is at most its amplitude over pi f t.
    left = float(np.linalg.norm(4 * np.sqrt(height) / (2 * (len(power) - 1)) / (np.pi * lines)))
    combs = [_comb(first, lines, np.sqrt(height), step, rate) for first in tried]
    if stated is None:
        combs = [comb for comb in combs if comb.evidence >= np.log(len(tried)) + BY_CHANCE]
    combs = sorted((comb for comb in combs if comb.share >= CLEAR), key=lambda comb: -comb.frequency)
    if not combs:
        return None
    best = max(comb.share for comb in combs) - NEARLY
    widest = next(comb for comb in combs if comb.share >= best)
    slow = lines < widest.frequency - 1.5 * step
    found = widest
    if (_held(widest.frequency, lines[[strongest]], np.ones(1), step)
            and np.sqrt(height[slow]).sum() > NEARLY * np.sqrt(height).sum()):
        found = next((comb for comb in combs if comb.share >= best and _divides(comb.frequency, widest.frequency, step)
                      and _held(comb.frequency, lines[slow], np.sqrt(height[slow]), step) >= CLEAR), widest)
    rivals: list[float] = []
    for comb in combs:
        alike = comb.share >= best or comb.evidence > found.evidence
        if alike and not any(_divides(comb.frequency, other, step) for other in (found.frequency, widest.frequency, *rivals)):
            rivals.append(comb.frequency)
    return Spindle(found.frequency, found.share, top, float(over[strongest]), left, tuple(rivals),
                   None if found is widest else widest.frequency)


def _held(first: float, lines: Array, amplitude: Array, step: float) -> float:
    """The share of the amplitude of lines [Hz] that stand at multiples of `first` [Hz]."""
    off = np.abs(lines - first * np.round(lines / first))
    return float(amplitude[off <= 1.5 * step].sum() / amplitude.sum())


def _divides(one: float, other: float, step: float) -> bool:
    """Whether one of two frequencies is a multiple of the other, as far as the steps of the spectrum tell."""
    low, high = min(one, other), max(one, other)
    return bool(abs(np.round(high / low) * low - high) <= 1.5 * step)


@dataclass(frozen=True)
class _Comb:
    """frequency [Hz], share as in Spindle; evidence: minus the log of the chance that so many lines lie on such a comb."""

    frequency: float
    share: float
    evidence: float


def _comb(first: float, lines: Array, amplitude: Array, step: float, rate: float) -> _Comb:
    """The comb of lines near a spindle's speed `first` [Hz]: that speed by least squares, and the share of the lines' amplitude
    at its multiples, those that fold back at half the rate [Hz] included, chance taken off."""
    guess = first
    for _ in range(3):
        order = np.arange(1, int(max(0.5 * rate, min(MULTIPLES * guess, BROADEST)) / guess) + 1)
        fold = np.round(order * guess / rate)
        place = order * guess - fold * rate         # negative where the line is mirrored
        nearest = np.argmin(np.abs(np.abs(place) - lines[:, None]), axis=1)
        close = np.abs(np.abs(place[nearest]) - lines) <= 1.5 * step
        if not close.any():
            break
        weight, number = amplitude * close, order[nearest]
        unfolded = fold[nearest] * rate + np.where(place[nearest] < 0, -lines, lines)
        guess = float(np.sum(weight * number * unfolded) / np.sum(weight * number**2))
    covered = np.zeros(int(0.5 * rate / step) + 2, dtype=bool)
    for shift in (-1, 0, 1):
        covered[np.clip(np.round(np.abs(place) / step).astype(np.intp) + shift, 0, len(covered) - 1)] = True
    chance = min(float(covered.mean()), 0.9)
    share = (amplitude[close].sum() / amplitude.sum() - chance) / (1 - chance)
    return _Comb(guess, float(share), -int(close.sum()) * float(np.log(chance)))


def lines_of(power: Array) -> tuple[Array, Array, Array]:
    """Lines of a spectrum: place in bins, between them by the parabola through three logarithms; power; power over the median
    of its neighbours."""
    half = NEIGHBOURS // 2
    padded = np.pad(power, half, mode="reflect")
    floor = np.median(np.lib.stride_tricks.sliding_window_view(padded, 2 * half + 1), axis=1)
    over = power / np.maximum(floor, 1e-300)
    inner = power[1:-1]
    place = 1 + np.flatnonzero((inner > power[:-2]) & (inner >= power[2:]) & (over[1:-1] > OVER_FLOOR))
    # A line so far below the strongest that it may be a side lobe of the window says nothing.
    place = place[power[place] > 1e-6 * power[place].max()] if len(place) else place
    low, mid, high = (np.log(np.maximum(power[place + k], 1e-300)) for k in (-1, 0, 1))
    shift = 0.5 * (low - high) / np.minimum(low - 2 * mid + high, -1e-12)
    return place + np.clip(shift, -0.5, 0.5), power[place], over[place]

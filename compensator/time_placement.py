"""Where on the path the samples of a force log were taken when the log has nothing but time.

The log's clock starts anywhere, and the feed override scales the program's time: planned time = override * (t - start). Which start
and override it were is estimated from what the program says of the force, without a model of the engagement: none on air moves, and
on the others, behind an air lead-in and before an air lead-out of unknown lengths, a constant plus a linear function of the
direction of travel (the sensor's bias is the constant everywhere). For every start and override that is a linear regression; all
of them are looked at on a coarse grid (correlations by FFT), the best ones refined with the lead lengths. Passes of a raster
resemble each other, so the answer is believed only if the best alignment beats the best one elsewhere by far: the score is the
difference of their log likelihoods. Afterwards each stretch of the program may slip a little against the clock, as far as its own
samples say so.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Flags = NDArray[np.bool_]

# Feed overrides looked for.
SLOWEST, FASTEST = 0.4, 1.5
# Feeds whose gap is at least this factor are cutting feed and air feed.
AIR_FACTOR = 2.0
# Bins of the coarse and of the fine search, at most.
COARSE, FINE = 2000, 12_000
# The smallest difference of log likelihoods to the best other alignment, and share of the force's variance explained, that are
# believed.
LOWEST_SCORE, LOWEST_SHARE = 10.0, 0.2
# How many best places of the coarse search are refined.
CANDIDATES = 6
# Lead-in and lead-out are taken to be alike to this share of their sum (1 sigma), and at least this length [m].
LEAD_SHARE, LEAD_LEAST = 0.1, 1e-3
# The edge of a cut is this wide [m].
EDGE = 4e-3


@dataclass(frozen=True, eq=False)
class Program:
    """What the program says: time (N,) [s] and length (N,) [m] at which each target is reached, ascending; air (N,): the move to the
    target does not cut; direction (N, 3): unit vector of the move to it, in the log's frame."""

    time: Array
    length: Array
    air: Flags
    direction: Array


@dataclass(frozen=True, eq=False)
class TimePlacement:
    """Arc length (M,) [m] of each sample, NaN before the start and after the end of the program.

    start [s]: the log's clock at the program's start; override: actual over planned speed; slip [s]: the largest departure from
    these two. score: log likelihood over that of the best other alignment; share: of the force's variance that is explained; rival
    [s]: how far, in planned time, the best other alignment is. std (M,) [s]: 1 sigma of a sample's planned time.
    """

    place: Array
    start: float
    override: float
    slip: float
    score: float
    share: float
    rival: float
    std: Array

    @property
    def believed(self) -> bool:
        """The score and the share are high enough."""
        return self.score >= LOWEST_SCORE and self.share >= LOWEST_SHARE


def air_moves(feed: Array, by_joints: Flags) -> Flags:
    """Moves (N,) that do not cut: joint moves, and those of the fast class where the feeds (N,) [m/s] fall into two classes."""
    feeds = np.unique(feed[(feed > 0) & ~by_joints])
    ratio = feeds[1:] / feeds[:-1]
    if not len(ratio) or ratio.max() < AIR_FACTOR:
        return by_joints
    return np.asarray(by_joints | (feed >= feeds[1:][np.argmax(ratio)]))


def place_by_time(program: Program, time: Array, force: Array) -> TimePlacement:
    """Places samples at times (M,) [s], ascending, with force (M, 3) [N]."""
    span = float(time[-1] - time[0])
    bins = int(np.clip(8 * span / max(_period(program), 1e-3), 64, COARSE))
    candidates = _coarse(program, *_binned(time, force, span / bins), span / bins)
    middle = 0.5 * float(time[0] + time[-1])
    fine = max(span / FINE, 0.02)
    model = _Model(program, *_binned(time, force, fine), middle)
    refined = [model.refine(np.array([override * (middle - start), np.log(override), 0.0, 0.0])) for start, override in candidates]
    values = np.array([model.value(one) for one in refined])
    best = refined[int(np.argmin(values))]
    # An alignment is another one if it puts the samples elsewhere by more than half a stretch on average.
    apart = np.array([model.apart(best, one) for one in refined])
    others = np.flatnonzero(apart > 0.5 * _stretch(program))
    independent = model.independent(best)
    rival = int(others[np.argmin(values[others])]) if len(others) else -1
    score = 0.5 * independent * float(values[rival] - values.min()) if rival >= 0 else np.inf
    covariance = model.covariance(best, independent)
    slip, slip_std = model.slips(best, independent)
    planned = model.planned(best, time)
    planned = planned + np.interp(time, model.time, slip)
    inside = (planned >= program.time[0]) & (planned <= program.time[-1])
    place = np.where(inside, np.interp(planned, program.time, program.length), np.nan)
    away = np.exp(best[1]) * (time - middle)
    variance = covariance[0, 0] + 2 * away * covariance[0, 1] + away**2 * covariance[1, 1]
    std = np.sqrt(np.maximum(variance, 0.0) + np.interp(time, model.time, slip_std) ** 2)
    override = float(np.exp(best[1]))
    return TimePlacement(place, middle - float(best[0]) / override, override, float(np.max(np.abs(slip), initial=0.0)), score,
                         model.share(best), float(apart[rival]) if rival >= 0 else np.inf, np.asarray(std))


def _runs(program: Program) -> list[tuple[int, int]]:
    """Stretches of moves that may cut: the target before the first of them, and the last one."""
    cuts = ~program.air
    cuts[0] = False
    edges = np.flatnonzero(np.diff(np.concatenate([[False], cuts, [False]]).astype(int)))
    return [(int(a) - 1, int(b) - 1) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _stretch(program: Program) -> float:
    """Duration of a typical stretch that cuts [s]."""
    lengths = [program.time[b] - program.time[a] for a, b in _runs(program)]
    return float(np.median(lengths)) if lengths else float(program.time[-1])


def _period(program: Program) -> float:
    """Typical time from cut to cut [s]."""
    return float(program.time[-1] - program.time[0]) / max(len(_runs(program)), 1)


def _binned(time: Array, force: Array, width: float) -> tuple[Array, Array, Array]:
    """Middle (n,) [s], mean force (n, 3) [N] and weight (n,), 0 or 1, of bins of time."""
    number = np.minimum(((time - time[0]) / width).astype(np.intp), int((time[-1] - time[0]) / width))
    count = np.bincount(number)
    mean = np.column_stack([np.bincount(number, column) for column in force.T]) / np.maximum(count, 1)[:, None]
    return time[0] + (np.arange(len(count)) + 0.5) * width, mean, (count > 0).astype(float)


def _features(program: Program, planned: Array, lead_in: float, lead_out: float) -> Array:
    """What may carry force at planned times (n,) [s]: engaged, and engaged times direction, (n, 4); zero outside the program."""
    leg = np.clip(np.searchsorted(program.time, planned, side="left"), 1, len(program.time) - 1)
    s = np.interp(planned, program.time, program.length)
    first, last = np.zeros(len(program.time)), np.zeros(len(program.time))
    for a, b in _runs(program):
        first[a + 1:b + 1], last[a + 1:b + 1] = program.length[a], program.length[b]
    engaged = np.clip((s - first[leg] - lead_in) / EDGE + 0.5, 0, 1) * np.clip((last[leg] - lead_out - s) / EDGE + 0.5, 0, 1)
    engaged *= ~program.air[leg] & (planned >= program.time[0]) & (planned <= program.time[-1])
    return np.asarray(engaged[:, None] * np.column_stack([np.ones(len(leg)), program.direction[leg]]))


def _coarse(program: Program, time: Array, force: Array, weight: Array, width: float) -> list[tuple[float, float]]:
    """Start [s] and override of the alignments that explain most, each a stretch away from those before it."""
    from scipy.fft import irfft, next_fast_len, rfft

    n = len(time)
    total = float(program.time[-1] - program.time[0])
    centred = (force - np.average(force, axis=0, weights=weight)) * weight[:, None]
    energy = float(np.sum(centred**2))
    count = weight.sum()
    found: list[tuple[float, float, float]] = []
    stretch = _stretch(program)
    step = 0.5 * width * 2 / max(total, n * width)
    for override in np.exp(np.arange(np.log(SLOWEST), np.log(FASTEST), step)):
        m = int(np.ceil(total / override / width)) + 1
        size = next_fast_len(n + m, real=True)
        planned = program.time[0] + override * width * (np.arange(m) + 0.5)
        phi = _features(program, planned, 0.0, 0.0)
        pairs = [(i, j) for i in range(4) for j in range(i, 4)]
        of_features = np.conj(rfft(np.column_stack([phi, *(phi[:, i] * phi[:, j] for i, j in pairs)]), size, axis=0))
        of_log = rfft(np.column_stack([weight, centred]), size, axis=0)
        sums = irfft(of_features * of_log[:, :1], size, axis=0)
        cross = irfft(of_features[:, :4, None] * of_log[:, None, 1:], size, axis=0)
        gram = np.empty((size, 4, 4))
        for k, (i, j) in enumerate(pairs):
            gram[:, i, j] = gram[:, j, i] = sums[:, 4 + k] - sums[:, i] * sums[:, j] / count
        ridge = 1e-3 * np.trace(gram, axis1=1, axis2=2) + 1e-9 * count
        gram += ridge[:, None, None] * np.eye(4)
        explained = np.einsum("nic,nic->n", cross, np.linalg.solve(gram, cross)) / energy
        lag = np.arange(size)
        lag[lag > n] -= size            # a lag: bin of the log at which the program starts
        for place in np.argsort(explained)[::-1][:CANDIDATES * 3]:
            found.append((float(explained[place]), float(time[0] + (lag[place] - 0.0) * width - 0.5 * width), float(override)))
    found.sort(reverse=True)
    kept: list[tuple[float, float]] = []
    ends = np.array([time[0], time[-1]])
    for _, start, override in found:
        here = override * (ends - start)
        if all(np.mean(np.abs(here - other_override * (ends - other))) > 0.5 * stretch for other, other_override in kept):
            kept.append((start, override))
            if len(kept) == CANDIDATES:
                break
    return kept


class _Model:
    """The regression on fine bins. Parameters x: planned time at the log's middle [s], ln override, lead-in, lead-out [m]."""

    def __init__(self, program: Program, time: Array, force: Array, weight: Array, middle: float) -> None:
        kept = weight > 0
        self.program, self.time, self.middle = program, time[kept], middle
        self.force = force[kept] - force[kept].mean(axis=0)
        self.energy = float(np.sum(self.force**2))

    def planned(self, x: Array, time: Array) -> Array:
        return np.asarray(x[0] + np.exp(x[1]) * (time - self.middle))

    def _design(self, x: Array, slip: float = 0.0) -> Array:
        phi = _features(self.program, self.planned(x, self.time) + slip, float(x[2]), float(x[3]))
        return np.column_stack([np.ones(len(phi)), phi])

    def _fit(self, x: Array) -> tuple[Array, Array]:
        """Coefficients (5, 3) and residual (n, 3) [N]."""
        design = self._design(x)
        gram = design.T @ design + 1e-6 * len(design) * np.eye(5)
        coefficients = np.linalg.solve(gram, design.T @ self.force)
        return coefficients, self.force - design @ coefficients

    def value(self, x: Array) -> float:
        """ln of the unexplained share, with the prior that lead-in and lead-out are alike."""
        sum_of_leads = max(float(x[2] + x[3]), 0.0)
        spread = LEAD_SHARE * sum_of_leads + LEAD_LEAST
        prior = ((x[2] - x[3]) / spread) ** 2 + np.sum(np.minimum(x[2:] / LEAD_LEAST, 0.0) ** 2)
        _, residual = self._fit(x)
        # The prior counts as two of about a hundred independent values of the residual.
        return float(np.log(np.sum(residual**2) / self.energy)) + 0.01 * float(prior)

    def share(self, x: Array) -> float:
        return 1.0 - float(np.sum(self._fit(x)[1] ** 2)) / self.energy

    def refine(self, x: Array) -> Array:
        from scipy.optimize import minimize

        typical = np.median([self.program.length[b] - self.program.length[a] for a, b in _runs(self.program)] or [0.0])
        period = _period(self.program)
        best = x.copy()
        for lead in (0.02, 0.1, 0.2):
            start = x.copy()
            start[2:] = lead * typical
            if self.value(start) < self.value(best):
                best = start
        steps = np.array([0.1 * period, 0.1 * period / max(self.time[-1] - self.time[0], 1e-3), 0.05 * typical, 0.05 * typical])
        for _ in range(2):
            simplex = best + np.concatenate([np.zeros((1, 4)), np.diag(steps)])
            best = minimize(self.value, best, method="Nelder-Mead",
                            options={"initial_simplex": simplex, "maxfev": 250, "xatol": 1e-6, "fatol": 1e-7}).x
            steps = 0.2 * steps
        return np.asarray(best)

    def apart(self, x: Array, other: Array) -> float:
        """Mean distance [s] of two alignments in planned time."""
        return float(np.mean(np.abs(self.planned(x, self.time) - self.planned(other, self.time))))

    def independent(self, x: Array) -> float:
        """How many independent values the residual has: its bins over its correlation time."""
        _, residual = self._fit(x)
        n = len(residual)
        size = 1 << int(np.ceil(np.log2(2 * n)))
        spectrum = np.fft.rfft(residual, size, axis=0)
        correlation = np.fft.irfft(np.sum(np.abs(spectrum) ** 2, axis=1), size)[:n]
        correlation /= correlation[0]
        below = np.flatnonzero(correlation < 0.05)
        reach = int(below[0]) if len(below) else n
        return float(n / (1 + 2 * np.sum(correlation[1:reach])))

    def covariance(self, x: Array, independent: float) -> Array:
        """Of x (4, 4), from the curvature of the log likelihood by differences as wide as the answer is uncertain."""
        steps = np.array([0.05, 0.05 / max(self.time[-1] - self.time[0], 1e-3) * 4, 1e-3, 1e-3])
        for _ in range(2):
            hessian = self._hessian(x, steps) * 0.5 * independent
            values, vectors = np.linalg.eigh(hessian * np.outer(steps, steps))
            covariance = (vectors / np.maximum(values, 1e-2)) @ vectors.T * np.outer(steps, steps)
            steps = np.clip(np.sqrt(np.diag(covariance)), 0.3 * steps, 10 * steps)
        return np.asarray(covariance)

    def _hessian(self, x: Array, steps: Array) -> Array:
        result = np.empty((4, 4))
        for i in range(4):
            for j in range(i, 4):
                a, b = np.zeros(4), np.zeros(4)
                a[i], b[j] = steps[i], steps[j]
                values = [self.value(x + a + b), self.value(x + a - b), self.value(x - a + b), self.value(x - a - b)]
                result[i, j] = result[j, i] = (values[0] - values[1] - values[2] + values[3]) / (4 * steps[i] * steps[j])
        return result

    def slips(self, x: Array, independent: float) -> tuple[Array, Array]:
        """Departure (n,) [s] of planned time from the straight line, and its 1 sigma (n,), a value a stretch, steadied between
        neighbours."""
        coefficients, residual = self._fit(x)
        planned = self.planned(x, self.time)
        reach = 0.4 * _period(self.program)
        tried = np.linspace(-reach, reach, 81)
        errors = np.array([np.sum((self.force - self._design(x, slip) @ coefficients) ** 2, axis=1) for slip in tried])
        noise = np.sum(residual**2) / independent
        middles, found, spread = [], [], []
        gaps = [self.program.time[0], *(0.5 * (self.program.time[b] + self.program.time[a]) for (_, b), (a, _) in zip(
            _runs(self.program)[:-1], _runs(self.program)[1:], strict=True)), self.program.time[-1]]
        for low, high in zip(gaps[:-1], gaps[1:], strict=True):
            part = (planned >= low) & (planned < high)
            if part.sum() < 5:
                continue
            likelihood = -0.5 * errors[:, part].sum(axis=1) / noise
            weight = np.exp(likelihood - likelihood.max())
            weight /= weight.sum()
            mean = float(weight @ tried)
            middles.append(0.5 * (low + high))
            found.append(mean)
            spread.append(float(np.sqrt(weight @ (tried - mean) ** 2 + (tried[1] - tried[0]) ** 2 / 12)))
        if len(found) < 2:
            return np.zeros(len(planned)), np.zeros(len(planned))
        value, sigma = _steadied(np.array(found), np.array(spread))
        return np.interp(planned, middles, value), np.interp(planned, middles, sigma)


def _steadied(value: Array, std: Array) -> tuple[Array, Array]:
    """A random walk through values (k,) with their stds: its mean and std; its step's size from the values themselves."""
    difference = np.diff(value)
    walk = max(float(np.median(difference**2)) / 0.455 - 2 * float(np.median(std**2)), (1e-3) ** 2)
    precision = np.diag(1 / std**2)
    link = np.diff(np.eye(len(value)), axis=0)
    precision += link.T @ link / walk
    covariance = np.linalg.inv(precision)
    return np.asarray(covariance @ (value / std**2)), np.sqrt(np.diag(covariance))

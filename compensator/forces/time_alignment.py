"""Where on the path the samples of a force log were taken when the log has nothing but time.

The log's clock starts anywhere, and the feed override scales the program's time: planned time = override * (t - start). Both
are estimated from what the program says of the force, without a model of the engagement: none on air moves; on the others,
behind an air lead-in and before an air lead-out of unknown lengths, a constant plus a linear function of the direction of
travel (the sensor's bias is a constant everywhere). For every start and override that is a linear regression: all are tried on
a coarse grid (correlations by FFT), the best ones refined with the lead lengths. Then each stretch of the program may slip a
little against the clock, a random walk, as far as its own samples say so. Passes of a raster resemble each other, so the answer
is believed only if it beats the best alignment elsewhere by far: the score is the difference of their log likelihoods.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from identification.common.autocorrelation import autocorrelation_time

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Flags = NDArray[np.bool_]

# Feed overrides looked for.
SLOWEST, FASTEST = 0.4, 1.5
# Feeds whose gap is at least this factor are cutting feed and air feed.
AIR_FACTOR = 2.0
# Bins of the coarse and of the fine search, at most.
COARSE, FINE = 1000, 3000
# The smallest score, and share of the force's variance explained, that are believed (docs/benchmarks.md: logs of the right
# program score 26 and more, others 5 at most).
LOWEST_SCORE, LOWEST_SHARE = 15.0, 0.5
# A stretch is odd whose residual is more than this share of the energy of its force and of what the program predicts. Where the
# program stood still for longer than stretches may slip, several are.
ODD, MOST_ODD = 0.5, 1
# How many best places of the coarse search are refined.
CANDIDATES = 5
# Lead-in and lead-out are taken to be alike to this share of their sum (1 sigma), and at least this length [m].
LEAD_SHARE, LEAD_LEAST = 0.1, 1e-3
# The edge of a cut is this wide [m].
EDGE = 4e-3
# Feeds whose cuts have a force of their own.
KINDS = 2
# The slip of a stretch against the straight line: at most REACH periods, WALK periods (1 sigma) from stretch to stretch, on so
# many states; stretches are cut into pieces of at most LONGEST [s].
REACH, WALK, STATES, LONGEST, ROUNDS = 0.4, 0.03, 61, 10.0, 3


@dataclass(frozen=True, eq=False)
class Program:
    """What the program says: time (N,) [s] and length (N,) [m] at which each target is reached, ascending; air (N,): the move
    to the target does not cut; kind (N,): moves of one number cut alike, such as those of one feed; direction (N, 3): unit
    vector of the move to it, in the log's frame."""

    time: Array
    length: Array
    air: Flags
    kind: Indices
    direction: Array


@dataclass(frozen=True, eq=False)
class TimePlacement:
    """Arc length (M,) [m] of each sample, NaN before the start and after the end of the program.

    start [s]: the log's clock at the program's start; override: actual over planned speed; slip [s]: the largest departure from
    these two. score: log likelihood over that of the best other alignment; share: of the force's variance that is explained;
    rival [s]: how far, in planned time, the best other alignment is. odd: stretches, from and to which planned time [s], whose
    force does not follow the program. std (M,) [s]: 1 sigma of a sample's planned time.
    """

    place: Array
    start: float
    override: float
    slip: float
    score: float
    share: float
    rival: float
    odd: tuple[tuple[float, float], ...]
    std: Array

    @property
    def believed(self) -> bool:
        """The score and the share are high enough, and no more than one stretch is odd."""
        return self.score >= LOWEST_SCORE and self.share >= LOWEST_SHARE and len(self.odd) <= MOST_ODD


def air_moves(feed: Array, by_joints: Flags) -> Flags:
    """Moves (N,) that do not cut: joint moves, and those of the fast class where the feeds (N,) [m/s] fall into two classes."""
    feeds = np.unique(feed[(feed > 0) & ~by_joints])
    ratio = feeds[1:] / feeds[:-1]
    if not len(ratio) or ratio.max() < AIR_FACTOR:
        return by_joints
    return np.asarray(by_joints | (feed >= feeds[1:][np.argmax(ratio)]))


def kinds_of_cut(feed: Array, air: Flags, length: Array) -> Indices:
    """Number (N,) of the kind of cut of each move: one for each of the KINDS feeds with most path, one for all others."""
    step = np.diff(length, prepend=length[:1])
    feeds, which = np.unique(np.round(feed, 6), return_inverse=True)
    share = np.bincount(which, np.where(air, 0.0, step))
    rank = np.argsort(np.argsort(-share, kind="stable"), kind="stable")
    return np.asarray(np.minimum(rank[which], min(KINDS, len(feeds) - 1)))


def place_by_time(program: Program, time: Array, force: Array) -> TimePlacement:
    """Places samples at times (M,) [s], ascending, with force (M, 3) [N]."""
    span = float(time[-1] - time[0])
    bins = int(np.clip(8 * span / max(_period(program), 1e-3), 64, COARSE))
    candidates = _coarse(program, *_binned(time, force, span / bins), span / bins)
    middle = 0.5 * float(time[0] + time[-1])
    model = _Model(program, *_binned(time, force, max(span / FINE, 0.02)), middle)
    refined, slipped = [], []
    for start, override in candidates:
        x = model.refine(np.array([override * (middle - start), np.log(override), 0.0, 0.0]))
        # With the stretches in their places the leads show, and with the leads the places.
        x = model.refine(x, model.slips(x).slip)
        refined.append(x)
        slipped.append(model.slips(x))
    values = np.array([one.value for one in slipped])
    number = int(np.argmin(values))
    best, slips = refined[number], slipped[number]
    # An alignment is another one if it puts the samples elsewhere by more than half a stretch on average.
    apart = np.array([float(np.mean(np.abs(one.planned - slips.planned))) for one in slipped])
    others = np.flatnonzero(apart > 0.5 * _stretch(program))
    rival = int(others[np.argmin(values[others])]) if len(others) else -1
    score = slips.independent * float(values[rival] - values[number]) if rival >= 0 else np.inf
    covariance = model.covariance(best, slips)
    override = float(np.exp(best[1]))
    planned = best[0] + override * (time - middle) + np.interp(time, model.time, slips.slip)
    inside = (planned >= program.time[0]) & (planned <= program.time[-1])
    place = np.where(inside, np.interp(planned, program.time, program.length), np.nan)
    away = override * (time - middle)
    variance = covariance[0, 0] + 2 * away * covariance[0, 1] + away**2 * covariance[1, 1]
    std = np.sqrt(np.maximum(variance, 0.0) + np.interp(time, model.time, slips.std) ** 2)
    return TimePlacement(place, middle - float(best[0]) / override, override, float(np.max(np.abs(slips.slip), initial=0.0)),
                         score, slips.share, float(apart[rival]) if rival >= 0 else np.inf, slips.odd, np.asarray(std))


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


def _stretch_ends(program: Program) -> tuple[Array, Array]:
    """Path length (N,) [m] at the start and the end of the stretch that each leg belongs to; 0 on air moves."""
    first, last = np.zeros(len(program.time)), np.zeros(len(program.time))
    for a, b in _runs(program):
        first[a + 1:b + 1], last[a + 1:b + 1] = program.length[a], program.length[b]
    return first, last


def _features(
    program: Program, ends: tuple[Array, Array], planned: Array, lead_in: float, lead_out: float
) -> tuple[Array, Indices]:
    """What may carry force at planned times (n,) [s]: engaged, and engaged times direction, (n, 4), zero outside the program;
    and the leg (n,)."""
    leg = np.clip(np.searchsorted(program.time, planned, side="left"), 1, len(program.time) - 1)
    s = np.interp(planned, program.time, program.length)
    first, last = ends
    engaged = np.clip((s - first[leg] - lead_in) / EDGE + 0.5, 0, 1) * np.clip((last[leg] - lead_out - s) / EDGE + 0.5, 0, 1)
    engaged *= ~program.air[leg] & (planned >= program.time[0]) & (planned <= program.time[-1])
    return np.asarray(engaged[:, None] * np.column_stack([np.ones(len(leg)), program.direction[leg]])), leg


def _coarse(program: Program, time: Array, force: Array, weight: Array, width: float) -> list[tuple[float, float]]:
    """Start [s] and override of the alignments that explain most, each a stretch away from those before it."""
    from scipy.fft import irfft, next_fast_len, rfft

    n = len(time)
    total = float(program.time[-1] - program.time[0])
    centred = (force - np.average(force, axis=0, weights=weight)) * weight[:, None]
    energy = float(np.sum(centred**2))
    count = weight.sum()
    found: list[tuple[float, float, float]] = []
    stretch, ends_of = _stretch(program), _stretch_ends(program)
    step = 0.5 * width * 2 / max(total, n * width)
    for override in np.exp(np.arange(np.log(SLOWEST), np.log(FASTEST), step)):
        m = int(np.ceil(total / override / width)) + 1
        size = next_fast_len(n + m, real=True)
        planned = program.time[0] + override * width * (np.arange(m) + 0.5)
        phi, _ = _features(program, ends_of, planned, 0.0, 0.0)
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
        lag[lag > n] -= size            # the bin of the log at which the program starts
        for place in np.argsort(explained)[::-1][:CANDIDATES * 3]:
            found.append((float(explained[place]), float(time[0] + (lag[place] - 0.5) * width), float(override)))
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


@dataclass(frozen=True, eq=False)
class _Slips:
    """An alignment whose stretches slip: slip (n,) [s] of each fine bin and its 1 sigma (n,), planned (n,) [s] with it. value:
    minus the log likelihood over `independent`, the number of independent values of the residual. share: explained. odd: as in
    `TimePlacement`."""

    slip: Array
    std: Array
    planned: Array
    value: float
    independent: float
    share: float
    odd: tuple[tuple[float, float], ...]


class _Model:
    """The regression on fine bins. Parameters x: planned time at the log's middle [s], ln override, lead-in, lead-out [m]."""

    def __init__(self, program: Program, time: Array, force: Array, weight: Array, middle: float) -> None:
        kept = weight > 0
        self.program, self.time, self.middle = program, time[kept], middle
        self.force = force[kept] - force[kept].mean(axis=0)
        self.energy = float(np.sum(self.force**2))
        self.ends = _stretch_ends(program)

    def planned(self, x: Array) -> Array:
        return np.asarray(x[0] + np.exp(x[1]) * (self.time - self.middle))

    def _design(self, x: Array, slip: Array | float = 0.0) -> Array:
        phi, leg = _features(self.program, self.ends, self.planned(x) + slip, float(x[2]), float(x[3]))
        kind = self.program.kind[leg]
        return np.column_stack([np.ones(len(phi)), *(phi * (kind == one)[:, None] for one in range(KINDS + 1))])

    def _fit(self, x: Array, slip: Array | float = 0.0) -> tuple[Array, Array]:
        """Coefficients (13, 3) and residual (n, 3) [N]."""
        design = self._design(x, slip)
        gram = design.T @ design + 1e-6 * len(design) * np.eye(design.shape[1])
        coefficients = np.linalg.solve(gram, design.T @ self.force)
        return coefficients, self.force - design @ coefficients

    def value(self, x: Array, slip: Array | float = 0.0, independent: float = 100.0) -> float:
        """Minus the log likelihood over `independent`, with the prior that lead-in and lead-out are alike."""
        spread = LEAD_SHARE * max(float(x[2] + x[3]), 0.0) + LEAD_LEAST
        prior = ((x[2] - x[3]) / spread) ** 2 + np.sum(np.minimum(x[2:] / LEAD_LEAST, 0.0) ** 2)
        return 0.5 * float(np.log(np.sum(self._fit(x, slip)[1] ** 2) / self.energy) + prior / independent)

    def refine(self, x: Array, slip: Array | float = 0.0) -> Array:
        """The likeliest alignment near x, lead-in and lead-out included, with this slip (n,) [s] beside it."""
        from scipy.optimize import minimize

        typical = np.median([self.program.length[b] - self.program.length[a] for a, b in _runs(self.program)] or [0.0])
        period = _period(self.program)
        starts = [np.append(x[:2], [lead * typical, lead * typical]) for lead in (0.0, 0.03, 0.1, 0.2, 0.3)]
        best = min((x, *starts), key=lambda one: self.value(one, slip))
        steps = np.array([0.1 * period, 0.1 * period / max(self.time[-1] - self.time[0], 1e-3), 0.05 * typical, 0.05 * typical])
        for _ in range(2):
            simplex = best + np.concatenate([np.zeros((1, 4)), np.diag(steps)])
            best = minimize(self.value, best, (slip,), method="Nelder-Mead",
                            options={"initial_simplex": simplex, "maxfev": 100, "xatol": 1e-6, "fatol": 1e-5}).x
            steps = 0.2 * steps
        return np.asarray(best)

    def covariance(self, x: Array, slips: _Slips) -> Array:
        """Of x (4, 4), from the curvature of the log likelihood by differences about as wide as the answer is uncertain."""
        steps = np.array([0.05, 0.2 / max(self.time[-1] - self.time[0], 1e-3), 1e-3, 1e-3])
        covariance = np.diag(steps**2)
        for _ in range(2):
            hessian = self._hessian(x, steps, slips) * slips.independent
            values, vectors = np.linalg.eigh(hessian * np.outer(steps, steps))
            covariance = (vectors / np.maximum(values, 1e-2)) @ vectors.T * np.outer(steps, steps)
            steps = np.clip(np.sqrt(np.diag(covariance)), 0.3 * steps, 10 * steps)
        return np.asarray(covariance)

    def _hessian(self, x: Array, steps: Array, slips: _Slips) -> Array:
        result = np.empty((4, 4))
        for i in range(4):
            for j in range(i, 4):
                a, b = np.zeros(4), np.zeros(4)
                a[i], b[j] = steps[i], steps[j]
                values = [self.value(x + step, slips.slip, slips.independent) for step in (a + b, a - b, b - a, -a - b)]
                result[i, j] = result[j, i] = (values[0] - values[1] - values[2] + values[3]) / (4 * steps[i] * steps[j])
        return result

    def slips(self, x: Array) -> _Slips:
        """How each stretch slips against the straight line: a random walk from stretch to stretch, its states weighed by the
        residual of that stretch alone (forward and backward), the regression with it in turn."""
        period = _period(self.program)
        tried = np.linspace(-REACH * period, REACH * period, STATES)
        walk = -0.5 * ((tried[:, None] - tried) / (WALK * period)) ** 2
        start = -0.5 * (tried / (0.5 * REACH * period)) ** 2
        borders = self._borders()
        planned, slip, std = self.planned(x), np.zeros(len(self.time)), np.zeros(len(self.time))
        number = np.searchsorted(borders, planned, side="right") - 1
        valid = (number >= 0) & (number < len(borders) - 1)
        middles = 0.5 * (borders[1:] + borders[:-1])
        for _ in range(ROUNDS):
            coefficients, residual = self._fit(x, slip)
            independent = self._independent(residual)
            noise = np.sum(residual**2) / independent
            errors = np.array([np.bincount(number[valid], error[valid], minlength=len(middles)) for error in (
                np.sum((self.force - self._design(x, one) @ coefficients) ** 2, axis=1) for one in tried)])
            mean, spread = _smoothed(-0.5 * errors.T / noise, walk, start, tried)
            slip, std = np.interp(planned, middles, mean), np.interp(planned, middles, spread)
        coefficients, residual = self._fit(x, slip)
        independent = self._independent(residual)
        left = float(np.sum(residual**2)) / self.energy
        penalty = 0.5 * float(np.sum((np.diff(mean) / (WALK * period)) ** 2))
        force = self.force - coefficients[0]
        sums = [np.bincount(number[valid], np.sum(values[valid] ** 2, axis=1), minlength=len(middles)) for values in (
            residual, force, force - residual)]
        energy = sums[1] + sums[2]
        odd = np.flatnonzero((sums[0] > ODD * energy) & (energy > 0.1 * np.median(energy)))
        return _Slips(slip, std, planned + slip, 0.5 * float(np.log(left)) + penalty / independent, independent, 1 - left,
                      tuple((float(borders[k]), float(borders[k + 1])) for k in odd))

    def _borders(self) -> Array:
        """Planned times [s] half way through the air between stretches: what lies between two of them slips together."""
        time, runs = self.program.time, _runs(self.program)
        between = [0.5 * (time[b] + time[a]) for (_, b), (a, _) in pairwise(runs)]
        # A program of one long stretch slips piece by piece all the same.
        pieces = [np.linspace(low, high, 1 + max(int((high - low) / LONGEST), 1))[:-1] for low, high in zip(
            [time[0], *between], [*between, time[-1]], strict=True)]
        return np.append(np.concatenate(pieces), time[-1])

    @staticmethod
    def _independent(residual: Array) -> float:
        """How many independent values the residual (n, 3) has: its bins over its correlation time."""
        return len(residual) / autocorrelation_time(residual, 0.05).values


def _smoothed(likelihood: Array, walk: Array, start: Array, states: Array) -> tuple[Array, Array]:
    """Posterior mean and std (k,) of a walk over states (m,) with log likelihoods (k, m), log steps (m, m), log start (m,)."""
    count = len(likelihood)
    ahead, behind = np.zeros_like(likelihood), np.zeros_like(likelihood)
    ahead[0] = start + likelihood[0]
    for k in range(1, count):
        ahead[k] = likelihood[k] + _log_sum(ahead[k - 1][:, None] + walk)
    for k in range(count - 2, -1, -1):
        behind[k] = _log_sum((likelihood[k + 1] + behind[k + 1])[:, None] + walk)
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

"""What to measure next: the loads that separate what is left, and the checks that are no loads (docs/effects.md, step 6).

Rivals are models fitted to the same data, with probabilities p_a. Under rival a the readings of further runs are expected to
be normal with mean m_a and covariance `K_a C_a K_a^T + N`, K_a their derivative by its parameters, C_a its posterior, N the
noise. With the mean of two rivals' covariances S_ab

    d_ab^2 = (m_a - m_b)^T S_ab^-1 (m_a - m_b) ,      P(the wrong name) <= sum_(a<b) sqrt(p_a p_b) exp(-d_ab^2 / 8)

(Bhattacharyya's bound, its determinants left out, which only raises it). The runs are chosen to make it small: unlike the
expected squared distance of Box and Hill, a pair that is already far apart is worth nothing more. Runs are independent in
their noise and share the parameters: with the sums over runs of G = X^T N^-1 X, X = (K_a, -K_b, m_a - m_b), Woodbury's
identity gives d_ab^2 of any set of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.common.arrays import rms
from identification.diagnosis.attempt import attempt
from identification.diagnosis.search import Survey
from identification.fit.fitted_model import predicted_deflection, response
from identification.fit.load_test import LoadTest
from identification.fit.noise import noise_model
from identification.fit.posterior import Posterior
from identification.measurements import Measurements
from identification.model.cell import Cell
from identification.model.gravity import fall_in_base

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
# Fitted models and their probabilities by label, the likeliest first.
Rivals = dict[str, tuple[Posterior, float]]
CANDIDATES = 120
# The rivals that are fitted hold so much of the probability together, or are so many.
HELD, MOST_RIVALS = 0.95, 12
# The cycle of one candidate, shares of the largest load: both signs, three magnitudes, back to zero.
CYCLE = (0.0, 0.33, 0.67, 1.0, 0.0, -0.5, -1.0, 0.0)
DWELL_S = (10.0, 60.0)
AXIS_NAMES, DOWN = "xyz", "down"
# Of the weights that were measured with so many are hung on next.
MOST_WEIGHTS = 6


@dataclass(frozen=True, eq=False)
class NextLoad:
    """A load cycle worth measuring: theta (6,) [rad], base axis, None of weights, which hang straight down, forces (m,) [N];
    distance: by how many sigmas the two rivals that it separates best would differ; separates: their labels."""

    theta: Array
    axis: int | None
    forces: Array
    distance: float
    separates: tuple[str, str]

    def as_dict(self) -> dict[str, Any]:
        """JSON values."""
        return {"kind": "load", "q_deg": np.degrees(self.theta).round(3).tolist(),
                "axis": DOWN if self.axis is None else AXIS_NAMES[self.axis],
                "forces_n": self.forces.tolist(), "separates": list(self.separates), "expected_sigmas": self.distance}


@dataclass(frozen=True, eq=False)
class Separation:
    """How c candidate runs separate rivals. names (R,); probability (R,), of sum one. pairs (P): of rivals, the first before
    the second; grams (P): G (c, k + 1, k + 1) of each pair, before (P): inverse (k, k) of the mean of the two posteriors."""

    names: tuple[str, ...]
    probability: Array
    pairs: tuple[tuple[int, int], ...]
    grams: tuple[Array, ...]
    before: tuple[Array, ...]

    def __len__(self) -> int:
        return len(self.grams[0]) if self.grams else 0

    def squared(self, sums: Sequence[Array]) -> Array:
        """d^2 (P, ...) of sets of runs, whose sums of G (..., k + 1, k + 1) are given pair by pair."""
        distances = []
        for gram, before in zip(sums, self.before, strict=True):
            across = gram[..., :-1, -1:]
            known = np.swapaxes(across, -1, -2) @ np.linalg.solve(before + gram[..., :-1, :-1], across)
            distances.append(np.maximum(gram[..., -1, -1] - known[..., 0, 0], 0.0))
        return np.array(distances)

    def mistaken(self, sums: Sequence[Array]) -> Array:
        """The bound (...) on the probability of the wrong name."""
        weight = np.array([np.sqrt(self.probability[a] * self.probability[b]) for a, b in self.pairs])
        return np.asarray(np.minimum(np.tensordot(weight, np.exp(-self.squared(sums) / 8), axes=1), 1.0))

    def of(self, chosen: Indices) -> list[Array]:
        """Sums of G over these candidates."""
        return [gram[chosen].sum(axis=0) for gram in self.grams]

    def best_pair(self, candidate: int) -> tuple[tuple[str, str], float]:
        """Names of the two rivals that a candidate separates best, the likelier pairs first in weight, and by how many
        sigmas."""
        squared = self.squared(self.of(np.array([candidate])))
        weight = [self.probability[a] * self.probability[b] for a, b in self.pairs]
        best = int(np.argmax(weight * (1 - np.exp(-squared / 8))))
        a, b = self.pairs[best]
        return (self.names[a], self.names[b]), float(np.sqrt(squared[best]))


def separation(trial: Measurements, rivals: Rivals) -> Separation:
    """How the visits of `trial`, all with as many rows, separate the rivals. The first one's variance components and springs
    carry the noise."""
    models = [model for model, _ in rivals.values()]
    data = models[0].data.with_rows(trial)
    count = int(trial.visit.max()) + 1
    noise = noise_model(data, models[0].compliance)
    # Posteriors of planned rows must not see single readings' weights: those belong to what was measured.
    weights = noise.weights(models[0].components)
    expected = [response(data, model.map, model.terms) for model in models]
    pairs, grams, before = tuple(combinations(range(len(rivals)), 2)), [], []
    for a, b in pairs:
        (readings_a, slope_a), (readings_b, slope_b) = expected[a], expected[b]
        columns = np.concatenate([slope_a, -slope_b, (readings_a - readings_b)[:, :, None]], axis=2)
        columns = noise.whitening @ columns
        shape = (count, -1, columns.shape[2])
        grams.append(np.swapaxes(columns.reshape(shape), 1, 2) @ weights.apply(columns).reshape(shape))
        covariance = [2 * np.linalg.inv(models[k].quick_covariance) for k in (a, b)]
        count_a, count_b = (len(matrix) for matrix in covariance)
        both = np.zeros((count_a + count_b, count_a + count_b))
        both[:count_a, :count_a], both[count_a:, count_a:] = covariance
        before.append(both)
    probability = np.array([p for _, p in rivals.values()])
    return Separation(tuple(rivals), probability / probability.sum(), pairs, tuple(grams), tuple(before))


def discriminating(separation: Separation, count: int, group: Indices) -> list[int]:
    """The candidates, at most one of each group, that make the bound smallest together: the best one at a time, then each
    exchanged while that helps."""
    chosen: list[int] = []
    for _ in range(min(count, len(np.unique(group)))):
        chosen.append(_best(separation, chosen, group))
    for _ in range(3):
        before = list(chosen)
        for place in range(len(chosen)):
            rest = chosen[:place] + chosen[place + 1:]
            chosen[place] = _best(separation, rest, group)
        if chosen == before:
            break
    # In the order they are worth measuring in: the first is the best one alone.
    ordered: list[int] = []
    while len(ordered) < len(chosen):
        left = [k for k in chosen if k not in ordered]
        ordered.append(min(left, key=lambda k: float(separation.mistaken(separation.of(np.array([*ordered, k]))))))
    return ordered


def _best(separation: Separation, chosen: list[int], group: Indices) -> int:
    known = separation.of(np.array(chosen, dtype=np.intp))
    mistaken = separation.mistaken([gram + total for gram, total in zip(separation.grams, known, strict=True)])
    mistaken[np.isin(group, group[chosen])] = np.inf
    return int(np.argmin(mistaken))


def rivals_of(data: LoadTest, survey: Survey, near: Posterior) -> Rivals:
    """The likeliest hypotheses fitted to the data, with their probabilities; near: a fit to begin near."""
    rivals, held, total = {}, 0.0, sum(hypothesis.probability for hypothesis in survey.hypotheses)
    for hypothesis in survey.hypotheses[:MOST_RIVALS]:
        fitted = attempt(data, survey.terms(hypothesis), near)
        if fitted is not None:
            rivals[survey.name(hypothesis)] = (fitted, hypothesis.probability)
        held += hypothesis.probability
        if held >= HELD * total and len(rivals) > 1:
            break
    return rivals


def robot_difference(models: Sequence[Posterior]) -> float:
    """Largest RMS [m] by which two models of the same rows differ in what the robot itself does under their loads."""
    if len(models) < 2:
        return 0.0
    data = models[0].data
    loaded = data.with_rows(data.rows.select(np.any(data.rows.wrench != 0, axis=1)))
    moved = []
    for model in models:
        kept = [k for k, term in enumerate(model.terms) if term.effect.of_robot]
        x = np.concatenate([model.log_compliance, *(model.term_values[k] for k in kept)])
        moved.append(predicted_deflection(loaded, x, [model.terms[k] for k in kept]))
    return max((rms(a - b) for a, b in combinations(moved, 2)), default=0.0)


def next_loads(rivals: Rivals, rng: np.random.Generator, count: int = 3) -> tuple[NextLoad, ...]:
    """The load cycles, as large as the measured ones, that discriminate best, each at a pose of its own. Where the measured
    ones were all weights, these are hung on and taken off again."""
    if len(rivals) < 2:
        return ()
    data = next(iter(rivals.values()))[0].data
    poses, axes = _candidates(data.cell, rng)
    fall = fall_in_base(data.cell.world_from_base)
    down = fall / np.linalg.norm(fall)
    hung, every = hung_cycle(data.rows, down), 3
    if len(hung):
        poses, every = poses[::3], 1
        rows, forces = planned_rows(poses, np.tile(np.outer(hung, down), (len(poses), 1, 1)), DWELL_S), hung
    else:
        force = float(np.abs(data.rows.wrench[:, :3]).max())
        rows, forces = candidate_rows(poses, axes, force), force * np.array(CYCLE)
    separated = separation(rows, rivals)
    chosen = []
    for k in discriminating(separated, count, np.arange(len(poses)) // every):
        names, distance = separated.best_pair(k)
        chosen.append(NextLoad(poses[k], None if len(hung) else int(axes[k]), forces, distance, names))
    return tuple(chosen)


def hung_cycle(rows: Measurements, down: Array) -> Array:
    """Forces (m,) [N] along `down` (3,) of rows whose loads were all weights: nothing, each by rising size, the same back, and
    nothing; empty where any load was none."""
    loaded = np.any(rows.wrench[:, :3] != 0, axis=1)
    if rows.hung is None or not loaded.any() or not rows.hung[loaded].all():
        return np.zeros(0)
    sizes = np.unique(np.round(rows.wrench[loaded, :3] @ down, 1))
    sizes = sizes[np.argsort(np.abs(sizes), kind="stable")]
    sizes = sizes[np.linspace(0, len(sizes) - 1, min(len(sizes), MOST_WEIGHTS)).astype(int)]
    return np.concatenate([[0.0], sizes, sizes[-2::-1], [0.0]])


def _candidates(cell: Cell, rng: np.random.Generator) -> tuple[Array, Indices]:
    """Random poses well inside the limits, each with all three base axes."""
    robot = cell.robot
    middle = np.clip(0.0, *robot.limits.T)
    theta = middle + 0.6 * rng.uniform(robot.limits[:, 0] - middle, robot.limits[:, 1] - middle, (6 * CANDIDATES, 6))
    theta = theta[(robot.limit_excess(theta) == 0).all(axis=1)][: CANDIDATES // 3]
    return np.repeat(theta, 3, axis=0), np.tile(np.arange(3), len(theta)).astype(np.intp)


def probing_rows(data: LoadTest) -> Measurements:
    """Load cycles as large as the measured ones at random poses, always the same ones, beside which models are held."""
    poses, axes = _candidates(data.cell, np.random.default_rng(0))
    return candidate_rows(poses, axes, float(np.abs(data.rows.wrench[:, :3]).max()))


def candidate_rows(poses: Array, axes: Indices, force: float) -> Measurements:
    """The rows of one load cycle at each pose (c, 6) along its base axis (c,); c * len(CYCLE) rows, nothing measured yet."""
    cycles = np.zeros((len(poses), len(CYCLE), 3))
    cycles[np.arange(len(poses)), :, axes] = force * np.array(CYCLE)
    return planned_rows(poses, cycles, DWELL_S)


def planned_rows(poses: Array, forces: Array, dwell: tuple[float, ...]) -> Measurements:
    """Rows of visits to poses (c, 6) with loads (c, m, 3) [N], nothing measured yet, each as if measured next.

    Each visit has a reference of its own, since the sensors are zeroed there; and rows and labels that no fitted row has, so
    that a step at a certain row or pose of the data does not seem to act there.
    """
    visits, loads = forces.shape[:2]
    count = visits * loads
    visit = np.repeat(np.arange(visits), loads).astype(np.intp)
    held = np.resize(np.array(dwell), loads)
    nothing = np.full((count, 3), np.nan)
    wrench = np.concatenate([forces.reshape(-1, 3), np.zeros((count, 3))], axis=1)
    return Measurements(
        source="candidates", theta=np.repeat(poses, loads, axis=0), wrench=wrench, deflection=np.zeros_like(nothing),
        sigma=nothing, time=np.tile(np.cumsum(held) - held[0], visits), dwell=np.tile(held, visits), visit=visit,
        reference=visit, validate=np.zeros(count, dtype=bool),
        machined_pass=np.full(count, "", dtype=object), pose=np.full(count, "not measured yet", dtype=object),
        row=np.zeros(count, dtype=np.intp), line=np.arange(2, count + 2), findings=())

"""What a design can show of a hidden effect at all, from the noise-free truth and the true noise: before any diagnosis.

The effect's signal is what is left of it, in units of the noise, once the six compliances (within their prior) have taken
what they can. It is detectable if enough is left, identifiable if enough is left after any one other entry of the dictionary
has taken what it can too, whatever its size. The noise's covariance is the one the case was simulated with, not the nominal.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from identification.diagnosis.dictionary import Dictionary, dictionary_of
from identification.diagnosis.projection import Base, scores
from identification.diagnosis.search import base_at
from identification.fit.load_test import LoadTest
from identification.fit.noise import noise_model
from identification.fit.noise_parts import VarianceComponents
from identification.measurements import read_measurements
from identification.model.cell import read_cell
from identification.model.effects import effects
from tests.runs.hidden_effects.judge import label
from tests.virtual_cell.cell import Case, Hidden, simulate

# Square roots of the noncentrality from which an effect can be detected, and told from every other.
DETECTABLE, IDENTIFIABLE = 5.0, 4.0
FREE = 1e12     # variance, in units of the signal, of a column that is free


@dataclass(frozen=True)
class Visible:
    """Of one hidden effect: its label, its signal, what its own entry leaves of the signal, and what the nearest other leaves.
    others: the entries that leave too little, the nearest first, by label."""

    label: str
    signal: float
    own: float
    left: float
    others: tuple[str, ...]

    @property
    def detectable(self) -> bool:
        return self.signal >= DETECTABLE

    @property
    def identifiable(self) -> bool:
        return self.detectable and self.left >= IDENTIFIABLE


def visible(case: Case) -> list[Visible]:
    """One for each hidden effect of the case; of several, each is judged with the others' signals free."""
    alone = [_alone(case, k) for k in range(len(case.hidden))]
    base, dictionary, rotation = _linearised(case)
    fitted = ~case.validate
    signals = [rotation @ (1e-6 * one.effect_um[fitted])[:, :, None] for one in alone]
    found = []
    for k, truth in enumerate(case.truth):
        free = base
        for signal in signals[:k] + signals[k + 1:]:
            free = _with_free(free, signal)
        found.append(_seen(_with_residual(free, signals[k][:, :, 0]), dictionary, label(truth["effect"], truth["joint"])))
    return found


def _seen(base: Base, dictionary: Dictionary, name: str) -> Visible:
    signal = float(np.sqrt(max(base.gram(base.residual[:, :, None])[0, 0], 0.0)))
    ratio = scores(base, dictionary).ratio
    left = {label(entry.effect.name, entry.joint): float(np.sqrt(max(
        signal**2 - ratio[entry.signatures.start: entry.signatures.stop].max(), 0.0))) for entry in dictionary.entries}
    own = left.pop(name, signal)
    near = sorted((rest, other) for other, rest in left.items())
    return Visible(name, signal, own, near[0][0], tuple(other for rest, other in near if rest < IDENTIFIABLE))


def _alone(case: Case, which: int) -> Case:
    """The case with only one of its effects, exactly as it is there."""
    if len(case.hidden) == 1:
        return case
    hidden = Hidden(case.hidden[which].effect, case.hidden[which].joint, case.hidden[which].factor,
                    case.truth[which]["parameters"])
    return simulate(case.seed, case.design_name, (hidden,), case.noise, validation=len(set(case.design.pose[case.validate])),
                    tool=case.tool, gravity=case.gravity, stiffness=case.stiffness)


def _linearised(case: Case) -> tuple[Base, Dictionary, np.ndarray]:
    """The plain model at the true stiffnesses under the true noise, the dictionary there, and what whitens (n, 3, 3)."""
    n = case.noise
    stated = replace(case, noise=replace(n, stated_sensor_um=max(n.sensor_um, 1e-3), stated_force_n=n.force_n,
                                         stated_force_relative=n.force_relative, stated_pose_offset_um=n.pose_offset_um))
    with TemporaryDirectory() as folder:
        cell_file, measurements = stated.write(Path(folder))
        cell = read_cell(cell_file)
        rows = read_measurements(measurements, cell.robot)
    data = LoadTest.of(cell, rows.select(~rows.validate))
    noise = noise_model(data, 1 / case.stiffness)
    base = base_at(data, -np.log(case.stiffness), noise, noise.weights(VarianceComponents()))
    return base, dictionary_of(data.load_state(1 / case.stiffness), noise, effects()), noise.whitening


def _with_residual(base: Base, residual: np.ndarray) -> Base:
    """The same model with another residual (n, 3), and nothing that pulls at its start."""
    return Base(base.design, residual, base.weights, base.precision, np.zeros_like(base.shift))


def _with_free(base: Base, column: np.ndarray) -> Base:
    """The model with one more column (n, 3, 1) that is free."""
    size = len(base.precision)
    precision = np.zeros((size + 1, size + 1))
    precision[:size, :size] = base.precision
    precision[size, size] = 1 / FREE
    return Base(np.concatenate([base.design, column], axis=2), base.residual, base.weights, precision, np.zeros(size + 1))


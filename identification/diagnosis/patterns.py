"""Patterns that no cause is needed for: what a residual would show if something outside the dictionary were wrong.

Each is a set of columns H with coefficients that average out; its statistic is the sum of squares of `H^T W r`, its own
distribution matched by two moments of the replicates. A model that explains the data leaves none of them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.model.situation import Situation
from identification.noise import NoiseModel

Array = NDArray[np.float64]
# Waves over the time (or order) of the measurements.
WAVES = 4


@dataclass(frozen=True, eq=False)
class Pattern:
    """name: what is seen, in plain words. columns (3n, m) in the noise's coordinates."""

    name: str
    columns: Array

    def surprise(self, weighted: Array, variance: Array) -> Array:
        """-log10 of its probability (B,), from W r (3n, B); the first is the data, the others replicates of the null."""
        from scipy.stats import chi2

        total = np.sum((self.columns.T @ weighted) ** 2, axis=0) / variance
        null = total[1:]
        mean, spread = float(null.mean()), float(null.var())
        if mean <= 0 or spread <= 0:
            return np.zeros(len(total))
        # Satterthwaite: total ~ a chi2(d)
        scale = spread / (2 * mean)
        return np.asarray(np.maximum(-chi2.logsf(total / scale, mean / scale) / np.log(10), 0.0))


def patterns(where: Situation, noise: NoiseModel) -> tuple[Pattern, ...]:
    """The patterns these rows can show."""
    force = where.wrench[:, :3]
    size = np.linalg.norm(force, axis=1)
    typical = max(float(size.max(initial=0.0)), 1e-9)
    order = np.linspace(0.0, 1.0, len(where)) if np.isnan(where.time).any() else _scaled(where.time)
    found = []

    def add(name: str, groups: Array, values: Array) -> None:
        """One coefficient a group and base axis: values (n,) where the group is."""
        indicator = (groups[:, None] == np.unique(groups)) * values[:, None]
        indicator = indicator[:, np.count_nonzero(indicator, axis=0) > 1]
        if indicator.shape[1]:
            columns = indicator[:, None, :, None] * np.eye(3)[None, :, None, :]
            whitened = noise.rotation @ columns.reshape(len(where), 3, -1)
            found.append(Pattern(name, whitened.reshape(3 * len(where), -1)))

    visit = where.visit.astype(float)
    along = _along(force) / typical
    axis = np.argmax(np.abs(force), axis=1)
    before = np.concatenate([[0.0], along[:-1]])
    before[where.starts] = 0.0
    everywhere = np.zeros(len(where))
    by_axis = visit * 3 + axis
    add("the deflection of single poses does not grow with the load as the springs say", by_axis, along)
    add("the deflection does not turn round with the load", by_axis, np.abs(along))
    add("the deflection does not grow in proportion to the load", by_axis, along * np.abs(along) - 0.7 * along)
    add("what a load leaves depends on the load before", by_axis, np.sign(along - before))
    add("zero readings within a pose wander", visit, (size == 0) * (order - 0.5))
    for wave in range(1, WAVES + 1):
        add("the readings wander with time", everywhere, np.cos(np.pi * wave * order))
        add("the robot softens or stiffens with time", axis.astype(float), along * np.cos(np.pi * wave * order))
    return tuple(_joined(found))


def _joined(found: list[Pattern]) -> list[Pattern]:
    """Patterns of one name as one."""
    names = dict.fromkeys(pattern.name for pattern in found)
    return [Pattern(name, np.concatenate([p.columns for p in found if p.name == name], axis=1)) for name in names]


def _along(force: Array) -> Array:
    """The force's size with the sign of its largest component (n,) [N]."""
    largest = np.take_along_axis(force, np.argmax(np.abs(force), axis=1)[:, None], axis=1)[:, 0]
    return np.asarray(np.linalg.norm(force, axis=1) * np.sign(largest))


def _scaled(time: Array) -> Array:
    return np.asarray((time - time.min()) / max(float(np.ptp(time)), 1e-9))

"""Patterns that no cause is needed for: what a residual would show if something outside the dictionary were wrong.

Each is a set of columns, alike in kind (joints whose deflection is not proportional to their torque, loads that leave something
behind), each scaled to what the data can tell of it; its statistic is the sum of squares of `H^T W r`, its distribution
matched by two moments of the replicates. A model that explains the data leaves none of them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.diagnosis.projection import Base
from identification.fit.noise import NoiseModel
from identification.model.load_state import LoadState

Array = NDArray[np.float64]
# Waves over the time (or order) of the measurements, and over a joint's angle.
WAVES = 4
TURNS = (1, 2, 3)
# A column that the fitted model explains to this share of its own size says nothing of the residual.
EXPLAINED = 1e-4


@dataclass(frozen=True, eq=False)
class Pattern:
    """name: what is seen, in plain words. columns (n, 3, m) in the noise's coordinates."""

    name: str
    columns: Array

    def surprise(self, base: Base, left: Array, variance: Array) -> Array:
        """-log10 of its probability (B,), from `W (r - D step)` (3n, B); the first is the data, the others replicates."""
        from scipy.stats import chi2

        own = np.einsum("ncm,ncm->m", self.columns, base.weights.apply(self.columns))
        free = np.einsum("mm->m", base.gram(self.columns))
        kept = free > EXPLAINED * np.maximum(own, 1e-300)
        if not kept.any():
            return np.zeros(left.shape[1])
        columns = self.columns[:, :, kept].reshape(left.shape[0], -1) / np.sqrt(free[kept])
        total = np.sum((columns.T @ left) ** 2, axis=0) / variance
        mean, spread = float(total[1:].mean()), float(total[1:].var())
        # Satterthwaite: total ~ a chi2(d)
        scale = spread / (2 * mean)
        return np.asarray(np.maximum(-chi2.logsf(total / scale, mean / scale) / np.log(10), 0.0))


def patterns(where: LoadState, noise: NoiseModel) -> tuple[Pattern, ...]:
    """The patterns these rows can show."""
    force = where.wrench[:, :3]
    size = np.linalg.norm(force, axis=1)
    typical = max(float(size.max(initial=0.0)), 1e-9)
    order = np.linspace(0.0, 1.0, len(where)) if np.isnan(where.time).any() else _scaled(where.time)
    columns: dict[str, list[Array]] = {}

    def add(name: str, *found: Array) -> None:
        columns.setdefault(name, []).extend(found)

    along = _along(force) / typical
    change = along - _before(along, where.starts)
    pose = where.visit * 3.0 + np.argmax(np.abs(force), axis=1)
    add("single poses do not yield as the springs say", *_by_group(pose, along))
    add("the deflection does not turn round with the load", *_by_group(pose, np.abs(along)))
    add("what a load leaves depends on the load before", *_by_group(pose, np.sign(change)))
    add("zero readings wander within a pose", *_by_group(where.visit.astype(float), (size == 0) * (order - 0.5)))
    waves = [np.cos(np.pi * wave * order) for wave in range(1, WAVES + 1)]
    add("the readings wander with time", *(column for wave in waves for column in _axes(wave)))
    for i in range(6):
        move, torque = where.jacobian[:, :3, i], where.torque[:, i]
        t = torque / max(float(np.abs(torque).max(initial=0.0)), 1e-9)
        step = t - _before(t, where.starts)
        spring = move * t[:, None]
        add("a joint's deflection is not proportional to its torque", spring * np.abs(t)[:, None], spring * t[:, None] ** 2)
        add("a joint yields differently to torques of either sign", move * np.abs(t)[:, None], move * t[:, None] ** 2)
        add("a joint's deflection depends on the torque before", move * np.sign(step)[:, None],
            move * _before(t, where.starts)[:, None])
        for turn in TURNS:
            angle = turn * where.theta[:, i]
            add("a joint is softer at some angles than at others", spring * np.cos(angle)[:, None],
                spring * np.sin(angle)[:, None])
        add("a joint softens or stiffens with time", *(spring * wave[:, None] for wave in waves))
    for j in range(3):
        f = force[:, j] / typical
        step = f - _before(f, where.starts)
        add("a load along one axis moves the tool in a way no spring explains", *_axes(f), *_axes(np.abs(f)))
        add("a load along one axis leaves something behind", *_axes(np.sign(step)), *_axes(_before(f, where.starts)))
    pushed = np.linalg.norm(force, axis=1) / typical
    for j in range(3):
        axis = where.tool[:, :, j]
        own = np.einsum("ni,ni->n", axis, force)[:, None] / typical
        add("tool or spindle move in a way no spring explains", axis * own, axis * np.abs(own), axis * np.sign(own))
        side = np.zeros((len(where), 6))
        side[:, j] = typical * pushed
        moved = where.compliant(side)[:, :3]
        add("a load brings another force along", moved,
            *(moved * wave[:, None] for wave in (np.cos(where.theta[:, 0]), np.sin(where.theta[:, 0]))))
    found = []
    for name, members in columns.items():
        seen = [column for column in members if np.count_nonzero(np.abs(column).sum(axis=1)) > 1]
        if seen:
            found.append(Pattern(name, noise.rotation @ np.stack(seen, axis=2)))
    return tuple(found)


def _axes(values: Array) -> list[Array]:
    """values (n,) on each of the three readings (n, 3)."""
    return [values[:, None] * axis for axis in np.eye(3)]


def _by_group(group: Array, values: Array) -> list[Array]:
    """values (n,) on each reading of each group of rows by itself."""
    return [column for one in np.unique(group) for column in _axes(values * (group == one))]


def _before(values: Array, starts: NDArray[np.bool_]) -> Array:
    """The value of the row before (n,), zero at the start of a pose."""
    before = np.concatenate([[0.0], values[:-1]])
    before[starts] = 0.0
    return before


def _along(force: Array) -> Array:
    """The force's size with the sign of its largest component (n,) [N]."""
    largest = np.take_along_axis(force, np.argmax(np.abs(force), axis=1)[:, None], axis=1)[:, 0]
    return np.asarray(np.linalg.norm(force, axis=1) * np.sign(largest))


def _scaled(time: Array) -> Array:
    return np.asarray((time - time.min()) / max(float(np.ptp(time)), 1e-9))

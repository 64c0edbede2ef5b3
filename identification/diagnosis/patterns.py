"""Patterns that no cause is needed for: what a residual would show if something outside the dictionary were wrong.

Each is a set of columns, alike in kind (joints whose deflection is not proportional to their torque, loads that leave something
behind), each scaled to what the data can tell of it; its statistic is the sum of squares of `H^T W r`, its distribution
matched by two moments of the replicates. A model that explains the data leaves none of them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.diagnosis.projection import Base
from identification.fit.sight import Sight
from identification.model.load_state import LoadState

Array = NDArray[np.float64]
# A pattern's name, in plain words, and some of its columns (n, 3) [m, but for a factor].
Named = tuple[str, list[Array]]
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
        cross = base.cross(self.columns)
        free = own - np.einsum("qm,qm->m", cross, base.inverse @ cross)
        kept = free > EXPLAINED * np.maximum(own, 1e-300)
        if not kept.any():
            return np.zeros(left.shape[1])
        columns = self.columns[:, :, kept].reshape(left.shape[0], -1) / np.sqrt(free[kept])
        total = np.sum((columns.T @ left) ** 2, axis=0) / variance
        mean, spread = float(total[1:].mean()), float(total[1:].var())
        # Satterthwaite: total ~ a chi2(d)
        scale = spread / (2 * mean)
        return np.asarray(np.maximum(-chi2.logsf(total / scale, mean / scale) / np.log(10), 0.0))


def patterns_of(state: LoadState, sight: Sight) -> tuple[Pattern, ...]:
    """The patterns these rows can show."""
    force = state.wrench[:, :3]
    typical = max(float(np.linalg.norm(force, axis=1).max(initial=0.0)), 1e-9)
    order = np.linspace(0.0, 1.0, len(state)) if np.isnan(state.time).any() else _scaled(state.time)
    waves = [np.cos(np.pi * wave * order) for wave in range(1, WAVES + 1)]
    columns: dict[str, list[Array]] = {}
    for name, members in (*_of_poses(state, typical, order, waves), *_of_joints(state, waves), *_of_axes(state, typical),
                          *_of_tool(state, typical)):
        columns.setdefault(name, []).extend(members)
    patterns = []
    for name in list(columns):
        # Each makes room for the next: those of single poses are as many as the poses.
        seen = [column for column in columns.pop(name) if np.count_nonzero(np.abs(column).sum(axis=1)) > 1]
        if seen:
            patterns.append(Pattern(name, sight.whitened(np.stack(seen, axis=2))))
    return tuple(patterns)


def _of_poses(state: LoadState, typical: float, order: Array, waves: list[Array]) -> Iterator[Named]:
    """Poses by themselves, and the order of the rows."""
    force = state.wrench[:, :3]
    unloaded = np.linalg.norm(force, axis=1) == 0
    along = _along(force) / typical
    change = along - _before(along, state.starts)
    pose = state.visit * 3.0 + np.argmax(np.abs(force), axis=1)
    yield "single poses do not yield as the springs say", _by_group(pose, along)
    yield "the deflection does not turn round with the load", _by_group(pose, np.abs(along))
    yield "what a load leaves depends on the load before", _by_group(pose, np.sign(change))
    yield "zero readings wander within a pose", _by_group(state.visit.astype(float), unloaded * (order - 0.5))
    yield "the readings wander with time", [column for wave in waves for column in _axes(wave)]


def _of_joints(state: LoadState, waves: list[Array]) -> Iterator[Named]:
    """Gears that are no linear springs."""
    for i in range(6):
        move, torque = state.jacobian[:, :3, i], state.torque[:, i]
        t = torque / max(float(np.abs(torque).max(initial=0.0)), 1e-9)
        before = _before(t, state.starts)
        step = t - before
        spring = move * t[:, None]
        yield "a joint's deflection is not proportional to its torque", [spring * np.abs(t)[:, None], spring * t[:, None] ** 2]
        yield "a joint yields differently to torques of either sign", [move * np.abs(t)[:, None], move * t[:, None] ** 2]
        yield "a joint's deflection depends on the torque before", [move * np.sign(step)[:, None], move * before[:, None]]
        for turn in TURNS:
            angle = turn * state.theta[:, i]
            yield "a joint is softer at some angles than at others", [spring * np.cos(angle)[:, None],
                                                                      spring * np.sin(angle)[:, None]]
        yield "a joint softens or stiffens with time", [spring * wave[:, None] for wave in waves]


def _of_axes(state: LoadState, typical: float) -> Iterator[Named]:
    """Loads along one base axis."""
    for j in range(3):
        f = state.wrench[:, j] / typical
        before = _before(f, state.starts)
        step = f - before
        yield "a load along one axis moves the tool in a way no spring explains", [*_axes(f), *_axes(np.abs(f))]
        yield "a load along one axis leaves something behind", [*_axes(np.sign(step)), *_axes(before)]


def _of_tool(state: LoadState, typical: float) -> Iterator[Named]:
    """The tool's own axes, and forces that come along with the load."""
    force = state.wrench[:, :3]
    pushed = np.linalg.norm(force, axis=1) / typical
    for j in range(3):
        axis = state.tool[:, :, j]
        own = np.einsum("ni,ni->n", axis, force)[:, None] / typical
        yield "tool or spindle move in a way no spring explains", [axis * own, axis * np.abs(own), axis * np.sign(own)]
        side = np.zeros((len(state), 6))
        side[:, j] = typical * pushed
        moved = state.compliant(side)[:, :3]
        yield "a load brings another force along", [
            moved, *(moved * wave[:, None] for wave in (np.cos(state.theta[:, 0]), np.sin(state.theta[:, 0])))]


def _axes(values: Array) -> list[Array]:
    """values (n,) on each of the three readings (n, 3)."""
    return [values[:, None] * axis for axis in np.eye(3)]


def _by_group(group: Array, values: Array) -> list[Array]:
    """values (n,) on each reading of each group of rows by itself."""
    return [column for number in np.unique(group) for column in _axes(values * (group == number))]


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

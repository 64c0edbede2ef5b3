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

from identification.common.tails import chi2_surprise
from identification.diagnosis.projection import Base
from identification.fit.noise import NoiseModel
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
    """name: what is seen, in plain words. columns (n, 3, m) in the coordinates of `noise`; by_visit: each visit has its own;
    seen (visits, m), or (1, m): which of them more than one row shows."""

    name: str
    columns: Array
    noise: NoiseModel
    by_visit: bool
    seen: NDArray[np.bool_]

    def surprise(self, base: Base, left: Array, variance: Array) -> Array:
        """-log10 of its probability (B,), from `W (r - D step)` (3n, B); the first is the data, the others replicates."""
        weighted = base.weights.apply(self.columns)
        own = _sums(self.noise, np.sum(self.columns * weighted, axis=1), self.by_visit)
        cross = self._products(base.weighted_design)
        free = own - np.sum(cross * (cross @ base.inverse), axis=2)
        kept = self.seen & (free > EXPLAINED * np.maximum(own, 1e-300))
        if not kept.any():
            return np.zeros(left.shape[1])
        score = self._products(left.reshape(*self.columns.shape[:2], -1))
        total = np.sum(score[kept] ** 2 / free[kept][:, None], axis=0) / variance
        mean, spread = float(total[1:].mean()), float(total[1:].var())
        # Satterthwaite: total ~ a chi2(d)
        scale = spread / (2 * mean)
        return chi2_surprise(total / scale, mean / scale)

    def _products(self, right: Array) -> Array:
        """columns^T right (visits, m, q), or (1, m, q), of right (n, 3, q)."""
        if self.by_visit:
            return self.noise.products(self.columns, right)
        return np.asarray(self.columns.reshape(-1, self.columns.shape[2]).T @ right.reshape(-1, right.shape[2]))[None]


def patterns_of(state: LoadState, noise: NoiseModel) -> tuple[Pattern, ...]:
    """The patterns these rows can show."""
    force = state.wrench[:, :3]
    typical = max(float(np.linalg.norm(force, axis=1).max(initial=0.0)), 1e-9)
    order = np.linspace(0.0, 1.0, len(state)) if np.isnan(state.time).any() else _scaled(state.time)
    waves = [np.cos(np.pi * wave * order) for wave in range(1, WAVES + 1)]
    columns: dict[str, list[Array]] = {}
    for name, members in (*_of_order(waves), *_of_joints(state, waves), *_of_axes(state, typical),
                          *_of_tool(state, typical)):
        columns.setdefault(name, []).extend(members)
    return tuple(pattern for pattern in (
        *(_pattern(name, members, noise, by_visit=True) for name, members in _of_single_poses(state, typical, order)),
        *(_pattern(name, members, noise, by_visit=False) for name, members in columns.items())) if pattern.seen.any())


def _pattern(name: str, members: list[Array], noise: NoiseModel, by_visit: bool) -> Pattern:
    columns = np.stack(members, axis=2)
    seen = _sums(noise, np.any(columns, axis=1).astype(int), by_visit) > 1
    shown = seen.any(axis=0)
    return Pattern(name, noise.whitened(columns[:, :, shown]), noise, by_visit, seen[:, shown])


def _sums(noise: NoiseModel, values: Array, by_visit: bool) -> Array:
    """Sums (visits, m), or (1, m), of values (n, m)."""
    return noise.by_visit(values) if by_visit else np.asarray(values.sum(axis=0))[None]


def _of_single_poses(state: LoadState, typical: float, order: Array) -> Iterator[Named]:
    """Poses by themselves: what each visit has of its own."""
    force = state.wrench[:, :3]
    unloaded = np.linalg.norm(force, axis=1) == 0
    along = _along(force) / typical
    change = along - _before(along, state.starts)
    axis = np.argmax(np.abs(force), axis=1)
    yield "single poses do not yield as the springs say", _by_axis(axis, along)
    yield "the deflection does not turn round with the load", _by_axis(axis, np.abs(along))
    yield "what a load leaves depends on the load before", _by_axis(axis, np.sign(change))
    yield "zero readings wander within a pose", _axes(unloaded * (order - 0.5))


def _of_order(waves: list[Array]) -> Iterator[Named]:
    """The order of the rows."""
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


def _by_axis(axis: NDArray[np.intp], values: Array) -> list[Array]:
    """values (n,) on each reading of the rows loaded along each axis (n,) by itself."""
    return [column for number in range(3) for column in _axes(values * (axis == number))]


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

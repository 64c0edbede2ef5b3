"""A quick look at hundreds of mistakes: the linear model z = A c on the data as each would mend them.

Readings are taken with one variance for all axes of a row (the sensor's, and the stated error of the force as a share of the
deflection), so that it is the same however the axes are mixed up; re-seating is integrated out. What a visit says of the
springs is then three sums, and those of any rows together are sums of these. The noise's common scale is free: a gross misfit
has one of its own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.fit.load_test import LoadTest
from identification.fit.noise import USUAL_OFFSET_M, force_error
from identification.model.kinematics import jacobian

Array = NDArray[np.float64]
ROUNDS = 60
# A data set is at its best springs where a step gains less of ln likelihood, or none does however short.
LITTLE, HOPELESS = 1e-9, 1e6
# A force under this is none [N].
LEAST_FORCE = 1.0
# No robot is softer than so many times its prior's medians: of a small force no large reading's error is a share.
SOFTEST = 10.0


@dataclass(frozen=True, eq=False)
class Sums:
    """What each of V visits says of u = c k_prior (6,): gram (V, 6, 6), pull (V, 6), squares (V,), how many readings (V,), and
    ln of the noise's determinant (V,)."""

    gram: Array
    pull: Array
    squares: Array
    count: Array
    log_determinant: Array

    def total(self) -> Sums:
        """Of all visits: one."""
        return Sums(*(np.sum(part, axis=0, keepdims=True) for part in self._parts))

    def up_to(self) -> Sums:
        """Of the first one, two, ... V visits."""
        return Sums(*(np.cumsum(part, axis=0) for part in self._parts))

    def __add__(self, other: Sums) -> Sums:
        return Sums(*(a + b for a, b in zip(self._parts, other._parts, strict=True)))

    def __sub__(self, other: Sums) -> Sums:
        return Sums(*(a - b for a, b in zip(self._parts, other._parts, strict=True)))

    def __getitem__(self, which: slice | NDArray[np.intp]) -> Sums:
        return Sums(*(part[which] for part in self._parts))

    @property
    def _parts(self) -> tuple[Array, Array, Array, Array, Array]:
        return self.gram, self.pull, self.squares, self.count, self.log_determinant

    @staticmethod
    def joined(sums: list[Sums]) -> Sums:
        """One behind the other."""
        return Sums(*(np.concatenate(parts) for parts in zip(*(each._parts for each in sums), strict=True)))


@dataclass(frozen=True, eq=False)
class Linear:
    """The linear model of some rows: columns (n, 3, 6) for compliances in units of the prior's medians, readings (n, 3) [m]
    with zero where none was taken, and the variance (n,) [m^2] of a reading."""

    data: LoadTest
    columns: Array
    readings: Array
    variance: Array


def sums(model: Linear) -> Sums:
    """Of these rows, by visit."""
    data, columns, scaled, variance = model.data, model.columns, model.readings, model.variance
    precision = np.where(np.isnan(data.rows.deflection), 0.0, 1 / variance[:, None])
    offset = data.cell.noise.pose_offset if data.cell.noise.offset_stated else np.full(3, USUAL_OFFSET_M)
    order = np.argsort(data.rows.visit, kind="stable")
    starts = np.unique(data.rows.visit[order], return_index=True)[1]

    def by_visit(values: Array) -> Array:
        return np.asarray(np.add.reduceat(values[order], starts, axis=0))

    both = np.concatenate([columns, scaled[:, :, None]], axis=2)
    weighted = precision[:, :, None] * both
    weight, first = by_visit(precision), by_visit(weighted)
    # Re-seating, one draw a visit and axis, integrated out.
    shared = offset**2 / (1 + offset**2 * weight)
    gram = by_visit(np.einsum("nap,naq->npq", weighted, both)) - np.einsum("vap,va,vaq->vpq", first, shared, first)
    measured = precision > 0
    log_determinant = by_visit((measured * np.log(variance)[:, None]).sum(axis=1)) + np.log1p(offset**2 * weight).sum(axis=1)
    return Sums(gram[:, :6, :6], gram[:, :6, 6], gram[:, 6, 6], by_visit(measured.sum(axis=1).astype(float)), log_determinant)


def linear(data: LoadTest, arm: Array | None = None) -> Linear:
    """The linear model of these rows; arm (n, 6, 6): the springs' Jacobian at their poses, where it is known."""
    cell, rows = data.cell, data.rows
    arm = spring_jacobian(data) if arm is None else arm
    torque = np.einsum("nri,nr->ni", arm, rows.wrench)
    columns = arm[:, :3] * torque[:, None, :] / data.prior.prior.stiffness
    readings = np.nan_to_num(rows.deflection)
    sensor = np.where(np.isnan(rows.sigma), cell.noise.deflection, rows.sigma)
    force = np.linalg.norm(rows.wrench[:, :3], axis=1)
    absolute, relative = force_error(cell.noise)
    share = np.minimum(relative**2 + np.mean(absolute**2) / np.maximum(force, LEAST_FORCE) ** 2, 1.0)
    most = SOFTEST * np.linalg.norm(columns.sum(axis=2), axis=1)
    moved = np.minimum(np.linalg.norm(readings, axis=1), most)
    return Linear(data, columns, readings, np.mean(sensor**2, axis=1) + share * moved**2)


def spring_jacobian(data: LoadTest) -> Array:
    """The springs' Jacobian (n, 6, 6) [m/rad, rad/rad] at the poses of these rows."""
    return jacobian(data.cell.robot, data.rows.theta, data.cell.flange_from_tcp)


def log_scores(each: Sums, log_std: Array) -> tuple[Array, Array]:
    """ln of how likely each of H data sets is under its best springs (H,), and these, ln c k_prior (H, 6).

    log_std (6,): of the log-normal prior. The common scale of the noise is the likeliest one.
    """
    count = np.maximum(each.count, 1.0)
    x = np.zeros_like(each.pull)
    damping = np.full(len(x), 1e-3)

    def chi2(which: NDArray[np.intp], x: Array) -> Array:
        c, gram, pull = np.exp(x), each.gram[which], each.pull[which]
        value = each.squares[which] - 2 * np.einsum("hp,hp->h", pull, c) + np.einsum("hp,hpq,hq->h", c, gram, c)
        return np.asarray(np.maximum(value, 1e-3 * count[which]))

    def cost(which: NDArray[np.intp], x: Array, left: Array) -> Array:
        readings = count[which]
        return np.asarray(0.5 * readings * np.log(left / readings) + 0.5 * np.sum((x / log_std) ** 2, axis=1))

    ahead = np.arange(len(x))
    left = chi2(ahead, x)
    value = cost(ahead, x, left)
    for _ in range(ROUNDS):
        gram, at, c, scale = each.gram[ahead], x[ahead], np.exp(x[ahead]), (left[ahead] / count[ahead])[:, None]
        gradient = c * (each.pull[ahead] - np.einsum("hpq,hq->hp", gram, c)) / scale - at / log_std**2
        curvature = c[:, :, None] * gram * c[:, None, :] / scale[:, :, None] + np.diag(1 / log_std**2)
        diagonal = np.einsum("hpp->hp", curvature)
        damped = curvature + np.eye(6) * (damping[ahead, None] * diagonal)[:, None, :]
        steps = np.linalg.solve(damped, gradient[:, :, None])[:, :, 0]
        steps *= np.minimum(1.0, 1.5 / np.maximum(np.abs(steps).max(axis=1), 1e-300))[:, None]
        trial = at + steps
        trial_left = chi2(ahead, trial)
        trial_value = cost(ahead, trial, trial_left)
        gained = value[ahead] - trial_value
        better = gained >= 0
        moved = ahead[better]
        x[moved], left[moved], value[moved] = trial[better], trial_left[better], trial_value[better]
        damping[ahead] = np.where(better, 0.2 * damping[ahead], 5 * damping[ahead] + 1e-12)
        ahead = ahead[np.where(better, gained >= LITTLE, damping[ahead] <= HOPELESS)]
        if not len(ahead):
            break
    return -value - 0.5 * each.log_determinant, x

"""Axis: one joint of one or more records as a linear model, and the generalised least squares that answers it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from identification.model.effects.gear_damping import GearDamping
from identification.model.joint_log import JointLog
from identification.motion.autoregression import Autoregression, noise_beside
from identification.motion.band import BAND, low_pass, thinned
from identification.motion.dictionary import Shape, catalogue, shapes
from identification.motion.log_file import MotionLog
from identification.motion.smooth import Smooth

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Axis:
    """A joint in the records that have it, low-passed to `band` [Hz], the records below one another.

    deflection (n,) [rad], torque (n,) [N m], angle (n,) [rad] of the motor, time (n,) [s]; lengths: samples of
    each record; dictionary: the shapes of each effect that the joint can show. band infinite: nothing was filtered.
    smooth: an error over the joint's angle that stands beside the spring; None: none.
    """

    joint: int
    logs: list[JointLog]
    rates: list[float]
    band: float
    deflection: Array
    torque: Array
    angle: Array
    time: Array
    lengths: tuple[int, ...]
    dictionary: list[list[Shape]]
    smooth: Smooth | None = None

    @cached_property
    def spring(self) -> Array:
        """Columns (n, records + 1) of the plain spring: an offset for each record, then the torque."""
        offsets = np.zeros((len(self.torque), len(self.lengths)))
        start = 0
        for k, length in enumerate(self.lengths):
            offsets[start: start + length, k] = 1.0
            start += length
        return np.column_stack([offsets, self.torque])

    @cached_property
    def plain(self) -> Array:
        """Columns of all that stands beside the effects: the plain spring, then the smooth error over the angle."""
        return self.spring if self.smooth is None else np.column_stack([self.spring, self.smooth.columns(self.angle)])

    @cached_property
    def widest(self) -> Array:
        """Columns (n, p) of the plain spring and the whole dictionary, one shape of each effect: the one in the middle. A gear
        that is damped has the column of a torque that is late."""
        return np.column_stack([self.plain, *(group[len(group) // 2].columns for group in self.dictionary
                                              if group[0].name != GearDamping.name)])

    @cached_property
    def noise(self) -> Autoregression:
        """The noise: what is left beside the whole dictionary."""
        scale = np.linalg.norm(self.widest, axis=0)
        return noise_beside(self.parts(self.widest / scale), self.parts(self.deflection))

    @cached_property
    def penalty(self) -> Array:
        """What the smooth error's prior adds to the normal equations, for the columns of `plain`: (noise / size)^2, else 0."""
        penalty = np.zeros(self.plain.shape[1])
        if self.smooth is not None:
            penalty[self.spring.shape[1]:] = self.white_variance / self.smooth.size**2
        return penalty

    @cached_property
    def white_variance(self) -> float:
        """Variance [rad^2] of the white part of the noise, beside the whole dictionary."""
        white = self.whiten(self.widest / np.linalg.norm(self.widest, axis=0))
        left = self.white_deflection - white @ np.linalg.lstsq(white, self.white_deflection, rcond=1e-10)[0]
        return float(left @ left / max(1, len(left) - white.shape[1]))

    def parts(self, values: Array) -> list[Array]:
        """The records' parts of rows that stand below one another."""
        return np.split(values, np.cumsum(self.lengths)[:-1])

    def whiten(self, columns: Array) -> Array:
        """Columns (n, p) whitened by the noise's autoregression, records below one another, each a few rows shorter."""
        return np.concatenate([self.noise.whiten(part) for part in self.parts(columns)])

    @cached_property
    def white_deflection(self) -> Array:
        """The deflection whitened likewise."""
        return self.whiten(self.deflection[:, None])[:, 0]


def axis_of(
    joint: int, records: list[MotionLog], band: float = BAND, smooth: Smooth | None = None, only: tuple[str, ...] = ()
) -> Axis:
    """The joint in the records that have it; only: the effects of its dictionary, all where empty."""
    having = [record for record in records if joint in record.joints]
    logs = [record.joints[joint] for record in having]
    rates = [record.rate for record in having]
    parts = [low_pass(np.column_stack([log.deflection, log.torque, log.angle]), rate, band)
             for log, rate in zip(logs, rates, strict=True)]
    deflection, torque, angle = np.concatenate(parts).T
    time = np.concatenate([thinned(record.time, rate, band) for record, rate in zip(having, rates, strict=True)])
    return Axis(joint, logs, rates, band, deflection, torque, angle, time,
                tuple(len(part) for part in parts), shapes(logs, rates, band, catalogue(only, over_angle=smooth is None)),
                smooth)


@dataclass(frozen=True, eq=False)
class Solved:
    """A linear model's answer. coefficients (p,), covariance (p, p) under autocorrelated noise, chi2: whitened sum of squares,
    count: whitened rows."""

    coefficients: Array
    covariance: Array
    chi2: float
    count: int


def solve(axis: Axis, columns: Array) -> Solved:
    """Generalised least squares of the deflection on columns (n, p), those of `plain` first, with the smooth error's prior."""
    scale = np.linalg.norm(columns, axis=0)
    scale[scale == 0] = 1.0
    white = axis.whiten(columns / scale)
    deflection = axis.white_deflection
    penalty = np.zeros(columns.shape[1])
    penalty[: len(axis.penalty)] = axis.penalty
    return answered(white.T @ white, white.T @ deflection, float(deflection @ deflection), len(deflection), penalty, scale,
                    len(axis.noise.phi))


def answered(
    gram: Array, moment: Array, total: float, count: int, penalty: Array, scale: Array, order: int
) -> Solved:
    """From the products of whitened columns of length one (p, p), with the deflection (p,) and of this with itself; scale (p,):
    the columns' lengths; count: whitened rows; order: of the noise's autoregression."""
    prior = penalty / scale**2
    inverse = np.linalg.pinv(gram + np.diag(prior), rcond=1e-12, hermitian=True)
    coefficients = inverse @ moment
    left = total - 2 * float(moment @ coefficients) + float(coefficients @ gram @ coefficients)
    chi2 = max(left, 1e-15 * total) + float(prior @ coefficients**2)
    free = len(moment) - float(prior @ np.diag(inverse))
    covariance = inverse * chi2 / max(1.0, count - free - order) / np.outer(scale, scale)
    return Solved(coefficients / scale, covariance, chi2, count)


def straight_line(axis: Axis) -> Array:
    """Offsets and compliance (records + 1,) of the plain spring by ordinary least squares: the straight line one would draw."""
    return np.asarray(np.linalg.lstsq(axis.spring, axis.deflection, rcond=None)[0], dtype=float)

"""The weight of what hangs on the force sensor, at any orientation; its mass, its centre and the sensor's bias from still ones.

With g the acceleration of free fall in the log's axes, a reading without contact is (log frame, moments about its origin)

    F = b_F + m g,      M = b_M + (m c) x g,

linear in the ten parameters b_F, m, b_M, m c. Only orientations that differ separate b_F from m; the centre needs g to turn in
two directions, since a moment arm along g does not show.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identification.common.arrays import Array, read_only
from identification.model.gravity import FREE_FALL

# g must turn by about this much [rad], RMS over the readings, for what depends on it to be told apart from the bias.
TURN = 0.1


@dataclass(frozen=True, eq=False)
class Payload:
    """What still readings (n) say: 10 parameters with standard deviations; all in the log's frame and sign `on tool`.

    bias, bias_std (6,) [N, N m], moments NaN where there are none; mass, mass_std [kg]; centre, centre_std (3,) [m], None where
    the orientations do not separate it, or there are no moments. force_dof, moment_dof: degrees of freedom behind the standard
    deviations. force_scatter [N], moment_scatter [N m]: of one reading about the law. turn (2,) [rad]: how far g turned, RMS:
    in all, and the least over two directions. force_covariance (4, 4) of b_F and m; moment_covariance (6, 6) of b_M and m c,
    None where these are not told.
    """

    bias: Array
    bias_std: Array
    mass: float
    mass_std: float
    centre: Array | None
    centre_std: Array | None
    force_dof: int
    moment_dof: int
    force_scatter: float
    moment_scatter: float
    turn: Array
    force_covariance: Array
    moment_covariance: Array | None = None

    def __post_init__(self) -> None:
        held = (self.bias, self.bias_std, self.turn, self.centre, self.centre_std)
        read_only(*(array for array in held if array is not None))

    @property
    def told_from_none(self) -> bool:
        """The mass is over three standard deviations."""
        return self.mass > 3 * self.mass_std

    @property
    def negative(self) -> bool:
        """The mass is under zero by more than three standard deviations: something has the wrong sign."""
        return self.mass < -3 * self.mass_std

    def covariance(self, fall: Array, bias_nm: Array) -> Array:
        """Covariance (n, 6, 6) [N, N m] of what the sensor shows without contact where free fall is fall (n, 3) [m/s^2], forces
        and moments each for themselves; of moments that are not told it is bias_nm (3, 3)."""
        found = np.zeros((len(fall), 6, 6))
        force = np.concatenate([np.broadcast_to(np.eye(3), (len(fall), 3, 3)), fall[:, :, None]], axis=2)
        found[:, :3, :3] = np.einsum("nai,ij,nbj->nab", force, self.force_covariance, force)
        found[:, 3:, 3:] = bias_nm
        if self.moment_covariance is not None:
            arms = np.stack([np.cross(axis, fall) for axis in np.eye(3)], axis=2)
            arms = np.concatenate([np.broadcast_to(np.eye(3), arms.shape), arms], axis=2)
            found[:, 3:, 3:] = np.einsum("nai,ij,nbj->nab", arms, self.moment_covariance, arms)
        return found


def weight(fall: Array, mass: float, arm: Array | None) -> Array:
    """Wrench (n, 6) [N, N m] of a mass; fall (n, 3) [m/s^2] and arm (3,) or (n, 3) [m] in the log's axes, None: no moment."""
    force = mass * fall
    moment = np.zeros_like(force) if arm is None else np.cross(arm, force)
    return np.concatenate([force, moment], axis=1)


def turns(fall: Array) -> Array:
    """How far g turns over readings (n, 3) [rad], RMS: in all, and what an arm in the worst direction sees."""
    off = (fall - fall.mean(axis=0)) / FREE_FALL
    spread = off.T @ off / len(off)
    seen = np.trace(spread) * np.eye(3) - spread
    return np.sqrt([np.trace(spread), max(float(np.linalg.eigvalsh(seen)[0]), 0.0)])


def estimate_payload(fall: Array, load: Array, *, has_moment: bool, noise: Array | None = None) -> Payload | None:
    """Bias, mass and centre from still readings: fall (n, 3) [m/s^2] and load (n, 6) in the log's axes, one row a still
    orientation. noise (n, 6): 1 sigma of the readings, at least; else it is how they scatter about the law. None where the
    orientations do not tell the mass from the bias, or leave no degree of freedom."""
    count = len(fall)
    turn = turns(fall)
    if count < 2 or turn[0] < TURN:
        return None
    force = np.zeros((3 * count, 4))
    force[:, :3] = np.tile(np.eye(3), (count, 1))
    force[:, 3] = fall.ravel()
    of_force, of_moment = (None, None) if noise is None else (noise[:, :3].ravel(), noise[:, 3:].ravel())
    parameters, covariance, scatter, dof = _least_squares(force, load[:, :3].ravel(), of_force)
    mass, mass_std = float(parameters[3]), float(np.sqrt(covariance[3, 3]))
    bias, bias_std = np.full(6, np.nan), np.full(6, np.nan)
    bias[:3], bias_std[:3] = parameters[:3], np.sqrt(np.diag(covariance)[:3])
    centre = centre_std = None
    moment_scatter, moment_dof, arm_covariance = float("nan"), 0, None
    if has_moment and turn[1] >= TURN and mass > 3 * mass_std:
        moment = np.zeros((3 * count, 6))
        moment[:, :3] = np.tile(np.eye(3), (count, 1))
        # (m c) x g = -[g]x (m c)
        for k, axis in enumerate(np.eye(3)):
            moment[:, 3 + k] = np.cross(axis, fall).ravel()
        arm, arm_covariance, moment_scatter, moment_dof = _least_squares(moment, load[:, 3:].ravel(), of_moment)
        bias[3:], bias_std[3:] = arm[:3], np.sqrt(np.diag(arm_covariance)[:3])
        centre = arm[3:] / mass
        centre_std = np.sqrt(np.diag(arm_covariance)[3:] + (centre * mass_std) ** 2) / mass
    return Payload(bias, bias_std, mass, mass_std, centre, centre_std, dof, moment_dof, scatter, moment_scatter, turn,
                   covariance, arm_covariance)


def _least_squares(design: Array, values: Array, noise: Array | None) -> tuple[Array, Array, float, int]:
    """Estimates, their covariance, the scatter about the law, and its degrees of freedom. The covariance is by that scatter, or
    by the values' noise (n,), times as much as they scatter more than it lets expect."""
    normal = np.linalg.inv(design.T @ design)
    parameters = normal @ design.T @ values
    dof = int(len(values) - design.shape[1])
    square = float(np.sum((values - design @ parameters) ** 2))
    scatter = float(np.sqrt(square / dof))
    if noise is None or not noise.any():
        return parameters, np.asarray(scatter**2 * normal), scatter, dof
    expected = float(noise**2 @ (1 - np.einsum("ni,ij,nj->n", design, normal, design)))
    weighed, more = noise[:, None] * design, max(square / expected, 1.0)
    return parameters, np.asarray(more * normal @ (weighed.T @ weighed) @ normal), scatter, dof


def interval_factor(dof: int) -> float:
    """Half a 95 % interval in standard deviations that have so many degrees of freedom (Student)."""
    from scipy.special import stdtrit

    return float(stdtrit(dof, 0.975))

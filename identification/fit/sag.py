"""What the robot's own weight may do where the robot file has no `links`: it is not known, so it may not pass for a cause.

Under its weight the arm hangs by dq_i = c_i g_i(theta) before it is loaded, and the load moves the weight, whose torques then
turn the springs once more. To first order the deflection changes by

    sum_i d elastic / d q_i  c_i g_i(theta)  +  sum_i J_i c_i (g_i(loaded) - g_i(theta))

Wherever an arm is heavy, g is linear in first moments that turn with its links: of the forearm the two across the axis of
joint 3, of the wrist and what the flange carries all three. The lower arm has a balancer beside it: the torque at joint 2 is
constant, or goes with the sine and cosine of its angle, and what that does as a spring is free by itself. Cables and hoses
pull at joint 3 alike everywhere. Eleven columns, each of the size that an arm of a few hundred kilograms makes, are free
beside every model, and integrated out of the posterior of the springs.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from identification.fit.noise import Weights
from identification.fit.sight import Sight
from identification.model.load_state import LoadState

Array = NDArray[np.float64]
# Torques at joints 2 and 3 [N m], 1 sigma: an assumption, of the order that an arm of 600 kg with its spindle has half
# stretched out.
WEIGHT_NM = 4000.0
# First moment of what the flange carries [N m], each way, 1 sigma: an assumption, of a spindle of 100 kg, 0.25 m away.
FLANGE_NM = 250.0
# Serial axes, from the first, that carry the forearm.
OF_FOREARM = 3


def sag_columns(state: LoadState, sight: Sight) -> Array:
    """Columns (n, 3, 11) in the noise's coordinates, of the size that is usual; none where the robot file has links."""
    if state.robot.link_mass is not None:
        return sight.whitened(np.zeros((len(state), 3, 0)))
    of_angles = np.stack([state.slope_by_angle(axis) for axis in range(6)], axis=2)
    slope = of_angles @ state.robot.uncoupling @ state.robot.load_matrix * state.compliance
    spring = state.jacobian[:, :3] * state.compliance
    wave = np.stack([np.sin(state.theta[:, 1]), np.cos(state.theta[:, 1])], axis=1)[:, None]
    balanced = WEIGHT_NM * slope[:, :, 1, None] * wave
    balancer = WEIGHT_NM * spring[:, :, 1, None] * (state.compliance[1] * state.torque[:, 1, None, None]) * wave
    hangs = _hanging(replace(state, wrench=np.zeros_like(state.wrench)))
    links = slope @ hangs + spring @ (_hanging(state) - hangs)
    return sight.whitened(np.concatenate([WEIGHT_NM * slope[:, :, 1:3], balanced, balancer, links], axis=2))


def _hanging(state: LoadState) -> Array:
    """Torques at the springs (n, 6, 5), at the loaded pose, of the usual first moments of forearm and flange."""
    x, z = state.link_x[:, OF_FOREARM - 1], state.axes[:, OF_FOREARM - 1]
    carried = (np.arange(6) < OF_FOREARM)[:, None]
    forearm = [WEIGHT_NM * across[:, None] * carried for across in (x, np.cross(z, x))]
    flange = [np.repeat(FLANGE_NM * state.flange[:, None, :, axis], 6, axis=1) for axis in range(3)]
    return np.stack([state.hung(lever) for lever in (*forearm, *flange)], axis=2)


@dataclass(frozen=True, eq=False)
class BesideWeight:
    """Sigma^-1 of the rows with what the arm's own weight may do among their errors: columns (n, 3, m) of 1 sigma each,
    none where it is known."""

    weights: Weights
    columns: Array

    @cached_property
    def _own(self) -> Array:
        return self.weights.inner(self.columns, self.columns) + np.eye(self.columns.shape[2])

    def inner(self, left: Array, right: Array) -> Array:
        """left^T Sigma^-1 right (p, q) of columns (n, 3, p) and (n, 3, q)."""
        if not self.columns.shape[2]:
            return self.weights.inner(left, right)
        taken = np.linalg.solve(self._own, self.weights.inner(self.columns, right))
        return np.asarray(self.weights.inner(left, right) - self.weights.inner(self.columns, left).T @ taken)

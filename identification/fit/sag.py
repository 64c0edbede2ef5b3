"""What the robot's own weight may do where the robot file has no `links`: it is not known, so it may not pass for a cause.

Under its weight the arm hangs by dq = c g(theta) at joints 2 and 3 before it is loaded, and the weight's moving with the load
acts like springs there. To first order the deflection changes by `d elastic / d theta_i` times the sag, and by `J_i tau_i c_i`
times `c_i d g_i / d theta_i`; g goes with the sine and cosine of the link's angle. Ten columns, each with the size that an arm
of a few hundred kilograms makes, are free beside every model, and integrated out of the posterior of the springs.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from identification.fit.noise import Weights
from identification.fit.sight import Sight
from identification.model.load_state import LoadState

Array = NDArray[np.float64]
# Joints that carry the arm's weight, from 0.
CARRIERS = (1, 2)
# Gravity torque at a carrier [N m]: an assumption, of the order that an arm of 600 kg with its spindle has half stretched out.
WEIGHT_NM = 4000.0


def sag_columns(state: LoadState, sight: Sight) -> Array:
    """Columns (n, 3, 10) in the noise's coordinates, of the size that is usual; none where the robot file has links."""
    if state.robot.link_mass is not None:
        return sight.whitened(np.zeros((len(state), 3, 0)))
    columns = []
    for i in CARRIERS:
        sag = state.compliance[i] * WEIGHT_NM
        slope = state.slope_by_angle(i)
        spring = state.jacobian[:, :3, i] * (state.compliance[i] * state.torque[:, i])[:, None]
        angle = state.theta[:, i]
        columns += [sag * slope, sag * slope * np.sin(angle)[:, None], sag * slope * np.cos(angle)[:, None],
                    sag * spring * np.sin(angle)[:, None], sag * spring * np.cos(angle)[:, None]]
    return sight.whitened(np.stack(columns, axis=2))


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

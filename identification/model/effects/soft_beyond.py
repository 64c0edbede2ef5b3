"""A gear that yields more under large torques than under small ones: what was pre-loaded opens, or slips, beyond."""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Parameter, saturated
from identification.model.effects.kinds import GearTwist
from identification.model.load_state import LoadState


class _SoftBeyond(GearTwist):
    """What the laws have in common: `J_i a c_i (e(g + tau) - e(g))`, e being what comes on top of the spring."""

    name = "soft_beyond"
    of_gravity = True
    sentence = "the gear of joint {joint} yields more under large torques than under small ones"
    settles = "a torque ladder on this joint up to the largest load, in even steps"

    @abstractmethod
    def excess(self, torque: Array, values: Array) -> Array:
        """e (n,) [N m] of the whole torque (n,)."""

    def twist(self, rows: LoadState, i: int, values: Array) -> Array:
        preload = self.preload(rows, i, values)
        excess = self.excess(preload + rows.torque[:, i], values) - self.excess(preload, values)
        return np.asarray(values[0] * rows.compliance[i] * excess)


class CubicExcess(_SoftBeyond):
    """e = x (x / 1 kN m)^2: softer and softer."""

    law = "cubic"
    formula_source = "engineering judgement: the first odd power after the spring's own"
    parameters = (
        Parameter("share_per_square_kn_m", "1/(kN*m)^2", 0.2, 0.0, 1e4,
                  source="engineering judgement: a fifth more than the spring alone under the largest torque of the rows; here "
                         "1 kN m",
                  bounds_source="engineering judgement: a spring that is straight, to a wrist that opens under 10 N m"),
    )
    REFERENCE: ClassVar[float] = 1000.0

    def typical(self, rows: LoadState, joint: int | None) -> Array:
        largest = float(np.abs(rows.torque[:, self.index(joint)]).max(initial=1.0))
        return super().typical(rows, joint) * (self.REFERENCE / max(largest, 10.0)) ** 2

    def excess(self, torque: Array, values: Array) -> Array:
        return np.asarray(torque * (torque / self.REFERENCE) ** 2)


class SoftBeyond(_SoftBeyond):
    """e = x - T sat(x / T): nothing up to T, and 1 + a times the compliance beyond."""

    other_laws = (CubicExcess(),)
    formula_source = "engineering judgement: two springs in series, the second one pre-loaded by T"
    parameters = (
        Parameter("share", "1", 0.3, 0.0, 5.0,
                  source="engineering judgement: a third of what holds the gear is a pre-loaded joint",
                  bounds_source="engineering judgement: nothing that opens, to what is held by its preload alone"),
        Parameter("torque_nm", "N*m", 300.0, 10.0, 5000.0, grid=(40.0, 120.0, 360.0, 1000.0), shape=True,
                  source="engineering judgement: screws and bearings are pre-loaded for loads of this order",
                  bounds_source="engineering judgement: as for soft_zone.cubic"),
    )

    def excess(self, torque: Array, values: Array) -> Array:
        return np.asarray(torque - values[1] * saturated(torque / values[1]))

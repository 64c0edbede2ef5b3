"""Every gear is softer under small torques: what `soft_zone` is of one."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import replace

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Effect, Parameter, saturated
from identification.model.effects.documents import HARMONIC_DRIVE
from identification.model.effects.soft_zone import EXTRA, WOUND
from identification.model.load_state import LoadState


class _SoftGears(Effect):
    """What the laws have in common: `sum_i J_i t_i`, t_i the further twist of gear i under what its weight and the load wind it
    up by."""

    name = "soft_gears"
    family = "gear"
    of_robot = True
    of_gravity = True
    sentence = "every gear is softer under small torques than under large ones"
    settles = "torque ladders through zero with small steps, joint after joint"

    @abstractmethod
    def further_twist(self, wound: Array, values: Array) -> Array:
        """t (n, 6) [rad] of the gears that their springs let wind up by so much (n, 6) [rad]."""

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        before, under_load = (torque * rows.compliance for torque in (rows.gravity, rows.gravity + rows.torque))
        twist = self.further_twist(under_load, values) - self.further_twist(before, values)
        return np.asarray(np.einsum("nri,ni->nr", rows.jacobian, twist))


class Rolling(_SoftGears):
    """t_i = u ((|u| / W)^-p - 1), u what it is wound up by and W = 1 mrad: all stiffen with the torque to the power p, as
    rolling contacts do."""

    law = "rolling"
    formula_source = ("engineering judgement: Hertz's points of contact are pressed together by the torque to the power 2/3 "
                      "(p = 1/3), and springs in series with them that do not stiffen make p less")
    parameters = (Parameter("power", "1", 0.05, 0.0, 0.5,
                            source="engineering judgement: a seventh of what gives way is contacts of points",
                            bounds_source="engineering judgement: none, to more than points that touch"),)

    def further_twist(self, wound: Array, values: Array) -> Array:
        size = np.maximum(np.abs(wound), 1e-12) / 1e-3
        return np.asarray(wound * (size ** -values[0] - 1.0))


class SoftGears(_SoftGears):
    """t_i = a_i sat(u / w), u what it is wound up by: below a wind-up w that all have in common each yields more, by an a_i of
    its own."""

    other_laws = (Rolling(),)
    formula_source = (f"{HARMONIC_DRIVE}, fig. 11: straight lines of stiffness between torques by which gears of one shape are "
                      "wound up alike, whatever their size")
    parameters = (
        *(replace(EXTRA, name=f"extra_{joint}_rad") for joint in range(1, 7)),
        Parameter("wind_up_rad", "rad", WOUND, 1e-6, 1e-2, grid=(5e-5, 1e-4, 2e-4, 4e-4, 8e-4), shape=True,
                  source=f"{HARMONIC_DRIVE}, table 42: 54 to 168 N m for sizes 40 to 58 are about this angle",
                  bounds_source="engineering judgement: a softness that nothing would show, to half a degree"),
    )

    def further_twist(self, wound: Array, values: Array) -> Array:
        return np.asarray(values[:6] * saturated(wound / values[6]))

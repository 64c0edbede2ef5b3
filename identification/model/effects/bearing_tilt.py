"""A joint's bearing tilts: the two axes across the joint yield too."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Parameter
from identification.model.effects.kinds import AtJoint
from identification.model.load_state import LoadState


class BearingTilt(AtJoint):
    """Sum over both axes across joint i of `J_t (J_t^T w) c_t`, pivot at the origin of the joint's frame. Tilt 4 keeps only its
    x axis, because its y axis is joint 5's own."""

    name = "bearing_tilt"
    family = "structure"
    joints = (1, 2, 3, 4, 5)
    parameters = (Parameter("compliance_rad_per_nm", "rad/(N*m)", 9.1e-8, 0.0, 2e-6),)
    sentence = "the bearing of joint {joint} tilts under load across its axis"
    settles = "a dial gauge across the bearing while the tool is loaded"

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        i = self.index(joint)
        axis, pivot = rows.axes[:, i], rows.origins[:, i]
        moment = rows.moment_about(pivot)
        across = moment - axis * np.sum(axis * moment, axis=1, keepdims=True)
        if joint == 4:
            only = rows.link_x[:, 3]
            across = only * np.sum(only * moment, axis=1, keepdims=True)
        return rows.turned(pivot, values[0] * across)

"""Two axes of the wrist share gears: a torque at one turns the other."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Effect, Parameter
from identification.model.load_state import LoadState


class _Coupling(Effect):
    """`(J_a tau_b + J_b tau_a) c` of the axes a and b."""

    name = "wrist_coupling"
    family = "gear"
    of_robot = True
    formula_source = "docs/architecture.md, Springs: an element off the diagonal of diag(c), symmetric by Maxwell-Betti"
    axes: ClassVar[tuple[int, int]]

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        a, b = (axis - 1 for axis in self.axes)
        twisted = rows.jacobian[:, :, a] * rows.torque[:, b, None] + rows.jacobian[:, :, b] * rows.torque[:, a, None]
        return np.asarray(values[0] * twisted)


class _WithForearm(_Coupling):
    """Of axis 4 with another: the shafts of a hollow wrist run through each other."""

    parameters = (
        Parameter("compliance_rad_per_nm", "rad/(N*m)", 5e-7, -1e-5, 1e-5,
                  source="engineering judgement: half that of axes 5 and 6",
                  bounds_source="engineering judgement: half the bound of axes 5 and 6, since gear 4 is stiffer; beyond "
                                "sqrt(c4 c5) the compliance is not positive definite"),
    )


class OfAxes4And5(_WithForearm):
    """Of axes 4 and 5."""

    law, axes = "45", (4, 5)
    sentence = "the gears of the wrist are coupled: a torque at axis 4 turns axis 5 and the other way round"
    settles = "a pure moment on the flange about axis 4 with a dial gauge on axis 5"


class OfAxes4And6(_WithForearm):
    """Of axes 4 and 6."""

    law, axes = "46", (4, 6)
    sentence = "the gears of the wrist are coupled: a torque at axis 4 turns axis 6 and the other way round"
    settles = "a pure moment on the flange about axis 6 with a dial gauge on axis 4"


class WristCoupling(_Coupling):
    """Of axes 5 and 6."""

    axes = (5, 6)
    other_laws = (OfAxes4And5(), OfAxes4And6())
    parameters = (
        Parameter("compliance_rad_per_nm", "rad/(N*m)", 1e-6, -2e-5, 2e-5,
                  source="engineering judgement: an eighth of sqrt(c5 c6) of the paper's Table 1",
                  bounds_source="sqrt(c5 c6) of the paper's Table 1, 8.06e-6 rad/(N m), beyond which the compliance is not "
                                "positive definite, for wrists up to 2.5 times softer"),
    )
    sentence = "the gears of the wrist are coupled: a torque at axis 5 turns axis 6 and the other way round"
    settles = "a pure moment on the flange about axis 6 with a dial gauge on axis 5"

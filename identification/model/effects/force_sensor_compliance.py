"""The force sensor between flange and spindle tilts about flange x and y."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Effect, Parameter
from identification.model.load_state import LoadState

# Engineering judgement: beams or struts that tilt by c under a moment yield by c h^2 to a force, h being how high and wide they
# stand, half the width of a sensor for forces of a kilonewton; and they tilt about a point within h of the flange. (Their twist
# about flange z is joint 6's own.)
HEIGHT_M = 0.07


class ForceSensorCompliance(Effect):
    """Rotation c (M_x, M_y) about the flange, in the flange frame. Further ways: it yields to the force across its axis, and
    along it, and tilts about another point of its axis."""

    name = "force_sensor_compliance"
    family = "tool"
    of_robot = True
    stiffens = True
    of_tool = True
    ways = 3
    formula_source = "the paper, eq. 3 and 5, for two more torsion springs, about flange x and y"
    parameters = (
        Parameter("tilt_rad_per_nm", "rad/(N*m)", 3e-6, 0.0, 1e-4,
                  source="engineering judgement: 3.3e5 N m/rad, about joint 5 (the paper, Table 1): a sensor works by "
                         "yielding",
                  bounds_source="engineering judgement: rigid, to 1e4 N m/rad, a seventh of joint 6 (the paper, Table 1)"),
    )
    sentence = "the force sensor between flange and spindle tilts under load"
    settles = "the sensor's data sheet, or a dial gauge between flange and spindle"

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        return rows.tilted(values[0], 0.0)

    def further_ways(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        axis, force = rows.flange[:, :, 2], rows.wrench[:, :3]
        along = axis * np.sum(axis * force, axis=1, keepdims=True)
        ways = np.zeros((len(rows), 6, self.ways))
        ways[:, :3, 0], ways[:, :3, 1] = values[0] * HEIGHT_M**2 * (force - along), values[0] * HEIGHT_M**2 * along
        ways[:, :, 2] = 0.5 * (rows.tilted(values[0], HEIGHT_M) - rows.tilted(values[0], -HEIGHT_M))
        return ways

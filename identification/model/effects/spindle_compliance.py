"""Tool and spindle yield across the tool axis."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Effect, Parameter
from identification.model.load_state import LoadState


class SpindleCompliance(Effect):
    """c times the part of the force across tool z."""

    name = "spindle_compliance"
    family = "tool"
    of_robot = True
    stiffens = True
    of_tool = True
    formula_source = ("Systematic analysis of geometric inaccuracy and its contributing factors in roboforming, Sci. Rep., "
                      "2024 (s41598-024-70746-3), Table 2: the radial terms of tool and holder")
    parameters = (
        Parameter("radial_m_per_n", "m/N", 6.7e-8, 0.0, 2e-6,
                  source="the same Table 2: a tool holder 1.07e-7 m/N; 1.5e7 N/m for a milling spindle with its tool is "
                         "engineering judgement",
                  bounds_source="the same Table 2: the forming tool 9.34e-7 m/N; rigid to about twice that"),
    )
    sentence = "tool and spindle bend sideways"
    settles = "a dial gauge between spindle nose and tool tip while the tool is loaded"

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        axis, force = rows.tool[:, :, 2], rows.wrench[:, :3]
        across = force - axis * np.sum(axis * force, axis=1, keepdims=True)
        return np.concatenate([values[0] * across, np.zeros_like(across)], axis=1)

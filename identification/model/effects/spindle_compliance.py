"""Tool and spindle yield across the tool axis, or along it too."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Effect, Parameter
from identification.model.load_state import LoadState

RADIAL = Parameter("radial_m_per_n", "m/N", 6.7e-8, 0.0, 2e-6,
                   source="the same Table 2: a tool holder 1.07e-7 m/N; 1.5e7 N/m for a milling spindle with its tool is "
                          "engineering judgement",
                   bounds_source="the same Table 2: the forming tool 9.34e-7 m/N; rigid to about twice that")


class _Spindle(Effect):
    """What both laws have in common."""

    name = "spindle_compliance"
    family = "tool"
    of_robot = True
    stiffens = True
    of_tool = True
    formula_source = ("Systematic analysis of geometric inaccuracy and its contributing factors in roboforming, Sci. Rep., "
                      "2024 (s41598-024-70746-3), Table 2: the radial terms of tool and holder")
    settles = "a dial gauge between spindle nose and tool tip while the tool is loaded"


class AlongToo(_Spindle):
    """c_r times the part of the force across tool z and c_a times that along it: a bearing or a mount that is pressed in."""

    law = "along"
    sentence = "tool, spindle or its mount give way sideways and along the tool"
    parameters = (RADIAL, Parameter(
        "axial_m_per_n", "m/N", 6.7e-8, 0.0, 2e-6, source="engineering judgement: as radially",
        bounds_source="engineering judgement: as radially"))

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        along, across = _parts(rows)
        return np.concatenate([values[0] * across + values[1] * along, np.zeros_like(across)], axis=1)


class SpindleCompliance(_Spindle):
    """c times the part of the force across tool z."""

    other_laws = (AlongToo(),)
    sentence = "tool and spindle bend sideways"
    parameters = (RADIAL,)

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        _, across = _parts(rows)
        return np.concatenate([values[0] * across, np.zeros_like(across)], axis=1)


def _parts(rows: LoadState) -> tuple[Array, Array]:
    """The force (n, 3) [N] along and across tool z."""
    axis, force = rows.tool[:, :, 2], rows.wrench[:, :3]
    along = axis * np.sum(axis * force, axis=1, keepdims=True)
    return along, force - along

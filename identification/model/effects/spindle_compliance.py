"""Tool and spindle yield across the tool axis, or along it too; or they stand on the flange as a beam that bends."""

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


class Beam(_Spindle):
    """A beam from the flange to the height of the tool tip, clamped at the flange: also where the tip stands beside it."""

    law = "beam"
    formula_source = "Timoshenko, Strength of Materials, 1930: a cantilever's curvature is the moment at each place over E I"
    sentence = "a long slender tool, or what carries it, bends as a beam from the flange on"
    parameters = (Parameter(
        "per_bending_stiffness", "1/(N*m^2)", 1.3e-5, 0.0, 1e-3,
        source="engineering judgement: a tool 250 mm long that yields by 6.7e-8 m/N at its tip, as across the tool axis",
        bounds_source="engineering judgement: rigid, to a solid steel bar of 18 mm (1/(E I) is 9.2e-4)"),)

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        length = np.asarray(rows.flange_from_tcp.position[..., 2])
        # The tip's deviation is an integral over tilts along the beam, of second order in their place: two places are exact.
        places = (0.5 - np.sqrt(1 / 12), 0.5 + np.sqrt(1 / 12))
        tilts = [rows.tilted(values[0] * np.abs(length) / 2, place * length) for place in places]
        return np.asarray(tilts[0] + tilts[1])


class SpindleCompliance(_Spindle):
    """c times the part of the force across tool z."""

    other_laws = (AlongToo(), Beam())
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

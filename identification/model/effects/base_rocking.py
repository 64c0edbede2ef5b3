"""The whole robot rocks on its base about base x and y."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Effect, Parameter
from identification.model.load_state import LoadState

COMPLIANCE = Parameter("compliance_rad_per_nm", "rad/(N*m)", 5e-8, 0.0, 2e-6,
                       source="engineering judgement: 2e7 N m/rad, ten times joint 1 (the paper, Table 1)",
                       bounds_source="engineering judgement: rigid, to 5e5 N m/rad, a quarter of joint 1: a pedestal that is "
                                     "loose")
# Of a tilt to one side, from base x.
AXIS = Parameter("axis_rad", "rad", 0.8, -3.1416, 3.1416, grid=tuple((np.arange(8) * np.pi / 4 - 0.75 * np.pi).round(4)),
                 shape=True, source="engineering judgement: no side is more likely than another",
                 bounds_source="engineering judgement: any direction, a full turn")
# Where the centre of the feet under a platform is tried [m], along base x, y and z.
CENTRES = ((-0.3, 0.3), (-0.3, 0.3), (-0.8, 0.0))


class _Rocking(Effect):
    """Rotation (c_x M_x, c_y M_y) about the base origin, M the moment of the load there."""

    name = "base_rocking"
    family = "base"
    of_robot = True
    stiffens = True
    formula_source = "the paper, eq. 3 and 5, for two more torsion springs, about base x and y"
    sentence = "the robot rocks on its base: floor, anchors or pedestal give way"
    settles = "a dial gauge on the base while the tool is loaded"

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        base = np.zeros((len(rows), 3))
        about = np.append(np.broadcast_to(values, 2), 0.0)
        return rows.turned(base, rows.moment_about(base) * about)


class AboutEach(_Rocking):
    """A frame, a narrow pedestal or a track: softer about one of the two axes."""

    law = "each"
    parameters = tuple(replace(COMPLIANCE, name=f"{axis}_rad_per_nm") for axis in "xy")


class Column(_Rocking):
    """A column of height h under the base that bends: a moment M at its top turns it there by c M, c = h / EI, and moves it by
    M x z c h / 2; a force F turns it by z x F c h / 2 and moves it by F c h^2 / 3."""

    law = "column"
    formula_source = ("Engineering Mechanics OER, StrengthBook, Appendix B.2 "
                      "(engineeringmechanicsoer.github.io/StrengthBook), cantilever beams: P L^3 / 3EI and P L^2 / 2EI, the "
                      "moment's part by reciprocity")
    parameters = (
        COMPLIANCE,
        Parameter("height_m", "m", 0.7, 0.1, 3.0, grid=(0.4, 0.8, 1.5), shape=True,
                  source="engineering judgement: pedestals under milling robots, half a metre to a metre",
                  bounds_source="engineering judgement: a plate, to a column as tall as the robot"),
    )
    sentence = "the column under the robot bends"
    settles = "dial gauges at the top and half way up the column while the tool is loaded"

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        compliance, height = values
        top, z = np.zeros((len(rows), 3)), np.array([0.0, 0.0, 1.0])
        force, moment = (part * (1 - z) for part in (rows.wrench[:, :3], rows.moment_about(top)))
        moved = rows.turned(top, compliance * (np.cross(z, force) * height / 2 + moment))
        moved[:, :3] += compliance * (force * height**2 / 3 + np.cross(moment, z) * height / 2)
        return moved


class Lifting(_Rocking):
    """Anchors that hold one way only: it tilts by c max(0, M.a) about a level axis a, which stands at an angle from base x."""

    law = "lifting"
    formula_source = "engineering judgement: a foot that lifts off where an anchor is loose, and is pressed down rigidly"
    parameters = (COMPLIANCE, AXIS)
    sentence = "the robot rocks on its base to one side: an anchor is loose there, and lifts"

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        compliance, angle = values
        base, axis = np.zeros((len(rows), 3)), np.array([np.cos(angle), np.sin(angle), 0.0])
        return rows.turned(base, compliance * np.maximum(rows.moment_about(base) @ axis, 0.0)[:, None] * axis)


class Opens(_Rocking):
    """The same once the moment passes what an anchor's preload or the weight on the foot holds, m, the arm's weight with it: a
    load tilts it by c (max(0, (M + w).a - m) - max(0, w.a - m)), w the moment of a weight at the wrist's centre that weighs
    on the base as the arm does."""

    law = "opens"
    formula_source = "engineering judgement: a foot that is held by a preload, and lifts in proportion to what passes it"
    parameters = (
        COMPLIANCE, AXIS,
        Parameter("holds_nm", "N*m", 1000.0, -50000.0, 50000.0, grid=(0.0, 0.3), shape=True,
                  source="engineering judgement: it shows where it is a part of the largest moment in the rows",
                  bounds_source="engineering judgement: to what no load test reaches, on either side"),
        Parameter("weight_n", "N", 2000.0, 0.0, 20000.0, grid=(0.0, 1.0, 3.0), shape=True,
                  source="engineering judgement: a third of an arm's 600 kg, which is nearer to the base than the wrist",
                  bounds_source="engineering judgement: none, to an arm of six tonnes"))
    sentence = "the robot rocks on its base to one side: an anchor is loose there, and lifts once a moment passes what holds it"

    def grid(self, rows: LoadState, joint: int | None, parameter: Parameter) -> tuple[float, ...]:
        if parameter.name == "axis_rad":
            return parameter.grid
        level = rows.moment_about(np.zeros((len(rows), 3)))[:, :2]
        largest = float(np.linalg.norm(level, axis=1).max(initial=1.0))
        lever = float(np.linalg.norm(rows.origins[:, 4, :2], axis=1).max(initial=0.1)) if parameter.name == "weight_n" else 1.0
        return tuple(share * largest / lever for share in parameter.grid)

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        compliance, angle, holds, weight = values
        axis, base = np.array([np.cos(angle), np.sin(angle), 0.0]), np.zeros((len(rows), 3))
        down = rows.fall / np.linalg.norm(rows.fall)
        at_rest = weight * np.cross(rows.origins[:, 4], down) @ axis - holds
        loaded = at_rest + rows.moment_about(base) @ axis
        opened = np.maximum(loaded, 0.0) - np.maximum(at_rest, 0.0)
        return rows.turned(base, compliance * opened[:, None] * axis)


class Platform(_Rocking):
    """A rigid body on elastic feet: the moment about their centre p, beside, under or above the base origin, turns it by
    (c_x M_x, c_y M_y, c_z M_z) about p, and the force moves it by (s_x F_x, s_y F_y, s_z F_z)."""

    law = "platform"
    formula_source = ("engineering judgement: springs under the corners of a rectangle, whose compliance about their centre is "
                      "diagonal")
    parameters = (
        *(replace(COMPLIANCE, name=f"{axis}_rad_per_nm") for axis in "xyz"),
        *(Parameter(f"{axis}_m_per_n", "m/N", 5e-8, 0.0, 4e-6,
                    source="engineering judgement: 2e7 N/m, 15 um under the 300 N of the paper's sect. 4",
                    bounds_source="engineering judgement: as for base_shift") for axis in "xyz"),
        *(Parameter(f"centre_{axis}_m", "m", 0.5, low, high, grid=grid, shape=True,
                    source="engineering judgement: robots stand off the middle of a platform, and upon it",
                    bounds_source="engineering judgement: platforms of a few metres, as low as a pit")
          for axis, low, high, grid in zip("xyz", (-2.0, -2.0, -3.0), (2.0, 2.0, 1.0), CENTRES, strict=True)),
    )
    sentence = "what the robot stands on moves and tilts under load: a platform on elastic feet, a frame, a soft floor"
    settles = "dial gauges at three corners of what the robot stands on while the tool is loaded"

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        turns, shifts, centre = np.reshape(values, (3, 3))
        pivot = np.broadcast_to(centre, (len(rows), 3))
        moved = rows.turned(pivot, rows.moment_about(pivot) * turns)
        moved[:, :3] += rows.wrench[:, :3] * shifts
        return moved


class BaseRocking(_Rocking):
    """c_x = c_y: a foot that gives way alike to all sides."""

    other_laws = (AboutEach(), Column(), Lifting(), Opens(), Platform())
    parameters = (COMPLIANCE,)

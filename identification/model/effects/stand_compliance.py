"""The stand of the deflection sensors is pushed by what loads the robot: the reading holds the stand's own motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.kinds import OfReading, along_axes
from identification.model.load_state import LoadState


class _Stand(OfReading):
    """What the laws have in common: three compliances, one a direction in which the stand moves."""

    name = "stand_compliance"
    formula_source = ("engineering judgement: what the loading device stands on gives way in proportion to its load; where it "
                      "turns, in another direction than the load's")
    parameters = along_axes(
        "{}_m_per_n", "m/N", 5e-8, 4e-6,
        source="engineering judgement: 2e7 N/m, 15 um under the 300 N of the paper's sect. 4, as base_shift",
        bounds_source="engineering judgement: either way, to 1.2 mm under 300 N, which is seen by eye")
    sentence = ("the stand of the deflection sensors gives way with the load: it stands on, or is screwed to, what the loading "
                "device pushes against")
    settles = "a dial gauge from the robot's base to the sensors' stand while the tool is loaded"


class _OneLoad(_Stand):
    """`g f`, f the load along one base axis: its device shares a frame with the sensors, the others do not."""

    axis: int

    def misread(self, rows: LoadState, values: Array) -> Array:
        return np.asarray(rows.wrench[:, self.axis, None] * values)


class OfLoadsAlongX(_OneLoad):
    """Of loads along base x."""

    law, axis = "x", 0


class OfLoadsAlongY(_OneLoad):
    """Of loads along base y."""

    law, axis = "y", 1


class OfLoadsAlongZ(_OneLoad):
    """Of loads along base z."""

    law, axis = "z", 2


class _Pushed(_Stand):
    """What pushes the tool pushes the stand the other way, so that the tool seems to give way more."""

    parameters = tuple(
        replace(parameter, low=0.0, bounds_source="engineering judgement: away from the tool, to 0.3 mm under 300 N, which is "
                                                  "seen by eye") for parameter in _Stand.parameters)

    def misread(self, rows: LoadState, values: Array) -> Array:
        return np.asarray(rows.wrench[:, :3] * values)


class Upright(_Pushed):
    """`(g_h f_x, g_h f_y, g_v f_z)`: alike to all sides, as a base may give way too."""

    law = "upright"
    parameters = tuple(replace(_Pushed.parameters[0], name=f"{way}_m_per_n") for way in ("sideways", "upright"))

    def misread(self, rows: LoadState, values: Array) -> Array:
        return super().misread(rows, values[[0, 0, 1]])


class StandCompliance(_Pushed):
    """`(g_x f_x, g_y f_y, g_z f_z)`: each load moves the stand along itself."""

    other_laws = (Upright(), OfLoadsAlongX(), OfLoadsAlongY(), OfLoadsAlongZ())

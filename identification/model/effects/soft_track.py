"""The track that carries the robot gives way along its travel, and its carriage rocks across its rails."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Effect, Parameter
from identification.model.effects.kinds import NO_TRACK
from identification.model.load_state import LoadState


class SoftTrack(Effect):
    """Shift c_1 (F . d) d, and rotation c_2 (M . d) d about the base origin; d the direction of travel in the base frame, F the
    load's force and M its moment there."""

    name = "soft_track"
    family = "base"
    of_robot = True
    stiffens = True
    of_track = True
    formula_source = "engineering judgement: a linear spring of the drive, and one of the guides about the travel"
    parameters = (
        Parameter("along_m_per_n", "m/N", 1e-7, 0.0, 5e-6,
                  source="engineering judgement: 1e7 N/m, a pinion on its rack with its gear: half of base_shift's floor",
                  bounds_source="engineering judgement: rigid, to 2e5 N/m, 1.5 mm under 300 N: a belt, or a loose pinion"),
        Parameter("rocking_rad_per_nm", "rad/(N*m)", 1e-7, 0.0, 4e-6,
                  source="engineering judgement: 1e7 N m/rad, rails a metre apart on 2e7 N/m a side",
                  bounds_source="engineering judgement: rigid, to 2.5e5 N m/rad: guides with play"),
    )
    sentence = "the track under the robot gives way: its drive along the travel, its carriage across the rails"
    settles = "dial gauges on the carriage, along the travel and on both rails, while the tool is loaded; clamp the carriage"

    def missing(self, rows: LoadState) -> str:
        return NO_TRACK if rows.robot.track is None else ""

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        if rows.robot.track is None:
            return np.zeros((len(rows), 6))
        travel, base = rows.robot.track, np.zeros((len(rows), 3))
        moved = rows.turned(base, values[1] * np.outer(rows.moment_about(base) @ travel, travel))
        moved[:, :3] += values[0] * np.outer(rows.wrench[:, :3] @ travel, travel)
        return moved

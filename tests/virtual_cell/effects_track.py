"""What the track under the robot gives: its drive along the travel, its carriage about it. Only a cell with a track has it."""

from __future__ import annotations

import numpy as np

from tests.virtual_cell.hidden import Parameters, effect
from tests.virtual_cell.plant import Plant

# The direction of travel, base frame: level, at an angle to both axes of the base.
TRAVEL = np.array([0.6, 0.8, 0.0])
UNITS = ("mechanical_units:\n  - {name: TRACK_1, carries: robot, axes: [{eax: a, kind: linear, direction: "
         f"[{', '.join(map(str, TRAVEL.tolist()))}]}}]}}\n")


@effect("soft_track", lambda draw: {"along_m_per_n": draw.factor / 1e7, "rocking_rad_per_nm": draw.factor / 1e7})
def soft_track(plant: Plant, joint: None, parameters: Parameters) -> None:
    for names, size in ((("base_x", "base_y"), parameters["along_m_per_n"]),
                        (("rock_x", "rock_y"), parameters["rocking_rad_per_nm"])):
        block = [plant.at(name) for name in names]
        plant.compliance[np.ix_(block, block)] += size * np.outer(TRAVEL[:2], TRAVEL[:2])

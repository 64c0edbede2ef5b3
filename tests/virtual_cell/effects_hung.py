"""Effects of dead weights: what hangs beside the tool point, or swings. Not drawn for designs with a cylinder.

Sizes are made up for tests.
"""

from __future__ import annotations

import numpy as np

from tests.virtual_cell.hidden import Draw, Parameters, effect
from tests.virtual_cell.laws import Row
from tests.virtual_cell.plant import Plant


def _aside(draw: Draw) -> Parameters:
    """20 mm to any side."""
    angle = draw.phase()
    return {"x_m": draw.factor * 0.02 * float(np.cos(angle)), "y_m": draw.factor * 0.02 * float(np.sin(angle))}


@effect("hook_offset", _aside)
def hook_offset(plant: Plant, joint: None, parameters: Parameters) -> None:
    """The rope passes the tool point at a place that is fixed in the cell."""
    plant.beside = np.array([parameters["x_m"], parameters["y_m"], 0.0])


def _swing(draw: Draw) -> Parameters:
    return {"amplitude_rad": draw.factor * 0.03, "seed": int(draw.rng.integers(2**31))}


@effect("swinging_weight", _swing)
def swinging_weight(plant: Plant, joint: None, parameters: Parameters) -> None:
    """A pendulum that each hooking on sets going in another plane; the reading catches it at any moment of its swing."""
    def swung(force: np.ndarray, row: Row) -> np.ndarray:
        rng = np.random.default_rng([parameters["seed"], row.number])
        weight = np.linalg.norm(force)
        angle = parameters["amplitude_rad"] * np.sin(rng.uniform(0, 2 * np.pi))
        # Rope force: the weight's part along the rope, and the centripetal force 2 m g (cos angle - cos amplitude).
        rope = weight * (3 * np.cos(angle) - 2 * np.cos(parameters["amplitude_rad"]))
        plane = rng.uniform(0, 2 * np.pi)
        return np.asarray(rope * np.array([np.sin(angle) * np.cos(plane), np.sin(angle) * np.sin(plane), -np.cos(angle)]))

    plant.force_faults.append(swung)

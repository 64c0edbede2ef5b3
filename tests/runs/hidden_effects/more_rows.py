"""Goes on measuring in a virtual cell: the same robot, the same hidden effects, further poses with further loads."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tests.virtual_cell.cell import Case
from tests.virtual_cell.designs import POSE_PAUSE_S, ROW_PAUSE_S, Design
from tests.virtual_cell.noise import force_errors, readings


def measured_further(case: Case, theta: np.ndarray, load: np.ndarray, rng: np.random.Generator, dwell: tuple[float, ...] = (
        10.0, 60.0)) -> Case:
    """The case with one more pose (6,) [rad] and its loads (m, 3) [N], one after the other; the rows before stay as they are.

    A case with validation rows has to be simulated without them: rows are taken in order.
    """
    before, count = case.design, len(load)
    assert not before.validate.any()
    held = np.resize(dwell, count)
    start = before.time[-1] + POSE_PAUSE_S
    design = Design(
        np.concatenate([before.theta, np.repeat(np.radians(np.round(np.degrees(theta), 4))[None], count, axis=0)]),
        np.concatenate([before.load, load]), np.concatenate([before.time, start + np.cumsum(held + ROW_PAUSE_S)]),
        np.concatenate([before.dwell, held]), np.concatenate([before.pose, np.full(count, before.pose.max() + 1)]),
        np.concatenate([before.validate, np.zeros(count, dtype=bool)]))
    seen = case.plant.displacement(design, force_errors(case.noise, design, rng))[1]
    new = readings(case.noise, design, 1e6 * seen, rng)[-count:]
    return replace(case, design=design, deflection_um=np.concatenate([case.deflection_um, new]))

"""What acts on the tool is less than the sensor says while the load grows, and more while it is taken off."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Parameter
from identification.model.effects.kinds import NO_LOAD_OFF, OfWrench
from identification.model.load_state import LoadState

# Loads [N] that differ by less are the same.
SAME_N = 1.0


class LoadFriction(OfWrench):
    """True force = (1 - m s) reported force, s = 1 while the load grows and -1 while it is taken off."""

    name = "load_friction"
    family = "load path"
    formula_source = ("engineering judgement: Coulomb's friction at a sheave, a guide or a seal: a share of the load, "
                      "against the motion")
    parameters = (Parameter("share", "1", 0.02, -0.3, 0.3,
                            source="engineering judgement: a sheave takes 1 to 5 % of the load",
                            bounds_source="engineering judgement: either way, to a sheave that hardly turns"),)
    sentence = ("the load had friction between its sensor and the tool (a sheave, a guide, a seal): smaller than reported on "
                "the way up, larger on the way down")
    settles = "put the force sensor between the friction and the tool, or tap the rig before each reading"

    def missing(self, rows: LoadState) -> str:
        loaded = np.any(rows.wrench[:, :3] != 0, axis=1)
        return "" if np.any(direction(rows)[loaded] < 0) else NO_LOAD_OFF

    def true_wrench(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        return np.asarray(rows.wrench * (1.0 - values[0] * direction(rows))[:, None])


def direction(rows: LoadState) -> Array:
    """1 where the load of a row (n,) is larger than the last at the same pose, -1 where it is smaller, else as before."""
    size, starts = np.linalg.norm(rows.wrench[:, :3], axis=1), rows.starts
    result, now = np.ones(len(size)), 1.0
    for k, (start, step) in enumerate(zip(starts, np.diff(size, prepend=0.0), strict=True)):
        now = 1.0 if start else np.sign(step) if abs(step) > SAME_N else now
        result[k] = now
    return result

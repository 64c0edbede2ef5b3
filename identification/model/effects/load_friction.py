"""What acts on the tool is less than the sensor says while the load grows, and more while it is taken off."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Parameter
from identification.model.effects.kinds import NO_LOAD_OFF, OfWrench
from identification.model.load_state import LoadState

# Loads that differ by less than this share are the same; along one line they are down to this cosine.
SAME, SAME_LINE = 0.03, 0.995


class _LoadFriction(OfWrench):
    """What the laws have in common."""

    name = "load_friction"
    family = "load path"
    sentence = ("the load had friction between its sensor and the tool (a sheave, a guide, a seal): smaller than reported on "
                "the way up, larger on the way down")
    settles = "put the force sensor between the friction and the tool, or tap the rig before each reading"


class Seal(_LoadFriction):
    """True force = F - f s u, u along the load: as large under every load. held: how much of it stays when the load that was
    taken off reads zero."""

    law = "seal"
    formula_source = ("engineering judgement: Coulomb's friction that no load presses on, as of a cylinder's seal under its "
                      "own tension: the same force against the motion")
    parameters = (
        Parameter("force_n", "N", 10.0, 0.0, 500.0,
                  source="engineering judgement: a seal of a hand pump's cylinder takes some per cent of what it pushes with",
                  bounds_source="engineering judgement: none, to a cylinder that hardly moves"),
        Parameter("held", "1", 1.0, 0.0, 1.0, grid=(0.0, 1.0), shape=True,
                  source="engineering judgement: either it is relieved, or it goes on pressing",
                  bounds_source="engineering judgement: nothing, to all of it"),
    )

    def missing(self, rows: LoadState) -> str:
        return "" if np.any((_opposed(rows, 1.0) < 0) & last_direction(rows).any(axis=1)) else NO_LOAD_OFF

    def true_wrench(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        force, held = values
        wrench, along = rows.wrench.copy(), last_direction(rows)
        wrench[:, :3] -= force * _opposed(rows, held)[:, None] * along
        return wrench


class LoadFriction(_LoadFriction):
    """True force = (1 - m s) reported force, s = 1 while the load grows and -1 while it is taken off."""

    other_laws = (Seal(),)
    formula_source = ("engineering judgement: Coulomb's friction at a sheave, a guide or a seal: a share of the load, "
                      "against the motion")
    parameters = (Parameter("share", "1", 0.02, -0.3, 0.3,
                            source="engineering judgement: a sheave takes 1 to 5 % of the load",
                            bounds_source="engineering judgement: either way, to a sheave that hardly turns"),)

    def missing(self, rows: LoadState) -> str:
        loaded = np.any(rows.wrench[:, :3] != 0, axis=1)
        return "" if np.any(direction(rows)[loaded] < 0) else NO_LOAD_OFF

    def true_wrench(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        return np.asarray(rows.wrench * (1.0 - values[0] * direction(rows))[:, None])


def last_direction(rows: LoadState) -> Array:
    """Unit vector (n, 3) of the load of a row, of the last at the same pose where there is none, zero before the first."""
    force = rows.wrench[:, :3]
    size = np.linalg.norm(force, axis=1)
    number = np.arange(len(rows))
    first = np.maximum.accumulate(np.where(rows.starts, number, 0))
    last = np.maximum(np.maximum.accumulate(np.where(size > 0, number, 0)), first)
    return np.asarray(force[last] / np.where(size[last] > 0, size[last], 1.0)[:, None])


def _opposed(rows: LoadState, held: float) -> Array:
    """s (n,): 1 on the way up, -1 on the way down, -held where what was taken off reads zero, 0 where it is read once more: for
    the next load the device was set up anew."""
    empty = ~np.any(rows.wrench[:, :3] != 0, axis=1)
    once_more = np.concatenate([[False], empty[:-1]]) & ~rows.starts
    return np.where(empty, np.where(once_more, 0.0, -held), direction(rows))


def direction(rows: LoadState) -> Array:
    """1 where the load of a row (n,) is larger than the last along the same line at the same pose, -1 where it is smaller, as
    before where it is the same; 1 where it comes along another line, since it grew from nothing there."""
    force, now = rows.wrench[:, :3], 1.0
    size, result = np.linalg.norm(force, axis=1), np.ones(len(rows))
    for k in range(1, len(rows)):
        same_line = not rows.starts[k] and force[k] @ force[k - 1] > SAME_LINE * size[k] * size[k - 1] > 0
        step = size[k] - size[k - 1]
        now = 1.0 if not same_line else np.sign(step) if abs(step) > SAME * size[k - 1] else now
        result[k] = now
    return result

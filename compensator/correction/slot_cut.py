"""The force in a slot: it grows with how deep the cutter stands along its axis, and with nothing else.

Half of the cutter is in the stock there, whichever way it steps aside: the force stays. A step along the axis takes as much
more or less of the edges into the stock, and with the depth b along the axis all of the force grows alike:

    F' = F (1 + (e . up) / b),

e where the tool stood off the plan, up the unit vector from the tip to the spindle. A push across moves the tool of a robot
along its axis too: 0.1 mm in a slot 1.5 mm deep are 7 % of the force. So K of an open wall says nothing here; what does is
K = F_n / b [N/m], the same in every slot of a tool and feed, however deep. By the specific cutting force k_c of the material,
from the mean over the half circle of the push across, chips of f_z cos(phi) on z teeth,

    K = k_c(h) f / 4,    h = 2 f_z / pi,    f = z f_z the feed a turn.

Where nothing tells it, b is one of the depths that there may be (cutting_prior.py). Where the tool enters a slot the force
grows to that of the full slot, and K with it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from compensator.correction.cut_kind import cut_shares, towards_spindle
from compensator.path.robot_path import RobotPath
from identification.common.arrays import Array

# A slot is full where the push across is over this share of the middle of its stretch, at so many targets to either side too.
FULL, BESIDE = 0.9, 3


@dataclass(frozen=True, eq=False)
class Slots:
    """share (N,) of a slot that the cut is (cut_kind.py); per_stiffness (N,) [m/N]: by what share of itself the force grows for
    each N/m of K, where the tool goes to its plan; rise (N,) [m]: how far it stood towards the spindle."""

    share: Array
    per_stiffness: Array
    rise: Array


def slots(path: RobotPath, force: Array, across: Array, stood: Array) -> Slots:
    """Of a log whose force (N, 3) [N], base frame, has the part `across` (N,) [N] across the feed, the tool standing off the
    plan by stood (N, 3) [m]."""
    _, share = cut_shares(path, force)
    rise = np.einsum("ni,ni->n", stood, towards_spindle(path))
    full = in_full_slot(share, across)
    return Slots(share, np.where(full > 0, rise / np.maximum(full, 1e-300), 0.0), rise)


def in_full_slot(share: Array, across: Array) -> Array:
    """The push across (N,) [N] of the full slot that each target stands in: the middle of its stretch, or what is there if that
    is more."""
    rows = np.flatnonzero(share > 0.5)
    if not len(rows):
        return across
    stretch = np.cumsum(np.diff(rows, prepend=rows[0]) > 1)
    count = np.bincount(stretch)
    start = np.cumsum(count) - count
    ascending = across[rows][np.lexsort((across[rows], stretch))]
    middle = 0.5 * (ascending[start + (count - 1) // 2] + ascending[start + count // 2])
    full = across.copy()
    full[rows] = np.maximum(across[rows], middle[stretch])
    return full


def full_slot(path: RobotPath, force: Array, across: Array) -> NDArray[np.bool_]:
    """The targets (N,) that stand in a full slot, not where the tool enters it."""
    _, share = cut_shares(path, force)
    full = (share > 0.5) & (across > FULL * in_full_slot(share, across))
    return np.asarray(np.convolve(full, np.ones(2 * BESIDE + 1))[BESIDE:BESIDE + len(full)] > 2 * BESIDE)

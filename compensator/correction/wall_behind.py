"""Behind a sharp corner the corrected tool comes where that of the log was not: it must not spring into the wall there.

Pushed aside by the wall that it cuts, a yielding tool turns an inner corner early: while the log was taken it passed D beyond
the corner, D how far it stood off the plan along the way behind. Corrected it turns at the corner, in stock that no log has
met: what it cuts there pushes it along the feed, on into the wall behind, and the push back of that wall, which the log shows
as the corner comes near, may be missing. So towards the wall behind an offset is made for the worse side: from where it begins
to rise before the corner, to D behind it, it stays one sigma below what it was before. What it would have risen is left as
stock, which the log of that pass shows; it is never so much that the point is farther off than without correction. A
tool that stood aside by less than the cut is deep turned within the stock: its log tells the force there. So does that of a
corrected pass, whose tool stands aside by little (least_depth.py).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from compensator.correction.corners import sharp_corners
from compensator.correction.cutting_prior import SHALLOWEST_CUT
from compensator.path.robot_path import RobotPath
from identification.common.arrays import directions

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
# Held is at most this share of a deviation, half of its square: the point is no farther off than without correction then, even
# if as much is left of something else.
ROOM = float(np.sqrt(0.5))
STRAIGHT = 1 - 1e-6     # cosine between moves that are in line


def held_before_the_wall(
    path: RobotPath, targets: Indices, offset: Array, sigma: Array, stood: Array, force: Array, depth: Array
) -> Array:
    """The offsets (M, 3) [m] of the targets (M,), held at inner sharp corners.

    sigma (M,) [m] of them. stood (M, 3) [m]: where the tool of the log stood off the plan; force (M, 3) [N] on it. All in the
    resting frame (external_axes.py). depth (M,) [m]: how deep across the feed the cut is at least, NaN
    where nothing tells.
    """
    corners = sharp_corners(path, targets)
    result, length = offset.copy(), path.length[targets]
    with np.errstate(over="ignore", invalid="ignore"):      # absurd numbers in targets without force
        way = directions(np.diff(path.rest_from_tcp.position, axis=0))
    ends = _ends_of_lines(way, targets)
    for corner, end in zip(corners.tolist(), np.searchsorted(ends, corners).tolist(), strict=True):
        before, behind = way[targets[corner] - 1], way[targets[corner]]
        early = float(stood[corner] @ behind)
        first, stop = int(ends[end - 1]), min(int(np.searchsorted(length, length[corner] + early)), int(ends[end + 1]))
        if early <= _least(depth[first:corner + 1]) or force[stop] @ before >= 0:
            continue        # an outer corner, one in whose stock the tool turned, or no wall behind it
        calm = np.linalg.norm(offset[corner + 1:stop] - offset[stop], axis=1) <= sigma[corner + 1:stop]
        stop = corner + 1 + int(np.argmax(calm)) if calm.any() else stop      # it is in the cut behind already
        low = first + _low_before(offset[first:corner + 1] @ before, sigma[first:corner + 1])
        size = np.linalg.norm(offset[low:stop + 1], axis=1)
        unsure = sigma[low] * np.abs(offset[low] @ before) / max(size[0], 1e-12)
        rise = (offset[low:stop] - offset[low]) @ before + unsure
        rise[0] = 0.0
        room = ROOM * size[:-1]
        room[-1] = min(room[-1], ROOM * size[-1])       # what stands behind it is not held
        result[low:stop] -= np.clip(rise, 0.0, room)[:, None] * before
    return result


def _least(depth: Array) -> float:
    """Of the depths (n,) [m] on the way to a corner: as it comes near the push across is that of the wall behind too."""
    return float(np.nanmin(depth)) if np.isfinite(depth).any() else SHALLOWEST_CUT


def _ends_of_lines(way: Array, targets: Indices) -> Indices:
    """The places (K,) among the targets (M,) where straight lines of moves with force begin or end, ascending, the first and
    the last among them; way (N - 1, 3): directions of the moves."""
    inner = targets[1:-1]
    through = (np.diff(targets)[:-1] == 1) & (np.diff(targets)[1:] == 1)
    through &= np.einsum("ni,ni->n", way[inner - 1], way[inner]) > STRAIGHT
    return np.flatnonzero(~np.concatenate([[False], through, [False]]))


def _low_before(rising: Array, sigma: Array) -> int:
    """Where values (n,) began to rise to the last one: their least, looked back from there until they are sigma (n,) above."""
    back = rising[::-1]
    above = np.flatnonzero(back > np.minimum.accumulate(back) + sigma[::-1])
    return len(rising) - 1 - int(np.argmin(back[:above[0]] if len(above) else back))

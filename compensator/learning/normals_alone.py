"""A probe feels a surface along its normal. Where such readings are written as three components, what the tool did along the
feed stands there as nothing, and the springs come out too stiff."""

from __future__ import annotations

import numpy as np

from compensator.correction.predict import Predicted
from compensator.learning.rows import Rows
from identification.common.arrays import Array, directions, rms
from identification.common.findings import Finding

# So many places at least; so large a part of the prediction along the feed [m], and so many sigmas of the readings; under such
# a share of it, or so many sigmas, next to nothing was read; while across the feed at least such a share was.
FEWEST, LEAST, CLEARLY = 12, 2e-5, 3.0
NOTHING, WITHIN, THERE = 0.1, 1.5, 0.5
# The feed's direction is that over so far a way to both sides [m].
STEP = 5e-4


def said_of_normals(rows: Rows, measured: Array, told: Array, predicted: Predicted, source: str) -> list[Finding]:
    """A warning (CS5332) where measured (n,) [m] has nothing along the feed at the places at which all three components stand,
    and told (n,) [m], the prediction, has a deviation there."""
    each = np.bincount(rows.place, minlength=len(rows.position))
    whole = np.flatnonzero(each[rows.place] == 3).reshape(-1, 3)
    axes = rows.direction[whole]
    if len(whole) < FEWEST or np.any(np.abs(np.linalg.det(axes)) < 0.9):
        return []
    read, expected = (np.einsum("pkc,pk->pc", axes, values[whole]) for values in (measured, told))
    length, position = predicted.path.length, predicted.path.base_from_tcp.position
    known = np.flatnonzero(np.isfinite(length) & predicted.path.known)
    way, at = np.maximum.accumulate(length[known]), rows.length[rows.place[whole[:, 0]]]
    before, behind = (np.column_stack([np.interp(at + side, way, axis) for axis in position[known].T])
                      for side in (-STEP, STEP))
    feed = directions(behind - before)
    along = [np.einsum("pc,pc->p", values, feed) for values in (read, expected)]
    across = [np.linalg.norm(values - part[:, None] * feed, axis=1)
              for values, part in zip((read, expected), along, strict=True)]
    # In the middle: at arcs the feed is that of their chords.
    sigma = rms(rows.sigma)
    (read_along, size), (read_across, wide) = ([float(np.median(np.abs(each))) for each in both] for both in (along, across))
    if size < max(LEAST, CLEARLY * sigma) or read_along > max(NOTHING * size, WITHIN * sigma) or read_across < THERE * wide:
        return []
    return [Finding("CS5332", "warning", f"along the feed the points are off by {1e6 * read_along:.0f} um in the middle, where "
                    f"{1e6 * size:.0f} are predicted, and across it by {1e6 * read_across:.0f} of {1e6 * wide:.0f}",
                    file=source, hint="a probe feels along the surface's normal alone: then give nx ny nz and dn_um, or leave "
                    "the other components empty; as zeros they make the robot too stiff")]

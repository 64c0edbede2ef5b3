"""Are the force's columns in the wrong order, so that the push along the tool's axis stands where a push across it belongs?

A cutter's tip or helix pushes along the axis one way, whichever way it travels; what pushes across follows the travel. Read in
the wrong order the axial force of passes to and fro turns its sign with the travel, as its direction tells, and that across
follows less than it does in another order: both at once no cut does. Columns across the axis that change places are told by
their directions (cut_direction.py). Passes all one way, or a slot along one line, cannot tell: three constants fit any order.
"""

from __future__ import annotations

from itertools import permutations

import numpy as np

from compensator.forces.cut_direction import CutDirection, Travel
from identification.common.arrays import Array
from identification.common.findings import Finding

# Across the axis so much of the force follows the travel in the right order, and at most this part of it in the other; along
# the axis its mean is at most such a share of its RMS, which is so much of the whole, and the travel's direction explains such
# a part of its energy (engineering judgement; columns.py).
FOLLOWS, LESS, TURNS_OVER, MATTERS, EXPLAINED = 0.6, 0.8, 0.5, 0.3, 0.5
# Orders of the columns that bring another one onto an axis.
ORDERS = [order for order in permutations(range(3)) if order != (0, 1, 2)]


def swapped_columns(cuts: Travel | None, force: Array, base_from_log: Array, source: str) -> list[Finding]:
    """A warning (CS3078). force (N, 3) [N] on the tool, base frame; base_from_log (N, 3, 3): the axes that it was logged in."""
    if cuts is None or not turns_over(cuts, force):
        return []
    here = cuts.against(force)
    logged = np.einsum("nji,nj->ni", base_from_log, force)
    each = {order: cuts.against(np.einsum("nij,nj->ni", base_from_log, logged[:, order])) for order in ORDERS}
    best = max(each, key=lambda order: _kept(each[order]))
    if each[best].share < FOLLOWS or here.share > LESS * each[best].share:
        return []
    names = ["fx_n", "fy_n", "fz_n"]
    return [Finding(
        "CS3078", "warning", "the force along the tool's axis turns its sign with the travel, and of that across it only "
        f"{100 * here.share:.0f} % follow; with the columns {' '.join(names[k] for k in best)} in this order "
        f"{100 * each[best].share:.0f} % would", file=source,
        hint="are the force columns in the order of the sensor's axes, and is force_log.frame right?")]


def _kept(seen: CutDirection) -> float:
    return seen.share * seen.follows


def turns_over(cuts: Travel, force: Array) -> bool:
    """Whether the force (N, 3) along the axis is large, of either sign alike, and turns with the travel."""
    local = force[cuts.which]
    along_axis = np.einsum("ni,ni->n", local, cuts.up)
    total = np.average(np.sum(local**2, axis=1), weights=cuts.weight)
    energy = np.average(along_axis**2, weights=cuts.weight)
    if energy <= MATTERS**2 * total or np.average(along_axis, weights=cuts.weight) ** 2 >= TURNS_OVER**2 * energy:
        return False
    root, feed = np.sqrt(cuts.weight), cuts.feed - np.average(cuts.feed, axis=0, weights=cuts.weight)
    # Along a line two of the three directions are rounding: no regression on them.
    with_travel = np.linalg.lstsq(feed * root[:, None], along_axis * root, rcond=1e-3)[0]
    return bool(np.average((feed @ with_travel) ** 2, weights=cuts.weight) > EXPLAINED * energy)

"""Are the force's columns in the wrong order, so that the push along the tool's axis stands where a push across it belongs?

A cutter's tip or helix pushes along the axis one way, whichever way it travels; what pushes across follows the travel. Read in
the wrong order the axial force of passes to and fro turns its sign with the travel, and that across does not follow: both at
once no cut does. Columns across the axis that change places are told by their directions (cut_direction.py).
"""

from __future__ import annotations

from itertools import permutations

import numpy as np

from compensator.forces.cut_direction import CutDirection, Travel
from identification.common.arrays import Array
from identification.common.findings import Finding

# Across the axis so much of the force follows the travel in the right order, and at most this part of it in the other; along
# the axis its mean is at most such a share of its RMS, which is so much of the whole (engineering judgement; passes.py).
FOLLOWS, LESS, TURNS_OVER, MATTERS = 0.6, 0.6, 0.5, 0.4
# Orders of the columns that bring another one onto an axis.
ORDERS = [order for order in permutations(range(3)) if order != (0, 1, 2)]


def swapped_columns(cuts: Travel | None, force: Array, base_from_log: Array, source: str) -> list[Finding]:
    """A warning (CS3078). force (N, 3) [N] on the tool, base frame; base_from_log (N, 3, 3): the axes that it was logged in."""
    if cuts is None:
        return []
    here = cuts.against(force)
    logged = np.einsum("nji,nj->ni", base_from_log, force)
    each = {order: cuts.against(np.einsum("nij,nj->ni", base_from_log, logged[:, order])) for order in ORDERS}
    best = max(each, key=lambda order: _kept(each[order]))
    if not turns_over(cuts, force) or each[best].share < FOLLOWS or here.share > LESS * each[best].share:
        return []
    names = ["fx_n", "fy_n", "fz_n"]
    return [Finding(
        "CS3078", "warning", "the force along the tool's axis turns its sign with the travel, and that across it does not "
        f"follow the travel ({100 * here.share:.0f} %); with the columns {' '.join(names[k] for k in best)} in this order "
        f"{100 * each[best].share:.0f} % would", file=source,
        hint="are the force columns in the order of the sensor's axes, and is force_log.frame right?")]


def _kept(seen: CutDirection) -> float:
    return seen.share * seen.follows


def turns_over(cuts: Travel, force: Array) -> bool:
    """Whether the force (N, 3) along the axis is large and of either sign alike."""
    local = force[cuts.which]
    along_axis = np.einsum("ni,ni->n", local, cuts.up)
    total = float(np.sqrt(np.average(np.sum(local**2, axis=1), weights=cuts.weight)))
    size = float(np.sqrt(np.average(along_axis**2, weights=cuts.weight)))
    return size > MATTERS * total and abs(float(np.average(along_axis, weights=cuts.weight))) < TURNS_OVER * size

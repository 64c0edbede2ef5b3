"""How deep across the feed a cut is at least, by what is known of it.

At an inner corner a tool that stood aside by less turned within the stock (wall_behind.py). Stated, it is that depth. Where a
cutting stiffness K is known the push across F_n of a climbing cut tells it: K = GROWS F_n / a of the depth a while the log was
taken, and the planned one is deeper by as much as the tool stood aside,

    GROWS F_n / K + e . n ,

of whose first part one sigma is taken off, by K and by how cutters differ (cutting_prior.py).
"""

from __future__ import annotations

import numpy as np

from compensator.correction.cut_kind import climb_share
from compensator.correction.cutting_prior import CUTTERS_DIFFER, GROWS
from compensator.correction.engagement import LoggedPass, across_feed
from compensator.correction.predict import Predicted
from identification.common.arrays import Array


def least_depth(predicted: Predicted, logged: LoggedPass, stood: Array) -> Array:
    """At the targets with force (M,) [m], NaN where nothing tells; stood (M, 3) [m], base frame: where the tool of the log
    stood off the plan."""
    targets, stated, known = predicted.targets, predicted.settings.correction.depth_of_cut, logged.stiffness
    if stated is not None:
        return np.full(len(targets), stated)
    if known is None or not known.followed:
        return np.full(len(targets), np.nan)
    force = predicted.forces.wrench[:, :3]
    direction, across = (values[targets] for values in across_feed(predicted.path, force))
    sure = float(np.exp(-np.hypot(known.std / known.value, CUTTERS_DIFFER)))
    depth = sure * GROWS * across / known.value + np.maximum(np.einsum("ni,ni->n", stood, direction), 0.0)
    return np.where((climb_share(predicted.path, force)[targets] > 0.5) & (across > 0), depth, np.nan)

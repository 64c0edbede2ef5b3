"""Teeth of a tool whose axis is off: where the chip is thin some of them miss it, and the force of so many edges is not there.

With the axis off by e the tooth j stands out by e cos(2 pi j / z + psi): its chip is f_z cos(phi) + D cos(theta), D = 2 e
sin(pi / z), theta by the tooth. It misses where that is negative: of all teeth the share arccos(f_z cos(phi) / D) / pi, near
the two ends of the half circle that faces the feed. What it leaves the next tooth takes, so that the chips' force stays; the
edges' is lost. A fit that knows of no run-out takes that for other coefficients.
"""

from __future__ import annotations

import numpy as np

from compensator.cutting.chips import EDGE
from compensator.cutting.cut import Cut
from identification.common.arrays import Array

# 1 sigma of a tool's axis in its holder, which nobody has measured [m]; an indicator reads twice that. Engineering judgement.
AXIS_OFF = 6e-6
# Of the half circle.
PIECES = 720


def missing_force(cut: Cut, coefficients: Array) -> Array:
    """What AXIS_OFF takes of the mean force of the targets (N, 3) [N] of a cut, base frame; coefficients (6,)."""
    engagement, track = cut.engagement, cut.track
    way = (track.end - track.start)[:, :2]
    feed = way / np.maximum(np.hypot(*way.T), 1e-12)[:, None]
    left = np.column_stack([-feed[:, 1], feed[:, 0]])
    some = engagement.cuts & ~engagement.unknown
    local = np.zeros((len(track), 3))
    local[some] = engagement.depth[some, None] * lost(engagement.low[some], engagement.high[some],
                                                      float(np.median(track.chip[some])), cut.cutter.teeth, coefficients[EDGE])
    turned = np.column_stack([local[:, :1] * feed + local[:, 1:2] * left, local[:, 2]])
    return cut.mean(np.einsum("sij,sj->si", cut.path.base_from_object.rotation[track.target], turned))


def lost(low: Array, high: Array, chip: float, teeth: int, edge: Array, off: float = AXIS_OFF) -> Array:
    """Force (n, 3) [N/m] of depth, along the feed, to its left and up, that an axis `off` [m] of its place takes of a cut from
    low to high (n,) [rad].

    chip [m]: feed a tooth; edge (3,) [N/m]: Kte Kre Kae. Edges stand upright: for the size of an error that is enough.
    """
    ends = np.linspace(-np.pi / 2, np.pi / 2, PIECES + 1)
    phi = 0.5 * (ends[1:] + ends[:-1])
    most = max(2 * off * np.sin(np.pi / teeth), 1e-12)
    missed = np.arccos(np.minimum(chip * np.cos(phi) / most, 1.0)) / np.pi
    tangential, radial, axial = edge
    force = np.column_stack([-tangential * np.sin(phi) - radial * np.cos(phi),
                             tangential * np.cos(phi) - radial * np.sin(phi), np.full(PIECES, -axial)])
    up_to = np.concatenate([np.zeros((1, 3)), np.cumsum(force * missed[:, None], axis=0)]) * (-teeth / (2 * PIECES))
    return np.column_stack([np.interp(high, ends, column) - np.interp(low, ends, column) for column in up_to.T])

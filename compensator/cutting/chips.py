"""The mean force of an end mill is linear in six coefficients: what its chips weigh them with, over a revolution.

At the angle phi to the left of the feed, an edge of length dS that carries the depth dz along the axis has the force ON THE
TOOL (linear-edge model; Altintas, Manufacturing Automation, ch. 2; Engin and Altintas, Int. J. Mach. Tools Manuf. 41, 2001, for
the rounded corner)

    (Ktc h dz / s + Kte dS) t - (Krc h dz / s + Kre dS) n - (Kac h dz / s + Kae dS) a,    h = f_z n . f,    dS = dz / s

t = (-sin, cos, 0) against the edge's speed (the spindle turns clockwise seen from above), n the outer normal of the surface
that the edge describes, a along the edge towards the spindle, s the sine of the normal's angle to the axis (1 on the flank),
f along the feed: on the level n . f = s cos(phi).
Each of z teeth passes an angle once a revolution: the mean is z / 2 pi times the integral over the angles in the cut. The helix
shifts in time, not in the mean. Not in it: the floor under the cutter, run-out so large that a tooth misses, chatter.
"""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array

COEFFICIENTS = ("Ktc", "Krc", "Kac", "Kte", "Kre", "Kae")
SHEAR, EDGE = slice(0, 3), slice(3, 6)


def integrals(low: Array, high: Array) -> Array:
    """Of cos sin, cos^2, cos, sin, 1 over phi from low to high (n,) [rad]: (n, 5)."""
    sl, cl, sh, ch = np.sin(low), np.cos(low), np.sin(high), np.cos(high)
    return np.column_stack([0.5 * (sh**2 - sl**2), 0.5 * (high - low + sh * ch - sl * cl), sh - sl, cl - ch, high - low])


def weights(integral: Array, depth: Array, sine: Array, edge: Array, teeth: int, level: Array | None = None,
            rise: Array | None = None) -> Array:
    """A (n, 3, 6): the mean force (along the feed, to its left, towards the spindle) is A K with a feed a tooth of 1 m in the
    three of the chip; [m^2] there, [m] in the three of the edge.

    integral (n, 5) as `integrals` gives them, depth (n,) [m] along the axis, sine (n,) of the normal's angle to the axis, edge
    (n,) [m]: length of the edge in that depth; level (n,): cosine of the feed's slope; rise (n,) [m]: its sine times what the
    cutter widens by in that depth, since n . f has a part -sin(slope) sqrt(1 - s^2), and sqrt(1 - s^2) dz / s is dr; None: on
    the level.
    """
    cos_sin, cos2, cos, sin, one = integral.T
    root = np.sqrt(np.maximum(1 - sine**2, 0.0))
    result = np.zeros((len(integral), 3, 6))
    # Of the chip on the level: h dz / s = f_z cos dz. The unit vectors t, n, a, each times cos, integrated.
    result[:, :, 0] = np.column_stack([-cos_sin, cos2, 0 * cos])
    result[:, :, 1] = -np.column_stack([sine * cos2, sine * cos_sin, -root * cos])
    result[:, :, 2] = -np.column_stack([root * cos2, root * cos_sin, sine * cos])
    # Of the edge: dS = dz / s.
    result[:, :, 3] = np.column_stack([-sin, cos, 0 * cos])
    result[:, :, 4] = -np.column_stack([sine * cos, sine * sin, -root * one])
    result[:, :, 5] = -np.column_stack([root * cos, root * sin, sine * one])
    shear, edges, deep = result[:, :, SHEAR], result[:, :, EDGE], np.maximum(depth, 1e-300)
    if level is not None and rise is not None:
        shear *= level[:, None, None]
        shear -= (rise / deep)[:, None, None] * edges
    edges *= (edge / deep)[:, None, None]
    result *= (teeth / (2 * np.pi) * depth)[:, None, None]
    return result

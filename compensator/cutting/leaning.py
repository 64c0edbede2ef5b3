"""A ball whose tool leans: where it cuts the stock is that of any ball, how hard, and which way, goes by the tool's axis.

On a ball of radius R each of z teeth meets a patch dA of the surface once a revolution, with dA / (R s) of edge times angle, s
the sine of the surface's normal n to the axis a. With h = f_z (n . f) along the feed f, and dA = R dz dphi in a level slice,

    mean force = z / 2 pi integral of [(Ktc h + Kte) t - (Krc h + Kre) n - (Kac h + Kae) u] dz dphi / s,

t against the edge's speed, that of the turn along a x n and, near the tip, that of the feed, u = (a - (a . n) n) / s along the
edge towards the spindle. Upright, but for that feed, it is chips.py. Where n . a > 0 there is no ball but the shank.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from compensator.cutting.cutter import Cutter
from identification.common.arrays import Array

Flags = NDArray[np.bool_]
# An axis so far off the vertical of the work object leans [rad]: by more, a flat cutter of 16 mm would stand 0.14 mm lower on
# one side. And a ball is known as far as this: beyond it little of what faces the stock is ball.
MOST_TILT, MOST_LEAN = np.radians(1.0), np.radians(60.0)
# A layer of a ball is looked at in so many rings; in more where it holds the tip, or is next to it.
RINGS, RINGS_AT_TIP = 3, 24


def leans(axis: Array) -> Flags:
    """Tools (K,) whose axes (K, 3) are not upright."""
    return np.asarray(axis[:, 2] < np.cos(MOST_TILT))


def leans_too_far(axis: Array) -> Flags:
    """Those (K,) of which nothing is worked out, balls too."""
    return np.asarray(axis[:, 2] < np.cos(MOST_LEAN))


def above_the_ball(angle: Array, at: Array, radius: float, feed: Array, axis: Array) -> Flags:
    """Points (K, P) of the rims at heights `at` (K,) [m] above the tip, at angles (K, P) from the feed (K, 2), that are no
    points of the ball: there the shank begins."""
    cosine = np.clip(1 - at / radius, -1.0, 1.0)
    normal = _normals(np.arccos(cosine)[:, None], angle, feed[:, None, :])
    return np.asarray((np.einsum("kpi,ki->kp", normal, axis) > 0) | (at > radius)[:, None])


def shank_rim(angle: Array, high: Array, radius: float, travel: Array, axis: Array) -> Array:
    """Points (K, P, 2) [m] from the ball's middle on the half of the shank that faces the feed, travel (K, 3), where it passes
    heights `high` (K,) [m] over the middle; NaN where that is ball."""
    forward = travel - np.einsum("ki,ki->k", travel, axis)[:, None] * axis
    forward /= np.maximum(np.linalg.norm(forward, axis=1), 1e-12)[:, None]
    across = np.cross(axis, forward)
    out = np.cos(angle)[None, :, None] * forward[:, None, :] + np.sin(angle)[None, :, None] * across[:, None, :]
    up = (high[:, None] - radius * out[..., 2]) / axis[:, 2:]
    points = up[..., None] * axis[:, None, :2] + radius * out[..., :2]
    return np.where((up > 0)[..., None], points, np.nan)


def across_shank(points: Array, axis: Array) -> Array:
    """Level points (..., 2) [m] squeezed along the lean of an axis (3,), so that the ellipses of a shank become its circles."""
    lean = axis[:2] / max(float(np.hypot(*axis[:2])), 1e-12)
    return np.asarray(points - (1 - axis[2]) * (points @ lean)[..., None] * lean)


def leaning_weights(begin: Array, stop: Array, foot: Array, thick: Array, cutter: Cutter, feed: Array, travel: Array,
                    axis: Array, chip: Array) -> Array:
    """Weights (M, 3, 6) as those of `chips.weights`, in the work object, of arcs from begin to stop (M,) [rad] in layers from
    foot (M,) [m] above the lowest point, thick (M,) [m]; feed (M, 2), level, and travel (M, 3) with its slope, axis (M, 3) of
    the tool, chip (M,) [m]: feed a tooth."""
    lower, upper = (np.arccos(np.clip(1 - height / cutter.radius, -1.0, 1.0)) for height in (foot, foot + thick))
    tip, width = np.arccos(np.minimum(axis[:, 2], 1.0)), upper - lower
    near = (tip > lower - width) & (tip < upper + width)
    result = np.empty((len(begin), 3, 6))
    for some, rings in ((near, RINGS_AT_TIP), (~near, RINGS)):
        edges = lower[some, None] + width[some, None] * np.linspace(0, 1, rings + 1)
        slip = cutter.teeth * chip[some] / (2 * np.pi * cutter.radius)
        result[some] = _in_rings(edges, begin[some], stop[some], cutter, feed[some], travel[some], axis[some], slip)
    return result


def _in_rings(edges: Array, begin: Array, stop: Array, cutter: Cutter, feed: Array, travel: Array, axis: Array, slip: Array
              ) -> Array:
    """The same for rings between polar angles edges (M, rings + 1) [rad]; slip (M,): feed by the equator's speed."""
    height = -cutter.radius * np.diff(np.cos(edges), axis=1)
    polar = 0.5 * (edges[:, 1:] + edges[:, :-1])
    normal = _normals(polar, (0.5 * (begin + stop))[:, None], feed[:, None, :])
    turned = np.cross(axis[:, None, :], normal)
    size = np.linalg.norm(turned, axis=2)
    # About the tip: the mean of 1 / s over a disc is that of half its radius.
    sine = np.maximum(size, 0.25 * np.diff(edges, axis=1))
    against = turned - slip[:, None, None] * travel[:, None, :]
    t = against / np.maximum(np.linalg.norm(against, axis=2), 1e-12)[..., None]
    u = (axis[:, None, :] - np.einsum("mi,mri->mr", axis, normal)[..., None] * normal) / np.maximum(size, 1e-12)[..., None]
    weight = cutter.teeth / (2 * np.pi) * height * (stop - begin)[:, None] / sine
    chip = np.einsum("mri,mi->mr", normal, travel)
    vectors = np.stack([t, -normal, -u], axis=3)
    return np.concatenate([np.einsum("mr,mric->mic", of, vectors) for of in (weight * chip, weight)], axis=2)


def _normals(polar: Array, angle: Array, feed: Array) -> Array:
    """Outer normals (..., 3) of a ball at polar angles from its lowest point, at angles to the left of the feed (..., 2)."""
    level = np.stack([np.cos(angle) * feed[..., 0] - np.sin(angle) * feed[..., 1],
                      np.cos(angle) * feed[..., 1] + np.sin(angle) * feed[..., 0]], axis=-1)
    flat = np.sin(polar)[..., None] * level
    return np.concatenate([flat, np.broadcast_to(-np.cos(polar)[..., None], (*flat.shape[:-1], 1))], axis=-1)

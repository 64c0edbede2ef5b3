"""Deviations that were written along other axes than their columns say: in another frame, an axis with the other sign, two
exchanged, or turned by any angle. Told by what is predicted there, beside a constant that a set-up error may leave."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations

import numpy as np

from identification.common.arrays import Array, rms

# Told where other axes leave under this share of what the stated ones do, which is over this share of the measured itself and
# over so many sigmas, at so many places at least, with a multiple of the prediction within these (engineering judgement).
SHARE, LARGE, SIGMAS, FEWEST, SANE = 0.6, 0.2, 3.0, 12, (0.5, 2.0)
AXES = "xyz"
# A turn by any angle fits anything somewhat: told from so many degrees on, where it leaves under this share.
LEAST_TURN, OF_TURN = 15.0, 0.5


def along_other_axes(
    measured: Array, told: Array, frames: Mapping[str, Array], sigma: float
) -> tuple[str, float, float] | None:
    """What axes the measured (P, 3) [m], 1 sigma [m] of each number, seem to be along, and what is left RMS [m] with these and
    with the stated; None: the stated ones, or nothing that is sure. told (P, 3) [m]: predicted along the stated axes; frames:
    along others, each by its name."""
    centred = measured - measured.mean(axis=0)
    as_is = _left(centred, told, sane=False)
    if len(measured) < FEWEST or as_is < max(LARGE * rms(centred), SIGMAS * sigma):
        return None
    others = dict(frames)
    for axis in range(3):
        others[f"{AXES[axis]} with the other sign"] = told * np.where(np.arange(3) == axis, -1.0, 1.0)
    for one, other in combinations(range(3), 2):
        order = np.arange(3)
        order[[one, other]] = other, one
        others[f"{AXES[one]} and {AXES[other]} exchanged"] = told[:, order]
    left = {name: _left(centred, values, sane=True) for name, values in others.items()}
    best = min(left, key=lambda name: left[name])
    return (best, left[best], as_is) if left[best] < SHARE * as_is else None


def turned_axes(measured: Array, told: Array, sigma: float) -> tuple[str, float, float] | None:
    """As `along_other_axes`, of axes that are turned by any angle: that of the best rotation from told (P, 3) to
    measured (Kabsch, Acta Crystallographica A 32 (1976) 922)."""
    centred, about = measured - measured.mean(axis=0), told - told.mean(axis=0)
    as_is = _left(centred, told, sane=False)
    if len(measured) < FEWEST or as_is < max(LARGE * rms(centred), SIGMAS * sigma):
        return None
    left, _, right = np.linalg.svd(about.T @ centred)
    proper = np.array([1.0, 1.0, np.linalg.det(left @ right)])
    turn = (left * proper) @ right          # told @ turn is along the axes of measured
    degrees = float(np.degrees(np.arccos(np.clip((np.trace(turn) - 1) / 2, -1.0, 1.0))))
    with_turn = _left(centred, told @ turn, sane=True)
    if degrees < LEAST_TURN or with_turn >= OF_TURN * as_is:
        return None
    # From the axes stated to those that the numbers seem to be along, right-handed; of half a turn either way is right.
    kept, vectors = np.linalg.eig(turn)
    axis, sense = np.real(vectors[:, int(np.argmin(np.abs(kept - 1)))]), turn - turn.T
    axis = axis * (-1.0 if axis @ np.array([sense[2, 1], sense[0, 2], sense[1, 0]]) < 0 else 1.0)
    said = ", ".join(f"{along:.2f}" for along in np.where(np.abs(axis) < 0.005, 0.0, axis))
    return f"turned by {degrees:.0f} deg about ({said})", with_turn, as_is


def _left(centred: Array, told: Array, *, sane: bool) -> float:
    """RMS that the best multiple of told (P, 3), less its mean, leaves of centred (P, 3); sane: within SANE, else infinite."""
    told = told - told.mean(axis=0)
    power = float(np.sum(told**2))
    multiple = float(np.sum(told * centred)) / power if power > 0 else 0.0
    return rms(centred - multiple * told) if not sane or SANE[0] <= multiple <= SANE[1] else np.inf

"""Deviations that were written along other axes than their columns say: in another frame, an axis with the other sign, two
exchanged. Told by what is predicted there, beside a constant that a set-up error may leave."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations

import numpy as np

from identification.common.arrays import Array, rms

# Told where other axes leave under this share of what the stated ones do, which is over this share of the measured itself and
# over so many sigmas, at so many places at least, with a multiple of the prediction within these (engineering judgement).
SHARE, LARGE, SIGMAS, FEWEST, SANE = 0.6, 0.2, 3.0, 12, (0.5, 2.0)
AXES = "xyz"


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


def _left(centred: Array, told: Array, *, sane: bool) -> float:
    """RMS that the best multiple of told (P, 3), less its mean, leaves of centred (P, 3); sane: within SANE, else infinite."""
    told = told - told.mean(axis=0)
    power = float(np.sum(told**2))
    multiple = float(np.sum(told * centred)) / power if power > 0 else 0.0
    return rms(centred - multiple * told) if not sane or SANE[0] <= multiple <= SANE[1] else np.inf

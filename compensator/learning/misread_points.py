"""As what the places of measured points would lie on the path that they miss: another unit or frame, a mirrored part, columns
exchanged, normals that point the other way."""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from compensator.learning.measured_points import MeasuredPoints
from identification.common.arrays import Array
from identification.model.rotations import Frame

# Told where as it stands less than this share of the points has a place on the path, and read otherwise at least that share;
# points that are looked at (engineering judgement).
STANDS, WOULD, MOST = 0.9, 0.97, 4000
INCH, METRE = 25.4, 1e3
Read = Callable[[Array, Array], tuple[Array, Array]]


def misread(points: MeasuredPoints, radius: float, within: float, path: Array, frames: dict[str, Frame]) -> str:
    """What would put the points onto the path (k, 3) [m], to be said; "": nothing, or they lie there. radius, within [m] as in
    `place_points`; frames: that the points may be in, each as the work object stands in it, by its name."""
    from scipy.spatial import cKDTree

    tree, step = cKDTree(path), -(-len(points) // MOST)
    position, normal = points.position[::step], points.normal[::step] if radius else np.zeros_like(points.position[::step])

    def share(read: Read) -> float:
        place, out = read(position, normal)
        return float(np.mean(np.asarray(tree.query(place + radius * out)[0]) <= within))

    if share(lambda place, out: (place, out)) >= STANDS:
        return ""
    ways = {**_units(), **{name: _of_frame(frame) for name, frame in frames.items()}, **_axes()}
    if radius:
        ways["with normals that point the other way, out of the material"] = lambda place, out: (place, -out)
    found = {words: share(read) for words, read in ways.items()}
    best = max(found, key=lambda words: found[words])
    return best if found[best] >= WOULD else ""


def _units() -> dict[str, Read]:
    return {"in inches": lambda place, out: (INCH * place, out), "in metres": lambda place, out: (METRE * place, out)}


def _of_frame(frame: Frame) -> Read:
    back = frame.inverse()
    return lambda place, out: (back.apply(place), out @ back.rotation.T)


def _axes() -> dict[str, Read]:
    """An axis with the other sign, as of a mirrored part; two of them, as of a part that was turned round; two exchanged."""
    ways: dict[str, Read] = {}
    for axis, name in enumerate("xyz"):
        ways[f"with the other sign of {name}, as of a mirrored part"] = _by(np.diag(np.where(np.arange(3) == axis, -1.0, 1.0)))
        ways[f"turned round by half a turn about {name}"] = _by(np.diag(np.where(np.arange(3) == axis, 1.0, -1.0)))
    for one, other in combinations(range(3), 2):
        order = np.arange(3)
        order[[one, other]] = other, one
        ways[f"with {'xyz'[one]} and {'xyz'[other]} exchanged"] = _by(np.eye(3)[order])
    return ways


def _by(matrix: NDArray[np.float64]) -> Read:
    return lambda place, out: (place @ matrix.T, out @ matrix.T)

"""Quaternions are w x y z, as RAPID has them (q1 = w); many libraries write x y z w. Both are four numbers of length one, so
that nothing but what they do tells one from the other."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from identification.common.findings import Finding
from identification.model.rotations import matrix_to_quaternion, quaternion_to_matrix, rotation_vector

Array = NDArray[np.float64]
# Turns and axes are told to this [rad]; a component of an axis beside the others.
SMALL = 1e-3
# w and x of a quaternion that is a turn about z alone, written x y z w, to the digits that people write.
NONE = 1e-5


def other_order(rotation: ArrayLike) -> Array:
    """What the quaternions of these rotations (..., 3, 3) turn by, read as x y z w in place of w x y z."""
    return quaternion_to_matrix(matrix_to_quaternion(rotation)[..., [3, 0, 1, 2]])


def as_written(rotation: ArrayLike, digits: int = 6) -> str:
    """A rotation (3, 3) as cell.yaml has it: [w, x, y, z]."""
    return f"[{', '.join(f'{x + 0.0:.{digits}g}' for x in np.round(matrix_to_quaternion(rotation), digits))}]"


def in_words(rotation: ArrayLike) -> str:
    """A rotation (3, 3) as a turn about an axis, "" for none: "180 deg about z"."""
    vector = rotation_vector(rotation)
    angle = float(np.linalg.norm(vector))
    if angle < SMALL:
        return ""
    axis = vector / angle
    largest = int(np.argmax(np.abs(axis)))
    alone = np.abs(np.delete(axis, largest)).max() < SMALL
    half = abs(angle - np.pi) < SMALL           # either way is the same
    sign = "-" if axis[largest] < 0 and not half else ""
    about = f"{sign}{'xyz'[largest]}" if alone else f"({', '.join(f'{x + 0.0:.2g}' for x in axis)})"
    return f"{np.degrees(angle):.4g} deg about {about}"


def said_of_order(name: str, rotation: ArrayLike, source: str) -> list[Finding]:
    """A question (CS0117) where a quaternion, read as x y z w, would be no turn at all, or one about z alone of a frame that
    as written stands askew: frames are upright far more often. A half turn about x or y alone is none of these."""
    w, x, _, z = matrix_to_quaternion(rotation)
    if max(abs(w), abs(x)) > NONE or abs(z) < NONE:
        return []
    other = in_words(other_order(rotation)) or "no turn"
    return [Finding("CS0117", "note", f"{name} {as_written(rotation)} is {in_words(rotation)}; read as x y z w it would be "
                    f"{other}", file=source, hint="compstiff and RAPID have w first (q1); is this one w first?")]

"""Small things about arrays that several rooms need."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
_Item = TypeVar("_Item", bound=np.generic)


def rms(values: Array) -> float:
    """Root of the mean square of all values that are known (NaN: not known), in their unit."""
    return float(np.sqrt(np.nanmean(values**2)))


def nothing_or(values: Array) -> Array:
    """The values (N, k), or where none is known (NaN) the same in the room of one number, read-only."""
    return values if not np.isnan(values).all() else np.broadcast_to(np.nan, values.shape)


def held_once(values: NDArray[_Item]) -> NDArray[_Item]:
    """The values (N, ...), or where they are all one the same in the room of one, read-only."""
    return values if (values != values[:1]).any() else np.broadcast_to(values[:1].copy(), values.shape)


def read_only(*arrays: NDArray[np.generic]) -> None:
    """Makes the arrays of a result read-only, in place: whoever wants to change one copies it."""
    for array in arrays:
        array.flags.writeable = False


def directions(vectors: Array) -> Array:
    """Unit vectors (n, 3) of vectors (n, 3) of any size; zeros of those that are nothing."""
    largest = np.maximum(np.abs(vectors).max(axis=1, keepdims=True), 1e-300)
    scaled = vectors / largest
    return np.asarray(scaled / np.maximum(np.linalg.norm(scaled, axis=1, keepdims=True), 1e-300))

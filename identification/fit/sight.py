"""Sight: how the rows of a measurement see a displacement of the tool, in the coordinates in which their noise is counted."""

from __future__ import annotations

from typing import Protocol

from identification.common.arrays import Array


class Sight(Protocol):
    """Load tests read three components a row (NoiseModel); a machined part is measured otherwise, at places along a path."""

    def whitened(self, moved: Array) -> Array:
        """What R readings of C components see (R, C, k), in the noise's coordinates, of displacements (N, 3, k) [m] of the tool
        in N states of the arm, in the order of their loads."""
        ...

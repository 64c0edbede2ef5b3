"""Products of all columns that a joint's log is judged by, from which any set of them is answered without the samples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.motion.axis import Axis, Solved, answered
from identification.motion.dictionary import Shape

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Products:
    """Of the plain columns and those of shapes, q in all, each of length one.

    gram (q, q): of the whitened ones; moment (q,): with the whitened deflection; total: of this with itself; count: whitened
    rows; order: of the noise's autoregression; alike (q, q): of the columns as they are; scale (q,): their lengths; penalty
    (q,): `Axis.penalty`, then nothing; plain: how many are the plain model's; first: place of each shape's first.
    """

    gram: Array
    moment: Array
    total: float
    count: int
    order: int
    alike: Array
    scale: Array
    penalty: Array
    plain: int
    first: dict[int, int]

    def places(self, shapes: Sequence[Shape], kept: Sequence[Sequence[int]]) -> list[int]:
        """The plain columns' places, then those of the columns that each shape keeps."""
        return [*range(self.plain), *(self.first[id(shape)] + column for shape, mine in zip(shapes, kept, strict=True)
                                      for column in mine)]

    def solve(self, places: list[int]) -> Solved:
        """Generalised least squares on the columns at these places, those of the plain model first; as `axis.solve`."""
        some = np.ix_(places, places)
        return answered(self.gram[some], self.moment[places], self.total, self.count, self.penalty[places],
                        self.scale[places], self.order)

    def doubled(self, places: list[int], least: float) -> bool:
        """Whether the columns nearly span a space of fewer dimensions: their smallest singular value, of columns of length one,
        is under `least`."""
        return bool(np.linalg.eigvalsh(self.alike[np.ix_(places, places)])[0] < least**2)


def products(axis: Axis) -> Products:
    """Of all shapes of the axis' dictionary."""
    shapes = [shape for group in axis.dictionary for shape in group]
    columns = np.column_stack([axis.plain, *(shape.columns for shape in shapes)])
    scale = np.linalg.norm(columns, axis=0)
    scale[scale == 0] = 1.0
    unit = columns / scale
    white, deflection = axis.whiten(unit), axis.white_deflection
    plain = axis.plain.shape[1]
    widths = np.array([shape.columns.shape[1] for shape in shapes], dtype=int)
    firsts = plain + np.concatenate([[0], np.cumsum(widths)])[: len(shapes)]
    penalty = np.zeros(columns.shape[1])
    penalty[:plain] = axis.penalty
    return Products(white.T @ white, white.T @ deflection, float(deflection @ deflection), len(deflection), len(axis.noise.phi),
                    unit.T @ unit, scale, penalty, plain,
                    {id(shape): int(first) for shape, first in zip(shapes, firsts, strict=True)})

"""The deflections were read beside the modelled TCP, where the tilting tool moves otherwise."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Parameter
from identification.model.effects.kinds import OfReading, along_axes
from identification.model.load_state import LoadState

JUDGED = "engineering judgement: 10 to 40 mm, their geometric mean: a reflector's nest, or a cube that gauges touch"
BOUNDED = "engineering judgement: 300 mm, a long tool's own length"


class _ReadingPoint(OfReading):
    """`w x p`, w the rotation vector of the tool under its load: what a point at p from the TCP moves by beyond the TCP."""

    name = "reading_point"
    formula_source = "the paper, eq. 5: the lever of the moment is that of the motion"
    parameters = along_axes("{}_m", "m", 0.02, 0.3, source=JUDGED, bounds_source=BOUNDED)
    sentence = "the deflections were read beside the modelled tool point: the tool's tilt moves that point otherwise"
    settles = "measure where the reflector or the gauges sit on the tool, or turn the tool there without a load and read them"

    in_the_cell = False

    def misread(self, rows: LoadState, values: Array) -> Array:
        lever = values if self.in_the_cell else rows.tool @ values
        return np.asarray(np.cross(rows.elastic[:, 3:], lever))


class InTheCell(_ReadingPoint):
    """p along the base's axes: gauges on the same side of the tool wherever it is turned to."""

    law, in_the_cell = "base", True


class EachGauge(_ReadingPoint):
    """Each gauge touches a point of its own, at p along the base's axes; along its own axis p does nothing."""

    law = "gauges"
    parameters = tuple(
        Parameter(f"d{axis}_at_{along}_m", "m", 0.02, -0.3, 0.3, source=JUDGED, bounds_source=BOUNDED)
        for axis in "xyz" for along in "xyz" if along != axis)
    sentence = "the gauges touched the tool beside its modelled point, each elsewhere: the tool's tilt reads as motion"

    def misread(self, rows: LoadState, values: Array) -> Array:
        lever = np.zeros((3, 3))
        lever[~np.eye(3, dtype=bool)] = values
        return np.asarray(np.einsum("nii->ni", np.cross(rows.elastic[:, None, 3:], lever)))


class ReadingPoint(_ReadingPoint):
    """p along the tool's axes: a reflector beside the tip."""

    other_laws = (InTheCell(), EachGauge())

"""A deflection sensor was bumped or re-seated; one bad row is its smallest case."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from identification.common.arrays import Array
from identification.model.effects.base import Signature
from identification.model.effects.kinds import OfReading, along_axes, as_it_is, evenly, from_row_on, reference_at
from identification.model.load_state import LoadState

# In longer files only the starts of poses are tried as places of a step.
MOST_ROWS = 400
# Of more starts of poses, so many evenly.
MOST_PLACES = 400


class SeatsUnderLoad(OfReading):
    """A constant on the readings of every pose from its first load on: what is read from seats there, as it did before each
    time."""

    name = "sensor_step"
    law = "seating"
    formula_source = "engineering judgement: a plate that hangs in a hook, a target on a magnet, comes to rest under the load"
    parameters = along_axes(
        "{}_m", "m", 1e-5, 1e-2,
        source="engineering judgement: the clearance of what hangs or clips on, some hundredths of a millimetre",
        bounds_source="the paper, sect. 4: the sensors measure +-5 mm, from one end to the other")
    sentence = ("what the deflection sensors look at (a target, a plate) shifted by the same at each pose when the first load "
                "came, and stayed")
    settles = "load once before the zero is taken, at each pose"

    def missing(self, rows: LoadState) -> str:
        return "" if _seated(rows).any() and rows.starts.sum() > 1 else "there is one pose alone"

    def misread(self, rows: LoadState, values: Array) -> Array:
        return np.asarray(_seated(rows)[:, None] * values)


class SensorStep(OfReading):
    """A constant on the readings from one row on (until the next reference) or of one pose; from the first row on it is a zero
    that nobody took off. A single bad row is found by its
    weight (fit/noise.py) and named by diagnosis/gross.py."""

    name = "sensor_step"
    other_laws = (SeatsUnderLoad(),)
    formula_source = "engineering judgement: a sensor that was touched stays where it is"
    parameters = along_axes(
        "{}_m", "m", 1e-5, 1e-2,
        source="engineering judgement: ten times the 1 um of the paper's sensors (sect. 4)",
        bounds_source="the paper, sect. 4: the sensors measure +-5 mm, from one end to the other")
    sentence = "a deflection sensor was bumped or re-seated, or its zero not taken off"
    settles = "repeat the rows about the step"

    def __init__(self, kind: str = "row", place: int | str = 1, reference: int | None = None) -> None:
        """reference: the number of the one that holds at that row, for other rows than those it was seen in."""
        self.kind, self.place, self.reference = kind, place, reference

    @property
    def where(self) -> dict[str, int | str | float]:
        return {self.kind: self.place}

    def misread(self, rows: LoadState, values: Array) -> Array:
        return np.asarray(self._mask(rows)[:, None] * values)

    def _mask(self, rows: LoadState) -> NDArray[np.bool_]:
        """The rows (n,) the step touches: a pose's, or from a row of the file on until the reference is taken anew."""
        if self.kind == "pose":
            return np.asarray(_names(rows) == self.place)
        return from_row_on(rows, int(self.place), self.reference)

    def signatures(self, rows: LoadState, joint: int | None) -> list[Signature]:
        first = rows.row if len(rows) <= MOST_ROWS else rows.row[rows.starts]
        first = evenly(first, MOST_PLACES)
        names = _names(rows)
        poses = names[rows.starts] if len(np.unique(rows.visit)) <= MOST_ROWS else names[:0]
        steps = [(SensorStep("row", int(row), reference_at(rows, int(row))), False) for row in first]
        steps += [(SensorStep("pose", str(name)), True) for name in dict.fromkeys(poses.tolist())]
        scale = self.typical(rows, joint)
        return [*(Signature(step._mask(rows)[:, None, None] * np.eye(3), scale, False, as_it_is, step, local)
                  for step, local in steps), *self.of_other_laws(rows, joint)]


def _seated(rows: LoadState) -> NDArray[np.bool_]:
    """Rows (n,) that a load came before, or with, at the same pose."""
    loads = np.cumsum(np.any(rows.wrench[:, :3] != 0, axis=1))
    before = np.where(rows.starts, np.concatenate([[0], loads[:-1]]), 0)
    return np.asarray(loads > np.maximum.accumulate(before))


def _names(rows: LoadState) -> NDArray[np.object_]:
    """The name of each row's pose (n,): its label, or the number of its visit from 1."""
    numbers = np.array([str(visit + 1) for visit in rows.visit.tolist()], dtype=object)
    return np.where(rows.labels == "", numbers, rows.labels)


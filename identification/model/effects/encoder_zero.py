"""A joint's zero is off: from a pose on, or at all poses, the joint stands off by the same angle."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Parameter, Signature
from identification.model.effects.kinds import AtJoint, as_it_is, evenly, from_row_on, reference_at
from identification.model.load_state import LoadState

# Of more starts of poses, so many evenly, at each of six joints.
MOST_PLACES = 60


class EncoderZero(AtJoint):
    """`J_i zero` in all rows from a pose on, until the reference is taken anew. It is no answer to a load: the readings are put
    right, nothing is carried into the model; the controller's absolute accuracy is off by as much."""

    name = "encoder_zero"
    family = "deflection measurement"
    of_robot = False
    joints = (1, 2, 3, 4, 5, 6)
    formula_source = "the paper, eq. 1: a joint that stands off turns everything behind it"
    parameters = (Parameter("zero_rad", "rad", 1e-4, -5e-3, 5e-3,
                            source="engineering judgement: 0.3 arcmin, 0.15 mm at 1.5 m: from what a restart leaves to what a "
                                   "calibration by marks does",
                            bounds_source="docs/real-data.md: 2.4 mrad between two records on one axis; twice that"),)
    sentence = "the zero of joint {joint} is off: from one pose on, or at all of them, it stands off by the same angle"
    settles = "go back to the first pose and read without a load; check the joint's calibration marks"

    def __init__(self, row: int = 1, reference: int | None = None) -> None:
        """reference: the number of the one that holds at that row, for other rows than those it was seen in."""
        self.row, self.reference = row, reference

    @property
    def where(self) -> dict[str, int | str | float]:
        return {"row": self.row}

    def missing(self, rows: LoadState) -> str:
        return "" if self._starts(rows).size else "the reference was taken anew at every pose"

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        after = from_row_on(rows, self.row, self.reference)
        return np.asarray(after[:, None] * rows.jacobian[:, :, self.index(joint)] * values)

    def signatures(self, rows: LoadState, joint: int | None) -> list[Signature]:
        move, scale = rows.jacobian[:, :3, self.index(joint), None], self.typical(rows, joint)
        moved = [EncoderZero(int(row), reference_at(rows, int(row))) for row in evenly(self._starts(rows), MOST_PLACES)]
        return [Signature(from_row_on(rows, shift.row, shift.reference)[:, None, None] * move, scale, False, as_it_is, shift)
                for shift in moved]

    @staticmethod
    def _starts(rows: LoadState) -> np.ndarray:
        """First rows, as numbers in their file, of the poses that share their reference with another."""
        first = np.flatnonzero(rows.starts)
        references, count = np.unique(rows.reference[first], return_counts=True)
        return np.asarray(rows.row[first[np.isin(rows.reference[first], references[count > 1])]])

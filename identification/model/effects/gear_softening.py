"""One gear gives way more, or less, from row to row or from one pose on."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from functools import partial
from typing import ClassVar

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Parameter, Signature
from identification.model.effects.drift import SETTLES_S, settling_times
from identification.model.effects.kinds import GearTwist, evenly
from identification.model.effects.softening import since_first
from identification.model.load_state import LoadState

# Of more poses at which it may have changed, so many evenly.
MOST_PLACES = 60


class _GearSoftening(GearTwist):
    """`J_i tau_i c_i a s`, s from 0 on the way to 1 over the rows."""

    name = "gear_softening"
    gear_law = False
    of_robot = False
    unsettles = True
    settles = "repeat the first pose at the end, and once more the next morning"
    share: ClassVar[Parameter] = Parameter(
        "share", "1", 0.1, -0.9, 3.0,
        source="engineering judgement: some per cent from cold grease to warm; a brake holds softer or stiffer than a servo",
        bounds_source="engineering judgement: ten times stiffer, to four times as soft")

    @abstractmethod
    def reached(self, rows: LoadState, values: Array) -> Array:
        """s (n,)."""

    def twist(self, rows: LoadState, i: int, values: Array) -> Array:
        return np.asarray(values[0] * rows.compliance[i] * rows.torque[:, i] * self.reached(rows, values))

    def shown(self, rows: LoadState, joint: int | None, shapes: Sequence[tuple[float, ...]]) -> list[Signature]:
        """Its signatures, one for the values of each shape that follow the share."""
        columns = [self.contribution(rows, joint, np.array([1.0, *shape]))[:, :3, None] for shape in shapes]
        return [Signature(column, self.typical(rows, joint)[:1], False, partial(np.append, values=shape), self)
                for column, shape in zip(columns, shapes, strict=True)]


class FromPose(_GearSoftening):
    """s = 1 from one row of the file on."""

    law = "from"
    formula_source = ("engineering judgement: brakes in place of motors, a damper that is touched, a bolt that was tightened: "
                      "from then on")
    parameters = (_GearSoftening.share,)
    sentence = ("the gear of joint {joint} gives way more, or less, from one pose on: brakes hold in place of the motor, or "
                "something was changed")

    def __init__(self, row: int = 2) -> None:
        self.row = row

    @property
    def where(self) -> dict[str, int | str | float]:
        return {"row": self.row}

    def missing(self, rows: LoadState) -> str:
        return "" if rows.starts.sum() > 2 else "there are no two poses behind the first"

    def reached(self, rows: LoadState, values: Array) -> Array:
        return np.asarray(rows.row >= self.row, dtype=float)

    def signatures(self, rows: LoadState, joint: int | None) -> list[Signature]:
        # From the last pose on it would be that pose alone that is off.
        firsts = evenly(rows.row[np.flatnonzero(rows.starts)[1:-1]], MOST_PLACES)
        return [shape for row in firsts for shape in FromPose(int(row)).shown(rows, joint, [()])]


class GearSoftening(_GearSoftening):
    """s = 1 - exp(-t / t0), t the time since the first row."""

    other_laws = (FromPose(),)
    formula_source = "engineering judgement: what warms up comes to a temperature, as one heat capacity does"
    parameters = (_GearSoftening.share, SETTLES_S)
    sentence = "the gear of joint {joint} gives way more, or less, from row to row: its grease warms up"

    def reached(self, rows: LoadState, values: Array) -> Array:
        return np.asarray(-np.expm1(-since_first(rows) / values[1]))

    def signatures(self, rows: LoadState, joint: int | None) -> list[Signature]:
        shapes = [(settles,) for settles in settling_times(rows)]
        return [*self.shown(rows, joint, shapes), *self.of_other_laws(rows, joint)]

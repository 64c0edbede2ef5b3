"""LoadTest: the rows of a cell with what was known of its stiffnesses before, and how the robot stands in them.

A robot whose file has links sags under its own weight before it is loaded, and its weight moves with the load: both enter the
prediction. Without links neither does.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from identification.fit.priors import PriorModel
from identification.measurements import Measurements
from identification.model.cell import Cell
from identification.model.gravity import fall_in_base, gravity_torque, sagged_angles
from identification.model.load_state import LoadState

Array = NDArray[np.float64]
# Up to so many rows the state that was worked out last is kept: a fit asks for the same one several times in a row.
MOST_KEPT = 20_000


@dataclass(frozen=True, eq=False)
class LoadTest:
    """All that a model is fitted to or predicts: the cell, its rows (n), measured or planned, and the prior. rest [m]: 1 sigma
    by which the zero readings of each visit lie aside of its loaded ones. last: the state that was worked out last, if any."""

    cell: Cell
    rows: Measurements
    prior: PriorModel
    rest: float = 0.0
    last: list[LoadState] = field(default_factory=list, init=False, repr=False)

    @classmethod
    def of(cls, cell: Cell, rows: Measurements) -> LoadTest:
        """With the cell's own prior, log-normal."""
        return cls(cell, rows, PriorModel(cell.prior))

    def with_rows(self, rows: Measurements) -> LoadTest:
        """Other rows in the same cell."""
        return replace(self, rows=rows)

    def load_state(self, compliance: Array) -> LoadState:
        """What the effects may look at, on a robot with these springs (6,) [rad/(N m)], that sags under its own weight."""
        if self.last and np.array_equal(self.last[0].compliance, compliance):
            return self.last[0]
        state = self._state(compliance.copy())
        if len(self.rows) <= MOST_KEPT:
            self.last[:] = [state]
        return state

    @cached_property
    def _fall(self) -> Array:
        return fall_in_base(self.cell.world_from_base)

    @cached_property
    def _weight(self) -> Array:
        """Gravity torques (n, 6) at the commanded angles, whatever the springs."""
        return gravity_torque(self.cell.robot, self.rows.theta, self._fall, self.cell.tool_mass, self.cell.tool_centre)

    def _state(self, compliance: Array) -> LoadState:
        cell, rows, fall = self.cell, self.rows, self._fall
        mass, centre = cell.tool_mass, cell.tool_centre
        return LoadState(
            robot=cell.robot, flange_from_tcp=cell.flange_from_tcp,
            theta=sagged_angles(cell.robot, rows.theta, compliance, fall, mass, centre, self._weight), wrench=rows.wrench,
            compliance=compliance, visit=rows.visit, reference=rows.reference, time=rows.time - rows.began, dwell=rows.dwell,
            row=rows.row, labels=rows.pose, fall=fall, tool_mass=mass, tool_centre=centre)

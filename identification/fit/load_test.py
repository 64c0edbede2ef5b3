"""LoadTest: the rows of a cell with what was known of its stiffnesses before, and how the robot stands in them.

A robot whose file has links sags under its own weight before it is loaded, and its weight moves with the load: both enter the
prediction. Without links neither does.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from identification.fit.priors import PriorModel
from identification.measurements import Measurements
from identification.model.cell import Cell
from identification.model.compliance import loaded_angles
from identification.model.gravity import fall_in_base, gravity_torque
from identification.model.load_state import LoadState

Array = NDArray[np.float64]
# Rounds of the sag under the robot's own weight; each shrinks the error by a few thousandths.
SAG_ROUNDS = 3


@dataclass(frozen=True, eq=False)
class LoadTest:
    """All that a model is fitted to or predicts: the cell, its rows (n), measured or planned, and the prior."""

    cell: Cell
    rows: Measurements
    prior: PriorModel

    @classmethod
    def of(cls, cell: Cell, rows: Measurements) -> LoadTest:
        """With the cell's own prior, log-normal."""
        return cls(cell, rows, PriorModel(cell.prior))

    def with_rows(self, rows: Measurements) -> LoadTest:
        """Other rows in the same cell."""
        return replace(self, rows=rows)

    def load_state(self, compliance: Array) -> LoadState:
        """What the effects may look at, on a robot with these springs (6,) [rad/(N m)], that sags under its own weight."""
        cell, rows = self.cell, self.rows
        return LoadState(
            robot=cell.robot, flange_from_tcp=cell.flange_from_tcp, theta=self._sagged(compliance), wrench=rows.wrench,
            compliance=compliance, visit=rows.visit, reference=rows.reference, time=rows.time, dwell=rows.dwell, row=rows.row,
            labels=rows.pose, fall=fall_in_base(cell.world_from_base), tool_mass=cell.tool_mass, tool_centre=cell.tool_centre)

    def yields_to_gravity(self, state: LoadState) -> Array:
        """How much further (n, 3) [m] the loaded robot yields because its weight has moved with it, first order: the change of
        the gravity torques turns the springs once more. 0.1 to 0.4 % of the deflection on the IRB 6660."""
        moved = self._gravity(state.loaded) - self._gravity(state.theta)
        return np.asarray(np.einsum("nri,ni->nr", state.jacobian[:, :3], state.compliance * moved))

    def _sagged(self, compliance: Array) -> Array:
        """Controller angles (n, 6) [rad] at which a rigid robot stands where this one does under its own weight: the unloaded
        pose of a robot that is commanded to theta. The same as theta where the robot file has no `links`."""
        theta = self.rows.theta
        if self.cell.robot.link_mass is None:
            return theta
        sagged = theta
        for _ in range(SAG_ROUNDS):
            sagged = loaded_angles(self.cell.robot, theta, compliance * self._gravity(sagged))
        return sagged

    def _gravity(self, theta: Array) -> Array:
        cell = self.cell
        return gravity_torque(cell.robot, theta, fall_in_base(cell.world_from_base), cell.tool_mass, cell.tool_centre)

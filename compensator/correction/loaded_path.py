"""LoadedPath: a path under its forces, driven by an identified robot: what the forward model and the correction work on."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from compensator.forces.target_forces import TargetForces
from compensator.learned.learned import Learned, Rest
from compensator.path.robot_path import RobotPath
from identification.model.inverse import nearest_angles
from identification.model.rotations import Frame
from identification.model.stiffness import IdentifiedModel

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class LoadedPath:
    """path with N targets, the forces at all of them, the robot's model, and the `targets` (M,) that are looked at: those with
    force that can be corrected. learned: what a measured part taught beyond the model's parameters, None: nothing."""

    path: RobotPath
    forces: TargetForces
    model: IdentifiedModel
    targets: Indices
    learned: Learned | None = None

    @cached_property
    def rest(self) -> Rest | None:
        """What was learned beyond the model at the targets (M,)."""
        return None if self.learned is None else self.learned.rest(self.path, self.targets)

    @property
    def plan(self) -> Frame:
        """base_from_tcp (M) as planned: where the loaded tool shall stand."""
        tcp = self.path.base_from_tcp
        return Frame(self._picked(tcp.rotation), self._picked(tcp.position))

    @property
    def planned_theta(self) -> Array:
        """Joint angles (M, 6) [rad] as planned."""
        return self._picked(self.path.theta)

    @property
    def goal(self) -> Frame:
        """base_from_tcp (M) to which the model shall bring the loaded tool, so that it stands on the plan: beside it by what
        was learned."""
        return self.goal_of(slice(None))

    def goal_of(self, places: slice | Indices) -> Frame:
        """The same at some places among the M."""
        plan = self.path.base_from_tcp[self.targets[places]]
        return plan if self.rest is None else Frame(plan.rotation, plan.position - self.rest.mean[places])

    @property
    def goal_position(self) -> Array:
        """Its position (M, 3) [m]."""
        position = self.path.base_from_tcp.position[self.targets]
        return position if self.rest is None else position - self.rest.mean

    @property
    def theta(self) -> Array:
        """Joint angles (M, 6) [rad] at the goal; without anything learned those of the plan."""
        return self.planned_theta if self.rest is None else self._beside_plan

    @cached_property
    def _beside_plan(self) -> Array:
        """The same where something was learned: worked out once."""
        flange = self.goal @ self.path.flange_from_tcp[self.targets].inverse()
        return nearest_angles(self.model.robot, flange, self.planned_theta)

    @property
    def wrench(self) -> Array:
        """(M, 6) [N, N m] on the tool at the TCP, base frame."""
        return self._picked(self.forces.wrench)

    def _picked(self, values: Array) -> Array:
        """Of values (N, ...) those of the targets (M, ...), read-only where these are all, as often."""
        return values if len(self.targets) == len(values) else values[self.targets]

    def each_tool(self) -> list[tuple[Frame, Indices]]:
        """The targets by tool: flange_from_tcp, and the places among the M that use it."""
        return self.path.each_tool(self.targets)

"""LoadedPath: a path under its forces, driven by an identified robot: what the forward model and the correction work on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from compensator.forces.placement import TargetForces
from compensator.path.robot_path import RobotPath
from identification.model.rotations import Frame
from identification.model.stiffness import IdentifiedModel

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class LoadedPath:
    """path with N targets, the forces at all of them, the robot's model, and the `targets` (M,) that are looked at: those with
    force that can be corrected."""

    path: RobotPath
    forces: TargetForces
    model: IdentifiedModel
    targets: Indices

    @property
    def theta(self) -> Array:
        """Planned joint angles (M, 6) [rad]."""
        return self.path.theta[self.targets]

    @property
    def goal(self) -> Frame:
        """base_from_tcp (M) as planned: where the loaded tool shall stand."""
        return self.path.base_from_tcp[self.targets]

    @property
    def wrench(self) -> Array:
        """(M, 6) [N, N m] on the tool at the TCP, base frame."""
        return self.forces.wrench[self.targets]

    def each_tool(self) -> list[tuple[Frame, Indices]]:
        """The targets by tool: flange_from_tcp, and the places among the M that use it."""
        tools = self.path.toolpath.tool[self.targets]
        groups = [np.flatnonzero(tools == tool) for tool in np.unique(tools)]
        return [(self.path.flange_from_tcp[int(self.targets[places[0]])], places) for places in groups]

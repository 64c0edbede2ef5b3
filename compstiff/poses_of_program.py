"""The targets of a milling program as `design` needs them: where the robot will stand, and the forces that will act there."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from compensator.forces.placement import place_forces, read_force_log
from compensator.path.robot_path import robot_path
from compensator.posting.read_toolpath import read_toolpath
from identification.common.findings import error
from identification.design.milling import MillingPoses, assumed_force
from identification.model.cell import Cell

# More poses than this along a program say nothing new of a mean over it.
MOST_POSES = 2000


def milling_poses(cell: Cell, toolpath: str | Path, forces: str | Path | None = None) -> MillingPoses:
    """The reached targets of a program (with force, where a log is given), evenly thinned where there are very many.

    Raises what the readers raise, and CompstiffError (CS1602) where the robot reaches none of them.

    >>> from pathlib import Path
    >>> cell = compstiff.read_cell("cell.yaml")
    >>> poses = compstiff.milling_poses(cell, Path("insert.mod"), Path("insert.forces.parquet"))
    >>> poses.theta.shape
    (1793, 6)
    """
    path = robot_path(read_toolpath(toolpath, cell).toolpath, cell)
    wanted = path.reached.copy()
    findings = [*path.toolpath.findings, *path.findings]
    wrench = None
    if forces is not None:
        placed = place_forces(read_force_log(forces, cell.force_log.form), path, cell)
        findings += placed.findings
        wanted &= placed.forced
        wrench = placed.wrench
    rows = np.flatnonzero(wanted)
    if not len(rows):
        raise error("CS1602", f"none of the {len(path.toolpath)} targets is reached by the robot"
                    + ("" if forces is None else " with a force on the tool"), file=str(toolpath),
                    hint="the criterion I needs the targets that are milled; or choose --criterion D")
    rows = rows[:: -(-len(rows) // MOST_POSES)]
    moment = assumed_force() if wrench is None else np.einsum("ni,nj->nij", wrench[rows, :3], wrench[rows, :3])
    tool = path.flange_from_tcp[rows]
    return MillingPoses(path.theta[rows], tool, path.base_from_tcp.position[rows], str(toolpath), len(path.toolpath),
                        moment, tuple(findings))

"""The points of a grid as the robot drives them: between the program's targets, by the way it drives these."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from compensator.correction.fine_grid import Grid
from compensator.correction.predict import Predicted
from compensator.path.robot_path import LARGEST_STEP, RobotPath, robot_path
from identification.common.arrays import read_only
from identification.model.inverse import nearest_angles
from identification.model.rotations import Frame

Array = NDArray[np.float64]
# Beyond a joint's limits by more than this [rad] a point is not reached.
ROUNDING = 1e-9


def asks_for_all(planned: Predicted, pieces: Array) -> bool:
    """Whether all of a program must stand on the grid of the moves with finite pieces (N,): the log is placed by position, the
    means of many places tell its scatter, effects and what was learned remember, external axes drive, or the robot turns over
    along such a move."""
    path, moves = planned.path, np.flatnonzero(np.isfinite(pieces[1:]))
    turns_over = (np.abs(path.theta[moves + 1] - path.theta[moves]) >= LARGEST_STEP).any()
    drives = path.axes.moves or not np.isnan(path.toolpath.external).all()
    return bool(not planned.forces.named or planned.model.effects or planned.loaded.learned or drives or turns_over)


def grid_path(path: RobotPath, grid: Grid) -> RobotPath:
    """The points (G,) of a grid of this program. NaN, and not reached, where no angles near those of the move's ends, or
    none within the joints' limits, reach a further point."""
    if len(grid.kept) == len(path.toolpath):
        return robot_path(grid.toolpath, path.cell)
    owner, toolpath = grid.owner, grid.toolpath
    tool, of_object = path.flange_from_tcp[owner], path.base_from_object[owner]
    tcp, theta = path.base_from_tcp[owner], path.theta[owner]
    points = np.flatnonzero(grid.further)
    there = of_object[points] @ Frame.from_quaternion(toolpath.position[points], toolpath.quaternion[points])
    tcp.rotation[points], tcp.position[points] = there.rotation, there.position
    between = np.column_stack([np.interp(points, grid.kept, angle) for angle in theta[grid.kept].T])
    found = nearest_angles(path.cell.robot, there @ tool[points].inverse(), between)
    found[(path.cell.robot.limit_excess(found) > ROUNDING).any(axis=1)] = np.nan
    theta[points] = found
    axes = replace(path.axes, **{name: getattr(path.axes, name)[owner] for name in ("values", "carrier", "problem")})
    known, reached = path.known[owner], np.asarray(~np.isnan(theta).any(axis=1))
    read_only(theta, tcp.rotation, tcp.position, known, reached)
    return RobotPath(toolpath, path.cell, theta, tcp, tool, of_object, axes, tcp, known, reached, path.used_frames, ())

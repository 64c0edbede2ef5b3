"""A force log by path length, whatever its columns: TCP positions and joint angles are matched forwards, time is estimated.
Done once a program: targets that are added to it later lie on the same path."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from compensator.force_log import ForceLog
from compensator.placement import match_forwards, polyline
from compensator.planning import Plan
from compensator.program_time import placed_by_time
from identification.findings import error
from identification.model.kinematics import forward

Array = NDArray[np.float64]


def on_path(log: ForceLog, plan: Plan) -> ForceLog:
    """The log with the key `path_mm`, NaN where a sample is not on the path; a log that names its targets as it is.

    Raises CompstiffError: CS3005 no target of known position, CS3010 several tools or work objects, and what `placed_by_time`
    raises.
    """
    if log.key in ("target", "path_mm"):
        return log
    if log.key == "time":
        return placed_by_time(log, plan)
    points, length = polyline(plan.world_position, plan.toolpath.move)
    if not len(points):
        raise error("CS3005", "the program has no target of known position to place the log on", file=log.source)
    return replace(log, key="path_mm", place=match_forwards(points, length, _world_positions(log, plan)))


def _world_positions(log: ForceLog, plan: Plan) -> Array:
    """TCP positions of the samples (M, 3) [m] in the world frame; one tool and one work object are required."""
    used = plan.used_frames
    if log.key == "joints":
        if len(used.tools) != 1:
            raise error("CS3010", f"a log placed by joint angles needs one tool, the program uses {len(used.tools)}",
                        file=log.source, hint="log the column target or path_mm")
        return plan.cell.world_from_base.apply(forward(plan.cell.robot, log.place, used.tools[0]).position)
    if len(used.workobjects) != 1:
        raise error("CS3010", f"a log placed by TCP position needs one work object, the program uses "
                    f"{len(used.workobjects)}", file=log.source, hint="log the column target or path_mm")
    return used.workobjects[0].apply(log.place)

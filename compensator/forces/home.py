"""Where a log by path length begins to count, in a program that begins with a MoveAbsJ: there, or at the first robtarget."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from compensator.forces.log import ForceLog
from compensator.path.robot_path import RobotPath
from compensator.toolpath import Move
from identification.common.findings import Finding

# The end that a log reaches is that of one count where it is so many times nearer to it than to that of the other; a way that
# is shorter than this [m] is none.
NEARER, LEAST = 5.0, 2e-3
HINT = "let path_mm begin at 0 where the MoveAbsJ stands, or log the column target, or x_mm y_mm z_mm"


def counted_from_home(log: ForceLog, path: RobotPath) -> ForceLog:
    """The log with its path lengths (M,) [m] from the first target on, also where they were counted from the first one that is
    no MoveAbsJ: it then ends short of the path by the way between the two. A program may end with a MoveAbsJ that was not
    counted either. Where the end does not tell that is said (CS3129), and the path is taken to begin at the MoveAbsJ."""
    known = np.flatnonzero(np.isfinite(path.length))
    by_joints = path.toolpath.move[known] == Move.ABSOLUTE
    if by_joints.all() or not by_joints[0]:
        return log
    others = known[~by_joints]
    begin, last, end = path.length[others[0]], path.length[others[-1]], path.length[known[-1]]
    if begin < LEAST:
        return log
    reached = float(np.nanmax(log.place))
    from_home, from_target = (float(np.min(np.abs(reached - np.array([last, end]) + skipped))) for skipped in (0.0, begin))
    if NEARER * from_home < from_target:
        return log
    told = NEARER * from_target < from_home
    way = f"the program begins with a MoveAbsJ, {1e3 * begin:.1f} mm from the first robtarget, and path_mm ends at " \
          f"{1e3 * reached:.1f} mm"
    said = Finding("CS3129", "warning", f"{way}: it is taken as counted from the robtarget on" if told else
                   f"{way}, where neither count ends: it is taken as counted from the MoveAbsJ on", file=log.source, hint=HINT)
    return replace(log, place=log.place + begin if told else log.place, findings=(*log.findings, said))

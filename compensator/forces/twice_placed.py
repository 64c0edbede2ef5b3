"""Joint angles and positions in one log: both say where the tool was, by the controller's robot, tool, base and work object.

By those of cell.yaml and the program they say the same, or some of these are not the controller's: a pedestal that was left
out of `base_frame`, a turntable's zero, another TCP, a robot of the same family. Nothing else in a program and its log tells.
"""

from __future__ import annotations

import numpy as np

from compensator.forces.source import BothPlaces
from compensator.path.robot_path import RobotPath
from identification.common.findings import Finding
from identification.model.kinematics import forward

# What a controller's clocks, and a calibration that it takes into account, put both apart by is under this [m].
APART = 3e-3
# A share of the samples that agrees is enough: the others may be of moves with another tool or work object, as at home.
AGREE = 0.25


def said_of_both(source: str, both: BothPlaces, path: RobotPath) -> list[Finding]:
    """A warning (CS3133) where the joint angles put the tool elsewhere than the positions do."""
    used = path.used_frames
    if len(used.tools) != 1 or len(used.workobjects) != 1 or path.axes.moves:
        return []
    by_angles = path.axes.world_from_base.apply(forward(path.cell.robot, both.joints, used.tools[0]).position)
    apart = by_angles - used.workobjects[0].apply(both.position)
    size = np.linalg.norm(apart, axis=1)
    if np.quantile(size, AGREE) <= APART:
        return []
    middle = float(np.median(size))
    axes = ", ".join(f"{1e3 * axis:+.1f}" for axis in np.median(apart, axis=0))
    return [Finding(
        "CS3133", "warning", f"the joint angles in the log put the tool {1e3 * middle:.1f} mm from where its positions do, in "
        f"the middle ({axes} mm, world frame)", file=source,
        hint="are robot, tool and base_frame of cell.yaml, the program's work object, and what carries it, those of the "
        "controller? By the wrong ones the robot stands, and yields, otherwise than is worked out here")]

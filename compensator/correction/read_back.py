"""The written program, read again: every corrected number there, every other target as it was."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from compensator.correction.correction import Correction
from compensator.correction.forward import off_goal
from compensator.correction.loaded_path import LoadedPath
from compensator.path.legs import Poses
from compensator.rapid import POSITION_DECIMALS, QUATERNION_DECIMALS, RapidProgram, read_rapid
from compensator.toolpath import Toolpath
from identification.common.findings import error
from identification.model.compliance import CHUNK
from identification.model.inverse import nearest_angles
from identification.model.kinematics import chunks
from identification.model.rotations import Frame

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

# Half a step of the last decimal that is written of x y z [mm] and q1 q2 q3 q4, and a ten-thousandth of it for the arithmetic:
# a digit that is off by one is off by more.
HALF_STEPS = 0.50005 * np.repeat([10.0**-POSITION_DECIMALS, 10.0**-QUATERNION_DECIMALS], [3, 4])


def read_back(loaded: LoadedPath, correction: Correction, content: bytes, wanted: Indices) -> tuple[Poses, Array]:
    """The poses that the written program commands at the targets `wanted` (n,), ascending, and the distance (M,) [m] of the
    loaded tool from the plan with the numbers as written.

    Raises CompstiffError (CS4203) where the text does not say what was meant.
    """
    path, targets = loaded.path, loaded.targets
    again = read_rapid(content, path.toolpath.source)
    if not _as_meant(path.toolpath, again, correction):
        raise error("CS4203", "the corrected program does not read back as it was meant; nothing was written",
                    file=path.toolpath.source, hint="a defect in compstiff: please report it with this program")
    position, quaternion = again.toolpath.position, again.toolpath.quaternion
    del again
    theta = np.empty((len(targets), 6))
    for part in chunks(len(targets), CHUNK):
        few = targets[part]
        base_from_tcp = path.base_from_object[few] @ Frame.from_quaternion(position[few], quaternion[few])
        base_from_flange = base_from_tcp @ path.flange_from_tcp[few].inverse()
        theta[part] = nearest_angles(path.cell.robot, base_from_flange, correction.theta[part])
    there, joints, moved = path.base_from_tcp[wanted], path.theta[wanted], np.isin(wanted, targets)
    few = wanted[moved]
    written = path.base_from_object[few] @ Frame.from_quaternion(position[few], quaternion[few])
    there.rotation[moved], there.position[moved] = written.rotation, written.position
    joints[moved] = theta[np.searchsorted(targets, few)]
    return Poses(there, joints), off_goal(loaded, theta)


def _as_meant(before: Toolpath, again: RapidProgram, correction: Correction) -> bool:
    after, targets = again.toolpath, correction.targets
    if len(after) != len(before):
        return False
    others = np.ones(len(before), dtype=bool)
    others[targets] = False
    intact = all(np.array_equal(getattr(after, name)[others], getattr(before, name)[others], equal_nan=True)
                 for name in ("position", "quaternion", "confdata", "joints"))
    intact &= all(np.array_equal(getattr(after, name), getattr(before, name), equal_nan=True)
                  for name in ("external", "move", "feed", "zone", "tool", "workobject"))
    intact &= all([one.name for one in now] == [one.name for one in then] for now, then in (
        (after.tools, before.tools), (after.workobjects, before.workobjects)))
    intact &= bool(np.array_equal(after.confdata[targets], correction.confdata))
    return intact and all(_figures_as_meant(again, correction, part) for part in chunks(len(targets), CHUNK))


def _figures_as_meant(again: RapidProgram, correction: Correction, part: slice) -> bool:
    """Whether the numbers of some of the targets are those that were to be written, to half a step of their last decimal."""
    written = again.rows.numbers.pose[again.rows.row[correction.targets[part]]]
    position, quaternion = correction.position[part], correction.quaternion[part]
    sign = np.where(np.einsum("ni,ni->n", written[:, 3:], quaternion) < 0, -1.0, 1.0)
    off = np.abs(written - np.concatenate([1e3 * position, sign[:, None] * quaternion], axis=1))
    return bool(np.all(off <= HALF_STEPS))

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

# Half a step of the last decimal that is written of x y z [mm] and q1 q2 q3 q4, and a ten-thousandth of it for the arithmetic:
# a digit that is off by one is off by more.
HALF_STEPS = 0.50005 * np.repeat([10.0**-POSITION_DECIMALS, 10.0**-QUATERNION_DECIMALS], [3, 4])


def read_back(loaded: LoadedPath, correction: Correction, content: bytes) -> tuple[Poses, Array]:
    """The poses (N) that the written program commands, and the distance (M,) [m] of the loaded tool from the plan with the
    numbers as written.

    Raises CompstiffError (CS4203) where the text does not say what was meant.
    """
    path, targets = loaded.path, loaded.targets
    again = read_rapid(content, path.toolpath.source)
    if not _as_meant(path.toolpath, again, correction):
        raise error("CS4203", "the corrected program does not read back as it was meant; nothing was written",
                    file=path.toolpath.source, hint="a defect in compstiff: please report it with this program")
    after = again.toolpath
    del again
    rotation, position, joints = path.base_from_tcp.rotation.copy(), path.base_from_tcp.position.copy(), path.theta.copy()
    for part in chunks(len(targets), CHUNK):
        few = targets[part]
        base_from_tcp = path.base_from_object[few] @ Frame.from_quaternion(after.position[few], after.quaternion[few])
        base_from_flange = base_from_tcp @ path.flange_from_tcp[few].inverse()
        joints[few] = nearest_angles(path.cell.robot, base_from_flange, correction.theta[part])
        rotation[few], position[few] = base_from_tcp.rotation, base_from_tcp.position
    return Poses(Frame(rotation, position), joints), off_goal(loaded, joints[targets])


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
    written = again.rows.numbers.pose[again.rows.row[targets]]
    sign = np.where(np.einsum("ni,ni->n", written[:, 3:], correction.quaternion) < 0, -1.0, 1.0)
    off = np.abs(written - np.concatenate([1e3 * correction.position, sign[:, None] * correction.quaternion], axis=1))
    return intact and bool(np.all(off <= HALF_STEPS))

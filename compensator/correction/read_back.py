"""The written program, read again: every corrected number there, every other target as it was."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from compensator.correction.correction import Correction
from compensator.correction.forward import off_goal
from compensator.correction.loaded_path import LoadedPath
from compensator.path.legs import Poses
from compensator.rapid import read_rapid
from compensator.toolpath import Toolpath
from identification.common.findings import error
from identification.model.inverse import nearest_angles
from identification.model.rotations import Frame

Array = NDArray[np.float64]

# Half a unit of the last written decimal, in each coordinate [m], and what 8 decimals of a quaternion leave [rad].
WRITTEN_POSITION = 1e-7
WRITTEN_ROTATION = 1e-7


def read_back(loaded: LoadedPath, correction: Correction, content: bytes) -> tuple[Poses, Array]:
    """The poses (N) that the written program commands, and the distance (M,) [m] of the loaded tool from the plan with the
    numbers as written.

    Raises CompstiffError (CS4203) where the text does not say what was meant.
    """
    path, targets = loaded.path, loaded.targets
    after = read_rapid(content, path.toolpath.source).toolpath
    if not _as_meant(path.toolpath, after, correction):
        raise error("CS4203", "the corrected program does not read back as it was meant; nothing was written",
                    file=path.toolpath.source, hint="a defect in compstiff: please report it with this program")
    object_from_tcp = Frame.from_quaternion(after.position[targets], after.quaternion[targets])
    base_from_tcp = path.base_from_object[targets] @ object_from_tcp
    base_from_flange = base_from_tcp @ path.flange_from_tcp[targets].inverse()
    theta = nearest_angles(path.cell.robot, base_from_flange, correction.theta)
    residual = off_goal(loaded, theta)
    rotation, position, joints = path.base_from_tcp.rotation.copy(), path.base_from_tcp.position.copy(), path.theta.copy()
    rotation[targets], position[targets], joints[targets] = base_from_tcp.rotation, base_from_tcp.position, theta
    return Poses(Frame(rotation, position), joints), residual


def _as_meant(before: Toolpath, after: Toolpath, correction: Correction) -> bool:
    if len(after) != len(before):
        return False
    targets = correction.targets
    others = np.ones(len(before), dtype=bool)
    others[targets] = False
    intact = all(np.array_equal(getattr(after, name)[others], getattr(before, name)[others], equal_nan=True)
                 for name in ("position", "quaternion", "confdata", "joints"))
    intact &= bool(np.array_equal(after.external, before.external, equal_nan=True))
    intact &= bool(np.array_equal(after.move, before.move) and np.array_equal(after.feed, before.feed, equal_nan=True))
    alike = np.abs(np.einsum("ni,ni->n", after.quaternion[targets], correction.quaternion))
    return intact and bool(np.all(np.abs(after.position[targets] - correction.position) <= WRITTEN_POSITION)
                           and np.all(alike > 1 - WRITTEN_ROTATION**2 - 1e-15))

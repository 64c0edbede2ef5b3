"""What the places of a toolpath say of its unit, and of which of its moves are in the air."""

from __future__ import annotations

import numpy as np

from compensator.posting.campath import CamPath
from identification.common.arrays import Array
from identification.common.findings import Finding
from identification.model.rotations import Frame, quaternion_to_matrix

# A program of so many targets reaches over this [m], or is in metres; its tool has one direction where the mean of the unit
# vectors is as long; and its moves in the air are no deeper than its cuts by this [m], in the middle (engineering judgement).
FEWEST, SMALLEST, ONE_DIRECTION, DEEPER = 10, 2e-3, 0.95, 5e-4


def said_of_places(cam_path: CamPath, flange_from_tcp: Frame) -> list[Finding]:
    """Warnings: a path that is next to nothing (CS4308), moves in the air below the cuts (CS4309)."""
    position, rapid = cam_path.position, cam_path.rapid
    if len(position) < FEWEST:
        return []
    reach = float(np.max(np.ptp(position, axis=0)))
    if reach < SMALLEST:
        return [Finding("CS4308", "warning", f"all {len(position)} targets lie within {1e3 * reach:.2g} mm: in metres?",
                        file=cam_path.source, hint="x_mm y_mm z_mm are millimetres; an APT file is in its UNITS")]
    up = np.mean(_to_spindle(cam_path, flange_from_tcp), axis=0)
    if np.linalg.norm(up) < ONE_DIRECTION or min(rapid.sum(), (~rapid).sum()) < FEWEST // 2:
        return []
    height = position @ up
    deeper = float(np.median(height[~rapid]) - np.median(height[rapid]))
    if deeper < DEEPER:
        return []
    return [Finding("CS4309", "warning", f"the moves in the air lie {1e3 * deeper:.3g} mm deeper than the cuts, in the "
                    "middle: are they the cuts?", file=cam_path.source,
                    hint="rapid is 1 for a move through the air, 0 for one that cuts")]


def _to_spindle(cam_path: CamPath, flange_from_tcp: Frame) -> Array:
    """Unit vectors (N, 3) from the tip towards the spindle, whichever way the tool's z points."""
    if cam_path.axis is not None:
        return cam_path.axis
    assert cam_path.quaternion is not None
    sign = -1.0 if flange_from_tcp.inverse().position[2] < 0 else 1.0
    return np.asarray(sign * quaternion_to_matrix(cam_path.quaternion)[:, :, 2])

"""What the places of a toolpath say of its unit, its order, where the spindle is, and which of its moves are in the air."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from compensator.posting.campath import CamPath
from identification.common.arrays import Array
from identification.common.findings import Finding
from identification.model.rotations import Frame, quaternion_to_matrix

# A program of so many targets reaches over this [m], or is in metres; its tool has one direction where the mean of the unit
# vectors is as long; and its moves in the air are no deeper than its cuts by this [m], in the middle (engineering judgement).
FEWEST, SMALLEST, ONE_DIRECTION, DEEPER = 10, 2e-3, 0.95, 5e-4
# Rows are in disorder where, of so many cuts, the path turns by more than this in the middle [rad], its directions are spread
# over more than four (mean of the unit vectors of the fourfold angle), and its steps are so many times as long as the next
# target is far.
MANY, TURNS, CROSSWISE, LEAPS = 30, np.radians(60.0), 0.5, 5.0


def said_of_places(cam_path: CamPath, flange_from_tcp: Frame) -> list[Finding]:
    """Warnings: a path that is next to nothing (CS4308), moves in the air below the cuts, or out of a cut towards the tip
    (CS4309), rows in disorder (CS4315)."""
    position, rapid = cam_path.position, cam_path.rapid
    if len(position) < FEWEST:
        return []
    reach = float(np.max(np.ptp(position, axis=0)))
    if reach < SMALLEST:
        return [Finding("CS4308", "warning", f"all {len(position)} targets lie within {1e3 * reach:.2g} mm: in metres?",
                        file=cam_path.source, hint="x_mm y_mm z_mm are millimetres; an APT file is in its UNITS")]
    up = to_spindle(cam_path, flange_from_tcp)
    return [*_deeper(position, rapid, up, cam_path.source), *_leaps(cam_path)]


def _deeper(position: Array, rapid: NDArray[np.bool_], up: Array, source: str) -> list[Finding]:
    """position (N, 3) [m], up (N, 3) unit vectors towards the spindle."""
    first, mean = np.flatnonzero(rapid[1:] != rapid[:-1]), np.mean(up, axis=0)
    # Out of a cut, and backwards out of where the next begins.
    away = np.where(rapid[1:], 1, -1)[first] * np.einsum("ni,ni->n", position[first + 1] - position[first], up[first])
    if np.linalg.norm(mean) >= ONE_DIRECTION and min(rapid.sum(), (~rapid).sum()) >= FEWEST // 2:
        height = position @ mean
        deeper = float(np.median(height[~rapid]) - np.median(height[rapid]))
        if deeper >= DEEPER:
            return [Finding("CS4309", "warning", f"the moves in the air lie {1e3 * deeper:.3g} mm deeper than the cuts, in the "
                            "middle: are they the cuts?", file=source,
                            hint="rapid is 1 for a move through the air, 0 for one that cuts; or the tool's axis points the "
                            "wrong way: quaternions are w x y z, tool z away from the spindle as in cell.yaml")]
    if len(first) > 1 and float(np.median(away)) < -DEEPER:
        return [Finding("CS4309", "warning", f"the moves in the air leave the cuts towards the tool's tip, by "
                        f"{-1e3 * float(np.median(away)):.3g} mm in the middle", file=source,
                        hint="does the tool's axis point the wrong way: quaternions are w x y z, an APT axis points from the "
                        "tip to the spindle")]
    return []


def _leaps(cam_path: CamPath) -> list[Finding]:
    """Rows that a spreadsheet has sorted."""
    from scipy.spatial import KDTree

    cut = ~cam_path.rapid
    pairs = np.flatnonzero(cut[1:] & cut[:-1])
    point = cam_path.position[cut]
    if len(pairs) < MANY:
        return []
    step = np.diff(cam_path.position, axis=0)[pairs]
    length = np.linalg.norm(step, axis=1)
    # In the plane in which the cuts reach farthest.
    plane = np.linalg.svd(point - point.mean(axis=0), full_matrices=False)[2][:2]
    angle = np.arctan2(*(plane @ step.T)[::-1])
    turn = np.abs((np.diff(angle) + np.pi) % (2 * np.pi) - np.pi)
    near = np.asarray(KDTree(point).query(point, k=2)[0])[:, 1]
    if (np.median(turn) < TURNS or abs(np.mean(np.exp(4j * angle))) > CROSSWISE
            or np.median(length) < LEAPS * np.median(near)):
        return []
    worst = int(pairs[np.argmax(length)])
    return [Finding("CS4315", "warning", f"from cut to cut the path leaps {1e3 * np.median(length):.3g} mm, in the middle, in "
                    f"any direction, and turns by {np.degrees(np.median(turn)):.0f} degrees; the nearest cuts lie "
                    f"{1e3 * np.median(near):.2g} mm apart", file=cam_path.source, line=int(cam_path.line[worst + 1]),
                    hint="are the rows still in the order in which they are driven, or were they sorted?")]


def to_spindle(cam_path: CamPath, flange_from_tcp: Frame) -> Array:
    """Unit vectors (N, 3) from the tip towards the spindle, whichever way the tool's z points."""
    if cam_path.axis is not None:
        return cam_path.axis
    assert cam_path.quaternion is not None
    sign = -1.0 if flange_from_tcp.inverse().position[2] < 0 else 1.0
    return np.asarray(sign * quaternion_to_matrix(cam_path.quaternion)[:, :, 2])

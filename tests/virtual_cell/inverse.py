"""Joint angles of the IRB 6660 for a wanted TCP, from the drawing of its zero pose: the planar two-bar arm and the wrist."""

from __future__ import annotations

import numpy as np

from tests.virtual_cell.arm_model import ELBOW, FLANGE, FOREARM, HEIGHT, LOWER_ARM, SHOULDER, ZERO_FLANGE, Tool

# The controller's limits [deg] and the window of theta3 - theta2 (identification/model/robots/irb6660-205-1.90.yaml).
LIMITS = np.array([[-180, 180], [-42, 85], [-20, 120.5], [-300, 300], [-120, 120], [-360, 360]])
WINDOW = np.array([-70.0, 70.0])


def inverse(tcp: np.ndarray, rotation: np.ndarray, tool: Tool) -> np.ndarray:
    """Angles (N, 2, 6) [rad], both wrist branches, arm forwards and elbow up; NaN where the TCP is out of reach.

    tcp (N, 3) [m] in the base frame, rotation (N, 3, 3) base_from_flange.
    """
    hand = rotation @ ZERO_FLANGE.T
    wrist = tcp - rotation @ np.array(tool.tcp) - FLANGE * hand[:, :, 0]
    q1 = np.arctan2(wrist[:, 1], wrist[:, 0])
    out, up = np.hypot(wrist[:, 0], wrist[:, 1]) - SHOULDER, wrist[:, 2] - HEIGHT
    reach, forearm = np.hypot(out, up), np.hypot(FOREARM, ELBOW)
    with np.errstate(invalid="ignore"):
        lower = np.arctan2(up, out) + np.arccos((LOWER_ARM**2 + reach**2 - forearm**2) / (2 * LOWER_ARM * reach))
    q2 = np.pi / 2 - lower
    rise = np.arctan2(up - LOWER_ARM * np.sin(lower), out - LOWER_ARM * np.cos(lower))
    q3 = np.arctan2(ELBOW, FOREARM) - rise
    zero, one = np.zeros_like(q1), np.ones_like(q1)
    column = np.stack([np.cos(q1), -np.sin(q1), zero, np.sin(q1), np.cos(q1), zero, zero, zero, one], -1).reshape(-1, 3, 3)
    arm = np.stack([np.cos(q3), zero, np.sin(q3), zero, one, zero, -np.sin(q3), zero, np.cos(q3)], -1).reshape(-1, 3, 3)
    turn = np.swapaxes(column @ arm, 1, 2) @ hand       # Rx(q4) Ry(q5) Rx(q6)
    result = []
    for sign in (1.0, -1.0):
        q5 = sign * np.arctan2(np.hypot(turn[:, 1, 0], turn[:, 2, 0]), turn[:, 0, 0])
        q4 = np.arctan2(sign * turn[:, 1, 0], -sign * turn[:, 2, 0])
        q6 = np.arctan2(sign * turn[:, 0, 1], sign * turn[:, 0, 2])
        result.append(np.stack([q1, q2, q3, q4, q5, q6], axis=1))
    return np.stack(result, axis=1)


def comfortable(theta: np.ndarray, share: float = 0.9) -> np.ndarray:
    """Whether angles (..., 6) [rad] lie in the inner share of the limits, with |q5| over 15 degrees; NaN does not."""
    degrees = np.degrees(theta)
    rows = np.concatenate([degrees, degrees[..., 2:3] - degrees[..., 1:2]], axis=-1)
    limits = np.concatenate([LIMITS, WINDOW[None]])
    with np.errstate(invalid="ignore"):
        inside = np.abs(rows - limits.mean(axis=1)) <= share * np.ptp(limits, axis=1) / 2
    return inside.all(axis=-1) & (np.abs(degrees[..., 4]) > 15.0)

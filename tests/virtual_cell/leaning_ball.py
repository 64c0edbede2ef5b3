"""A ball-end mill that leans, climbs or descends, edge by edge in time: the truth for forces from the stock in slices.

Nothing is cut into levels here, and no integral is closed. Straight edges turn about the leaning axis while the ball's middle
goes its way; every bit of an edge is a point in space with a velocity. It meets what stands between it and the ball as it was
one tooth before, where the block is and none of the ways before went. The material is a block, less balls and their shanks
along straight ways. Only the linear-edge law is shared. Not modelled: what the shank cuts, deflection, run-out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

Block = tuple[tuple[float, float, float], tuple[float, float, float]]


@dataclass(frozen=True)
class LeaningBall:
    """Millimetres, newtons. axis (3,): unit vector towards the spindle, which turns clockwise seen from there."""

    axis: tuple[float, float, float]
    radius_mm: float = 8.0
    teeth: int = 3
    shear_n_mm2: tuple[float, float, float] = (767.01, 168.8, 222.0)
    edge_n_mm: tuple[float, float, float] = (27.7, 26.6, 0.7)


def tilted(lead_deg: float, tilt_deg: float) -> tuple[float, float, float]:
    """An axis that leans forward along x by lead, then to y by tilt."""
    lead, tilt = np.radians([lead_deg, tilt_deg])
    axis = np.array([np.tan(lead), np.tan(tilt), 1.0])
    x, y, z = axis / np.linalg.norm(axis)
    return float(x), float(y), float(z)


def mean_force(ball: LeaningBall, middle: np.ndarray, chip: np.ndarray, block: Block, ways: Sequence[np.ndarray] = (), *,
               bits: int = 300, instants: int = 360) -> np.ndarray:
    """Mean force (3,) [N] on the tool over a revolution about `middle` (3,) [mm], with a feed of chip (3,) [mm] a tooth; ways,
    each (2, 3) [mm]: first and last place of the middle on passes before this. On its own pass it comes straight from afar."""
    axis = np.array(ball.axis)
    first = np.cross(axis, [0.3, -0.5, 0.8])
    first /= np.linalg.norm(first)
    second = np.cross(axis, first)
    kappa = (np.arange(bits) + 0.5) / bits * 0.5 * np.pi
    length = ball.radius_mm * 0.5 * np.pi / bits
    low, high = np.array(block[0]), np.array(block[1])
    (ktc, krc, kac), (kte, kre, kae) = ball.shear_n_mm2, ball.edge_n_mm
    total = np.zeros(3)
    for k in range(instants):
        # One tooth does for all: they are alike. Its way is that of a whole revolution, as many teeth long.
        turn = (k + 0.5) / instants
        angle = -2 * np.pi * turn
        out = np.cos(angle) * first + np.sin(angle) * second
        normal = np.sin(kappa)[:, None] * out - np.cos(kappa)[:, None] * axis
        point = middle + ball.radius_mm * normal
        # Turning clockwise about the axis, and fed.
        velocity = 2 * np.pi * np.cross(ball.radius_mm * normal, axis) + ball.teeth * chip
        against = -velocity / np.linalg.norm(velocity, axis=1)[:, None]
        # Along the normal, from the ball one tooth ago to this point.
        back = point - (middle - chip)
        along = np.einsum("bi,bi->b", back, normal)
        thick = along - np.sqrt(np.maximum(ball.radius_mm**2 - (np.einsum("bi,bi->b", back, back) - along**2), 0.0))
        inner = point - 0.5 * thick[:, None] * normal
        cuts = (thick > 0) & (inner > low).all(axis=1) & (inner < high).all(axis=1)
        for way in ways:
            cuts[cuts] = _away_from_tool(inner[cuts], way[0], way[1], axis) > ball.radius_mm
        cuts[cuts] = _away(inner[cuts], middle - 1e3 * chip, middle - chip) > ball.radius_mm
        upward = np.cos(kappa)[:, None] * out + np.sin(kappa)[:, None] * axis
        force = (ktc * thick + kte)[:, None] * against - (krc * thick + kre)[:, None] * normal - (
            kac * thick + kae)[:, None] * upward
        total += length * (force * cuts[:, None]).sum(axis=0)
    return ball.teeth * total / instants


def _away(points: np.ndarray, first: np.ndarray, last: np.ndarray) -> np.ndarray:
    """From points (n, 3) to a straight way."""
    along = last - first
    share = np.clip((points - first) @ along / (along @ along), 0.0, 1.0)
    return np.asarray(np.linalg.norm(points - first - share[:, None] * along, axis=1))


def _away_from_tool(points: np.ndarray, first: np.ndarray, last: np.ndarray, axis: np.ndarray, turns: int = 20) -> np.ndarray:
    """From points (n, 3) to the ball's middle, or what of the axis is above that, as it went a straight way. Along the way that
    has one least value: what is not in its third is left out."""
    low, high = np.zeros(len(points)), np.ones(len(points))

    def away(share: np.ndarray) -> np.ndarray:
        off = points - first - share[:, None] * (last - first)
        up = np.maximum(off @ axis, 0.0)
        return np.asarray(np.linalg.norm(off - up[:, None] * axis, axis=1))

    for _ in range(turns):
        one, other = low + (high - low) / 3, high - (high - low) / 3
        less = away(one) < away(other)
        low, high = np.where(less, low, one), np.where(less, other, high)
    return away(0.5 * (low + high))

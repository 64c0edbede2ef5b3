"""Where an elastic chain comes to rest: the minimum of its potential energy, springs less the work of dead loads.

    E(u) = springs(u) - sum_j f_j . p_j(s),   s = given + give u

u are the elastic coordinates; f_j keep their direction in the base frame however far the point p_j moves. Newton's method with
the exact second derivative, all rows at once; along its step each row goes on to where the energy has stopped falling.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tests.second_cell.chain import Placed, placed

TOLERANCE = 1e-13       # [rad], [m]: of the last Newton step
Springs = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True)
class Load:
    """A dead load: force (n, 3) [N] in the base frame on the point that is at `home` (3,) [m] at home, behind an element."""

    behind: int
    home: np.ndarray
    force: np.ndarray


def at_rest(screws: np.ndarray, given: np.ndarray, give: np.ndarray, springs: Springs, loads: list[Load],
            start: np.ndarray) -> tuple[np.ndarray, Placed]:
    """Elastic coordinates u (n, e) at the minimum, from `start` (n, e), and the chain there.

    given (n, m): the elements' s of the rigid arm; give (m, e); springs: u -> its torques (n, e) and stiffnesses (n, e, e).
    """
    def gradient(u: np.ndarray) -> tuple[np.ndarray, np.ndarray, Placed]:
        now = placed(screws, given + u @ give.T)
        pull, stiffness = springs(u)
        for load in loads:
            moved = now.motion(load.behind, now.point(load.behind, load.home))
            pull = pull - np.einsum("nki,ni->nk", moved, load.force) @ give
            stiffness = stiffness - give.T @ now.bending(moved, load.force) @ give
        return pull, stiffness, now

    u = start.copy()
    pull, stiffness, now = gradient(u)
    for _ in range(80):
        step = -np.linalg.solve(stiffness, pull[:, :, None])[:, :, 0]
        if np.abs(step).max() < TOLERANCE:
            return u, now
        falling, coarse = np.abs(np.sum(pull * step, axis=1)), np.abs(step).max(axis=1) > 100 * TOLERANCE
        low, high, share = np.zeros(len(u)), np.ones(len(u)), np.ones(len(u))
        for _ in range(50):
            pull, stiffness, now = gradient(u + share[:, None] * step)
            rising = np.sum(pull * step, axis=1)
            far, short = coarse & (rising > falling / 2), coarse & (rising < -falling / 2) & (share < 1)
            if not (far | short).any():
                break
            high, low = np.where(far, share, high), np.where(short, share, low)
            share = np.where(far | short, (low + high) / 2, share)
        u = u + share[:, None] * step
    raise ArithmeticError(f"not at rest: the last step was {np.abs(step).max():.1e}")

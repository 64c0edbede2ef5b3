"""A corner of the pocket milled chip by chip in time: what milling.py, which has no time at a corner, cannot tell.

There the force is that of the place and of a steady feed, at once. Here the chip is what the tooth before left: along every ray
from the axis the cutter reaches beyond the circles in which it stood a tooth and more ago, and what of that is stock is cut. So
a tool that is drawn back cuts nothing, and a force needs the time in which the chip grows. The arm is a spring without mass,
in balance with the chip at every instant; teeth and run-out are averaged. Commands are driven at the feed, as controller.py
interpolates them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tests.virtual_cell.endmill import EndMill
from tests.virtual_cell.milled_part import CORNER, HALF, POCKET, RADIUS, Part

# The sharp corner of the tool's path [mm], reached along x and left along y.
AT = np.array([HALF[0] - RADIUS, RADIUS - HALF[1]])
RAYS, INSTANTS, PAST_TEETH = 360, 2, 24     # about the axis; a tooth; looked back
FADE_MM = 2e-3                              # of chip, up to which an edge's own force comes
BALANCE_MM, SMALL_MM = 2e-5, 1e-5           # of arm and chip; of a difference


@dataclass(frozen=True)
class CornerPass:
    """Commands (n, 2) and where the tool stands (n, 2) [mm], and the force on it (n, 3) [N], work object, evenly in time."""

    commanded_mm: np.ndarray
    stands_mm: np.ndarray
    force_n: np.ndarray

    @property
    def walls_um(self) -> np.ndarray:
        """How far both walls are cut too deep (positive) or not deep enough, over CORNER mm before and behind the corner."""
        grid, tool = np.arange(0.0, CORNER, 0.05), self.stands_mm
        before = _reach(-tool[:, 1], tool[:, 0], AT[0] - grid) - HALF[1]
        behind = _reach(tool[:, 0], tool[:, 1], AT[1] + grid) - HALF[0]
        return 1e3 * np.concatenate([before, behind])


def _reach(towards: np.ndarray, along: np.ndarray, grid: np.ndarray) -> np.ndarray:
    """How far the cutter reached towards a wall at places along it."""
    square = RADIUS**2 - (grid[:, None] - along) ** 2
    return np.asarray(np.where(square > 0, towards + np.sqrt(np.maximum(square, 0)), -np.inf).max(axis=1))


class _Chips:
    """The force on a tool at a place, with the places where it stood before."""

    def __init__(self, part: Part, cutter: EndMill) -> None:
        angle = (np.arange(RAYS) + 0.5) * 2 * np.pi / RAYS
        self.part, self.cutter = part, cutter
        self.ray = np.column_stack([np.cos(angle), np.sin(angle)])
        self.against = np.column_stack([-self.ray[:, 1], self.ray[:, 0]])
        self.weight = -float(part.target_mm[part.feature == POCKET, 2].min()) * cutter.teeth / RAYS

    def force(self, place: np.ndarray, before: np.ndarray) -> np.ndarray:
        seen = before - place
        along = seen @ self.ray.T
        inside = RADIUS**2 - (seen**2).sum(axis=1)[:, None] + along**2
        gone = np.where(inside > 0, along + np.sqrt(np.maximum(inside, 0)), 0.0).max(axis=0)
        chip = np.clip(self.part.inside_mm(POCKET, place + RADIUS * self.ray), 0.0, np.maximum(RADIUS - gone, 0.0))
        edge = np.clip(chip / FADE_MM, 0.0, 1.0)
        tangential, radial, axial = (shear * chip + own * edge for shear, own in zip(
            self.cutter.shear_n_mm2, self.cutter.edge_n_mm, strict=True))
        flat = tangential @ self.against - radial @ self.ray
        return self.weight * np.append(flat, -axial.sum())


    def balance(self, place: np.ndarray, before: np.ndarray, aim: np.ndarray, compliance: np.ndarray) -> np.ndarray:
        """Where (2,) a tool that is commanded to `aim` (2,) stands: Newton's method, with shorter steps where a chip begins."""
        def miss(at: np.ndarray) -> np.ndarray:
            return np.asarray(at - aim - (compliance @ self.force(at, before))[:2])

        off = miss(place)
        for _ in range(60):
            if np.abs(off).max() < BALANCE_MM:
                return place
            slope = np.column_stack([(miss(place + small) - off) / SMALL_MM for small in SMALL_MM * np.eye(2)])
            step, share = np.linalg.solve(slope, -off), 1.0
            while np.linalg.norm(new := miss(place + share * step)) > (1 - 0.1 * share) * np.linalg.norm(off) and share > 1e-3:
                share *= 0.5
            place, off = place + share * step, new
        raise AssertionError(f"no balance: {1e3 * np.abs(off).max():.2f} um")


def mill_corner(way_mm: np.ndarray, part: Part, cutter: EndMill, compliance: np.ndarray) -> CornerPass:
    """The pass along a commanded way (m, 2) [mm] about the corner, densely given, with an arm of a compliance (3, 3) [mm/N]."""
    chips = _Chips(part, cutter)
    a_step = cutter.feed_mm_s / (cutter.turns_per_s * cutter.teeth * INSTANTS)
    length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(way_mm, axis=0), axis=1)))
    at = np.arange(0.0, length[-1], a_step)
    commanded = np.column_stack([np.interp(at, length, axis) for axis in way_mm.T])
    lead_in = commanded[0] - np.outer(np.arange(3 * INSTANTS, 0, -1), commanded[1] - commanded[0])
    stood, force = np.concatenate([lead_in, np.zeros_like(commanded)]), np.zeros((len(commanded), 3))
    for i, aim in enumerate(commanded):
        row = i + len(lead_in)
        before = stood[max(0, row - (PAST_TEETH + 1) * INSTANTS):row - INSTANTS + 1]
        stood[row] = chips.balance(stood[row - 1], before, aim, compliance)
        force[i] = chips.force(stood[row], before)
    return CornerPass(commanded, stood[len(lead_in):], force)

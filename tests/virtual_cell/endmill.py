"""Cutting force of an end mill on the engagement it really has: mechanistic, mean over a revolution and tooth by tooth.

The edge of tooth j at the angle phi from the feed's direction carries, per millimetre of depth and ON THE TOOL (linear-edge
force model of end milling, Altintas),

    g = (Ktc h + Kte) e_t - (Krc h + Kre) e_r - (Kac h + Kae) e_z,     h = f_z cos(phi) + (rho_j - rho_{j-1}),

e_r from the axis to the edge, e_t against the edge's speed (spindle clockwise seen from above), e_z from tip to spindle, f_z
the feed a tooth, rho_j the run-out. It cuts where h > 0, in the half of the circle that faces the feed, and where there is
stock; the caller says how deep in the stock each point of that half circle lies. Not modelled: chatter, rubbing, the floor.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

PIECES = 360        # of the half circle that faces the feed


@dataclass(frozen=True)
class EndMill:
    """Cutter, spindle and material.

    Force coefficients: Al7075-T6, dry, as in samples/cutting.py (which names the source). All else is made up for tests.
    """

    radius_mm: float = 8.0
    teeth: int = 3
    helix_deg: float = 30.0
    spindle_rpm: float = 9000.0
    feed_mm_s: float = 36.0
    runout_mm: tuple[float, ...] = (0.012, 0.0, 0.0)
    shear_n_mm2: tuple[float, float, float] = (767.01, 168.8, 222.0)        # Ktc, Krc, Kac
    edge_n_mm: tuple[float, float, float] = (27.7, 26.6, 0.7)               # Kte, Kre, Kae

    @property
    def turns_per_s(self) -> float:
        return self.spindle_rpm / 60

    @cached_property
    def edges(self) -> np.ndarray:
        """Angles (PIECES + 1,) [rad] between the pieces of the half circle, 0 in the feed's direction."""
        return np.linspace(-np.pi / 2, np.pi / 2, PIECES + 1)

    @cached_property
    def rim_mm(self) -> np.ndarray:
        """The half circle (PIECES + 1, 2) [mm] about the axis: along the feed and to its left."""
        return self.radius_mm * np.column_stack([np.cos(self.edges), np.sin(self.edges)])

    @cached_property
    def _edge_force(self) -> np.ndarray:
        """g (teeth, 3, PIECES) [N/mm] of the model, along the feed, to its left, up."""
        phi = 0.5 * (self.edges[1:] + self.edges[:-1])
        runout = np.array(self.runout_mm)
        chip = self.feed_mm_s / (self.teeth * self.turns_per_s) * np.cos(phi) + (runout - np.roll(runout, 1))[:, None]
        tangential, radial, axial = ((chip > 0) * (shear * chip + edge)
                                     for shear, edge in zip(self.shear_n_mm2, self.edge_n_mm, strict=True))
        cos, sin = np.cos(phi), np.sin(phi)
        return np.stack([-tangential * sin - radial * cos, tangential * cos - radial * sin, -axial], axis=1)

    @cached_property
    def _sum_of_teeth(self) -> np.ndarray:
        return np.asarray(self._edge_force.sum(axis=0) * (np.pi / PIECES) / (2 * np.pi))

    def coverage(self, inside_mm: np.ndarray) -> np.ndarray:
        """Share (PIECES,) of each piece that is in the stock; inside_mm (PIECES + 1,): how far `rim_mm` is within it."""
        first, last = inside_mm[:-1], inside_mm[1:]
        high, low = np.maximum(first, last), np.minimum(first, last)
        return np.minimum(np.maximum(high / np.maximum(high - low, 1e-12), 0.0), 1.0)

    def mean_force(self, coverage: np.ndarray, depth_mm: float) -> np.ndarray:
        """Mean over a revolution (3,) [N]: along the feed, to its left, up."""
        return np.asarray(depth_mm * (self._sum_of_teeth @ coverage))

    def force(self, coverage: np.ndarray, depth_mm: float, spindle: np.ndarray) -> np.ndarray:
        """Force (n, 3) [N] at spindle angles (n,) [rad] (first tooth, clockwise from the feed): along the feed, left, up.

        The helix is integrated exactly: an edge of that depth covers an interval of angles.
        """
        summed = np.zeros((3, self.teeth, PIECES + 1))
        np.cumsum(self._edge_force.swapaxes(0, 1) * (np.pi / PIECES * coverage), axis=2, out=summed[:, :, 1:])
        per_mm = np.tan(np.radians(self.helix_deg)) / self.radius_mm        # of depth; the upper edge trails
        tooth = np.arange(self.teeth)[:, None, None]
        tip = -spindle - 2 * np.pi * tooth / self.teeth + np.pi / 2
        turns, rest = np.divmod(tip + np.array([[per_mm * depth_mm], [0.0]]), 2 * np.pi)        # (teeth, 2 ends, n)
        # Between the edges of pieces that are all alike; beyond the half circle nothing more is added.
        place = np.minimum(rest * (PIECES / np.pi), PIECES)
        piece = np.minimum(place.astype(int), PIECES - 1)
        before, after = (summed.reshape(3, -1).take(piece + (PIECES + 1) * tooth + end, axis=1) for end in (0, 1))
        passed = turns * summed[:, :, None, -1:] + before + (place - piece) * (after - before)
        return np.asarray((passed[:, :, 0] - passed[:, :, 1]).sum(axis=1).T / per_mm)

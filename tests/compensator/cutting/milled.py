"""A stock milled along a polyline by the program, without a robot, and the same by the tests' engine tooth by tooth."""

from __future__ import annotations

import numpy as np

from compensator.cutting.chips import SHEAR
from compensator.cutting.cutter import Cutter
from compensator.cutting.removal import Engagement, mill_through
from compensator.cutting.stock import Stock, box_stock
from compensator.cutting.track import Track
from tests.virtual_cell.tooth_by_tooth import ToothedMill

MILL = ToothedMill()
FLAT = Cutter(1e-3 * MILL.radius_mm, MILL.teeth)
TRUE = np.array([*(1e6 * np.array(MILL.shear_n_mm2)), *(1e3 * np.array(MILL.edge_n_mm))])


def track_along(corner_mm: np.ndarray, chip_mm: float = 0.1, step_mm: float = 0.5, **changed: np.ndarray) -> Track:
    """Along corners (K, 3) [mm] in even steps."""
    corner = 1e-3 * np.asarray(corner_mm, dtype=float)
    size = np.linalg.norm(np.diff(corner, axis=0), axis=1)
    pieces = np.maximum(np.ceil(size / (1e-3 * step_mm) - 1e-9), 1).astype(int)
    leg = np.repeat(np.arange(len(size)), pieces)
    number = np.concatenate([np.arange(count) for count in pieces])
    way = (corner[leg + 1] - corner[leg]) / pieces[leg, None]
    start = corner[leg] + number[:, None] * way
    done = np.concatenate([[0.0], np.cumsum(size)])[leg] + (number + 0.5) * size[leg] / pieces[leg]
    count = len(leg)
    arrays = {"start": start, "end": start + way, "place": done, "length": np.linalg.norm(way, axis=1), "target": leg,
              "move": leg,
              "chip": np.full(count, 1e-3 * chip_mm),
              "joint": np.zeros(count, dtype=bool),
              "axis": np.broadcast_to([0.0, 0.0, 1.0], (count, 3))}
    return Track(**(arrays | changed))


def block(low: tuple[float, float, float], high: tuple[float, float, float], levels_mm: tuple[float, ...],
          cell_mm: float = 0.2) -> Stock:
    """A block with layers that end at these heights [mm] too."""
    height = 1e-3 * np.array(sorted({low[2], *levels_mm, high[2]}))
    return box_stock(1e-3 * np.array(low), 1e-3 * np.array(high), height, 1e-3 * cell_mm)


def force_of(track: Track, engaged: Engagement, coefficients: np.ndarray = TRUE) -> np.ndarray:
    """Mean force (S, 3) [N] of the steps."""
    weight = engaged.weights.copy()
    weight[:, :, SHEAR] *= track.chip[:, None, None]
    return np.asarray(weight @ coefficients)


def milled(stock: Stock, corner_mm: np.ndarray, chip_mm: float = 0.1, cutter: Cutter = FLAT, step_mm: float = 0.5
           ) -> tuple[Track, Engagement, np.ndarray]:
    """Track, engagement and force (S, 3) [N] of a way through a stock."""
    track = track_along(corner_mm, chip_mm, step_mm)
    engaged, _ = mill_through(stock, track, cutter)
    return track, engaged, force_of(track, engaged)

"""Cutter: an end mill as bodies of revolution have it, flat, bull-nose or ball."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identification.common.arrays import Array
from identification.common.findings import error
from identification.model.cell import Cell


@dataclass(frozen=True)
class Cutter:
    """radius [m]; corner [m]: radius of the rounding between flank and floor, 0 for a flat end mill, `radius` for a ball;
    teeth, evenly spaced; flute [m]: length of the edges along the axis."""

    radius: float
    teeth: int
    corner: float = 0.0
    flute: float = np.inf

    def radius_at(self, height: Array) -> Array:
        """Radius [m] at heights [m] above the tip; negative below it and above the edges."""
        down = np.maximum(self.corner - np.maximum(height, 0.0), 0.0)
        inside = self.radius - self.corner + np.sqrt(np.maximum(self.corner**2 - down**2, 0.0))
        return np.asarray(np.where((height >= 0) & (height <= self.flute), inside, -1.0))

    def sine_at(self, height: Array) -> Array:
        """Sine of the angle between the axis and the normal of the edge at heights [m]: 1 on the flank, 0 at a ball's tip."""
        if not self.corner:
            return np.ones_like(height)
        down = np.clip(1 - np.asarray(height) / self.corner, 0.0, 1.0)
        return np.asarray(np.sqrt(np.maximum(1 - down**2, 0.0)))

    def edge_length(self, low: Array, high: Array) -> Array:
        """Length of the edge's outline [m] between heights low and high [m] above the tip: of the axis' length on the flank."""
        if not self.corner:
            return np.asarray(high - low)
        first, last = (np.arccos(np.clip(1 - np.maximum(one, 0.0) / self.corner, 0.0, 1.0)) for one in (low, high))
        on_flank = np.maximum(high, self.corner) - np.maximum(low, self.corner)
        return np.asarray(self.corner * (last - first) + on_flank)

    def words(self) -> str:
        """For people."""
        kind = "flat" if not self.corner else "ball" if self.corner == self.radius else f"bull-nose R{1e3 * self.corner:g}"
        return f"{kind} end mill, diameter {2e3 * self.radius:g} mm, {self.teeth} teeth"


def cutter_of(cell: Cell) -> Cutter:
    """As `cutting` of cell.yaml says. Raises CompstiffError (CS4701) where diameter or teeth are not stated there."""
    cutting = cell.cutting
    missing = [f"cutting.{name}" for name in ("tool_diameter_mm", "teeth") if getattr(cutting, name) is None]
    if missing or cutting.tool_diameter_mm is None or cutting.teeth is None:
        raise error("CS4701", f"the cutter is not known: {' and '.join(missing)} of cell.yaml", file=str(cell.source),
                    hint="state diameter and teeth, and cutting.corner_radius_mm unless it is a flat end mill")
    radius = 0.5e-3 * cutting.tool_diameter_mm
    corner = 1e-3 * (cutting.corner_radius_mm or 0.0)
    if corner > radius * (1 + 1e-9):
        raise error("CS4701", f"cutting.corner_radius_mm is {1e3 * corner:g}, expected at most half the diameter, "
                    f"{1e3 * radius:g}", file=str(cell.source), hint="a ball has just half the diameter")
    return Cutter(radius, cutting.teeth, min(corner, radius),
                  np.inf if cutting.flute_mm is None else 1e-3 * cutting.flute_mm)

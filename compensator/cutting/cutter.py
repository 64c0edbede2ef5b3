"""Cutter: an end mill as bodies of revolution have it, flat, bull-nose or ball."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from compensator.toolpath import StatedCutter
from identification.common.arrays import Array
from identification.common.findings import Finding, error
from identification.model.cell import Cell

# Lengths of a cutter that are one [m].
SAME = 1e-5


@dataclass(frozen=True)
class Cutter:
    """radius [m]; corner [m]: radius of the rounding between flank and floor, 0 for a flat end mill, `radius` for a ball;
    teeth, evenly spaced; flute [m]: length of the edges along the axis."""

    radius: float
    teeth: int
    corner: float = 0.0
    flute: float = np.inf

    @property
    def ball(self) -> bool:
        """Whether all of it under the flank is one ball."""
        return self.corner > self.radius - SAME

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
        kind = "flat" if not self.corner else "ball" if self.ball else f"bull-nose R{1e3 * self.corner:g}"
        return f"{kind} end mill, diameter {2e3 * self.radius:g} mm, {self.teeth} teeth"


def cutter_of(cell: Cell, stated: tuple[StatedCutter, ...] = ()) -> Cutter:
    """As `cutting` of cell.yaml says; what it leaves out of diameter and corner radius is that which the program states.

    Raises CompstiffError: CS4701 diameter or teeth are stated nowhere, CS4716 cell and program contradict each other, CS4718
    the program's tool is no end mill that is modelled, CS4719 the program states several.
    """
    cutting, own = cell.cutting, _only(stated)
    wide, rounded = cutting.tool_diameter_mm, cutting.corner_radius_mm
    if own is not None:
        for name, value, there in (("tool_diameter_mm", wide, 1e3 * own.diameter),
                                   ("corner_radius_mm", rounded, None if own.corner is None else 1e3 * own.corner)):
            if value is not None and there is not None and abs(value - there) > 1e3 * SAME:
                raise error("CS4716", f"{own.words} has {there:g} mm, cutting.{name} of {Path(str(cell.source)).name} "
                            f"{value:g}", file=own.file, line=own.line, column=own.column, hint="which tool is in the spindle? "
                            "Correct cell.yaml, or let the CAM system write the program for that tool")
        wide = 1e3 * own.diameter if wide is None else wide
        rounded = 1e3 * own.corner if rounded is None and own.corner is not None else rounded
    missing = [f"cutting.{name}" for name, value in (("tool_diameter_mm", wide), ("teeth", cutting.teeth)) if value is None]
    if wide is None or cutting.teeth is None:
        raise error("CS4701", f"the cutter is not known: {' and '.join(missing)} of cell.yaml", file=str(cell.source),
                    hint="state diameter and teeth, and cutting.corner_radius_mm unless it is a flat end mill")
    radius, corner = 0.5e-3 * wide, 1e-3 * (rounded or 0.0)
    if corner > radius * (1 + 1e-9):
        raise error("CS4701", f"cutting.corner_radius_mm is {1e3 * corner:g}, expected at most half the diameter, "
                    f"{1e3 * radius:g}", file=str(cell.source), hint="a ball has just half the diameter")
    return Cutter(radius, cutting.teeth, min(corner, radius),
                  np.inf if cutting.flute_mm is None else 1e-3 * cutting.flute_mm)


def said_of_cutter(cell: Cell, stated: tuple[StatedCutter, ...]) -> list[Finding]:
    """A note (CS4717) of what the program stated of the cutter and cell.yaml did not."""
    own = _only(stated)
    if own is None:
        return []
    taken = ([f"diameter {1e3 * own.diameter:g} mm"] if cell.cutting.tool_diameter_mm is None else []) + (
        [f"corner radius {1e3 * own.corner:g} mm"] if cell.cutting.corner_radius_mm is None and own.corner else [])
    return [Finding("CS4717", "note", f"the cutter's {' and '.join(taken)}: as {own.words} says", own.file, own.line,
                    own.column, hint="state it in cell.yaml to have it checked")] if taken else []


def _only(stated: tuple[StatedCutter, ...]) -> StatedCutter | None:
    """The one cutter of a program. Raises CompstiffError: CS4718, CS4719."""
    for one in stated:
        if one.beyond:
            raise error("CS4718", f"{one.words}: {one.beyond}; forces are worked out for end mills with an upright flank and a "
                        "level floor", file=one.file, line=one.line, column=one.column,
                        hint="log a pass of this program, or let the CAM system write CUTTER/diameter,corner radius")
    if len(stated) > 1:
        raise error("CS4719", f"{stated[1].words} behind {stated[0].words} (line {stated[0].line}): one program, one cutter",
                    file=stated[1].file, line=stated[1].line, column=stated[1].column,
                    hint="let the CAM system write one file a tool; --leaves gives the next one its stock")
    return stated[0] if stated else None

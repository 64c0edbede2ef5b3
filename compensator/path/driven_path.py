"""The moves of a program in the order in which its calls drive them, and where a place on that way is in that of the text."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from compensator.path.external_axes import ExternalAxes
from compensator.path.robot_path import RobotPath, robot_path
from identification.common.arrays import Array

Indices = NDArray[np.intp]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class DrivenPath:
    """path: by the text; run: as driven; order (D,): the targets of the text in that order."""

    path: RobotPath
    run: RobotPath
    order: Indices

    @property
    def ends(self) -> tuple[float, float]:
        """The length [m] as driven, and by the text."""
        return float(np.nanmax(self.run.length)), float(np.nanmax(self.path.length))

    @property
    def first(self) -> Flags:
        """The targets (D,) that are driven for the first time."""
        return np.isin(np.arange(len(self.order)), np.unique(self.order, return_index=True)[1])

    def in_text(self, place: Array) -> tuple[Array, Flags]:
        """Places (M,) [m] along the run by the path length of the text, and whether the target each is nearest to is driven for
        the first time. Where a call leads on, the text has another move to the next target: a place is at the nearer end."""
        known = np.flatnonzero(np.isfinite(self.run.length))
        order, along, length = self.order[known], self.run.length[known], self.path.length
        at = np.clip(place, 0.0, along[-1])
        behind = np.clip(np.searchsorted(along, at), 1, len(order) - 1)
        before = behind - 1
        start, end = order[before], order[behind]
        way = along[behind] - along[before]
        share = (at - along[before]) / np.where(way > 0, way, 1.0)
        nearer = np.where(share > 0.5, behind, before)
        within = length[start] + share * (length[end] - length[start])
        return np.where(end == start + 1, within, length[order[nearer]]), self.first[known[nearer]]


def driven_path(path: RobotPath, order: Indices | None = None) -> DrivenPath | None:
    """The path in the order (D,) of the targets, that of the toolpath where none is named; None where that is the order of the
    text, or cannot be told: no two targets of known place, external axes that stand elsewhere in that order."""
    order = path.toolpath.driven if order is None else order
    if order is None or len(order) < 2:
        return None
    run = robot_path(path.toolpath.taken(order), path.cell)
    if np.isfinite(run.length).sum() < 2 or (np.isfinite(run.length) != np.isfinite(path.length[order])).any():
        return None
    if path.axes.moves and not _axes_stand_alike(run.axes, path.axes, order):
        return None
    return DrivenPath(path, run, order)


def _axes_stand_alike(run: ExternalAxes, text: ExternalAxes, order: Indices) -> bool:
    """Whether the external axes stand at each target (D,) as the order of the text leads to, and where the path begins too."""
    return np.array_equal(run.values, text.values[order], equal_nan=True) and np.array_equal(run.rest, text.rest)

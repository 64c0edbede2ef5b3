"""What is left between the targets of the written program, by the same model: lines and arcs between the written numbers, each
point of the looked-at moves under its own force, measured across the planned curve.

Zones are left out: what they cut off corners is said by corners.py. What the scatter of the log may explain is not counted.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compensator.correction.engagement import LoggedPass, following_the_cut
from compensator.correction.forward import loaded_tool
from compensator.correction.grid_forces import place_of
from compensator.correction.intermediate_targets import LookedAt
from compensator.correction.needed_targets import ENOUGH, SIGMAS, beyond_noise
from compensator.correction.prediction import Prediction
from compensator.path.arc_length import circle, turned_angle
from compensator.path.robot_path import RobotPath
from identification.common.arrays import Array, read_only, rms
from identification.common.findings import Finding, Level, counted
from identification.model.inverse import nearest_angles
from identification.model.rotations import Frame, rotation_matrix, rotation_vector

Indices = NDArray[np.intp]
# Fewer micrometres over the tolerance are its own rounding [m].
ROUNDING = 0.2e-6


@dataclass(frozen=True, eq=False)
class BetweenTargets:
    """left (P,) [m]: how far the loaded tool is off the planned curve between targets, beyond what the log's scatter explains;
    square (P,) [m^2]: what is expected of its square, of which a point may show less than its scatter would make by itself:
    means over many are right; noise (Q,) [m]: 1 sigma of that, of each point; owner (P,): the targets, as given, that these
    moves go to, and piece (P,): of the written program, added ones among them. assumed: the log names targets, and the force
    was taken as straight between them."""

    left: Array
    square: Array
    noise: Array
    owner: Indices
    piece: Indices
    assumed: bool
    findings: tuple[Finding, ...]

    def as_dict(self) -> dict[str, Any]:
        """JSON values, micrometres."""
        return {"moves": len(np.unique(self.owner)), "largest": float(1e6 * self.left.max(initial=0.0)),
                "rms": 1e6 * rms(self.left) if len(self.left) else 0.0,
                "scatter_rms": 1e6 * rms(self.noise) if len(self.noise) else 0.0}

    def line(self) -> str:
        """The same for the terminal."""
        figures = self.as_dict()
        beside = (f"the scatter of the log, {figures['scatter_rms']:.2f} um RMS a point, not counted" if not self.assumed else
                  "the log names targets: the force is taken as straight from one to the next")
        return (f"left between targets, by the same model: largest {figures['largest']:.2f} um, RMS {figures['rms']:.2f} um "
                f"({counted(figures['moves'], 'move')} looked at; {beside})")


def left_between(looked_at: LookedAt, commanded: Frame, logged: LoggedPass) -> BetweenTargets:
    """The points between the targets of a program that commands the poses base_from_tcp (n) at the points `at`. logged: the
    pass the forces are of; with a cutting stiffness they are those of the corrected pass."""
    grid, fine, path = looked_at.grid, looked_at.fine, looked_at.fine.path
    points = fine.targets[grid.further[fine.targets]]
    offsets = None if logged.offsets is None else logged.offsets.some(grid.targets)
    under, prediction = following_the_cut(fine, grid.kept, replace(logged, offsets=offsets))
    target = path.axes.to_rest(commanded, looked_at.at)
    pose = path.axes.to_base(_commanded(looked_at, target, points), points)
    theta = nearest_angles(path.cell.robot, pose @ path.flange_from_tcp[points].inverse(), path.theta[points])
    reached = ~np.isnan(theta).any(axis=1)
    points = points[reached]
    loaded = replace(under.loaded, targets=points)
    rest = loaded_tool(loaded, theta[reached])
    off = _across(rest.position - loaded.goal_position, path, points)
    left = beyond_noise(off, looked_at.noise[points], ENOUGH * fine.settings.correction.tolerance)
    first, beside, steps = _steps(looked_at, prediction)
    noise = looked_at.noise[points]
    square = np.concatenate([np.einsum("ni,ni->n", off, off) - noise**2, steps**2])
    piece = looked_at.number[np.searchsorted(looked_at.at, np.concatenate([points, first + 1]))]
    where, left = np.concatenate([points, beside]), np.concatenate([left, steps])
    owner = grid.owner[where]
    read_only(left, square, owner, piece, noise)
    return BetweenTargets(left, square, noise, owner, piece, fine.forces.named, _findings(looked_at, where, left))


def _across(off: Array, path: RobotPath, points: Indices) -> Array:
    """The part (n, 3) across the planned curve of distances off (n, 3) [m], base frame, at further points, which stand evenly
    on their move: their neighbours show its direction."""
    position = path.rest_from_tcp.position
    along = path.axes.turned_to_base(position[points + 1] - position[points - 1], points)
    along /= np.maximum(np.linalg.norm(along, axis=1), 1e-12)[:, None]
    return np.asarray(off - np.einsum("ni,ni->n", off, along)[:, None] * along)


def _steps(looked_at: LookedAt, prediction: Prediction) -> tuple[Indices, Indices, Array]:
    """The first of two targets (n,) that stand as near to each other as they may, which of both was added, and how far off (n,)
    [m] the tool may be between the two: half of what the deviation jumps there, beyond the scatter. A jump is what neither side
    leads up to; on a line it is taken over two pieces, for it may lie within one."""
    grid, at, count = looked_at.grid, looked_at.at, len(looked_at.grid.owner)
    deviation = np.full((count, 3), np.nan)
    axes = looked_at.fine.path.axes
    deviation[prediction.targets] = axes.turned_to_rest(prediction.position, prediction.targets)
    length = np.maximum(np.diff(place_of(looked_at.fine.path)), 1e-9)[:, None]
    slope = np.diff(deviation, axis=0) / length
    first = at[:-1][(np.diff(at) == 1) & (grid.further[at[:-1]] | grid.further[at[1:]])]
    first = first[(first > 1) & (first < count - 3)]
    beside = np.where(grid.further[first], first, first + 1)
    alone = length[first] * (slope[first] - 0.5 * (slope[first - 1] + slope[first + 1]))
    around = 0.5 * (slope[first - 2] + slope[first + 1])
    two = length[first] * (slope[first] - around) + length[first - 1] * (slope[first - 1] - around)
    jump = np.where(grid.may[beside, None], two, alone)
    jump = axes.turned_to_base(jump, beside)
    size = 0.5 * np.linalg.norm(_across(jump, looked_at.fine.path, beside), axis=1) - SIGMAS * looked_at.noise[beside]
    known = ~np.isnan(size)
    return first[known], beside[known], np.maximum(size[known], 0.0)


def _commanded(looked_at: LookedAt, target: Frame, points: Indices) -> Frame:
    """Where the program commands the tool at points (n,) of the grid, with targets (N) at its points `at`, resting frame."""
    at, place = looked_at.at, place_of(looked_at.fine.path)
    start = np.clip(np.searchsorted(at, points, side="right") - 1, 0, len(at) - 2)
    share = (place[points] - place[at[start]]) / np.maximum(place[at[start + 1]] - place[at[start]], 1e-12)
    position = target.position[start] + share[:, None] * (target.position[start + 1] - target.position[start])
    begin, turned, end = start.copy(), share.copy(), start + 1
    if len(looked_at.arcs):
        arcs = looked_at.arcs[np.argsort(looked_at.arcs[:, 0])]
        via = np.searchsorted(at, arcs.sum(axis=1))
        straight, centre, axis = circle(*(target.position[via + k] for k in (-1, 0, 1)))
        arc = np.clip(np.searchsorted(arcs[:, 0], points, side="right") - 1, 0, len(arcs) - 1)
        inside = (points >= arcs[arc, 0]) & (points <= arcs[arc, 0] + 2 * arcs[arc, 1])
        begin[inside], end[inside] = via[arc[inside]] - 1, via[arc[inside]] + 1
        turned[inside] = ((place[points] - place[at[begin]]) / (place[at[end]] - place[at[begin]]))[inside]
        round_ = np.flatnonzero(inside & ~straight[arc])
        of = arc[round_]
        first, last = (target.position[start[round_] + k] - centre[of] for k in (0, 1))
        angle = (share[round_] * turned_angle(axis[of], first, last))[:, None]
        position[round_] = centre[of] + np.einsum("nij,nj->ni", rotation_matrix(angle * axis[of]), first)
    change = rotation_vector(target.rotation[end] @ np.swapaxes(target.rotation[begin], 1, 2))
    return Frame(rotation_matrix(turned[:, None] * change) @ target.rotation[begin], position)


def _findings(looked_at: LookedAt, points: Indices, left: Array) -> tuple[Finding, ...]:
    """CS3091, CS3092: where the tolerance is not kept between the targets, and why."""
    settings, grid, path = looked_at.fine.settings.correction, looked_at.grid, looked_at.fine.path
    over = left > settings.tolerance + ROUNDING
    beside = grid.beside_zone[points]
    spacing = f"{1e3 * settings.min_spacing.length:g} mm or {1e3 * settings.min_spacing.time:g} ms (--min-spacing)"
    near = grid.may[points] | grid.divisible[points] | grid.crowded[points]
    reasons: tuple[tuple[NDArray[np.bool_], str, Level, str, str], ...] = (
        (over & beside, "CS3092", "warning", "the zone of a corner leaves no room for a target",
         "--tighten-zones makes zones smaller that cut corners in the cut"),
        (over & ~beside & near, "CS3091", "note", f"the force changes within {spacing}, or a correction is held back",
         "the entry into and the exit from a cut are such places"),
        (over & ~beside & ~near, "CS3091", "warning", "no target can be added to the move" if not settings.keep_targets else
         "no target is added (--keep-targets)", "without --keep-targets, moves that follow each other directly are refined" if
         settings.keep_targets else "targets are added to moves that stand one a line behind the move before them, and to a "
         "loop of one MoveL to aPath{i} with a zone, not to the first move of a routine: let the approach stand in the routine "
         "of the cut, and the post write other loops so"))
    findings = []
    for mask, code, level, why, hint in reasons:
        if mask.any():
            worst = points[mask][np.argmax(left[mask])]
            moves = counted(len(np.unique(grid.owner[points[mask]])), "move")
            findings.append(path.finding(
                int(worst), code, level, f"between targets the tool stays up to {1e6 * left[mask].max():.1f} um off the plan "
                f"in {moves}, more than the tolerance of {1e6 * settings.tolerance:g} um: {why}", hint))
    return tuple(findings)

"""Where along the program each measured point was cut: the nearest place of the cutting moves, where there is but one.

Points may be those of the tool's path (a tracker at the spindle), or of the surface: then the tool stood beside them by its
radius, along the normal. A second place that is as near, and elsewhere on the path, makes it ambiguous: which of both cut the
surface is not guessed.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from compensator.correction.predict import Predicted
from compensator.learning.measured_points import MeasuredPoints, left_out
from compensator.learning.misread_points import misread
from compensator.path.arc_length import polyline
from identification.common.added_targets import read_added
from identification.common.arrays import Array
from identification.common.findings import CompstiffError, Finding, counted, error
from identification.model.rotations import Frame

Indices = NDArray[np.intp]
# The path is looked at in pieces of this [m]; a place is as near as another within MARGIN [m], and elsewhere when the path
# between is longer than this many distances and ELSEWHERE [m].
STEP, MARGIN, DISTANCES, ELSEWHERE = 0.25e-3, 0.5e-3, 4.0, 5e-3
MOST_STEPS = 2_000_000
# A larger share of points off the path or ambiguous: it is another program, another frame, or it needs the column target.
MOST_LOST = 0.3
# So many points that stand beside the path by more than this [m], along their normals, by the same in the middle.
FEWEST_BESIDE, BESIDE = 10, 3e-4
CHUNK = 2000


@dataclass(frozen=True, eq=False)
class PathPlaces:
    """Points that have a place on the cutting path: rows (K,) of the points; before, after (K,) the targets with force that the
    place lies between, as rows of the prediction, share (K,) of the way; length (K,) [m] along the path, time (K,) [s] of the
    job at the programmed feed."""

    rows: Indices
    before: Indices
    after: Indices
    share: Array
    length: Array
    time: Array
    findings: tuple[Finding, ...]


def place_points(points: MeasuredPoints, predicted: Predicted, radius: float, within: float) -> PathPlaces:
    """radius [m]: of the tool, where the points are of the surface; 0: the points are where the tool's centre point was
    planned. within [m]: how far a point may be from the path then.

    Raises CompstiffError: CS5303 too many points too far from the cut, ambiguous, or without force, or on it if
    they are read otherwise (misread_points.py); CS5304 a radius without
    normals, or several work objects; CS3004 a target beyond the program.
    """
    path = predicted.path
    sought = _sought(points, radius)
    _one_work_object(predicted)
    position, along = _cut(predicted)
    if not len(position):
        raise error("CS5303", "no two targets of the program that follow each other have force: there is no cut to learn from",
                    file=points.source, hint="is it the log of this program, and the tare right?")
    otherwise = misread(points, radius, within, position, _frames(predicted)) if (points.target < 0).all() else ""
    distance, place, ambiguous = _nearest(sought, position, along)
    named, numbered = points.target >= 0, tuple[Finding, ...]()
    if named.any():
        length_of, numbered = _numbered(points, named, sought, (position, along), predicted)
        beyond = points.target >= len(length_of)
        if beyond.any():
            row = int(np.argmax(beyond))
            raise error("CS3004", f"target {points.target[row]}, the program has {len(length_of)}", file=points.source,
                        line=int(points.line[row]))
        place = np.where(named, length_of[np.maximum(points.target, 0)], place)
        ambiguous &= ~named
    far = ~named & ~(distance <= within)
    before, after, share, inside = _between(predicted, place)
    without = ~far & ~ambiguous & ~inside
    lost = far | ambiguous | without
    findings = [
        *numbered,
        *_beside(points, sought, place, cut=(position, along), used=~far, radius=radius),
        *left_out(points, far, "CS5305", f"more than {1e3 * within:g} mm from the cutting path (the farthest "
                  f"{1e3 * float(np.nanmax(np.where(far, distance, 0.0))):.3g} mm)",
                  "points on the surface need --tool-radius-mm and normals; else --within-mm"),
        *left_out(points, ~far & ambiguous, "CS5306", "near two places of the path alike, so that which one cut is not known",
                  "name the target in a column target"),
        *left_out(points, without, "CS5307", "cut where the log shows no force", "leave points of the entry out"),
    ]
    kept = np.flatnonzero(~lost)
    if otherwise or lost.sum() > MOST_LOST * len(points) or not len(kept):
        stopped = error("CS5303", f"only {counted(len(kept), 'point')} of {len(points)} have a place of their own on the "
                        "cutting path", file=points.source,
                        hint=(f"nearly all would, read {otherwise}: " if otherwise else "is it the part of this program? ")
                        + "x_mm y_mm z_mm, and normals, are in its work object, in millimetres")
        raise CompstiffError(*stopped.findings, *findings)
    order = kept[np.argsort(place[kept], kind="stable")]
    time = np.cumsum(np.nan_to_num(path.move_time, posinf=0.0))
    targets = predicted.targets
    when = (1 - share[order]) * time[targets[before[order]]] + share[order] * time[targets[after[order]]]
    return PathPlaces(order, before[order], after[order], share[order], place[order], when, tuple(findings))


def _frames(predicted: Predicted) -> dict[str, Frame]:
    """The frames in which points may be given by mistake, as the work object stands in them."""
    base = _resting_object(predicted)
    return {"in the robot's base frame": base, "in the world": predicted.cell.world_from_base @ base}


def _beside(
    points: MeasuredPoints, sought: Array, place: Array, cut: tuple[Array, Array], used: NDArray[np.bool_], radius: float
) -> list[Finding]:
    """A warning (CS5327) where the points stand beside the path by the same all along their normals: the tool's radius, or the
    probe's, is not taken off, or is a diameter. sought (N, 3) [m], place (N,) [m] along the path."""
    known = used & ~np.isnan(points.normal).any(axis=1) & np.isfinite(place)
    if known.sum() < FEWEST_BESIDE:
        return []
    at = np.column_stack([np.interp(place[known], cut[1], axis) for axis in cut[0].T])
    off = np.einsum("ni,ni->n", at - sought[known], points.normal[known])
    middle = float(np.median(off))
    scatter = float(np.median(np.abs(off - middle)))
    if abs(middle) < BESIDE or scatter > 0.2 * abs(middle):
        return []
    fits = radius + middle
    hint = ("--tool-radius-mm is the radius of the cutter; the probe's own must be taken off the points. "
            f"{1e3 * fits:.3g} mm would fit" if fits > 0 else "do nx ny nz point out of the material, towards the tool?")
    return [Finding("CS5327", "warning", f"with a tool radius of {1e3 * radius:g} mm the points stand "
                    f"{1e3 * abs(middle):.3g} mm {'short of' if middle > 0 else 'beyond'} where the tool went, along their "
                    "normals, in the middle", file=points.source, hint=hint)]


def _numbered(
    points: MeasuredPoints, named: NDArray[np.bool_], sought: Array, cut: tuple[Array, Array], predicted: Predicted
) -> tuple[Array, tuple[Finding, ...]]:
    """Path lengths [m] by target number: those of the program given (N,), or, where the points stand nearer to these, those of
    the corrected program (W,), which has the targets too that were added. cut: positions and lengths of `_cut`."""
    given, file = predicted.path.length, predicted.settings.correction.logged_with
    added = read_added(file) if file else None
    if added is None or len(added.number) != len(given):
        return given, ()
    written, (position, along) = added.place(given), cut

    def off(lengths: Array) -> float:
        at = lengths[np.minimum(points.target[named], len(lengths) - 1)]
        stands = np.column_stack([np.interp(at, along, axis) for axis in position.T])
        return float(np.median(np.linalg.norm(stands - sought[named], axis=1)))

    if points.target.max() < len(given) and off(given) <= off(written):
        return given, ()
    return written, (Finding("CS5326", "note", f"the points name targets of the corrected program, which has "
                             f"{len(written) - len(given)} more (column added of {Path(added.source).name})",
                             file=points.source),)


def _sought(points: MeasuredPoints, radius: float) -> Array:
    """Where the tool's centre point was planned to be (N, 3) [m] when each point was cut."""
    if not radius:
        return points.position
    if np.isnan(points.normal).any():
        raise error("CS5304", "a tool radius says how far beside the surface the path is, and no normal on which side",
                    file=points.source, hint="give nx ny nz, out of the material")
    return np.asarray(points.position + radius * points.normal)


def _one_work_object(predicted: Predicted) -> None:
    toolpath, targets = predicted.path.toolpath, predicted.targets
    if len(np.unique(toolpath.workobject[targets])) > 1:
        raise error("CS5304", "cuts in several work objects, and the points do not say which is theirs", file=toolpath.source,
                    hint="learn from a program with one")


def _cut(predicted: Predicted) -> tuple[Array, Array]:
    """The cutting moves, those between two neighbours with force, in small steps: positions (k, 3) [m] in the work object and
    path lengths (k,) [m]."""
    path = predicted.path
    points, length = polyline(path.world_position, path.toolpath.move)
    points = _resting_object(predicted).inverse().apply(path.axes.world_from_base.inverse().apply(points))
    total = float(length[-1]) if len(length) else 0.0
    step = max(STEP, total / MOST_STEPS)
    at = np.arange(0.0, total, step)
    _, _, _, inside = _between(predicted, at)
    at = at[inside]
    return np.column_stack([np.interp(at, length, axis) for axis in points.T]), at


def _resting_object(predicted: Predicted) -> Frame:
    """Where the work object that is cut in stands in the resting base, in which the path is given as a whole: joint moves and
    moves in other work objects are on it, too."""
    path, target = predicted.path, int(predicted.targets[0])
    object_from_tcp = path.base_from_object[target].inverse() @ path.base_from_tcp[target]
    return path.rest_from_tcp[target] @ object_from_tcp.inverse()


def _between(predicted: Predicted, place: Array) -> tuple[Indices, Indices, Array, NDArray[np.bool_]]:
    """Of path lengths (n,) [m], none on a path of fewer than two known targets: rows of the prediction before and after, share
    of the way, and whether both have force. A place at a target is on the move to it or, where that has no force, on the next:
    the cut begins there."""
    to, onward = _on_moves(predicted, place, "left"), _on_moves(predicted, place, "right")
    before, after, share, inside = (np.where(to[3], one, other) for one, other in zip(to, onward, strict=True))
    return before, after, share, inside


def _on_moves(
    predicted: Predicted, place: Array, side: Literal["left", "right"]
) -> tuple[Indices, Indices, Array, NDArray[np.bool_]]:
    """The same, a place at a target on the move to it (left) or from it."""
    length, targets = predicted.path.length, predicted.targets
    known = np.flatnonzero(~np.isnan(length))
    row = np.full(len(length), -1)
    row[targets] = np.arange(len(targets))
    upper = np.clip(np.searchsorted(length[known], place, side=side), 1, max(len(known) - 1, 1))
    first, last = known[upper - 1], known[upper]
    run = length[last] - length[first]
    with np.errstate(invalid="ignore", divide="ignore"):
        share = np.where(run > 0, (place - length[first]) / run, 0.0)
    inside = (row[first] >= 0) & (row[last] >= 0) & np.isfinite(place)
    return np.maximum(row[first], 0), np.maximum(row[last], 0), np.clip(np.nan_to_num(share), 0.0, 1.0), inside


def _nearest(sought: Array, position: Array, along: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Distance (N,) [m] to the nearest step of the cut, its path length (N,) [m], and whether another place is as near."""
    from scipy.spatial import cKDTree

    tree = cKDTree(position)
    distance, nearest = map(np.asarray, tree.query(sought))
    ambiguous = np.zeros(len(sought), dtype=bool)
    for first in range(0, len(sought), CHUNK):
        part = slice(first, first + CHUNK)
        beside = tree.query_ball_point(sought[part], np.minimum(distance[part], 0.1) + MARGIN)
        count = np.array([len(each) for each in beside])
        owner = np.repeat(np.arange(len(count)), count)
        other = np.concatenate([np.asarray(each, dtype=np.intp) for each in beside])
        apart = np.abs(along[other] - along[nearest[part]][owner])
        elsewhere = apart > DISTANCES * distance[part][owner] + ELSEWHERE
        ambiguous[part] = np.bincount(owner[elsewhere], minlength=len(count)) > 0
    return distance, along[nearest], ambiguous

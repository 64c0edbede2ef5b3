"""What fly-by zones cut off: a corner becomes a parabola from the edge of the zone, and the programmed point is never reached.

With the zone's radius r, at most half the way to either neighbour, and the turn a of the direction, the path passes the corner
at

    miss = (r / 2) sin(a / 2) .

The correction moves the whole corner; what the zone cuts off stays. (ABB, zonedata: fly-by points and corner paths.)
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from compensator.correction.predict import Predicted
from compensator.path.arc_length import FARTHEST, circle
from compensator.path.robot_path import RobotPath
from compensator.rapid import move_text, read_rapid
from compensator.rapid import with_zones as with_radii
from compensator.toolpath import Move, Toolpath
from identification.common.findings import Finding, counted, verb

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
# A zone smaller than this is not worth a stop-and-go [m]; what it misses then is reported.
SMALLEST = 0.01e-3
# sin(a / 2) of a turn that is sharp: chords of a rolled corner turn by less.
SHARP = float(np.sin(np.radians(45.0) / 2))


def corner_misses(toolpath: Toolpath, position: Array) -> tuple[Array, Array]:
    """How far the path passes each target (N,) [m], 0 at stop points, and sin(a / 2) (N,) of its turn.

    position (N, 3) [m] of the targets in one frame. Joint moves, targets of unknown position or zone, those beside a move of no
    length, and the program's ends have 0.
    """
    count = len(toolpath)
    miss, half_sine = np.zeros(count), np.zeros(count)
    known = np.flatnonzero((np.abs(position) < FARTHEST).all(axis=1))
    if len(known) < 3:
        return miss, half_sine
    arriving, leaving, before = _directions(toolpath.move[known], position[known])
    here = known[1:-1]
    cosine = np.clip(np.einsum("ni,ni->n", arriving[:-1], leaving[1:]), -1.0, 1.0)
    # A move of no length has no direction to turn from.
    half_sine[here] = np.where((before[:-1] > 0) & (before[1:] > 0), np.sqrt(np.maximum(0.5 * (1 - cosine), 0.0)), 0.0)
    linear = np.isin(toolpath.move[known], (Move.LINEAR, Move.ARC_END, Move.ARC_VIA))
    both = linear[1:-1] & linear[2:] & (toolpath.move[here] != Move.ARC_VIA)
    radius = np.minimum(np.nan_to_num(toolpath.zone[here]), 0.5 * np.minimum(before[:-1], before[1:]))
    miss[here] = np.where(both, 0.5 * radius * half_sine[here], 0.0)
    return miss, half_sine


def _directions(move: NDArray[np.uint8], points: Array) -> tuple[Array, Array, Array]:
    """Unit directions (K - 1, 3) in which each move arrives and leaves, and its length (K - 1,), of K targets; tangents of
    arcs."""
    chord = np.diff(points, axis=0)
    length = np.linalg.norm(chord, axis=1)
    unit = chord / np.maximum(length, 1e-300)[:, None]
    arriving, leaving = unit.copy(), unit.copy()
    via = np.flatnonzero((move[1:-1] == Move.ARC_VIA) & (move[2:] == Move.ARC_END)) + 1
    if len(via):
        straight, centre, axis = circle(points[via - 1], points[via], points[via + 1])
        for shift, moves in ((-1, via - 1), (0, via)):
            for values, at_point in ((leaving, via + shift), (arriving, via + shift + 1)):
                tangent = np.cross(axis, points[at_point] - centre)
                tangent /= np.maximum(np.linalg.norm(tangent, axis=1), 1e-300)[:, None]
                values[moves] = np.where(straight[:, None], values[moves], tangent)
    return arriving, leaving, length


def sharp_corners(path: RobotPath, targets: Indices) -> Indices:
    """Places (C,) among the targets (M,) with force, ascending, at which straight moves turn sharply between two with force."""
    _, half_sine = corner_misses(path.toolpath, path.world_position)
    straight = path.toolpath.move == Move.LINEAR
    sharp = (half_sine > SHARP) & straight & np.append(straight[1:], False)
    return np.flatnonzero(sharp[targets] & np.isin(targets, _in_the_cut(targets)))


def _in_the_cut(targets: Indices) -> Indices:
    """Those of the targets (M,) with force, ascending, between two with force: lead-in and lead-out may be round."""
    return np.asarray(targets[1:-1][(np.diff(targets)[:-1] == 1) & (np.diff(targets)[1:] == 1)])


def with_zones(predicted: Predicted) -> tuple[Predicted, tuple[Finding, ...]]:
    """The program with smaller zones in the cut where the settings ask for them, and a finding where zones cut more than the
    tolerance off the corners there (CS4320, CS4321, CS4322)."""
    settings = predicted.settings.correction
    findings: list[Finding] = []
    if settings.tighten_zones:
        content, findings = _tightened(predicted, settings.tolerance)
        text = read_rapid(content, predicted.program.text.source.name)
        path = replace(predicted.path, toolpath=text.toolpath)
        predicted = replace(predicted, program=replace(predicted.program, text=text),
                            loaded=replace(predicted.loaded, path=path))
    return predicted, (*findings, *_cut_off(predicted, settings.tolerance, tightened=settings.tighten_zones))


def _cut_off(predicted: Predicted, tolerance: float, *, tightened: bool) -> list[Finding]:
    """A finding (CS4320) where zones in the cut cut more than the tolerance [m]; tightened: by what remains."""
    path = predicted.path
    miss, _ = corner_misses(path.toolpath, path.world_position)
    inside = _in_the_cut(predicted.targets)
    over = inside[miss[inside] > 1.001 * tolerance]
    if not len(over):
        return []
    worst = int(over[np.argmax(miss[over])])
    return [path.finding(worst, "CS4320", "warning", f"the zone cuts the corner at {counted(len(over), 'target')} in the cut "
                         f"by more than {1e6 * tolerance:g} um, by {1e6 * miss[worst]:.0f} um at most; no correction reaches a "
                         "fly-by point",
                         "smaller zones there cannot be written" if tightened else "--tighten-zones makes the zones smaller "
                         "there")]


def _tightened(predicted: Predicted, tolerance: float) -> tuple[bytes, list[Finding]]:
    """The text with zones in the cut that cut no more than the tolerance [m] off, and what was done (CS4321, CS4322)."""
    path, text, move = predicted.path, predicted.program.text, predicted.path.toolpath.move
    miss, half_sine = corner_misses(path.toolpath, path.world_position)
    inside = _in_the_cut(predicted.targets)
    over = inside[miss[inside] > tolerance]
    possible = [int(i) for i in over if (there := move_text(text, int(i) - int(move[i] == Move.ARC_END))) is not None
                and there.tail_end == there.end - 1]        # a move that sets an output takes no \\Z
    findings = []
    if len(possible) < len(over):
        left = [int(i) for i in over if int(i) not in set(possible)]
        findings.append(path.finding(left[0], "CS4322", "warning", f"{counted(len(left), 'zone')} that "
                                                                   f"{verb(len(left), 'cut')} corners cannot be made smaller "
                                     "here"))
    if not possible:
        return text.source.data, findings
    # In whole micrometres, as they are written.
    radius = 1e-6 * np.floor(1e6 * np.maximum(2 * tolerance / half_sine[possible], SMALLEST) + 1e-6)
    findings.append(path.finding(possible[0], "CS4321", "note", f"{counted(len(possible), 'zone', 'were')} made smaller, to "
                                 f"{1e3 * radius.min():.3f} ... {1e3 * radius.max():.3f} mm, so that they cut at most "
                                 f"{5e5 * np.max(radius * half_sine[possible]):.2g} um off the corner"))
    return with_radii(text, possible, np.round(1e3 * radius, 3).tolist()), findings

"""Targets of a cut on which no sample of the log lies: a few between two with force take what lies between those, more stay
and are said; so is a stretch between targets that the log leaves out."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

from compensator.forces.detection import GAP
from compensator.forces.log import ForceLog
from compensator.forces.program_time import moves_in_air
from compensator.forces.target_forces import TargetForces, at_target, listed
from compensator.path.robot_path import RobotPath
from identification.common.arrays import Array
from identification.common.findings import Finding, Level, counted, verb

Indices = NDArray[np.intp]
Mask = NDArray[np.bool_]
# A stretch without a sample is no longer than this share of the cut it lies in.
SHARE = 0.25
# A log leaves a stretch of a move out where no sample lies on so much of it [m], so many times the usual way between two.
LEFT_OUT, TIMES = 5e-3, 20.0
# A feed is for cutting where this share of the logged targets that are reached at it has a force.
CUTS = 0.5
# A median of absolute values of a normal distribution, in sigmas.
MEDIAN = 0.6745


def without_sample_in_cut(path: RobotPath, samples: Indices, forced: Mask) -> Mask:
    """The targets (N,) in the cut without a sample and without a force, on from one with force or up to one."""
    empty = (samples == 0) & ~forced
    run = np.cumsum(np.diff(empty, prepend=empty[:1]))
    beside = np.unique(np.concatenate([run[1:][empty[1:] & forced[:-1]], run[:-1][empty[:-1] & forced[1:]]]))
    return np.asarray(empty & np.isin(run, beside) & ~moves_in_air(path.toolpath))


def left_out(path: RobotPath, place: Array) -> tuple[Indices, Array]:
    """The targets (k,) at the cutting feed on the way to which the log, of samples at places (M,) [m], leaves a stretch out
    between two samples, and how much (k,) [m] of that move."""
    length, cutting = path.length, np.flatnonzero(~moves_in_air(path.toolpath))
    cutting = cutting[cutting > 0]
    cutting = cutting[np.isfinite(length[cutting]) & np.isfinite(length[cutting - 1])]
    place = np.sort(place[np.isfinite(place)])
    start, way = place[:-1], np.diff(place)
    usual = np.median(way[way > 0]) if (way > 0).any() else 0.0
    wide = way > max(LEFT_OUT, TIMES * usual)
    start, end = start[wide], start[wide] + way[wide]
    lost = np.array([np.maximum(np.minimum(end, length[to]) - np.maximum(start, length[to - 1]), 0.0).max(initial=0.0)
                     for to in cutting.tolist()])
    found = lost > LEFT_OUT
    return cutting[found], lost[found]


def short_gaps(path: RobotPath, samples: Indices, forced: Mask, held: Indices) -> list[tuple[int, int]]:
    """The targets with force before and behind each short gap of a cut: up to GAP targets without a sample, reached at the
    cutting feed, over no more than a quarter of the cut. held (k,): targets whose samples stood still, of which no gap is."""
    length, cutting, standing = path.length, ~moves_in_air(path.toolpath), np.isin(np.arange(len(samples)), held)
    gaps = [(int(first), int(last)) for first, last in itertools.pairwise(np.flatnonzero(forced & (samples > 0)))
            if 1 < last - first <= GAP + 1 and cutting[first + 1:last + 1].all() and not samples[first + 1:last].any()
            and not standing[first + 1:last].any() and np.isfinite(length[first:last + 1]).all()]
    of_cut = forced.copy()
    for first, last in gaps:
        of_cut[first:last] = True
    run, found = np.cumsum(np.diff(of_cut, prepend=of_cut[:1])), []
    for first, last in gaps:
        cut = length[np.flatnonzero((run == run[first]) & np.isfinite(length))]
        if 0 < length[last] - length[first] <= SHARE * (cut[-1] - cut[0]):
            found.append((first, last))
    return found


def filled(path: RobotPath, wrench: Array, standard_error: Array, known: Mask, gaps: list[tuple[int, int]]) -> Indices:
    """Puts into wrench (N, 6) and standard_error (N, 3) what lies between both sides of each gap, by path length, and says of
    which targets (n,) that is. known (N,): targets with samples and force.

    The standard error holds that of both sides, a step that may lie anywhere between (a force v between b and a is either, of
    variance (v - b)(a - v)), and by how much targets are off what lies between others as far away.
    """
    inside = [np.arange(first + 1, last) for first, last in gaps]
    for (first, last), here in zip(gaps, inside, strict=True):
        share = ((path.length[here] - path.length[first]) / (path.length[last] - path.length[first]))[:, None]
        wrench[here] = (1 - share) * wrench[first] + share * wrench[last]
        step = share * (1 - share) * (wrench[last, :3] - wrench[first, :3]) ** 2
        ends = np.nan_to_num((1 - share) * standard_error[first] + share * standard_error[last])
        standard_error[here] = np.sqrt(ends**2 + step + _off_between(wrench[:, :3], known, (last - first + 1) // 2) ** 2)
    return np.concatenate(inside) if inside else np.empty(0, dtype=np.intp)


def _off_between(force: Array, known: Mask, away: int) -> Array:
    """1 sigma (3,) [N] of how far the forces of targets are off the middle of those so many targets before and behind them."""
    inside = known[2 * away:] & known[away:-away] & known[:-2 * away]
    off = force[away:-away] - 0.5 * (force[2 * away:] + force[:-2 * away])
    return np.asarray(np.median(np.abs(off[inside]), axis=0) / MEDIAN) if inside.any() else np.zeros(3)


def said_of_gaps(log: ForceLog, path: RobotPath, forces: TargetForces, between: Indices) -> list[Finding]:
    """Targets without a sample: those in short gaps of a cut, which are `between` (n,) others, and those that stay where they
    are, which in the cut leaves a step."""
    empty = forces.samples == 0
    inside = np.flatnonzero(without_sample_in_cut(path, forces.samples, forces.forced))
    level: Level = "warning" if 2 * empty.sum() > len(empty) else "note"
    at_feed = ~moves_in_air(path.toolpath)
    # A cut that is not in the log: where what the log has at the cutting feed has forces, that feed is for cutting.
    missed = empty & at_feed
    missed[between], missed[inside] = False, False
    if log.predicted is not None or forces.forced[at_feed & ~empty].sum() < CUTS * (at_feed & ~empty).sum():
        missed[:] = False
    findings = []
    if empty.sum() > len(between):
        alone = "" if not missed.any() else (f", {int(missed.sum())} of them reached at the cutting feed, from line "
                                             f"{path.toolpath.line[missed].min()} on")
        hint = ("was a cut added to the program since, or does the log end before it?" if missed.any()
                else "is it the log of this program?" if level == "warning" else "")
        findings.append(Finding(
            "CS3011", "warning" if missed.any() else level, f"{int(empty.sum()) - len(between)} of "
            f"{counted(len(empty), 'target')} got no sample: left where planned{alone}",
            file=log.source, hint=hint))
    if len(between):
        findings.append(Finding(
            "CS3014", level, f"{counted(len(between), 'target')} of the cut without a sample {verb(len(between), 'take')} what "
            f"lies between the forces on either side: {listed(between)}", **at_target(path, int(between[0])),
            hint="log at a higher rate; what may lie between is in their sigma"))
    if len(inside):
        findings.append(Finding(
            "CS3012", "warning", f"{counted(len(inside), 'target')} of the cut without a sample, beside targets with force: "
            f"left where planned, with a step in the surface at either end: {listed(inside)}",
            **at_target(path, int(inside[0])), hint="log at a higher rate, or check that the log covers the whole cut"))
    return findings


def said_of_left_out(log: ForceLog, path: RobotPath, forces: TargetForces, on: NDArray[np.bool_]) -> list[Finding]:
    """Stretches of a cut without a sample between two targets that have some. on (M,): the log's rows on the path."""
    if log.key != "path_mm" or log.spread is not None or log.predicted is not None or path.toolpath.driven is not None:
        return []
    to, lost = left_out(path, log.place[on])
    known = (forces.samples[to] > 0) & (forces.samples[to - 1] > 0) & (forces.forced[to] | forces.forced[to - 1])
    if not known.any():
        return []
    to, lost = to[known], lost[known]
    worst = int(np.argmax(lost))
    more = f", and less of {len(to) - 1} more" if len(to) > 1 else ""
    return [Finding("CS3134", "warning", f"the log leaves out {1e3 * lost[worst]:.0f} mm of the move to this target, in the "
                    f"cut{more}: there the force is taken to lie between those on either side",
                    **at_target(path, int(to[worst])),
                    hint="log the pass again where that matters: what the force did there is in no sigma")]


def said_of_held(left: Indices, path: RobotPath) -> list[Finding]:
    """The targets whose samples stood still and that have no others, and so no correction."""
    if not len(left):
        return []
    return [Finding("CS3070", "warning", f"{counted(len(left), 'target')} left where planned, since the log stood still there: "
                    f"{listed(left)}", **at_target(path, int(left[0])),
                    hint="log the pass again; what stands in the log there is no force")]

"""Was the logged pass driven as it is said, with these offsets or with none? Logged positions are where the program sent the
tool, so that they stand off the planned path by the offsets of the pass, which are the deflection turned round."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from compensator.correction.predict import Predicted
from compensator.path.arc_length import nearest_target
from compensator.toolpath import Move
from identification.common.arrays import directions, rms
from identification.common.findings import Finding, counted

Array = NDArray[np.float64]
# So many targets, and so large a deflection across the path [m, RMS], say whether a pass had the offsets; so many say that what
# is left is another version of the program.
FEWEST, LEAST, FEWEST_OF_VERSION = 12, 3e-5, 40
# The positions stand off as the deflection does where it explains this share of their square, and they are so many times of it;
# not as the offsets of --logged-with where they are under this share of them (engineering judgement).
EXPLAINS, TIMES, HARDLY = 0.5, (0.7, 1.4), 0.3
# What is left stands off by the same everywhere where its middle is as large [m]: corners cut and lag cancel in it.
BESIDE = 1.5e-4
# So does a stretch, where the middles of so many targets that follow each other are as large [m], over this share of all.
IN_A_ROW, STRETCH, SHARE = 15, 2.5e-4, 0.12
# Of a single straight move of so many metres, or half an arc of so many, it says so where the middle of the samples on so much
# of its middle stands aside by so much [m] and this share of the deflection more than up to so many times the deflection
# explains, as that of a corrected pass does, and its zones end before that.
LONG, LONG_ARC, MIDDLE, FAR, SAMPLES = 0.02, 0.01, 0.6, 1e-3, 20
OTHERWISE, UP_TO = 0.25, 1.5


def said_of_positions(planned: Predicted, offsets: Array | None) -> tuple[Finding, ...]:
    """Warnings (CS3075, CS3076, CS3120). offsets (N, 3) [m], base frame, that the pass is said to have had; None: none.
    Where all of the log lies beside the path (CS3120 of its placing) only that it stands there as a corrected pass does is said
    too."""
    found = _judged(planned, offsets)
    if offsets is None and any(finding.code == "CS3120" for finding in planned.findings):
        return tuple(finding for finding in found if finding.code == "CS3075")
    return found or (_beside_long_moves(planned) if offsets is None else ())


def _beside_long_moves(planned: Predicted) -> tuple[Finding, ...]:
    """Long moves that were changed since the log was taken (CS3120): a program may have a dozen, and few targets."""
    log, path, targets = planned.forces.log, planned.path, planned.targets
    toolpath = path.toolpath
    if log.beside is None or path.axes.driven or toolpath.driven is not None or toolpath.ways:
        return ()
    position, length = path.base_from_tcp.position, path.length
    yields = np.zeros((len(length), 3))
    yields[targets] = planned.prediction.position
    to = np.intersect1d(targets, targets + 1)
    way, margin = length[to] - length[to - 1], 0.5 * (1 - MIDDLE)
    zones = np.maximum(toolpath.zone[to - 1], toolpath.zone[to])
    straight, arc = toolpath.move[to] == Move.LINEAR, np.isin(toolpath.move[to], (Move.ARC_VIA, Move.ARC_END))
    chosen = ((straight & (way >= LONG)) | (arc & (way >= LONG_ARC))) & (zones <= margin * way)
    to, margin = to[chosen], margin * way[chosen]
    placed = np.flatnonzero(np.isfinite(log.place) & np.isfinite(log.beside).all(axis=1))
    placed = placed[np.argsort(log.place[placed], kind="stable")]
    beside = path.axes.world_from_base.inverse().turn(log.beside[placed])
    first = np.searchsorted(log.place[placed], length[to - 1] + margin, side="right")
    last = np.searchsorted(log.place[placed], length[to] - margin)
    along, found = directions(position[to] - position[to - 1]), []
    for k in np.flatnonzero(last - first >= SAMPLES).tolist():
        middle = np.median(beside[first[k]:last[k]], axis=0)
        aside = middle - (middle @ along[k]) * along[k]
        if _left_of(aside, yields[to[k] - 1:to[k] + 1]) > FAR:
            found.append((int(to[k]), aside))
    if not found:
        return ()
    worst, aside = max(found, key=lambda one: float(np.linalg.norm(one[1])))
    axes = ", ".join(f"{1e3 * axis:+.2f}" for axis in aside)
    return (path.finding(
        worst, "CS3120", "warning", f"the samples of {counted(len(found), 'long move')} lie beside the path, here most, by "
        f"{1e3 * np.linalg.norm(aside):.2g} mm ({axes} mm, base frame)",
        "was this part of the program changed since the log was taken? Log the program as it is"),)


def _left_of(aside: Array, yields: Array) -> float:
    """How far (3,) [m] is from what a corrected pass stands off its plan, whose tool yields by (2, 3) [m] at both ends."""
    of_pass = [*yields, yields.mean(axis=0)]
    return min(float(np.linalg.norm(aside - np.clip(aside @ one / max(one @ one, 1e-30), -UP_TO, UP_TO) * one)
                     - OTHERWISE * np.linalg.norm(one)) for one in of_pass)


def _judged(planned: Predicted, offsets: Array | None) -> tuple[Finding, ...]:
    log, path, targets = planned.forces.log, planned.path, planned.targets
    if log.beside is None or path.axes.driven or len(targets) < FEWEST:
        return ()
    placed = np.isfinite(log.place) & np.isfinite(log.beside).all(axis=1)
    target = nearest_target(path.length, log.place[placed])
    count: NDArray[np.intp] = np.bincount(target, minlength=len(path.toolpath)).astype(np.intp)
    total = np.column_stack([np.bincount(target, axis, len(count)) for axis in log.beside[placed].T])
    beside = path.axes.world_from_base.inverse().turn(total / np.maximum(count, 1)[:, None])
    # What lies along the path does not show: a sample is placed at the nearest point.
    along = directions(np.gradient(path.base_from_tcp.position, axis=0))

    def across(values: Array, which: NDArray[np.intp]) -> Array:
        return np.asarray(values - np.einsum("ni,ni->n", values, along[which])[:, None] * along[which])

    known = (count[targets] > 0) & np.isfinite(along[targets]).all(axis=1)
    which = np.asarray(targets[known], dtype=np.intp)
    if len(which) < FEWEST:
        return ()
    off, deflection = across(beside[which], which), across(planned.prediction.position[known], which)
    size = 1e6 * rms(np.linalg.norm(off, axis=1))
    if offsets is not None:
        sent = across(offsets[which], which)
        if rms(np.linalg.norm(sent, axis=1)) > LEAST and np.sum(off * sent) < HARDLY * np.sum(sent**2):
            return (Finding(
                "CS3076", "warning", f"the positions in the log stand {size:.0f} um RMS off the planned path, and not as the "
                f"offsets of --logged-with do ({1e6 * rms(np.linalg.norm(sent, axis=1)):.0f} um)", file=log.source,
                hint="was it logged without them? Then leave --logged-with out"),)
        return _another_version(off - sent, which, planned)
    times = float(np.sum(off * deflection) / max(np.sum(deflection**2), 1e-30))
    if (rms(np.linalg.norm(deflection, axis=1)) < LEAST or not TIMES[0] < abs(times) < TIMES[1]
            or times * np.sum(off * deflection) < EXPLAINS * np.sum(off**2)):
        return _another_version(off, which, planned)
    if times < 0:
        what = "against the deflection, as those of a corrected pass do"
        hint = "name the offsets of that pass with --logged-with, and the planned program"
    else:
        what = "by the deflection itself, as those of the planned pass do off a program that is corrected already"
        hint = ("give the planned program of the CAM system: nothing is corrected twice. Right where the log has the loaded "
                "tool, measured from outside")
    return (Finding("CS3075", "warning", f"the positions in the log stand {size:.0f} um RMS off the path, {what}",
                    file=log.source, hint=hint),)


def _another_version(off: Array, which: NDArray[np.intp], planned: Predicted) -> tuple[Finding, ...]:
    """A pass that stands off its plan by (n, 3) [m] at the targets `which` (n,) by the same everywhere, or in a stretch
    (CS3120): less than any other program does."""
    if len(which) < FEWEST_OF_VERSION:
        return ()
    middle, source = np.median(off, axis=0), planned.forces.log.source
    if np.linalg.norm(middle) < BESIDE:
        return _stretch(off, which, planned)
    return (Finding("CS3120", "warning", f"the samples lie beside the path, by {1e3 * np.linalg.norm(middle):.2g} mm in the "
                    f"middle of the cuts ({', '.join(f'{1e3 * axis:+.2f}' for axis in middle)} mm, base frame)", file=source,
                    hint="is it the log of another version of this program, or of another TCP or work object?"),)


def _stretch(off: Array, which: NDArray[np.intp], planned: Predicted) -> tuple[Finding, ...]:
    """Where an operation of the program was changed since the log was taken, and the others were not."""
    middles = np.median(np.lib.stride_tricks.sliding_window_view(off, IN_A_ROW, axis=0), axis=2)
    far = np.flatnonzero(np.linalg.norm(middles, axis=1) > STRETCH)
    inside = np.zeros(len(off), dtype=bool)
    inside[(far[:, None] + np.arange(IN_A_ROW)).ravel()] = True
    if inside.sum() < SHARE * len(off) or not len(far):
        return ()
    worst = middles[far[np.argmax(np.linalg.norm(middles[far], axis=1))]]
    line = planned.path.toolpath.line
    first, last = (int(line[which[np.flatnonzero(inside)[end]]]) for end in (0, -1))
    by = f"{1e3 * np.linalg.norm(worst):.2g} mm ({', '.join(f'{1e3 * axis:+.2f}' for axis in worst)} mm, base frame)"
    some = f"{int(inside.sum())} of {len(off)} targets"
    return (Finding("CS3120", "warning", f"the samples of {some}, from line {first} to {last}, lie "
                    f"beside the path by up to {by}", file=planned.forces.log.source,
                    hint="was this part of the program changed since the log was taken?"),)

"""A log placed along the moves in the order in which the program drives them, where that is not the order of the text: routines
that are called in another order, that no call leads to, branches, error handlers and trap routines."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from compensator.forces.log import ForceLog
from compensator.forces.log_path import on_path, placed_rows
from compensator.forces.one_pass import check_once
from compensator.forces.program_time import moves_in_air
from compensator.forces.source import Key
from compensator.forces.time_log import promise_by_time
from compensator.path.driven_path import DrivenPath, driven_path
from compensator.path.robot_path import RobotPath
from compensator.toolpath import Way
from identification.common.arrays import Array
from identification.common.findings import CompstiffError, Finding, counted, error, verb
from identification.common.progress import progress

Indices = NDArray[np.intp]
# Of two orders of different length [share] a log by path length is of the one whose end it reaches to so much nearer.
APART, NEARER = 0.02, 0.2
# Samples of two ways are on the same place within this [m]; of positions those are of a way that lie on it but for this share.
SAME, BESIDE = 5e-3, 0.01
# A log by time alone, whose place takes long to find, is tried with no more turns of a loop than this, but for those stated.
TURNS_BY_TIME = 2
# Of more ways than this only those are tried, and so many at most, of which a quick look explains the force worse than of the
# best by no more than this share of its variance (the quick look of the right one is the best or next to it: tests).
MOST_BY_TIME, RULED_OUT = 8, 0.3
# A log of which no more than this share has one place on all ways is not used.
LEAST = 0.1
# So many moves are named.
NAMED = 4
HINT = ("log the column target, numbered by the text, or x_mm y_mm z_mm; or give the condition a value in the file, such as "
        "CONST bool")


class AsDriven(NamedTuple):
    """A log by the path length of the text, and the same rows, or more, `along` that of the path as it is driven: `run`, whose
    targets are `order` (D,) of the text."""

    log: ForceLog
    along: ForceLog
    run: RobotPath
    order: Indices

    @classmethod
    def by_text(cls, log: ForceLog, path: RobotPath) -> AsDriven:
        """A log that is placed in the order of the text."""
        return cls(log, log, path, np.arange(len(path.toolpath)))

    @classmethod
    def in_other_order(cls, log: ForceLog, key: Key, driven: DrivenPath, said: Sequence[Finding] = ()) -> AsDriven:
        """A log that is placed along the moves as driven. key: what placed it; said: of the way."""
        by_text = in_text(log, key, driven)
        return cls(replace(by_text, findings=(*by_text.findings, *said)), log, driven.run, driven.order)


class _Placed(NamedTuple):
    """A log placed along one way; place (M,) [m]: by the path length of the text; unknown (M,): rows of no known place."""

    way: Way
    driven: DrivenPath
    log: ForceLog
    place: Array
    unknown: NDArray[np.bool_]


def as_driven(log: ForceLog, path: RobotPath) -> AsDriven:
    """The log with the key `path_mm`, placed along the moves as they are driven, or as they stand in the text where the log
    fits that better. Rows of a move that was driven before are left out, so that of targets which are driven twice the first
    pass counts; so are rows whose place is another on each of several ways that the program may have gone.

    Raises what `on_path` and `check_once` raise, and CompstiffError (CS3123) where that is nearly all of them.
    """
    if log.on_path or log.predicted is not None:
        return AsDriven.by_text(on_path(log, path), path)
    if log.key == "target":
        return _by_targets(log, path)
    if path.toolpath.ways:
        return _along_ways(log, path)
    driven = driven_path(path)
    if driven is None or (log.key == "path_mm" and _of_text(float(log.place.max()), *driven.ends)):
        return AsDriven.by_text(on_path(log, path), path)
    try:
        placed = on_path(log, driven.run)
    except CompstiffError as stopped:
        if any(finding.code == "CS3124" for finding in stopped.findings):
            raise       # the text may have the same move at its end, where nothing shows that the way is not known
        return AsDriven.by_text(on_path(log, path), path)
    if log.key in ("position", "joints"):
        by_text = on_path(log, path)
        if np.isfinite(by_text.place).sum() > np.isfinite(placed.place).sum():
            return AsDriven.by_text(by_text, path)
    return AsDriven.in_other_order(placed, log.key, driven)


def _by_targets(log: ForceLog, path: RobotPath) -> AsDriven:
    """A log that names targets: the way to the one ahead begins at the one that is driven before it."""
    driven, number = None if path.toolpath.ways else driven_path(path), log.place.astype(np.intp)
    if driven is None or path.cell.force_log.form.target == "nearest" or not np.isin(number, driven.order).all():
        return AsDriven.by_text(on_path(log, path), path)
    again = check_once(log, number, driven.order)
    named, turn = np.unique(driven.order, return_index=True)
    by_turn = replace(log, place=turn[np.searchsorted(named, number)].astype(float))
    return AsDriven.in_other_order(on_path(by_turn, driven.run), log.key, driven, again)


def _of_text(end: float, driven: float, text: float) -> bool:
    """Whether a log that ends at this path length [m] is of all moves of the text, not of those that are driven."""
    return abs(driven - text) > APART * text and abs(end - text) < NEARER * abs(end - driven)


def _along_ways(log: ForceLog, path: RobotPath) -> AsDriven:
    """The log along that of several ways which it tells, or which the file's values lead to; else its rows that are on the same
    place on all of them."""
    ways = path.toolpath.ways
    placed = _fitting(log, list(_each_way(log, path))) if len(ways) > 1 else []
    if not placed:
        return AsDriven.by_text(_not_followed(on_path(log, path)), path)
    chosen, key = placed[0], log.key
    if len(placed) == 1 or chosen.way.stated:
        said = _assumed(log, chosen.way, len(placed))
        log = chosen.log.rows(~chosen.unknown) if chosen.unknown.any() else chosen.log
    else:
        agreed = _agreed(placed)
        keep = agreed & ~chosen.unknown
        if keep.mean() <= LEAST:
            raise error("CS3123", f"where this log lies depends on {_open(placed)}, which the text does not say, nor the log",
                        file=log.source, hint=HINT)
        said = _left(log, placed, agreed | chosen.unknown)
        log = chosen.log.rows(keep)
    log = replace(log, findings=(*log.findings, *said))
    order = chosen.way.order
    if np.array_equal(order, np.arange(len(path.toolpath))):
        return AsDriven.by_text(log, path)
    return AsDriven.in_other_order(log, key, chosen.driven)


def _each_way(log: ForceLog, path: RobotPath) -> Iterator[_Placed]:
    """The log along each way on which it can be placed. By time alone each takes seconds: who waits is told how many there
    are."""
    tried = [way for way in path.toolpath.ways if log.key != "time" or way.stated or not any(
        turns is not None and turns > TURNS_BY_TIME for turns in way.turns)]
    if log.key == "time" and len(tried) > MOST_BY_TIME:
        tried = _promising(log, path, tried)
    with progress(f"placing the log along {counted(len(tried), 'way')} that the program may go", len(tried)) as bar:
        for way in tried:
            placed = _along(log, path, way)
            bar.add(1)
            if placed is not None:
                yield placed


def _promising(log: ForceLog, path: RobotPath, ways: list[Way]) -> list[Way]:
    """Of many ways those that a quick look at a log by time alone leaves, and those that the file's values lead to."""
    found = []
    with progress(f"looking at {counted(len(ways), 'way')} that the program may go", len(ways)) as bar:
        for way in ways:
            driven = driven_path(path, way.order)
            bar.add(1)
            try:
                found.append(0.0 if driven is None else promise_by_time(log, driven.run))
            except CompstiffError:
                found.append(0.0)
    looked = np.array(found)
    best = np.argsort(-looked, kind="stable")[:MOST_BY_TIME]
    kept = {int(k) for k in best if looked[k] >= looked.max() - RULED_OUT}
    return [way for k, way in enumerate(ways) if k in kept or way.stated]


def _along(log: ForceLog, path: RobotPath, way: Way) -> _Placed | None:
    """The log along one way, None where it cannot be placed."""
    driven = driven_path(path, way.order)
    if driven is None:
        return None
    try:
        placed, unknown = placed_rows(log, driven.run)
    except CompstiffError:
        return None
    place = np.full(len(placed.place), np.nan)
    on = np.isfinite(placed.place) & ~unknown
    place[on] = driven.in_text(placed.place[on])[0]
    return _Placed(way, driven, placed, place, unknown)


def _fitting(log: ForceLog, placed: list[_Placed]) -> list[_Placed]:
    """Those ways which the log may be of: by its end where it counts path length, by its samples on the path where it has
    positions."""
    if log.key == "path_mm":
        length = np.array([one.driven.ends[0] for one in placed])
        off = np.abs(float(log.place.max()) - length)
        near = off.min(initial=np.inf)
        if not placed or near > APART * length[np.argmin(off)]:
            return placed
        return [one for one, away in zip(placed, off, strict=True) if near >= NEARER * away]
    if log.key in ("position", "joints"):
        on = np.array([np.isfinite(one.place).sum() for one in placed])
        fits = [placed[number] for number in np.argsort(-on, kind="stable") if on[number] >= (1 - BESIDE) * on.max()]
        return sorted(_fewest_turns(fits), key=lambda one: not one.way.stated)
    return placed


def _fewest_turns(placed: list[_Placed]) -> list[_Placed]:
    """Of ways that differ in turns of loops alone, which a log that ends earlier fits too, those of the fewest."""
    fewest: dict[tuple[str, ...], _Placed] = {}
    for one in placed:
        branches = tuple(taken for taken, turns in zip(one.way.taken, one.way.turns, strict=True) if turns is None)
        if branches not in fewest or len(one.way.order) < len(fewest[branches].way.order):
            fewest[branches] = one
    return list(fewest.values())


def _agreed(placed: list[_Placed]) -> NDArray[np.bool_]:
    """The rows (M,) that are on the same place on all ways, or on none."""
    places = np.array([one.place for one in placed])
    off = np.isnan(places)
    spread = np.where(off, -np.inf, places).max(axis=0) - np.where(off, np.inf, places).min(axis=0)
    return np.asarray(off.all(axis=0) | (~off.any(axis=0) & (spread <= SAME)))


def _open(placed: list[_Placed]) -> str:
    """The branches on which the ways differ."""
    taken = [set(one.way.taken) for one in placed]
    differ = sorted({branch for branches in taken for branch in branches if not all(branch in other for other in taken)})
    return ", ".join(differ[:3]) + (" ..." if len(differ) > 3 else "")


def _assumed(log: ForceLog, way: Way, several: int) -> list[Finding]:
    """What is said of the branches of a way that is followed: a warning where the file's values alone speak for it."""
    if several > 1:
        return [Finding("CS3123", "warning", f"taken as driven by the values in the file, which the log does not show: "
                        f"{', '.join(way.taken[:3])}", file=log.source, hint=HINT)]
    return [Finding("CS3123", "note", f"the log is of the program with {', '.join(way.taken[:3])}", file=log.source)]


def _left(log: ForceLog, placed: list[_Placed], keep: NDArray[np.bool_]) -> list[Finding]:
    number = int(log.weight[~keep].sum())
    if not number:
        return []
    return [Finding("CS3123", "warning", f"neither the text nor the log says which was driven: "
                    f"{_open(placed)}; {counted(number, 'sample')} that {verb(number, 'lie')} elsewhere by each are left out",
                    file=log.source, hint=HINT)]


def _not_followed(log: ForceLog) -> ForceLog:
    """A log in the order of the text, since no way can be followed."""
    said = Finding("CS3123", "warning", "the branches of this program cannot be followed, as they are too many, or the place "
                   "of a move is not known: the log is placed as if all of them were driven, in the order of the text",
                   file=log.source, hint=HINT)
    return replace(log, findings=(*log.findings, said))


def in_text(log: ForceLog, key: Key, driven: DrivenPath) -> ForceLog:
    """A log along the moves as driven, by the path length of the text. key: what placed it."""
    place, keep = np.full(len(log.place), np.nan), np.ones(len(log.place), dtype=bool)
    on = np.flatnonzero(np.isfinite(log.place))
    place[on], keep[on] = driven.in_text(log.place[on])
    log = replace(log, place=place, findings=(*log.findings, _said(log, key, driven)))
    if not keep.all():
        log = log.rows(keep)
    return log.along_the_path() if (np.diff(driven.order) < 0).any() else log


def _said(log: ForceLog, key: Key, driven: DrivenPath) -> Finding:
    """What is said of it: a warning where cuts are left out, and no position shows that the log is of none of them."""
    toolpath = driven.path.toolpath
    idle = np.setdiff1d(np.arange(len(toolpath)), driven.order)
    never = np.setdiff1d(idle, np.concatenate([idle[:0], *(way.order for way in toolpath.ways)]))
    cuts = bool((~moves_in_air(toolpath)[never]).any()) and key in ("path_mm", "time")
    words = [f"{counted(len(idle), 'target')} that no call or branch leads to, of an error handler, a trap or an idle routine, "
             f"{verb(len(idle), 'have')} no sample"] if len(idle) else []
    if not driven.first.all():
        words.append("of targets that are driven more than once the first time counts")
    led = 1 + np.flatnonzero(np.diff(driven.order) != 1)
    led = led[~moves_in_air(toolpath)[driven.order[led]] & (np.diff(driven.run.length)[led - 1] > SAME)]
    if len(led):
        lines = ", ".join(str(toolpath.line[driven.order[place]]) for place in led[:NAMED].tolist())
        words.append(f"{counted(len(led), 'move')} at the feed of the cut that a call leads to (line {lines}"
                     f"{' ...' if len(led) > NAMED else ''}) {verb(len(led), 'are')} looked at at both ends alone")
    said = "; ".join(["followed along the moves as the calls drive them, which is not the order of the text", *words])
    return Finding("CS3122", "warning" if cuts else "note", said, file=log.source,
                   hint="was an idle routine started by itself? Then give it as a program of its own" if cuts else "")

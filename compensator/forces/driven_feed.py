"""How fast the robot drove while a log was taken, against the program's feed: with the override at a half the chips are half as
thick, and the forces are not those that the corrected program will meet."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from compensator.forces.log import ForceLog
from compensator.forces.program_time import moves_in_air
from compensator.path.robot_path import RobotPath
from identification.common.findings import Finding

# Said where nine tenths of the cut, by time, were driven slower than this share of the feed, or half of it faster than that
# one: where a controller cannot hold a feed it is slower for a part of a path, and never faster (engineering judgement).
SLOW, FAST = 0.75, 1.25
# So many moves of the cut at least, and so many samples in each: the places of a log scatter by a sample either way. A move
# counts once for every so many metres of it: of a long one a larger part is driven at the feed, not at starting and stopping.
FEWEST, SAMPLES, COUNTS_AGAIN = 20, 8, 0.01
# A time in another unit, off by 60 and more, shows in fewer.
FEWEST_OF_UNIT = 3

# What share of its feed a robot seems to drive at where the time is in another unit than seconds.
UNITS = {"milliseconds": 1e-3, "microseconds": 1e-6, "minutes": 60.0}
# The same where the path length is, of a part of the program; of all of it the length tells (log_path.py).
INCHES = 1 / 25.4


def said_of_feed(log: ForceLog, path: RobotPath, forced: NDArray[np.bool_]) -> list[Finding]:
    """A warning (CS3072) where the pass of a log, by path length and with time, was not driven at the program's feed.
    forced (N,): targets with force."""
    if log.key != "path_mm" or log.time is None or log.spread is not None:
        return []
    placed = np.isfinite(log.place) & np.isfinite(log.time)
    length, feed = path.length, path.toolpath.feed
    cut = np.zeros(len(length), dtype=bool)
    cut[1:] = forced[1:] & forced[:-1]
    cut &= ~moves_in_air(path.toolpath) & np.isfinite(length) & (feed > 0)
    place, time = np.maximum.accumulate(log.place[placed]), log.time[placed]
    if len(place) < 2 or not cut.any():
        return []
    # Where the tool stood still all of the time is the last place's.
    last = np.append(place[1:] > place[:-1], True)
    way = np.diff(length, prepend=np.nan)
    taken = np.diff(np.interp(length, place[last], time[last], left=np.nan, right=np.nan), prepend=np.nan)
    with np.errstate(invalid="ignore", divide="ignore"):
        cut &= (taken > SAMPLES * np.median(np.diff(time))) & (way > 0)
        share = way / taken / feed
    if cut.sum() < FEWEST_OF_UNIT:
        return []
    order = np.argsort(share[cut])
    passed = np.cumsum(taken[cut][order]) / taken[cut].sum()
    middle, most = share[cut][order][np.searchsorted(passed, (0.5, 0.9))].tolist()
    if most >= SLOW and middle <= FAST:
        return []
    unit = unit_of_time(middle)
    if unit:
        return [_in_unit(log, unit, middle)]
    if np.maximum(way[cut] / COUNTS_AGAIN, 1.0).sum() < FEWEST:
        return []
    counted = not log.sent and all(finding.code != "CS3090" for finding in log.findings)
    if counted and place[-1] < 1.1 * INCHES * np.nanmax(length) and 0.6 * INCHES < middle < 1.5 * INCHES:
        return [Finding(
            "CS3072", "warning", f"by this log the cuts were driven at {100 * middle:.2g} % of their feed: path_mm seems to be "
            "in inches", file=log.source, hint="path_mm is in millimetres; the forces lie on other targets")]
    return [Finding(
        "CS3072", "warning", f"while this log was taken the cuts were driven at {100 * middle:.0f} % of their feed (nine "
        f"in ten under {100 * most:.0f} %): the force is that of another feed", file=log.source,
        hint="was the override on, or is it the log of another version? Log the pass as the corrected program will be driven. "
        "A robot that never holds its feed (--check-feed) will not then either, and the log is right")]


def said_of_clock(log: ForceLog, path: RobotPath, samples: float) -> list[Finding]:
    """A warning (CS3072) where the time of a log is in milliseconds or less by how long it took for all of the program: told
    of logs whose rows are not in the order of time any more, or that name targets. samples: so many are on the path."""
    if log.rate is None or log.key not in ("path_mm", "target") or log.spread is not None or (
            log.key == "path_mm" and log.time is not None):
        return []
    way, feed = np.diff(path.length, prepend=np.nan), path.toolpath.feed
    known = np.isfinite(way) & (feed > 0)
    share = float(np.sum(way[known] / feed[known])) * log.rate / samples if samples else 0.0
    unit = unit_of_time(share)
    return [_in_unit(log, unit, share)] if unit and share < 1 else []


def unit_of_time(share: float) -> str:
    """The unit in which a time is that shows such a share of the feed; "" for seconds, or none."""
    return next((unit for unit, factor in UNITS.items() if 0.3 * factor < share < 3 * factor), "")


def _in_unit(log: ForceLog, unit: str, share: float) -> Finding:
    """What is said of a time in another unit, by which the cuts were driven at such a share of their feed."""
    return Finding(
        "CS3072", "warning", f"by the time in this log the cuts were driven at {100 * share:.2g} % of their feed: it seems to "
        f"be in {unit}", file=log.source, hint="time_s is in seconds; by it the samples of a turn of the spindle are "
        "counted, too")

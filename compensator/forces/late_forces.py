"""Whether the forces of a log belong to the places beside them: the clock of the force sensor may run behind the controller's.

What the program says of the force (alignment_regression.py: it is there on moves that cut, and turns with the travel) is held
against forces that are taken to be early or late by up to half a second. Where the air before and behind a cut lies is free
for each, so that only a force on moves that are certainly in air, and its turns at corners, tell.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

from compensator.forces.alignment_regression import Bins, Regression, binned
from compensator.forces.log import ForceLog
from compensator.forces.program_time import ProgramTime, kinds_of_cut, moves_in_air, travel_in_log
from compensator.path.robot_path import RobotPath
from identification.common.arrays import Array
from identification.common.findings import Finding

# Forces are looked for so much earlier and later [s], in steps of bins so wide; of a longer log the first so many bins with a
# cut in them.
FURTHEST, BIN, MOST_BINS = 0.5, 0.02, 5000
# Lengths of air at the cutting feed before and behind a cut [m]: those that are tried with every delay, and with the two that
# are compared.
LEADS, FINE = (0.0, 2e-3, 5e-3, 1e-2, 2e-2, 4e-2), tuple(1e-3 * k for k in range(41))
# Said where the program explains this share of the force at that delay and leaves so much less of it unexplained than without
# one, the tool moving on by so much meanwhile [m]. A step of NEARBY [s] must be better by CLOSER, or nothing more is tried.
FOLLOWS, LEAVES, WAY, NEARBY, CLOSER = 0.5, 0.85, 1e-3, 0.06, 0.97
# So many bins on moves that cut, and as many samples, say something.
FEWEST = 100


def said_of_delay(log: ForceLog, path: RobotPath) -> list[Finding]:
    """A warning (CS3073) where the forces of a log, by path length and with time, are those of places before or behind."""
    if log.key != "path_mm" or log.time is None or log.spread is not None or log.predicted is not None:
        return []
    placed = np.isfinite(log.place) & np.isfinite(log.time)
    if placed.sum() < FEWEST or not np.isfinite(path.length).all() or np.any(np.diff(log.time[placed]) < 0):
        return []
    time, place = log.time[placed], np.maximum.accumulate(log.place[placed])
    program = _by_length(path)
    bins = _cuts_of(time, log.force[placed], place, program)
    if bins is None:
        return []
    left = _Left(program, bins, time, place)
    if min(left.at(-NEARBY), left.at(NEARBY)) > CLOSER * left.at(0.0):
        return []
    delays = np.arange(-FURTHEST, FURTHEST + 0.5 * BIN, BIN)
    likeliest = int(np.argmin([left.at(float(delay)) for delay in delays]))
    if likeliest in (0, len(delays) - 1):
        return []
    delay = float(delays[likeliest])
    here, best = left.at(0.0, FINE), left.at(delay, FINE)
    speed = float(np.median(np.abs(np.gradient(np.interp(bins.time, time, place), bins.time))))
    if best > 1 - FOLLOWS or best > LEAVES * here or abs(delay) * speed < WAY:
        return []
    late = round(1e3 * delay)
    stated = path.cell.force_log.form.position_late_ms
    return [Finding(
        "CS3073", "warning", f"the forces seem to be {abs(late)} ms {'late' if late > 0 else 'early'} against the places in "
        f"the log, {1e3 * abs(delay) * speed:.1f} mm of path: then cuts and turns of the program leave "
        f"{100 * best:.1f} % of them unexplained, and {100 * here:.1f} % as logged", file=log.source,
        hint="have sensor and controller two clocks, or is one of them filtered? "
        f"force_log.position_late_ms: {stated - late:g} in cell.yaml sets it right")]


def _by_length(path: RobotPath) -> ProgramTime:
    """The program over path length in place of time."""
    air = moves_in_air(path.toolpath)
    return ProgramTime(path.length, path.length, air, kinds_of_cut(path.toolpath.feed, air, path.length), travel_in_log(path))


def _cuts_of(time: Array, force: Array, place: Array, program: ProgramTime) -> Bins | None:
    """At most MOST_BINS bins, from FURTHEST before the first sample on a move that cuts on: as many however long the log took,
    or says that it took. None where too few of them are on such moves."""
    def cuts(where: Array) -> NDArray[np.bool_]:
        move = np.clip(np.searchsorted(program.length, where), 1, len(program.length) - 1)
        return np.asarray(~program.air[move])

    first = np.searchsorted(time, time[int(np.argmax(cuts(place)))] - FURTHEST)
    some = slice(first, np.searchsorted(time, time[first] + MOST_BINS * BIN))
    bins = binned(time[some], force[some], BIN)
    seen = bins.weight > 0
    if (seen & cuts(np.interp(bins.time, time, place))).sum() < FEWEST or not bins.force[seen].any():
        return None
    return bins


class _Left:
    """What share of the force's energy the program does not explain, were the forces late."""

    def __init__(self, program: ProgramTime, bins: Bins, time: Array, place: Array) -> None:
        self.regression, self.time, self.place = Regression(program, bins, 0.0), time, place

    def at(self, delay: float, leads: Sequence[float] = LEADS) -> float:
        """By so much [s], with the likeliest of these lengths [m] of air before and behind the cuts."""
        at = self.regression.time
        slip = np.interp(at - delay, self.time, self.place) - at
        best, chosen, known = np.inf, (0.0, 0.0), set[tuple[float, float]]()
        for side, length in product((0, 1, 0, 1), leads):
            tried = (chosen[0], length) if side else (length, chosen[1])
            if tried in known:
                continue
            known.add(tried)
            residual = self.regression.fit(np.array([0.0, 0.0, *tried]), slip).residual
            share = float(np.sum(residual**2)) / max(self.regression.energy, 1e-300)
            if share < best:
                best, chosen = share, tried
        return best

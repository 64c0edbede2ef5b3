"""What would mend a single bad reading: its sign, its decimal point, whole turns of a dial that were not counted, or the
reading of another row of its visit.

Each of these leaves the reading off by something else. Its probability is that of what is left among all that are tried, each
kind as likely as another beforehand, and none of them: an axis, or all three, off by about as much as they are.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from identification.common.findings import counted
from identification.common.tails import chi2_tail
from identification.fit.mending import FITS, WORTH_TELLING, Mend
from identification.fit.mistakes.readings import TURNS
from identification.measurements import Measurements

Array = NDArray[np.float64]
FACTORS = ((-1.0, "sign", "with the other sign"), (10.0, "decimal point", "ten times as large"),
           (0.1, "decimal point", "a tenth as large"))
# So many whole turns may be lost.
MOST_TURNS = 3
AXES = (*np.eye(3, dtype=bool), np.ones(3, dtype=bool))


def row_mend(rows: Measurements, off: Array, std: Array, row: int) -> Mend | None:
    """The likeliest slip of the pen that explains the reading of this row, an index; None where none does. off (n, 3) [m]: the
    readings minus what the others let expect, std (n, 3) [m]: what of that is noise; nan where nothing was read."""
    slips = [(kind, what, left, _log_likelihood(left, std[row]) + beside)
             for kind, what, left, beside in _slips(rows, off, std, row)]
    many = Counter(kind for kind, *_ in slips)
    weight = np.array([value - np.log(many[kind]) for kind, _, _, value in slips])
    none = np.logaddexp.reduce([_log_likelihood(off[row], np.hypot(std[row], axes * np.nan_to_num(np.abs(off[row]))))
                                for axes in AXES]) - np.log(len(AXES))
    probability = np.exp(weight - np.logaddexp.reduce([*weight, none]))
    best = int(np.argmax(probability))
    kind, what, left, _ = slips[best]
    read = np.isfinite(left) & np.isfinite(std[row])
    fits = chi2_tail(float(np.sum((left[read] / std[row][read]) ** 2)), int(read.sum())) >= FITS
    return Mend(kind, what, float(probability[best])) if fits and probability[best] >= WORTH_TELLING else None


def _slips(rows: Measurements, off: Array, std: Array, row: int) -> Iterator[tuple[str, str, Array, float]]:
    """Kind and words of each, what is left of the reading (3,) [m] with it mended, and by how much another row is likelier."""
    reading = rows.deflection[row]
    for axes in AXES:
        which = "the reading" if axes.all() else f"d{'xyz'[int(np.argmax(axes))]}"
        for factor, kind, words in FACTORS:
            yield kind, f"{which} {words} would fit", off[row] + np.where(axes, (factor - 1) * reading, 0.0), 0.0
    for axis in range(3):
        for turn in TURNS:
            for count in (*range(-MOST_TURNS, 0), *range(1, MOST_TURNS + 1)):
                turns = f"{counted(abs(count), 'whole turn')} of {1e6 * turn:.0f} um {'more' if count > 0 else 'less'}"
                yield "whole turns", f"d{'xyz'[axis]} with {turns} would fit", off[row] + count * turn * np.eye(3)[axis], 0.0
    read = np.isfinite(rows.deflection)
    for other in np.flatnonzero(rows.visit == rows.visit[row]):
        if other != row and np.array_equal(read[other], read[row]):
            exchanged = rows.deflection[other] - reading
            beside = _log_likelihood(off[other] - exchanged, std[other]) - _log_likelihood(off[other], std[other])
            yield ("readings exchanged", f"exchanged with the reading of row {rows.row[other]} (line {rows.line[other]}) both "
                   "would fit", off[row] + exchanged, beside)


def _log_likelihood(left: Array, std: Array) -> float:
    read = np.isfinite(left) & np.isfinite(std)
    return float(-0.5 * np.sum((left[read] / std[read]) ** 2) - np.sum(np.log(std[read])))

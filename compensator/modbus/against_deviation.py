"""Do the offsets of a file undo the deviation that the same file predicts? A sign, a unit, an axis or a row that got into
disorder between `correct` and `push` makes them something else, and the robot cannot tell."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from compensator.modbus.offset_file import Offsets
from identification.common.arrays import Array
from identification.common.findings import Finding, Refused, counted

# Offsets are the deviation turned round, but for what is held back, and for a force that follows the cut: together they are
# between these shares of it (RMS over the targets that are moved), and point this well against it (engineering judgement).
LEAST, MOST, AGAINST = 0.1, 3.0, 0.7
# Under this [m], RMS, rounded figures decide.
SMALL = 2e-6
# In the middle of the targets they are that many times it: more, or less, is worth a word (engineering judgement).
USUAL = (0.6, 1.6)


def check_deviation(offsets: Offsets, base_from_object: Array | None, up: Array | None = None) -> tuple[Finding, ...]:
    """A warning (CS5027) where they are more or less than the deviation, or seem to point along it.

    base_from_object (M, 3, 3): rotations of the work object at the program's targets; None: not known, and the direction is
    looked at along `up` (3,) alone, base frame, where the z of most work objects points. A file without dx_um dy_um dz_um says
    nothing. Raises Refused (CS5025)."""
    if offsets.predicted is None:
        return ()
    moved = np.any(offsets.offset != 0, axis=1)
    still = np.flatnonzero(moved & np.all(offsets.predicted == 0, axis=1))
    if len(still):
        raise _other(offsets, f"{counted(len(still), 'target')} would be moved where it predicts no deviation", int(still[0]),
                     "are the columns of one row those of another (sorted, shifted)")
    used: NDArray[np.bool_] = np.logical_and(moved, np.all(np.isfinite(offsets.predicted), axis=1))
    offset, deviation = offsets.offset[used], offsets.predicted[used]
    size, predicted = (float(np.sqrt(np.mean(np.sum(values**2, axis=1)))) if len(values) else 0.0
                       for values in (offset, deviation))
    if max(size, predicted) < SMALL:
        return ()
    row = int(np.flatnonzero(used)[np.argmax(np.linalg.norm(offset, axis=1))])
    if not LEAST * predicted <= size <= MOST * predicted:
        raise _other(offsets, f"they are {1e6 * size:.4g} um RMS, the deviation that it predicts there {1e6 * predicted:.4g}",
                     row, "ox_mm oy_mm oz_mm are millimetres, dx_um dy_um dz_um micrometres")
    if base_from_object is None:
        return (*_times(offsets, offset, deviation, row), *_upright(offsets, offset[:, 2], deviation, up, row))
    turn = base_from_object[offsets.first:offsets.first + len(used)][used]
    along = np.einsum("nj,nji,ni->", deviation, turn, offset) / (len(offset) * size * predicted)
    if along > -AGAINST:
        what = "is the sign of the offsets turned over" if along > AGAINST else "are axes swapped, or of another frame"
        raise _other(offsets, "they do not point against the deviation that it predicts there", row, what)
    return _times(offsets, offset, deviation, row)


def _times(offsets: Offsets, offset: Array, deviation: Array, row: int) -> tuple[Finding, ...]:
    """How many times the deviation (n, 3) the offsets (n, 3) are."""
    felt = np.linalg.norm(deviation, axis=1)
    clear = felt > SMALL
    times = float(np.median(np.linalg.norm(offset[clear], axis=1) / felt[clear])) if clear.any() else 1.0
    return () if USUAL[0] <= times <= USUAL[1] else (_warned(
        offsets, f"the offsets are {times:.2f} times the deviation that this file predicts, in the middle of their targets; "
        "undoing it takes 1", row, "right only if correct had such a --scale, or a force that grows so with the cut"),)


def _upright(offsets: Offsets, offset: Array, deviation: Array, up: Array | None, row: int) -> tuple[Finding, ...]:
    """Whether the offsets' z (n,) points along the deviation (n, 3), where the work object stands upright."""
    height = deviation @ up if up is not None else np.zeros(len(deviation))
    size = float(np.linalg.norm(height) * np.linalg.norm(offset))
    if size <= SMALL**2 * len(offset) or float(height @ offset) <= AGAINST * size:
        return ()
    return (_warned(offsets, "along z the offsets point with the deviation that this file predicts, not against it: is their "
                    "sign turned over", row,
                    "right only for a work object that hangs upside down; --program PROGRAM.mod tells"),)


def _warned(offsets: Offsets, what: str, row: int, hint: str) -> Finding:
    return Finding("CS5027", "warning", what, file=offsets.source, line=int(offsets.lines[row]), target=offsets.first + row,
                   hint=hint)


def _other(offsets: Offsets, what: str, row: int, why: str) -> Refused:
    return Refused(Finding(
        "CS5025", "error", f"the offsets do not undo the deviation of this file: {what}", file=offsets.source,
        line=int(offsets.lines[row]), target=offsets.first + row,
        hint=f"nothing was sent; {why}; push the file as correct --offsets wrote it"))

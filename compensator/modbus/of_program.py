"""Are these the offsets of the program that the robot runs? It cannot tell: it adds the offset of a number to a target."""

from __future__ import annotations

import numpy as np

from compensator.modbus.offset_file import Offsets
from identification.common.arrays import Array
from identification.common.findings import Finding, Refused, counted

# Planned places are written with 1e-6 mm; those of a corrected program, and so what it has beyond them, with 1e-4 mm.
SAME_PLACE, SAME_OFFSET = 2e-6, 2e-6


def check_program(offsets: Offsets, position: Array, source: str, written: str = "") -> tuple[Finding, ...]:
    """Holds the offsets against a program, its targets at position (M, 3) [m] in the work object, NaN where its text does not
    give one: the same targets at the same places. written: the record by which `correct` wrote this program, "": none.

    Raises Refused: CS5022 another program or another version of it, CS5023 the corrected one, which has them already. Where
    the file does not say where its targets are only the record and their number are looked at, which a warning says (CS5024).
    """
    count, rows = len(position), len(offsets.offset)
    last = offsets.first + rows
    corrected = _twice(offsets, f"{source} is a corrected program (record {written})") if written else None
    if offsets.planned is None:
        if corrected:
            raise corrected
        if last != count:
            raise _other(offsets, source, f"they are for {counted(last, 'target')}, the program has {count}")
        return (Finding("CS5024", "warning", f"that {source} is their program is held by its number of targets alone: the "
                        "file has no columns x_mm y_mm z_mm", file=offsets.source,
                        hint="is it the planned program, not the corrected one? Push the file that correct --offsets "
                        "writes"),)
    there = position[offsets.first:last]
    same = min(len(there), rows)
    apart = there[:same] - offsets.planned[:same]
    far = np.linalg.norm(apart, axis=1)
    if last == count and not np.nanmax(far, initial=0.0) <= SAME_PLACE and np.nanmax(
            np.linalg.norm(apart - offsets.offset, axis=1), initial=0.0) <= SAME_OFFSET:
        raise _twice(offsets, f"{source} has these offsets already: it is the corrected program")
    wrong = np.flatnonzero((far > SAME_PLACE) | (np.isnan(there[:same]) != np.isnan(offsets.planned[:same])).any(axis=1))
    if len(wrong):
        row = int(wrong[0])
        size = "not" if np.isnan(far[row]) else f"{1e3 * far[row]:.4g} mm from"
        raise corrected or _other(offsets, source, f"target {offsets.first + row} is {size} where the program has it", row)
    if last != count:
        raise corrected or _other(offsets, source, f"they are for {counted(last, 'target')}, the program has {count}")
    return ()


def _twice(offsets: Offsets, what: str) -> Refused:
    return Refused(Finding("CS5023", "error", what, file=offsets.source, hint="nothing was sent; either the corrected program "
                           "runs, or the planned one with these offsets, never both"))


def _other(offsets: Offsets, source: str, what: str, row: int = 0) -> Refused:
    return Refused(Finding(
        "CS5022", "error", f"these are not the offsets of {source}: {what}", file=offsets.source, line=int(offsets.lines[row]),
        hint="nothing was sent; name the planned program that the robot runs and the offsets that correct --offsets wrote for "
        "it; after a change of the program correct it again"))

"""OFFSETS.csv as tables to push: read, checked against the limit and the registers, cut into windows."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from compensator.modbus.wire import LARGEST_UM, OffsetTable, to_registers
from identification.common.added_targets import ADDED, ADDED_MM, added_of, added_offsets
from identification.common.arrays import Array
from identification.common.files import AsRead, sha256
from identification.common.findings import Finding, Refused, counted, error

if TYPE_CHECKING:
    from identification.common.tables import Table

OFFSET = ("ox_mm", "oy_mm", "oz_mm")
TURN = ("orx_deg", "ory_deg", "orz_deg")
PLACE = ("x_mm", "y_mm", "z_mm")
DEVIATION = ("dx_um", "dy_um", "dz_um")
# Targets that are not sent are more than entries, exits and corners where they stand in such a share of the corrected moves.
MANY_MOVES = 0.25
# Decimal millimetres are not exact in binary: an offset of exactly the limit must pass.
EXACT_M = 1e-12


@dataclass(frozen=True, eq=False)
class Offsets:
    """offset (N, 3) [m], work object, of the targets first ... first + N - 1; lines (N,): where each stands in the file.

    turn (N,) [rad]: angle by which the correction also turns the tool, NaN where the file does not say, which is not sent.
    sha256: of the file as it was read. planned (N, 3) [m], work object: where the program has these targets, NaN where it does
    not say; None: the file has no such columns. predicted (N, 3) [m], base frame: the deviation without them, likewise.
    """

    source: str
    first: int
    offset: Array
    turn: Array
    lines: NDArray[np.intp]
    findings: tuple[Finding, ...]
    sha256: str = ""
    planned: Array | None = None
    predicted: Array | None = None

    @property
    def length(self) -> Array:
        """Lengths (N,) [m]."""
        lengths: Array = np.linalg.norm(self.offset, axis=1)
        return lengths

    @property
    def worst(self) -> int:
        """Row of the largest offset."""
        return int(np.argmax(self.length))

    @property
    def micrometres(self) -> NDArray[np.int64]:
        """Rounded to what is sent (N, 3); what no register holds by far stays as far beyond as an integer goes."""
        return np.rint(np.clip(1e6 * self.offset, -1e18, 1e18)).astype(np.int64)


def read_offsets(file: str | Path, reach_mm: float) -> Offsets:
    """Reads the file that `correct --offsets` writes, or any with target, ox_mm, oy_mm, oz_mm.

    reach_mm: distance between TCP and cutting edge for which the error of the turn not sent is stated. Raises
    CompstiffError: CS5001 targets that are not consecutive, CS5006 an offset with some cells empty, CS0080 a file that changes
    while it is read, and those of read_table.

    >>> offsets = compstiff.read_offsets("offsets.csv", reach_mm=10.0)
    >>> offsets.first, offsets.offset.shape
    (0, (3586, 3))
    """
    from identification.common.tables import read_table

    read = AsRead.of([Path(file)])
    table = read_table(file, required=("target", *OFFSET), optional=(*TURN, *PLACE, *DEVIATION), texts=(ADDED, ADDED_MM),
                       may_be_empty=(*OFFSET, *TURN, *PLACE, *DEVIATION), together=(TURN, PLACE, DEVIATION))
    if not len(table):
        raise error("CS5001", "has no row: there is nothing to push", file=str(file))
    _check_targets(table.numbers["target"], table.line, file)
    findings = [finding for finding in table.findings if finding.level != "note"]
    offset = 1e-3 * table.stack(*OFFSET)
    empty = np.isnan(offset)
    partly = np.flatnonzero(empty.any(axis=1) & ~empty.all(axis=1))
    if len(partly):
        raise error("CS5006", f"an offset with {counted(int(empty[partly[0]].sum()), 'empty cell')} of three",
                    file=str(file), line=int(table.line[partly[0]]), hint="give all three components, or none: no correction")
    none = empty.all(axis=1)
    if none.any():
        findings.append(Finding("CS5002", "note", f"{counted(int(none.sum()), 'target')} without an offset: 0 is sent",
                                file=str(file), line=int(table.line[np.argmax(none)])))
    turn = np.full(len(table), np.nan)
    if TURN[0] in table.numbers:
        turn = np.radians(np.linalg.norm(table.stack(*TURN), axis=1))
    findings += _added_not_sent(table, np.where(empty, 0.0, offset))
    findings.append(_turn_not_sent(table.numbers["target"], turn, reach_mm, file))
    first = int(table.numbers["target"][0])
    digest = sha256(file)
    read.check()
    planned = 1e-3 * table.stack(*PLACE) if PLACE[0] in table.numbers else None
    predicted = 1e-6 * table.stack(*DEVIATION) if DEVIATION[0] in table.numbers else None
    return Offsets(str(file), first, np.where(empty, 0.0, offset), turn, table.line, tuple(findings), digest, planned,
                   predicted)


def check_offsets(offsets: Offsets, limit: float) -> None:
    """Raises Refused: CS5003 over the limit [m], CS5004 beyond what a register holds."""
    row = offsets.worst
    over = int((offsets.length > limit + EXACT_M).sum())
    code, what, hint = "", "", ""
    if over:
        code, hint = "CS5003", "; limits.max_offset_mm is in cell.yaml: is the file in millimetres?"
        what = (f"{counted(over, 'offset')} over the limit: the largest is {1e3 * offsets.length[row]:.4f} mm at target "
                f"{offsets.first + row}, the limit {1e3 * limit:g} mm")
    elif np.abs(offsets.micrometres).max() > LARGEST_UM:
        code, row = "CS5004", int(np.argmax(np.abs(offsets.offset).max(axis=1)))
        what = (f"an offset component of {1e3 * np.abs(offsets.offset).max():.4f} mm does not fit into 16 bits of micrometres "
                f"(+-{1e-3 * LARGEST_UM:g} mm)")
    if code:
        raise Refused(Finding(code, "error", what, file=offsets.source, line=int(offsets.lines[row]),
                              target=offsets.first + row, hint=f"nothing was sent{hint}"))


def tables_of(offsets: Offsets, window_rows: int) -> list[OffsetTable]:
    """The tables of up to `window_rows` rows, one where the device holds them all. Raises Refused (CS5004)."""
    registers = to_registers(offsets.micrometres)
    count = -(-len(registers) // window_rows)
    if count > 0xFFFF:
        raise Refused(Finding("CS5004", "error", f"{count} windows of {window_rows} rows: more than a register counts"))
    tables = []
    for number in range(count):
        rows = registers[number * window_rows:(number + 1) * window_rows]
        first = offsets.first + number * window_rows
        tables.append(OffsetTable.of(rows, first, offsets.first + len(registers), number + 1, count))
    return tables


def _check_targets(target: Array, line: NDArray[np.intp], file: str | Path) -> None:
    expected = target[0] + np.arange(len(target))
    if target[0] != np.floor(target[0]) or not 0 <= target[0] < 2 ** 31:
        raise error("CS5001", f"column 'target': found {target[0]:g}, expected a whole number from 0", file=str(file),
                    line=int(line[0]))
    wrong = np.flatnonzero(target != expected)
    if len(wrong):
        row = int(wrong[0])
        raise error("CS5001", f"column 'target': found {target[row]:g} where {expected[row]:.0f} should follow",
                    file=str(file), line=int(line[row]),
                    hint="one row a target, counted up without gaps, as correct --offsets writes them")


def _added_not_sent(table: Table, offset: Array) -> list[Finding]:
    """What the targets of the corrected program that the planned one does not have cost: how far their own offsets are off the
    straight line between those (N, 3) [m] that are sent; of a file that does not tell them half of the step over a move. A
    note, and a warning where they stand in many moves."""
    added = added_of(table)
    if added is None:
        return []
    beside = added.share < 1
    before, share = added.given[beside], added.share[beside, None]
    moves = np.unique(before)
    moved = np.linalg.norm(offset, axis=1) > 0
    corrected = len(np.union1d(moves, np.flatnonzero(moved | np.append(False, moved[:-1]))))
    start, way = offset[np.maximum(before - 1, 0)], offset[before] - offset[np.maximum(before - 1, 0)]
    own = added_offsets(table)
    off = 0.5 * way if own is None else 1e-3 * own - start - share * way
    step = np.zeros(len(offset))
    np.maximum.at(step, before, 1e6 * np.linalg.norm(np.nan_to_num(off), axis=1))
    step = step[moves]
    many = len(moves) > MANY_MOVES * corrected
    return [Finding("CS5008", "warning" if many else "note", f"in {len(moves)} of {counted(corrected, 'move')} from or to a "
                    "corrected target the correction changes on the way, and only those of the planned program are sent: there "
                    f"the tool goes straight, off by up to about {step.max():.0f} um at the worst, "
                    f"{np.median(step):.0f} um in the middle", file=table.source,
                    line=int(table.line[moves[int(np.argmax(step))]]),
                    hint="correct --keep-targets makes offsets for the planned program and says what they leave; or run the "
                    "corrected program")]


def _turn_not_sent(target: Array, turn: Array, reach_mm: float, file: str | Path) -> Finding:
    """What is left because only positions are sent."""
    if not np.isfinite(turn).any():
        return Finding("CS5007", "note", "the file does not say by how much the correction turns the tool; only positions are "
                       "sent, and the error that leaves is not known", file=str(file),
                       hint="push the file that correct --offsets writes")
    worst = int(np.nanargmax(turn))
    left = left_um(float(turn[worst]), reach_mm)
    return Finding("CS5005", "note", "only positions are sent: the tool stays turned by up to "
                   f"{np.degrees(turn[worst]):.4f} deg (target {int(target[worst])}); the TCP itself lies right, "
                   f"{reach_mm:g} mm from it up to {left:.1f} um are left",
                   file=str(file), hint="name the distance of the cutting edge from the TCP with --reach; the corrected RAPID "
                   "program carries the orientation too")


def left_um(turn: float, reach_mm: float) -> float:
    """How far a point of the tool `reach_mm` from the TCP stays off, at most, when the tool is turned by `turn` [rad]."""
    return 2e3 * reach_mm * float(np.sin(turn / 2))

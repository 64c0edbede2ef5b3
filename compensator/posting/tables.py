"""Toolpaths as tables (CSV, Parquet): a row a target, in the work object (docs/formats.md#toolpaths)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from compensator.posting.campath import CamPath
from compensator.toolpath import Move
from identification.common.arrays import Array
from identification.common.findings import CompstiffError, Finding, error
from identification.common.tables import Table, read_table

POSITION, QUATERNION = ("x_mm", "y_mm", "z_mm"), ("q1", "q2", "q3", "q4")
CONFDATA, JOINTS = ("cf1", "cf4", "cf6", "cfx"), tuple(f"q{axis}_deg" for axis in range(1, 7))
# A quaternion off the unit by more than this is refused, by more than the second one reported.
UNUSABLE, SLIGHT = 1e-3, 1e-5
LARGEST_CONFDATA = 7


def read_cam_table(file: Path, feed: float) -> CamPath:
    """Reads a toolpath table. feed [m/s]: taken where the file has no `feed_mm_s`.

    Raises CompstiffError: what `read_table` raises, CS2150 (feed), CS2151 (quaternion), CS2152 (confdata), CS2154 (no rows).
    """
    table = read_table(file, required=(*POSITION, *QUATERNION), optional=("feed_mm_s", "rapid", *CONFDATA, *JOINTS),
                       may_be_empty=("feed_mm_s",), together=(CONFDATA, JOINTS))
    count = len(table)
    if not count:
        raise error("CS2154", "the table has no row below its header", file=str(file), line=table.header_line,
                    hint="one row a target: x_mm y_mm z_mm q1 q2 q3 q4")
    findings = list(table.findings)
    rapid = _flags(table)
    quaternion = _quaternions(table, findings)
    joints = np.radians(table.stack(*JOINTS)) if JOINTS[0] in table.numbers else None
    return CamPath(
        source=str(file), form="CSV", move=np.full(count, Move.LINEAR, dtype=np.uint8), line=table.line.astype(np.int64),
        position=1e-3 * table.stack(*POSITION), axis=None, quaternion=quaternion, rapid=rapid,
        feed=_feeds(table, rapid, feed, findings), stop=np.zeros(count, dtype=bool), confdata=_confdata(table), joints=joints,
        remarks={}, findings=tuple(findings))


def _flags(table: Table) -> NDArray[np.bool_]:
    values = table.numbers.get("rapid", np.zeros(len(table)))
    wrong = np.flatnonzero((values != 0) & (values != 1))
    if len(wrong):
        raise _at(table, "CS2152", int(wrong[0]), "rapid", f"found {values[wrong[0]]:g}, expected 1 (in the air) or 0",
                  "mark moves in the air with 1")
    return np.asarray(values == 1)


def _feeds(table: Table, rapid: NDArray[np.bool_], assumed: float, findings: list[Finding]) -> Array:
    """Feed (N,) [m/s], NaN where rapid."""
    if "feed_mm_s" not in table.numbers:
        findings.append(Finding(
            "CS2150", "warning", f"no column feed_mm_s: {1e3 * assumed:g} mm/s is assumed for every cut", table.source,
            hint="add feed_mm_s, or give --feed-mm-s"))
        return np.where(rapid, np.nan, assumed)
    feed = table.numbers["feed_mm_s"]
    wrong = np.flatnonzero(~rapid & ~(feed > 0))
    if len(wrong):
        raise _at(table, "CS2150", int(wrong[0]), "feed_mm_s", "found "
                  + ("an empty cell" if np.isnan(feed[wrong[0]]) else f"{feed[wrong[0]]:g}") + ", expected a feed above zero",
                  "only rows with rapid = 1 may leave the feed empty")
    return np.where(rapid, np.nan, 1e-3 * feed)


def _quaternions(table: Table, findings: list[Finding]) -> Array:
    """Unit quaternions (N, 4) w x y z."""
    values = table.stack(*QUATERNION)
    length = np.linalg.norm(values, axis=1)
    off = np.abs(length - 1)
    worst = int(np.argmax(off))
    if off[worst] > UNUSABLE:
        first = int(np.argmax(off > UNUSABLE))
        raise _at(table, "CS2151", first, "q1", f"the quaternion has length {length[first]:.6g}, expected 1 within "
                                                f"{UNUSABLE:g}",
                  "q1 q2 q3 q4 are w x y z of a unit quaternion")
    if off[worst] > SLIGHT:
        findings.append(Finding("CS2151", "note", f"quaternions are off the unit by up to {off[worst]:.2g} and were normalised",
                                table.source, int(table.line[worst]), table.column("q1"), count=int((off > SLIGHT).sum())))
    return np.asarray(values / length[:, None])


def _confdata(table: Table) -> NDArray[np.int64] | None:
    if CONFDATA[0] not in table.numbers:
        return None
    values = table.stack(*CONFDATA)
    wrong = (values != np.round(values)) | (np.abs(values) > LARGEST_CONFDATA)
    wrong[:, 3] |= values[:, 3] < 0
    if wrong.any():
        row, column = (int(index) for index in np.argwhere(wrong)[0])
        raise _at(table, "CS2152", row, CONFDATA[column], f"found {values[row, column]:g}, expected a whole number from "
                  f"{0 if column == 3 else -LARGEST_CONFDATA} to {LARGEST_CONFDATA}", "cf1 cf4 cf6 are quadrants, cfx 0 to 7")
    return values.astype(np.int64)


def _at(table: Table, code: str, row: int, column: str, message: str, hint: str) -> CompstiffError:
    return error(code, f"column '{column}': {message}", file=table.source, line=int(table.line[row]),
                 column=table.column(column), hint=hint)

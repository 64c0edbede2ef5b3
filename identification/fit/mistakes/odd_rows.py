"""Rows of a table of load tests that fit no springs which fit the others: told without a fit."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from identification.common.findings import counted
from identification.fit.load_test import LoadTest
from identification.model.compliance import regressor

Array = NDArray[np.float64]
Rows = NDArray[np.bool_]
# A row is off where this share of what was read, or of what the springs make, is left; what noise, friction, play and the like
# leave of a reading is less (engineering judgement, held against benchmarks/mistakes.py look). Small readings are measured
# by this part of the middle one, and by so many sigmas.
OFF, SMALL, SIGMAS = 0.5, 0.5, 10.0
# The share from which a row counts little for the springs, from loose to tight: so the likeliest of several sets of springs,
# which each fit a part of the rows, wins wherever the first fit of all rows stood.
SHARES = (2.0, 1.4, 1.0, 0.7, 0.5, 0.35, 0.25, 0.18, 0.13, 0.1, 0.1, 0.1)
# Fewer rows than these fit springs of their own, and of more than this share none are told from the others.
FEWEST, MOST = 4, 0.5
# So many places in a file are named.
NAMED = 4


def odd_rows(data: LoadTest) -> Rows:
    """Rows (n,) that fit no springs which fit the others; none where those are not the most. data: rows with a load and a
    reading."""
    rows, nothing = data.rows, np.zeros(len(data.rows), dtype=bool)
    if len(rows) < FEWEST:
        return nothing
    columns = regressor(data.cell.robot, rows.theta, data.cell.flange_from_tcp, rows.wrench)[:, :3]
    columns = np.where(np.isnan(rows.deflection)[:, :, None], 0.0, columns)
    readings = np.nan_to_num(rows.deflection)
    sizes = np.linalg.norm(readings, axis=1)
    expected = np.linalg.norm(columns @ (1 / data.prior.prior.stiffness), axis=1)
    noise = np.sqrt(data.cell.noise.deflection**2 + np.nan_to_num(data.cell.noise.pose_offset) ** 2)
    least = max(SMALL * float(np.median(sizes)), SIGMAS * float(np.linalg.norm(noise)))
    # Rows count alike by what was read, which keeps those ten times too large down, or by what the prior's springs make of
    # their loads, which keeps those ten times too small down: whichever leaves the fewest off.
    each = [_off(columns, readings, least, scale) for scale in (
        np.maximum(sizes, least), np.maximum(expected, SMALL * float(np.median(expected))))]
    off = min(each, key=np.count_nonzero)
    enough = np.count_nonzero(~off) >= max(FEWEST, (1 - MOST) * len(rows)) and len(np.unique(rows.visit[~off])) > 1
    return off if enough else nothing


def _off(columns: Array, readings: Array, least: float, scale: Array) -> Rows:
    """Rows (n,) that springs do not fit which fit the most others: columns (n, 3, 6), readings (n, 3) [m], and by what size
    (n,) each is divided before it counts."""
    from scipy.optimize import nnls

    size = np.linalg.norm(columns.reshape(-1, 6), axis=0)
    columns = columns / np.where(size > 0, size, 1.0)
    count, sizes = 1 / np.where(scale > 0, scale, np.inf), np.linalg.norm(readings, axis=1)
    weight, share = np.ones(len(readings)), np.zeros(len(readings))
    for loose in SHARES:
        scaled = (weight * count)[:, None]
        springs = nnls((columns * scaled[:, :, None]).reshape(-1, 6), (readings * scaled).reshape(-1))[0]
        made = columns @ springs
        share = np.linalg.norm(readings - made, axis=1) / np.maximum(np.maximum(sizes, np.linalg.norm(made, axis=1)), least)
        weight = 1 / (1 + (share / loose) ** 2)
    return np.asarray(share > OFF)


def where(data: LoadTest, rows: Rows, every: int = 1) -> str:
    """These rows in words: how many of how many, and on which lines of the file. every: of so many rows one is looked at."""
    line = np.flatnonzero(rows)
    runs = np.split(line, np.flatnonzero(np.diff(line) > 1) + 1)
    words = []
    for run in runs[:NAMED]:
        first, last = (int(data.rows.line[index]) for index in (run[0], run[-1]))
        words.append(f"{first}" if first == last else f"{first} to {last}")
    more = f" and {counted(len(runs) - NAMED, 'more place')}" if len(runs) > NAMED else ""
    looked_at = "with a load" if every == 1 else "that were looked at"
    lines = "line" if len(line) == 1 else "lines"
    return f"{len(line)} of {counted(len(rows), 'row')} {looked_at} ({lines} {', '.join(words)}{more})"

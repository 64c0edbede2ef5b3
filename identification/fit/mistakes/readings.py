"""How readings and loads were written down: from another zero, step by step, without their signs, without whole turns."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from identification.common.arrays import rms
from identification.fit.load_test import LoadTest
from identification.fit.mistakes.mistake import Mistake, table_mistake
from identification.fit.noise import USUAL_OFFSET_M
from identification.model.compliance import regressor

Array = NDArray[np.float64]
UNLOADED = "the first reading of a pose, without a load, is its zero: take it off the others"
STEPS = "a row holds the whole load and all that the tool moved since the unloaded reading of its pose"
SIGNS = "hold two rows with opposite loads against the sheet that was written at the robot"
# First readings without a load that are so many times their noise from zero, over all poses, are none that was taken off.
UNLIKE_SEATING = 10.0
# Readings of one gauge in so many visits that are all its largest, to so many times its noise, are the end of its travel.
FEW_VISITS, AT_THE_END = 3, 6.0
# Of a gauge's readings that many at most are at its end.
SOME_STOPPED = 0.5
# What the large hand of a dial gauge counts in one turn [m] (engineering judgement: a hundred divisions of 1, 5 or 10 um, or
# two hundred of 1 um).
TURNS = (1e-4, 2e-4, 5e-4, 1e-3)
# Of loaded rows so many have another sign when their signs are found anew, or whole turns more.
SOME = 0.1
# What springs let expect is counted from so many times the prior's on, tried in so many steps; by the smallest readings first,
# then these parts of them: what is small lacks no turn. Springs that these do not tell stay as they were (a share of what all
# readings tell).
SOFTER, TRIED, PARTS, KEPT = 6.0, 8, (0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.0, 1.0, 1.0), 0.03


def reading_mistakes(data: LoadTest) -> list[Mistake]:
    """Those that the rows have room for."""
    rows, found = data.rows, []
    loaded = np.any(rows.wrench[:, :3] != 0, axis=1)
    visits, first = np.unique(rows.visit, return_index=True)
    if _far_from_zero(data, first):
        found.append(table_mistake(
            "readings_raw", "the unloaded reading of a pose seems not to be taken off the others in {rows}", UNLOADED,
            lambda other: {"deflection": _from_unloaded(other)}))
    if len(rows) > len(visits):
        found.append(table_mistake(
            "readings_stepwise", "the readings seem to be what each step changed, not what changed since the unloaded one, in "
            "{rows}", STEPS, lambda other: {"deflection": _summed(other, other.rows.deflection)}))
        found.append(table_mistake(
            "forces_stepwise", "the forces seem to be what each step added, not the whole load, in {rows}", STEPS,
            lambda other: {"wrench": _summed(other, other.rows.wrench)}))
    if np.all(rows.wrench >= 0) and _share(_with_signs(data)["wrench"] != rows.wrench, loaded) >= SOME:
        found.append(table_mistake("forces_unsigned", "the forces seem to be written without their signs in {rows}", SIGNS,
                                   _with_signs))
    if np.nanmin(rows.deflection, initial=0.0) >= 0:
        found.append(table_mistake("deflections_unsigned", "the deflections seem to be written without their signs in {rows}",
                                   SIGNS, lambda other: {"deflection": _mended(other, _signed)}))
    largest = np.nanmax(np.abs(rows.deflection), axis=0, initial=0.0)
    stopped = _at_the_end(data, largest)
    # Gauges of one kind end alike.
    alike = np.abs(largest - largest[:, None]) <= AT_THE_END * np.broadcast_to(data.cell.noise.deflection, 3)
    visits_at_end = np.array([len(np.unique(rows.visit[stopped[:, same].any(axis=1)])) for same in alike])
    # One that reads the same in most rows is unplugged, or stuck.
    ends = np.where((visits_at_end >= FEW_VISITS) & (stopped.mean(axis=0) < SOME_STOPPED), largest, np.inf)
    if np.isfinite(ends).any():
        told = " and ".join(f"{stopped[:, k].sum()} readings of d{'xyz'[k]} of {1e6 * ends[k]:.0f} um"
                            for k in np.flatnonzero(np.isfinite(ends)))
        found.append(table_mistake(
            "readings_clipped", f"{told}, the largest in {{rows}}, seem to be the end of a gauge's travel",
            "push a gauge to its end by hand and read it: what is that large is no reading",
            lambda other: {"deflection": np.where(_at_the_end(other, ends), np.nan, other.rows.deflection)}))
    found += [lacking for turn in TURNS if 0.5 * turn < largest.max() < turn
              and _share((lacking := _lacking(turn)).mended(data).rows.deflection != rows.deflection, loaded) >= SOME]
    return found


def _far_from_zero(data: LoadTest, first: NDArray[np.intp]) -> bool:
    """Whether the first readings of all visits (V,), none under a load and each the reference of its own visit, are farther
    from zero than any re-seating takes them."""
    rows, noise = data.rows, data.cell.noise
    if np.any(rows.wrench[first, :3] != 0) or len(np.unique(rows.reference[first])) < len(first):
        return False
    read = ~np.isnan(rows.deflection[first])
    usual = np.broadcast_to(np.fmax(noise.deflection, noise.pose_offset if noise.offset_stated else USUAL_OFFSET_M), read.shape)
    return bool(read.any()) and rms(rows.deflection[first][read] / usual[read]) > UNLIKE_SEATING


def _at_the_end(data: LoadTest, largest: Array) -> NDArray[np.bool_]:
    """Readings (n, 3) that are no smaller than the largest (3,) of their gauge, but for the sensor's noise."""
    noise = np.fmax(np.nan_to_num(data.rows.sigma), data.cell.noise.deflection)
    return np.nan_to_num(np.abs(data.rows.deflection)) > largest - AT_THE_END * noise


def _lacking(turn: float) -> Mistake:
    def whole(readings: Array, expected: Array) -> Array:
        return readings + turn * np.round((expected - readings) / turn)

    return table_mistake(
        "readings_turns", f"the readings seem to lack whole turns of {1e6 * turn:.0f} um (the small hand of the gauges) in "
        "{rows}", "read the small hand, too: no reading may be larger than one turn where it was not",
        lambda data: {"deflection": _mended(data, whole)})


def _share(changed: NDArray[np.bool_], loaded: NDArray[np.bool_]) -> float:
    return float(changed[loaded].any(axis=1).mean()) if loaded.any() else 0.0


def _from_unloaded(data: LoadTest) -> Array:
    """Readings (n, 3) from the mean of those of the same visit without a load."""
    rows = data.rows
    visit = np.unique(rows.visit, return_inverse=True)[1]
    zero = np.zeros((visit.max() + 1, 3))
    count = np.zeros_like(zero)
    unloaded = ~np.any(rows.wrench[:, :3] != 0, axis=1, keepdims=True) & ~np.isnan(rows.deflection)
    np.add.at(zero, visit, np.where(unloaded, rows.deflection, 0.0))
    np.add.at(count, visit, unloaded)
    return np.asarray(rows.deflection - (zero / np.maximum(count, 1))[visit])


def _summed(data: LoadTest, steps: Array) -> Array:
    """Columns (n, k) summed up along each visit."""
    total = np.cumsum(np.nan_to_num(steps), axis=0)
    _, first, number = np.unique(data.rows.visit, return_index=True, return_inverse=True)
    before = np.where((first > 0)[:, None], total[first - 1], 0.0)[number]
    return np.where(np.isnan(steps), np.nan, total - before)


def _with_signs(data: LoadTest) -> dict[str, Array]:
    """Forces that do work on the tool: springs yield with the load, not against it."""
    work = np.einsum("ni,ni->n", data.rows.wrench[:, :3], np.nan_to_num(data.rows.deflection))
    return {"wrench": data.rows.wrench * np.where(work < 0, -1.0, 1.0)[:, None]}


def _signed(readings: Array, expected: Array) -> Array:
    return np.where(expected < 0, -readings, readings)


def _mended(data: LoadTest, mend: Callable[[Array, Array], Array]) -> Array:
    """Readings (n, 3) mended by what springs let expect of them, and these by the mended readings, in turn; of the springs that
    this comes to from softer and stiffer ones those that fit best."""
    from scipy.optimize import nnls

    rows, cell = data.rows, data.cell
    read = ~np.isnan(rows.deflection)
    columns = regressor(cell.robot, rows.theta, cell.flange_from_tcp, rows.wrench)[:, :3][read] / data.prior.prior.stiffness
    readings, kept = rows.deflection[read], np.diag(KEPT * np.linalg.norm(columns, axis=0))
    best, least = readings, np.inf
    for times in np.geomspace(1 / SOFTER, SOFTER, TRIED):
        springs = np.full(6, times)
        for part in PARTS:
            size, mended = np.abs(columns) @ springs, mend(readings, columns @ springs)
            small = size <= np.quantile(size, part)
            springs = nnls(np.vstack([columns[small], kept]), np.concatenate([mended[small], kept @ springs]))[0]
        mended = mend(readings, columns @ springs)
        left = float(np.sum((mended - columns @ springs) ** 2))
        if left < least:
            best, least = mended, left
    found = rows.deflection.copy()
    found[read] = best
    return found

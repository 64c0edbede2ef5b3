"""What a cause of fourth_world may change, and the load test that is run with it.

Used by: python benchmarks/fourth_world.py CASES SEED FOLDER
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from fourth_arm import Arm, Array, Flex, GearLaw, Load, State, linear_columns
from fourth_bench import Bench, Random, Row


@dataclass
class Seen:
    """Readings on their way from the tool to the table: one row each."""

    moved: Array  # m, base frame
    turned: Array  # rotation vectors of the tool, base frame
    place: Array  # TCP in the base frame
    rotation: Array  # of the tool
    force: Array  # as it acts


@dataclass
class Hidden:
    """One cause. Each hook takes the size first; what is None stays as it is."""

    words: str
    joint: str
    unit: str
    low: float
    high: float
    gears: Callable[[float], dict[int, GearLaw]] | None = None
    flexes: Callable[[float], list[Flex]] | None = None
    stiffness: Callable[[float, Row], Array] | None = None  # share of each spring
    load: Callable[[float, Row, Load, State], Load] | None = None  # last: the arm before it is loaded
    rest: Callable[[float, Row], Load] | None = None  # what pulls at the zero reading
    angles: Callable[[float, Row], Array] | None = None  # where the robot stands, in place of Row.q
    arm: Callable[[float, Arm], Arm] | None = None
    stop: Callable[[float, Row], tuple[Array, float, float] | None] | None = None  # direction, gap [m], stiffness [N/m]
    read: Callable[[float, Seen, list[Row]], Array] | None = None
    table: Callable[[float, pd.DataFrame], pd.DataFrame] | None = None
    cell: Callable[[float, dict[str, Any]], dict[str, Any]] | None = None
    scaled: bool = True
    extra: dict[str, Any] = field(default_factory=dict)


def run(bench: Bench, hidden: Hidden | None, size: float, rng: Random | None) -> Seen:
    """Run the load test; without a random stream, without noise of the force."""
    h = hidden or Hidden("", "", "", 0, 0)
    arm = bench.arm if h.arm is None else h.arm(size, bench.arm)
    laws = [GearLaw() for _ in range(6)]
    for joint, law in (h.gears(size) if h.gears else {}).items():
        laws[joint] = law
    remember = any(law.memory for law in laws)
    flexes = h.flexes(size) if h.flexes else []
    zeros: dict[int, State] = {}
    clock, last_visit = 0.0, -1
    out: list[tuple[Array, ...]] = []
    for row in bench.rows:
        q = row.q if h.angles is None else h.angles(size, row)
        shares = np.ones(6) if h.stiffness is None else h.stiffness(size, row)

        def settle(load: Load, seconds: float, q: Array = q, k: Array = arm.k * shares) -> State:
            return arm.settle(q, load, lambda j, t: laws[j].twist(t, k[j], q, seconds), flexes)

        if row.visit not in zeros:
            rest = h.rest(size, row) if h.rest else Load(np.zeros(3))
            first = settle(rest, 0.0)
            for i, law in enumerate(laws):
                law.arrive(first.torques[i], arm.k[i], bench.approach[row.visit, i])
            zeros[row.visit] = settle(rest, 0.0)
        zero = zeros[row.visit]
        force = row.force.copy()
        if rng is not None and np.any(force):
            force = force * (1 + rng.normal(0, bench.force_share, 3)) + rng.normal(0, bench.force_noise, 3) * (row.mass is None)
        load = Load(force, row.moment.copy())
        if h.load:
            load = h.load(size, row, load, zero)
        if remember:
            pause = max(row.time - clock - row.dwell, 0.0) / len(row.way) if row.visit == last_visit else 0.0
            for step in row.way:
                state = settle(Load(step), 0.0)
                for i, law in enumerate(laws):
                    law.commit(state.torques[i], arm.k[i], pause)
            clock, last_visit = row.time, row.visit
        state = settle(load, row.dwell)
        if remember:
            for i, law in enumerate(laws):
                law.commit(state.torques[i], arm.k[i], row.dwell)
        if h.stop and (stop := h.stop(size, row)) is not None:
            state = against(stop, load, zero, state, partial(settle, seconds=row.dwell))
        turned = state.rotation @ zero.rotation.T
        spin = 0.5 * np.array([turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]])
        out.append((state.place - zero.place, spin, zero.place, zero.rotation, load.force))
    return Seen(*(np.array(column) for column in zip(*out, strict=True)))


def against(stop: tuple[Array, float, float], load: Load, zero: State, free: State, settle: Callable[[Load], State]) -> State:
    """The tool meets something: the force of contact by bisection."""
    direction, gap, stiffness = stop
    reach = float(direction @ (free.place - zero.place)) - gap
    if reach <= 0:
        return free
    low, high = 0.0, reach * stiffness
    state = free
    for _ in range(18):
        push = 0.5 * (low + high)
        state = settle(Load(load.force - push * direction, load.moment, load.lever))
        if stiffness * (float(direction @ (state.place - zero.place)) - gap) > push:
            low = push
        else:
            high = push
    return state


def write_table(bench: Bench, hidden: Hidden | None, size: float, seen: Seen, rng: Random | None) -> pd.DataFrame:
    """measurements.csv: the readings with their noise, and what people make of them."""
    moved = seen.moved if hidden is None or hidden.read is None else hidden.read(size, seen, bench.rows)
    readings = moved * 1e6
    if rng is not None:
        noise = rng.standard_t(4, readings.shape) / np.sqrt(2) if bench.tails else rng.normal(size=readings.shape)
        seats = rng.normal(0, bench.reseat, (bench.rows[-1].visit + 1, 3))
        readings = readings + noise * bench.sigma + seats[[r.visit for r in bench.rows]]
        readings = np.round(readings / bench.step) * bench.step
    rows = bench.rows
    table = pd.DataFrame(np.degrees([r.q for r in rows]).round(3), columns=[f"q{i}_deg" for i in range(1, 7)])
    hung = np.array([r.mass is not None for r in rows])
    force, moment = np.array([r.force for r in rows]), np.array([r.moment for r in rows])
    if not hung.all():
        for i, name in enumerate(("fx_n", "fy_n", "fz_n")):
            table[name] = np.where(hung, np.nan, force[:, i])
    if np.any(moment):
        for i, name in enumerate(("mx_nm", "my_nm", "mz_nm")):
            table[name] = moment[:, i]
    if hung.any():
        table["mass_kg"] = [r.mass for r in rows]
    for i, name in enumerate(("dx_um", "dy_um", "dz_um")):
        table[name] = readings[:, i].round(1) + 0.0
    table["time_s"] = [r.time for r in rows]
    table["dwell_s"] = [r.dwell for r in rows]
    table["pose"] = [bench.labels[r.visit] for r in rows]
    if bench.per_visit:
        table["reference"] = [r.visit + 1 for r in rows]
    if hidden is not None and hidden.table is not None:
        table = hidden.table(size, table)
    return table


def left_over(bench: Bench, arm: Arm, table: pd.DataFrame) -> float:
    """RMS [um] of what the best six springs leave of a table without noise, read as it is written."""
    q = np.radians(table[[f"q{i}_deg" for i in range(1, 7)]].to_numpy(float))
    force = table.get(["fx_n", "fy_n", "fz_n"]) if "fx_n" in table else None
    loads = np.zeros((len(table), 3)) if force is None else np.nan_to_num(force.to_numpy(float))
    if "mass_kg" in table:
        loads[:, 2] -= 9.80665 * np.nan_to_num(table["mass_kg"].to_numpy(float))
    moments = table[["mx_nm", "my_nm", "mz_nm"]].to_numpy(float) if "mx_nm" in table else np.zeros_like(loads)
    columns = np.array([linear_columns(arm, *row) for row in zip(q, loads, moments, strict=True)]).reshape(-1, 6)
    wanted = table[["dx_um", "dy_um", "dz_um"]].to_numpy(float).reshape(-1)
    kept = np.isfinite(wanted)
    scale = np.maximum(np.linalg.norm(columns[kept], axis=0), 1e-30)
    best = np.linalg.lstsq(columns[kept] / scale, wanted[kept], rcond=1e-9)[0]
    return float(np.sqrt(np.mean((wanted[kept] - columns[kept] / scale @ best) ** 2)))

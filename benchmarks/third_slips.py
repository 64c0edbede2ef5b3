"""What the third judge's people get wrong in table and cell file (third_world.py)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from benchmarks.third_arm import DEGREE, rotation
from benchmarks.third_causes import one_visit
from benchmarks.third_gears import Array
from benchmarks.third_trial import Hide, Row, Trial, into

MISTAKES: dict[str, Hide] = {}
mistake = into(MISTAKES)


def each(trial: Trial, change: Callable[[Row], None], where: Callable[[Row], bool] = lambda row: True) -> None:
    """Changes the rows, or those where that holds."""
    def slip(rows: list[Row]) -> None:
        for row in filter(where, rows):
            change(row)

    trial.slips.append(slip)


def at(visit: int) -> Callable[[Row], bool]:
    return lambda row: row.visit == visit


def since(visit: int) -> Callable[[Row], bool]:
    return lambda row: row.visit >= visit


def angles_of(rows: list[Row], visit: int) -> Array:
    return next(row.q for row in rows if row.visit == visit).copy()


def once_round_um(trial: Trial) -> float:
    """What a dial shows in one turn."""
    return 1000.0 if trial.noise.step == 10 else 200.0


# ------------------------------------------------------------------ readings
@mistake
def row_skipped(trial: Trial, size: float) -> tuple[str, set[str]]:
    visit = one_visit(trial)

    def slip(rows: list[Row]) -> None:
        own = [row for row in rows if row.visit == visit]
        read = [row.reading for row in own]
        for row, reading in zip(own, read[:2] + read[3:] + read[-1:], strict=True):
            row.reading = reading

    trial.slips.append(slip)
    return f"visit {visit + 1}: a reading skipped, the rest of the visit shifted up, last doubled", {"*", "bad_visit"}


@mistake
def rows_shifted(trial: Trial, size: float) -> tuple[str, set[str]]:
    first = int(trial.rng.integers(len(trial.rows) // 4, len(trial.rows) // 2))

    def slip(rows: list[Row]) -> None:
        read = [row.reading for row in rows]
        for row, reading in zip(rows, [*read[:first], read[first - 1], *read[first:-1]], strict=True):
            row.reading = reading

    trial.slips.append(slip)
    return f"readings one row late from row {first + 1} to the end", {"*"}


def scaled(gauge: int, factor: float) -> Callable[[Row], None]:
    """A gauge's reading times a factor."""
    def change(row: Row) -> None:
        row.reading[gauge] *= factor

    return change


@mistake
def reversed_part(trial: Trial, size: float) -> tuple[str, set[str]]:
    gauge = int(trial.rng.integers(3))
    first = trial.visits // 2 if trial.rng.random() < .5 else trial.visits * 2 // 3
    each(trial, scaled(gauge, -1), since(first))
    return f"gauge {'xyz'[gauge]} reversed from visit {first + 1} on", {"*"}


# ------------------------------------------------------------------ angles
@mistake
def neighbour_pose(trial: Trial, size: float) -> tuple[str, set[str]]:
    visit, q = one_visit(trial), trial.poses(1)[0]

    def change(row: Row) -> None:
        row.q = q.copy()

    each(trial, change, at(visit))
    return f"visit {visit + 1}: angles of a pose of another plan", {"*", "bad_visit"}


@mistake
def angle_slip(trial: Trial, size: float) -> tuple[str, set[str]]:
    visit, joint = one_visit(trial), int(trial.rng.integers(1, 5))

    def change(row: Row) -> None:
        row.q[joint] += 10

    each(trial, change, at(visit))
    return f"visit {visit + 1}: q{joint + 1} is 10 deg too large", {"*", "bad_visit", f"encoder_zero[{joint + 1}]"}


@mistake
def sign_of_angle(trial: Trial, size: float) -> tuple[str, set[str]]:
    visit, joint = one_visit(trial), int(trial.rng.choice([3, 5, 0]))

    def change(row: Row) -> None:
        row.q[joint] *= -1

    each(trial, change, at(visit))
    return f"visit {visit + 1}: q{joint + 1} without its minus", {"*", "bad_visit"}


# ------------------------------------------------------------------ single rows and visits
def heavier(row: Row, factor: float) -> None:
    """The mass and the force that are written, times a factor."""
    row.force, row.mass = row.force * factor, None if row.mass is None else row.mass * factor


@mistake
def other_stack(trial: Trial, size: float) -> tuple[str, set[str]]:
    visit = one_visit(trial)
    each(trial, lambda row: heavier(row, 0.5), lambda row: row.visit == visit and row.loaded)
    return f"visit {visit + 1}: loads written half (the other stack)", {"*", "bad_visit"}


@mistake
def comma_slip(trial: Trial, size: float) -> tuple[str, set[str]]:
    number = int(trial.rng.choice([k for k, row in enumerate(trial.rows) if row.loaded and not row.validate]))
    gauge = int(trial.rng.integers(3))
    trial.slips.append(lambda rows: scaled(gauge, 0.1)(rows[number]))
    return f"row {number + 1}: d{'xyz'[gauge]} a tenth (comma)", {"*", "sensor_step", "bad_visit"}


@mistake
def once_round(trial: Trial, size: float) -> tuple[str, set[str]]:
    turn, visit, gauge = once_round_um(trial), one_visit(trial), int(trial.rng.integers(3))

    def slip(rows: list[Row]) -> None:
        own = [row.reading for row in rows if row.visit == visit]
        large = 0.5 * max(abs(reading[gauge]) for reading in own)
        for reading in own:
            if abs(reading[gauge]) > large:
                reading[gauge] -= turn * np.sign(reading[gauge])

    trial.slips.append(slip)
    return (f"visit {visit + 1}: gauge {'xyz'[gauge]} once round, {turn:.0f} um not counted at the larger loads",
            {"*", "bad_visit", "sensor_step"})


@mistake
def always_round(trial: Trial, size: float) -> tuple[str, set[str]]:
    turn = once_round_um(trial)

    def change(row: Row) -> None:
        row.reading = [float(np.sign(read) * (abs(read) % turn)) for read in row.reading]

    each(trial, change)
    return f"small hand never read: all readings modulo {turn:.0f} um", {"*"}


# ------------------------------------------------------------------ tools and frames
@mistake
def other_tool(trial: Trial, size: float) -> tuple[str, set[str]]:
    off = np.array([[0, 0, 100], [-60, 0, 0], [0, 80, 0]])[trial.rng.integers(3)]

    def slip(rows: list[Row]) -> None:
        trial.named_tool_mm = trial.tool_mm + off

    trial.slips.append(slip)
    return f"cell.yaml has the TCP of another tool: {off} mm off", {"*", "tool_point", "reading_point"}


def into_tool(trial: Trial, row: Row) -> Array:
    return trial.arm.chain(trial.arm.serial(row.q))[1][:3, :3].T


@mistake
def tool_frame(trial: Trial, size: float) -> tuple[str, set[str]]:
    def change(row: Row) -> None:
        row.force, row.mass = into_tool(trial, row) @ row.force, None

    each(trial, change, lambda row: row.loaded)
    return "forces written in the tool frame", {"*"}


@mistake
def reading_in_tool_frame(trial: Trial, size: float) -> tuple[str, set[str]]:
    def change(row: Row) -> None:
        row.reading = list(into_tool(trial, row) @ row.reading)

    each(trial, change)
    return "deflections in the tool frame", {"*"}


# ------------------------------------------------------------------ copies
@mistake
def copied_row(trial: Trial, size: float) -> tuple[str, set[str]]:
    pairs = enumerate(zip(trial.rows, trial.rows[1:], strict=False), 1)
    number = int(trial.rng.choice([k for k, (before, row) in pairs if before.visit == row.visit and not row.validate
                                   and np.linalg.norm(row.force - before.force) > 0]))

    def slip(rows: list[Row]) -> None:
        rows[number].reading = list(rows[number - 1].reading)

    trial.slips.append(slip)
    return f"row {number + 1} has the readings of the row before", {"*", "sensor_step", "bad_visit"}


@mistake
def copied_pose(trial: Trial, size: float) -> tuple[str, set[str]]:
    visit = one_visit(trial)

    def slip(rows: list[Row]) -> None:
        q = angles_of(rows, visit - 1)
        for row in filter(at(visit), rows):
            row.q = q.copy()

    trial.slips.append(slip)
    return f"visit {visit + 1}: angles copied from the visit before", {"*", "bad_visit"}


# ------------------------------------------------------------------ zeros and signs
@mistake
def unloaded_minus_loaded(trial: Trial, size: float) -> tuple[str, set[str]]:
    first = trial.visits // 2

    def change(row: Row) -> None:
        row.reading = [-read for read in row.reading]

    each(trial, change, since(first))
    return f"from visit {first + 1} on: unloaded minus loaded", {"*"}


@mistake
def increments(trial: Trial, size: float) -> tuple[str, set[str]]:
    def slip(rows: list[Row]) -> None:
        read = [row.reading for row in rows]
        for k in range(1, len(rows)):
            if rows[k].visit == rows[k - 1].visit:
                rows[k].reading = [now - before for now, before in zip(read[k], read[k - 1], strict=True)]

    trial.slips.append(slip)
    return "gauges set to zero at each step: increments written", {"*"}


@mistake
def raw_dial(trial: Trial, size: float) -> tuple[str, set[str]]:
    rng = np.random.default_rng(7)

    def slip(rows: list[Row]) -> None:
        zeros: dict[int, Array] = {}
        for row in rows:
            if row.visit not in zeros:
                zeros[row.visit] = rng.uniform(-300, 300, 3).round()
            row.reading = list(row.reading + zeros[row.visit])

    trial.slips.append(slip)
    return "dial's raw readings, zero reading not taken off", {"*", "sensor_step"}


# ------------------------------------------------------------------ columns
@mistake
def swapped_labels(trial: Trial, size: float) -> tuple[str, set[str]]:
    visit = one_visit(trial, before_last=1)

    def slip(rows: list[Row]) -> None:
        here, next_one = angles_of(rows, visit), angles_of(rows, visit + 1)
        for row in rows:
            row.q = {visit: next_one, visit + 1: here}.get(row.visit, row.q).copy()

    trial.slips.append(slip)
    return f"angles of visits {visit + 1} and {visit + 2} exchanged", {"*", "bad_visit"}


@mistake
def q46(trial: Trial, size: float) -> tuple[str, set[str]]:
    def change(row: Row) -> None:
        row.q[[3, 5]] = row.q[[5, 3]]

    each(trial, change)
    return "columns q4 and q6 exchanged", {"*"}


@mistake
def yz_part(trial: Trial, size: float) -> tuple[str, set[str]]:
    first = trial.visits * 2 // 3

    def change(row: Row) -> None:
        row.reading[1], row.reading[2] = row.reading[2], row.reading[1]

    each(trial, change, since(first))
    return f"gauges y and z exchanged from visit {first + 1} on", {"*"}


@mistake
def no_minus_force(trial: Trial, size: float) -> tuple[str, set[str]]:
    def change(row: Row) -> None:
        row.force, row.mass = np.abs(row.force), None

    each(trial, change)
    return "forces without their minus", {"*"}


# ------------------------------------------------------------------ units, frames and order
@mistake
def tenfold_part(trial: Trial, size: float) -> tuple[str, set[str]]:
    gauge, first = int(trial.rng.integers(3)), trial.visits // 2
    each(trial, scaled(gauge, 10), since(first))
    return f"gauge {'xyz'[gauge]}: divisions of another gauge, tenfold from visit {first + 1} on", {"*"}


@mistake
def inch_gauge(trial: Trial, size: float) -> tuple[str, set[str]]:
    gauge = int(trial.rng.integers(3))
    each(trial, scaled(gauge, 1 / 2.54))
    return f"gauge {'xyz'[gauge]} in 0.0001 inch taken for um x 1 (factor 1/2.54)", {"*", "deflection_sensor_gain"}


@mistake
def tracker_frame(trial: Trial, size: float) -> tuple[str, set[str]]:
    turned = float(trial.rng.choice([90, 180, 30, -45]))

    def change(row: Row) -> None:
        row.reading = list(rotation(np.array([0, 0, turned]) * DEGREE) @ row.reading)

    each(trial, change)
    return f"deflections in the tracker's frame, turned {turned:.0f} deg about z", {"*", "deflection_sensor_rotation"}


@mistake
def sorted_rows(trial: Trial, size: float) -> tuple[str, set[str]]:
    def slip(rows: list[Row]) -> None:
        times = [row.time for row in rows]
        rows.sort(key=lambda row: (row.visit, row.force.sum()))
        for row, time in zip(rows, times, strict=True):
            row.time = time

    trial.slips.append(slip)
    return "rows sorted by force within a visit (only the order)", {"adequate", "*"}


@mistake
def filled_in(trial: Trial, size: float) -> tuple[str, set[str]]:
    visit = one_visit(trial)

    def change(row: Row) -> None:
        row.reading = [0.0, 0.0, row.reading[2]]

    each(trial, change, at(visit))
    return f"visit {visit + 1}: gauges x and y were not read, zeros filled in", {"*", "bad_visit"}


@mistake
def kilograms_part(trial: Trial, size: float) -> tuple[str, set[str]]:
    first = trial.visits // 2

    def change(row: Row) -> None:
        if row.mass is None:
            row.force = np.round(row.force / 9.81, 1)
        else:
            heavier(row, 10)

    each(trial, change, lambda row: row.visit >= first and row.loaded)
    return f"from visit {first + 1} on forces in kg (or weights tenfold)", {"*"}


# ------------------------------------------------------------------ the robot
OTHER_ROBOT = {
    "irb6640-235-2.55": "irb6700-200-2.60", "irb6700-200-2.60": "irb6640-235-2.55", "irb6660-205-1.90": "irb6640-235-2.55",
    "irb4400-60": "irb6640-235-2.55", "kr210-r2700-extra": "kr60-ha", "kr60-ha": "kr210-r2700-extra",
    "r2000ic-210f": "m710ic-50", "m710ic-50": "r2000ic-210f"}


@mistake
def wrong_robot(trial: Trial, size: float) -> tuple[str, set[str]]:
    def slip(rows: list[Row]) -> None:
        trial.named = OTHER_ROBOT[trial.arm.name]

    trial.slips.append(slip)
    return f"robot in the cell is {OTHER_ROBOT[trial.arm.name]}", {"*"}


@mistake
def serial_angle(trial: Trial, size: float) -> tuple[str, set[str]]:
    def change(row: Row) -> None:
        row.q[2] += (-1 if trial.arm.rod else 1) * row.q[1]

    each(trial, change)
    return "q3 in the other convention (q3 -+ q2)", {"*"}

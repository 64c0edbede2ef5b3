"""Axes mixed up: signs, swapped columns, other frames than the robot's base, one column in another unit."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray

from identification.fit.load_test import LoadTest
from identification.fit.mistakes.mistake import Mistake, table_mistake
from identification.model.kinematics import forward

Array = NDArray[np.float64]
FORCE, DEFLECTION = "force", "deflection"
COLUMNS = {FORCE: ("fx", "fy", "fz"), DEFLECTION: ("dx", "dy", "dz")}
SETTLES = {
    FORCE: "push the tool along base +x, +y and +z by hand: forces are those that act on the tool",
    DEFLECTION: "jog the robot a little along base +x, +y and +z without force and read the sensors",
}
# Factors that a column may be off by, and how people say so.
FORCE_UNITS = ((1000.0, "in kN, not in N"), (10.0, "ten times too small"), (0.1, "ten times too large"),
               (9.80665, "in kgf, not in N"), (4.44822, "in lbf, not in N"), (0.001, "in mN, not in N"))
DEFLECTION_UNITS = ((1000.0, "in mm, not in um"), (10.0, "ten times too small"), (0.1, "ten times too large"),
                    (25.4, "in mil, not in um"), (0.001, "in nm, not in um"))


@cache
def signed_permutations() -> tuple[Array, ...]:
    """The 47 ways to mix up three axes and their signs: base = P table; not the identity."""
    found = [np.diag(signs)[list(order)] for order in permutations(range(3)) for signs in product((1.0, -1.0), repeat=3)]
    return tuple(matrix for matrix in found if not np.array_equal(matrix, np.eye(3)))


def axes_mistakes(data: LoadTest) -> list[Mistake]:
    """Forces, deflections or both in other axes; one column in another unit, or all of them in a part of the rows."""
    found = []
    for matrix in signed_permutations():
        opposite = np.array_equal(matrix, -np.eye(3))
        found += [_mixed(quantity, matrix) for quantity in COLUMNS if not opposite]
        if opposite:
            found.append(_all_signs())
        # A mirrored pair of triads is the turned one again: both signs at once leave the springs as they are.
        elif np.linalg.det(matrix) > 0:
            found.append(_both_turned(matrix))
    found += _in_frames(data)
    for axis in (0, 1, 2, None):
        found += [_column_unit(FORCE, axis, factor, words) for factor, words in FORCE_UNITS]
        found += [_column_unit(DEFLECTION, axis, factor, words) for factor, words in DEFLECTION_UNITS]
    return found


def turned(data: LoadTest, matrix: Array, quantities: tuple[str, ...]) -> dict[str, Array]:
    """The columns of these quantities turned by a matrix (3, 3), or one a row (n, 3, 3)."""
    rows, changed = data.rows, {}
    if FORCE in quantities:
        changed["wrench"] = np.concatenate([_turn(matrix, rows.wrench[:, :3]), _turn(matrix, rows.wrench[:, 3:])], axis=1)
    if DEFLECTION in quantities:
        changed["deflection"] = _turn(matrix, rows.deflection)
        if matrix.ndim == 2:
            changed["sigma"] = np.abs(_turn(np.abs(matrix), rows.sigma))
    return changed


def _turn(matrix: Array, vectors: Array) -> Array:
    """Turned vectors (n, 3). What was not measured stays so: a NaN spoils no axis it has no part in."""
    matrices = np.broadcast_to(matrix, (len(vectors), 3, 3))
    parts = np.where(matrices == 0.0, 0.0, matrices * vectors[:, None, :])
    return np.asarray(parts.sum(axis=2))


def _mixed(quantity: str, matrix: Array) -> Mistake:
    names, size = COLUMNS[quantity], np.abs(matrix)
    negative = [names[i] for i in range(3) if matrix[i].sum() < 0]
    settles = SETTLES[quantity]
    if np.array_equal(size, np.eye(3)):
        one = len(negative) == 1
        key = f"{quantity}_sign[{''.join(name[1] for name in negative)}]"
        sentence = f"{' and '.join(negative)} {'seems' if one else 'seem'} to have the other sign in {{rows}}"
        usual = True
    elif not negative and np.trace(size) == 1:
        swapped = [names[i] for i in range(3) if size[i, i] == 0]
        key, usual = f"{quantity}_swapped[{''.join(name[1] for name in swapped)}]", True
        sentence = f"{' and '.join(swapped)} seem to be swapped in {{rows}}"
    else:
        order = ", ".join(("-" if matrix[i].sum() < 0 else "") + names[int(np.argmax(size[i]))] for i in range(3))
        key, usual = f"{quantity}_axes[{order.replace(', ', ' ')}]", not negative
        sentence = f"{', '.join(names)} seem to be mixed up in {{rows}}: base x, y, z is {order} of the table"
    return table_mistake(key, sentence, settles, lambda data: turned(data, matrix, (quantity,)), usual=usual)


def _all_signs() -> Mistake:
    return table_mistake("all_signs", "all forces (or all deflections: that is the same to the springs) seem to have the other "
                         "sign in {rows}", SETTLES[FORCE], lambda data: turned(data, -np.eye(3), (FORCE,)))


def _both_turned(matrix: Array) -> Mistake:
    order = ", ".join(("-" if matrix[i].sum() < 0 else "") + "xyz"[int(np.argmax(np.abs(matrix[i])))] for i in range(3))
    about_z = matrix[2, 2] > 0
    angle = np.degrees(np.arctan2(matrix[1, 0], matrix[0, 0]))
    words = (f"turned by {angle:.0f} degrees about z (or joint 1 counts from elsewhere)" if about_z
             else f"other axes than the robot's base: base x, y, z is {order} of the table")
    return table_mistake(
        f"axes_turned[{f'z {angle:.0f}' if about_z else order.replace(', ', ' ')}]",
        f"forces and deflections seem to be given in {'axes ' if about_z else ''}{words} in {{rows}}",
        "jog the robot along base +x: force and sensors must call that direction x",
        lambda data: turned(data, matrix, (FORCE, DEFLECTION)), usual=bool(about_z))


def _in_frames(data: LoadTest) -> list[Mistake]:
    """Forces, deflections or both given in a frame of the cell that is not the robot's base."""
    if np.isnan(data.rows.deflection).any():
        quantities: tuple[tuple[str, ...], ...] = ((FORCE,),)
    else:
        quantities = ((FORCE,), (DEFLECTION,), (FORCE, DEFLECTION))
    cell, found = data.cell, []
    moving = {"tool": cell.flange_from_tcp.rotation, "flange": np.eye(3)}
    if cell.force_log.flange_from_sensor is not None:
        moving["sensor"] = cell.force_log.flange_from_sensor.rotation
    fixed = {"world": cell.world_from_base.rotation.T, "workobject": cell.world_from_base.rotation.T
             @ cell.world_from_object.rotation}
    for chosen in quantities:
        words = " and ".join(f"{quantity}s" for quantity in chosen)
        seen: list[Array] = []
        for name, rotation in (moving | fixed).items():
            moves = name in moving
            if any(np.allclose(rotation, other) for other in seen) or (not moves and np.allclose(rotation, np.eye(3))):
                continue
            if moves:
                seen.append(rotation)
            found.append(table_mistake(
                f"{'_and_'.join(chosen)}_frame[{name}]", f"{words} seem to be given in the {name}'s frame, not in the robot's "
                "base, in {rows}", SETTLES[chosen[0]], _to_base(rotation, moves, chosen)))
    return found


def _to_base(rotation: Array, moves: bool, chosen: tuple[str, ...]) -> Callable[[LoadTest], dict[str, Array]]:
    def change(data: LoadTest) -> dict[str, Array]:
        if not moves:
            return turned(data, rotation, chosen)
        tool = forward(data.cell.robot, data.rows.theta, data.cell.flange_from_tcp).rotation
        return turned(data, tool @ data.cell.flange_from_tcp.rotation.T @ rotation, chosen)

    return change


def _column_unit(quantity: str, axis: int | None, factor: float, words: str) -> Mistake:
    """One column, or (None) all three, from or to a row: another person, another display."""
    scale = np.ones(3)
    scale[slice(None) if axis is None else axis] = factor

    def change(data: LoadTest) -> dict[str, Array]:
        if quantity == DEFLECTION:
            return {"deflection": data.rows.deflection * scale}
        return {"wrench": data.rows.wrench * np.concatenate([scale, np.full(3, factor) if axis is None else np.ones(3)])}

    name = f"{quantity}s" if axis is None else COLUMNS[quantity][axis]
    key, seem = (f"{quantity}_unit", "seem") if axis is None else (f"{quantity}_unit[{name[1]}]", "seems")
    return table_mistake(key, f"{name} {seem} to be {words}, in {{rows}}",
                         "compare one reading of each axis with the instrument's display", change,
                         scale=scale if quantity == DEFLECTION else None, in_part=axis is None)

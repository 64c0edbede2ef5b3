"""Slips of the pen in the rows of one visit, kind by kind.

A digit of one angle changed, lost or one too many, two neighbouring digits exchanged, a sign, a decimal point, two columns of
angles exchanged, the angles of another visit, the sign or the size of its loads, readings that stand a row too high or too low
from some row on, readings of two rows exchanged, whole turns of a dial that were not counted.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from identification.fit.mistakes.readings import TURNS
from identification.fit.visits import visit_name
from identification.measurements import Measurements

Array = NDArray[np.float64]
FROM_ANOTHER = "another visit's angles"
# Rows of a visit up to which each load's sign is tried by itself.
FEW_LOADS = 6
# And up to which any two of them may have been exchanged.
MOST_ROWS = 40
# What the loads are to be multiplied by, and how people say so.
SIZES = ((2.0, "twice as large"), (0.5, "half as large"), (10.0, "ten times as large"), (0.1, "a tenth as large"),
         (9.80665, "9.81 times as large (kilograms, not newtons)"))


@dataclass(frozen=True, eq=False)
class Slip:
    """kind and words of a slip; theta (6,) [rad]: the pose it would be; force (n, 3) [N]: the loads; readings (n, 3) [m]; None
    where as they are."""

    kind: str
    what: str
    theta: Array
    force: Array | None = None
    readings: Array | None = None

    @property
    def in_rows(self) -> bool:
        """Whether it is one of single rows, not of the pose."""
        return self.force is not None or self.readings is not None


def slips_of(rows: Measurements, mine: NDArray[np.bool_], bad: frozenset[str], expected: Array) -> Iterator[Slip]:
    """All slips that are tried, of the rows `mine` (N,) of one visit; bad: names of all bad visits; expected (n, 3) [m]: its
    readings as the other visits have them."""
    theta, force = rows.theta[mine][0], rows.wrench[mine, :3]
    for axis, angle in enumerate(theta):
        text = written(float(np.degrees(angle)))
        for kind, other in slips_of_pen(text):
            moved = theta.copy()
            moved[axis] = np.radians(float(other))
            yield Slip(kind, f"axis {axis + 1} is {text} in the table; {other} would fit", moved)
    for i in range(6):
        for j in range(i):
            moved = theta.copy()
            moved[[i, j]] = theta[[j, i]]
            yield Slip("columns exchanged", f"axes {j + 1} and {i + 1} are {written(float(np.degrees(theta[j])))} and "
                        f"{written(float(np.degrees(theta[i])))} in the table; exchanged they would fit", moved)
    own = rows.visit[mine][0]
    seen: set[str] = {visit_name(rows, np.flatnonzero(mine))}
    for visit in np.unique(rows.visit[rows.visit != own]):
        place = np.flatnonzero(rows.visit == visit)
        name = visit_name(rows, place)
        if name not in seen and np.all(rows.theta[place] == rows.theta[place[0]]):
            seen.add(name)
            kind, ask = ("visits exchanged", "were the two exchanged?") if name in bad else (FROM_ANOTHER, "is it that pose?")
            yield Slip(kind, f"the angles of {name} would fit: {ask}", rows.theta[place[0]])
    yield from _loads_turned(rows, mine, theta, force)
    for factor, words in SIZES:
        yield Slip("size of the loads", f"its loads {words} would fit", theta, factor * force)
    yield from _rows_slipped(rows.line[mine], theta, force)
    for turn in TURNS:
        for axis in range(3):
            whole = rows.deflection[mine].copy()
            whole[:, axis] += turn * np.round((expected[:, axis] - whole[:, axis]) / turn)
            if not np.allclose(whole, rows.deflection[mine], equal_nan=True):
                yield Slip("whole turns", f"d{'xyz'[axis]} with the whole turns of {1e6 * turn:.0f} um that were not counted "
                           "would fit", theta, readings=whole)


def _loads_turned(rows: Measurements, mine: NDArray[np.bool_], theta: Array, force: Array) -> Iterator[Slip]:
    """Loads with the other sign: all, one axis, or single rows of a few."""
    kind = "sign of a load"
    axes = np.flatnonzero(np.any(force != 0, axis=0))
    if len(axes) > 1:
        yield Slip(kind, "its loads with the other sign would fit", theta, -force)
    for axis in axes:
        turned = force.copy()
        turned[:, axis] *= -1
        yield Slip(kind, f"f{'xyz'[axis]} with the other sign would fit", theta, turned)
    if 1 < len(force) <= FEW_LOADS:
        for row, line in enumerate(rows.line[mine]):
            turned = force.copy()
            turned[row] *= -1
            yield Slip(kind, f"the load in line {line} with the other sign would fit", theta, turned)


def _rows_slipped(line: NDArray[np.intp], theta: Array, force: Array) -> Iterator[Slip]:
    """Readings that stand a row too high or too low from some row on, or that were exchanged between two rows, neighbours where
    there are many: under the loads they were taken under."""
    for k in range(len(force) - 1):
        high, low = force.copy(), force.copy()
        high[k:-1], low[k + 1:] = force[k + 1:], force[k:-1]
        moved = [("readings slipped", high, f"its readings a row too high from line {line[k]} on"),
                 ("readings slipped", low, f"its readings a row too low from line {line[k + 1]} on")]
        for other in range(k + 1, len(force) if len(force) <= MOST_ROWS else k + 2):
            both = force.copy()
            both[[k, other]] = force[[other, k]]
            moved.append(("readings exchanged", both, f"the readings of lines {line[k]} and {line[other]} exchanged"))
        for kind, loads, words in moved:
            if not np.array_equal(loads, force):
                yield Slip(kind, f"{words}: put back they would fit", theta, loads)


def written(angle: float) -> str:
    """An angle [deg] as it stands in the table, as far as that is known: six decimals, no empty ones."""
    return f"{angle:.6f}".rstrip("0").rstrip(".")


def slips_of_pen(text: str) -> list[tuple[str, str]]:
    """(kind, other number) for every slip of the pen that may have made `text` of it; each number once, simple kinds first."""
    sign, digits = ("-", text[1:]) if text.startswith("-") else ("", text)
    places = [k for k, letter in enumerate(digits) if letter.isdigit()]
    whole = len(digits.split(".")[0])
    found: list[tuple[str, str]] = [("sign", digits if sign else "-" + digits)]
    for first, second in pairwise(places):
        changed = list(digits)
        changed[first], changed[second] = digits[second], digits[first]
        found.append(("digits exchanged", sign + "".join(changed)))
    found += [("digit", sign + digits[:k] + other + digits[k + 1:]) for k in places for other in "0123456789"]
    found += [("digit lost", sign + digits[:k] + other + digits[k:]) for k in range(whole + 1) for other in "0123456789"]
    found += [("digit too many", sign + digits[:k] + digits[k + 1:]) for k in places if len(places) > 1 and k < whole]
    found += [("decimal point", written(float(text) * factor)) for factor in (10.0, 0.1)]
    once: dict[float, tuple[str, str]] = {}
    for kind, other in found:
        if other.strip("-").strip(".") and float(other) != float(text):
            once.setdefault(float(other), (kind, other))
    return list(once.values())

"""A first look at a table of load tests, without a fit: can a robot of such springs have moved so?

Springs are linear in their compliances, so that least squares with none negative say in one step how much of the readings any
springs explain; and the prior's stiffnesses say how large readings are, within the factor that robots of one kind differ by.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.common.findings import Finding, counted, error
from identification.fit.load_test import LoadTest
from identification.fit.mistakes.axes import axes_mistakes
from identification.fit.mistakes.cell_file import cell_mistakes
from identification.fit.mistakes.joints import joint_mistakes
from identification.fit.mistakes.mistake import Mistake
from identification.fit.mistakes.odd_rows import odd_rows, where
from identification.fit.mistakes.readings import reading_mistakes
from identification.fit.mistakes.units import DEFLECTION_UNITS, FORCE_UNITS
from identification.model.compliance import regressor

Array = NDArray[np.float64]
# Rows that are enough for a look.
ENOUGH = 400
# Readings so many times larger or smaller than the prior's are worth a word: it is over three standard deviations of what
# robots of one kind differ by (units.py). NEAR: within this factor a unit is named.
FACTOR, NEAR = 6.0, 2.5
# From here on no fit is needed to call it a unit: no robot, and none that the fit itself would find (units.py).
ABSURD = 1e5
PRIOR = ", and the prior's stiffnesses with N m/rad"
METRES = (1e6, "in m, not in um")
# Readings of so many rows without a load are looked at, and told from this part of the loaded ones' on: friction and play hold
# less (engineering judgement).
FEW, STILL = 3, 0.5
# Share of the squared readings that no springs explain, beyond the stated noise, from which one mistake is looked for that
# leaves this part of it; it is told without one, too. Physical causes leave under 0.05: benchmarks/mistakes.py look.
UNEXPLAINED, LEFT = 0.1, 0.25
# Mistakes that leave up to so many times what the best leaves, or this part of what the rows leave as they stand, are not
# told apart.
ALIKE, NEARLY = 1.5, 0.01
# Rows that fit no springs which fit the others matter where, without them, at most this part is left: a cause leaves more.
MATTERS = 0.5


def first_look(data: LoadTest) -> Finding | None:
    """What is implausible about the size and the directions of the readings (CS0115); None where nothing is."""
    unloaded, loaded, data = _unloaded(data), len(with_readings(data, None).rows), with_readings(data)
    if not len(data.rows):
        return None
    said, settles = [], []
    if len(unloaded) >= FEW and np.median(unloaded) > STILL * np.median(_sizes(data.rows.deflection)):
        said.append(f"the tool moves in rows without a load, too, by {1e6 * np.median(unloaded):.3g} um in the middle")
        settles.append("is a column of loads lost, or are these positions and not what a load changed?")
    times = times_smaller(data)
    if not 1 / FACTOR < times < FACTOR:
        said.append(_too(times))
        settles.append(f"compare one reading with the instrument's display{PRIOR}")
    left = unexplained(data)
    odd = odd_rows(data)
    rest = unexplained(data.with_rows(data.rows.select(~odd))) if odd.any() else left
    matters = bool(odd.any()) and rest < MATTERS * left
    usual = _explaining(data, left, None) if left > UNEXPLAINED else []
    # One that is made in all rows mends them better than to leave out those that fit the others least.
    if usual and usual[0].left <= max(rest if matters else left, NEARLY * left):
        said.append(usual[0].mistake.sentence.format(rows="all rows") + f": as they stand {left:.0%} of the readings fit no "
                    f"springs, so mended {max(usual[0].left, 0.0):.2%}")
        settles.append(usual[0].mistake.settles)
    elif matters:
        every = int(np.ceil(loaded / ENOUGH))
        words, settled = _said_of_rows(data, left, rest, odd, where(data, odd, every))
        said.append(words)
        settles.append(settled)
    elif left > UNEXPLAINED:
        said.append(f"the tool moves in directions in which no springs let it go: {left:.0%} of the readings fit none")
        settles.append("are all loads, readings and angles in the columns they belong to, and is it the right robot? "
                       "compstiff diagnose looks for the mistake")
    if not said:
        return None
    return Finding("CS0115", "warning", "; ".join(said), file=data.rows.source, hint="check: " + "; ".join(settles))


def _said_of_rows(data: LoadTest, left: float, rest: float, odd: NDArray[np.bool_], words: str) -> tuple[str, str]:
    """What is said of rows (n,), in words, that fit no springs which fit the others, and what would settle it."""
    usual = _explaining(data, left, odd)
    alike = [one.mistake for one in usual if one.left < max(ALIKE * usual[0].left, NEARLY * left)]
    if not alike:
        return (f"{words} fit no springs that fit the others: with them {left:.1%} of the readings fit none, without them "
                f"{max(rest, 0.0):.1%}", "was something in these rows moved, read or typed otherwise, or does something else "
                "than springs give way there? compstiff diagnose looks for it")
    more = f" (or {counted(len(alike) - FEW, 'more mistake')} would mend them as well)" if len(alike) > FEW else ""
    said = ", or ".join(one.sentence.format(rows="them").replace(", in", " in") for one in alike[:FEW])
    return f"{words} fit no springs that fit the others: {said}{more}", alike[0].settles


def refuse_absurd(data: LoadTest) -> None:
    """Refuses readings whose unit no robot can explain, which are too small or too large to be fitted (CS1018)."""
    data = with_readings(data)
    times = times_smaller(data) if len(data.rows) else 1.0
    if not 1 / ABSURD < times < ABSURD:
        raise error("CS1018", _too(times), file=data.rows.source, hint="deflections are in micrometres, forces in newton; "
                    f"check: compare one reading with the instrument's display{PRIOR}")


def times_smaller(data: LoadTest) -> float:
    """How many times smaller the readings are than those of the prior's stiffnesses."""
    columns, readings, _ = _columns(data)
    return float(np.linalg.norm(columns @ (1 / data.prior.prior.stiffness)) / np.linalg.norm(readings))


def unexplained(data: LoadTest, before: LoadTest | None = None) -> float:
    """Share of the squared readings that no springs explain, the stated noise taken off. before: the same where another unit
    has not yet made the readings smaller, which their noise goes with."""
    from scipy.optimize import nnls

    columns, readings, noise = _columns(data)
    squares = float(readings @ readings)
    if before is not None:
        first = _columns(before)[1]
        noise *= min(1.0, squares / float(first @ first))
    if squares <= noise:
        return 0.0
    size = np.linalg.norm(columns, axis=0)
    return float((nnls(columns / np.where(size > 0, size, 1.0), readings)[1] ** 2 - noise) / squares)


def _unloaded(data: LoadTest) -> Array:
    """Sizes [m] of the readings without a load."""
    return _sizes(data.rows.deflection[~np.any(data.rows.wrench != 0, axis=1)])


def _sizes(deflection: Array) -> Array:
    return np.asarray(np.linalg.norm(np.nan_to_num(deflection), axis=1))


def with_readings(data: LoadTest, most: int | None = ENOUGH) -> LoadTest:
    """Rows with a load and a reading, at most so many, evenly over them."""
    rows = np.flatnonzero(np.any(data.rows.wrench != 0, axis=1) & np.any(np.nan_to_num(data.rows.deflection) != 0, axis=1))
    kept = np.zeros(len(data.rows), dtype=bool)
    kept[rows[::int(np.ceil(len(rows) / most)) or 1] if most else rows] = True
    return data.with_rows(data.rows.select(kept))


def _columns(data: LoadTest) -> tuple[Array, Array, float]:
    """The readings (m,) [m], what each joint's compliance does to them (m, 6), and the sum of their squared stated noise."""
    rows, cell = data.rows, data.cell
    measured = ~np.isnan(rows.deflection)
    columns = regressor(cell.robot, rows.theta, cell.flange_from_tcp, rows.wrench)[:, :3]
    variance = np.broadcast_to(cell.noise.deflection**2 + np.nan_to_num(cell.noise.pose_offset) ** 2, measured.shape)
    return columns[measured], rows.deflection[measured], float(variance[measured].sum())


@dataclass(frozen=True, eq=False)
class _Usual:
    """A usual mistake, and the share of the readings that no springs explain once it is mended."""

    mistake: Mistake
    left: float


def _explaining(data: LoadTest, left: float, rows: NDArray[np.bool_] | None) -> list[_Usual]:
    """The usual mistakes without which springs explain the readings, the best first; made in all rows, or in these."""
    tried = (*axes_mistakes(data), *joint_mistakes(data), *reading_mistakes(data), *cell_mistakes(data))
    each = [_Usual(mistake, unexplained(mistake.mended(data, rows), data)) for mistake in tried
            if mistake.usual and (rows is None or mistake.of == "table")]
    return sorted((one for one in each if one.left < LEFT * left), key=lambda one: one.left)


def _too(smaller: float) -> str:
    times = f"{smaller:.3g} times smaller" if smaller > 1 else f"{1 / smaller:.3g} times larger"
    return f"the readings are {times} than the prior's stiffnesses make them under these loads{_unit(smaller)}"


def _unit(smaller: float) -> str:
    """The units that are near."""
    words = [f"deflections {text}" for factor, text, *_ in (*DEFLECTION_UNITS, METRES) if 1 / NEAR < smaller / factor < NEAR]
    words += [f"forces {text}" for factor, text, _ in FORCE_UNITS if 1 / NEAR < smaller * factor < NEAR]
    return f": {' or '.join(words)}?" if words else ""

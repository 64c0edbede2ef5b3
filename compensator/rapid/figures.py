"""Texts of many poses written in figures, with new numbers: all of them at once, every other byte as it was.

The same as `literals.rewritten` does number by number (tests/compensator/rapid/test_laws_figures.py).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from compensator.rapid.literals import LEAST, STEPS, decimals, figure
from compensator.rapid.text import Offsets

Array = NDArray[np.float64]

NUMBERS = len(LEAST)            # x y z q1 q2 q3 q4
CHUNK = 1 << 12                 # poses at a time: bounds the memory their texts take
_OF_NUMBER = np.zeros(256, dtype=bool)
_OF_NUMBER[list(b"0123456789.+-eE")] = True
_POINT, _MINUS, _ZERO, _EXPONENTS = ord("."), ord("-"), ord("0"), list(b"eE")
_STEPS, _POWERS = np.array(STEPS), 10.0 ** np.arange(len(STEPS))
# A number of so many steps, or one that its product with a power of ten may have put on the wrong side of a half of a step, is
# written by itself: the product is off by half a unit in its last place.
_LARGEST, _ROUNDING = 1e15, 2.0**-52
_DIGITS = 10 ** np.arange(1, 16)


@dataclass(frozen=True, slots=True, eq=False)
class Poses:
    """texts: of K poses, from the offset given as their start to the one given as their end. changed (K,): how many numbers of
    each differ."""

    texts: list[bytes]
    changed: NDArray[np.int64]


def renumbered_poses(data: bytes, start: Offsets, end: Offsets, old: Array, numbers: Array) -> Poses:
    """The poses data[start:end] (K,), each with NUMBERS numbers and otherwise brackets, commas and blanks, with other numbers
    (K, NUMBERS) [mm, then a quaternion] than the old (K, NUMBERS) that it says."""
    whole = b"\0".join([data[a:b] for a, b in zip(start.tolist(), end.tolist(), strict=True)]) + b"\0"
    letters = np.frombuffer(whole, dtype=np.uint8)
    of_number = _OF_NUMBER[letters]
    edge = np.diff(of_number.view(np.int8), prepend=np.int8(0))
    first, behind = np.flatnonzero(edge == 1), np.flatnonzero(edge == -1)
    places = _decimals(whole, letters, first, behind)
    new = _figures(numbers.ravel(), places)
    stay = _same(old.ravel(), numbers.ravel(), places, new)
    changed = np.full(len(start), NUMBERS) - stay.reshape(-1, NUMBERS).sum(axis=1)
    written, used = _right_aligned(new, places, int((behind - first).max(initial=1)))
    # A number that stays is spelled as it was: the letters before its end.
    kept, width = np.flatnonzero(stay), written.shape[1]
    written[kept] = letters[np.maximum(behind[kept, None] + np.arange(-width, 0), 0)]
    used[kept] = (behind - first)[kept]
    lengths = np.empty(2 * len(first) + 1, dtype=np.intp)           # of what stands before each number, and of the number
    lengths[::2], lengths[1::2] = np.append(first, len(whole)) - np.append(0, behind), used
    is_number = np.repeat(np.arange(len(lengths)) % 2 == 1, lengths)
    text = np.empty(len(is_number), dtype=np.uint8)
    text[is_number] = written[np.arange(width) >= width - used[:, None]]
    text[~is_number] = letters[~of_number]
    return Poses(text.tobytes().split(b"\0")[:-1], changed)


def _decimals(whole: bytes, letters: NDArray[np.uint8], first: Offsets, behind: Offsets) -> NDArray[np.int64]:
    """With how many decimals each number is to be written: those it has, and no fewer than RAPID's precision needs."""
    points = np.flatnonzero(letters == _POINT)
    places = np.zeros(len(first), dtype=np.int64)
    token = np.searchsorted(first, points, side="right") - 1
    places[token] = np.minimum(behind[token] - points - 1, len(STEPS) - 1)
    exponents = np.flatnonzero((letters == _EXPONENTS[0]) | (letters == _EXPONENTS[1]))
    for index in (np.searchsorted(first, exponents, side="right") - 1).tolist():
        places[index] = decimals(whole[first[index]:behind[index]])
    return np.asarray(np.maximum(places, np.tile(LEAST, len(first) // NUMBERS)))


@dataclass(frozen=True, slots=True, eq=False)
class _Figures:
    """Numbers as they are written: steps (n,), how many steps of their last decimal each is; spelled: those by themselves whose
    steps are not known so, with their texts."""

    steps: NDArray[np.int64]
    spelled: dict[int, bytes]


def _figures(values: Array, places: NDArray[np.int64]) -> _Figures:
    """Numbers with so many decimals each, rounded as Python's own formatting does: to the nearest of the exact value."""
    with np.errstate(over="ignore", invalid="ignore"):
        exact = values * _POWERS[places]
        steps = np.rint(exact)
        size = np.abs(exact)
        sure = (size < _LARGEST) & (np.abs(np.abs(exact - steps) - 0.5) > _ROUNDING * size)
        spelled = {index: figure(values[index], int(places[index])) for index in np.flatnonzero(~sure).tolist()}
        return _Figures(np.where(sure, steps, 0.0).astype(np.int64), spelled)


def _same(old: Array, values: Array, places: NDArray[np.int64], new: _Figures) -> NDArray[np.bool_]:
    """The numbers (n,) that say the same to the decimals written, whatever their spelling."""
    before = _figures(old, places)
    near = np.abs(old - values) < _STEPS[places]
    same = np.asarray(near & (before.steps == new.steps))
    for index in before.spelled.keys() | new.spelled.keys():
        decimals_written = int(places[index])
        same[index] = near[index] and figure(old[index], decimals_written) == figure(values[index], decimals_written)
    return same


def _right_aligned(figures: _Figures, places: NDArray[np.int64], least: int) -> tuple[NDArray[np.uint8], NDArray[np.intp]]:
    """The texts of numbers at the ends of rows of letters (n, width), width being `least` or more, and their lengths (n,)."""
    steps = np.abs(figures.steps)
    digits = np.maximum(np.searchsorted(_DIGITS, steps, side="right") + 1, places + 1)
    negative = figures.steps < 0
    used = digits + (places > 0) + negative
    width = max(int(used.max(initial=1)), least, *(len(text) for text in figures.spelled.values()))
    rows = np.empty((len(steps), width), dtype=np.uint8)
    for fraction in np.unique(places).tolist():
        which = np.flatnonzero(places == fraction)
        left, most = steps[which], int(digits[which].max())
        columns = np.full((width, len(which)), _ZERO, dtype=np.uint8)
        for digit in range(most):
            rest = left // 10
            columns[width - 1 - digit - (0 < fraction <= digit)] += (left - 10 * rest).astype(np.uint8)
            left = rest
        if fraction:
            columns[width - 1 - fraction] = _POINT
        rows[which] = columns.T
    rows[negative, width - used[negative]] = _MINUS
    for index, text in figures.spelled.items():
        rows[index, width - len(text):] = np.frombuffer(text, dtype=np.uint8)
        used[index] = len(text)
    return rows, used.astype(np.intp)

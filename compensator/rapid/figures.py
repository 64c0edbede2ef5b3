"""Texts of many poses written in figures, with new numbers: all of them at once, every other byte as it was.

The same as `literals.rewritten` does number by number (tests/compensator/rapid/test_laws_figures.py).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from compensator.rapid.literals import LEAST, MOST_DECIMALS, STEPS, decimals, figure
from compensator.rapid.text import Offsets

Array = NDArray[np.float64]

NUMBERS = len(LEAST)            # x y z q1 q2 q3 q4
_CHUNK = 1 << 14                # poses at a time: bounds the memory their texts take
_OF_NUMBER = np.zeros(256, dtype=bool)
_OF_NUMBER[list(b"0123456789.+-eE")] = True
_POINT, _EXPONENTS = ord("."), list(b"eE")
_FORMS = np.array([b"%%.%df" % places for places in range(MOST_DECIMALS + 1)], dtype=object)
_STEPS = np.array(STEPS)


@dataclass(frozen=True, slots=True, eq=False)
class Poses:
    """texts: of K poses, from the offset given as their start to the one given as their end. changed (K,): how many numbers of
    each differ."""

    texts: list[bytes]
    changed: NDArray[np.int64]


def renumbered_poses(data: bytes, start: Offsets, end: Offsets, old: Array, numbers: Array) -> Poses:
    """The poses data[start:end] (K,), each with NUMBERS numbers and otherwise brackets, commas and blanks, with other numbers
    (K, NUMBERS) [mm, then a quaternion] than the old (K, NUMBERS) that it says."""
    texts: list[bytes] = []
    changed = np.empty(len(start), dtype=np.int64)
    for at in range(0, len(start), _CHUNK):
        part = slice(at, at + _CHUNK)
        some, changed[part] = _renumbered(data, start[part], end[part], old[part].ravel(), numbers[part].ravel())
        texts += some
    return Poses(texts, changed)


def _renumbered(
    data: bytes, start: Offsets, end: Offsets, old: Array, numbers: Array
) -> tuple[list[bytes], NDArray[np.int64]]:
    whole = b"\0".join([data[a:b] for a, b in zip(start.tolist(), end.tolist(), strict=True)]) + b"\0"
    letters = np.frombuffer(whole, dtype=np.uint8)
    edge = np.diff(_OF_NUMBER[letters].view(np.int8), prepend=np.int8(0))
    first, behind = np.flatnonzero(edge == 1), np.flatnonzero(edge == -1)
    places = _decimals(whole, letters, first, behind)
    new = _figures(numbers, places)
    stay = _same(old, numbers, places, new)
    for index in stay:
        new[index] = whole[first[index]:behind[index]]
    changed = np.full(len(start), NUMBERS) - np.bincount(np.array(stay, dtype=np.int64) // NUMBERS, minlength=len(start))
    # What stands before each number, then the number; the rest behind the last.
    pieces = [b""] * (2 * len(new) + 1)
    pieces[::2] = [whole[a:b] for a, b in zip([0, *behind.tolist()], [*first.tolist(), len(whole)], strict=True)]
    pieces[1::2] = new
    return b"".join(pieces).split(b"\0")[:-1], changed


def _decimals(whole: bytes, letters: NDArray[np.uint8], first: Offsets, behind: Offsets) -> NDArray[np.int64]:
    """With how many decimals each number is to be written: those it has, and no fewer than RAPID's precision needs."""
    points = np.flatnonzero(letters == _POINT)
    places = np.zeros(len(first), dtype=np.int64)
    token = np.searchsorted(first, points, side="right") - 1
    places[token] = np.minimum(behind[token] - points - 1, MOST_DECIMALS)
    exponents = np.flatnonzero(np.isin(letters, _EXPONENTS))
    for index in (np.searchsorted(first, exponents, side="right") - 1).tolist():
        places[index] = decimals(whole[first[index]:behind[index]])
    return np.asarray(np.maximum(places, np.tile(LEAST, len(first) // NUMBERS)))


def _figures(values: Array, places: NDArray[np.int64]) -> list[bytes]:
    """Numbers without exponent and without a negative zero, with so many decimals each."""
    texts = (b" ".join(_FORMS[places].tolist()) % tuple(values.tolist())).split(b" ")
    for index in np.flatnonzero((values <= 0) & (values > -_STEPS[places])).tolist():
        texts[index] = figure(values[index], int(places[index]))
    return texts


def _same(old: Array, values: Array, places: NDArray[np.int64], new: list[bytes]) -> list[int]:
    """The numbers that say the same to the decimals written, whatever their spelling."""
    near = np.flatnonzero(np.abs(old - values) < _STEPS[places])
    texts = _figures(old[near], places[near]) if len(near) else []
    return [index for index, text in zip(near.tolist(), texts, strict=True) if text == new[index]]

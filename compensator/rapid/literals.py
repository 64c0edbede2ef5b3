"""Texts of robtargets with new numbers, blanks, commas and everything else as it was."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

from compensator.rapid.expressions import Expr
from compensator.rapid.targets import WIDTH
from compensator.rapid.values import UNUSED, Values

POSITION_DECIMALS = 4           # of a millimetre: RAPID's num is single precision, 0.00012 mm at 1-2 m
QUATERNION_DECIMALS = 8         # 5 move the tip of a 200 mm tool by 4 um
MOST_DECIMALS = 15

_NUMBER = re.compile(rb"([-+]?(?:\d+\.?\d*|\.\d+)(?:[Ee][-+]?\d+)?)")
# No comment, no name (E and e belong to numbers), no sign that stands apart from its digits.
_PLAIN = re.compile(rb"(?:[^!A-DF-Za-df-z_\x80-\xff+-]++|[-+](?=[\d.]))*+")
_FORMATS = tuple(b"%%.%df" % places for places in range(MOST_DECIMALS + 1))
STEPS = tuple(10.0**-places for places in range(MOST_DECIMALS + 1))
LEAST = (POSITION_DECIMALS,) * 3 + (QUATERNION_DECIMALS,) * 4


@dataclass(frozen=True, slots=True)
class Pose:
    """Commanded numbers of one target: x y z [mm], q1..q4 with the sign they are to be written with, cf1 cf4 cf6 cfx or None
    where they stay; of a further target its external axes [mm or deg], NaN for 9E9, or None for those of the move."""

    numbers: Sequence[float]
    confdata: Sequence[int] | None
    external: Sequence[float] | None = None


@dataclass(frozen=True, slots=True)
class Written:
    """text: the robtarget. changed: how many numbers differ; symbols: how many names were replaced by numbers."""

    text: bytes
    changed: int
    symbols: int = 0


def decimals(token: bytes) -> int:
    """Decimals a number was written with: 3 of "-12.500", 6 of "-1.2E-05"."""
    if b"E" not in token and b"e" not in token:
        point = token.find(b".") + 1
        places = len(token) - point if point else 0
        return places if places < MOST_DECIMALS else MOST_DECIMALS
    mantissa, _, exponent = token.lower().partition(b"e")
    _, _, fraction = mantissa.partition(b".")
    return min(max(len(fraction) - int(exponent or 0), 0), MOST_DECIMALS)


def figure(value: float, places: int) -> bytes:
    """A number without exponent and without a negative zero."""
    text = _FORMATS[places] % value
    return text[1:] if -1.0 < value <= 0.0 and text[0] == 45 and not text.strip(b"-0.") else text


def renumbered(token: bytes, value: float, least: int) -> bytes:
    """`value` in the place of a number; the number itself where it says the same to the decimals written."""
    places = decimals(token)
    if places < least:
        places = least
    old = float(token)
    text = figure(value, places)
    if abs(old - value) < STEPS[places] and figure(old, places) == text:
        return token
    return text


def rewritten(values: Values, start: int, end: int, row: Sequence[float], pose: Pose) -> Written:
    """The robtarget at source.data[start:end], which says `row` (WIDTH numbers), with the numbers of `pose`."""
    text = values.source.data[start:end]
    if _PLAIN.fullmatch(text):
        parts = _NUMBER.split(text)
        if len(parts) == 2 * WIDTH + 1:
            return _replaced(parts, pose)
    return _replaced_parts(values, values.parse(start, end), row, pose)


def fresh(row: Sequence[float], pose: Pose) -> bytes:
    """A robtarget in numbers alone; `row` gives the confdata and the external axes, unless `pose` does."""
    numbers = [figure(value, least) for value, least in zip(pose.numbers, LEAST, strict=True)]
    confdata = pose.confdata if pose.confdata is not None else [round(value) for value in row[7:11]]
    axes = row[11:17] if pose.external is None else pose.external
    external = [b"9E9" if math.isnan(value) or abs(value) >= UNUSED else _shortest(float(value)) for value in axes]
    groups = (numbers[:3], numbers[3:], [b"%d" % value for value in confdata], external)
    return b"[" + b",".join(b"[" + b",".join(group) + b"]" for group in groups) + b"]"


def _shortest(value: float) -> bytes:
    """All digits of a number, without exponent."""
    text = repr(value)
    return figure(value, 9) if "e" in text else text.removesuffix(".0").encode()


def _replaced(parts: list[bytes], pose: Pose) -> Written:
    changed = 0
    for place, (value, least) in enumerate(zip(pose.numbers, LEAST, strict=True)):
        token = parts[2 * place + 1]
        new = renumbered(token, value, least)
        if new is not token:
            parts[2 * place + 1] = new
            changed += 1
    if pose.confdata is not None:
        for place, quadrant in enumerate(pose.confdata, 7):
            if float(parts[2 * place + 1]) != quadrant:
                parts[2 * place + 1] = str(quadrant).encode()
                changed += 1
    return Written(b"".join(parts), changed)


def _replaced_parts(values: Values, expr: Expr, row: Sequence[float], pose: Pose) -> Written:
    """As `_replaced` for a robtarget with comments or symbols inside: a symbol gives way to numbers where they differ."""
    data = values.source.data
    pieces: list[bytes] = []
    at, changed, symbols = expr.start, 0, 0
    groups = ((pose.numbers[:3], row[:3], POSITION_DECIMALS), (pose.numbers[3:], row[3:7], QUATERNION_DECIMALS),
              (pose.confdata, row[7:11], 0))
    for part, (numbers, old, least) in zip(expr.items, groups, strict=False):
        if numbers is None:
            continue
        whole = part.kind != "aggregate"
        items = [(part, numbers, old)] if whole else zip(part.items, zip(numbers), zip(old), strict=True)
        for item, new_values, old_values in items:
            text = _part(data, item, new_values, old_values, least)
            if text is not None:
                pieces += [data[at:item.start], text]
                at = item.end
                changed += len(new_values)
                symbols += item.kind != "number"
    pieces.append(data[at:expr.end])
    return Written(b"".join(pieces), changed, symbols)


def _part(data: bytes, item: Expr, new: Sequence[float], old: Sequence[float], least: int) -> bytes | None:
    """The text an expression inside a robtarget gets; None where it stays. A symbol may stand for several numbers."""
    if item.kind == "number":
        token = data[item.start:item.end]
        if not _NUMBER.fullmatch(token):                # blanks between sign and digits
            token = repr(item.value).encode()
        text = renumbered(token, new[0], least)
        return None if text is token else text
    figures = [figure(value, least) for value in new]
    if figures == [figure(value, least) for value in old]:
        return None
    text = b",".join(figures)
    return b"[" + text + b"]" if len(figures) > 1 else text

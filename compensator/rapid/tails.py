"""Speed, zone, tool and work object of every target; each tail is resolved once for each scope it stands in."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from compensator.rapid.frames import Frames
from compensator.rapid.handed import handed_in
from compensator.rapid.scan import Scan
from compensator.rapid.speeds import feed, zone
from compensator.rapid.text import Offsets, locate
from compensator.rapid.values import Values
from compensator.toolpath import Array, Indices, ToolFrame, WorkObject
from identification.common.arrays import held_once

_Named = TypeVar("_Named", ToolFrame, WorkObject)


@dataclass(frozen=True, slots=True)
class Tails:
    """Columns (N,) as in `Toolpath`; tail (N,) number in scan.tails. slight: offsets of the quaternions in tools and work
    objects that were normalised. handed: numbers of the parameters that were followed to what calls hand over; declared:
    offsets of the declarations of all tools and work objects."""

    tail: Offsets
    feed: Array
    zone: Array
    tool: Indices
    workobject: Indices
    tools: tuple[ToolFrame, ...]
    workobjects: tuple[WorkObject, ...]
    slight: tuple[int, ...]
    handed: tuple[int, ...]
    declared: frozenset[int]


def resolve_tails(scan: Scan, values: Values, scope_of: Offsets) -> Tails:
    """Raises CS2004, CS2005 for data of a tool, work object, speed or zone that no controller would load."""
    tail = np.asarray(scan.tail, dtype=np.int64)
    pair = tail * len(scan.scopes) + scope_of
    _, first, inverse = np.unique(pair, return_index=True, return_inverse=True)
    order = np.argsort(first)                           # tools and work objects in the order of their first use
    columns = np.full((len(first), 4), math.nan)
    frames = Frames(values, handed_in(scan))
    for number in order.tolist():
        written = scan.tails[tail[first[number]]]
        scope = scan.scopes[scope_of[first[number]]][1]
        columns[number] = (feed(values, written, scope), zone(values, written, scope), frames.tool(written.tool, scope),
                           frames.workobject(written.workobject, scope))
        for part in (written.velocity, written.radius, written.speed):
            if part is not None and part.kind not in ("name", "number"):
                scan.uses.read.update((inner.name, scope) for inner in part.walk() if inner.name)
    tool, workobject = (held_once(columns[:, column].astype(np.intp)[inverse]) for column in (2, 3))
    return Tails(
        tail, columns[:, 0][inverse], columns[:, 1][inverse], tool, workobject,
        _with_lines(values, frames.tools, frames.tool_offsets),
        _with_lines(values, frames.workobjects, frames.workobject_offsets), tuple(frames.slight),
        tuple(sorted(frames.taken)), frozenset((*frames.tool_offsets, *frames.workobject_offsets)),
    )


def _with_lines(values: Values, frames: list[_Named], offsets: list[int]) -> tuple[_Named, ...]:
    lines, _ = locate(values.source, [max(offset, 0) for offset in offsets])
    return tuple(
        replace(frame, line=int(line)) if offset >= 0 else frame
        for frame, offset, line in zip(frames, offsets, lines, strict=True)
    )

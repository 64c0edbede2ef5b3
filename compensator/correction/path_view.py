"""A program in space for its report: which places are drawn, what can be shown at each, its line, and the findings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from compensator.correction.predict import Predicted
from compensator.path.robot_path import RobotPath
from compensator.rapid import RapidProgram
from identification.common.chart_svg import number
from identification.common.findings import Finding, fold
from identification.common.packed import packed, packed_words
from identification.common.report import View
from identification.common.scene import Projection, named_places, picture, stroke

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Kind = Literal["size", "signed", "share"]
# Stretches of the program of which the first target, the corner that sticks out and the largest values are drawn: of the first
# quantity in each, of the others in coarser ones. What a browser draws fluently in a file of less than 2 MB.
STRETCHES, COARSE = 3000, 500
# So many lines of the program are there to be read; of more places those that stand out and every so-manieth.
MOST_TEXTS, LONGEST_TEXT = 6000, 160
STEP_MM = 1e-3
# Colours of the picture.
BINS = 12


@dataclass(frozen=True, eq=False)
class Quantity:
    """What can be shown along the path: values (N,) in `unit`, NaN where there is none. kind: a size from 0, a component with
    its sign, or a share of the tolerance [%]. tolerance: in the same unit, None for none; words: what it is."""

    key: str
    name: str
    unit: str
    values: Array
    words: str
    kind: Kind = "size"
    digits: int = 1
    tolerance: float | None = None

    @property
    def step(self) -> float:
        """What is kept of its decimals: more than is shown."""
        return float(0.01 * 10.0**-self.digits)

    @property
    def largest(self) -> int | None:
        """Where its size is largest."""
        sizes = np.where(np.isfinite(self.values), np.abs(self.values), -1.0)
        return int(np.argmax(sizes)) if (sizes >= 0).any() else None

    @property
    def limit(self) -> float:
        """The end of its colours: its largest size, so that no place is beyond it."""
        place = self.largest
        return 1.0 if place is None else float(abs(self.values[place])) or 1.0


def components(predicted: Predicted, deviation: Array) -> list[Quantity]:
    """A deviation (M, 3) [m] of the targets with force as the cut sees it: along the tool's axis, across the path, along it."""
    path, targets = predicted.path, predicted.targets
    axis = path.base_from_tcp.rotation[targets][:, :, 2]
    travel = _travel(path)[targets]
    left = np.cross(travel, axis)
    with np.errstate(invalid="ignore", divide="ignore"):
        left /= np.linalg.norm(left, axis=1, keepdims=True)

    def over_all(direction: Array) -> Array:
        return spread(1e6 * np.einsum("ij,ij->i", deviation, direction), targets, len(path.toolpath))

    return [
        Quantity("axial", "Along the tool", "um", over_all(axis),
                 "Predicted deviation along the z axis of the tool frame, positive along z.", "signed"),
        Quantity("across", "Across the path", "um", over_all(left),
                 "Predicted deviation across the travel and the tool's z axis: what changes a wall. Positive is to the left "
                 "of the "
                 "travel for one who looks along the tool's z axis.", "signed"),
        Quantity("feed", "Along the feed", "um", over_all(travel),
                 "Predicted deviation along the travel: it changes no wall, only where the path begins and ends.", "signed")]


def spread(values: Array, targets: Indices, count: int) -> Array:
    """values (M,) of some targets over all (count,); NaN elsewhere."""
    all_of_them = np.full(count, np.nan)
    all_of_them[targets] = values
    return all_of_them


def _travel(path: RobotPath) -> Array:
    """Unit vector (N, 3) of the way to each target, base frame; of one without way that of the way before it."""
    steps = np.nan_to_num(path.steps)
    size = np.linalg.norm(steps, axis=1)
    moved = size > 1e-9
    if not moved.any():
        return np.full_like(steps, np.nan)
    last = np.maximum.accumulate(np.where(moved, np.arange(len(steps)), -1))
    last = np.where(last < 0, int(np.argmax(moved)), last)
    return np.asarray(steps[last] / size[last, None])


def kept_targets(where: Array, quantities: Sequence[Quantity], always: Sequence[int] = ()) -> Indices:
    """The targets (k,), ascending, that are drawn of those at where (N, 3): all of a few. Else of equal stretches the first,
    the farthest from the straight line through the stretch and the largest of the first quantity, of coarser stretches the
    largest of every quantity, the ends of each run with force, and `always`. The largest of all are among them.
    """
    count = len(where)
    if count <= 3 * STRETCHES:
        return np.arange(count)
    kept = [np.array([0, count - 1, *always], dtype=np.intp), _corners(where)]
    kept += [_largest(quantity.values, COARSE if place else STRETCHES) for place, quantity in enumerate(quantities)]
    edges = np.flatnonzero(np.diff(np.isfinite(quantities[0].values).astype(np.int8)))
    if len(edges) <= STRETCHES:
        kept += [edges, edges + 1]
    return np.unique(np.concatenate(kept))


def _stretches(count: int, number: int) -> tuple[int, int]:
    """The length of equal stretches, and how many of them."""
    each = -(-count // number)
    return each, -(-count // each)


def _largest(values: Array, stretches: int) -> Indices:
    """Of each stretch the target of the largest size, and the one of all."""
    each, many = _stretches(len(values), stretches)
    sizes = np.full(each * many, -1.0)
    sizes[:len(values)] = np.nan_to_num(np.abs(values), nan=-1.0)
    found = each * np.arange(many) + np.argmax(sizes.reshape(many, each), axis=1)
    return np.asarray(found[sizes[found] >= 0])


def _corners(where: Array) -> Indices:
    """Of each stretch its first target and the one farthest from the straight line between its ends."""
    count = len(where)
    each, many = _stretches(count, STRETCHES)
    first = each * np.arange(many)
    last = np.minimum(first + each, count - 1)
    owner = np.arange(count) // each
    start, way = where[first][owner], (where[last] - where[first])[owner]
    square = np.maximum(np.einsum("ij,ij->i", way, way), 1e-18)
    off = where - start
    off = off - way * (np.einsum("ij,ij->i", off, way) / square)[:, None]
    sizes = np.full(each * many, -1.0)
    sizes[:count] = np.nan_to_num(np.einsum("ij,ij->i", off, off), nan=-1.0)
    return np.unique(np.concatenate([first, first + np.argmax(sizes.reshape(many, each), axis=1)]))


def path_view(
    title: str, caption: str, path: RobotPath, quantities: Sequence[Quantity], text: RapidProgram, findings: Sequence[Finding]
) -> View:
    """The path with its quantities; text: of the program as given, whose lines are shown; findings: those of this file are
    marked where they name a line with a target."""
    toolpath, where = path.toolpath, 1e3 * path.rest_from_tcp.position
    where = np.where(path.known[:, None], where, np.nan)
    places = _places(findings, text.source.name, toolpath.line)
    kept = kept_targets(where, quantities, [place for place, _, _ in places])
    drawn = [replace(quantity, values=quantity.values[kept]) for quantity in quantities]
    length = np.nan_to_num(1e3 * path.length)
    marked = [int(np.searchsorted(kept, place)) for place, _, _ in places]
    data: dict[str, Any] = {
        "step_mm": STEP_MM, "start": drawn[0].largest or 0,
        "position": packed(where[kept], STEP_MM), "length": packed(np.maximum.accumulate(length)[kept], STEP_MM),
        "line": packed(toolpath.line[kept].astype(float)), "target": packed(toolpath.number[kept].astype(float)),
        "texts": packed_words(_texts(text, toolpath.line[kept], drawn, marked)),
        "quantities": [_quantity(quantity) for quantity in drawn],
        "marks": [{"index": index, "line": finding.line, "level": finding.level, "finding": at}
                  for index, (_, at, finding) in zip(marked, places, strict=True)]}
    if len(kept) < len(where):
        caption += (f" {len(kept)} of {len(where)} targets are drawn: of each stretch of the program the first, the corner and "
                    "the largest values; the largest of all is always among them.")
    # In print the findings that warn, and the largest place of all.
    named = {place: f"line {finding.line}" for place, _, finding in places if finding.level != "note"}
    if (largest := quantities[0].largest) is not None:
        named[largest] = f"largest, line {toolpath.line[largest]}"
    return View(title, caption, "path", data,
                _picture(where[kept], drawn[0], f"{title}. Colour: {drawn[0].name}.", where[list(named)], list(named.values())),
                frozenset(at for _, at, _ in places))


def _quantity(quantity: Quantity) -> dict[str, Any]:
    place = quantity.largest
    return {"key": quantity.key, "name": quantity.name, "unit": quantity.unit.replace("um", "\u00b5m"), "words": quantity.words,
            "kind": quantity.kind, "digits": quantity.digits, "step": quantity.step, "limit": quantity.limit,
            "tolerance": quantity.tolerance, "values": packed(quantity.values, quantity.step),
            "largest": None if place is None else {"index": place, "value": float(quantity.values[place])}}


def _places(findings: Sequence[Finding], source: str, line: Indices) -> list[tuple[int, int, Finding]]:
    """Target, place among the folded findings and finding of each that names a line of the program with a target."""
    placed = []
    order = np.argsort(line, kind="stable")
    lines = line[order]
    for at, finding in enumerate(fold(tuple(findings))):
        if finding.line is not None and finding.file == source:
            place = int(np.searchsorted(lines, finding.line, side="right")) - 1
            if place >= 0 and lines[place] == finding.line:
                placed.append((int(order[place]), at, finding))
    return placed


def _texts(program: RapidProgram, lines: Indices, drawn: Sequence[Quantity], marked: list[int]) -> list[str]:
    """The lines of the program at the places (k,) that are drawn; "" for some of very many, never for those `marked`."""
    shown = np.ones(len(lines), dtype=bool)
    if len(lines) > MOST_TEXTS:
        shown[:] = False
        shown[::-(-len(lines) // (MOST_TEXTS - 1000))] = True
        shown[np.unique(np.concatenate([_largest(quantity.values, 100) for quantity in drawn]))] = True
        shown[marked] = True
    text = program.source
    starts = np.concatenate([[text.start], text.ends, [len(text.data)]])
    words = []
    for line, wanted in zip(lines.tolist(), shown.tolist(), strict=True):
        if not wanted or not 0 < line < len(starts):
            words.append("")
            continue
        own = text.text(int(starts[line - 1]), int(starts[line])).strip()
        words.append(own if len(own) <= LONGEST_TEXT else f"{own[:LONGEST_TEXT - 1]}…")
    return words


def _picture(where: Array, quantity: Quantity, label: str, marked: Array, names: Sequence[str]) -> Markup:
    """The path from one side: grey without force, else by a quantity's colour; places marked (m, 3) with their names."""
    cut = where[np.isfinite(quantity.values) & np.isfinite(where).all(axis=1)]
    # What is cut fills the picture, without the way there from home.
    seen = cut if len(cut) > 1 else where
    project = Projection.fitting(seen if np.isfinite(seen).any() else np.zeros((1, 3)))
    x, y = project(where)
    size = np.abs(quantity.values)
    share = np.nan_to_num(BINS * size / quantity.limit, nan=-1.0)
    colour = np.where(np.isfinite(size), np.minimum(share, BINS - 1), -1.0).astype(int)
    parts = []
    for own in (-1, *range(BINS)):
        # Each segment has the colour of its end.
        mine = np.flatnonzero(colour[1:] == own) + 1
        if not len(mine):
            continue
        ends = np.column_stack([x[mine - 1], x[mine], np.full(len(mine), np.nan)]).ravel()
        heights = np.column_stack([y[mine - 1], y[mine], np.full(len(mine), np.nan)]).ravel()
        parts.append(stroke("air" if own < 0 else f"heat-{own}", 0.7 if own < 0 else 2.4, *_joined(ends, heights)))
    if len(names):
        parts += named_places(*project(marked), names)
    for place in range(BINS):
        parts.append(Markup('<rect class="fill-heat-{}" x="{}" y="440" width="15" height="9"/>').format(place, 20 + 15 * place))
    parts.append(Markup('<text x="20" y="434">{}: 0 to {} {}; grey: no force</text>').format(
        quantity.name, number(round(quantity.limit, quantity.digits)), quantity.unit.replace("um", "µm")))
    return picture(parts, project, label)


def _joined(x: Array, y: Array) -> tuple[Array, Array]:
    """Segments (start, end, gap, ...) whose ends meet become one line."""
    start, end = np.arange(0, len(x), 3), np.arange(1, len(x), 3)
    meets = np.zeros(len(start), dtype=bool)
    meets[1:] = (x[start[1:]] == x[end[:-1]]) & (y[start[1:]] == y[end[:-1]])
    keep = np.ones(len(x), dtype=bool)
    keep[start[meets]] = False
    keep[start[meets] - 1] = False
    return x[keep], y[keep]

"""Charts as SVG: drawn here and not in the browser, so that they print, follow the page's colours and need no script."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from textwrap import wrap
from typing import Any

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from identification.common.chart import Axis, Band, Bars, Cells, Figure, Line, Panel, Points, Rule, Series
from identification.common.typeset import typeset

Array = NDArray[np.float64]
WIDE, HALF, NARROW = 920, 450, 370
SMALL = "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"
RAISED = str.maketrans("-0123456789", SMALL)
LETTER = 7.0                        # width of a letter of the axes [px]
TOP, RIGHT, BOTTOM = 26.0, 16.0, 46.0
# Names beside a chart take this share of its width at most, and go on in further lines.
NAMES, LINE = 0.42, 14.0
# More points than these get no label each; of longer lines so many columns keep their lowest and highest.
MOST_LABELS, COLUMNS = 400, 600
# What is larger, or of logarithmic axes smaller, is no place on a chart.
HUGE = 1e200
BAR = Markup('<rect class="fill-{}" x="{:.1f}" y="{:.1f}" width="{:.1f}" height="{:.1f}"><title>{}: {} {}</title></rect>')


@dataclass(frozen=True)
class Scale:
    """Values to pixels along one axis."""

    low: float
    high: float
    start: float
    end: float
    log: bool = False

    def __call__(self, values: Any) -> Array:
        """(n,) pixels; NaN where there is none."""
        values = np.asarray(values, dtype=float)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            if self.log:
                values = np.log(values / self.low) / np.log(self.high / self.low)
            else:
                values = (values - self.low) / (self.high - self.low)
            return np.where(np.isfinite(values), self.start + np.clip(values, -1.0, 2.0) * (self.end - self.start), np.nan)


def number(value: float) -> str:
    """As axes and tables show it: a point for the decimals, thin blanks between thousands, no rounding of what is exact."""
    if value == 0:
        return "0"
    text = f"{value:.6g}"
    if "e" in text:
        mantissa, power = text.split("e")
        return ("" if mantissa == "1" else f"{mantissa}·") + "10" + str(int(power)).translate(RAISED)
    whole, _, rest = text.partition(".")
    sign, whole = ("−", whole[1:]) if whole.startswith("-") else ("", whole)
    if len(whole) > 4:
        whole = f"{int(whole):,}".replace(",", "\u202f")
    return f"{sign}{whole}{'.' if rest else ''}{rest}"


def numbers(values: Array, log: bool) -> list[str]:
    """The marks of one axis: on a logarithmic one all as powers of ten where one of them is."""
    texts = [number(float(value)) for value in values]
    if log and any("10" in text and text[-1] in SMALL for text in texts):
        powers = np.floor(np.log10(values) + 1e-9).astype(int)
        factors = [f"{value / 10.0**power:.3g}" for value, power in zip(values, powers, strict=True)]
        texts = [("" if factor == "1" else f"{factor}·") + "10" + str(power).translate(RAISED)
                 for factor, power in zip(factors, powers, strict=True)]
    return texts


def ticks(low: float, high: float, most: int) -> Array:
    """Round values between two others, steps of 1, 2 or 5 times a power of ten: the widest that leave `most` of them or fewer,
    and a finer one where that would leave a single one."""
    raw = max((high - low) / max(most, 1), 1e-300)
    power = 10.0 ** np.floor(np.log10(raw))
    steps = [power * factor for factor in (10.0, 5.0, 2.0, 1.0, 0.5, 0.2)]
    first = next(i for i in (3, 2, 1, 0) if steps[i] >= raw * (1 - 1e-9))
    found = np.zeros(0)
    for step in steps[first:]:
        found = np.round(np.arange(np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9) + 1) * step, 12)
        if len(found) > 1:
            break
    return np.asarray(found)


def log_ticks(low: float, high: float, most: int) -> Array:
    """Powers of ten, with what stands between them where few fit; of next to no range even steps."""
    first, last = np.floor(np.log10(low)), np.ceil(np.log10(high))
    decades = 10.0 ** np.arange(first, last + 1, max(1, int((last - first) // max(most, 1))))
    inside = [value for value in decades if low <= value <= high]
    if len(inside) < 3:
        inside = [value * factor for value in decades for factor in (1, 2, 5) if low <= value * factor <= high]
    return np.array(inside) if len(inside) > 1 else ticks(low, high, most)


def legend(figure: Figure) -> list[tuple[str, str, str]]:
    """Name, colour and kind of mark of each series that has a name, once; nothing where there is but one."""
    kinds = {Line: "line", Points: "dot", Band: "area", Bars: "area", Rule: "rule"}
    entries = [(item.name, item.colour, "rule" if isinstance(item, Line) and item.dashed else
                item.symbol if isinstance(item, Points) else kinds[type(item)])
               for panel in figure.panels for item in panel.series
               if not isinstance(item, Cells) and item.name and getattr(item, "legend", True)]
    named = list({name: (name, colour, kind) for name, colour, kind in entries}.values())
    return named if len(named) > 1 else []


def draw(panel: Panel, width: int, label: str) -> Markup:
    """One panel as an SVG of this width [px]; label: what it shows, for those who do not see it."""
    names = [wrap(name, int(NAMES * width / LETTER), break_on_hyphens=False) or [""] for name in panel.y.categories]
    lines = max(map(len, names), default=1)
    height = max(panel.height, TOP + BOTTOM + (3 + LINE * lines) * len(names)) if panel.sideways else panel.height
    vertical = _scale(panel, panel.y, "y", height - BOTTOM, TOP)
    marks = [] if names else _marks(vertical, 42)
    left = 14 + LETTER * max([4, *(len(line) for name in names for line in name), *(len(text) for _, text in marks)])
    horizontal = _scale(panel, panel.x, "x", left, width - RIGHT)
    parts = [_axis_x(panel.x, horizontal, height, width), _axis_y(panel.y, names, vertical, left, width, marks)]
    bars = [item for item in panel.series if isinstance(item, Bars)]
    if bars:
        parts.append(_bars(panel, bars, horizontal, vertical))
    parts += [_drawn(item, horizontal, vertical) for item in panel.series if not isinstance(item, Bars)]
    return Markup('<svg class="chart" role="img" aria-label="{}" viewBox="0 0 {} {:.0f}" width="{}" height="{:.0f}">'
                  "{}</svg>").format(
        label, width, height, width, height, Markup("").join(parts))


def _extent(panel: Panel, which: str) -> Array:
    """All finite values along x or y."""
    values: list[Any] = []
    for item in panel.series:
        if isinstance(item, Line | Points):
            values.append(item.x if which == "x" else item.y)
            if which == "y" and isinstance(item, Points) and item.interval is not None:
                values += list(item.interval)
        elif isinstance(item, Band):
            values += [item.x] if which == "x" else [item.low, item.high]
        elif isinstance(item, Rule) and item.upright == (which == "x"):
            values.append([item.at])
        elif isinstance(item, Bars) and (which == "x") == panel.sideways:
            values += [item.values, [0.0]]
    stacks = [np.asarray(item.values, dtype=float) for item in panel.series if isinstance(item, Bars)]
    if panel.stacked and stacks and (which == "x") == panel.sideways:
        values.append(np.nansum(stacks, axis=0))
    flat = np.concatenate([np.asarray(value, dtype=float).ravel() for value in values]) if values else np.zeros(0)
    return np.asarray(flat[np.abs(flat) < HUGE])


def _scale(panel: Panel, axis: Axis, which: str, start: float, end: float) -> Scale:
    if axis.categories:
        count = len(axis.categories)
        # Categories on y run downwards.
        return Scale(-0.5, count - 0.5, end, start) if which == "y" else Scale(-0.5, count - 0.5, start, end)
    if axis.limits is not None:
        return Scale(*axis.limits, start, end, axis.log)
    found = _extent(panel, which)
    if axis.log:
        positive = found[found > 1 / HUGE] if (found > 1 / HUGE).any() else np.array([1.0, 10.0])
        low, high = float(positive.min()), float(positive.max())
        return Scale(low / 1.15, high * 1.15, start, end, log=True) if high / low > 1.01 else Scale(
            low / 2, high * 2, start, end, log=True)
    low, high = (float(found.min()), float(found.max())) if len(found) else (0.0, 1.0)
    if axis.from_zero:
        low, high = min(low, 0.0), max(high, 0.0)
    if high - low <= 1e-12 * max(abs(low), abs(high)):
        low, high = low - (abs(low) or 1.0), high + (abs(high) or 1.0)
    room = 0.04 * (high - low)
    bars = any(isinstance(item, Bars) for item in panel.series)
    return Scale(low if low == 0 and (axis.from_zero or bars) else low - room, high + room, start, end)


def _axis_x(axis: Axis, scale: Scale, height: float, width: int) -> Markup:
    bottom = height - BOTTOM
    room = scale.end - scale.start
    parts = [Markup('<path class="axis" d="M{:.1f} {:.1f}H{:.1f}"/>').format(scale.start, bottom, scale.end)]
    if axis.categories:
        # As many names as fit without touching.
        longest = max(len(name) for name in axis.categories)
        every = max(1, int(np.ceil(len(axis.categories) * (LETTER * longest + 10) / room)))
        shown = [(float(scale(i)), name) for i, name in enumerate(axis.categories) if i % every == 0]
    else:
        shown = _marks(scale, 90)
        parts += [Markup('<path class="grid" d="M{:.1f} {:.1f}V{:.1f}"/>').format(x, TOP, bottom) for x, _ in shown]
    parts += [Markup('<text x="{:.1f}" y="{:.1f}" text-anchor="middle">{}</text>').format(x, bottom + 17, words)
              for x, words in shown]
    if axis.title:
        parts.append(Markup('<text class="title" x="{:.1f}" y="{:.1f}" text-anchor="end">{}</text>').format(
            width - RIGHT, height - 8, typeset(axis.title)))
    return Markup("").join(parts)


def _marks(scale: Scale, room: float) -> list[tuple[float, str]]:
    """Pixels and words of round values, about so far apart [px]."""
    fits = max(2, int(abs(scale.end - scale.start) / room))
    found = log_ticks(scale.low, scale.high, fits) if scale.log else ticks(scale.low, scale.high, fits)
    return [(float(scale(value)), words) for value, words in zip(found, numbers(found, scale.log), strict=True)]


def _axis_y(
    axis: Axis, names: list[list[str]], scale: Scale, left: float, width: int, marks: list[tuple[float, str]]
) -> Markup:
    parts = [Markup('<text x="{:.1f}" y="{:.1f}" text-anchor="end">{}</text>').format(
        left - 8, float(scale(i)) + 4 + LINE * (k - 0.5 * (len(name) - 1)), line)
        for i, name in enumerate(names) for k, line in enumerate(name)]
    line = Markup('<path class="{}" d="M{:.1f} {:.1f}H{:.1f}"/><text x="{:.1f}" y="{:.1f}" text-anchor="end">{}</text>')
    parts += [line.format("zero" if words == "0" else "grid", left, y, width - RIGHT, left - 6, y + 4, words)
              for y, words in marks]
    if axis.title:
        parts.append(Markup('<text class="title" x="4" y="14">{}</text>').format(typeset(axis.title)))
    return Markup("").join(parts)


def _bars(panel: Panel, bars: list[Bars], horizontal: Scale, vertical: Scale) -> Markup:
    """Rectangles from zero, or from the bar below, with their values as words."""
    along, across = (vertical, horizontal) if panel.sideways else (horizontal, vertical)
    step = abs(along.end - along.start) / max(along.high - along.low, 1.0)
    thick = 0.76 * step / (1 if panel.stacked else len(bars))
    names = panel.y.categories if panel.sideways else panel.x.categories
    floor = across.low if across.log else 0.0
    base = np.full(len(names), floor)
    parts = []
    for place, item in enumerate(bars):
        values = np.asarray(item.values, dtype=float)
        known = np.isfinite(values)
        ends = np.where(known, base + values if panel.stacked else values, base)
        first, last = across(base), across(ends)
        middle = along(np.arange(len(names))) + (0.0 if panel.stacked else (place - 0.5 * (len(bars) - 1)) * thick)
        for i, name in enumerate(names):
            if not known[i]:
                continue
            near, far = sorted((float(first[i]), float(last[i])))
            edge = float(middle[i]) - 0.5 * thick
            box = (near, edge, far - near, thick) if panel.sideways else (edge, near, thick, far - near)
            parts.append(BAR.format(item.colour, *box, name, item.name, number(float(values[i]))))
        if panel.stacked:
            base = ends
    return Markup("").join(parts)


def _drawn(item: Series, horizontal: Scale, vertical: Scale) -> Markup:
    if isinstance(item, Line):
        return Markup('<path class="line stroke-{}{}" stroke-width="{:g}" d="{}"/>').format(
            item.colour, " dashed" if item.dashed else "", item.width, polyline(*_thinned(item, horizontal, vertical)))
    if isinstance(item, Band):
        x, low, high = horizontal(item.x), vertical(item.low), vertical(item.high)
        known = np.flatnonzero(np.isfinite(x) & np.isfinite(low) & np.isfinite(high))
        # It ends where its edges are not known, and begins anew behind.
        runs = np.split(known, np.flatnonzero(np.diff(known) > 1) + 1) if len(known) else []
        around = " ".join(polyline(np.r_[x[run], x[run][::-1]], np.r_[high[run], low[run][::-1]]) + "Z" for run in runs)
        return Markup('<path class="area fill-{}" d="{}"/>').format(item.colour, around) if runs else Markup("")
    if isinstance(item, Rule):
        if not np.isfinite(horizontal(item.at) if item.upright else vertical(item.at)):
            return Markup("")
        if item.upright:
            where = Markup("M{:.1f} {:.1f}V{:.1f}").format(float(horizontal(item.at)), vertical.start, vertical.end)
        else:
            where = Markup("M{:.1f} {:.1f}H{:.1f}").format(horizontal.start, float(vertical(item.at)), horizontal.end)
        return Markup('<path class="line dashed stroke-{}" stroke-width="1.3" d="{}"/>').format(item.colour, where)
    if isinstance(item, Cells):
        return _cells(item, horizontal, vertical)
    assert isinstance(item, Points)
    return _points(item, horizontal, vertical)


def _points(item: Points, horizontal: Scale, vertical: Scale) -> Markup:
    x, y = horizontal(item.x), vertical(item.y)
    shown = np.flatnonzero(np.isfinite(x) & np.isfinite(y))
    parts = []
    if item.interval is not None:
        low, high = (vertical(end) for end in item.interval)
        d = "".join(f"M{x[i]:.1f} {low[i]:.1f}V{high[i]:.1f}" for i in shown)
        parts.append(Markup('<path class="line stroke-{}" stroke-width="{:g}" d="{}"/>').format(
            item.colour, 7 if item.symbol == "dash" else 2, d))
    half = 0.5 * item.size
    if len(item.labels) and len(shown) <= MOST_LABELS:
        parts += [Markup('<circle class="fill-{}" cx="{:.1f}" cy="{:.1f}" r="{:g}"><title>{}</title></circle>').format(
            item.colour, x[i], y[i], half, item.labels[int(i)]) for i in shown]
    elif item.symbol == "dot":
        d = "".join(f"M{x[i]:.1f} {y[i]:.1f}h0" for i in shown)
        parts.append(Markup('<path class="dots stroke-{}" stroke-width="{:g}" d="{}"/>').format(item.colour, item.size, d))
    else:
        shape = (f"m-{half:g} -{half:g}l{2 * half:g} {2 * half:g}m0 -{2 * half:g}l-{2 * half:g} {2 * half:g}"
                 if item.symbol == "cross" else f"m-{2 * half:g} 0h{4 * half:g}")
        d = "".join(f"M{x[i]:.1f} {y[i]:.1f}{shape}" for i in shown)
        parts.append(Markup('<path class="line stroke-{}" stroke-width="1.5" d="{}"/>').format(item.colour, d))
    return Markup("").join(parts)


def _cells(item: Cells, horizontal: Scale, vertical: Scale) -> Markup:
    values = np.asarray(item.values, dtype=float)
    wide, high = abs(horizontal(1) - horizontal(0)), abs(vertical(1) - vertical(0))
    cell = Markup('<rect class="fill-{}" fill-opacity="{:.2f}" x="{:.1f}" y="{:.1f}" width="{:.1f}" height="{:.1f}"/>'
                  '<text x="{:.1f}" y="{:.1f}" text-anchor="middle">{}</text>')
    return Markup("").join(cell.format(
        "before" if value > 0 else "after", 0.5 * min(abs(value), 1.0), horizontal(j) - 0.5 * wide,
        vertical(i) - 0.5 * high, wide, high, horizontal(j), vertical(i) + 4, f"{value:.2f}".replace("-", "−"))
        for i, row in enumerate(values) for j, value in enumerate(row))


def _thinned(item: Line, horizontal: Scale, vertical: Scale) -> tuple[Array, Array]:
    """Pixels of the line; of a long one the ends, the lowest and the highest of each column."""
    x, y = np.asarray(item.x, dtype=float), np.asarray(item.y, dtype=float)
    kept = extremes(y, COLUMNS)
    return horizontal(x[kept]), vertical(y[kept])


def extremes(values: Array, columns: int) -> NDArray[np.intp]:
    """Places (k,), ascending, of at most 4 values in each of so many equal stretches: its ends, its least and its largest."""
    count = len(values)
    if count <= 4 * columns:
        return np.arange(count)
    each = -(-count // columns)
    padded = np.pad(np.asarray(values, dtype=float), (0, -count % each), constant_values=np.nan).reshape(-1, each)
    first = each * np.arange(len(padded))
    lowest = first + np.argmin(np.where(np.isnan(padded), np.inf, padded), axis=1)
    highest = first + np.argmax(np.where(np.isnan(padded), -np.inf, padded), axis=1)
    return np.unique(np.minimum(np.concatenate([first, lowest, highest, first + each - 1]), count - 1))


def polyline(x: Array, y: Array) -> str:
    """A path's `d`; NaN is a gap. A place alone between gaps is a line of no length, which round ends make a dot."""
    known = np.isfinite(x) & np.isfinite(y)
    edges = np.flatnonzero(np.diff(np.r_[False, known, False].astype(np.int8)))
    return "".join("M" + "L".join(f"{a:.1f} {b:.1f}" for a, b in zip(x[start:end], y[start:end], strict=True))
                   + ("h0" if end == start + 1 else "")
                   for start, end in pairwise(edges) if known[start])


def drawn(figure: Figure) -> list[tuple[str, list[tuple[str, Markup]]]]:
    """Each panel: its words, and its pictures with the width they are for ("wide", "narrow" or "any")."""
    pictures = []
    for panel in figure.panels:
        label = f"{panel.words or figure.title}. {panel.y.title or 'values'} over {panel.x.title or 'categories'}"
        if figure.beside:
            pictures.append((panel.words, [("any", draw(panel, HALF, label))]))
        else:
            pictures.append((panel.words, [("wide", draw(panel, WIDE, label)), ("narrow", draw(panel, NARROW, label))]))
    return pictures



"""Small SVG pictures for the documentation: panels of dots and lines, no plotting library."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

WIDTH, HEIGHT, LEFT, BELOW, ABOVE = 300, 230, 52, 40, 26


@dataclass(frozen=True, eq=False)
class Series:
    """x (n,), y (n,), a CSS colour, a name for the key, dots or a line."""

    x: np.ndarray
    y: np.ndarray
    colour: str
    name: str
    line: bool = False


@dataclass(frozen=True, eq=False)
class Panel:
    """One set of axes."""

    title: str
    x_label: str
    y_label: str
    series: Sequence[Series]


def ticks(low: float, high: float) -> list[float]:
    """Round numbers between two limits."""
    raw = (high - low) / 4
    step = 10 ** np.floor(np.log10(raw))
    step *= min((m for m in (1, 2, 5, 10)), key=lambda m: abs(m * step - raw))
    return [float(value) + 0.0 for value in np.arange(np.ceil(low / step), np.floor(high / step) + 1) * step]


def svg(panels: Sequence[Panel]) -> str:
    """The panels side by side."""
    parts = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH * len(panels)} {HEIGHT + 18}" '
             'font-family="sans-serif" font-size="10">', '<rect width="100%" height="100%" fill="#fff"/>']
    for number, panel in enumerate(panels):
        parts += _panel(panel, WIDTH * number)
    place = LEFT
    for series in panels[0].series:
        parts.append(f'<rect x="{place}" y="{HEIGHT + 3}" width="10" height="10" fill="{series.colour}"/>'
                     f'<text x="{place + 14}" y="{HEIGHT + 12}">{series.name}</text>')
        place += 30 + 6 * len(series.name)
    return "\n".join([*parts, "</svg>\n"])


def _panel(panel: Panel, shift: float) -> list[str]:
    x, y = (np.concatenate([getattr(one, name) for one in panel.series]) for name in ("x", "y"))
    (x0, x1), (y0, y1) = ((float(v.min()), float(v.max())) for v in (x, y))
    y0, y1 = y0 - 0.04 * (y1 - y0), y1 + 0.04 * (y1 - y0)
    wide, tall = WIDTH - LEFT - 12, HEIGHT - BELOW - ABOVE

    def px(value: np.ndarray | float) -> np.ndarray | float:
        return shift + LEFT + (value - x0) / (x1 - x0) * wide

    def py(value: np.ndarray | float) -> np.ndarray | float:
        return ABOVE + (y1 - value) / (y1 - y0) * tall

    parts = [f'<text x="{shift + LEFT}" y="16" font-size="12">{panel.title}</text>',
             f'<text x="{shift + LEFT + wide / 2:.0f}" y="{HEIGHT - 8}" text-anchor="middle">{panel.x_label}</text>',
             f'<text transform="translate({shift + 11:.0f},{ABOVE + tall / 2:.0f}) rotate(-90)" '
             f'text-anchor="middle">{panel.y_label}</text>']
    for value in ticks(x0, x1):
        parts.append(f'<path d="M{px(value):.1f} {ABOVE}v{tall}" stroke="#eee"/><text x="{px(value):.1f}" '
                     f'y="{ABOVE + tall + 13}" text-anchor="middle">{value:g}</text>')
    for value in ticks(y0, y1):
        parts.append(f'<path d="M{shift + LEFT} {py(value):.1f}h{wide}" stroke="#eee"/><text x="{shift + LEFT - 4}" '
                     f'y="{py(value) + 3:.1f}" text-anchor="end">{value:g}</text>')
    for one in panel.series:
        points = list(zip(np.atleast_1d(px(one.x)), np.atleast_1d(py(one.y)), strict=True))
        if one.line:
            path = " ".join(f"{a:.1f},{b:.1f}" for a, b in points)
            parts.append(f'<polyline points="{path}" fill="none" stroke="{one.colour}" stroke-width="0.8"/>')
        else:
            path = "".join(f"M{a:.1f} {b:.1f}h0" for a, b in points)
            parts.append(f'<path d="{path}" stroke="{one.colour}" stroke-width="2" stroke-linecap="round" fill="none"/>')
    return parts

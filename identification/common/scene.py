"""Lines in space: as a picture from one side, and as data for the browser to turn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from identification.common.chart_svg import polyline
from identification.common.report import View

Array = NDArray[np.float64]
# From where pictures look, as scene.js does at first.
FROM = np.array([0.62, -0.68, 0.5])
WIDTH, HEIGHT, EDGE = 920.0, 460.0, 34.0
# Of names in a picture: a letter, a row, a dot [px].
LETTER, ROW, DOT = 6.8, 15.0, 5.0


@dataclass(frozen=True, eq=False)
class SpaceLine:
    """Points (n, 3), joined by a line of this width [px], 0 for none; dots: the size [px] of a mark at each, 0 for none."""

    points: Array
    colour: str
    width: float = 2.0
    dots: float = 0.0


@dataclass(frozen=True)
class Projection:
    """Space to the pixels of a picture: parallel, seen from FROM, z upwards, x to y turning left as seen from above."""

    across: Array
    up: Array
    scale: float
    centre: Array

    @staticmethod
    def fitting(points: Array) -> Projection:
        """In which all points (n, 3) are in the picture."""
        towards = FROM / np.linalg.norm(FROM)
        across = np.cross([0.0, 0.0, 1.0], towards)
        across /= np.linalg.norm(across)
        up = np.cross(towards, across)
        flat = np.column_stack([points @ across, points @ up])
        flat = flat[np.isfinite(flat).all(axis=1)]
        low, high = (flat.min(axis=0), flat.max(axis=0)) if len(flat) else (np.zeros(2), np.ones(2))
        size = np.maximum(high - low, 1e-9)
        return Projection(across, up, float(min((WIDTH - 2 * EDGE) / size[0], (HEIGHT - 2 * EDGE) / size[1])),
                          0.5 * (low + high))

    def __call__(self, points: Array) -> tuple[Array, Array]:
        """Pixels x, y (n,)."""
        return (0.5 * WIDTH + self.scale * (points @ self.across - self.centre[0]),
                0.5 * HEIGHT - self.scale * (points @ self.up - self.centre[1]))


def stroke(name: str, width: float, x: Array, y: Array) -> Markup:
    """A line of the picture; NaN is a gap."""
    return Markup('<path class="line stroke-{}" stroke-width="{:g}" d="{}"/>').format(name, width, polyline(x, y))


def named_places(x: Array, y: Array, names: Sequence[str]) -> list[Markup]:
    """Dots at x, y (n,) [px] with their names above them, higher where another name or dot stands, below where there is no
    room; NaN is none."""
    parts, signs = [], list[tuple[float, float, float]]()
    dots = [(across, down) for across, down in zip(x.tolist(), y.tolist(), strict=True) if np.isfinite(across)]
    for across, down, name in zip(x.tolist(), y.tolist(), names, strict=True):
        if not np.isfinite(across):
            continue
        half = 0.5 * LETTER * len(name)
        middle = min(max(across, half + 2), WIDTH - half - 2)

        def free(foot: float, middle: float = middle, half: float = half) -> bool:
            return ROW <= foot <= HEIGHT and all(
                abs(foot - other) >= ROW or abs(middle - beside) >= half + wide for beside, other, wide in signs) and not any(
                foot - ROW < below < foot + DOT and abs(middle - beside) < half + DOT for beside, below in dots)

        places = [down - 9 - 0.5 * ROW * k for k in range(60)] + [down + 9 + ROW + 0.5 * ROW * k for k in range(60)]
        foot = next((foot for foot in places if free(foot)), down - 9)
        signs.append((middle, foot, half))
        if foot < down - 9:
            parts.append(Markup('<path class="stroke-ink" stroke-width="0.7" d="M{:.1f} {:.1f}L{:.1f} {:.1f}"/>').format(
                across, down, middle, foot + 3))
        parts.append(Markup('<path class="dots stroke-ink" stroke-width="8" d="M{:.1f} {:.1f}h0"/><text class="mark" '
                            'x="{:.1f}" y="{:.1f}" text-anchor="middle">{}</text>').format(across, down, middle, foot, name))
    return parts


def picture(parts: Sequence[Markup], project: Projection, label: str) -> Markup:
    """An SVG of the parts with the directions of the axes."""
    axes = []
    for name, axis in zip("xyz", np.eye(3), strict=True):
        tip = 34 * np.array([axis @ project.across, -axis @ project.up])
        axes.append(Markup('<path class="stroke-muted" stroke-width="1.5" d="M{0:.1f} {1:.1f}l{2:.1f} {3:.1f}"/><text '
                           'x="{4:.1f}" y="{5:.1f}" text-anchor="middle">{6}</text>').format(
            WIDTH - 60, HEIGHT - 55, *tip, WIDTH - 60 + 1.3 * tip[0], HEIGHT - 51 + 1.3 * tip[1], name))
    return Markup('<svg class="scene" role="img" aria-label="{}" viewBox="0 0 {:g} {:g}">{}{}</svg>').format(
        label, WIDTH, HEIGHT, Markup("").join(parts), Markup("").join(axes))


def scene(title: str, caption: str, lines: Sequence[SpaceLine]) -> View:
    """Lines that a browser can turn, and their picture."""
    project = Projection.fitting(np.concatenate([line.points for line in lines]) if lines else np.zeros((1, 3)))
    drawn = [stroke(line.colour, line.width, *project(line.points)) for line in lines if line.width]
    for line in lines:
        if line.dots:
            d = "".join(f"M{x:.1f} {y:.1f}h0" for x, y in zip(*project(line.points), strict=True))
            drawn.append(Markup('<path class="dots stroke-{}" stroke-width="{:g}" d="{}"/>').format(line.colour, line.dots, d))
    data: dict[str, Any] = {"lines": [{"points": np.round(line.points, 5).tolist(), "colour": line.colour, "width": line.width,
                                       "dots": line.dots} for line in lines]}
    return View(title, caption, "scene", data, picture(drawn, project, title))

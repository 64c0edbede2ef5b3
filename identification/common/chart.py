"""Charts as plain values: what is drawn over which axes, in units, before anything is an image."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

AXES = "xyz"
# Names of colours, each with a light and a dark value in report.css. Those of the base axes stay the same in every report.
AXIS_COLOURS = ("x", "y", "z")
Values = Sequence[float] | Any      # (n,) numbers, an array as a rule


@dataclass(frozen=True)
class Axis:
    """title: with its unit. categories: names in place of numbers, the first at 0. from_zero: the axis begins at zero. limits:
    of panels that shall be compared, None: as far as the values go."""

    title: str = ""
    log: bool = False
    categories: Sequence[str] = ()
    from_zero: bool = False
    limits: tuple[float, float] | None = None


@dataclass(frozen=True)
class Line:
    """Joined points (n,); NaN is a gap."""

    name: str
    x: Values
    y: Values
    colour: str = "after"
    width: float = 1.5
    dashed: bool = False
    legend: bool = True


@dataclass(frozen=True)
class Points:
    """Marks (n,), each with a label that is shown when pointed at, and an interval (low, high) along y where given."""

    name: str
    x: Values
    y: Values
    colour: str = "after"
    symbol: Literal["dot", "cross", "dash"] = "dot"
    size: float = 6.0
    labels: Sequence[str] = ()
    interval: tuple[Values, Values] | None = None


@dataclass(frozen=True)
class Band:
    """The area between low and high (n,)."""

    name: str
    x: Values
    low: Values
    high: Values
    colour: str = "muted"


@dataclass(frozen=True)
class Bars:
    """One bar a category (n,), beside those of other `Bars` of the panel, or on them where it is stacked."""

    name: str
    values: Values
    colour: str = "after"


@dataclass(frozen=True)
class Cells:
    """A matrix (n, m) with values from -1 to 1 as colours with their numbers; n categories on y, m on x."""

    values: Any


@dataclass(frozen=True)
class Rule:
    """A straight line across the panel at a value of y, or of x where it stands upright."""

    at: float
    name: str = ""
    colour: str = "ink"
    upright: bool = False


Series = Line | Points | Band | Bars | Cells | Rule


@dataclass(frozen=True)
class Panel:
    """Series over one pair of axes. stacked: bars stand on each other; sideways: bars lie, categories belong to y. words: what
    the panel shows, above it where there are several."""

    series: Sequence[Series]
    x: Axis = Axis()
    y: Axis = Axis()
    height: int = 300
    stacked: bool = False
    sideways: bool = False
    words: str = ""


@dataclass(frozen=True)
class Figure:
    """Panels under one title, a caption below. beside: two in a row where the page is wide enough."""

    title: str
    caption: str
    panels: Sequence[Panel]
    beside: bool = False

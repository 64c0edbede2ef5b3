"""What a user may choose for `predict` and `correct`, and the options that choose it."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any

import click


@dataclass(frozen=True)
class Settings:
    """tare: first and last target of an air move, whose mean force is the sensor's bias.

    APT and CSV toolpaths: zone_mm of every move, rapid_mm_s in the air, feed_mm_s where a table has none, tool_x the direction
    of the work object that the tool's x axis is turned towards, None to choose it.
    split: most targets of a part, None to write one module; split_load: parts are loaded one after the other.
    """

    tare: tuple[int, int] | None = None
    zone_mm: float = 0.3
    rapid_mm_s: float = 200.0
    feed_mm_s: float = 20.0
    tool_x: tuple[float, float, float] | None = None
    split: int | None = None
    split_load: bool = False


DEFAULTS = Settings()


class TargetRange(click.ParamType[tuple[int, int]]):
    """Two target numbers, FIRST:LAST."""

    name = "FIRST:LAST"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[int, int]:
        if isinstance(value, tuple):
            return value[0], value[1]
        first, colon, last = str(value).partition(":")
        if not (colon and first.isdigit() and last.isdigit() and int(first) <= int(last)):
            self.fail(f"'{value}' is not a range of targets such as 0:3", param, ctx)
        return int(first), int(last)


class Direction(click.ParamType[tuple[float, float, float]]):
    """Three numbers, X,Y,Z."""

    name = "X,Y,Z"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[float, float, float]:
        try:
            x, y, z = (float(part) for part in (value if isinstance(value, tuple) else str(value).split(",")))
        except ValueError:
            self.fail(f"'{value}' is not a direction such as 1,0,0", param, ctx)
        if not 0 < math.hypot(x, y, z) < math.inf:
            self.fail(f"'{value}' has no direction", param, ctx)
        return x, y, z


Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]

# How the force log is read and placed: `predict` and `correct`.
FORCE_OPTIONS: tuple[Decorator, ...] = (
    click.option("--tare", type=TargetRange(), help="Targets of an air move: their mean force is the sensor's bias."),
)
# How an APT or CSV toolpath becomes RAPID: `post`, `predict` and `correct`.
POSTING_OPTIONS: tuple[Decorator, ...] = (
    click.option("--zone-mm", type=click.FloatRange(0, 200), default=Settings.zone_mm, show_default=True,
                 help="APT, CSV: fly-by zone of the moves, 0 for stop points."),
    click.option("--rapid-mm-s", type=click.FloatRange(1, 7000), default=Settings.rapid_mm_s, show_default=True,
                 help="APT, CSV: speed in the air."),
    click.option("--feed-mm-s", type=click.FloatRange(0, 7000, min_open=True), default=Settings.feed_mm_s, show_default=True,
                 help="CSV: feed where the table has none."),
    click.option("--tool-x", type=Direction(), help="APT: direction of the work object that tool x is turned towards."),
)
# One module or several: `post` and `correct`.
SPLITTING_OPTIONS: tuple[Decorator, ...] = (
    click.option("--split", type=click.IntRange(min=1), metavar="N", help="Parts of at most N targets, split in the air."),
    click.option("--split-load", is_flag=True, help="Load the parts one after the other, in place of all at once."),
)
# How the program is corrected: `correct` alone.
CORRECTION_OPTIONS: tuple[Decorator, ...] = (*SPLITTING_OPTIONS,)


def with_settings(*options: Decorator) -> Decorator:
    """Adds the options to a command's body and hands their values over as `settings`, a `Settings`."""

    def decorate(body: Callable[..., Any]) -> Callable[..., Any]:
        @functools.wraps(body)
        def run(*positional: Any, **arguments: Any) -> Any:
            chosen = {item.name: arguments.pop(item.name) for item in fields(Settings) if item.name in arguments}
            return body(*positional, settings=Settings(**chosen), **arguments)

        decorated: Callable[..., Any] = run
        for option in reversed(options):
            decorated = option(decorated)
        return decorated

    return decorate

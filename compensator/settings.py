"""What a user may choose for `predict` and `correct`, and the options that choose it."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, NamedTuple

import click

from identification.console import READABLE


class Estimate(NamedTuple):
    """A number and its standard error, in one unit."""

    value: float
    std: float = 0.0


ONE = Estimate(1.0)


@dataclass(frozen=True)
class Settings:
    """tare: first and last target of air moves, whose mean force is the sensor's bias. log_format: a public form of the force
    log, None for CSV and Parquet. spindle_rpm: the spindle's speed, whole revolutions of which are averaged; None: as cell.yaml
    states it, or found in the log.

    confidence: probability with which a correction must make its point better; at 0.69 those larger than their own standard
    deviation are made in full, those below half of it left out. slope [m/m]: the steepest change of the offset along the
    path; None: SLOPE, and no limit where the log names its targets, for then every step is the force's own.
    cutting_stiffness [N/m]: how the force grows with the depth of cut. logged_with: the offsets.csv that the program had
    while the force was logged; first_forces: the log of the pass before, without offsets. scale: factor on all joint
    compliances, from a measured pass. tolerance [m]: how far the correction along a move may be from what its place asks
    for; long_move [m]: a MoveL, or half a MoveC, of this length may get intermediate targets; keep_targets: none does.
    tighten_zones: zones that cut corners by more than the tolerance are made smaller. advise: say which turn about the tool's
    axis would lower the deviation. check_feed: work out whether the robot can hold the programmed feed; strict_feed: and
    refuse a cut that cannot.

    APT and CSV toolpaths: zone_mm of every move, rapid_mm_s in the air, feed_mm_s where a table has none, tool_x the direction
    of the work object that the tool's x axis is turned towards, None to choose it.
    split: most targets of a part, None to write one module; split_load: parts are loaded one after the other.
    """

    tare: tuple[tuple[int, int], ...] = ()
    log_format: str | None = None
    spindle_rpm: float | None = None
    confidence: float = 0.69
    slope: float | None = None
    cutting_stiffness: Estimate | None = None
    logged_with: Path | None = None
    first_forces: Path | None = None
    scale: Estimate = ONE
    tolerance: float = 5e-6
    long_move: float = 0.03
    keep_targets: bool = False
    tighten_zones: bool = False
    advise: bool = False
    check_feed: bool = False
    strict_feed: bool = False
    zone_mm: float = 0.3
    rapid_mm_s: float = 200.0
    feed_mm_s: float = 20.0
    tool_x: tuple[float, float, float] | None = None
    split: int | None = None
    split_load: bool = False

    def files(self) -> list[tuple[str, Path]]:
        """The input files among them, by name."""
        return [(item.name, value) for item in fields(self) if isinstance(value := getattr(self, item.name), Path)]

    def as_options(self) -> str:
        """What `correct` needs to read the log and the stiffness as here, as on the command line."""
        words = [f"--tare {first}:{last}" for first, last in self.tare]
        words += [f"--log-format {self.log_format}"] if self.log_format else []
        words += [f"--spindle-rpm {self.spindle_rpm:g}"] if self.spindle_rpm else []
        if self.scale != ONE:
            words.append(f"--scale {self.scale.value:g}" + (f":{self.scale.std:g}" if self.scale.std else ""))
        return "".join(f" {word}" for word in words)

    def as_dict(self) -> dict[str, Any]:
        """JSON values in SI, files by their name."""
        values = {item.name: getattr(self, item.name) for item in fields(self)}
        return {name: value.name if isinstance(value, Path) else value for name, value in values.items()}


DEFAULTS = Settings()
# Where a ball mill enters the shipped sample the offset changes by 140 um/mm at most, in the sharp corners of the simulated
# milled part by up to 1000; a place that is 0.05 mm off then errs by 50 um.
SLOPE = 1.0


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


class Scaled(click.ParamType[float]):
    """A finite number of at least `low` in the unit of the help text, times `factor` in SI."""

    name = "NUMBER"

    def __init__(self, factor: float, low: float = 0.0) -> None:
        self.factor, self.low = factor, low

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        if not (math.isfinite(number) and number >= self.low):
            self.fail(f"'{value}' is not a number of at least {self.low:g}", param, ctx)
        return float(f"{self.factor * number:.12g}")       # a default said in other units is the default again


class ScaledEstimate(click.ParamType[Estimate]):
    """A positive number, with its standard error behind a colon where it is known: VALUE[:STD]."""

    name = "VALUE[:STD]"

    def __init__(self, factor: float) -> None:
        self.factor = factor

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Estimate:
        if isinstance(value, Estimate):
            return value
        number = Scaled(self.factor)
        size, _, std = str(value).partition(":")
        estimate = Estimate(number.convert(size, param, ctx), number.convert(std or 0, param, ctx))
        if not estimate.value > 0:
            self.fail(f"'{value}' is not positive", param, ctx)
        return estimate


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
    click.option("--tare", type=TargetRange(), multiple=True,
                 help="Targets of an air move: their mean force is the sensor's bias. May be given several times."),
    click.option("--log-format", type=click.Choice(("metallicadour", "lvm", "net-ft")),
                 help="A public form of the force log, as `convert` reads it; CSV and Parquet need none."),
    click.option("--spindle-rpm", type=click.FloatRange(min=0, min_open=True),
                 help="Spindle speed; forces are averaged over its whole revolutions. Else it is looked for in the log."),
    click.option("--scale", type=ScaledEstimate(1.0), default=DEFAULTS.scale, metavar="VALUE[:STD]",
                 help="Factor on the deflection at the joints, as verify finds it from a measured pass."),
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
CORRECTION_OPTIONS: tuple[Decorator, ...] = (
    *SPLITTING_OPTIONS,
    click.option("--confidence", type=click.FloatRange(0.5, 0.999), default=DEFAULTS.confidence, show_default=True,
                 help="Probability with which a correction must make its point better, else it is reduced or left out."),
    click.option("--max-slope", "slope", type=Scaled(1e-3, low=1.0), help="Steepest change of the offset along the path "
                 f"[um/mm]; steeper steps are reduced.  [default: {1e3 * SLOPE:g}, none where the log has target numbers]"),
    click.option("--tolerance", type=Scaled(1e-6, low=0.1), default=1e6 * DEFAULTS.tolerance, show_default=True,
                 help="Along a long MoveL or a MoveC the correction may be off what its place asks for by so much [um]; "
                      "beyond, "
                 "intermediate targets are added."),
    click.option("--long-move", type=Scaled(1e-3, low=1.0), default=1e3 * DEFAULTS.long_move, show_default=True,
                 help="A MoveL of this length [mm] may get intermediate targets."),
    click.option("--keep-targets", is_flag=True, help="Add no intermediate targets."),
    click.option("--tighten-zones", is_flag=True, help="Make zones smaller where they cut corners by more than the tolerance."),
    click.option("--advise", is_flag=True, help="Say which turn about the tool's axis would lower the deviation."),
    click.option("--cutting-stiffness", type=ScaledEstimate(1e3), help="How the force grows with the depth of cut [N/mm]."),
    click.option("--logged-with", type=READABLE, help="The offsets.csv that the program had while FORCES were logged."),
    click.option("--first-forces", type=READABLE, help="With --logged-with: the log of the pass without offsets; both passes "
                 "give the cutting stiffness."),
    click.option("--check-feed", is_flag=True, help="Also report whether the robot can hold the feed, before and after."),
    click.option("--strict-feed", is_flag=True, help="As --check-feed, and refuse (exit 3) a cut that cannot hold its feed."),
)


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

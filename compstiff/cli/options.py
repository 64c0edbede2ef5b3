"""The options of a job's settings: how the log is read, the toolpath posted, the program corrected."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from compensator.correction.settings import CLOSEST, DEFAULTS, SLOPE, Estimate, Settings, Spacing
from compstiff.cli.console import READABLE, WRITABLE, option


class TargetRange(click.ParamType[tuple[int, int]]):
    """Two target numbers, FIRST:LAST."""

    name = "FIRST:LAST"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[int, int]:
        if isinstance(value, tuple):
            return value[0], value[1]
        first, colon, last = str(value).partition(":")
        if not (colon and first.isdecimal() and last.isdecimal() and int(first) <= int(last)):
            self.fail(f"'{value}' is not a range of targets such as 0:3", param, ctx)
        return int(first), int(last)


class Shard(click.ParamType[tuple[int, int]]):
    """K/N as (K, N), 1 <= K <= N."""

    name = "K/N"

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> tuple[int, int]:
        try:
            part, of = map(int, str(value).split("/"))
        except ValueError:
            part, of = 0, 0
        if not 1 <= part <= of:
            self.fail(f"'{value}' is no part K/N, 1 <= K <= N, as in 2/8.", param, ctx)
        return part, of


class Scaled(click.ParamType[float]):
    """A finite number of at least `low` and at most `high` in the unit of the help text, times `factor` in SI."""

    name = "NUMBER"

    def __init__(self, factor: float, low: float = 0.0, high: float = math.inf) -> None:
        self.factor, self.low, self.high = factor, low, high

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        if not (math.isfinite(number) and number >= self.low):
            self.fail(f"'{value}' is not a number of at least {self.low:g}", param, ctx)
        if number > self.high:
            self.fail(f"'{value}' is over {self.high:g}: in which unit is it?", param, ctx)
        return float(f"{self.factor * number:.12g}")       # a default said in other units is the default again


class ScaledEstimate(click.ParamType[Estimate]):
    """A positive number, with its standard error behind a colon where it is known: VALUE[:STD]."""

    name = "VALUE[:STD]"

    def __init__(self, factor: float, least: float = 0.0, most: float = math.inf) -> None:
        self.factor, self.least, self.most = factor, least, most

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Estimate:
        if isinstance(value, Estimate):
            return value
        number = Scaled(self.factor)
        size, _, std = str(value).partition(":")
        estimate = Estimate(number.convert(size, param, ctx), number.convert(std or 0, param, ctx))
        if not estimate.value > 0:
            self.fail(f"'{value}' is not positive", param, ctx)
        for beyond, limit, word in ((estimate.value > self.most, self.most, "over"),
                                    (estimate.value < self.least, self.least, "under")):
            if beyond:
                self.fail(f"'{value}' is {word} {limit:g}: it is a factor, 1.1 for ten per cent more", param, ctx)
        return estimate


class MinSpacing(click.ParamType[Spacing]):
    """A length in millimetres, with a time in milliseconds behind a colon: MM[:MS]."""

    name = "MM[:MS]"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Spacing:
        if isinstance(value, Spacing):
            return value
        length, _, time = str(value).partition(":")
        return Spacing(Scaled(1e-3, low=0.05).convert(length, param, ctx), Scaled(1e-3, low=0.0).convert(time or 0, param, ctx))


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

CELL = click.argument("cell_file", metavar="CELL", type=READABLE)
TOOLPATH = click.argument("toolpath_file", metavar="TOOLPATH", type=READABLE)
STIFFNESS = click.option("--stiffness", "stiffness_file", required=True, type=READABLE, help="What identify wrote.")
FORCES = click.option("--forces", "forces_file", required=True, type=READABLE, help="The force log of this program.")
FORCES_IF_ANY = click.option("--forces", "forces_file", type=READABLE,
                             help="The force log of this program; without one --predict-force and --stock tell the forces.")
REPORT = click.option("--report", type=WRITABLE, help="Also write an HTML report.")

_log = functools.partial(option, "Force log")
_cutting = functools.partial(option, "Forces from the stock")
_posting = functools.partial(option, "Posting (APT, CSV)")
_correction = functools.partial(option, "Correction")
_feed = functools.partial(option, "Feed")
_output = functools.partial(option, "Output")

# How the force log is read and placed: `predict` and `correct`.
READING_OPTIONS: tuple[Decorator, ...] = (
    click.option("--tare", type=TargetRange(), multiple=True,
                 help="Targets of an air move, counted from 0 in the order of the text, not as driven: their mean force is the "
                 "sensor's bias. May be given several times."),
    _log("--trust-tare", is_flag=True, help="Use a tare that the log speaks against, or not for; else it is refused."),
    _log("--log-format", type=click.Choice(("metallicadour", "lvm", "net-ft")),
         help="A public form of the force log, as `convert` reads it; CSV and Parquet need none."),
    _log("--spindle-rpm", type=click.FloatRange(min=0, min_open=True),
         help="Spindle speed; forces are averaged over its whole revolutions. Else it is looked for in the log."),
)
LOG_OPTIONS: tuple[Decorator, ...] = (
    *READING_OPTIONS,
    _correction("--scale", type=ScaledEstimate(1.0, 0.2, 10.0), default=DEFAULTS.correction.scale, metavar="VALUE[:STD]",
                help="Factor on the deflection at the joints, as verify finds it from a measured pass."),
    _correction("--accept-rejected", is_flag=True,
                help="Use a stiffness file, or cutting coefficients, that their own measurements reject; else they are "
                "refused, exit 3."),
)
# What a measured part taught: `predict` and `correct`.
LEARNED_OPTIONS: tuple[Decorator, ...] = (
    _correction("--learned", type=READABLE, help="What learn wrote of a measured part: its springs in motion and its smooth "
                "remainder are used."),
    _correction("--repeats", type=click.Choice(("nothing", "setup", "job")), default=DEFAULTS.correction.repeats,
                show_default=True, help="With --learned: the measured part's set-up comes again, or its whole job with its "
                "warming."),
)
# Forces that are predicted from the stock: `predict` and `correct`.
PREDICT_FORCE: Decorator = _cutting(
    "--predict-force", type=READABLE, help="What cutting wrote of tool and material: the forces are predicted, and no log of "
    "this program is needed; beside a log both are compared.")
FORCE_OPTIONS: tuple[Decorator, ...] = (
    PREDICT_FORCE,
    _cutting("--stock", type=READABLE, help="What the program starts from: stock.yaml, or what an earlier one left (.npz)."),
)
# What a log is held against, for one program: `predict` and `correct`.
OTHER_LOG: tuple[Decorator, ...] = (
    _log("--other-forces", type=READABLE, help="A log of another pass of this program: refused where the two contradict each "
         "other, target by target."),
)
# How an APT or CSV toolpath becomes RAPID: `post`, `predict` and `correct`.
POSTING_OPTIONS: tuple[Decorator, ...] = (
    _posting("--zone-mm", type=click.FloatRange(0, 200), default=DEFAULTS.posting.zone_mm, show_default=True,
             help="Fly-by zone of the moves, 0 for stop points."),
    _posting("--rapid-mm-s", type=click.FloatRange(1, 7000), default=DEFAULTS.posting.rapid_mm_s, show_default=True,
             help="Speed in the air."),
    _posting("--feed-mm-s", type=click.FloatRange(0, 7000, min_open=True), default=DEFAULTS.posting.feed_mm_s,
             show_default=True, help="CSV: feed where the table has none."),
    _posting("--tool-x", type=Direction(), help="APT: direction of the work object that tool x is turned towards."),
    _posting("--tool", metavar="NUMBER", help="APT: of a file with several tools the one to post, by number or name."),
)
# How the program is written: `post`, `correct` and `watch`.
SPLITTING_OPTIONS: tuple[Decorator, ...] = (
    _output("--split", type=click.IntRange(min=1), metavar="N", help="Parts of at most N targets, split in the air."),
    _output("--split-load", is_flag=True, help="Load the parts one after the other, in place of all at once."),
    _output("--mark", metavar="SIGNAL", help="Moves switch this output at their targets, for the log's column mark."),
)
# A job's modules, corrected as one program: `correct` alone.
MODULE_OPTIONS: tuple[Decorator, ...] = (
    _output("--modules", is_flag=True, help="Of a program of several modules (post joins them): a file of each."),
)
# How the program is corrected: `correct` alone.
CORRECTION_OPTIONS: tuple[Decorator, ...] = (
    _correction("--confidence", type=click.FloatRange(0.5, 0.999), default=DEFAULTS.correction.confidence, show_default=True,
                help="Probability with which a correction must make its point better, else it is reduced or left out."),
    _correction("--max-slope", "slope", type=Scaled(1e-3, low=1.0), help="Steepest change of the offset along the path "
                f"[um/mm]; steeper steps are reduced.  [default: {1e3 * SLOPE:g}, none where the log has target numbers]"),
    _correction("--tolerance", type=Scaled(1e-6, low=0.1), default=1e6 * DEFAULTS.correction.tolerance, show_default=True,
                help="Between targets the correction may be off what its place asks for by so much [um]; beyond, intermediate "
                "targets are added."),
    _correction("--min-spacing", type=MinSpacing(), default=DEFAULTS.correction.min_spacing, metavar="MM[:MS]",
                help="How near to each other intermediate targets may stand [mm], and in time at the feed [ms].  "
                f"[default: {1e3 * CLOSEST.length:g}:{1e3 * CLOSEST.time:g}]"),
    _correction("--long-move", type=Scaled(1e-3, low=0.0), default=1e3 * DEFAULTS.correction.long_move, show_default=True,
                help="No MoveL shorter than this [mm] gets intermediate targets."),
    _correction("--keep-targets", is_flag=True, help="Add no intermediate targets."),
    _correction("--tighten-zones", is_flag=True, help="Make zones smaller where they cut corners by more than the tolerance."),
    _correction("--advise", is_flag=True, help="Say which turn about the tool's axis would lower the deviation."),
    _correction("--correct-again", is_flag=True, help="Also correct what a record names as the output of a correction."),
)
# How the force follows the cut: `correct`, and the error budget of `predict`.
CUT_OPTIONS: tuple[Decorator, ...] = (
    _correction("--cutting-stiffness", type=ScaledEstimate(1e3), help="How the force grows with the depth of cut [N/mm]."),
    _correction("--depth-of-cut", type=Scaled(1e-3, low=0.01, high=100), help="Across the feed [mm]; where nothing says more "
                "of the cut it tells how the force grows."),
    _correction("--slot-depth", type=Scaled(1e-3, low=0.01, high=100), help="Of slots, along the tool's axis [mm]: it tells "
                "how the force grows there."),
    _correction("--logged-with", type=READABLE, help="The offsets.csv that the program had while FORCES were logged."),
    _correction("--first-forces", type=READABLE, help="With --logged-with: the log of the pass without offsets; both passes "
                "give the cutting stiffness."),
)
# Can the robot hold the feed: `correct` alone.
FEED_OPTIONS: tuple[Decorator, ...] = (
    _feed("--check-feed", is_flag=True, help="Also report whether the robot can hold the feed, before and after."),
    _feed("--strict-feed", is_flag=True, help="As --check-feed, and refuse (exit 3) a cut that cannot hold its feed."),
)


def check_forces(forces_file: Path | None, settings: Settings) -> None:
    """UsageError where nothing tells the forces, or half of what predicts them is missing."""
    cutting = settings.cutting
    if (cutting.predict_force is None) != (cutting.stock is None):
        raise click.UsageError("--predict-force and --stock go together: coefficients, and what is cut.")
    if forces_file is None and cutting.predict_force is None:
        raise click.UsageError("Missing option '--forces': the log of this program, or --predict-force and --stock.")


def with_settings(*options: Decorator) -> Decorator:
    """Adds the options to a command's body and hands their values over as `settings`, a `Settings`."""

    def decorate(body: Callable[..., Any]) -> Callable[..., Any]:
        @functools.wraps(body)
        def run(*positional: Any, **arguments: Any) -> Any:
            chosen = {name: arguments.pop(name) for name in DEFAULTS.values() if name in arguments}
            return body(*positional, settings=Settings.of(**chosen), **arguments)

        decorated: Callable[..., Any] = run
        for add in reversed(options):
            decorated = add(decorated)
        return decorated

    return decorate

"""What a user may choose for `predict` and `correct`, and the options that choose it."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any

import click


@dataclass(frozen=True)
class Settings:
    """tare: first and last target of air moves, whose mean force is the sensor's bias.

    log_format: a public form of the force log, None for CSV and Parquet. spindle_rpm: the spindle's speed, whole revolutions of
    which are averaged; None: as cell.yaml states it, or found in the log.
    """

    tare: tuple[tuple[int, int], ...] = ()
    log_format: str | None = None
    spindle_rpm: float | None = None


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


Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]

# How the force log is read and placed: `predict` and `correct`.
FORCE_OPTIONS: tuple[Decorator, ...] = (
    click.option("--tare", type=TargetRange(), multiple=True,
                 help="Targets of an air move: their mean force is the sensor's bias. May be given several times."),
    click.option("--log-format", type=click.Choice(("metallicadour", "lvm", "net-ft")),
                 help="A public form of the force log, as `convert` reads it; CSV and Parquet need none."),
    click.option("--spindle-rpm", type=click.FloatRange(min=0, min_open=True),
                 help="Spindle speed; forces are averaged over its whole revolutions. Else it is looked for in the log."),
)
# How the program is corrected: `correct` alone.
CORRECTION_OPTIONS: tuple[Decorator, ...] = ()


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

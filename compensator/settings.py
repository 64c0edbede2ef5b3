"""What a user may choose for `predict` and `correct`, and the options that choose it."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any

import click


@dataclass(frozen=True)
class Settings:
    """tare: first and last target of an air move, whose mean force is the sensor's bias. check_feed: work out whether the robot
    can hold the programmed feed; strict_feed: and refuse a cut that cannot."""

    tare: tuple[int, int] | None = None
    check_feed: bool = False
    strict_feed: bool = False


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
    click.option("--tare", type=TargetRange(), help="Targets of an air move: their mean force is the sensor's bias."),
)
# How the program is corrected: `correct` alone.
CORRECTION_OPTIONS: tuple[Decorator, ...] = (
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

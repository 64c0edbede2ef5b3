"""What each option of a number takes, in the unit of its help, and what it stands for: by a table written by hand."""

from __future__ import annotations

import math
from collections.abc import Iterator

import click
import pytest

from compstiff.cli.main import compstiff

POSITIVE = "(0, inf]"
# Option: interval, default in its unit (None: none), SI unit of it. `command option` where one command has another.
LIMITS = {
    "--port": ("[1, 65535]", None, 1), "cell --port": ("[0, 65535]", None, 1), "--unit": ("[0, 255]", None, 1),
    "--timeout": ("[0.05, 60]", 2.0, 1), "upload --timeout": ("[0.05, 600]", 10.0, 1),
    "--retries": ("[0, 10]", 4, 1), "upload --retries": ("[0, 10]", 3, 1), "--patience": ("[0, 3600]", 12.0, 1),
    "--robot-wait": ("[1, 86400]", 600.0, 1), "--reach": ("[0, 1000]", 10.0, 1),
    "--settle": ("[0, 3600]", 5.0, 1), "--interval": ("[0.05, 3600]", 2.0, 1), "--jobs": ("[1, 64]", 1, 1),
    "--spindle-rpm": (POSITIVE, None, 1), "--rate": (POSITIVE, None, 1),
    "--counts-per-force": (POSITIVE, 1e6, 1), "--counts-per-torque": (POSITIVE, 1e6, 1),
    "--scale": ("[0.2, 10]", None, 1), "--cutting-stiffness": (POSITIVE, None, 1e3),
    "--depth-of-cut": ("[0.01, 100]", None, 1e-3), "--slot-depth": ("[0.01, 100]", None, 1e-3),
    "--confidence": ("[0.5, 0.999]", 0.69, 1), "--max-slope": ("[1, inf]", None, 1e-3),
    "--tolerance": ("[0.1, inf]", 5.0, 1e-6),
    "--long-move": ("[0, inf]", 0.0, 1e-3), "--split": ("[1, inf]", None, 1),
    "--zone-mm": ("[0, 200]", 0.3, 1), "--rapid-mm-s": ("[1, 7000]", 200.0, 1), "--feed-mm-s": ("(0, 7000]", 20.0, 1),
    "--measurements": ("[1, 60]", None, 1), "--max-force": ("[1, 20000]", None, 1), "--phi": ("[5, 180]", 80.0, 1),
    "--replicates": ("[1, 10]", 1, 1), "diagnose --replicates": ("[19, 9999]", 199, 1), "--alarm": ("[0.001, 0.5]", 0.05, 1),
    "--add": ("[1, 60]", None, 1), "--validate": ("[0, 20]", 0, 1), "--seed": ("[0, inf]", 0, 1), "--gamma": (POSITIVE, 1.0, 1),
    "--tool-mass": ("[0, inf]", None, 1), "--deflection-std": (POSITIVE, None, 1), "--cutter-diameter": (POSITIVE, None, 1),
    "--contact": (POSITIVE, None, 1), "--tool-radius-mm": ("[0, 500]", 0.0, 1),
    "--within-mm": ("[0, inf]", 1.0, 1), "learn --within-mm": (POSITIVE, 1.0, 1), "--tolerance-um": (POSITIVE, None, 1),
}
NO_LIMIT = ("--position", "--box", "--min-spacing")         # places and lengths that are judged where they are used
CONTEXT = click.Context(compstiff)


def numbers() -> Iterator[tuple[str, click.Parameter, click.ParamType]]:
    """All options that take a number: `command option`, and the type of its first part."""
    for name in compstiff.list_commands(CONTEXT):
        command = compstiff.get_command(CONTEXT, name)
        assert command is not None
        for option in command.params:
            kind = option.type.types[0] if isinstance(option.type, click.Tuple) else option.type
            if option.opts[-1] not in NO_LIMIT and kind.name.rstrip(" range") and kind.name.split()[0] in (
                    "integer", "float", "NUMBER", "VALUE[:STD]"):
                yield f"{name} {option.opts[-1]}", option, kind


OPTIONS = [pytest.param(*each, id=each[0]) for each in numbers()]


def taken(kind: click.ParamType, value: float) -> float | None:
    """What an option makes of a number as it is typed; None: it is refused."""
    words = f"{value:.12g}"
    try:
        made = kind.convert(words, None, CONTEXT)
    except click.BadParameter:
        return None
    return float(getattr(made, "value", made))


@pytest.mark.parametrize(("name", "option", "kind"), OPTIONS)
def test_an_option_takes_its_numbers_and_no_others(name: str, option: click.Parameter, kind: click.ParamType) -> None:
    interval, default, unit = LIMITS.get(name) or LIMITS[name.split()[1]]
    low, high = (float(limit) for limit in interval[1:-1].split(","))
    step = 1 if kind.name.startswith("integer") else 1e-4
    assert taken(kind, low) == (None if interval[0] == "(" else pytest.approx(unit * low, abs=1e-15))
    assert taken(kind, low + step) == pytest.approx(unit * (low + step))
    assert taken(kind, low - step) is None
    if math.isfinite(high):
        assert (taken(kind, high), taken(kind, high + step)) == (pytest.approx(unit * high), None)
    else:
        assert taken(kind, 1e9) == pytest.approx(unit * 1e9)
    if default is not None:
        assert option.default == default


def test_every_row_of_the_table_is_an_option() -> None:
    names = {param.id for param in OPTIONS}
    assert not [row for row in LIMITS if not any(name == row or name.endswith(f" {row}") for name in names)]

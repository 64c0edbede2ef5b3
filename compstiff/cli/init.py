"""`compstiff init`: the files a new cell begins with."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from compstiff.cli.console import FOLDER, command
from compstiff.outcome import Outcome, Session


class Numbers(click.ParamType[tuple[float, ...]]):
    """So many finite numbers, with commas between them."""

    def __init__(self, count: int, name: str) -> None:
        self.count, self.name = count, name

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[float, ...]:
        import math

        try:
            numbers = value if isinstance(value, tuple) else tuple(float(part) for part in str(value).split(","))
        except ValueError:
            numbers = ()
        if len(numbers) != self.count or not all(map(math.isfinite, numbers)):
            self.fail(f"'{value}' is not {self.count} numbers with commas between them, such as "
                      f"{','.join(['120', '0', '250', '0'][:self.count])}", param, ctx)
        return numbers


class RobotName(click.ParamType[str]):
    """A built-in robot, or the path of a robot file."""

    name = "ROBOT"

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[Any]:
        from click.shell_completion import CompletionItem

        from identification.model.robot import built_in_robots

        return [CompletionItem(name) for name in built_in_robots() if name.startswith(incomplete)]


class Weights(click.ParamType[str]):
    """Masses as `design --dead-weight` takes them."""

    name = "KG,KG"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        from identification.design.dead_weights import DeadWeights

        if value:
            try:
                DeadWeights.of(str(value))
            except ValueError as reason:
                self.fail(f"takes masses in kg such as 20,40, not '{value}': {reason}", param, ctx)
        return str(value)


class MaterialName(click.ParamType[str]):
    """A material of cell.yaml."""

    name = "MATERIAL"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        from typing import get_args

        from identification.model.cell_file import Material

        known, word = get_args(Material), str(value).strip().lower().replace(" ", "_")
        if word not in known:
            self.fail(f"'{value}' is none of {', '.join(known)}", param, ctx)
        return word


PLACE, TURN = Numbers(3, "X,Y,Z"), Numbers(4, "W,X,Y,Z")
# What is asked on a terminal where no option says it: option, question, its type, what Enter stands for (None: nothing; "": it
# may be left open).
QUESTIONS: tuple[tuple[str, str, Any, Any], ...] = (
    ("robot", "Robot (? lists the built-in ones; or the path of a robot file)", RobotName(), None),
    ("serial_number", "Its serial number (Enter: not known; it tells its stiffnesses from those of another robot of the type)",
     click.STRING, ""),
    ("tool_tcp", "TCP in the flange frame in mm, as in tooldata: x,y,z", PLACE, None),
    ("tool_quaternion", "Turn of the tool in the flange frame: w,x,y,z", TURN, "1,0,0,0"),
    ("tool_mass", "Mass of tool and spindle in kg (Enter: not known)", click.FloatRange(0), ""),
    ("tool_centre", "Their centre of mass in the flange frame in mm, tload.cog: x,y,z (Enter: not known)", PLACE, ""),
    ("deflection_std", "1 sigma of one deflection reading in um", click.FloatRange(0, min_open=True), "2"),
    ("weights", "Load tests by hung weights, such as 20,40 kg (Enter: by cylinder or jack)", Weights(), ""),
    ("force_frame", "Frame of the logged milling forces", click.Choice(["base", "tool", "sensor"]), "base"),
    ("force_sign", "Do the logged forces act on the tool, or by the tool on the part", click.Choice(["on_tool", "by_tool"]),
     "on_tool"),
    ("spindle_rpm", "Spindle speed in rpm (Enter: it is looked for in the log)", click.FloatRange(0, min_open=True), ""),
    ("material", "Material that is milled, such as aluminium or steel (Enter: it varies; what a correction leaves on the "
     "part is then told less sharply)", MaterialName(), ""),
    ("cutter_diameter", "Diameter of the cutter in mm (Enter: it varies)", click.FloatRange(0, min_open=True), ""),
    ("contact", "How long the edge is in the cut, along the tool's axis, in mm (Enter: it varies)",
     click.FloatRange(0, min_open=True), ""),
)
# Questions that say nothing where another one was left open.
AFTER = {"tool_centre": "tool_mass", "cutter_diameter": "material", "contact": "material"}
SENSOR = (
    ("sensor_position", "Origin of the sensor in the flange frame in mm: x,y,z", PLACE, None),
    ("sensor_quaternion", "Turn of the sensor in the flange frame: w,x,y,z", TURN, "1,0,0,0"),
)


@command("init", writes=True, examples=(
    "compstiff init my-cell",
    "compstiff init my-cell --robot irb6700-200-2.60 --tool-tcp 120,0,250 --weights 20,40",
))
@click.argument("folder", metavar="CELL-FOLDER", type=FOLDER)
@click.option("--robot", type=RobotName(), help="A built-in robot (`compstiff robots`), or a robot file, which is copied.")
@click.option("--serial-number", help="Of the robot: others of its type then do not take its stiffnesses.")
@click.option("--tool-tcp", type=PLACE, help="The TCP in the flange frame [mm], as in tooldata.")
@click.option("--tool-quaternion", type=TURN, help="Its turn.  [default: 1,0,0,0]")
@click.option("--tool-mass", type=click.FloatRange(0), metavar="KG", help="Of tool and spindle.")
@click.option("--tool-centre", type=PLACE, help="Their centre of mass in the flange frame [mm].")
@click.option("--deflection-std", type=click.FloatRange(0, min_open=True), metavar="UM",
              help="1 sigma of one deflection reading.  [default: 2]")
@click.option("--weights", type=Weights(), help="Load tests by hung weights, as design --dead-weight takes them.")
@click.option("--force-frame", type=click.Choice(["base", "tool", "sensor"]), help="Frame of logged forces.  [default: base]")
@click.option("--sensor-position", type=PLACE, help="With --force-frame sensor: its origin in the flange frame [mm].")
@click.option("--sensor-quaternion", type=TURN, help="And its turn.  [default: 1,0,0,0]")
@click.option("--force-sign", type=click.Choice(["on_tool", "by_tool"]), help="Of logged forces.  [default: on_tool]")
@click.option("--spindle-rpm", type=click.FloatRange(0, min_open=True), metavar="RPM", help="Spindle speed.")
@click.option("--material", type=MaterialName(), help="That is milled: how the force follows the cut.")
@click.option("--cutter-diameter", type=click.FloatRange(0, min_open=True), metavar="MM", help="With --material.")
@click.option("--contact", type=click.FloatRange(0, min_open=True), metavar="MM",
              help="With --material: how long the edge is in the cut, along the tool's axis.")
def init(session: Session, folder: Path, **given: Any) -> Outcome:
    """Begin a new cell: cell.yaml, a measurement sheet, and the chain for make and PowerShell.

    What no option says is asked on a terminal; elsewhere --robot and --tool-tcp are required and the rest is left open. Files
    that exist are not overwritten.
    """
    if sys.stdin.isatty() and not session.as_json:
        given = _asked(given)
    missing = [f"'--{name.replace('_', '-')}'" for name in ("robot", "tool_tcp") if given[name] is None]
    if missing:
        raise click.UsageError(f"Missing option {' and '.join(missing)}: there is no terminal to ask on.")
    if given["force_frame"] == "sensor":
        if given["sensor_position"] is None:
            raise click.UsageError("--force-frame sensor needs --sensor-position.")
        given["sensor_quaternion"] = given["sensor_quaternion"] or (1.0, 0.0, 0.0, 0.0)
    elif given["sensor_position"] or given["sensor_quaternion"]:
        raise click.UsageError("--sensor-position and --sensor-quaternion belong to --force-frame sensor.")
    if given["material"] is None and (given["cutter_diameter"] or given["contact"]):
        raise click.UsageError("--cutter-diameter and --contact belong to --material.")
    from compstiff import CellAnswers, new_cell

    made = new_cell(folder, CellAnswers(**{name: value for name, value in given.items() if value is not None}),
                    overwrite=session.overwrite)
    return Outcome(made.as_dict(), made.findings, made.lines())


def _asked(given: dict[str, Any]) -> dict[str, Any]:
    """The options, those that were left out asked for; prompts go to stderr, since stdout is for the result."""
    answers = dict(given)

    def ask(questions: Sequence[tuple[str, str, Any, Any]]) -> None:
        for name, question, kind, default in questions:
            if answers[name] is None and not (name in AFTER and answers[AFTER[name]] is None):
                answers[name] = _answer(question, kind, default)

    ask(QUESTIONS)
    if answers["force_frame"] == "sensor":
        ask(SENSOR)
    return answers


def _answer(question: str, kind: click.ParamType[Any], default: Any) -> Any:
    """One answer; "" where it may be left open and was."""
    def read(text: str) -> Any:
        if default == "" and not text.strip():
            return None
        if isinstance(kind, RobotName):
            return _robot(text.strip())
        return kind.convert(text.strip(), None, None)

    return click.prompt(question, default=default, value_proc=read, show_default=bool(default), err=True)


def _robot(text: str) -> str:
    from identification.model.robot import built_in_robots

    names = built_in_robots()
    if text not in names and not Path(text).is_file():
        if text != "?":
            import difflib

            near = difflib.get_close_matches(text.lower(), names, n=3, cutoff=0.3)
            click.echo(f"'{text}' is neither a built-in robot nor a file." + (
                f" Near it: {', '.join(near)}." if near else ""), err=True)
        raise click.UsageError("built-in: " + ", ".join(names))     # click shows it and asks again
    return text

"""`compstiff`: all commands together. A command's file is imported when it is called: `--help` shows this table alone."""

from __future__ import annotations

import difflib
from importlib import import_module

import click

from compstiff.cli import console
from compstiff.cli.console import CONTEXT

# Each command, in the file of its name, and the first sentence of its help, which a test holds against the command's own.
COMMANDS = {
    "cell": "Serve the register map: the embedded Modbus cell, until Ctrl-C or SIGTERM.",
    "check": "Check the files of a cell, and say all that is wrong with them, without computing.",
    "convert": "Turn a public or a sensor's own log into columns that the other commands read.",
    "correct": "Correct a milling program for the deflection under its logged forces.",
    "cutting": "Learn what force a tool needs in a material, from the log of any program that cut with it.",
    "demo": "Run identify and correct on the shipped samples, into DIR.",
    "design": "Plan the poses and loads that tell most, and certify how good the plan is.",
    "diagnose": "Show what the model gets wrong, name the cause, measure the gain.",
    "explain": "Explain a finding or a cause: what is behind it, what to do; without CODE, list both.",
    "identify": "Learn the joint stiffnesses from measured loads and deflections.",
    "init": "Begin a new cell: cell.yaml, a measurement sheet, and the chain for make and PowerShell.",
    "learn": "Learn from a measured part what the next program should know.",
    "post": "Post an APT or CSV toolpath as the planned RAPID program.",
    "predict": "Predict how far the tool is pushed off its path.",
    "push": "Send offsets to the cell over Modbus; a dry run unless --apply.",
    "robots": "List the built-in robots, or check a robot file.",
    "tare": "Find what hangs on the force sensor, and its bias, from still readings.",
    "upload": "Put a RAPID module onto the controller over Robot Web Services; a dry run unless --apply.",
    "verify": "Compare the deviation measured before and after a correction.",
    "watch": "Correct every finished program that appears in a folder, once.",
}
# As the help lists them: in the order in which a cell comes to need them.
GROUPS = {
    "Before and at commissioning": ("init", "check", "design", "identify", "diagnose"),
    "Each toolpath": ("post", "cutting", "tare", "predict", "correct", "watch"),
    "To the machine": ("upload", "push", "cell"),
    "On the part": ("verify", "learn"),
    "Around": ("demo", "explain", "robots", "convert"),
}


class Commands(click.Group):
    """A group whose commands are imported when they are needed."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return sorted(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        found: click.Command = getattr(import_module(f"compstiff.cli.{cmd_name}"), cmd_name)
        return found

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        near = difflib.get_close_matches(args[0], COMMANDS, n=2)
        if near and args[0] not in COMMANDS:
            ctx.fail(f"No such command '{args[0]}'. Did you mean {' or '.join(near)}?")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        room = max(map(len, COMMANDS))
        for group, names in GROUPS.items():
            with formatter.section(group):
                formatter.write_dl([(name.ljust(room), COMMANDS[name]) for name in names])


@click.group(cls=Commands, context_settings=CONTEXT)
@click.version_option(package_name="compstiff", prog_name="compstiff")
def compstiff() -> None:
    """Make an industrial robot mill accurately.

    identify learns the joint stiffnesses from load tests; correct rewrites a milling program so that the loaded tool goes
    where the CAM system meant it to go. For a first look: compstiff demo. For your own cell: compstiff init FOLDER.
    """


def main() -> None:
    """Entry point."""
    console.main(compstiff)

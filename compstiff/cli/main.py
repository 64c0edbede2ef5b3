"""`compstiff`: all commands together."""

from __future__ import annotations

import click

from compstiff.cli import console
from compstiff.cli.cell import cell
from compstiff.cli.console import CONTEXT
from compstiff.cli.convert import convert
from compstiff.cli.correct import correct
from compstiff.cli.demo import demo
from compstiff.cli.design import design
from compstiff.cli.diagnose import diagnose
from compstiff.cli.explain import explain
from compstiff.cli.identify import identify
from compstiff.cli.post import post
from compstiff.cli.predict import predict
from compstiff.cli.push import push
from compstiff.cli.robots import robots
from compstiff.cli.tare import tare
from compstiff.cli.verify import verify
from compstiff.cli.watch import watch

COMMANDS = (robots, design, identify, diagnose, convert, post, tare, predict, correct, watch, verify, push, cell, demo, explain)


@click.group(context_settings=CONTEXT)
@click.version_option(package_name="compstiff", prog_name="compstiff")
def compstiff() -> None:
    """Make an industrial robot mill accurately.

    identify learns the joint stiffnesses from load tests; correct rewrites a milling program so that the loaded tool goes
    where the CAM system meant it to go.
    """


for _command in COMMANDS:
    compstiff.add_command(_command)


def main() -> None:
    """Entry point."""
    console.main(compstiff)

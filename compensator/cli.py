"""`compstiff`: puts both packages' commands together."""

from __future__ import annotations

import click

from compensator import commands as compensating
from compensator import verify_commands as verifying
from compensator.cell import commands as connecting
from identification import commands as identifying
from identification import console


@click.group(context_settings=console.CONTEXT)
@click.version_option(package_name="compstiff", prog_name="compstiff")
def compstiff() -> None:
    """Make an industrial robot mill accurately.

    identify learns the joint stiffnesses from load tests; correct rewrites a milling program so that the loaded tool goes
    where the CAM system meant it to go.
    """


for _command in (*identifying.COMMANDS, *compensating.COMMANDS, *verifying.COMMANDS, *connecting.COMMANDS):
    compstiff.add_command(_command)


def main() -> None:
    """Entry point."""
    console.main(compstiff)

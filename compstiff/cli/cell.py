"""The command `cell`: the embedded Modbus cell."""

from __future__ import annotations

import signal
from pathlib import Path
from typing import TYPE_CHECKING

import click

from compstiff.cli.console import FOLDER, READABLE, command
from compstiff.cli.signals import noted
from compstiff.cli.tls import with_tls
from compstiff.outcome import DONE, INTERRUPTED, Outcome, Session

if TYPE_CHECKING:
    from compensator.modbus.embedded import Served
    from compensator.modbus.tls import TlsFiles


@command("cell")
@click.argument("cell_file", metavar="CELL", type=READABLE)
@click.option("--host", default="127.0.0.1", show_default=True, help="Address to listen on.")
@click.option("--port", type=click.IntRange(0, 65535), help="Instead of modbus.port; 0: any free one.")
@click.option("--unit", type=click.IntRange(0, 255), help="Instead of modbus.unit.")
@click.option("--state", type=FOLDER, help="Directory that keeps the active table.")
@with_tls
def cell(
    session: Session, cell_file: Path, host: str, port: int | None, unit: int | None, state: Path | None, tls: TlsFiles | None
) -> Outcome:
    """Serve the register map: the embedded Modbus cell, until Ctrl-C or SIGTERM.

    CELL is cell.yaml. It listens on this computer alone unless --host says otherwise. With --state the active table survives
    a restart, and DIR/active.csv shows it.
    """
    import asyncio

    from compensator.modbus.embedded import serve_cell
    from compensator.modbus.server import Endpoint
    from compstiff import read_cell

    session.inputs.append(cell_file)
    described = read_cell(cell_file, geometry=False)
    endpoint = Endpoint(host, port if port is not None else described.modbus.port,
                        described.modbus.unit if unit is None else unit, tls)
    received: list[int] = []

    async def run() -> Served:
        stop, loop = asyncio.Event(), asyncio.get_running_loop()

        def on_signal(number: int) -> None:
            received.append(number)
            stop.set()

        # Not the loop's own handlers, which Windows does not have.
        with noted(lambda number: loop.call_soon_threadsafe(on_signal, number)):
            return await serve_cell(described, endpoint, state, stop, warn=lambda finding: session.say(str(finding)),
                                    ready=lambda text: None if session.quiet else click.echo(text, err=True))

    served = asyncio.run(run())
    return Outcome(served.as_dict(), served.findings if session.as_json else (), served.lines(),
                   exit_code=INTERRUPTED if received[-1] == signal.SIGINT else DONE)

"""The command `push`: offsets to the cell over Modbus."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

import click

from compstiff.cli.console import READABLE, WRITABLE, command
from compstiff.cli.tls import with_tls
from compstiff.outcome import Outcome, Session, call

if TYPE_CHECKING:
    from compensator.modbus.tls import TlsFiles
    from compensator.modbus.transfer import Progress


@command("push", writes=True)
@click.argument("cell_file", metavar="CELL", type=READABLE)
@click.argument("offsets_file", metavar="OFFSETS", type=READABLE)
@click.option("--apply", "applies", is_flag=True, help="Really send them; without it nothing changes.")
@click.option("--program", type=READABLE, help="The planned RAPID program that the robot runs: the offsets must be its own.")
@click.option("--any-program", is_flag=True, help="Send them without knowing which program runs.")
@click.option("--host", help="Instead of modbus.host.")
@click.option("--port", type=click.IntRange(1, 65535), help="Instead of modbus.port.")
@click.option("--unit", type=click.IntRange(0, 255), help="Instead of modbus.unit.")
@click.option("--timeout", type=click.FloatRange(0.05, 60), default=2.0, show_default=True, help="For every reply [s].")
@click.option("--retries", type=click.IntRange(0, 10), default=4, show_default=True, help="Repetitions of every request.")
@click.option("--patience", type=click.FloatRange(0, 3600), default=12.0, show_default=True,
              help="How long to wait while another writes or the robot runs [s].")
@click.option("--robot-wait", type=click.FloatRange(1, 86400), default=600.0, show_default=True,
              help="With several windows: how long the robot may give no sign [s].")
@click.option("--restart", is_flag=True, help="With several windows: begin with the first, whichever is active.")
@click.option("--reach", type=click.FloatRange(0, 1000), default=10.0, show_default=True,
              help="Distance of the cutting edge from the TCP [mm], for the error of the orientation not sent.")
@click.option("--receiver", type=WRITABLE, help="Also write the RAPID module that receives these offsets in the robot.")
@click.option("--corrwrite", is_flag=True, help="In that module: path correction too (option Path Offset).")
@click.option("--log", type=WRITABLE, help="Log of the pushes.  [default: push-log.jsonl beside CELL]")
@with_tls
def push(
    session: Session, cell_file: Path, offsets_file: Path, applies: bool, program: Path | None, any_program: bool,
    host: str | None, port: int | None, unit: int | None, timeout: float, retries: int, patience: float, robot_wait: float,
    restart: bool, reach: float, receiver: Path | None, corrwrite: bool, log: Path | None, tls: TlsFiles | None,
) -> Outcome:
    """Send offsets to the cell over Modbus; a dry run unless --apply.

    CELL is cell.yaml, OFFSETS what correct --offsets writes. With --program they are held against the program that the robot
    runs, which --apply asks for. The table becomes active whole or not at all, and is read back.
    Only positions are sent. It does not belong together with a program that correct wrote: that one has the offsets already.
    """
    if corrwrite and not receiver:
        raise click.UsageError("--corrwrite belongs to --receiver")
    if applies and not program and not any_program:
        raise click.UsageError("--apply needs --program: the planned program that the robot runs, so that it does not get the "
                               "offsets of another one (--any-program sends them unseen)")
    from compensator.modbus.push import LOG, Waiting
    from compensator.modbus.receiver import Receiver
    from compstiff import Address, push, read_cell, read_offsets
    from compstiff.offsets_of_program import check_offsets_of

    session.inputs += [cell_file, offsets_file, *((program,) if program else ())]
    cell = read_cell(cell_file, geometry=program is not None)
    offsets = read_offsets(offsets_file, reach)
    told = check_offsets_of(offsets, program, cell)
    address = Address(host or cell.modbus.host, port or cell.modbus.port, cell.modbus.unit if unit is None else unit,
                      timeout, retries, tls.context("client") if tls else None)
    result = push(
        cell, offsets, address, apply=applies, waiting=Waiting(patience, robot_wait, restart),
        receiver=Receiver(receiver, corrwrite, session.overwrite) if receiver else None,
        log=log or cell_file.parent / LOG, progress=_progress(session), say=session.say)
    words = sys.argv[1:] if session.command in sys.argv else ["push", str(cell_file), str(offsets_file)]
    of_program = () if program or any_program else ("--program", "PROGRAM.mod")
    return Outcome(result.as_dict() | {"program": str(program) if program else None}, (*result.findings, *told), result.lines(),
                   "" if applies else call(*words, *of_program, "--apply"))


def _progress(session: Session) -> Progress:
    """Pages on stderr once it has taken a second, on a terminal only."""
    begun = time.monotonic()
    shown = sys.stderr.isatty() and not session.quiet and not session.as_json

    def progress(page: int, pages: int) -> None:
        if shown and time.monotonic() - begun > 1 and (page % 10 == 0 or page == pages):
            click.echo(f"\rpage {page} of {pages}{chr(10) if page == pages else ''}", err=True, nl=False)

    return progress

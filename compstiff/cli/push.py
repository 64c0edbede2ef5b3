"""The commands `push` and `cell`."""

from __future__ import annotations

import functools
import shlex
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from compstiff.cli.console import READABLE, WRITABLE, command
from compstiff.outcome import DONE, INTERRUPTED, Outcome, Session

if TYPE_CHECKING:
    from compensator.modbus.machine import CellMachine
    from compensator.modbus.push import Progress
    from compensator.modbus.tls import TlsFiles
    from identification.model.cell import Cell

LOOPBACK = ("127.0.0.1", "localhost", "::1")
TLS_OPTIONS = ("tls_ca", "tls_cert", "tls_key")


def _with_tls(body: Callable[..., Any]) -> Callable[..., Any]:
    """The three options of Modbus/TCP Security, handed over as `tls`."""

    @functools.wraps(body)
    def run(*positional: Any, **arguments: Any) -> Any:
        given = [arguments.pop(name) for name in TLS_OPTIONS]
        if any(given) and not all(given):
            raise click.UsageError("--tls-ca, --tls-cert and --tls-key belong together")
        return body(*positional, tls=_tls_files(given) if all(given) else None, **arguments)

    decorated: Callable[..., Any] = run
    for name, text in (("--tls-key", "PEM file: the key of that certificate."),
                       ("--tls-cert", "PEM file: this side's certificate."),
                       ("--tls-ca", "PEM file: the authority both sides trust. All three: TLS, certificates on both sides.")):
        decorated = click.option(name, type=READABLE, help=text)(decorated)
    return decorated


def _tls_files(given: list[Path]) -> TlsFiles:
    from compensator.modbus.tls import TlsFiles

    return TlsFiles(*given)


@command("push", writes=True)
@click.argument("cell_file", metavar="CELL", type=READABLE)
@click.argument("offsets_file", metavar="OFFSETS", type=READABLE)
@click.option("--apply", "applies", is_flag=True, help="Really send them; without it nothing changes.")
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
@_with_tls
def push(
    session: Session, cell_file: Path, offsets_file: Path, applies: bool, host: str | None, port: int | None, unit: int | None,
    timeout: float, retries: int, patience: float, robot_wait: float, restart: bool, reach: float, receiver: Path | None,
    corrwrite: bool, log: Path | None, tls: TlsFiles | None,
) -> Outcome:
    """Send offsets to the cell over Modbus; a dry run unless --apply.

    CELL is cell.yaml, OFFSETS what correct --offsets writes. The table becomes active whole or not at all, and is read back.
    Only positions are sent. It does not belong together with a program that correct wrote: that one has the offsets already.
    """
    if corrwrite and not receiver:
        raise click.UsageError("--corrwrite belongs to --receiver")
    from compensator.modbus.audit import NAME
    from compensator.modbus.job import Waiting, after_interrupt, apply_push, lines, plan_push, summary
    from compensator.modbus.link import Address
    from compensator.modbus.offset_file import check_offsets, read_offsets
    from identification.common.files import check_writable, write_whole
    from identification.model.cell import read_cell

    session.inputs += [cell_file, offsets_file]
    cell = read_cell(cell_file, geometry=False)
    offsets = read_offsets(offsets_file, reach)
    check_offsets(offsets, cell.max_offset)
    address = Address(host or cell.modbus.host, port or cell.modbus.port, cell.modbus.unit if unit is None else unit,
                      timeout, retries, tls.context("client") if tls else None)
    plan = plan_push(cell, offsets, address, needed=applies)
    text, findings = lines(plan, address, cell.max_offset), (*offsets.findings, *plan.findings)
    if receiver:
        content = _receiver(plan.tables, cell, receiver, offsets_file, corrwrite)
        # The dry run has written it already: the same call with --apply must not stumble over it.
        if not (receiver.is_file() and receiver.read_bytes() == content):
            check_writable([receiver], overwrite=session.overwrite)
            write_whole({receiver: content})
    done: list[str] = []
    if applies:
        try:
            done = apply_push(plan, address, Waiting(patience, robot_wait, restart), log or cell_file.parent / NAME,
                              _progress(session), session.say)
        except KeyboardInterrupt:
            return Outcome(findings=(after_interrupt(plan, address),), exit_code=INTERRUPTED)
    name = plan.tables[-1].header.name
    text.append(f"new table active (read back): {name}, {done[-1]}" if done else "dry run: nothing was sent")
    call = shlex.join(sys.argv[1:]) if session.command in sys.argv else f"push {cell_file} {offsets_file}"
    return Outcome(summary(plan, address, cell.max_offset, done), findings, text,
                   "" if done else f"compstiff {call} --apply")


def _receiver(tables: Any, cell: Cell, file: Path, source: Path, corrwrite: bool) -> bytes:
    from compensator.modbus.receiver import receiver_text
    from identification.common.shipped import shipped

    return receiver_text(tables, cell.max_offset, shipped("rapid_templates"), file.stem, source.name,
                         corrwrite=corrwrite).encode("ascii")


def _progress(session: Session) -> Progress:
    """Pages on stderr once it has taken a second, on a terminal only."""
    import time

    begun = time.monotonic()
    shown = sys.stderr.isatty() and not session.quiet and not session.as_json

    def progress(page: int, pages: int) -> None:
        if shown and time.monotonic() - begun > 1 and (page % 10 == 0 or page == pages):
            click.echo(f"\rpage {page} of {pages}{chr(10) if page == pages else ''}", err=True, nl=False)

    return progress


@command("cell")
@click.argument("cell_file", metavar="CELL", type=READABLE)
@click.option("--host", default="127.0.0.1", show_default=True, help="Address to listen on.")
@click.option("--port", type=click.IntRange(0, 65535), help="Instead of modbus.port; 0: any free one.")
@click.option("--unit", type=click.IntRange(0, 255), help="Instead of modbus.unit.")
@click.option("--state", type=click.Path(file_okay=False, path_type=Path), help="Directory that keeps the active table.")
@_with_tls
def cell(
    session: Session, cell_file: Path, host: str, port: int | None, unit: int | None, state: Path | None, tls: TlsFiles | None
) -> Outcome:
    """Serve the register map: the embedded Modbus cell, until Ctrl-C or SIGTERM.

    CELL is cell.yaml. It listens on this computer alone unless --host says otherwise. With --state the active table survives
    a restart, and DIR/active.csv shows it.
    """
    import contextlib

    from compensator.modbus.job import limit_um
    from compensator.modbus.machine import CellMachine
    from compensator.modbus.state import TableFiles, TableStore, locked
    from identification.common.findings import Finding
    from identification.model.cell import read_cell

    session.inputs.append(cell_file)
    described = read_cell(cell_file, geometry=False)
    findings = []
    if host not in LOOPBACK and not tls:
        findings.append(Finding("CS5104", "warning", f"listening on {host}: Modbus has no login, whoever reaches this port can "
                                "change offsets", hint="a network of its own, or --tls-ca, --tls-cert and --tls-key"))
    if state is None:
        findings.append(Finding("CS5106", "note", "without --state the active table is lost when the cell stops"))
    with locked(state) if state else contextlib.nullcontext():
        machine = CellMachine(TableFiles(state) if state else TableStore(), limit_um(described), described.robot.name)
        for finding in findings:
            session.say(str(finding))
        listening = port if port is not None else described.modbus.port
        interrupted = _serve(session, machine, host, listening, described.modbus.unit if unit is None else unit, tls)
    active = machine.active
    shown = f"{active.header.name}, {active.header.rows} rows" if active else "none"
    return Outcome({"active": active.header.as_dict() if active else None, "commits": machine.commits},
                   tuple(findings) if session.as_json else (),
                   [f"stopped; commits: {machine.commits}, active table: {shown}"],
                   exit_code=INTERRUPTED if interrupted else DONE)


def _serve(session: Session, machine: CellMachine, host: str, port: int, unit: int, tls: TlsFiles | None) -> bool:
    """Serves until a signal; returns whether it was Ctrl-C."""
    import asyncio
    import signal

    from compensator.modbus.server import serve

    context = tls.context("server") if tls else None
    interrupted = False

    async def run() -> None:
        nonlocal interrupted
        stop, loop = asyncio.Event(), asyncio.get_running_loop()

        def on_signal(ctrl_c: bool) -> None:
            nonlocal interrupted
            interrupted = ctrl_c
            stop.set()

        loop.add_signal_handler(signal.SIGINT, on_signal, True)
        loop.add_signal_handler(signal.SIGTERM, on_signal, False)
        await serve(machine, host, port, unit, context, stop, lambda at: _listening(session, host, at, unit, machine))

    asyncio.run(run())
    return interrupted


def _listening(session: Session, host: str, port: int, unit: int, machine: CellMachine) -> None:
    active = f"{machine.active.header.name}, {machine.active.header.rows} rows" if machine.active else "none"
    if not session.quiet:
        click.echo(f"listening on {host}:{port} unit {unit}, limit {1e-3 * machine.limit_um:g} mm, active table: {active}",
                   err=True)


COMMANDS = (push, cell)

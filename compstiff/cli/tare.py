"""`compstiff tare`: payload and bias of a force sensor from still readings."""

from __future__ import annotations

from pathlib import Path

import click

from compstiff.cli.console import READABLE, WRITABLE, command
from compstiff.outcome import REFUSED, Outcome, Session


@command("tare", writes=True)
@click.argument("cell_file", metavar="CELL", type=READABLE)
@click.argument("still_file", metavar="STILL", type=READABLE)
@click.option("-o", "--output", type=WRITABLE, help="Write the lines for cell.yaml here.")
def tare(session: Session, cell_file: Path, still_file: Path, output: Path | None) -> Outcome:
    """Find what hangs on the force sensor, and its bias, from still readings.

    STILL is a force log without contact, q1_deg ... q6_deg beside the forces, in orientations that differ: spindle down, and
    tilted to several sides. What comes out goes to force_log in cell.yaml.
    """
    from compstiff import read_cell, read_force_log, still_payload
    from identification.common.files import check_writable, write_whole

    session.inputs += [cell_file, still_file]
    check_writable([output] if output else [], overwrite=session.overwrite)
    cell = read_cell(cell_file)
    stills = still_payload(read_force_log(still_file, cell.force_log.form), cell)
    if not stills.of_a_weight:
        return Outcome(stills.as_dict(), stills.findings, stills.lines(), exit_code=REFUSED)
    keys = stills.yaml(still_file)
    if output:
        write_whole({output: keys.encode()}, overwrite=session.overwrite, read=session.read)
    return Outcome(stills.as_dict(), stills.findings, [*stills.lines(), "", *([] if output else keys.splitlines())],
                   next_step=f"copy the keys to force_log in {cell_file}")

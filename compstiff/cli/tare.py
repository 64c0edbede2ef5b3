"""`compstiff tare`: payload and bias of a force sensor from still readings."""

from __future__ import annotations

from pathlib import Path

import click

from compstiff.cli.console import READABLE, WRITABLE, command
from compstiff.outcome import Outcome, Session


@command("tare", writes=True)
@click.argument("cell_file", metavar="CELL", type=READABLE)
@click.argument("still_file", metavar="STILL", type=READABLE)
@click.option("-o", "--output", type=WRITABLE, help="Write the lines for cell.yaml here.")
def tare(session: Session, cell_file: Path, still_file: Path, output: Path | None) -> Outcome:
    """Find what hangs on the force sensor, and its bias, from still readings.

    STILL is a force log without contact, q1_deg ... q6_deg beside the forces, in orientations that differ: spindle down, and
    tilted to several sides. What comes out goes to force_log in cell.yaml.
    """
    from compensator.forces.log import read_force_log
    from compensator.forces.tare import as_yaml, still_payload, summary
    from identification.common.files import check_writable, write_whole
    from identification.model.cell import read_cell

    session.inputs += [cell_file, still_file]
    check_writable([output] if output else [], overwrite=session.overwrite)
    cell = read_cell(cell_file)
    stills = still_payload(read_force_log(still_file, cell.force_log.form), cell)
    text = as_yaml(stills, str(still_file))
    if output:
        write_whole({output: text.encode()})
    found = stills.payload
    lines = [f"{stills.orientations} still orientations",
             f"mass    {found.mass:9.3f} +- {found.mass_std:.3f} kg"]
    if stills.centre is not None and stills.centre_std is not None:
        lines += [f"centre {axis} {1e3 * x:8.2f} +- {1e3 * s:.2f} mm (flange frame)"
                  for axis, x, s in zip("xyz", stills.centre, stills.centre_std, strict=True)]
    named = (("f", "N"), ("m", "N m"))[: 2 if stills.centre is not None else 1]
    lines += [f"bias {kind}{axis} {stills.bias[3 * i + k]:8.3f} +- {stills.bias_std[3 * i + k]:.3f} {unit}"
              for i, (kind, unit) in enumerate(named) for k, axis in enumerate("xyz")]
    return Outcome(summary(stills), stills.findings, [*lines, "", *([] if output else text.splitlines())],
                   next_step=f"copy the keys to force_log in {cell_file}")

"""`compstiff cutting`: the force coefficients of a tool in a material, from another program's log."""

from __future__ import annotations

from pathlib import Path

import click

from compensator.correction.settings import Settings
from compstiff.cli.console import READABLE, WRITABLE, command
from compstiff.cli.options import CELL, LOG_OPTIONS, POSTING_OPTIONS, TOOLPATH, with_settings
from compstiff.outcome import Outcome, Session


@command("cutting", writes=True, examples=(
    "compstiff cutting cell.yaml other.mod --stock other.stock.yaml --stiffness stiffness.json \\",
    "    --forces other.forces.csv --tare 0:2 -o cutting.json",
    "compstiff correct cell.yaml part.mod --stiffness stiffness.json --predict-force cutting.json \\",
    "    --stock part.stock.yaml -o part_corrected.mod",
))
@CELL
@TOOLPATH
@click.option("--stock", "stock_file", type=READABLE,
              help="What the program started from: stock.yaml, or what an earlier one left (.npz).")
@click.option("--stiffness", "stiffness_file", type=READABLE,
              help="What identify wrote: how far the tool yielded while it cut.")
@click.option("--forces", "forces_file", type=READABLE,
              help="The force log of this program; without one the table of materials tells the coefficients.")
@click.option("-o", "--output", required=True, type=WRITABLE, help="The coefficients (JSON) to write.")
@click.option("--leaves", type=WRITABLE, help="Also write the stock that the program leaves (.npz), for the next one.")
@click.option("--logged-with", type=READABLE, help="The offsets.csv that the program had in this pass.")
@with_settings(*LOG_OPTIONS, *POSTING_OPTIONS)
def cutting(
    session: Session, cell_file: Path, toolpath_file: Path, stock_file: Path | None, stiffness_file: Path | None,
    forces_file: Path | None, output: Path, leaves: Path | None, settings: Settings,
) -> Outcome:
    """Learn what force a tool needs in a material, from the log of any program that cut with it.

    CELL is cell.yaml with the cutter, TOOLPATH the program that was logged. Written are six coefficients with their covariance,
    which tell the forces of other programs from their stock (predict and correct, --predict-force).
    """
    from compensator.cutting.stock_file import stock_npz
    from compstiff import cutting_coefficients, read_cell, read_stiffness, read_toolpath, table_coefficients
    from identification.common.files import check_writable, json_bytes, write_whole
    from identification.model.controller import use_of_stiffnesses

    with_log = {"--stock": stock_file, "--stiffness": stiffness_file}
    missing = [name for name, file in with_log.items() if file is None]
    if forces_file and missing:
        raise click.UsageError(f"--forces needs {' and '.join(missing)}.")
    if not forces_file and (len(missing) < 2 or leaves or settings.correction.logged_with):
        raise click.UsageError("--stock, --stiffness, --leaves and --logged-with are about a log: name it with --forces.")
    named = [cell_file, toolpath_file, stock_file, stiffness_file, forces_file, *(path for _, path in settings.files())]
    session.inputs += [file for file in named if file]
    check_writable([output, *([leaves] if leaves else [])], overwrite=session.overwrite)
    cell = read_cell(cell_file)
    program = read_toolpath(toolpath_file, cell, settings.posting)
    if forces_file and stock_file and stiffness_file:
        fitted = cutting_coefficients(cell, program, stock_file, read_stiffness(stiffness_file, cell), forces_file, settings)
    else:
        fitted = table_coefficients(cell, program, settings)
    files = {output: json_bytes(fitted.content())}
    if leaves and fitted.cut:
        files[leaves] = stock_npz(fitted.cut.left)
    write_whole(files)
    use = use_of_stiffnesses(cell.robot, cell_file, stiffness_file or "STIFFNESS.json", "--predict-force", output,
                             "--stock", "PART.stock.yaml")
    return Outcome(fitted.as_dict(), fitted.findings, fitted.lines(), "" if fitted.coefficients.rejected else use)

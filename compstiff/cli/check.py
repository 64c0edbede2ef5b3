"""`compstiff check`: every file of a cell read, nothing computed."""

from __future__ import annotations

from pathlib import Path

import click

from compensator.correction.settings import Settings
from compstiff.cli.console import EXISTING, command
from compstiff.cli.options import CELL, READING_OPTIONS, with_settings
from compstiff.outcome import Outcome, Session


@command("check", examples=(
    "compstiff check cell.yaml",
    "compstiff check cell.yaml measurements.csv stiffness.json programs/",
))
@CELL
@click.argument("files", metavar="[FILES]...", nargs=-1, type=EXISTING)
@with_settings(*READING_OPTIONS)
def check(session: Session, cell_file: Path, files: tuple[Path, ...], settings: Settings) -> Outcome:
    """Check the files of a cell, and say all that is wrong with them, without computing.

    CELL is cell.yaml; FILES are measurements, plans, toolpaths, force logs, joint logs, robot files, and what the commands
    write, or folders of such. A log part.forces.csv is held against the program part.mod that is named with it.
    """
    from compstiff import check_files

    session.inputs += [cell_file, *(file for file in files if file.is_file())]
    checked = check_files(cell_file, files, settings)
    return Outcome(checked.as_dict(), checked.findings, checked.lines(), exit_code=checked.exit_code)

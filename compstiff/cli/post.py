"""`compstiff post`: the planned RAPID program of an APT or CSV toolpath, for the first pass."""

from __future__ import annotations

from pathlib import Path

import click

from compensator.correction.settings import Settings
from compstiff.cli.console import READABLE, WRITABLE, command
from compstiff.cli.options import POSTING_OPTIONS, SPLITTING_OPTIONS, with_settings
from compstiff.outcome import Outcome, Session, call


@command("post", writes=True)
@click.argument("cell_file", metavar="CELL", type=READABLE)
@click.argument("toolpath_file", metavar="TOOLPATH", type=READABLE)
@click.option("-o", "--output", required=True, type=WRITABLE, help="The planned program to write.")
@with_settings(*POSTING_OPTIONS, *SPLITTING_OPTIONS)
def post(session: Session, cell_file: Path, toolpath_file: Path, output: Path, settings: Settings) -> Outcome:
    """Post an APT or CSV toolpath as the planned RAPID program.

    Mill it once, log the forces, and give it to correct. Beside OUTPUT stands OUTPUT.json, the record of what was assumed. With
    --split OUTPUT calls parts OUTPUT_001 ...; correct then takes TOOLPATH again, with the same options.
    """
    from compstiff import post_files
    from identification.common.files import write_whole

    session.inputs += [cell_file, toolpath_file]
    posted = post_files(cell_file, toolpath_file, output, settings.posting, overwrite=session.overwrite)
    write_whole(posted.files, overwrite=session.overwrite, read=session.read)
    # The parts are not read again: the same toolpath with the same options gives the same targets.
    again = toolpath_file if posted.parts else output
    following = call("correct", cell_file, again, "--stiffness", "stiffness.json", "--forces", f"{output.stem}.forces.csv",
                     "-o", f"{output.stem}_corrected{output.suffix}")
    return Outcome(posted.as_dict(), posted.findings, posted.lines(),
                   next_step=f"mill it once with the forces logged, then {following}"
                   + (", with the options given here" if posted.parts else ""))

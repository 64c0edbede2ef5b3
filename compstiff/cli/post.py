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
@click.argument("toolpath_files", metavar="TOOLPATH...", nargs=-1, required=True, type=READABLE)
@click.option("-o", "--output", required=True, type=WRITABLE, help="The planned program to write.")
@with_settings(*POSTING_OPTIONS, *SPLITTING_OPTIONS)
def post(session: Session, cell_file: Path, toolpath_files: tuple[Path, ...], output: Path, settings: Settings) -> Outcome:
    """Post an APT or CSV toolpath as the planned RAPID program.

    Mill it once, log the forces, and give it to correct. Beside OUTPUT stands OUTPUT.json, the record of what was assumed. With
    --split OUTPUT calls parts OUTPUT_001 ...; correct then takes TOOLPATH again, with the same options.

    Of a job of several RAPID modules (main.mod layer1.mod ..., or the .pgf that lists them): one program of them all,
    for a log of the whole job. It is not for the robot: correct it with --modules, which writes the modules again.
    """
    from compensator.posting.modules import join_files, of_modules
    from compstiff import post_files
    from identification.common.files import write_whole

    if of_modules(toolpath_files):
        joined = join_files(toolpath_files, output, settings.posting)
        session.inputs += [cell_file, *joined.sources]
        write_whole(joined.files, overwrite=session.overwrite, read=session.read)
        following = call("correct", cell_file, output, "--stiffness", "stiffness.json", "--forces", f"{output.stem}.forces.csv",
                         "--modules", "-o", f"corrected/{joined.main.name}")
        return Outcome(joined.as_dict(), joined.findings, joined.lines(),
                       next_step=f"with the forces of the whole job logged, and a folder for what is corrected: {following}")
    if len(toolpath_files) > 1:
        raise click.UsageError("Several APT or CSV toolpaths are posted one by one; only RAPID modules are joined.")
    toolpath_file, = toolpath_files

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

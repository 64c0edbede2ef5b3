"""`compstiff learn`: from a measured part to what the next program should know."""

from __future__ import annotations

from pathlib import Path

import click

from compensator.correction.settings import Settings
from compstiff.cli.console import READABLE, WRITABLE, command
from compstiff.cli.options import (
    CELL,
    FORCES,
    LOG_OPTIONS,
    OTHER_LOG,
    POSTING_OPTIONS,
    REPORT,
    STIFFNESS,
    TOOLPATH,
    with_settings,
)
from compstiff.outcome import Outcome, Session, call


@command("learn", writes=True, examples=(
    "compstiff learn cell.yaml part.mod points.csv --stiffness stiffness.json --forces part.forces.csv \\",
    "    --tare 0:2 -o learned.json --report learn.html",
    "compstiff correct cell.yaml other.mod --stiffness stiffness.json --forces other.forces.csv --learned learned.json \\",
    "    -o other_corrected.mod",
))
@CELL
@TOOLPATH
@click.argument("points_file", metavar="POINTS", type=READABLE)
@STIFFNESS
@FORCES
@click.option("-o", "--output", required=True, type=WRITABLE, help="The learned file (JSON) to write.")
@click.option("--logged-with", type=READABLE, help="The offsets.csv that the program had in this pass, where it was "
              "a corrected one.")
@click.option("--tool-radius-mm", type=click.FloatRange(0, 500), default=0.0, show_default=True,
              help="Of the tool, where POINTS are of the machined surface: it stood so far beside them, along the normal.")
@click.option("--within-mm", type=click.FloatRange(0, min_open=True), default=1.0, show_default=True,
              help="How far from the path a point may be.")
@with_settings(*LOG_OPTIONS, *OTHER_LOG, *POSTING_OPTIONS)
@REPORT
def learn(
    session: Session, cell_file: Path, toolpath_file: Path, points_file: Path, stiffness_file: Path, forces_file: Path,
    output: Path, tool_radius_mm: float, within_mm: float, report: Path | None, settings: Settings,
) -> Outcome:
    """Learn from a measured part what the next program should know.

    CELL is cell.yaml, TOOLPATH the planned program, POINTS the deviation measured on the part: x_mm y_mm z_mm in the work
    object, with dx_um dy_um dz_um, or nx ny nz and dn_um along the normal; std_um. FORCES is the log of that very pass.
    """
    from dataclasses import replace

    from compensator.correction.recorded import check_not_corrected
    from compensator.posting.suffixes import rapid_suffix, toolpath_stem
    from compstiff import learn, read_cell, read_stiffness, read_toolpath
    from identification.common.files import check_writable, json_bytes, write_whole
    from identification.common.findings import Refused

    inputs = [cell_file, toolpath_file, points_file, stiffness_file, forces_file]
    session.inputs += [*inputs, *(path for _, path in settings.files())]
    check_writable([output, *([report] if report else [])], overwrite=session.overwrite)
    try:
        check_not_corrected(toolpath_file)
    except Refused as corrected:
        raise Refused(*(replace(finding, hint="name the planned program, and with --logged-with the offsets.csv that this one "
                                "has over it") for finding in corrected.findings)) from corrected
    cell = read_cell(cell_file)
    model = read_stiffness(stiffness_file, cell)
    learning = learn(cell, read_toolpath(toolpath_file, cell, settings.posting), model, forces_file, points_file, settings,
                     radius=1e-3 * tool_radius_mm, within=1e-3 * within_mm)
    files = {output: json_bytes(learning.content())}
    if report:
        from compstiff.writing import report as page_of

        files[report] = page_of(learning).encode()
    write_whole(files, overwrite=session.overwrite, read=session.read)
    return Outcome(learning.as_dict(), learning.findings, learning.lines(),
                   call("correct", cell_file, toolpath_file, "--stiffness", stiffness_file, "--forces", forces_file,
                        *settings.log_options(), "--learned", output, "--repeats", "job", "-o",
                        f"{toolpath_stem(toolpath_file)}_corrected{rapid_suffix(toolpath_file)}"))

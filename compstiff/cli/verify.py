"""`compstiff verify`: the acceptance step at the machine."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import click

from compstiff.cli.console import READABLE, WRITABLE, command
from compstiff.outcome import DONE, REFUSED, Outcome, Session


@command("verify", writes=True)
@click.argument("cell_file", metavar="CELL", type=READABLE)
@click.argument("before_file", metavar="BEFORE", type=READABLE)
@click.argument("after_file", metavar="AFTER", type=READABLE)
@click.option("--predicted", "predicted_file", type=READABLE,
              help="deviation.csv or offsets.csv of the measured program: how much was predicted, and which scale fits.")
@click.option("--tolerance-um", type=click.FloatRange(0, min_open=True),
              help="Largest deviation that is accepted: exit code 3 if a reading of AFTER exceeds it.")
@click.option("--within-mm", type=click.FloatRange(0), default=1.0, show_default=True,
              help="How far apart places may be that belong together.")
@click.option("--frame", type=click.Choice(["base", "workobject"]), default="base", show_default=True,
              help="Frame of dx_um dy_um dz_um and nx ny nz; workobject: that of CELL.")
@click.option("--tool-radius-mm", type=click.FloatRange(0, 500), default=0.0, show_default=True,
              help="Of the tool, where places are of the machined surface: it stood so far beside them, along the normal.")
@click.option("--report", type=WRITABLE, help="Also write an HTML report.")
def verify(
    session: Session, cell_file: Path, before_file: Path, after_file: Path, predicted_file: Path | None,
    tolerance_um: float | None, within_mm: float, frame: Literal["base", "workobject"], tool_radius_mm: float,
    report: Path | None,
) -> Outcome:
    """Compare the deviation measured before and after a correction.

    CELL is cell.yaml. BEFORE and AFTER are CSV files of the part, or of the tool, measured along the path: target, path_mm or
    x_mm y_mm z_mm, with dx_um dy_um dz_um (any of them) or dn_um along the normal.
    """
    from compstiff import read_cell, verify
    from identification.common.files import check_writable, write_whole

    session.inputs += [cell_file, before_file, after_file, *([predicted_file] if predicted_file else [])]
    if report:
        check_writable([report], overwrite=session.overwrite)
    result = verify(read_cell(cell_file), before_file, after_file, predicted_file, tolerance_um=tolerance_um,
                    within=1e-3 * within_mm, frame=frame, radius=1e-3 * tool_radius_mm)
    if report:
        from compensator.verification.report import verify_report

        # Written with either answer: a part that is not accepted needs it most.
        write_whole({report: verify_report(result).encode()}, overwrite=session.overwrite, read=session.read)
    step = ""
    if result.scale is not None and result.scale.option:
        step = f"compstiff correct ... {result.scale.option}"
    elif result.scale is None and result.comparison.verdict != "worse":
        step = "add --predicted offsets.csv to see how much was predicted and whether a scale would help"
    return Outcome(result.as_dict(), result.findings, result.lines(), step, REFUSED if result.accepted is False else DONE)

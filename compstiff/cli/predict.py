"""`compstiff predict`: how far the tool is pushed off its path."""

from __future__ import annotations

from pathlib import Path

import click

from compensator.correction.settings import Settings
from compstiff.cli.console import WRITABLE, command
from compstiff.cli.options import (
    CELL,
    FORCES,
    LEARNED_OPTIONS,
    LOG_OPTIONS,
    OTHER_LOG,
    POSTING_OPTIONS,
    REPORT,
    STIFFNESS,
    TOOLPATH,
    with_settings,
)
from compstiff.outcome import Outcome, Session, call


@command("predict", writes=True)
@CELL
@TOOLPATH
@STIFFNESS
@FORCES
@click.option("-o", "--output", required=True, type=WRITABLE, help="The deviation file (CSV) to write.")
@with_settings(*LOG_OPTIONS, *OTHER_LOG, *POSTING_OPTIONS, *LEARNED_OPTIONS)
@REPORT
def predict(
    session: Session, cell_file: Path, toolpath_file: Path, stiffness_file: Path, forces_file: Path, output: Path,
    report: Path | None, settings: Settings,
) -> Outcome:
    """Predict how far the tool is pushed off its path.

    CELL is cell.yaml, TOOLPATH a RAPID program, APT or CSV; the deviation and its standard deviation are written target by
    target.
    """
    from compensator.correction.files import predict_files
    from compensator.posting.suffixes import rapid_suffix, toolpath_stem
    from compstiff import Inputs, deviation_csv
    from identification.common.files import check_writable, write_whole

    inputs = Inputs(cell_file, toolpath_file, stiffness_file, forces_file)
    session.inputs += [cell_file, toolpath_file, stiffness_file, forces_file, *(path for _, path in settings.files())]
    outputs = [output, *([report] if report else [])]
    check_writable(outputs, overwrite=session.overwrite)
    predicted = predict_files(inputs, settings)
    files = {output: deviation_csv(predicted)}
    if report:
        from compstiff.writing import report as page_of

        files[report] = page_of(predicted).encode()
    write_whole(files)
    return Outcome(predicted.as_dict(), predicted.findings, predicted.lines(),
                   next_step=call("correct", cell_file, toolpath_file, "--stiffness", stiffness_file, "--forces", forces_file,
                                  *settings.as_options(), "-o",
                                  f"{toolpath_stem(toolpath_file)}_corrected{rapid_suffix(toolpath_file)}"))

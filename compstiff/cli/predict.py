"""`compstiff predict`: how far the tool is pushed off its path."""

from __future__ import annotations

from pathlib import Path

import click

from compensator.correction.settings import DEFAULTS, Settings
from compstiff.cli.console import WRITABLE, command
from compstiff.cli.options import (
    CELL,
    CUT_OPTIONS,
    FORCE_OPTIONS,
    FORCES_IF_ANY,
    LEARNED_OPTIONS,
    LOG_OPTIONS,
    OTHER_LOG,
    POSTING_OPTIONS,
    REPORT,
    STIFFNESS,
    TOOLPATH,
    check_forces,
    with_settings,
)
from compstiff.outcome import Outcome, Session, call


@command("predict", writes=True)
@CELL
@TOOLPATH
@STIFFNESS
@FORCES_IF_ANY
@click.option("-o", "--output", required=True, type=WRITABLE, help="The deviation file (CSV) to write.")
@click.option("--budget", is_flag=True, help="Also say what a tolerance would be spent on after a correction.")
@click.option("--tolerance-um", type=click.FloatRange(0, min_open=True),
              help="With --budget: the largest deviation that is accepted on the part.")
@with_settings(*LOG_OPTIONS, *OTHER_LOG, *POSTING_OPTIONS, *CUT_OPTIONS, *LEARNED_OPTIONS, *FORCE_OPTIONS)
@REPORT
def predict(
    session: Session, cell_file: Path, toolpath_file: Path, stiffness_file: Path, forces_file: Path | None, output: Path,
    report: Path | None, settings: Settings, budget: bool, tolerance_um: float | None,
) -> Outcome:
    """Predict how far the tool is pushed off its path.

    CELL is cell.yaml, TOOLPATH a RAPID program, APT or CSV; the deviation and its standard deviation are written target by
    target. --budget works out the correction too, writes none, and says by cause what --tolerance-um would be spent on, which
    lines may fail, and what would help by how much.
    """
    from compensator.correction.files import predict_files
    from compensator.correction.logged_pass import driven_as_said
    from compensator.posting.modules import in_modules, told_in_modules
    from compensator.posting.suffixes import rapid_suffix, toolpath_stem
    from compstiff import Inputs, deviation_csv, error_budget
    from identification.common.files import check_writable, write_whole
    from identification.model.controller import runs_rapid

    if budget != (tolerance_um is not None):
        raise click.UsageError("--budget and --tolerance-um go together.")
    if not budget and _of_the_cut(settings) != _of_the_cut(DEFAULTS):
        raise click.UsageError("--cutting-stiffness, --depth-of-cut, --slot-depth, --logged-with and --first-forces are for "
                               "correct, and for --budget: the force of the logged pass is predicted.")
    check_forces(forces_file, settings)
    if settings.correction.first_forces and not settings.correction.logged_with:
        raise click.UsageError("--first-forces needs --logged-with: the offsets of the pass that FORCES were logged in.")
    inputs = Inputs(cell_file, toolpath_file, stiffness_file, forces_file)
    session.inputs += [*inputs.files(), *(path for _, path in settings.files())]
    outputs = [output, *([report] if report else [])]
    check_writable(outputs, overwrite=session.overwrite)
    with told_in_modules(toolpath_file):
        predicted = predict_files(inputs, settings)
        spent = error_budget(predicted, 1e-6 * tolerance_um) if tolerance_um is not None else None
    files = {output: deviation_csv(predicted)}
    if report:
        from compstiff.writing import report as page_of

        files[report] = page_of(spent or predicted).encode()
    write_whole(files, overwrite=session.overwrite, read=session.read)
    figures, lines = predicted.as_dict(), predicted.lines()
    findings = (*predicted.findings, *(driven_as_said(predicted) if forces_file and not budget else ()))
    if spent is not None:
        figures, findings, lines = figures | {"budget": spent.as_dict()}, (*findings, *spent.findings), [*lines, *spent.lines()]
    following = call("correct", cell_file, toolpath_file, "--stiffness", stiffness_file,
                     *(["--forces", forces_file] if forces_file else []), *settings.as_options(), "-o",
                     f"{toolpath_stem(toolpath_file)}_corrected{rapid_suffix(toolpath_file)}")
    return Outcome(figures, in_modules(findings, toolpath_file), lines,
                   next_step=following if runs_rapid(predicted.path.cell.robot) and len(predicted.targets) else "")


def _of_the_cut(settings: Settings) -> tuple[object, ...]:
    chosen = settings.correction
    return chosen.cutting_stiffness, chosen.depth_of_cut, chosen.slot_depth, chosen.logged_with, chosen.first_forces

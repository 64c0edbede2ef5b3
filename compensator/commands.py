"""The commands of every toolpath: `predict`, `correct`, `demo`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from compensator.design import design
from compensator.pipeline_commands import correct_batch, is_batch, watch
from compensator.post_command import post
from compensator.settings import CORRECTION_OPTIONS, FORCE_OPTIONS, POSTING_OPTIONS, Settings, with_settings
from compensator.tare import tare
from identification.console import EXISTING, PATH, READABLE, WRITABLE, Outcome, Session, command
from identification.findings import counted

if TYPE_CHECKING:
    from compensator.pipeline import Corrected, Inputs, Predicted


_CELL = click.argument("cell_file", metavar="CELL", type=READABLE)
_TOOLPATH = click.argument("toolpath_file", metavar="TOOLPATH", type=READABLE)
_STIFFNESS = click.option("--stiffness", "stiffness_file", required=True, type=READABLE, help="What identify wrote.")
_FORCES = click.option("--forces", "forces_file", required=True, type=READABLE, help="The force log of this program.")
_REPORT = click.option("--report", type=WRITABLE, help="Also write an HTML report.")


@command("predict", writes=True)
@_CELL
@_TOOLPATH
@_STIFFNESS
@_FORCES
@click.option("-o", "--output", required=True, type=WRITABLE, help="The deviation file (CSV) to write.")
@with_settings(*FORCE_OPTIONS, *POSTING_OPTIONS)
@_REPORT
def predict(
    session: Session, cell_file: Path, toolpath_file: Path, stiffness_file: Path, forces_file: Path, output: Path,
    report: Path | None, settings: Settings,
) -> Outcome:
    """Predict how far the tool is pushed off its path.

    CELL is cell.yaml, TOOLPATH a RAPID program, APT or CSV; the deviation and its standard deviation are written target by
    target.
    """
    from compensator.offsets import deviation_csv
    from compensator.pipeline import Inputs, check_distinct, predict_program, rapid_suffix, summary
    from identification.files import check_writable, write_whole

    inputs = Inputs(cell_file, toolpath_file, stiffness_file, forces_file)
    session.inputs += [cell_file, toolpath_file, stiffness_file, forces_file]
    outputs = [output, *([report] if report else [])]
    check_distinct(inputs, outputs)
    check_writable(outputs, overwrite=session.overwrite)
    predicted = predict_program(inputs, settings)
    files = {output: deviation_csv(predicted)}
    if report:
        from compensator.report import path_report

        files[report] = path_report(predicted, None).encode()
    write_whole(files)
    return Outcome(summary(predicted), predicted.findings, _predicted_lines(predicted),
                   next_step=f"compstiff correct {cell_file} {toolpath_file} --stiffness {stiffness_file} --forces "
                   f"{forces_file}{settings.as_options()} -o {toolpath_file.stem}_corrected{rapid_suffix(toolpath_file)}")


@command("correct", writes=True)
@_CELL
@click.argument("toolpath_files", metavar="TOOLPATH...", nargs=-1, required=True, type=EXISTING)
@_STIFFNESS
@click.option("--forces", "forces_file", type=EXISTING,
              help="The force log of this program; of several the folder of their logs.  [default: beside each]")
@click.option("-o", "--output", required=True, type=click.Path(), help="The corrected program to write; of several a folder.")
@click.option("--offsets", type=PATH, help="Also write the offsets, one row a target (CSV).")
@with_settings(*FORCE_OPTIONS, *POSTING_OPTIONS, *CORRECTION_OPTIONS)
@click.option("--report", type=PATH, help="Also write an HTML report.")
@click.option("--jobs", type=click.IntRange(1, 64), default=1, show_default=True, help="Of several, so many at a time.")
def correct(
    session: Session, cell_file: Path, toolpath_files: tuple[Path, ...], stiffness_file: Path, forces_file: Path | None,
    output: str, offsets: Path | None, report: Path | None, settings: Settings, jobs: int,
) -> Outcome:
    """Correct a milling program for the deflection under its logged forces.

    CELL is cell.yaml, TOOLPATH a RAPID program; APT and CSV are posted as RAPID first (see post). Only the numbers of
    corrected targets change; beside OUTPUT stands OUTPUT.json, the record of what it was made from.

    Several programs, or a folder of them: each with its log part.forces.csv beside part.mod or in the folder --forces names.
    Then OUTPUT, --offsets and --report are folders, and --json prints one line a program.
    """
    if is_batch(toolpath_files, output):
        return correct_batch(session, cell_file, toolpath_files, stiffness_file, forces_file, Path(output), offsets, report,
                             settings, jobs)
    return _correct_one(session, cell_file, toolpath_files[0], stiffness_file, forces_file, Path(output), offsets, report,
                        settings)


def _correct_one(
    session: Session, cell_file: Path, toolpath_file: Path, stiffness_file: Path, forces_file: Path | None, output: Path,
    offsets: Path | None, report: Path | None, settings: Settings,
) -> Outcome:
    from compensator.batch import log_beside
    from compensator.pipeline import Inputs, summary

    forces_file = forces_file or log_beside(toolpath_file)
    if forces_file is None:
        raise click.UsageError("Missing option '--forces': there is no force log " +
                               f"{toolpath_file.stem}.forces.csv (or .parquet) beside the program.")
    for path in (forces_file, offsets, report):
        if path and path.is_dir():
            raise click.UsageError(f"'{path}' is a folder. For a batch, '-o' has to be a folder too.")
    inputs = Inputs(cell_file, toolpath_file, stiffness_file, forces_file)
    session.inputs += [cell_file, toolpath_file, stiffness_file, forces_file, *(path for _, path in settings.files())]
    if settings.first_forces and not settings.logged_with:
        raise click.UsageError("--first-forces needs --logged-with: the offsets of the pass that FORCES were logged in.")
    corrected = run_correction(inputs, output, offsets, report, settings, overwrite=session.overwrite)
    step = f"open {report} in a browser" if report else f"load {output}{_parts_of(output)} into the robot, first in air"
    return Outcome(summary(corrected.predicted, corrected), corrected.findings, correction_lines(corrected), step)


def _parts_of(output: Path) -> str:
    """The parts that were written with a program, by its record: parts of an earlier split may lie beside them."""
    import json

    parts = [part["file"] for part in json.loads(output.with_name(output.name + ".json").read_bytes())["parts"]]
    return f" and its parts {parts[0]} ... {parts[-1]}" if parts else ""


def run_correction(
    inputs: Inputs, output: Path, offsets: Path | None, report: Path | None, settings: Settings, *, overwrite: bool,
    before_writing: Callable[[], None] | None = None,
) -> Corrected:
    """Corrects one program and writes all its files, or none. What `before_writing` raises stops it at the last moment."""
    import json
    from dataclasses import replace

    from compensator.offsets import offsets_csv
    from compensator.pipeline import check_distinct, check_not_corrected, correct_program, predict_program, record
    from compensator.split_files import split_files
    from identification.files import check_writable, write_whole

    record_file = output.with_name(output.name + ".json")
    outputs = [output, record_file, *(path for path in (offsets, report) if path)]
    check_distinct(inputs, outputs)
    check_writable(outputs, overwrite=overwrite)
    if not overwrite:
        check_not_corrected(inputs.toolpath)
    corrected = correct_program(predict_program(inputs, settings))
    air = ~corrected.predicted.forces.forced | corrected.predicted.rapid
    files, _, said = split_files(corrected.content, air, settings, output, overwrite=overwrite)
    check_distinct(inputs, list(files))
    corrected = replace(corrected, findings=(*corrected.findings, *said))
    files[record_file] = (json.dumps(record(corrected, files), indent=1, allow_nan=False) + "\n").encode()
    if offsets:
        files[offsets] = offsets_csv(corrected)
    if report:
        from compensator.report import path_report

        files[report] = path_report(corrected.predicted, corrected).encode()
    if before_writing:
        before_writing()
    write_whole(files)
    return corrected


def _predicted_lines(predicted: Predicted) -> list[str]:
    from compensator.pipeline import summary

    figures = summary(predicted)
    deviation, std = figures["deviation_um"], figures["deviation_std_um"]
    return [
        f"targets: {figures['targets']}, {figures['with_force']} with force, {figures['without_sample']} without a sample",
        f"predicted deviation: largest {deviation['largest']:.1f} um, RMS {deviation['rms']:.1f} um; its standard deviation "
        f"up to {std['largest']:.1f} um",
    ]


def correction_lines(corrected: Corrected) -> list[str]:
    """The correction for the terminal."""
    from compensator.pipeline import as_logged, summary

    figures = summary(corrected.predicted, corrected)
    offset, residual = figures["offset_mm"], figures["residual_um"]
    added = [f"intermediate targets added: {figures['added_targets']}"] if figures["added_targets"] else []
    return [
        *_predicted_lines(corrected.planned), *added,
        f"corrected: {figures['corrected']} targets; largest correction {offset['largest']:.4f} mm and "
        f"{figures['turn_deg']['largest']:.4f} deg",
        f"left after correction, by the same model: largest {residual['largest']:.2f} um, RMS {residual['rms']:.2f} um ("
        + (f"{counted(figures['held_back'], 'correction')} held back, else the rounding of the written numbers)"
           if figures["held_back"] else "the rounding of the written numbers)"),
        f"expected to end up farther off than uncorrected: {figures['expected_worse']:.1f} of {figures['corrected']} targets",
        *([f"forces taken as logged: {as_logged(figures)}"] if figures["left_at_10_n_per_mm_um"] else []),
        *(corrected.advice.words() if corrected.advice else []),
        *([] if figures["feed_check"] is None else _feed_lines(**figures["feed_check"])),
    ]


def _feed_lines(planned: dict[str, Any], corrected: dict[str, Any]) -> list[str]:
    def both(key: str, form: str, factor: int = 1) -> str:
        return f"{factor * corrected[key]:{form}} (as planned {factor * planned[key]:{form}})"

    return [
        f"feed cannot be held by {both('held_back', 'd')} of {corrected['judged']} moves, in the cut by "
        f"{both('held_back_with_force', 'd')}; lowest share {both('lowest_feed_ratio', '.0f', 100)} %, in the cut "
        f"{both('lowest_feed_ratio_with_force', '.0f', 100)} %",
        f"time: {both('time_s', '.1f')} s, of them {both('lost_held_back_s', '.2f')} s lost where the feed cannot be held and "
        f"{both('lost_ramps_s', '.2f')} s at stops and changes of feed",
    ]


@command("demo", writes=True)
@click.argument("folder", metavar="[DIR]", default="compstiff-demo", type=click.Path(file_okay=False, path_type=Path))
def demo(session: Session, folder: Path) -> Outcome:
    """Run identify and correct on the shipped samples, into DIR.

    The samples are simulated (samples/README.md says how); DIR is compstiff-demo if it is not given.
    """
    from compensator.demo import run_demo

    return run_demo(session, folder)


COMMANDS = (design, post, tare, predict, correct, watch, demo)

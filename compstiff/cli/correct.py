"""`compstiff correct`: a milling program, or many, corrected for the deflection under logged forces."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from compensator.correction.settings import Settings
from compstiff.cli.console import EXISTING, PATH, TEXT_PATH, command, option
from compstiff.cli.correct_batch import correct_batch, is_batch
from compstiff.cli.options import (
    CELL,
    CORRECTION_OPTIONS,
    CUT_OPTIONS,
    FEED_OPTIONS,
    FORCE_OPTIONS,
    LEARNED_OPTIONS,
    LOG_OPTIONS,
    MODULE_OPTIONS,
    OTHER_LOG,
    POSTING_OPTIONS,
    SPLITTING_OPTIONS,
    STIFFNESS,
    Shard,
    check_forces,
    with_settings,
)
from compstiff.outcome import Outcome, Session

if TYPE_CHECKING:
    from compensator.correction.files import Inputs, Outputs


@command("correct", writes=True, examples=(
    "compstiff correct cell.yaml part.mod --stiffness stiffness.json --forces part.forces.csv \\",
    "    --tare 0:2 -o part_corrected.mod --report correct.html",
    "compstiff correct cell.yaml programs/ --stiffness stiffness.json --tare 0:2 -o corrected/ --json",
))
@CELL
@click.argument("toolpath_files", metavar="TOOLPATH...", nargs=-1, required=True, type=EXISTING)
@STIFFNESS
@click.option("--forces", "forces_file", type=EXISTING,
              help="The force log of this program; of several the folder of their logs.  [default: beside each, "
              "unless --predict-force]")
@click.option("-o", "--output", required=True, type=TEXT_PATH, help="The corrected program to write; of several a folder.")
@with_settings(*LOG_OPTIONS, *OTHER_LOG, *POSTING_OPTIONS, *CORRECTION_OPTIONS, *CUT_OPTIONS, *LEARNED_OPTIONS, *FORCE_OPTIONS,
               *FEED_OPTIONS, *SPLITTING_OPTIONS, *MODULE_OPTIONS)
@click.option("--report", type=PATH, help="Also write an HTML report.")
@option("Output", "--offsets", type=PATH, help="Also write the offsets, one row a target (CSV).")
@option("Output", "--jobs", type=click.IntRange(1, 64), default=1, show_default=True, help="Of several, so many at a time.")
@option("Output", "--shard", type=Shard(), help="Of several, part K of N by their content: for arrays of jobs.")
@option("Output", "--scheduler", metavar="ADDRESS", help="Of several, on the workers of the Dask scheduler tls://HOST:PORT.")
def correct(
    session: Session, cell_file: Path, toolpath_files: tuple[Path, ...], stiffness_file: Path, forces_file: Path | None,
    output: str, offsets: Path | None, report: Path | None, settings: Settings, jobs: int,
    shard: tuple[int, int] | None, scheduler: str | None,
) -> Outcome:
    """Correct a milling program for the deflection under its logged forces.

    CELL is cell.yaml, TOOLPATH a RAPID program; APT and CSV are posted as RAPID first (see post). Only the numbers of
    corrected targets change; beside OUTPUT stands OUTPUT.json, the record of what it was made from.

    Several programs, or a folder of them: each with its log part.forces.csv beside part.mod or in the folder --forces names.
    With --predict-force a program has part.stock.yaml beside it, in place of a log or to hold the log against.
    Then OUTPUT, --offsets and --report are folders, and --json prints one line a program. --jobs, --shard and --scheduler
    share them out (docs/cluster.md).

    RAPID modules, or the .pgf that lists them, with one log: they are one job, and OUTPUT is the folder to which each is
    written under its own name. MAIN_job.mod beside the first holds them all, as post joins them.
    """
    from compstiff import Inputs, Outputs

    if forces_file is not None and forces_file.is_file() and _of_one_job(toolpath_files):
        if scheduler or shard:
            raise click.UsageError("--scheduler and --shard are for several programs: these are the modules of one job.")
        return _correct_job(session, Inputs(cell_file, toolpath_files[0], stiffness_file, forces_file), toolpath_files,
                            Outputs(Path(output), offsets, report), settings)
    if is_batch(toolpath_files, output):
        if settings.log.other_forces or settings.correction.first_forces:
            raise click.UsageError("--other-forces and --first-forces name the log of one program: call it by itself.")
        if settings.cutting.stock:
            raise click.UsageError("--stock is what one program starts from. Of several, each has its own beside it: "
                                   "part.stock.yaml (or .npz) beside part.mod.")
        from compstiff.batch.pairing import Folders
        from compstiff.batch.programs import Shared

        return correct_batch(toolpath_files, Folders(Path(output), offsets, report),
                             Shared(cell_file, stiffness_file, settings, session, forces_file), jobs, scheduler, shard)
    if scheduler or shard:
        raise click.UsageError("--scheduler and --shard are for several programs, or a folder of them.")
    if forces_file is None and not settings.cutting.predict_force:
        forces_file = _log_beside(toolpath_files[0])
    inputs = Inputs(cell_file, toolpath_files[0], stiffness_file, forces_file)
    return _correct_one(session, inputs, Outputs(Path(output), offsets, report), settings)


def _log_beside(toolpath_file: Path) -> Path:
    from compensator.posting.suffixes import toolpath_stem
    from compstiff.batch.pairing import logs_of

    logs = logs_of(toolpath_file)
    if len(logs) != 1:
        raise click.UsageError("Missing option '--forces': there is no force log " +
                               f"{toolpath_stem(toolpath_file)}.forces.csv (or .parquet) beside the program.")
    return logs[0]


def _of_one_job(files: tuple[Path, ...]) -> bool:
    from compensator.posting.modules import SUFFIXES, of_modules

    return of_modules(files) and all(file.is_file() and file.suffix.lower() in SUFFIXES for file in files)


def _correct_job(
    session: Session, inputs: Inputs, modules: tuple[Path, ...], outputs: Outputs, settings: Settings
) -> Outcome:
    """Modules of one job by one log; outputs: its program is the folder."""
    from compensator.correction.recorded import check_not_corrected
    from compensator.posting.modules import join_files
    from identification.common.files import check_distinct, write_whole

    folder = outputs.program
    if folder.suffix and not folder.is_dir():
        raise click.UsageError("These are modules of one job, each written under its own name: -o names a folder, not "
                               f"'{folder}'.")
    together = modules[0].with_name(f"{modules[0].stem}_job.mod")
    joined = join_files(modules, together, settings.posting)
    check_distinct(joined.sources, [folder / source.name for source in joined.sources])
    if not settings.correction.correct_again:
        for source in joined.sources:
            check_not_corrected(source, folder)
    if not together.is_file() or together.read_bytes() != joined.files[together]:
        write_whole(joined.files, overwrite=session.overwrite)
    folder.mkdir(parents=True, exist_ok=True)
    session.inputs += joined.sources
    outcome = _correct_one(session, replace(inputs, toolpath=together), replace(outputs, program=folder / joined.main.name),
                           replace(settings, posting=replace(settings.posting, modules=True)))
    of_job = [finding for finding in joined.findings if finding.code == "CS4352"]
    return replace(outcome, findings=(*of_job, *outcome.findings), lines=[*joined.lines(), *outcome.lines])


def _correct_one(session: Session, inputs: Inputs, outputs: Outputs, settings: Settings) -> Outcome:
    from compensator.posting.modules import in_modules, told_in_modules
    from compstiff import correct_files
    from identification.common.files import check_distinct

    check_distinct([*inputs.files(), *(path for _, path in settings.files())], outputs.files())
    check_forces(inputs.forces, settings)
    for path in (inputs.forces, outputs.offsets, outputs.report):
        if path and path.is_dir():
            raise click.UsageError(f"'{path}' is a folder. For a batch, '-o' has to be a folder too.")
    session.inputs += [*inputs.files(), *(path for _, path in settings.files())]
    if settings.correction.first_forces and not settings.correction.logged_with:
        raise click.UsageError("--first-forces needs --logged-with: the offsets of the pass that FORCES were logged in.")
    with told_in_modules(inputs.toolpath):
        corrected = correct_files(inputs, outputs, settings, overwrite=session.overwrite)
    step = (f"open {outputs.report} in a browser" if outputs.report
            else f"load {outputs.program}{_parts_of(outputs)} into the robot, first in air")
    return Outcome(corrected.as_dict(), in_modules(corrected.findings, inputs.toolpath), corrected.lines(), step)


def _parts_of(outputs: Outputs) -> str:
    """The parts that were written with a program, by its record: parts of an earlier split may lie beside them."""
    import json

    parts = [part["file"] for part in json.loads(outputs.record.read_bytes())["parts"]]
    return f" and its parts {parts[0]}{f' ... {parts[-1]}' if len(parts) > 1 else ''}" if parts else ""

"""The commands of a CAM pipeline: `correct` on many programs, and `watch`."""

from __future__ import annotations

import contextlib
import json
import os
import signal
from collections.abc import Iterator, Sequence
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

import click

from compensator.correction.settings import Settings
from compstiff.cli.console import PATH, READABLE, command
from compstiff.cli.options import CORRECTION_OPTIONS, FEED_OPTIONS, LOG_OPTIONS, SPLITTING_OPTIONS, with_settings
from compstiff.outcome import DONE, INTERRUPTED, Outcome, Session

if TYPE_CHECKING:
    from compstiff.batch.program import Done

FOLDER = click.Path(exists=True, file_okay=False, path_type=Path)


def is_batch(programs: Sequence[Path], output: str) -> bool:
    """Whether a call of `correct` is one of many programs: several, a folder of them, or a folder to write to."""
    return len(programs) > 1 or programs[0].is_dir() or Path(output).is_dir() or output.endswith(("/", os.sep))


def correct_batch(
    session: Session, cell_file: Path, programs: Sequence[Path], stiffness_file: Path, forces: Path | None, output: Path,
    offsets: Path | None, report: Path | None, settings: Settings, processes: int,
) -> Outcome:
    """Each program by itself: one that fails does not stop the others."""
    session.jobs = True
    for path, option in ((output, "-o"), (forces, "--forces"), (offsets, "--offsets"), (report, "--report")):
        if path and path.exists() and not path.is_dir():
            raise click.UsageError(f"'{path}' is a file. Of several programs, {option} names a folder.")
    from compstiff.batch.pairing import Folders, jobs_for, programs_in
    from compstiff.batch.program import Common, run_jobs, worst
    from identification.common.findings import Finding, counted, error

    found = [one for path in programs for one in (programs_in(path) if path.is_dir() else [path])]
    if not found:
        raise error("CS6003", "has no program in it", file=str(programs[0]), hint="name the folder of the programs (.mod ...)")
    folders = Folders(output, offsets, report)
    folders.make()
    jobs = jobs_for(found, forces, folders)
    done: list[Done] = []
    findings: tuple[Finding, ...] = ()
    with _stopping() as signals:
        for one in run_jobs(jobs, Common(cell_file, stiffness_file, settings, session, forces), processes,
                            lambda: bool(signals)):
            done.append(one)
            show(session, one)
    if signals and len(done) < len(jobs):
        findings = (Finding("CS6011", "error", f"interrupted: {len(done)} of {counted(len(jobs), 'program')} were dealt with, "
                            "no further one was begun"),)
    code = INTERRUPTED if findings else worst([one.code for one in done])
    counts = {status: sum(one.status == status for one in done) for status in dict.fromkeys(one.status for one in done)}
    words = {"ok": "corrected", "left": "left alone"}
    text = ", ".join(f"{number} {words.get(status, status)}" for status, number in counts.items())
    return Outcome(findings=findings, exit_code=code, lines=[f"{counted(len(jobs), 'program')}: {text or 'none dealt with'}"],
                   next_step=f"compare the programs with those in {output}, then load them into the robot" if not code else "")


def show(session: Session, done: Done) -> None:
    """One program, as soon as it is done: a line of JSON on stdout, or its findings on stderr and a line of text."""
    from identification.common.findings import fold

    if session.as_json:
        click.echo(json.dumps(done.document, allow_nan=False))
        return
    for finding in done.findings if session.verbose else fold(done.findings):
        if finding.level == "error" or not session.quiet:
            click.echo(str(finding), err=True)
    click.echo(done.line)


@command("watch", writes=True)
@click.argument("source", metavar="IN", type=FOLDER)
@click.argument("output", metavar="OUT", type=PATH)
@click.option("--cell", "cell_file", required=True, type=READABLE, help="cell.yaml.")
@click.option("--stiffness", "stiffness_file", required=True, type=READABLE, help="What identify wrote.")
@click.option("--offsets", type=PATH, help="A folder for the offsets of each program (CSV).")
@with_settings(*LOG_OPTIONS, *CORRECTION_OPTIONS, *FEED_OPTIONS, *SPLITTING_OPTIONS)
@click.option("--report", type=PATH, help="A folder for an HTML report of each program.")
@click.option("--settle", type=click.FloatRange(0, 3600), default=5.0, show_default=True,
              help="A file is finished when it has not changed for so many seconds.")
@click.option("--interval", type=click.FloatRange(0.05, 3600), default=2.0, show_default=True, help="Seconds between looks.")
@click.option("--once", is_flag=True, help="Take what is finished now and end, with the exit code of the worst program.")
@click.option("--retry", is_flag=True, help="Try programs again that failed before.")
def watch(
    session: Session, source: Path, output: Path, cell_file: Path, stiffness_file: Path, offsets: Path | None,
    settings: Settings, report: Path | None, settle: float, interval: float, once: bool, retry: bool,
) -> Outcome:
    """Correct every finished program that appears in a folder, once.

    Programs in IN with their logs (part.mod, part.forces.csv) are corrected into OUT, which must lie outside IN. The journal
    OUT/compstiff-watch.jsonl keeps what was done: a restart goes on where the last run ended. Ctrl-C or SIGTERM ends it after
    the program under way.
    """
    session.jobs = True
    from compstiff.batch.finished_files import Settled
    from compstiff.batch.journal import Journal
    from compstiff.batch.pairing import Folders
    from compstiff.batch.program import Common, Done, worst
    from compstiff.batch.watch import Watch, check_folders, look_once, watching
    from identification.model.cell import read_cell
    from identification.model.stiffness_file import read_stiffness

    folders = Folders(output, offsets, report)
    check_folders(source, folders)
    # What every program needs is read now: a mistake in it is no program's failure.
    read_stiffness(stiffness_file, read_cell(cell_file))
    folders.make()
    journal = Journal(output)
    one = Watch(source, folders, Common(cell_file, stiffness_file, settings, session), journal, Settled(settle))
    codes: list[int] = []
    with contextlib.closing(journal), _stopping() as signals:
        journal.sweep()
        if retry:
            journal.forget_failures()
        if not once:
            session.say(f"watching {source}; Ctrl-C ends it")
        for finding in journal.findings:
            session.say(str(finding))
        looks = look_once(one, lambda: bool(signals)) if once else watching(one, interval, lambda: bool(signals))
        for done in looks:
            if isinstance(done, Done):
                codes.append(done.code)
                _log(session, done)
            else:
                session.say(str(done))
    code = INTERRUPTED if signal.SIGINT in signals else worst(codes) if once else DONE
    return Outcome(exit_code=code)


def _log(session: Session, done: Done) -> None:
    """One program of a watched folder: a line on stderr, with what went wrong; with `--json` a line on stdout."""
    if session.as_json:
        click.echo(json.dumps(done.document, allow_nan=False))
        return
    from identification.common.findings import fold

    if done.code or not session.quiet:
        click.echo(f"{datetime.now():%Y-%m-%d %H:%M:%S} {done.line}", err=True)
    for finding in done.findings if session.verbose else fold(done.findings):
        if finding.level == "error" or session.verbose:
            click.echo(f"  {str(finding).replace(chr(10), chr(10) + '  ')}", err=True)


@contextlib.contextmanager
def _stopping() -> Iterator[list[int]]:
    """The signals that ask to end, as they come. The second one ends the program under way, too: nothing of it is written."""
    received: list[int] = []

    def note(number: int, frame: object) -> None:
        received.append(number)
        signal.signal(signal.SIGINT, signal.default_int_handler)
        signal.signal(signal.SIGTERM, signal.SIG_DFL)

    before = {number: signal.signal(number, note) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield received
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)

"""`compstiff watch`: a folder of a CAM pipeline."""

from __future__ import annotations

import json
import signal
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

import click

from compensator.correction.settings import Settings
from compstiff.cli.console import PATH, READABLE, Named, command, readers_may_go
from compstiff.cli.options import CORRECTION_OPTIONS, FEED_OPTIONS, LOG_OPTIONS, PREDICT_FORCE, SPLITTING_OPTIONS, with_settings
from compstiff.cli.signals import ending_signals
from compstiff.outcome import DONE, INTERRUPTED, Outcome, Session

if TYPE_CHECKING:
    from compstiff.batch.programs import ProgramResult

WATCHED = Named("folder", exists=True, file_okay=False)


@command("watch", writes=True)
@click.argument("source", metavar="IN", type=WATCHED)
@click.argument("output", metavar="OUT", type=PATH)
@click.option("--cell", "cell_file", required=True, type=READABLE, help="cell.yaml.")
@click.option("--stiffness", "stiffness_file", required=True, type=READABLE, help="What identify wrote.")
@click.option("--offsets", type=PATH, help="A folder for the offsets of each program (CSV).")
@with_settings(*LOG_OPTIONS, *CORRECTION_OPTIONS, PREDICT_FORCE, *FEED_OPTIONS, *SPLITTING_OPTIONS)
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

    Programs in IN with their logs (part.mod, part.forces.csv), or with --predict-force with what they start from
    (part.stock.yaml), are corrected into OUT, which must lie outside IN. The journal
    OUT/compstiff-watch.jsonl keeps what was done: a restart goes on where the last run ended. Ctrl-C or SIGTERM ends it after
    the program under way.
    """
    session.jobs = True
    from compstiff import Folders, Shared, watch_folder
    from compstiff.batch.pairing import logs_without_program
    from compstiff.batch.programs import worst
    from compstiff.batch.watch import Rhythm

    shared = Shared(cell_file, stiffness_file, settings, session)
    codes: list[int] = []
    with ending_signals() as signals:
        for result in watch_folder(source, Folders(output, offsets, report), shared, Rhythm(settle, interval, once, retry),
                                   stopped=lambda: bool(signals), say=session.say):
            codes.append(result.code)
            with readers_may_go():
                _log(session, result)
    if once and not signals:
        for finding in logs_without_program(source):
            session.say(str(finding))
        if not codes:
            session.say(f"nothing new to correct in {source}")
    return Outcome(exit_code=INTERRUPTED if signal.SIGINT in signals else worst(codes) if once else DONE)


def _log(session: Session, result: ProgramResult) -> None:
    """One program of a watched folder: a line on stderr, with its errors and warnings; with `--json` a line on stdout."""
    if session.as_json:
        click.echo(json.dumps(result.as_dict(), allow_nan=False))
        return
    from identification.common.findings import fold, printable

    if result.code or not session.quiet:
        click.echo(f"{datetime.now():%Y-%m-%d %H:%M:%S} {printable(result.lines()[0])}", err=True)
    for finding in result.findings if session.verbose else fold(result.findings):
        if finding.level == "error" or session.verbose or (finding.level == "warning" and not session.quiet):
            click.echo(f"  {str(finding).replace(chr(10), chr(10) + '  ')}", err=True)

"""`compstiff correct` on many programs: each as soon as it is done, and all of them in one line."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from compstiff.cli.console import readers_may_go
from compstiff.cli.signals import ending_signals
from compstiff.outcome import INTERRUPTED, Outcome, Session

if TYPE_CHECKING:
    from compstiff.batch.pairing import Folders
    from compstiff.batch.programs import ProgramResult, Shared

STATUS_WORDS = {"ok": "corrected", "left": "left alone"}


def is_batch(programs: Sequence[Path], output: str) -> bool:
    """Whether a call of `correct` is one of many programs: several, a folder of them, or a folder to write to."""
    return len(programs) > 1 or programs[0].is_dir() or Path(output).is_dir() or output.endswith(("/", os.sep))


def correct_batch(
    programs: Sequence[Path], folders: Folders, shared: Shared, processes: int, scheduler: str | None,
    shard: tuple[int, int] | None,
) -> Outcome:
    """Each program by itself: one that fails does not stop the others. shard: (K, N), that part of them alone."""
    session = shared.session
    session.jobs = True
    for path, option in ((folders.output, "-o"), (shared.logs, "--forces"), (folders.offsets, "--offsets"),
                         (folders.report, "--report")):
        if path and path.exists() and not path.is_dir():
            several = len(programs) > 1 or programs[0].is_dir()
            where = "Of several programs" if several else f"Where -o is a folder ({folders.output})"
            job = (f" Is it the log of a whole job of these modules? Join them: compstiff post CELL {programs[0]} "
                   f"{programs[1] if len(programs) > 1 else 'OTHER.mod'} ... -o job.mod, then correct job.mod with --modules."
                   if option == "--forces" else "")
            raise click.UsageError(f"'{path}' is a file. {where}, {option} names a folder.{job}")
    from compstiff import Finding, correct_programs, paired
    from compstiff.batch.pairing import share_of
    from compstiff.batch.programs import programs_of, worst
    from identification.common.findings import counted

    files = programs_of(programs)
    folders.make()
    batch = paired(files, shared.logs, folders, predicted=shared.predicted)
    if shard:
        batch = share_of(batch, shard)
        session.say(f"part {shard[0]} of {shard[1]}: {len(batch)} of {counted(len(files), 'program')}")
    results: list[ProgramResult] = []
    findings: tuple[Finding, ...] = ()
    with ending_signals() as signals:
        for result in correct_programs(batch, shared, processes=processes, scheduler=scheduler, stopped=lambda: bool(signals)):
            results.append(result)
            with readers_may_go():
                _show(session, result)
    if signals and len(results) < len(batch):
        findings = (Finding("CS6011", "error", f"interrupted: {len(results)} of {counted(len(batch), 'program')} dealt "
                            "with, no further one was begun"),)
    code = INTERRUPTED if findings else worst([result.code for result in results])
    statuses = [result.status for result in results]
    counts = ", ".join(f"{statuses.count(status)} {STATUS_WORDS.get(status, status)}" for status in dict.fromkeys(statuses))
    step = "" if code else f"compare the programs with those in {folders.output}, then load them into the robot"
    return Outcome(findings=findings, lines=[f"{counted(len(batch), 'program')}: {counts or 'none dealt with'}"],
                   next_step=step, exit_code=code)


def _show(session: Session, result: ProgramResult) -> None:
    """One program, as soon as it is done: a line of JSON on stdout, or its findings on stderr and a line of text."""
    from identification.common.findings import fold, printable

    if session.as_json:
        click.echo(json.dumps(result.as_dict(), allow_nan=False))
        return
    for finding in result.findings if session.verbose else fold(result.findings):
        if finding.level == "error" or not session.quiet:
            click.echo(str(finding), err=True)
    for line in result.lines():
        click.echo(printable(line))

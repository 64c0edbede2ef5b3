"""What a command, or one program of a batch, has to say: its result, its findings, its exit code (docs/formats.md)."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from identification.common.command_line import call as call
from identification.common.files import NOTHING_READ, AsRead

if TYPE_CHECKING:
    from identification.common.findings import Finding

DONE, FAILED, USAGE, REFUSED, DEFECT, INTERRUPTED = 0, 1, 2, 3, 70, 130
STATUS = {DONE: "ok", FAILED: "failed", REFUSED: "refused", DEFECT: "defect", INTERRUPTED: "interrupted"}


@dataclass
class Outcome:
    """What a command has to show: result (JSON values), findings, and the text a person reads.

    lines: printed on stdout without `--json`. next_step: the command a user would call now. exit_code: not DONE where the
    job was done and the answer is no, where the worst of several jobs counts, or where the command itself can say what Ctrl-C
    left.
    """

    result: dict[str, Any] = field(default_factory=dict)
    findings: tuple[Finding, ...] = ()
    lines: list[str] = field(default_factory=list)
    next_step: str = ""
    exit_code: int = DONE


@dataclass
class Session:
    """The options all commands share, and the input files named so far.

    jobs: the command does several jobs and shows each by itself, with `--json` on one line. read: the files that the call names
    to be read, as they were when it began.
    """

    command: str
    as_json: bool = False
    quiet: bool = False
    verbose: bool = False
    overwrite: bool = False
    jobs: bool = False
    inputs: list[Path] = field(default_factory=list)
    read: AsRead = NOTHING_READ

    def say(self, text: str) -> None:
        """A message for the person at the terminal, on stderr."""
        if not self.quiet and not self.as_json:
            from identification.common.findings import printable

            click.echo(printable(text), err=True)


def attempt(session: Session, body: Callable[[], Outcome]) -> tuple[Outcome, str, int]:
    """Runs the body: what it has to say, its status, its exit code. Nothing but a wrong call is raised."""
    from identification.common import files, progress
    from identification.common.findings import CompstiffError, Finding

    progress.shown.set(sys.stderr.isatty() and not session.quiet and not session.as_json)
    before, known = len(files.written), len(files.earlier)
    try:
        outcome = body()
    except CompstiffError as stopped:
        old = [path for path in dict.fromkeys(files.earlier[known:]) if path not in files.written[before:]]
        findings = (*stopped.findings, *_of_earlier_calls(old))
        return Outcome(findings=findings), STATUS.get(stopped.exit_code, "failed"), stopped.exit_code
    except (KeyboardInterrupt, click.Abort):
        # The demo writes in several steps; every other command in one, its last.
        demo = session.command == "demo"
        if len(files.written) > before and not demo and not session.jobs:
            return Outcome(findings=(Finding("CS0011", "note", "interrupted after the output was complete"),)), "ok", DONE
        left = "the program under way was not written" if session.jobs else (
            "its folder may have a part of the files; --force runs it over them" if demo else "nothing was written")
        return Outcome(findings=(Finding("CS0010", "error", f"interrupted; {left}"),)), "interrupted", INTERRUPTED
    except click.ClickException:
        raise
    except Exception as defect:
        return Outcome(findings=(_defect(session, defect, len(files.written) > before),)), "defect", DEFECT
    if outcome.exit_code == REFUSED and len(files.written) == before:
        old = list(dict.fromkeys(files.earlier[known:]))
        outcome = replace(outcome, findings=(*outcome.findings, *_of_earlier_calls(old)))
    return outcome, STATUS.get(outcome.exit_code, "failed"), outcome.exit_code


def _of_earlier_calls(outputs: list[Path]) -> list[Finding]:
    """That files stand where outputs were to be, and are not of this call (CS0014): another program may take them for its."""
    from identification.common.findings import Finding, verb

    there = [path.name for path in outputs if path.is_file()]
    names = " and ".join([", ".join(there[:-1]), there[-1]] if there[1:] else there)
    return [Finding("CS0014", "warning", f"{names} {verb(len(there), 'stand')} there still, of an earlier call: nothing was "
                    "written now", hint="go by the exit code, or delete them first")] if there else []


def _defect(session: Session, defect: Exception, written: bool) -> Finding:
    """An unexpected exception as a finding, its traceback kept in a log file. written: whether files were before it."""
    import tempfile
    import traceback

    from identification.common.findings import Finding

    log = "(the log could not be written)"
    with contextlib.suppress(OSError):
        handle, log = tempfile.mkstemp(prefix="compstiff-", suffix=".log")
        with os.fdopen(handle, "w", encoding="utf-8", errors="backslashreplace") as stream:
            stream.write(f"compstiff {session.command}, arguments {sys.argv[1:]}\n\n{traceback.format_exc()}")
    return Finding("CS0070", "error", f"a defect in compstiff: {type(defect).__name__}: {defect}",
                   hint=f"{'what was written before it is whole' if written else 'nothing was written'}; please report it with "
                   f"the log file {log}")


def document(session: Session, outcome: Outcome, status: str, code: int) -> dict[str, Any]:
    """What `--json` prints of one job (docs/formats.md#commands)."""
    from identification.common.findings import fold

    findings = outcome.findings if session.verbose else fold(outcome.findings)
    return {
        "format": f"compstiff-{session.command}", "version": 1, "status": status, "exit_code": code,
        "findings": [finding.as_dict() for finding in findings],
        "inputs": _inputs(session.inputs), "result": outcome.result if outcome.result or code == DONE else None,
    }


def _inputs(paths: Iterable[Path]) -> list[dict[str, str]]:
    from identification.common.files import sha256

    listed = []
    for path in paths:
        with contextlib.suppress(OSError):
            listed.append({"file": str(path), "sha256": sha256(path)})
    return listed

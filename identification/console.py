"""What every command does the same way: options, messages, `--json`, exit codes (FORMATS.md).

Results go to stdout or the named file, messages to stderr; `--json` prints exactly one document on stdout, also when the
command fails. Only this module and the command modules talk.
"""

from __future__ import annotations

import contextlib
import functools
import json
import os
import sys
import tempfile
import traceback
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from identification.findings import Finding

DONE, FAILED, USAGE, REFUSED, DEFECT, INTERRUPTED = 0, 1, 2, 3, 70, 130
STATUS = {DONE: "ok", FAILED: "failed", REFUSED: "refused", DEFECT: "defect", INTERRUPTED: "interrupted"}
READABLE = click.Path(exists=True, dir_okay=False, readable=True, path_type=Path)
WRITABLE = click.Path(dir_okay=False, path_type=Path)
EXISTING = click.Path(exists=True, readable=True, path_type=Path)       # a file or a folder
PATH = click.Path(path_type=Path)
CONTEXT = {"help_option_names": ["-h", "--help"]}


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

    jobs: the command does several jobs and shows each by itself, with `--json` on one line.
    """

    command: str
    as_json: bool = False
    quiet: bool = False
    verbose: bool = False
    overwrite: bool = False
    jobs: bool = False
    inputs: list[Path] = field(default_factory=list)

    def say(self, text: str) -> None:
        """A message for the person at the terminal, on stderr."""
        if not self.quiet and not self.as_json:
            click.echo(text, err=True)


Body = Callable[..., Outcome]


def command(name: str, *, writes: bool = False) -> Callable[[Body], click.Command]:
    """A click command whose body takes `session` first and returns its `Outcome`; adds the common options."""

    def decorate(body: Body) -> click.Command:
        @functools.wraps(body)
        def run(as_json: bool, quiet: bool, verbose: bool, overwrite: bool = False, **arguments: Any) -> None:
            session = Session(name, as_json, quiet, verbose, overwrite)
            sys.exit(_show(session, *attempt(session, functools.partial(body, session, **arguments))))

        decorated: Any = run
        if writes:
            decorated = click.option("--force", "overwrite", is_flag=True, help="Overwrite files that exist.")(decorated)
        decorated = click.option("-v", "--verbose", is_flag=True, help="Every finding by itself, nothing folded.")(decorated)
        decorated = click.option("-q", "--quiet", is_flag=True, help="Only errors on stderr.")(decorated)
        decorated = click.option("--json", "as_json", is_flag=True, help="One JSON document on stdout.")(decorated)
        return click.command(name, context_settings=CONTEXT)(decorated)

    return decorate


def attempt(session: Session, body: Callable[[], Outcome]) -> tuple[Outcome, str, int]:
    """Runs the body: what it has to say, its status, its exit code. Nothing but a wrong call is raised."""
    from identification import files, progress
    from identification.findings import CompstiffError, Finding

    progress.shown.set(sys.stderr.isatty() and not session.quiet and not session.as_json)
    before = len(files.written)
    try:
        outcome = body()
    except CompstiffError as stopped:
        return Outcome(findings=stopped.findings), STATUS.get(stopped.exit_code, "failed"), stopped.exit_code
    except (KeyboardInterrupt, click.Abort):
        # The demo writes in several steps; every other command in one, its last.
        if len(files.written) > before and session.command != "demo" and not session.jobs:
            return Outcome(findings=(Finding("CS0011", "note", "interrupted after the output was complete"),)), "ok", DONE
        left = "the program under way was not written" if session.jobs else "nothing was written"
        return Outcome(findings=(Finding("CS0010", "error", f"interrupted; {left}"),)), "interrupted", INTERRUPTED
    except click.ClickException:
        raise
    except Exception as defect:
        return Outcome(findings=(_defect(session, defect),)), "defect", DEFECT
    return outcome, STATUS.get(outcome.exit_code, "failed"), outcome.exit_code


def _defect(session: Session, defect: Exception) -> Finding:
    """An unexpected exception as a finding, its traceback kept in a log file."""
    from identification.findings import Finding

    log = "(the log could not be written)"
    with contextlib.suppress(OSError):
        handle, log = tempfile.mkstemp(prefix="compstiff-", suffix=".log")
        with os.fdopen(handle, "w") as stream:
            stream.write(f"compstiff {session.command}, arguments {sys.argv[1:]}\n\n{traceback.format_exc()}")
    return Finding("CS0070", "error", f"a defect in compstiff: {type(defect).__name__}: {defect}",
                   hint=f"nothing was written; please report it with the log file {log}")


def document(session: Session, outcome: Outcome, status: str, code: int) -> dict[str, Any]:
    """What `--json` prints of one job (FORMATS.md, Exit codes)."""
    from identification.findings import fold

    findings = outcome.findings if session.verbose else fold(outcome.findings)
    return {
        "format": f"compstiff-{session.command}", "version": 1, "status": status, "exit_code": code,
        "findings": [finding.as_dict() for finding in findings],
        "inputs": _inputs(session.inputs), "result": outcome.result if outcome.result or code == DONE else None,
    }


def _show(session: Session, outcome: Outcome, status: str, code: int) -> int:
    from identification.findings import fold

    if session.as_json:
        if not session.jobs:
            click.echo(json.dumps(document(session, outcome, status, code), allow_nan=False, indent=1))
        elif code != outcome.exit_code:
            # The call as a whole ended before its jobs did: a line of its own says why.
            click.echo(json.dumps(document(session, outcome, status, code), allow_nan=False))
        return code
    for finding in outcome.findings if session.verbose else fold(outcome.findings):
        if finding.level == "error" or not session.quiet:
            click.echo(str(finding), err=True)
    for line in outcome.lines:
        click.echo(line)
    if outcome.next_step and not session.quiet:
        click.echo(f"next: {outcome.next_step}", err=True)
    return code


def _inputs(paths: Iterable[Path]) -> list[dict[str, str]]:
    from identification.files import sha256

    listed = []
    for path in paths:
        with contextlib.suppress(OSError):
            listed.append({"file": str(path), "sha256": sha256(path)})
    return listed


def main(group: click.Group) -> None:
    """Runs the command line; wrong calls exit 2, and with `--json` among the arguments they too print a document."""
    try:
        code = group.main(standalone_mode=False)
    except SystemExit as done:
        code = done.code
    except click.ClickException as wrong:
        code = USAGE
        if "--json" in sys.argv[1:]:
            from identification.findings import Finding

            _show(Session("call", as_json=True), Outcome(findings=(Finding("CS0002", "error", wrong.format_message()),)),
                  "failed", USAGE)
        else:
            wrong.show()
    except (KeyboardInterrupt, click.Abort):
        click.echo("interrupted", err=True)
        code = INTERRUPTED
    except BrokenPipeError:
        # The reader of stdout went away (`| head`): not a defect. Without this Python would complain when it flushes.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = DONE
    sys.exit(code)

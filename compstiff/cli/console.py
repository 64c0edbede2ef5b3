"""What every command does the same way: options, messages, `--json`, exit codes (docs/formats.md#commands).

Results go to stdout or the named file, messages to stderr; `--json` prints exactly one document on stdout, also when the
command fails. Only this module and the command modules talk.
"""

from __future__ import annotations

import functools
import json
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from compstiff.outcome import DONE, INTERRUPTED, USAGE, Outcome, Session, attempt, document

READABLE = click.Path(exists=True, dir_okay=False, readable=True, path_type=Path)
WRITABLE = click.Path(dir_okay=False, path_type=Path)
EXISTING = click.Path(exists=True, readable=True, path_type=Path)       # a file or a folder
PATH = click.Path(path_type=Path)
CONTEXT = {"help_option_names": ["-h", "--help"]}


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


def _show(session: Session, outcome: Outcome, status: str, code: int) -> int:
    from identification.common.findings import fold

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


def main(group: click.Group) -> None:
    """Runs the command line; wrong calls exit 2, and with `--json` among the arguments they too print a document."""
    try:
        code = group.main(standalone_mode=False)
    except SystemExit as done:
        code = done.code
    except click.ClickException as wrong:
        code = USAGE
        if "--json" in sys.argv[1:]:
            from identification.common.findings import Finding

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

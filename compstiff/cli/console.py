"""What every command does the same way: options, messages, `--json`, exit codes (docs/formats.md).

Results go to stdout or the named file, messages to stderr; `--json` prints exactly one document on stdout, also when the
command fails. Only this module and the command modules talk.
"""

from __future__ import annotations

import contextlib
import errno
import functools
import io
import json
import math
import os
import re
import shutil
import sys
import textwrap
from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal, TextIO

import click

from compstiff.outcome import DONE, INTERRUPTED, USAGE, Outcome, Session, attempt, document
from identification.common.files import AsRead, check_distinct


class Named(click.Path):
    """A path on the command line: an input, an output, or a folder to write in. either: a file to write, or for many programs a
    folder; what writes them checks that they are several."""

    def __init__(self, role: Literal["input", "output", "folder", "either"], *, path_type: type = Path, **named: Any) -> None:
        super().__init__(path_type=path_type, **named)
        self.role = role


READABLE = Named("input", exists=True, dir_okay=False, readable=True)
WRITABLE = Named("output", dir_okay=False)
EXISTING = Named("input", exists=True, readable=True)       # a file or a folder
PATH = Named("either")
TEXT_PATH = Named("either", path_type=str)                  # as typed: a slash at its end says folder
FOLDER = Named("folder", file_okay=False)
CONTEXT = {"help_option_names": ["-h", "--help"]}


Body = Callable[..., Outcome]
COMMON = "Common"


class HeadedOption(click.Option):
    """An option that stands under a heading in the help of its command."""

    def __init__(self, *arguments: Any, heading: str, **named: Any) -> None:
        super().__init__(*arguments, **named)
        self.heading = heading


class HeadedCommand(click.Command):
    """A command whose options stand under headings: those without one first, the common ones last. examples: calls to copy."""

    examples: tuple[str, ...] = ()

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Raises click.UsageError: as click, for numbers and words too many with what was meant in their place."""
        words = list(args)
        try:
            left = super().parse_args(ctx, args)
            self.check_finite(ctx)
            return left
        except click.BadParameter as wrong:
            if wrong.param is None or not (wrong.message.startswith("'") and "is not a valid" in wrong.message):
                raise
            raise click.BadParameter(number_expected(wrong.message.split("'")[1], wrong.param), ctx, wrong.param) from wrong
        except click.UsageError as wrong:
            if not wrong.message.startswith("Got unexpected extra argument"):
                raise
            raise click.UsageError(wrong.message + switch_with_value(words, self.params), ctx) from wrong

    def check_finite(self, ctx: click.Context) -> None:
        """Raises click.BadParameter for a number that is none: no bound of a range holds against NaN."""
        for parameter in self.params:
            wrong = next((value for value in _floats(ctx.params.get(parameter.name or "")) if not math.isfinite(value)), None)
            if wrong is not None and isinstance(parameter.type, click.types.FloatParamType):
                raise click.BadParameter(f"found '{wrong}', expected a finite number", ctx, parameter)

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        headed: dict[str, list[tuple[str, str]]] = {"Options": []}
        for parameter in self.get_params(ctx):
            record = parameter.get_help_record(ctx)
            if record and isinstance(parameter, click.Option):
                headed.setdefault(getattr(parameter, "heading", "Options"), []).append(record)
        common = headed.pop(COMMON, [])
        if len(headed) == 1:        # a short list needs no headings
            headed["Options"][:0] = common
        else:
            headed[COMMON] = [*common, headed["Options"].pop()]      # --help
        for heading, records in headed.items():
            with formatter.section(heading):
                formatter.write_dl(records)

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        if self.examples:
            with formatter.section("Examples"):
                for example in self.examples:
                    formatter.write(f"  {example}\n")


def _floats(value: Any) -> list[float]:
    """The floats in the value of a parameter, which may be a tuple of them, or of such tuples."""
    if isinstance(value, tuple):
        return [each for item in value for each in _floats(item)]
    return [value] if isinstance(value, float) else []


def number_expected(found: str, parameter: click.Parameter) -> str:
    """What is said of a word where a number stands: units are in the names of the options."""
    last = (parameter.name or "").rpartition("_")[2]
    unit = last if last in ("um", "mm", "deg") else ""
    kind = "a whole number" if isinstance(parameter.type, click.types.IntParamType) else "a number"
    bare = re.match(r"\s*([-+]?\d+(?:[.,]\d+)?)", found)
    alone = f", without its unit{f': it is in {unit}' if unit else ''}" if bare and bare[0].strip() != found.strip() else ""
    point = ", with a point for the decimals" if bare and "," in bare[0] else ""
    return f"found '{found}', expected {kind}{point}{alone}"


def switch_with_value(words: list[str], parameters: Sequence[click.Parameter]) -> str:
    """A hint where a value stands behind an option that takes none."""
    switches = {name for parameter in parameters if isinstance(parameter, click.Option) and parameter.is_flag
                for name in parameter.opts}
    return next((f" ('{value}' behind {name}, which takes no value)" for name, value in pairwise(words)
                 if name in switches and not value.startswith("-") and not Path(value).exists()), "")


def option(heading: str, *names: str, **named: Any) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """`click.option` under a heading."""
    return click.option(*names, cls=HeadedOption, heading=heading, **named)


def command(name: str, *, writes: bool = False, examples: tuple[str, ...] = ()) -> Callable[[Body], click.Command]:
    """A click command whose body takes `session` first and returns its `Outcome`; adds the common options."""

    def decorate(body: Body) -> click.Command:
        @functools.wraps(body)
        def run(as_json: bool, quiet: bool, verbose: bool, overwrite: bool = False, **arguments: Any) -> None:
            session = Session(name, as_json, quiet, verbose, overwrite)
            context = click.get_current_context()

            def checked() -> Outcome:
                session.read = AsRead.of(check_paths(context))
                outcome = body(session, **arguments)
                if as_json:             # what JSON cannot say is a defect, and told as one
                    json.dumps(outcome.result, allow_nan=False)
                return outcome

            sys.exit(_show(session, *attempt(session, checked)))

        decorated: Any = run
        if writes:
            decorated = option(COMMON, "--force", "overwrite", is_flag=True, help="Overwrite files that exist.")(decorated)
        decorated = option(COMMON, "-v", "--verbose", is_flag=True, help="Every finding by itself, nothing folded.")(decorated)
        decorated = option(COMMON, "-q", "--quiet", is_flag=True, help="Only errors on stderr.")(decorated)
        decorated = option(COMMON, "--json", "as_json", is_flag=True, help="One JSON document on stdout.")(decorated)
        headed = click.command(name, cls=HeadedCommand, context_settings=CONTEXT)(decorated)
        headed.examples = examples
        return headed

    return decorate


def check_paths(context: click.Context) -> list[Path]:
    """The paths that the call reads. Raises CompstiffError (CS0006) where two outputs of it are one file, or an output is one
    of its inputs."""
    values = context.params
    named = [pair for parameter in context.command.params for pair in _paths(parameter.type, values.get(parameter.name))]
    inputs = [path for role, path in named if role == "input"]
    check_distinct(inputs, [path for role, path in named if role == "output"])
    return inputs


def _paths(kind: click.ParamType[Any], value: Any) -> list[tuple[str, Path]]:
    """The paths in the value of a parameter, which may be a list or a tuple of several kinds, with their role."""
    if isinstance(value, tuple):
        kinds = kind.types if isinstance(kind, click.Tuple) else [kind] * len(value)
        return [pair for each, item in zip(kinds, value, strict=False) for pair in _paths(each, item)]
    return [(kind.role, value)] if isinstance(kind, Named) and isinstance(value, Path) else []


def _show(session: Session, outcome: Outcome, status: str, code: int) -> int:
    """Prints an outcome; the exit code is its own, whether somebody reads on to the end or not."""
    with readers_may_go():
        _print(session, outcome, status, code)
    return code


@contextlib.contextmanager
def readers_may_go() -> Iterator[None]:
    """The reader of stdout goes away (`| head`): not a defect. Without this Python would complain when it flushes."""
    try:
        yield
    except OSError as reason:
        # Windows says EINVAL where the reader has gone.
        if not (isinstance(reason, BrokenPipeError) or (os.name == "nt" and reason.errno == errno.EINVAL)):
            raise
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _print(session: Session, outcome: Outcome, status: str, code: int) -> None:
    from identification.common.findings import fold, printable

    if session.as_json:
        if not session.jobs:
            click.echo(json.dumps(document(session, outcome, status, code), allow_nan=False, indent=1))
        elif code != outcome.exit_code or outcome.findings:
            # The call as a whole ended before its jobs did: a line of its own says why.
            click.echo(json.dumps(document(session, outcome, status, code), allow_nan=False))
        return
    for finding in outcome.findings if session.verbose else fold(outcome.findings):
        if finding.level == "error" or not session.quiet:
            click.echo(_in_lines(str(finding), sys.stderr), err=True)
    for line in outcome.lines:
        click.echo(_in_lines(printable(line), sys.stdout))
    if outcome.next_step and not session.quiet:
        click.echo(f"next: {printable(outcome.next_step)}", err=True)


# A call of the command line with an option.
CALL = re.compile(r"compstiff \w+ .*?-")


def _in_lines(text: str, stream: TextIO) -> str:
    """On a terminal sentences go on in further lines between their words; tables (two blanks in a row), calls with options,
    which are copied whole, and all that is piped stay as they are."""
    if not stream.isatty():
        return text
    width, lines = shutil.get_terminal_size().columns, []
    for line in text.splitlines():
        words = line.lstrip()
        if "  " in words or CALL.search(words):
            lines.append(line)
        else:
            lines += textwrap.wrap(line, width, subsequent_indent=" " * (len(line) - len(words) + 2), break_long_words=False,
                                   break_on_hyphens=False) or [""]
    return "\n".join(lines)


def main(group: click.Group) -> None:
    """Runs the command line; wrong calls exit 2, and with `--json` among the arguments they too print a document."""
    for stream in (sys.stdout, sys.stderr):
        # What the terminal's code page does not have (cp1252 has no Greek) is written as its number, not refused.
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    code: str | int | None = DONE           # of a help text that nobody reads to its end
    try:
        with readers_may_go():
            code = group.main(prog_name="compstiff", standalone_mode=False)
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
    sys.exit(code)

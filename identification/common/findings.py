"""What the program has to say about its input: findings as data, and the one exception that carries them.

Library code never prints: it returns findings, or raises `CompstiffError` with those that stopped it.
`compstiff/cli/console.py` shows them. Every code has its page in `identification/common/catalogue.yaml`
(`compstiff explain CODE`).
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any, Literal

Level = Literal["error", "warning", "note"]


# What a terminal obeys in place of showing it, and what turns the direction of writing.
_CONTROL = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u202a-\u202e\u2066-\u2069]")


# Verbs that do not take an s behind one.
SINGULAR = {"are": "is", "were": "was", "have": "has", "do": "does", "go": "goes"}


def printable(text: str) -> str:
    """Text of a file or of its name for a terminal: control characters, but for line ends and tabs, as their numbers."""
    return _CONTROL.sub(lambda match: f"\\x{ord(match[0]):02x}" if ord(match[0]) < 256 else f"\\u{ord(match[0]):04x}", text)


def one_line(text: str) -> str:
    """Text of a file or of its name for a comment in a program: one line of printable ASCII, whatever stands in it."""
    return " ".join("".join(sign if " " <= sign <= "~" or sign.isspace() else "?" for sign in text).split())


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing worth saying, with the place it belongs to.

    code: "CSnnnn", a page of the catalogue. message: what was found, with the number and the limit or what was
    expected. hint: what to do. line and column count from 1; target counts from 0 (docs/formats.md#force-logs).
    count: how many places this finding stands for (`fold`); line, column and target are then the first one's.

    >>> print(compstiff.Finding("CS3003", "note", "12 samples, placed by target", file="part.forces.csv"))
    part.forces.csv: note CS3003: 12 samples, placed by target
    """

    code: str
    level: Level
    message: str
    file: str | None = None
    line: int | None = None
    column: int | None = None
    target: int | None = None
    hint: str = ""
    count: int = 1

    def __str__(self) -> str:
        place = printable(self.file or "").replace("\n", "\\n")
        if self.file is not None and self.line is not None:
            place += f":{self.line}" + (f":{self.column}" if self.column is not None else "")
        more = f" (and {self.count - 1} more like it)" if self.count > 1 else ""
        text = f"{place}{': ' if place else ''}{self.level} {self.code}: {printable(self.message)}{more}"
        return f"{text}\nhint: {printable(self.hint)}" if self.hint else text

    def as_dict(self) -> dict[str, Any]:
        """The finding as JSON values, all keys always there."""
        return asdict(self)


class CompstiffError(ValueError):
    """The job could not be done: bad content, no solution, file trouble (exit code 1).

    >>> try:
    ...     compstiff.read_cell("no_such_cell.yaml")
    ... except compstiff.CompstiffError as stopped:
    ...     print(stopped.findings[0].code)
    CS0005
    """

    exit_code = 1

    def __init__(self, *findings: Finding) -> None:
        if not findings:
            raise TypeError("CompstiffError needs at least one Finding")
        self.findings = findings
        super().__init__("\n".join(str(finding) for finding in findings))

    def beside(self, findings: Iterable[Finding]) -> CompstiffError:
        """The same, with the warnings that were noticed before: they may be the reason."""
        known = set(self.findings)
        return type(self)(*self.findings, *(one for one in findings if one.level == "warning" and one not in known))


class Refused(CompstiffError):
    """The job was done and the answer is no: a limit is exceeded, nothing was written (exit code 3)."""

    exit_code = 3


class Unconfirmed(CompstiffError):
    """The cell was not reachable, or did not confirm (exit code 4)."""

    exit_code = 4


class Interrupted(CompstiffError):
    """Ctrl-C while something was under way to a machine; the finding says what is there now (exit code 130)."""

    exit_code = 130


def error(
    code: str, message: str, *, file: str | None = None, line: int | None = None, column: int | None = None,
    target: int | None = None, hint: str = "",
) -> CompstiffError:
    """A `CompstiffError` with one finding."""
    return CompstiffError(Finding(code, "error", message, file=file, line=line, column=column, target=target, hint=hint))


def counted(number: int, noun: str, plural: str = "") -> str:
    """"1 sample", "2 samples"; with the verb "are": "1 sample is", "2 samples are"."""
    return f"{number} {noun if number == 1 else f'{noun}s'}{f' {verb(number, plural)}' if plural else ''}"


def verb(number: int, plural: str) -> str:
    """The verb that goes with a number: "is" or "are", "shows" or "show"."""
    return plural if number != 1 else SINGULAR.get(plural, f"{plural}s")


def fold(findings: list[Finding] | tuple[Finding, ...]) -> tuple[Finding, ...]:
    """Findings with the same code, level, file and message become one with their count, at the first one's place."""
    folded: dict[tuple[str, Level, str | None, str], Finding] = {}
    for finding in findings:
        key = (finding.code, finding.level, finding.file, finding.message)
        first = folded.get(key)
        if first is None:
            folded[key] = finding
        else:
            fields = {**asdict(first), "count": first.count + finding.count}
            folded[key] = Finding(**fields)
    return tuple(folded.values())

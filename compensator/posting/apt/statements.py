"""Statements of an APT file: continuation lines joined, comments taken off, every word with its place in the text."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from pathlib import Path

from identification.common.findings import CompstiffError, error

# Behind these words stands free text, which may hold dollar signs, slashes and commas.
LITERAL = ("PPRINT", "PARTNO", "INSERT", "REMARK", "DISPLY", "HEADER")
COMMENT = "$$"
# Creo's remarks, which alone of all comments go on in the next line where they end in "$".
_REMARK = "$$->"
# No coordinate, centre or radius of a part on a robot is beyond this [m].
FARTHEST = 100.0


class Statement:
    """One statement.

    word: the major word in upper case, "$$" for a comment line. text: what stands behind it (behind the slash if there is one).
    pieces: (offset in `text`, line, column) of each stretch of it, columns from 1; a statement may run over several lines.
    """

    __slots__ = ("column", "file", "line", "pieces", "text", "word")

    def __init__(self, file: str, word: str, text: str, line: int, column: int, pieces: list[tuple[int, int, int]]) -> None:
        self.file, self.word, self.text, self.line, self.column, self.pieces = file, word, text, line, column, pieces

    @property
    def arguments(self) -> list[str]:
        """What stands between the commas, blanks and case taken off; empty where nothing stands behind the word."""
        return [part.strip().upper() for part in self.text.split(",")] if self.text.strip() else []

    def numbers(self, first: int = 0, last: int | None = None) -> list[float]:
        """The arguments as finite numbers. Raises CompstiffError (CS2101) with the place of the one that is none."""
        values = []
        for index, word in enumerate(self.text.split(",")[first:last], first):
            try:
                value = float(word)
            except ValueError:
                value = math.nan
            if not math.isfinite(value) or "_" in word:
                shown = f"'{word.strip()}'" if word.strip() else "nothing"
                raise self.fail("CS2101", f"{self.word}: found {shown}, expected a number", index,
                                "cutter location data hold numbers only; the CAM system must work out names and geometry")
            values.append(value)
        return values

    def lengths(self, scale: float, first: int = 0, last: int | None = None) -> list[float]:
        """The arguments as lengths [m]; scale: metres in one unit of the file. Raises CompstiffError (CS2101), also for one
        that is out of all proportion."""
        values = [scale * value for value in self.numbers(first, last)]
        for index, value in enumerate(values, first):
            if abs(value) > FARTHEST:
                raise self.fail("CS2101", f"{self.word}: found {self.arguments[index]}, expected at most {FARTHEST:g} m", index,
                                "check the unit of the file (UNITS) and this number")
        return values

    def spelled(self) -> str:
        """The statement as written, in one line."""
        text = " ".join(self.text.split())
        return f"{self.word}/{text}" if text else self.word

    def place(self, argument: int | None = None) -> tuple[int, int]:
        """Line and column of an argument, from 0, or of the word."""
        if argument is None or not self.pieces:
            return self.line, self.column
        parts = self.text.split(",")
        argument = min(argument, len(parts) - 1)
        offset = sum(len(part) + 1 for part in parts[:argument])
        offset += len(parts[argument]) - len(parts[argument].lstrip())
        begin, line, column = next(piece for piece in reversed(self.pieces) if piece[0] <= offset or piece is self.pieces[0])
        return line, column + max(offset - begin, 0)

    def fail(self, code: str, message: str, argument: int | None = None, hint: str = "") -> CompstiffError:
        """The error `code` at an argument, or at the word, to be raised."""
        line, column = self.place(argument)
        return error(code, message, file=self.file, line=line, column=column, hint=hint)


def read_text(file: Path) -> str:
    """The file as text with plain line ends. Raises CompstiffError (CS0005, CS2100)."""
    try:
        data = file.read_bytes()
    except OSError as reason:
        raise error("CS0005", f"cannot be read: {reason.strerror}", file=str(file)) from reason
    if b"\0" in data[:4096]:
        raise error("CS2100", "found binary or UTF-16 data, expected APT as plain text", file=str(file), line=1, column=1,
                    hint="let the CAM system write the cutter location file as text (UTF-8 or ANSI)")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def statements(text: str, file: str) -> Iterator[Statement]:
    """The statements in order. Raises CompstiffError (CS2101) where the last one is continued into nothing."""
    open_line, remark = 0, False
    for number, raw in enumerate(text.split("\n"), 1):
        line = raw.strip().rstrip("\x1a")
        if not line:
            continue
        column = len(raw) - len(raw.lstrip()) + 1
        if not open_line:
            upper = line[:6].upper()
            if upper in LITERAL:
                yield Statement(file, upper, line[6:].lstrip().removeprefix("/").strip(), number, column, [])
                continue
            remark = line.startswith(_REMARK)
            if line.startswith(COMMENT) and not (remark and line.endswith("$")):
                yield Statement(file, COMMENT, line[2:].strip(), number, column, [])
                continue
        comment = line.find(COMMENT)
        if comment >= 0 and not remark:
            line = line[:comment].rstrip()
        goes_on = line.endswith("$")
        if goes_on:
            line = line[:-1].rstrip()
        if not open_line:
            joined, pieces, begin = line, [(0, number, column)], (number, column)
        else:
            # A comma may stand at the end of the line, at the start of the next one, or be left out between two numbers.
            comma = "" if not line or joined.endswith((",", "/", "(")) or line.startswith((",", ")")) else ","
            joined += comma
            pieces.append((len(joined), number, column))
            joined += line
        open_line = number if goes_on else 0
        if not goes_on and joined:
            if remark:
                yield Statement(file, COMMENT, joined[2:].strip(), *begin, [])
                remark = False
            else:
                yield _split(file, joined, pieces, begin)
    if open_line:
        raise error("CS2101", "the statement goes on ('$' at its end), found the end of the file, expected the rest of it",
                    file=file, line=open_line, hint="the file may have been cut off; write it again from the CAM system")


def _split(file: str, joined: str, pieces: list[tuple[int, int, int]], begin: tuple[int, int]) -> Statement:
    word, slash, rest = joined.partition("/")
    shift = len(word) + len(slash)
    name = word.strip().upper()
    if " " in name or "\t" in name:
        name = re.sub(r"\s*,\s*", ",", " ".join(name.split()))
        first, _, last = name.partition(" ")
        if first.removeprefix("N").isdigit():       # a sequence number before the word
            name = last
    return Statement(file, name, rest, *begin, [(at - shift, line, column) for at, line, column in pieces])

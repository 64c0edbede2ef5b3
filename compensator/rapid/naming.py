"""Declarations added beside the one of a target that needs several corrections."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from compensator.rapid.lexer import NAME
from compensator.rapid.scopes import Declaration
from compensator.rapid.text import Source

LONGEST_NAME = 32

_NAME = re.compile(NAME)
_REST_OF_LINE = re.compile(rb"[ \t]*+(?:![^\r\n]*+)?+(?=\r|\n|\Z)")
_LINE_END = re.compile(rb"\r\r\n|\r\n|\n|\r|\Z")
_INDENT = re.compile(rb"[ \t]*+")
_DECLARED = re.compile(rb"(?i)robtarget(?:[\s\x1a]++|![^\r\n]*+)++(" + NAME + rb")")


@dataclass(slots=True)
class NewNames:
    """Identifiers that stand nowhere in the program yet."""

    source: Source
    _taken: set[str] = field(default_factory=set)

    def make(self, stem: str) -> str:
        """A name that begins like `stem`, at most 32 characters, different from every other whatever the case."""
        if not self._taken:
            words = {match[0] for match in _NAME.finditer(self.source.data, self.source.start)}
            self._taken = {self.source.fold(word) for word in words}
        number = 1
        while True:
            suffix = f"_c{number}"
            name = stem[:LONGEST_NAME - len(suffix)] + suffix
            if name.lower() not in self._taken:
                self._taken.add(name.lower())
                return name
            number += 1


def declared_name(source: Source, declaration: Declaration) -> str:
    """The name as the declaration spells it."""
    match = _DECLARED.search(source.data, declaration.start, declaration.end)
    return source.text(*match.span(1)) if match else declaration.name


def place_for(source: Source, declaration: Declaration) -> tuple[int, bytes]:
    """Offset behind a declaration where another one goes, and what goes before it: line end and indent, or a blank where
    the line goes on with another statement."""
    data = source.data
    rest = _REST_OF_LINE.match(data, declaration.end)
    if rest is None:
        return declaration.end, b" "
    line = int(source.ends.searchsorted(declaration.start, side="right"))
    start = source.start if line == 0 else int(source.ends[line - 1])
    indent = _INDENT.match(data, start)
    line_end = _LINE_END.match(data, rest.end())
    end = line_end[0] if line_end else b""
    if not end and len(source.ends):                    # the last line of a file without a final line end
        last = int(source.ends[-1])
        end = next(e for e in (b"\r\r\n", b"\r\n", b"\n", b"\r") if data[:last].endswith(e))
    return rest.end(), (end or b"\n") + (indent[0] if indent else b"")

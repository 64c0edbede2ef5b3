"""What the files beside a program hold of it: routines that it calls and that drive, so that they are on its way and not in its
text, and data that it names."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from pathlib import Path

from compensator.posting.suffixes import RAPID_SUFFIXES
from compensator.rapid import JOINED

# So much of the files beside a program is looked through [bytes], and so many of them: a folder may hold a night's programs.
MOST_BYTES, MOST_FILES = 64 << 20, 200
# Of text in lower case.
_PROC = re.compile(rb"(?<!end)\bproc[ \t]+([\w\x80-\xff]+)")
_INSTRUCTION = rb"(?:move(?:[ljc](?:do|ao|go|sync)?|absj)|trigg(?:[ljc]|absj)|search[lc])(?![\w\x80-\xff])"
_DRIVES = re.compile(rb"(?m)(?:^|;)[ \t]*" + _INSTRUCTION)
# Behind IF, THEN, DO, a label or a CASE: asked of text without comments and strings, but for the name in a call by name.
_DRIVES_THERE = re.compile(rb"(?<![\w\x80-\xff.\\])" + _INSTRUCTION)
_NO_CODE = re.compile(rb'(%"[^"\r\n]*"%)|"[^"\r\n]*"|![^\r\n]*')
_ROUTINES = re.compile(rb"(?ms)(?:^|;)[ \t]*(?:local[ \t]+)?(proc|func|trap)\b.*?\bend\1\b")
_DATA = re.compile(rb"(?m)(?:^|;)[ \t]*(?:task[ \t]+)?(?:const|pers|var)[ \t]+[\w\x80-\xff]+[ \t]+([\w\x80-\xff]+)")
_MAIN = re.compile(rb"(?m)^[ \t]*(?:local[ \t]+)?proc[ \t]+main\b")
_WORDS = re.compile(rb"[\w\x80-\xff]+")


def driving_beside(file: Path, called: Iterable[str]) -> dict[str, str]:
    """Which of the routines `called` (in lower case) a RAPID file beside `file` holds and drives in: its name and that file's.
    A file that cannot be read holds none."""
    wanted = set(called)
    if not wanted:
        return {}
    # A routine stands most often in the file of its name.
    holds, drives = dict[str, str](), set[str]()
    calls: dict[str, set[str]] = {}
    for name_of_file, data in _beside(file, wanted):
        for match in _PROC.finditer(data):
            name = match[1].decode("utf-8", errors="replace")
            if name in holds:
                continue
            holds[name] = name_of_file
            body = data[match.end():max(data.find(b"endproc", match.end()), match.end())]
            if _DRIVES.search(body) or _DRIVES_THERE.search(body := _NO_CODE.sub(rb" \1 ", body)):
                drives.add(name)
            else:           # what else it names, but for its own data, may be a routine
                calls[name] = {word.decode("utf-8", errors="replace")
                               for word in {*_WORDS.findall(body)} - {*_DATA.findall(body)}}
    grown = True
    while grown:
        more = {name for name, others in calls.items() if others & drives} - drives
        drives |= more
        grown = bool(more)
    return {name: holds[name] for name in sorted(wanted & drives)}


def declared_beside(file: Path, names: Iterable[str]) -> dict[str, frozenset[str]]:
    """Which of the data `names` (in lower case) each RAPID file beside `file` declares for all modules, by that file's name. A
    file that cannot be read declares none."""
    wanted = set(names)
    return {name: found for name, data in _other_modules(file) if (found := frozenset(_declared(data) & wanted))}


def users_beside(file: Path) -> list[str]:
    """The RAPID files beside `file` that name data or a routine which it holds and they do not."""
    own = _held(_text(file))
    return [name for name, other in _other_modules(file)
            if (own - _held(other)) & {word.decode("utf-8", errors="replace") for word in _WORDS.findall(other)}]


def _other_modules(file: Path) -> Iterator[tuple[str, bytes]]:
    """As `_beside`, without what may not be of one job with `file`: joined modules, and a second one with the routine main."""
    main = _MAIN.search(_text(file)) is not None
    return ((name, data) for name, data in _beside(file, set())
            if JOINED.lower() not in data and not (main and _MAIN.search(data)))


def _text(file: Path) -> bytes:
    """A file in lower case; empty where it cannot be read."""
    try:
        return file.read_bytes().lower()
    except OSError:
        return b""


def _held(data: bytes) -> set[str]:
    """The data and routines of a module, whose text is in lower case."""
    return _declared(data) | {match[1].decode("utf-8", errors="replace") for match in _PROC.finditer(data)}


def _declared(data: bytes) -> set[str]:
    """The data that a module, whose text is in lower case, declares for all: not those LOCAL to it or to a routine."""
    return {match[1].decode("utf-8", errors="replace") for match in _DATA.finditer(_ROUTINES.sub(b"", data))}


def _beside(file: Path, first: set[str]) -> Iterator[tuple[str, bytes]]:
    """Name and text, in lower case, of the RAPID files beside `file`, those first whose names without suffix are `first`."""
    try:
        beside = sorted((path for path in file.parent.iterdir() if path.suffix.lower() in RAPID_SUFFIXES
                         and not path.name.startswith(".") and path.name != file.name and path.is_file()),
                        key=lambda path: (path.stem.lower() not in first, path.name))
        sizes = {path: path.stat().st_size for path in beside[:MOST_FILES]}
    except OSError:
        return
    left = MOST_BYTES
    for path, size in sizes.items():
        left -= size
        if left < 0:
            return
        yield path.name, _text(path)

"""Routines that the files beside a program hold and that drive: what it calls of these is on its way and not in its text."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

from compensator.posting.suffixes import RAPID_SUFFIXES

# So much of the files beside a program is looked through [bytes], and so many of them: a folder may hold a night's programs.
MOST_BYTES, MOST_FILES = 64 << 20, 200
# Of text in lower case.
_PROC = re.compile(rb"(?<!end)\bproc[ \t]+([\w\x80-\xff]+)")
_DRIVES = re.compile(rb"(?m)(?:^|;)[ \t]*(?:move(?:[ljc](?:do|ao|go|sync)?|absj)|trigg(?:[ljc]|absj)|search[lc])\b")
_CALLS = re.compile(rb"(?m)(?:^|;)[ \t]*([\w\x80-\xff]+)[^;:=\r\n]*;")


def driving_beside(file: Path, called: Iterable[str]) -> dict[str, str]:
    """Which of the routines `called` (in lower case) a RAPID file beside `file` holds and drives in: its name and that file's.
    A file that cannot be read holds none."""
    wanted = set(called)
    if not wanted:
        return {}
    try:
        beside = sorted(path for path in file.parent.iterdir() if path.suffix.lower() in RAPID_SUFFIXES
                        and not path.name.startswith(".") and path.name != file.name and path.is_file())
        sizes = {path: path.stat().st_size for path in beside[:MOST_FILES]}
    except OSError:
        return {}
    # A routine stands most often in the file of its name.
    left, holds, drives = MOST_BYTES, dict[str, str](), set[str]()
    calls: dict[str, set[str]] = {}
    for path in sorted(sizes, key=lambda path: (path.stem.lower() not in wanted, path.name)):
        left -= sizes[path]
        if left < 0:
            break
        try:
            data = path.read_bytes().lower()
        except OSError:
            continue
        for match in _PROC.finditer(data):
            name = match[1].decode("utf-8", errors="replace")
            if name in holds:
                continue
            holds[name] = path.name
            body = data[match.end():max(data.find(b"endproc", match.end()), match.end())]
            if _DRIVES.search(body):
                drives.add(name)
            else:
                calls[name] = {word.decode("utf-8", errors="replace") for word in _CALLS.findall(body)}
    grown = True
    while grown:
        more = {name for name, others in calls.items() if others & drives} - drives
        drives |= more
        grown = bool(more)
    return {name: holds[name] for name in sorted(wanted & drives)}

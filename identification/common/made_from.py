"""Files that an output was made from and that are others now: the output is of an earlier run."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from identification.common.files import sha256
from identification.common.findings import Finding

# What of a record decides the correction, and is not written over by a later pass as its log is.
DECIDE = ("input", "stiffness")
# A stiffness file is some kilobytes; what is larger is none, and not looked into.
LARGEST_STIFFNESS_FILE = 16 << 20
RECORD, LARGEST_RECORD = "compstiff-correction", 64 << 20
# Files that one copy or one batch wrote differ by less [s].
LATER_S = 2.0


def said_of_changes(record: dict[str, Any], folder: Path, output: Path, program: Path | None = None) -> tuple[Finding, ...]:
    """A warning (CS4205) where the program or the stiffness file that `record` names stand in `folder` with another content, or
    `program`, where it has the name of the first, has; else what `said_of_tables` says of that stiffness file."""
    changed: list[str] = []
    of_tables: tuple[Finding, ...] = ()
    for key in DECIDE:
        named = record.get(key)
        if not isinstance(named, dict) or not isinstance(named.get("file"), str):
            continue
        beside = folder / Path(named["file"]).name
        file = program if key == "input" and program is not None and program.name == beside.name else beside
        if not os.path.isfile(file):                # where Path.is_file raises for a name that is too long
            continue
        if sha256(file) != named.get("sha256"):
            changed.append(file.name)
        elif key == "stiffness":
            of_tables = said_of_tables(file, _tables_of(file))
    if not changed:
        return of_tables
    what = f"{changed[0]} was changed since this was worked out from it"
    if len(changed) > 1:
        what = f"{' and '.join(changed)} were changed since this was worked out from them"
    return (Finding("CS4205", "warning", what, file=str(output),
                    hint="correct again; right where nothing but a comment was changed"), *of_tables)


def said_of_later(record: Path, output: Path) -> tuple[Finding, ...]:
    """A warning (CS4206) where a correction of the same program was made after that of `record`: another record beside it that
    took the log of the pass with these offsets, or, made from the same program, was written later."""
    own = _record(record)
    if own is None:
        return ()
    for path in sorted(record.parent.glob("*.json")):
        other = _record(path)
        if path == record or other is None or _digest(other, "input") != _digest(own, "input") or (
                _digest(other, "output") == _digest(own, "output")):
            continue
        of_this_pass = _digest(own, "offsets") is not None and _digest(other, "logged_with") == _digest(own, "offsets")
        if of_this_pass or path.stat().st_mtime > record.stat().st_mtime + LATER_S:
            name, of = other["output"]["file"], other["input"]["file"]
            return (Finding("CS4206", "warning", f"is the earlier of two corrections of {of}: {name} was "
                            + ("made from the log of the pass with it" if of_this_pass else "written later"), file=str(output),
                            hint=f"is {name} (record {path.name}) meant?"),)
    return ()


def _record(file: Path) -> dict[str, Any] | None:
    """The record of a correction; None where the file is none."""
    try:
        content = json.loads(file.read_bytes()) if file.stat().st_size <= LARGEST_RECORD else None
    except (OSError, ValueError, RecursionError):
        return None
    whole = isinstance(content, dict) and content.get("format") == RECORD and all(
        isinstance(content.get(key), dict) and isinstance(content[key].get("file"), str) for key in ("input", "output"))
    return content if whole else None


def _digest(record: dict[str, Any], key: str) -> str | None:
    """SHA-256 of what a record names so; None where it names none."""
    named = record.get(key)
    return named.get("sha256") if isinstance(named, dict) else None


def said_of_tables(stiffness: Path | None, made_from: Sequence[dict[str, str]]) -> tuple[Finding, ...]:
    """A warning (CS1205) where tables that a stiffness file was identified from stand beside it with another content.
    made_from: their names and SHA-256, as the file has them; a table that stands elsewhere is not looked for."""
    changed = [] if stiffness is None else [
        beside.name for table in made_from
        if os.path.isfile(beside := stiffness.parent / Path(table["file"]).name) and sha256(beside) != table["sha256"]]
    if not changed:
        return ()
    what = f"{' and '.join(changed)} {'was' if len(changed) == 1 else 'were'} changed since these stiffnesses were identified"
    return (Finding("CS1205", "warning", what, file=str(stiffness),
                    hint="identify again, or diagnose --extended; right where nothing but a comment was changed"),)


def _tables_of(stiffness: Path) -> list[dict[str, str]]:
    """What a stiffness file says that it was identified from; nothing where it says nothing of it that can be read."""
    try:
        content = json.loads(stiffness.read_bytes()) if stiffness.stat().st_size <= LARGEST_STIFFNESS_FILE else None
    except (OSError, ValueError, RecursionError):
        return []
    tables = content.get("made_from") if isinstance(content, dict) else None
    return [table for table in (tables if isinstance(tables, list) else []) if isinstance(table, dict)
            and isinstance(table.get("file"), str) and isinstance(table.get("sha256"), str)]

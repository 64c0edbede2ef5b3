"""What the records of corrections say that stand in a folder: nothing is corrected twice, offsets are those that were written,
and what they were made from is as it was."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from identification.common.files import sha256
from identification.common.findings import Finding, Refused
from identification.common.made_from import RECORD, said_of_changes, said_of_later


def check_as_written(offsets: Path, digest: str, program: Path | None = None) -> None:
    """Refused (CS5026) where records name an offsets file, and none has its content's SHA-256, `digest`: those beside it, and
    those beside the planned program or in the working folder that were made from this program."""
    named = _naming(offsets, program)
    if named and all(_of_offsets(path).get("sha256") != digest for path in named):
        raise Refused(Finding("CS5026", "error", f"was changed after correct wrote it (record {named[-1].name})",
                              file=str(offsets), hint="nothing was sent; write it again with correct --offsets, or give a file "
                              "that was changed on purpose another name"))


def _naming(offsets: Path, program: Path | None) -> list[Path]:
    """The records that name an offsets file so: those beside it, and those beside the planned program or in the working folder
    that were made from this program."""
    paths = sorted(offsets.parent.glob("*.json"))
    if program is not None:
        source = sha256(program)
        folders = {folder.resolve() for folder in (program.parent, Path.cwd())} - {offsets.parent.resolve()}
        paths += [path for folder in sorted(folders) for path in sorted(folder.glob("*.json"))
                  if (made := _recorded(path)) is not None and made[0][1] == source]
    return [path for path in paths if _of_offsets(path).get("file") == offsets.name]


def said_of_offsets(offsets: Path, program: Path | None, robot: str, *, sent: bool = False) -> tuple[Finding, ...]:
    """Warnings on offsets that a record beside them wrote: what they were made from was changed since (CS4205), or they were
    (CS4129, of those of a logged pass); sent: they go to the robot now, and later ones stand beside them (CS4206). Raises
    Refused (CS5028) where the robot of the record is another than `robot`."""
    named, digest = _naming(offsets, program), sha256(offsets)
    own = [path for path in named if _of_offsets(path).get("sha256") == digest]
    if not named:
        return ()
    if not own:
        return (Finding("CS4129", "warning", f"was changed after correct wrote it (record {named[-1].name})", file=str(offsets),
                        hint="the pass had the offsets that were written: name that file, under whatever name it was kept"),)
    record = _content(own[-1]) or {}
    there = record.get("robot")
    if isinstance(there, dict) and there.get("name", robot) != robot:
        raise Refused(Finding("CS5028", "error", f"was worked out for the robot '{there['name']}', the cell has '{robot}'",
                              file=str(offsets), hint="give the cell.yaml it was corrected with"))
    later = said_of_later(own[-1], offsets) if sent else ()
    return (*later, *said_of_changes(record, own[-1].parent, offsets, program))


def _of_offsets(file: Path) -> dict[str, Any]:
    """Name and SHA-256 of the offsets that a correction record says were written; empty where it says none."""
    written = (_content(file) or {}).get("offsets")
    return written if isinstance(written, dict) else {}


def check_not_corrected(toolpath: Path, *folders: Path) -> None:
    """Refused (CS4204) where a record in the toolpath's folder names this file, or its content, as an output, or where one in
    `folders` names its content."""
    found = written_by(toolpath, *folders)
    if found is not None:
        record, source = found
        raise Refused(Finding("CS4204", "error", f"is the output of an earlier correction (record {record}); nothing is "
                              "corrected twice", file=str(toolpath),
                              hint=f"correct the CAM system's program {source}; --correct-again if this really is one"))


def written_by(toolpath: Path, *folders: Path) -> tuple[str, str] | None:
    """The record that names a program as what `correct` wrote, and the program that it was made from; None: there is none."""
    digest = sha256(toolpath)
    for path in (record for folder in (toolpath.parent, *folders) for record in sorted(folder.glob("*.json"))):
        names = _recorded(path)
        if names is None:
            continue
        (source, _), *outputs = names
        beside = path.parent == toolpath.parent
        if any(output_digest == digest or (beside and output == toolpath.name) for output, output_digest in outputs):
            return path.name, source
    return None


def _content(file: Path) -> dict[str, Any] | None:
    """A correction record; None where the file is none."""
    try:
        if file.stat().st_size > 64 << 20:
            return None
        record = json.loads(file.read_bytes())
    except (OSError, ValueError, RecursionError):
        return None
    return record if isinstance(record, dict) and record.get("format") == RECORD else None


def _recorded(file: Path) -> list[tuple[str, str]] | None:
    """Name and SHA-256 of the input, the output and its parts of a correction record; None where the file is no such record."""
    record = _content(file)
    if record is None:
        return None
    source, output = record.get("input"), record.get("output")
    if not (isinstance(source, dict) and isinstance(output, dict)):
        return None
    parts = record.get("parts")
    items = [source, output, *(part for part in (parts if isinstance(parts, list) else []) if isinstance(part, dict))]
    return [(str(item.get("file", "")), str(item.get("sha256", ""))) for item in items]

"""OUT.mod.json: what a corrected program was made from, and that nothing is corrected twice."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from compensator.correction.correct import Corrected
from compensator.correction.offsets import offset_blocks
from compensator.cutting.stock_file import named_by
from identification.common.files import sha256
from identification.common.findings import Finding, Refused, fold

RECORD = "compstiff-correction"


def record(corrected: Corrected, files: dict[Path, bytes], offsets: Path | None = None) -> dict[str, Any]:
    """What was made from what, JSON values. files: the program, and its parts where it was split; offsets: where those of
    this correction are written."""
    predicted = corrected.predicted
    outputs = [{"file": path.name, "sha256": hashlib.sha256(content).hexdigest()} for path, content in files.items()]
    return {
        "format": RECORD, "version": 1, "compstiff": version("compstiff"), "numpy": np.__version__,
        "input": _named(predicted.program.source),
        "output": outputs[0],
        "parts": outputs[1:],
        "offsets": {"file": offsets.name, "sha256": _digest(offset_blocks(corrected))} if offsets else None,
        "stiffness": _named(predicted.model.source),
        "cell": _named(predicted.cell.source),
        "forces": _named(Path(predicted.forces.log.source)),
        **{name: _named(file) for name, file in predicted.settings.files()},
        **_blank(predicted.settings.cutting.stock),
        "settings": predicted.settings.as_dict(),
        "robot": {"name": predicted.cell.robot.name, "sha256": predicted.cell.robot.sha256},
        "summary": corrected.as_dict(),
        "findings": [finding.as_dict() | {"file": Path(finding.file).name if finding.file else None}
                     for finding in fold(corrected.findings)],
    }


def _named(file: Path | None) -> dict[str, str] | None:
    """A file by its name and content; None where a script gave the value itself."""
    return None if file is None else {"file": file.name, "sha256": sha256(file)}


def _blank(stock: Path | None) -> dict[str, Any]:
    """The file that the stock file names, under `blank`."""
    named = named_by(stock) if stock else ()
    return {"blank": _named(named[0])} if named else {}


def _digest(blocks: Iterable[bytes]) -> str:
    digest = hashlib.sha256()
    for block in blocks:
        digest.update(block)
    return digest.hexdigest()


def check_as_written(offsets: Path, digest: str, program: Path | None = None) -> None:
    """Refused (CS5026) where records name an offsets file, and none has its content's SHA-256, `digest`: those beside it, and
    those beside the planned program or in the working folder that were made from this program."""
    names = [(path.name, _of_offsets(path)) for path in sorted(offsets.parent.glob("*.json"))]
    if program is not None:
        source = sha256(program)
        folders = {folder.resolve() for folder in (program.parent, Path.cwd())} - {offsets.parent.resolve()}
        names += [(path.name, _of_offsets(path)) for folder in sorted(folders) for path in sorted(folder.glob("*.json"))
                  if (made := _recorded(path)) is not None and made[0][1] == source]
    named = [(name, written) for name, written in names if written.get("file") == offsets.name]
    if named and all(written.get("sha256") != digest for _, written in named):
        raise Refused(Finding("CS5026", "error", f"was changed after correct wrote it (record {named[-1][0]})",
                              file=str(offsets), hint="nothing was sent; write it again with correct --offsets, or give a file "
                              "that was changed on purpose another name"))


def _of_offsets(file: Path) -> dict[str, Any]:
    """Name and SHA-256 of the offsets that a correction record says were written; empty where it says none."""
    written = (_content(file) or {}).get("offsets")
    return written if isinstance(written, dict) else {}


def check_not_corrected(toolpath: Path, *folders: Path) -> None:
    """Refused (CS4204) where a record in the toolpath's folder names this file, or its content, as an output, or where one in
    `folders` names its content."""
    digest = sha256(toolpath)
    for path in (record for folder in (toolpath.parent, *folders) for record in sorted(folder.glob("*.json"))):
        names = _recorded(path)
        if names is None:
            continue
        (source, _), *outputs = names
        beside = path.parent == toolpath.parent
        if any(output_digest == digest or (beside and output == toolpath.name) for output, output_digest in outputs):
            raise Refused(Finding("CS4204", "error", f"is the output of an earlier correction (record {path.name}); nothing is "
                                  "corrected twice", file=str(toolpath),
                                  hint=f"correct the CAM system's program {source}; --correct-again if this really is one"))


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

"""The RAPID module that goes to the controller: its bytes, its name, and the record of the correction beside it."""

from __future__ import annotations

import hashlib
import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from compensator.upload.session import MOST_BYTES
from identification.common.findings import Finding, Refused, error

SUFFIXES = (".mod", ".modx", ".sys", ".sysx")
RECORD = "compstiff-correction"
_MODULE = re.compile(rb"^[ \t]*MODULE[ \t]+([A-Za-z][A-Za-z0-9_]*)", re.MULTILINE | re.IGNORECASE)
_END = re.compile(rb"^[ \t]*ENDMODULE\b", re.MULTILINE | re.IGNORECASE)
_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_-]*\.(mod|modx|sys|sysx)", re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class LocalModule:
    """name: the module's, as RAPID knows it. record: what `correct` wrote of this very content, None where there is none."""

    file: Path
    content: bytes
    sha256: str
    name: str
    record: dict[str, Any] | None
    findings: tuple[Finding, ...]

    @property
    def stem(self) -> str:
        """The file's stem, in letters a controller's file system certainly has."""
        return re.sub(r"[^A-Za-z0-9_-]", "_", self.file.stem)[:40].lstrip("-") or "_"

    @property
    def new_name(self) -> str:
        """A name that belongs to this content: no other content is ever given it."""
        return f"{self.stem}-{self.sha256[:10]}{self.file.suffix.lower()}"

    def as_dict(self) -> dict[str, Any]:
        """JSON values."""
        return {"file": str(self.file), "module": self.name, "bytes": len(self.content), "sha256": self.sha256,
                "record": None if self.record is None else _summary(self.record)}

    def lines(self) -> list[str]:
        """What the terminal shows."""
        shown = [f"module: {self.name}, {len(self.content)} bytes, SHA-256 {self.sha256[:16]}..."]
        if self.record is not None:
            summary = _summary(self.record)
            shown.append(f"record: corrected from {summary['input']} with {summary['stiffness']} and {summary['forces']}, "
                         f"robot {summary['robot']}, largest offset {summary['largest_offset_mm']} mm")
        return shown


def read_module(file: Path, robot: str, *, changed: bool = False) -> LocalModule:
    """Reads a module and the record beside it (FILE.json).

    changed: takes one that differs from its record. Raises CompstiffError: CS0005 unreadable, CS6100 not one module, too large
    or of another suffix; Refused: CS6101 it was changed since it was corrected, CS6103 it was corrected for another robot.
    """
    try:
        if file.stat().st_size > MOST_BYTES:
            raise error("CS6100", f"is larger than {MOST_BYTES >> 20} MiB", file=str(file), hint="correct --split makes parts")
        content = file.read_bytes()
    except OSError as reason:
        raise error("CS0005", f"cannot be read: {reason.strerror}", file=str(file)) from reason
    names = _MODULE.findall(content)
    if file.suffix.lower() not in SUFFIXES or len(names) != 1 or len(_END.findall(content)) != 1:
        raise error("CS6100", f"is not one whole RAPID module in a file *{', *'.join(SUFFIXES)} ({len(names)} MODULE, "
                    f"{len(_END.findall(content))} ENDMODULE)", file=str(file), hint="upload one module a call")
    digest = hashlib.sha256(content).hexdigest()
    record, findings = _record(file, digest, robot, changed)
    return LocalModule(file, content, digest, names[0].decode("ascii"), record, findings)


def check_name(name: str) -> str:
    """A file name for the controller. Raises CompstiffError (CS6100)."""
    if not _NAME.fullmatch(name) or len(name) > 64:
        raise error("CS6100", f"'{name}' is no name for a module's file on a controller: letters, digits, _ and -, then "
                    f"{' or '.join(SUFFIXES)}, 64 at most")
    return name


def _record(file: Path, digest: str, robot: str, changed: bool) -> tuple[dict[str, Any] | None, tuple[Finding, ...]]:
    path = file.with_name(f"{file.name}.json")
    record = _read_record(path)
    if record is None:
        return None, (Finding("CS6102", "warning", f"has no record of a correction beside it ({path.name})", file=str(file),
                              hint="right for a first pass; a corrected program keeps its record beside it"),)
    outputs = [record["output"], *(part for part in record.get("parts") or [] if isinstance(part, dict))]
    if not any(output.get("sha256") == digest for output in outputs):
        difference = Finding("CS6101", "warning" if changed else "error", f"is not what its record {path.name} says: it was "
                             "changed since it was corrected", file=str(file),
                             hint="" if changed else "correct it again, or --changed where it was changed on purpose")
        if not changed:
            raise Refused(difference)
        return record, (difference,)
    corrected_for = str((record.get("robot") or {}).get("name", ""))
    if corrected_for != robot:
        raise Refused(Finding("CS6103", "error", f"was corrected for the robot '{corrected_for}', the cell has '{robot}'",
                              file=str(file), hint="give the cell.yaml it was corrected with"))
    return record, ()


def _read_record(path: Path) -> dict[str, Any] | None:
    """The record, None where there is none, or another file has that name."""
    try:
        if path.stat().st_size > MOST_BYTES:
            return None
        record = json.loads(path.read_bytes())
    except (OSError, ValueError, RecursionError):
        return None
    sound = isinstance(record, dict) and record.get("format") == RECORD and isinstance(record.get("output"), dict)
    return record if sound else None


def _summary(record: dict[str, Any]) -> dict[str, Any]:
    def file(of: str) -> str | None:
        named = record.get(of)
        return named.get("file") if isinstance(named, dict) else None

    summary = record.get("summary") if isinstance(record.get("summary"), dict) else {}
    robot = record.get("robot")
    return {"input": file("input"), "stiffness": file("stiffness"), "forces": file("forces"), "cell": file("cell"),
            "robot": robot.get("name") if isinstance(robot, dict) else None, "compstiff": record.get("compstiff"),
            "largest_offset_mm": (summary or {}).get("largest_offset_mm")}

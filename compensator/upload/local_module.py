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
from identification.common.made_from import RECORD, said_of_changes, said_of_later

SUFFIXES = (".mod", ".modx", ".sys", ".sysx")
_MODULE = re.compile(rb"^[ \t]*MODULE[ \t]+([A-Za-z][A-Za-z0-9_]*)", re.MULTILINE | re.IGNORECASE)
_END = re.compile(rb"^[ \t]*ENDMODULE\b", re.MULTILINE | re.IGNORECASE)
# A folder that stands in a variable is not known here.
_LOAD = re.compile(rb'^[ \t]*(?:Start)?Load[ \t]*(?:\\Dynamic[ \t]*)?,?[ \t]*(?:"([^"\r\n]+)"|[a-z][a-z0-9_]*)'
                   rb'(?:[ \t]*\\File[ \t]*:=[ \t]*"([^"\r\n]+)")?', re.MULTILINE | re.IGNORECASE)
_PART = re.compile(r"_[0-9]{3,}$")
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

    def loads(self, folder: str, name: str) -> tuple[Finding, ...]:
        """A warning (CS6125) where this module loads others at run time, or is itself loaded so by another name or from another
        folder than it is to have on the controller."""
        others = [place for place in _loaded(self.content) if place.rpartition("/")[2].lower() != self.file.name.lower()]
        if others:
            shown = ", ".join(others[:3]) + (" ..." if len(others) > 3 else "")
            return (Finding("CS6125", "warning", f"it loads {shown} at run time: they must be there under these names",
                            file=str(self.file), hint="upload each part with --name and the name that it is loaded by"
                            + _in_folder(others[0], "")),)
        main = self.record["output"].get("file") if self.record else None
        if not isinstance(main, str) or main == self.file.name or Path(main).name != main:
            return ()
        try:
            places = _loaded(self.file.with_name(main).read_bytes())
        except OSError:
            return ()
        place = next((place for place in places if place.rpartition("/")[2].lower() == self.file.name.lower()), "")
        here = f"{folder}/{name}" if "/" in place else name
        if not place or place.lower() == here.lower():
            return ()
        return (Finding("CS6125", "warning", f"{main} loads it as {place} at run time, and here it would be {folder}/{name}",
                        file=str(self.file), hint=f"--name {self.file.name}{_in_folder(place, folder)}"),)

    def as_dict(self) -> dict[str, Any]:
        """JSON values."""
        return {"file": str(self.file), "module": self.name, "bytes": len(self.content), "sha256": self.sha256,
                "record": None if self.record is None else _summary(self.record)}

    def lines(self) -> list[str]:
        """What the terminal shows."""
        shown = [f"module: {self.name}, {len(self.content)} bytes, SHA-256 {self.sha256[:16]}..."]
        if self.record is not None:
            summary = _summary(self.record)
            sources = ", ".join(f"{summary[key]}" for key in ("input", "stiffness", "forces", "cell") if summary[key])
            shown.append(f"record: corrected from {sources}")
            if summary["largest_offset_mm"] is not None:
                shown.append(f"record: {summary['corrected']} targets corrected, largest offset "
                             f"{summary['largest_offset_mm']:.4f} mm")
        return shown


def _in_folder(place: str, folder: str) -> str:
    """The rest of a hint: the folder of a place that is loaded, where it is another one."""
    there = place.rpartition("/")[0]
    return f", and controller.folder {there}" if there and there.lower() != folder.lower() else ""


def _loaded(content: bytes) -> list[str]:
    """What a module loads at run time, `HOME/part.mod`, as a controller's folders are written here."""
    return [b"/".join(place.replace(b":", b"/").strip(b"/").replace(b"//", b"/") for place in parts if place).decode("latin-1")
            for parts in _LOAD.findall(content) if any(parts)]


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
    if record is None:      # a part of a program that was split: the record is the main module's
        path = file.with_name(f"{_PART.sub('', file.stem)}{file.suffix}.json")
        record = _read_record(path)
        record = record if record and any(output.get("file") == file.name for output in _outputs(record)) else None
    if record is None:
        return None, (Finding("CS6102", "warning", f"has no record of a correction beside it ({file.name}.json)",
                              file=str(file),
                              hint="right for a first pass; a corrected program keeps its record beside it"),)
    corrected_for = _summary(record)["robot"]
    if corrected_for != robot:
        raise Refused(Finding("CS6103", "error", f"was corrected for the robot '{corrected_for}', the cell has '{robot}'",
                              file=str(file), hint="give the cell.yaml it was corrected with"))
    # What the record says of this name; a program that was renamed with its record is what it was.
    outputs = [output for output in _outputs(record) if output.get("file") == file.name] or _outputs(record)
    differs = () if any(output.get("sha256") == digest for output in outputs) else (Finding(
        "CS6101", "warning" if changed else "error", f"is not what its record {path.name} says: it was changed since it was "
        "corrected", file=str(file), hint="" if changed else "correct it again, or --changed where it was changed on purpose"),)
    if differs and not changed:
        raise Refused(*differs)
    return record, (*differs, *said_of_later(path, file), *said_of_changes(record, path.parent, file))


def _outputs(record: dict[str, Any]) -> list[dict[str, Any]]:
    parts = record.get("parts")
    return [record["output"], *(part for part in (parts if isinstance(parts, list) else []) if isinstance(part, dict))]


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
    """What the record says, as far as it says it."""
    def inside(*keys: str) -> Any:
        found: Any = record
        for key in keys:
            found = found.get(key) if isinstance(found, dict) else None
        return found

    largest = inside("summary", "offset_mm", "largest")
    return {**{key: inside(key, "file") for key in ("input", "stiffness", "forces", "cell")}, "robot": inside("robot", "name"),
            "compstiff": inside("compstiff"), "targets": inside("summary", "targets"),
            "corrected": inside("summary", "corrected"),
            "largest_offset_mm": float(largest) if isinstance(largest, int | float) else None}

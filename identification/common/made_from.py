"""Files that an output was made from and that are others now: the output is of an earlier run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from identification.common.files import sha256
from identification.common.findings import Finding

# What of a record decides the correction, and is not written over by a later pass as its log is.
DECIDE = ("input", "stiffness")


def said_of_changes(record: dict[str, Any], folder: Path, output: Path, program: Path | None = None) -> tuple[Finding, ...]:
    """A warning (CS4205) where the program or the stiffness file that `record` names stand in `folder` with another content, or
    `program`, where it has the name of the first, has."""
    changed = []
    for key in DECIDE:
        named = record.get(key)
        if not isinstance(named, dict) or not isinstance(named.get("file"), str):
            continue
        beside = folder / Path(named["file"]).name
        file = program if key == "input" and program is not None and program.name == beside.name else beside
        if file.is_file() and sha256(file) != named.get("sha256"):
            changed.append(file.name)
    if not changed:
        return ()
    what = f"{changed[0]} was changed since this was worked out from it"
    if len(changed) > 1:
        what = f"{' and '.join(changed)} were changed since this was worked out from them"
    return (Finding("CS4205", "warning", what, file=str(output),
                    hint="correct again; right where nothing but a comment was changed"),)

"""OUT.mod.json: what a corrected program was made from."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from compensator.correction.correct import Corrected
from compensator.correction.offsets import offset_blocks
from compensator.cutting.stock_file import named_by
from identification.common.files import sha256
from identification.common.findings import fold
from identification.common.made_from import RECORD


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

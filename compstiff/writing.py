"""What a script does with a result: its report, and files written whole or not at all."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

# The function that makes the report of each result; imported when one is asked for.
REPORTS = {
    "Fit": "identification.fit.report:identification_report",
    "Diagnosis": "identification.diagnosis.pages:diagnosis_report",
    "JointLogFit": "identification.motion.pages:stiffness_report",
    "JointLogDiagnosis": "identification.motion.pages:diagnosis_report",
    "DesignPlan": "identification.design.pages:design_report",
    "Predicted": "compensator.correction.report:path_report",
    "Budget": "compensator.correction.report:budget_report",
    "Corrected": "compensator.correction.report:path_report",
    "Learning": "compensator.learning.pages:learn_report",
    "Verification": "compensator.verification.report:verify_report",
}


def report(result: object, **files: Path | None) -> str:
    """The HTML report of a result: one page that opens offline. files: those that were written beside it and that its steps
    name, such as extended of a diagnosis. Raises TypeError for a value that has none.

    >>> cell = compstiff.read_cell("cell.yaml")
    >>> fit = compstiff.fit_stiffness(cell, compstiff.read_measurements("measurements.csv", cell.robot))
    >>> compstiff.report(fit).lstrip()[:15]
    '<!doctype html>'
    """
    where = REPORTS.get(type(result).__name__)
    if where is None:
        raise TypeError(f"there is no report of {type(result).__name__}; there is one of {', '.join(REPORTS)}")
    module, _, name = where.partition(":")
    page: str = getattr(import_module(module), name)(result, **files)
    return page


def write(files: Mapping[str | Path, bytes | str | Mapping[str, Any]], *, overwrite: bool = False) -> None:
    """Writes all files or none: bytes, text, or JSON values.

    Raises CompstiffError: CS0003 a file exists and `overwrite` is not set, CS0004 it cannot be written, CS0006 two
    names are one file.

    >>> compstiff.write({"notes.txt": "as planned", "notes.json": {"planned": True}})
    """
    from identification.common.files import check_distinct, check_writable, json_bytes, write_whole

    contents = {Path(name): content if isinstance(content, bytes) else content.encode() if isinstance(content, str)
                else json_bytes(dict(content)) for name, content in files.items()}
    check_distinct([], [Path(name) for name in files])
    check_writable(contents, overwrite=overwrite)
    write_whole(contents, overwrite=overwrite)

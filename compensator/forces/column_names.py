"""A logger's own header told in the names of docs/formats.md: a line to put into cell.yaml, never taken unasked."""

from __future__ import annotations

import re
from collections.abc import Sequence

from identification.common.columns import FORCES
from identification.common.header_names import meant
from identification.model.cell_file import LOG_COLUMNS

FORCE_COUNTS = ("fx_counts", "fy_counts", "fz_counts")
KILO = re.compile(r"(?<![a-z])kn\b")


def named_columns(header: Sequence[str]) -> str:
    """`, or put this into cell.yaml: ...` with the columns that are meant beyond doubt, quantity and unit; "" unless all three
    forces are among them. Kilonewtons are a thousandth of a count a newton."""
    told = [column if column in LOG_COLUMNS and not needed else "" for column, needed in map(meant, header)]
    scale = ""
    if not any(force in told for force in FORCES):
        told = [f"{column[:2]}_counts" if column in FORCES and KILO.search(name.lower()) else known
                for name, (column, _), known in zip(header, map(meant, header), told, strict=True)]
        scale = ", and counts_per_n: 0.001"
    if any(told.count(force) != 1 for force in (FORCE_COUNTS if scale else FORCES)):
        return ""
    sure = [name if name and told.count(name) == 1 else "'-'" for name in told]
    left = [name for name, column in zip(header, sure, strict=True) if column == "'-'" and name]
    unsure = f"; '-' stands for {', '.join(left)}, of which quantity or unit is not sure" if left else ""
    return f"; if they are meant so, put into cell.yaml below force_log: columns: [{', '.join(sure)}]{scale}{unsure}"

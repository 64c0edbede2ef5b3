"""A logger's own header told in the names of docs/formats.md: a line to put into cell.yaml, never taken unasked."""

from __future__ import annotations

from collections.abc import Sequence

from identification.common.columns import FORCES
from identification.common.header_names import meant
from identification.model.cell_file import LOG_COLUMNS


def named_columns(header: Sequence[str]) -> str:
    """`, or put this into cell.yaml: ...` with the columns that are meant beyond doubt, quantity and unit; "" unless all three
    forces are among them."""
    told = [column if column in LOG_COLUMNS and not needed else "" for column, needed in map(meant, header)]
    if any(told.count(force) != 1 for force in FORCES):
        return ""
    sure = [name if name and told.count(name) == 1 else "'-'" for name in told]
    left = [name for name, column in zip(header, sure, strict=True) if column == "'-'" and name]
    unsure = f"; '-' stands for {', '.join(left)}, of which quantity or unit is not sure" if left else ""
    return f"; if they are meant so, put into cell.yaml below force_log: columns: [{', '.join(sure)}]{unsure}"

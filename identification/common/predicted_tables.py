"""Tables of deviations that were predicted, given for measured ones: they would prove themselves right."""

from __future__ import annotations

from identification.common.findings import error
from identification.common.tables import Table

# What `predict` and `correct` write beside the deviation, and nobody who measures.
OF_A_PREDICTION = {"samples", "note", "time_s"}


def check_measured(table: Table, use: str) -> None:
    """Raises CompstiffError (CS6039) for deviation.csv or offsets.csv; use: what they are good for here."""
    if set(table.columns) >= OF_A_PREDICTION:
        raise error("CS6039", "holds the predicted deviation (columns samples, note, time_s), not a measured one",
                    file=table.source, line=table.header_line, hint=f"name the file of what the probe or laser measured; {use}")

"""A logger's own header told in the names of docs/formats.md: a line to put into cell.yaml, never taken unasked."""

from __future__ import annotations

import re
from collections.abc import Sequence

from identification.common.columns import FORCES

QUANTITY = re.compile(r"(f[xyz]|m[xyz]|[xyz]|t|time|zeit|target)[ _]*[\[(]?(n|n ?[*·]? ?m|mm|ms|s|)[\])]?")
TIMES = {"t", "time", "zeit"}
# The units that each kind of quantity is read in.
READ = {"f": ("n",), "m": ("nm",), "p": ("mm",), "t": ("s", "ms")}


def named_columns(header: Sequence[str]) -> str:
    """`, or put this into cell.yaml: ...` with the columns that are meant beyond doubt, quantity and unit; "" unless all three
    forces are among them."""
    meant = [_meant(name) for name in header]
    if any(meant.count(force) != 1 for force in FORCES):
        return ""
    columns = ", ".join(name if name and meant.count(name) == 1 else "'-'" for name in meant)
    return f"; if they are meant so, put into cell.yaml below force_log: columns: [{columns}]"


def _meant(name: str) -> str:
    """fx_n of "Fx [N]", time_s of "Zeit (s)"; "" where the unit is missing or another."""
    found = QUANTITY.fullmatch(name.strip().lower())
    if not found:
        return ""
    quantity, unit = found[1], re.sub(r"[ *·]", "", found[2])
    if quantity == "target":
        return "" if unit else "target"
    kind = "t" if quantity in TIMES else quantity[0] if len(quantity) == 2 else "p"
    return f"{'time' if kind == 't' else quantity}_{unit}" if unit in READ[kind] else ""

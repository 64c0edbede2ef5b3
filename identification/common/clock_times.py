"""Times by the clock in a column of seconds, `08:14:07` or `08:14:07,250`: as seconds of the day, running on over midnight."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from identification.common.findings import Finding

if TYPE_CHECKING:
    import pandas as pd

TIME = "time_s"
_CLOCK = re.compile(r"([01]?\d|2[0-3]):([0-5]\d):([0-5]\d(?:[.,]\d+)?)")
# Hours back that are a midnight [s]; less is a clock that was set, or a new count.
MIDNIGHT, DAY = 12 * 3600.0, 86400.0


def with_seconds(frame: pd.DataFrame, file: str, line: NDArray[np.intp]) -> tuple[pd.DataFrame, tuple[Finding, ...]]:
    """The frame with times by the clock as seconds, and the note that says so (CS0208); as it is where a cell of the column
    holds anything else. Empty cells stay empty."""
    if TIME not in frame.columns or frame[TIME].dtype.kind in "fiu" or not len(frame):
        return frame, ()
    text = frame[TIME].fillna("").astype(str).str.strip()
    if not _CLOCK.fullmatch(next((cell for cell in text if cell), "")):
        return frame, ()
    found = [_CLOCK.fullmatch(cell) for cell in text]
    if any(cell and not match for cell, match in zip(text, found, strict=True)):
        return frame, ()
    seconds = np.array([np.nan if match is None else 3600 * float(match[1]) + 60 * float(match[2])
                        + float(match[3].replace(",", ".")) for match in found])
    known = np.flatnonzero(np.isfinite(seconds))
    seconds[known] += DAY * np.cumsum(np.diff(seconds[known], prepend=seconds[known[0]]) < -MIDNIGHT)
    first = int(known[0])
    return frame.assign(**{TIME: seconds}), (Finding(
        "CS0208", "note", f"column '{TIME}': times by the clock are read as seconds of the day, {text.iloc[first]} as "
        f"{seconds[first]:g}", file=file, line=int(line[first])),)

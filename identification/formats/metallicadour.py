"""The form of the METALLICADOUR milling records (PHM data set, an IRB 6660): CSV without header, 12 channels at 25.6 kHz.

Channels: three currents, three forces, three torques, three vibrations, in this order; cells separated by `;` (then a decimal
comma may stand), `,` or blanks. The folder's name tells the cut: `5mm_648mm_mn_9000rpm` is 5 mm deep, 648 mm/min, 9000 rpm.
Written from that description; no file of the set was seen.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pandas as pd

from identification.common.findings import error
from identification.formats.force_samples import ForceSamples

RATE_HZ = 25600.0
CHANNELS = 12
FOLDER = re.compile(r"(?P<depth_mm>[\d.]+)mm_(?P<feed_mm_min>[\d.]+)mm_mn_(?P<spindle_rpm>[\d.]+)rpm", re.IGNORECASE)


def read_metallicadour(file: str | Path, *, rate_hz: float = RATE_HZ) -> ForceSamples:
    """Reads one file. Raises CompstiffError: CS0005 cannot be read, CS0201 not 12 channels, CS0203 not a number."""
    file = Path(file)
    try:
        with open(file, encoding="utf-8-sig") as stream:
            first = next((line for line in stream if line.strip()), "")
            # Also where the first row is of whole numbers alone.
            decimal = "," if ";" in first and ("," in first or any("," in line for line in stream)) else "."
    except (OSError, UnicodeDecodeError) as reason:
        raise error("CS0005", f"cannot be read: {reason}", file=str(file)) from reason
    separator = ";" if ";" in first else "," if "," in first else r"\s+"
    try:
        frame = pd.read_csv(file, sep=separator, header=None, decimal=decimal, skip_blank_lines=True,
                            skipinitialspace=True, low_memory=False)
    except (pd.errors.ParserError, pd.errors.EmptyDataError, UnicodeDecodeError) as reason:
        raise error("CS0201", f"is not a table: {reason}", file=str(file)) from reason
    if frame.shape[1] == CHANNELS + 1 and frame.iloc[:, -1].isna().all():
        frame = frame.iloc[:, :-1]
    if frame.shape[1] != CHANNELS:
        raise error("CS0201", f"has {frame.shape[1]} channels, expected {CHANNELS}: 3 currents, 3 forces, 3 torques, "
                    "3 vibrations", file=str(file), line=1)
    values = frame.apply(pd.to_numeric, errors="coerce").to_numpy(dtype=float)
    bad = np.argwhere(~np.isfinite(values))
    if len(bad):
        row, column = (int(k) for k in bad[0])
        lines = [number for number, line in enumerate(file.read_text("utf-8-sig").splitlines(), start=1) if line.strip()]
        raise error("CS0203", f"channel {column + 1}: found '{frame.iat[row, column]!s}', expected a finite number",
                    file=str(file), line=lines[row], column=column + 1)
    cut = FOLDER.search(str(file.resolve().parent))
    conditions = {name: float(value) for name, value in cut.groupdict().items()} if cut else {}
    others = {f"{kind}_{k + 1}": values[:, start + k] for kind, start in (("current", 0), ("vibration", 9)) for k in range(3)}
    return ForceSamples(str(file), np.arange(len(values)) / rate_hz, values[:, 3:6], values[:, 6:9], conditions, others)

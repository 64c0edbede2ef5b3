"""`convert`: a public log, or a sensor's own, as the columns of docs/formats.md."""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from identification.common.findings import Finding
from identification.formats.force_logs import read_force_samples

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Converted:
    """A log as columns (N,) in the units of their names. conditions: what its file states beside them, by name."""

    columns: dict[str, Array]
    conditions: dict[str, float]
    findings: tuple[Finding, ...]

    @property
    def seconds(self) -> float:
        """From the first sample to the last."""
        return float(self.columns["time_s"][-1] - self.columns["time_s"][0])

    def as_dict(self) -> dict[str, Any]:
        """JSON values."""
        return {"rows": len(self.columns["time_s"]), "seconds": self.seconds, "columns": list(self.columns),
                "conditions": self.conditions}

    def lines(self) -> list[str]:
        """What was read, for the terminal."""
        stated = "".join(f", {name} {value:g}" for name, value in self.conditions.items())
        return [f"{len(self.columns['time_s'])} samples over {self.seconds:.3f} s: {', '.join(self.columns)}{stated}"]

    def content(self, *, parquet: bool) -> bytes:
        """The file to write: CSV, or Parquet."""
        buffer = io.BytesIO()
        if parquet:
            pd.DataFrame(self.columns).to_parquet(buffer)
        else:
            pd.DataFrame(self.columns).to_csv(buffer, index=False, float_format="%.10g")
        return buffer.getvalue()


def convert_log(
    log: Path, form: str, *, rate: float | None = None, channels: tuple[str, ...] | None = None,
    counts: tuple[float, float] = (1e6, 1e6),
) -> Converted:
    """Reads a log in its form (`kuka-kr300`, `metallicadour`, `lvm`, `net-ft`).

    rate: samples a second (metallicadour, net-ft); channels: names of the force, then the moment channels (lvm); counts: per
    newton and per newton metre (net-ft). Raises what the form's reader raises.

    >>> converted = compstiff.convert_log("log.lvm", "lvm")
    >>> converted.lines()
    ['40 samples over 0.004 s: time_s, fx_n, fy_n, fz_n']
    """
    if form == "kuka-kr300":
        from identification.formats.kuka_kr300 import read_kuka_kr300

        columns, findings = read_kuka_kr300(log)
        return Converted(columns, {}, findings)
    samples = read_force_samples(log, form, rate_hz=rate, channels=channels, counts_per_n=counts[0], counts_per_nm=counts[1])
    return Converted(samples.columns(), samples.conditions, samples.findings)

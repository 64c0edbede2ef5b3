"""`convert`: a public log, or a sensor's own, as the columns of FORMATS.md."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from identification.console import Outcome
from identification.files import check_writable, write_whole
from identification.findings import Finding

Array = NDArray[np.float64]


def convert_log(
    log: Path, form: str, output: Path, rate: float | None, channels: tuple[str, ...], counts: tuple[float, float], *,
    overwrite: bool,
) -> Outcome:
    """Reads LOG in its form and writes OUTPUT; counts: per newton and per newton metre (net-ft)."""
    check_writable([output], overwrite=overwrite)
    columns, conditions, findings = _read(log, form, rate, channels, counts)
    frame = pd.DataFrame(columns)
    buffer = io.BytesIO()
    if output.suffix.lower() in (".parquet", ".pq"):
        frame.to_parquet(buffer)
    else:
        frame.to_csv(buffer, index=False, float_format="%.10g")
    write_whole({output: buffer.getvalue()})
    seconds = float(columns["time_s"][-1] - columns["time_s"][0])
    told = "".join(f", {name} {value:g}" for name, value in conditions.items())
    return Outcome({"rows": len(frame), "seconds": seconds, "columns": list(columns), "conditions": conditions}, findings,
                   [f"{len(frame)} samples over {seconds:.3f} s: {', '.join(columns)}{told}"])


def _read(
    log: Path, form: str, rate: float | None, channels: tuple[str, ...], counts: tuple[float, float]
) -> tuple[dict[str, Array], dict[str, float], tuple[Finding, ...]]:
    if form == "kuka-kr300":
        from identification.public.kuka_kr300 import read_record

        return read_record(log), {}, ()
    if form == "lvm":
        from identification.public.lvm import read_lvm

        samples = read_lvm(log, channels)
    elif form == "net-ft":
        from identification.public import net_ft

        samples = net_ft.read_net_ft(log, counts_per_force=counts[0], counts_per_torque=counts[1], rate=rate or net_ft.RATE)
    else:
        from identification.public import metallicadour

        samples = metallicadour.read_metallicadour(log, rate=rate or metallicadour.RATE)
    return samples.columns(), samples.conditions, samples.findings

"""ATI Net F/T: records of its raw data transfer (RDT) as they come over UDP, one behind the other in a file.

A record is nine big-endian words: RDT sequence, F/T sequence, status (unsigned), then Fx Fy Fz Tx Ty Tz in counts (signed).
Counts become newtons by the sensor's counts per force, usually 1e6. The F/T sequence counts the samples inside the sensor, so
the time of each sample follows from it, whatever was lost on the way.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from identification.common.findings import Finding, counted, error
from identification.formats.force_samples import ForceSamples

RECORD = np.dtype([("rdt", ">u4"), ("ft", ">u4"), ("status", ">u4"), ("force", ">i4", 3), ("moment", ">i4", 3)])
COUNTS = 1e6
# Samples a second inside the sensor: the largest RDT rate of the Net F/T box. State your own where it is set lower.
RATE_HZ = 7000.0


def read_net_ft(
    file: str | Path, *, counts_per_n: float = COUNTS, counts_per_nm: float = COUNTS, rate_hz: float = RATE_HZ
) -> ForceSamples:
    """Reads RDT records; rate_hz: of the F/T sequence.

    Records out of order are put in order. Raises CompstiffError: CS0005 cannot be read, CS0201 not whole records.
    """
    name = str(file)
    try:
        content = Path(file).read_bytes()
    except OSError as reason:
        raise error("CS0005", f"cannot be read: {reason.strerror}", file=name) from reason
    if not content or len(content) % RECORD.itemsize:
        raise error("CS0201", f"has {len(content)} bytes, expected a multiple of {RECORD.itemsize}", file=name,
                    hint="write the 36 bytes of each UDP packet one behind the other, nothing else")
    records = np.frombuffer(content, RECORD)
    order = np.argsort(_unwrapped(records["rdt"]), kind="stable")
    late = int(np.sum(np.diff(order) < 0))
    records = records[order]
    sent, inside = _unwrapped(records["rdt"]), _unwrapped(records["ft"])
    findings = []
    lost = int(np.sum(np.maximum(np.diff(sent) - 1, 0)))
    if lost:
        findings.append(Finding("CS0205", "warning", f"{counted(lost, 'packet')} of {len(records) + lost} lost on the way",
                                file=name, hint="a gap keeps its time; too many lost say the network is busy"))
    if late:
        findings.append(Finding("CS0205", "note", f"{counted(late, 'packet')} came out of order", file=name))
    faulty = int(np.sum(records["status"] != 0))
    if faulty:
        findings.append(Finding("CS0205", "warning", f"{counted(faulty, 'sample')} with a sensor status that is not zero",
                                file=name, hint="saturation or a gauge fault: see the sensor's status codes"))
    return ForceSamples(name, inside / rate_hz, records["force"] / counts_per_n,
                        records["moment"] / counts_per_nm, findings=tuple(findings))


def _unwrapped(sequence: np.ndarray) -> np.ndarray:
    """Counts (n,) since the first of a 32-bit counter that may have run over, as float."""
    step = np.mod(np.diff(sequence.astype(float)) + 2.0**31, 2.0**32) - 2.0**31
    return np.concatenate([[0.0], np.cumsum(step)])

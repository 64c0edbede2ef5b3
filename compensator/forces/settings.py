"""What a user may choose of reading and placing a force log."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class LogSettings:
    """tare: first and last target of air moves, whose mean force is the sensor's bias; trust_tare: also where the log
    speaks against it. other_forces: another log of the program, held against this one. log_format: a public form of the force
    log, None for CSV and Parquet. spindle_rpm: the spindle's speed, whole revolutions of which are averaged; None: as cell.yaml
    states it, or found in the log."""

    tare: tuple[tuple[int, int], ...] = ()
    log_format: str | None = None
    spindle_rpm: float | None = None
    trust_tare: bool = False
    other_forces: Path | None = None

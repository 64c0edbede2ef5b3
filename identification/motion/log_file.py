"""MotionLog: reads a joint deflection log (docs/formats.md), CSV, Parquet or a public KUKA record."""

from __future__ import annotations

import io
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from identification.common.cells import opened
from identification.common.files import sha256
from identification.common.findings import CompstiffError, Finding, counted, error
from identification.common.tables import read_table
from identification.model.joint_log import JointLog

Array = NDArray[np.float64]
COLUMN = re.compile(r"q([1-6])_(motor_deg|link_deg|torque_nm|speed_deg_s)$")
SHORTEST = 3.0
UNEVEN = 0.2
# Lags of the speed channel that are looked for, and from which it is said [samples].
MOST_LAG, WORTH_SAYING = 5, 0.5


@dataclass(frozen=True, eq=False)
class MotionLog:
    """One record: time (n,) [s], even steps. joints: by number, compliance left at one. sha256: of the
    file's bytes."""

    source: str
    time: Array
    joints: dict[int, JointLog]
    findings: tuple[Finding, ...]
    sha256: str = ""

    @property
    def rate(self) -> float:
        """Samples a second."""
        return (len(self.time) - 1) / float(self.time[-1] - self.time[0])

    def cut(self, start: int, stop: int) -> MotionLog:
        """The samples from start to stop."""
        part = slice(start, stop)
        joints = {k: JointLog(k, log.time[part], log.torque[part], log.speed[part], log.deflection[part], log.angle[part],
                              log.compliance, {j: torque[part] for j, torque in log.others.items()})
                  for k, log in self.joints.items()}
        return MotionLog(self.source, self.time[part], joints, ())

    def less(self, joint: int, error: Array) -> MotionLog:
        """The log with an error (n,) [rad] taken off the deflection of a joint."""
        log = self.joints[joint]
        return replace(self, joints=self.joints | {joint: replace(log, deflection=log.deflection - error)})


def is_motion_log(file: str | Path) -> bool:
    """Whether a file is a joint deflection log: a .mat file, or a table with motor and link angles."""
    file = Path(file)
    if file.suffix.lower() == ".mat":
        return True
    if file.suffix.lower() in (".parquet", ".pq"):
        import pyarrow as pa
        import pyarrow.parquet as pq

        try:
            names = pq.read_schema(file).names
        except (OSError, pa.ArrowInvalid):
            return False
        return any(COLUMN.match(name) for name in names)
    try:
        return any(COLUMN.match(name) for name in _header(file))
    except (OSError, CompstiffError):
        return False


def read_motion_log(file: str | Path) -> MotionLog:
    """Reads a joint deflection log.

    Raises what `tables.read_table` raises, and CompstiffError CS1501: no joint with both encoders and torque, uneven time,
    too short.

    >>> log = compstiff.read_motion_log("log_a.csv")
    >>> list(log.joints), round(log.rate)
    ([2], 250)
    """
    file = Path(file)
    line: NDArray[np.intp] | None = None
    findings: list[Finding] = []
    if file.suffix.lower() == ".mat":
        from identification.formats.kuka_kr300 import read_kuka_kr300

        columns, said = read_kuka_kr300(file)
        findings += said
    else:
        columns, line, findings = _table(file)
    name, time = str(file), columns["time_s"]
    joints = [k for k in range(1, 7) if f"q{k}_motor_deg" in columns]
    if not joints:
        raise error("CS1501", "no joint has q?_motor_deg, q?_link_deg and q?_torque_nm", file=name,
                    hint="a joint needs an encoder on either side of its gear, and its torque on the gear side")
    _check_time(time, line, name)
    logs = {}
    for k in joints:
        angle = np.radians(columns[f"q{k}_motor_deg"])
        speed = np.gradient(angle, time)
        deflection = angle - np.radians(columns[f"q{k}_link_deg"])
        others = {j: columns[f"q{j}_torque_nm"] for j in joints if j != k}
        logs[k] = JointLog(k, time, columns[f"q{k}_torque_nm"], speed, deflection, angle, 1.0, others)
        logged = columns.get(f"q{k}_speed_deg_s")
        lag = 0.0 if logged is None else _lag(np.radians(logged), speed)
        if abs(lag) >= WORTH_SAYING:
            by = 1e3 * abs(lag) * float(time[1] - time[0])
            far = f"{by:.3g} ms or more" if abs(lag) > MOST_LAG - 0.05 else f"{by:.1f} ms"
            findings.append(Finding("CS1506", "note", f"q{k}_speed_deg_s lies {far} {'behind' if lag > 0 else 'ahead of'} the "
                                    "motor angle; the speed is taken from the angle", file=name))
    return MotionLog(name, time, logs, tuple(findings), sha256(file))


def _table(file: Path) -> tuple[dict[str, Array], NDArray[np.intp], list[Finding]]:
    names = [f"q{k}_{what}" for k in range(1, 7) for what in ("motor_deg", "link_deg", "torque_nm", "speed_deg_s")]
    groups = [[f"q{k}_motor_deg", f"q{k}_link_deg", f"q{k}_torque_nm"] for k in range(1, 7)]
    if file.suffix.lower() not in (".parquet", ".pq") and "time_s" not in _header(file):
        raise error("CS1501", "has no column time_s", file=str(file), line=1,
                    hint="a logger with a fixed step needs no clock: write time_s as the row's number times the step (at "
                    "250 Hz 0, 0.004, 0.008 ...), if no row was lost")
    table = read_table(file, required=["time_s"], optional=names, together=groups)
    return dict(table.numbers), table.line, list(table.findings)


def _header(file: Path) -> list[str]:
    """The names in the first line that says anything."""
    with opened(file) as stream:
        text = io.TextIOWrapper(stream, encoding="utf-8-sig", errors="replace")
        header = next((line for line in text if line.strip() and not line.lstrip().startswith("#")), "")
    return [name.strip().strip('"') for name in re.split(r"[,;\t]", header)]


def check_distinct(logs: Sequence[MotionLog]) -> None:
    """Raises CompstiffError (CS1616) where a log is there twice: it would confirm itself."""
    for k, log in enumerate(logs):
        for other in logs[:k]:
            both = [joint for joint in log.joints if joint in other.joints]
            if both and all(np.array_equal(log.joints[joint].torque, other.joints[joint].torque) for joint in both):
                raise error("CS1616", f"holds the same samples as {other.source}", file=log.source,
                            hint="a further record is another motion, best of another day")


def _check_time(time: Array, line: NDArray[np.intp] | None, name: str) -> None:
    if len(time) < 2:
        raise error("CS1501", f"has {counted(len(time), 'sample')}", file=name, hint="a log takes a few seconds of motion")
    steps = np.diff(time)
    wrong = np.flatnonzero((steps <= 0) | (np.abs(steps - np.median(steps)) > UNEVEN * np.median(steps)))
    if len(wrong):
        row = int(wrong[0])
        raise error("CS1501", f"time_s steps by {steps[row]:.6g} s where the log steps by {np.median(steps):.6g} s", file=name,
                    line=None if line is None else int(line[row + 1]), column=None,
                    hint="the samples must be evenly spaced: cut the log at its gaps, or resample it")
    length = float(time[-1] - time[0])
    if length < SHORTEST:
        raise error("CS1501", f"lasts {length:.2f} s, expected {SHORTEST:g} s or more", file=name,
                    hint="neighbouring samples are not independent: a short log tells little")


def _lag(logged: Array, speed: Array) -> float:
    """By how many samples a logged speed (n,) lies behind the motor angle's (n,), by the least squared difference."""
    n, index = len(speed), np.arange(len(speed), dtype=float)
    inner = slice(MOST_LAG, n - MOST_LAG)
    lags = np.arange(-MOST_LAG, MOST_LAG + 0.05, 0.1)
    off = [float(np.mean((np.interp(index - lag, index, speed) - logged)[inner] ** 2)) for lag in lags]
    return float(lags[int(np.argmin(off))])

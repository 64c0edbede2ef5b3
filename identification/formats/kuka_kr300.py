"""The public KUKA KR300 records: MATLAB files of "Dataset and baseline for an industrial robot identification benchmark".

github.com/JonasWeigand/Robot_Identification, MIT licence. Struct `rec`: `time_cont` [s], `act_pos_mot_deg` and
`act_pos_se_deg` (6, n) [deg], `act_vel_mot_deg_per_s`, `act_torque_abs_nm` [N m] on the motor side; `para.u` are the gear
ratios. Link encoders carry data on axes 1-3 only; an axis whose link angle never moves has none. Of a record without
`rec.time_cont` the struct `time_data` states the step, `dt` [s].
"""

from __future__ import annotations

import contextlib
import io
import os
import subprocess
import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.common.findings import Finding, error
from identification.common.sizes import LARGEST_CELL

Array = NDArray[np.float64]
# Struct, field: what a record must have.
NEEDED = (("rec", "act_pos_mot_deg"), ("rec", "act_pos_se_deg"), ("rec", "act_vel_mot_deg_per_s"),
          ("rec", "act_torque_abs_nm"), ("para", "u"))

PATIENCE_S = 120.0
SIGNALS = ("act_pos_mot_deg", "act_pos_se_deg", "act_vel_mot_deg_per_s", "act_torque_abs_nm")
CLOCKS = (("rec", "time_cont"), ("time_data", "dt"))


def read_kuka_kr300(file: str | Path) -> tuple[dict[str, Array], tuple[Finding, ...]]:
    """The record as columns of a joint deflection log (docs/formats.md), the torque on the gear side, and what was assumed.

    Raises CompstiffError: CS0005 cannot be read, CS0201 no MATLAB file or not one of these records, CS0203 a sample of a joint
    with a link encoder is no number.
    """
    name = str(file)
    content, said = _content(name)
    findings = [Finding("CS1615", "warning", f"the reader of MATLAB files says: {text}", file=name) for text in said]
    fields = {}
    for struct, field in NEEDED:
        value = content.get(f"{struct}.{field}")
        if value is None:
            raise error("CS0201", f"has no {struct}.{field}, or not in numbers", file=name,
                        hint="among .mat files only the public KUKA KR300 records are read; write others as CSV")
        fields[field] = value
    if fields["u"].shape != (6,):
        raise error("CS0201", f"para.u has shape {fields['u'].shape}, expected (6,)", file=name)
    time = _time(content, np.atleast_2d(fields["act_pos_mot_deg"]).shape[1], name, findings)
    columns = {"time_s": time}
    for field in SIGNALS:
        if fields[field].shape != (6, len(time)):
            raise error("CS0201", f"rec.{field} has shape {fields[field].shape}, expected (6, {len(time)})", file=name)
    for k in range(6):
        link = fields["act_pos_se_deg"][k]
        if not np.isfinite(link).any() or np.ptp(link) == 0:
            continue
        for place, values in (*((f"rec.{field}", fields[field][k]) for field in SIGNALS), ("para.u", fields["u"][k:k + 1])):
            wrong = np.flatnonzero(~(np.abs(values) <= LARGEST_CELL))
            if len(wrong):
                raise error("CS0203", f"{place}, joint {k + 1}: found {values[wrong[0]]:g} as number {wrong[0] + 1}, expected "
                            f"a finite number up to {LARGEST_CELL:g} in size", file=name,
                            hint="cut the record where samples are lost")
        columns[f"q{k + 1}_motor_deg"] = fields["act_pos_mot_deg"][k]
        columns[f"q{k + 1}_link_deg"] = link
        columns[f"q{k + 1}_torque_nm"] = fields["act_torque_abs_nm"][k] * fields["u"][k]
        columns[f"q{k + 1}_speed_deg_s"] = fields["act_vel_mot_deg_per_s"][k]
    return columns, tuple(findings)


def _content(name: str) -> tuple[dict[str, Array], list[str]]:
    """The fields that are read, in numbers, by "struct.field", and the reader's warnings. Raises CS0005, CS0201.

    Read in a process of its own: SciPy's reader trusts the sizes that a file states, and a damaged file can end its process.
    """
    try:
        with open(name, "rb"):
            pass
    except OSError as reason:
        raise error("CS0005", f"cannot be read: {reason.strerror or reason}", file=name) from reason
    here = f"from {__name__} import write_fields; write_fields()"
    try:
        done = subprocess.run([sys.executable, "-c", here, name], capture_output=True, check=False, timeout=PATIENCE_S,
                              env={**os.environ, "PYTHONPATH": os.pathsep.join(path or os.getcwd() for path in sys.path)})
    except subprocess.TimeoutExpired as reason:
        raise error("CS0201", f"is not a MATLAB file that can be read: its reader took over {PATIENCE_S:g} s",
                    file=name) from reason
    if done.returncode:
        said = done.stderr.decode("utf-8", "replace").strip().split("\n")[-1]
        raise error("CS0201", "is not a MATLAB file that can be read: "
                    + (said[:200] if done.returncode == 1 else "its reader broke down"), file=name)
    with np.load(io.BytesIO(done.stdout), allow_pickle=False) as fields:
        return {key: fields[key] for key in fields.files if key != "said"}, fields["said"].tolist()


def write_fields() -> None:
    """What `_content` gives of the file named on the command line, onto stdout, as .npz."""
    from scipy.io import loadmat

    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        content: dict[str, Any] = loadmat(sys.argv[1], squeeze_me=True, struct_as_record=False)
    fields: dict[str, Any] = {}
    for struct, field in (*NEEDED, *CLOCKS):
        value = getattr(content.get(struct), field, None)
        with contextlib.suppress(ValueError, TypeError):
            if value is not None:
                fields[f"{struct}.{field}"] = np.array(value, dtype=float)
    stream = io.BytesIO()
    np.savez(stream, said=np.array(list(dict.fromkeys(str(one.message) for one in said)), dtype=np.str_), **fields)
    sys.stdout.buffer.write(stream.getvalue())


def _time(content: dict[str, Array], count: int, name: str, findings: list[Finding]) -> Array:
    """The record's clock, or the rows' numbers times the stated step."""
    clock = content.get("rec.time_cont")
    if clock is not None:
        if clock.shape != (count,) or not np.isfinite(clock).all():
            raise error("CS0201", f"rec.time_cont has shape {clock.shape}, expected ({count},), in finite numbers", file=name)
        return clock
    step = float(content["time_data.dt"]) if content.get("time_data.dt", np.empty(0)).shape == () else np.nan
    if not 0 < step < np.inf:
        raise error("CS0201", "has no clock: neither rec.time_cont nor a step in time_data.dt", file=name,
                    hint="write the log as CSV with time_s")
    findings.append(Finding("CS1614", "note", f"has no clock; time is the row's number times time_data.dt = {step:g} s",
                            file=name, hint="true if the logger kept its step and lost no row"))
    return np.asarray(np.arange(count) * step, dtype=float)

"""The public KUKA KR300 records: MATLAB files of "Dataset and baseline for an industrial robot identification benchmark".

github.com/JonasWeigand/Robot_Identification, MIT licence. Struct `rec`: `time_cont` [s], `act_pos_mot_deg` and
`act_pos_se_deg` (6, n) [deg], `act_vel_mot_deg_per_s`, `act_torque_abs_nm` [N m] on the motor side; `para.u` are the gear
ratios. Link encoders carry data on axes 1-3 only; an axis whose link angle never moves has none.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.common.findings import error

Array = NDArray[np.float64]
# Struct, field: what a record must have.
NEEDED = (("rec", "time_cont"), ("rec", "act_pos_mot_deg"), ("rec", "act_pos_se_deg"), ("rec", "act_vel_mot_deg_per_s"),
          ("rec", "act_torque_abs_nm"), ("para", "u"))


def read_kuka_kr300(file: str | Path) -> dict[str, Array]:
    """The record as columns of a joint deflection log (docs/formats.md): the torque on the gear side.

    Raises CompstiffError: CS0005 cannot be read, CS0201 no MATLAB file or not one of these records.
    """
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadError

    name = str(file)
    try:
        content: dict[str, Any] = loadmat(name, squeeze_me=True, struct_as_record=False)
    except OSError as reason:
        raise error("CS0005", f"cannot be read: {reason.strerror or reason}", file=name) from reason
    except (MatReadError, ValueError, TypeError, NotImplementedError, KeyError) as reason:
        raise error("CS0201", f"is not a MATLAB file that can be read: {reason}", file=name) from reason
    fields = {}
    for struct, field in NEEDED:
        value = getattr(content.get(struct), field, None)
        if value is None:
            raise error("CS0201", f"has no {struct}.{field}", file=name,
                        hint="among .mat files only the public KUKA KR300 records are read; write others as CSV")
        fields[field] = np.asarray(value, dtype=float)
    time = fields["time_cont"]
    columns = {"time_s": time}
    for field in ("act_pos_mot_deg", "act_pos_se_deg", "act_vel_mot_deg_per_s", "act_torque_abs_nm"):
        if fields[field].shape != (6, len(time)):
            raise error("CS0201", f"rec.{field} has shape {fields[field].shape}, expected (6, {len(time)})", file=name)
    for k in range(6):
        link = fields["act_pos_se_deg"][k]
        if not np.all(np.isfinite(link)) or np.ptp(link) == 0:
            continue
        columns[f"q{k + 1}_motor_deg"] = fields["act_pos_mot_deg"][k]
        columns[f"q{k + 1}_link_deg"] = link
        columns[f"q{k + 1}_torque_nm"] = fields["act_torque_abs_nm"][k] * fields["u"][k]
        columns[f"q{k + 1}_speed_deg_s"] = fields["act_vel_mot_deg_per_s"][k]
    return columns

"""Points whose deviation belongs to another place of the path: rows that were shifted, or a log that is late."""

from __future__ import annotations

import numpy as np

from compensator.correction.predict import Predicted
from compensator.learning.rows import Rows
from identification.common.arrays import Array, rms
from identification.common.findings import Finding

# Looked at up to so far along the path [m], in steps; said from this shift on, where it leaves under this share of what is left
# as it is, which is over so many sigmas of the points (engineering judgement).
FARTHEST, STEP, LEAST, SHARE, SIGMAS = 10e-3, 0.5e-3, 1.5e-3, 0.6, 3.0


def said_of_shift(rows: Rows, measured: Array, predicted: Predicted, source: str) -> list[Finding]:
    """A warning (CS5329) where measured (n,) [m] follows the prediction far better when that is taken farther along the path,
    or less far, by the same everywhere."""
    length, moved = predicted.path.length[predicted.targets], predicted.prediction.position
    if not len(length) or not np.isfinite(length).all():
        return []
    shifts = np.arange(-round(FARTHEST / STEP), round(FARTHEST / STEP) + 1) * STEP
    taken = [np.column_stack([np.interp(length + by, length, axis) for axis in moved.T]) for by in shifts]
    left = np.array([_left(measured, rows.seen(field)[:, 0]) for field in taken])
    best, as_is = int(np.argmin(left)), float(left[len(shifts) // 2])
    if abs(shifts[best]) < LEAST or left[best] > SHARE * as_is or as_is < SIGMAS * rms(rows.sigma):
        return []
    where = f"{1e3 * abs(shifts[best]):.1f} mm {'farther' if shifts[best] > 0 else 'less far'} along the path"
    return [Finding("CS5329", "warning", f"the points are off as is predicted {where}, not at their own places: "
                    f"{1e6 * left[best]:.1f} um would be left in place of {1e6 * as_is:.1f}", file=source,
                    hint="were rows of the table shifted against their places, or is the log late "
                    "(force_log.position_late_ms)?")]


def _left(measured: Array, told: Array) -> float:
    """RMS [m] of what the best multiple of told (n,) [m] leaves of measured (n,) [m]."""
    power = float(told @ told)
    return rms(measured - (float(measured @ told) / power if power > 0 else 0.0) * told)

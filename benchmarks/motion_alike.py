"""Whether a record can tell two causes of the motion judge apart at all: least squares with each one's columns.

Columns are what a cause adds to link minus motor angle, to first order, from the measured channels; nothing of the packages.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.signal import savgol_filter

from benchmarks.motion_drive import Array

APART = 6.0                                                             # chi squared: odds of twenty to one


def smooth(signal: Array, rate: float, order: int) -> Array:
    window = max(7, round(0.03 * rate) | 1)
    return np.asarray(savgol_filter(signal, window, 3, deriv=order, delta=1 / rate))


def stop(torque: Array, width: float) -> Array:
    """An elastic element that slides: what remembers the way that the torque came."""
    out, x, last = np.empty_like(torque), 0.0, float(torque[0])
    for i, t in enumerate(torque.tolist()):
        x = max(-width, min(width, x + t - last))
        last, out[i] = t, x
    return out


def columns(name: str, motor: Array, torque: Array, rate: float, lines: Sequence[float]) -> Array:
    """What `name` adds, (rows, k); motor angle [rad], torque [Nm], `lines` in cycles a turn of the joint."""
    speed, peak, quiet = smooth(motor, rate, 1), float(np.abs(torque).max()), smooth(torque, rate, 0)
    if name == "channel_delay(link)":
        found = [speed]
    elif name == "channel_delay(torque)":
        found = [smooth(torque, rate, 1)]
    elif name == "joint_friction":
        found = [np.tanh(speed / 0.005), speed]
    elif name == "motor_inertia":
        found = [smooth(motor, rate, 2)]
    elif name == "backlash":
        found = [np.tanh(quiet / (w * peak)) for w in (0.01, 0.04)]
    elif name == "soft_zone":
        found = [*(np.tanh(quiet / (w * peak)) for w in (0.05, 0.1, 0.2, 0.4)), (quiet / peak) ** 3]
    elif name == "hysteresis":
        found = [stop(quiet, w * peak) for w in (0.03, 0.1, 0.2, 0.4)]
    elif name == "transmission_error":
        found = [motor, motor**2, np.cos(motor), np.sin(motor)]
        found += [f(n * motor) for n in lines for f in (np.cos, np.sin)]
    else:
        return np.zeros((len(motor), 0))
    return np.column_stack(found)


def chi_squared(motor: Array, link: Array, torque: Array, rate: float, names: Sequence[str], others: Sequence[str],
                lines: Sequence[float]) -> float:
    """By how much `names` leave more than `others` do, whitened by what both together leave (first order)."""
    base = np.column_stack([np.ones_like(torque), torque])
    sides = [np.column_stack([base, *(columns(n, motor, torque, rate, lines) for n in some)]) for some in (names, others)]
    seen = link - motor

    def left(y: Array, x: Array) -> Array:
        return np.asarray(y - x @ np.linalg.lstsq(x, y, rcond=1e-12)[0])

    both = left(seen, np.column_stack(sides))
    rho = float(np.clip(both[1:] @ both[:-1] / (both @ both), 0, 0.999))
    rest = [left(seen[1:] - rho * seen[:-1], x[1:] - rho * x[:-1]) for x in (*sides, np.column_stack(sides))]
    scale = float(rest[2] @ rest[2]) / len(seen)
    return float((rest[0] @ rest[0] - rest[1] @ rest[1]) / scale)


def apart(motor: Array, link: Array, torque: Array, rate: float, wrong: Sequence[str], right: Sequence[str],
          lines: Sequence[float]) -> bool:
    """Whether the true names fit this record so much better than the wrong ones that these had no excuse."""
    return chi_squared(motor, link, torque, rate, wrong, right, lines) > APART

"""A joint in motion that shares no code with the program: motor, gear, link, a controller's log of them.

The link follows a given path, so everything else follows from the laws of motion without integrating them (a two-mass drive is
differentially flat): the gear carries what accelerates the link, its weight and what the other axes push; the twist is the
gear's law of that torque; the motor stands at link plus twist; its torque accelerates it, overcomes friction and loads the
gear.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

RATE = 250.0
STIFFNESS = 5e6
LINK_INERTIA = 900.0
FAULTS = ("channel_delay", "torque_delay", "joint_friction", "motor_inertia", "hysteresis", "soft_zone", "backlash")


def smooth_noise(rng: np.random.Generator, count: int, size: float, lasts: float) -> np.ndarray:
    """Ornstein-Uhlenbeck noise of a given standard deviation and memory [s]."""
    keep = np.exp(-1 / RATE / lasts)
    values, state = np.empty(count), size * rng.standard_normal()
    for k in range(count):
        state = keep * state + size * np.sqrt(1 - keep**2) * rng.standard_normal()
        values[k] = state
    return values


def waves(rng: np.random.Generator, time: np.ndarray, size: float, low: float, high: float, terms: int = 6) -> np.ndarray:
    """A sum of sines between two frequencies [Hz] with a given RMS."""
    found = np.zeros_like(time)
    for _ in range(terms):
        found += np.sin(2 * np.pi * rng.uniform(low, high) * time + rng.uniform(0, 2 * np.pi))
    return size * found / np.sqrt(terms / 2)


def iwan(torque: np.ndarray, amplitude: float, reach: float) -> np.ndarray:
    """Lag of the twist by friction inside: eight sliders that slip at different torques, the mean of their states."""
    limits = reach * np.linspace(0.3, 1.7, 8)
    state = np.zeros(8)
    found = np.empty_like(torque)
    before = torque[0]
    for k, value in enumerate(torque):
        state = np.clip(state + (value - before) / limits, -1, 1)
        before = value
        found[k] = -amplitude * state.mean()
    return found


def columns(seed: int, faults: dict[str, float], *, seconds: float = 20.0, noise: float = 8e-6, joint: int = 2,
            stiffness: float = STIFFNESS) -> dict[str, np.ndarray]:
    """A log's columns (docs/formats.md) with the named faults, sizes in typical units; noise [rad]."""
    rng = np.random.default_rng(seed)
    count = int(seconds * RATE)
    time = np.arange(count) / RATE
    # Slower than 2 Hz, so that the log's derivatives are exact enough; the other axes push up to 3 Hz.
    link = waves(rng, time, 0.15, 0.08, 0.5)
    push = waves(rng, time, 700.0, 0.15, 3.0, 12)
    speed, acceleration = np.gradient(link, time), np.gradient(np.gradient(link, time), time)
    carried = LINK_INERTIA * acceleration + 500.0 * np.sin(link) + push
    twist = carried / stiffness
    if "soft_zone" in faults:
        twist = twist + faults["soft_zone"] * 8e-5 * np.tanh(carried / 250.0)
    if "backlash" in faults:
        twist = twist + faults["backlash"] * 5e-5 * np.tanh(carried / 4.0)
    if "hysteresis" in faults:
        twist = twist + iwan(carried, faults["hysteresis"] * 6e-5, 160.0)
    motor = link + twist
    torque = carried.copy()
    if "motor_inertia" in faults:
        torque += faults["motor_inertia"] * 700.0 * np.gradient(np.gradient(motor, time), time)
    if "joint_friction" in faults:
        motor_speed = np.gradient(motor, time)
        torque += faults["joint_friction"] * (300.0 * np.tanh(motor_speed / 4e-3) + 900.0 * motor_speed)
    logged_link = link
    if "channel_delay" in faults:
        logged_link = np.interp(time - 3e-3 * faults["channel_delay"], time, link)
    if "torque_delay" in faults:
        torque = np.interp(time - 12e-3 * faults["torque_delay"], time, torque)
    if "angle_error" in faults:
        logged_link = logged_link + faults["angle_error"] * 2e-4 * np.sin(25 * link)
    logged_link = logged_link + smooth_noise(rng, count, noise, 0.1) + noise * rng.standard_normal(count)
    torque = torque + 15.0 * rng.standard_normal(count)
    return {"time_s": time, f"q{joint}_motor_deg": np.degrees(motor), f"q{joint}_link_deg": np.degrees(logged_link) - 0.05,
            f"q{joint}_torque_nm": torque, f"q{joint}_speed_deg_s": np.degrees(speed)}


def write(path: Path, values: dict[str, np.ndarray]) -> Path:
    """The columns as CSV."""
    np.savetxt(path, np.column_stack(list(values.values())), delimiter=",", header=",".join(values), comments="", fmt="%.10g")
    return path

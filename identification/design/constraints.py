"""The limits of a run (paper eq. 19-21) as smooth inequalities `g <= 0` of order one, with derivatives by angles and load line.

    wrist, elbow   sin(margin)^2 - sin(angle)^2 <= 0, angle of axis 5, or between the arm's two links
    shoulder       1 - (distance of the wrist's centre from axis 1 / margin)^2 <= 0
    reach          the TCP's distance from axis 1 inside the window of cell.yaml, as shares of its ends
    rod            its angle inside the window
    phi            cos(limit) |a| |b| - a . b <= 0, a and b the horizontal parts of (TCP - base origin) and (TCP - flange), over
                   |TCP| |TCP - flange| as they are; it holds by itself where the tool is vertical
    range          each component of the deflection under the largest load over the sensors' range, less 1
    signal         1 - that deflection in sigmas over the fewest allowed
    box            the TCP inside it

Range and signal are those of the worst of the loaded axes: where two are equally bad their derivative jumps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.design.information import Instrument
from identification.design.loads import Loads
from identification.design.stance import Stance, by_angles, elbow_angle, lever_slope, wrist_slope

Array = NDArray[np.float64]
# Keeps the derivative of a horizontal length finite where it is zero [m].
TINY_M = 1e-9


@dataclass(frozen=True)
class Margins:
    """phi [rad], None for no window. joint [rad] to the joint limits; wrist, elbow [rad] and shoulder [m] from singularities.
    range [m] of the sensors; signal: smallest deflection, in sigmas of the sensor along it."""

    phi: float | None = float(np.radians(80))
    joint: float = float(np.radians(2))
    wrist: float = float(np.radians(10))
    elbow: float = float(np.radians(10))
    shoulder: float = 0.15
    range: float = 5e-3
    signal: float = 10.0


def _carried(rig: Instrument, columns: Array, force: Array) -> Array:
    """Deflection (n, A, 3) [m] under forces (n, A, 3) [N]."""
    return np.asarray((force @ columns * rig.compliance) @ np.swapaxes(columns, 1, 2))


def inequalities(
    rig: Instrument, margins: Margins, box: Array | None, theta: Array, arm: Stance, loads: Loads
) -> Array:
    """g (n, q), admissible where not positive, without the joint limits; theta (n, 6) [rad]."""
    robot = rig.cell.robot
    serial = robot.serial_angles(theta)
    parts = [
        np.sin(margins.wrist) ** 2 - np.sin(serial[:, 4:5]) ** 2,
        np.sin(margins.elbow) ** 2 - np.sin(elbow_angle(robot, serial)[:, None]) ** 2,
        1 - np.sum(arm.wrist[:, :2] ** 2, axis=1, keepdims=True) / margins.shoulder**2,
    ]
    if rig.cell.reach is not None:
        least, most = rig.cell.reach
        away = np.sum(arm.tcp[:, :2] ** 2, axis=1, keepdims=True)
        parts += [(least**2 - away) / most**2, away / most**2 - 1]
    if robot.window is not None:
        joint, low, high = robot.window
        angle = (theta @ robot.coupling[joint])[:, None]
        parts += [low + margins.joint - angle, angle - high + margins.joint]
    if margins.phi is not None:
        across = _horizontal(arm.tcp) * _horizontal(arm.lever)
        parts.append((np.cos(margins.phi) * across - np.sum(arm.tcp[:, :2] * arm.lever[:, :2], axis=1, keepdims=True))
                     / _lengths(arm))
    moved = _carried(rig, arm.columns, loads.peak)
    parts.append(np.abs(moved).max(axis=1) / margins.range - 1)
    parts.append(1 - np.linalg.norm(moved / rig.sensor, axis=2).min(axis=1, keepdims=True) / margins.signal)
    if box is not None:
        parts += [box[0] - arm.tcp, arm.tcp - box[1]]
    return np.concatenate(parts, axis=1)


def _horizontal(vector: Array) -> Array:
    return np.asarray(np.sqrt(np.sum(vector[:, :2] ** 2, axis=1, keepdims=True) + TINY_M**2))


def _lengths(arm: Stance) -> Array:
    long, short = (np.linalg.norm(vector, axis=1, keepdims=True) for vector in (arm.tcp, arm.lever))
    return np.asarray(long * short + 1e-12)


def inequality_slopes(
    rig: Instrument, margins: Margins, box: Array | None, theta: Array, arm: Stance, loads: Loads, columns_slope: Array
) -> tuple[Array, Array]:
    """Derivatives of g by the angles (n, 6, q) and by the line (n, 3, q); columns_slope: of `stance.columns_slope`."""
    robot = rig.cell.robot
    serial, count = robot.serial_angles(theta), len(theta)
    by_elbow: Array = np.zeros((count, 6, 2))
    by_elbow[:, 4, 0] = -np.sin(2 * serial[:, 4])
    by_elbow[:, 2, 1] = -np.sin(2 * elbow_angle(robot, serial))
    moving = wrist_slope(arm)
    shoulder = -2 * np.einsum("nja,na->nj", moving[:, :, :2], arm.wrist[:, :2])[:, :, None] / margins.shoulder**2
    parts = [by_angles(robot, np.concatenate([by_elbow, shoulder], axis=2))]
    if rig.cell.reach is not None:
        away = by_angles(robot, 2 * np.einsum("nja,na->nj", arm.serial[:, :, :2], arm.tcp[:, :2])[:, :, None])
        parts += [-away / rig.cell.reach[1]**2, away / rig.cell.reach[1]**2]
    if robot.window is not None:
        row = np.tile(robot.coupling[robot.window[0]], (count, 1))[:, :, None]
        parts += [-row, row]
    if margins.phi is not None:
        parts.append(by_angles(robot, _phi_slope(margins.phi, arm)))
    by_range, by_line = _signal_slopes(rig, margins, arm, loads, columns_slope)
    parts.append(by_range)
    before, after = sum(part.shape[2] for part in parts[:-1]), 0
    if box is not None:
        tcp = by_angles(robot, arm.serial)
        parts += [-tcp, tcp]
        after = 6
    line = np.zeros((count, 3, before + by_line.shape[2] + after))
    line[:, :, before: before + by_line.shape[2]] = by_line
    return np.concatenate(parts, axis=2), line


def _phi_slope(phi: float, arm: Stance) -> Array:
    """Derivative (n, 6, 1) by the serial angles."""
    out, tool = _horizontal(arm.tcp), _horizontal(arm.lever)
    scale = _lengths(arm)
    moved, turned = arm.serial[:, :, :2], lever_slope(arm)[:, :, :2]
    towards, lever = arm.tcp[:, :2], arm.lever[:, :2]
    by_tcp = np.cos(phi) * tool / out * towards - lever
    by_lever = np.cos(phi) * out / tool * lever - towards
    top = np.einsum("nja,na->nj", moved, by_tcp) + np.einsum("nja,na->nj", turned, by_lever)
    value = np.cos(phi) * out * tool - np.sum(towards * lever, axis=1, keepdims=True)
    # The flange's distance to the TCP does not change; the TCP's to the base does.
    longer = np.einsum("nja,na->nj", arm.serial, arm.tcp) / np.sum(arm.tcp**2, axis=1, keepdims=True)
    return np.asarray((top / scale - value / scale * longer)[:, :, None])


def _signal_slopes(
    rig: Instrument, margins: Margins, arm: Stance, loads: Loads, columns_slope: Array
) -> tuple[Array, Array]:
    """Derivatives of range and signal by the angles (n, 6, 4) and the line (n, 3, 4)."""
    runs = np.arange(len(arm.tcp))
    moved = _carried(rig, arm.columns, loads.peak)
    worst = np.abs(moved).argmax(axis=1)
    sign = np.sign(moved[runs[:, None], worst, np.arange(3)])
    sigmas = np.linalg.norm(moved / rig.sensor, axis=2)
    least = sigmas.argmin(axis=1)
    weakest = np.maximum(sigmas[runs, least], 1e-12)
    # Each is `toward . G force`: its force, and the direction in which the deflection counts.
    which = np.concatenate([worst, least[:, None]], axis=1)
    force = loads.peak[runs[:, None], which]
    toward = np.zeros((len(runs), 4, 3))
    toward[:, :3] = np.eye(3) * sign[:, :, None] / margins.range
    toward[:, 3] = -moved[runs, least] / rig.sensor**2 / weakest[:, None] / margins.signal
    softened = arm.columns * rig.compliance
    by_columns = toward[:, :, :, None] * (force @ softened)[:, :, None, :] + force[:, :, :, None] * (
        toward @ softened)[:, :, None, :]
    count = len(runs)
    by_angle = columns_slope.reshape(count, 6, 18) @ by_columns.reshape(count, 4, 18).swapaxes(1, 2)
    by_force = (toward @ softened) @ np.swapaxes(arm.columns, 1, 2)
    line = by_force * loads.peak_by_line[runs[:, None], which][:, :, None]
    return np.asarray(by_angle), np.swapaxes(line, 1, 2)

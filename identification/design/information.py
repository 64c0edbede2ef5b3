"""What one run tells: its share of the posterior precision of ln c.

A run is a pose and a list of loads f_l. To first order (DESIGN.md, physics 3) the deflection under f_l is `D_l 1` with

    D_l = J diag(J^T f_l) diag(c)          (3, 6), the derivative by ln c; J the position rows of the springs' Jacobian

and the noise of row l is `N_l = S + G F_l G^T` with the sensor's variances S, the first-order compliance `G = J diag(c) J^T`
and the force error's variances F_l = force_std^2 + (relative f_l)^2; all rows of the run share one re-seating offset of
variance O. With B = sum N_l^-1 D_l, T = sum N_l^-1 and R = O^1/2, Woodbury's identity gives

    m(run) = sum D_l^T N_l^-1 D_l - B^T R (1 + R T R)^-1 R B     (6, 6).

It is the same noise as in `noise.py`, in which a part that the cell file leaves out has its usual size.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.cell import Cell
from identification.design.loads import Slot
from identification.model.kinematics import chain, chunks
from identification.noise import USUAL_FORCE_RELATIVE, USUAL_OFFSET_M

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Instrument:
    """The cell as the design sees it: compliance (6,) [rad/(N m)] about which it is linearised, and the stated noise:
    sensor (3,) [m], force (3,) [N], relative, offset (3,) [m]."""

    cell: Cell
    compliance: Array
    sensor: Array
    force: Array
    relative: float
    offset: Array


def instrument(cell: Cell, compliance: Array | None = None) -> Instrument:
    """The cell's stated noise, usual sizes where it states none; compliance: the prior's where None."""
    noise = cell.noise
    return Instrument(
        cell, 1.0 / cell.prior.stiffness if compliance is None else compliance, noise.deflection, noise.force,
        noise.force_relative if noise.force_stated else USUAL_FORCE_RELATIVE,
        noise.pose_offset if noise.offset_stated else np.full(3, USUAL_OFFSET_M))


@dataclass(frozen=True, eq=False)
class Stance:
    """The arm at n poses: columns (n, 3, 6) [m/rad], position rows of the springs' Jacobian; tcp (n, 3) [m] in the base frame;
    lever (n, 3) [m] from the origin of joint 6's frame (the flange) to the TCP."""

    columns: Array
    tcp: Array
    lever: Array


def stance(rig: Instrument, theta: Array) -> Stance:
    """The arm at controller angles (n, 6) [rad]."""
    robot = rig.cell.robot
    columns, tcp, lever = np.empty((len(theta), 3, 6)), np.empty((len(theta), 3)), np.empty((len(theta), 3))
    for part in chunks(len(theta)):
        frames = chain(robot, np.ascontiguousarray(robot.serial_angles(theta[part]).T))
        arm = np.einsum("ijn,j->in", frames.rotation, rig.cell.flange_from_tcp.position)
        point = frames.origins[5] + arm
        columns[part] = np.einsum("icn,ij->ncj", np.cross(frames.axes, point - frames.origins, axis=1), robot.load_matrix)
        tcp[part], lever[part] = point.T, arm.T
    return Stance(columns, tcp, lever)


def largest_deflection(rig: Instrument, columns: Array, slot: Slot) -> Array:
    """Predicted deflection (n, 3, 3) [m] under the slot's largest force along each base axis; columns: of `stance`.
    Second index: the component, third: the axis of the force."""
    compliance = np.einsum("nai,i,nbi->nab", columns, rig.compliance, columns)
    return np.asarray(compliance * slot.largest)


def run_information(rig: Instrument, columns: Array, slot: Slot) -> Array:
    """m (n, 6, 6) of runs with these loads at n poses; columns (n, 3, 6): of `stance`."""
    count = len(columns)
    softened = columns * rig.compliance
    carried = softened @ np.swapaxes(columns, 1, 2)
    total, shared, common = np.zeros((count, 6, 6)), np.zeros((count, 3, 6)), np.zeros((count, 3, 3))
    # Rows with the same magnitudes have the same noise, and along one axis the same D up to its sign.
    for magnitude, signs in slot.grouped:
        variance = rig.force**2 + (rig.relative * magnitude) ** 2
        noise = np.diag(rig.sensor**2) + (carried * variance) @ np.swapaxes(carried, 1, 2)
        precision = np.linalg.inv(noise)
        common += signs.size * precision
        if magnitude.any():
            design = softened * (magnitude @ columns)[:, None, :]
            weighted = precision @ design
            total += signs.size * (np.swapaxes(design, 1, 2) @ weighted)
            shared += float(np.sum(signs)) * weighted
    root = np.diag(rig.offset)
    inner = root @ np.linalg.inv(np.eye(3) + root @ common @ root) @ root
    result = total - np.swapaxes(shared, 1, 2) @ inner @ shared
    return np.asarray(0.5 * (result + np.swapaxes(result, 1, 2)))

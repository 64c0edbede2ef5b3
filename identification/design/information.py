"""What one run tells: its share of the posterior precision of ln c (paper eq. 17), and how that changes with the pose.

A run is a pose and a list of loads f_l. To first order (model/compliance.py, the torque as if nothing yielded) the deflection
under f_l is `D_l 1` with

    D_l = J diag(J^T f_l) diag(c)          (3, 6), the derivative by ln c; J the position rows of the springs' Jacobian

and the noise of row l is `N_l = S + G F_l G^T` with the sensor's variances S, the first-order compliance `G = J diag(c) J^T`
and the force error's variances F_l = force_std^2 + (relative f_l)^2, none where nothing pushes; all rows of the run share one
re-seating offset of variance O. With B = sum N_l^-1 D_l, T = sum N_l^-1 and R = O^1/2, Woodbury's identity gives

    m(run) = sum D_l^T N_l^-1 D_l - B^T R (1 + R T R)^-1 R B     (6, 6).

It is the same noise as in fit/noise.py, in which a part that the cell file leaves out has its usual size.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.design.loads import Loads
from identification.fit.noise import USUAL_OFFSET_M, force_error
from identification.model.cell import Cell

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
        cell, 1.0 / cell.prior.stiffness if compliance is None else compliance, noise.deflection, *force_error(noise),
        noise.pose_offset if noise.offset_stated else np.full(3, USUAL_OFFSET_M))


@dataclass(frozen=True, eq=False)
class Parts:
    """The pieces of m for n runs with K distinct loads, as named above; `weighted` N^-1 D, `inner` R (1 + R T R)^-1 R."""

    carried: Array
    variance: Array
    precision: Array
    design: Array
    weighted: Array
    shared: Array
    inner: Array


def parts_of(rig: Instrument, columns: Array, loads: Loads) -> Parts:
    """Of n runs; columns (n, 3, 6) [m/rad]: position rows of the springs' Jacobian."""
    softened = columns * rig.compliance
    carried = softened @ np.swapaxes(columns, 1, 2)
    loaded = np.any(loads.force != 0, axis=-1, keepdims=True)
    variance = loaded * rig.force**2 + (rig.relative * loads.force) ** 2
    noise = np.diag(rig.sensor**2) + (carried[:, None] * variance[:, :, None, :]) @ np.swapaxes(carried, 1, 2)[:, None]
    precision = np.asarray(np.linalg.inv(noise), dtype=float)
    design = softened[:, None] * (loads.force @ columns)[:, :, None, :]
    weighted = precision @ design
    common = np.sum(loads.rows[:, :, None, None] * precision, axis=1)
    shared = np.sum(loads.surplus[:, :, None, None] * weighted, axis=1)
    root = np.diag(rig.offset)
    inner = root @ np.linalg.inv(np.eye(3) + root @ common @ root) @ root
    return Parts(carried, variance, precision, design, weighted, shared, inner)


def run_information(rig: Instrument, columns: Array, loads: Loads, parts: Parts | None = None) -> Array:
    """m (n, 6, 6) of n runs; columns (n, 3, 6) [m/rad]: position rows of the springs' Jacobian; parts: where they are at
    hand."""
    parts = parts_of(rig, columns, loads) if parts is None else parts
    total = np.sum(loads.rows[:, :, None, None] * (np.swapaxes(parts.design, 2, 3) @ parts.weighted), axis=1)
    result = total - np.swapaxes(parts.shared, 1, 2) @ parts.inner @ parts.shared
    return np.asarray(0.5 * (result + np.swapaxes(result, 1, 2)))


def information_slope(
    rig: Instrument, columns: Array, loads: Loads, weight: Array, parts: Parts | None = None
) -> tuple[Array, Array]:
    """Derivatives of trace(weight m) (n,): by the columns (n, 3, 6), and by the loads' forces (n, K, 3); weight (6, 6)
    symmetric.

    Backwards through the formula: X = I B and Y = X W with I the inner matrix and W the weight; the derivative by
    N_l^-1 is `n (D W D^T + X W X^T) - s (Y D^T + D Y^T)`, by D_l `2 N^-1 (n D W - s Y)`, n rows, s their surplus.
    """
    parts = parts_of(rig, columns, loads) if parts is None else parts
    rows, surplus = loads.rows[:, :, None, None], loads.surplus[:, :, None, None]
    across = (parts.inner @ parts.shared)[:, None]
    mixed = across @ weight
    weighed = parts.design @ weight
    one_way = mixed @ np.swapaxes(parts.design, 2, 3)
    by_precision = rows * (weighed @ np.swapaxes(parts.design, 2, 3) + mixed @ np.swapaxes(across, 2, 3)) - surplus * (
        one_way + np.swapaxes(one_way, 2, 3))
    by_design = 2 * parts.precision @ (rows * weighed - surplus * mixed)
    by_noise = -parts.precision @ by_precision @ parts.precision
    # N = S + G F G: by G, and by the force through F.
    half = by_noise @ parts.carried[:, None] * parts.variance[:, :, None, :]
    by_carried = np.sum(half + np.swapaxes(half, 2, 3), axis=1)
    by_columns = 2 * (by_carried @ columns) * rig.compliance
    turned = np.einsum("nkai,nai->nki", by_design, columns)
    torque = loads.force @ columns
    by_columns += rig.compliance * np.sum(
        torque[:, :, None, :] * by_design + loads.force[:, :, :, None] * turned[:, :, None, :], axis=1)
    by_variance = np.einsum("nab,nkbc,nca->nka", parts.carried, by_noise, parts.carried)
    by_force = (turned * rig.compliance) @ np.swapaxes(columns, 1, 2) + 2 * rig.relative**2 * loads.force * by_variance
    return by_columns, by_force

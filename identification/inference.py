"""Posterior of the joint compliances: MAP and Laplace covariance in ln c (paper eq. 11-14, in logarithms of compliances).

    -2 ln posterior(x) = |z - eta(exp x)|^2 (Sigma^-1) + |x - x0|^2 (P^-1) ,    x = ln c

eta is the finite model at equilibrium. Sigma has three parts (EFFECTS.md, procedure 2): the sensor, the error of the
force carried through `J c J^T`, and an offset common to all rows of one pose visit. Its overall size is estimated from
the data, started from what the cell file states.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.cell import Cell, Noise
from identification.findings import Finding, error
from identification.measurements import Measurements
from identification.model.compliance import compliance_matrix, equilibrium, sensitivity, signature
from identification.model.stiffness import IdentifiedModel

Array = NDArray[np.float64]

# The stated noise counts as this many readings when its size is estimated: a few rows cannot talk it down to nothing.
NOISE_PRIOR_READINGS = 5.0
# Grades by the posterior's std of ln k: a stiffness known to a fifth is reliable; one whose prior shrank by less than a
# third of its width was not seen by the data.
RELIABLE_LOG_STD = 0.2
UNSEEN_SHRINKAGE = 2.0 / 3.0
MAX_STEPS = 50


@dataclass(frozen=True, eq=False)
class Fit:
    """What the data say.

    model: the posterior. residual (N, 3) [m]: measured minus predicted, all rows, NaN where not measured. noise_scale:
    estimated over stated standard deviation of the noise. sensor_std (3,) [m]: the stated one of a reading. held_out: RMS [m]
    of the validate rows with the prior's and with the posterior's stiffnesses, None without such rows.
    """

    model: IdentifiedModel
    residual: Array
    noise_scale: float
    sensor_std: Array
    held_out: tuple[float, float] | None
    findings: tuple[Finding, ...]


@dataclass(frozen=True, eq=False)
class _Weights:
    """Sigma^-1 of n rows in pose visits: per row `precision` (n, 3, 3), per visit the rank-3 part of the pose offset."""

    precision: Array
    visit: NDArray[np.intp]
    offset: Array            # (visits, 3, 3): (Gamma^-1 + sum precision)^-1, zero where no offset is stated

    def inner(self, left: Array, right: Array) -> Array:
        """left^T Sigma^-1 right for left (n, 3, p), right (n, 3, q): (p, q)."""
        weighted = self.precision @ right
        total = np.einsum("nip,niq->pq", left, weighted)
        if not self.offset.any():
            return np.asarray(total)
        of_right = self._by_visit(weighted)
        of_left = of_right if left is right else self._by_visit(self.precision @ left)
        return np.asarray(total - np.einsum("vip,vij,vjq->pq", of_left, self.offset, of_right))

    def _by_visit(self, values: Array) -> Array:
        total = np.zeros((len(self.offset), *values.shape[1:]))
        np.add.at(total, self.visit, values)
        return total


def _weights(rows: Measurements, noise: Noise, cell: Cell, compliance: Array) -> _Weights:
    """Sigma^-1 at these compliances; components that were not measured have no weight."""
    measured = ~np.isnan(rows.deflection)
    sensor = np.where(np.isnan(rows.sigma), noise.deflection, rows.sigma)
    force = noise.force**2 + (noise.force_relative * rows.wrench[:, :3]) ** 2
    covariance = np.zeros((len(rows), 3, 3))
    if force.any():
        carried = compliance_matrix(cell.robot, rows.theta, cell.flange_from_tcp, compliance)[:, :3, :3]
        covariance = np.einsum("nij,nj,nkj->nik", carried, force, carried)
    covariance[:, range(3), range(3)] += sensor**2
    both = measured[:, :, None] & measured[:, None, :]
    precision = np.where(both, np.linalg.inv(np.where(both, covariance, np.eye(3))), 0.0)
    _, visit = np.unique(rows.visit, return_inverse=True)
    visits = int(visit.max()) + 1
    offset = np.zeros((visits, 3, 3))
    if noise.pose_offset.any():
        total = np.zeros((visits, 3, 3))
        np.add.at(total, visit, precision)
        root = np.diag(noise.pose_offset)
        # Woodbury, written so that an axis without offset stays finite: G^1/2 (I + G^1/2 T G^1/2)^-1 G^1/2.
        offset = root @ np.linalg.inv(np.eye(3) + root @ total @ root) @ root
    return _Weights(precision, visit, offset)


def fit_stiffness(cell: Cell, measurements: Measurements) -> Fit:
    """MAP, Laplace covariance and noise size from the rows with purpose `identify`.

    Raises CompstiffError: CS1009 no row to fit, CS1010 data that prefer all compliances negative, CS1011 no convergence.
    """
    rows = measurements.select(~measurements.validate)
    if not np.any(rows.wrench != 0):
        raise error("CS1009", "no loaded row has the purpose identify: all are kept for validation", file=measurements.source)
    z = np.nan_to_num(rows.deflection)
    prior_mean = -np.log(cell.prior.stiffness)
    prior_precision = np.eye(6) / cell.prior.log_std**2
    _check_sign(cell, rows, z, np.exp(prior_mean))
    x = _start(cell, rows, z, prior_mean, prior_precision)
    scale = 1.0
    for _ in range(MAX_STEPS):
        weights = _weights(rows, cell.noise, cell, np.exp(x))
        position, slope = sensitivity(cell.robot, rows.theta, cell.flange_from_tcp, rows.wrench, np.exp(x))
        by_log = slope * np.exp(x)
        residual = (z - position)[:, :, None]
        information = weights.inner(by_log, by_log)
        chi2 = float(weights.inner(residual, residual)[0, 0])
        readings = int((~np.isnan(rows.deflection)).sum())
        learned = np.trace(np.linalg.solve(information + scale**2 * prior_precision, information))
        new_scale = float(np.sqrt((NOISE_PRIOR_READINGS + chi2) / (NOISE_PRIOR_READINGS + readings - learned)))
        gradient = weights.inner(by_log, residual)[:, 0] / new_scale**2 - prior_precision @ (x - prior_mean)
        curvature = information / new_scale**2 + prior_precision
        step = np.linalg.solve(curvature, gradient)
        change = max(float(np.sqrt(step @ curvature @ step)), abs(new_scale / scale - 1))
        x = x + step * min(1.0, 1.0 / max(np.max(np.abs(step)), 1e-300))
        scale = new_scale
        if change < 1e-6:
            break
    else:
        raise error("CS1011", f"the fit did not converge in {MAX_STEPS} steps: the last moved by {change:.2g} posterior "
                    "standard deviations", file=measurements.source, hint="check the units and the prior")
    covariance = np.asarray(np.linalg.inv(curvature), dtype=float)
    return _summary(cell, measurements, rows, x, covariance, scale, chi2, readings)


def _start(cell: Cell, rows: Measurements, z: Array, prior_mean: Array, prior_precision: Array) -> Array:
    """MAP of the linear model z = A c, which needs A only once: Gauss-Newton in ln c from the prior's median."""
    a = signature(cell.robot, rows.theta, cell.flange_from_tcp, rows.wrench)[:, :3]
    weights = _weights(rows, cell.noise, cell, np.exp(prior_mean))
    information, projected = weights.inner(a, a), weights.inner(a, z[:, :, None])[:, 0]

    def objective(x: Array) -> float:
        c = np.exp(x)
        return float(c @ information @ c - 2 * projected @ c + (x - prior_mean) @ prior_precision @ (x - prior_mean))

    x, damping = prior_mean.copy(), 1e-3
    value = objective(x)
    for _ in range(200):
        c = np.exp(x)
        gradient = c * (projected - information @ c) - prior_precision @ (x - prior_mean)
        curvature = c[:, None] * information * c + prior_precision
        step = np.linalg.solve(curvature + damping * np.diag(np.diag(curvature)), gradient)
        step *= min(1.0, 2.0 / max(np.max(np.abs(step)), 1e-300))
        trial = objective(x + step)
        if trial <= value:
            finished = value - trial < 1e-9 * (1 + abs(value))
            x, value, damping = x + step, trial, 0.2 * damping
            if finished:
                break
        else:
            damping = 5 * damping + 1e-12
    return x


def _check_sign(cell: Cell, rows: Measurements, z: Array, prior_compliance: Array) -> None:
    """Refuses data that the prior's deflections explain best with a negative factor."""
    a = signature(cell.robot, rows.theta, cell.flange_from_tcp, rows.wrench)[:, :3]
    weights = _weights(rows, cell.noise, cell, prior_compliance)
    # One factor a joint, so that a single soft joint cannot hide the sign of the rest.
    shape = a * prior_compliance
    size = np.sqrt(np.diag(weights.inner(shape, shape)))
    along = weights.inner(shape, z[:, :, None])[:, 0]
    seen = size > 3
    whole = shape.sum(axis=2, keepdims=True)
    factor = float(weights.inner(whole, z[:, :, None])[0, 0] / weights.inner(whole, whole)[0, 0])
    if seen.any() and factor < 0 and np.all(along[seen] < 0):
        raise error("CS1010", f"the data prefer all compliances negative: the tool moved against the force (best factor on "
                    f"the expected deflections {factor:.2f})", file=rows.source,
                    hint="forces are those that act ON the tool; deflection is loaded minus unloaded position")


def _grade(log_std: float, prior_log_std: float) -> str:
    if log_std > UNSEEN_SHRINKAGE * prior_log_std:
        return "not identifiable"
    return "reliable" if log_std <= RELIABLE_LOG_STD else "tentative"


def _summary(
    cell: Cell, measurements: Measurements, rows: Measurements, x: Array, covariance: Array, scale: float, chi2: float,
    readings: int,
) -> Fit:
    """The fit with its figures and findings."""
    predicted = equilibrium(cell.robot, measurements.theta, cell.flange_from_tcp, measurements.wrench, np.exp(x)).position
    residual = measurements.deflection - predicted
    fitted = residual[~measurements.validate]
    held_out = None
    if measurements.validate.any():
        kept = measurements.select(measurements.validate)
        literature = equilibrium(cell.robot, kept.theta, cell.flange_from_tcp, kept.wrench, 1 / cell.prior.stiffness)
        held_out = (_rms(kept.deflection - literature.position), _rms(residual[measurements.validate]))
    grades = tuple(_grade(float(std), cell.prior.log_std) for std in np.sqrt(np.diag(covariance)))
    figures = {
        "rows": len(rows), "residual_rms_um": 1e6 * _rms(fitted), "chi2": chi2, "dof": readings - 6,
        "noise_scale": scale,
    }
    findings = list(measurements.findings)
    unseen = [name for name, grade in zip(range(1, 7), grades, strict=True) if grade == "not identifiable"]
    if unseen:
        names = ", ".join(f"k{joint}" for joint in unseen)
        findings.append(Finding("CS1012", "warning", f"{names}: not identifiable from these loads, the value is the prior's",
                                file=measurements.source, hint=f"load joint{'s' if len(unseen) > 1 else ''} "
                                f"{', '.join(map(str, unseen))}: a force whose line passes the joint axis at a distance, in "
                                "another orientation of the tool"))
    if scale > 2.0:
        findings.append(Finding("CS1013", "warning", f"the residual is {scale:.1f} times what the stated noise allows; the "
                                "intervals were widened by that factor", file=measurements.source,
                                hint="compstiff diagnose finds out what the model leaves out"))
    model = IdentifiedModel(cell.robot, cell.flange_from_tcp, x, covariance, grades, figures)
    return Fit(model, residual, scale, cell.noise.deflection, held_out, tuple(findings))


def _rms(values: Array) -> float:
    return float(np.sqrt(np.nanmean(values**2)))

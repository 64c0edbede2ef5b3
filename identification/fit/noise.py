"""The measurement noise: its three parts, their variance components estimated from the data, and the weight of every row.

The covariance of the deflections of one row and of rows that share a pose visit (docs/effects.md, step 1) is

    cov(row n) = (s^2 S + f^2 G F G^T) / w_n ,    cov(row n, row m of one visit) = o^2 O

with the sensor's stated variances S (the row's own where it has them), the force error F carried through the first-order
compliance G = J diag(c) J^T, and the re-seating offset O of a visit. s, f and o are estimated by restricted maximum
likelihood (the stiffnesses integrated out), w_n is the row's weight in a Student likelihood whose degrees of freedom are
estimated too: 1 for ordinary rows, small for gross errors.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from identification.fit.load_test import LoadTest
from identification.model.compliance import compliance_matrix

Array = NDArray[np.float64]

# A part that the cell file leaves out is there all the same: these sizes are the scale of its prior then.
USUAL_OFFSET_M = 3e-6
USUAL_FORCE_RELATIVE = 0.005
# Degrees of freedom that are tried; the last is the normal distribution, the prior's favourite.
DEGREES = (3.0, 4.0, 6.0, 10.0, 20.0, 50.0, np.inf)


@dataclass(frozen=True)
class VarianceComponents:
    """Square roots of the variance components of the three parts, as multiples of what is stated of each (of what is usual
    where nothing is stated), and the Student degrees of freedom."""

    sensor: float = 1.0
    force: float = 1.0
    offset: float = 1.0
    degrees: float = np.inf

    @property
    def logs(self) -> Array:
        """ln of the three multipliers (3,)."""
        return np.log([self.sensor, self.force, self.offset])

    def within(self, stated: tuple[bool, bool, bool]) -> VarianceComponents:
        """As stated, and these for the parts that are not stated."""
        sensor, force, offset = (1.0 if known else own for known, own in zip(
            stated, (self.sensor, self.force, self.offset), strict=True))
        return VarianceComponents(sensor, force, offset, self.degrees)

    def with_logs(self, logs: Array) -> VarianceComponents:
        """The same degrees of freedom with other multipliers."""
        sensor, force, offset = np.exp(logs)
        return VarianceComponents(float(sensor), float(force), float(offset), self.degrees)


@dataclass(frozen=True, eq=False)
class NoiseModel:
    """The noise of n rows in coordinates in which each row's own covariance is diagonal.

    rotation (n, 3, 3): U^T S^-1/2, zero rows for components that were not measured. force (n, 3): eigenvalues of
    S^-1/2 G F G^T S^-1/2. measured (n, 3): the coordinate exists. visit (n,): pose visit, from 0. offset (3,): stated standard
    deviation of the re-seating offset [m]. stated: (sensor, force, offset), which parts the cell file states.
    """

    rotation: Array
    force: Array
    measured: NDArray[np.bool_]
    visit: NDArray[np.intp]
    offset: Array
    stated: tuple[bool, bool, bool]

    @cached_property
    def visits(self) -> int:
        """How many pose visits there are."""
        return int(self.visit.max()) + 1

    @cached_property
    def separable(self) -> tuple[bool, bool, bool]:
        """Which parts the rows can tell apart: re-seating needs visits with several rows, force error needs loads."""
        repeated = bool(np.any(np.bincount(self.visit, self.measured.any(axis=1)) > 1))
        return True, bool(np.any(self.force > 0.01)), repeated

    @cached_property
    def _runs(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Rows in the order of their visits, and where each visit starts in it."""
        order = np.argsort(self.visit, kind="stable")
        return order, np.searchsorted(self.visit[order], np.arange(self.visits))

    def by_visit(self, values: Array) -> Array:
        """Sums (visits, ...) of values (n, ...) over the rows of each visit."""
        order, starts = self._runs
        return np.asarray(np.add.reduceat(values[order], starts, axis=0))

    def weights(self, components: VarianceComponents, row_weight: Array | None = None) -> Weights:
        """Sigma^-1 for these variance components and row weights (n,)."""
        variance = components.sensor**2 + components.force**2 * np.where(self.measured, self.force, 0.0)
        if row_weight is not None:
            variance = variance / row_weight[:, None]
        precision = np.where(self.measured, 1.0 / variance, 0.0)
        weighted = np.swapaxes(self.rotation, 1, 2) * precision[:, None, :]
        total = self.by_visit(weighted @ self.rotation)
        root = np.diag(components.offset * self.offset)
        # Woodbury, so written that an axis without offset stays finite: G^1/2 (I + G^1/2 T G^1/2)^-1 G^1/2.
        inner = np.eye(3) + root @ total @ root
        log_determinant = -float(np.sum(np.log(precision[self.measured]))) + float(np.sum(np.linalg.slogdet(inner)[1]))
        return Weights(self, precision, root @ np.linalg.inv(inner) @ root, log_determinant)


@dataclass(frozen=True, eq=False)
class Weights:
    """Sigma^-1: per row `precision` (n, 3) in the model's coordinates, less the rank-3 part of each visit's offset
    `shared` (visits, 3, 3). log_determinant: of Sigma, without the constant of the coordinates."""

    model: NoiseModel
    precision: Array
    shared: Array
    log_determinant: float

    def inner(self, left: Array, right: Array) -> Array:
        """left^T Sigma^-1 right (p, q) for left (n, 3, p) and right (n, 3, q) in the model's coordinates."""
        weighted = self.precision[:, :, None] * right
        total = left.reshape(-1, left.shape[2]).T @ weighted.reshape(-1, right.shape[2])
        of_right = self._by_visit(weighted)
        of_left = of_right if left is right else self._by_visit(self.precision[:, :, None] * left)
        return np.asarray(total - of_left.reshape(-1, left.shape[2]).T @ (self.shared @ of_right).reshape(-1, right.shape[2]))

    def offsets(self, residual: Array) -> Array:
        """Best estimate of each visit's re-seating offset (visits, 3) [m] from a residual (n, 3)."""
        gathered = self._by_visit((self.precision * residual)[:, :, None])[:, :, 0]
        return np.asarray(np.einsum("vij,vj->vi", self.shared, gathered))

    def apply(self, columns: Array) -> Array:
        """Sigma^-1 columns (n, 3, q), all in the model's coordinates."""
        weighted = self.precision[:, :, None] * columns
        common = self.shared @ self._by_visit(weighted)
        return np.asarray(weighted - self.precision[:, :, None] * (self.model.rotation @ common[self.model.visit]))

    def _by_visit(self, weighted: Array) -> Array:
        return self.model.by_visit(np.swapaxes(self.model.rotation, 1, 2) @ weighted)


def noise_model(data: LoadTest, compliance: Array) -> NoiseModel:
    """The noise of these rows as the cell file states it, the force error carried through `compliance` (6,)."""
    cell, rows, noise = data.cell, data.rows, data.cell.noise
    measured = ~np.isnan(rows.deflection)
    sensor = np.where(np.isnan(rows.sigma), noise.deflection, rows.sigma)
    relative = noise.force_relative if noise.force_stated else USUAL_FORCE_RELATIVE
    variance = noise.force**2 + (relative * rows.wrench[:, :3]) ** 2
    carried = compliance_matrix(cell.robot, rows.theta, cell.flange_from_tcp, compliance)[:, :3, :3]
    scaled = carried / sensor[:, :, None]
    whitened = np.einsum("nij,nj,nkj->nik", scaled, variance, scaled)
    both = measured[:, :, None] & measured[:, None, :]
    # A component that was not measured gets the eigenvalue -1, so that its eigenvector is its own axis.
    eigenvalues, vectors = np.linalg.eigh(np.where(both, whitened, -np.eye(3) * ~measured[:, None, :]))
    exists = eigenvalues > -0.5
    rotation = np.where(exists[:, :, None], np.swapaxes(vectors, 1, 2) / sensor[:, None, :], 0.0)
    _, visit = np.unique(rows.visit, return_inverse=True)
    offset = noise.pose_offset if noise.offset_stated else np.full(3, USUAL_OFFSET_M)
    sensor_stated = noise.deflection_stated or not np.isnan(rows.sigma).all()
    return NoiseModel(rotation, np.maximum(eigenvalues, 0.0), exists, visit.astype(np.intp), offset,
                      (sensor_stated, noise.force_stated, noise.offset_stated))


def residual_std(data: LoadTest, components: VarianceComponents, compliance: Array) -> Array:
    """1 sigma of each component's residual (n, 3) [m] under noise of these components: sensor, force error and re-seating."""
    noise = noise_model(data, compliance)
    sensor = np.where(np.isnan(data.rows.sigma), data.cell.noise.deflection, data.rows.sigma)
    # Back from the whitened coordinates: S^1/2 U diag(f^2 lambda) U^T S^1/2, with U^T S^-1/2 = rotation.
    vectors = np.swapaxes(noise.rotation, 1, 2) * sensor[:, :, None]
    force = np.einsum("nij,nj,nij->ni", vectors, noise.force, vectors) * sensor**2
    # A Student distribution's variance is more than its scale squared.
    heavier = 1.0 if np.isinf(components.degrees) else components.degrees / (components.degrees - 2.0)
    own = (components.sensor * sensor) ** 2 + components.force**2 * force
    return np.asarray(np.sqrt(heavier * own + (components.offset * noise.offset) ** 2))


def distances(
    model: NoiseModel, components: VarianceComponents, weights: Weights, residual: Array
) -> tuple[Array, NDArray[np.int_]]:
    """Squared distance (n,) of each row's residual (n, 3), offsets taken out, in its own noise, and its components' count."""
    offsets = weights.offsets(residual)
    own = residual - np.einsum("nij,nj->ni", model.rotation, offsets[model.visit])
    variance = components.sensor**2 + components.force**2 * model.force
    return np.where(model.measured, own**2 / variance, 0.0).sum(axis=1), model.measured.sum(axis=1)


def student_weights(
    model: NoiseModel, components: VarianceComponents, weights: Weights, residual: Array
) -> tuple[Array, float]:
    """Row weights (n,) and degrees of freedom of a Student likelihood for the residual (n, 3), offsets taken out.

    The degrees of freedom are those of the largest likelihood, each doubling of heaviness costing one unit of ln
    likelihood: without evidence of gross errors the weights are all 1.
    """
    distance, count = distances(model, components, weights, residual)
    degrees, _ = tails(distance, count)
    if np.isinf(degrees):
        return np.ones(len(distance)), degrees
    return (degrees + count) / (degrees + distance), degrees


def tails(distance: Array, count: NDArray[np.int_]) -> tuple[float, float]:
    """Degrees of freedom and scale of the Student distribution that squared distances (n,) of `count` components follow."""
    best, chosen = -np.inf, (np.inf, 1.0)
    for degrees in DEGREES:
        scale = _student_scale(distance, count, degrees)
        value = float(np.sum(_student_log_density(distance / scale, count, degrees) - 0.5 * count * np.log(scale)))
        value -= np.log2(100.0 / min(degrees, 100.0))
        if value > best:
            best, chosen = value, (degrees, scale)
    return chosen


def _student_scale(distance: Array, count: NDArray[np.int_], degrees: float) -> float:
    """Common factor on the variances that fits best, by fixed-point iteration."""
    scale = 1.0
    for _ in range(30):
        weight = np.ones_like(distance) if np.isinf(degrees) else (degrees + count) / (degrees + distance / scale)
        scale = max(float(np.sum(weight * distance) / np.sum(count)), 1e-12)
    return scale


def _student_log_density(distance: Array, count: NDArray[np.int_], degrees: float) -> Array:
    """ln density of multivariate Student (normal where degrees is infinite) at a squared distance (n,)."""
    from scipy.special import gammaln

    if np.isinf(degrees):
        return np.asarray(-0.5 * distance - 0.5 * count * np.log(2 * np.pi))
    return np.asarray(gammaln(0.5 * (degrees + count)) - gammaln(0.5 * degrees) - 0.5 * count * np.log(degrees * np.pi)
                      - 0.5 * (degrees + count) * np.log1p(distance / degrees))

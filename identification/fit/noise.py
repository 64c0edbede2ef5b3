"""The measurement noise: its parts, their variance components estimated from the data, and the weight of every row.

The covariance of the deflections of the rows of one pose visit (docs/effects.md, step 1) is the sum of

    sensor     s^2 S rho^|n - m| / w     the stated variances S (the row's own where it has them), with a memory rho
    force      f^2 G (R F)^2 G^T / w     each row's own error, R of each component of the force, carried through the first-order
                                         compliance G = J diag(c) J^T
    absolute   a^2 G N G^T / w           each loaded row's own error, alike in every direction
    setup      v^2 (F_n . F_m) G_n G_m^T how far one visit's forces are stretched and turned: the rig is set up anew
    offset     o^2 O                     re-seating, one draw a visit

s, f, a, v, o and rho are estimated by restricted maximum likelihood (the stiffnesses integrated out), v and rho only where the
rows ask for them (variance_components.py). w_n is the row's weight in a Student likelihood whose degrees of freedom are
estimated too: 1 for ordinary rows, small for gross errors.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from identification.common.findings import error
from identification.fit.load_test import LoadTest
from identification.model import cell as cells
from identification.model.compliance import compliance_matrix

Array = NDArray[np.float64]

# A part that the cell file leaves out is there all the same: these sizes are the scale of its prior then.
USUAL_OFFSET_M = 3e-6
USUAL_FORCE_RELATIVE = 0.005
USUAL_FORCE_N = 0.4
# No file states these: forces of one visit against the next, relative, and the odds rho / (1 - rho) of a sensor's memory.
USUAL_SETUP = 0.001
USUAL_ODDS = 0.1
# Rows of a visit whose memory of each other counts.
REMEMBERED = 8
# A part this much (ln) smaller or larger than usual is as good as nothing or all there is.
LARGEST_LOG = 7.0
# How many times the sensor's 1 sigma the force error may move the tool: with that and LARGEST_LOG a double still holds both.
LARGEST_RATIO = 1e4


@dataclass(frozen=True)
class VarianceComponents:
    """Square roots of the variance components of the parts, as multiples of what is stated of each (of what is usual where
    nothing is stated); memory: the odds rho / (1 - rho), likewise; and the Student degrees of freedom."""

    sensor: float = 1.0
    force: float = 1.0
    absolute: float = 1.0
    offset: float = 1.0
    setup: float = 0.0
    memory: float = 0.0
    degrees: float = np.inf

    @property
    def values(self) -> Array:
        """The six multiples, in the order of PARTS."""
        return np.array([getattr(self, part) for part in PARTS])

    @property
    def logs(self) -> Array:
        """ln of the multiples (6,), of one that is nothing the smallest."""
        return np.log(np.maximum(self.values, np.exp(-LARGEST_LOG)))

    @property
    def rho(self) -> float:
        """How alike neighbouring readings of the sensor are, 0 to 1."""
        return float(memory_of(np.array(self.memory)))

    def within(self, stated: tuple[bool, ...]) -> VarianceComponents:
        """As stated, and these for the parts that are not stated."""
        return replace(self, **{part: 1.0 for part, known in zip(PARTS, stated, strict=True) if known})

    def at_most(self, multiple: float) -> VarianceComponents:
        """With no part but the sensor's above so many times the stated, or usual."""
        return replace(self, **{part: min(getattr(self, part), multiple) for part in PARTS[1:]})

    def with_logs(self, logs: Array) -> VarianceComponents:
        """The same degrees of freedom with other multiples (6,)."""
        sensor, force, absolute, offset, setup, memory = (float(value) for value in np.exp(logs))
        return VarianceComponents(sensor, force, absolute, offset, setup, memory, self.degrees)


PARTS = ("sensor", "force", "absolute", "offset", "setup", "memory")
SENSOR, FORCE, ABSOLUTE, OFFSET, SETUP, MEMORY = range(6)


def memory_of(multiple: Array) -> Array:
    """rho of multiples of the usual odds."""
    odds = USUAL_ODDS * np.asarray(multiple)
    return np.asarray(odds / (1.0 + odds))


@dataclass(frozen=True, eq=False)
class NoiseModel:
    """The noise of n rows in units of each component's sensor sigma.

    rotation (n, 3, 3): S^-1/2, zero where a component was not measured. force, absolute (n, 3, 3): roots of the two parts of
    the force error in these units. setups (n, 3, 9): what one visit's forces do to its rows. measured (n, 3). visit (n,): pose
    visit, from 0. offset (3,): stated standard deviation of the re-seating offset [m]. stated (6,): which of PARTS the cell
    file states. active (6,): which of PARTS there are.
    """

    rotation: Array
    force: Array
    absolute: Array
    setups: Array
    measured: NDArray[np.bool_]
    visit: NDArray[np.intp]
    offset: Array
    stated: tuple[bool, ...]
    active: tuple[bool, ...]

    @cached_property
    def visits(self) -> int:
        """How many pose visits there are."""
        return int(self.visit.max()) + 1

    @cached_property
    def told_apart(self) -> tuple[bool, bool]:
        """Whether the rows can tell force error, and re-seating: the first needs loads, the second visits with several rows."""
        repeated = bool(np.any(np.bincount(self.visit, self.measured.any(axis=1)) > 1))
        return bool(np.any(np.linalg.norm(self.force, axis=(1, 2)) > 0.1)), repeated

    def with_parts(self, *parts: int) -> NoiseModel:
        """With these parts active too."""
        return replace(self, active=tuple(known or part in parts for part, known in enumerate(self.active)))

    def of_rows(self, rows: NDArray[np.bool_]) -> NoiseModel:
        """The noise of some of the rows."""
        _, visit = np.unique(self.visit[rows], return_inverse=True)
        return replace(self, rotation=self.rotation[rows], force=self.force[rows], absolute=self.absolute[rows],
                       setups=self.setups[rows], measured=self.measured[rows], visit=visit.astype(np.intp))

    def by_visit(self, values: Array) -> Array:
        """Sums (visits, ...) of values (n, ...) over the rows of each visit."""
        order = np.argsort(self.visit, kind="stable")
        return np.asarray(np.add.reduceat(values[order], np.searchsorted(self.visit[order], np.arange(self.visits)), axis=0))

    def of_rows_alone(self, components: VarianceComponents) -> Array:
        """Precision (n, 3, 3) of each row by itself, without what its visit shares; nothing where a component was not
        measured."""
        alone = replace(self, active=(*self.active[:MEMORY], False))
        precision = np.empty((len(self.visit), 3, 3))
        precision[alone.blocks[:, 0]] = alone.own(components.values[None], np.ones(len(precision)))[0][0]
        return precision * (self.measured[:, :, None] & self.measured[:, None, :])

    @cached_property
    def blocks(self) -> NDArray[np.intp]:
        """Rows (b, B) whose noise goes together, visit by visit, -1 where a block is shorter: single rows without a memory."""
        order = np.argsort(self.visit, kind="stable")
        if not self.active[MEMORY]:
            return order[:, None]
        visit = self.visit[order]
        place = np.arange(len(order)) - np.searchsorted(visit, visit)
        first = np.flatnonzero(place % REMEMBERED == 0)
        size = np.diff(np.append(first, len(order)))
        within = first[:, None] + np.arange(size.max())
        return np.where(np.arange(size.max()) < size[:, None], order[np.minimum(within, len(order) - 1)], -1)

    @cached_property
    def block_starts(self) -> NDArray[np.intp]:
        """Where each visit's blocks start."""
        return np.searchsorted(self.visit[self.blocks[:, 0]], np.arange(self.visits))

    @cached_property
    def loading(self) -> Array:
        """What a visit has in common, as columns (n, 3, r) of unit size: its offset, then its set-up."""
        offset = self.rotation * self.offset
        return np.concatenate([offset, self.setups], axis=2) if self.active[SETUP] else offset

    def loading_scale(self, values: Array) -> Array:
        """Size (..., r) of each column of `loading` for multiples (..., 6)."""
        columns = [OFFSET] * 3 + [SETUP] * (self.loading.shape[2] - 3)
        return np.asarray(values[..., columns])

    def in_blocks(self, values: Array) -> Array:
        """Values (n, 3, p) as (b, 3 B, p), zero where a block is shorter."""
        gathered = values[self.blocks]
        gathered[self.blocks < 0] = 0.0
        return np.asarray(gathered.reshape(len(self.blocks), -1, values.shape[2]))

    def out_of_blocks(self, values: Array) -> Array:
        """The rows (n, 3, p) of blocks (b, 3 B, p)."""
        rows = np.empty((len(self.visit), 3, values.shape[2]))
        there = self.blocks >= 0
        rows[self.blocks[there]] = values.reshape(*self.blocks.shape, 3, -1)[there]
        return rows

    def own(self, values: Array, row_weight: Array) -> tuple[Array, Array]:
        """Precision (S, b, 3 B, 3 B) of each block without what visits share, and its ln determinant (S,), for multiples (S, 6)
        and row weights (n,)."""
        count, (blocks, size) = len(values), self.blocks.shape
        there, rows = (self.blocks >= 0)[:, :, None, None], self.blocks
        squared = values**2
        parts = np.zeros((count, blocks, size, 3, 3))
        for part, root in ((FORCE, self.force), (ABSOLUTE, self.absolute)):
            if self.active[part]:
                covariance = np.where(there, root[rows] @ np.swapaxes(root[rows], 2, 3), 0.0)
                parts += squared[:, part, None, None, None, None] * covariance
        sensor = squared[:, SENSOR, None]
        measured = self.measured[rows] & there[..., 0]
        if size == 1:
            single, determinant = inverse_of_three(parts[:, :, 0] + sensor[:, :, None, None] * np.eye(3))
            weight = row_weight[rows[:, 0]]
            missing = 3 - measured.sum(axis=(1, 2))
            log_determinant = np.log(determinant) - missing * np.log(sensor) - (3 - missing) * np.log(weight)
            return single * weight[:, None, None], log_determinant.sum(axis=1)
        apart = np.abs(np.subtract.outer(np.arange(size), np.arange(size)))
        alike = (memory_of(values[:, MEMORY])[:, None, None] ** apart)[:, None, :, :, None] * (
            measured[:, :, None, :] & measured[:, None, :, :])
        alike = np.where((apart == 0)[None, None, :, :, None], 1.0, alike)
        covariance = np.zeros((count, blocks, size, 3, size, 3))
        for axis in range(3):
            covariance[:, :, :, axis, :, axis] = sensor[:, :, None, None] * alike[..., axis]
        index = np.arange(size)
        covariance[:, :, index, :, index, :] += np.moveaxis(parts, 2, 0)
        root_weight: Array = np.repeat(np.sqrt(np.where(rows >= 0, row_weight[rows], 1.0)), 3, axis=1)
        root = np.asarray(np.linalg.cholesky(covariance.reshape(count, blocks, 3 * size, 3 * size)), dtype=float)
        inverse: Array = np.asarray(np.linalg.inv(covariance.reshape(root.shape)), dtype=float)
        precision: Array = inverse * (root_weight[:, :, None] * root_weight[:, None, :])
        log_determinant = 2 * np.log(np.diagonal(root, axis1=2, axis2=3)).sum(axis=(1, 2))
        seen = measured.reshape(blocks, -1)
        log_determinant -= np.log(sensor[:, 0]) * (~seen).sum() + 2 * np.log(root_weight[seen]).sum()
        return precision, log_determinant

    def weights(self, components: VarianceComponents, row_weight: Array | None = None) -> Weights:
        """Sigma^-1 for these variance components and row weights (n,)."""
        row_weight = np.ones(len(self.visit)) if row_weight is None else row_weight
        values = components.values
        precision, log_determinant = self.own(values[None], row_weight)
        loading = self.in_blocks(self.loading * self.loading_scale(values))
        total = np.add.reduceat(np.swapaxes(loading, 1, 2) @ precision[0] @ loading, self.block_starts, axis=0)
        # Woodbury, so written that a part of no size stays finite: (I + L^T P L)^-1.
        inner = np.eye(loading.shape[2]) + total
        log_total = float(log_determinant[0] + np.sum(np.linalg.slogdet(inner)[1]))
        return Weights(self, components, precision[0], loading, np.asarray(np.linalg.inv(inner), dtype=float), log_total)

    def draw(self, values: Array, row_weight: Array, rng: np.random.Generator) -> Array:
        """Noise (n, 3, S) of these rows, one draw for each of the multiples (S, 6); row_weight (n,), or (n, S)."""
        count, n = len(values), len(self.visit)
        sensor = rng.standard_normal((n, 3, count))
        if self.active[MEMORY]:
            rho = memory_of(values[:, MEMORY])
            for before, block in zip(self.blocks.T[:-1], self.blocks.T[1:], strict=True):
                there = block >= 0
                sensor[block[there]] = rho * sensor[before[there]] + np.sqrt(1 - rho**2) * sensor[block[there]]
        own = values[:, SENSOR] * sensor
        for part, root in ((FORCE, self.force), (ABSOLUTE, self.absolute)):
            if self.active[part]:
                own += values[:, part] * (root @ rng.standard_normal((n, 3, count)))
        shared = self.loading_scale(values).T * rng.standard_normal((self.visits, self.loading.shape[2], count))
        drawn = own / np.sqrt(row_weight.reshape(n, 1, -1)) + self.loading @ shared[self.visit]
        return np.asarray(np.where(self.measured[:, :, None], drawn, 0.0))


@dataclass(frozen=True, eq=False)
class Weights:
    """Sigma^-1: of each block its own precision (b, 3 B, 3 B), less what each visit shares: loading (b, 3 B, r) and
    shared_inverse (visits, r, r). log_determinant: of Sigma, without the constant of the coordinates."""

    model: NoiseModel
    components: VarianceComponents
    precision: Array
    loading: Array
    shared_inverse: Array
    log_determinant: float

    def inner(self, left: Array, right: Array) -> Array:
        """left^T Sigma^-1 right (p, q) for left (n, 3, p) and right (n, 3, q) in the model's coordinates."""
        of_left, of_right = self.model.in_blocks(left), self.model.in_blocks(right)
        weighted = self.precision @ of_right
        total = of_left.reshape(-1, left.shape[2]).T @ weighted.reshape(-1, right.shape[2])
        gathered = self._by_visit(weighted)
        other = gathered if left is right else self._by_visit(self.precision @ of_left)
        common = (self.shared_inverse @ gathered).reshape(-1, right.shape[2])
        return np.asarray(total - other.reshape(-1, left.shape[2]).T @ common)

    def apply(self, columns: Array) -> Array:
        """Sigma^-1 columns (n, 3, q), all in the model's coordinates."""
        weighted = self.precision @ self.model.in_blocks(columns)
        common = self.shared_inverse @ self._by_visit(weighted)
        return self.model.out_of_blocks(weighted - self.precision @ (self.loading @ common[self._visit_of_block]))

    def shared(self, residual: Array) -> Array:
        """Best estimate (n, 3) of what the rows of a visit share, in the model's coordinates, from a residual (n, 3)."""
        common = self.shared_inverse @ self._by_visit(self.precision @ self.model.in_blocks(residual[:, :, None]))
        return self.model.out_of_blocks(self.loading @ common[self._visit_of_block])[:, :, 0]

    def offsets(self, residual: Array) -> Array:
        """Best estimate of each visit's re-seating offset (visits, 3) [m] from a residual (n, 3)."""
        common = self.shared_inverse @ self._by_visit(self.precision @ self.model.in_blocks(residual[:, :, None]))
        return np.asarray(self.components.offset * self.model.offset * common[:, :3, 0])

    def _by_visit(self, weighted: Array) -> Array:
        return np.asarray(np.add.reduceat(np.swapaxes(self.loading, 1, 2) @ weighted, self.model.block_starts, axis=0))

    @cached_property
    def _visit_of_block(self) -> NDArray[np.intp]:
        return self.model.visit[self.model.blocks[:, 0]]


def inverse_of_three(matrix: Array) -> tuple[Array, Array]:
    """Inverse (..., 3, 3) and determinant (...) of symmetric positive definite matrices, all at once: each is small work.

    By their factors L D L^T. Cofactors would lose the determinant where the force error is 1e4 times the sensor's; this holds
    to 1e7 times.
    """
    first, low, lower = matrix[..., 0, 0], matrix[..., 0, 1], matrix[..., 0, 2]
    a, b = low / first, lower / first                       # L: 1; a 1; b c 1
    second = matrix[..., 1, 1] - a * low
    left = matrix[..., 1, 2] - a * lower
    c = left / second
    third = matrix[..., 2, 2] - b * lower - c * left
    # The inverse of L: 1; -a 1; corner -c 1.
    corner = a * c - b
    last, beside = 1 / third, -c / third
    middle = 1 / second - c * beside
    edge, top = corner * last, -a / second + corner * beside
    whole = 1 / first + a * a / second + corner * edge
    inverse = np.stack([whole, top, edge, top, middle, beside, edge, beside, last], axis=-1)
    return np.asarray(inverse.reshape(matrix.shape)), first * second * third


def force_error(noise: cells.Noise) -> tuple[Array, float]:
    """1 sigma of the force, (3,) [N] in each direction and relative: as stated, else as is usual."""
    return (noise.force if noise.force_stated else np.full(3, USUAL_FORCE_N),
            noise.force_relative if noise.force_relative_stated else USUAL_FORCE_RELATIVE)


def noise_model(data: LoadTest, compliance: Array) -> NoiseModel:
    """The noise of these rows as the cell file states it, the force error carried through `compliance` (6,).

    Raises CompstiffError (CS1081) where the parts differ by more than can be computed with.
    """
    cell, rows, noise = data.cell, data.rows, data.cell.noise
    measured = ~np.isnan(rows.deflection)
    sensor = sensor_sigma(data)
    rotation = np.where(measured, 1.0 / sensor, 0.0)[:, :, None] * np.eye(3)
    carried = rotation @ compliance_matrix(cell.robot, rows.theta, cell.flange_from_tcp, compliance)[:, :3, :3]
    load, (absolute, relative) = rows.wrench[:, :3], force_error(noise)
    loaded = np.any(load != 0, axis=1)[:, None]
    _check_parts(data, carried * (relative * load + absolute * loaded)[:, None, :])
    setups = USUAL_SETUP * (carried[:, :, :, None] * load[:, None, None, :]).reshape(len(load), 3, 9)
    _, visit = np.unique(rows.visit, return_inverse=True)
    offset = noise.pose_offset if noise.offset_stated else np.full(3, USUAL_OFFSET_M)
    sensor_stated = noise.deflection_stated or not np.isnan(rows.sigma).all()
    return NoiseModel(
        rotation, carried * (relative * load)[:, None, :], carried * (absolute * loaded)[:, None, :], setups, measured,
        visit.astype(np.intp), offset,
        (sensor_stated, noise.force_relative_stated, noise.force_stated, noise.offset_stated, False, False),
        (True, relative > 0, bool(np.any(absolute > 0)), bool(offset.any()), False, False))


def _check_parts(data: LoadTest, of_force: Array) -> None:
    """of_force (n, 3, 3): the force error's deflection in sigmas of the sensor. Raises CompstiffError (CS1081)."""
    ratio = np.abs(of_force).max(axis=(1, 2))
    if ratio.max() > LARGEST_RATIO:
        row = int(np.argmax(ratio))
        raise error("CS1081", f"the force error moves the tool by {ratio[row]:.3g} times the sensor's 1 sigma, at most "
                    f"{LARGEST_RATIO:g} can be computed with", file=data.rows.source, line=int(data.rows.line[row]),
                    hint=f"look at this row's load and sigma, and at measurement and prior in {data.cell.source.name}")


def sensor_sigma(data: LoadTest) -> Array:
    """Stated 1 sigma (n, 3) [m] of each reading: the row's own, else the cell's."""
    return np.where(np.isnan(data.rows.sigma), data.cell.noise.deflection, data.rows.sigma)


def residual_std(data: LoadTest, components: VarianceComponents, compliance: Array) -> Array:
    """1 sigma of each component's residual (n, 3) [m] under noise of these components, all of its parts."""
    noise, values = noise_model(data, compliance), components.values**2
    own = values[SENSOR] + sum(values[part] * np.sum(root**2, axis=2) for part, root in (
        (FORCE, noise.force), (ABSOLUTE, noise.absolute)))
    # A Student distribution's variance is more than its scale squared.
    heavier = 1.0 if np.isinf(components.degrees) else components.degrees / (components.degrees - 2.0)
    shared = sum(values[part] * np.sum(root**2, axis=2) for part, root in (
        (SETUP, noise.setups), (OFFSET, noise.rotation * noise.offset)))
    return np.asarray(sensor_sigma(data) * np.sqrt(heavier * own + shared))

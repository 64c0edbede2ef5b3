"""The measurement noise: its parts, their variance components estimated from the data, and the weight of every row.

The covariance of the deflections of the rows of one pose visit (docs/effects.md, step 1) is the sum of

    sensor     s^2 S rho^|n - m| / w     the stated variances S (the row's own where it has them), with a memory rho
    force      f^2 G (R F)^2 G^T / w     each row's own error, R of each component of the force, carried through the first-order
                                         compliance G = J diag(c) J^T
    absolute   a^2 G N G^T / w           each loaded row's own error, alike in every direction
    setup      v^2 G_n M G_m^T           how far one visit's forces are off, since the rig is set up anew: in size alone, M =
                                         F_n F_m^T; stretched, each component by itself, M = diag(F_n F_m); or turned too,
                                         M = (F_n . F_m) I (`SetUp`)
    offset     o^2 O                     re-seating, one draw a visit

s, f, a, v, o and rho are estimated by restricted maximum likelihood (the stiffnesses integrated out), v and rho only where the
rows ask for them, and which of the three set-ups are with v (variance_components.py). w_n is the row's weight in a Student
likelihood whose degrees of freedom are estimated too: 1 for ordinary rows, small for gross errors.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from identification.common.findings import error
from identification.fit.load_test import LoadTest
from identification.fit.noise_parts import (
    ABSOLUTE,
    FORCE,
    MEMORY,
    OFFSET,
    SENSOR,
    SETUP,
    USUAL_SETUP,
    SetUp,
    VarianceComponents,
    memory_of,
)
from identification.fit.own_noise import RememberingRows, RowsAlone, stretches
from identification.model import cell as cells
from identification.model.compliance import compliance_matrix

Array = NDArray[np.float64]

# A part that the cell file leaves out is there all the same: these sizes are the scale of its prior then.
USUAL_OFFSET_M = 3e-6
USUAL_FORCE_RELATIVE = 0.005
USUAL_FORCE_N = 0.4
# Rows of a visit whose memory of each other counts; a longer one is taken in stretches.
REMEMBERED = 64
# Rows that are multiplied at once.
PIECE = 4096
# How many times the sensor's 1 sigma the force error may move the tool: with that and LARGEST_LOG a double still holds both.
LARGEST_RATIO = 1e4


@dataclass(frozen=True, eq=False)
class NoiseModel:
    """The noise of n rows in units of each component's sensor sigma.

    whitening (n, 3, 3): S^-1/2, zero where a component was not measured. force, absolute (n, 3, 3): roots of the two parts of
    the force error in these units. setups (n, 3, 9): what an error of each component by each component of a visit's forces
    does to its rows. measured (n, 3). visit (n,): pose visit, from 0. offset (3,): stated standard deviation of the re-seating
    offset [m]. stated (6,): which of PARTS the cell file states. active (6,): which of PARTS there are.
    set_up: as in VarianceComponents. further (n, 3, d): what else each visit may do, by itself, 1 sigma each.
    """

    whitening: Array
    force: Array
    absolute: Array
    setups: Array
    measured: NDArray[np.bool_]
    visit: NDArray[np.intp]
    offset: Array
    stated: tuple[bool, ...]
    active: tuple[bool, ...]
    set_up: SetUp = SetUp.TURNED
    further: Array | None = None

    def whitened(self, moved: Array) -> Array:
        """Displacements (n, 3, k) [m] of the rows in the noise's coordinates."""
        return np.asarray(self.whitening @ moved)

    @cached_property
    def visits(self) -> int:
        """How many pose visits there are."""
        return int(self.visit.max()) + 1

    @cached_property
    def told_apart(self) -> tuple[bool, bool]:
        """Whether the rows can tell force error, and re-seating: the first needs loads, the second visits with several rows."""
        repeated = bool(np.any(np.bincount(self.visit, self.measured.any(axis=1)) > 1))
        return bool(np.any(np.linalg.norm(self.force, axis=(1, 2)) > 0.1)), repeated

    def with_parts(self, *parts: int, set_up: SetUp = SetUp.TURNED) -> NoiseModel:
        """With these parts active too."""
        return replace(self, active=tuple(known or part in parts for part, known in enumerate(self.active)), set_up=set_up)

    def of_rows(self, rows: NDArray[np.bool_ | np.intp]) -> NoiseModel:
        """The noise of some of the rows, or of all in another order."""
        _, visit = np.unique(self.visit[rows], return_inverse=True)
        return replace(self, whitening=self.whitening[rows], force=self.force[rows], absolute=self.absolute[rows],
                       setups=self.setups[rows], measured=self.measured[rows], visit=visit.astype(np.intp),
                       further=None if self.further is None else self.further[rows])

    @cached_property
    def _by_visit(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """The rows visit by visit, and where each visit starts."""
        order = np.argsort(self.visit, kind="stable")
        return order, np.searchsorted(self.visit[order], np.arange(self.visits))

    @cached_property
    def alike(self) -> list[tuple[NDArray[np.intp], slice | NDArray[np.intp]]]:
        """The visits piece by piece, those of one length together: visits (v,), and their rows (v length,), visit by visit; as
        a slice where they stand one after the other."""
        order, starts = self._by_visit
        length = np.diff(np.append(starts, len(order)))
        pieces = []
        for each in np.unique(length):
            visits = np.flatnonzero(length == each)
            for some in np.array_split(visits, -(-len(visits) * each // PIECE)):
                if len(some):
                    rows = order[starts[some][:, None] + np.arange(each)].ravel()
                    run = slice(int(rows[0]), int(rows[0]) + len(rows))
                    pieces.append((some, run if np.array_equal(rows, np.arange(run.start, run.stop)) else rows))
        return pieces

    def products(self, left: Array, right: Array) -> Array:
        """left^T right (visits, p, q) over the rows of each visit, of left (n, 3, p) and right (n, 3, q): never more than a
        piece of them at once."""
        result = np.empty((self.visits, left.shape[2], right.shape[2]))
        for visits, rows in self.alike:
            side_by_side = left[rows].reshape(len(visits), -1, left.shape[2]).swapaxes(1, 2)
            result[visits] = side_by_side @ right[rows].reshape(len(visits), -1, right.shape[2])
        return result

    def by_visit(self, values: Array) -> Array:
        """Sums (visits, ...) of values (n, ...) over the rows of each visit."""
        order, starts = self._by_visit
        return np.asarray(np.add.reduceat(values[order], starts, axis=0))

    def of_rows_alone(self, components: VarianceComponents) -> Array:
        """Precision (n, 3, 3) of each row by itself, without what its visit shares; nothing where a component was not
        measured."""
        alone = replace(self, active=(*self.active[:MEMORY], False)).own(components.values[None], np.ones(len(self.visit)))
        assert isinstance(alone, RowsAlone)
        return np.asarray(alone.precision[0] * (self.measured[:, :, None] & self.measured[:, None, :]))

    @cached_property
    def steps(self) -> tuple[NDArray[np.intp], ...]:
        """The rows at each place of their visit, or of their stretch of a long one."""
        return stretches(self.visit, REMEMBERED)

    @cached_property
    def loading(self) -> Array:
        """What a visit has in common, as columns (n, 3, r) of unit size: its offset, then its set-up, then what is further."""
        parts = [self.whitening * self.offset]
        parts += [self.setup_loading] if self.active[SETUP] else []
        parts += [] if self.further is None else [self.further]
        return np.concatenate(parts, axis=2)

    @property
    def setup_loading(self) -> Array:
        """What a set-up does to its rows: (n, 3, 1) in size, (n, 3, 3) stretched, (n, 3, 9) turned."""
        if self.set_up is SetUp.TURNED:
            return self.setups
        stretched = self.setups[:, :, ::4]
        return stretched if self.set_up is SetUp.STRETCHED else stretched.sum(axis=2, keepdims=True)

    def loading_scale(self, values: Array) -> Array:
        """Size (..., r) of each column of `loading` for multiples (..., 6)."""
        further = 0 if self.further is None else self.further.shape[2]
        columns = [OFFSET] * 3 + [SETUP] * (self.loading.shape[2] - 3 - further)
        return np.concatenate([values[..., columns], np.ones((*values.shape[:-1], further))], axis=-1)

    @cached_property
    def _squares(self) -> Array:
        """Covariances (2, n, 3, 3) of the two parts of the force error, nothing of one that is not active."""
        return np.array([root @ np.swapaxes(root, 1, 2) * self.active[part]
                         for part, root in ((FORCE, self.force), (ABSOLUTE, self.absolute))])

    def own(self, values: Array, row_weight: Array) -> RowsAlone | RememberingRows:
        """The noise without what visits share, for multiples (S, 6) and row weights (n,)."""
        own = (values[:, [FORCE, ABSOLUTE]] ** 2 @ self._squares.reshape(2, -1)).reshape(-1, *self.whitening.shape)
        sensor = values[:, SENSOR]
        if not self.active[MEMORY]:
            return RowsAlone.of(own, sensor, self.measured, row_weight)
        return RememberingRows.of(own, sensor, memory_of(values[:, MEMORY]), self.measured, row_weight, self.steps)

    def weights(self, components: VarianceComponents, row_weight: Array | None = None) -> Weights:
        """Sigma^-1 for these variance components and row weights (n,)."""
        row_weight = np.ones(len(self.visit)) if row_weight is None else row_weight
        return self.beside(self.own(components.values[None], row_weight), components)

    def beside(self, own: RowsAlone | RememberingRows, components: VarianceComponents) -> Weights:
        """Sigma^-1 of the rows' own noise with what their visits share."""
        loading = self.loading * self.loading_scale(components.values)
        carried = own.solve(loading)
        # Woodbury, so written that a part of no size stays finite: (I + L^T P L)^-1.
        inner = np.eye(loading.shape[2]) + self.products(loading, carried)
        log_total = float(own.log_determinant[0] + np.sum(np.linalg.slogdet(inner)[1]))
        return Weights(self, components, own, loading, carried, np.asarray(np.linalg.inv(inner), dtype=float), log_total)

    def draw(self, values: Array, row_weight: Array, rng: np.random.Generator) -> Array:
        """Noise (n, 3, S) of these rows, one draw for each of the multiples (S, 6); row_weight (n,), or (n, S)."""
        count, n = len(values), len(self.visit)
        sensor = rng.standard_normal((n, 3, count))
        if self.active[MEMORY]:
            rho = memory_of(values[:, MEMORY])
            for before, rows in pairwise(self.steps):
                sensor[rows] = rho * sensor[before[: len(rows)]] + np.sqrt(1 - rho**2) * sensor[rows]
        own = values[:, SENSOR] * sensor
        for part, root in ((FORCE, self.force), (ABSOLUTE, self.absolute)):
            if self.active[part]:
                own += values[:, part] * (root @ rng.standard_normal((n, 3, count)))
        shared = self.loading_scale(values).T * rng.standard_normal((self.visits, self.loading.shape[2], count))
        drawn = own / np.sqrt(row_weight.reshape(n, 1, -1)) + self.loading @ shared[self.visit]
        return np.asarray(np.where(self.measured[:, :, None], drawn, 0.0))


@dataclass(frozen=True, eq=False)
class Weights:
    """Sigma^-1: that of the rows' own noise, less what each visit shares: loading (n, 3, r), what the own noise makes of it
    (n, 3, r), and shared_inverse (visits, r, r). log_determinant: of Sigma, without the constant of the coordinates."""

    model: NoiseModel
    components: VarianceComponents
    own: RowsAlone | RememberingRows
    loading: Array
    carried: Array
    shared_inverse: Array
    log_determinant: float

    def inner(self, left: Array, right: Array) -> Array:
        """left^T Sigma^-1 right (p, q) for left (n, 3, p) and right (n, 3, q) in the model's coordinates."""
        total = left.reshape(-1, left.shape[2]).T @ self.own.solve(right).reshape(-1, right.shape[2])
        gathered = self._by_visit(right)
        other = gathered if left is right else self._by_visit(left)
        common = (self.shared_inverse @ gathered).reshape(-1, right.shape[2])
        return np.asarray(total - other.reshape(-1, left.shape[2]).T @ common)

    def apply(self, columns: Array) -> Array:
        """Sigma^-1 columns (n, 3, q), all in the model's coordinates."""
        solved = self.own.solve(columns)
        for visits, rows in self.model.alike:
            carried = self.carried[rows].reshape(len(visits), -1, self.carried.shape[2])
            mine = columns[rows].reshape(len(visits), -1, columns.shape[2])
            common = self.shared_inverse[visits] @ (carried.swapaxes(1, 2) @ mine)
            solved[rows] -= (carried @ common).reshape(-1, *solved.shape[1:])
        return solved

    def freed(self, moved: Array) -> Weights:
        """Sigma^-1 where each visit, by itself, may move its rows by displacements (n, 3, p) [m] too, 1 sigma each."""
        known = [] if self.model.further is None else [self.model.further]
        further = np.concatenate([*known, self.model.whitened(moved)], axis=2)
        return replace(self.model, further=further).beside(self.own, self.components)

    def shared(self, columns: Array) -> Array:
        """Best estimate (n, 3, q) of what the rows of a visit share, of each of the columns (n, 3, q), in the model's
        coordinates."""
        common = self.shared_inverse @ self._by_visit(columns)
        return np.asarray(self.loading @ common[self.model.visit])

    @property
    def shared_covariance(self) -> Array:
        """What that leaves open (n, 3, 3)."""
        return np.asarray(self.loading @ self.shared_inverse[self.model.visit] @ np.swapaxes(self.loading, 1, 2))

    def offsets(self, residual: Array) -> Array:
        """Best estimate of each visit's re-seating offset (visits, 3) [m] from a residual (n, 3)."""
        common = self.shared_inverse @ self._by_visit(residual[:, :, None])
        return np.asarray(self.components.offset * self.model.offset * common[:, :3, 0])

    def _by_visit(self, columns: Array) -> Array:
        return self.model.products(self.carried, columns)


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
    whitening = np.where(measured, 1.0 / sensor, 0.0)[:, :, None] * np.eye(3)
    carried = whitening @ compliance_matrix(cell.robot, rows.theta, cell.flange_from_tcp, compliance)[:, :3, :3]
    load, (absolute, relative) = rows.wrench[:, :3], force_error(noise)
    loaded = np.any(load != 0, axis=1)[:, None]
    _check_parts(data, carried * (relative * np.abs(load) + absolute * loaded)[:, None, :])
    setups = USUAL_SETUP * (carried[:, :, :, None] * load[:, None, None, :]).reshape(len(load), 3, 9)
    if rows.hung is not None:
        # A weight is plumb and as heavy at every pose.
        setups[rows.hung] = 0.0
    _, visit = np.unique(rows.visit, return_inverse=True)
    offset = noise.pose_offset if noise.offset_stated else np.full(3, USUAL_OFFSET_M)
    sensor_stated = noise.deflection_stated or not np.isnan(rows.sigma).all()
    further = whitening * (data.rest * ~loaded)[:, :, None] if data.rest else None
    return NoiseModel(
        whitening, carried * (relative * load)[:, None, :], carried * (absolute * loaded)[:, None, :], setups, measured,
        visit.astype(np.intp), offset,
        (sensor_stated, noise.force_relative_stated, noise.force_stated, noise.offset_stated, False, False),
        (True, relative > 0, bool(np.any(absolute > 0)), bool(offset.any()), False, False), further=further)


def _check_parts(data: LoadTest, of_force: Array) -> None:
    """of_force (n, 3, 3): the force error's deflection in sigmas of the sensor. Raises CompstiffError (CS1081)."""
    ratio = np.abs(of_force).max(axis=(1, 2))
    if ratio.max() > LARGEST_RATIO:
        row = int(np.argmax(ratio))
        raise error("CS1081", f"the force error moves the tool by {ratio[row]:.3g} times the sensor's 1 sigma, at most "
                    f"{LARGEST_RATIO:g} can be computed with", file=data.rows.source, line=int(data.rows.line[row]),
                    hint=f"look at this row's load and sigma, and at measurement and prior in {data.cell.source.name}: are "
                    "stiffnesses in N m/rad?")


def sensor_sigma(data: LoadTest) -> Array:
    """Stated 1 sigma (n, 3) [m] of each reading: the row's own, else the cell's."""
    return np.where(np.isnan(data.rows.sigma), data.cell.noise.deflection, data.rows.sigma)


def residual_std(data: LoadTest, components: VarianceComponents, compliance: Array, further: Array | None = None) -> Array:
    """1 sigma of each component's residual (n, 3) [m] under noise of these components, all of its parts; further: as in
    NoiseModel, None: what the rows have by themselves."""
    noise, values = noise_model(data, compliance).with_parts(set_up=components.set_up), components.values**2
    own = values[SENSOR] + sum(values[part] * np.sum(root**2, axis=2) for part, root in (
        (FORCE, noise.force), (ABSOLUTE, noise.absolute)))
    # A Student distribution's variance is more than its scale squared.
    heavier = 1.0 if np.isinf(components.degrees) else components.degrees / (components.degrees - 2.0)
    shared = sum(values[part] * np.sum(root**2, axis=2) for part, root in (
        (SETUP, noise.setup_loading), (OFFSET, noise.whitening * noise.offset)))
    further = noise.further if further is None else further
    shared = shared + (0.0 if further is None else np.sum(further**2, axis=2))
    return np.asarray(sensor_sigma(data) * np.sqrt(heavier * own + shared))

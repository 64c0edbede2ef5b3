"""Rows that were not fitted: every pose predicted from the others, and how likely a model makes them."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from identification.common.arrays import rms
from identification.common.findings import CompstiffError
from identification.fit.fitted_model import predicted_deflection, response
from identification.fit.load_test import LoadTest
from identification.fit.noise import Weights, noise_model
from identification.fit.noise_parts import OPTIONAL
from identification.fit.posterior import Posterior, posterior
from identification.measurements import Measurements

Array = NDArray[np.float64]
# A slope does not hold where what lies along it and what the law does there are apart by this share of what is left, or of the
# sensors' noise.
NO_SLOPE = 0.3


def poses(rows: Measurements) -> NDArray[np.intp]:
    """Group (n,) of the rows that are held out together: one label (wherever it returns), else one visit."""
    return np.unique(_names(rows), return_inverse=True)[1].astype(np.intp)


def pose_names(rows: Measurements) -> tuple[str, ...]:
    """The groups' names in the order of their numbers."""
    return tuple(np.unique(_names(rows)).tolist())


def _names(rows: Measurements) -> NDArray[np.str_]:
    """Label of each row's pose, or "line n" of its visit's first row."""
    _, first, numbers = np.unique(rows.visit, return_index=True, return_inverse=True)
    lines = np.array([f"line {line}" for line in rows.line[first]], dtype=object)
    return np.where(rows.pose == "", lines[numbers], rows.pose).astype(str)


def left_out(model: Posterior, groups: NDArray[np.intp]) -> Array:
    """Residual (n, 3) [m] of every row, predicted by the model fitted without the row's group."""
    return _left_out(model, groups)[0]


def _left_out(model: Posterior, groups: NDArray[np.intp]) -> tuple[Array, dict[int, Posterior]]:
    """The residual by one step from the MAP, along the slopes there. With effects that is held against what they do after the
    step: where a law has a corner, as play, or trades with the springs along a curve, no slope holds, and the fit without the
    group is done: those fits by their groups, too."""
    at, prior = model.at_map, model.prior
    position, slope = response(model.data, model.map, model.terms)
    residual = model.data.rows.deflection - position
    weighted = model.weights.apply(at.design)
    precision = prior.precision(model.map)
    order, parameters = np.argsort(groups, kind="stable"), at.design.shape[2]
    each = [slice(start, end) for start, end in pairwise((0, *np.cumsum(np.bincount(groups))))]
    design, carried, readings = at.design[order], weighted[order], at.residual[order]
    information = np.array([design[g].reshape(-1, parameters).T @ carried[g].reshape(-1, parameters) for g in each])
    pulled = np.array([carried[g].reshape(-1, parameters).T @ readings[g].reshape(-1) for g in each])
    step = np.linalg.solve(information.sum(axis=0) - information + precision,
                           (pulled.sum(axis=0) - pulled - prior.gradient(model.map))[:, :, None])[:, :, 0]
    residual = np.asarray(residual - np.einsum("nij,nj->ni", slope, step[groups]))
    fits: dict[int, Posterior] = {}
    if model.terms:
        sensor = model.components.sensor * rms(model.data.cell.noise.deflection)
        read = np.bincount(groups, ~np.isnan(residual).all(axis=1)) > 0
        for group in np.flatnonzero(read):
            mine, moved = groups == group, step[group]
            rows, along = model.data.with_rows(model.data.rows.select(mine)), residual[mine]
            there = rows.rows.deflection - predicted_deflection(rows, prior.inside(model.map + moved), model.terms)
            if rms(there - along) > NO_SLOPE * max(min(rms(there), rms(along)), sensor):
                residual[mine] = there
                try:
                    fits[int(group)] = posterior(model.data.with_rows(model.data.rows.select(~mine)), model.terms, model)
                except CompstiffError:
                    continue
                residual[mine] = fits[int(group)].residual_of(rows)
    return residual, fits


def left_out_with_density(model: Posterior, groups: NDArray[np.intp]) -> tuple[Array, float]:
    """The residual of `left_out`, and ln p of the readings of each group given those of the others, but for what models of the
    same rows have in common: their noise, what its heavy tails cost and what is left open of the parameters are in it."""
    residual, fits = _left_out(model, groups)
    at, known = model.at_map, model.information + model.prior.precision(model.map)
    total = model.log_tails
    for group in range(groups.max() + 1):
        mine = groups == group
        if group in fits:
            total += log_density(fits[group], model.data.with_rows(model.data.rows.select(mine)))
            continue
        weights = at.noise.of_rows(mine).weights(model.components, model.row_weight[mine])
        whitened = np.einsum("nij,nj->ni", at.noise.whitening[mine], np.nan_to_num(residual[mine]))
        total += _log_normal(weights, at.design[mine], whitened, known - weights.inner(at.design[mine], at.design[mine]))
    return residual, total


def log_density(model: Posterior, data: LoadTest) -> float:
    """ln p of rows that were not fitted, given all that were, as in `left_out_with_density`."""
    noise, active = noise_model(data, model.compliance), model.at_map.noise.active
    noise = noise.with_parts(*(part for part in OPTIONAL if active[part]), set_up=model.components.set_up)
    position, slope = response(data, model.map, model.terms)
    whitened = np.einsum("nij,nj->ni", noise.whitening, np.nan_to_num(data.rows.deflection - position))
    known = model.information + model.prior.precision(model.map)
    return _log_normal(noise.weights(model.components), noise.whitening @ slope, whitened, known)


def _log_normal(weights: Weights, design: Array, residual: Array, known: Array) -> float:
    """ln of the normal density of a residual (n, 3) with this noise and parameters known with a precision (p, p), which these
    rows see by their design (n, 3, p)."""
    columns = np.concatenate([design, residual[:, :, None]], axis=2)
    square = weights.inner(columns, columns)
    pull, after = square[:-1, -1], known + square[:-1, :-1]
    volume = np.linalg.slogdet(after)[1] - np.linalg.slogdet(known)[1]
    return float(-0.5 * (square[-1, -1] - pull @ np.linalg.solve(after, pull) + volume + weights.log_determinant))

"""Rows that were not fitted: every pose predicted from the others, and how likely a model makes them."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from identification.common.arrays import rms
from identification.common.findings import CompstiffError
from identification.fit.fitted_model import predicted_deflection, response
from identification.fit.load_test import LoadTest
from identification.fit.noise import OPTIONAL, NoiseModel, noise_model
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
    """Residual (n, 3) [m] of every row, predicted by the model fitted without the row's group: by one step from its MAP, along
    the slopes there. With effects that is held against what they do after the step: where a law has a corner, as play, or
    trades with the springs along a curve, no slope holds, and the fit without the group is done."""
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
    if model.terms:
        sensor = model.components.sensor * rms(model.data.cell.noise.deflection)
        read = np.bincount(groups, ~np.isnan(residual).all(axis=1)) > 0
        for group in np.flatnonzero(read):
            mine, moved = groups == group, step[group]
            rows, along = model.data.with_rows(model.data.rows.select(mine)), residual[mine]
            there = rows.rows.deflection - predicted_deflection(rows, prior.inside(model.map + moved), model.terms)
            if rms(there - along) > NO_SLOPE * max(min(rms(there), rms(along)), sensor):
                residual[mine] = _fitted_without(model, mine, there)
    return residual


def log_density(model: Posterior, data: LoadTest, groups: NDArray[np.intp], residual: Array) -> float:
    """ln p of rows that were not fitted, but for what models of the same rows have in common. residual (n, 3) [m]: each group's
    by what the model is without it, as by `left_out`, of its own rows; or all of one group, of other rows. Their noise and what
    is left open of the parameters then are in it."""
    fitted = np.array_equal(data.rows.row, model.data.rows.row)
    noise = model.at_map.noise if fitted else _noise_of(model, data)
    weights = model.weights if fitted else noise.weights(model.components)
    design = model.at_map.design if fitted else noise.whitening @ response(data, model.map, model.terms)[1]
    columns = np.concatenate([design, np.einsum("nij,nj->ni", noise.whitening, np.nan_to_num(residual))[:, :, None]], axis=2)
    carried, last = weights.apply(columns), design.shape[2]
    of_groups = np.array([np.einsum("nip,niq->pq", columns[groups == group], carried[groups == group])
                          for group in range(groups.max() + 1)])
    information, pull = of_groups[:, :last, :last], of_groups[:, :last, last]
    # What is known with a group, and without it.
    known = model.information + model.prior.precision(model.map)
    after = known if fitted else known + information
    before = known - information if fitted else known
    misfit = of_groups[:, last, last] - np.einsum("gp,gp->g", pull, np.linalg.solve(after, pull[:, :, None])[:, :, 0])
    volume = np.linalg.slogdet(after)[1] - np.linalg.slogdet(before)[1]
    return float(-0.5 * np.sum(misfit + volume) - 0.5 * weights.log_determinant)


def _noise_of(model: Posterior, data: LoadTest) -> NoiseModel:
    """The noise of other rows than those that were fitted, with the parts that those asked for."""
    active = model.at_map.noise.active
    further = [part for part in OPTIONAL if active[part]]
    return noise_model(data, model.compliance).with_parts(*further, set_up=model.components.set_up)


def _fitted_without(model: Posterior, mine: NDArray[np.bool_], otherwise: Array) -> Array:
    """Residual (m, 3) [m] of the rows `mine` (n,) by a fit to the others; `otherwise` where that does not converge."""
    try:
        fitted = posterior(model.data.with_rows(model.data.rows.select(~mine)), model.terms, model)
    except CompstiffError:
        return otherwise
    return fitted.residual_of(model.data.with_rows(model.data.rows.select(mine)))

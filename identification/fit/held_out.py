"""Rows that were not fitted: every pose predicted from the others."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from identification.common.arrays import rms
from identification.common.findings import CompstiffError
from identification.fit.fitted_model import predicted_deflection, response
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


def _fitted_without(model: Posterior, mine: NDArray[np.bool_], otherwise: Array) -> Array:
    """Residual (m, 3) [m] of the rows `mine` (n,) by a fit to the others; `otherwise` where that does not converge."""
    try:
        fitted = posterior(model.data.with_rows(model.data.rows.select(~mine)), model.terms, model)
    except CompstiffError:
        return otherwise
    return fitted.residual_of(model.data.with_rows(model.data.rows.select(mine)))

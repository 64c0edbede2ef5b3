"""Rows that were not fitted: every pose predicted from the others."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from identification.fit.fitted_model import predicted_deflection, response
from identification.fit.posterior import Posterior
from identification.measurements import Measurements

Array = NDArray[np.float64]


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
    """Residual (n, 3) [m] of every row, predicted by the model fitted without the row's group: fitted by one step from its MAP.
    With effects that step is predicted in full: a law that has corners, as play, has no slope there that holds beyond them."""
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
    if not model.terms:
        return np.asarray(residual - np.einsum("nij,nj->ni", slope, step[groups]))
    for group in range(len(each)):
        mine, x = groups == group, prior.inside(model.map + step[group])
        rows = model.data.with_rows(model.data.rows.select(mine))
        residual[mine] = rows.rows.deflection - predicted_deflection(rows, x, model.terms)
    return np.asarray(residual)

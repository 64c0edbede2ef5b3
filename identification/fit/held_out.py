"""Rows that were not fitted: every pose predicted from the others."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from identification.fit.fitted_model import response
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
    first = np.array([f"line {rows.line[np.argmax(rows.visit == visit)]}" for visit in np.unique(rows.visit)], dtype=object)
    numbers = np.unique(rows.visit, return_inverse=True)[1]
    return np.where(rows.pose == "", first[numbers], rows.pose).astype(str)


def left_out(model: Posterior, groups: NDArray[np.intp]) -> Array:
    """Residual (n, 3) [m] of every row, predicted by the model fitted without the row's group (linearised at its MAP)."""
    at, prior = model.at_map, model.prior
    position, slope = response(model.data, model.map, model.terms)
    residual = model.data.rows.deflection - position
    weighted = model.weights.apply(at.design)
    precision = prior.precision(model.map)
    parameters, numbers = at.design.shape[2], range(groups.max() + 1)
    information = np.array([at.design[groups == g].reshape(-1, parameters).T @ weighted[groups == g].reshape(-1, parameters)
                            for g in numbers])
    pulled = np.array([weighted[groups == g].reshape(-1, parameters).T @ at.residual[groups == g].reshape(-1)
                       for g in numbers])
    held = np.empty_like(residual)
    for g in numbers:
        step = np.linalg.solve(information.sum(axis=0) - information[g] + precision,
                               pulled.sum(axis=0) - pulled[g] - prior.gradient(model.map))
        mine = groups == g
        held[mine] = residual[mine] - slope[mine] @ step
    return held

"""The targets of a logged pass that show a force and are engaged as the stock says: what a log can be held against."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from compensator.cutting.cut import Cut
from compensator.cutting.posterior import ForceRows
from compensator.forces.target_forces import TargetForces
from identification.common.arrays import Array

# So many such places tell something: forces drawn along one slot with errors that neighbours share by 0.7 leave its predicted
# force off by 0.65 of its sigma (RMS) by so many, by 0.4 with the second. With the second it can be told what a log speaks
# against.
FEWEST, ENOUGH = 12, 30


def logged_rows(
    cut: Cut, forces: TargetForces, coefficients: Array | None = None
) -> tuple[ForceRows, NDArray[np.bool_]]:
    """The rows, and which targets (N,) they are; what the forces change by with the tool aside, as `cut_of` was asked.

    coefficients (6,): those the change is worked out with; None: those that fit the log best by themselves.
    """
    weight, path = cut.per_target, cut.path
    used = forces.forced & cut.cuts & ~cut.unknown & (forces.samples > 0) & ~np.isnan(path.length)
    chosen = np.flatnonzero(used)
    rows = ForceRows(weight[chosen], forces.wrench[chosen, :3], np.nan_to_num(forces.standard_error[chosen]),
                     np.zeros((len(chosen), 3, 0)), path.length[chosen])
    if cut.engagement.moved is None or len(chosen) < FEWEST:
        return rows, used
    known = np.linalg.lstsq(rows.weight.reshape(-1, 6), rows.force.reshape(-1), rcond=None)[0] if coefficients is None else (
        coefficients)
    return replace(rows, aside=cut.mean(cut.change(np.asarray(known)))[chosen]), used

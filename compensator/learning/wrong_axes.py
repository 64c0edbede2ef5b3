"""Points whose columns are along other axes than those of the work object: nothing is learned of them."""

from __future__ import annotations

import numpy as np

from compensator.learning.rows import Rows
from identification.common.arrays import Array, rms
from identification.common.findings import Finding, Refused
from identification.common.other_axes import along_other_axes, turned_axes


def refuse_wrong_axes(rows: Rows, measured: Array, told: Array, source: str) -> None:
    """Refused (CS5330) where measured (n,) [m] follows the prediction, told (n,) [m] along the rows' directions, far better
    along other axes; asked of places with a row along each axis."""
    each = np.bincount(rows.place, minlength=len(rows.position))
    whole = np.flatnonzero(each[rows.place] == 3).reshape(-1, 3)
    axes = rows.direction[whole]
    if not len(whole) or np.any(np.abs(np.linalg.det(axes)) < 0.9):
        return
    in_base = np.einsum("pkc,pk->pc", axes, told[whole])
    found = along_other_axes(measured[whole], told[whole], {"the base frame": in_base}, rms(rows.sigma))
    if found is None:
        found = turned_axes(measured[whole], told[whole], rms(rows.sigma))
    if found is None:
        return
    name, left, as_is = found
    raise Refused(Finding(
        "CS5330", "error", f"the points are off as is predicted, but along other axes: {name}, which would leave "
        f"{1e6 * left:.1f} um in place of {1e6 * as_is:.1f}", file=source,
        hint="dx_um dy_um dz_um are along the axes of the program's work object, measured minus planned; or are the axes of "
        "the force log (force_log) wrong?"))

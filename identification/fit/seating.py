"""A zero that moves between visits: it looks like re-seating, and is said where it is more than re-seating was stated to be."""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from identification.common.findings import Finding
from identification.fit.noise_parts import VarianceComponents
from identification.fit.posterior import Posterior
from identification.measurements import Measurements

# Data sheets are nominal; a size that nobody stated is only the usual one.
STATED, UNSTATED = 2.0, 3.0
ONE_SIDED_95 = 1.645
# How many visits are told, the farthest off first.
MOST = 3
OFFSET = [part.name for part in fields(VarianceComponents)].index("offset")


def moving_zero(fitted: Posterior) -> list[Finding]:
    """The finding (CS1734) where the readings of a visit share more than re-seating explains; at most one."""
    noise, components, rows = fitted.at_map.noise, fitted.components, fitted.data.rows
    stated = fitted.data.cell.noise.offset_stated
    granted = STATED if stated else UNSTATED
    repeated = bool(np.any(np.bincount(noise.visit, noise.measured.any(axis=1)) > 1))
    surely = np.log(components.offset / granted) > ONE_SIDED_95 * fitted.components_log_std[OFFSET]
    if np.any(rows.machined_pass != "") or not repeated or not surely or not noise.offset.any():
        return []
    size, usual = 1e6 * components.offset * float(np.mean(noise.offset)), 1e6 * float(np.mean(noise.offset))
    off = 1e6 * np.linalg.norm(fitted.weights.offsets(fitted.at_map.residual), axis=1)
    if off.max() < size:        # of offsets of that size the largest is larger: another misfit made the component large
        return []
    where = ", ".join(f"{_name(rows, noise.visit == visit)} by {off[visit]:.0f} um" for visit in np.argsort(-off)[:MOST])
    against = "cell.yaml states" if stated else "is usual (cell.yaml states none)"
    told = float(f"{size:.2g}")
    return [Finding("CS1734", "warning", f"the zero moves between the poses: all readings of a pose are off together, by "
                    f"{told:g} um, {components.offset:.1f} times the {usual:.2g} um of re-seating that {against}; farthest "
                    f"{where}", file=rows.source,
                    hint="read the unloaded zero anew at every pose, just before the loads, and take it off the pose's "
                    "readings; see whether a sensor, its stand or the target was touched between poses")]


def _name(rows: Measurements, mine: np.ndarray) -> str:
    """The label of a visit's pose, or where its first row stands."""
    first = int(np.argmax(mine))
    return str(rows.pose[first]) or f"the pose from line {rows.line[first]}"

"""Subset conflict: do the loads along x and along y, up and down, early and late want the same stiffnesses?

One more set of compliances for a part of the rows, c + delta there: with the score u = D^T Sigma^-1 r of the common fit's
residual, D the design of those rows alone, and the information on delta left when c is free,
J = D^T W D - D^T W A (A^T W A + P)^-1 A^T W D, the squared Mahalanobis distance between the two fits is u^T J^+ u. It counts
the directions in which the difference is determined at all, and is chi-squared with as many degrees of freedom if one set of
springs explains both parts and the noise's size is known; it is an estimate, and the p-value of what looks clear is that of an
F (noise_degrees.py). A conflict is a finding: something the plain model leaves out. A holds what the arm's unknown weight may
do, too (sag.py), and u is what is left of the score once that is free.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.common.tails import chi2_tail, f_tail
from identification.fit.noise_degrees import NoiseDegrees, beside_the_springs
from identification.fit.posterior import Posterior
from identification.measurements import Measurements

Array = NDArray[np.float64]

# A direction in which the two parts' difference of ln c is known to a factor e or better is compared.
DETERMINED = 1.0
FEWEST_ROWS = 2
SIGNIFICANCE = 0.05
# What is less clear than that with a known noise is no conflict with an estimated one.
WORTH_DEGREES = 0.01
# Each pose is compared with the others up to so many.
MOST_POSES = 40


@dataclass(frozen=True, eq=False)
class Conflict:
    """One comparison. distance: Mahalanobis, over `directions` degrees of freedom; p_value of that, corrected: times the
    number of comparisons. difference (6,): estimated ln k of the part minus ln k of the rest, where determined."""

    part: str
    rest: str
    rows: tuple[int, int]
    distance: float
    directions: int
    p_value: float
    corrected: float
    difference: Array

    @property
    def is_conflict(self) -> bool:
        """Family-wise at 5 %."""
        return self.corrected < SIGNIFICANCE

    def as_dict(self) -> dict[str, Any]:
        """JSON values."""
        return {"part": self.part, "rest": self.rest, "rows": list(self.rows), "distance": self.distance,
                "directions": self.directions, "p_value": self.p_value, "p_corrected": self.corrected,
                "log_stiffness_difference": self.difference.tolist(), "conflict": self.is_conflict}


def partitions(rows: Measurements) -> list[tuple[str, str, NDArray[np.bool_]]]:
    """The comparisons these rows allow: names of both parts, and which rows are in the first."""
    force = rows.wrench[:, :3]
    strength = np.linalg.norm(force, axis=1)
    loaded = strength > 0
    axis = np.argmax(np.abs(force), axis=1)
    along = np.abs(force).max(axis=1) > 0.9 * strength
    comparisons = [(f"loads along base {name}", "the other loads", loaded & along & (axis == i))
                   for i, name in enumerate("xyz")]
    largest = force[np.arange(len(force)), axis]
    comparisons.append(("positive loads", "negative loads", loaded & (largest > 0)))
    # Loading: the load grew from the row before of the same visit, which starts from zero.
    before = np.concatenate([[0.0], strength[:-1]])
    before[np.concatenate([[True], np.diff(rows.visit) != 0])] = 0.0
    comparisons.append(("loads while loading", "loads while unloading", loaded & (strength >= before)))
    comparisons.append(("the first half of the visits", "the second half", rows.visit < np.median(np.unique(rows.visit)) + 0.5))
    largest_load = strength > np.median(strength[loaded]) if loaded.any() else loaded
    comparisons.append(("the larger loads", "the smaller loads", loaded & largest_load))
    visits, first = np.unique(rows.visit, return_index=True)
    if len(visits) <= MOST_POSES:
        comparisons += [(f"the pose from line {rows.line[row]}", "the other poses", rows.visit == visit)
                        for visit, row in zip(visits, first, strict=True)]
    return comparisons


def subset_conflicts(posterior: Posterior) -> tuple[Conflict, ...]:
    """All comparisons that are possible, the clearest conflict first."""
    rows, at, weights = posterior.data.rows, posterior.at_map, posterior.weights
    loaded = np.any(rows.wrench != 0, axis=1)
    common, precision = beside_the_springs(posterior)
    inverse = np.linalg.inv(weights.inner(common, common) + precision)
    degrees = NoiseDegrees(posterior, common, precision)
    pull = weights.inner(common, at.residual[:, :, None])[:, 0]
    pull[:at.design.shape[2]] = 0.0     # at the mode data and prior are in balance
    raw = []
    for part, rest, mask in partitions(rows):
        counts = int((mask & loaded).sum()), int((~mask & loaded).sum())
        if min(counts) < FEWEST_ROWS:
            continue
        design = np.where(mask[:, None, None], at.design, 0.0)
        cross = weights.inner(common, design)
        own = weights.inner(design, design)
        score = weights.inner(design, at.residual[:, :, None])[:, 0] - cross.T @ (inverse @ pull)
        left = own - cross.T @ inverse @ cross
        eigenvalues, vectors = np.linalg.eigh(0.5 * (left + left.T))
        kept = eigenvalues > DETERMINED
        if not kept.any():
            continue
        along = vectors[:, kept].T @ score
        squared, directions = float(np.sum(along**2 / eigenvalues[kept])), int(kept.sum())
        p_value = float(chi2_tail(squared, directions))
        if p_value < WORTH_DEGREES:
            known = degrees.along(design, eigenvalues[kept], vectors[:, kept])
            p_value = float(f_tail(squared / directions, directions, known))
        difference = -vectors[:, kept] @ (along / eigenvalues[kept])
        raw.append(Conflict(part, rest, counts, float(np.sqrt(squared)), directions, p_value, p_value, difference))
    conflicts = [replace(conflict, corrected=min(1.0, conflict.p_value * len(raw))) for conflict in raw]
    return tuple(sorted(conflicts, key=lambda conflict: conflict.p_value))

"""Directions in which no point tells how far the part is off: level normals of upright walls say nothing of its height."""

from __future__ import annotations

import numpy as np

from compensator.correction.predict import Predicted
from compensator.learning.rows import Rows
from identification.common.findings import Finding

# Where the points' directions have less than this share of their mean square [1] along an axis they do not see it: normals
# within 6 degrees of a plane; engineering judgement.
LEAST_SEEN = 0.01


def said_of_unseen(rows: Rows, predicted: Predicted, source: str) -> list[Finding]:
    """A warning (CS5331) for each axis, in the work object, that the points do not see."""
    path, first, direction = predicted.path, predicted.targets[:1], rows.direction
    if rows.to_base is not None:        # as the part has them, wherever its table stands
        direction = np.einsum("nji,nj->ni", rows.to_base[rows.place], direction)
    share, axes = np.linalg.eigh(direction.T @ direction)
    to_object = path.axes.to_rest(path.base_from_object[first], first)[0].rotation.T
    findings = []
    for axis in axes.T[share < LEAST_SEEN * share.sum()]:
        along = to_object @ axis
        along *= np.sign(along[np.argmax(np.abs(along))])
        said = ", ".join(f"{value:.2f}" for value in np.where(np.abs(along) < 0.005, 0.0, along))
        findings.append(Finding(
            "CS5331", "warning", f"no point tells how far the part is off along ({said}) of its work object: what set-up, "
            "calibration and warming do that way is not learned, and in left_um by how far it is off the other ways",
            file=source,
            hint="measure faces that look that way too, or all components of the points"))
    return findings

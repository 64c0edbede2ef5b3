"""Whether a program was corrected before, told by its own orientations: the record beside it tells, where it came along.

A correction turns each target against the arm's tilt under its force, by hundredths of a degree, and leaves those in the air as
they are. A planned program of one orientation has none of these turns; one that was fetched back from the controller has them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from compensator.correction.correction import Correction
from compensator.correction.predict import Predicted
from identification.common.arrays import rms
from identification.common.findings import Finding
from identification.model.rotations import rotation_vector

# Targets in the air have one orientation where so many, and this share of them, agree within this [rad]; those in the cut were
# turned where they stand off it by this [rad, RMS], and by a degree at most: an axis that leans along the path goes farther.
ALIKE, FEWEST, MOSTLY, TURNED, MOST = 1e-6, 3, 0.6, 2e-5, np.radians(1.0)
# They were as by a correction where this share of their turns (its square) is that of this one, so many times of it.
SHARE, TIMES = 0.7, (0.6, 1.6)


def said_of_own_turns(predicted: Predicted, kept: NDArray[np.intp], correction: Correction) -> tuple[Finding, ...]:
    """A warning (CS4207) where the orientations of the program's own targets, `kept` (N,) among those of `predicted`, are
    turned as this correction would turn them."""
    path = predicted.path
    which = np.isin(correction.targets, kept)
    targets, turn = correction.targets[which], correction.turn[which]
    rotation = np.swapaxes(path.base_from_object.rotation, -1, -2) @ path.base_from_tcp.rotation
    air = np.setdiff1d(kept[np.isfinite(rotation[kept]).all(axis=(1, 2))], predicted.targets)
    if len(air) < FEWEST or len(targets) < FEWEST:
        return ()
    # As most of them stand, component by component: of one orientation the middle is that one.
    middle = rotation[air[np.argmin(np.abs(rotation[air] - np.median(rotation[air], axis=0)).sum(axis=(1, 2)))]]
    alike = np.linalg.norm(rotation_vector(rotation[air] @ middle.T), axis=1) < ALIKE
    if alike.sum() < max(FEWEST, MOSTLY * len(air)):
        return ()
    own = rotation_vector(rotation[targets] @ middle.T)
    size = np.linalg.norm(own, axis=1)
    if rms(size) < TURNED or size.max() > MOST:
        return ()
    times = float(np.sum(own * turn) / max(np.sum(turn**2), 1e-30))
    if not TIMES[0] < times < TIMES[1] or np.sum((own - times * turn) ** 2) > (1 - SHARE) * np.sum(own**2):
        return ()
    return (Finding(
        "CS4207", "warning", f"the orientations of {len(targets)} targets are turned off the program's own by "
        f"{np.degrees(rms(size)):.4f} deg RMS, {times:.2f} times as this correction would turn them: is this program corrected "
        "already?", file=str(predicted.program.source or "") or None,
        hint="correct the planned program of the CAM system, by the log of the corrected pass with --logged-with OFFSETS.csv"),)

"""Was the logged pass driven as it is said, with these offsets or with none? Logged positions are where the program sent the
tool, so that they stand off the planned path by the offsets of the pass, which are the deflection turned round."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from compensator.correction.predict import Predicted
from compensator.path.arc_length import nearest_target
from identification.common.arrays import rms
from identification.common.findings import Finding

Array = NDArray[np.float64]
# So many targets, and so large a deflection across the path [m, RMS], say something.
FEWEST, LEAST = 40, 3e-5
# The positions stand off as the deflection does where it explains this share of their square, and they are so many times of it;
# not as the offsets of --logged-with where they are under this share of them (engineering judgement).
EXPLAINS, TIMES, HARDLY = 0.5, (0.7, 1.4), 0.3


def said_of_positions(planned: Predicted, offsets: Array | None) -> tuple[Finding, ...]:
    """Warnings (CS3075, CS3076). offsets (N, 3) [m], base frame, that the pass is said to have had; None: none."""
    log, path, targets = planned.forces.log, planned.path, planned.targets
    if log.beside is None or path.axes.driven or any(finding.code == "CS3120" for finding in planned.findings):
        return ()
    placed = np.isfinite(log.place)
    target = nearest_target(path.length, log.place[placed])
    count: NDArray[np.intp] = np.bincount(target, minlength=len(path.toolpath)).astype(np.intp)
    total = np.column_stack([np.bincount(target, axis, len(count)) for axis in log.beside[placed].T])
    beside = path.axes.world_from_base.inverse().turn(total / np.maximum(count, 1)[:, None])
    # What lies along the path does not show: a sample is placed at the nearest point.
    along = np.gradient(path.base_from_tcp.position, axis=0)
    along /= np.maximum(np.linalg.norm(along, axis=1), 1e-300)[:, None]

    def across(values: Array, which: NDArray[np.intp]) -> Array:
        return np.asarray(values - np.einsum("ni,ni->n", values, along[which])[:, None] * along[which])

    known = count[targets] > 0
    which = np.asarray(targets[known], dtype=np.intp)
    if len(which) < FEWEST:
        return ()
    off, deflection = across(beside[which], which), across(planned.prediction.position[known], which)
    if offsets is not None:
        sent = across(offsets[which], which)
        if rms(np.linalg.norm(sent, axis=1)) < LEAST or np.sum(off * sent) > HARDLY * np.sum(sent**2):
            return ()
        return (Finding(
            "CS3076", "warning", f"the positions in the log stand {1e6 * rms(np.linalg.norm(off, axis=1)):.0f} um RMS off the "
            f"planned path, and not as the offsets of --logged-with do ({1e6 * rms(np.linalg.norm(sent, axis=1)):.0f} um)",
            file=log.source, hint="was it logged without them? Then leave --logged-with out"),)
    if rms(np.linalg.norm(deflection, axis=1)) < LEAST:
        return ()
    times = float(np.sum(off * deflection) / np.sum(deflection**2))
    if times * np.sum(off * deflection) < EXPLAINS * np.sum(off**2) or not TIMES[0] < abs(times) < TIMES[1]:
        return ()
    if times < 0:
        what = "against the deflection, as those of a corrected pass do"
        hint = "name the offsets of that pass with --logged-with, and the planned program"
    else:
        what = "by the deflection itself, as those of the planned pass do off a program that is corrected already"
        hint = ("give the planned program of the CAM system: nothing is corrected twice. Right where the log has the loaded "
                "tool, measured from outside")
    return (Finding("CS3075", "warning", f"the positions in the log stand {1e6 * rms(np.linalg.norm(off, axis=1)):.0f} um RMS "
                    f"off the path, {what}", file=log.source, hint=hint),)

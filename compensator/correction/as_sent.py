"""The log of a corrected program, placed by its targets: logged TCP positions are where the program sent the tool, and have its
offsets in them.

The part of an offset along the feed moves a logged position along the path by as much: before a corner the force grows by some
100 N/mm there, and 0.2 mm of offset would be 20 N.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from compensator.correction.correctable import targets_to_correct
from compensator.correction.predict import Predicted
from compensator.correction.prediction import predict_path
from compensator.correction.sent_offsets import SentOffsets
from compensator.forces.placement import place_forces
from compensator.path.robot_path import RobotPath

Array = NDArray[np.float64]


def as_sent(planned: Predicted, offsets: SentOffsets | None) -> Predicted:
    """The program under a log that is placed by its targets, whatever offsets they were driven with; None: without any."""
    path, log = planned.path, planned.forces.log
    if offsets is None or not log.sent:
        return planned
    targets = np.arange(float(len(path.length)))
    known = np.flatnonzero(np.isfinite(path.length))
    on = np.isfinite(path.length[np.ceil(offsets.place).astype(np.intp)])
    length = np.interp(offsets.place[on], targets[known], path.length[known])
    # No target stands behind the one before.
    driven = np.maximum.accumulate(np.nan_to_num(length + _along_feed(path, offsets)[on]))
    place = np.interp(log.place, driven, length, left=np.nan, right=np.nan)
    # The tare was judged on the log as it was.
    placed = place_forces(replace(log, place=place, sent=False), path, planned.cell, tare=planned.settings.log.tare,
                          trust_tare=True)
    targets, _ = targets_to_correct(path, placed)
    loaded = replace(planned.loaded, forces=placed, targets=targets)
    return replace(planned, loaded=loaded, prediction=predict_path(loaded))


def _along_feed(path: RobotPath, offsets: SentOffsets) -> Array:
    """The part (W,) of the offsets along the feed; 0 at targets of unknown position."""
    to = np.ceil(offsets.place).astype(np.intp)
    known = np.flatnonzero(path.known[to] & path.known[np.maximum(to - 1, 0)] | path.known[to] & (offsets.place == to))
    along = np.zeros_like(offsets.offset)
    if len(known) > 1:
        targets = np.flatnonzero(path.known)
        position = np.column_stack([np.interp(offsets.place[known], targets, axis[targets])
                                    for axis in path.rest_from_tcp.position.T])
        along[known] = path.axes.turned_to_base(np.gradient(position, axis=0), to[known])
    along /= np.maximum(np.linalg.norm(along, axis=1), 1e-300)[:, None]
    return np.asarray(np.einsum("ni,ni->n", offsets.offset, along))

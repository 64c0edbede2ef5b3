"""The log of a corrected program, placed by its targets: logged TCP positions are where the program sent the tool, and have its
offsets in them.

The part of an offset along the feed moves a logged position along the path by as much: before a corner the force grows by some
100 N/mm there, and 0.2 mm of offset would be 20 N. A logged path length counts the way that the tool was sent: with its
offsets, which come and go, it is longer or shorter than that of the plan by a millimetre or more at the end.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from compensator.correction.correctable import targets_to_correct
from compensator.correction.pass_offsets import PassOffsets
from compensator.correction.predict import Predicted
from compensator.correction.prediction import predict_path
from compensator.forces.placement import place_forces
from compensator.path.arc_length import polyline
from compensator.path.robot_path import RobotPath
from identification.common.arrays import Array, directions


def as_sent(planned: Predicted, offsets: PassOffsets | None) -> Predicted:
    """The program under a log that is placed by its targets, whatever offsets they were driven with; None: without any."""
    path, log = planned.path, planned.forces.log
    if offsets is None or not (log.sent or log.counted):
        return planned
    length = offsets.length(path.length)
    known = np.flatnonzero(np.isfinite(length))
    length = length[known]
    if log.counted:
        driven = _counted_with(path, offsets, known, length)
        if driven is None or abs(log.place.max() - driven[-1]) >= abs(log.place.max() - length[-1]):
            return planned
    else:
        # No target stands behind the one before.
        driven = np.maximum.accumulate(length + np.nan_to_num(_along_feed(path, offsets)[known]))
    place = np.interp(log.place, driven, length, left=np.nan, right=np.nan)
    # The tare was judged on the log as it was.
    log = replace(log, place=place, sent=False, counted=False)
    placed = place_forces(log, path, planned.cell, tare=planned.settings.log.tare, trust_tare=True)
    targets, _ = targets_to_correct(path, placed)
    loaded = replace(planned.loaded, forces=placed, targets=targets)
    return replace(planned, loaded=loaded, prediction=predict_path(loaded))


def _counted_with(path: RobotPath, offsets: PassOffsets, known: NDArray[np.intp], length: Array) -> Array | None:
    """The path lengths (n,) [m] with the offsets at those targets `known` (n,), given and added, whose planned ones are
    `length` (n,); None where the axes or the order in which targets are driven say otherwise."""
    if path.axes.driven or path.toolpath.driven is not None or path.toolpath.ways:
        return None
    points, at = polyline(path.world_position, path.toolpath.move)
    planned = np.column_stack([np.interp(length, at, axis) for axis in points.T])
    sent = planned + path.axes.world_from_base.turn(offsets.offset[known])
    longer = np.linalg.norm(np.diff(sent, axis=0), axis=1) - np.linalg.norm(np.diff(planned, axis=0), axis=1)
    return np.asarray(np.maximum.accumulate(length + np.concatenate([[0.0], np.cumsum(longer)])))


def _along_feed(path: RobotPath, offsets: PassOffsets) -> Array:
    """The part (N + A,) along the feed of the offsets, in their order: of the path at the targets as given, 0 where their
    position is not known, of its move at the added ones."""
    position, along = path.rest_from_tcp.position, np.zeros_like(offsets.given)
    known = np.flatnonzero(path.known)
    if len(known) > 1:
        along[known] = path.axes.turned_to_base(np.gradient(position[known], axis=0), known)
    move = path.axes.turned_to_base(position[offsets.before] - position[offsets.before - 1], offsets.before)
    return np.asarray(np.einsum("ni,ni->n", offsets.offset, directions(offsets.in_order(along, move))))

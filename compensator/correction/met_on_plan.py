"""Which force a tool on the plan meets: a log says where the program sent the tool, and the tool stood beside it.

A sample at the path length s was taken with the tool at s + e_t: e_t is the part along the feed of what the tool stood off the
plan, its offsets and its deviation. There a tool on the plan will meet that force. Where the force changes along the path this
counts as much as the depth (engagement.py): at an entry and before a corner it grows by some 100 N/mm, and a tool
pushed back by 0.1 mm meets all of it so much later.

Logged TCP positions, and those of logged joint angles, have the offsets in them, which are taken off first. A log that names
targets is as coarse as they are, and stays. Where the feed turns the force turns with it, as commanded and not where the tool
was: at a corner, a vertex of chords or on an arc no sample is moved, and none by more than half the way to one.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from compensator.correction.correctable import targets_to_correct
from compensator.correction.engagement import standing
from compensator.correction.predict import Predicted
from compensator.correction.prediction import predict_path
from compensator.forces.placement import place_forces
from compensator.path.robot_path import RobotPath
from compensator.toolpath import Move

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
# sin of an angle by which the feed turns for the force to turn with it: 1 degree.
TURN = float(np.sin(np.radians(1.0)))


def as_sent(planned: Predicted, offsets: Array | None) -> Predicted:
    """The program under a log that is placed by its targets, whatever offsets (N, 3) [m], base frame, they were driven with."""
    path, log = planned.path, planned.forces.log
    if offsets is None or not log.sent:
        return planned
    known = np.flatnonzero(np.isfinite(path.length))
    length = path.length[known]
    driven = _in_order(length + along_feed(path, offsets)[known])
    return _placed_at(planned, np.interp(log.place, driven, length, left=np.nan, right=np.nan))


def met_on_plan(planned: Predicted, offsets: Array | None) -> Predicted:
    """The program under the forces that a tool on its plan meets at each target, but for the depth (engagement.py), out of
    those of a pass with these offsets (N, 3) [m], base frame. Predicted forces are those of a tool on the plan already."""
    forces, path = planned.forces, planned.path
    if forces.named or forces.unknown is not None or not len(planned.targets):
        return planned
    known = np.flatnonzero(np.isfinite(path.length))
    length, place = path.length[known], forces.log.place
    with np.errstate(over="ignore", invalid="ignore"):          # absurd numbers in targets without force
        room = 0.5 * _to_turn(path, known)
        stood = _in_order(length + np.clip(along_feed(path, standing(planned, offsets))[known], -room, room))
    return _placed_at(planned, place + np.interp(place, length, stood - length))


def _placed_at(planned: Predicted, place: Array) -> Predicted:
    """The program under its log with the rows at other places (M,) [m]."""
    # The tare was judged on the log as it was.
    placed = place_forces(replace(planned.forces.log, place=place, sent=False), planned.path, planned.cell,
                          tare=planned.settings.log.tare, trust_tare=True)
    targets, _ = targets_to_correct(planned.path, placed)
    loaded = replace(planned.loaded, forces=placed, targets=targets)
    return replace(planned, loaded=loaded, prediction=predict_path(loaded))


def _in_order(place: Array) -> Array:
    """Places (K,) along the path, none behind the one before."""
    return np.asarray(np.maximum.accumulate(np.nan_to_num(place)))


def along_feed(path: RobotPath, values: Array) -> Array:
    """The part (N,) along the feed of vectors (N, 3), base frame; 0 at targets of unknown position."""
    position, along = path.rest_from_tcp.position, np.zeros_like(values)
    known = np.flatnonzero(path.known)
    if len(known) > 1:
        along[known] = path.axes.turned_to_base(np.gradient(position[known], axis=0), known)
    along /= np.maximum(np.linalg.norm(along, axis=1), 1e-300)[:, None]
    return np.asarray(np.einsum("ni,ni->n", values, along))


def _to_turn(path: RobotPath, known: Indices) -> Array:
    """How far from the nearest place at which the feed turns [m] the targets known (K,) stand; inf without one."""
    way = np.diff(path.rest_from_tcp.position[known], axis=0)
    way /= np.maximum(np.linalg.norm(way, axis=1), 1e-12)[:, None]
    move = path.toolpath.move[known]
    arc = np.isin(move, (Move.ARC_VIA, Move.ARC_END))
    arc |= np.append(arc[1:], False)
    arc[1:-1] |= np.linalg.norm(np.diff(way, axis=0), axis=1) > TURN
    length = path.length[known]
    turns = length[arc]
    if not len(turns):
        return np.full(len(length), np.inf)
    behind = np.searchsorted(turns, length)
    near = turns[np.clip(behind, 0, len(turns) - 1)], turns[np.clip(behind - 1, 0, len(turns) - 1)]
    return np.asarray(np.minimum(*(np.abs(length - turn) for turn in near)))

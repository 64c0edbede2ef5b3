"""What a program says over time: when it is where, which of its moves cut, and what may carry force then."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from compensator.path.robot_path import RobotPath
from compensator.path.timing import drive
from compensator.toolpath import Toolpath
from identification.common.arrays import Array, read_only
from identification.common.findings import counted, error

Indices = NDArray[np.intp]
Flags = NDArray[np.bool_]
# Feeds whose gap is at least this factor are cutting feed and air feed.
AIR_FACTOR = 2.0
# The edge of a cut is this wide [m].
EDGE = 4e-3
# Feeds whose cuts have a force of their own.
KINDS = 2
HINT = "log the column target, or x_mm y_mm z_mm (TCP in the work object), with the forces"


@dataclass(frozen=True, eq=False)
class ProgramTime:
    """time (N,) [s] and length (N,) [m] at which each target is reached, ascending; air (N,): the move to the target does not
    cut; kind (N,): moves of one number cut alike, such as those of one feed; direction (N, 3): unit vector of the move to it,
    in the log's frame. slowed (N,) [s]: how much of the time is for speeding up and braking; None: it is not known."""

    time: Array
    length: Array
    air: Flags
    kind: Indices
    direction: Array
    slowed: Array | None = None

    def __post_init__(self) -> None:
        read_only(self.time, self.length, self.air, self.kind, self.direction)

    @property
    def duration(self) -> float:
        """Of the whole program [s]."""
        return float(self.time[-1] - self.time[0])

    def with_slowing(self, share: float) -> ProgramTime:
        """The program as a robot drives it that takes this share of the time for speeding up and braking."""
        slowed = np.zeros_like(self.time) if self.slowed is None else self.slowed
        return ProgramTime(self.time + (share - 1) * slowed, self.length, self.air, self.kind, self.direction, share * slowed)

    @cached_property
    def speed(self) -> Array:
        """Mean speed (N,) [m/s] of the move to each target; 0 where that takes no time."""
        step, duration = np.diff(self.length, prepend=self.length[:1]), np.diff(self.time, prepend=self.time[:1])
        return np.asarray(np.where(duration > 0, step / np.maximum(duration, 1e-9), 0.0))

    @cached_property
    def stretches(self) -> list[tuple[int, int]]:
        """Stretches of moves that may cut: the target before the first of them, and the last one."""
        cuts = ~self.air
        cuts[0] = False
        edges = np.flatnonzero(np.diff(np.concatenate([[False], cuts, [False]]).astype(int)))
        return [(int(a) - 1, int(b) - 1) for a, b in zip(edges[::2], edges[1::2], strict=True)]

    @cached_property
    def typical_stretch(self) -> float:
        """Duration of a typical stretch that cuts [s]."""
        durations = [self.time[b] - self.time[a] for a, b in self.stretches]
        return float(np.median(durations)) if durations else float(self.time[-1])

    @cached_property
    def period(self) -> float:
        """Typical time from cut to cut [s]."""
        return self.duration / max(len(self.stretches), 1)

    @cached_property
    def _ends(self) -> tuple[Array, Array]:
        """Path length (N,) [m] at the start and the end of the stretch that each move belongs to; 0 on air moves."""
        first, last = np.zeros(len(self.time)), np.zeros(len(self.time))
        for a, b in self.stretches:
            first[a + 1:b + 1], last[a + 1:b + 1] = self.length[a], self.length[b]
        return first, last

    @cached_property
    def _carried(self) -> Array:
        """1 and the direction (N, 4) of each move."""
        return np.column_stack([np.ones(len(self.time)), self.direction])

    def engagement(self, planned: Array, lead_in: float, lead_out: float) -> tuple[Array, Indices]:
        """What may carry force at planned times (n,) [s]: engaged, and engaged times direction, (n, 4), zero outside the
        program and over lead-in and lead-out [m]; and the move (n,)."""
        move = np.minimum(np.maximum(np.searchsorted(self.time, planned, side="left"), 1), len(self.time) - 1)
        before = move - 1
        s = self.length.take(before) + self.speed.take(move) * (planned - self.time.take(before))
        first, last = self._ends
        engaged = (np.clip((s - first.take(move) - lead_in) / EDGE + 0.5, 0, 1)
                   * np.clip((last.take(move) - lead_out - s) / EDGE + 0.5, 0, 1))
        engaged *= ~self.air.take(move) & (planned >= self.time[0]) & (planned <= self.time[-1])
        return np.asarray(engaged[:, None] * self._carried.take(move, axis=0)), move


def air_moves(feed: Array, by_joints: Flags) -> Flags:
    """Moves (N,) that do not cut: joint moves, and those of the fast class where the feeds (N,) [m/s] fall into two classes."""
    feeds = np.unique(feed[(feed > 0) & ~by_joints])
    ratio = feeds[1:] / feeds[:-1]
    if not len(ratio) or ratio.max() < AIR_FACTOR:
        return by_joints
    return np.asarray(by_joints | (feed >= feeds[1:][np.argmax(ratio)]))


def moves_in_air(toolpath: Toolpath) -> Flags:
    """The moves (N,) of a toolpath that do not cut (`air_moves`)."""
    return air_moves(toolpath.feed, toolpath.by_joints)


def kinds_of_cut(feed: Array, air: Flags, length: Array) -> Indices:
    """Number (N,) of the kind of cut of each move: one for each of the KINDS feeds with most path, one for all others."""
    step = np.diff(length, prepend=length[:1])
    feeds, which = np.unique(np.round(feed, 6), return_inverse=True)
    share = np.bincount(which, np.where(air, 0.0, step))
    rank = np.argsort(np.argsort(-share, kind="stable"), kind="stable")
    return np.asarray(np.minimum(rank[which], min(KINDS, len(feeds) - 1)))


def program_time(path: RobotPath) -> ProgramTime:
    """The program in time, as the robot can drive it. Raises CompstiffError (CS3060) where the feed or the way of a move is not
    known."""
    toolpath, robot_time = path.toolpath, drive(path)
    legs = robot_time.route.legs
    unknown = np.flatnonzero(np.isnan(robot_time.duration) | (legs.linear & np.isnan(robot_time.programmed)))
    if len(unknown):
        first = int(unknown[0])
        feeds = legs.linear & np.isnan(robot_time.programmed)
        why, mend = ("its feed is not known", "declare the speed in this file") if feeds[first] else (
            "the robot's way to it is not known: its place, or that of the target before it, is said nowhere or out of reach",
            "declare the target in this file")
        alike = int((feeds[unknown] == feeds[first]).sum())
        raise error("CS3060", f"a log with time alone needs the time of every move: target {first}: {why} "
                    f"({counted(alike, 'such target')})", file=toolpath.source, line=int(toolpath.line[first]),
                    target=first, hint=f"{mend}, or {HINT}")
    length = path.length
    air = moves_in_air(toolpath)
    at_feed = np.where(legs.linear, np.fmin(robot_time.programmed, robot_time.duration), robot_time.duration)
    return ProgramTime(robot_time.time, length, air, kinds_of_cut(toolpath.feed, air, length), travel_in_log(path),
                       np.cumsum(np.nan_to_num(robot_time.duration - at_feed)))


def travel_in_log(path: RobotPath) -> Array:
    """Unit vectors (N, 3) along the moves to each target, in the base frame or that of the tool, as the log's forces are; zeros
    where there is no way."""
    step = path.steps
    direction = step / np.maximum(np.linalg.norm(step, axis=1), 1e-9)[:, None]
    if path.cell.force_log.kind != "base":
        # The sensor's frame turns with the tool's; a fixed rotation between them is part of what is estimated.
        direction = np.einsum("nji,nj->ni", path.base_from_tcp.rotation, direction)
    return np.asarray(direction)

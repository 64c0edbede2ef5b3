"""Can the robot hold the programmed feed, as planned and as corrected? Where not, which joint, why, and what it costs.

A grid point holds the feed when the joints can drive it at constant speed there: `|q'| v` within the speeds, `|q''| v^2` within
the accelerations. That is the verdict; it is free of ramps. What starts, stops, corners and held-back stretches cost in time is
TOPPRA's (`timing.py`). The programmed stops cost time too and are counted apart.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compensator.path.legs import SHARPEST, Poses
from compensator.path.robot_path import RobotPath
from compensator.path.timing import Drive, drive
from identification.common.findings import Finding, Level, Refused, counted
from identification.model.inverse import NEARLY_SINGULAR, configuration, wrist_distance
from identification.model.kinematics import chunks

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Flags = NDArray[np.bool_]

# A feed of this share or more is held.
HELD = 0.99
# A move passes the wrist singularity between its targets where it comes nearer than this share of their distance.
NEARER = 0.9
# Within this distance of the wrist singularity [rad] axes 4 and 6 turn three times as fast as the tool or faster (1 / sin), and
# turning the part helps; engineering judgement.
WRIST_COUNTS = np.radians(20.0)
# So many stretches are told one by one.
MOST_TOLD = 5


@dataclass(frozen=True, eq=False)
class Feasibility:
    """One program, driven. path, poses: what was driven; forced (N,): the targets with force; cutting (N,): the moves with
    force at both of their ends.

    ratio (N,): the lowest share of the programmed feed that the joints can hold on the way to each target, 1 where all of it;
    NaN where the move is not judged by its feed. joint (N,) index and by_speed (N,): what holds it back there, at the grid
    point `point` (N,). wrist (N,) [rad]: the smallest distance from the wrist singularity on the way. outside (N,): a joint
    limit or the rod's window is left between the targets. lost (N,) [s]: over length / feed.
    """

    path: RobotPath
    poses: Poses
    forced: Flags
    cutting: Flags
    drive: Drive
    ratio: Array
    joint: Indices
    by_speed: Flags
    point: Indices
    wrist: Array
    outside: Flags
    lost: Array

    @property
    def slow(self) -> Flags:
        """Moves (N,) that cannot hold their feed."""
        return np.asarray(self.ratio < HELD)

    def moves(self, which: Flags | Indices) -> int:
        """How many moves of the program as given these are: one that was given further targets counts once."""
        return len(np.unique(self.path.toolpath.number[which]))

    def seconds_lost(self, which: Flags | Indices) -> float:
        """What these moves lose against length / feed [s]; none where rounded corners make up for it."""
        return max(float(np.nansum(self.lost[which])), 0.0)

    def as_dict(self) -> dict[str, Any]:
        """Its figures, JSON values."""
        judged = ~np.isnan(self.ratio)
        lowest = [float(np.nanmin(self.ratio[mask], initial=1.0)) for mask in (judged, judged & self.cutting)]
        drive = self.drive
        return {
            "time_s": round(float(drive.time[-1]), 4), "programmed_time_s": round(float(np.nansum(drive.programmed)), 4),
            "joint_moves_s": round(float(np.nansum(drive.duration[drive.route.legs.joint])), 4),
            "judged": self.moves(judged), "held_back": self.moves(self.slow),
            "held_back_with_force": self.moves(self.slow & self.cutting),
            "lowest_feed_ratio": round(lowest[0], 4), "lowest_feed_ratio_with_force": round(lowest[1], 4),
            "lost_held_back_s": round(self.seconds_lost(self.slow), 4),
            "lost_ramps_s": round(self.seconds_lost(judged & ~self.slow), 4),
            "wrist_margin_deg": round(float(np.degrees(self.wrist.min(initial=np.pi / 2))), 4),
        }


@dataclass(frozen=True, eq=False)
class FeedCheck:
    """The program as given, and as corrected, with the targets that were added to it and the zones that were made smaller."""

    before: Feasibility
    after: Feasibility | None
    findings: tuple[Finding, ...]

    @property
    def last(self) -> Feasibility:
        """What the robot is to drive."""
        return self.after or self.before

    def as_dict(self) -> dict[str, Any]:
        """The figures before and after correction, JSON values."""
        return {when: program.as_dict() for when, program in (("planned", self.before), ("corrected", self.after)) if program}

    def lines(self) -> list[str]:
        """For the terminal: what the corrected program holds, beside the planned one."""
        planned, corrected = self.before.as_dict(), self.last.as_dict()

        def both(key: str, form: str, factor: int = 1) -> str:
            return f"{factor * corrected[key]:{form}} (as planned {factor * planned[key]:{form}})"

        return [
            f"feed cannot be held by {both('held_back', 'd')} of {corrected['judged']} moves, in the cut by "
            f"{both('held_back_with_force', 'd')}; lowest share {both('lowest_feed_ratio', '.0f', 100)} %, in the cut "
            f"{both('lowest_feed_ratio_with_force', '.0f', 100)} %",
            f"time: {both('time_s', '.1f')} s, of them {both('lost_held_back_s', '.2f')} s lost where the feed cannot be held "
            f"and {both('lost_ramps_s', '.2f')} s at stops and changes of feed",
        ]


def judge(path: RobotPath, forced: Flags | None = None, poses: Poses | None = None) -> Feasibility:
    """Drives the planned poses, or these. Raises CompstiffError (CS4409)."""
    poses = poses or Poses(path.base_from_tcp, path.theta)
    driven = drive(path, poses)
    route, robot, limits, count = driven.route, path.cell.robot, path.limits, len(path.toolpath)
    ratio, by_speed = np.full(count, np.nan), np.zeros(count, dtype=bool)
    joint, point = np.zeros(count, dtype=np.intp), np.zeros(count, dtype=np.intp)
    known = route.legs.linear & (path.toolpath.feed > 0)
    ratio[known] = 1.0
    wrist, outside = np.full(count, np.inf), np.zeros(count, dtype=bool)
    for part in chunks(len(route.s), 65_536):
        leg, feed = route.leg[part], route.feed[part, None]
        with np.errstate(divide="ignore", invalid="ignore"):      # an unknown feed is infinite, a joint may rest
            of_speed = limits.speed / np.abs(route.dtheta_ds[part]) / feed
            of_acceleration = np.sqrt(limits.acceleration / np.abs(route.d2theta_ds2[part])) / feed
        share = np.minimum(of_speed, of_acceleration)
        which = np.argmin(share, axis=1)
        lowest = share[np.arange(len(leg)), which]
        # The worst point of each leg: sorted by leg, the lowest first.
        order = np.lexsort((lowest, leg))
        first = order[np.unique(leg[order], return_index=True)[1]]
        worse = first[lowest[first] < np.where(np.isnan(ratio[leg[first]]), -np.inf, ratio[leg[first]])]
        ratio[leg[worse]], joint[leg[worse]] = lowest[worse], which[worse]
        point[leg[worse]] = part.start + worse
        by_speed[leg[worse]] = (of_speed <= of_acceleration)[worse, which[worse]]
        np.minimum.at(wrist, leg, wrist_distance(robot, route.theta[part, :6]))
        np.logical_or.at(outside, leg, (robot.limit_excess(route.theta[part, :6]) > 1e-7).any(axis=1))
    lost = np.where(known, driven.duration - driven.programmed, 0.0)
    forced = np.zeros(count, dtype=bool) if forced is None else forced
    # A single noisy target on an air move is no cut.
    cutting = forced & forced[route.legs.before]
    return Feasibility(path, poses, forced, cutting, driven, ratio, joint, by_speed, point, wrist, outside, lost)


def check_feed(before: Feasibility, after: Feasibility | None = None, *, strict: bool) -> FeedCheck:
    """The verdict on the program as given and, where there is one, on the corrected one, with the targets that were added.

    strict: Refused (CS4402) where a cut cannot hold its feed in the program that would be written.
    """
    check = FeedCheck(before, after, ())
    last = check.last
    if strict and (last.slow & last.cutting).any():
        raise Refused(*_cuts(check, "CS4402", "error"))
    unfollowed = np.flatnonzero(last.drive.route.lost & last.cutting)
    if strict and len(unfollowed):
        raise Refused(last.path.finding(int(unfollowed[0]), "CS4402", "error", f"{counted(last.moves(unfollowed), 'cut')} the "
                         "robot cannot follow between the targets: it would stop", "add targets, or turn the part"))
    findings = [*_cuts(check, "CS4401", "warning"), *_air(last), *_places(before, "as planned")]
    if after is not None:
        findings += _places(after, "after correction")
    return FeedCheck(before, after, (*findings, *_configurations(before), *_assumed(before)))


def _reason(driven: Feasibility, target: int) -> tuple[str, str]:
    """What holds a move back, and what would help."""
    joint = int(driven.joint[target])
    limits, axis = driven.path.limits, driven.path.axes.driven[joint - 6] if joint >= 6 else None
    name, unit, factor = (f"joint {joint + 1}", "deg", np.radians(1.0)) if axis is None else (axis.name, axis.unit, axis.factor)
    limit = (f"speed limit ({limits.speed[joint] / factor:g} {unit}/s)" if driven.by_speed[target]
             else f"acceleration limit ({limits.acceleration[joint] / factor:g} {unit}/s^2)")
    route, words = driven.drive.route, ""
    legs = route.legs
    if not driven.by_speed[target]:
        # The corner is the one at the nearer end of the leg.
        grid, place = np.flatnonzero(route.leg == target), driven.point[target]
        nearer_end = route.s[grid[-1]] - route.s[place] <= route.s[place] - route.s[grid[0]]
        corner = target if nearer_end else int(legs.before[target])
        if legs.radius[corner] > 0 and legs.corner[corner] > np.radians(1.0):
            words = (f", in the corner of {np.degrees(legs.corner[corner]):.0f} deg at target "
                     f"{driven.path.toolpath.number[corner]}, rounded by a zone of "
                     f"{1e3 * legs.radius[corner]:.3g} mm")
    helps = "lower the feed there" + (", or round the corner with a larger zone" if words else "")
    wrist = float(driven.wrist[target])
    if joint in (3, 5) and wrist < WRIST_COUNTS:
        helps += f", or turn the part: axis 5 comes within {np.degrees(wrist):.1f} deg of the wrist singularity"
    return f"{name} at its {limit}{words}", helps


def _cuts(check: FeedCheck, code: str, level: Level) -> list[Finding]:
    """One finding a stretch of moves with force that cannot hold their feed, the worst first; the rest counted."""
    driven = check.last
    places = np.flatnonzero(driven.slow & driven.cutting)
    if not len(places):
        return []
    runs = np.split(places, np.flatnonzero(np.diff(places) > 1) + 1)
    worst = np.array([int(run[np.argmin(driven.ratio[run])]) for run in runs])
    order = np.argsort(driven.ratio[worst], kind="stable")
    findings = []
    for index in order[:MOST_TOLD]:
        target, run = int(worst[index]), runs[index]
        planned = float(check.before.ratio[driven.path.toolpath.number[target]])
        before = "" if check.after is None or np.isnan(planned) else f"; as planned {_percent(min(planned, 1.0))}"
        reason, helps = _reason(driven, target)
        findings.append(driven.path.finding(
            target, code, level, f"a cut of {counted(driven.moves(run), 'target')} cannot hold {_feed(driven, target)}: "
            f"{_percent(driven.ratio[target])}, {reason}; {driven.seconds_lost(run):.2f} s lost{before}", helps))
    if len(runs) > MOST_TOLD:
        rest = worst[order[MOST_TOLD:]]
        findings.append(driven.path.finding(int(rest[0]), code, level, f"{counted(len(rest), 'further cut')} cannot hold "
                                            f"the feed; the lowest {_percent(driven.ratio[rest].min())}"))
    return findings


def _air(driven: Feasibility) -> list[Finding]:
    """One note for all moves without force that cannot hold their feed."""
    places = np.flatnonzero(driven.slow & ~driven.cutting)
    if not len(places):
        return []
    target = int(places[np.argmin(driven.ratio[places])])
    return [driven.path.finding(target, "CS4411", "note", f"{counted(driven.moves(places), 'move')} without force cannot hold "
                                f"their feed, {driven.seconds_lost(places):.2f} s lost; the lowest share "
                                f"{_percent(driven.ratio[target])} of {_feed(driven, target)}: {_reason(driven, target)[0]}")]


def _percent(ratio: float) -> str:
    return f"{100 * ratio:.0f} %" if ratio >= 0.1 else f"{100 * ratio:.2g} %"


def _feed(driven: Feasibility, target: int) -> str:
    return f"{1e3 * driven.drive.route.feed[driven.point[target]]:g} mm/s"


def _places(driven: Feasibility, when: str) -> list[Finding]:
    """What lies between the targets: the wrist singularity, joint limits, moves that cannot be followed."""
    findings = []
    path, robot, route = driven.path, driven.path.cell.robot, driven.drive.route
    # The targets with force themselves are judged by the correction (CS4105, CS4106, CS4110): of moves between them only what
    # comes nearer than both.
    own = np.where(driven.forced, wrist_distance(robot, driven.poses.theta), np.inf)
    near = np.flatnonzero(driven.wrist < np.minimum(NEARLY_SINGULAR, NEARER * np.minimum(own, own[route.legs.before])))
    if len(near):
        closest = int(near[np.argmin(driven.wrist[near])])
        cuts = driven.moves(near[driven.forced[near]])
        findings.append(path.finding(closest, "CS4406", "warning", f"{when}: {counted(driven.moves(near), 'move')} "
                           f"{f'({cuts} with force, between its targets) ' if cuts else 'without force '}"
                           f"within {np.degrees(NEARLY_SINGULAR):g} deg of the wrist singularity, the closest "
                           f"{np.degrees(driven.wrist[closest]):.2f} deg: axes 4 and 6 turn fast there"))
    left = np.flatnonzero(driven.outside)
    if len(left):
        findings.append(path.finding(int(left[0]), "CS4407", "warning", f"{when}: on the way to "
                           f"{counted(driven.moves(left), 'target')} a joint limit or the parallel rod's window is left",
                           "step through these moves at low speed"))
    lost = np.flatnonzero(route.lost)
    if len(lost):
        findings.append(path.finding(int(lost[0]), "CS4404", "warning",
                                     f"{when}: between {counted(driven.moves(lost), 'pair')} of targets the robot cannot "
                                     "follow the straight line or arc; these moves were not judged",
                                     "step through these moves, or add targets"))
    return findings


def _configurations(driven: Feasibility) -> list[Finding]:
    """Joint moves that change the configuration."""
    path, legs = driven.path, driven.drive.route.legs
    moved = np.flatnonzero(legs.joint & ~np.isin(path.toolpath.move, (1, 2, 3)))
    if not len(moved):
        return []
    ends = [configuration(path.cell.robot, path.theta[which])[:, 3] for which in (moved, legs.before[moved])]
    changed = moved[ends[0] != ends[1]]
    return [path.finding(int(changed[0]), "CS4408", "note", f"{counted(len(changed), 'joint move')} into another configuration "
                         "of arm or wrist")] if len(changed) else []


def _assumed(driven: Feasibility) -> list[Finding]:
    """What the verdict rests on."""
    path, legs, toolpath = driven.path, driven.drive.route.legs, driven.path.toolpath
    count = len(toolpath)
    cusps = int((legs.stop & legs.linear & (legs.corner >= SHARPEST) & (toolpath.zone > 0)).sum())
    text = (f"the limits are the speeds and accelerations of the robot file {path.cell.robot.name}; zones are driven as "
            f"parabolas; at rest behind {counted(int((legs.stop & legs.linear).sum()), 'linear move')}"
            + (f", {cusps} of them in a corner sharper than {np.degrees(SHARPEST):.0f} deg" if cusps else "")
            + f"; {counted(int(legs.joint.sum()), 'move')} by joint angles timed, not judged by feed")
    findings = [Finding("CS4403", "note", text, file=str(path.cell.robot.source))]
    if path.axes.unjudged:
        names = ", ".join(axis.name for axis in path.axes.unjudged)
        findings.append(Finding("CS4508", "note", f"the program moves {names}, whose speed and acceleration cell.yaml does not "
                                "state: whether they hold the feed is not judged",
                                file=str(path.cell.source), hint="state speed_mm_s and acceleration_mm_s2, of a rotary axis "
                                "speed_deg_s and acceleration_deg_s2"))
    unknown = np.flatnonzero(legs.unknown_zone)
    if len(unknown):
        findings.append(path.finding(int(unknown[0]), "CS4410", "note", f"the zone of {counted(len(unknown), 'target')} is not "
                           "known: taken as a stop"))
    no_feed = np.flatnonzero(legs.linear & ~(toolpath.feed > 0))
    if len(no_feed):
        findings.append(path.finding(int(no_feed[0]), "CS4405", "warning", f"the feed of {counted(len(no_feed), 'move')} is "
                                     "not known: not judged, timed as fast as the joints allow",
                                     "declare the speed in this file"))
    away = np.flatnonzero(np.isnan(driven.drive.duration) & ~driven.drive.route.lost & (np.arange(count) > 0))
    if len(away):
        findings.append(path.finding(int(away[0]), "CS4404", "warning", f"{counted(len(away), 'move')} from or to a target "
                                     "whose joint angles are not known: neither judged nor timed"))
    return findings

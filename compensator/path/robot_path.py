"""RobotPath: the toolpath as the robot drives it: poses in the base frame, and the joint angles it takes them with."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from compensator.path.arc_length import arc_length
from compensator.path.external_axes import ExternalAxes, external_axes, resting_object
from compensator.toolpath import Move, ToolFrame, Toolpath, WorkObject
from identification.common.arrays import read_only
from identification.common.findings import Finding, Level, counted
from identification.model.cell import Cell
from identification.model.inverse import Solutions, configuration, configured_solution, inverse, nearest_solution, one_branch
from identification.model.kinematics import chunks, forward
from identification.model.robot import RobotModel
from identification.model.rotations import Frame

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
# Two neighbouring targets of a linear move never turn a joint farther than this [rad]; a branch that would is left.
LARGEST_STEP = np.radians(90.0)
# A program names its configurations, unless more than this share of its targets is in another one.
MOST_DIFFER = 0.5
# A frame that is nearer to the origin of the world than this [m], and not in it: robots stand and parts lie farther off.
IN_METRES = 5e-3


@dataclass(frozen=True, eq=False)
class UsedFrames:
    """flange_from_tcp of each tool and world_from_object of each work object that linear moves of known pose use; where there
    are none, all moves. A work object that a mechanical unit moves as it stands at the resting values (external_axes.py)."""

    tools: tuple[Frame, ...]
    workobjects: tuple[Frame, ...]


@dataclass(frozen=True, eq=False)
class Limits:
    """speed [rad/s, m/s] and acceleration (6 + D,) of the joints, and of the external axes that the program drives."""

    speed: Array
    acceleration: Array


@dataclass(frozen=True, eq=False)
class RobotPath:
    """N targets as the robot drives them; NaN where a pose is not known or not reachable.

    theta (N, 6) [rad] controller angles; base_from_tcp, flange_from_tcp, base_from_object (N) frames, the
    base where it stands at that target; rest_from_tcp (N): the path in the resting frame of `axes`, the very same frames where
    no unit moves. known (N,): the pose is known; reached (N,): joint angles were found.
    """

    toolpath: Toolpath
    cell: Cell
    theta: Array
    base_from_tcp: Frame
    flange_from_tcp: Frame
    base_from_object: Frame
    axes: ExternalAxes
    rest_from_tcp: Frame
    known: NDArray[np.bool_]
    reached: NDArray[np.bool_]
    used_frames: UsedFrames
    findings: tuple[Finding, ...]

    @property
    def world_position(self) -> Array:
        """Where the TCP stands (N, 3) [m] in the world at the resting values of `axes`; NaN where the pose is not known."""
        return np.where(self.known[:, None], self.axes.world_from_base.apply(self.rest_from_tcp.position), np.nan)

    @cached_property
    def length(self) -> Array:
        """Path length (N,) [m] at each target (`arc_length`); NaN where the position is not known."""
        length = arc_length(self.world_position, self.toolpath.move)
        read_only(length)
        return length

    @property
    def base_from_flange(self) -> Frame:
        """Where the flange stands (N)."""
        return self.base_from_tcp @ self.flange_from_tcp.inverse()

    @property
    def to_flange(self) -> Array:
        """Way (N, 3) [m] from the TCP to the flange, base frame."""
        return self.base_from_tcp.turn(self.flange_from_tcp.inverse().position)

    @property
    def steps(self) -> Array:
        """Way (N, 3) [m] over the work object from the target before to each target, base frame; zero at the first."""
        position = self.rest_from_tcp.position
        return self.axes.turned_to_base(np.diff(position, axis=0, prepend=position[:1]))

    @cached_property
    def limits(self) -> Limits:
        """Of the six joints, then of `axes.driven`."""
        robot, driven = self.cell.robot, self.axes.driven
        return Limits(np.append(robot.speed, [axis.speed or np.inf for axis in driven]),
                      np.append(robot.acceleration, [axis.acceleration or np.inf for axis in driven]))

    @property
    def move_time(self) -> Array:
        """Time (N,) [s] from the target before to each target with the programmed feed; NaN where that is not known."""
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            steps = np.diff(self.length, prepend=self.length[:1])
            return np.asarray(np.where(steps == 0, 0.0, steps / self.toolpath.feed))

    def each_tool(self, targets: Indices) -> list[tuple[Frame, Indices]]:
        """The targets (M,) by tool: flange_from_tcp, and the places among the M that use it."""
        tools = self.toolpath.tool[targets]
        if len(tools) and (tools == tools[0]).all():        # mostly
            return [(self.flange_from_tcp[int(targets[0])], np.arange(len(tools)))]
        groups = [np.flatnonzero(tools == tool) for tool in np.unique(tools)]
        return [(self.flange_from_tcp[int(targets[places[0]])], places) for places in groups]

    def finding(self, target: int, code: str, level: Level, message: str, hint: str = "") -> Finding:
        """A finding at the place of a target in the text of the program as it was given."""
        toolpath = self.toolpath
        return Finding(code, level, message, file=toolpath.source, line=int(toolpath.line[target]),
                       column=int(toolpath.column[target]), target=int(toolpath.number[target]), hint=hint)


def robot_path(toolpath: Toolpath, cell: Cell) -> RobotPath:
    """Frames and joint angles of every target. Raises CompstiffError (CS1102) for an arm without closed-form inverse."""
    count = len(toolpath)
    robot = cell.robot
    flange_from_tcp = _pick([_tool(tool, cell) for tool in toolpath.tools], toolpath.tool, count)
    axes = external_axes(toolpath, cell)
    objects = [resting_object(toolpath, number, _world_from_object(item, cell), axes)
               for number, item in enumerate(toolpath.workobjects)]
    base_from_world = axes.world_from_base.inverse()
    base_from_object = axes.to_base(_pick([base_from_world @ frame for frame in objects], toolpath.workobject, count))
    absolute = toolpath.move == Move.ABSOLUTE
    posed = ~absolute & ~np.isnan(toolpath.position).any(axis=1) & ~np.isnan(toolpath.quaternion).any(axis=1)
    base_from_tcp = _base_from_tcp(toolpath, posed, base_from_object)
    by_joints = absolute & ~np.isnan(toolpath.joints).any(axis=1)
    theta = np.full((count, 6), np.nan)
    theta[by_joints] = toolpath.joints[by_joints]
    if by_joints.any():
        flange = forward(robot, theta[by_joints], Frame.identity())
        tcp = flange @ flange_from_tcp[by_joints]
        base_from_tcp.rotation[by_joints], base_from_tcp.position[by_joints] = tcp.rotation, tcp.position
    known = posed | by_joints
    findings: list[Finding] = []
    if posed.any():
        flanges = _Flanges(base_from_tcp, flange_from_tcp, np.flatnonzero(posed))
        findings = _follow(robot, toolpath, flanges, by_joints, theta)
    rest_from_tcp = axes.to_rest(base_from_tcp)
    findings += _in_metres(cell, toolpath, posed)
    linear = posed & (toolpath.move != Move.JOINT)
    tools, parts = (linear, linear) if linear.any() else (known, posed)
    used = UsedFrames(
        tuple(_tool(toolpath.tools[i], cell) for i in np.unique(toolpath.tool[tools])),
        tuple(objects[i] for i in np.unique(toolpath.workobject[parts])))
    reached = np.asarray(~np.isnan(theta[:, 0]))
    read_only(theta, base_from_tcp.rotation, base_from_tcp.position, known, reached)
    return RobotPath(toolpath, cell, theta, base_from_tcp, flange_from_tcp, base_from_object, axes,
                     rest_from_tcp, known, reached, used, tuple(findings))


def _in_metres(cell: Cell, toolpath: Toolpath, posed: NDArray[np.bool_]) -> list[Finding]:
    """Frames that lie next to the world's origin, and not in it (CS0118): base_frame, and the work objects of the posed
    targets, as the program declares them, or cell.yaml where it does not."""
    near: list[tuple[str, Array, str, int | None]] = [
        ("base_frame.position_mm", cell.world_from_base.position, str(cell.source), None)]
    used = [toolpath.workobjects[k] for k in np.unique(toolpath.workobject[posed])]
    near += [(f"the work object {item.name}", item.position, toolpath.source, item.line)
             for item in used if item.position is not None and not item.unit]
    if any(item.position is None for item in used):
        near.append(("workobject.position_mm", cell.world_from_object.position, str(cell.source), None))
    return [Finding("CS0118", "warning", f"{name} is {1e3 * size:.3g} mm from the world's origin: is it in metres?", file,
                    line, hint="every length is in millimetres, in cell.yaml as in RAPID")
            for name, position, file, line in near if 0 < (size := float(np.linalg.norm(position))) < IN_METRES]


def _tool(tool: ToolFrame, cell: Cell) -> Frame:
    if tool.position is None or tool.quaternion is None:
        return cell.flange_from_tcp
    return Frame.from_quaternion(tool.position, tool.quaternion)


def _world_from_object(item: WorkObject, cell: Cell) -> Frame:
    if item.position is None or item.quaternion is None:
        return cell.world_from_object
    return Frame.from_quaternion(item.position, item.quaternion)


def _pick(frames: list[Frame], index: Indices, count: int) -> Frame:
    """The frame of each target (N)."""
    if len(frames) < 2:         # mostly: then it is held once
        return Frame.shared(frames[0] if frames else Frame.identity(), count)
    return Frame(np.stack([frame.rotation for frame in frames])[index],
                 np.stack([frame.position for frame in frames])[index])


def _base_from_tcp(toolpath: Toolpath, posed: NDArray[np.bool_], base_from_object: Frame) -> Frame:
    """The pose of each target (N); those that are not posed stand in for one at their work object."""
    rotation, position = np.empty((len(toolpath), 3, 3)), np.empty((len(toolpath), 3))
    for part in chunks(len(toolpath)):
        known = posed[part, None]
        here = base_from_object[part] @ Frame.from_quaternion(
            np.where(known, toolpath.position[part], 0.0), np.where(known, toolpath.quaternion[part], [1.0, 0, 0, 0]))
        rotation[part], position[part] = here.rotation, here.position
    return Frame(rotation, position)


@dataclass(frozen=True, eq=False)
class _Flanges:
    """The flange poses of the posed targets, which are `where` (n,) of all; worked out for some at a time."""

    base_from_tcp: Frame
    flange_from_tcp: Frame
    where: Indices

    def at(self, places: Indices | slice) -> Frame:
        """base_from_flange at these places among the n."""
        targets = self.where[places]
        return self.base_from_tcp[targets] @ self.flange_from_tcp[targets].inverse()

    def branch(self, robot: RobotModel, number: int) -> tuple[Array, NDArray[np.bool_]]:
        """One branch (n, 6), and where it reaches (n,)."""
        theta, reachable = np.empty((len(self.where), 6)), np.empty(len(self.where), dtype=bool)
        for part in chunks(len(self.where)):
            theta[part], reachable[part] = one_branch(robot, self.at(part), number)
        return theta, reachable


def _follow(
    robot: RobotModel, toolpath: Toolpath, flanges: _Flanges, by_joints: NDArray[np.bool_], theta: Array
) -> list[Finding]:
    """Fills `theta` of the posed targets: the configuration a target names where the robot gets there by joint move, the
    continuous one along linear moves and arcs (the controller never changes configuration on those)."""
    where = flanges.where
    moves = toolpath.move[where]
    # The MoveAbsJ that stands before each posed target, behind the posed target before it: -1 where there is none.
    latest = np.maximum.accumulate(np.where(by_joints, np.arange(len(by_joints)), -1))[where]
    latest[latest < np.concatenate([[-1], where[:-1]])] = -1
    # Where a run of linear moves and arcs ends because the next target is reached by joint move or from known joint angles.
    ends = np.append(np.flatnonzero((moves == Move.JOINT) | (latest >= 0)), len(where))
    anchors = _Anchors(robot, flanges, toolpath.confdata[where], toolpath.has_confdata[where], np.union1d(0, ends[:-1]))
    branches: dict[int, tuple[Array, NDArray[np.bool_]]] = {}       # of all poses, each when it is first needed
    previous: Array | None = None
    findings: list[Finding] = []
    follows = np.ones(len(where), dtype=bool)
    start = 0
    while start < len(where):
        if latest[start] >= 0:
            previous = theta[latest[start]]
        anchor = _anchor(robot, *anchors.at(start), previous, int(moves[start]))
        if anchor is None:
            start += 1
            continue
        angles, branch, guessed = anchor
        if guessed:
            follows[start] = False
            target = int(where[start])
            why = (f"no reachable configuration has this target's confdata {toolpath.confdata[target].tolist()}"
                   if toolpath.has_confdata[target] else "the confdata of this target are not known")
            nearest = "the joints' zero" if previous is None else "the joints before it"
            findings.append(Finding(
                "CS4001", "warning", f"{why}: the configuration nearest to {nearest} was taken", file=toolpath.source,
                line=int(toolpath.line[target]), target=target,
                hint="another configuration yields differently under load: check it on the robot"))
        stop = int(ends[np.searchsorted(ends, start, side="right")])
        if branch not in branches:
            branches[branch] = flanges.branch(robot, branch)
        of_branch, reachable = branches[branch]
        run = of_branch[start:stop]
        run[0] = angles             # what stands before is not looked at again
        steps = _largest_steps(run)
        if not steps.max(initial=0.0) < np.pi:          # mostly no axis comes round
            run = np.unwrap(run, axis=0)
            steps = _largest_steps(run)
        good = reachable[start:stop] & robot.within_limits(run, 1e-9)
        good[1:] &= steps < LARGEST_STEP
        length = stop - start if good.all() else max(int(np.argmin(good)), 1)
        theta[where[start:start + length]] = run[:length]
        previous = run[length - 1]
        start += length
    turned = where[toolpath.has_confdata[where] & ~np.isnan(theta[where, 0]) & follows]
    differs = np.zeros(len(turned), dtype=bool)
    for part in chunks(len(turned)):
        few = turned[part]
        differs[part] = (configuration(robot, theta[few])[:, :3] != toolpath.confdata[few, :3]).any(axis=1)
    if differs.any():
        first = turned[np.argmax(differs)]
        stops = toolpath.monitored and toolpath.others.started and differs.mean() > MOST_DIFFER
        findings.append(Finding(
            "CS4002", "warning" if stops else "note", f"{counted(int(differs.sum()), 'target')} with another configuration "
            "(cf1 cf4 cf6) than the one linear moves arrive in; the continuous one was used", file=toolpath.source,
            line=int(toolpath.line[first]), target=int(first), hint="without ConfL\\Off the controller stops there: are work "
            "object, tool and robot those that the program was made for?" if stops else ""))
    return findings


def _largest_steps(run: Array) -> Array:
    """By how much (n - 1,) [rad] the joint that turns farthest turns from each of the angles (n, 6) to the next."""
    largest = np.zeros(max(len(run) - 1, 0))
    for angle in run.T:
        np.maximum(largest, np.abs(np.diff(angle)), out=largest)
    return largest


class _Anchors:
    """Where the branch is chosen: of those among the poses (N) that are known beforehand, `places` (K,) ascending, all branches
    are worked out together."""

    def __init__(
        self, robot: RobotModel, poses: _Flanges, confdata: NDArray[np.int32], given: NDArray[np.bool_], places: Indices
    ) -> None:
        self._robot, self._poses, self._confdata, self._given, self._places = robot, poses, confdata, given, places
        self._solved = self._solve(places)

    def at(self, index: int) -> tuple[Solutions, Array, bool]:
        """All branches of one pose, the angles (6,) its confdata name, and whether there are such."""
        row = int(np.searchsorted(self._places, index))
        solved = self._solved if row < len(self._places) and self._places[row] == index else None
        if solved is None:
            row, solved = 0, self._solve(np.array([index]))
        solutions, configured, fits = solved
        return Solutions(solutions.theta[row:row + 1], solutions.reachable[row:row + 1]), configured[row], bool(fits[row])

    def _solve(self, places: Indices) -> tuple[Solutions, Array, NDArray[np.bool_]]:
        solutions = inverse(self._robot, self._poses.at(places))
        configured, fits = configured_solution(self._robot, solutions, self._confdata[places])
        return solutions, configured, fits & self._given[places]


def _anchor(
    robot: RobotModel, branches: Solutions, configured: Array, fits: bool, previous: Array | None, move: int
) -> tuple[Array, int, bool] | None:
    """Angles (6,) and branch of one target, and whether they were guessed; None where no branch reaches it."""
    if not branches.reachable.any():
        return None
    linear = move != Move.JOINT and previous is not None
    if fits and not linear:
        branch = int(np.argmin(np.max(np.abs(_modulo(branches.theta[0] - configured)), axis=1)))
        return configured, branch, False
    reference = np.zeros(6) if previous is None else previous
    inside = Solutions(branches.theta, branches.reachable & (robot.limit_excess(branches.theta) <= 1e-9).all(axis=2))
    angles, nearest = nearest_solution(robot, inside if inside.reachable.any() else branches, reference[None])
    return angles[0], int(nearest[0]), not linear


def _modulo(angle: Array) -> Array:
    """Angles [rad] brought to -pi ... pi."""
    return np.asarray(angle - 2 * np.pi * np.round(angle / (2 * np.pi)))

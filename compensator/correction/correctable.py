"""Which targets with force can be corrected, and which stop the job."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from compensator.correction.driven_axes import said_of_axes, unknown_axes
from compensator.forces.target_forces import TargetForces
from compensator.path.robot_path import RobotPath
from compensator.toolpath import Toolpath
from identification.common.findings import CompstiffError, Finding, Refused, counted

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
# What is said of where a move with force stands.
OF_PLACES = ("CS4104", "CS4105")
# So many targets are told one by one.
MOST_TOLD = 20
BEYOND = 1e-7       # joint limits that are exceeded by more [rad] are exceeded


def targets_to_correct(path: RobotPath, forces: TargetForces) -> tuple[Indices, list[Finding]]:
    """The targets (M,) with force that can be corrected, and a finding for each that is left as it is.

    Raises CompstiffError (CS4103: unusable quaternion) and Refused (CS4104: a move with force depends on a tool, work object or
    mechanical unit that is not understood; CS4505: it is synchronised with other robots; CS4105: not reachable, outside the
    joint limits).
    """
    toolpath = path.toolpath
    forced = np.flatnonzero(forces.forced)
    stopped = toolpath.block[forced] != ""
    blocked, rest = forced[stopped].tolist(), forced[~stopped]
    unusable = [i for i in blocked if np.isfinite(toolpath.position[i]).all() and np.isnan(toolpath.quaternion[i]).any()]
    if unusable:
        raise CompstiffError(*(path.finding(i, "CS4103", "error", f"a move with force: {toolpath.block[i]}",
                                  "post the program again with a unit quaternion w x y z") for i in unusable[:MOST_TOLD]),
                             *and_more(path, unusable, "CS4103", "with force and an unusable quaternion"))
    findings = [path.finding(i, "CS4101", "warning",
                             f"a move with force stays uncorrected: {toolpath.block[i]}") for i in blocked]
    by_joints = np.isnan(toolpath.position[rest]).any(axis=1)
    joints, rest = rest[by_joints].tolist(), rest[~by_joints]
    findings += [path.finding(i, "CS4102", "warning", "a move with force to joint angles (MoveAbsJ) stays uncorrected",
                    "cut with MoveL, MoveC or MoveJ") for i in joints]
    problems = _not_understood(path, rest)
    if problems:
        raise Refused(*problems)
    lost = rest[~path.reached[rest]]
    if len(lost):
        first = path.finding(int(lost[0]), "CS4105", "error", "a move with force: the robot cannot reach this target",
                             f"check tool, work object and base frame{_not_declared(path, int(lost[0]))}")
        raise Refused(replace(first, count=len(lost)))
    refuse_outside(path, rest, path.theta[rest], "as planned")
    return rest, findings + said_of_axes(path, rest)


def and_more(path: RobotPath, targets: Sequence[int], code: str, what: str) -> list[Finding]:
    """An error at the first of the targets after MOST_TOLD, which says how many there are; none where all were told."""
    rest = targets[MOST_TOLD:]
    return [path.finding(int(rest[0]), code, "error", f"{counted(len(rest), 'more target')} {what}")] if len(rest) else []


def check_known(toolpath: Toolpath) -> None:
    """Raises CompstiffError (CS2011) for a program of which no target has a known place, since it does not declare them."""
    undeclared = [finding for finding in toolpath.findings if finding.code == "CS2011"]
    if undeclared and np.isnan(toolpath.position).any(axis=1).all():
        raise CompstiffError(replace(undeclared[0], level="error"))


def said_before_forces(path: RobotPath, targets: Indices) -> list[Finding]:
    """What of these targets, of known pose, `targets_to_correct` would refuse for their place if they had force: warnings."""
    found, reached = _nowhere_declared(path, targets), targets[path.reached[targets]]
    if not found:
        try:
            refuse_outside(path, reached, path.theta[reached], "as planned")
        except Refused as refused:
            found = list(refused.findings)
    return [replace(finding, level="warning", message=finding.message.replace("a move with force is", "a move is"))
            for finding in found]


def _not_understood(path: RobotPath, targets: Indices) -> list[Finding]:
    """CS4104, CS4505: targets with force whose tool, work object or mechanical unit is not understood."""
    toolpath = path.toolpath
    tool_unknown, object_unknown = (np.array([bool(frame.problem) for frame in frames], dtype=bool)
                                    for frames in (toolpath.tools, toolpath.workobjects))
    doubtful = tool_unknown[toolpath.tool[targets]] | object_unknown[toolpath.workobject[targets]]
    problems = _nowhere_declared(path, targets)
    if problems:
        return problems
    for i in targets[doubtful].tolist():
        tool, item = toolpath.tools[toolpath.tool[i]], toolpath.workobjects[toolpath.workobject[i]]
        for kind, frame in (("tool", tool), ("work object", item)):
            if frame.problem:
                problems.append(path.finding(
                    i, "CS4104", "error", f"a move with force depends on {kind} {frame.name}: {frame.problem}",
                    "declare it with its numbers in this module, or in cell.yaml"))
    return problems + unknown_axes(path, targets)


def _nowhere_declared(path: RobotPath, targets: Indices) -> list[Finding]:
    """CS4104: work objects that moves with force name and neither the program nor cell.yaml declares; one finding each."""
    toolpath = path.toolpath
    problems = []
    for number, item in enumerate(toolpath.workobjects):
        which = targets[toolpath.workobject[targets] == number]
        if len(which) and item.position is None and not item.problem and not item.unit and not path.cell.object_stated:
            finding = path.finding(
                int(which[0]), "CS4104", "error", f"a move with force is in work object {item.name}, which neither this "
                "program nor cell.yaml declares", "declare it with its numbers in this module, or state workobject in "
                "cell.yaml; where it is the world, say so: workobject: {position_mm: [0, 0, 0]}")
            problems.append(replace(finding, count=len(which)))
    return problems


def refuse_outside(path: RobotPath, targets: Indices, theta: Array, when: str) -> None:
    """Refused (CS4105) where joint angles are outside the robot's limits: a finding a joint, at the target farthest out."""
    robot = path.cell.robot
    if robot.within_limits(theta, BEYOND).all():
        return
    excess = robot.limit_excess(theta)
    over = excess > BEYOND
    findings = []
    for joint in np.flatnonzero(over.any(axis=0)):
        row = int(np.argmax(excess[:, joint]))
        if joint < 6:
            low, high = np.degrees(robot.limits[joint])
            what = f"joint {joint + 1} at {np.degrees(theta[row, joint]):.4f} deg, limits {low:g} to {high:g} deg"
        else:
            assert robot.window is not None
            index, first, last = robot.window
            what = (f"the parallel rod's angle at {np.degrees(theta[row] @ robot.coupling[index]):.4f} deg, window "
                    f"{np.degrees(first):g} to {np.degrees(last):g} deg")
        finding = path.finding(int(targets[row]), "CS4105", "error", f"{when}: {what}", "check the configuration (confdata), "
                               f"tool and work object, or move the part{_not_declared(path, int(targets[row]))}")
        findings.append(replace(finding, count=int(over[:, joint].sum())))
    if findings:
        raise Refused(*findings)


def _not_declared(path: RobotPath, target: int) -> str:
    """What to add to a hint where tool or work object of a target are cell.yaml's, as the program does not declare them."""
    toolpath = path.toolpath
    named = (("tool", toolpath.tools[toolpath.tool[target]]),
             ("work object", toolpath.workobjects[toolpath.workobject[target]]))
    absent = " and ".join(f"{kind} {frame.name}" for kind, frame in named if frame.position is None)
    return f"; the program does not declare {absent} with numbers, so that of cell.yaml was taken" if absent else ""

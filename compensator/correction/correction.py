"""Predicted deviation with its covariance, and the commanded pose whose loaded pose is the planned one (physics 6).

Springs at the joints make the correction exact without iteration. The robot commanded to `theta_cmd` comes to rest at
`theta~_cmd + L dq` with `dq = c * tau`, tau taken at the loaded pose; the loaded pose shall be the planned one, so tau
is known beforehand: `dq = c * L^T J~(theta~_plan)^T w` and `theta~_cmd = theta~_plan - L dq`. Effects in force displace the
tool from where the springs hold it: then the springs shall hold it at angles from which the effects bring it to the plan
(`loading.resting_angles`), and these take the place of theta~_plan. That the tool lands there is not
taken on trust: `correct_path` loads the commanded pose with the iterated forward model and reports what is left.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from compensator.correction.forward import each_tool, loaded_path, resting_angles
from compensator.correction.prediction import Prediction
from compensator.correction.restraint import chance_of_harm, confident_share, limited_steps
from compensator.forces.placement import TargetForces
from compensator.path.arc_length import arc_length
from compensator.path.robot_path import RobotPath
from identification.common.findings import CompstiffError, Finding, Refused, counted
from identification.model.compliance import displacement, joint_torque, loaded_angles
from identification.model.inverse import NEARLY_SINGULAR, configuration, nearest_angles, wrist_distance
from identification.model.kinematics import forward
from identification.model.rotations import Frame, rotation_matrix, rotation_vector
from identification.model.stiffness import IdentifiedModel

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

# A converged correction leaves less than this between the loaded tool and the plan [m], [rad].
RESIDUAL_LIMIT = 1e-8
# Axis 5 closer than this to the wrist singularity [rad]: micrometres of correction become degrees of axes 4 and 6.
SINGULAR = np.radians(0.1)
# A correction that differs by less from the full one is the full one [m]: a tenth of what is written.
HELD = 1e-8


@dataclass(frozen=True, eq=False)
class Correction:
    """Commanded poses of the `targets` (M,) in their work objects.

    object_from_tcp (M): position [m], rotation. offset (M, 3) [m] and turn (M, 3) [rad]: commanded minus planned, work
    object. theta (M, 6) [rad] commanded joint angles. confdata (M, 4): the target's, changed where a quadrant changes.
    residual (M,) [m]: distance of the loaded tool from the plan, by the iterated forward model. share (M,): how much of the
    full correction is made, below 1 where it is held back. harm (M,): probability that the point is farther from the plan
    than without correction; NaN where no restraint was asked for.
    """

    targets: Indices
    object_from_tcp: Frame
    offset: Array
    turn: Array
    theta: Array
    confdata: NDArray[np.int64]
    residual: Array
    share: Array
    harm: Array
    findings: tuple[Finding, ...]


@dataclass(frozen=True, eq=False)
class Restraint:
    """What a correction must satisfy beyond landing on the plan (restraint.py): the prediction it rests on, the probability
    with which it must make a point better, and the steepest change of the offset along the path [m/m]."""

    prediction: Prediction
    confidence: float
    slope: float


def targets_to_correct(path: RobotPath, forces: TargetForces) -> tuple[Indices, list[Finding]]:
    """The targets (M,) with force that can be corrected, and a finding for each that is left as it is.

    Raises CompstiffError (CS4103: unusable quaternion) and Refused (CS4104: a move with force depends on a tool, work
    object or external axis that is not understood; CS4105: not reachable, outside the joint limits).
    """
    toolpath = path.toolpath
    forced = np.flatnonzero(forces.forced)
    stopped = toolpath.block[forced] != ""
    blocked, rest = forced[stopped].tolist(), forced[~stopped]
    unusable = [i for i in blocked if np.isfinite(toolpath.position[i]).all() and np.isnan(toolpath.quaternion[i]).any()]
    if unusable:
        raise CompstiffError(*(path.finding(i, "CS4103", "error", f"a move with force: {toolpath.block[i]}",
                                  "post the program again with a unit quaternion w x y z") for i in unusable[:20]))
    findings = [path.finding(i, "CS4101", "warning",
                             f"a move with force stays uncorrected: {toolpath.block[i]}") for i in blocked]
    by_joints = np.isnan(toolpath.position[rest]).any(axis=1)
    joints, rest = rest[by_joints].tolist(), rest[~by_joints]
    findings += [path.finding(i, "CS4102", "warning", "a move with force to joint angles (MoveAbsJ) stays uncorrected",
                    "cut with MoveL, MoveC or MoveJ") for i in joints]
    problems = []
    unknown = [np.array([bool(frame.problem) for frame in frames], dtype=bool) for frames in (toolpath.tools,
                                                                                              toolpath.workobjects)]
    doubtful = (unknown[0][toolpath.tool[rest]] | unknown[1][toolpath.workobject[rest]]
                | ~np.isnan(toolpath.external[rest]).all(axis=1))
    for i in rest[doubtful]:
        tool, item = toolpath.tools[toolpath.tool[i]], toolpath.workobjects[toolpath.workobject[i]]
        for kind, name, problem in (("tool", tool.name, tool.problem), ("work object", item.name, item.problem)):
            if problem:
                problems.append(path.finding(int(i), "CS4104", "error", f"a move with force depends on {kind} {name}: "
                                             f"{problem}",
                                   "declare it with its numbers in this module, or in cell.yaml"))
        used = [f"eax_{letter}" for letter, value in zip("abcdef", toolpath.external[i], strict=True) if not np.isnan(value)]
        if used:
            problems.append(path.finding(int(i), "CS4104", "error", "a move with force uses the external axis "
                                         f"{', '.join(used)}, "
                               "which is not understood: it moves the robot's base or the part",
                               "write 9E9 where no external axis is driven; tracks and positioners are not supported"))
    if problems:
        raise Refused(*problems)
    lost = rest[~path.reached[rest]]
    if len(lost):
        raise Refused(*(path.finding(int(i), "CS4105", "error", "a move with force: the robot cannot reach this target",
                           "check tool, work object and base frame") for i in lost[:20]))
    _refuse_outside(path, rest, path.theta[rest], "as planned")
    return rest, findings


def _refuse_outside(path: RobotPath, targets: Indices, theta: Array, when: str) -> None:
    """Refused (CS4105) where joint angles are outside the robot's limits."""
    robot = path.cell.robot
    excess = robot.limit_excess(theta)
    worst = np.argwhere(excess > 1e-7)
    if not len(worst):
        return
    findings = []
    for row, joint in worst[:20]:
        if joint < 6:
            low, high = np.degrees(robot.limits[joint])
            what = f"joint {joint + 1} at {np.degrees(theta[row, joint]):.4f} deg, limits {low:g} to {high:g} deg"
        else:
            assert robot.window is not None
            index, first, last = robot.window
            what = (f"the parallel rod's angle at {np.degrees(theta[row] @ robot.coupling[index]):.4f} deg, window "
                    f"{np.degrees(first):g} to {np.degrees(last):g} deg")
        findings.append(path.finding(int(targets[row]), "CS4105", "error", f"{when}: {what}",
                           "check the configuration (confdata), tool and work object, or move the part"))
    raise Refused(*findings)


def correct_path(
    path: RobotPath, forces: TargetForces, model: IdentifiedModel, targets: Indices, restraint: Restraint | None = None
) -> Correction:
    """The commanded poses: those whose loaded pose is the plan, held back where the restraint asks for it.

    Raises Refused: CS4105 outside the joint limits, CS4106 singular, CS4107 offset or tilt over the cell's limits;
    CompstiffError: CS4108 the forward model does not confirm the full correction.
    """
    robot, cell, toolpath = model.robot, path.cell, path.toolpath
    count = len(targets)
    planned = path.theta[targets]
    theta = np.empty((count, 6))
    tcp = Frame(np.empty((count, 3, 3)), np.empty((count, 3)))
    goal = Frame(path.base_from_tcp.rotation[targets], path.base_from_tcp.position[targets])
    rest = resting_angles(path, forces, model, targets) if model.effects else planned
    for tool, places in each_tool(path, targets):
        yielded = model.compliance * joint_torque(robot, rest[places], tool, forces.wrench[targets[places]])
        theta[places] = loaded_angles(robot, rest[places], -yielded)
        commanded = forward(robot, theta[places], tool)
        tcp.rotation[places], tcp.position[places] = commanded.rotation, commanded.position
    off, turned = displacement(loaded_path(path, forces, model, targets, theta), goal)
    residual, twist = np.linalg.norm(off, axis=1), np.linalg.norm(turned, axis=1)
    if count and not max(residual.max(), twist.max()) <= RESIDUAL_LIMIT:
        worst = int(np.argmax(residual))
        raise CompstiffError(path.finding(int(targets[worst]), "CS4108", "error", "the correction did not converge: the loaded "
                                f"tool stays {1e6 * residual.max():.3g} um and {twist.max():.3g} rad off the plan",
                                "check the units of the forces"))
    findings: list[Finding] = []
    share, harm = np.ones(count), np.full(count, np.nan)
    if restraint is not None and count:
        full = tcp.position - goal.position
        offset, findings = _restrained(path, forces, targets, full, restraint)
        harm = chance_of_harm(restraint.prediction.position, restraint.prediction.covariance, offset)
        held = np.flatnonzero(np.linalg.norm(offset - full, axis=1) > HELD)
        if len(held):
            share[held] = np.linalg.norm(offset[held], axis=1) / np.maximum(np.linalg.norm(full[held], axis=1), HELD)
            turn = rotation_vector(tcp.rotation[held] @ np.swapaxes(goal.rotation[held], 1, 2))
            tcp.rotation[held] = rotation_matrix(np.minimum(share[held], 1.0)[:, None] * turn) @ goal.rotation[held]
            tcp.position[held] = goal.position[held] + offset[held]
            tool = Frame(path.flange_from_tcp.rotation[targets[held]], path.flange_from_tcp.position[targets[held]])
            flange = Frame(tcp.rotation[held], tcp.position[held]) @ tool.inverse()
            theta[held] = nearest_angles(robot, flange, theta[held])
            loaded = loaded_path(path, forces, model, targets, theta)
            residual = np.linalg.norm(loaded.position - goal.position, axis=1)
    object_from_base = Frame(path.base_from_object.rotation[targets], path.base_from_object.position[targets]).inverse()
    commanded, wanted = object_from_base @ tcp, object_from_base @ goal
    offset = commanded.position - wanted.position
    turn = rotation_vector(commanded.rotation @ np.swapaxes(wanted.rotation, 1, 2))
    _refuse_outside(path, targets, theta, "after correction")
    findings += [*_singularity(path, targets, planned, theta), *_check_size(path, targets, offset, turn, cell.max_offset,
                                                                            cell.max_tilt)]
    step = configuration(robot, theta)[:, :3] - configuration(robot, planned)[:, :3]
    confdata = toolpath.confdata[targets].copy()
    confdata[:, :3] += step
    return Correction(targets, commanded, offset, turn, theta, confdata, residual, share, harm, tuple(findings))


def _restrained(
    path: RobotPath, forces: TargetForces, targets: Indices, full: Array, restraint: Restraint
) -> tuple[Array, list[Finding]]:
    """The offsets (M, 3) [m] to make, base frame, out of the full ones, and what was held back (CS4112, CS4113)."""
    predicted = restraint.prediction
    share = confident_share(predicted.position, predicted.covariance, restraint.confidence)
    sure = share[:, None] * full
    findings = []
    unsure = np.flatnonzero((share < 1) & (np.linalg.norm(full - sure, axis=1) > HELD))
    if len(unsure):
        left = np.linalg.norm((full - sure)[unsure], axis=1)
        findings.append(path.finding(int(targets[unsure[np.argmax(left)]]), "CS4112", "note",
                           f"small against their own uncertainty: {counted(len(unsure), 'correction')}; "
                           f"{int((share[unsure] == 0).sum())} are left out, the others reduced; up to "
                           f"{1e6 * left.max():.1f} um of expected deviation stay",
                           f"each correction makes its point better with a probability of at least {restraint.confidence:g} "
                           "(--confidence)"))
    if not np.isfinite(restraint.slope):
        return sure, findings
    length = arc_length(path.world_position, path.toolpath.move)
    air = (forces.samples > 0) & ~forces.forced
    row = np.full(len(length), -1)
    row[targets] = np.arange(len(targets))
    where = np.flatnonzero(~np.isnan(length) & (air | (row >= 0)))
    offsets = np.zeros((len(where), 3))
    corrected = row[where] >= 0
    offsets[corrected] = sure[row[where[corrected]]]
    limited = limited_steps(offsets, length[where], air[where] & ~corrected, restraint.slope)
    result = sure.copy()
    result[row[where[corrected]]] = limited[corrected]
    changed = np.linalg.norm(result - sure, axis=1)
    steep = np.flatnonzero(changed > HELD)
    if len(steep):
        findings.append(path.finding(int(targets[steep[np.argmax(changed[steep])]]), "CS4113", "warning",
                           f"the correction would change by more than {1e3 * restraint.slope:g} um a millimetre: it is "
                           f"reduced at {len(steep)} targets, by up to {1e6 * changed.max():.1f} um",
                           "a step of the force between neighbours: is the log placed right? --max-slope sets the limit"))
    return result, findings


def _check_size(path: RobotPath, targets: Indices, offset: Array, turn: Array, max_offset: float,
                max_tilt: float) -> list[Finding]:
    """Refused (CS4107) where a correction exceeds the limits of cell.yaml."""
    size, tilt = np.linalg.norm(offset, axis=1), np.linalg.norm(turn, axis=1)
    hint = "check force units, sign (force_log.sign) and stiffnesses; limits.max_offset_mm and max_tilt_deg are in cell.yaml"
    findings = []
    for values, limit, factor, unit, what in ((size, max_offset, 1e3, "mm", "offset"),
                                              (tilt, max_tilt, np.degrees(1.0), "deg", "rotation")):
        over = np.flatnonzero(values > limit)
        if len(over):
            worst = int(over[np.argmax(values[over])])
            findings.append(path.finding(int(targets[worst]), "CS4107", "error", f"{len(over)} corrections exceed the limit: "
                                         "the "
                               f"largest {what} is {factor * values[worst]:.3f} {unit}, the limit {factor * limit:g} {unit}",
                               hint))
    if findings:
        raise Refused(*findings)
    return []


def _singularity(path: RobotPath, targets: Indices, planned: Array, theta: Array) -> list[Finding]:
    """Refused (CS4106) at the wrist singularity or where a correction would cross it; a warning (CS4110) near it."""
    robot = path.cell.robot
    distance = wrist_distance(robot, theta)
    crossed = np.sign(np.sin(robot.serial_angles(theta)[:, 4])) != np.sign(np.sin(robot.serial_angles(planned)[:, 4]))
    bad = np.flatnonzero((distance < SINGULAR) | crossed)
    if len(bad):
        raise Refused(*(path.finding(int(targets[i]), "CS4106", "error", f"axis 5 is {np.degrees(distance[i]):.3f} deg from "
                                     "the "
                           f"wrist singularity after correction, at least {np.degrees(SINGULAR):g} deg are needed",
                           "turn the part or the tool so that axis 5 stays away from zero") for i in bad[:20]))
    near = np.flatnonzero(distance < NEARLY_SINGULAR)
    if not len(near):
        return []
    closest = int(near[np.argmin(distance[near])])
    return [path.finding(int(targets[closest]), "CS4110", "warning", f"{len(near)} targets with force are within "
               f"{np.degrees(NEARLY_SINGULAR):g} deg of the wrist singularity, the closest {np.degrees(distance[closest]):.2f}"
               " deg: axes 4 and 6 turn fast there")]

"""The commanded pose whose loaded pose is the planned one.

Springs at the joints make the correction exact without iteration. The robot commanded to `theta_cmd` comes to rest at
`theta~_cmd + L dq` with `dq = c * tau`, tau taken at the loaded pose; the loaded pose shall be the planned one, so tau
is known beforehand: `dq = c * L^T J~(theta~_plan)^T w` and `theta~_cmd = theta~_plan - L dq`. Effects in force displace the
tool from where the springs hold it: then the springs shall hold it at angles from which the effects bring it to the plan
(`forward.resting_angles`), and these take the place of theta~_plan. That the tool lands there is not
taken on trust: `correct_path` loads the commanded pose with the iterated forward model and reports what is left.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from compensator.correction.before_touch import held_beside_air
from compensator.correction.corners import sharp_corners
from compensator.correction.correctable import MOST_TOLD, and_more, refuse_outside
from compensator.correction.forward import loaded_blocks, off_goal, resting_angles
from compensator.correction.loaded_path import LoadedPath
from compensator.correction.prediction import Prediction
from compensator.correction.restraint import confident_share, fair_to_both, limited_steps
from compensator.correction.wall_behind import held_before_the_wall
from compensator.path.legs import Poses
from compensator.path.robot_path import RobotPath
from identification.common.arrays import read_only
from identification.common.findings import CompstiffError, Finding, Refused, counted, verb
from identification.common.quantities import cause_words
from identification.model.compliance import CHUNK, displacement, joint_torque, loaded_angles
from identification.model.inverse import NEARLY_SINGULAR, configuration, nearest_angles, wrist_distance
from identification.model.kinematics import chunks, forward
from identification.model.rotations import Frame, rotation_matrix, rotation_vector

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

    position (M, 3) [m], quaternion (M, 4) w x y z. offset (M, 3) [m] and turn (M, 3) [rad]: commanded minus planned, work
    object. theta (M, 6) [rad] commanded joint angles. confdata (M, 4): the target's, changed where a quadrant changes.
    residual (M,) [m]: distance of the loaded tool from the plan, by the iterated forward model. share (M,): how much of the
    full correction is made, below 1 where it is held back.
    """

    targets: Indices
    position: Array
    quaternion: Array
    offset: Array
    turn: Array
    theta: Array
    confdata: NDArray[np.int32]
    residual: Array
    share: Array
    findings: tuple[Finding, ...]


@dataclass(frozen=True, eq=False)
class Restraint:
    """What a correction must satisfy beyond landing on the plan (restraint.py): the prediction it rests on, where the tool
    stood off the plan (M, 3) [m], base frame, while the log was taken, the probability with which it must make a point better,
    and the steepest change of the offset along the path [m/m]. tolerance [m]: what is left at a corner is told from there on.
    depth (M,) [m]: how deep across the feed the cut is at least, NaN where nothing tells. air (M,): which share of the
    line from a target in the air is air (before_touch.py)."""

    prediction: Prediction
    stood: Array
    confidence: float
    slope: float
    tolerance: float
    depth: Array
    air: Array


def correct_path(loaded: LoadedPath, restraint: Restraint | None = None) -> Correction:
    """The commanded poses: those whose loaded pose is the plan, held back where the restraint asks for it.

    Raises Refused: CS4105 outside the joint limits, CS4106 singular, CS4107 offset or tilt over the cell's limits;
    CompstiffError: CS4108 the forward model does not confirm the full correction.
    """
    path, targets = loaded.path, loaded.targets
    commanded, residual = _full(loaded)
    share = np.broadcast_to(1.0, len(targets))
    findings: list[Finding] = []
    if restraint is not None and len(targets):
        full = commanded.base_from_tcp.position - path.base_from_tcp.position[targets]
        offset, findings = _restrained(loaded, full, restraint)
        held = np.flatnonzero(np.linalg.norm(offset - full, axis=1) > HELD)
        if len(held):
            share = share.copy()
            share[held] = np.linalg.norm(offset[held], axis=1) / np.maximum(np.linalg.norm(full[held], axis=1), HELD)
            _hold_back(loaded, commanded, held, share[held], offset[held])
            residual = _residual(loaded, commanded.theta, held, residual)
    theta = commanded.theta
    position, quaternion, offset, turn = _in_objects(loaded, commanded.base_from_tcp)
    del commanded
    refuse_outside(path, targets, theta, "after correction")
    findings += _singularity(path, targets, theta)
    _check_size(path, targets, offset, turn)
    confdata = path.toolpath.confdata if len(targets) == len(path.toolpath) else path.toolpath.confdata[targets]
    for part in chunks(len(targets), CHUNK):
        now, then = (configuration(loaded.model.robot, angles) for angles in (theta[part], path.theta[targets[part]]))
        if (now != then)[:, :3].any():
            confdata = confdata if confdata is not path.toolpath.confdata else confdata.copy()
            confdata[part, :3] += (now - then)[:, :3]
    read_only(position, quaternion, offset, turn, theta, confdata, residual, share)
    return Correction(targets, position, quaternion, offset, turn, theta, confdata, residual, share, tuple(findings))


def _residual(loaded: LoadedPath, theta: Array, held: Indices, residual: Array) -> Array:
    """Distance (M,) [m] of the loaded tool from the plan at commanded angles theta (M, 6) [rad], of which those at the places
    `held` (H,) are others than `residual` (M,) [m] is of. Effects remember: a change is felt at the targets behind it too."""
    if not loaded.model.of_springs_alone:
        return off_goal(loaded, theta)
    residual = residual.copy()
    residual[held] = off_goal(replace(loaded, targets=loaded.targets[held]), theta[held])
    return residual


def _in_objects(loaded: LoadedPath, base_from_tcp: Frame) -> tuple[Array, Array, Array, Array]:
    """Position (M, 3) [m], quaternion (M, 4), offset (M, 3) [m] and turn (M, 3) [rad] in their work objects of commanded poses
    (M)."""
    path, targets = loaded.path, loaded.targets
    position, quaternion, offset, turn = (np.empty((len(targets), width)) for width in (3, 4, 3, 3))
    for part in chunks(len(targets), CHUNK):
        object_from_base = path.base_from_object[targets[part]].inverse()
        here, wanted = object_from_base @ base_from_tcp[part], object_from_base @ path.base_from_tcp[targets[part]]
        position[part], quaternion[part] = here.position, here.quaternion
        offset[part] = here.position - wanted.position
        turn[part] = rotation_vector(here.rotation @ np.swapaxes(wanted.rotation, 1, 2))
    return position, quaternion, offset, turn


def _full(loaded: LoadedPath) -> tuple[Poses, Array]:
    """The commanded poses whose loaded pose is the plan, and the distance (M,) [m] that the forward model finds between them.

    Raises CompstiffError (CS4108) where that is more than RESIDUAL_LIMIT.
    """
    model, targets, wrench = loaded.model, loaded.targets, loaded.wrench
    rest = loaded.theta if model.of_springs_alone else resting_angles(loaded)
    theta, rotation, position = np.empty((len(targets), 6)), np.empty((len(targets), 3, 3)), np.empty((len(targets), 3))
    for tool, places in loaded.each_tool():
        for part in chunks(len(places), CHUNK):
            few = places[part]
            yielded = model.compliance * joint_torque(model.robot, rest[few], tool, wrench[few])
            theta[few] = loaded_angles(model.robot, rest[few], -yielded)
            commanded = forward(model.robot, theta[few], tool)
            rotation[few], position[few] = commanded.rotation, commanded.position
    residual, twist = np.empty(len(targets)), 0.0
    for block in loaded_blocks(loaded, theta):
        off, turned = displacement(block.tool, loaded.goal_of(block.places))
        residual[block.places] = np.linalg.norm(off, axis=1)
        twist = float(np.maximum(twist, np.linalg.norm(turned, axis=1).max(initial=0.0)))     # NaN stays
    if len(targets) and not max(residual.max(), twist) <= RESIDUAL_LIMIT:
        worst = int(targets[np.argmax(residual)])
        of = ", ".join(cause_words(effect.label) for effect in model.effects)
        raise CompstiffError(loaded.path.finding(
            worst, "CS4108", "error", f"the correction did not converge: the loaded tool stays {1e6 * residual.max():.3g} um "
            f"and {twist:.3g} rad off the plan", "check the units of the forces" + (
                f"; or what the stiffness file has beyond springs is too steep for a correction: {of}" if of else "")))
    return Poses(Frame(rotation, position), theta), residual


def _hold_back(loaded: LoadedPath, commanded: Poses, held: Indices, share: Array, offset: Array) -> None:
    """Leaves the full commanded poses only this share (H,) of the turn and this offset (H, 3) [m], base frame, at the places
    `held` (H,) among the targets."""
    plan, tcp, theta = loaded.path.base_from_tcp[loaded.targets[held]], commanded.base_from_tcp, commanded.theta
    turn = rotation_vector(tcp.rotation[held] @ np.swapaxes(plan.rotation, 1, 2))
    reduced = Frame(rotation_matrix(np.minimum(share, 1.0)[:, None] * turn) @ plan.rotation, plan.position + offset)
    tcp.rotation[held], tcp.position[held] = reduced.rotation, reduced.position
    flange = reduced @ loaded.path.flange_from_tcp[loaded.targets[held]].inverse()
    theta[held] = nearest_angles(loaded.model.robot, flange, theta[held])


def _restrained(loaded: LoadedPath, full: Array, restraint: Restraint) -> tuple[Array, list[Finding]]:
    """The offsets (M, 3) [m] to make, base frame, out of the full ones, and what was held back (CS4112, CS4113, CS4114)."""
    path, targets, prediction = loaded.path, loaded.targets, restraint.prediction
    share = confident_share(prediction.position, prediction.known, restraint.confidence)
    sure = share[:, None] * full
    findings = []
    unsure = np.flatnonzero((share < 1) & (np.linalg.norm(full - sure, axis=1) > HELD))
    if len(unsure):
        left, reduced = np.linalg.norm((full - sure)[unsure], axis=1), int((share[unsure] > 0).sum())
        findings.append(path.finding(int(targets[unsure[np.argmax(left)]]), "CS4112", "note",
                           f"small against their own uncertainty: {counted(len(unsure), 'correction')}; "
                           f"{len(unsure) - reduced} left out, {reduced} reduced; up to "
                           f"{1e6 * left.max():.1f} um of expected deviation stay",
                           f"each correction makes its point better with a probability of at least {restraint.confidence:g} "
                           "(--confidence)"))
    sure, at_corners = _at_corners(loaded, sure, restraint)
    sure, at_walls = _before_walls(loaded, sure, restraint)
    sure, at_touches = _beside_air(loaded, sure, restraint)
    findings += [*at_corners, *at_walls, *at_touches]
    if not np.isfinite(restraint.slope):
        return sure, findings
    axes = path.axes
    result = axes.turned_to_base(_limited(loaded, axes.turned_to_rest(sure, targets), restraint.slope), targets)
    changed = np.linalg.norm(result - sure, axis=1)
    steep = np.flatnonzero(changed > HELD)
    if len(steep):
        findings.append(path.finding(int(targets[steep[np.argmax(changed[steep])]]), "CS4113", "warning",
                           f"the correction would change by more than {1e3 * restraint.slope:g} um a millimetre: it is "
                           f"reduced at {counted(len(steep), 'target')}, by up to {1e6 * changed.max():.1f} um",
                           "a step of the force between neighbours: is the log placed right? --max-slope sets the limit"))
    return result, findings


def _at_corners(loaded: LoadedPath, offset: Array, restraint: Restraint) -> tuple[Array, list[Finding]]:
    """The offsets (M, 3) [m], base frame, fair to both sides of sharp corners, and what one target leaves there (CS4114)."""
    path, targets = loaded.path, loaded.targets
    corners = sharp_corners(path, targets)
    if not len(corners):
        return offset, []
    axes = path.axes
    before, here, behind = (axes.turned_to_rest(offset[at], targets[at]) for at in (corners - 1, corners, corners + 1))
    known = restraint.prediction.known
    sides = [(asked, np.sqrt(np.trace(known[at], axis1=1, axis2=2)))
             for asked, at in ((before, corners - 1), (behind, corners + 1))]
    fair = fair_to_both(here, sides)
    result = offset.copy()
    result[corners] = axes.turned_to_base(fair, targets[corners])
    left = np.linalg.norm(np.stack([before, behind]) - fair, axis=2).max(axis=0)
    told = left > restraint.tolerance
    if not told.any():
        return result, []
    worst = int(np.argmax(left))
    asked, other, apart = (1e6 * np.linalg.norm(each[worst]) for each in (before, behind, behind - before))
    return result, [path.finding(
        int(targets[corners[worst]]), "CS4114", "warning",
        f"one target serves two forces at {counted(int(told.sum()), 'corner')}: before this one {asked:.0f} um are asked for, "
        f"behind it {other:.0f} um, {apart:.0f} um apart; up to {1e6 * left[worst]:.0f} um are left there",
        "no offset serves both, nor do two targets or a stop: round the corner in the toolpath, rough it closer, or correct "
        "again by the log of the corrected pass (--logged-with)")]


def _before_walls(loaded: LoadedPath, offset: Array, restraint: Restraint) -> tuple[Array, list[Finding]]:
    """The offsets (M, 3) [m], base frame, held before the walls behind sharp corners, and what stays as stock (CS4116)."""
    path, targets, axes = loaded.path, loaded.targets, loaded.path.axes
    known = np.sqrt(np.maximum(np.trace(restraint.prediction.known, axis1=1, axis2=2), 0.0))
    asked, stood, force = (axes.turned_to_rest(vectors, targets) for vectors in (offset, restraint.stood, loaded.wrench[:, :3]))
    made = held_before_the_wall(path, targets, asked, known, stood, force, restraint.depth)
    result = axes.turned_to_base(made, targets)
    held = np.linalg.norm(result - offset, axis=1)
    told = int((held > restraint.tolerance).sum())
    if not told:
        return result, []
    worst = int(np.argmax(held))
    return result, [path.finding(
        int(targets[worst]), "CS4116", "warning",
        f"at sharp corners the tool of the log turned early, so that the force where the corrected one turns is not known: "
        f"towards the wall behind {counted(told, 'correction', 'are')} held back, by up to {1e6 * held[worst]:.0f} um, which "
        f"may be left there as stock",
        "correct again by the log of the corrected pass (--logged-with), or round the corner in the toolpath; where the cut is "
        "deeper than the tool stood aside it was in that stock: state --depth-of-cut, or what tells it (cutting in cell.yaml, "
        "--first-forces)")]


def _beside_air(loaded: LoadedPath, offset: Array, restraint: Restraint) -> tuple[Array, list[Finding]]:
    """The offsets (M, 3) [m], base frame, held where the line to them begins or ends in the air, and what stays (CS4119)."""
    known = np.sqrt(np.maximum(np.trace(restraint.prediction.known, axis1=1, axis2=2), 0.0))
    result = held_beside_air(offset, restraint.air, known, restraint.tolerance)
    held = np.linalg.norm(result - offset, axis=1)
    told = int((held > restraint.tolerance).sum())
    if not told:
        return result, []
    worst = int(np.argmax(held))
    return result, [loaded.path.finding(
        int(loaded.targets[worst]), "CS4119", "note",
        f"the tool touches or leaves the stock nearer to a target in the air than one can be added: "
        f"{counted(told, 'correction', 'are')} held back beside it, by up to {1e6 * held[worst]:.0f} um, so as not to cut "
        f"where the log shows air",
        "a target of the program's own where the tool touches or leaves, or --min-spacing if the controller takes less")]


def _limited(loaded: LoadedPath, offset: Array, slope: float) -> Array:
    """The offsets (M, 3) [m], resting frame, with the slope [m/m] along the path limited; air moves stay where they are. To a
    sharp corner and from it there is no limit: there the force steps with the path, wherever the log was taken."""
    length, forces = loaded.path.length, loaded.forces
    air = (forces.samples > 0) & ~forces.forced
    row = np.full(len(length), -1)
    row[loaded.targets] = np.arange(len(loaded.targets))
    where = np.flatnonzero(~np.isnan(length) & (air | (row >= 0)))
    corrected = row[where] >= 0
    offsets = np.zeros((len(where), 3))
    offsets[corrected] = offset[row[where[corrected]]]
    corner = np.searchsorted(where, loaded.targets[sharp_corners(loaded.path, loaded.targets)])
    still = air[where] & ~corrected
    for side in np.split(np.arange(len(where)), np.column_stack([corner, corner + 1]).ravel()):
        offsets[side] = limited_steps(offsets[side], length[where[side]], still[side], slope)
    result = offset.copy()
    result[row[where[corrected]]] = offsets[corrected]
    return result


def _check_size(path: RobotPath, targets: Indices, offset: Array, turn: Array) -> None:
    """Refused (CS4107) where a correction exceeds the limits of cell.yaml."""
    size, tilt = np.linalg.norm(offset, axis=1), np.linalg.norm(turn, axis=1)
    hint = "check force units, sign (force_log.sign) and stiffnesses; limits.max_offset_mm and max_tilt_deg are in cell.yaml"
    findings = []
    for values, limit, factor, unit, what in ((size, path.cell.max_offset, 1e3, "mm", "offset"),
                                              (tilt, path.cell.max_tilt, np.degrees(1.0), "deg", "rotation")):
        over = np.flatnonzero(values > limit)
        if len(over):
            worst = int(over[np.argmax(values[over])])
            findings.append(path.finding(int(targets[worst]), "CS4107", "error",
                                         f"{counted(len(over), 'correction', 'exceed')} the limit: "
                                         f"the largest {what} is {factor * values[worst]:.3f} {unit}, the limit "
                                         f"{factor * limit:g} {unit}", hint))
    if findings:
        raise Refused(*findings)


def _singularity(path: RobotPath, targets: Indices, theta: Array) -> list[Finding]:
    """Refused (CS4106) at the wrist singularity or where a correction would cross it; a warning (CS4110) near it."""
    robot = path.cell.robot
    distance, crossed = np.empty(len(targets)), np.empty(len(targets), dtype=bool)
    for part in chunks(len(targets), CHUNK):
        distance[part] = wrist_distance(robot, theta[part])
        now, then = (np.sin(robot.serial_angles(angles)[:, 4]) for angles in (theta[part], path.theta[targets[part]]))
        crossed[part] = np.sign(now) != np.sign(then)
    bad = np.flatnonzero((distance < SINGULAR) | crossed)
    if len(bad):
        raise Refused(*(path.finding(int(targets[i]), "CS4106", "error", "the correction takes axis 5 through zero, the wrist "
                                     f"singularity, to {np.degrees(distance[i]):.3f} deg on the other side" if crossed[i] else
                                     f"axis 5 is {np.degrees(distance[i]):.3f} deg from the wrist singularity after "
                                     f"correction, at least {np.degrees(SINGULAR):g} deg are needed",
                                     "turn the part or the tool so that axis 5 stays away from zero") for i in
                        bad[:MOST_TOLD]),
                      *and_more(path, targets[bad].tolist(), "CS4106", "at the wrist singularity after correction, or past it"))
    near = np.flatnonzero(distance < NEARLY_SINGULAR)
    if not len(near):
        return []
    closest = int(near[np.argmin(distance[near])])
    return [path.finding(int(targets[closest]), "CS4110", "warning", f"{counted(len(near), 'target')} with force "
                                                                     f"{verb(len(near), 'are')} within "
               f"{np.degrees(NEARLY_SINGULAR):g} deg of the wrist singularity, the closest {np.degrees(distance[closest]):.2f}"
               " deg: axes 4 and 6 turn fast there")]

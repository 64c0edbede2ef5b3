"""`compstiff robots --check`: a robot file held against itself and against what the data sheet states."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from identification.common.findings import CompstiffError, Finding, Level
from identification.common.yaml_source import read_yaml
from identification.model.inverse import check_spherical_wrist, nearest_angles
from identification.model.kinematics import chain, forward
from identification.model.reach import reach
from identification.model.robot import RobotModel, read_robot
from identification.model.robot_file import PoseFile, RobotFile
from identification.model.rotations import Frame, quaternion_to_matrix, rotation_vector

Array = NDArray[np.float64]
# Poses at which the inverse kinematics must give the pose back, and how well [m, rad].
POSES, CLOSES = 2000, 1e-9
# Fewer of the joints' box than this share is allowed by the window: the window and the limits do not go together.
LEAST_SHARE = 1e-3
# Sum of all lengths [m] of an arm that mills; limits and speeds of all joints below this [deg, deg/s] are in radians
# (engineering judgement: the smallest milling arms reach 0.5 m, the largest 4.2 m).
SMALLEST_M, LARGEST_M, RADIANS = 0.3, 15.0, 7.0
STIFFEST_ROBOT = 1e4                # [N m/rad]: a first joint that is softer is in other units (engineering judgement)
# Speeds and accelerations that are too slow or too fast for a joint of such an arm [deg/s] (engineering judgement).
FASTEST = 1500.0
# A data sheet counts its reach from one of these.
_AXES: tuple[Literal[1, 2], Literal[1, 2]] = (1, 2)


@dataclass(frozen=True)
class Checked:
    """One line of the table. subject: what was looked at. found: what it says, with its numbers."""

    subject: str
    found: str
    findings: tuple[Finding, ...] = ()

    @property
    def verdict(self) -> str:
        """"ok", or the worst level among its findings."""
        levels = {finding.level for finding in self.findings}
        return next((level for level in ("error", "warning", "note") if level in levels), "ok")


@dataclass(frozen=True)
class RobotCheck:
    """What was found of one robot file, a line each. file: its path; name: the robot's."""

    file: str
    name: str
    rows: tuple[Checked, ...]

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Of all lines."""
        return tuple(finding for row in self.rows for finding in row.findings)

    @property
    def sound(self) -> bool:
        """Whether nothing in it is wrong; what could not be checked may be left."""
        return all(finding.level != "error" for finding in self.findings)

    def as_dict(self) -> dict[str, Any]:
        """JSON values."""
        return {"file": self.file, "name": self.name, "sound": self.sound,
                "checks": [{"subject": row.subject, "verdict": row.verdict, "found": row.found,
                            "codes": [finding.code for finding in row.findings]} for row in self.rows]}

    def lines(self) -> list[str]:
        """The table."""
        return [f"{row.subject:<14}{row.verdict:<9}{row.found}" for row in self.rows]


def check_robot(file: str | Path) -> RobotCheck:
    """Holds a robot file against itself (geometry, limits, units) and against the data sheet's figures and poses in it.

    Raises CompstiffError as `read_robot`: a file that cannot be read has nothing to check.

    >>> check = compstiff.check_robot(compstiff.built_in_robots()["irb6700-200-2.60"])
    >>> check.sound, check.rows[5].subject, check.rows[5].found[:22]
    (True, 'reach', '2600.6 mm from axis 1:')
    """
    robot, described = read_robot(file), read_yaml(file, RobotFile)
    words = {"drive": "springs at the drives", "serial": "springs at the serial axes"}[robot.load_path]
    rod = "" if robot.rod is None else f", a parallel rod from axis {robot.rod[1] + 1} to {robot.rod[0] + 1}"
    rows = [Checked("file", f"{robot.name}, {robot.manufacturer or 'no maker named'}, {words}{rod}")]
    rows += [_units(robot), _limits(robot), *_geometry(robot), _reach(robot, described)]
    rows += _poses(robot, described)
    rows.append(_sources(robot, described))
    return RobotCheck(str(file), robot.name, tuple(rows))


def _finding(robot: RobotModel, code: str, message: str, hint: str, level: Level = "error") -> Finding:
    return Finding(code, level, message, file=str(robot.source), hint=hint)


def _units(robot: RobotModel) -> Checked:
    """Lengths in mm, angles in degrees, stiffnesses in N m/rad: what is far off was typed in another unit."""
    found = []
    size = float(np.sum(np.abs(robot.a) + np.abs(robot.d)))
    if not SMALLEST_M <= size <= LARGEST_M:
        found.append(_finding(robot, "CS0062", f"all lengths together are {1e3 * size:.6g} mm; of a milling arm "
                              f"{1e3 * SMALLEST_M:g} to {1e3 * LARGEST_M:g} mm are expected",
                              "a_mm and d_mm are in millimetres"))
    turns = {"limits_deg": np.abs(robot.limits), "speed_deg_s": robot.speed}
    for key, values in turns.items():
        largest = float(np.degrees(values.max()))
        if largest < RADIANS:
            found.append(_finding(robot, "CS0062", f"the largest {key} of all joints is {largest:.4g}; more than {RADIANS:g} "
                                  "is expected", "it seems to be in radians: multiply by 57.2958"))
    fastest = float(np.degrees(robot.speed.max()))
    if fastest > FASTEST:
        found.append(_finding(robot, "CS0062", f"the largest speed_deg_s is {fastest:.4g}; at most {FASTEST:g} is expected",
                              "speeds are degrees a second, not a minute"))
    bent = [f"joint {j + 1}: {np.degrees(alpha):.5g}" for j, alpha in enumerate(robot.alpha)
            if abs(np.sin(2 * alpha)) > 1e-9]
    if bent:
        found.append(_finding(robot, "CS0062", f"alpha_deg is no multiple of 90 ({', '.join(bent)})",
                              "angles are in degrees: 1.5708 is 90"))
    if robot.prior.stiffness[0] < STIFFEST_ROBOT:
        found.append(_finding(robot, "CS0062", f"the prior of joint 1 is {robot.prior.stiffness[0]:.4g} N m/rad; over "
                              f"{STIFFEST_ROBOT:g} is expected", "stiffnesses in N m/arcmin are to be multiplied by 3437.75"))
    return Checked("units", f"lengths {1e3 * size:.6g} mm in all, fastest joint {fastest:.4g} deg/s, prior of joint 1 "
                   f"{robot.prior.stiffness[0]:.3g} N m/rad", tuple(found))


def poses_inside(robot: RobotModel, count: int, seed: int = 0) -> Array:
    """Random joint angles (at most count, 6) [rad] inside the limits and the window; fewer where the window leaves few."""
    tried = np.random.default_rng(seed).uniform(robot.limits[:, 0], robot.limits[:, 1], (20 * count, 6))
    return np.asarray(tried[(robot.limit_excess(tried) == 0).all(axis=1)][:count])


def _limits(robot: RobotModel) -> Checked:
    low, high = np.degrees(robot.limits).T
    words = ", ".join(f"{a:g} ... {b:g}" for a, b in zip(low, high, strict=True))
    tried = np.random.default_rng(1).uniform(robot.limits[:, 0], robot.limits[:, 1], (20 * POSES, 6))
    share = float(np.mean((robot.limit_excess(tried) == 0).all(axis=1)))
    found = []
    if share < LEAST_SHARE:
        found.append(_finding(robot, "CS0068", f"the window of the coupled angle leaves {100 * share:.2g} % of what the "
                              "joints' limits allow", "check window_deg, ratio and the limits of the two joints: they do not "
                              "belong together"))
    return Checked("limits", words + (f" deg; {share:.0%} of it inside the window" if robot.window else " deg"), tuple(found))


def _geometry(robot: RobotModel) -> Iterator[Checked]:
    """Which axes are parallel or meet, from the frames themselves; then whether the closed inverse gives poses back."""
    theta = poses_inside(robot, POSES)
    if not len(theta):
        yield Checked("axes", "no pose to look at: nothing lies inside the limits")
        return
    frames = chain(robot, np.ascontiguousarray(robot.serial_angles(theta).T))
    parallel = [f"{i + 1} and {j + 1}" for i in range(6) for j in range(i + 1, 6)
                if np.abs(np.cross(frames.axes[i], frames.axes[j], axis=0)).max() < 1e-9]
    apart = 1e3 * max(_apart(frames.axes[i], frames.origins[i], frames.axes[j], frames.origins[j])
                      for i, j in ((3, 4), (4, 5), (3, 5)))
    words = (f"parallel: {', '.join(parallel) or 'none'}; axes 4, 5 and 6 "
             + ("meet in the wrist centre" if apart < 1e-6 else f"miss each other by {apart:.4g} mm"))
    try:
        check_spherical_wrist(robot)
    except CompstiffError as refused:
        reason = refused.findings[0]
        yield Checked("axes", words, (_finding(robot, "CS0061", reason.message, reason.hint),))
        return
    yield Checked("axes", words)
    flange = forward(robot, theta, Frame.identity())
    again = forward(robot, nearest_angles(robot, flange, theta), Frame.identity())
    off = np.linalg.norm(again.position - flange.position, axis=1)
    turned = np.linalg.norm(rotation_vector(np.swapaxes(flange.rotation, 1, 2) @ again.rotation), axis=1)
    lost = int(np.sum(~((off < CLOSES) & (turned < CLOSES))))
    found = () if not lost else (_finding(
        robot, "CS0061", f"at {lost} of {len(theta)} poses inside the limits the inverse kinematics gives another pose",
        "please report this file: the structure was taken for one with a closed inverse"),)
    yield Checked("inverse", f"{len(theta)} random poses inside the limits, given back to {np.nanmax(off):.1g} m, "
                  f"{np.nanmax(turned):.1g} rad", found)


def _apart(first: Array, at_first: Array, second: Array, at_second: Array) -> float:
    """The largest distance [m] of two axes over n poses, directions and points (3, n)."""
    across = np.cross(first, second, axis=0)
    size = np.linalg.norm(across, axis=0)
    between = at_second - at_first
    with np.errstate(invalid="ignore", divide="ignore"):
        skew = np.abs(np.sum(across * between, axis=0)) / size
    along = np.linalg.norm(between - first * np.sum(first * between, axis=0), axis=0)
    return float(np.max(np.where(size > 1e-6, skew, along)))


def _reach(robot: RobotModel, described: RobotFile) -> Checked:
    sheet = described.data_sheet
    axis, other = _AXES if sheet.reach_from == "axis 1" else _AXES[::-1]
    found = 1e3 * reach(robot, axis)
    if not np.isfinite(found):
        return Checked("reach", "no angle of joints 2 and 3 lies inside the limits and the window")
    words = f"{found:.1f} mm from {sheet.reach_from}: the wrist centre's largest distance inside the limits"
    if sheet.reach_mm is None:
        return Checked("reach", words, (_finding(
            robot, "CS0066", "no reach of the data sheet to hold the lengths against", "state data_sheet.reach_mm",
            "warning"),))
    off = found - sheet.reach_mm
    words += f"; stated {sheet.reach_mm:g} mm, {off:+.1f}"
    if abs(off) <= sheet.reach_tolerance_mm:
        return Checked("reach", words)
    fits = abs(1e3 * reach(robot, other) - sheet.reach_mm) <= sheet.reach_tolerance_mm
    hint = (f"from axis {other} it fits: state reach_from: axis {other}" if fits
            else "check a_mm, d_mm and the limits of joints 2 and 3, and from which axis to which point the data sheet counts")
    return Checked("reach", words, (_finding(
        robot, "CS0063", f"reaches {found:.1f} mm from {sheet.reach_from}, the data sheet states {sheet.reach_mm:g} mm, "
        f"tolerance {sheet.reach_tolerance_mm:g} mm", hint),))


def _poses(robot: RobotModel, described: RobotFile) -> Iterator[Checked]:
    if not described.poses:
        yield Checked("poses", "none stated", (_finding(
            robot, "CS0066", "no pose to hold the forward kinematics against: signs and zeros of the joints are unproved",
            "copy one or two poses of the data sheet, or read them on the pendant, into poses:", "warning"),))
    for number, pose in enumerate(described.poses, 1):
        yield _pose(robot, number, pose)


def _pose(robot: RobotModel, number: int, pose: PoseFile) -> Checked:
    theta = np.radians([pose.joints_deg])
    frames = chain(robot, np.ascontiguousarray(robot.serial_angles(theta).T))
    findings, words = [], []
    for key, stated, origin in (("flange", pose.flange_mm, 5), ("wrist", pose.wrist_mm, 4)):
        if stated is None:
            continue
        at = frames.origins[origin, :, 0]
        off = float(np.linalg.norm(1e3 * at - np.array(stated)))
        words.append(f"{key} off by {off:.3f} mm")
        if off > pose.tolerance_mm:
            place = ", ".join(f"{x:.2f}" for x in 1e3 * at + 0.0)
            findings.append(_finding(
                robot, "CS0064", f"pose {number}: {key}_mm is [{', '.join(f'{x:g}' for x in stated)}] in the document, the "
                f"file's geometry gives [{place}], {off:.2f} mm away, tolerance {pose.tolerance_mm:g} mm",
                "check the lengths, the sense and offset_deg of the joints that are not zero there, and the coupling"))
    if pose.quaternion is not None:
        wanted = quaternion_to_matrix(np.array([pose.quaternion]))
        angle = float(np.degrees(np.linalg.norm(rotation_vector(np.swapaxes(wanted, 1, 2) @ frames.rotation[None, :, :, 0]))))
        words.append(f"turned by {angle:.4f} deg")
        if angle > pose.tolerance_deg:
            findings.append(_finding(
                robot, "CS0064", f"pose {number}: the flange is turned by {angle:.3f} deg against the document's quaternion, "
                f"tolerance {pose.tolerance_deg:g} deg", "check offset_deg and sense of joints 4 to 6"))
    outside = robot.limit_excess(theta)[0]
    if (outside > 1e-9).any():
        which = [f"joint {j + 1}" if j < 6 else "the window of the coupled angle" for j in np.flatnonzero(outside > 1e-9)]
        findings.append(_finding(robot, "CS0067", f"pose {number} is outside the limits of the file: {', '.join(which)}",
                                 "the limits or the pose are of another variant, or counted otherwise", "warning"))
    if pose.source is None:
        findings.append(_unsourced(robot, f"poses[{number - 1}].source"))
    return Checked(f"pose {number}", ", ".join(words) + f" ({pose.source or 'no source'})", tuple(findings))


def _unsourced(robot: RobotModel, key: str) -> Finding:
    return _finding(robot, "CS0065", f"{key} names no document", "name document and page, or say that it is assumed", "warning")


def _sources(robot: RobotModel, described: RobotFile) -> Checked:
    sheet = described.data_sheet
    needed = {"geometry": True, "limits": True, "speed": True, "acceleration": True, "prior": True,
              "coupling": described.coupling is not None, "links": described.links is not None,
              "data_sheet": sheet.reach_mm is not None or sheet.payload_kg is not None}
    wanted = [key for key, here in needed.items() if here]
    missing = [key for key in wanted if getattr(described.sources, key) is None]
    return Checked("sources", f"{len(wanted) - len(missing)} of {len(wanted)} kinds of numbers have one",
                   tuple(_unsourced(robot, f"sources.{key}") for key in missing))

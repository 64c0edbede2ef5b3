"""The turn of the tool about its axis and the robot's configuration, where a CAM system leaves them open."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compensator.path.configurations import LEAST_ANGLE, angle_to, base_from_flange, best_direction, hold, tool_frames
from compensator.posting.campath import CamPath
from compensator.posting.settings import PostingSettings
from identification.common.arrays import Array, read_only
from identification.common.findings import Finding, Refused, error
from identification.model.cell import Cell
from identification.model.inverse import configuration
from identification.model.kinematics import forward
from identification.model.rotations import Frame, rotation_vector

# Joint angles of a table and its poses may differ by rounding only [m, rad].
POSE_APART, TURN_APART = 5e-4, np.radians(0.1)
# Less than this between a joint and its limit, or axis 5 and zero, is worth a warning [rad].
LITTLE = np.radians(5.0)


@dataclass(frozen=True, eq=False)
class Orientations:
    """quaternion (N, 4) w x y z, unit, in the work object; confdata (N, 4). chosen: what the file left open, JSON values."""

    quaternion: Array
    confdata: NDArray[np.int64]
    chosen: dict[str, Any]
    findings: tuple[Finding, ...]

    def __post_init__(self) -> None:
        read_only(self.quaternion, self.confdata)


def orientations(cam_path: CamPath, cell: Cell, settings: PostingSettings) -> Orientations:
    """Those of the file, or chosen. Raises Refused (CS4303), CompstiffError (CS2153, CS4304)."""
    chosen: dict[str, Any] = {}
    findings: list[Finding] = []
    if cam_path.quaternion is not None:
        quaternion = cam_path.quaternion
    else:
        assert cam_path.axis is not None
        towards = _tool_x_towards(cam_path, cam_path.axis, cell, settings)
        quaternion = tool_frames(cam_path.axis, towards)
        direction = (np.round(towards, 9) + 0.0).tolist()          # + 0.0: no -0
        chosen = {"tool_x_towards": direction, "tool_axis": "tip to spindle; tool z against it"}
        findings.append(_turn_chosen(cam_path, direction, settings))
    if cam_path.joints is None and cam_path.confdata is not None:
        return Orientations(quaternion, cam_path.confdata, {**chosen, "configuration": "as in the file"}, tuple(findings))
    flange = base_from_flange(cell, cam_path.position, quaternion)
    if cam_path.joints is not None:
        _check_joints(cam_path, cam_path.joints, cell, flange)
        theta = cam_path.joints
    else:
        held = hold(cell.robot, flange)
        if held.failed_at >= 0:
            raise Refused(Finding(
                "CS4303", "error", "no configuration of the robot goes all along the path: the one that gets farthest ends at "
                f"target {held.failed_at} of {len(cam_path)} (out of reach, beyond a joint limit, or a jump)",
                file=cam_path.source, line=int(cam_path.line[held.failed_at]), target=held.failed_at,
                hint="check workobject and tool in cell.yaml (a work object that is not stated lies in the robot's base); "
                f"{'' if cam_path.quaternion is not None else 'turn the tool with --tool-x, or '}move the part; is its unit "
                "right, its tool axis from tip to spindle"))
        if held.reserve < LITTLE:
            findings.append(Finding(
                "CS4305", "warning", f"{np.degrees(held.reserve):.1f} degrees from {held.where} at target {held.at}",
                cam_path.source, int(cam_path.line[held.at]), target=held.at,
                hint="move the part" if cam_path.quaternion is not None else "try another --tool-x, or move the part"))
        chosen["smallest_reserve_deg"] = round(float(np.degrees(held.reserve)), 3)
        theta = held.theta
    # An axis that stands on the border of two quadrants must not flicker between them with the last digit.
    return Orientations(quaternion, configuration(cell.robot, theta + 1e-9), chosen, tuple(findings))


def _tool_x_towards(cam_path: CamPath, axis: Array, cell: Cell, settings: PostingSettings) -> Array:
    """Unit direction (3,) of the work object that tool x is turned towards; axis (N, 3) of the tool."""
    if settings.tool_x is None:
        best = best_direction(cell, cam_path.position, axis)
        if best is None:
            raise error("CS4304", "the tool axis comes near every horizontal direction along this path: tool x can keep none",
                        file=cam_path.source, hint="give a direction with --tool-x, or split the path")
        return best[0]
    towards = np.array(settings.tool_x) / np.linalg.norm(settings.tool_x)
    near = angle_to(axis, towards)
    nearest = int(np.argmin(near))
    if near[nearest] < LEAST_ANGLE:
        raise error("CS4304", f"the tool axis comes within {np.degrees(near[nearest]):.1f} degrees of the direction --tool-x, "
                    f"at least {np.degrees(LEAST_ANGLE):.0f} are needed: the tool would spin about its axis there",
                    file=cam_path.source, line=int(cam_path.line[nearest]), target=nearest,
                    hint="give a direction that the tool axis never comes near")
    return np.asarray(towards)


def _turn_chosen(cam_path: CamPath, direction: list[float], settings: PostingSettings) -> Finding:
    shown = ",".join(f"{x:.6g}" for x in direction)
    return Finding(
        "CS4302", "note", "tool z points against the APT axis (tip to spindle); the free turn about it puts tool x as near "
        f"as possible to {shown} of the work object" + ("" if settings.tool_x else ", which leaves most room"),
        cam_path.source, hint="" if settings.tool_x else f"--tool-x {shown} keeps it so when the path changes")


def _check_joints(cam_path: CamPath, joints: Array, cell: Cell, flange: Frame) -> None:
    """Raises CompstiffError (CS2153) where the joint angles (N, 6) of a table do not put the tool where its pose is."""
    reached = forward(cell.robot, joints, Frame.identity())
    apart = np.linalg.norm(reached.position - flange.position, axis=1)
    turned = np.linalg.norm(rotation_vector(np.swapaxes(reached.rotation, 1, 2) @ flange.rotation), axis=1)
    wrong = np.flatnonzero((apart > POSE_APART) | (turned > TURN_APART))
    if len(wrong):
        target = int(wrong[0])
        raise error("CS2153", f"the joint angles put the flange {1e3 * apart[target]:.3f} mm and "
                    f"{np.degrees(turned[target]):.3f} degrees off this row's pose, at most {1e3 * POSE_APART:g} mm and "
                    f"{np.degrees(TURN_APART):g} degrees are expected",
                    file=cam_path.source, line=int(cam_path.line[target]), target=target,
                    hint="check robot, tool and workobject in cell.yaml, or leave q1_deg ... q6_deg out")

"""Cell: robot, tool, sensors, limits and connection, as the one file describes them (docs/formats.md#cellyaml)."""

from __future__ import annotations

import difflib
import os
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from identification.common.findings import error
from identification.common.yaml_source import read_yaml
from identification.model.cell_file import (
    AccuracyFile,
    CellFile,
    ControllerFile,
    CuttingFile,
    ForceLogFile,
    FrameKind,
    ModbusFile,
    MotionFile,
    ToolFile,
)
from identification.model.frame_file import ZERO
from identification.model.mechanical_units import MechanicalUnit, mechanical_units, travel
from identification.model.pendant import PendantProof, check_pendant
from identification.model.robot import Prior, RobotModel, built_in_robots, read_robot
from identification.model.rotations import Frame

Array = NDArray[np.float64]
# A tool shorter than this [mm] is given in metres: no flange carries one.
SHORTEST_TOOL = 2.0
# And no load hangs farther from it [mm].
FARTHEST_CENTRE = 3000.0


@dataclass(frozen=True, eq=False)
class Noise:
    """What the cell states of the measurement noise, 1 sigma, base x y z.

    deflection (3,) [m] of one reading; force (3,) [N] plus force_relative (of each component); pose_offset (3,) [m],
    one draw a pose; force_gain of all forces alike, which no row tells. deflection_stated, force_stated,
    force_relative_stated, offset_stated: the file names that part, so that a zero means none and not unknown; a force error of
    which one part is zero and the other left out is none.
    """

    deflection: Array
    force: Array
    force_relative: float
    pose_offset: Array
    deflection_stated: bool
    force_stated: bool
    force_relative_stated: bool
    offset_stated: bool
    force_gain: float = 0.0


@dataclass(frozen=True, eq=False)
class ForceLogFrame:
    """kind: frame of logged forces. flange_from_sensor: where kind is "sensor". sign: +1 on the tool, -1 by the tool.

    bias (6,) [N, N m] as logged, None where it is not stated. mass [kg] and centre (3,) [m] in the flange frame of what hangs
    on the sensor: force_log.payload, else the tool's. weight: whether the log holds it, None where that is not stated.
    form: how the logger writes.
    """

    kind: FrameKind
    flange_from_sensor: Frame | None
    sign: float
    bias: Array | None = None
    mass: float | None = None
    centre: Array | None = None
    weight: Literal["in_log", "removed"] | None = None
    form: ForceLogFile = field(default_factory=ForceLogFile)


@dataclass(frozen=True, eq=False)
class Cell:
    """A robot cell, SI units. Frames: flange_from_tcp, world_from_base, world_from_object.

    object_stated: whether the file states its work object; else that is the world. joint_window (6, 2) [rad]: where the joints
    of planned poses may stand, infinite where nothing is said; reach [m]: least and greatest distance of their TCP from axis 1.
    units: the mechanical units beside the arm, None where the file says nothing of them; world_from_base holds where the unit
    that carries the robot stands at its zero.
    cutting, motion, accuracy: as the file has them. pendant: how far robot and tool are from the poses of the pendant, None
    where the file has none.
    """

    source: Path
    robot: RobotModel
    flange_from_tcp: Frame
    world_from_base: Frame
    world_from_object: Frame
    noise: Noise
    prior: Prior
    force_log: ForceLogFrame
    max_offset: float
    max_tilt: float
    modbus: ModbusFile
    tool_mass: float | None
    tool_centre: Array | None
    object_stated: bool = True
    joint_window: Array = field(default_factory=lambda: np.tile([-np.inf, np.inf], (6, 1)))
    reach: tuple[float, float] | None = None
    controller: ControllerFile = field(default_factory=ControllerFile)
    units: tuple[MechanicalUnit, ...] | None = None
    cutting: CuttingFile = field(default_factory=CuttingFile)
    motion: MotionFile = field(default_factory=MotionFile)
    accuracy: AccuracyFile | None = None
    pendant: PendantProof | None = None

    @property
    def frames(self) -> dict[str, Frame]:
        """The frames that the file turns by a quaternion, by the words before `quaternion` there."""
        sensor = self.force_log.flange_from_sensor
        return {"tool.": self.flange_from_tcp, "base_frame.": self.world_from_base, "workobject.": self.world_from_object,
                **({} if sensor is None else {"force_log.sensor_": sensor})}


def read_cell(file: str | Path, *, geometry: bool = True) -> Cell:
    """Reads cell.yaml and the robot file it names; geometry: whether the robot must have joints.

    Raises CompstiffError: CS0101 and CS0102 (content, with line and column), CS0104 (unknown robot), CS0105 (no joints),
    CS0116 (another robot or tool than the pendant's).

    >>> cell = compstiff.read_cell("cell.yaml")
    >>> cell.robot.name, (1e3 * cell.flange_from_tcp.position).round(3).tolist()
    ('irb6660-205-1.90', [120.0, 0.0, 250.0])
    """
    file = Path(file)
    described = read_yaml(file, CellFile)
    log = described.force_log
    if log.frame == "sensor" and (log.sensor_quaternion is None or log.sensor_position_mm is None):
        raise error("CS0102", "force_log.frame is 'sensor', but sensor_quaternion and sensor_position_mm are not both "
                    "given", file=str(file), hint="state the sensor frame in the flange frame")
    length = float(np.linalg.norm(described.tool.position_mm))
    if 0 < length < SHORTEST_TOOL:
        raise error("CS0102", f"tool.position_mm is {length:.3g} mm long, expected 0 or at least {SHORTEST_TOOL:g} mm",
                    file=str(file), hint="it is in millimetres, as in RAPID tooldata: is it in metres?")
    for key, load in (("tool", described.tool), ("force_log.payload", log.payload)):
        away = 0.0 if load is None or load.centre_of_mass_mm is None else float(np.linalg.norm(load.centre_of_mass_mm))
        if away and not SHORTEST_TOOL <= away <= FARTHEST_CENTRE:
            raise error("CS0102", f"{key}.centre_of_mass_mm is {away:.4g} mm from the flange, expected 0, or "
                        f"{SHORTEST_TOOL:g} to {FARTHEST_CENTRE:g} mm", file=str(file),
                        hint=f"it is in millimetres: is it in {'metres' if away < SHORTEST_TOOL else 'micrometres'}?")
    sensor = None
    if log.sensor_quaternion is not None and log.sensor_position_mm is not None:
        sensor = Frame.from_quaternion(1e-3 * np.array(log.sensor_position_mm), log.sensor_quaternion)
    units, world_from_base = mechanical_units(described.mechanical_units, str(file)), described.base_frame.frame()
    robot = replace(_robot(described.robot, file, geometry), track=travel(units, world_from_base),
                    serial_number=described.serial_number or "")
    stiffness, relative_std = described.prior.stiffness_nm_per_rad, described.prior.relative_std
    prior = Prior(robot.prior.stiffness if stiffness is None else np.array(stiffness),
                  robot.prior.relative_std if relative_std is None else np.array(relative_std))
    measurement, stated = described.measurement, described.measurement.model_fields_set
    centre = described.tool.centre_of_mass_mm
    return Cell(
        source=file,
        robot=robot,
        flange_from_tcp=described.tool.frame(),
        world_from_base=world_from_base,
        world_from_object=described.workobject.frame(),
        noise=Noise(
            deflection=1e-6 * np.array(measurement.deflection_std_um),
            force=np.array(measurement.force_std_n),
            force_relative=measurement.force_relative_std,
            pose_offset=1e-6 * np.array(measurement.pose_offset_std_um),
            deflection_stated="deflection_std_um" in stated,
            force_stated="force_std_n" in stated or ("force_relative_std" in stated and measurement.force_relative_std == 0),
            force_relative_stated="force_relative_std" in stated or (
                "force_std_n" in stated and not any(measurement.force_std_n)),
            offset_stated="pose_offset_std_um" in stated,
            force_gain=measurement.force_gain_std,
        ),
        prior=prior,
        force_log=_force_log(log, sensor, described.tool),
        max_offset=1e-3 * described.limits.max_offset_mm,
        max_tilt=float(np.radians(described.limits.max_tilt_deg)),
        modbus=described.modbus,
        controller=described.controller,
        tool_mass=described.tool.mass_kg,
        tool_centre=None if centre is None else 1e-3 * np.array(centre),
        object_stated="workobject" in described.model_fields_set,
        joint_window=np.radians([window or (-np.inf, np.inf) for _, window in described.design.joint_window_deg]),
        reach=None if described.design.reach_mm is None else (1e-3 * described.design.reach_mm[0],
                                                              1e-3 * described.design.reach_mm[1]),
        units=units,
        cutting=_cutting(described.cutting, file),
        motion=described.motion,
        accuracy=_accuracy(described.accuracy, file),
        pendant=check_pendant(described.pendant_poses, robot, described.tool.frame(), str(file)),
    )


def _cutting(cutting: CuttingFile, file: Path) -> CuttingFile:
    """As it stands. CompstiffError (CS0102) where a key says nothing without another one."""
    needs = (("std_n_per_mm", "stiffness_n_per_mm"), ("tool_diameter_mm", "material"), ("contact_mm", "material"))
    for key, other in needs:
        if key == "tool_diameter_mm" and cutting.teeth is not None:
            continue                # a cutter of its own (docs/cutting.md)
        if getattr(cutting, key) is not None and getattr(cutting, other) is None:
            raise error("CS0102", f"cutting.{key} is stated without cutting.{other}, and says nothing by itself",
                        file=str(file), hint=f"state cutting.{other} too")
    return cutting


def _accuracy(accuracy: AccuracyFile | None, file: Path) -> AccuracyFile | None:
    """As it stands. CompstiffError (CS0102) where of length_mm and probed_by_robot one is stated without the other."""
    if accuracy is None or accuracy.probed_by_robot == (accuracy.length_mm is not None):
        return accuracy
    one, other = ("probed_by_robot", "length_mm") if accuracy.probed_by_robot else ("length_mm", "probed_by_robot: true")
    raise error("CS0102", f"accuracy.{one} is stated without {other}", file=str(file),
                hint="of a part that was probed by this robot only what its error changes by over the part is left, and that "
                "takes both: the length over which it changes, and that the part was probed")


def _force_log(log: ForceLogFile, sensor: Frame | None, tool: ToolFile) -> ForceLogFrame:
    bias = None
    if log.bias_n is not None or log.bias_nm is not None:
        bias = np.array([*(log.bias_n or ZERO), *(log.bias_nm or ZERO)])
    payload = log.payload or tool
    centre = payload.centre_of_mass_mm
    return ForceLogFrame(log.frame, sensor, 1.0 if log.sign == "on_tool" else -1.0, bias, payload.mass_kg,
                         None if centre is None else 1e-3 * np.array(centre), log.weight, log)


def _robot(name: str, cell: Path, geometry: bool) -> RobotModel:
    """A built-in robot by its name, else a robot file by its path, relative to the cell's folder."""
    known = built_in_robots()
    if name in known:
        return read_robot(known[name])
    path = cell.parent / name
    if os.path.isfile(path):        # False, too, for what no file can be called
        return read_robot(path, geometry=geometry)
    near = difflib.get_close_matches(name.lower().replace(" ", ""), known, n=3, cutoff=0.5)
    raise error("CS0104", f"robot '{name}' is neither built in nor a file {path}", file=str(cell),
                hint=(f"near it: {', '.join(near)}; " if near else "")
                + "compstiff robots lists the built-in ones; a path is relative to the folder of cell.yaml")

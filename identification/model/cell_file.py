"""cell.yaml as it is written: its keys, their kinds and bounds (docs/formats.md#cellyaml)."""

from __future__ import annotations

import re
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from identification.common.yaml_source import EachJoint, NotNegative, Number, Positive, Quaternion, Stiffness, Strict, Triple
from identification.model.frame_file import ZERO, FrameFile
from identification.model.mechanical_units import MechanicalUnitFile
from identification.model.pendant import PendantPoseFile

FrameKind = Literal["base", "tool", "sensor"]


class ToolFile(FrameFile):
    """The tool: TCP in the flange frame, optional payload."""

    position_mm: Triple
    mass_kg: NotNegative | None = None
    centre_of_mass_mm: Triple | None = None


class MeasurementFile(Strict):
    """How well a deflection is measured. Standard deviations, 1 sigma."""

    deflection_std_um: tuple[Positive, Positive, Positive] = (2.0, 2.0, 2.0)
    force_std_n: tuple[NotNegative, NotNegative, NotNegative] = ZERO
    force_relative_std: Annotated[float, Field(ge=0, le=0.3)] = 0.0
    force_gain_std: Annotated[float, Field(ge=0, le=0.3)] = 0.0
    pose_offset_std_um: tuple[NotNegative, NotNegative, NotNegative] = ZERO


class PayloadFile(Strict):
    """What hangs on the force sensor, in the flange frame."""

    mass_kg: NotNegative
    centre_of_mass_mm: Triple | None = None


# Columns of a force log by the names that files and cell.yaml give them; "-" is one that is not read.
LOG_COLUMNS = frozenset((
    "-", "target", "path_mm", "time_s", "time_ms", "sequence", "x_mm", "y_mm", "z_mm", *(f"q{k}_deg" for k in range(1, 7)),
    *(f"{kind}{axis}_{unit}" for kind, units in (("f", ("n", "counts")), ("m", ("nm", "counts"))) for axis in "xyz"
      for unit in units)))


def _log_columns(names: tuple[str, ...]) -> tuple[str, ...]:
    unknown = [name for name in names if name not in LOG_COLUMNS]
    if unknown:
        raise ValueError(f"must be column names of a force log, '-' for one that is not read; unknown: {', '.join(unknown)}")
    return names


class ForceLogFile(Strict):
    """What frame and sign logged forces have, and how this cell's logger writes them."""

    frame: FrameKind = "base"
    sensor_quaternion: Quaternion | None = None
    sensor_position_mm: Triple | None = None
    sign: Literal["on_tool", "by_tool"] = "on_tool"
    columns: Annotated[tuple[str, ...], AfterValidator(_log_columns)] | None = None
    rate_hz: Positive | None = None
    target: Literal["nearest", "ahead"] = "nearest"
    position_late_ms: Annotated[float, Field(ge=-1000, le=1000)] = 0.0
    gain_std: Annotated[float, Field(ge=0, le=0.5)] = 0.01
    mounting_std_deg: Annotated[float, Field(ge=0, le=20)] | None = None
    counts_per_n: Positive | None = None
    counts_per_nm: Positive | None = None
    saturation_n: Positive | None = None
    saturation_nm: Positive | None = None
    spindle_rpm: Positive | None = None
    bias_n: Triple | None = None
    bias_nm: Triple | None = None
    weight: Literal["in_log", "removed"] | None = None
    payload: PayloadFile | None = None


class LimitsFile(Strict):
    """What a correction may not exceed."""

    max_offset_mm: Positive = Field(default=2.0, le=100.0)
    max_tilt_deg: Positive = Field(default=0.5, le=30.0)


Material = Literal["aluminium", "copper_alloy", "cast_iron", "steel", "stainless_steel", "titanium", "superalloy",
                   "hardened_steel"]


class CuttingFile(Strict):
    """The cut that this cell mills with: how stiff it is across the feed, or what its prior is made from; and its cutter."""

    material: Material | None = None
    tool_diameter_mm: Positive | None = None
    contact_mm: Positive | None = None
    teeth: Annotated[int, Field(ge=1, le=100)] | None = None
    corner_radius_mm: NotNegative | None = None
    flute_mm: Positive | None = None
    # 1 sigma of what the edges need more, or less, than when their coefficients were logged: half again, two of it, is a cutter
    # in the middle of its life (engineering judgement).
    wear_std: Annotated[float, Field(ge=0, le=2)] = 0.25
    stiffness_n_per_mm: Positive | None = None
    std_n_per_mm: NotNegative | None = None


class MotionFile(Strict):
    """How much more, or less, the moving robot gives way than at rest, where no measured pass has told it."""

    compliance_std: Annotated[float, Field(ge=0, le=0.5)] = 0.02


class AccuracyFile(Strict):
    """What a calibration says of the robot without load: how far its tool is from where it was sent. probed_by_robot: the
    part's work object was measured with this robot, at the part."""

    position_um: Annotated[float, Field(ge=5, le=2e4)]
    length_mm: Annotated[float, Field(ge=20, le=1e4)] | None = None
    probed_by_robot: bool = False


def host_alone(value: str) -> str:
    """A name or an address. Raises ValueError where it has more: scheme, port, path."""
    if re.search(r"[\s/\\@]", value) or re.fullmatch(r"[^:]*:\d*", value) or not value:
        raise ValueError("must be a name or an address alone, such as 192.168.125.1; port and tls have keys of their own")
    return value


Host = Annotated[str, AfterValidator(host_alone)]


class ModbusFile(Strict):
    """Where the cell's Modbus server listens."""

    host: Host = "127.0.0.1"
    port: Annotated[int, Field(ge=1, le=65535)] = 5020
    unit: Annotated[int, Field(ge=0, le=255)] = 1


# What a folder on a controller may be called: a root such as HOME, and folders in it; nothing that leads out of it.
_FOLDER = re.compile(r"[A-Za-z][A-Za-z0-9_]*(/[A-Za-z0-9_][A-Za-z0-9_ .-]*)*")


def _folder(value: str) -> str:
    name = value.replace("\\", "/").strip("/").removeprefix("$")
    if not _FOLDER.fullmatch(name) or ".." in name:
        raise ValueError("must be a folder of the controller such as HOME or HOME/milling")
    return name


def _fingerprint(value: str) -> str:
    digits = value.replace(":", "").replace(" ", "").lower()
    if not re.fullmatch("[0-9a-f]{64}", digits):
        raise ValueError("must be the SHA-256 of the certificate: 64 hexadecimal digits, colons allowed")
    return digits


class ControllerFile(Strict):
    """Where the robot controller's web services listen, and who logs in there. The password is never in a file."""

    host: Host | None = None
    port: Annotated[int, Field(ge=1, le=65535)] | None = None
    tls: bool = True
    ca: str | None = None
    fingerprint: Annotated[str, AfterValidator(_fingerprint)] | None = None
    user: str = "Default User"
    folder: Annotated[str, AfterValidator(_folder)] = "HOME"
    system: str | None = None


def _window(value: tuple[float, float]) -> tuple[float, float]:
    if not value[0] < value[1]:
        raise ValueError("must be [lowest, highest]")
    return value


Window = Annotated[tuple[Number, Number], AfterValidator(_window)]


class JointWindowFile(Strict):
    """Where the joints of a planned pose may stand, inside their limits."""

    q1: Window | None = None
    q2: Window | None = None
    q3: Window | None = None
    q4: Window | None = None
    q5: Window | None = None
    q6: Window | None = None


class DesignFile(Strict):
    """Which poses `design` may plan in this cell."""

    joint_window_deg: JointWindowFile = JointWindowFile()
    reach_mm: Window | None = None


class CellPriorFile(Strict):
    """The prior, where it differs from the robot file's."""

    stiffness_nm_per_rad: tuple[Stiffness, Stiffness, Stiffness, Stiffness, Stiffness, Stiffness] | None = None
    relative_std: EachJoint | None = None


class CellFile(Strict):
    """cell.yaml."""

    robot: str
    serial_number: Annotated[str, Field(min_length=1, max_length=60)] | None = None
    tool: ToolFile
    pendant_poses: tuple[PendantPoseFile, ...] = ()
    base_frame: FrameFile = FrameFile()
    workobject: FrameFile = FrameFile()
    mechanical_units: tuple[MechanicalUnitFile, ...] | None = None
    measurement: MeasurementFile = MeasurementFile()
    prior: CellPriorFile = CellPriorFile()
    force_log: ForceLogFile = ForceLogFile()
    limits: LimitsFile = LimitsFile()
    modbus: ModbusFile = ModbusFile()
    controller: ControllerFile = ControllerFile()
    design: DesignFile = DesignFile()
    cutting: CuttingFile = CuttingFile()
    motion: MotionFile = MotionFile()
    accuracy: AccuracyFile | None = None

"""robot.yaml as it is written: joints, coupling, prior, and what `compstiff robots --check` holds them against."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, StringConstraints, model_validator

from identification.common.yaml_source import (
    EachJoint,
    NotNegative,
    Number,
    Positive,
    Quaternion,
    Stiffness,
    Strict,
    Triple,
)

LoadPath = Literal["drive", "serial"]
Text = Annotated[str, StringConstraints(strip_whitespace=True, min_length=1)]
Six = tuple[Number, Number, Number, Number, Number, Number]


class JointFile(Strict):
    """A joint. sense: -1 where the controller counts against the z axis of the joint's frame."""

    alpha_deg: Number
    a_mm: Number
    d_mm: Number
    offset_deg: Number = 0.0
    sense: Literal[1, -1] = 1
    limits_deg: tuple[Number, Number]
    speed_deg_s: Positive
    acceleration_deg_s2: Positive

    @model_validator(mode="after")
    def _ascending(self) -> JointFile:
        if self.limits_deg[0] >= self.limits_deg[1]:
            raise ValueError(f"limits_deg must be an ascending pair; received {list(self.limits_deg)}")
        return self


class CouplingFile(Strict):
    """An angle the controller counts with another axis' angle in it. rod: whether a parallel rod makes it so, or the controller
    alone."""

    joint: Annotated[int, Field(ge=1, le=6)]
    driven_by: Annotated[int, Field(ge=1, le=6)]
    ratio: Number
    rod: bool = True
    window_deg: tuple[Number, Number] | None = None

    @model_validator(mode="after")
    def _ascending(self) -> CouplingFile:
        if self.window_deg is not None and self.window_deg[0] >= self.window_deg[1]:
            raise ValueError(f"window_deg must be an ascending pair; received {list(self.window_deg)}")
        if self.joint == self.driven_by:
            raise ValueError(f"joint {self.joint} is driven by itself")
        return self


class PriorFile(Strict):
    """The `prior` block of a robot file and of cell.yaml."""

    stiffness_nm_per_rad: tuple[Stiffness, Stiffness, Stiffness, Stiffness, Stiffness, Stiffness]
    relative_std: EachJoint = (2.0,) * 6


class LinkFile(Strict):
    """A link, in the frame of the joint that carries it."""

    mass_kg: NotNegative
    centre_of_mass_mm: Triple


class DataSheetFile(Strict):
    """What the maker states of the whole arm. The reach is the wrist centre's: its distance from axis 1, or from axis 2."""

    reach_mm: Positive | None = None
    reach_from: Literal["axis 1", "axis 2"] = "axis 1"
    reach_tolerance_mm: Positive = 10.0
    payload_kg: Positive | None = None


class PoseFile(Strict):
    """Where a document says the arm stands at some joint angles: flange or wrist centre in the robot's base."""

    joints_deg: Six
    flange_mm: Triple | None = None
    wrist_mm: Triple | None = None
    quaternion: Quaternion | None = None
    tolerance_mm: Positive = 1.0
    tolerance_deg: Positive = 0.1
    source: Text | None = None

    @model_validator(mode="after")
    def _says_something(self) -> PoseFile:
        if self.flange_mm is None and self.wrist_mm is None and self.quaternion is None:
            raise ValueError("a pose must say flange_mm, wrist_mm or quaternion; received none of them")
        return self


class SourcesFile(Strict):
    """The document that each kind of number was taken from, or that it is an assumption."""

    geometry: Text | None = None
    limits: Text | None = None
    speed: Text | None = None
    acceleration: Text | None = None
    coupling: Text | None = None
    prior: Text | None = None
    links: Text | None = None
    data_sheet: Text | None = None


class RobotFile(Strict):
    """robot.yaml (docs/formats.md#robotyaml)."""

    name: str
    manufacturer: str = ""
    load_path: LoadPath | None = None
    joints: Annotated[list[JointFile], Field(min_length=6, max_length=6)] | None = None
    coupling: CouplingFile | None = None
    prior: PriorFile
    links: Annotated[list[LinkFile], Field(min_length=6, max_length=6)] | None = None
    data_sheet: DataSheetFile = DataSheetFile()
    poses: tuple[PoseFile, ...] = ()
    sources: SourcesFile = SourcesFile()

    @model_validator(mode="after")
    def _whole(self) -> RobotFile:
        if self.joints is not None and self.load_path is None:
            raise ValueError("load_path must be drive or serial where joints are given; received none")
        if self.joints is None and (self.coupling is not None or self.links is not None or self.poses):
            raise ValueError("coupling, links and poses need joints; received none")
        if self.coupling is not None and not self.coupling.rod and self.load_path == "drive":
            raise ValueError("load_path must be serial where the controller alone couples (rod: false); received drive")
        return self

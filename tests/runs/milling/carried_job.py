"""The path of line_job.py with the robot on a slide, the part on a tilting and turning table, or both: kinematics of their own,
by SciPy's rotations about drawn lines."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from tests.runs.command_line import user_files as kit
from tests.runs.command_line.user_files import BASE, Frame
from tests.runs.milling.line_job import LineJob

# A slide, its direction in the world and the value at which the robot stands at BASE; a table: two lines in its own frame, each
# by a direction and a point [m], and where its user frame is with both angles at zero.
SLIDE, SLIDE_ZERO = np.array([0.6, 0.64, -0.48]), 800.0
TABLE = Frame.mm([700.0, -900.0, 380.0], kit.quaternion(Rotation.from_euler("zyx", [-25, 4, 7], degrees=True)))
TILT, TILT_POINT = np.array([0.8, 0.6, 0.0]), np.array([0.0, 0.3, 0.2])
TURN, TURN_POINT = np.array([0.0, 0.28, 0.96]), np.array([0.35, 0.1, 0.0])
ON_TABLE = Frame.mm([120.0, 60.0, 240.0], kit.quaternion(Rotation.from_euler("xyz", [10, -20, 30], degrees=True)))
UNUSED = "9E9"


def _list(values: np.ndarray, factor: float = 1.0) -> str:
    return "[" + ", ".join(f"{factor * value:.9f}" for value in values) + "]"


def slide_yaml(*, limits: str = "") -> str:
    return (f"  - {{name: TRACK_1, carries: robot, axes: [{{eax: a, kind: linear, direction: {_list(SLIDE)}, "
            f"zero_mm: {SLIDE_ZERO}{limits}}}]}}\n")


def table_yaml(*, limits: str = "") -> str:
    tilt = f"{{eax: b, kind: rotary, direction: {_list(TILT)}, through_mm: {_list(TILT_POINT, 1e3)}{limits}}}"
    turn = f"{{eax: c, kind: rotary, direction: {_list(TURN)}, through_mm: {_list(TURN_POINT, 1e3)}{limits}}}"
    return (f"  - name: STN1\n    carries: workobject\n    base_frame: {kit.yaml_frame(TABLE)}\n    axes: [{tilt}, {turn}]\n"
            f"    user_frame: {kit.yaml_frame(ON_TABLE)}\n")


def base_in_world(slide_mm: np.ndarray) -> tuple[np.ndarray, Rotation]:
    """Origin (n, 3) [m] and turn of the robot's base where the slide stands so (n,)."""
    return BASE.p + 1e-3 * (slide_mm - SLIDE_ZERO)[:, None] * SLIDE, BASE.r


def on_table(point: np.ndarray, turn: Rotation, tilt_deg: np.ndarray, turn_deg: np.ndarray) -> tuple[np.ndarray, Rotation]:
    """A frame of the table's user frame in the world (n), at these angles (n,)."""
    p, r = ON_TABLE.p + ON_TABLE.r.apply(point), ON_TABLE.r * turn
    for axis, through, degrees in ((TURN, TURN_POINT, turn_deg), (TILT, TILT_POINT, tilt_deg)):
        about = Rotation.from_rotvec(np.radians(degrees)[:, None] * axis)
        p, r = through + about.apply(p - through), about * r
    return TABLE.p + TABLE.r.apply(p), TABLE.r * r


@dataclass
class CarriedJob(LineJob):
    """on: "slide", "table" or "both". ends (2, 3): slide [mm], tilt and turn [deg] at the path's ends; in between they go with
    the share of the targets, the two angles not evenly. The part lies where it does in line_job.py at the first target."""

    on: str = "both"
    ends: np.ndarray = field(default_factory=lambda: np.array([[950.0, 12.0, -20.0], [700.0, 4.0, 5.0]]))
    limits: str = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        slide, table = slide_yaml(limits=self.limits.replace("deg", "mm")), table_yaml(limits=self.limits)
        self.units = "mechanical_units:\n" + {"slide": slide, "table": table, "both": slide + table}[self.on]

    @property
    def values(self) -> np.ndarray:
        share = np.linspace(0, 1, len(self.xy))[:, None]
        values = np.zeros((len(share), 6))
        values[:, :3] = self.ends[0] + share**[1.0, 1.3, 0.8] * (self.ends[1] - self.ends[0])
        for number in np.flatnonzero(np.array(self.kinds) == "V"):
            # What a circle point says of them counts for nothing.
            values[number] = values[number - 1] + 0.5 * (values[number + 1] - values[number - 1])
        return np.round(values, 5)

    def external(self, number: int) -> str:
        slide, tilt, turn = (f"{value:.5f}" for value in self.values[number, :3])
        used = {"slide": [slide, UNUSED, UNUSED], "table": [UNUSED, tilt, turn], "both": [slide, tilt, turn]}[self.on]
        return "[" + ",".join(used + [UNUSED] * 3) + "]"

    @cached_property
    def on_unit(self) -> Frame:
        """The work object in the table's user frame, so that it lies at kit's place at the first target."""
        first = self.values[:1]
        origin, turn = on_table(np.zeros(3), Rotation.identity(), first[:, 1], first[:, 2])
        return Frame(origin[0], turn[0]).inv() @ self.in_world

    @cached_property
    def in_world(self) -> Frame:
        """Where the work object is at the first target: as line_job.py has it, seen from the robot."""
        origin, turn = self._base(self.values[:1])
        return Frame(origin[0], turn) @ kit.work_object()

    def _base(self, values: np.ndarray) -> tuple[np.ndarray, Rotation]:
        return base_in_world(values[:, 0] if self.on != "table" else np.full(len(values), SLIDE_ZERO))

    @property
    def data(self) -> list[str]:
        none = Frame(np.zeros(3), Rotation.identity())
        if self.on == "slide":
            return [kit.tooldata(), kit.wobjdata(user=self.in_world, obj=none)]
        return [kit.tooldata(), kit.wobjdata(user=none, obj=self.on_unit, fixed="FALSE", unit="STN1")]

    def stands(self, external: np.ndarray) -> tuple[np.ndarray, Rotation]:
        origin, turn = self._base(external)
        if self.on == "slide":
            p, r = np.tile(self.in_world.p, (len(external), 1)), Rotation.concatenate([self.in_world.r] * len(external))
        else:
            p, r = on_table(self.on_unit.p, self.on_unit.r, external[:, 1], external[:, 2])
        return turn.inv().apply(p - origin), turn.inv() * r

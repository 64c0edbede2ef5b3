"""A path under a known force, on one of several robots: programs and logs of it in every form, and how far the corrected
program would take the loaded tool off the planned curve, measured across it every half millimetre.
tests/virtual_cell/controller.py drives it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from tests.runs.command_line import user_files as kit
from tests.runs.command_line.user_files import START, TOOL, Frame, K
from tests.virtual_cell import controller
from tests.virtual_cell.arm import ARMS, Arm
from tests.virtual_cell.controller import Driven, Leg

FEED_MM_S, STEP_MM = 50.0, 0.5
# What the tool meets: nothing, then a force that rises over RAMP_MM, varies, and falls again.
RAMP_MM, WAVE_MM = 12.0, 25.0
TURN_DEG = np.array([2.0, -3.0, 4.0])       # of the tool, along the whole path

AIR_MM_S = 200.0
# Points of paths in a plane of the work object [mm], and how each is reached; "V" the circle point of the arc to the next, "A"
# a MoveL in the air.
LINES = "J 0,0 L 60,0 L 120,0 L 120,40"
ARCS = "J 0,0 L 10,0 V 40,30 C 10,60 L 0,60 V -30,90 C 0,120 L 20,120"
SHORT = "J 0,0 " + " ".join(f"L {3 * i:g},{8 * np.sin(i / 9):.3f}" for i in range(1, 46))
DENSE = "J 0,0 " + " ".join(f"L {i:g},{8 * np.sin(i / 27):.3f}" for i in range(1, 136))


@dataclass
class LineJob:
    """One path on one robot. force(s) (n, 3) [N], base frame, at path lengths [mm]."""

    folder: Path
    path: str = LINES
    robot: str = "irb6660-205-1.90"
    zone: str = "z1"
    feed: str = "v50"
    force_of: Callable[[LineJob, np.ndarray], np.ndarray] | None = None
    noise_n: float = 0.0
    text: str = ""      # a program of the same path, written elsewhere
    units: str = ""     # mechanical_units of cell.yaml

    def __post_init__(self) -> None:
        words = self.path.split()
        self.kinds = words[0::2]
        self.xy = np.array([[float(value) for value in word.split(",")] for word in words[1::2]])
        self.folder.mkdir(exist_ok=True)

    @property
    def arm(self) -> Arm:
        return ARMS[self.robot]

    @cached_property
    def origin(self) -> Frame:
        p, r = kit.point(self.arm, START, TOOL.p)
        return kit.work_object().inv() @ Frame(p, Rotation.from_matrix(r) * TOOL.r)

    @cached_property
    def poses(self) -> list[Frame]:
        """The targets in the work object; the tool turns evenly with their number."""
        share = np.linspace(0, 1, len(self.xy))
        return [Frame(self.origin.p + self.origin.r.apply([*point / 1e3, 0.0]),
                      Rotation.from_rotvec(np.radians(TURN_DEG) * part) * self.origin.r)
                for point, part in zip(self.xy, share, strict=True)]

    @cached_property
    def program(self) -> str:
        if self.text:
            return self.text
        angles = self.angles(np.array([1e3 * pose.p for pose in self.poses]), Rotation.concatenate([p.r for p in self.poses]),
                             self.values)
        texts = [kit.robtarget(pose, kit.confdata(q), self.external(number), 8)
                 for number, (pose, q) in enumerate(zip(self.poses, angles, strict=True))]
        moves, index = [], 0
        while index < len(texts):
            air = self.kinds[index] == "A"
            tail = rf"{'v200' if air else self.feed},{self.zone},tMill\WObj:=wPart;"
            if air:
                moves.append(f"    MoveL {texts[index]},{tail}")
            elif self.kinds[index] == "V":
                moves.append(f"    MoveC {texts[index]},{texts[index + 1]},{tail}")
                index += 1
            else:
                moves.append(f"    Move{self.kinds[index]} {texts[index]},{tail}")
            index += 1
        return kit.module(moves, self.data)

    @property
    def data(self) -> list[str]:
        """Declarations of tool and work object."""
        return [kit.tooldata(), kit.wobjdata()]

    @property
    def values(self) -> np.ndarray:
        """External axes (N, 6) [mm or deg] at the targets."""
        return np.zeros((len(self.xy), 6))

    def external(self, number: int) -> str:
        """What a target says of them."""
        return kit.E

    def stands(self, external: np.ndarray) -> tuple[np.ndarray, Rotation]:
        """base_from_object, origin (n, 3) [m] and turn, where the external axes stand so (n, 6)."""
        base = kit.work_object()
        return np.tile(base.p, (len(external), 1)), Rotation.concatenate([base.r] * len(external))

    @cached_property
    def planned(self) -> list[Leg]:
        return controller.legs_of(self.program)

    @cached_property
    def length(self) -> float:
        return sum(leg.length for leg in self.planned)

    def force(self, s: np.ndarray) -> np.ndarray:
        if self.force_of is not None:
            return self.force_of(self, s)
        risen = np.clip((np.minimum(s, self.length - s) - 10) / RAMP_MM, 0, 1)
        size = 0.5 - 0.5 * np.cos(np.pi * risen)
        return np.asarray(size[:, None] * np.column_stack([50 + 0 * s, 150 + 100 * np.sin(s / WAVE_MM), -80 + 0 * s]))

    def angles(self, position_mm: np.ndarray, turn: Rotation, external: np.ndarray) -> np.ndarray:
        """Joint angles (n, 6) [rad] at poses in the work object."""
        origin, turned = self.stands(external)
        flange_turn = turned * turn * TOOL.r.inv()
        return controller.solve(self.arm, origin + turned.apply(position_mm / 1e3) - flange_turn.apply(TOOL.p), flange_turn,
                                START)

    def samples(self, step: float = 0.1) -> tuple[np.ndarray, Driven, np.ndarray]:
        """Path lengths (n,) [mm], the planned way there, and the force (n, 3) as it is logged."""
        ways = [controller.drive([leg], step, zones=False) for leg in self.planned]
        ends = np.cumsum([0.0, *(leg.length for leg in self.planned)])
        s = np.concatenate([a + np.linspace(0, b - a, len(way.position)) for way, a, b in
                            zip(ways, ends[:-1], ends[1:], strict=True)])
        way = Driven(np.concatenate([one.position for one in ways]), Rotation.concatenate([one.turn for one in ways]),
                     np.concatenate([one.external for one in ways]))
        noise = self.noise_n * np.random.default_rng(1).standard_normal((len(s), 3))
        return s, way, self.force(s) + noise

    @cached_property
    def target_lengths(self) -> np.ndarray:
        """Path length (N,) [mm] at each target."""
        lengths = [0.0]
        for leg in self.planned:
            if len(leg.points) == 3:
                half = Leg(leg.points, leg.turn, 0.0)
                centre, axis, _ = half.circle
                a, b = leg.points[0] - centre, leg.points[1] - centre
                angle = np.mod(np.arctan2(axis @ np.cross(a, b), a @ b), 2 * np.pi)
                lengths.append(lengths[-1] + angle * np.linalg.norm(a))
                lengths.append(lengths[-2] + leg.length)
            else:
                lengths.append(lengths[-1] + leg.length)
        return np.array(lengths)

    def log(self, by: str, step: float = 0.1) -> str:
        """The log of the planned pass: by target | path_mm | position | joints | time."""
        s, way, force = self.samples(step)
        columns: dict[str, np.ndarray]
        if by == "target":
            s = self.target_lengths
            columns, force = {"target": np.arange(len(s))}, self.force(s)
        elif by == "path_mm":
            columns = {"path_mm": s}
        elif by == "position":
            columns = dict(zip(("x_mm", "y_mm", "z_mm"), way.position.T, strict=True))
        elif by == "joints":
            degrees = np.degrees(self.angles(way.position, way.turn, way.external))
            columns = {f"q{i + 1}_deg": degrees[:, i] for i in range(6)}
        else:
            # The logger runs before the program and after it.
            still = np.arange(0, 4, 0.01)
            feed = np.where(np.array(self.kinds[1:]) == "A", AIR_MM_S, FEED_MM_S)
            at = np.interp(s, self.target_lengths, np.append(0.0, np.cumsum(np.diff(self.target_lengths) / feed)))
            columns = {"time_s": np.concatenate([still, 4 + at, 4 + at[-1] + still])}
            force = np.concatenate([np.zeros((len(still), 3)), force, np.zeros((len(still), 3))])
        rows = np.column_stack([*columns.values(), force])
        return ",".join([*columns, "fx_n", "fy_n", "fz_n"]) + "\n" + "".join(
            ",".join(f"{value:.7f}" for value in row) + "\n" for row in rows)

    @property
    def air(self) -> np.ndarray:
        """Path lengths (n, 2) [mm] between which the tool is in the air."""
        ends = np.column_stack([self.target_lengths[:-1], self.target_lengths[1:]])
        return np.asarray(ends[np.array(self.kinds[1:]) == "A"])

    def job(self, log: str) -> kit.Job:
        springs = "drive" if self.arm.parallel_rod else "serial"
        return kit.Job(self.folder, cell=kit.cell_text(self.robot, extra=self.units), program=self.program,
                       stiffness=kit.stiffness_text(robot=self.robot, load_path=springs), forces=log)

    def off_um(self, rapid: str) -> np.ndarray:
        """How far the loaded tool is off the planned curve (n,) [um], every half millimetre of the driven program. The force is
        that of the place where the loaded tool stands."""
        commanded = controller.drive(controller.legs_of(rapid), STEP_MM)
        origin, turned = self.stands(commanded.external)
        sharp = controller.drive(self.planned, 0.05, zones=False).position
        q, stands = self.angles(commanded.position, commanded.turn, commanded.external), commanded.position
        for _ in range(3):
            force = self.force(controller.nearest(stands, sharp)[1])
            rest = controller.loaded(self.arm, q, TOOL.p, force, K)
            stands = 1e3 * turned.inv().apply(rest - origin)
        return np.asarray(1e3 * controller.nearest(stands, controller.drive(self.planned, 0.05).position)[0])

    def where(self, rapid: str) -> np.ndarray:
        commanded = controller.drive(controller.legs_of(rapid), STEP_MM)
        return controller.nearest(commanded.position, controller.drive(self.planned, 0.05, zones=False).position)[1]

    def correct(self, by: str, *options: Any, step: float = 0.1) -> tuple[np.ndarray, dict[str, Any], str]:
        """How far off the corrected program is (n,) [um], the result, and the program."""
        job = self.job(self.log(by, step))
        done = job.correct("--json", "--force", *options)
        assert done.code == 0, done
        text = job.out.read_text()
        return self.off_um(text), done.json, text

"""A sound job on disk, for a robot of tests/virtual_cell: the files of a cell as text, to spoil one of them at a time."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from tests.runs.command_line import user_files as kit
from tests.runs.command_line.user_files import Frame, Run
from tests.virtual_cell.arm import ARMS

TOOL = Frame.mm([110.0, -20.0, 260.0])
USER = Frame.mm([900.0, 50.0, 400.0])
# The first and the last targets are in the air.
TARGETS, AIR = 12, (0, 1, 10, 11)
JOINTS = [f"q{i}_deg" for i in range(1, 7)]
COLUMNS = [*JOINTS, "fx_n", "fy_n", "fz_n", "dx_um", "dy_um", "dz_um"]
BEGINNING = {"irb6660-205-1.90": [12.0, 18, 22, 25, 48, -30], "irb6700-200-2.60": [-15.0, 20, 12, 40, -50, 100]}


@dataclass(frozen=True)
class Workshop:
    """The files by name, sound."""

    robot: str
    files: dict[str, str]

    def run(self, folder: Path, spoilt: dict[str, str | bytes | None], *words: str) -> Run:
        """The command line on these files, some of them spoilt (None: not there). `@name` is the file of that name."""
        for name, content in {**self.files, **spoilt}.items():
            if content is not None:
                (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())
        return kit.run(*(str(folder / word[1:]) if word.startswith("@") else word for word in words), "--json")


@cache
def workshop(robot: str) -> Workshop:
    arm, rod = ARMS[robot], robot == "irb6660-205-1.90"
    first = np.radians(BEGINNING[robot])
    start, q, angles, frames = kit.tcp_pose(arm, first, TOOL), first, [], []
    for i in range(TARGETS):
        at = Frame(start.p + np.array([0.0, 0.004, 0.001]) * i, start.r)
        q = kit.solve(arm, at @ TOOL.inv(), q)
        angles.append(q)
        frames.append(USER.inv() @ at)
    moves = [kit.move(kit.robtarget(frame, kit.confdata(q), digits=4)) for frame, q in zip(frames, angles, strict=True)]
    force = np.array([[0, 0, 0] if i in AIR else [80.0 + 4 * i, -120.0 - 3 * i, -150.0] for i in range(TARGETS)])
    rng = np.random.default_rng(11)
    logged = [(i, frames[i].p * 1e3, force[i] + rng.normal(0, 1.0, 3)) for i in range(TARGETS) for _ in range(5)]
    return Workshop(robot, {
        "cell.yaml": kit.cell_text(robot, TOOL, None, "measurement: {deflection_std_um: [2, 2, 2]}\n"
                                   "force_log: {frame: base, sign: on_tool}\n"),
        "stiffness.json": kit.stiffness_text(robot=robot, load_path="drive" if rod else "serial", tool=None),
        "measurements.csv": _measurements(robot),
        "part.mod": kit.module(moves, [kit.tooldata(TOOL), kit.wobjdata(USER, Frame.mm([0, 0, 0]))]),
        "forces.csv": "target,fx_n,fy_n,fz_n\n" + "".join(f"{i},{_cells(f)}\n" for i, _, f in logged),
        "along.csv": "x_mm,y_mm,z_mm,fx_n,fy_n,fz_n\n" + "".join(f"{_cells(p)},{_cells(f)}\n" for _, p, f in logged),
    })


def _cells(values: np.ndarray) -> str:
    return ",".join(f"{value:.4f}" for value in values)


def _measurements(robot: str) -> str:
    """Ten poses, 250 N both ways along each base axis, with 2 um of noise."""
    arm, rng = ARMS[robot], np.random.default_rng(4)
    low, high = np.array([-60, -20, 0, -90, 20, -90.0]), np.array([60, 40, 50, 90, 90, 90.0])
    rows = []
    for _ in range(10):
        q = np.radians(rng.uniform(low, high))
        for load in 250 * np.concatenate([np.eye(3), -np.eye(3)]):
            moved = 1e6 * kit.deviation(arm, q, TOOL.p, np.r_[load, 0, 0, 0], kit.K) + rng.normal(0, 2, 3)
            rows.append(_cells(np.r_[np.degrees(q), load, moved]))
    return "\n".join([",".join(COLUMNS), *rows]) + "\n"

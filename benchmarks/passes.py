"""Logs of passes beside each other, right, late and turned: how often CS3073 and CS3074 tell, and how often they are wrong.

    python benchmarks/passes.py [--jobs 60] [--seed 0]

Each job is a raster to and fro (linked in the cut or lifted between), a raster one way, or a rectangular spiral outwards,
turned by any angle, with air at the cutting feed of unequal length before and behind the cuts. The forces are those of the
virtual cell's end mill on the width that each pass has, with teeth, coefficients (edge and radial parts by a factor of two),
width, depth and feed drawn, and 30 % more or less of it along the way. The arm does not yield.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections import Counter, defaultdict
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np
import pyarrow
import pyarrow.parquet

from compensator.forces.placement import place_forces, read_force_log
from compensator.path.robot_path import RobotPath, robot_path
from compensator.rapid import read_rapid
from identification.common.arrays import Array
from identification.model.cell import read_cell
from tests.virtual_cell.endmill import EndMill

RATE, NOISE_N, NOISE_MM = 250.0, 2.0, 0.02
AIR_MM_S, SAFE_MM = 250.0, 12.0
NONE, RIGHT, LEFT, SLOT = 0, 1, -1, 2       # where the stock is


@dataclass(frozen=True)
class Job:
    """points (N, 3) [mm] with the stock beside the move to each (N,), speed (N,) [mm/s] and width of cut [mm]."""

    kind: str
    points: Array
    stock: Array
    speed: Array
    width_mm: float
    cutter: EndMill
    depth_mm: float

    def force(self) -> Array:
        """Mean force on the tool (N, 3) [N] on the way to each target."""
        step = np.diff(self.points, axis=0, prepend=self.points[:1])
        step /= np.maximum(np.linalg.norm(step, axis=1), 1e-9)[:, None]
        force = np.zeros_like(step)
        for stock in (RIGHT, LEFT, SLOT):
            side = self.cutter.rim_mm[:, 1] * (-1 if stock == LEFT else 1)
            width = 2 * self.cutter.radius_mm if stock == SLOT else self.width_mm
            along, left, up = self.cutter.mean_force(
                self.cutter.coverage(width - self.cutter.radius_mm - side), self.depth_mm)
            here, ahead = self.stock == stock, step[self.stock == stock]
            force[here] = np.column_stack([along * ahead[:, 0] - left * ahead[:, 1], along * ahead[:, 1] + left * ahead[:, 0],
                                           np.full(len(ahead), up)])
        return force


def drawn(rng: np.random.Generator) -> Job:
    """A job."""
    kind = str(rng.choice(["to and fro, linked", "to and fro, lifted", "one way, climb", "one way, conventional",
                           "spiral, climb", "spiral, conventional"]))
    width, feed = float(rng.uniform(0.4, 11)), float(rng.uniform(15, 80))
    points, stock, fast = (_spiral if "spiral" in kind else _raster)(rng, kind, width)
    turn = rng.uniform(0, 2 * np.pi)
    points[:, :2] = points[:, :2] @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    teeth = int(rng.integers(1, 5))
    cutter = EndMill(teeth=teeth, runout_mm=teeth * (0.0,), feed_mm_s=feed,
                     shear_n_mm2=tuple(np.array(EndMill.shear_n_mm2) * [1, rng.uniform(0.5, 2), 1]),
                     edge_n_mm=tuple(np.array(EndMill.edge_n_mm) * rng.uniform(0.5, 2, 3)))
    one_feed = rng.random() < 0.2
    return Job(kind, points, stock, np.where(fast & (not one_feed), AIR_MM_S, feed), width, cutter, float(rng.uniform(0.5, 4)))


def _raster(rng: np.random.Generator, kind: str, width: float) -> tuple[Array, Array, Array]:
    length, rows, spacing = rng.uniform(40, 120), int(rng.integers(4, 12)), rng.uniform(2, 6)
    before, behind = rng.uniform(0, 15, 2)
    towards = 1 if rng.random() < 0.5 else -1               # the side to which the passes go
    parts = []
    for row in range(rows):
        ahead = -1 if "fro" in kind and row % 2 else 1
        if "one way" in kind:
            ahead = -towards if "climb" in kind else towards
        y, side = row * towards * width, LEFT if ahead * towards > 0 else RIGHT
        x = ahead * np.linspace(-length / 2, length / 2, max(int(length / spacing), 2))
        if "linked" in kind and row:
            parts.append((x[:1], y, 0.0, SLOT if width > 2 else side, False))
        else:
            parts += [(x[:1] - ahead * before, y, SAFE_MM, NONE, True), (x[:1] - ahead * before, y, 0.0, NONE, False),
                      (x[:1], y, 0.0, NONE, False)]
        parts.append((x[1:], y, 0.0, side if row else (SLOT, side)[int(rng.integers(2))], False))
        if "linked" not in kind or row == rows - 1:
            parts += [(x[-1:] + ahead * behind, y, 0.0, NONE, False), (x[-1:] + ahead * behind, y, SAFE_MM, NONE, True)]
    points = np.concatenate([np.column_stack([x, np.full(len(x), y), np.full(len(x), z)]) for x, y, z, _, _ in parts])
    return (points, np.concatenate([np.full(len(part[0]), part[3]) for part in parts]),
            np.concatenate([np.full(len(part[0]), part[4]) for part in parts]))


def _spiral(rng: np.random.Generator, kind: str, width: float) -> tuple[Array, Array, Array]:
    loops, spacing, half = int(rng.integers(3, 8)), rng.uniform(2, 6), rng.uniform(2, 25)
    corners = []
    for loop in range(loops):
        x, y = half + loop * width, 0.6 * half + loop * width
        corners += [(-x, -y), (x, -y), (x, y), (-x, y)]
    # Anticlockwise about the middle the stock, which is outside, is on the right.
    corners = np.array(corners) * [1, -1 if "conventional" in kind else 1]
    points = [corners[:1]]
    for a, b in pairwise(corners):
        count = max(int(np.linalg.norm(b - a) / spacing), 1)
        points.append(a + (b - a) * (np.arange(1, count + 1) / count)[:, None])
    path = np.concatenate(points)
    side = LEFT if "conventional" in kind else RIGHT
    ends = np.array([[*path[0], SAFE_MM], [*path[-1], SAFE_MM]])
    points = np.concatenate([ends[:1], np.column_stack([path, np.zeros(len(path))]), ends[1:]])
    stock = np.concatenate([[NONE, NONE], np.full(len(path) - 1, side), [NONE]])
    fast = np.zeros(len(points), dtype=bool)
    fast[[0, -1]] = True
    return points, stock, fast


CELL = "robot: irb6660-205-1.90\ntool: {position_mm: [120, 0, 250]}\nforce_log: {sign: on_tool}\n"


def written(job: Job, folder: Path, rng: np.random.Generator) -> tuple[RobotPath, Array, Array, Array]:
    """Path of the job's program; time (M,) [s], place (M, 3) [mm] and force (M, 3) [N] of its log."""
    moves = "\n".join(
        f"Move{'J' if i == 0 else 'L'} [[{1100 + x:.4f},{y:.4f},{700 + z:.4f}],[0.02522428,-0.00054983,-0.99944426,0.02178562],"
        f"[-1,-1,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],[{v:.2f},500,5000,1000],fine,tSpindle;"
        for i, ((x, y, z), v) in enumerate(zip(job.points, job.speed, strict=True)))
    (folder / "cell.yaml").write_text(CELL)
    program = read_rapid(f"MODULE M\nPROC main()\n{moves}\nENDPROC\nENDMODULE\n".encode(), "part.mod").toolpath
    step = np.linalg.norm(np.diff(job.points, axis=0), axis=1)
    until = np.append(0.0, np.cumsum(step / (job.speed[1:] * rng.uniform(0.9, 1.05))))
    time = np.arange(0, until[-1], 1 / RATE)
    place = np.column_stack([np.interp(time, until, axis) for axis in job.points.T])
    move = np.clip(np.searchsorted(until, time), 1, len(until) - 1)
    bend = np.interp(time, np.linspace(0, until[-1], 12), rng.uniform(0.7, 1.3, 12))
    force = job.force()[move] * bend[:, None] + rng.normal(0, NOISE_N, (len(time), 3))
    return (robot_path(program, read_cell(folder / "cell.yaml")), time,
            place + np.array([1100.0, 0, 700]) + rng.normal(0, NOISE_MM, place.shape), force)


def said(path: RobotPath, time: Array, place: Array, force: Array, folder: Path) -> dict[str, str]:
    """Codes of the findings on such a log, with their messages."""
    columns = [time, *place.T, *force.T]
    names = ["time_s", "x_mm", "y_mm", "z_mm", "fx_n", "fy_n", "fz_n"]
    pyarrow.parquet.write_table(pyarrow.table(dict(zip(names, columns, strict=True))), folder / "log.parquet")
    log = read_force_log(folder / "log.parquet", path.cell.force_log.form)
    return {finding.code: finding.message for finding in place_forces(log, path, path.cell).findings}


def late(force: Array, seconds: float) -> Array:
    """The force as a sensor gives it whose clock is behind."""
    return np.roll(force, round(seconds * RATE), axis=0)


def turned(force: Array, degrees: float, mirrored: bool = False) -> Array:
    """The force as a sensor gives it that is turned about the vertical, or has one axis the other way round."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.asarray((force * ([1, -1, 1] if mirrored else [1, 1, 1])) @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]))


def main(jobs: int, seed: int) -> None:
    found: dict[str, Counter[str]] = defaultdict(Counter)
    with tempfile.TemporaryDirectory() as name:
        for number in range(jobs):
            rng = np.random.default_rng((seed, number))
            job = drawn(rng)
            path, time, place, force = written(job, Path(name), rng)
            logs = {"right": force, "late 100 ms": late(force, 0.1), "early 100 ms": late(force, -0.1),
                    "late 200 ms": late(force, 0.2), "sign": -force, "turned 90": turned(force, 90),
                    "turned -90": turned(force, -90), "mirrored": turned(force, 0, True)}
            for what, log in logs.items():
                codes = said(path, time, place, log, Path(name))
                told = "+".join(code for code in ("CS3068", "CS3073", "CS3074", "CS3071") if code in codes) or "silent"
                found[what][told] += 1
                if what == "right" and told != "silent":
                    print(number, job.kind, f"{job.width_mm:.1f} mm", *(codes[code] for code in told.split("+")))
    for what, counts in found.items():
        print(f"{what}: {dict(counts)}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--jobs", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    print(f"seed {arguments.seed}")
    main(arguments.jobs, arguments.seed)

"""A load test as a shop does it (third_world.py): poses by hand, loads, instruments, and what is stated of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.third_arm import DEGREE, ROBOTS, Arm, G, Loaded, length, rotation
from benchmarks.third_gears import Array

# Of an IRB 6660 (the paper's Table 1) [N m/rad]; a small robot's are this share of it, and each robot has its own.
STIFFNESS = np.array([2.03e6, 6.02e6, 1.91e6, 0.45e6, 0.22e6, 0.07e6])
SMALL, OWN = 0.4, 0.35
SMALL_ROBOTS = ("irb4400-60", "kr60-ha", "m710ic-50")
# In which of the pendant's angles [deg] somebody would measure.
WORK = {
    "ABB, rod": ((-50, 50), (-20, 45), (-10, 45), (-110, 110), (25, 85), (-150, 150)),
    "ABB": ((-50, 50), (-15, 45), (-25, 25), (-110, 110), (25, 85), (-150, 150)),
    "KUKA": ((-50, 50), (-110, -50), (70, 120), (-110, 110), (25, 85), (-150, 150)),
    "FANUC": ((-50, 50), (-15, 45), (-40, 10), (-110, 110), (-85, -25), (-150, 150)),
}
# The largest force [N] of a rig on a large robot.
FORCE = {"gauges1": 400, "gauges10": 800, "tracker": 600, "weights": 0, "turnbuckle": 1000, "hydraulic": 1500}
KINDS = tuple(FORCE)
# Seconds from pose to pose and from load to load.
TO_A_POSE, TO_A_LOAD = 120, 25


class Diverged(ArithmeticError):
    """A load test that this simulator cannot make."""


@dataclass
class Noise:
    """What is off: a reading, what a visit's seat shares [um]; a force as a share and [N], and for a whole visit its direction
    [deg] and its size (share). step [um]: of the display. All are engineering judgement."""

    sensor: float
    step: float = 1.0
    seat: float = 2.0
    relative: float = 0.004
    absolute: float = 0.5
    turn: float = 0.25
    stretch: float = 0.0
    heavy_tails: bool = False


@dataclass
class Row:
    """A row: the pendant's angles (6,) [deg], the force (3,) [N] as it is written, or the mass [kg] that hangs; what is read
    (3,) [um]."""

    q: Array
    force: Array
    mass: float | None
    visit: int
    time: float
    validate: bool
    reading: list[float] = field(default_factory=list)

    @property
    def loaded(self) -> bool:
        return length(self.force) > 0


# A force that acts, from what acted without this, the row, and the force (3,) that the row before has written.
Pull = Callable[[Array, Row, Array], Array]
# A force (3,) that answers to the tool's frame now, and as it was at the begin of the visit.
Hold = Callable[[Array, Array, Row], Array]
# A reading (3,) [um] from what moved, the tool's frame, the row and the force that acts.
See = Callable[[Array, Array, Row, Array], Array]
# What becomes of the table that is written.
Slip = Callable[[list[Row]], None]
# Hides something of a size in a trial: in words, and the names that are right: effects as diagnosis.json has them, "*" for any
# mistake.
Hide = Callable[["Trial", float], tuple[str, set[str]]]


def into(table: dict[str, Hide]) -> Callable[[Hide], Hide]:
    """Puts what it decorates into a table, by its name."""
    def kept(hide: Hide) -> Hide:
        table[hide.__name__] = hide
        return hide

    return kept


class Trial:
    """A robot, its plan, its instruments, and what is hidden: pulls, holds, sights and slips are asked in their order."""

    def __init__(self, kind: str, seed: int, robot: str | None = None, hung: bool = False) -> None:
        self.rng = rng = np.random.default_rng(seed)
        self.kind, self.hung = kind, hung
        name = robot or list(ROBOTS)[rng.integers(len(ROBOTS))]
        small = name in SMALL_ROBOTS
        self.tool_mm = np.round([rng.choice([80, 120, 160, 200]), rng.choice([0, 0, 60]), rng.choice([180, 250, 350])], 0)
        self.arm = Arm(name, self.tool_mm, hung, SMALL if small else 1.0)
        self.stiffness = STIFFNESS * np.exp(rng.normal(0, OWN, 6)) * (SMALL if small else 1)
        self.robot = Loaded(self.arm, 1 / self.stiffness)
        self.pulls: list[Pull] = []
        self.holds: list[Hold] = []
        self.sights: list[See] = []
        self.slips: list[Slip] = []
        self.beside = np.zeros(3)           # where the load acts beside the TCP, in the tool's axes [m]
        self.track = False                  # whether cell.yaml has a track
        self.seen: dict[str, Any] = {}      # what a visit's instruments remember
        self._plan(small)

    def poses(self, count: int) -> list[Array]:
        """Poses (6,) [deg] within reach of somebody with gauges."""
        key = f"{self.arm.maker}{', rod' if self.arm.rod else ''}"
        found: list[Array] = []
        while len(found) < count:
            q = np.round(np.array([self.rng.uniform(*window) for window in WORK[key]]), 0 if self.whole_degrees else 3)
            x, y, z = self.arm.chain(self.arm.serial(q))[1][:3, 3]
            low = -0.45 if self.arm.maker == "FANUC" else 0.25
            if np.hypot(x, y) > 0.8 and (z > -0.5 if self.hung else low < z < 2.4):
                found.append(q)
        return found

    def _plan(self, small: bool) -> None:
        rng, kind = self.rng, self.kind
        self.whole_degrees = bool(rng.random() < 0.4)
        count = int(rng.integers(8, 21))
        every = bool(rng.random() < 0.4)
        self._instruments()
        kept = 2 if rng.random() < 0.6 else 0
        self.rows: list[Row] = []
        time = 0.0
        for visit, q in enumerate(self.poses(count)):
            time += TO_A_POSE
            axes = (0, 1, 2) if every else (visit % 3,)
            if kind == "weights":
                loads = self._weights(visit, small)
            else:
                top = FORCE[kind] * (0.5 if small else 1.0)
                loads = [(np.round(top * share, 0) * np.eye(3)[axis], None) for axis in axes for share in self._shares(visit)]
            for force, mass in loads:
                time += TO_A_LOAD
                self.rows.append(Row(q, np.array(force, float), mass, visit, time, visit >= count - kept))
        self.visits, self.kept = count, kept

    def _instruments(self) -> None:
        """Noise and what cell.yaml states of it, by the kind of rig."""
        reading, force, relative, seat = 2.0, 0.5, 0.005, 3.0
        if self.kind == "gauges1":
            self.noise = Noise(1.5)
        elif self.kind == "gauges10":
            self.noise, reading, seat = Noise(3.0, 10.0, 3.0), 5.0, 5.0
        elif self.kind == "tracker":
            reading = float(self.rng.choice([5, 8, 10]))
            self.noise, seat = Noise(reading, 0.0, 3.0), 5.0
        elif self.kind == "weights":
            self.noise, relative = Noise(1.5, relative=0.002), 0.002
        elif self.kind == "turnbuckle":
            self.noise, reading, force, relative = Noise(2.0, relative=0.01, absolute=4.0), 3.0, 4.0, 0.01
        else:
            self.noise, reading, force, relative = Noise(2.0, relative=0.008, absolute=8.0), 3.0, 8.0, 0.01
        self.stated = {"deflection_std_um": reading, "force_std_n": force, "pose_offset_std_um": seat,
                       "force_relative_std": relative}

    def _shares(self, visit: int) -> tuple[float, ...]:
        """The loads of a cycle, as shares of the largest."""
        if self.kind in ("gauges1", "gauges10", "tracker"):
            self.rng.random()               # asked for nothing: the figures that were published count it
            return (0, .5, 1, .5, 0, -1, 0) if visit % 2 and self.kind == "tracker" else (0, .33, .67, 1, 0, -.5, -1)
        way = 1 if (visit // 3) % 2 == 0 else -1
        shares = (0, .3, .6, 1.0, .6, 0) if self.kind == "turnbuckle" else (0, .33, .67, 1, .67, .33, 0)
        return tuple(way * share for share in shares)

    def _weights(self, visit: int, small: bool) -> list[tuple[Array, float | None]]:
        """Dead weights, and at every fourth pose a rope over a pulley."""
        low, middle, most = (20, 40, 60) if small else (20, 40, 80)
        loads: list[tuple[Array, float | None]] = [
            (mass * self.arm.down, mass) for mass in (0, low, middle, most, middle, low, 0)]
        if visit % 4 == 1:
            side = np.array([0, 1 if visit % 8 == 1 else -1, 0])
            loads += [(np.round(middle * G * share, 1) * side, None) for share in (0, .5, 1, .5)]
        return loads

    def readings(self, quiet: bool = False, seed: int = 1) -> Array:
        """(n, 3) [um] of the rows; quiet: without noise."""
        rng, of_gears, noise = np.random.default_rng(seed), np.random.default_rng(4242), self.noise
        found, visit = [], None
        for row in self.rows:
            first = row.visit != visit
            if first:
                self.robot.begin(row.q, row.visit, of_gears)
                visit, before, seat, self.seen = row.visit, np.zeros(3), None, {}
                turn = np.zeros(3) if quiet else rng.normal(0, noise.turn, 3) * DEGREE
                stretch = 1 if quiet else 1 + rng.normal(0, noise.stretch)
            force = row.force.copy()
            if not quiet and row.loaded:
                force = (rotation(turn) @ force * stretch if row.mass is None else force) * (1 + rng.normal(0, noise.relative))
                force = force + rng.normal(0, noise.absolute) * row.force / length(row.force)
            for pull in self.pulls:
                force = pull(force, row, before)
            before = row.force.copy()
            tool = self.robot.solve(force, self.beside, row.time)
            if first:
                self.start = tool
            else:
                for hold in self.holds:
                    tool = self._held(tool, force, hold, row)
            read = (tool[:3, 3] - self.start[:3, 3]) * 1e6
            for see in self.sights:
                read = see(read, tool, row, force)
            if not quiet:
                seat = rng.normal(0, noise.seat, 3) if seat is None else seat
                off = rng.standard_t(3, 3) / np.sqrt(3) if noise.heavy_tails else rng.normal(0, 1, 3)
                read = read + seat + noise.sensor * off
                if noise.step:
                    read = np.round(read / noise.step) * noise.step
            found.append(read)
        return np.array(found)

    def _held(self, tool: Array, force: Array, hold: Hold, row: Row) -> Array:
        """The tool's frame where a force answers to it, in six steps. Raises Diverged."""
        ways = []
        for _ in range(6):
            before = tool
            tool = self.robot.solve(force + hold(tool, self.start, row), self.beside, row.time, keep=False)
            ways.append(length(tool[:3, 3] - before[:3, 3]))
        if ways[-1] > ways[0]:
            raise Diverged("what holds the tool is stiffer than the arm")
        return tool

    def written(self, readings: Array) -> list[Row]:
        """The table as it is written, and with it which robot and which tool (3,) [mm] the cell file names."""
        self.named, self.named_tool_mm = self.arm.name, self.tool_mm
        rows = [replace(row, q=row.q.copy(), force=row.force.copy(), reading=[float(x) for x in read])
                for row, read in zip(self.rows, readings, strict=True)]
        for slip in self.slips:
            slip(rows)
        return rows

    def write(self, folder: Path, seed: int) -> None:
        """cell.yaml and measurements.csv."""
        rows = self.written(self.readings(seed=seed))
        weights = any(row.mass is not None for row in rows)
        forces = any(row.mass is None for row in rows)
        timed = self.rng.random() < 0.8
        head = [*(f"q{i}_deg" for i in range(1, 7)), *["mass_kg"] * weights, *["fx_n", "fy_n", "fz_n"] * forces,
                "dx_um", "dy_um", "dz_um", *["time_s", "reference"] * timed, "pose", "purpose"]
        lines = [",".join(head)]
        for row in rows:
            cells = [f"{angle:.10g}" for angle in row.q]
            if weights:
                cells.append("" if row.mass is None else f"{row.mass:.10g}")
            if forces:
                cells += [f"{part:.10g}" for part in row.force] if row.mass is None else [""] * 3
            cells += [f"{part:.1f}" for part in row.reading]
            if timed:
                cells += [f"{row.time:.0f}", f"R{row.visit + 1}"]
            lines.append(",".join([*cells, f"P{row.visit + 1}", "validate" if row.validate else "identify"]))
        (folder / "measurements.csv").write_text("\n".join([*lines, ""]))
        (folder / "cell.yaml").write_text("\n".join([*self._cell(), ""]))

    def _cell(self) -> list[str]:
        lines = [f"robot: {self.named}", "tool:", f"  position_mm: {[float(part) for part in self.named_tool_mm]}",
                 "  quaternion: [1, 0, 0, 0]"]
        if self.hung:
            lines += ["base_frame:", "  position_mm: [0, 0, 3000]", "  quaternion: [0, 1, 0, 0]"]
        if self.track:
            lines += ["mechanical_units:", "  - name: TRACK_1", "    carries: robot", "    axes:",
                      "      - {eax: a, kind: linear, direction: [0, 1, 0], speed_mm_s: 1500, acceleration_mm_s2: 1500}"]
        if self.stated:
            lines.append("measurement:")
        for key, value in self.stated.items():
            lines.append(f"  {key}: " + (f"{value:g}" if key == "force_relative_std" else f"[{value:g}, {value:g}, {value:g}]"))
        return lines

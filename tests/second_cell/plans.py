"""Load tests as they are carried out: which poses, which loads in which order, at what time. All of it is this cell's own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tests.second_cell.robots import Robot

CYCLE_N = (130.0, 260.0, 390.0, 200.0, 0.0, -190.0, -380.0, -90.0)     # up, down, through zero, the other side


SHORT_N = (150.0, 300.0, 150.0, 0.0, -150.0, -300.0, -150.0)           # one cycle, as a short commissioning takes it


@dataclass(frozen=True)
class Plan:
    """Rows in the order taken: q (n, 6) [rad], load (n, 3) [N] as reported, time (n,) and dwell (n,) [s], visit (n,) from 0;
    gauges (n, 3): which components are read, None for all. Every visit has the same number of rows."""

    q: np.ndarray
    load: np.ndarray
    time: np.ndarray
    dwell: np.ndarray
    visit: np.ndarray
    gauges: np.ndarray | None = None

    @property
    def read(self) -> np.ndarray:
        """Which components are read (n, 3)."""
        return np.ones(self.load.shape, bool) if self.gauges is None else self.gauges

    @property
    def visits(self) -> int:
        return int(self.visit[-1]) + 1


def _plan(poses: np.ndarray, loads: np.ndarray, rng: np.random.Generator, gauges: np.ndarray | None = None) -> Plan:
    """loads (visits, rows, 3) [N]; gauges as loads."""
    visits, rows = loads.shape[:2]
    dwell = np.resize([6.0, 25.0, 12.0], visits * rows)
    gaps = np.tile([rng.uniform(60, 200)] + [4.0] * (rows - 1), visits)
    return Plan(np.repeat(poses, rows, axis=0), np.round(loads.reshape(-1, 3), 1), np.cumsum(gaps + dwell), dwell,
                np.repeat(np.arange(visits), rows), None if gauges is None else gauges.reshape(-1, 3))


def cycles(robot: Robot, tool: np.ndarray, rng: np.random.Generator) -> Plan:
    """Ten poses, a load cycle along each of three axes: 240 rows."""
    cycle = np.concatenate([np.outer(CYCLE_N, axis) for axis in np.eye(3)])
    return _plan(robot.poses(10, tool, rng), np.repeat(cycle[None], 10, axis=0), rng)


def five(robot: Robot, tool: np.ndarray, rng: np.random.Generator) -> Plan:
    """Fourteen poses, five single loads each in random directions, 150 to 350 N: 70 rows."""
    direction = rng.standard_normal((14, 5, 3))
    direction /= np.linalg.norm(direction, axis=2, keepdims=True)
    return _plan(robot.poses(14, tool, rng), rng.uniform(150, 350, (14, 5, 1)) * direction, rng)


def single(robot: Robot, tool: np.ndarray, rng: np.random.Generator) -> Plan:
    """Twenty-four poses with one load each along one axis, 320 N of either sign."""
    axes = np.eye(3)[rng.permutation(24) % 3] * rng.choice([-320.0, 320.0], 24)[:, None]
    return _plan(robot.poses(24, tool, rng), axes[:, None], rng)


def few(robot: Robot, tool: np.ndarray, rng: np.random.Generator) -> Plan:
    """Eight poses, a load cycle along one axis at each: 56 rows."""
    axes = np.eye(3)[rng.permutation(8) % 3]
    return _plan(robot.poses(8, tool, rng), np.einsum("l,va->vla", np.array(SHORT_N), axes), rng)


def shop(robot: Robot, tool: np.ndarray, rng: np.random.Generator) -> Plan:
    """What a shop might do, everything drawn: 5 to 16 poses; 1 to 8 loads at each, up in steps, there and back, through zero
    to the other side, or unlike ones; along one axis a pose, the vertical alone, or any direction; 100 to 450 N at most; three
    gauges, two that stay or, where loads are along an axis, the one that looks along it. 15 to 128 rows."""
    poses, rows = 0, 0
    while not 15 <= poses * rows <= 128:
        poses, rows = int(rng.integers(5, 17)), int(rng.integers(1, 9))
    up = np.arange(1, rows + 1) / rows
    courses = up, np.sin(np.pi * up * rows / (rows + 1)), np.cos(np.pi * (up - up[0])), rng.uniform(-1, 1, rows)
    course = courses[rng.integers(4)].round(2)
    way = rng.choice(["axis", "vertical", "any"], p=[0.5, 0.1, 0.4])
    axes = {"axis": np.eye(3)[rng.permutation(poses) % 3] * rng.choice([-1, 1], poses)[:, None],
            "vertical": np.tile([0.0, 0.0, -1.0], (poses, 1)), "any": rng.standard_normal((poses, 3))}[way]
    direction = np.repeat((axes / np.linalg.norm(axes, axis=1, keepdims=True))[:, None], rows, axis=1)
    loads = rng.uniform(100, 450) / np.max(np.abs(course)) * course[:, None] * direction
    gauges = np.ones(loads.shape, bool)
    which = rng.random()
    if which < 0.2:
        gauges[..., rng.integers(3)] = False
    elif which < 0.4 and way == "axis":
        gauges = np.repeat(np.abs(axes)[:, None] > 0, rows, axis=1)
    return _plan(robot.poses(poses, tool, rng), loads, rng, gauges)


def fresh(robot: Robot, tool: np.ndarray, rng: np.random.Generator, count: int = 30) -> Plan:
    """Poses that no model was fitted to, one load in any direction each."""
    direction = rng.standard_normal((count, 1, 3))
    direction /= np.linalg.norm(direction, axis=2, keepdims=True)
    return _plan(robot.poses(count, tool, rng), rng.uniform(120, 380, (count, 1, 1)) * direction, rng)


PLANS = {"cycles": cycles, "five": five, "single": single, "few": few, "shop": shop}

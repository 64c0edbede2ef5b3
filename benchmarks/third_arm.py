"""The third judge's arm (third_world.py): rigid links on six springs, what hangs on them and what else yields.

Solved at finite motions, at rest, one row after the other. Nothing of the program is imported. Frames by the modified rules of
Denavit and Hartenberg (J. J. Craig, Introduction to Robotics); metres, newtons, radians; a pose is the pendant's angles [deg].
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from benchmarks.third_gears import Array, Law, Rng

DEGREE = np.pi / 180
G = 9.80665
# Steps of the search for the equilibrium, half steps from the ninth on, and its end [rad].
STEPS, WHOLE_STEPS, NEAR = 60, 8, 1e-11
# A part of the structure that yields: force [N] and moment [N m] in its own axes -> its motion [m] and turn [rad].
Yielding = Callable[[Array, Array], tuple[Array, Array]]


class Links(NamedTuple):
    """Lengths [mm] of a robot; rod: its motor 3 drives the forearm through a rod, so that gear 3 bears against the world."""

    maker: str
    d1: float
    a2: float
    a3: float
    a4: float
    d4: float
    d6: float
    rod: bool


ROBOTS = {
    # ros-industrial/abb_experimental, pull request 113, and RobSim
    "irb6660-205-1.90": Links("ABB", 814.5, 300, 700, 280, 893, 200, True),
    # visose/Robots and RobotComponents
    "irb4400-60": Links("ABB", 680, 200, 890, 150, 880, 140, True),
    # visose/Robots and RobotComponents; ros-industrial/abb
    "irb6640-235-2.55": Links("ABB", 780, 320, 1075, 200, 1142.5, 200, False),
    "irb6700-200-2.60": Links("ABB", 780, 320, 1125, 200, 1142.5, 200, False),
    # ros-industrial/kuka_experimental: kuka_kr210_support, kuka_kr60_support
    "kr210-r2700-extra": Links("KUKA", 675, 350, 1150, -41, 1200, 215, False),
    "kr60-ha": Links("KUKA", 815, 350, 850, 145, 820, 170, False),
    # ros-industrial/fanuc: fanuc_r2000ic_support, fanuc_m710ic_support
    "r2000ic-210f": Links("FANUC", 0, 312, 1075, 225, 1280, 215, False),
    "m710ic-50": Links("FANUC", 0, 150, 870, 170, 1016, 175, False),
}
# How a maker counts the angles of a chain: which way, and from where [deg] (the same documents).
SENSE = {"ABB": (1, 1, 1, 1, 1, 1), "KUKA": (-1, 1, 1, -1, 1, -1), "FANUC": (1, 1, -1, -1, -1, -1)}
OFFSET = {"ABB": (0, -90, 0, 0, 0, 180), "KUKA": (0, 0, -90, 0, 0, 180), "FANUC": (0, -90, 0, 0, 0, 0)}
# The share of axis 2's weight that its balancer takes; this and all masses are engineering judgement.
BALANCED = 0.7


def length(vector: Array) -> float:
    return float(np.linalg.norm(vector))


def rotation(vector: Array) -> Array:
    """The turn (3, 3) by a vector [rad]."""
    angle = length(vector)
    cross = np.array([[0, -vector[2], vector[1]], [vector[2], 0, -vector[0]], [-vector[1], vector[0], 0]])
    if angle < 1e-12:
        return np.asarray(np.eye(3) + cross)
    return np.asarray(np.eye(3) + np.sin(angle) / angle * cross + (1 - np.cos(angle)) / angle**2 * cross @ cross)


def frame(turned: Array, at: Array) -> Array:
    """(4, 4) of a turn (3, 3) and a place (3,)."""
    made = np.eye(4)
    made[:3, :3], made[:3, 3] = turned, at
    return made


class Arm:
    """A robot with its tool (3,) [mm]; hung: from a gantry; heavy: what its links weigh against those of a large robot."""

    def __init__(self, name: str, tool_mm: Array, hung: bool = False, heavy: float = 1.0) -> None:
        links = ROBOTS[name]
        self.name, self.maker, self.rod = name, links.maker, links.rod
        self.alpha = np.array([0, -90, 0, -90, 90, -90]) * DEGREE
        self.a = np.array([0, links.a2, links.a3, links.a4, 0, 0]) / 1e3
        self.d = np.array([links.d1, 0, 0, links.d4, 0, links.d6]) / 1e3
        self.tool = frame(np.eye(3), np.array(tool_mm) / 1e3)
        self.sense, self.offset = np.array(SENSE[links.maker]), np.array(OFFSET[links.maker]) * DEGREE
        # Axis 3 of the pendant stands against the horizontal where axis 2 carries the forearm along, and at FANUC.
        self.coupling = np.zeros((6, 6))
        self.coupling[2, 1] = -1 if links.rod or links.maker == "FANUC" else 0
        # What turns the joints of the chain: the gears, of which a rod's turns joint 3 against gear 2.
        self.driven = np.eye(6)
        self.driven[2, 1] = -1 if links.rod else 0
        self.down = np.array([0.0, 0.0, G if hung else -G])
        long = links.a3 / 1000 + links.d4 / 1000
        # Mass [kg] of each link, and where its centre is in the frame of the joint that carries it.
        self.links = [(0, (0, 0, 0)), (220 * long * heavy, (links.a3 / 2e3, 0, 0)), (180 * long * heavy, (0.05, 0.1, 0)),
                      (110 * long * heavy, (0, 0, -links.d4 / 2e3)), (40 * heavy, (0, 0, 0)), (25 * heavy, (0, 0, 0.1))]
        self.tool_mass = 60 * heavy

    def serial(self, q: Array) -> Array:
        """Angles (6,) [rad] of the chain at the pendant's [deg]."""
        angles = np.asarray(q) * DEGREE
        return np.asarray(self.sense * angles + self.offset + self.coupling @ angles)

    def chain(self, theta: Array, moved: dict[int, Array] | None = None) -> tuple[list[Array], Array]:
        """Frames of the joints and of the tool; moved: how the base (0) or what stands behind a joint (1 to 6) has moved."""
        moved = moved or {}
        at, frames = moved.get(0, np.eye(4)), []
        for i in range(6):
            ca, sa, c, s = np.cos(self.alpha[i]), np.sin(self.alpha[i]), np.cos(theta[i]), np.sin(theta[i])
            at = at @ np.array([[c, -s, 0, self.a[i]], [s * ca, c * ca, -sa, -sa * self.d[i]],
                                [s * sa, c * sa, ca, ca * self.d[i]], [0, 0, 0, 1]])
            frames.append(at)
            if i + 1 in moved:
                at = at @ moved[i + 1]
        return frames, at @ self.tool

    def torques(self, frames: list[Array], tool: Array, point: Array, force: Array) -> tuple[Array, Array]:
        """At the gears (6,): of a force at a point, and of the weight."""
        load, weight = np.zeros(6), np.zeros(6)
        centres = [(each @ np.array([*centre, 1]))[:3] for each, (_, centre) in zip(frames, self.links, strict=True)]
        of_tool = tool[:3, 3] * 0.5 + frames[5][:3, 3] * 0.5
        for i, each in enumerate(frames):
            axis, origin = each[:3, 2], each[:3, 3]
            load[i] = axis @ np.cross(point - origin, force)
            for j in range(i, 6):
                weight[i] += axis @ np.cross(centres[j] - origin, self.links[j][0] * self.down)
            weight[i] += axis @ np.cross(of_tool - origin, self.tool_mass * self.down)
        weight[1] *= 1 - BALANCED
        return self.driven.T @ load, self.driven.T @ weight

    def jacobian(self, q: Array) -> Array:
        """How the TCP moves (3, 6) [m/rad] with the gears."""
        frames, tool = self.chain(self.serial(q))
        tcp = tool[:3, 3]
        return np.asarray(np.stack([np.cross(f[:3, 2], tcp - f[:3, 3]) for f in frames], axis=1) @ self.driven)


class Loaded:
    """An arm on springs of a compliance (6,) [rad/(N m)], with laws of gears beside them and structure that yields: at the base
    (0) or behind a joint (1 to 6). cross (6, 6): what the load's torque at one gear does at another."""

    def __init__(self, arm: Arm, compliance: Array) -> None:
        self.arm, self.compliance = arm, np.array(compliance)
        self.laws: list[tuple[int, Law]] = []
        self.structure: list[tuple[int, Yielding]] = []
        self.cross = np.zeros((6, 6))

    def begin(self, q: Array, visit: int, rng: Rng) -> None:
        """A pose is driven to."""
        self.theta = self.arm.serial(q)
        for joint, law in self.laws:
            law.begin((q * np.pi / 180)[joint], self.compliance[joint], visit, rng)
        self.turned: Array = np.zeros(6)
        self.moved: dict[int, Array] = {}

    def solve(self, force: Array, beside: Array, time: float, keep: bool = True) -> Array:
        """The tool's frame (4, 4) under a force [N] beside the TCP (3,) [m], in the tool's axes. keep: gears remember it."""
        for step in range(STEPS):
            frames, tool = self.arm.chain(self.theta + self.arm.driven @ self.turned, self.moved)
            point = (tool @ np.array([*beside, 1]))[:3]
            load, weight = self.arm.torques(frames, tool, point, force)
            turned = self.compliance * (load + weight) + self.cross @ load
            for joint, law in self.laws:
                turned[joint] += law.value(load[joint], weight[joint], time, self.turned[joint])
            moved: dict[int, Array] = {}
            for place, yielding in self.structure:
                own = np.eye(4) if place == 0 else frames[place - 1]
                into = own[:3, :3].T
                motion, turn = yielding(into @ force, into @ np.cross(point - own[:3, 3], force))
                moved[place] = moved.get(place, np.eye(4)) @ frame(rotation(turn), motion)
            change = np.abs(turned - self.turned).max()
            self.turned, self.moved = (turned if step < WHOLE_STEPS else 0.5 * (turned + self.turned)), moved
            if change < NEAR and step > 2:
                break
        if keep:
            for joint, law in self.laws:
                law.keep(load[joint], weight[joint], time, self.turned[joint])
        return self.arm.chain(self.theta + self.arm.driven @ self.turned, self.moved)[1]

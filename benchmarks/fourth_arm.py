"""An arm of its own for fourth_world: joints, flexible parts and a load, brought into equilibrium at finite rotations.

Used by: python benchmarks/fourth_world.py CASES SEED FOLDER
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
GRAVITY = 9.80665


def turn(vector: Array) -> Array:
    """Rotation matrix of a rotation vector (Rodrigues)."""
    angle = float(np.linalg.norm(vector))
    if angle < 1e-15:
        return np.eye(3)
    x, y, z = vector / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross)


def turn_vector(matrix: Array) -> Array:
    """Rotation vector of a small turn."""
    return 0.5 * np.array([matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]])


def frame(position: Array, rotation: Array | None = None) -> Array:
    result = np.eye(4)
    result[:3, :3] = np.eye(3) if rotation is None else rotation
    result[:3, 3] = position
    return result


class GearLaw:
    """How far a gear twists under a torque; by default a spring."""

    memory = False

    def twist(self, torque: float, k: float, q: Array, seconds: float) -> float:
        """Twist [rad]; q: the robot's angles [rad], seconds: how long this load has been on."""
        return torque / k

    def arrive(self, torque: float, k: float, sign: float) -> None:
        """The robot has come to a new pose, turning in the direction of sign."""

    def commit(self, torque: float, k: float, seconds: float) -> None:
        """The load went on to this torque and stayed for so long."""


@dataclass
class Flex:
    """A flexible place behind joint `where` (0: the base): twist of what follows by the wrench about `at`."""

    where: int
    at: Array  # m, in the frame of the link
    law: Callable[[Array, Array], Array]  # force and moment [6] -> shift and turn [6]; second: how the link is turned


@dataclass
class Load:
    """What pulls at the tool, in the base frame."""

    force: Array
    moment: Array = field(default_factory=lambda: np.zeros(3))
    lever: Array = field(default_factory=lambda: np.zeros(3))  # where it acts, from the TCP, in the tool's frame


@dataclass
class State:
    """Where the loaded tool is."""

    place: Array
    rotation: Array
    torques: Array
    axes: Array
    points: Array


@dataclass
class Arm:
    """Joint geometry (modified Denavit-Hartenberg), springs, and the weights of its links."""

    alpha: Array
    a: Array
    d: Array
    offset: Array
    sense: Array
    ratio: tuple[int, int, float] | None  # joint, driven by, ratio
    rod: bool  # springs at the drives
    tool: Array
    k: Array
    masses: Array
    centres: Array

    def theta(self, q: Array) -> Array:
        """Angles of the frames at the controller's angles [rad]."""
        result = self.sense * q + self.offset
        if self.ratio is not None:
            joint, other, ratio = self.ratio
            result[joint] += ratio * q[other]
        return np.asarray(result)

    def spread(self) -> Array:
        """How the frames' angles follow the springs' twists."""
        result = np.eye(6)
        if self.rod and self.ratio is not None:
            result[self.ratio[0], self.ratio[1]] = self.ratio[2]
        return result

    def joint(self, index: int, angle: float) -> Array:
        ca, sa = np.cos(self.alpha[index]), np.sin(self.alpha[index])
        ct, st = np.cos(angle), np.sin(angle)
        d = self.d[index]
        return np.array(
            [[ct, -st, 0, self.a[index]], [st * ca, ct * ca, -sa, -d * sa], [st * sa, ct * sa, ca, d * ca], [0, 0, 0, 1.0]]
        )

    def settle(
        self,
        q: Array,
        load: Load,
        twist: Callable[[int, float], float],
        flexes: list[Flex],
        tip: Callable[[Array], Array] | None = None,
    ) -> State:
        """Equilibrium: springs and flexible parts under the load at the place where the arm has gone to."""
        theta0, spread = self.theta(q), self.spread()
        delta, bends = np.zeros(6), [np.zeros(6) for _ in flexes]
        torques = np.zeros(6)
        last = np.full(3, np.inf)
        for _ in range(60):
            links, ends = self.chain(theta0 + spread @ delta, flexes, bends)
            tool = links[6] @ self.tool if not ends.get(6) else ends[6][-1] @ self.tool
            place = tool[:3, 3]
            if float(np.linalg.norm(place - last)) < 2e-11:
                break
            last = place.copy()
            point = place + tool[:3, :3] @ load.lever
            serial = np.zeros(6)
            for i in range(6):
                f, m = self._beyond(i + 1, links, load, point, links[i + 1][:3, 3])
                serial[i] = links[i + 1][:3, 2] @ m
            torques = spread.T @ serial
            delta = np.array([twist(i, torques[i]) for i in range(6)])
            for n, flex in enumerate(flexes):
                rotation = links[flex.where][:3, :3]
                about = links[flex.where][:3, 3] + rotation @ flex.at
                f, m = self._beyond(flex.where + 1, links, load, point, about)
                bends[n] = flex.law(np.concatenate([rotation.T @ f, rotation.T @ m]), rotation)
        return State(
            place,
            tool[:3, :3],
            torques,
            np.array([links[i + 1][:3, 2] for i in range(6)]),
            np.array([links[i + 1][:3, 3] for i in range(6)]),
        )

    def chain(self, theta: Array, flexes: list[Flex], bends: list[Array]) -> tuple[list[Array], dict[int, list[Array]]]:
        links = [np.eye(4)]
        ends: dict[int, list[Array]] = {}
        at = np.eye(4)
        for i in range(7):
            if i:
                at = at @ self.joint(i - 1, theta[i - 1])
                links.append(at)
            for flex, bend in zip(flexes, bends, strict=True):
                if flex.where == i:
                    at = at @ frame(flex.at + bend[:3], turn(bend[3:])) @ frame(-flex.at)
                    ends.setdefault(i, []).append(at)
        return links, ends

    def _beyond(self, first: int, links: list[Array], load: Load, point: Array, about: Array) -> tuple[Array, Array]:
        """Force and moment about a point of the load and of the links from `first` on."""
        force = load.force.copy()
        moment = load.moment + np.cross(point - about, load.force)
        for j in range(max(first, 1), 7):
            weight = np.array([0, 0, -GRAVITY * self.masses[j - 1]])
            centre = links[j][:3, 3] + links[j][:3, :3] @ self.centres[j - 1]
            force = force + weight
            moment = moment + np.cross(centre - about, weight)
        return force, moment

    def weightless(self) -> Arm:
        return replace(self, masses=np.zeros(6))


def linear_columns(arm: Arm, q: Array, force: Array, moment: Array) -> Array:
    """What a compliance of one at each spring moves the TCP by: 3 x 6, small rotations, for the fit alone."""
    state = arm.weightless().settle(q, Load(np.zeros(3)), lambda i, t: 0.0, [])
    spread = arm.spread()
    moves = np.array([np.cross(state.axes[i], state.place - state.points[i]) for i in range(6)]).T @ spread
    turns = state.axes.T @ spread
    return np.asarray(moves * (moves.T @ force + turns.T @ moment))


def read_arm(robot: dict[str, Any], tool: Array, k: Array, masses: Array) -> Arm:
    """Arm with the lengths of a robot file."""
    joints = robot["joints"]
    coupling = robot.get("coupling")
    ratio = None if coupling is None else (coupling["joint"] - 1, coupling["driven_by"] - 1, float(coupling["ratio"]))

    def column(key: str, scale: float, other: float = 0.0) -> Array:
        return np.array([float(j.get(key, other)) * scale for j in joints])

    lengths = column("a_mm", 1e-3), column("d_mm", 1e-3)
    centres = np.array(
        [[lengths[0][1] / 2, 0, -0.1], [lengths[0][2] / 2, 0, 0.05], [0.05, 0.15, 0], [0, 0, -0.35], [0, 0, 0], [0, 0, -0.05]]
    )
    return Arm(
        column("alpha_deg", np.pi / 180),
        *lengths,
        column("offset_deg", np.pi / 180),
        column("sense", 1.0, 1.0),
        ratio,
        robot.get("load_path") == "drive",
        tool,
        k,
        masses,
        centres,
    )

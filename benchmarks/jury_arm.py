"""A jury's own arm under load: six gears and what else gives way, at the loaded posture. It shares nothing with the program.

A chain of modified Denavit-Hartenberg frames (Craig). A `Gear` turns about the axis of its joint by what its law makes
of the torque, an `Element` moves by a small twist at a place of the chain by what its law makes of the wrench there. Every
reading is a fixed point: forces act on the arm as it stands loaded, and what remembers (play, friction, creep) goes on from row
to row. Metres, radians, newtons and seconds; the lengths of the robots are those of their makers' drawings as remembered.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
FIXED: dict[str, list[Array]] = {}
DOWN = np.array([0.0, 0.0, -9.80665])


@dataclass(frozen=True)
class Robot:
    """Lengths [mm] and the controller's way of counting; `rod`: springs at the drives of a parallel-rod arm."""

    name: str
    maker: str
    d1: float
    a2: float
    a3: float
    a4: float
    d4: float
    d6: float
    sense: tuple[int, ...]
    offset: tuple[float, ...]
    coupled: bool = False
    rod: bool = False
    stiffness: tuple[float, ...] = (2.0e6, 3.5e6, 2.0e6, 0.5e6, 0.3e6, 0.1e6)
    limits: tuple[tuple[float, float], ...] = ((-180, 180),) * 6

    def table(self) -> Array:
        """Alpha, a, d of the six joints, (6, 3) [rad, m, m]."""
        degrees = np.array([0, -90, 0, -90, 90, -90.0])
        a = np.array([0, self.a2, self.a3, self.a4, 0, 0]) / 1000
        d = np.array([self.d1, 0, 0, self.d4, 0, self.d6]) / 1000
        out: Array = np.stack([np.radians(degrees), a, d], axis=1)
        return out

    def fixed(self) -> list[Array]:
        """What stands ahead of each joint's turn, six of (4, 4)."""
        if self.name not in FIXED:
            FIXED[self.name] = [turn(0, alpha) @ shift(a, 0, d) for alpha, a, d in self.table()]
        return FIXED[self.name]

    def axes(self, q_deg: Array) -> Array:
        """Angles of the frames [rad] of the controller's angles [deg], both (6,)."""
        theta = np.array(self.sense) * q_deg + np.array(self.offset)
        if self.coupled:
            theta[2] -= q_deg[1]
        out: Array = np.radians(theta)
        return out

    def controller(self, theta_deg: Array) -> Array:
        """The controller's angles [deg] of the frames' [deg], both (6,)."""
        q = (theta_deg - np.array(self.offset)) * np.array(self.sense)
        if self.coupled:
            q[2] += q[1] * self.sense[2]
        out: Array = q
        return out


ABB, KUKA = (1, 1, 1, 1, 1, 1), (-1, 1, 1, -1, 1, -1)
ROBOTS = (
    Robot("kr210", "KUKA", 675, 350, 1150, -41, 1200, 215, KUKA, (0, 0, -90, 0, 0, 180)),
    Robot("kr500", "KUKA", 1045, 500, 1300, -55, 1025, 290, KUKA, (0, 0, -90, 0, 0, 180),
          stiffness=(4e6, 7e6, 4e6, 1e6, 0.7e6, 0.3e6)),
    Robot("r2000", "FANUC", 0, 312, 1075, 225, 1280, 215, (1, 1, -1, -1, -1, -1), (0, -90, 0, 0, 0, 0), coupled=True),
    Robot("irb6640", "ABB", 780, 320, 1075, 200, 1142.5, 200, ABB, (0, -90, 0, 0, 0, 180)),
    Robot("irb6660", "ABB", 814.5, 300, 700, 280, 893, 200, ABB, (0, -90, 0, 0, 0, 180), coupled=True, rod=True),
    Robot("irb4400", "ABB", 680, 200, 890, 150, 880, 140, ABB, (0, -90, 0, 0, 0, 180), coupled=True, rod=True,
          stiffness=(0.8e6, 1.2e6, 0.8e6, 0.15e6, 0.1e6, 0.04e6)),
    Robot("rx160", "Staubli", 550, 150, 825, 0, 625, 110, ABB, (0, -90, -90, 0, 0, 0),
          stiffness=(0.5e6, 0.7e6, 0.4e6, 0.09e6, 0.06e6, 0.03e6)),
    Robot("nj220", "Comau", 830, 400, 1175, 250, 1125, 230, ABB, (0, -90, 0, 0, 0, 180)),
)  # fmt: skip


def cross(a: Array, b: Array) -> Array:
    """The vector product of two, (3,); numpy's is slow for single ones."""
    x, y, z = a
    u, v, w = b
    return np.array([y * w - z * v, z * u - x * w, x * v - y * u])


def turn(axis: int, angle: float) -> Array:
    """A rotation about one of the axes x, y, z, (4, 4)."""
    c, s = math.cos(angle), math.sin(angle)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    out = np.eye(4)
    out[i, i], out[j, j], out[i, j], out[j, i] = c, c, -s, s
    return out


def shift(x: float, y: float, z: float) -> Array:
    """A translation, (4, 4)."""
    out = np.eye(4)
    out[:3, 3] = x, y, z
    return out


def rotation(vector: Array) -> Array:
    """The rotation about a vector by its length, (3, 3): Rodrigues."""
    angle = float(np.sqrt(vector @ vector))
    if angle < 1e-15:
        return np.eye(3)
    x, y, z = vector / angle
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    out: Array = np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k
    return out


def twist(motion: Array) -> Array:
    """A small motion (shift, turn), (6,), as a transform."""
    out = np.eye(4)
    out[:3, :3], out[:3, 3] = rotation(motion[3:]), motion[:3]
    return out


@dataclass
class Row:
    """One reading: controller's angles [deg], force that truly acts [N], time and the time the load has been on [s]."""

    q: Array
    theta: Array
    force: Array
    time: float
    since: float
    dwell: float
    span: float


class Gear:
    """A linear spring; laws that differ override `twist`, those that remember `settle` and `forget` too."""

    def __init__(self, compliance: float) -> None:
        self.compliance = compliance

    def twist(self, torque: float, row: Row) -> float:
        """The gear's angle [rad] under a torque [N m]."""
        return self.compliance * torque

    def settle(self, torque: float, row: Row) -> None:
        """Go on from here."""

    def forget(self, torque: float) -> None:
        """A new pose was driven to; it stands under this torque [N m]."""


@dataclass
class Element:
    """What gives way at a place of the chain: 0 the floor, 1 ... 6 a joint (`ahead`: before it turns), 7 the TCP."""

    place: int
    law: Callable[[Array, Row], Array]  # wrench (force, moment) in the place's axes -> motion (shift, turn), both (6,)
    ahead: bool = False


@dataclass
class Arm:
    """A robot with its springs, what else gives way, what hangs on it."""

    robot: Robot
    gears: list[Gear]
    tool: Array
    elements: list[Element] = field(default_factory=list)
    masses: list[tuple[int, Array, float]] = field(default_factory=list)  # carried by frame, at [m], [kg]
    beside_tool: Array = field(default_factory=lambda: np.zeros(3))  # where the force acts beside the TCP [m]
    beside_base: Array = field(default_factory=lambda: np.zeros(3))
    fine: bool = True
    coupling: tuple[int, int, float] | None = None  # torque of one joint turns the other [rad/(N m)]

    def chain(self, row: Row, delta: Array, motions: list[Array]) -> tuple[list[Array], list[Array], Array]:
        """Frames of the six joints, places of the elements and the TCP's frame."""
        robot = self.robot
        angles = row.theta + delta
        fixed = robot.fixed()
        at: list[Array] = [np.eye(4)] * len(self.elements)
        t = np.eye(4)

        def give(t: Array, place: int, ahead: bool) -> Array:
            for n, element in enumerate(self.elements):
                if element.place == place and element.ahead == ahead:
                    at[n] = t
                    t = t @ twist(motions[n])
            return t

        t = give(t, 0, False)
        frames = []
        for i in range(6):
            t = t @ fixed[i]
            t = give(t, i + 1, True)
            t = t @ turn(2, angles[i])
            frames.append(t)
            t = give(t, i + 1, False)
        t = t @ shift(*self.tool)
        return frames, at, give(t, 7, False)

    def solve(self, row: Row) -> tuple[Array, Array]:
        """TCP's frame under the row's force (4, 4), and the torques of the gears (6,)."""
        sense = np.array(self.robot.sense, dtype=float)
        drive = self.robot.rod
        delta, motions = np.zeros(6), [np.zeros(6) for _ in self.elements]
        torque = np.zeros(6)
        for _ in range(3 if self.fine else 1):
            frames, at, tcp = self.chain(row, delta, motions)
            p = tcp[:3, 3] + tcp[:3, :3] @ self.beside_tool + self.beside_base
            torque = np.zeros(6)
            weights = [(k, (frames[k - 1] @ np.append(r, 1))[:3], m * DOWN) for k, r, m in self.masses]
            for i, f in enumerate(frames):
                moment = cross(p - f[:3, 3], row.force)
                for k, c, w in weights:
                    if k >= i + 1:
                        moment = moment + cross(c - f[:3, 3], w)
                torque[i] = f[:3, 2] @ moment
            if drive:
                own = sense * torque
                own[1] -= torque[2]
                torque = own
            turned = np.array([g.twist(t, row) for g, t in zip(self.gears, torque, strict=True)])
            if self.coupling:
                i, j, c = self.coupling
                turned[i] += c * torque[j]
                turned[j] += c * torque[i]
            delta = turned.copy()
            if drive:
                delta = sense * turned
                delta[2] -= turned[1]
            for n, element in enumerate(self.elements):
                r = at[n][:3, :3].T
                wrench = np.concatenate([r @ row.force, r @ cross(p - at[n][:3, 3], row.force)])
                motions[n] = element.law(wrench, row)
        _, _, tcp = self.chain(row, delta, motions)
        return tcp, torque

    def settle(self, torque: Array, row: Row) -> None:
        """What remembers goes on from this row."""
        for g, t in zip(self.gears, torque, strict=True):
            g.settle(float(t), row)

    def still(self, row: Row) -> tuple[Array, Array]:
        """The pose as it was driven to, without a load: TCP's frame and torques; what remembers begins anew."""
        idle = Row(row.q, row.theta, np.zeros(3), row.since, row.since, 0.0, row.span)
        for g in self.gears:
            g.forget(0.0)
        _, torque = self.solve(idle)
        for g, t in zip(self.gears, torque, strict=True):
            g.forget(float(t))
        return self.solve(idle)


class Shaped(Gear):
    """Compliance times a function [N m] of the torque and the row: play, soft zones, angle, time."""

    def __init__(self, compliance: float, shape: Callable[[float, Row], float]) -> None:
        super().__init__(compliance)
        self.shape = shape

    def twist(self, torque: float, row: Row) -> float:
        return self.compliance * self.shape(torque, row)


class HeldPlay(Gear):
    """Play that friction holds: the gap is crossed when the torque exceeds the friction."""

    def __init__(self, compliance: float, half: float, friction: float) -> None:
        super().__init__(compliance)
        self.half, self.friction, self.at = half, friction, 0.0

    def place(self, torque: float) -> float:
        if abs(torque) < self.friction:
            return self.at
        return math.copysign(self.half, torque)

    def twist(self, torque: float, row: Row) -> float:
        return self.compliance * torque + self.place(torque)

    def settle(self, torque: float, row: Row) -> None:
        self.at = self.place(torque)

    def forget(self, torque: float) -> None:
        self.at = self.half * np.sign(torque) if abs(torque) > self.friction else 0.0


class Rubbing(Gear):
    """A spring with dry friction beside it: `steep` times as stiff until `friction` N m are passed; Dahl's law if smooth."""

    def __init__(self, compliance: float, steep: float, friction: float, smooth: bool = False) -> None:
        super().__init__(compliance)
        self.k, self.friction, self.smooth = steep / compliance, friction, smooth
        self.angle = self.held = 0.0

    def held_at(self, angle: float) -> float:
        way = angle - self.angle
        if not self.smooth:
            return float(np.clip(self.held + self.k * way, -self.friction, self.friction))
        end = self.friction * np.sign(way)
        return float(end - (end - self.held) * np.exp(-self.k * abs(way) / self.friction))

    def twist(self, torque: float, row: Row) -> float:
        low, high = sorted((self.compliance * (torque - self.friction), self.compliance * (torque + self.friction)))
        for _ in range(50):
            mid = 0.5 * (low + high)
            low, high = (mid, high) if mid / self.compliance + self.held_at(mid) < torque else (low, mid)
        return 0.5 * (low + high)

    def settle(self, torque: float, row: Row) -> None:
        angle = self.twist(torque, row)
        self.held = self.held_at(angle)
        self.angle = angle

    def forget(self, torque: float) -> None:
        self.angle, self.held = self.compliance * torque, 0.0


class Creep(Gear):
    """A share of the spring that comes late: Kelvin and Voigt."""

    def __init__(self, compliance: float, share: float, tau: float) -> None:
        super().__init__(compliance)
        self.share, self.tau = share, tau
        self.late = self.torque = self.time = 0.0

    def late_at(self, torque: float, row: Row) -> float:
        switched = row.time - row.dwell
        late = self.late
        for load, span in ((self.torque, max(switched - self.time, 0.0)), (torque, min(row.dwell, row.time - self.time))):
            goal = self.share * self.compliance * load
            late = goal + (late - goal) * np.exp(-span / self.tau)
        return float(late)

    def twist(self, torque: float, row: Row) -> float:
        return self.compliance * torque + self.late_at(torque, row)

    def settle(self, torque: float, row: Row) -> None:
        self.late, self.torque, self.time = self.late_at(torque, row), torque, row.time

    def forget(self, torque: float) -> None:
        self.late, self.torque, self.time = self.share * self.compliance * torque, torque, 0.0


class Slip(Gear):
    """A brake or clutch that slips beyond a torque and stays."""

    def __init__(self, compliance: float, breakaway: float, per: float) -> None:
        super().__init__(compliance)
        self.breakaway, self.per, self.up, self.down = breakaway, per, 0.0, 0.0

    def slipped(self, torque: float) -> tuple[float, float]:
        over = self.per * self.compliance
        return max(self.up, over * (torque - self.breakaway)), max(self.down, over * (-torque - self.breakaway))

    def twist(self, torque: float, row: Row) -> float:
        up, down = self.slipped(torque)
        return self.compliance * torque + up - down

    def settle(self, torque: float, row: Row) -> None:
        self.up, self.down = self.slipped(torque)

    def forget(self, torque: float) -> None:
        self.up = self.down = 0.0


def linear(matrix: Array) -> Callable[[Array, Row], Array]:
    """A structure that yields in proportion, (6, 6)."""
    return lambda wrench, row: matrix @ wrench


def diagonal(*values: float) -> Callable[[Array, Row], Array]:
    return linear(np.diag(values))


def beam(along: int, length: float, ei: float) -> Callable[[Array, Row], Array]:
    """The tip of a beam of bending stiffness ei [N m^2], with its torsion at 0.8 of it, both ways alike."""
    c = np.zeros((6, 6))
    y, z = (along + 1) % 3, (along + 2) % 3
    c[y, y] = c[z, z] = length**3 / 3 / ei
    c[3 + y, 3 + y] = c[3 + z, 3 + z] = length / ei
    c[3 + along, 3 + along] = length / (0.8 * ei)
    c[y, 3 + z] = c[3 + z, y] = length**2 / 2 / ei
    c[z, 3 + y] = c[3 + y, z] = -(length**2) / 2 / ei
    return linear(c)

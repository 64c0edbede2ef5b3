"""The arm under load: the robot's six hinges with a spring at each drive, and whatever else an effect lets yield.

Effects add elements to the chain (beam segments, bearings, feet, struts), each with its elastic coordinates, and laws to
coordinates. A law is a force over one coordinate, energy or friction; laws with a memory are carried along the load path, the
load going straight from row to row of a visit.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from tests.second_cell.plans import Plan
from tests.second_cell.rest import Load, at_rest
from tests.second_cell.robots import Robot, X

G = np.array([0.0, 0.0, -9.81])
SUBSTEPS = 2        # of the way from row to row, for laws with a memory


@dataclass(frozen=True)
class Rows:
    """Rows that come to rest together: q (n, 6) [rad]; time, dwell (n,) [s]; visit (n,)."""

    q: np.ndarray
    time: np.ndarray
    dwell: np.ndarray
    visit: np.ndarray


class Law:
    """Torque (n,) and slope (n,) over one elastic coordinate x (n,), beside its linear spring."""

    memory = False

    def __init__(self, at: int) -> None:
        self.at = at

    def pull(self, x: np.ndarray, rows: Rows) -> tuple[np.ndarray, np.ndarray]:
        raise NotImplementedError

    def reset(self) -> None:
        """Nothing is remembered."""

    def begin(self, x: np.ndarray, rows: Rows) -> None:
        """The visits begin, at rest without load in x."""

    def settle(self, x: np.ndarray, rows: Rows) -> None:
        """The visits have come to rest in x."""


@dataclass
class Element:
    """One screw of the chain: `place` orders it (0 floor, i joint i, 7 the TCP); drive (6,): how the drives move it."""

    place: float
    screw: np.ndarray
    drive: np.ndarray
    gives: dict[int, float]


@dataclass
class Arm:
    """tool: the TCP in the flange frame [m]; stiffness (6,) [N m/rad] of the drives. masses: kg at a home point behind a place.
    load_point (3,) [m]: where the load really acts, off the TCP, in the flange frame's home axes. fall (3,) [m/s^2]:
    gravity in the base frame. spindle (3,): its axis, the TCP's z, at home."""

    robot: Robot
    tool: np.ndarray
    stiffness: np.ndarray
    elements: list[Element] = field(default_factory=list)
    springs: np.ndarray = field(default_factory=lambda: np.empty((0, 0)))
    laws: list[Law] = field(default_factory=list)
    masses: list[tuple[float, np.ndarray, float]] = field(default_factory=list)
    load_point: np.ndarray = field(default_factory=lambda: np.zeros(3))
    fall: np.ndarray = field(default_factory=lambda: G)
    spindle: np.ndarray = field(default_factory=lambda: X)

    def __post_init__(self) -> None:
        for i, (screw, drive) in enumerate(zip(self.robot.screws, self.robot.drive, strict=True)):
            self.coordinates(np.array([[self.stiffness[i]]]))
            self.elements.append(Element(i + 1.0, screw, drive, {j: drive[j] for j in np.flatnonzero(drive)}))

    def coordinates(self, stiffness: np.ndarray) -> list[int]:
        """New elastic coordinates with that stiffness matrix between them."""
        old, new = len(self.springs), len(stiffness)
        grown = np.zeros((old + new, old + new))
        grown[:old, :old], grown[old:, old:] = self.springs, stiffness
        self.springs = grown
        return list(range(old, old + new))

    def yields(self, place: float, screws: list[np.ndarray], stiffness: np.ndarray) -> list[int]:
        """New elements with one coordinate each, one behind the other at that place."""
        new = self.coordinates(stiffness)
        self.elements += [Element(place, screw, np.zeros(6), {k: 1.0}) for screw, k in zip(screws, new, strict=True)]
        return new

    def hinge_of(self, joint: int) -> Element:
        """The hinge of a joint (1-based)."""
        return next(element for element in self.elements if element.place == joint)

    def in_series(self, joint: int) -> int:
        """A further coordinate that turns what the gear of a joint (1-based) turns."""
        (new,) = self.coordinates(np.zeros((1, 1)))
        for element in self.elements:
            if joint - 1 in element.gives:
                element.gives[new] = element.gives[joint - 1]
        return new

    def displacement(self, plan: Plan, force: np.ndarray) -> np.ndarray:
        """How the TCP moves (n, 3) [m] under the real forces (n, 3) [N], against the unloaded arm of the same visit."""
        chain = sorted(self.elements, key=lambda element: element.place)
        screws, size = np.array([element.screw for element in chain]), len(self.springs)
        drive, give = np.array([element.drive for element in chain]), np.zeros((len(chain), size))
        for k, element in enumerate(chain):
            give[k, list(element.gives)] = list(element.gives.values())
        places = np.array([element.place for element in chain])
        tcp, last = self.robot.tcp_home(self.tool), len(chain) - 1

        def solve(rows: Rows, load: np.ndarray, start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            def springs(u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
                pull, slope = u @ self.springs, np.repeat(self.springs[None], len(u), axis=0)
                for law in self.laws:
                    torque, stiffer = law.pull(u[:, law.at], rows)
                    pull[:, law.at] += torque
                    slope[:, law.at, law.at] += stiffer
                return pull, slope

            loads = [Load(last, tcp + self.load_point, load)]
            loads += [Load(int(np.flatnonzero(places <= place)[-1]), home, np.broadcast_to(mass * self.fall, load.shape))
                      for place, home, mass in self.masses]
            u, now = at_rest(screws, rows.q @ drive.T, give, springs, loads, start)
            return u, now.point(last, tcp)

        def rows_of(which: np.ndarray) -> Rows:
            return Rows(plan.q[which], plan.time[which], plan.dwell[which], plan.visit[which])

        count = len(plan.q) // plan.visits
        first = np.arange(plan.visits) * count
        rows = rows_of(first)
        for law in self.laws:
            law.reset()
        rest, before = solve(rows, np.zeros((plan.visits, 3)), np.zeros((plan.visits, size)))
        if not any(law.memory for law in self.laws):
            _, after = solve(rows_of(np.arange(len(force))), force, np.repeat(rest, count, axis=0))
            return after - np.repeat(before, count, axis=0)
        for law in self.laws:
            law.begin(rest[:, law.at], rows)
        u, load, moved = rest, np.zeros((plan.visits, 3)), np.empty_like(force)
        for k in range(count):
            rows, target = rows_of(first + k), force[first + k]
            for way in range(1, SUBSTEPS + 1):
                passing = rows if way == SUBSTEPS else replace(rows, dwell=np.zeros(plan.visits))
                u, after = solve(passing, load + (target - load) * way / SUBSTEPS, u)
                for law in self.laws:
                    law.settle(u[:, law.at], passing)
            load, moved[first + k] = target, after - before
        return moved

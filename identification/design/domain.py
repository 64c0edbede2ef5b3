"""Which runs are admissible (paper eq. 19-21, DESIGN.md physics 5), as smooth constraints and as a random pool.

    joints    inside their limits by a margin, the parallel rod's angle inside its window by the same
    place     the TCP at one of the given positions, or anywhere in a box
    phi       |phi| <= limit, phi the angle in the base x-y plane from (TCP - base origin) to (TCP - origin of joint 6)
    wrist     axis 5 away from its singularity
    signal    the predicted deflection inside the sensors' range, and well above their noise

Inequalities are `g <= 0` with g of order one; phi is written as `cos(limit) |a| |b| - a . b <= 0` with a and b those vectors'
horizontal parts, which holds by itself where the tool is vertical. Forces are admissible by the slots' construction.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from identification.design.information import Instrument, Stance, largest_deflection, run_information, stance
from identification.design.loads import Slot
from identification.findings import error
from identification.model.inverse import inverse
from identification.model.rotations import Frame

Array = NDArray[np.float64]
# A plan is feasible where nothing exceeds its limit by more than this (in units of g; positions in metres).
TOLERANCE = 1e-6
MOST_DRAWS = 40


@dataclass(frozen=True, eq=False)
class Domain:
    """The admissible runs.

    positions (K, 3) [m] of the TCP in the base frame, or box (2, 3) [m] with its lowest and highest corner, the other None.
    phi [rad], None for no window. margin [rad] to the joint limits, wrist [rad] from the singularity. range [m] of the
    sensors; signal: smallest deflection in its largest component's sigmas.
    """

    rig: Instrument
    slots: tuple[Slot, ...]
    positions: Array | None
    box: Array | None = None
    phi: float | None = float(np.radians(80))
    margin: float = float(np.radians(2))
    wrist: float = float(np.radians(10))
    range: float = 5e-3
    signal: float = 10.0

    @cached_property
    def limits(self) -> Array:
        """Joint limits (6, 2) [rad] less the margin."""
        return np.asarray(self.rig.cell.robot.limits + self.margin * np.array([1.0, -1.0]))

    @property
    def places(self) -> int:
        """How many positions there are; a box counts as one."""
        return 1 if self.positions is None else len(self.positions)

    def look(self, theta: Array) -> Stance:
        """The arm at controller angles (n, 6) [rad]."""
        return stance(self.rig, theta)

    def inequalities(self, theta: Array, seen: Stance, slot: int) -> Array:
        """g (n, q), admissible where not positive, without the joint limits."""
        robot = self.rig.cell.robot
        parts = [np.sin(self.wrist) ** 2 - np.sin(robot.serial_angles(theta)[:, 4:5]) ** 2]
        if robot.window is not None:
            joint, low, high = robot.window
            angle = (theta @ robot.coupling[joint])[:, None]
            parts += [low + self.margin - angle, angle - high + self.margin]
        if self.phi is not None:
            towards, tool = seen.tcp[:, :2], seen.lever[:, :2]
            size = np.linalg.norm(towards, axis=1) * np.linalg.norm(tool, axis=1)
            longest = np.linalg.norm(seen.tcp, axis=1) * np.linalg.norm(seen.lever, axis=1) + 1e-12
            parts.append(((np.cos(self.phi) * size - np.sum(towards * tool, axis=1)) / longest)[:, None])
        moved = largest_deflection(self.rig, seen.columns, self.slots[slot])
        parts.append(np.abs(moved).max(axis=2) / self.range - 1)
        loaded = self.slots[slot].largest > 0
        sigmas = np.sqrt(np.sum((moved[:, :, loaded] / self.rig.sensor[:, None]) ** 2, axis=1)).min(axis=1)
        parts.append((1 - sigmas / self.signal)[:, None])
        if self.box is not None:
            parts += [self.box[0] - seen.tcp, seen.tcp - self.box[1]]
        return np.concatenate(parts, axis=1)

    def equalities(self, seen: Stance, place: NDArray[np.intp]) -> Array:
        """TCP minus its wanted position (n, 3) [m], (n, 0) in a box; place (n,): which position."""
        return seen.tcp[:, :0] if self.positions is None else seen.tcp - self.positions[place]

    def excess(self, theta: Array, slot: NDArray[np.intp], place: NDArray[np.intp]) -> Array:
        """Largest violation (n,) of any constraint, not positive where admissible to the last digit."""
        seen = self.look(theta)
        worst = np.maximum(self.limits[:, 0] - theta, theta - self.limits[:, 1]).max(axis=1)
        for s in np.unique(slot):
            rows = slot == s
            part = Stance(seen.columns[rows], seen.tcp[rows], seen.lever[rows])
            worst[rows] = np.maximum(worst[rows], self.inequalities(theta[rows], part, int(s)).max(axis=1))
        off = self.equalities(seen, place)
        return np.asarray(np.maximum(worst, np.abs(off).max(axis=1, initial=0.0)))

    def centred(self, theta: Array, place: NDArray[np.intp]) -> Array:
        """theta (n, 6) with the TCP put exactly at its position, by a few Newton steps of least joint motion."""
        if self.positions is None:
            return theta
        drive = np.linalg.pinv(self.rig.cell.robot.load_matrix)     # the springs' axes back to serial ones, and to the drives
        back = self.rig.cell.robot.uncoupling
        for _ in range(3):
            seen = self.look(theta)
            serial = seen.columns @ drive @ np.linalg.inv(back)
            theta = theta - np.einsum("nij,nj->ni", np.linalg.pinv(serial), self.equalities(seen, place))
        return theta


@dataclass(frozen=True, eq=False)
class Pool:
    """n admissible runs: theta (n, 6) [rad], slot and place (n,), information (n, 6, 6)."""

    theta: Array
    slot: NDArray[np.intp]
    place: NDArray[np.intp]
    information: Array

    def __len__(self) -> int:
        return len(self.theta)

    def take(self, rows: NDArray[np.intp] | NDArray[np.bool_]) -> Pool:
        """Some of them."""
        return Pool(self.theta[rows], self.slot[rows], self.place[rows], self.information[rows])

    def joined(self, other: Pool) -> Pool:
        """Both."""
        return Pool(*(np.concatenate([getattr(self, name), getattr(other, name)])
                      for name in ("theta", "slot", "place", "information")))


def random_pool(domain: Domain, poses: int, rng: np.random.Generator) -> Pool:
    """Random admissible runs: about `poses` poses, tool orientations uniform over all rotations, every branch of the inverse
    kinematics, each with every slot. Raises CompstiffError (CS1601) where none is admissible."""
    robot, tool = domain.rig.cell.robot, domain.rig.cell.flange_from_tcp
    found: list[tuple[Array, NDArray[np.intp]]] = []
    count = drawn = 0
    for _ in range(MOST_DRAWS):
        draws = max(poses, 200)
        quaternion = rng.standard_normal((draws, 4))
        place = rng.integers(0, domain.places, draws)
        if domain.positions is not None:
            position = domain.positions[place]
        else:
            assert domain.box is not None
            position = rng.uniform(domain.box[0], domain.box[1], (draws, 3))
        target = Frame.from_quaternion(position, quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True))
        solved = inverse(robot, target @ tool.inverse())
        theta = solved.theta.reshape(-1, 6)
        inside = (theta >= domain.limits[:, 0]) & (theta <= domain.limits[:, 1])
        fits = solved.reachable.reshape(-1) & inside.all(axis=1)
        theta, spot = theta[fits], np.repeat(place, solved.theta.shape[1])[fits]
        drawn += draws
        found.append((theta, spot))
        count += len(theta)
        if count >= poses:
            break
    theta, place = (np.concatenate(parts) for parts in zip(*found, strict=True))
    theta, place = theta[:poses], place[:poses]
    seen = domain.look(theta)
    pools = []
    for number, one in enumerate(domain.slots):
        good = domain.inequalities(theta, seen, number).max(axis=1) <= 0 if len(theta) else np.zeros(0, dtype=bool)
        pools.append(Pool(theta[good], np.full(int(good.sum()), number), place[good],
                          run_information(domain.rig, seen.columns[good], one)))
    if not all(map(len, pools)):
        empty = next(domain.slots[i].name for i, pool in enumerate(pools) if not len(pool))
        raise error("CS1601", f"of {drawn} random tool orientations at the wanted place none is admissible with a load along "
                    f"{empty}: {len(theta)} are inside the joint limits, none of them also inside the orientation window, away "
                    "from the wrist's singularity and within the sensors' range", file=str(domain.rig.cell.source),
                    hint="move the place with --position, widen --phi, or check the tool in cell.yaml")
    result = pools[0]
    for pool in pools[1:]:
        result = result.joined(pool)
    return result

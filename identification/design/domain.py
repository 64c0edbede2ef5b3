"""Which runs are admissible (paper eq. 19-21), and a random pool of such runs.

    joints    inside their limits by a margin, the parallel rod's angle inside its window by the same, and in cell.yaml's window
    place     the TCP at one of the given positions, or anywhere in a box
    phi       |phi| <= limit, phi the angle in the base x-y plane from (TCP - base origin) to (TCP - origin of joint 6)
    singular  the wrist, the elbow and the shoulder away from where axes 4 and 6, the arm's links, or the wrist's centre and
              axis 1 are in line
    signal    the predicted deflection inside the sensors' range, and well above their noise

As smooth inequalities they stand in constraints.py. Collisions are not among them: what stands in the cell is not known here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from identification.common.findings import CompstiffError, error
from identification.design.constraints import Margins, inequalities
from identification.design.information import Instrument, run_information
from identification.design.loads import Loads, LoadTable, Slot
from identification.design.stance import Stance, stance
from identification.model.inverse import inverse
from identification.model.rotations import Frame

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
# A plan is feasible where nothing exceeds its limit by more than this (in units of g; positions in metres).
TOLERANCE = 1e-6
MOST_DRAWS = 40
# As `Margins.signal`: any deflection is seen.
NO_SIGNAL = 1e-300


@dataclass(frozen=True, eq=False)
class Pool:
    """n admissible runs: theta (n, 6) [rad], slot and place (n,), line (n, 3) along which a free slot is loaded (base x for the
    others), information (n, m, m): of the six ln c, and for causes.py of more."""

    theta: Array
    slot: Indices
    place: Indices
    line: Array
    information: Array

    def __len__(self) -> int:
        return len(self.theta)

    def take(self, rows: NDArray[np.intp] | NDArray[np.bool_]) -> Pool:
        """Some of them."""
        return Pool(self.theta[rows], self.slot[rows], self.place[rows], self.line[rows], self.information[rows])

    @staticmethod
    def of(pools: Sequence[Pool]) -> Pool:
        """One or more pools as one."""
        return Pool(*(np.concatenate([getattr(pool, name) for pool in pools])
                      for name in ("theta", "slot", "place", "line", "information")))

    def joined(self, other: Pool) -> Pool:
        """Both."""
        return Pool.of([self, other])


@dataclass(frozen=True, eq=False)
class Domain:
    """The admissible runs.

    positions (K, 3) [m] of the TCP in the base frame, or box (2, 3) [m] with its lowest and highest corner, the other None.
    margins: of all the rest.
    """

    rig: Instrument
    slots: tuple[Slot, ...]
    positions: Array | None
    box: Array | None = None
    margins: Margins = field(default_factory=Margins)

    @cached_property
    def limits(self) -> Array:
        """Joint limits (6, 2) [rad] less the margin, and inside the cell's window."""
        inside = self.rig.cell.robot.limits + self.margins.joint * np.array([1.0, -1.0])
        window = self.rig.cell.joint_window
        return np.column_stack([np.maximum(inside[:, 0], window[:, 0]), np.minimum(inside[:, 1], window[:, 1])])

    @cached_property
    def table(self) -> LoadTable:
        """The slots' loads."""
        return LoadTable(self.slots)

    @property
    def places(self) -> int:
        """How many positions there are; a box counts as one."""
        return 1 if self.positions is None else len(self.positions)

    def look(self, theta: Array) -> Stance:
        """The arm at controller angles (n, 6) [rad]."""
        return stance(self.rig.cell.robot, self.rig.cell.flange_from_tcp, theta)

    def equalities(self, arm: Stance, place: Indices) -> Array:
        """TCP minus its wanted position (n, 3) [m], (n, 0) in a box; place (n,): which position."""
        return arm.tcp[:, :0] if self.positions is None else arm.tcp - self.positions[place]

    def runs(self, theta: Array, slot: Indices, place: Indices, line: Array) -> Pool:
        """Runs with these angles, slots, places and lines."""
        loads = self.table.of(slot, line)
        return Pool(theta, slot, place, line, run_information(self.rig, self.look(theta).columns, loads))

    def excess(self, runs: Pool) -> Array:
        """Largest violation (n,) of any constraint, not positive where admissible to the last digit."""
        arm = self.look(runs.theta)
        worst = np.maximum(self.limits[:, 0] - runs.theta, runs.theta - self.limits[:, 1]).max(axis=1)
        loads = self.table.of(runs.slot, runs.line)
        worst = np.maximum(worst, inequalities(self.rig, self.margins, self.box, runs.theta, arm, loads).max(axis=1))
        off = self.equalities(arm, runs.place)
        return np.asarray(np.maximum(worst, np.abs(off).max(axis=1, initial=0.0)))

    def centred(self, theta: Array, place: Indices) -> Array:
        """theta (n, 6) with the TCP put exactly at its position, by a few Newton steps of least joint motion."""
        if self.positions is None:
            return theta
        for _ in range(3):
            arm = self.look(theta)
            slope = np.swapaxes(arm.serial, 1, 2) @ self.rig.cell.robot.coupling
            theta = theta - np.einsum("nij,nj->ni", np.linalg.pinv(slope), self.equalities(arm, place))
        return theta


def random_pool(domain: Domain, poses: int, rng: np.random.Generator) -> Pool:
    """Random admissible runs: about `poses` poses, tool orientations uniform over all rotations, every branch of the inverse
    kinematics, each with every slot, a free one along a random line. Raises CompstiffError (CS1601) where none fits."""
    theta, place, drawn = _poses_in_place(domain, poses, rng)
    arm = domain.look(theta)
    pools = []
    for number in range(len(domain.slots)):
        line = np.tile([1.0, 0.0, 0.0], (len(theta), 1))
        if domain.slots[number].free:
            line = rng.standard_normal((len(theta), 3))
            line /= np.linalg.norm(line, axis=1, keepdims=True)
        loads: Loads = domain.table.of(np.full(len(theta), number), line)
        good = np.zeros(0, dtype=bool)
        if len(theta):
            good = inequalities(domain.rig, domain.margins, domain.box, theta, arm, loads).max(axis=1) <= 0
        if not good.any():
            raise _nothing_fits(domain, domain.slots[number].name, theta, drawn, loads)
        pools.append(domain.runs(theta[good], np.full(int(good.sum()), number, dtype=np.intp), place[good], line[good]))
    return Pool.of(pools)


def _nothing_fits(domain: Domain, name: str, theta: Array, drawn: int, loads: Loads) -> CompstiffError:
    """CS1601 with what was in the way of a slot of this name: theta (n, 6) [rad] in place, of how many orientations drawn."""
    def fitting(margins: Margins) -> int:
        worst = inequalities(domain.rig, margins, domain.box, theta, domain.look(theta), loads).max(axis=1, initial=-np.inf)
        return int(np.sum(worst <= 0))

    any_signal, any_range = replace(domain.margins, signal=NO_SIGNAL), replace(domain.margins, range=np.inf)
    standing = fitting(replace(any_signal, range=np.inf)) if len(theta) else 0
    found = f"no run with a load along {name} is admissible: "
    hint = "move the place with --position, widen --phi, or check tool and design (joint_window_deg, reach_mm) in cell.yaml"
    if not len(theta):
        found += f"at none of {drawn} random tool orientations is the wanted place in reach and inside the joint limits"
    elif not standing:
        found += (f"of {len(theta)} random poses at the wanted place, in reach and inside the joint limits, none is inside the "
                  "windows (of the orientation, reach_mm, the parallel rod's) and away from singularities")
    else:
        weak, far = standing - fitting(any_range), standing - fitting(any_signal)
        found += (f"at {standing} random poses at the wanted place it deflects the robot by less than "
                  f"{domain.margins.signal:g} sigmas of the sensors ({weak}) or by more than {1e3 * domain.margins.range:g} mm "
                  f"({far})")
        hint = f"plan with a {'larger' if weak >= far else 'smaller'} load: --max-force, or --dead-weight"
    return error("CS1601", found, file=str(domain.rig.cell.source), hint=hint)


def _poses_in_place(domain: Domain, poses: int, rng: np.random.Generator) -> tuple[Array, Indices, int]:
    """Angles (n, 6) [rad] inside the joint limits with the TCP in place, which place (n,), and how many were drawn."""
    robot, tool = domain.rig.cell.robot, domain.rig.cell.flange_from_tcp
    drawn_poses: list[tuple[Array, Indices]] = []
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
        drawn_poses.append((theta, spot.astype(np.intp)))
        count += len(theta)
        if count >= poses:
            break
    theta, place = (np.concatenate(parts) for parts in zip(*drawn_poses, strict=True))
    return theta[:poses], place[:poses], drawn

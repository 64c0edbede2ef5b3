"""The cell as it really is: springs, faults of the force and of the reading, and how a row of measurements comes about."""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from tests.virtual_cell.arm_model import Tool
from tests.virtual_cell.designs import Design
from tests.virtual_cell.inverse import comfortable, inverse
from tests.virtual_cell.laws import Law, Row
from tests.virtual_cell.statics import TOLERANCE, State, Statics, statics

ForceFault = Callable[[np.ndarray, Row], np.ndarray]
ReadingFault = Callable[[np.ndarray, Row, np.ndarray], np.ndarray]
# Force (3,) [N] at a step, by where the tool is pushed to (3,) [m], base frame.
ForceOf = Callable[[int, np.ndarray], np.ndarray]
FORCE_TOLERANCE = 1e-4      # of the balance of cut and arm [N]
# Of the arm's own balance in a pass [rad, m]: where an edge enters, the force changes by some 1e6 N/m.
PASS_TOLERANCE = 1e-12


@dataclass
class Plant:
    """One cell. Effects (effects_*.py) change it in place.

    stiffness (6,) [N m/rad] of the gears; compliance (e, e) of the elastic joints; laws: what they give beyond it; rod_ratio,
    offset [m, flange axes] and beside [m, base axes] as in `Statics.solve`. force_faults turn the force cell's force (3,) [N]
    into the real one;
    reading_faults turn the TCP's real displacement (3,) [m] (with row and real force) into what the lasers see, in order of
    their rank. object_m: where the part lies that is milled.
    """

    stiffness: np.ndarray
    tool: Tool = field(default_factory=Tool)
    gravity: bool = True
    rod_ratio: float = 1.0
    offset: np.ndarray | None = None
    beside: np.ndarray | None = None
    laws: list[Law] = field(default_factory=list)
    force_faults: list[ForceFault] = field(default_factory=list)
    reading_faults: list[tuple[int, ReadingFault]] = field(default_factory=list)
    object_m: tuple[float, float, float] = (1.35, -0.1, 0.75)

    def __post_init__(self) -> None:
        self.solver: Statics = statics(self.tool, self.gravity)
        self.compliance = np.zeros((len(self.solver.e), len(self.solver.e)))
        drives = self.solver.drives
        self.compliance[drives, drives] = 1 / np.asarray(self.stiffness)

    def at(self, name: str) -> int:
        """Where an elastic joint of arm_model.py stands in the torques."""
        return self.solver.index[name]

    def drive(self, joint: int) -> int:
        """Where the gear of joint 1 … 6 stands in the torques."""
        return int(self.solver.drives[joint - 1])

    def yields(self, name: str, compliance: float) -> None:
        """Gives a joint that was rigid a compliance [rad/(N m)] or [m/N]."""
        self.compliance[self.at(name), self.at(name)] += compliance

    def _springs(self, row: Row, rest: np.ndarray | None) -> Callable[[np.ndarray], np.ndarray]:
        def give(torque: np.ndarray) -> np.ndarray:
            x = self.compliance @ torque
            for law in self.laws:
                law.add(x, torque, rest, row)
            return x

        return give

    def at_rest(self, row: Row, force: np.ndarray, rest: np.ndarray | None, start: State | None = None,
                tolerance: float = TOLERANCE) -> State:
        """Where the arm comes to rest under a force (3,) [N, base]; rest: the torques unloaded, None for that state itself;
        start and tolerance as in `Statics.solve`."""
        return self.solver.solve(row.q, self._springs(row, rest), force, offset=None if rest is None else self.offset,
                                 beside=None if rest is None else self.beside, rod_ratio=self.rod_ratio, start=start,
                                 tolerance=tolerance)

    def displacement(self, design: Design, force_error: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """TCP displacement (N, 3) [m], loaded minus unloaded in the same pose, base frame, and what the lasers see of it.

        force_error (N, 3) [N]: what the force cell does not show, beside its faults.
        """
        moved, seen = np.empty((len(design.theta), 3)), np.empty((len(design.theta), 3))
        faults = [fault for _, fault in sorted(self.reading_faults, key=lambda entry: entry[0])]
        pose, unloaded, state, before = -1, None, None, np.zeros(3)
        for i, q in enumerate(design.theta):
            row = Row(i, int(design.pose[i]), q, float(design.time[i]), float(design.dwell[i]), design.load[i],
                      before if design.pose[i] == pose else np.zeros(3))
            if design.pose[i] != pose:
                for law in self.laws:
                    law.begin()
                pose = int(design.pose[i])
                unloaded = state = self.at_rest(row, np.zeros(3), None)
                for law in self.laws:
                    law.settle(unloaded.torque, row)
            assert unloaded is not None
            force = row.force if force_error is None else row.force + force_error[i]
            for fault in self.force_faults:
                force = fault(force, row)
            state = self.at_rest(row, force, unloaded.torque, state)
            for law in self.laws:
                law.settle(state.torque, row)
            moved[i] = seen[i] = state.tcp - unloaded.tcp
            for reading in faults:
                seen[i] = reading(seen[i], row, force)
            before = row.force
        return moved, seen

    def angles(self, tcp: np.ndarray, rotation: np.ndarray) -> np.ndarray:
        """The controller's joint angles (N, 6) [rad] for TCPs (N, 3) [m], base frame, and rotations (N, 3, 3) base_from_flange;
        raises ValueError where they are at the end of the robot's range."""
        theta = inverse(tcp, rotation, self.tool)[:, 0]
        if not comfortable(theta).all():
            raise ValueError("the path leaves the robot's comfortable range")
        return theta

    def pushed(self, theta: np.ndarray, time_s: np.ndarray, force_of: ForceOf) -> tuple[np.ndarray, np.ndarray]:
        """Goes through theta (S, 6) [rad]: how far the tool is off the same way in air (S, 3) [m], and the force
        (S, 3) [N], base frame.

        force_of(step, displacement) is the force where the tool is pushed to; it is solved for together with the displacement.
        """
        cut, air = copy.copy(self), copy.copy(self)
        cut.laws, air.laws = copy.deepcopy(self.laws), copy.deepcopy(self.laws)
        for law in (*cut.laws, *air.laws):
            law.begin()
        off, forces = np.zeros((len(theta), 3)), np.zeros((len(theta), 3))
        state = unloaded = before = None
        loaded_since = time_s[0]
        moved = np.zeros(3)
        for i, q in enumerate(theta):
            force = force_of(i, moved)
            if not force.any():
                loaded_since = time_s[i]
            row = Row(i, 1, q, float(time_s[i]), float(time_s[i] - loaded_since), force, np.zeros(3))
            # From where the last two steps point to.
            start = unloaded if before is None else replace(unloaded, moved=2 * unloaded.moved - before.moved)
            unloaded, before = air.at_rest(row, np.zeros(3), None, start, PASS_TOLERANCE), unloaded
            share, last = 1.0, np.inf
            for _ in range(200):
                state = cut.at_rest(row, force, unloaded.torque, state, PASS_TOLERANCE)
                moved = state.tcp - unloaded.tcp
                missing = force_of(i, moved) - force
                if np.abs(missing).max() <= FORCE_TOLERANCE:
                    break
                # Where the cut is stiffer than the arm, whole steps would go back and forth; short ones gain little each.
                share = 0.5 * share if np.linalg.norm(missing) > (1 - 0.1 * share) * last else share
                last = float(np.linalg.norm(missing))
                force = force + share * missing
            else:
                raise RuntimeError(f"cut and arm find no balance at step {i}")
            for law in cut.laws:
                law.settle(state.torque, row)
            for law in air.laws:
                law.settle(unloaded.torque, row)
            off[i], forces[i] = moved, force
        return off, forces

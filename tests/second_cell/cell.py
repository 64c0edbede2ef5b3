"""The second cell: load tests of a simulated robot that share neither code nor laws with the packages or the virtual cell.

    python -m tests.second_cell.cell SEED PLAN STRATUM EFFECT[:JOINT[:FACTOR]][+EFFECT...]|none FOLDER

writes the files that a user would have: cell.yaml, measurements.csv, and robot.yaml where the arm's masses are known.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from tests.second_cell.arm import Arm
from tests.second_cell.effects import EFFECTS
from tests.second_cell.hidden import World
from tests.second_cell.noise import Noise, draw_noise, reading, real_force
from tests.second_cell.plans import PLANS, Plan, fresh
from tests.second_cell.robots import HOME_FLANGE, ROBOTS, Robot, X, Y, Z, foreign, robot
from tests.second_cell.setting import Setting, any_setting, matrix, quaternion

FOREIGN = "foreign"
LOG_STD = 0.45      # of the true stiffnesses about the published ones
# [kg] of column, lower arm, forearm, wrist, hand, disc and tool, where they are along their links: made up for tests.
MASSES = (450.0, 240.0, 330.0, 65.0, 45.0, 15.0, 70.0)


@dataclass(frozen=True)
class Hidden:
    """An effect to hide, at a joint (0 where it belongs to none), at a multiple of its typical size."""

    effect: str
    joint: int = 0
    factor: float = 1.0

    @property
    def truth(self) -> dict[str, Any]:
        """As an answer would have it."""
        return {"effect": EFFECTS[self.effect].known_as, "joint": self.joint or None}


@dataclass(frozen=True)
class Case:
    """One load test. stiffness (6,) [N m/rad]: the truth of the plain springs; reading (n, 3) [um]: as in the table;
    weight: the arm's masses act, "known" ones stand in robot.yaml."""

    seed: int
    robot: Robot
    tool: np.ndarray
    stiffness: np.ndarray
    noise: Noise
    hidden: tuple[Hidden, ...]
    weight: str
    plan: Plan
    reading: np.ndarray
    world: World = field(repr=False)
    setting: Setting = field(default_factory=Setting)

    def plain_arm(self, stiffness: np.ndarray | None = None) -> Arm:
        """The arm without what is hidden, or another one with other springs."""
        return _arm(self.robot, self.tool, self.stiffness if stiffness is None else stiffness, self.weight, self.setting)

    @cached_property
    def seen_um(self) -> np.ndarray:
        """What the sensors would see (n, 3) [um] without noise."""
        return 1e6 * _seen(self.world, self.plan.load)

    def fresh(self, count: int = 30) -> tuple[Plan, np.ndarray]:
        """Poses and loads that were not measured, and how the robot really moves there (n, 3) [m] under these forces, which act
        at the tool's point: where the calibration's cylinder touched is of no meaning there."""
        plan = fresh(self.robot, self.tool, np.random.default_rng([self.seed, 4]), count)
        arm = copy(self.world.arm)
        arm.load_point = np.zeros(3)
        return plan, arm.displacement(plan, plan.load)

    def write(self, folder: Path) -> tuple[Path, Path]:
        """The files in the folder; returns cell.yaml and measurements.csv."""
        cell, table = folder / "cell.yaml", folder / "measurements.csv"
        if self._robot_file:
            (folder / "robot.yaml").write_text(self._robot(), encoding="utf-8")
        cell.write_text(self._cell(), encoding="utf-8")
        table.write_text(self._table(), encoding="utf-8")
        return cell, table

    @property
    def _robot_file(self) -> bool:
        return self.weight == "known" or not self.robot.built_in

    def _cell(self) -> str:
        lines = [f"robot: {'robot.yaml' if self._robot_file else self.robot.name}", "tool:",
                 f"  position_mm: {(1e3 * self.tool).round(3).tolist()}", f"  quaternion: {quaternion(self.setting.tool)}"]
        if self.weight == "known":
            lines += [f"  mass_kg: {_masses(self.robot)[6]:.6g}", f"  centre_of_mass_mm: [0, 0, {500 * self.tool[2]:.3f}]"]
        lines += [f"base_frame: {{quaternion: {quaternion(self.setting.base)}}}"] if self.setting.base.any() else []
        if self.noise.stated:
            said = self.noise.stated
            lines += ["measurement:", f"  deflection_std_um: {[round(said.sensor, 3)] * 3}",
                      f"  pose_offset_std_um: {[round(said.seating, 3)] * 3}", f"  force_relative_std: {said.relative:.5f}"]
            lines += [f"  force_std_n: {[said.force] * 3}"] if said.force else []
        return "\n".join(lines) + "\n"

    def _robot(self) -> str:
        """The robot's file, with the masses of the links, each in the frame of its joint, where they are known."""
        if self.weight != "known":
            return self.robot.text
        shoulder, elbow, wrist = self.robot.joints
        frames = [(shoulder * Z, X, Z), (shoulder, Z, Y), (elbow, Z, Y), (wrist, Z, X), (wrist, Z, Y),
                  (self.robot.flange, -Z, X)]
        lines = ["links:                             # made up for tests"]
        for mass, centre, (origin, x, z) in zip(_masses(self.robot), _centres(self.robot, self.tool), frames,
                                                  strict=False):
            own = np.array([x, np.cross(z, x), z]) @ (centre - origin)
            lines.append(f"  - {{mass_kg: {mass:.9g}, centre_of_mass_mm: {(1e3 * own).round(6).tolist()}}}")
        return self.robot.text + "\n".join(lines) + "\n"

    def _table(self) -> str:
        p = self.plan
        head = [*(f"q{i}_deg" for i in range(1, 7)), *(f"f{axis}_n" for axis in "xyz"), *(f"d{axis}_um" for axis in "xyz"),
                "time_s", "dwell_s", "pose"]
        read, moment = np.where(p.read, self.reading, np.nan), np.empty((len(p.load), 0))
        if self.setting.hook.any():
            head[9:9] = [f"m{axis}_nm" for axis in "xyz"]
            moment = np.cross(self.robot.tcp(p.q, self.tool + self.setting.hook) - self.robot.tcp(p.q, self.tool), p.load)
        rows = np.column_stack([np.degrees(self.world.table_q), p.load, moment, read, p.time, p.dwell])
        return "\n".join([",".join(head), *(",".join([*("" if np.isnan(x) else f"{x + 0.0:.8g}" for x in row), f"V{visit + 1}"])
                                            for row, visit in zip(rows, p.visit, strict=True))]) + "\n"


def _centres(arm: Robot, tool: np.ndarray) -> list[np.ndarray]:
    """Where the masses are at home (7 of (3,)) [m]."""
    shoulder, elbow, wrist = arm.joints
    return [0.6 * shoulder, 0.55 * shoulder + 0.45 * elbow, elbow + 0.2 * (wrist - elbow), wrist - 0.12 * X, wrist + 0.03 * X,
            arm.flange - 0.03 * X, arm.flange + HOME_FLANGE @ (tool * [0, 0, 0.5])]


def _masses(arm: Robot) -> np.ndarray:
    return np.asarray(np.array(MASSES) * arm.size**3)


def _arm(model: Robot, tool: np.ndarray, stiffness: np.ndarray, weight: str, setting: Setting) -> Arm:
    built = Arm(model, tool, stiffness, load_point=HOME_FLANGE @ setting.hook, fall=setting.fall,
                spindle=HOME_FLANGE @ matrix(setting.tool) @ Z)
    if weight != "none":
        built.masses = [(float(min(i, 6)), centre, float(mass))
                        for i, (mass, centre) in enumerate(zip(_masses(model), _centres(model, tool), strict=True), 1)]
    return built


def _seen(world: World, force: np.ndarray) -> np.ndarray:
    """What the sensors see (n, 3) [m] where `force` (n, 3) [N] pushes but for what falsifies it."""
    for fault in world.force:
        force = fault(force)
    seen = world.arm.displacement(world.plan, force)
    for fault in world.reading:
        seen = fault(seen)
    return seen


def simulate(seed: int, plan: str = "cycles", stratum: str = "near", hidden: Sequence[Hidden] = (), name: str | None = None,
             weight: str = "none") -> Case:
    """The load test of a seed. Robot, tool, stiffnesses and poses depend on the seed and the plan alone. name: of a robot, or
    FOREIGN: a robot of nobody's in any setting."""
    rng = np.random.default_rng([seed, list(PLANS).index(plan), 2])
    model, tool, setting = _set_up(name, rng)
    stiffness = model.stiffness * np.exp(LOG_STD * rng.standard_normal(6))
    planned = setting.carried_out(PLANS[plan](model, tool, rng))
    return measured(seed, model, tool, stiffness, planned, stratum, hidden, weight, setting)


def _set_up(name: str | None, rng: np.random.Generator) -> tuple[Robot, np.ndarray, Setting]:
    """Robot, tool (3,) [m] and setting."""
    if name == FOREIGN:
        model = foreign(rng)
        tool = model.size**0.5 * rng.uniform([-0.1, -0.1, 0.1], [0.16, 0.1, 0.32])
        return model, tool.round(4), any_setting(model.size, rng)
    model = robot(name or ROBOTS[int(rng.integers(len(ROBOTS)))])
    return model, np.array([rng.uniform(0.06, 0.16), 0.0, rng.uniform(0.15, 0.32)]).round(4), Setting()


def measured(seed: int, model: Robot, tool: np.ndarray, stiffness: np.ndarray, planned: Plan, stratum: str = "near",
             hidden: Sequence[Hidden] = (), weight: str = "none", setting: Setting | None = None) -> Case:
    """A plan carried out. tool (3,) [m] from the flange, stiffness (6,) [N m/rad]; the seed draws sizes and noise.

    weight: whether the arm's masses act: "none", "known" (robot.yaml has them) or "unknown".
    """
    setting = setting or Setting()
    world = World(_arm(model, tool, stiffness, weight, setting), planned, planned.q.copy())
    sizes = np.random.default_rng([seed, 5])
    for one in hidden:
        EFFECTS[one.effect].build(world, one.joint, one.factor, sizes)
    chance = np.random.default_rng([seed, 3])
    noise = setting.noisy(draw_noise(stratum, chance))
    seen = 1e6 * _seen(world, real_force(noise, planned, chance))
    table = reading(noise, planned, seen, chance)
    return Case(seed, model, tool, stiffness, noise, tuple(hidden), weight, planned, table, world, setting)


def drawn(seed: int, plan: str, names: Sequence[str], count: int = 1,
          times: tuple[float, float] = (0.5, 2.0), name: str | None = None) -> tuple[tuple[Hidden, ...], str]:
    """What is hidden in the case of that seed, `count` different effects, so many `times` typical; and the arm's weight."""
    rng, model = np.random.default_rng([seed, 6]), simulated_robot(seed, plan, name)
    fit = [each for each in names if model.rod or not EFFECTS[each].rod]
    hidden: list[Hidden] = []
    for each in rng.permutation(fit)[:count]:
        joints = EFFECTS[each].joints
        joint = int(rng.choice(joints)) if joints else 0
        hidden.append(Hidden(str(each), joint, float(times[0] * (times[1] / times[0]) ** rng.random())))
    return tuple(hidden), str(rng.choice(["known", "unknown"]))


def simulated_robot(seed: int, plan: str, name: str | None = None) -> Robot:
    """The robot of a seed."""
    return _set_up(name, np.random.default_rng([seed, list(PLANS).index(plan), 2]))[0]


def parsed(text: str) -> tuple[Hidden, ...]:
    """`EFFECT[:JOINT[:FACTOR]][+EFFECT...]` or `none`."""
    parts = [one.split(":") for one in text.split("+") if text != "none"]
    return tuple(Hidden(part[0], int(part[1] or 0) if part[1:] else 0, float(part[2]) if part[2:] else 1.0) for part in parts)


if __name__ == "__main__":
    target = Path(sys.argv[5])
    target.mkdir(parents=True, exist_ok=True)
    print(*simulate(int(sys.argv[1]), sys.argv[2], sys.argv[3], parsed(sys.argv[4])).write(target))

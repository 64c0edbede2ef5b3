"""Load tests with a mistake in the table or in the cell file, in the units and words of the files.

The robots of tests/virtual_cell and, in load tests as a shop might make them, of tests/second_cell share no physics with the
packages. The other robots are simulated with the packages' own plain
model: there the truth lies in the mistake alone, which is planted in the files by hand.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from identification.model.compliance import equilibrium
from identification.model.robot import RobotModel, built_in_robots, read_robot
from identification.model.rotations import Frame
from tests.second_cell import cell as second_cell
from tests.virtual_cell import files
from tests.virtual_cell.cell import Hidden, simulate
from tests.virtual_cell.designs import Design
from tests.virtual_cell.noise import draw_noise, force_errors, readings

VIRTUAL, SHOP = "virtual", "shop"
ROBOTS = (VIRTUAL, "irb4400-60", "irb6640-235-2.55", "irb6700-200-2.60")
TCP_MM = (120.0, 0.0, 250.0)
STEPS_N = (0.0, 150.0, 300.0, 0.0, -150.0, -300.0)
POSES = 10


@dataclass(frozen=True)
class Files:
    """What a user has: theta (n, 6) [deg], force (n, 3) [N], moved (n, 3) [um], time and dwell (n,) [s], pose labels (n,); the
    TCP [mm]; the robot's name and the text of the robot file where it is not built in; the noise as stated; anew: the table
    says that the reference was taken anew at each pose."""

    theta: np.ndarray
    force: np.ndarray
    moved: np.ndarray
    time: np.ndarray
    dwell: np.ndarray
    pose: list[str]
    tcp: np.ndarray
    robot: str
    robot_text: str
    mass: str
    measurement: str
    stiffness: np.ndarray
    anew: bool = False

    def write(self, folder: Path) -> tuple[Path, Path]:
        """cell.yaml and measurements.csv."""
        if self.robot_text:
            (folder / "robot.yaml").write_text(self.robot_text)
        cell, table = folder / "cell.yaml", folder / "measurements.csv"
        tcp = ", ".join(f"{x:.9g}" for x in self.tcp)
        cell.write_text(f"robot: {self.robot}\ntool:\n  position_mm: [{tcp}]   # taught\n  quaternion: [1, 0, 0, 0]\n"
                        f"{self.mass}measurement:\n{self.measurement}")
        names = [*(f"q{i}_deg" for i in range(1, 7)), "fx_n", "fy_n", "fz_n", "dx_um", "dy_um", "dz_um", "time_s", "dwell_s",
                 "pose"]
        numbers = np.column_stack([self.theta, self.force, self.moved, self.time, self.dwell])
        lines = [",".join([*("" if np.isnan(x) else f"{x + 0.0:.9g}" for x in row), label])
                 for row, label in zip(numbers, self.pose, strict=True)]
        if self.anew:
            names, lines = [*names, "reference"], [f"{line},R{label}" for line, label in zip(lines, self.pose, strict=True)]
        table.write_text("\n".join([",".join(names), *lines]) + "\n")
        return cell, table


def first(case: Files, poses: int) -> Files:
    """Its first poses alone: a short load test takes less time, and what is plain in it is plain."""
    kept = np.isin(case.pose, list(dict.fromkeys(case.pose))[:poses])
    names = ("theta", "force", "moved", "time", "dwell")
    return replace(case, pose=[label for label, keep in zip(case.pose, kept, strict=True) if keep],
                   **{name: getattr(case, name)[kept] for name in names})


def right(seed: int, robot: str = VIRTUAL, design: str = "ladder12", hidden: tuple[Hidden, ...] = ()) -> Files:
    """A load test without a mistake; design and hidden effects are the virtual cell's."""
    if robot == VIRTUAL:
        case = simulate(seed, design, hidden)
        head, lines = files.cell_yaml(case).split("measurement:\n")
        mass = head.split("quaternion: [1, 0, 0, 0]\n")[1]
        return Files(np.degrees(case.theta), case.wrench[:, :3], case.deflection_um, case.time, case.dwell, list(case.pose),
                     np.array(TCP_MM), "robot.yaml", files.robot_yaml(), mass, lines, case.stiffness)
    if robot == SHOP:
        return _in_a_shop(seed)
    rng = np.random.default_rng([seed, 7])
    model = read_robot(built_in_robots()[robot])
    stiffness = model.prior.stiffness * np.exp(0.5 * rng.standard_normal(6))
    plan = _ladder(model, rng)
    noise = draw_noise("realistic", rng)
    frame = Frame(np.eye(3), 1e-3 * np.array(TCP_MM))
    felt = plan.load + force_errors(noise, plan, rng)
    wrench = np.concatenate([felt, np.zeros_like(felt)], axis=1)
    seen = 1e6 * equilibrium(model, plan.theta, frame, wrench, 1 / stiffness).position
    three = "[{0:g}, {0:g}, {0:g}]"
    stated = (f"  deflection_std_um: {three.format(noise.stated_sensor_um)}\n"
              f"  force_std_n: {three.format(noise.stated_force_n)}\n"
              f"  force_relative_std: {noise.stated_force_relative:g}\n"
              f"  pose_offset_std_um: {three.format(noise.stated_pose_offset_um)}\n")
    return Files(np.degrees(plan.theta), plan.load, readings(noise, plan, seen, rng), plan.time, plan.dwell,
                 [f"P{k}" for k in plan.pose], np.array(TCP_MM), robot, "", "", stated, stiffness)


def _in_a_shop(seed: int, springs: int | None = None) -> Files:
    """A load test of the second cell, any plan (tests/second_cell/plans.py); springs: seed of other ones."""
    case = second_cell.simulate(seed, "shop", "near", weight="unknown")
    if springs is not None:
        other = case.robot.stiffness * np.exp(second_cell.LOG_STD * np.random.default_rng([springs, 9]).standard_normal(6))
        case = second_cell.measured(springs, case.robot, case.tool, other, case.plan, "near", (), "unknown")
    said = case.noise.stated
    assert said is not None
    stated = (f"  deflection_std_um: {[said.sensor] * 3}\n  pose_offset_std_um: {[said.seating] * 3}\n"
              f"  force_relative_std: {said.relative}\n")
    plan = case.plan
    return Files(np.degrees(plan.q), plan.load, np.where(plan.read, case.reading, np.nan), plan.time, plan.dwell,
                 [f"V{visit}" for visit in plan.visit], 1e3 * case.tool, case.robot.name, "", "", stated, case.stiffness)


def _ladder(model: RobotModel, rng: np.random.Generator) -> Design:
    """Poses in the middle of the joints' ranges, each with a load cycle along x, y and z."""
    middle, half = model.limits.mean(axis=1), np.minimum(0.35 * np.ptp(model.limits, axis=1), np.radians(90))
    theta = middle + half * rng.uniform(-1, 1, (200, 6))
    theta[:, 4] = np.where(rng.random(200) < 0.5, 1, -1) * rng.uniform(0.5, 1.6, 200)
    theta = theta[np.max(model.limit_excess(theta), axis=1) <= 0][:POSES]
    theta = np.radians(np.round(np.degrees(theta), 4))
    steps = np.concatenate([np.outer(STEPS_N, axis) for axis in np.eye(3)])
    count = len(steps)
    pose = np.repeat(np.arange(POSES), count)
    dwell = rng.choice([5.0, 10.0, 30.0], POSES * count)
    time = np.cumsum(dwell + 5.0) + 120.0 * pose
    return Design(theta[pose], np.tile(steps, (POSES, 1)), time, dwell, pose, np.zeros(len(pose), dtype=bool))


Plant = Callable[[Files, np.random.Generator], tuple[Files, tuple[str, ...]]]


def _sign(column: str) -> Plant:
    def plant(case: Files, rng: np.random.Generator) -> tuple[Files, tuple[str, ...]]:
        axis = int(rng.integers(3))
        values = getattr(case, column) * np.where(np.arange(3) == axis, -1, 1)
        return replace(case, **{column: values}), (f"{_name(column)}_sign[{'xyz'[axis]}]",)

    return plant


def _swapped(column: str) -> Plant:
    def plant(case: Files, rng: np.random.Generator) -> tuple[Files, tuple[str, ...]]:
        a, b = sorted(rng.permutation(3)[:2])
        order = np.arange(3)
        order[[a, b]] = b, a
        return replace(case, **{column: getattr(case, column)[:, order]}), (f"{_name(column)}_swapped[{'xyz'[a]}{'xyz'[b]}]",)

    return plant


def _cyclic(column: str) -> Plant:
    def plant(case: Files, rng: np.random.Generator) -> tuple[Files, tuple[str, ...]]:
        by = int(rng.choice([1, 2]))
        letters = ["fx fy fz", "dx dy dz"][column == "moved"].split()
        mended = " ".join(np.roll(letters, -by))
        return replace(case, **{column: np.roll(getattr(case, column), by, axis=1)}), (f"{_name(column)}_axes[{mended}]",)

    return plant


def _name(column: str) -> str:
    return "force" if column == "force" else "deflection"


def _joints_swapped(case: Files, rng: np.random.Generator) -> tuple[Files, tuple[str, ...]]:
    a = int(rng.integers(5))
    order = np.arange(6)
    order[[a, a + 1]] = a + 1, a
    return replace(case, theta=case.theta[:, order]), (f"joints_swapped[{a + 1}{a + 2}]",)


def _joint_sign(case: Files, rng: np.random.Generator) -> tuple[Files, tuple[str, ...]]:
    joint = int(rng.integers(6))
    return replace(case, theta=case.theta * np.where(np.arange(6) == joint, -1, 1)), (f"joint_sign[{joint + 1}]",)


def _joint_zero(case: Files, rng: np.random.Generator) -> tuple[Files, tuple[str, ...]]:
    joint = int(rng.integers(6))
    shift = np.where(np.arange(6) == joint, 2.0 * rng.choice([-1, 1]), 0.0)
    return replace(case, theta=case.theta + shift), (f"joint_zero[{joint + 1}]",)


def _radians(case: Files, rng: np.random.Generator) -> tuple[Files, tuple[str, ...]]:
    return replace(case, theta=np.radians(case.theta)), ("radians",)


def _tool_frame(case: Files, rng: np.random.Generator) -> tuple[Files, tuple[str, ...]]:
    """Forces as a sensor behind the tool shows them: by the virtual arm's own kinematics, or the packages'."""
    if case.robot_text:
        from tests.virtual_cell.plant import Plant as Arm

        solver = Arm(case.stiffness).solver
        turns = np.array([solver.tcp_pose(solver.place(q))[1] for q in np.radians(case.theta)])
    else:
        from identification.model.kinematics import forward

        turns = forward(read_robot(built_in_robots()[case.robot]), np.radians(case.theta), Frame.identity()).rotation
    return replace(case, force=np.einsum("nji,nj->ni", turns, case.force)), ("force_frame[tool]",)


def _base_turned(case: Files, rng: np.random.Generator) -> tuple[Files, tuple[str, ...]]:
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    angle = -90 if rng.random() < 0.5 else 90
    turn = turn if angle == -90 else turn.T
    moved = np.where(turn == 0, 0.0, turn * case.moved[:, None]).sum(axis=2)    # an empty cell moves to another column
    return replace(case, force=case.force @ turn.T, moved=moved), (f"axes_turned[z {angle}]",)


def _tcp(case: Files, rng: np.random.Generator) -> tuple[Files, tuple[str, ...]]:
    return replace(case, tcp=case.tcp + np.array([0, 0, 20.0 * rng.choice([-1, 1])])), ("tcp",)


def _tcp_inches(case: Files, rng: np.random.Generator) -> tuple[Files, tuple[str, ...]]:
    return replace(case, tcp=case.tcp / 25.4), ("tcp_unit[inches]",)


def _of_part(case: Files) -> np.ndarray:
    labels = list(dict.fromkeys(case.pose))
    return np.isin(case.pose, labels[len(labels) // 2:])


def _sign_in_part(case: Files, rng: np.random.Generator) -> tuple[Files, tuple[str, ...]]:
    flipped, names = _sign("force")(case, rng)
    return replace(case, force=np.where(_of_part(case)[:, None], flipped.force, case.force)), names


def _column_unit(case: Files, rng: np.random.Generator) -> tuple[Files, tuple[str, ...]]:
    axis = int(rng.integers(3))
    return replace(case, moved=case.moved * np.where(np.arange(3) == axis, 0.1, 1.0)), (f"deflection_unit[{'xyz'[axis]}]",)


def _reference(case: Files, rng: np.random.Generator) -> tuple[Files, tuple[str, ...]]:
    """The force sensor was zeroed under a load of 60 N: to the springs the same as a reference taken under it."""
    direction = rng.standard_normal(3)
    return replace(case, force=case.force + 60.0 * direction / np.linalg.norm(direction)), ("reference_load",)


def _slipped(column: str, by: int, name: str, *, half: bool = False) -> Plant:
    """From the first row, or from somewhere in the middle on, cells stand lower (by > 0) or higher; what falls off is lost, and
    what is left over stands twice."""
    def plant(case: Files, rng: np.random.Generator) -> tuple[Files, tuple[str, ...]]:
        values = getattr(case, column)
        first = int(rng.integers(len(values) // 3, 2 * len(values) // 3)) if half else 0
        source = np.arange(len(values))
        source[first:] = np.clip(source[first:] - by, first, len(values) - 1)
        return replace(case, **{column: values[source]}), (f"{name}[{by:+d}]", f"readings_slipped[{-by:+d}]")

    return plant


def _poses_slipped(case: Files, rng: np.random.Generator) -> tuple[Files, tuple[str, ...]]:
    """The angles of each pose stand at the next one."""
    labels = list(dict.fromkeys(case.pose))
    first = np.array([case.pose.index(labels[max(labels.index(label) - 1, 0)]) for label in case.pose])
    return replace(case, theta=case.theta[first]), ("joints_slipped[+1]",)


def _scaled(column: str, factor: float, *names: str) -> Plant:
    return lambda case, rng: (replace(case, **{column: factor * getattr(case, column)}), names)


def _times(factor: float, name: str) -> Plant:
    return lambda case, rng: (replace(case, time=factor * case.time, dwell=case.dwell * (factor if factor > 1 else 1)), (name,))


def _raw(case: Files, rng: np.random.Generator) -> tuple[Files, tuple[str, ...]]:
    """What the gauges show: they stand somewhere when a pose begins."""
    labels = list(dict.fromkeys(case.pose))
    stands = rng.uniform(-300, 300, (len(labels), 3))
    return replace(case, moved=case.moved + stands[[labels.index(label) for label in case.pose]], anew=True), ("readings_raw",)


def _stepwise(column: str, name: str) -> Plant:
    """Each row holds what changed since the row before, at each pose from the first row on."""
    def plant(case: Files, rng: np.random.Generator) -> tuple[Files, tuple[str, ...]]:
        values, same = getattr(case, column), np.array([False, *(a == b for a, b in pairwise(case.pose))])
        before = np.where(same[:, None], np.roll(np.nan_to_num(values), 1, axis=0), 0.0)
        return replace(case, **{column: values - before}), (f"{name}_stepwise",)

    return plant


def _unsigned(column: str, name: str) -> Plant:
    return lambda case, rng: (replace(case, **{column: np.abs(getattr(case, column))}), (f"{name}_unsigned",))


def _turns(case: Files, rng: np.random.Generator) -> tuple[Files, tuple[str, ...]]:
    """The small hand was not read, of gauges that go round at least once."""
    largest = np.nanmax(np.abs(case.moved))
    turn = max((turn for turn in (100.0, 200.0, 500.0, 1000.0) if 1.5 * turn < largest), default=100.0)
    return replace(case, moved=np.sign(case.moved) * (np.abs(case.moved) % turn)), ("readings_turns",)


def _at_the_end(case: Files, rng: np.random.Generator) -> tuple[Files, tuple[str, ...]]:
    """Gauges that go no farther than two thirds of what the largest deflection would be."""
    end = np.nanmax(np.abs(case.moved)) / 1.5
    return replace(case, moved=np.clip(case.moved, -end, end)), ("readings_clipped",)


def _third_with_second(case: Files, rng: np.random.Generator) -> tuple[Files, tuple[str, ...]]:
    """q3 as the angle to another link than the controller's."""
    theta = case.theta.copy()
    theta[:, 2] += (-1 if case.robot_text else 1) * theta[:, 1]
    return replace(case, theta=theta), ("joint_coupling", "joint_coupling[-1]")


MISTAKES: dict[str, Plant] = {
    "force sign": _sign("force"), "deflection sign": _sign("moved"), "forces swapped": _swapped("force"),
    "deflections swapped": _swapped("moved"), "forces cyclic": _cyclic("force"), "deflections cyclic": _cyclic("moved"),
    "force in tool frame": _tool_frame, "base turned 90": _base_turned, "joints swapped": _joints_swapped,
    "joint sign": _joint_sign, "joint zero 2 deg": _joint_zero, "radians": _radians, "TCP 20 mm": _tcp,
    "TCP in inches": _tcp_inches, "sign in the second half": _sign_in_part, "one deflection x 0.1": _column_unit,
    "zeroed under load": _reference, "times in ms": _times(1000.0, "time_unit[ms]"),
    "readings a row low": _slipped("moved", 1, "readings_slipped"),
    "readings a row high": _slipped("moved", -1, "readings_slipped", half=True),
    "forces a row low": _slipped("force", 1, "forces_slipped", half=True), "poses one down": _poses_slipped,
    "times in minutes": _times(1 / 60, "time_unit[minutes]"), "forces in kgf": _scaled("force", 1 / 9.80665, "unit"),
    "forces in lbf": _scaled("force", 1 / 4.44822, "unit"), "forces in kN": _scaled("force", 1e-3, "unit"),
    "readings raw": _raw, "readings stepwise": _stepwise("moved", "readings"), "forces stepwise": _stepwise("force", "forces"),
    "forces unsigned": _unsigned("force", "forces"), "deflections unsigned": _unsigned("moved", "deflections"),
    "turns not counted": _turns, "gauges at their end": _at_the_end, "q3 with q2": _third_with_second,
    "deflections in mm": _scaled("moved", 1e-3, "unit"), "deflections in mil": _scaled("moved", 1 / 25.4, "unit"),
}


def two_robots(seed: int, robot: str = VIRTUAL) -> Files:
    """The second half of the rows is another robot's of the same type, with other springs."""
    first = right(seed, robot)
    second = _in_a_shop(seed, seed + 500_000) if robot == SHOP else right(seed + 500_000, robot)
    part = _of_part(first)
    later = np.isin(second.pose, list(dict.fromkeys(second.pose))[:len(set(second.pose)) // 2])
    joined = {name: np.concatenate([getattr(first, name)[~part], getattr(second, name)[later]])
              for name in ("theta", "force", "moved", "dwell")}
    time = np.concatenate([first.time[~part], first.time[~part][-1] + second.time[later]])
    labels = [label for label, other in zip(first.pose, part, strict=True) if not other]
    labels += [f"S{label}" for label, own in zip(second.pose, later, strict=True) if own]
    return replace(first, time=time, pose=labels, **joined)

"""The virtual cell obeys mechanics, and its effects are the contract's: to first order where they are linear, near otherwise.

The formulas are the dictionary's (identification/model/effects/), worked out here from the drawing of the arm, not with MuJoCo.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.support import long
from tests.virtual_cell.arm_model import ELBOW, FLANGE, FOREARM, HEIGHT, LOWER_ARM, SHOULDER, ZERO_FLANGE, Tool
from tests.virtual_cell.cell import Hidden, simulate
from tests.virtual_cell.designs import Design
from tests.virtual_cell.hidden import install
from tests.virtual_cell.plant import Plant

STIFFNESS = np.array([1.6e6, 5.1e6, 1.5e6, 0.5e6, 0.2e6, 0.08e6])
STRUCTURE = [
    *(Hidden("bearing_tilt", joint) for joint in range(1, 6)), Hidden("link_bending", 2), Hidden("link_bending", 3),
    *(Hidden(name) for name in ("base_rocking", "base_shift", "force_sensor_compliance", "spindle_compliance",
                                "wrist_coupling", "parallelogram"))]


@dataclass
class Drawing:
    """Points [m] and axes of the arm at one pose: joint frames' origins (after d) and the TCP, base_from_* rotations."""

    column: Rotation
    lower: Rotation
    forearm: Rotation
    hand: Rotation
    flange: Rotation
    origin: dict[int, np.ndarray]
    tcp: np.ndarray


def draw_arm(q: np.ndarray) -> Drawing:
    column = Rotation.from_euler("z", q[0])
    lower, forearm = column * Rotation.from_euler("y", q[1]), column * Rotation.from_euler("y", q[2])
    wrist_turn = forearm * Rotation.from_euler("x", q[3])
    hand = wrist_turn * Rotation.from_euler("y", q[4])
    flange = hand * Rotation.from_euler("x", q[5]) * Rotation.from_matrix(ZERO_FLANGE)
    shoulder = column.apply([SHOULDER, 0, HEIGHT])
    elbow = shoulder + lower.apply([0, 0, LOWER_ARM])
    wrist = elbow + forearm.apply([FOREARM, 0, ELBOW])
    disc = wrist + hand.apply([FLANGE, 0, 0])
    origin = {1: np.array([0, 0, HEIGHT]), 2: shoulder, 3: elbow, 4: wrist, 5: wrist, 6: disc}
    axes = Drawing(column, lower, forearm, hand, flange, origin, disc + flange.apply(Tool().tcp))
    axes.origin[0] = np.zeros(3)
    return axes


def tilts(arm: Drawing, joint: int) -> np.ndarray:
    """The axes across a joint: any two for an isotropic tilt; across joint 4 the one that is not joint 5's own."""
    if joint == 4:
        five = arm.hand.apply([0, 1, 0])
        return np.cross(arm.forearm.apply([1, 0, 0]), five)[None]
    axis, turn = {1: ([0, 0, 1], arm.column), 2: ([0, 1, 0], arm.lower), 3: ([0, 1, 0], arm.forearm),
                  5: ([0, 1, 0], arm.hand)}[joint]
    return turn.apply([row for row in np.eye(3) if not np.array_equal(row, axis)])


def bending(arm: Drawing, link: int, force: np.ndarray) -> np.ndarray:
    """TCP displacement per 1/EI of a cantilever's end shift and slope."""
    length, turn, along, end = {2: (LOWER_ARM, arm.lower, 2, arm.origin[3]), 3: (FOREARM, arm.forearm, 0, arm.origin[4])}[link]
    lever, moved = arm.tcp - end, np.zeros(3)
    for across in {0, 1, 2} - {along}:
        shift = turn.apply(np.eye(3)[across])
        slope = np.cross(turn.apply(np.eye(3)[along]), shift)
        moment = np.cross(lever, force) @ slope
        if link == 2 and across == 0:       # the rod's plane: the elbow carries no moment, the forearm does not turn
            moved += shift * (force @ shift) * length**3 / 3
        else:
            moved += shift * ((force @ shift) * length**3 / 3 + moment * length**2 / 2)
            moved += np.cross(slope, lever) * ((force @ shift) * length**2 / 2 + moment * length)
    return moved


def columns(arm: Drawing) -> np.ndarray:
    """J~ (6, 3): TCP motion [m/rad] about each serial axis."""
    axes = [np.array([0, 0, 1.0]), arm.lower.apply([0, 1, 0]), arm.lower.apply([0, 1, 0]), arm.forearm.apply([1, 0, 0]),
            arm.hand.apply([0, 1, 0]), arm.hand.apply([1, 0, 0])]
    return np.array([np.cross(axis, arm.tcp - arm.origin[i]) for i, axis in enumerate(axes, 1)])


def expected(hidden: Hidden, size: float, arm: Drawing, force: np.ndarray) -> np.ndarray:
    """What the effect adds to the deflection (3,) [m], by the dictionary's formula."""
    def turned(axes: np.ndarray, pivot: np.ndarray) -> np.ndarray:
        motion = np.cross(axes, arm.tcp - pivot)
        return motion.T @ (motion @ force)

    serial = columns(arm)
    if hidden.effect == "link_bending":
        return size * bending(arm, hidden.joint or 0, force)
    if hidden.effect == "bearing_tilt":
        return size * turned(tilts(arm, hidden.joint or 0), arm.origin[hidden.joint or 0])
    if hidden.effect == "base_rocking":
        return size * turned(np.eye(3)[:2], np.zeros(3))
    if hidden.effect == "base_shift":
        return size * force * [1, 1, 0]
    if hidden.effect == "force_sensor_compliance":
        return size * turned(arm.flange.apply(np.eye(3)[:2]), arm.origin[6])
    if hidden.effect == "spindle_compliance":
        axis = arm.flange.apply([0, 0, 1])
        return size * (force - axis * (axis @ force))
    if hidden.effect == "wrist_coupling":
        return size * (serial[4] * (serial[5] @ force) + serial[5] * (serial[4] @ force))
    assert hidden.effect == "parallelogram"
    other, ideal = serial[1] - size * serial[2], serial[1] - serial[2]
    return (other * (other @ force) - ideal * (ideal @ force)) / STIFFNESS[1]


@pytest.mark.parametrize("hidden", STRUCTURE, ids=lambda hidden: f"{hidden.effect}{hidden.joint or ''}")
def test_linear_effects_are_the_contracts_to_first_order(hidden: Hidden) -> None:
    case = simulate(11, "poses20", [hidden], "none", stiffness=STIFFNESS, gravity=False)
    size = next(iter(case.truth[0]["parameters"].values()))
    formula = np.array([expected(hidden, size, draw_arm(q), w[:3]) for q, w in zip(case.theta, case.wrench, strict=True)])
    error = np.sqrt(np.mean((1e-6 * case.effect_um - formula) ** 2) / np.mean(formula**2))
    assert error < 0.01


def with_everything(gravity: bool) -> Plant:
    plant, rng = Plant(STIFFNESS, gravity=gravity), np.random.default_rng(0)
    design = simulate(0, "paper5").design
    for hidden in STRUCTURE[:-1]:
        install(plant, hidden, rng, design)
    return plant


def one_pose(load: np.ndarray) -> Design:
    count = len(load)
    theta = np.tile(np.radians([25, 20, 35, 50, 60, -70.0]), (count, 1))
    clock = np.arange(count, dtype=float)
    return Design(theta, load, clock, np.ones(count), np.ones(count, dtype=int), np.zeros(count, dtype=bool))


@pytest.mark.parametrize("gravity", [False, True])
def test_reciprocity(gravity: bool) -> None:
    """Maxwell-Betti: what a small load along a moves along b, the same load along b moves along a."""
    plant = with_everything(gravity)
    ahead, _ = plant.displacement(one_pose(10 * np.eye(3)))
    back, _ = plant.displacement(one_pose(-10 * np.eye(3)))
    matrix = (ahead - back) / 20
    np.testing.assert_allclose(matrix, matrix.T, atol=1e-7 * np.abs(matrix).max())
    assert (np.linalg.eigvalsh(matrix) > 0).all()


def loop_work(plant: Plant) -> float:
    """Work [N m] that a load of 300 N does on the tool when it goes round a circle in the y-z plane."""
    angle = np.linspace(0, 2 * np.pi, 181)
    load = 300 * np.stack([0 * angle, np.cos(angle), np.sin(angle)], axis=1)
    design = one_pose(np.concatenate([load, load[1:]]))         # the first round is the way in
    moved, _ = plant.displacement(design)
    return float(sum((a + b) @ (e - d) / 2 for a, b, d, e in zip(
        design.load[180:], design.load[181:], moved[180:], moved[181:], strict=False)))


def test_a_load_that_goes_round_does_no_work_on_springs_and_some_on_friction() -> None:
    """And gets some from the dictionary's hysteresis, whose twist runs ahead of the torque: no passive gear does that."""
    energy, work = 300 * 3e-4, {}
    for name in ("none", "gear_friction", "hysteresis"):
        plant = with_everything(gravity=True)
        if name != "none":
            install(plant, Hidden(name, 1), np.random.default_rng(0), one_pose(np.zeros((1, 3))))
        work[name] = loop_work(plant)
    assert abs(work["none"]) < 1e-4 * energy
    assert work["gear_friction"] > 1e-2 * energy
    assert work["hysteresis"] < -1e-2 * energy


def test_rod_stays_closed_and_solutions_are_at_rest() -> None:
    plant = with_everything(gravity=True)
    state = plant.solver.solve(np.radians([25, 20, 35, 50, 60, -70.0]), lambda torque: plant.compliance @ torque,
                               np.array([300.0, -300, 300]))
    assert state.residual < 1e-12
    plant.solver.tcp_pose(state.z)
    data = plant.solver.data
    np.testing.assert_allclose(data.site("rod_end").xpos, data.site("lever").xpos, atol=1e-12)
    np.testing.assert_allclose(plant.compliance @ state.torque, state.x, atol=1e-12)


def gear_torques(seed: int, joint: int) -> Iterator[tuple[Drawing, float, float, int]]:
    """(arm, gravity torque, load torque at the gear, pose) of each row of a ladder."""
    case = simulate(seed, "ladder12", noise="none", stiffness=STIFFNESS)
    plant = Plant(STIFFNESS)
    for q, w, pose in zip(case.theta, case.wrench, case.design.pose, strict=True):
        rest, state = (plant.solver.solve(q, lambda torque: plant.compliance @ torque, force) for force in (np.zeros(3), w[:3]))
        gear = plant.drive(joint)
        yield draw_arm(q), rest.torque[gear], state.torque[gear] - rest.torque[gear], int(pose)


@pytest.mark.parametrize(("effect", "joint"), [
    ("backlash", 1), long("backlash", 5), long("soft_zone", 1), ("soft_zone", 5), long("hysteresis", 1), ("hysteresis", 3)])
def test_gear_laws_are_near_the_contracts(effect: str, joint: int) -> None:
    """Near, so that a fit of the dictionary finds the parameters; not the same, so that it is a test."""
    case = simulate(12, "ladder12", [Hidden(effect, joint)], "none", stiffness=STIFFNESS)
    size, threshold = [*case.truth[0]["parameters"].values(), None][:2]
    formula, slip, pose, last = [], 0.0, -1, 0.0
    for arm, gravity, load, number in gear_torques(12, joint):
        if effect == "backlash":
            extra = np.sign(gravity + load) * (abs(gravity + load) > 1e-6) - np.sign(gravity) * (abs(gravity) > 1e-6)
        elif effect == "soft_zone":
            extra = np.clip((gravity + load) / threshold, -1, 1) - np.clip(gravity / threshold, -1, 1)
        else:
            slip, last = (slip, last) if number == pose else (0.0, 0.0)
            slip = extra = float(np.clip(slip + (load - last) / threshold, -1, 1))
            pose, last = number, load
        direction = columns(arm)[joint - 1]     # drive joints 1, 3 and 5 turn what their serial axes turn
        formula.append(size * extra * direction)
    error = np.sqrt(np.mean((1e-6 * case.effect_um - formula) ** 2) / np.mean(np.square(formula)))
    print(f"{effect}[{joint}]: {error:.1%} off the dictionary's law")
    assert 1e-3 < error < 0.35

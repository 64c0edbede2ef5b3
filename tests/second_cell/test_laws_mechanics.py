"""The second cell obeys mechanics: energy, reciprocity, work in closed cycles, and formulas of textbooks for its parts.

Only the last tests know the packages: the plain arm must agree with them, for both were written apart from each other.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from identification.fit.fitted_model import predicted_deflection
from identification.fit.load_test import LoadTest
from identification.measurements import read_measurements
from identification.model.cell import read_cell
from identification.model.effects import effects
from tests.second_cell.arm import Arm, Law, Rows
from tests.second_cell.cell import FOREIGN, Hidden, simulate
from tests.second_cell.chain import placed
from tests.second_cell.effects import DICTIONARY, EFFECTS
from tests.second_cell.hidden import World
from tests.second_cell.laws import BoucWen, Cubic, KelvinVoigt, Play, SmoothZone, Softening, Strut
from tests.second_cell.plans import Plan
from tests.second_cell.rest import Load, at_rest
from tests.second_cell.robots import ROBOTS, robot

ROD, SERIAL = ROBOTS[0], ROBOTS[1]
TOOL = np.array([0.11, 0.0, 0.24])
RIGID = np.full(6, 1e15)
Q = np.radians([[20.0, 15, 25, 40, 55, -30], [-35, 35, 10, -70, -40, 80]])
MEMORY = ("backlash", "hysteresis", "breakaway", "creep")
ELASTIC = ("soft_zone", "cubic_gear", "gravity_compensator", "wrist_coupling", "parallelogram", "bearing_tilt", "link_bending",
           "base_rocking", "base_shift", "force_sensor_compliance", "spindle_compliance")


def visit(q: np.ndarray, loads: np.ndarray, dwell: float = 0.0) -> Plan:
    """One visit, loads (n, 3) [N] one after the other."""
    n = len(loads)
    return Plan(np.tile(q, (n, 1)), np.asarray(loads, dtype=float), np.arange(1.0, n + 1), np.full(n, dwell), np.zeros(n, int))


def hidden(name: str, effect: str, factor: float = 1.0, stiffness: np.ndarray | None = None, tool: np.ndarray = TOOL,
           plan: Plan | None = None, which: int = -1) -> World:
    """A world with that effect at the last joint it can sit at (which: another of them)."""
    arm = Arm(robot(name), tool, robot(name).stiffness if stiffness is None else stiffness)
    plan = visit(Q[0], np.zeros((1, 3))) if plan is None else plan
    world = World(arm, plan, plan.q.copy())
    entry = EFFECTS[effect]
    entry.build(world, entry.joints[which] if entry.joints else 0, factor, np.random.default_rng(3))
    return world


@pytest.mark.parametrize("name", ROBOTS)
def test_at_rest_the_energy_is_least(name: str) -> None:
    arm, rng = robot(name), np.random.default_rng(1)
    given, force = Q @ arm.drive.T, np.array([[200.0, -300, 150], [-350, 80, 220]])
    load = Load(5, arm.tcp_home(TOOL), force)
    springs = np.diag(arm.stiffness)
    u, _ = at_rest(arm.screws, given, arm.drive, lambda u: (u @ springs, np.tile(springs, (2, 1, 1))), [load], np.zeros((2, 6)))

    def energy(u: np.ndarray) -> np.ndarray:
        tcp = placed(arm.screws, given + u @ arm.drive.T).point(5, load.home)
        return 0.5 * np.sum(arm.stiffness * u**2, axis=1) - np.sum(force * tcp, axis=1)

    assert np.abs(u).max() > 1e-5
    for _ in range(50):
        assert np.all(energy(u + 2e-5 * rng.standard_normal((2, 6))) > energy(u))


@pytest.mark.parametrize("effect", ["", *ELASTIC])
def test_small_loads_are_answered_reciprocally(effect: str) -> None:
    """Betti: what a load along y moves along x is what a load along x moves along y."""
    arm = hidden(ROD, effect).arm if effect else Arm(robot(ROD), TOOL, robot(ROD).stiffness)
    for q in Q:
        moved = arm.displacement(visit(q, np.concatenate([np.eye(3), -np.eye(3)])), np.concatenate([np.eye(3), -np.eye(3)]))
        compliance = (moved[:3] - moved[3:]) / 2
        assert np.abs(compliance - compliance.T).max() < 1e-6 * np.abs(compliance).max()


@pytest.mark.parametrize("name", ROBOTS)
def test_the_small_load_limit_is_the_second_derivative_of_the_energy(name: str) -> None:
    """`d = H_pu H_uu^-1 H_up F`, by differences of the rigid arm's TCP over the drives."""
    arm, step = robot(name), 1e-6
    for q in Q:
        slope = np.array([arm.tcp(q[None] + step * e, TOOL)[0] - arm.tcp(q[None] - step * e, TOOL)[0]
                          for e in np.eye(6)]).T / (2 * step)
        expected = slope @ np.diag(1 / arm.stiffness) @ slope.T
        moved = Arm(arm, TOOL, arm.stiffness).displacement(visit(q, np.eye(3)), np.eye(3))
        np.testing.assert_allclose(moved, expected, atol=1e-5 * np.abs(expected).max())


def work(plan: Plan, moved: np.ndarray) -> np.ndarray:
    """Of the load (n - 1,) [J] from row to row."""
    return np.sum((plan.load[1:] + plan.load[:-1]) / 2 * np.diff(moved, axis=0), axis=1)


@pytest.mark.parametrize("effect", [*ELASTIC, *MEMORY])
def test_a_closed_cycle_takes_work_or_none(effect: str) -> None:
    """Springs give back what they took; friction and creep never give more."""
    reach, way = np.array([250.0, 300, -200]), np.linspace(-1, 1, 33)
    loads = np.outer(np.concatenate([way[16:], way[::-1], way, way[::-1]]), reach)
    plan = visit(Q[0], loads, dwell=3.0)
    moved = hidden(ROD, effect, plan=plan, which=0).arm.displacement(plan, loads)
    done = work(plan, moved)
    cycle, largest = float(done[-65:].sum()), float(np.abs(np.cumsum(done)).max())
    if effect in MEMORY:
        assert cycle > 1e-3 * largest
    else:
        assert abs(cycle) < 1e-6 * largest


def test_springs_do_not_care_for_the_way() -> None:
    """Round a triangle of loads in space the work is nothing."""
    corners = np.array([[0.0, 0, 0], [350, 0, 0], [0, 300, 200], [0, 0, 0]])
    loads = np.concatenate([a + (b - a) * np.linspace(0, 1, 60)[:, None] for a, b in pairwise(corners)])
    plan = visit(Q[1], loads)
    done = work(plan, Arm(robot(SERIAL), TOOL, robot(SERIAL).stiffness / 10).displacement(plan, loads))
    assert abs(done.sum()) < 1e-6 * np.abs(np.cumsum(done)).max()


ROWS = Rows(np.tile(Q[0], (9, 1)), np.full(9, 900.0), np.full(9, 7.0), np.arange(9))


@pytest.mark.parametrize("law", [
    SmoothZone(0, 2e6, 3e-5, 7e-5), Cubic(0, 1e6, 1e-4), Play(0, 4e-5, 2e8, np.linspace(-0.4, 0.4, 9)), BoucWen(0, 80.0, 3e-5),
    KelvinVoigt(0, 2e6, np.array([0.02, 0.03]), np.array([2.0, 30])), Softening(0, 2e6, 0.1, 2400),
    Strut(0, 3e7, 0.25, 0.6, 1.1),
], ids=lambda law: type(law).__name__)
def test_a_law_says_its_own_slope(law: Law) -> None:
    x = np.linspace(-1.3e-4, 1.1e-4, 9)
    law.begin(np.full(9, 1e-5), ROWS)
    law.settle(np.full(9, -2e-5), ROWS)
    step = 1e-11
    ahead, behind = law.pull(x + step, ROWS)[0], law.pull(x - step, ROWS)[0]
    np.testing.assert_allclose(law.pull(x, ROWS)[1], (ahead - behind) / (2 * step), rtol=1e-3, atol=10)


def test_bouc_wen_is_its_differential_equation() -> None:
    law, width = BoucWen(0, 1.0, 2e-5), 2e-5
    path = np.concatenate([np.linspace(0, 5e-5, 6), np.linspace(4e-5, -6e-5, 9), np.linspace(-5e-5, 3e-5, 7)])
    law.begin(np.zeros(1), ROWS)
    z, x, one = 0.0, 0.0, Rows(Q[:1], *(np.zeros(1, int) for _ in range(3)))
    for target in path:
        dx = (target - x) / 4000
        for _ in range(4000):
            z += dx / width * (1 - z**2 * (z * dx > 0))
        x = target
        assert law.pull(np.array([x]), one)[0][0] == pytest.approx(z, abs=2e-3)
        law.settle(np.array([x]), one)
        assert abs(z) < 1


def test_creep_follows_its_time_constant() -> None:
    """One element on joint 1: at once 1 / k, then `share (1 - exp(-t / T))` of it more; unloaded, it goes back as slowly."""
    arm = Arm(robot(SERIAL), TOOL, np.array([1e6, *RIGID[1:]]))
    arm.laws = [KelvinVoigt(0, 1e6, np.array([0.2]), np.array([10.0]))]
    loads = np.array([[0.0, 1, 0], [0, 1, 0], [0, 0, 0]])
    plan = visit(np.array([0.0, 0, 0, 0, 0.3, 0]), loads)
    plan = Plan(plan.q, loads, plan.time, np.array([0.0, 10, 20]), plan.visit)
    y = arm.displacement(plan, loads)[:, 1]
    gone = 0.2 * (1 - np.exp(-1))
    np.testing.assert_allclose(y / y[0], [1, 1 + gone, gone * np.exp(-2)], rtol=1e-5)


def test_backlash_jumps_by_its_gap() -> None:
    """Joint 1, a hundred newtons one way and back: twice the half gap at the TCP beside what the spring gives."""
    loads = np.array([[0.0, 100, 0], [0, -100, 0]])
    plan = visit(np.zeros(6), loads)
    with_gap = World(Arm(robot(SERIAL), TOOL, robot(SERIAL).stiffness), plan, plan.q.copy())
    EFFECTS["backlash"].build(with_gap, 1, 2.0, np.random.default_rng(1))
    plain = Arm(robot(SERIAL), TOOL, robot(SERIAL).stiffness).displacement(plan, loads)
    more = with_gap.arm.displacement(plan, loads) - plain
    reach = robot(SERIAL).tcp(np.zeros((1, 6)), TOOL)[0, 0]
    assert more[0, 1] - more[1, 1] == pytest.approx(2 * 2 * 4.6e-5 * reach, rel=0.1)


@pytest.mark.parametrize("name", [ROD, SERIAL])
def test_a_bent_forearm_is_a_cantilever(name: str) -> None:
    """The TCP put to the wrist: P L^3 / 3 EI but for the sixty-fourth that four pieces leave."""
    arm = robot(name)
    tool = np.array([0.0, 0, -(arm.flange - arm.joints[2])[0]])
    length = (arm.joints[2] - arm.joints[1])[0]
    world = hidden(name, "link_bending", 1.0, RIGID, tool)
    moved = world.arm.displacement(visit(np.zeros(6), np.eye(3)), np.eye(3))
    np.testing.assert_allclose(moved, np.diag([0, 1, 1]) * 7.9e-8 * length**3 / 3 * (1 - 1 / 64), rtol=1e-4, atol=1e-13)


def test_the_rod_holds_the_forearm_while_the_lower_arm_bends() -> None:
    """In the arm's plane the moment of a load h above and r before the elbow does not bend the lower arm of a parallel-rod
    robot; without rod it adds h L^2 + h^2 L and r^2 L."""
    plan = visit(np.zeros(6), np.array([[1.0, 0, 0], [0, 0, 1]]))
    for name in (ROD, SERIAL):
        moved = hidden(name, "link_bending", 1.0, RIGID, plan=plan, which=0).arm.displacement(plan, plan.load) / 7.9e-8
        shoulder, elbow, _ = robot(name).joints
        length, (r, _, h) = (elbow - shoulder)[2], robot(name).tcp(np.zeros((1, 6)), TOOL)[0] - elbow
        free = 0.0 if name == ROD else 1.0
        assert moved[0, 0] == pytest.approx(length**3 / 3 * (1 - 1 / 64) + free * (h * length**2 + h**2 * length), rel=1e-3)
        assert moved[1, 2] == pytest.approx(free * r**2 * length, rel=1e-3, abs=1e-6)


def test_three_feet_rock_and_shift() -> None:
    """Upright force at reach r: r^2 / 2e7 and what three feet give upright, 2e7 / (1.5 r_f^2) each; sideways 1 / 2e7."""
    plan = visit(np.zeros(6), np.eye(3))
    reach, _, height = robot(SERIAL).tcp(np.zeros((1, 6)), TOOL)[0]
    rocks = hidden(SERIAL, "base_rocking", 1.0, RIGID).arm.displacement(plan, plan.load)
    assert rocks[2, 2] == pytest.approx(reach**2 / 2e7 + 1.5 * 0.4**2 / 3 / 2e7, rel=1e-4)
    assert rocks[0, 0] == pytest.approx(height**2 / 2e7, rel=1e-4)
    shifts = hidden(SERIAL, "base_shift", 1.0, RIGID).arm.displacement(plan, plan.load)
    np.testing.assert_allclose(np.diag(shifts)[[0, 2]], [1 / 2e7, 0], atol=1e-12)


def test_struts_and_spindle_have_their_size_at_the_tool() -> None:
    tool = np.array([0.0, 0, 0.8])
    plan = visit(np.zeros(6), np.eye(3))
    struts = hidden(SERIAL, "force_sensor_compliance", 1.0, RIGID, tool).arm.displacement(plan, plan.load)
    assert struts[1, 1] == pytest.approx(3e-6 * 0.8**2, rel=0.1)
    spindle = hidden(SERIAL, "spindle_compliance", 1.0, RIGID, tool).arm.displacement(plan, plan.load)
    np.testing.assert_allclose(np.diag(spindle), [0, 6.7e-8, 6.7e-8], rtol=1e-3, atol=1e-12)


def test_gear_5_turns_axis_6_as_much_as_gear_6_axis_5() -> None:
    """To first order the compliance of the two drives is [[c5, rho c5], [rho c5, c6 + rho^2 c5]]."""
    arm = hidden(SERIAL, "wrist_coupling").arm
    share = arm.hinge_of(6).gives[4]
    slope = np.array([[1, 0], [share, 1]])
    compliance = slope @ np.diag(1 / arm.stiffness[4:]) @ slope.T
    assert compliance[0, 1] == pytest.approx(share / arm.stiffness[4])
    assert abs(compliance[0, 1]) == pytest.approx(1e-6)


def test_a_ball_stands_back() -> None:
    world = hidden(SERIAL, "target_curvature", 1.0)
    aside = np.array([[0.0, 6e-4, 8e-4], [0, 0, 0]])
    shown = world.reading[0](aside)
    assert abs(shown[0, 0]) == pytest.approx(1e-6 / 2 / 0.01, abs=1e-3 * 1e-4 / 0.01)
    np.testing.assert_allclose(shown[1], 0, atol=1e-15)


def test_the_cylinder_leans_across_its_line() -> None:
    loads = np.array([[0.0, 100, 0], [0, 300, 0], [0, 150, 0], [0, 0, 0], [0, -200, 0]])
    world = hidden(SERIAL, "side_load", 1.0, plan=visit(Q[0], loads))
    aside = world.force[0](loads) - loads
    np.testing.assert_allclose(aside[:, 1], 0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(aside, axis=1), 0.032 * np.linalg.norm(loads, axis=1), rtol=1e-9)
    assert aside[1] @ aside[2] < 0


@pytest.mark.parametrize("effect", [name for name in EFFECTS if name != "pose_typo"])
def test_an_effect_of_no_size_is_none(effect: str) -> None:
    """Teeth that touch keep a hundredth of the gear's softness."""
    name = ROD if EFFECTS[effect].rod else SERIAL
    loads = np.array([[0.0, 250, 0], [0, 0, -300], [100, 50, 20]])
    plan = visit(Q[1], loads, dwell=5.0)
    world = hidden(name, effect, 1e-6, plan=plan)
    force = loads
    for fault in world.force:
        force = fault(force)
    moved = world.arm.displacement(plan, force)
    for fault in world.reading:
        moved = fault(moved)
    plain = Arm(robot(name), TOOL, robot(name).stiffness).displacement(plan, loads)
    tolerance = 0.02 if effect == "backlash" else 1e-4
    assert np.abs(moved - plain).max() < tolerance * np.abs(plain).max()


@pytest.mark.parametrize("weight", ["none", "known"])
@pytest.mark.parametrize(("name", "seed"), [*((name, 7) for name in ROBOTS), (FOREIGN, 1), (FOREIGN, 5)])
def test_the_plain_arm_agrees_with_the_packages(name: str, seed: int, weight: str, tmp_path: Path) -> None:
    """To the table's last digit without weight; to a nanometre of most of a millimetre with it. So does a robot of nobody's
    under the ceiling (1), and one at a wall whose load pulls beside the TCP (5), but for the turn of that arm."""
    case = simulate(seed, "five", "none", (), name, weight)
    cell_file, table = case.write(tmp_path)
    cell = read_cell(cell_file)
    rows = read_measurements(table, cell.robot)
    off = predicted_deflection(LoadTest.of(cell, rows), -np.log(case.stiffness)) - rows.deflection
    assert np.abs(rows.deflection).max() > 3e-4
    assert case.setting.base.any() == (name == FOREIGN)
    assert case.setting.hook.any() == (seed == 5)
    assert np.abs(off).max() < (2e-7 if seed == 5 else 2e-9 if weight == "known" or seed == 1 else 1e-11)
    assert not rows.findings


def test_what_is_hidden_has_a_name() -> None:
    """The dictionary's, that an answer may be right; all of gears, structure, base, tool and sensors."""
    answered = {Hidden(name).truth["effect"] for name in DICTIONARY}
    assert answered <= set(effects())
    assert len(answered) == 30

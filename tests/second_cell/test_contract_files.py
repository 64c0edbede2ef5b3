"""The strata of noise are what their names say, and the files are ones a user would have."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from identification.measurements import read_measurements
from identification.model.cell import read_cell
from tests.second_cell.cell import FOREIGN, Hidden, drawn, parsed, simulate
from tests.second_cell.effects import DICTIONARY, OUTSIDE
from tests.second_cell.noise import STRATA, Noise, draw_noise, reading, real_force
from tests.second_cell.plans import PLANS, Plan, cycles
from tests.second_cell.robots import ROBOTS, robot


def _plan(visits: int = 400, rows: int = 10) -> Plan:
    count = visits * rows
    load = np.tile([[100.0, 0, -300]], (count, 1))
    return Plan(np.zeros((count, 6)), load, np.arange(count) * 1.0, np.ones(count), np.repeat(np.arange(visits), rows))


@pytest.mark.parametrize("stratum", STRATA)
def test_the_noise_has_its_sizes(stratum: str) -> None:
    rng, plan = np.random.default_rng(5), _plan()
    noise = draw_noise(stratum, rng)
    shown = reading(noise, plan, np.zeros_like(plan.load), rng).reshape(400, 10, 3)
    if stratum != "autocorrelated":
        assert shown.std(axis=1, ddof=1).std() < noise.sensor * 2
        within = np.sqrt(np.mean(shown.var(axis=1, ddof=1)))
        assert within == pytest.approx(np.hypot(noise.sensor, noise.digit / np.sqrt(12)), rel=0.25)
    seating = shown.mean(axis=1)
    assert np.sqrt(np.mean(seating**2)) == pytest.approx(np.hypot(noise.seating, noise.sensor / np.sqrt(10)), rel=0.4)
    off = real_force(noise, plan, rng) - plan.load
    np.testing.assert_allclose(off.std(axis=0), np.hypot(noise.relative * np.abs(plan.load[0]), noise.absolute), rtol=0.1)


def test_the_strata_differ_as_they_say() -> None:
    rng, plan = np.random.default_rng(6), _plan()
    zero = np.zeros_like(plan.load)
    remembered = reading(Noise(sensor=1.0, memory=0.6), plan, zero, rng).reshape(400, 10, 3)
    assert np.mean(remembered[:, 1:] * remembered[:, :-1]) == pytest.approx(0.6, abs=0.03)
    assert remembered.std() == pytest.approx(1, abs=0.03)
    coarse = reading(Noise(sensor=2.0, digit=1.0), plan, zero, rng)
    np.testing.assert_array_equal(coarse, np.round(coarse))
    heavy = reading(Noise(sensor=1.0, sensor_degrees=3), plan, zero, rng)
    assert np.mean(np.abs(heavy) > 4) > 10 * 6.3e-5
    off = (real_force(Noise(relative=0.01, by_visit=True), plan, rng) - plan.load).reshape(400, 10, 3)
    assert np.ptp(off, axis=1).max() < 1e-10 < np.ptp(off[:, 0], axis=0)[0]


@pytest.mark.parametrize("plan", PLANS)
@pytest.mark.parametrize("stratum", ["sheet", "unstated"])
def test_the_files_are_read_without_a_word(plan: str, stratum: str, tmp_path: Path) -> None:
    for weight in ("known", "unknown"):
        case = simulate(1, plan, stratum, (), None, weight)
        cell_file, table = case.write(tmp_path)
        cell = read_cell(cell_file)
        rows = read_measurements(table, cell.robot)
        assert [finding.code for finding in rows.findings] == ["CS1007"] * (not case.plan.read.all())
        np.testing.assert_allclose(rows.deflection, np.where(case.plan.read, 1e-6 * case.reading, np.nan), atol=1e-11)
        assert len(np.unique(rows.visit)) == case.plan.visits


@pytest.mark.parametrize("name", ROBOTS)
def test_poses_are_the_robots(name: str) -> None:
    """Inside the limits of the built-in robot, in front of it, not singular; nothing is drawn twice."""
    rng, tool = np.random.default_rng(2), np.array([0.1, 0, 0.2])
    plan = cycles(robot(name), tool, rng)
    poses = plan.q[::len(plan.q) // plan.visits]
    assert len(np.unique(poses, axis=0)) == plan.visits
    assert np.abs(poses[:, 4]).min() >= np.radians(20)
    tcp = robot(name).tcp(poses, tool)
    assert tcp[:, 2].min() > 0.2
    assert np.hypot(*tcp[:, :2].T).min() > 0.8


def test_what_a_shop_might_do_is_each_of_its_kinds() -> None:
    """Of 60 drawn: one load a pose and several, unlike directions and none but down, one, two and three gauges, all as said."""
    model, tool = robot(ROBOTS[0]), np.array([0.1, 0, 0.2])
    drawn_plans = [PLANS["shop"](model, tool, np.random.default_rng(seed)) for seed in range(60)]
    for plan in drawn_plans:
        rows = len(plan.q) // plan.visits
        assert 5 <= plan.visits <= 16
        assert 1 <= rows <= 8
        assert 99 < np.linalg.norm(plan.load, axis=1).max() < 451
        assert plan.read.any(axis=1).all()
        assert np.all((plan.load * plan.read).any(axis=1) | ~plan.load.any(axis=1) | (plan.read.sum(axis=1) > 1))
    assert {len(plan.q) > plan.visits for plan in drawn_plans} == {True, False}
    assert {int(plan.read[0].sum()) for plan in drawn_plans} == {1, 2, 3}
    down = [not plan.load[:, :2].any() for plan in drawn_plans]
    assert 1 <= sum(down) <= 15


def test_a_robot_of_nobodys_is_read_as_it_stands(tmp_path: Path) -> None:
    """Of thirty: on the floor, leaning, at a wall and under the ceiling; the load at the TCP and beside it, as moments say."""
    cases = [simulate(seed, "shop", "near", (), FOREIGN, "known") for seed in range(30)]
    turned = {round(np.degrees(np.linalg.norm(case.setting.base)) / 45) for case in cases}
    assert turned == {0, 2, 4}
    assert len({round(float(np.linalg.norm(case.setting.base)), 3) for case in cases}) > 5
    for case in cases[:8]:
        cell_file, table = case.write(tmp_path)
        cell = read_cell(cell_file)
        rows = read_measurements(table, cell.robot)
        np.testing.assert_allclose(cell.world_from_base.rotation.T @ [0, 0, -9.81], case.setting.fall, atol=1e-7)
        arm = case.robot.tcp(case.plan.q, case.tool + case.setting.hook) - case.robot.tcp(case.plan.q, case.tool)
        np.testing.assert_allclose(rows.wrench[:, 3:], np.cross(arm, case.plan.load), atol=1e-6)
    assert 3 < sum(case.setting.hook.any() for case in cases) < 20


def test_a_seed_is_a_case() -> None:
    once, again = (simulate(4, "five", "near", (Hidden("drift"),)) for _ in range(2))
    np.testing.assert_array_equal(once.reading, again.reading)
    assert parsed("backlash:1:2+drift") == (Hidden("backlash", 1, 2.0), Hidden("drift", 0, 1.0))
    assert parsed("none") == ()
    for seed in range(30):
        first, second = drawn(seed, "cycles", DICTIONARY, 2)[0]
        assert first.effect != second.effect
        assert 0.5 <= first.factor <= 2
        assert drawn(seed, "cycles", OUTSIDE)[0][0].effect in OUTSIDE

"""Which slips are said to mend a visit: those that are likely and fit."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import chi2

from identification.fit import mending
from identification.fit.load_test import LoadTest
from identification.fit.noise_parts import VarianceComponents
from identification.fit.slips import Slip
from tests.identification.fit.exact_rows import by_compliance
from tests.identification.fit.test_laws_posterior import TRUE, simulate

RIGHT, SLIGHT = (chi2.isf(chance, 3) for chance in (1.1e-3, 0.9e-3))


@pytest.mark.parametrize(("weight", "fits", "told"), [
    ([0.0, -1.0, -9.0], [1.0, RIGHT, 1.0], [0, 1]), ([0.0, -1.0, -9.0], [1.0, SLIGHT, 1.0], [0]),
    ([0.0, -2.36, -9.0], [1.0, 1.0, 1.0], [0]), ([0.0, -2.15, -9.0], [1.0, 1.0, 1.0], [0, 1]),
    ([0.0, -1.0, -9.0], [SLIGHT, RIGHT, 1.0], [1]), ([-8.0, -8.0, -8.0], [1.0, 1.0, 1.0], [])])
def test_a_slip_is_told_that_is_likely_and_fits(
    monkeypatch: pytest.MonkeyPatch, weight: list[float], fits: list[float], told: list[int],
) -> None:
    """A twentieth among all and "none of them" (ln likelihood 0), and a misfit that chance makes in one of a thousand."""
    slips = [Slip(f"kind {k}", f"slip {k}", np.zeros(6)) for k in range(3)]
    visit = SimpleNamespace(expected=None, anything=lambda: 0.0, directions=3, angles_off=list,
                            judged=lambda slips: (np.array(weight), np.array(fits)))
    monkeypatch.setattr(mending, "slips_of", lambda *of: iter(slips))
    monkeypatch.setattr(mending, "_new", lambda *of: True)
    monkeypatch.setattr(mending, "_Visit", lambda *of: visit)
    rows: Any = SimpleNamespace(row=np.arange(4), theta=np.zeros((4, 6)), select=lambda mine: None)
    score: Any = SimpleNamespace(rows=np.array([1, 2]))
    rest: Any = None
    found = mending.mends(rest, rows, score, 1.0, frozenset())
    assert [mend.what for mend in found] == [f"slip {k}" for k in told]
    chance = np.exp(np.array([*weight, 0.0]))
    assert [mend.probability for mend in found] == pytest.approx(list((chance / chance.sum())[told]))


def test_a_response_off_in_any_way_is_as_likely_as_its_parts_are_on_average() -> None:
    """Off by 3 %, by 10 %, or by half of itself: a third each, by the likelihoods themselves."""
    likely = {0.03: 2e-3, 0.1: 0.5, 0.5: 0.04}
    visit: Any = SimpleNamespace(_rows=SimpleNamespace(theta=np.zeros((4, 6))), _loads=None, _own=None,
                                 _against=lambda theta, loads, own, part: (np.log([likely[part]]), np.zeros(1)))
    assert mending._Visit.anything(visit) == pytest.approx(np.log((2e-3 + 0.5 + 0.04) / 3))


SENSOR, SEAT, LOAD, SCALE = 1.5, 2.5, 4.0, 1.6
TABLE = np.radians([20.0, 25.0, 10.0, 40.0, 50.0, 60.0])
CELL = ("robot: irb6660-205-1.90\ntool: {position_mm: [120, 0, 250]}\nmeasurement: {deflection_std_um: [0.02, 0.02, 0.02], "
        "force_relative_std: 0, force_std_n: [0, 0, 0], pose_offset_std_um: [0.03, 0.03, 0.03]}\n")


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> LoadTest:
    """One visit of six rows; noise of the sensor and of re-seating alone."""
    cell, rows = simulate(tmp_path_factory.mktemp("mending"), np.random.default_rng(5), poses=1, loads=6, text=CELL, quiet=True)
    return LoadTest.of(cell, rows)


def response_at(data: LoadTest, theta: np.ndarray) -> np.ndarray:
    """Each spring's share (6, 3, 3) of what the independent arm yields by one newton along each axis [m]."""
    each = [by_compliance(theta[None], data.cell.flange_from_tcp.position, axis[None])[0] for axis in np.eye(3)]
    return np.moveaxis(np.array(each), (0, 1, 2), (2, 1, 0)) / TRUE[:, None, None]


@pytest.mark.parametrize(("both_ways", "links", "shared"), [(True, True, 0.005), (True, False, 0.03), (False, True, 0.005)])
def test_a_visit_s_response_is_held_against_that_of_the_springs_at_any_pose(
        data: LoadTest, both_ways: bool, links: bool, shared: float) -> None:
    """One load along each axis, there and back, or there alone, when re-seating cannot be told apart. What is open of it: the
    sensor's noise, re-seating, how well the springs are known, and a force error of half a per cent, or of three where nobody
    knows the arm's weight; all of it times the test's scale."""
    force = LOAD * (np.vstack([np.eye(3), -np.eye(3)]) if both_ways else np.eye(3))
    count = len(force)
    robot = replace(data.cell.robot, link_mass=np.zeros(6), link_centre=np.zeros((6, 3)))
    cell = replace(data.cell, robot=robot if links else replace(robot, link_mass=None, link_centre=None))
    rows = data.rows.select(np.arange(count))
    true = TABLE + np.radians([0, 0, 3.0, 0, 0, 0])
    whole = response_at(data, true).sum(axis=0)
    rows = replace(rows, theta=np.tile(TABLE, (count, 1)), wrench=np.hstack([force, np.zeros((count, 3))]),
                   deflection=force @ whole.T)
    root = np.random.default_rng(3).standard_normal((6, 6))
    spread = 1e-4 * (np.eye(6) + 0.3 * root @ root.T)
    rest: Any = SimpleNamespace(data=replace(data, cell=cell), compliance=1 / TRUE, map=-np.log(TRUE), terms=(), laplace=spread,
                                components=VarianceComponents(sensor=SENSOR, offset=SEAT))
    visit = mending._Visit(rest, rows, SCALE)
    assert visit.directions == 9
    # Of displacements by the load along x, y and z, (9,), x y z of each.
    noise = (SENSOR * 2e-8) ** 2
    seat = (SEAT * 3e-8) ** 2 * np.kron(np.ones((3, 3)), np.eye(3))
    open_of = noise / 2 * np.eye(9) if both_ways else noise * np.eye(9) + seat
    measured = (LOAD * whole.T).ravel()

    def against(theta: np.ndarray, times: float) -> tuple[float, float]:
        parts = response_at(data, theta)
        told = times * LOAD * parts.sum(axis=0).T.ravel()
        by_springs = times * LOAD * np.array([part.T.ravel() for part in parts])
        by_force = np.kron(np.eye(3), (shared * times * LOAD) ** 2 * parts.sum(axis=0) @ parts.sum(axis=0).T)
        allowed = SCALE * (open_of + by_springs.T @ spread @ by_springs + by_force)
        off = measured - told
        return float(off @ np.linalg.solve(allowed, off)), float(np.linalg.slogdet(allowed)[1])

    slips = [Slip("none", "", TABLE), Slip("angle", "", true), Slip("size", "", TABLE, 2.0 * force),
             Slip("loads of fewer axes", "", TABLE, force * [1.0, 1.0, 0.0])]
    value, misfit = visit.judged(slips)
    wanted = [against(TABLE, 1.0), against(true, 1.0), against(TABLE, 2.0)]
    assert_allclose(misfit[:3], [distance for distance, _ in wanted], rtol=2e-3, atol=0.05)
    assert misfit[1] < 0.05 < 2 < misfit[0]
    # Of densities of other units: their differences.
    log_density = np.array([-0.5 * (distance + volume) for distance, volume in wanted])
    assert value[1] - value[0] == pytest.approx(log_density[1] - log_density[0], rel=2e-3)
    # Coefficients are told of twice the load, so that the same readings are half the response.
    assert value[2] - value[0] == pytest.approx(log_density[2] - log_density[0], rel=2e-3)
    assert (value[3], misfit[3]) == (-np.inf, np.inf)
    assert_allclose(visit.expected, force @ response_at(data, TABLE).sum(axis=0).T, rtol=1e-3, atol=1e-10)


def test_readings_put_back_are_likelier_by_what_they_leave_in_the_rows(data: LoadTest) -> None:
    """Two readings exchanged: put back they are the springs', in the tails of four degrees that weigh a visit's rows."""
    force = LOAD * np.vstack([np.eye(3), -np.eye(3)])
    right = force @ response_at(data, TABLE).sum(axis=0).T
    wrong = right.copy()
    wrong[[0, 4]] = wrong[[4, 0]]
    rows = replace(data.rows.select(np.arange(6)), theta=np.tile(TABLE, (6, 1)), deflection=wrong,
                   wrench=np.hstack([force, np.zeros((6, 3))]))
    rest: Any = SimpleNamespace(data=data, compliance=1 / TRUE, map=-np.log(TRUE), terms=(), laplace=1e-4 * np.eye(6),
                                components=VarianceComponents(sensor=SENSOR, offset=SEAT))
    visit = mending._Visit(rest, rows, SCALE)
    put_back = Slip("readings exchanged", "", TABLE, readings=right)
    (as_it_is, back), (off, none) = visit.judged([Slip("none", "", TABLE), put_back])
    again = mending._Visit(rest, replace(rows, deflection=right), SCALE)
    (straight,), (fits,) = again.judged([Slip("none", "", TABLE)])
    assert none == pytest.approx(fits, abs=1e-6)
    assert none < 0.1 < off
    left = visit._own.left[0] - again._own.left[0]
    assert left > 10
    assert back - straight == pytest.approx(0.5 * left / SCALE)
    assert back > as_it_is + 0.5 * left / SCALE


@pytest.mark.parametrize(("mine", "others", "told"), [
    (0, {}, ""), (0, {2: 0}, "P2"), (0, {2: 0, 1: 0}, "P1"), (1, {2: 1, 0: 1}, "P0")])
def test_a_visit_with_the_angles_of_another_is_told_as_copied(mine: int, others: dict[int, int], told: str) -> None:
    """The first of them by its rows; its own rows, and those of a pose of its name, are none."""
    angles = np.random.default_rng(2).uniform(-1, 1, (4, 6))
    for visit, of in others.items():
        angles[visit] = angles[of]
    angles[3] = angles[mine]
    visits = np.repeat(np.arange(4), 2)
    names = np.array(["P0", "P1", "P2", f"P{mine}"], dtype=object)
    rows: Any = SimpleNamespace(row=np.arange(1, 9), theta=angles[visits], pose=names[visits], line=np.arange(2, 10))
    score: Any = SimpleNamespace(rows=rows.row[visits == mine], name=f"P{mine}")
    assert mending._copied(rows, score) == told

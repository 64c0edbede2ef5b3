"""Laws of gears, links and columns against answers of their own: beams slice by slice, springs in series, loads one by one."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from identification.fit.load_test import LoadTest
from identification.measurements import read_measurements
from identification.model.cell import read_cell
from identification.model.effects import effects
from identification.model.law_of import known
from identification.model.load_state import LoadState, load_state
from identification.model.rotations import Frame
from tests.support import random_poses, robot, write_cell

TOOL = Frame(np.eye(3), np.array([0.1, 0.0, 0.2]))
COMPLIANCE = 1 / np.array([1.6e6, 5.1e6, 1.5e6, 0.5e6, 0.2e6, 0.08e6])


def drawn(count: int = 8, *, heavy: bool = False, moments: bool = False) -> LoadState:
    """Loads at poses of a robot with articulated arm, which may weigh something."""
    arm, rng = robot("irb6700-200-2.60"), np.random.default_rng(11)
    if heavy:
        arm = replace(arm, link_mass=np.array([500, 400, 300, 100, 40, 20.0]), link_centre=np.full((6, 3), 0.2))
    wrench = rng.uniform(-400, 400, (count, 6)) * [1, 1, 1, 0.3, 0.3, 0.3]
    wrench[:, 3:] *= moments
    return load_state(arm, TOOL, random_poses(arm, count, rng, 0.6), wrench, COMPLIANCE)


@pytest.mark.parametrize(("law", "joint", "values"), [
    ("link_bending.twist", 2, [1e-7]), ("link_bending.beam", 2, [1e-7]), ("base_rocking.column", None, [5e-8, 0.7]),
    ("bearing_tilt.each", 1, [9e-8, 3e-8, 0.4]),
    ("base_rocking.platform", None, [3e-8, 5e-8, 2e-8, 4e-8, 6e-8, 3e-8, 0.4, -0.2, -0.8])])
def test_maxwell_betti(law: str, joint: int | None, values: list[float]) -> None:
    """What a load along a moves along b, the same load along b moves along a; no load gains energy."""
    rows, effect = drawn(), known(law)
    assert effect is not None
    units = [load_state(rows.robot, TOOL, rows.theta, np.repeat(unit[None], len(rows), axis=0), COMPLIANCE, at_load=True)
             for unit in np.eye(6)]
    matrix = np.stack([effect.contribution(unit, joint, np.array(values)) for unit in units], axis=2)
    assert np.abs(matrix).max() > 0
    assert_allclose(matrix, np.swapaxes(matrix, 1, 2), atol=1e-12 * np.abs(matrix).max())
    assert np.all(np.linalg.eigvalsh(matrix)[:, 0] > -1e-12 * np.abs(matrix).max())


def test_a_column_bends_as_its_curvature_integrates() -> None:
    """Slice by slice: each turns what is above it by M / EI, M the load's moment about the slice, level."""
    rows, height, compliance = drawn(moments=True), 0.9, 6e-8
    effect = known("base_rocking.column")
    assert effect is not None
    moved, slices = np.zeros((len(rows), 6)), 4000
    for z in -height * (np.arange(slices) + 0.5) / slices:
        arms = rows.tcp - np.array([0.0, 0.0, z])
        moment = np.cross(arms, rows.wrench[:, :3]) + rows.wrench[:, 3:]
        turn = compliance / slices * moment * [1.0, 1.0, 0.0]
        moved += np.concatenate([np.cross(turn, arms), turn], axis=1)
    assert_allclose(effect.contribution(rows, None, np.array([compliance, height])), moved, atol=1e-6 * np.abs(moved).max())


@pytest.mark.parametrize("angle", [0.0, 2.4, -1.1])
def test_a_foot_that_lifts_turns_about_the_line_of_the_anchors_that_hold(angle: float) -> None:
    """Loads that press the loose side down move nothing, the others turn the robot about a level line through the base."""
    rows, lifting = drawn(moments=True), known("base_rocking.lifting")
    assert lifting is not None
    moved, line = lifting.contribution(rows, None, np.array([6e-8, angle])), np.array([np.cos(angle), np.sin(angle), 0.0])
    moment = (np.cross(rows.tcp, rows.wrench[:, :3]) + rows.wrench[:, 3:]) @ line
    assert (moment > 0).any()
    assert (moment < 0).any()
    turn = 6e-8 * np.where(moment > 0, moment, 0.0)[:, None] * line
    assert_allclose(moved, np.concatenate([np.cross(turn, rows.tcp), turn], axis=1), atol=1e-12 * np.abs(moved).max())


@pytest.mark.parametrize("fall", [(0.0, 0.0, -9.81), (4.0, -2.0, 8.7)])
def test_a_loose_foot_lifts_once_load_and_weight_together_pass_what_holds_it(fall: tuple[float, ...]) -> None:
    """In small steps of the load, each of which tilts it where it is open: so where the weight alone holds it open all the way,
    it tilts as a soft base does, and where weight or anchor hold it down, from the load on that lifts it."""
    rows, opens = replace(drawn(24, moments=True), fall=np.array(fall)), known("base_rocking.opens")
    assert opens is not None
    compliance, angle, holds, weight, steps = 6e-8, 2.4, 150.0, 260.0, 4000
    line = np.array([np.cos(angle), np.sin(angle), 0.0])
    load = (np.cross(rows.tcp, rows.wrench[:, :3]) + rows.wrench[:, 3:]) @ line
    arm = np.cross(rows.origins[:, 4], weight / np.linalg.norm(fall) * np.array(fall)) @ line
    share = (np.arange(steps) + 0.5) / steps
    open_for = np.mean(arm[:, None] + share * load[:, None] > holds, axis=1)
    assert (open_for == 0).any()
    assert (open_for == 1).any()
    assert ((open_for > 0.1) & (open_for < 0.9)).any()
    turn = compliance * (load * open_for)[:, None] * line
    moved = opens.contribution(rows, None, np.array([compliance, angle, holds, weight]))
    expected = np.concatenate([np.cross(turn, rows.tcp), turn], axis=1)
    assert_allclose(moved, expected, atol=2e-3 * np.abs(expected).max())


def test_a_twisted_arm_turns_all_beyond_it_about_the_line_from_shoulder_to_elbow() -> None:
    rows, effect = drawn(moments=True), known("link_bending.twist")
    assert effect is not None
    moved = effect.contribution(rows, 2, np.array([1e-7]))
    for n in range(len(rows)):
        shoulder, elbow = rows.origins[n, 1], rows.origins[n, 2]
        u = (elbow - shoulder) / np.linalg.norm(elbow - shoulder)
        moment = u @ (np.cross(rows.tcp[n] - shoulder, rows.wrench[n, :3]) + rows.wrench[n, 3:])
        turn = 1e-7 * np.linalg.norm(elbow - shoulder) * moment * u
        expected = np.concatenate([np.cross(turn, rows.tcp[n] - shoulder), turn])
        assert_allclose(moved[n], expected, atol=1e-12 * np.abs(expected).max())


def test_a_one_sided_gear_has_two_compliances() -> None:
    """Under the arm's weight, load by load: how far it stands with the load, less how far without."""
    rows, joint, share = drawn(heavy=True), 2, 0.2
    moved = effects()["one_sided"].contribution(rows, joint, np.array([share]))

    def twist(torque: float) -> float:
        return COMPLIANCE[joint - 1] * (1 + share if torque > 0 else 1 - share) * torque

    for n in range(len(rows)):
        g, tau = rows.gravity[n, joint - 1], rows.torque[n, joint - 1]
        more = twist(g + tau) - twist(g) - COMPLIANCE[joint - 1] * tau
        assert_allclose(moved[n], rows.jacobian[n, :, joint - 1] * more, rtol=1e-9, atol=1e-18)
    sides = np.sign(rows.gravity[:, joint - 1] + rows.torque[:, joint - 1])
    assert set(sides) == {-1.0, 1.0}


@pytest.mark.parametrize("joint", [2, 5])
def test_a_gear_that_opens_beyond_its_preload(joint: int) -> None:
    """Two springs in series, the second of which does nothing up to its preload."""
    rows, share, preload = drawn(heavy=True), 0.4, 60.0
    moved = effects()["soft_beyond"].contribution(rows, joint, np.array([share, preload]))

    def opened(torque: float) -> float:
        return float(np.sign(torque)) * max(abs(torque) - preload, 0.0) * share * COMPLIANCE[joint - 1]

    for n in range(len(rows)):
        g, tau = rows.gravity[n, joint - 1], rows.torque[n, joint - 1]
        assert_allclose(moved[n], rows.jacobian[n, :, joint - 1] * (opened(g + tau) - opened(g)), rtol=1e-9, atol=1e-18)
    cubic = known("soft_beyond.cubic")
    assert cubic is not None
    moved = cubic.contribution(rows, joint, np.array([3.0]))
    for n in range(len(rows)):
        g, tau = 1e-3 * rows.gravity[n, joint - 1], 1e-3 * rows.torque[n, joint - 1]
        more = 3e3 * COMPLIANCE[joint - 1] * ((g + tau) ** 3 - g**3)
        assert_allclose(moved[n], rows.jacobian[n, :, joint - 1] * more, rtol=1e-9, atol=1e-18)


def test_one_element_creeps_as_the_sum_of_its_steps() -> None:
    """Each change of the load creeps on from when it came, and comes to an end; each visit begins from rest."""
    arm, rng, ratio, time = robot(), np.random.default_rng(4), 0.05, 12.0
    held = np.array([6.0, 20.0, 11.0, 40.0, 5.0] * 2)
    force = np.zeros((10, 6))
    force[:, 1] = [100, 300, 0, -200, 0] * 2
    rows = load_state(arm, TOOL, np.repeat(random_poses(arm, 2, rng, 0.6), 5, axis=0), force, np.full(6, 1e-6), dwell=held)
    rows = replace(rows, visit=np.repeat(np.array([0, 1]), 5), time=np.cumsum(held + 4.0) + 300.0 * np.repeat([0, 1], 5))
    twist, expected = rows.compliance * rows.torque, np.zeros((10, 6))
    for n in range(10):
        first = 5 * (n // 5)
        for k in range(first, n + 1):
            age = rows.time[n] - (rows.time[k] - rows.dwell[k])
            step = twist[k] - (twist[k - 1] if k > first else 0.0)
            expected[n] += ratio * (1 - np.exp(-age / time)) * (rows.jacobian[n] @ step)
    element = known("creep.element")
    assert element is not None
    assert_allclose(element.contribution(rows, None, np.array([ratio, time])), expected, atol=1e-12 * np.abs(expected).max())


def test_a_sensor_that_is_turned_in_its_seat_turns_with_the_flange() -> None:
    """A quarter about the flange's z: what it calls x was y there."""
    rows, effect = drawn(), known("force_misalignment.flange")
    assert effect is not None
    true = effect.true_wrench(rows, None, np.array([0.0, 0.0, np.pi / 2]))
    assert true is not None
    for n in range(len(rows)):
        read = rows.flange[n].T @ rows.wrench[n, :3]
        assert_allclose(rows.flange[n].T @ true[n, :3], [-read[1], read[0], read[2]], atol=1e-9)


def test_a_load_that_comes_from_the_same_side_of_the_cell_acts_there() -> None:
    """The springs by the work of the load: dq = c J^T w, with w moved to the point where it acts."""
    rows, effect, beside = drawn(), known("tool_point.base"), np.array([0.02, -0.03, 0.01])
    assert effect is not None
    moved = effect.contribution(rows, None, beside)
    for n in range(len(rows)):
        moment = np.concatenate([np.zeros(3), np.cross(beside, rows.wrench[n, :3])])
        expected = rows.jacobian[n] @ (COMPLIANCE * (rows.jacobian[n].T @ moment))
        assert_allclose(moved[n], expected, rtol=2e-3, atol=1e-3 * np.abs(expected).max())
    hung = replace(rows, wrench=np.concatenate([np.tile(rows.fall * 20, (len(rows), 1)), np.zeros((len(rows), 3))], axis=1))
    assert effect.missing(hung)
    assert not effect.missing(rows)


def test_a_box_bends_as_a_beam_and_twists_as_a_bar() -> None:
    """GJ = 0.385 E 1.5 I."""
    rows, beam = drawn(moments=True), known("link_bending.beam")
    twist, bent = known("link_bending.twist"), known("link_bending")
    assert beam is not None
    assert twist is not None
    assert bent is not None
    both = beam.contribution(rows, 2, np.array([1e-7]))
    parts = bent.contribution(rows, 2, np.array([1e-7])) + twist.contribution(rows, 2, np.array([1e-7 / (0.385 * 1.5)]))
    assert_allclose(both, parts, rtol=0.01, atol=0.01 * np.abs(parts).max())


def test_a_rod_that_yields_turns_the_crank_as_the_linkage_does() -> None:
    """The crank's turn by a rod that is longer, solved in the plane: shoulder, elbow, a crank at each, the rod between. What it
    carries follows from the work of the torque. The part that is the same at all poses is the gear's."""
    arm, rng = robot("irb4400-60"), np.random.default_rng(4)
    wrench = np.concatenate([rng.uniform(-400, 400, (12, 3)), np.zeros((12, 3))], axis=1)
    rows, effect = load_state(arm, TOOL, random_poses(arm, 12, rng, 0.6), wrench, COMPLIANCE), known("parallelogram.rod")
    assert effect is not None
    assert effect.missing(drawn())
    share = 0.3
    moved = effect.contribution(rows, None, np.array([share, 0.0]))
    length, crank = 1.0, 0.25
    for n in range(len(rows)):
        lower, fore = rows.origins[n, 2] - rows.origins[n, 1], rows.axes[n, 3]
        angle = np.arccos(lower @ fore / np.linalg.norm(lower))
        assert 0.2 < angle < np.pi - 0.2
        rest = crank * np.array([np.cos(angle), np.sin(angle)])

        def rod(turn: float, angle: float = angle, rest: np.ndarray = rest) -> float:
            """Length of the rod with the elbow's crank turned."""
            end = np.array([length, 0.0]) + crank * np.array([np.cos(angle + turn), np.sin(angle + turn)])
            return float(np.linalg.norm(end - rest))

        stretch = (rod(1e-6) - rod(-1e-6)) / 2e-6
        column = rows.serial_jacobian[n, :, 2]
        # c / (a sin g)^2 in units of c / a^2, the gear's compliance times the share.
        expected = share * COMPLIANCE[2] * (column @ rows.wrench[n]) * (crank / stretch) ** 2 * column
        assert_allclose(moved[n], expected, rtol=1e-4, atol=1e-5 * np.abs(expected).max())


@pytest.mark.parametrize(("law", "onward"), [("gear_creep", 1.0), ("gear_creep.recovering", -1.0)])
def test_one_gear_creeps_as_a_kelvin_element(law: str, onward: float) -> None:
    """Spring and damper side by side, step by step in time, while a load grows, turns and is taken off; a servo takes back
    what they would yield."""
    rows, effect = drawn(6), known(law)
    assert effect is not None
    share = np.array([0.5, 1.0, -1.0, 0.0, 0.3, 1.0])
    held = np.array([5.0, 30.0, 12.0, 20.0, 8.0, 15.0])
    alike = load_state(rows.robot, TOOL, np.repeat(rows.theta[:1], 6, axis=0), share[:, None] * rows.wrench[:1], COMPLIANCE)
    alike = replace(alike, visit=np.array([0, 0, 0, 0, 0, 1]), dwell=held)
    ratio, time, joint = 0.4, 18.0, 3
    twist, expected = 0.0, []
    for n in range(6):
        twist = 0.0 if n == 5 else twist
        pull = onward * ratio * COMPLIANCE[joint - 1] * alike.torque[n, joint - 1]
        for _ in range(20_000):
            twist += (pull - twist) / time * held[n] / 20_000
        expected.append(twist * alike.jacobian[n, :, joint - 1])
    moved = effect.contribution(alike, joint, np.array([ratio, time]))
    assert_allclose(moved, expected, atol=1e-3 * np.abs(expected).max())


def test_loads_without_a_time_of_their_own_are_on_since_the_reading_before() -> None:
    """Where no row says how long; the first of a visit, like most. Without any times, a minute each. What is written stands."""
    rows = replace(drawn(6), visit=np.array([0, 0, 0, 1, 1, 1]), time=np.array([10.0, 30.0, 55.0, 400.0, 425.0, 445.0]))
    nothing = np.full(6, np.nan)
    assert_allclose(replace(rows, dwell=nothing).held, [22.5, 20.0, 25.0, 22.5, 25.0, 20.0])
    assert_allclose(replace(rows, dwell=nothing, time=nothing).held, np.full(6, 60.0))
    assert_allclose(replace(rows, dwell=np.array([5.0, np.nan, 7.0, 8.0, 9.0, 1.0])).held, [5.0, 0.0, 7.0, 8.0, 9.0, 1.0])
    assert_allclose(replace(rows, dwell=nothing, at_load=True).held, np.zeros(6))


def test_a_warm_up_comes_to_an_end() -> None:
    """By halves: in each ln 2 of its time it goes half of what is left; from the reference, or the first row, on."""
    settles, rows = 900.0, drawn(5)
    rows = replace(rows, time=settles * np.log(2) * np.arange(5.0), row=np.arange(1, 6), reference=np.zeros(5, dtype=int))
    share = np.array([0.0, 0.5, 0.75, 0.875, 0.9375])
    drift, softening = known("drift.settling"), known("softening.settling")
    assert drift is not None
    assert softening is not None
    off = np.array([2e-5, -1e-5, 5e-6])
    assert_allclose(drift.contribution(rows, None, np.append(off, settles))[:, :3], share[:, None] * off, atol=1e-15)
    softer = softening.contribution(rows, None, np.array([0.2, settles]))
    assert_allclose(softer, 0.2 * share[:, None] * rows.elastic, atol=1e-15)


def lagging(torque: np.ndarray, radius: float, begin: float) -> np.ndarray:
    """A play operator of this radius: it follows the torque when that has come so far away; it begins at `begin`."""
    place, passed = begin, []
    for now in torque:
        place = min(max(place, now - radius), now + radius)
        passed.append(place)
    return np.array(passed)


def held_back(torque: np.ndarray, slip: float, elements: int, begin: float) -> np.ndarray:
    """The torque less what play operators of radii spread evenly up to `slip` make of it, in shares of the whole."""
    radii = slip * np.arange(1, elements + 1) / elements
    return sum(torque - lagging(torque, radius, -begin * radius) for radius in radii) / radii.sum()


def loaded_and_unloaded() -> LoadState:
    """Two visits, loaded up, down, the other way and back."""
    rows = drawn(24)
    share = np.concatenate([[0.0], np.array([0.3, 0.7, 1.0, 0.5, 0.0, -0.5, -1.0, -0.2, 0.0, 0.4, 0.1])])
    alike = load_state(rows.robot, TOOL, np.repeat(rows.theta[:2], 12, axis=0), np.tile(share, 2)[:, None] * np.repeat(
        rows.wrench[:2], 12, axis=0), COMPLIANCE)
    return replace(alike, visit=np.repeat([0, 1], 12))


@pytest.mark.parametrize(("law", "elements"), [("hysteresis", 1), ("hysteresis.smooth", 8)])
def test_friction_in_a_gear_is_what_lags_behind(law: str, elements: int) -> None:
    """The torque less what play operators of evenly spread radii make of it; and where the way to the pose left them elsewhere,
    against the reading that is taken first, the same with that begin."""
    alike, effect, joint = loaded_and_unloaded(), known(law), 3
    assert effect is not None
    torque = alike.torque[:, joint - 1]
    slip, amplitude = 0.6 * np.abs(torque).max(), -3e-5

    def state(part: slice, begin: float) -> np.ndarray:
        return held_back(torque[part], slip, elements, begin)

    column = alike.jacobian[:, :, joint - 1]
    values = np.array([amplitude, slip])
    plain = np.concatenate([state(slice(0, 12), 0.0), state(slice(12, 24), 0.0)])
    assert_allclose(effect.contribution(alike, joint, values), amplitude * plain[:, None] * column, atol=1e-15)
    otherwise = effect.of_each_visit(alike, joint, values)
    # Two ways that are each as wide as half of the variance of a begin that is anywhere alike.
    for way, begin in enumerate((6**-0.5, -(6**-0.5))):
        begun = np.concatenate([state(slice(0, 12), begin), state(slice(12, 24), begin)]) - begin
        assert_allclose(otherwise[:, :, way], amplitude * (begun - plain)[:, None] * column, atol=1e-15)
    assert_allclose(otherwise[[0, 12]], 0.0, atol=1e-15)


def test_a_state_is_kept_for_what_was_asked_alone() -> None:
    """In any order, on the same rows, as on rows that nothing was asked of before."""
    rows, none = loaded_and_unloaded(), ("lost_motion", None)
    asked = [(law, joint, np.append(np.full(1 if joint else 6, 1e-4), 60.0 * size if joint else 1e-4 * size))
             for size in (1, 2) for law, joint in (("hysteresis", 1), ("hysteresis", 2), ("hysteresis.smooth", 2), none)]
    shown = []
    for law, joint, values in [*asked, *asked[::4], *asked[1::4], *asked[2::4], *asked[3::4]]:
        one = known(law)
        assert one is not None
        shown.append(one.contribution(rows, joint, values))
        np.testing.assert_array_equal(shown[-1], one.contribution(replace(rows), joint, values))
    assert len({each.tobytes() for each in shown}) == len(asked)


def test_lost_motion_is_the_friction_of_every_gear() -> None:
    """Each lags behind by its own amplitude, and slips under the torque that winds it up as far as the others."""
    rows, law = loaded_and_unloaded(), known("lost_motion")
    assert law is not None
    wind_up, amplitudes = 2e-5, -1e-5 * np.array([3.0, 1.0, 2.0, 0.5, 4.0, 1.5])
    plain, begun = np.zeros((24, 6)), np.zeros((24, 6, 12))
    for joint, part in product(range(6), (slice(0, 12), slice(12, 24))):
        torque, column = rows.torque[part, joint], rows.jacobian[part, :, joint]
        of_zero = held_back(torque, wind_up / COMPLIANCE[joint], 8, 0.0)
        assert np.abs(of_zero).max() > 0.2
        plain[part] += amplitudes[joint] * of_zero[:, None] * column
        for way, begin in enumerate((6**-0.5, -(6**-0.5))):
            other = held_back(torque, wind_up / COMPLIANCE[joint], 8, begin) - begin - of_zero
            begun[part, :, 2 * joint + way] = amplitudes[joint] * other[:, None] * column
    values = np.append(amplitudes, wind_up)
    assert_allclose(law.contribution(rows, None, values), plain, atol=1e-15)
    assert_allclose(law.of_each_visit(rows, None, values), begun, atol=1e-15)


def test_a_platform_stands_on_its_feet() -> None:
    """Four feet at the corners of a rectangle, each a spring along x, y and z: the body's stiffness, foot by foot, inverted."""
    rows, platform = drawn(moments=True), known("base_rocking.platform")
    assert platform is not None
    centre, (a, b), k = np.array([0.4, -0.25, -0.7]), (0.9, 0.6), np.array([2e7, 3e7, 5e7])
    stiffness = np.zeros((6, 6))
    for sx, sy in product((-1, 1), (-1, 1)):
        x, y, z = centre + np.array([sx * a, sy * b, 0.0])
        # A foot's displacement u + turn x r, of a body that moves by u at the base origin.
        way = np.hstack([np.eye(3), np.array([[0, z, -y], [-z, 0, x], [y, -x, 0]])])
        stiffness += way.T @ np.diag(k) @ way
    turns = 1 / (4 * np.array([k[2] * b**2, k[2] * a**2, k[0] * b**2 + k[1] * a**2]))
    load = np.concatenate([rows.wrench[:, :3], np.cross(rows.tcp, rows.wrench[:, :3]) + rows.wrench[:, 3:]], axis=1)
    moved = np.linalg.solve(stiffness, load.T).T
    at_tcp = np.concatenate([moved[:, :3] + np.cross(moved[:, 3:], rows.tcp), moved[:, 3:]], axis=1)
    values = np.concatenate([turns, 1 / (4 * k), centre])
    assert_allclose(platform.contribution(rows, None, values), at_tcp, rtol=1e-9, atol=1e-15)


def test_every_gear_is_softer_near_zero() -> None:
    """Each by its own further twist, up to where its weight and the load wind it up by an angle that all have in common."""
    rows, law = drawn(heavy=True), known("soft_gears")
    assert law is not None
    wind_up, extra = 6e-5, 1e-5 * np.array([3.0, 1.0, 2.0, 0.5, 4.0, 1.5])
    plain = np.zeros((len(rows), 6))
    for joint, row in product(range(6), range(len(rows))):
        limit = wind_up / COMPLIANCE[joint]
        before = rows.gravity[row, joint]
        under_load = before + rows.torque[row, joint]
        shares = [max(-1.0, min(1.0, torque / limit)) for torque in (before, under_load)]
        plain[row] += extra[joint] * (shares[1] - shares[0]) * rows.jacobian[row, :, joint]
    assert_allclose(law.contribution(rows, None, np.append(extra, wind_up)), plain, atol=1e-15)


def test_gears_that_roll_wind_up_by_a_power_of_the_torque() -> None:
    """What the springs wind up by u, they wind up by 1 mrad (u / 1 mrad)^(1 - p)."""
    rows, rolling = drawn(), known("soft_gears.rolling")
    assert rolling is not None
    plain = np.zeros((len(rows), 6))
    for joint, row in product(range(6), range(len(rows))):
        wound = 1e3 * COMPLIANCE[joint] * rows.torque[row, joint]
        further = 1e-3 * (np.sign(wound) * abs(wound) ** 0.8 - wound)
        plain[row] += further * rows.jacobian[row, :, joint]
    assert_allclose(rolling.contribution(rows, None, np.array([0.2])), plain, atol=1e-14)
    assert_allclose(rolling.contribution(rows, None, np.zeros(1)), 0.0)


def cycled(poses: int) -> LoadState:
    """Each pose loaded up and down to one side, then less to the other, an hour in all."""
    arm, rng = drawn().robot, np.random.default_rng(8)
    steps = np.array([0.0, 1.0, 2.0, 1.0, 0.0, -1.0, 0.0])
    wrench = np.concatenate([np.outer(steps, rng.uniform(-300, 300, 6) * [1, 1, 1, 0, 0, 0]) for _ in range(poses)])
    rows = load_state(arm, TOOL, np.repeat(random_poses(arm, poses, rng, 0.6), len(steps), axis=0), wrench, COMPLIANCE)
    return replace(rows, time=np.linspace(0.0, 3600.0, len(rows)), visit=np.repeat(np.arange(poses), len(steps)))


def test_what_seats_stays_with_the_largest_torque_of_the_pose() -> None:
    rows, seats = cycled(3), known("hysteresis.seats")
    assert seats is not None
    moved = seats.contribution(rows, 2, np.array([0.1]))
    for visit in range(3):
        mine = np.flatnonzero(rows.visit == visit)
        torque = rows.torque[mine, 1]
        largest = np.array([max(torque[: k + 1], key=abs) for k in range(len(mine))])
        assert_allclose(moved[mine], rows.jacobian[mine, :, 1] * (0.1 * rows.compliance[1] * largest)[:, None], atol=1e-15)
    assert seats.missing(cycled(1))
    assert not seats.missing(rows)
    assert not seats.of_robot                       # a program has none of it


@pytest.mark.parametrize("law", ["gear_softening", "gear_softening.from"])
def test_a_gear_that_softens_is_a_softer_spring_afterwards(law: str) -> None:
    rows = cycled(4)
    softer = rows.jacobian[:, :, 4] * (rows.torque[:, 4] * 0.2 * rows.compliance[4])[:, None]
    if law == "gear_softening":
        moved, share = effects()[law].contribution(rows, 5, np.array([0.2, 1000.0])), 1 - np.exp(-rows.time / 1000.0)
    else:
        shapes = known(law).signatures(rows, 5)
        # Two poses at least.
        assert [shape.effect.where for shape in shapes] == [{"row": rows.row[7 * k]} for k in (1, 2)]
        moved, share = shapes[1].effect.contribution(rows, 5, np.array([0.2])), (rows.visit >= 2).astype(float)
    assert_allclose(moved, share[:, None] * softer, atol=1e-15)


def test_a_warm_up_goes_on_in_the_rows_that_are_not_fitted(tmp_path: Path) -> None:
    """Rows read by a clock that began at 7200 s: how soft the robot is at the last of them goes by the time since the first row
    of the file, whichever rows are asked about."""
    cell_file = write_cell(tmp_path)
    header = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,fx_n,fy_n,fz_n,dx_um,dy_um,dz_um,time_s,purpose"
    lines = [f"{10 * k},20,10,5,40,0,300,0,0,100,0,0,{7200 + 600 * k},{'validate' if k > 2 else 'identify'}" for k in range(6)]
    (tmp_path / "rows.csv").write_text("\n".join([header, *lines]) + "\n")
    cell = read_cell(cell_file)
    data = LoadTest.of(cell, read_measurements(tmp_path / "rows.csv", cell))
    for chosen in (np.arange(6) >= 0, data.rows.validate):
        rows = data.with_rows(data.rows.select(chosen)).load_state(COMPLIANCE)
        softer = effects()["softening"].contribution(rows, None, np.array([0.3]))
        assert_allclose(softer, 0.3 * (np.arange(6)[chosen] / 6)[:, None] * rows.elastic, atol=1e-15)


def test_a_foot_is_tried_that_the_rows_could_lift() -> None:
    """What holds it by shares of the largest moment that tips the arm, level: its weight, at the farthest that the wrist stands
    out; about eight axes, evenly round."""
    rows, opens = drawn(24, moments=True), known("base_rocking.opens")
    assert opens is not None
    grid = {parameter.name: np.array(opens.grid(rows, None, parameter)) for parameter in opens.parameters if parameter.grid}
    tips = np.cross(rows.tcp, rows.wrench[:, :3]) + rows.wrench[:, 3:]
    largest, reach = np.hypot(*tips[:, :2].T).max(), np.hypot(*rows.origins[:, 4, :2].T).max()
    assert_allclose(grid["holds_nm"], largest * np.array([0.0, 0.3]))
    assert_allclose(grid["weight_n"] * reach, largest * np.array([0.0, 1.0, 3.0]))
    assert_allclose(np.diff(grid["axis_rad"], append=grid["axis_rad"][0] + 2 * np.pi), np.pi / 4, atol=2e-4)


def test_a_grid_is_one_of_a_shape_and_ascends() -> None:
    """What enters linearly is found without one. The knees of soft gears are at most a factor of three apart, so that
    each gear is near one."""
    laws = [law for effect in effects().values() for law in (effect, *effect.other_laws)]
    for law in laws:
        for parameter in law.parameters:
            if parameter.grid:
                assert parameter.shape, (law.stored, parameter.name)
                assert np.all(np.diff(parameter.grid) > 0), (law.stored, parameter.name)
            if parameter.name == "torque_nm" and law.name == "soft_zone" and len(parameter.grid) > 1:
                assert np.all(np.array(parameter.grid[1:]) / parameter.grid[:-1] <= 3), law.stored


@pytest.mark.parametrize(("law", "values", "by_force"), [
    ("base_shift", [3e-8], np.diag([3e-8, 3e-8, 0])), ("base_shift.upright", [3e-8, 7e-8], np.diag([3e-8, 3e-8, 7e-8])),
    ("base_shift.each", [3e-8, 7e-8, 2e-8], np.diag([3e-8, 7e-8, 2e-8])),
    ("stand_compliance", [3e-8, 7e-8, 2e-8], np.diag([3e-8, 7e-8, 2e-8])),
    ("stand_compliance.upright", [3e-8, 7e-8], np.diag([3e-8, 3e-8, 7e-8])),
    *((f"stand_compliance.{axis}", [3e-8, -7e-8, 2e-8], np.outer([3e-8, -7e-8, 2e-8], np.eye(3)[k]))
      for k, axis in enumerate("xyz"))])
def test_a_floor_or_a_stand_moves_along_its_springs_and_does_not_turn(
    law: str, values: list[float], by_force: np.ndarray
) -> None:
    """By so many metres for each newton along base x, y and z, whatever the moment."""
    rows, effect = drawn(moments=True), known(law)
    assert effect is not None
    moved = effect.contribution(rows, None, np.array(values))
    for n, wrench in enumerate(rows.wrench):
        assert_allclose(moved[n], [*by_force @ wrench[:3], 0, 0, 0], rtol=1e-12, atol=1e-18)

"""What gauges and loading rigs get wrong, against rows written down by hand and rigid bodies that turn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from identification.model.effects import effects
from identification.model.effects.base import Effect, Signature
from identification.model.law_of import known
from identification.model.load_state import LoadState, load_state
from identification.model.rotations import Frame
from tests.support import random_poses, robot

TOOL = Frame(np.eye(3), np.array([0.1, 0.0, 0.2]))
COMPLIANCE = 1 / np.array([1.6e6, 5.1e6, 1.5e6, 0.5e6, 0.2e6, 0.08e6])


def law(name: str) -> Effect:
    effect = known(name)
    assert effect is not None
    return effect


def loaded(wrench: np.ndarray, *, poses: int | None = None) -> LoadState:
    """These loads (n, 6), each at a pose of its own, or all at `poses` of them one after the other."""
    arm, rng = robot("irb6700-200-2.60"), np.random.default_rng(17)
    count = len(wrench) if poses is None else poses
    visit = np.arange(len(wrench)) * count // len(wrench)
    state = load_state(arm, TOOL, random_poses(arm, count, rng, 0.6)[visit], wrench, COMPLIANCE)
    return replace(state, visit=visit)


def forces(sizes: list[float], along: np.ndarray) -> np.ndarray:
    return np.concatenate([np.outer(sizes, along / np.linalg.norm(along)), np.zeros((len(sizes), 3))], axis=1)


DRAWN = np.concatenate([np.random.default_rng(2).uniform(-400, 400, (9, 3)), np.zeros((9, 3))], axis=1)


def tilt(rows: LoadState, n: int) -> Rotation:
    """The tool's turn under its load, by the work of the load: dq = c J^T w."""
    return Rotation.from_rotvec(rows.jacobian[n, 3:] @ (COMPLIANCE * (rows.jacobian[n].T @ rows.wrench[n])))


@pytest.mark.parametrize(("name", "values"), [
    ("reading_point", [0.03, -0.01, 0.02]), ("reading_point.base", [0.03, -0.01, 0.02]),
    ("reading_point.gauges", [0.01, 0.02, 0.03, -0.04, 0.05, -0.06])])
def test_a_point_beside_the_tcp_moves_as_a_rigid_tool_does(name: str, values: list[float]) -> None:
    rows = loaded(DRAWN)
    read = law(name).contribution(rows, None, np.array(values))[:, :3]
    levers = np.array([[0, *values[:2]], [values[2], 0, values[3]], [*values[4:], 0]]) if name.endswith("gauges") else None
    for n in range(len(rows)):
        turn = tilt(rows, n)
        if levers is None:
            lever = np.array(values) if name.endswith("base") else rows.tool[n] @ values
            expected = turn.apply(lever) - lever
        else:
            expected = np.array([(turn.apply(lever) - lever)[axis] for axis, lever in enumerate(levers)])
        assert_allclose(read[n], expected, rtol=2e-3, atol=2e-3 * np.abs(expected).max())


def test_a_gauge_that_sticks_lags_on_both_ways() -> None:
    """Out by two steps, back, through zero to the other side; at the next pose anew. Half widths of 3 um in x, 1 in z."""
    sizes = [0, 100, 200, 100, 0, -100, 0]
    rows = loaded(np.tile(forces([float(size) for size in sizes], np.array([1.0, 2.0, -1.0])), (2, 1)), poses=2)
    read = law("gauge_friction").contribution(rows, None, np.array([3e-6, 0.0, 1e-6]))[:, :3]
    steps = np.array([0, -1, -1, 1, 1, 1, -1])
    for visit in range(2):
        mine = rows.visit == visit
        way = np.sign(rows.elastic[mine][1, :3])
        assert np.abs(np.diff(rows.elastic[mine][:, :3], axis=0)[:, [0, 2]]).min() > 6e-6
        assert_allclose(read[mine], steps[:, None] * way * [3e-6, 0.0, 1e-6], atol=1e-12)


def test_friction_takes_from_a_load_that_grows_and_adds_to_one_that_is_taken_off() -> None:
    sizes = [0.0, 100, 250, 250, 100, 0, 80]
    rows = loaded(np.tile(forces(sizes, np.array([0.0, 1.0, 1.0])), (2, 1)), poses=2)
    true = law("load_friction").true_wrench(rows, None, np.array([0.03]))
    assert true is not None
    share = np.array([0.97, 0.97, 0.97, 0.97, 1.03, 1.0, 0.97])
    assert_allclose(true, rows.wrench * np.tile(share, 2)[:, None], atol=1e-9)
    # A reading that is repeated under the load as it is (taken off: as it was) keeps the friction it had.
    again = loaded(forces([100.0, 250, 100, 100.01, 99.99], np.array([0.0, 1.0, 1.0])), poses=1)
    held = law("load_friction").true_wrench(again, None, np.array([0.03]))
    assert held is not None
    assert_allclose(held, again.wrench * np.array([0.97, 0.97, 1.03, 1.03, 1.03])[:, None], atol=1e-9)
    # A smaller load at 60 degrees to the last is none that was taken off.
    aside = np.zeros((2, 6))
    aside[:, :3] = [[300.0, 0.0, 0.0], [50.0, 50.0 * np.sqrt(3.0), 0.0]]
    grown = law("load_friction").true_wrench(loaded(aside, poses=1), None, np.array([0.03]))
    assert grown is not None
    assert_allclose(grown, 0.97 * aside, atol=1e-9)
    # One axis after the other, never exactly alike: each load grew from nothing.
    axes = loaded(np.concatenate([np.diag([500.0, 490.0, -480.0]), np.zeros((3, 3))], axis=1), poses=1)
    assert law("load_friction").missing(axes)
    assert law("load_friction").missing(loaded(forces([0.0, 100, 200], np.array([1.0, 0, 0])), poses=1))
    assert not law("load_friction").missing(rows)


@pytest.mark.parametrize("held", [0.0, 0.6])
def test_a_seal_takes_the_same_force_from_every_load_and_may_keep_it_on_the_robot(held: float) -> None:
    """Two directions one after the other at a pose, each up and down; the zero that is read once more is the next load's."""
    first, second = np.array([0.6, 0.0, 0.8]), np.array([0.0, -1.0, 0.0])
    rows = loaded(np.tile(np.concatenate([forces([0.0, 100, 250, 100, 0], first), forces([0.0, 100, 250, 100, 0], second)]),
                          (2, 1)), poses=2)
    seal = known("load_friction.seal")
    assert seal is not None
    true = seal.true_wrench(rows, None, np.array([12.0, held]))
    assert true is not None
    taken = np.array([0.0, -12.0, -12.0, 12.0, 12.0 * held])
    expected = np.concatenate([taken[:, None] * first, taken[:, None] * second])
    assert_allclose((true - rows.wrench)[:, :3], np.tile(expected, (2, 1)), atol=1e-9)
    assert seal.missing(loaded(forces([0.0, 100, 200], first), poses=1))


def test_what_seats_under_the_first_load_stays_until_the_next_pose() -> None:
    rows = loaded(np.tile(forces([0.0, 0.0, 100, 250, 0], np.array([0.0, 1.0, 0.0])), (3, 1)), poses=3)
    seats, off = known("sensor_step.seating"), np.array([25e-6, -20e-6, 15e-6])
    assert seats is not None
    read = seats.contribution(rows, None, off)
    assert_allclose(read[:, :3], np.tile(np.array([0.0, 0.0, 1.0, 1.0, 1.0]), 3)[:, None] * off, atol=1e-15)
    assert not read[:, 3:].any()
    assert seats.missing(loaded(forces([0.0, 100], np.array([1.0, 0.0, 0.0])), poses=1))


def test_a_cylinder_that_pulls_has_another_gain_than_one_that_pushes() -> None:
    """Loads along the axes of the base, both ways; there is no side to loads that point anywhere."""
    along = np.concatenate([forces([100.0, -200, 0.0], axis) for axis in np.eye(3)])
    rows, pull = loaded(along, poses=1), known("force_curve.pull")
    assert pull is not None
    true = pull.true_wrench(rows, None, np.array([0.2]))
    assert true is not None
    assert_allclose(true, rows.wrench * np.tile([1.1, 0.9, 1.0], 3)[:, None], atol=1e-9)
    assert not pull.missing(rows)
    assert pull.missing(loaded(np.abs(along), poses=1))
    assert pull.missing(loaded(forces([100.0, -200], np.array([0.6, 0.0, 0.8])), poses=1))


def test_a_curve_takes_another_share_of_large_loads() -> None:
    """Two weights read one by one, and both: the readings do not add up by twice their product."""
    rows = loaded(forces([300.0, 500.0, 800.0, 0.0], np.array([0.0, 0.0, -1.0])), poses=1)
    true = law("force_curve").true_wrench(rows, None, np.array([0.1]))
    assert true is not None
    assert_allclose(true[:, 2], [-309.0, -525.0, -864.0, 0.0])
    assert law("force_curve").missing(loaded(forces([300.0, 0.0, -310.0], np.array([1.0, 0, 0])), poses=1))
    assert not law("force_curve").missing(rows)


def test_what_has_play_lies_where_the_load_pushes_it() -> None:
    """Across the tool to the side of the force; tilted by the moment about the flange, of which a point farther out sees more.
    As far under a small load as under a large one, and by halves where it hardly goes over."""
    rows = loaded(forces([400.0, 40.0, -40.0, 10.0, 0.0], np.array([1.0, 2.0, 2.0])), poses=1)
    moved = law("tool_play").contribution(rows, None, np.array([2e-5]))
    axis, force = rows.tool[:, :, 2], rows.wrench[:, :3]
    across = force - axis * np.einsum("ni,ni->n", axis, force)[:, None]
    way = across / np.maximum(np.linalg.norm(across, axis=1), 1e-9)[:, None]
    assert_allclose(moved[:3, :3], 2e-5 * way[:3], atol=1e-9)
    assert_allclose(moved[2], -moved[1], atol=1e-8)
    assert_allclose(moved[3, :3], 2e-5 * across[3] / 20.0, atol=1e-9)
    assert_allclose(moved[4], 0.0)
    assert_allclose(moved[:, 3:], 0.0)
    tilted = law("tool_play.tilting").contribution(rows, None, np.array([1e-4]))
    arm = rows.tcp - rows.origins[:, 5]
    for n in (0, 2):
        # Work is done by the load, about an axis across flange z, by the whole half gap.
        assert_allclose(np.linalg.norm(tilted[n, 3:]), 1e-4, rtol=1e-6)
        assert abs(tilted[n, 3:] @ rows.flange[n, :, 2]) < 1e-12
        assert_allclose(tilted[n, :3], np.cross(tilted[n, 3:], arm[n]), atol=1e-9)
        moment = np.cross(np.cross(arm[n], force[n]), rows.flange[n, :, 2])
        assert tilted[n, :3] @ force[n] > 0.99 * 1e-4 * np.linalg.norm(moment)


def test_a_hook_adds_its_weight_to_each_load_and_to_none_else() -> None:
    rows = loaded(np.concatenate([forces([0.0, 100, 250, -50], np.array([1.0, 2, 2])), DRAWN]))
    true = law("hook_weight").true_wrench(rows, None, np.array([15.0]))
    assert true is not None
    size = np.linalg.norm(rows.wrench[:, :3], axis=1)
    assert_allclose(np.linalg.norm(true[:, :3], axis=1), np.where(size > 0, size + 15.0, 0.0))
    assert_allclose(np.cross(true[:, :3], rows.wrench[:, :3]), 0.0, atol=1e-9 * size.max() ** 2)
    assert law("hook_weight").missing(loaded(forces([0.0, 100, -100, 102], np.array([1.0, 0, 0]))))
    assert not law("hook_weight").missing(loaded(forces([0.0, 100, -100, 94], np.array([1.0, 0, 0]))))
    assert not law("hook_weight").missing(rows)


@pytest.mark.parametrize("name", ["force_crosstalk.one_way", "deflection_sensor_crosstalk.one_way"])
def test_cross_talk_one_way_is_a_share_of_one_axis_in_another(name: str) -> None:
    """Of y in x alone, then of x in z alone."""
    rows = loaded(DRAWN)
    for place, seen, of in ((0, 0, 1), (4, 2, 0)):
        values = np.eye(6)[place] * 0.05
        if name.startswith("force"):
            true = law(name).true_wrench(rows, None, values)
            assert true is not None
            got, source = true[:, :3] - rows.wrench[:, :3], rows.wrench[:, :3]
        else:
            got, source = law(name).contribution(rows, None, values)[:, :3], rows.elastic[:, :3]
        expected = np.zeros_like(source)
        expected[:, seen] = 0.05 * source[:, of]
        assert_allclose(got, expected, atol=1e-12 * np.abs(source).max())


def test_a_sensor_on_the_flange_talks_across_in_its_own_axes() -> None:
    """Of y in x alone, then of x in z alone, seen from the flange."""
    rows = loaded(DRAWN)
    in_flange = np.einsum("nij,ni->nj", rows.flange, rows.wrench[:, :3])
    for place, seen, of in ((0, 0, 1), (4, 2, 0)):
        true = law("force_crosstalk.one_way_flange").true_wrench(rows, None, np.eye(6)[place] * 0.05)
        assert true is not None
        expected = np.zeros_like(in_flange)
        expected[:, seen] = 0.05 * in_flange[:, of]
        assert_allclose(np.einsum("nij,ni->nj", rows.flange, true[:, :3] - rows.wrench[:, :3]), expected, atol=1e-10)


def test_a_drift_that_cycles_is_back_after_a_period() -> None:
    rows = replace(loaded(DRAWN), time=450.0 * np.arange(9), row=np.arange(1, 10), reference=np.zeros(9, dtype=int))
    off = np.array([2e-5, -1e-5, 5e-6])
    moved = law("drift.cycling").contribution(rows, None, np.array([*off, 0.0, 1800.0]))[:, :3]
    assert_allclose(moved, np.array([0, 1, 0, -1, 0, 1, 0, -1, 0.0])[:, None] * off, atol=1e-15)
    later = law("drift.cycling").contribution(rows, None, np.array([*off, np.pi / 2, 1800.0]))[:, :3]
    assert_allclose(later, np.array([0, -1, -2, -1, 0, -1, -2, -1, 0.0])[:, None] * off, atol=1e-15)


def test_an_arm_that_grows_stays_like_itself() -> None:
    """A tenth of a thousandth of the way from the foot to the tip when it is warm; 1 - 1/e of that after its time."""
    rows = replace(loaded(DRAWN), time=900.0 * np.arange(9), row=np.arange(1, 10), reference=np.zeros(9, dtype=int))
    grown = law("drift.growing").contribution(rows, None, np.array([1e-4, 900.0]))
    tip = rows.origins[:, 5] + (rows.flange @ TOOL.position)
    assert_allclose(grown[0], 0.0, atol=1e-15)
    assert_allclose(grown[1, :3], 1e-4 * (1 - np.exp(-1.0)) * tip[1], rtol=1e-12)
    assert_allclose(grown[8, :3], 1e-4 * (1 - np.exp(-8.0)) * tip[8], rtol=1e-12)
    assert_allclose(grown[:, 3:], 0.0)


def test_a_load_that_leaks_is_smaller_the_longer_it_is_on() -> None:
    rows = replace(loaded(DRAWN), dwell=np.array([0.0, 10, 20, 30, 40, 50, 60, 70, np.nan]))
    true = law("load_leak").true_wrench(rows, None, np.array([np.log(2) / 10]))
    assert true is not None
    assert_allclose(true, DRAWN * np.array([1, 1 / 2, 1 / 4, 1 / 8, 1 / 16, 1 / 32, 1 / 64, 1 / 128, 1])[:, None])
    assert not law("load_leak").missing(rows)
    assert law("load_leak").missing(replace(rows, dwell=np.full(9, 20.0)))
    assert law("load_leak").missing(replace(rows, dwell=np.full(9, np.nan)))


def test_a_cable_runs_to_the_pulley_wherever_the_tool_is() -> None:
    """From the tip towards a point four metres from where the written direction is right, with the same pull."""
    rows = loaded(forces([300.0] * 6, np.array([1.0, 2.0, 2.0])), poses=6)
    right_at = np.array([1.2, 0.1, 0.9])
    true = law("force_misalignment.pulley").true_wrench(rows, None, np.array([0.25, *right_at]))
    assert true is not None
    pulley = right_at + 4.0 * np.array([1.0, 2.0, 2.0]) / 3
    tip = rows.origins[:, 5] + (rows.flange @ TOOL.position)
    way = pulley - tip
    assert_allclose(true[:, :3], 300 * way / np.linalg.norm(way, axis=1)[:, None], rtol=1e-12)
    (shape,) = (shape for shape in law("force_misalignment").signatures(rows, None) if shape.effect.law == "pulley")
    small = np.array([1e-3, 1e-3 * 1.2, 1e-3 * 0.1, 1e-3 * 0.9])
    assert_allclose(shape.values(small), [1e-3, *right_at])
    moved = shape.effect.contribution(rows, None, shape.values(small))[:, :3]
    assert_allclose(shape.rows @ small, moved, atol=2e-3 * np.abs(moved).max())
    assert law("force_misalignment.pulley").missing(loaded(forces([300.0] * 6, np.array([0.0, 0.0, -1.0])), poses=6))


def test_hung_weights_lean_where_the_base_is_not_level_and_other_loads_do_not() -> None:
    down, along = np.array([0.0, 0.0, -1.0]), np.array([1.0, 0.0, 0.0])
    loads = np.concatenate([forces([0.0, 100, 300], down), forces([100.0, 300], along)])
    law_of_hung = law("force_misalignment.hung")
    true = law_of_hung.true_wrench(loaded(loads, poses=1), None, np.array([0.1, 0.0]))
    assert true is not None
    assert_allclose(true[1:3, :3], np.outer([100, 300], [0.0, np.sin(0.1), -np.cos(0.1)]), atol=1e-12)
    assert_allclose(true[[0, 3, 4]], loads[[0, 3, 4]])
    assert law_of_hung.missing(loaded(loads[:3], poses=1))
    assert law_of_hung.missing(loaded(loads[3:], poses=1))
    assert not law_of_hung.missing(loaded(loads, poses=1))


def test_a_changer_on_two_pins_tips_about_them_alone() -> None:
    """By half its play to where the moment about that axis turns it; a moment about the other one does nothing."""
    rows = replace(loaded(np.zeros((8, 6)), poses=1), at_load=True)
    about = np.array([np.cos(0.6), np.sin(0.6), 0.0])
    other = np.array([-np.sin(0.6), np.cos(0.6), 0.0])
    moment = np.outer([60, -60, 0, 0, 60, 0, 1, 2.5], about) + np.outer([0, 0, 60, -60, 300, 0, 0, 0], other)
    wrench = np.concatenate([np.zeros((8, 3)), np.einsum("nij,nj->ni", rows.flange, moment)], axis=1)
    rows = load_state(rows.robot, TOOL, rows.theta, wrench, COMPLIANCE, at_load=True)
    share = np.array([1, -1, 0, 0, 1, 0, 0.2, 0.5])
    turned = 2e-4 * share[:, None] * (rows.flange @ about)
    moved = law("tool_play.hinge").contribution(rows, None, np.array([2e-4, 0.6]))
    assert_allclose(moved[:, 3:], turned, atol=1e-15)
    assert_allclose(moved[:, :3], np.cross(turned, rows.flange @ TOOL.position), atol=1e-15)


def test_a_spindle_held_by_its_clamp_stays_where_it_was_pressed_last() -> None:
    """Over by a moment that overcomes the friction, and there until another one brings it back; nothing before the first. What
    the way to the pose left shows as soon as it was pressed anywhere, whichever side that was."""
    rows = replace(loaded(np.zeros((10, 6)), poses=2), at_load=True)
    about = np.array([np.cos(0.6), np.sin(0.6), 0.0])
    moment = np.array([0, 3, 60, 4, 0, 0, -60, -3, 0, 8])
    wrench = np.concatenate([np.zeros((10, 3)), moment[:, None] * (rows.flange @ about)], axis=1)
    rows = replace(load_state(rows.robot, TOOL, rows.theta, wrench, COMPLIANCE, at_load=True), visit=rows.visit)
    held, values = law("tool_play.held"), np.array([2e-4, 0.6])
    turned = 2e-4 * np.array([0, 0, 1, 1, 1, 0, -1, -1, -1, 1])[:, None] * (rows.flange @ about)
    assert_allclose(held.contribution(rows, None, values)[:, 3:], turned, atol=1e-15)
    otherwise = held.of_each_visit(rows, None, values)[:, 3:, 0]
    assert_allclose(otherwise, -2e-4 * np.array([0, 0, 1, 1, 1, 0, 1, 1, 1, 1])[:, None] * (rows.flange @ about), atol=1e-15)


def test_a_clamp_opens_where_the_moment_passes_what_holds_it() -> None:
    """Shut below, and beyond it tilts as the moment turns it; a moment about the flange's own axis does nothing."""
    rows = replace(loaded(np.zeros((5, 6)), poses=1), at_load=True)
    across = np.array([np.cos(0.6), np.sin(0.6), 0.0])
    moment = np.outer([60, 100, 160, -300, 0], across) + np.outer([0, 0, 50, 0, 400], [0.0, 0.0, 1.0])
    wrench = np.concatenate([np.zeros((5, 3)), np.einsum("nij,nj->ni", rows.flange, moment)], axis=1)
    rows = load_state(rows.robot, TOOL, rows.theta, wrench, COMPLIANCE, at_load=True)
    turned = 1e-6 * np.array([0, 0, 60, -200, 0])[:, None] * (rows.flange @ across)
    opens = law("tool_play.opens")
    moved = opens.contribution(rows, None, np.array([1e-6, 100.0]))
    assert_allclose(moved[:, 3:], turned, atol=1e-15)
    assert_allclose(moved[:, :3], np.cross(turned, rows.flange @ TOOL.position), atol=1e-15)
    held = [shape.values(np.array([1e-6]))[1] for shape in opens.signatures(rows, None)]
    assert 0 < min(held) < max(held) < 300


def test_a_disc_that_weighs_otherwise_is_in_every_load_from_its_own_on() -> None:
    plumb = np.array([0.0, 0.0, -1.0])
    rows = loaded(forces([0.0, 100, 200, 300, 200, 100, 0], plumb), poses=1)
    disc = law("hook_weight.disc")
    true = disc.true_wrench(rows, None, np.array([15.0, 150.0]))
    assert true is not None
    assert_allclose(true[:, 2], [0.0, -100, -215, -315, -215, -100, 0])
    places = [shape.values(np.array([15.0]))[1] for shape in disc.signatures(rows, None)]
    assert [int(np.sum(np.array([100, 200, 300]) > place)) for place in places] == [2, 1]
    assert disc.missing(loaded(forces([0.0, 100, 100], plumb), poses=1))
    assert disc.missing(loaded(forces([0.0, 100, 200], np.array([1.0, 0.0, 0.0])), poses=1))


def test_loads_of_one_size_are_off_whichever_way_they_point_and_those_of_others_are_not() -> None:
    """Where there are three sizes or more, each at two poses: with fewer it is a gain and a hook's weight."""
    along = np.array([1.0, 0.0, 0.0])
    rows = loaded(forces([0.0, 100, -200, 300, 200, 0, 100, 202, -300], along), poses=3)
    of_size = law("hook_weight.one_size")
    sizes = [shape.effect.where["size_n"] for shape in of_size.signatures(rows, None)]
    assert sizes == pytest.approx([100, 602 / 3, 300])
    true = of_size.signatures(rows, None)[1].effect.true_wrench(rows, None, np.array([15.0]))
    assert true is not None
    assert_allclose(true[:, 0], [0.0, 100, -215, 300, 215, 0, 100, 217, -300])
    for few in ([0.0, 100, -200, 0, 100, 200], list(np.arange(100.0, 1000, 50)) * 2, [100.0, 150, 300, 310, 200, 305]):
        assert of_size.missing(loaded(forces(few, along), poses=2))
    at_one_pose = of_size.signatures(loaded(forces([100.0, 200, 300, 0, 200, 300], along), poses=2), None)
    assert [shape.effect.where["size_n"] for shape in at_one_pose] == [200, 300]


def shapes(name: str, rows: LoadState) -> list[tuple[Signature, int | None]]:
    effect = effects()[name]
    return [(shape, joint) for joint in effect.places for shape in effect.signatures(rows, joint)]


@pytest.mark.parametrize("name", ["sensor_step", "encoder_zero", "drift"])
def test_some_rows_show_what_they_show_among_all(name: str) -> None:
    """Rows of later references by themselves, as rows that are kept for validation are: a step or a drift that ended with an
    earlier reference is not in them."""
    references = np.repeat(np.arange(3), [5, 3, 1])
    rows = replace(loaded(DRAWN), time=600.0 * np.arange(9), row=np.arange(1, 10), reference=references)
    later = load_state(rows.robot, TOOL, rows.theta[5:], rows.wrench[5:], COMPLIANCE)
    later = replace(later, visit=rows.visit[5:], time=rows.time[5:], row=rows.row[5:], reference=references[5:])
    seen = shapes(name, rows)
    assert len(seen) > 3
    for shape, joint in seen:
        values = shape.values(shape.scale)
        among = shape.effect.contribution(rows, joint, values)
        assert_allclose(shape.effect.contribution(later, joint, values), among[5:], atol=1e-12)

"""Laws of the criteria: information functions, and what a run tells."""

from __future__ import annotations

import numpy as np
import pytest

from identification.design.criteria import a_criterion, d_criterion, e_criterion, i_criterion
from identification.design.information import instrument, run_information
from identification.design.loads import LoadTable, Slot, loads_of, slot
from identification.design.milling import MillingPoses, prediction_weight
from identification.fit.load_test import LoadTest
from identification.fit.noise import noise_model
from identification.fit.noise_parts import VarianceComponents
from identification.measurements import Measurements
from identification.model.compliance import compliance_matrix, regressor
from identification.model.rotations import Frame
from tests.support import random_poses

STIFFNESS = np.array([2.03e6, 6.02e6, 1.91e6, 0.45e6, 0.22e6, 0.07e6])
WEIGHT = np.diag([1.0, 2, 3, 4, 5, 6]) + 0.5


# What loads may show: five directions of six, askew.
SEEN = np.linalg.qr(np.random.default_rng(8).normal(size=(6, 5)))[0]


@pytest.fixture(params=["D", "A", "raw", "E", "I", "D of a part", "A of a part", "E of a part", "I of a part"])
def criterion(request):
    kind, _, part = request.param.partition(" ")
    whole = {"D": d_criterion(), "A": a_criterion(), "raw": a_criterion(STIFFNESS), "E": e_criterion(),
             "I": i_criterion(WEIGHT)}[kind]
    return whole.of_seen(SEEN) if part else whole


def positive(rng, count):
    root = rng.normal(size=(count, 6, 6)) * 10.0 ** rng.uniform(-1, 2, (count, 1, 6))
    return root @ np.swapaxes(root, 1, 2) + 0.1 * np.eye(6)


def test_homogeneous_concave_and_bounded_by_its_tangent(criterion):
    rng = np.random.default_rng(1)
    one, other = positive(rng, 60), positive(rng, 60)
    np.testing.assert_allclose(criterion.value(7 * one), 7 * criterion.value(one), rtol=1e-9)
    between = criterion.value(0.3 * one + 0.7 * other)
    assert (between >= (0.3 * criterion.value(one) + 0.7 * criterion.value(other)) * (1 - 1e-9)).all()
    for a in one[:20]:
        tangent = criterion.tangent(a)
        assert np.linalg.eigvalsh(tangent).min() > -1e-9 * np.trace(tangent)
        assert (criterion.value(other) <= np.einsum("ij,nij->n", tangent, other) * (1 + 1e-7)).all()
        if criterion.kind != "E":
            assert np.sum(tangent * a) == pytest.approx(float(criterion.value(a)), rel=1e-6)


def test_of_springs_known_alike_the_mean_variance_of_a_deflection_is_theirs():
    """I weighs the springs as the deflection does, and its weights are of sum one."""
    assert i_criterion(WEIGHT).value(4 * np.eye(6)[None]) == pytest.approx(4)
    assert i_criterion(30 * WEIGHT).value(np.diag([1.0, 2, 4, 5, 10, 20])[None]) == pytest.approx(
        np.trace(WEIGHT) / np.sum(np.diag(WEIGHT) / [1, 2, 4, 5, 10, 20]))


def test_slope_is_the_derivative_of_the_logarithm(criterion):
    rng = np.random.default_rng(2)
    for information in positive(rng, 10):
        direction = rng.normal(size=(6, 6))
        direction = (direction + direction.T) * np.linalg.eigvalsh(information)[0] * 1e-6
        high, low = (np.log(criterion.smooth(information + sign * direction)) for sign in (1, -1))
        assert (high - low) / 2 == pytest.approx(np.sum(criterion.slope(information) * direction), rel=1e-3, abs=1e-11)
        assert np.sum(criterion.slope(information) * information) == pytest.approx(1, rel=1e-6)


def test_values_are_those_of_springs_that_are_known_apart():
    """By hand, of precisions along the axes: the geometric mean, the harmonic sums, the least; 0 where one is not known."""
    precision = np.array([1.0, 2, 4, 5, 10, 20])
    information = np.stack([np.diag(precision), np.diag(precision * [0, 1, 1, 1, 1, 1]) + 0.0])
    assert d_criterion().value(information) == pytest.approx([8000 ** (1 / 6), 0])
    assert a_criterion().value(information[:1]) == pytest.approx([1 / 2.1])
    # Of raw k in units of the largest, here 6: variances times their squares.
    raw = a_criterion(np.array([1.0, 2, 3, 4, 5, 6]))
    assert raw.value(information[:1]) == pytest.approx([36 / (1 / 1 + 4 / 2 + 9 / 4 + 16 / 5 + 25 / 10 + 36 / 20)])
    assert e_criterion().value(information) == pytest.approx([1, 0])
    assert e_criterion().value(np.diag([-1.0, 1, 1, 1, 1, 1])[None]) == [0]
    assert [one.name for one in (d_criterion(), a_criterion(), raw, e_criterion(), i_criterion(WEIGHT))] == [
        "D", "A", "A in raw k", "E", "I"]


def test_the_least_is_searched_by_means_that_come_close_to_it():
    """Power means of the precisions, a smooth one first; the others need none."""
    precision = np.array([1.0, 1.1, 1.3, 5, 10, 20])
    assert e_criterion().powers == (10, 80)
    for power in e_criterion().powers:
        found = e_criterion().smooth_with(power).smooth(np.diag(precision)[None])
        assert found == pytest.approx([np.mean(precision**-power) ** (-1 / power)], rel=1e-12)
        assert 1 < found[0] <= 6 ** (1 / power)
    for one in (d_criterion(), a_criterion(), i_criterion(WEIGHT)):
        assert len(one.powers) == 1
        assert one.smooth(np.diag(precision)[None]) == one.value(np.diag(precision)[None])


def test_joints_of_which_less_than_half_is_seen_are_left_out():
    assert d_criterion().left_out == ()
    assert d_criterion().of_seen(np.eye(6)[:, [1, 2, 4]]).left_out == (1, 4, 6)
    lean = np.zeros((6, 1))
    for share, left in ((0.49, (1, 3, 4, 5, 6)), (0.51, (2, 3, 4, 5, 6))):
        lean[:2, 0] = np.sqrt([share, 1 - share])
        assert e_criterion().of_seen(lean).left_out == left


def test_units_of_a_stiffness_do_not_change_what_d_prefers():
    rng = np.random.default_rng(3)
    one, other = positive(rng, 2)
    scale = np.diag(10.0 ** rng.uniform(-3, 3, 6))
    ratio = [d_criterion().value(turn @ one @ turn) / d_criterion().value(turn @ other @ turn) for turn in (np.eye(6), scale)]
    assert ratio[0] == pytest.approx(ratio[1], rel=1e-6)


def test_one_more_run_never_hurts(criterion, pool, prior):
    rng = np.random.default_rng(4)
    total = prior.copy()
    for run in rng.integers(0, len(pool), 12):
        more = total + pool.information[run]
        assert criterion.value(more) >= criterion.value(total) * (1 - 1e-9)
        total = more


def rows_of(theta, forces):
    count = len(forces)
    nothing, none = np.full(count, np.nan), np.zeros(count, dtype=np.intp)
    return Measurements("plan", np.repeat(theta[None], count, axis=0), np.column_stack([forces, np.zeros((count, 3))]),
                        np.zeros((count, 3)), np.full((count, 3), np.nan), nothing, nothing, none, none, none > 0,
                        np.full(count, "", dtype=object), np.full(count, "", dtype=object), none, none, ())


@pytest.mark.parametrize("loads", [slot("x", "cycle", 300), slot("zy", "cycle", 200), slot("yx", "single", 300)])
def test_a_run_tells_what_identify_would_make_of_its_rows(cell, domain, pool, loads):
    """The closed form against the noise model of the fit, row by row."""
    rig = domain.rig
    for theta in pool.theta[::400]:
        rows = rows_of(theta, loads.forces)
        noise = noise_model(LoadTest.of(cell, rows), rig.compliance)
        columns = regressor(cell.robot, rows.theta, cell.flange_from_tcp, rows.wrench)[:, :3]
        design = noise.whitening @ (columns * rig.compliance)
        expected = noise.weights(VarianceComponents()).inner(design, design)
        found = run_information(rig, domain.look(theta[None]).columns, loads_of(loads))[0]
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


def test_a_line_along_an_axis_is_that_axis(domain, pool):
    """A run with a line of its own has the loads of the axis that the line is along, beside runs that have none."""
    columns = domain.look(pool.theta[:3]).columns
    table = LoadTable((slot("free", "cycle", 300), slot("y", "single", 200)))
    own = table.of(np.zeros(3, dtype=int), np.eye(3))
    for k, axis in enumerate("xyz"):
        one = run_information(domain.rig, columns[k: k + 1], loads_of(slot(axis, "cycle", 300)))
        found = run_information(domain.rig, columns[k: k + 1], table.of(np.zeros(1, dtype=int), np.eye(3)[k: k + 1]))
        np.testing.assert_allclose(found, one, rtol=1e-9, atol=1e-9 * np.abs(one).max())
        np.testing.assert_allclose(np.abs(own.peak[k]).max(axis=0), 300 * np.eye(3)[k])
    # The derivative by the line: of one along y, that of its second component.
    step = 1e-3 * np.eye(3)[1:2]
    ahead, here = (table.of(np.zeros(1, dtype=int), np.eye(3)[1:2] + sign * step) for sign in (1, -1))
    np.testing.assert_allclose((ahead.force - here.force)[:, :, 1] / 2e-3, own.by_line[1:2])
    np.testing.assert_allclose((ahead.peak - here.peak)[:, :, 1] / 2e-3, own.peak_by_line[1:2])
    assert not table.of(np.ones(1, dtype=int), np.eye(3)[:1]).by_line.any()


def test_the_sign_of_the_cycle_and_repeats_of_it(domain, pool):
    """Turning every load round tells the same; a cycle twice tells more than once and less than at two visits."""
    columns = domain.look(pool.theta[:50]).columns
    once = slot("y", "cycle", 300)
    turned = Slot("y", -once.forces)
    twice = Slot("y", np.concatenate([once.forces, once.forces]))
    one, two = (run_information(domain.rig, columns, loads_of(loads)) for loads in (once, twice))
    np.testing.assert_allclose(run_information(domain.rig, columns, loads_of(turned)), one, rtol=1e-9, atol=1e-6)
    for difference in (two - one, 2 * one - two):
        assert (np.linalg.eigvalsh(difference)[:, 0] >= -1e-8 * np.linalg.eigvalsh(one)[:, -1]).all()


def test_the_weight_of_i_is_the_variance_of_the_predicted_deflection(cell):
    """W against the spread of G f over draws of ln c and of the force."""
    rng = np.random.default_rng(5)
    rig = instrument(cell)
    theta = random_poses(cell.robot, 4, rng, 0.6)
    tools = Frame.from_quaternion(np.tile([0.1, 0.02, 0.3], (4, 1)), np.tile([1.0, 0, 0, 0], (4, 1)))
    root = rng.normal(size=(3, 3)) * 50
    weight = prediction_weight(rig, MillingPoses(theta, tools, np.zeros((4, 3)), "", 4, root @ root.T))
    spread = 1e-3 * rng.normal(size=(6, 6))
    tool = Frame.from_quaternion([0.1, 0.02, 0.3], [1.0, 0, 0, 0])
    draws = []
    for _ in range(4000):
        changed = rig.compliance * np.exp(spread @ rng.normal(size=6))
        force = root @ rng.normal(size=3)
        moved = [compliance_matrix(cell.robot, theta, tool, c)[:, :3, :3] @ force for c in (changed, rig.compliance)]
        draws.append(np.sum((moved[0] - moved[1]) ** 2, axis=1).mean())
    assert np.mean(draws) == pytest.approx(np.sum(weight * (spread @ spread.T)), rel=0.15)

"""The variance components integrated out: against dense matrices, and a random walk through the written-out posterior."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from identification.fit.gram import NoiseGram
from identification.fit.linearised import Linearised
from identification.fit.load_test import LoadTest
from identification.fit.noise import NoiseModel
from identification.fit.noise_parts import SetUp, VarianceComponents
from identification.fit.posterior import _FittedModel, posterior
from identification.fit.variance_components import ComponentPosterior, _slopes, _subset, integrated_out, likeliest
from identification.measurements import Measurements, read_measurements
from identification.model.cell import Cell, read_cell
from identification.model.compliance import compliance_matrix, equilibrium, regressor
from tests.identification.fit.test_laws_posterior import TRUE
from tests.second_cell import cell as second_cell
from tests.support import measurement_text, random_poses, write_cell

CELL = "robot: irb6660-205-1.90\ntool: {position_mm: [120, 0, 250]}\nmeasurement: {deflection_std_um: [2, 2, 2], "
WHITE = CELL + "force_relative_std: 0, pose_offset_std_um: [0, 0, 0]}\n"
FULL = CELL + "force_relative_std: 0.01, force_std_n: [0, 0, 0], pose_offset_std_um: [5, 5, 5]}\n"
BARE = CELL[:-2] + "}\n"


@pytest.mark.parametrize(("remembers", "set_up"), [
    (False, SetUp.TURNED), (True, SetUp.TURNED), (False, SetUp.STRETCHED), (False, SetUp.SIZED)])
def test_the_gram_is_that_of_dense_matrices(remembers, set_up) -> None:
    """Eighteen rows on three visits, the longest of eleven, components missing, an axis without re-seating, row weights, three
    components at once; the same for `Weights`, and noise that is drawn has that covariance."""
    rng = np.random.default_rng(0)
    measured = np.ones((18, 3), dtype=bool)
    measured[[2, 9, 10], [1, 0, 0]] = False
    measured[13] = False

    def seen(values: np.ndarray) -> np.ndarray:
        return np.where(measured[:, :, None], values, 0.0)

    rotation, force, absolute, setups = (seen(rng.standard_normal((18, 3, columns))) for columns in (3, 3, 3, 9))
    visit, offset = np.array([0, 2, 1, 0, 2, 2, 1, *[2] * 8, 0, 1, 0]), np.array([0.7, 0.0, 1.9])
    design, residual = seen(rng.standard_normal((18, 3, 4))), np.where(measured, rng.standard_normal((18, 3)), 0.0)
    weight = rng.uniform(0.2, 1.3, 18)
    model = NoiseModel(rotation, force, absolute, setups, measured, visit, offset, (True,) * 6, (*[True] * 5, remembers),
                       set_up)
    # Column 3 k + m is an error along k of the component m of the force: without turns, k alone acts on k; in size, all alike.
    stretched = setups[:, :, [0, 4, 8]]
    setups = {SetUp.TURNED: setups, SetUp.STRETCHED: stretched, SetUp.SIZED: np.sum(stretched, axis=2)[:, :, None]}[set_up]
    logs = rng.normal(0, 0.6, (3, 6)) + np.array([0, 0, 0, 0, 0, 2])
    gram, log_determinant = NoiseGram(model, weight, design, residual)(logs)
    columns = np.concatenate([design, residual[:, :, None]], axis=2)
    kept = measured.ravel()
    for (sensor, relative, floor, seat, turned, multiple), found, determinant in zip(
            np.exp(logs), gram, log_determinant, strict=True):
        rho = 0.1 * multiple / (1 + 0.1 * multiple) if remembers else 0.0
        sigma = np.zeros((54, 54))
        for i in range(18):
            for j in np.flatnonzero(visit == visit[i]):
                apart = abs(int(np.sum(visit[:i] == visit[i])) - int(np.sum(visit[:j] == visit[j])))
                block = sensor**2 * rho**apart / np.sqrt(weight[i] * weight[j]) * np.eye(3)
                block += rotation[i] @ np.diag((seat * offset) ** 2) @ rotation[j].T + turned**2 * setups[i] @ setups[j].T
                if i == j:
                    block += (relative**2 * force[i] @ force[i].T + floor**2 * absolute[i] @ absolute[i].T) / weight[i]
                sigma[3 * i: 3 * i + 3, 3 * j: 3 * j + 3] = block
        inside, flat = sigma[np.ix_(kept, kept)], columns.reshape(54, 5)[kept]
        assert_allclose(found, flat.T @ np.linalg.solve(inside, flat), rtol=1e-9, atol=1e-9)
        assert_allclose(determinant, np.linalg.slogdet(inside)[1], rtol=1e-9)
    components = VarianceComponents().with_logs(logs[-1])
    weights = model.weights(components, weight)
    assert_allclose(weights.inner(columns, columns), gram[-1], rtol=1e-9)
    assert_allclose(weights.apply(columns).reshape(54, 5)[kept], np.linalg.solve(inside, flat), rtol=1e-8, atol=1e-10)
    assert weights.log_determinant == pytest.approx(log_determinant[-1])
    drawn = model.draw(np.repeat(components.values[None], 40_000, axis=0), weight, rng).reshape(54, -1)[kept]
    size = np.sqrt(np.diag(inside))
    assert np.max(np.abs((drawn @ drawn.T / 40_000 - inside) / np.outer(size, size))) < 0.04


@pytest.mark.parametrize(("rows", "visits", "kept"), [
    (6000, 3, None), (6001, 3, "stretches of 32"), (6001, 4, "visits"), (12_001, 5, "stretches of 32"), (12_001, 6, "visits")])
def test_noise_is_estimated_from_six_thousand_rows_evenly_over_the_file(rows: int, visits: int, kept: str | None) -> None:
    """Every second row of more, of more than twice as many every third: as whole visits where at least two are left, else as
    stretches."""
    noise: Any = SimpleNamespace(visit=np.arange(rows) * visits // rows, visits=visits)
    every = 3 if rows > 12_000 else 2
    number = {None: 0 * noise.visit, "visits": noise.visit, "stretches of 32": np.arange(rows) // 32}[kept]
    assert np.array_equal(_subset(noise), number % every == 0)


@pytest.mark.parametrize("hanging", [0, 2])
def test_half_of_a_long_file_says_half_of_what_all_of_it_says(hanging: int) -> None:
    """Visits that come in equal pairs, of which one each is looked at: but for what all parameters and columns of 1 sigma are
    known to, ln of the likelihood is half of that of all rows, the step's prior with it."""
    rng = np.random.default_rng(8)
    of, count = np.repeat(np.arange(752) // 2, 8) * 8 + np.tile(np.arange(8), 752), 6016

    def pairs(*shape: int) -> np.ndarray:
        return rng.standard_normal((count // 2, *shape))[of]

    noise = NoiseModel(pairs(3, 3), pairs(3, 3), pairs(3, 3), pairs(3, 9), np.ones((count, 3), dtype=bool),
                       np.repeat(np.arange(752), 8), np.array([0.7, 0.3, 1.9]), (True,) * 6, (*[True] * 5, False), SetUp.TURNED)
    design, residual, weight = pairs(3, 2), pairs(3), rng.uniform(0.2, 1.3, count // 2)[of]
    beside = 0.01 * pairs(3, hanging)
    precision, gradient = np.array([[90.0, 20.0], [20.0, 70.0]]), np.array([500.0, -300.0])
    prior: Any = SimpleNamespace(precision=lambda x: precision, gradient=lambda x: gradient)
    half = ComponentPosterior(Linearised(noise, design, residual, weight, prior, np.zeros(2)), beside)
    assert (half.whole, half.rows) == (False, count // 2)
    logs = rng.normal(0, 0.3, (3, 6))
    gram, log_determinant = NoiseGram(noise, weight, np.concatenate([beside, design], axis=2), residual)(logs)
    for own, determinant, found in zip(gram, log_determinant, half.likelihood(logs), strict=True):
        hung = own[:hanging, :hanging] + np.eye(hanging)
        rest = own[hanging:, hanging:] - own[hanging:, :hanging] @ np.linalg.inv(hung) @ own[:hanging, hanging:]
        information, pull = rest[:2, :2] + precision, rest[:2, 2] - gradient
        exponent = pull @ np.linalg.inv(information) @ pull - rest[2, 2] - determinant
        volumes = np.linalg.slogdet(information / 2)[1] + np.linalg.slogdet(hung / 2)[1]
        assert found == pytest.approx(0.25 * exponent - 0.5 * volumes, rel=1e-9)


def test_what_is_integrated_out_is_so_much_more_noise() -> None:
    """Columns of 1 sigma each, in every row at once: gram and determinant are those of a covariance with their products."""
    rng = np.random.default_rng(5)
    root, beside, others = rng.standard_normal((30, 30)), rng.standard_normal((30, 4)), rng.standard_normal((30, 3))
    sigma = root @ root.T + np.eye(30)
    both = np.concatenate([beside, others], axis=1)
    found, log_more = integrated_out((both.T @ np.linalg.solve(sigma, both))[None], 4)
    wider = sigma + beside @ beside.T
    assert_allclose(found[0], others.T @ np.linalg.solve(wider, others), rtol=1e-9)
    assert_allclose(log_more[0], np.linalg.slogdet(wider)[1] - np.linalg.slogdet(sigma)[1], rtol=1e-9)


HANGING = (187003, 187008, 187010, 187014, 187019, 187022, 187027, 187031)


# Long: what is stated of fresh poses holds for such an arm in tests/second_cell/test_answers.py.
@pytest.mark.long
def test_intervals_hold_for_an_arm_whose_weight_nobody_states(tmp_path) -> None:
    """Joints 2 and 3 took the weight for springs: off by 3.1 and 2.0 of their standard deviations, root mean square."""
    off = []
    for seed in HANGING:
        case = second_cell.simulate(seed, "cycles", "near", weight="unknown")
        cell_path, rows_path = case.write(tmp_path)
        cell = read_cell(cell_path)
        assert cell.robot.link_mass is None
        found = posterior(LoadTest.of(cell, read_measurements(rows_path, cell.robot)))
        off.append((found.mean + np.log(case.stiffness)) / np.sqrt(np.diag(found.covariance)))
    assert np.sqrt(np.mean(np.square(off), axis=0)).max() < 1.5
    assert np.mean(np.abs(off) < 1.96) > 0.9


def test_the_quick_covariance_has_the_weight_that_nobody_states_free(tmp_path: Path) -> None:
    """The block of the springs in the inverse of all that is free, written out; near what the draws have, and wider than with
    the weight known."""
    cell_path, rows_path = second_cell.simulate(HANGING[0], "few", "near", weight="unknown").write(tmp_path)
    cell = read_cell(cell_path)
    found = posterior(LoadTest.of(cell, read_measurements(rows_path, cell.robot)))
    count = 3 * len(found.data.rows)
    unit = np.eye(count).reshape(-1, 3, count)
    precision = found.weights.inner(unit, unit)
    beside = found.beside.reshape(count, -1)
    assert beside.shape[1] > 5
    everything = np.concatenate([found.at_map.design.reshape(count, -1), beside], axis=1)
    degrees = found.components.degrees
    shrunk = 1.0 if np.isinf(degrees) else (degrees + 3) / (degrees + 5)
    curvature = everything.T @ precision @ everything + np.diag([0.0] * 6 + [1.0] * beside.shape[1])
    own, cross, other = curvature[:6, :6], curvature[:6, 6:], curvature[6:, 6:]
    springs = shrunk * (own - cross @ np.linalg.inv(other) @ cross.T) + found.prior.precision(found.map)
    assert_allclose(found.quick_covariance, np.linalg.inv(springs), rtol=1e-6, atol=1e-12)
    std = np.sqrt(np.diag(found.quick_covariance))
    assert_allclose(std, np.sqrt(np.diag(found.covariance)), rtol=0.35)
    assert np.max(std / np.sqrt(np.diag(np.linalg.inv(shrunk * own + found.prior.precision(found.map))))) > 1.02


def five_loads(folder: Path, text: str, seed: int, noise: tuple[float, float, float]) -> tuple[Cell, Measurements]:
    """Five poses with one load each along the base axes; noise: sensor [m], force (relative), re-seating [m]."""
    rng = np.random.default_rng(seed)
    cell = read_cell(write_cell(folder, text))
    # An arm that weighs nothing, which is known of it: the written-out posterior has no weight in it.
    cell = replace(cell, robot=replace(cell.robot, link_mass=np.zeros(6), link_centre=np.zeros((6, 3))))
    theta = random_poses(cell.robot, 5, rng, share=0.6)
    wrench = np.zeros((5, 6))
    wrench[np.arange(5), [0, 1, 2, 0, 1]] = [300, -300, 300, -300, 300]
    applied = wrench * (1 + noise[1] * rng.standard_normal((5, 1)))
    deflection = equilibrium(cell.robot, theta, cell.flange_from_tcp, applied, 1 / TRUE).position
    deflection += noise[0] * rng.standard_normal((5, 3)) + noise[2] * rng.standard_normal((5, 3))
    path = folder / "m.csv"
    path.write_text(measurement_text(theta, wrench, 1e6 * deflection))
    return cell, read_measurements(path, cell.robot)


def random_walk(cell: Cell, rows: Measurements, start: np.ndarray, stated: bool | None) -> np.ndarray:
    """Draws (D, 6) of ln c by walkers that stretch towards each other (Goodman and Weare 2010), the prior and the noise written
    out: stated True for the parts of FULL, None for WHITE, False for BARE."""
    columns = regressor(cell.robot, rows.theta, cell.flange_from_tcp, rows.wrench)[:, :3]
    here = equilibrium(cell.robot, rows.theta, cell.flange_from_tcp, rows.wrench, np.exp(start)).position
    softness = compliance_matrix(cell.robot, rows.theta, cell.flange_from_tcp, np.exp(start))[:, :3, :3]
    carried = softness @ rows.wrench[:, :3, None]
    middle, width = -np.log(cell.prior.stiffness), cell.prior.log_std

    def about_stated(log: np.ndarray) -> np.ndarray:
        return np.where(log < 0, -0.5 * (log / 0.3) ** 2, -2.5 * np.log1p((log / 0.3) ** 2 / 4))

    def log_posterior(at: np.ndarray) -> np.ndarray:
        x, logs = at[:, :6], at[:, 6:]
        residual = rows.deflection - here - np.einsum("nij,wj->wni", columns, np.exp(x) - np.exp(start))
        value = -0.5 * np.sum(((x - middle) / width) ** 2, axis=1) + about_stated(logs[:, 0])
        sensor, force, offset = 2e-6 * np.exp(logs[:, 0]), np.zeros(len(at)), np.zeros(len(at))
        if stated is None:
            value -= 0.5 * np.sum(logs[:, 1:] ** 2, axis=1)
        elif stated:
            force, offset = 0.01 * np.exp(logs[:, 1]), 5e-6 * np.exp(logs[:, 2])
            value += about_stated(logs[:, 1]) + about_stated(logs[:, 2])
        else:
            force, offset = 0.005 * np.exp(logs[:, 1]), 3e-6 * np.exp(logs[:, 2])
            value += np.sum(logs[:, 1:] - np.exp(logs[:, 1:]) / 2, axis=1)
        sigma = (sensor**2 + offset**2)[:, None, None, None] * np.eye(3) + (force**2)[:, None, None, None] * (
            carried @ np.swapaxes(carried, 1, 2))
        quadratic = np.einsum("wni,wni->w", residual, np.linalg.solve(sigma, residual[..., None])[..., 0])
        return value - 0.5 * quadratic - 0.5 * np.linalg.slogdet(sigma)[1].sum(axis=1)

    rng = np.random.default_rng(1)
    walkers = np.concatenate([np.tile(start, (240, 1)), np.zeros((240, 3))], axis=1) + 0.05 * rng.standard_normal((240, 9))
    value, kept = log_posterior(walkers), []
    for step in range(2400):
        for half, other in ((slice(0, 120), slice(120, 240)), (slice(120, 240), slice(0, 120))):
            stretch = (1 + rng.random(120)) ** 2 / 2
            partner = walkers[other][rng.integers(0, 120, 120)]
            trial = partner + stretch[:, None] * (walkers[half] - partner)
            trial_value = log_posterior(trial)
            taken = np.log(rng.random(120)) < 8 * np.log(stretch) + trial_value - value[half]
            walkers[half][taken] = trial[taken]
            value[half][taken] = trial_value[taken]
        if step >= 600 and step % 10 == 0:
            kept.append(walkers[:, :6].copy())
    return np.concatenate(kept)


@pytest.mark.parametrize(("text", "stated", "noise"), [
    pytest.param(WHITE, None, (2e-6, 0, 0), marks=pytest.mark.long), (FULL, True, (2e-6, 0.01, 5e-6))])
def test_five_loads_against_a_random_walk(tmp_path, text, stated, noise) -> None:
    """Fifteen readings must tell six stiffnesses and the noise: widths, intervals and ellipsoid of the posterior as it is."""
    cell, rows = five_loads(tmp_path, text, 2, noise)
    found = posterior(LoadTest.of(cell, rows))
    assert np.isinf(found.components.degrees)
    walked = random_walk(cell, rows, found.map, stated)
    std = walked.std(axis=0)
    assert_allclose(np.sqrt(np.diag(found.covariance)), std, rtol=0.08)
    assert np.max(np.abs(found.mean - walked.mean(axis=0)) / std) < 0.1
    ends = np.quantile(walked, [0.025, 0.975], axis=0).T
    assert np.max(np.abs(found.draws.interval(0.95) - ends) / std[:, None]) < 0.35
    off = walked - walked.mean(axis=0)
    distance = np.einsum("di,ij,dj->d", off, np.linalg.inv(np.cov(walked.T)), off)
    # A normal distribution's would be 12.6: it holds too little.
    assert found.draws.radius(0.95, 6) == pytest.approx(np.quantile(distance, 0.95), rel=0.08)
    assert found.draws.radius(0.95, 6) > 13.7


def test_data_that_want_no_compliance_at_all_converge(tmp_path, monkeypatch) -> None:
    """Readings from which more is taken than joint 2 gives: the prior alone keeps its c positive. Gauss-Newton in ln c steps to
    and fro there, more than forty designs a fit and now and then for ever; the curvature of exp brings it to under ten."""
    designs = []
    linearised = _FittedModel.linearised
    monkeypatch.setattr(_FittedModel, "linearised", lambda *given: designs.append(1) or linearised(*given))
    for seed in range(4):
        cell, rows = five_loads(tmp_path, WHITE, seed, (2e-6, 0, 0))
        of_joint_2 = regressor(cell.robot, rows.theta, cell.flange_from_tcp, rows.wrench)[:, :3, 1] / TRUE[1]
        found = posterior(LoadTest.of(cell, replace(rows, deflection=rows.deflection - 1.1 * of_joint_2)))
        assert found.map[1] < -np.log(TRUE[1]) - 1
    assert len(designs) < 60


def test_the_likeliest_components_are_the_top_of_their_posterior() -> None:
    """Slopes and curvature of a posterior that is a parabola in the logarithms, and its top; what is not active stays."""
    rng = np.random.default_rng(33)
    active = np.array([True, True, False, True, False, False])
    root = rng.standard_normal((3, 3))
    curvature, top = root @ root.T + np.eye(3), np.array([0.4, -0.6, 0.9])

    def parabola(logs: np.ndarray) -> tuple[np.ndarray, None]:
        off = logs[:, active] - top
        return -0.5 * np.einsum("ni,ij,nj->n", off, curvature, off), None

    posterior: Any = parabola
    posterior.noise = SimpleNamespace(active=active)
    start = VarianceComponents(1.3, 0.8, 1.7, 0.9)
    free = np.flatnonzero(active)
    value, gradient, hessian = _slopes(posterior, start.logs, free)
    assert value == pytest.approx(float(parabola(start.logs[None])[0][0]))
    assert gradient == pytest.approx(-curvature @ (start.logs[free] - top), rel=1e-6)
    assert np.allclose(hessian, curvature, rtol=1e-4)
    found = likeliest(posterior, start)
    assert found.logs[free] == pytest.approx(top, abs=0.05)
    assert found.absolute == start.absolute

"""What the noise's precision says of what visits share, against dense matrices; and how far off rows are expected to be."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from identification.common.findings import CompstiffError
from identification.fit.load_test import LoadTest
from identification.fit.noise import NoiseModel, noise_model, residual_std
from identification.fit.noise_parts import SetUp, VarianceComponents
from tests.identification.fit.exact_rows import by_compliance
from tests.identification.fit.test_laws_posterior import TRUE, simulate

ROWS = 12
VISIT = np.array([1, 0, 2, 1, 1, 0, 2, 2, 1, 0, 0, 1])
SIZES = VarianceComponents(sensor=1.4, force=0.6, absolute=0.9, offset=1.7, setup=0.5)
WEIGHT = np.linspace(0.3, 1.2, ROWS)


def model(rng: np.random.Generator) -> NoiseModel:
    """Every part but a memory, set-ups stretched; one component was not read."""
    measured = np.ones((ROWS, 3), dtype=bool)
    measured[4, 1] = False
    whitening = np.where(measured, [0.5, 1.0, 2.0], 0.0)[:, :, None] * np.eye(3)
    force, absolute, setups = (measured[:, :, None] * rng.standard_normal((ROWS, 3, count)) for count in (3, 3, 9))
    return NoiseModel(whitening, force, absolute, setups, measured, VISIT, np.array([0.6, 0.0, 1.5]), (True,) * 6,
                      (True, True, True, True, True, False), SetUp.STRETCHED)


def dense(noise: NoiseModel, further: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray, Callable[..., np.ndarray]]:
    """Covariance (36, 36) of the readings, that of what the visits share, and the rows of an array one below the other."""
    own, shared = np.zeros((3 * ROWS, 3 * ROWS)), np.zeros((3 * ROWS, 3 * ROWS))
    each = np.concatenate([1.7 * noise.whitening * noise.offset, 0.5 * noise.setups[:, :, [0, 4, 8]],
                           *([] if further is None else [further])], axis=2)
    for i in range(ROWS):
        own[3 * i: 3 * i + 3, 3 * i: 3 * i + 3] = (
            1.4**2 * np.eye(3) + 0.6**2 * noise.force[i] @ noise.force[i].T
            + 0.9**2 * noise.absolute[i] @ noise.absolute[i].T) / WEIGHT[i]
        for j in np.flatnonzero(VISIT[i] == VISIT):
            shared[3 * i: 3 * i + 3, 3 * j: 3 * j + 3] = each[i] @ each[j].T
    return own + shared, shared, lambda values: values.reshape(3 * ROWS, -1)


def test_what_a_visit_shares_is_estimated_as_well_as_the_rows_tell_it() -> None:
    """The mean and the covariance of one part of a sum of two normal distributions, given the sum; and of its re-seating by
    itself, in metres."""
    rng = np.random.default_rng(4)
    noise = model(rng)
    columns = noise.measured[:, :, None] * rng.standard_normal((ROWS, 3, 2))
    weights = noise.weights(SIZES, WEIGHT)
    sigma, shared, flat = dense(noise)
    kept = noise.measured.ravel()
    told = np.zeros_like(sigma)
    told[np.ix_(kept, kept)] = np.linalg.inv(sigma[np.ix_(kept, kept)])
    assert_allclose(flat(weights.shared(columns)), shared @ told @ flat(columns), atol=1e-9)
    left = shared - shared @ told @ shared
    assert_allclose(weights.shared_covariance, [left[3 * i: 3 * i + 3, 3 * i: 3 * i + 3] for i in range(ROWS)], atol=1e-9)
    offsets = weights.offsets(columns[:, :, 0])
    for visit in range(3):
        with_rows = np.zeros((3, 3 * ROWS))
        for i in np.flatnonzero(visit == VISIT):
            with_rows[:, 3 * i: 3 * i + 3] = np.diag((1.7 * noise.offset) ** 2) @ noise.whitening[i]
        assert_allclose(offsets[visit], with_rows @ told @ flat(columns[:, :, 0]).ravel(), atol=1e-9)


def test_what_each_visit_may_do_further_is_so_much_more_that_it_shares() -> None:
    """Displacements [m] of one sigma each; twice in turn as both at once; and none of it is the rows' own."""
    rng = np.random.default_rng(5)
    noise = model(rng)
    moved = noise.measured[:, :, None] * rng.standard_normal((ROWS, 3, 3))
    columns = noise.measured[:, :, None] * rng.standard_normal((ROWS, 3, 2))
    weights = noise.weights(SIZES, WEIGHT)
    sigma, _, flat = dense(noise, np.einsum("nij,njk->nik", noise.whitening, moved))
    kept = noise.measured.ravel()
    inside = sigma[np.ix_(kept, kept)]
    wanted = flat(columns)[kept].T @ np.linalg.solve(inside, flat(columns)[kept])
    for freed in (weights.freed(moved), weights.freed(moved[:, :, :1]).freed(moved[:, :, 1:])):
        assert_allclose(freed.inner(columns, columns), wanted, atol=1e-9)
        assert freed.log_determinant == pytest.approx(np.linalg.slogdet(inside)[1])
    drawn = freed.model.draw(np.repeat(SIZES.values[None], 15_000, axis=0), WEIGHT, rng).reshape(3 * ROWS, -1)
    size = np.where(kept, np.sqrt(np.diag(sigma)), 1.0)
    assert np.max(np.abs(drawn @ drawn.T / 15_000 - np.where(np.outer(kept, kept), sigma, 0.0)) / np.outer(size, size)) < 0.05


def test_a_row_alone_has_its_own_errors_and_no_weight() -> None:
    noise = model(np.random.default_rng(6))
    found = noise.of_rows_alone(SIZES)
    for i in range(ROWS):
        read = noise.measured[i]
        own = 1.4**2 * np.eye(3) + 0.6**2 * noise.force[i] @ noise.force[i].T
        own += 0.9**2 * noise.absolute[i] @ noise.absolute[i].T
        wanted = np.zeros((3, 3))
        wanted[np.ix_(read, read)] = np.linalg.inv(own[np.ix_(read, read)])
        assert_allclose(found[i], wanted, atol=1e-12)
    assert_allclose(replace(noise, active=(True, False, True, True, True, True)).of_rows_alone(SIZES)[0], np.linalg.inv(
        1.4**2 * np.eye(3) + 0.9**2 * noise.absolute[0] @ noise.absolute[0].T))


@pytest.mark.parametrize("rows", [64, 70])
def test_a_sensor_s_memory_reaches_back_to_the_beginning_of_its_sixty_four_rows(rows: int) -> None:
    """A longer visit is taken in stretches of so many: of 70 the last six remember each other."""
    nothing = np.zeros((rows, 3, 3))
    noise = NoiseModel(np.tile(np.eye(3), (rows, 1, 1)), nothing, nothing, np.zeros((rows, 3, 9)),
                       np.ones((rows, 3), dtype=bool), np.zeros(rows, dtype=int), np.zeros(3), (False,) * 6,
                       (True, False, False, False, False, True))
    weights = noise.weights(VarianceComponents(sensor=2.0, memory=15.0))
    place = np.arange(rows)
    alike = np.where(np.subtract.outer(place // 64, place // 64) == 0, 0.6 ** np.abs(np.subtract.outer(place, place)), 0.0)
    assert weights.log_determinant == pytest.approx(3 * np.linalg.slogdet(4.0 * alike)[1])
    columns = np.random.default_rng(7).standard_normal((rows, 3, 2))
    wanted = np.einsum("nm,mij->nij", np.linalg.inv(4.0 * alike), columns)
    assert_allclose(weights.apply(columns), wanted, atol=1e-9)
    values = np.tile(weights.components.values, (6000, 1))
    drawn = noise.draw(values, np.ones(rows), np.random.default_rng(8))[:, 1]
    assert_allclose(drawn @ drawn.T / 6000, 4.0 * alike, atol=4.0 * 0.08)


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> LoadTest:
    """Two rows of four without a load, one with sigmas of its own and a component that was not read."""
    cell, rows = simulate(tmp_path_factory.mktemp("noise"), np.random.default_rng(5), poses=2, loads=2)
    wrench, sigma, deflection = rows.wrench.copy(), rows.sigma.copy(), rows.deflection.copy()
    wrench[[1, 3]] = 0.0
    sigma[2], deflection[2, 1] = [1e-6, 5e-6, 7e-6], np.nan
    return LoadTest.of(cell, replace(rows, wrench=wrench, sigma=sigma, deflection=deflection))


@pytest.mark.parametrize("degrees", [np.inf, 6.0])
@pytest.mark.parametrize("set_up", SetUp)
def test_how_far_off_a_row_is_expected_to_be(data: LoadTest, set_up: SetUp, degrees: float) -> None:
    """Its sensor, its force error by its share and of any loaded row, with the tails' variance; re-seating, and set-ups of a
    thousandth of the load; and what its visit may do further, in sensor's sigmas. Of a component that was not read its
    sensor's."""
    rows, cell = data.rows, data.cell
    count = len(rows)
    sizes = VarianceComponents(1.3, 0.7, 1.9, 2.1, 4.0, 3.0, degrees, set_up)
    # Displacement (n, 3, 3) by one newton along each axis.
    by_newton = np.stack([by_compliance(rows.theta, cell.flange_from_tcp.position, np.tile(axis, (count, 1))) @ (1 / TRUE)
                          for axis in np.eye(3)], axis=2)
    force, noise = rows.wrench[:, :3], cell.noise
    assert noise.force_relative_stated
    assert noise.force_stated
    read = ~np.isnan(rows.deflection)
    sensor = np.where(np.isnan(rows.sigma), noise.deflection, rows.sigma)
    loaded = np.any(force != 0, axis=1)[:, None]
    own = (0.7 * noise.force_relative) ** 2 * np.sum((by_newton * force[:, None, :]) ** 2, axis=2)
    own += 1.9**2 * loaded * np.sum((by_newton * noise.force) ** 2, axis=2)
    turned = {SetUp.SIZED: np.einsum("nik,nk->ni", by_newton, force) ** 2,
              SetUp.STRETCHED: np.sum((by_newton * force[:, None, :]) ** 2, axis=2),
              SetUp.TURNED: np.sum(by_newton**2, axis=2) * np.sum(force**2, axis=1)[:, None]}[set_up]
    shared = 0.004**2 * turned + (2.1 * noise.pose_offset) ** 2
    heavier = 1.5 if degrees == 6.0 else 1.0
    further = np.random.default_rng(1).standard_normal((count, 3, 2))
    for more in (None, further):
        moved = 0.0 if more is None else sensor**2 * np.sum(more**2, axis=2)
        wanted = np.sqrt(heavier * ((1.3 * sensor) ** 2 + own * read) + shared * read + moved)
        assert_allclose(residual_std(data, sizes, 1 / TRUE, more), wanted, rtol=1e-4)
    assert noise_model(data, 1 / TRUE).further is None


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("times", [0.99, 1.01])
def test_the_two_parts_of_a_force_error_add_up_whichever_way_the_load_points(data: LoadTest, sign: float, times: float) -> None:
    """To ten thousand sensor's sigmas at most: half of it by a share of the load, half by what any load may be off by."""
    row, count = 2, len(data.rows)
    along_x = np.tile([1.0, 0, 0], (count, 1))
    by_newton = by_compliance(data.rows.theta, data.cell.flange_from_tcp.position, along_x) @ (1 / TRUE)
    sensor = np.where(np.isnan(data.rows.sigma), data.cell.noise.deflection, data.rows.sigma)
    read = ~np.isnan(data.rows.deflection[row])
    newtons = times * 1e4 / np.max(np.abs(by_newton[row] / sensor[row])[read])
    noise = replace(data.cell.noise, force=np.array([newtons / 2, 0.0, 0.0]), force_relative=0.25)
    wrench = np.zeros((count, 6))
    wrench[row, 0] = sign * 2 * newtons
    large = replace(data, cell=replace(data.cell, noise=noise)).with_rows(replace(data.rows, wrench=wrench))
    if times < 1:
        noise_model(large, 1 / TRUE)
        return
    with pytest.raises(CompstiffError, match="moves the tool by 1.01e\\+04 times the sensor's 1 sigma") as stopped:
        noise_model(large, 1 / TRUE)
    assert [one.line for one in stopped.value.findings] == [int(data.rows.line[row])]


def test_a_part_is_there_that_is_stated_of_one_axis_and_of_a_weight_no_set_up(data: LoadTest) -> None:
    """What hangs is as heavy and as plumb at every pose."""
    def of(**stated: object) -> NoiseModel:
        rows = replace(data.rows, hung=np.array([True, False, True, False]))
        cell = replace(data.cell, noise=replace(data.cell.noise, **stated))
        return noise_model(replace(data, cell=cell).with_rows(rows), 1 / TRUE)

    one, none = np.array([0.0, 0.0, 2e-6]), np.zeros(3)
    assert of(force=one, force_relative=0.01, pose_offset=one).active == (True, True, True, True, False, False)
    assert of(force=none, force_relative=0.01, pose_offset=one).active == (True, True, False, True, False, False)
    assert of(force=one, force_relative=0.0, pose_offset=none).active == (True, False, True, False, False, False)
    assert not of().setups[[0, 2]].any()
    assert np.any(noise_model(data, 1 / TRUE).setups[[0, 2]], axis=(1, 2)).all()

"""The own response of a pose visit, by plain least squares of one residual after the other."""

from __future__ import annotations

import numpy as np
import pytest

from identification.fit.own_response import LoadColumns, own_response


@pytest.mark.parametrize("forces", [
    [[0, 0, 100], [0, 0, -300], [0, 0, 0]], [[50, 0, 100], [-120, 0, 40], [10, 0, -300], [0, 0, 0]],
    [[50, 10, 100], [-120, 30, 40], [10, 90, -300], [0, 0, 0], [20, -40, 10]], [[0.1, 0, 300], [0, 0, -200]]])
def test_what_a_response_moves_is_the_compliance_times_the_force(forces: list[list[float]]) -> None:
    """In as many directions as the loads have; one under a thousandth of the largest is none."""
    force = np.array(forces, dtype=float)
    loads = LoadColumns.of(force)
    directions = np.linalg.matrix_rank(force, tol=1.0)
    assert loads.columns.shape == (len(force), 3, 3 * directions)
    np.testing.assert_allclose(loads.directions @ loads.directions.T, np.eye(directions), atol=1e-12)
    compliance = 1e-7 * np.random.default_rng(1).standard_normal((4, 3, 3))
    coefficients = loads.coefficients(compliance)
    assert coefficients.shape == (4, 3 * directions)
    for one, own in zip(compliance, coefficients, strict=True):
        np.testing.assert_allclose(loads.columns @ own, force @ one.T, atol=1e-7)
    # A coefficient is what the root mean square of the loads along its direction does.
    np.testing.assert_allclose(loads.scale, np.sqrt(np.mean((force @ loads.directions.T) ** 2, axis=0)))
    np.testing.assert_allclose(coefficients[0, :3], compliance[0] @ loads.directions[0] * loads.scale[0])


@pytest.mark.parametrize(("share", "directions"), [(0.9e-3, 1), (1.1e-3, 2)])
def test_a_direction_of_load_is_one_from_a_thousandth_of_the_largest(share: float, directions: int) -> None:
    loads = LoadColumns.of(np.array([[300 * share, 0, 0], [0, 0, 300.0]]))
    assert loads.columns.shape == (2, 3, 3 * directions)


@pytest.mark.parametrize(("sizes", "told"), [
    ([100, 100], False), ([100, -100], True), ([100, 0], True), ([100], False), ([100, 111, 105], False),
    ([100, 150, 120], True)])
def test_an_offset_is_told_where_loads_differ(sizes: list[float], told: bool) -> None:
    assert LoadColumns.of(np.outer(sizes, [0.6, 0.0, -0.8])).has_offset is told


@pytest.mark.parametrize("gross", [0.0, 40.0])
def test_a_visit_is_fitted_in_four_rounds_that_make_little_of_bad_rows(gross: float) -> None:
    """Weights (4 + d) / (4 + chi-squared) of a row's d readings, of one at most; what its prior knows of a coefficient is a
    reading of nothing. Every residual by itself; what was not measured tells nothing."""
    rng = np.random.default_rng(2)
    n, count, residuals = 7, 4, 3
    columns, residual = rng.standard_normal((n, 3, count)), rng.standard_normal((n, 3, residuals))
    residual[2] += gross
    precision = np.zeros((n, 3, 3))
    for row in range(n):
        root = np.tril(rng.standard_normal((3, 3))) + 2 * np.eye(3)
        precision[row] = root @ root.T
    precision[4, 1, :] = precision[4, :, 1] = 0.0
    prior = np.array([0.0, 0.5, 2.0, 0.0])
    found = own_response(columns, precision, prior, residual)
    readings = np.array([3, 3, 3, 3, 2, 3, 3])
    for one in range(residuals):
        weight = np.ones(n)
        for _ in range(4):
            stacked, target = [np.diag(np.sqrt(prior))], [np.zeros(count)]
            for row in range(n):
                values, vectors = np.linalg.eigh(precision[row])
                root = np.sqrt(weight[row] * np.maximum(values, 0.0))[:, None] * vectors.T
                stacked.append(root @ columns[row])
                target.append(root @ residual[row, :, one])
            design = np.concatenate(stacked)
            coefficients = np.linalg.lstsq(design, np.concatenate(target), rcond=None)[0]
            left = residual[:, :, one] - columns @ coefficients
            distance = np.array([each @ own @ each for each, own in zip(left, precision, strict=True)])
            last, weight = weight, np.minimum(1.0, (4 + readings) / (4 + distance))
        np.testing.assert_allclose(found.coefficients[one], coefficients, rtol=1e-6, atol=1e-8)
        np.testing.assert_allclose(found.row_weight[one], weight, rtol=1e-5)
        np.testing.assert_allclose(found.covariance[one], np.linalg.inv(design.T @ design), rtol=1e-6, atol=1e-10)
        assert found.left[one] == pytest.approx(np.sum((4 + readings) * np.log(1 + distance / 4)), rel=1e-6)
        assert bool(last.min() < 0.05) is bool(gross)

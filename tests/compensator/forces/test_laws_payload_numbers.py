"""The numbers of a payload, each beside the same worked out in another way."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from compensator.forces.payload import Payload, estimate_payload, interval_factor, turns, weight
from identification.common.arrays import Array

G = 9.80665


def readings(seed: int, count: int = 7, spread: float = 1.0) -> tuple[Array, Array]:
    """Free fall (n, 3) at some orientations, and what a sensor shows there with noise."""
    rng = np.random.default_rng(seed)
    fall = Rotation.random(count, random_state=rng).apply([0, 0, -G])
    force = 8.0 * fall + [3.0, -2, 1] + rng.normal(0, spread, (count, 3))
    moment = np.cross([0.1, -0.2, 0.3], 8.0 * fall) + rng.normal(0, 0.1 * spread, (count, 3))
    return fall, np.hstack([force, moment])


def law(fall: Array, moment: bool) -> Array:
    """What each parameter adds to the readings (3 n, 4 or 6): bias and mass; bias and moment of mass about each axis."""
    columns = [np.tile(axis, len(fall)) for axis in np.eye(3)]
    columns += [np.cross(axis, fall).ravel() for axis in np.eye(3)] if moment else [fall.ravel()]
    return np.column_stack(columns)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("noisy", [None, 0.5, 3.0])
def test_bias_mass_and_centre_are_those_of_least_squares(seed: int, noisy: float | None) -> None:
    """With the covariance of their scatter, or of the noise that the readings have, times as much as they scatter more."""
    fall, load = readings(seed)
    rng = np.random.default_rng(seed + 50)
    noise = None if noisy is None else noisy * rng.uniform(0.5, 1.5, (7, 6)) * [1, 1, 1, 0.1, 0.1, 0.1]
    if noise is not None:
        noise[2, 1] = noise[3, 4] = 0.0
    found = estimate_payload(fall, load, has_moment=True, noise=noise)
    assert found is not None
    assert found.centre is not None
    assert found.centre_std is not None
    assert found.moment_covariance is not None
    answers = []
    for moment in (False, True):
        design, values = law(fall, moment), load[:, 3 * moment:3 * moment + 3].ravel()
        inverse = np.linalg.pinv(design)
        parameters = inverse @ values
        left = values - design @ parameters
        dof = len(values) - len(parameters)
        covariance = inverse @ inverse.T * (left @ left) / dof
        if noise is not None:
            each = np.diag(noise[:, 3 * moment:3 * moment + 3].ravel() ** 2)
            rest = np.eye(len(values)) - design @ inverse
            covariance = inverse @ each @ inverse.T * max(1.0, left @ left / np.trace(rest @ each @ rest.T))
        answers.append((parameters, covariance, np.sqrt(left @ left / dof), dof))
    (force, of_force, scatter, dof), (arm, of_arm, moment_scatter, moment_dof) = answers
    assert_allclose(found.bias, [*force[:3], *arm[:3]])
    assert_allclose(found.bias_std, np.sqrt([*np.diag(of_force)[:3], *np.diag(of_arm)[:3]]))
    assert (found.mass, found.mass_std) == pytest.approx((force[3], np.sqrt(of_force[3, 3])))
    assert_allclose(found.centre, arm[3:] / force[3])
    # Of a quotient of two that are independent.
    assert_allclose((found.centre_std / found.centre) ** 2,
                    np.diag(of_arm)[3:] / arm[3:] ** 2 + of_force[3, 3] / force[3] ** 2)
    assert (found.force_dof, found.moment_dof) == (dof, moment_dof) == (17, 15)
    assert (found.force_scatter, found.moment_scatter) == pytest.approx((scatter, moment_scatter))
    assert_allclose(found.force_covariance, of_force, atol=1e-15)
    assert_allclose(found.moment_covariance, of_arm, atol=1e-15)
    # What is expected at another orientation: by each of its parameters.
    there = Rotation.random(4, random_state=rng).apply([0, 0, -G])
    # Forces and moments each by themselves.
    of_bias = np.array([[4.0, 1, 0], [1, 5, 2], [0, 2, 6]])
    both = found.covariance(there, of_bias)
    for part, row, of_part in ((slice(0, 3), law(there, False), of_force), (slice(3, 6), law(there, True), of_arm)):
        for k, at in enumerate(row.reshape(4, 3, -1)):
            assert_allclose(both[k, part, part], at @ of_part @ at.T, atol=1e-12)
    assert not both[:, :3, 3:].any()
    assert not both[:, 3:, :3].any()
    if noise is None:
        exact = estimate_payload(fall, load, has_moment=True, noise=np.zeros((7, 6)))
        assert exact is not None
        assert_allclose([*exact.bias_std, exact.mass_std], [*found.bias_std, found.mass_std])
    without = estimate_payload(fall, load, has_moment=False, noise=noise)
    assert without is not None
    assert (without.centre, without.centre_std, without.moment_covariance, without.moment_dof) == (None, None, None, 0)
    assert_allclose(without.covariance(there, of_bias)[:, 3:, 3:], np.tile(of_bias, (4, 1, 1)))
    assert_allclose(without.covariance(there, of_bias)[:, :3], both[:, :3])
    assert np.isnan([*without.bias[3:], *without.bias_std[3:], without.moment_scatter]).all()


@pytest.mark.parametrize(("tilt", "told"), [(0.0999, False), (0.1001, True)])
def test_a_mass_is_told_where_gravity_turns_by_a_tenth_in_all(tilt: float, told: bool) -> None:
    """Tilted both ways about one axis: that is the turn in all, and nothing over a second direction."""
    angle = np.arcsin(tilt)
    fall = G * np.array([[-tilt, 0, -np.cos(angle)], [tilt, 0, -np.cos(angle)]])
    assert_allclose(turns(fall), [tilt, 0.0], atol=1e-9)
    found = estimate_payload(fall, np.hstack([5 * fall, np.zeros((2, 3))]), has_moment=True)
    assert (found is not None) == told
    if found is not None:
        assert found.mass == pytest.approx(5.0)
        assert found.centre is None
        assert found.force_dof == 2
    assert estimate_payload(fall[:1], np.zeros((1, 6)), has_moment=True) is None


def test_how_far_gravity_turns_over_two_directions_is_the_least() -> None:
    """Towards both sides, and half as far to the front and the back: an arm along the first sees the second alone."""
    fall = G * np.array([[0.2, 0, -1], [-0.2, 0, -1], [0, 0.1, -1], [0, -0.1, -1]])
    assert_allclose(turns(fall), [np.sqrt((0.2**2 + 0.1**2) / 2), np.sqrt(0.1**2 / 2)])


def payload(mass: float, std: float) -> Payload:
    return Payload(np.zeros(6), np.ones(6), mass, std, None, None, 2, 0, 1.0, 1.0, np.ones(2), np.eye(4))


@pytest.mark.parametrize(("mass", "told", "negative"), [
    (3.01, True, False), (2.99, False, False), (0.0, False, False), (-2.99, False, False), (-3.01, False, True)])
def test_a_mass_is_told_from_none_by_three_sigma(mass: float, told: bool, negative: bool) -> None:
    for std in (1.0, 0.2):
        assert (payload(std * mass, std).told_from_none, payload(std * mass, std).negative) == (told, negative)


@pytest.mark.parametrize(("noise", "centre"), [(0.99, True), (1.01, False)])
def test_a_centre_is_told_where_the_mass_is(noise: float, centre: bool) -> None:
    """Three sigma of the mass, by noise that the readings state, are the mass at 1."""
    fall = G * np.vstack([np.eye(3), -np.eye(3)])
    # Six readings along both senses of each axis: the mass has g sqrt(6) of them behind it.
    sigma = np.full((6, 6), noise * G * np.sqrt(6) / 3)
    load = np.hstack([fall, np.cross([0.1, 0.2, 0.3], fall)])
    found = estimate_payload(fall, load, has_moment=True, noise=sigma)
    assert found is not None
    assert found.mass_std == pytest.approx(noise / 3)
    assert (found.centre is not None) == centre


def test_a_weight_pulls_at_its_arm() -> None:
    fall = np.array([[0.0, 0, -G], [G, 0, 0]])
    assert_allclose(weight(fall, 2.0, None), [[0, 0, -2 * G, 0, 0, 0], [2 * G, 0, 0, 0, 0, 0]])
    assert_allclose(weight(fall, 2.0, np.array([0.1, 0, 0.3])), [[0, 0, -2 * G, 0, 0.2 * G, 0], [2 * G, 0, 0, 0, 0.6 * G, 0]])


@pytest.mark.parametrize(("dof", "factor"), [(1, 12.7062), (5, 2.5706), (30, 2.0423)])
def test_an_interval_is_wider_with_few_degrees_of_freedom(dof: int, factor: float) -> None:
    """Student's table, 97.5 %."""
    assert interval_factor(dof) == pytest.approx(factor, abs=1e-4)

"""Profile likelihoods against a normal distribution in the compliances, in closed form: its marginal is the profile."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import chi2

from identification.fit.profile import Profile, _classified, profiles

HALF = 0.5 * float(chi2.ppf(0.95, 1))
COMPLIANCE = np.geomspace(1e-6, 4e-6, 6)


def held(wanted: np.ndarray, information: np.ndarray, posterior_std: float) -> tuple[Profile, ...]:
    """The profiles of data that want these compliances, in units of those at the MAP."""
    pull = information @ (wanted - 1)
    fitted: Any = SimpleNamespace(
        at_map=SimpleNamespace(design=None, residual=np.zeros((1, 1))), compliance=COMPLIANCE, information=information,
        weights=SimpleNamespace(inner=lambda design, residual: pull[:, None]), laplace=posterior_std**2 * np.eye(6))
    return profiles(fitted)


def correlated(std: np.ndarray) -> np.ndarray:
    """Information of compliances known so well by themselves, each correlated with the others by a third."""
    return np.linalg.inv(np.outer(std, std) * np.where(np.eye(6) > 0, 1.0, 1 / 3))


def test_the_profile_of_a_normal_distribution_is_its_marginal() -> None:
    """Eight posterior sigmas to each side of the MAP, evenly in the logarithm; the interval is 1.96 sigma in the compliance."""
    std, wanted = np.linspace(0.02, 0.07, 6), np.array([1.0, 1.01, 0.98, 1.0, 1.03, 0.97])
    for profile, joint in zip(held(wanted, correlated(std), 0.06), range(6), strict=True):
        assert profile.joint == joint + 1
        assert_allclose(profile.stiffness * COMPLIANCE[joint], np.exp(np.linspace(-0.48, 0.48, 81)))
        inverse = 1 / (profile.stiffness * COMPLIANCE[joint])
        # Against the best of the others, which stay positive here: nearer than six sigmas.
        near = np.abs(inverse - wanted[joint]) < 6 * std[joint]
        assert_allclose(profile.drop[near], (0.5 * ((inverse - wanted[joint]) / std[joint]) ** 2)[near], atol=1e-6)
        low, high = profile.interval
        ends = 1 / (wanted[joint] + np.array([1, -1]) * np.sqrt(2 * HALF) * std[joint]) / COMPLIANCE[joint]
        assert (profile.kind, [low, high]) == ("bounded", pytest.approx(ends, rel=2e-3))
        assert profile.as_dict() == {"name": f"k{joint + 1}", "kind": "bounded", "interval_95": [low, high],
                                     "stiffness": profile.stiffness.tolist(), "log_likelihood_drop": profile.drop.tolist()}


@pytest.mark.parametrize(("posterior_std", "factor"), [(1e-4, 1.01), (0.3, np.exp(2.4)), (0.6, 50.0)])
def test_a_profile_reaches_eight_sigmas_but_a_per_cent_and_no_more_than_a_factor_of_fifty(
        posterior_std: float, factor: float) -> None:
    profile = held(np.ones(6), correlated(np.full(6, 0.3)), posterior_std)[2]
    assert_allclose(profile.stiffness[[0, 40, 80]] * COMPLIANCE[2], [1 / factor, 1.0, factor])


@pytest.mark.parametrize("times", [0.9, 1.1])
def test_a_profile_lies_about_what_the_data_say_where_the_prior_holds_the_stiffness_away_from_that(times: float) -> None:
    """Off by half the drop at the interval's ends and more: then as many sigmas of the data about what they say. Here they want
    1.22 times the compliance at the MAP."""
    std = 0.22 / (times * np.sqrt(HALF))
    profile = held(np.array([1.22, *[1.0] * 5]), np.diag(np.array([std, *[0.2] * 5]) ** -2.0), 0.03)[0]
    middle, reach = (1.0, 8 * 0.03) if times < 1 else (1 / 1.22, 8 * std / 1.22)
    assert_allclose(profile.stiffness[[0, 40, 80]] * COMPLIANCE[0], middle * np.exp([-reach, 0.0, reach]))


@pytest.mark.parametrize(("drop", "kind", "interval"), [
    ([4.0, 1.0, 0.0, 1.0, 4.0], "bounded", (1.0 - (HALF - 1.0) / 3, 3.0 + (HALF - 1.0) / 3)),
    ([1.9, 1.0, 0.0, 1.0, 4.0], "one-sided", (None, 3.0 + (HALF - 1.0) / 3)),
    ([4.0, 1.0, 0.0, 1.0, 1.9], "one-sided", (1.0 - (HALF - 1.0) / 3, None)),
    ([1.9, 1.0, 0.0, 1.0, 1.9], "flat", (None, None)),
    ([4.0, 4.0, 0.0, 4.0, 4.0], "bounded", (2.0 - HALF / 4, 2.0 + HALF / 4))])
def test_an_interval_ends_where_the_likelihood_has_fallen_by_half_of_chi_squared(
        drop: list[float], kind: str, interval: tuple[float | None, float | None]) -> None:
    """Between two points on the logarithm of the stiffness: here e^0 to e^4."""
    profile = _classified(3, np.exp(np.arange(5.0)), np.array(drop))
    assert (profile.joint, profile.kind) == (3, kind)
    assert [end and np.log(end) for end in profile.interval] == [
        end if end is None else pytest.approx(end) for end in interval]

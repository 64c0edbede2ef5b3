"""Trials of the variance components weigh what they stand for: moments of a posterior that is known in closed form."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from identification.fit.noise_parts import SetUp
from identification.fit.variance_components import trial_components


@pytest.mark.parametrize("free", [(1,), (0, 2), (0, 1, 3)])
@pytest.mark.parametrize("wide", [0.6, 1.0, 1.3])
def test_weights_give_the_mean_and_covariance_of_a_normal_posterior(free: tuple[int, ...], wide: float) -> None:
    """A posterior beside the trials' centre, narrower and wider than they were told, turned: its own mean and covariance."""
    rng, at = np.random.default_rng(5), np.array(free)
    root = 0.3 * np.eye(len(at)) + 0.1 * rng.normal(size=(len(at), len(at)))
    told, there = np.zeros((6, 6)), rng.normal(size=6)
    told[np.ix_(at, at)] = root @ root.T
    mean, covariance = there[at] + 0.4 * root @ np.ones(len(at)) / np.sqrt(len(at)), wide**2 * root @ root.T

    class Normal:
        rows, whole = 10, False
        noise = SimpleNamespace(active=np.isin(np.arange(6), at), set_up=SetUp.TURNED)

        def __call__(self, logs: np.ndarray) -> tuple[np.ndarray, None]:
            off = logs[:, at] - mean
            return -0.5 * np.einsum("si,ij,sj->s", off, np.linalg.inv(covariance), off), None

    posterior: Any = Normal()
    components: Any = SimpleNamespace(logs=there)
    trials = trial_components(posterior, components, told)
    assert trials.weight.sum() == pytest.approx(1)
    volume = 0.5 * np.linalg.slogdet(2 * np.pi * covariance)[1]
    assert trials.log_evidence == pytest.approx(volume, abs=0.05)
    found = trials.weight @ trials.logs
    off = (trials.logs - found)[:, at]
    whitened = np.linalg.solve(np.linalg.cholesky(covariance), found[at] - mean)
    spread = np.linalg.solve(np.linalg.cholesky(covariance), np.linalg.cholesky((trials.weight[:, None] * off).T @ off))
    np.testing.assert_allclose(whitened, 0.0, atol=0.05)
    np.testing.assert_allclose(spread @ spread.T, np.eye(len(at)), atol=0.1)
    fixed = np.setdiff1d(np.arange(6), at)
    np.testing.assert_array_equal(trials.logs[:, fixed], np.tile(there[fixed], (len(trials.logs), 1)))

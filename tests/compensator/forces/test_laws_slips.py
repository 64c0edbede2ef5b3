"""How stretches slip against a log's clock: the walk's posterior against that of normal numbers, and where a leap was."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from compensator.forces.alignment_leaps import leaps
from compensator.forces.alignment_slips import _smoothed

STATES = np.linspace(-1.0, 1.0, 401)
CELL = STATES[1] - STATES[0]


def test_the_slips_are_those_of_a_walk_of_normal_numbers() -> None:
    """Normal start, steps and readings: mean and variance are those of the normal equations, and a grid is known to no better
    than the scatter within a cell of it."""
    rng = np.random.default_rng(71)
    count, start, walk = 9, 0.12, 0.05
    read, sigma = rng.normal(0, 0.1, count), rng.uniform(0.03, 0.2, count)
    precision = np.diag(1 / sigma**2)
    precision[0, 0] += 1 / start**2
    for k in range(count - 1):
        precision[k:k + 2, k:k + 2] += np.array([[1, -1], [-1, 1]]) / walk**2
    covariance = np.linalg.inv(precision)
    mean, std = _smoothed(-0.5 * ((STATES - read[:, None]) / sigma[:, None]) ** 2,
                          -0.5 * ((STATES[:, None] - STATES) / walk) ** 2, -0.5 * (STATES / start) ** 2, STATES)
    np.testing.assert_allclose(mean, covariance @ (read / sigma**2), atol=1e-6)
    np.testing.assert_allclose(std, np.sqrt(np.diag(covariance) + CELL**2 / 12), rtol=1e-4)


def test_where_one_state_alone_is_likely_the_slip_is_known_to_its_cell() -> None:
    likelihood = np.where(np.arange(401) == 130, 0.0, -1e4) * np.ones((4, 1))
    mean, std = _smoothed(likelihood, np.zeros((401, 401)), np.zeros(401), STATES)
    assert mean == pytest.approx([STATES[130]] * 4)
    assert std == pytest.approx([CELL / np.sqrt(12)] * 4)


@pytest.mark.parametrize(("stood", "behind"), [(-3.0, 4), (-2.5, 7), (2.0, 6), (-0.3, 4)])
def test_a_leap_is_told_where_it_was_by_its_size(stood: float, behind: int) -> None:
    """Ten stretches of 5 s with a second of air between them, cut by another force each; the log lags from the air behind one
    of them on. What is a walk's own step is none."""
    begin = 6.0 * np.arange(10)
    time = np.sort(np.concatenate([begin, begin + 5.0]))
    program = SimpleNamespace(time=time, period=6.0, stretches=[(2 * k, 2 * k + 1) for k in range(10)])
    size = np.random.default_rng(72).uniform(60, 200, (10, 3))

    def force(planned: np.ndarray) -> np.ndarray:
        number = np.clip((planned // 6.0).astype(int), 0, 9)
        there = (planned >= 0) & (planned - 6.0 * number < 5.0)
        return np.where(there[:, None], size[number] * (1 + 0.5 * np.sin(planned + number))[:, None], 0.0)

    fine = np.arange(0.0, 59.0, 0.05)
    away = 5.5 + 6.0 * (behind - 1)
    measured = force(fine + np.where(fine > away, stood, 0.0)) + np.random.default_rng(73).normal(0, 5, (len(fine), 3))
    regression: Any = SimpleNamespace(
        program=program, planned=lambda _: fine, seen=lambda _, state: force(fine + state),
        left=lambda seen, _: measured - seen,
        fit=lambda _, slip: SimpleNamespace(residual=measured - force(fine + slip), coefficients=None))
    found = leaps(regression, np.zeros(2), np.zeros(len(fine)))
    assert len(found) == (abs(stood) > 1)
    for when, by in found:
        assert when == pytest.approx(away, abs=0.01)
        assert by == pytest.approx(stood, abs=0.15)


def test_a_log_beside_its_program_has_no_leap() -> None:
    """Placed behind the end of it, where no stretch has a sample."""
    program = SimpleNamespace(time=np.array([0.0, 5.0, 6.0, 11.0]), period=6.0, stretches=[(0, 1), (2, 3)])
    regression: Any = SimpleNamespace(program=program, planned=lambda _: np.arange(20.0, 30.0))
    assert leaps(regression, np.zeros(2), np.zeros(10)) == ()

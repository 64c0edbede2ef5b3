"""Analytic derivatives of the search against central differences: objective and every constraint, angles and lines."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.design.criteria import a_criterion
from identification.design.domain import Domain, random_pool
from identification.design.loads import slot
from identification.design.refine import Objective, _Problem

PLACE = np.array([[1.36, 0.0, 0.81]])


def differences(function, x, step=1e-6):
    return np.array([(function(x + move) - function(x - move)) / (2 * step) for move in step * np.eye(len(x))]).T


@pytest.mark.parametrize("boxed", [False, True])
@pytest.mark.parametrize("axes", [("x", "y", "z"), ("yx", "z"), ("free",)])
@pytest.mark.parametrize("reach", [None, (0.9, 1.8)])
def test_slopes(domain, prior, axes, boxed, reach):
    domain = replace(domain, rig=replace(domain.rig, cell=replace(domain.rig.cell, reach=reach)))
    slots = tuple(slot(one, "cycle", 300.0) for one in axes)
    box = np.concatenate([PLACE - 0.2, PLACE + 0.2]) if boxed else None
    here = Domain(domain.rig, slots, None if boxed else PLACE, box)
    rng = np.random.default_rng(0)
    pool = random_pool(here, 100, rng)
    start = pool.take(rng.choice(len(pool), 4))
    criterion = a_criterion()
    problem = _Problem(here, start, Objective(
        lambda told: -float(np.log(criterion.smooth(prior + told.sum(axis=0)))),
        lambda told: -criterion.slope(prior + told.sum(axis=0))))
    x = np.concatenate([start.theta, start.line], axis=1)[:, : problem.width].ravel()
    pairs = [(problem.gradient, problem.value), (problem.inequality_slope, problem.inequality),
             (problem.equality_slope, problem.equality)]
    for slope, value in pairs:
        expected = differences(value, x)
        if expected.size:
            np.testing.assert_allclose(slope(x), expected, atol=1e-7 * np.abs(expected).max())

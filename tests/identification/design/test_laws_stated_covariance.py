"""What a plan promises of stiffnesses where nobody stated the arm's weight, or the load cell's scale exactly: both are unknown
beside them."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from identification.design.criteria import d_criterion
from identification.design.stated_covariance import stated_covariance
from identification.design.task import Task, free_demand
from identification.fit.sag import sag_columns
from identification.model.compliance import compliance_matrix, regressor
from identification.model.load_state import load_state


@pytest.fixture
def task(domain, prior):
    return Task(domain, d_criterion(), prior, free_demand(3, 60))


def in_cell(task: Task, **other: Any) -> Task:
    """The task where something is otherwise in the cell."""
    rig = task.domain.rig
    return replace(task, domain=replace(task.domain, rig=replace(rig, cell=replace(rig.cell, **other))))


@pytest.mark.parametrize("gain", [0.0, 0.02])
def test_it_is_that_of_springs_and_weight_and_scale_together(task, pool, cell, prior, gain):
    """The whole covariance of all rows, the columns of the weight and the scale of all forces among the unknowns, without the
    design's formulas."""
    runs = pool.take(np.arange(60))
    noise, compliance = cell.noise, 1 / cell.prior.stiffness
    information = np.zeros((18, 18))
    information[:6, :6], information[6:, 6:] = prior, np.eye(12)
    for q, slot in zip(runs.theta, runs.slot, strict=True):
        force = task.domain.slots[slot].along(np.array([1.0, 0.0, 0.0]))
        count = len(force)
        wrench, rows = np.column_stack([force, np.zeros((count, 3))]), np.repeat(q[None], count, axis=0)
        springs = regressor(cell.robot, rows, cell.flange_from_tcp, wrench)[:, :3] * compliance
        weight = sag_columns(load_state(cell.robot, cell.flange_from_tcp, rows, wrench, compliance),
                             SimpleNamespace(whitened=lambda moved: moved))
        carried = compliance_matrix(cell.robot, q[None], cell.flange_from_tcp, compliance)[0, :3, :3]
        covariance = np.kron(np.ones((count, count)), np.diag(noise.pose_offset**2))
        for k in range(count):
            loaded = np.diag(np.any(force[k]) * noise.force**2 + (noise.force_relative * force[k]) ** 2)
            block = slice(3 * k, 3 * k + 3)
            covariance[block, block] += np.diag(noise.deflection**2) + carried @ loaded @ carried.T
        scale = gain * springs.sum(axis=2, keepdims=True)
        columns = np.concatenate([springs, weight, scale], axis=2).reshape(3 * count, 18)
        information += columns.T @ np.linalg.solve(covariance, columns)
    expected = np.sqrt(np.diag(np.linalg.inv(information))[:6])
    without = np.sqrt(np.diag(np.linalg.inv(information[:6, :6])))
    assert np.max(expected / without) > 1.08
    stated = stated_covariance(in_cell(task, noise=replace(noise, force_gain=gain)), runs)
    np.testing.assert_allclose(np.sqrt(np.diag(stated)), expected, rtol=0.02)


def test_a_weight_that_is_known_takes_nothing(task, pool):
    runs, rig = pool.take(np.arange(60)), task.domain.rig
    robot = replace(rig.cell.robot, link_mass=np.full(6, 100.0), link_centre=np.zeros((6, 3)))
    known = in_cell(task, robot=robot)
    np.testing.assert_array_equal(stated_covariance(known, runs), np.linalg.inv(known.information(runs)))
    assert (np.diag(stated_covariance(task, runs)) > np.diag(np.linalg.inv(task.information(runs)))).all()

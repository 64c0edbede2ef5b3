"""Ordinary postures: the tool pose with the wrist turned least, poses in front where they cost little, windows of cell.yaml."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from identification.design import posture
from identification.design.criteria import d_criterion
from identification.design.domain import Domain, random_pool
from identification.design.information import instrument, run_information
from identification.design.loads import slot
from identification.design.posture import COST, least_turned, ordinary, reaching_back
from identification.design.procedure import design_plan
from identification.design.request import Request
from identification.design.search import Design, Effort, optimal_design
from identification.design.task import Task, free_demand
from identification.model.cell import read_cell
from tests.support import write_cell
from tests.virtual_cell.arm import ARMS

SERIAL = "irb6700-200-2.60"
TCP = np.array([0.11, -0.02, 0.26])


def domain_of(folder, robot: str, extra: str = "") -> Domain:
    cell = read_cell(write_cell(folder, f"robot: {robot}\ntool: {{position_mm: [110, -20, 260]}}\n{extra}"))
    return Domain(instrument(cell), (slot("xyz", "cycle", 300.0),), np.array([[1.6, 0.0, 0.9]]))


@pytest.mark.parametrize("robot", ["irb6660-205-1.90", SERIAL])
def test_the_tool_stays_where_it_is_and_tells_as_much(tmp_path, robot):
    domain = domain_of(tmp_path, robot)
    rng = np.random.default_rng(31)
    pool = random_pool(domain, 200, rng)
    theta = least_turned(domain, pool.theta)
    arm = ARMS[robot]
    for before, after in zip(pool.theta[::10], theta[::10], strict=True):
        (p, r), (q, s) = arm.pose(before, TCP), arm.pose(after, TCP)
        np.testing.assert_allclose(q, p, atol=1e-9)
        np.testing.assert_allclose(s.as_matrix(), r.as_matrix(), atol=1e-9)
    turn = [np.abs(angles[:, [3, 5]]).sum(axis=1) for angles in (pool.theta, theta)]
    assert (turn[1] <= turn[0] + 1e-12).all()
    assert (turn[1] < turn[0] - 0.1).any(), "the case is none"
    assert (domain.rig.cell.robot.limit_excess(theta) == 0).all()
    loads = domain.table.of(pool.slot, pool.line)
    told = [run_information(domain.rig, domain.look(angles).columns, loads) for angles in (pool.theta, theta)]
    np.testing.assert_allclose(told[1], told[0], rtol=1e-9, atol=1e-9 * np.abs(told[0]).max())


def found_for(domain: Domain) -> Design:
    task = Task(domain, d_criterion(), np.eye(6) / domain.rig.cell.prior.log_std**2, free_demand(1, 6))
    return optimal_design(task, np.random.default_rng(32), Effort(poses=600, exchanges=10, refinements=2, moves=0, climbs=4))


def test_poses_in_front_cost_little(tmp_path):
    domain = domain_of(tmp_path, SERIAL)
    found = found_for(domain)
    task = found.task
    back = reaching_back(domain, found.runs.theta).sum()
    assert back, "the case is none"
    after, findings = ordinary(found)
    left = reaching_back(domain, after.runs.theta).sum()
    assert left <= back
    assert task.value(after.runs) >= (1 - COST) * task.value(found.runs)
    assert after.certificate.efficiency <= task.value(after.runs) / after.certificate.bound * (1 + 1e-6)
    assert (domain.excess(after.runs) <= 1e-6).all()
    assert [finding.code for finding in findings] == ["CS0013"] * bool(left)


@pytest.mark.parametrize(("share", "slips", "words"), [
    (0.981, False, ""), (0.979, False, "poses in front in their place would cost 2 % of the criterion or more"),
    (0.9, False, "poses in front in their place would cost 10 % of the criterion or more"),
    (0.9, True, "no pose in front was found in their place"), (None, False, "no pose in front was found in their place")])
def test_what_a_pose_in_front_would_cost_is_said(tmp_path, monkeypatch, share, slips, words):
    """From 2 % on. Not of one that has none in front at all, or whose search leads back again: that had been told to cost
    0 %."""
    domain = domain_of(tmp_path, SERIAL)
    found = found_for(domain)
    back = reaching_back(domain, found.runs.theta)
    assert back.any(), "the case is none"
    if share is None:
        backwards = reaching_back(domain, found.pool.theta)
        found = replace(found, pool=found.pool.take(backwards))
    else:
        monkeypatch.setattr(posture, "refined", lambda task, start: (SimpleNamespace(
            value=share * found.certificate.value, runs=found.runs if slips else start), None))
    after, findings = ordinary(found)
    if not words:
        assert (findings, reaching_back(domain, after.runs.theta).any()) == ((), False)
        return
    (said,) = findings
    angles = np.degrees(after.runs.theta[reaching_back(domain, after.runs.theta), 0])
    assert len(angles) == back.sum()
    assert (said.code, said.level, said.message) == (
        "CS0013", "note", f"{back.sum()} of 6 poses reach over the robot's back (axis 1 at "
        f"{', '.join(f'{angle:.0f}' for angle in angles)} deg): {words}")


def test_the_cell_s_windows_hold(tmp_path):
    windows = "design: {joint_window_deg: {q1: [-60, 60], q4: [-100, 120], q6: [-90, 90]}, reach_mm: [1300, 1500]}\n"
    cell = read_cell(write_cell(tmp_path, f"robot: {SERIAL}\ntool: {{position_mm: [110, -20, 260]}}\n{windows}"))
    plan = design_plan(cell, Request(measurements=4, axes="z", box_mm=(900, -500, 600, 1900, 500, 1200)), seed=33, quick=True)
    theta = np.degrees(plan.design.runs.theta)
    assert (np.abs(theta[:, 0]) <= 60 + 1e-6).all()
    assert (theta[:, 3] >= -100 - 1e-6).all()
    assert (theta[:, 3] <= 120 + 1e-6).all()
    assert (np.abs(theta[:, 5]) <= 90 + 1e-6).all()
    for angles in plan.design.runs.theta:
        away = np.linalg.norm(ARMS[SERIAL].pose(angles, TCP)[0][:2])
        assert 1.3 - 1e-5 <= away <= 1.5 + 1e-5


@pytest.mark.parametrize("windows", ["joint_window_deg: {q1: [90, -90]}", "joint_window_deg: {q7: [0, 1]}", "reach_mm: [5]"])
def test_windows_that_are_none(tmp_path, windows):
    with pytest.raises(ValueError, match="CS0102"):
        read_cell(write_cell(tmp_path, f"robot: {SERIAL}\ntool: {{position_mm: [110, -20, 260]}}\ndesign: {{{windows}}}\n"))

"""The chain on robots that are not the virtual cell's: their parts get better too, and what is said to be left holds."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.runs.milling.another_arm import PLACES, AnotherArmJob
from tests.runs.milling.milling_job import made_worse, rms
from tests.second_cell.plans import Plan
from tests.virtual_cell.milled_part import AIR
from tests.virtual_cell.milled_part import PLACES as PLACE_NAMES
from tests.virtual_cell.milling import BASE_FROM_OBJECT, angles, engagement, planned

SEEDS = {name: 400 + number for number, name in enumerate(PLACES)}


# The virtual cell mills with the first, and the others but the smallest differ in size.
LONG = tuple(name for name in PLACES if name != "irb4400-60")


@pytest.fixture(scope="module", params=[pytest.param(name, marks=[pytest.mark.long] * (name in LONG)) for name in PLACES])
def job(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> AnotherArmJob:
    return AnotherArmJob(tmp_path_factory.mktemp("arm"), SEEDS[request.param], arm=request.param, motion=1.0)


def test_a_corrected_part_is_better(job: AnotherArmJob) -> None:
    log = job.log(job.first, job.planned, "pass1.csv")
    found = job.correct(log, job.identify())
    before, after = job.first_with(found.part), job.mill(found.commands, part=found.part)
    cut = before.cutting | after.cutting
    off = np.linalg.norm(after.off_um, axis=1)[cut]
    assert rms(off) < 0.12 * rms(np.linalg.norm(before.off_um, axis=1)[cut])
    assert not made_worse(before, after, found.left_um).any()
    # Behind a sharp corner little force acts, before it much, and one target serves both.
    assert not np.any(made_worse(before, after, found.sigma_um) & (before.steps.place == PLACE_NAMES.index("sharp corner")))
    assert "CS4114" in [finding.code for finding in found.job.findings]
    assert np.mean(off <= 2 * before.steps.between(found.left_um)[cut]) > 0.9


def test_the_machine_stands_where_the_part_is(job: AnotherArmJob) -> None:
    """By the arm's own forward way: the TCP is on the path, the spindle points down; arm and cut are in balance."""
    machine, commands = job.moving, planned(job.part)
    theta = angles(commands, machine)
    tcp = np.array(machine.object_m) + 1e-3 * BASE_FROM_OBJECT.apply(commands.position_mm)
    arm = machine.arm
    assert_allclose(arm.robot.tcp(theta, arm.tool), tcp, atol=1e-9)
    longer = arm.robot.tcp(theta, arm.tool + np.array([0, 0, 0.1]))
    assert_allclose(longer - tcp, np.broadcast_to([0, 0, -0.1], tcp.shape), atol=1e-9)
    steps = np.flatnonzero(job.first.cutting)[::40]
    assert len(steps) >= 10
    assert not np.any(job.first.force_n[job.first.steps.feature == AIR])
    at = job.first.steps.between(theta)[steps]
    load = BASE_FROM_OBJECT.apply(job.first.force_n[steps])
    still = np.zeros(len(steps))
    moved = arm.displacement(Plan(at, load, still, still, np.arange(len(steps))), load)
    assert_allclose(1e6 * BASE_FROM_OBJECT.apply(moved, inverse=True), job.first.off_um[steps], atol=0.05)
    stands = job.first.steps.between(job.part.target_mm) + 1e-3 * job.first.off_um
    cut = [job.cutter.mean_force(*engagement(job.part, job.first.steps, job.cutter, i, stands[i])) for i in steps]
    assert_allclose(np.linalg.norm(cut, axis=1), np.linalg.norm(load, axis=1), atol=1e-3)

"""Criterion C: what a run tells of stiffnesses and causes, the bound over the pool, and that causes gain by it."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import combinations_with_replacement

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.optimize import brentq
from scipy.stats import chi2, ncx2

from compstiff.cli.design import design
from identification.design import causes
from identification.design.criteria import d_criterion
from identification.design.domain import Domain, random_pool
from identification.design.exchange import exchange
from identification.design.forecast import spread
from identification.design.information import instrument
from identification.design.loads import slot
from identification.design.posture import reaching_back
from identification.design.search import Effort
from identification.design.task import Demand, Task, free_demand
from identification.diagnosis.plan import judge_plan, visit_information
from identification.measurements import read_measurements
from identification.model.cell import read_cell
from tests.identification.design.conftest import CELL
from tests.support import write_cell

# Causes of one parameter whose law is exact and whose sign is open.
EXACT = {"force_gain", "parallelogram", "wrist_coupling"}
SMALL = Effort(poses=200, exchanges=30, refinements=1, moves=0, climbs=4)


@pytest.fixture(scope="module")
def task(domain, prior):
    box = np.array([[1.1, -0.4, 0.5], [1.7, 0.4, 1.2]])
    return Task(Domain(domain.rig, domain.slots, None, box), d_criterion(), prior, free_demand(3, 6))


@pytest.fixture(scope="module")
def visits(task, cell):
    """Some sixty runs of the pool, and what the dictionary says of each."""
    pool = random_pool(task.domain, 20, np.random.default_rng(3))
    return pool, visit_information(cell, causes._rows(task, pool, None), -np.log(cell.prior.stiffness))


@pytest.fixture(scope="module")
def found(task):
    return causes.design_for_causes(task, None, np.random.default_rng(2), SMALL)


def test_of_the_springs_it_is_the_closed_form(visits):
    """information.py knows no dictionary and no rows: it sums the noise's parts by hand."""
    pool, told = visits
    largest = np.abs(pool.information).max(axis=(1, 2), keepdims=True)
    assert np.abs((told.of[:, :6, :6] - pool.information) / largest).max() < 1e-3


def test_of_a_plan_s_causes_it_is_what_the_forecast_finds(visits, task, cell):
    """An effect with one parameter is found from the size on at which normal numbers about its distance from the springs pass
    what one in so many passes by itself, in four cases of five, and a little later where the noise would take some of it; one
    of several parameters over all directions that it may have. The forecast takes all rows together."""
    pool, told = visits
    total = np.diag(np.concatenate([np.diag(told.prior)[:6], np.zeros(len(told.prior) - 6)])) + told.of.sum(axis=0)
    left = total[6:, 6:] - total[6:, :6] @ np.linalg.solve(total[:6, :6], total[6:, :6].T)
    effects = judge_plan(cell, causes._rows(task, pool, None)).effects
    outlook = {cause.entry.label: cause.detectable for cause in effects}
    # Two-sided, over as many causes; of three parameters a chi-squared of three.
    passes = {degrees: chi2.isf(0.05 / len(effects), degrees) for degrees in (1, 3)}
    needed = np.sqrt(brentq(lambda nc: ncx2.sf(passes[1], 1, nc) - 0.8, 1, 100))
    distances = {label: outlook[label] * np.sqrt(left[k, k]) for k, label in enumerate(told.labels)
                 if label in outlook and told.labels.count(label) == 1 and label in EXACT}
    assert distances.keys() == EXACT
    assert all(0.93 * needed < distance < 1.2 * needed for distance in distances.values()), (needed, distances)
    rng = np.random.default_rng(5)
    for label in ("deflection_sensor_rotation",):
        mine = [k for k, other in enumerate(told.labels) if other == label]
        along = rng.standard_normal((4000, len(mine)))
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        shown = outlook[label]**2 * np.einsum("di,ij,dj->d", along, left[np.ix_(mine, mine)], along)
        assert np.mean(ncx2.sf(passes[3], 3, shown)) == pytest.approx(0.83, abs=0.05), label


def test_no_plan_out_of_the_pool_beats_the_bound(visits, task):
    pool, told = visits
    runs = replace(pool, information=told.of)
    two = Task(task.domain, d_criterion(), told.prior, free_demand(3, 2))
    best = max(two.value(runs.take(np.array(rows))) for rows in combinations_with_replacement(range(len(runs)), 2))
    assert best <= causes._bound(two, runs, np.array([0, 1])) * (1 + 1e-9)
    # Of many runs hardly a fraction is a whole number, and the bound is close.
    many = Task(task.domain, d_criterion(), told.prior, free_demand(3, 60))
    chosen, value = exchange(many, runs, np.random.default_rng(0))
    bound = causes._bound(many, runs, chosen)
    assert 0.97 * bound < value <= bound * (1 + 1e-9)


# Long: what the criterion counts is held above against the forecast and the bound; a whole plan, on the command line below.
@pytest.mark.long
def test_more_causes_are_told_apart_and_the_price_is_said(found, task, cell):
    plan, worth = found
    named = judge_plan(cell, causes._rows(task, plan.runs, None)).counts["identifiable"]
    assert named >= worth.otherwise_named + 3
    assert worth.largest < 2 * worth.otherwise_largest
    assert worth.largest == pytest.approx(float(np.sqrt(np.diag(plan.covariance).max())))
    assert 0.5 < worth.share <= 1
    assert plan.certificate.efficiency < 0.95       # by the stiffnesses alone it is not the best
    assert task.domain.excess(plan.runs).max() <= 1e-6


@pytest.fixture(scope="module")
def one_run(cell, prior):
    """What a single run is to be, visited twice, and the rows of another one that is measured, the last of them kept back."""
    task = Task(Domain(instrument(cell), (slot("z", "single", 300.0),), np.array([[1.36, 0.0, 0.81]])), d_criterion(), prior,
                free_demand(1, 1), 2)
    measured = causes._rows(task, random_pool(task.domain, 1, np.random.default_rng(8)), None)
    return task, replace(measured, validate=np.arange(len(measured)) == len(measured) - 1)


@pytest.mark.parametrize(("before", "left_out"), [(False, ()), (True, (1,))])
def test_one_run_is_the_best_of_the_pool_and_its_figures_are_those_of_all_of_them(
    one_run, cell, prior, monkeypatch, before, left_out,
):
    """Each run of the pool by itself, and the best plan in fractions by the multiplicative rule (Silvey, Titterington, Torsney
    1978): neither the exchange nor the bound."""
    monkeypatch.setattr(causes, "ROWS", 16)
    task, measured = one_run
    if left_out:
        task = replace(task, criterion=d_criterion().of_seen(np.eye(6)[:, 1:]))
    design, worth = causes.design_for_causes(task, measured if before else None, np.random.default_rng(2),
                                             replace(SMALL, poses=60, climbs=2))
    pool = design.pool
    assert (len(design.runs), len(pool), worth.pool) == (1, 8, 8)
    rows = causes._rows(replace(task, replicates=1), pool, measured.select(~measured.validate) if before else None)
    told = visit_information(cell, rows, np.log(task.domain.rig.compliance))
    earlier, each = told.prior + told.of[:-8].sum(axis=0), 2 * told.of[-8:]

    def bits(information):
        return 0.5 / np.log(2) * (np.linalg.slogdet(information)[1] - np.linalg.slogdet(earlier)[1])

    single = [bits(earlier + one) for one in each]
    assert np.array_equal(design.runs.theta[0], pool.theta[int(np.argmax(single))])
    assert worth.bits == pytest.approx(max(single), rel=1e-6)
    weights = np.full(8, 1 / 8)
    for _ in range(400):
        gain = np.einsum("nij,ji->n", each, np.linalg.inv(earlier + np.einsum("n,nij->ij", weights, each)))
        weights *= gain / (weights @ gain)
    best = bits(earlier + np.einsum("n,nij->ij", weights, each))
    assert 0.96 * worth.bits / best < worth.share <= worth.bits / best
    # The springs alone, from the prior: what was measured is in that of the task.
    seen = slice(len(left_out), 6)
    after = [prior + 2 * information for information in pool.information]
    plainly = int(np.argmax([np.linalg.det(one[seen, seen]) for one in after]))
    assert worth.otherwise_largest == pytest.approx(np.sqrt(np.diag(np.linalg.inv(after[plainly]))[seen].max()))
    assert worth.largest == pytest.approx(np.sqrt(np.diag(np.linalg.inv(after[int(np.argmax(single))]))[seen].max()))
    assert worth.otherwise_named == 0       # of one load at one pose
    assert design.certificate.value == pytest.approx(design.task.value(design.runs))


def test_what_a_plan_by_causes_is_worth_in_words():
    worth = causes.ByCauses(41.6, 0.8379, 233, 0.031, 17, 0.022)
    assert worth.lines() == [
        "42 bits about stiffnesses and causes, at least 83 % of what as many out of 233 runs drawn at random could tell "
        "(equivalence theorem, poses as fractions)",
        f"as many runs by criterion D name 17 causes of typical size and know the least known stiffness {spread(0.022)}; these "
        f"know it {spread(0.031)}, their causes stand below"]


def test_the_pool_is_of_ordinary_postures_with_runs_of_every_group(domain, prior, tmp_path):
    """An arm without a rod reaches over its back too; a group that is only reached so is kept."""
    serial = read_cell(write_cell(tmp_path, "robot: irb6700-200-2.60\ntool: {position_mm: [110, -20, 260]}\n"))
    beside = Domain(instrument(serial), domain.slots[:2], np.array([[1.6, 0.0, 0.9]]))
    task = Task(beside, d_criterion(), prior, Demand(np.arange(2), np.array([0, 1])))
    pool = random_pool(beside, 3000, np.random.default_rng(4))
    back = reaching_back(beside, pool.theta)
    assert back.any()
    small = causes._small(task, pool, np.random.default_rng(0))
    assert not reaching_back(beside, small.theta).any()
    only = pool.take(back | (pool.slot == 0))
    kept = causes._small(task, only, np.random.default_rng(0))
    assert set(np.unique(kept.slot)) == {0, 1}
    assert reaching_back(beside, kept.theta)[kept.slot == 1].all()


# Long: rows before count in tests/identification/design/test_laws_discrimination.py.
@pytest.mark.long
def test_rows_measured_before_count(task, found, cell):
    """The same runs again tell less that is new than runs that are chosen after them."""
    plan, worth = found
    before = causes._rows(task, plan.runs, None)
    _, further = causes.design_for_causes(task, before, np.random.default_rng(2), SMALL)
    assert further.bits < 0.6 * worth.bits
    assert further.otherwise_named >= worth.otherwise_named


def test_on_the_command_line(tmp_path, monkeypatch):
    """Over a seventh of the pool, which the bound takes most of the time for."""
    monkeypatch.setattr(causes, "ROWS", 1000)
    cell = write_cell(tmp_path, CELL)
    arguments = [cell, "-o", tmp_path / "plan.csv", "--criterion", "C", "--measurements", 3, "--axes", "z", "--quick",
                 "--report", tmp_path / "plan.html", "--json"]
    result = CliRunner().invoke(design, [str(argument) for argument in arguments])
    assert result.exit_code == 0, result.output
    content = json.loads(result.stdout)["result"]
    assert content["criterion"] == "C"
    assert content["by_causes"]["pool"] > 100
    assert 0.5 < content["by_causes"]["share_of_best_in_pool"] <= 1
    assert len(read_measurements(tmp_path / "plan.csv", read_cell(cell).robot, planned=True).row) == content["rows"] == 21
    assert "possible causes" in (tmp_path / "plan.html").read_text(encoding="utf-8")
    both = CliRunner().invoke(design, [str(cell), "-o", str(tmp_path / "x.csv"), "--criterion", "C", "--add", "1",
                                       str(tmp_path / "plan.csv"), "--diagnosis", str(tmp_path / "plan.csv")])
    assert both.exit_code == 2
    assert "give one of them" in both.output

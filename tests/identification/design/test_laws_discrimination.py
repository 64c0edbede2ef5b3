"""Runs after an ambiguous diagnosis: what they promise, measured in a cell that shares no code with the package."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import combinations
from types import SimpleNamespace

import numpy as np
import pytest

from identification.common.findings import CompstiffError
from identification.design import discrimination as design_discrimination
from identification.design.criteria import d_criterion
from identification.design.discrimination import (
    discriminating_design,
    discriminating_runs,
    read_diagnosis,
    rival_models,
)
from identification.design.domain import Domain, random_pool
from identification.design.exchange import many_exchanges
from identification.design.information import instrument
from identification.design.loads import slot
from identification.design.request import measured_place
from identification.design.search import Effort
from identification.design.task import Task, free_demand
from identification.diagnosis import discrimination as between_rivals
from identification.diagnosis.diagnose import diagnose
from identification.diagnosis.discrimination import Separation, candidate_rows, discriminating, separation
from identification.measurements import read_measurements
from identification.model.cell import read_cell
from identification.model.kinematics import forward
from tests.runs.hidden_effects.more_rows import measured_further
from tests.support import random_poses
from tests.virtual_cell.cell import Hidden, simulate

SEEDS = (700090,)
# Left open there by one load a pose.
OPEN = (Hidden("bearing_tilt", 3, 0.74),)


def diagnosed(case, folder):
    cell_file, rows_file = case.write(folder)
    cell = read_cell(cell_file)
    rows = read_measurements(rows_file, cell.robot)
    return cell, rows, diagnose(cell, rows, replicates=39)


def probability(case, found):
    truth = case.truth[0]
    return sum(one.probability for one in (*found.alternatives, *found.causes)
               if (one.effect.name, one.joint) == (truth["effect"], truth["joint"])) * (found.verdict in ("named", "ambiguous"))


@pytest.fixture(scope="module")
def hard(tmp_path_factory):
    folder = tmp_path_factory.mktemp("hard")
    case = simulate(SEEDS[0], "poses20", OPEN)
    cell, rows, found = diagnosed(case, folder)
    (folder / "diagnosis.json").write_text(json.dumps(found.as_dict()))
    return folder, cell, rows, found


def test_rivals_are_as_far_apart_as_their_predictions(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two linear models of five visits: the distance of what each lets expect of a visit's readings, in the readings' noise and
    the mean of what the two posteriors leave unsure of them (Bhattacharyya); written with the full covariance."""
    rng = np.random.default_rng(9)
    visits, rows, noise = 5, 2, 3e-6
    readings = 40e-6 * rng.standard_normal((2, visits * rows, 3))
    slopes = [30e-6 * rng.standard_normal((visits * rows, 3, size)) for size in (6, 8)]
    roots = [0.2 * rng.standard_normal((size, size)) for size in (6, 8)]
    covariances = [root @ root.T + 0.01 * np.eye(len(root)) for root in roots]
    data = SimpleNamespace(with_rows=lambda trial: None)
    whitening = np.broadcast_to(np.eye(3) / noise, (visits * rows, 3, 3))
    kind = SimpleNamespace(whitening=whitening, weights=lambda components: SimpleNamespace(
        apply=lambda columns: columns.reshape(3 * visits * rows, -1)))
    models = [SimpleNamespace(data=data, compliance=None, components=None, quick_covariance=covariance, map=k, terms=None)
              for k, covariance in enumerate(covariances)]
    monkeypatch.setattr(between_rivals, "noise_model", lambda *of: kind)
    monkeypatch.setattr(between_rivals, "response", lambda data, k, terms: (readings[k], slopes[k]))
    trial = SimpleNamespace(visit=np.repeat(np.arange(visits), rows))
    found = separation(trial, {"one": (models[0], 0.3), "other": (models[1], 0.1)})

    def squared(chosen: list[int]) -> float:
        mine = np.isin(trial.visit, chosen)
        apart = (readings[0] - readings[1])[mine].ravel()
        unsure = [slope[mine].reshape(len(apart), -1) for slope in slopes]
        covariance = noise**2 * np.eye(len(apart)) + sum(s @ c @ s.T for s, c in zip(unsure, covariances, strict=True)) / 2
        return float(apart @ np.linalg.solve(covariance, apart))

    assert found.probability == pytest.approx([0.75, 0.25])
    for chosen in ([0], [3], [1, 2, 4]):
        assert found.squared(found.of(np.array(chosen)))[0] == pytest.approx(squared(chosen), rel=1e-6)
        assert found.mistaken(found.of(np.array(chosen))) == pytest.approx(
            min(1.0, np.sqrt(0.75 * 0.25) * np.exp(-squared(chosen) / 8)), rel=1e-6)
    assert found.squared(found.grams)[0] == pytest.approx([squared([visit]) for visit in range(visits)], rel=1e-6)
    assert found.best_pair(3) == (("one", "other"), pytest.approx(np.sqrt(squared([3])), rel=1e-6))


def test_what_a_choice_makes_of_the_robot_is_the_largest_difference_of_two(monkeypatch: pytest.MonkeyPatch) -> None:
    """RMS over the loaded rows of what the springs and the robot's own effects do; what sits in the sensor is none of it."""
    moved = 1e-6 * np.random.default_rng(2).normal(0, 30, (3, 8, 3))
    kept: list[list[bool]] = []
    wrench = np.zeros((9, 6))
    wrench[[0, 2, 3, 7], [0, 2, 5, 1]] = 100.0
    rows = SimpleNamespace(wrench=wrench, select=lambda rows: kept.append(rows.tolist()))
    data = SimpleNamespace(rows=rows, with_rows=lambda kept: "loaded")
    robot, sensor = (SimpleNamespace(effect=SimpleNamespace(of_robot=own)) for own in (True, False))
    models = [SimpleNamespace(data=data, log_compliance=np.full(6, float(k)), terms=(sensor, robot),
                              term_values=[np.array([99.0]), np.array([0.5])]) for k in range(3)]
    asked = []

    def predicted(data: object, x: np.ndarray, terms: list[object]) -> np.ndarray:
        asked.append((data, x.tolist(), terms))
        return moved[int(x[0])]

    monkeypatch.setattr(between_rivals, "predicted_deflection", predicted)
    found = between_rivals.robot_difference(models)
    assert asked == [("loaded", [k] * 6 + [0.5], [robot]) for k in (0.0, 1.0, 2.0)]
    assert kept == [[row in (0, 2, 3, 7) for row in range(9)]]
    assert found == pytest.approx(max(np.sqrt(np.mean((a - b) ** 2)) for a, b in combinations(moved, 2)))
    assert between_rivals.robot_difference(models[:1]) == 0.0


@pytest.mark.parametrize(("shares", "fitted"), [
    ([0.6, 0.3, 0.06, 0.04], 3), ([0.97, 0.03], 2), ([0.05] * 20, 12), ([0.3, 0.15, 0.04, 0.01], 3), ([0.05] * 8, 8)])
def test_rivals_hold_nearly_all_of_what_is_left_open(monkeypatch: pytest.MonkeyPatch, shares: list[float], fitted: int) -> None:
    """0.95 of the probability that the sets have together, two of them at least and twelve at most; not those of which no fit
    converges."""
    sets = [SimpleNamespace(name=f"set {k}", probability=share) for k, share in enumerate(shares)]
    seen = SimpleNamespace(hypotheses=sets, terms=lambda one: one, name=lambda one: one.name)
    monkeypatch.setattr(between_rivals, "attempt", lambda data, terms, near: f"fit of {terms.name}")
    assert between_rivals.rivals_of("rows", seen, "near") == {
        f"set {k}": (f"fit of set {k}", shares[k]) for k in range(fitted)}
    monkeypatch.setattr(between_rivals, "attempt", lambda data, terms, near: None)
    assert between_rivals.rivals_of("rows", seen, "near") == {}


def test_the_rivals_of_the_file_are_those_of_the_diagnosis(hard):
    folder, cell, rows, found = hard
    told = read_diagnosis(folder / "diagnosis.json", cell)
    assert told.verdict == "ambiguous"
    assert set(told.names) == {(one.effect.name, one.joint) for one in found.alternatives}
    rivals = rival_models(cell, rows, told)
    assert len(rivals) >= 2
    labels = {one.label for one in found.alternatives}
    assert all(set(name.split(" + ")) <= labels for name in rivals)
    shares = [share for _, share in rivals.values()]
    assert shares == sorted(shares, reverse=True)


def test_a_set_of_runs_separates_by_what_its_readings_differ(hard):
    """The closed form, which adds runs up, against the covariance of all their readings at once."""
    folder, cell, rows, _ = hard
    rivals = rival_models(cell, rows, read_diagnosis(folder / "diagnosis.json", cell))
    rng = np.random.default_rng(0)
    trial = candidate_rows(random_poses(cell.robot, 4, rng, 0.6), np.array([0, 1, 2, 0]), 300.0)
    models = [model for model, _ in rivals.values()]
    found = separation(trial, rivals)
    chosen = np.array([0, 2, 3])
    fewer = found.squared(found.of(chosen[:2]))
    assert (found.squared(found.of(chosen)) >= fewer * (1 - 1e-9)).all()
    from identification.fit.fitted_model import response
    from identification.fit.noise import noise_model

    data = models[0].data.with_rows(trial)
    noise = noise_model(data, models[0].compliance)
    kept = np.isin(trial.visit, chosen)
    size = int(kept.sum())
    unit = np.eye(3 * len(trial)).reshape(len(trial), 3, -1)
    precision = noise.weights(models[0].components).inner(noise.whitening @ unit, noise.whitening @ unit)
    mine = np.repeat(kept, 3)
    covariance = np.linalg.inv(precision[np.ix_(mine, mine)])
    for k, (a, b) in enumerate(combinations(range(len(models)), 2)):
        (one, by_one), (other, by_other) = (response(data, models[i].map, models[i].terms) for i in (a, b))
        off = (one - other)[kept].ravel()
        # By the curvature, and, which tells whether that will do, by the draws.
        for name, close in (("quick_covariance", 1e-3), ("covariance", 0.03)):
            spread = sum(slope[kept].reshape(3 * size, -1) @ getattr(models[i], name) @ slope[kept].reshape(3 * size, -1).T
                         for i, slope in ((a, by_one), (b, by_other))) / 2
            expected = off @ np.linalg.solve(covariance + spread, off)
            assert found.squared(found.of(chosen))[k] == pytest.approx(expected, rel=close, abs=1e-6)


def test_chosen_together_they_beat_any_pair_drawn(hard):
    folder, cell, rows, _ = hard
    rivals = rival_models(cell, rows, read_diagnosis(folder / "diagnosis.json", cell))
    rng = np.random.default_rng(1)
    poses = random_poses(cell.robot, 20, rng, 0.6)
    found = separation(candidate_rows(poses, np.arange(20) % 3, 300.0), rivals)
    best = float(found.mistaken(found.of(np.array(discriminating(found, 2, np.arange(20))))))
    every = [float(found.mistaken(found.of(np.array(pair)))) for pair in combinations(range(20), 2)]
    assert best <= np.quantile(every, 0.02)


@pytest.mark.parametrize(("likelier", "asked", "runs", "before", "after"), [
    (0.9, 5, 3, 0.1, 0.3 * np.exp(-3)), (0.9, 2, 2, 0.1, 0.3 * np.exp(-2)), (0.9, 1, 1, 0.1, 0.1),
    (0.99, 3, 1, 0.01, 0.01), (0.5, 4, 4, 0.5, 0.5 * np.exp(-4))])
def test_no_more_runs_are_taken_than_decide_and_the_likeliest_is_wrong_at_most_as_often_as_it_is_not_true(
    monkeypatch: pytest.MonkeyPatch, domain, pool, prior, likelier: float, asked: int, runs: int, before: float, after: float,
) -> None:
    """Two rivals that each run takes sqrt(8) sigmas apart: after k runs sqrt(p q) exp(-k) bounds the wrong names, and so does
    what the likelier one leaves. Of more runs than bring it under 2 % the others are not taken, one always is."""
    def alike(rows, rivals):
        grams = np.zeros((int(rows.visit.max()) + 1, 2, 2))
        grams[:, -1, -1] = 8.0
        return Separation(("one", "other"), np.array([likelier, 1 - likelier]), ((0, 1),), (grams,), (np.eye(1),))

    monkeypatch.setattr(design_discrimination, "separation", alike)
    task = Task(domain, d_criterion(), prior, free_demand(3, asked))
    chosen, told = discriminating_runs(task, {}, pool, np.random.default_rng(0))
    assert len(chosen) == told.runs == runs
    assert (told.before, told.after) == pytest.approx((before, after))
    assert told.pairs == (("one", "other", pytest.approx(np.sqrt(8 * runs))),)
    assert len(np.unique(chosen.theta, axis=0)) == runs


@pytest.mark.parametrize(("asked", "first"), [(3, 3), (5, 3)])
def test_the_runs_that_decide_nothing_more_are_the_criterion_s(
    monkeypatch: pytest.MonkeyPatch, domain, prior, asked: int, first: int,
) -> None:
    """Rivals that three runs tell apart to 2 %, as above: the others are better by D than most that a pool would give."""
    def alike(rows, rivals):
        grams = np.zeros((int(rows.visit.max()) + 1, 2, 2))
        grams[:, -1, -1] = 8.0
        return Separation(("one", "other"), np.array([0.9, 0.1]), ((0, 1),), (grams,), (np.eye(1),))

    monkeypatch.setattr(design_discrimination, "separation", alike)
    monkeypatch.setattr(design_discrimination, "certify", lambda *given, starts: (given[1], starts))
    one_axis = replace(domain, slots=domain.slots[:1])
    task = Task(one_axis, d_criterion(), prior, free_demand(1, asked))
    design, told = discriminating_design(task, {}, np.random.default_rng(0), Effort(300, 8, 1, 0, 2))
    rng = np.random.default_rng(0)
    pool = random_pool(one_axis, 300, rng)
    chosen, _ = discriminating_runs(task, {}, pool, rng)
    assert (len(design.runs), len(chosen), told.runs) == (asked, first, first)
    np.testing.assert_array_equal(design.runs.theta[:first], chosen.theta)
    np.testing.assert_allclose(design.information, task.information(design.runs), rtol=1e-12)
    assert design.certificate[0] is design.runs
    if asked > first:
        draws = np.random.default_rng(1).integers(0, len(pool), (200, asked - first))
        others = [task.value(chosen.joined(pool.take(rows))) for rows in draws]
        assert task.value(design.runs) > np.quantile(others, 0.95)


def test_planned_runs_settle_what_is_open(tmp_path):
    """One further run in a case the plain answer leaves open (0.56) settles it, no worse than the D-optimal run does."""
    gained = []
    for seed in SEEDS:
        case = simulate(seed, "poses20", OPEN)
        cell, rows, found = diagnosed(case, tmp_path)
        model = found.judgement.plain
        slots = tuple(slot(axis, "cycle", 300.0) for axis in "xyz")
        tcp = forward(cell.robot, rows.theta, cell.flange_from_tcp).position
        domain = Domain(instrument(cell, np.exp(model.mean)), slots, *measured_place(tcp))
        task = Task(domain, d_criterion(), np.linalg.inv(model.covariance), free_demand(3, 1))
        rng = np.random.default_rng([seed, 8])
        pool = random_pool(domain, 600, rng)
        (tmp_path / "diagnosis.json").write_text(json.dumps(found.as_dict()))
        rivals = rival_models(cell, rows, read_diagnosis(tmp_path / "diagnosis.json", cell))
        plans = [discriminating_runs(task, rivals, pool, rng)[0],
                 pool.take(many_exchanges(task, pool, rng, 4)[0][0])]
        after = []
        for plan in plans:
            loads = slots[plan.slot[0]].forces
            further = measured_further(case, plan.theta[0], loads, np.random.default_rng(seed), (5.0, 20.0))
            after.append(probability(case, diagnosed(further, tmp_path)[2]))
        gained.append(after)
    settled, plain = np.mean(np.array(gained), axis=0)
    assert settled > 0.8
    assert settled > plain - 0.05


@pytest.mark.parametrize(("verdict", "taken"), [
    *((verdict, True) for verdict in ("adequate", "named", "ambiguous", "unknown", "mistake")),
    ("Ambiguous", False), ("ambigous", False), ("", False), (None, False)])
def test_a_verdict_that_diagnose_never_writes_is_none(cell, tmp_path, verdict: str | None, taken: bool) -> None:
    """It had counted as one that leaves nothing open, and the runs asked for were planned without it."""
    file = tmp_path / "diagnosis.json"
    file.write_text(json.dumps({"format": "compstiff-diagnosis", "robot": cell.robot.name, "verdict": verdict}))
    if taken:
        assert read_diagnosis(file, cell).verdict == verdict
        return
    with pytest.raises(CompstiffError) as refused:
        read_diagnosis(file, cell)
    (said,) = refused.value.findings
    assert (said.code, said.file) == ("CS1650", str(file))
    assert said.message == ("verdict: Input should be a valid string" if verdict is None else f"verdict: found '{verdict}', "
                            "expected one of adequate, named, ambiguous, unknown, mistake")


def test_files_that_are_no_diagnosis_of_this_cell(hard, tmp_path):
    folder, cell, _, _ = hard
    wrong = tmp_path / "wrong.json"
    content = json.loads((folder / "diagnosis.json").read_text())
    strange = content["alternatives"] + [{"effect": "gremlins", "joint": None, "probability": 0.1}]
    elsewhere = [content["alternatives"][0] | {"effect": "backlash", "joint": 9}]
    for text, says in (
        ("{", "not a diagnosis file: Expecting property name"), ("[]", "not a diagnosis file: its format is not compstiff-"),
        (json.dumps(content | {"format": "other"}), "not a diagnosis file: its format is not compstiff-diagnosis"),
        (json.dumps(content | {"robot": "other"}), f"the diagnosis is of robot other, the cell has {cell.robot.name}"),
        (json.dumps(content | {"verdict": 5}), "verdict: Input should be "),
        (json.dumps(content | {"alternatives": strange}), "the diagnosis names gremlins at joint None, which no effect here"),
        (json.dumps(content | {"alternatives": elsewhere}), "the diagnosis names backlash at joint 9, which no effect here")):
        wrong.write_text(text)
        with pytest.raises(CompstiffError) as refused:
            read_diagnosis(wrong, cell)
        (finding,) = refused.value.findings
        assert (finding.code, finding.file) == ("CS1650", str(wrong))
        assert finding.message.startswith(says)
    wrong.write_text(json.dumps(content))
    assert read_diagnosis(wrong, cell).verdict == content["verdict"]


def test_a_joint_log_s_diagnosis_plans_no_loads(cell, tmp_path):
    """Its names had been fitted to whatever load tests stood beside it."""
    file = tmp_path / "diagnosis.json"
    file.write_text(json.dumps({"format": "compstiff-diagnosis", "robot": cell.robot.name, "verdict": "ambiguous",
                                "measured": "joint deflection log"}))
    with pytest.raises(CompstiffError) as refused:
        read_diagnosis(file, cell)
    (said,) = refused.value.findings
    assert (said.code, said.message[:30]) == ("CS1650", "of a joint deflection log: its")
    assert read_diagnosis(file, cell, for_loads=False).verdict == "ambiguous"       # compstiff check

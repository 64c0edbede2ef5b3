"""What dead weights bring: a hook beside the tool point and a swing, told from each other and from nothing; the virtual cell is
the truth."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from identification.diagnosis import discrimination
from identification.diagnosis.detect import goodness_of_fit
from identification.diagnosis.diagnose import Diagnosis, diagnose
from identification.diagnosis.discrimination import hung_cycle, next_loads, planned_rows, separation
from identification.diagnosis.procedure import Procedure
from identification.diagnosis.swing import _groups, _visit, _Visits, swing_of
from identification.fit.fitted_model import Term
from identification.fit.load_test import LoadTest
from identification.fit.posterior import Posterior, posterior
from identification.measurements import Measurements, read_measurements
from identification.model.cell import Cell, read_cell
from identification.model.compliance import compliance_matrix
from identification.model.effects import effects
from identification.model.effects.kinds import NOTHING_HANGS, ONLY_AS_SCATTER
from tests.virtual_cell.cell import Case, Hidden, simulate


def read(case: Case) -> tuple[Cell, Measurements]:
    with TemporaryDirectory() as folder:
        cell_path, rows_path = case.write(Path(folder))
        cell = read_cell(cell_path)
        return cell, read_measurements(rows_path, cell)


@cache
def diagnosed(seed: int, *hidden: Hidden, design: str = "hung12") -> tuple[Case, Diagnosis]:
    case = simulate(seed, design, hidden)
    return case, diagnose(*read(case), replicates=39)


def test_the_hook_is_the_physics() -> None:
    """Force beside the displaced TCP in the closed-loop arm; neglected are terms of second order in the deflection."""
    case = simulate(1, "hung12", [Hidden("hook_offset")], "none")
    cell, rows = read(case)
    truth = case.truth[0]["parameters"]
    state = LoadTest.of(cell, rows).load_state(1 / case.stiffness)
    added = effects()["hook_offset"].contribution(state, None, np.array([truth["x_m"], truth["y_m"]]))[:, :3]
    size = np.sqrt(np.mean(case.effect_um**2))
    assert size > 1
    assert np.sqrt(np.mean((1e6 * added - case.effect_um) ** 2)) < 0.02 * size


def test_a_plumb_line_is_level_in_any_base() -> None:
    """The moment is across gravity and as large as lever times weight, whichever way the base stands; nothing else changes."""
    cell, rows = read(simulate(1, "hung12", noise="none"))
    effect = effects()["hook_offset"]
    state = LoadTest.of(cell, rows).load_state(1 / cell.prior.stiffness)
    for fall in ([0, 0, -9.80665], [-9.80665, 0, 0], [3.0, -5.0, 7.0]):
        down = np.array(fall, dtype=float)
        vars(state)["fall"] = down
        wrench = np.zeros_like(state.wrench)
        wrench[:, :3] = np.linspace(0, 40, len(wrench))[:, None] * down
        vars(state)["wrench"] = wrench
        assert effect.missing(state) == ""
        acted = effect.true_wrench(state, None, np.array([0.03, -0.04]))
        np.testing.assert_allclose(acted[:, :3], wrench[:, :3], atol=0)
        np.testing.assert_allclose(acted[:, 3:] @ down, 0, atol=1e-9)
        size, moment = (np.linalg.norm(part, axis=1) for part in (wrench[:, :3], acted[:, 3:]))
        np.testing.assert_allclose(moment, 0.05 * size, atol=1e-9)


def test_they_are_looked_for_where_weights_hang_only() -> None:
    for design, hook, swing in (("hung12", "", ONLY_AS_SCATTER), ("ladder12", NOTHING_HANGS, NOTHING_HANGS)):
        cell, rows = read(simulate(2, design, noise="none"))
        state = LoadTest.of(cell, rows).load_state(1 / cell.prior.stiffness)
        assert effects()["hook_offset"].missing(state) == hook
        assert effects()["swinging_weight"].missing(state) == swing
    cell, rows = read(simulate(2, "ladder12", [Hidden("side_load")]))
    assert swing_of(posterior(LoadTest.of(cell, rows))) is None


# Long: named by the command in tests/runs/command_line/test_dead_weights.py.
@pytest.mark.long
def test_the_hook_is_named_with_where_it_hangs() -> None:
    case, found = diagnosed(3, Hidden("hook_offset", None, 1.5))
    assert [cause.label for cause in found.causes] == ["hook_offset"]
    stated, truth = found.as_dict()["causes"][0]["parameters"], case.truth[0]["parameters"]
    for name in ("x_m", "y_m"):
        assert abs(stated[name]["estimate"] - truth[name]) < 3 * stated[name]["std"]
        assert stated[name]["std"] < 0.005


def test_a_hook_in_the_tool_is_the_tool_point() -> None:
    _, found = diagnosed(3, Hidden("tool_point", None, 3.0))
    assert [cause.label for cause in found.causes] == ["tool_point"]


def test_a_swing_is_named_and_is_no_displacement() -> None:
    case, found = diagnosed(4, Hidden("swinging_weight", None, 2.0))
    content = found.as_dict()
    assert found.verdict == "named"
    assert not found.causes                                     # of what displaces the tool
    (cause,) = content["causes"]
    assert cause["effect"] == "swinging_weight"
    angle = cause["parameters"]["angle_rad"]
    # A plane swing caught at any moment, in any plane: 1 sigma across is half its amplitude.
    assert abs(angle["estimate"] - case.truth[0]["parameters"]["amplitude_rad"] / 2) < 3 * angle["std"]
    assert any(finding.code == "CS1511" for finding in found.findings)
    assert any("swung" in line for line in found.lines())
    assert found.extended().effects == ()
    error = np.log(found.extended().stiffness / case.stiffness)[1:] / found.extended().log_std[1:]
    assert np.abs(error).max() < 4
    json.dumps(content)


# Long: three more of the same draw.
@pytest.mark.parametrize("seed", [41, *(pytest.param(seed, marks=pytest.mark.long) for seed in (40, 42, 43))])
def test_nothing_is_named_where_nothing_is_hidden(seed: int) -> None:
    _, found = diagnosed(seed)
    assert found.verdict != "named"
    assert not found.judgement.scatters


@pytest.fixture(scope="module")
def play() -> Posterior:
    """Springs fitted to play of the tool, sideways, which is outside the dictionary."""
    return posterior(LoadTest.of(*read(simulate(7025, "hung12", [Hidden("tool_play", None, 2.0)]))))


def test_play_of_the_tool_shows_as_a_swing_that_leaves_much(play: Posterior) -> None:
    """It repeats from row to row, and what the swing's sigmas leave is not explained."""
    swing = swing_of(play)
    assert swing is not None
    left = posterior(swing.allowed_for(play.data, play))
    assert goodness_of_fit(left, effects(), np.random.default_rng(0), 99).p_value <= 0.02


@pytest.mark.parametrize("then", ["unknown", "mistake"])
def test_a_swing_that_leaves_much_is_none(play: Posterior, then: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The judgement without it stands."""
    judged: Any = SimpleNamespace(verdict="unknown", plain=play, extended=play, tried=None)
    monkeypatch.setattr(Procedure, "of_good_rows", lambda procedure: SimpleNamespace(verdict=then))
    assert Procedure(play.data, effects(), 0.05, 99, 0).allowing_for_scatter(judged) is judged


# Long: the two above are its steps; here all causes are searched for twice.
@pytest.mark.long
def test_play_of_the_tool_is_no_swing() -> None:
    """Outside the dictionary, and sideways; it repeats from row to row, and what the swing's sigmas leave is not explained."""
    _, found = diagnosed(7025, Hidden("tool_play", None, 2.0))
    assert found.verdict != "named"
    assert found.judgement.swing is None


def test_one_gross_reading_is_no_swing() -> None:
    """Sideways, under the largest load, in one row alone."""
    cell, rows = read(simulate(44, "hung12"))
    fitted = posterior(LoadTest.of(cell, rows))
    row = int(np.flatnonzero(rows.wrench[:, 2] < -390)[3])
    across = compliance_matrix(cell.robot, rows.theta[row][None], cell.flange_from_tcp, fitted.compliance)[0, :3, 0]
    assert swing_of(fitted) is None
    rows.deflection[row] += 40.0 * across
    assert swing_of(posterior(LoadTest.of(cell, rows))) is None


@pytest.mark.parametrize("fall", [[0.0, 0.0, -1.0], [0.6, 0.0, -0.8]])
def test_what_separates_is_hung_where_weights_were(fall: list[float], monkeypatch: pytest.MonkeyPatch) -> None:
    """The weights of the rows by rising mass and back, straight down in the base as it stands, by as many sigmas as said; where
    a single load was no weight, along the base's axes."""
    monkeypatch.setattr(discrimination, "fall_in_base", lambda world: 9.80665 * np.array(fall))
    cell, rows = read(simulate(2, "hung12", noise="none"))
    mass = np.round(np.linalg.norm(rows.wrench[:, :3], axis=1) / 9.80665)
    wrench = np.zeros_like(rows.wrench)
    wrench[:, :3] = 9.80665 * np.outer(mass, fall)
    data = LoadTest.of(cell, replace(rows, wrench=wrench, hung=mass > 0))
    state, rivals = data.load_state(1 / cell.prior.stiffness), {}
    for name in ("hook_offset", "tool_point"):
        effect = effects()[name]
        found = Term(effect, None, effect.typical(state, None), effect.typical(state, None), effect.neutral(state))
        rivals[name] = posterior(data, (found,)), 0.5
    chosen = next_loads(rivals, np.random.default_rng(0))
    assert len({tuple(load.theta) for load in chosen}) == 3
    for load in chosen:
        assert load.axis is None
        np.testing.assert_allclose(load.forces / 9.80665, [0, 20, 40, 20, 0], atol=0.01)
        trial = planned_rows(load.theta[None], np.outer(load.forces, fall)[None], (10.0, 60.0))
        assert separation(trial, rivals).best_pair(0) == (load.separates, pytest.approx(load.distance))
    first = int(np.argmax(mass > 0))
    pulled = data.with_rows(replace(data.rows, hung=(mass > 0) & (np.arange(len(rows)) != first)))
    assert not len(hung_cycle(pulled.rows, np.array(fall)))
    assert next_loads({name: (replace(model, data=pulled), p) for name, (model, p) in rivals.items()},
                      np.random.default_rng(0))[0].axis in (0, 1, 2)


@pytest.mark.parametrize(("masses", "cycle"), [
    ([30, 10, 20, 10], [0, 10, 20, 30, 20, 10, 0]), ([5], [0, 5, 0]), ([-8, -4], [0, -4, -8, -4, 0]), ([], []),
    ([1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11], [0, 1, 3, 5, 7, 9, 11, 9, 7, 5, 3, 1, 0])])
def test_weights_are_hung_on_and_taken_off_as_they_were_measured(masses: list[float], cycle: list[float]) -> None:
    """By rising mass; six at most of many, the least and the largest among them; a weight that is taken off pulls up."""
    wrench = np.zeros((len(masses) + 1, 6))
    wrench[1:, 2] = -9.80665 * np.array(masses)
    rows: Any = SimpleNamespace(wrench=wrench, hung=np.ones(len(wrench), dtype=bool))
    np.testing.assert_allclose(hung_cycle(rows, np.array([0.0, 0.0, -1.0])) / 9.80665, cycle, atol=0.01)
    rows.hung = None
    assert not len(hung_cycle(rows, np.array([0.0, 0.0, -1.0])))


@pytest.mark.parametrize(("kept", "tells"), [("three rows", 1), ("two rows", 0), ("no load", 0)])
def test_a_visit_that_cannot_tell_leaves_all_others_in(kept: str, tells: int) -> None:
    """Of the first visit some readings are left, or the unloaded ones alone. An offset and what goes with the load take two
    rows of it, or what there is without a load."""
    cell, rows = read(simulate(44, "hung12"))
    data, compliance = LoadTest.of(cell, rows), 1 / cell.prior.stiffness
    wrench = rows.wrench.copy()
    wrench[np.flatnonzero(rows.visit == 0)[-2:]] = 0.0
    data = data.with_rows(replace(rows, wrench=wrench))
    state, residual = data.load_state(compliance), np.random.default_rng(1).normal(0, 1e-6, (len(rows), 3))
    mine, loaded = np.flatnonzero(rows.visit == 0), wrench.any(axis=1)
    assert (~loaded[mine]).sum() >= 3

    def told(residual: np.ndarray) -> list[np.ndarray]:
        fitted: Any = SimpleNamespace(data=data, load_state=state, residual=residual, compliance=compliance)
        return [values for group in _groups(fitted) for values in group.values]

    every = told(residual)
    residual[mine[loaded[mine]] if kept == "no load" else mine[{"two": 2, "three": 3}[kept.split()[0]]:]] = np.nan
    some = told(residual)
    assert len(every) == int(rows.visit.max()) + 1
    np.testing.assert_array_equal(some[tells:], every[1:])
    assert [len(values) for values in some[:tells]] == [3] * tells


def test_the_likelihood_of_a_visit_is_that_of_the_whole_covariance() -> None:
    """Against restricted maximum likelihood with dense matrices: offset and what goes with the load are free."""
    rng = np.random.default_rng(5)
    load, down = np.array([0.0, 196.0, 392.0, 196.0, 0.0]), np.array([0.0, 0.0, -1.0])
    sigma, root = np.array([2e-6, 3e-6, 1e-6]), rng.normal(size=(3, 3)) * 1e-4
    carried = root @ root.T
    parts = np.array([1.3, 0.8, 0.006, 0.02]) ** 2
    every, along = carried @ carried, np.outer(carried @ down, carried @ down)
    covariance = (np.kron(np.eye(5), parts[0] * np.diag(sigma**2)) + np.kron(np.diag(load != 0), parts[1] * every)
                  + np.kron(np.diag(load**2), parts[2] * along + parts[3] * (every - along)))
    free = np.kron(np.column_stack([np.ones(5), load / 392]), np.eye(3))
    differences = []
    for _ in range(3):
        residual = rng.normal(size=(5, 3)) * 1e-5
        inverse = np.linalg.inv(covariance)
        projected = inverse - inverse @ free @ np.linalg.solve(free.T @ inverse @ free, free.T @ inverse)
        dense = -0.5 * (np.linalg.slogdet(covariance)[1] + np.linalg.slogdet(free.T @ inverse @ free)[1]
                        + residual.ravel() @ projected @ residual.ravel())
        values, own = _visit(residual, sigma, carried, load, down)
        differences.append(dense - _Visits(values[None], own[None]).log_likelihood(parts)[0])
    np.testing.assert_allclose(differences, differences[0], rtol=1e-9)      # a constant, whatever the residual


def test_what_no_deflection_tells_is_said_of_the_loads_there_are() -> None:
    """Weights have no force sensor: it is they that are to be weighed."""
    for design, loads, check in (("hung12", "weights", "weigh what hangs"), ("poses20", "force sensor", "dead weight")):
        _, found = diagnosed(7, design=design)
        assert found.verdict == "adequate"
        said, = [finding for finding in found.findings if finding.code == "CS1406"]
        assert loads in said.message
        assert check in said.hint

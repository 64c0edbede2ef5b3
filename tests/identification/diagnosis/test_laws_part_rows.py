"""The search for causes on numbers of a part: rows made up here along a path whose load turns round, laws written here, noise
with a smooth error in it."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from identification.diagnosis.detect import REPLICATES, Detection
from identification.diagnosis.part_rows import (
    PartRows,
    _apart,
    adequate,
    alarm,
    best_of,
    effects_of_parts,
    enough,
    judged,
    of_nothing,
)
from identification.diagnosis.projection import Base
from identification.diagnosis.search import Hypothesis, Survey
from identification.fit.fitted_model import Term
from identification.model.effects import effects
from identification.model.load_state import LoadState, load_state
from identification.model.robot import built_in_robots, read_robot
from identification.model.rotations import Frame

SIGMA, PLACES = 3e-6, 60
STIFFNESS = np.array([1.5e6, 4e6, 3e6, 6e5, 4e5, 2e5])


def state_of_a_path() -> LoadState:
    """A tool that goes round a pocket, the load turning with it, as four walls make it, in air at first."""
    way = np.linspace(0, 1, PLACES)
    theta = np.radians([5.0, 20.0, 15.0, 10.0, 40.0, 5.0]) + 0.05 * np.column_stack(
        [np.sin(2 * np.pi * way + k) for k in range(6)])
    wall = np.minimum((4 * way).astype(int), 3)
    size = 90 + 30 * np.sin(9 * way)
    wrench = np.zeros((PLACES, 6))
    wrench[:, 0] = size * np.array([1.0, 0.3, -1.0, -0.3])[wall]
    wrench[:, 1] = size * np.array([0.3, -1.0, -0.3, 1.0])[wall]
    wrench[:, 2] = 30 * np.cos(5 * way)
    wrench[:3] = 0
    tool = Frame(np.eye(3), np.array([0.1, 0.0, 0.25]))
    return load_state(read_robot(built_in_robots()["irb6660-205-1.90"]), tool, theta, wrench, 1 / STIFFNESS)


def rows_of(state: LoadState, moved: np.ndarray, rng: np.random.Generator, smooth_m: float = 40e-6) -> PartRows:
    """All three components at every place; moved (N, 3) [m] beyond the springs; a smooth error along the path of that size,
    drawn from its own process, and known to be possible."""
    way = np.linspace(0, 1, PLACES)
    process = smooth_m**2 * np.exp(-0.5 * ((way[:, None] - way) / 0.3) ** 2)
    covariance = np.kron(process, np.eye(3)) + SIGMA**2 * np.eye(3 * PLACES)
    factor = np.linalg.cholesky(covariance)
    springs = np.einsum("nrj,nj,j->nrj", state.jacobian[:, :3], state.torque, 1 / STIFFNESS).reshape(3 * PLACES, 6)
    share = 0.02 * rng.standard_normal(6)
    residual = moved.ravel() + springs @ share + factor @ rng.standard_normal(3 * PLACES)
    return PartRows(state, lambda columns: columns.reshape(3 * PLACES, -1), factor, residual, 0.02 * springs)


def play(state: LoadState, joint: int, half_gap: float) -> np.ndarray:
    """A gear that rests on the side to which it is pressed: its whole gap, one way or the other."""
    pressed = np.sign(state.torque[:, joint - 1]) * (np.abs(state.torque[:, joint - 1]) > 0)
    return np.asarray(state.jacobian[:, :3, joint - 1] * (half_gap * pressed)[:, None])


def said(rows: PartRows, seed: int = 0) -> tuple[str, list[str], float]:
    rng = np.random.default_rng(seed)
    dictionary = rows.dictionary(effects_of_parts())
    first, seen = alarm(rows, dictionary, rng), best_of(rows, dictionary)
    found = judged(rows, seen, first, enough(rows, seen, seen.hypotheses[0], rng))
    return found.verdict, [cause.label for cause in found.causes], first.p_value


def test_play_of_a_gear_is_named() -> None:
    state = state_of_a_path()
    verdict, names, p_value = said(rows_of(state, play(state, 1, 4.6e-5), np.random.default_rng(1)))
    assert (verdict, p_value) == ("named", 1 / (REPLICATES + 1))
    assert names == ["backlash[1]"]


@pytest.mark.parametrize(("before", "after", "verdict"), [
    (0.005, 0.5, "named"), (0.03, 0.5, "unknown"), (0.2, 0.5, "adequate"), (0.005, 0.004, "unknown")])
def test_a_name_needs_a_clear_detection_and_a_model_that_is_enough(before: float, after: float, verdict: str) -> None:
    """However likely the cause is."""
    state = state_of_a_path()
    rows = rows_of(state, play(state, 1, 4.6e-5), np.random.default_rng(1))
    seen = best_of(rows, rows.dictionary(effects_of_parts()))
    first, then = (Detection(p_value, 1 / (REPLICATES + 1), {}, 1.0) for p_value in (before, after))
    found = judged(rows, seen, first, then)
    assert (found.verdict, bool(found.terms)) == (verdict, verdict == "named")


def test_replicates_are_drawn_from_the_stated_noise() -> None:
    """As metres, by the factor that makes them white: normal, each direction with the variance that the stated covariance has
    there, none with another's, no replicate with the next; its covariance is worked out here."""
    rows, count = rows_of(state_of_a_path(), np.zeros((PLACES, 3)), np.random.default_rng(1)), 6000
    way = np.linspace(0, 1, PLACES)
    stated = np.kron(40e-6**2 * np.exp(-0.5 * ((way[:, None] - way) / 0.3) ** 2), np.eye(3)) + SIGMA**2 * np.eye(3 * PLACES)
    variance, directions = np.linalg.eigh(stated)
    white = rows.draw(np.random.default_rng(2), count)
    assert white.shape == (rows.readings, 1, count)
    drawn = directions.T @ rows.factor @ white[:, 0] / np.sqrt(variance)[:, None]
    found = drawn @ drawn.T / count
    spread = 5 / np.sqrt(count)     # five standard errors: of 16 290 numbers one in a hundred sets has one beyond
    assert np.abs(np.diag(found) - 1).max() < np.sqrt(2) * spread
    assert np.abs(found - np.diag(np.diag(found))).max() < spread
    assert np.abs(np.mean(drawn**4, axis=1) / 3 - 1).max() < np.sqrt(96) / 3 * spread
    after = drawn[:, 1:] @ drawn[:, :-1].T / count
    assert np.abs(after).max() < 1.1 * spread
    assert np.allclose(rows.whitened(rows.factor @ white[:, 0, :3])[:, 0], white[:, 0, :3])


def test_a_smooth_error_alone_is_no_cause() -> None:
    """Of ten drawn errors of 40 um one in twenty alarms; at most three do (99.9 %), and none is named."""
    state = state_of_a_path()
    answers = [said(rows_of(state, np.zeros((PLACES, 3)), np.random.default_rng([7, k])), k) for k in range(10)]
    assert sum(p_value <= 0.05 for _, _, p_value in answers) <= 3
    assert "named" not in [verdict for verdict, _, _ in answers]


def test_a_smooth_error_that_is_not_allowed_for_alarms() -> None:
    """So the test above can fail: the same numbers, their noise said to be white."""
    state = state_of_a_path()
    rows = rows_of(state, np.zeros((PLACES, 3)), np.random.default_rng([7, 0]))
    blind = replace(rows, factor=SIGMA * np.eye(3 * PLACES))
    assert adequate(alarm(rows, rows.dictionary(effects_of_parts()), np.random.default_rng(0)))
    assert not adequate(alarm(blind, blind.dictionary(effects_of_parts()), np.random.default_rng(0)))


def test_two_structures_that_move_alike_are_not_told_apart() -> None:
    """A force that is turned or a base that slides, along with nothing else that differs: several names, or none."""
    state = state_of_a_path()
    moved = np.zeros((PLACES, 3))
    moved[:, :2] = 4e-8 * state.wrench[:, :2]
    verdict, names, _ = said(rows_of(state, moved, np.random.default_rng(3)))
    assert verdict != "named" or names == ["base_shift"]


@pytest.mark.parametrize("name", ["deflection_sensor_gain", "stand_compliance", "creep", "force_gain", "side_load",
                                  "joint_friction", "transmission_error"])
def test_what_a_part_cannot_show_is_not_asked(name: str) -> None:
    assert name in effects()
    assert name not in effects_of_parts()


@pytest.mark.parametrize(("off", "nothing"), [(1.9, True), (2.1, False)])
def test_what_is_within_two_sigma_of_nothing_is_nothing(off: float, nothing: bool) -> None:
    effect = effects()["soft_zone"]
    term = Term(effect, 2, np.array([1e-5, 50.0]), np.array([4e-5, 100.0]), np.zeros(2))
    found = of_nothing((term,), np.array([off * 1e-6, 50.0]), np.diag([1e-12, 1.0]))
    assert (found == ("soft_zone[2]",)) == nothing


def test_what_a_visit_may_do_by_itself_is_noise_that_goes_together() -> None:
    """By the whole covariance, inverted: white noise and, for each visit in which a cause moves the tool, as much as it moves
    it there. Freed for two causes, of both."""
    state = state_of_a_path()
    rows = rows_of(state, np.zeros((PLACES, 3)), np.random.default_rng(1))
    rng = np.random.default_rng(3)
    moves = [1e-6 * rng.normal(0, 20, (len(state.theta), 3, 1)) for _ in range(2)]
    moves[1][:, 1:] = 0.0           # along x alone
    columns = rng.normal(size=(rows.readings, 1, 4))
    covariance, freed = np.eye(rows.readings), rows
    for moved in moves:
        freed = freed.freed(moved)
        for number in np.unique(state.visit):
            one = rows.whitened(moved * (state.visit == number)[:, None, None])[:, 0, 0]
            covariance += np.outer(one, one)
    np.testing.assert_allclose(freed.apply(columns)[:, 0], np.linalg.solve(covariance, columns[:, 0]), rtol=1e-8, atol=1e-10)


def test_of_the_laws_that_are_left_open_it_counts_by_how_much_what_they_leave_differs() -> None:
    """The farthest from the first, root mean square; of one law nothing. Each is what least squares leave, by hand."""
    rng = np.random.default_rng(8)
    columns, left = {k: rng.standard_normal((10, 1, 1)) for k in range(3)}, []
    residual, spring = rng.standard_normal((10, 1)), rng.standard_normal((10, 1, 1))
    weights: Any = SimpleNamespace(apply=lambda columns: columns)
    base = Base(spring, residual, weights, np.array([[4.0]]), np.zeros(1))
    dictionary: Any = SimpleNamespace(of=lambda s: columns[s])
    nothing: Any = None
    laws = tuple(Hypothesis((k,), (k,), 0.0) for k in range(3))
    for k in range(3):
        design = np.column_stack([spring[:, 0], columns[k][:, 0]])
        step = np.linalg.lstsq(np.vstack([design, np.diag([2.0, 1 / 1.5])]), np.append(residual, [0, 0]))[0]
        left.append(residual[:, 0] - design @ step)
    differ = [float(np.sqrt(np.mean((one - left[0]) ** 2))) for one in left[1:]]
    assert differ[0] != differ[1]
    seen = Survey(nothing, dictionary, base, laws)
    assert _apart(seen, laws) == pytest.approx(max(differ))
    assert _apart(seen, (laws[0], laws[2], laws[1])) == pytest.approx(max(differ))
    assert _apart(seen, laws[:2]) == pytest.approx(differ[0])
    assert _apart(seen, laws[:1]) == 0.0

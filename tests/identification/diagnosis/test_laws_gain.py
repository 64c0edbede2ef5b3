"""What a name gains on rows that were not fitted, written out in full."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from identification.diagnosis.gain import AT_ONCE, RESAMPLES, Gain, _ratios, gain
from identification.fit.fitted_model import Term
from identification.fit.held_out import left_out_with_density, poses
from identification.fit.load_test import LoadTest
from identification.fit.noise import noise_model
from identification.fit.posterior import Posterior, posterior
from identification.measurements import Measurements
from identification.model.effects import effects
from tests.identification.fit.test_laws_posterior import simulate

POSES = 6


@pytest.fixture(scope="module")
def models(tmp_path_factory: pytest.TempPathFactory) -> tuple[LoadTest, Posterior, Posterior]:
    """Forces that are all 20 N off along base x, fitted without that and with it; a component of a row was not read. The
    first two rows of each of six poses are fitted, the last two held out."""
    cell, rows = simulate(tmp_path_factory.mktemp("gain"), np.random.default_rng(7), poses=POSES, loads=4)
    data = LoadTest.of(cell, rows)
    effect = effects()["force_offset"]
    state = data.load_state(1 / cell.prior.stiffness)
    typical, neutral = effect.typical(state, None), effect.neutral(state)
    moved = effect.contribution(state, None, neutral + typical * np.array([20.0, 0, 0]) / typical)[:, :3]
    deflection = rows.deflection + moved
    deflection[5, 1] = np.nan
    whole = LoadTest.of(cell, replace(rows, deflection=deflection, validate=np.arange(len(rows)) % 4 > 1))
    fitted = whole.with_rows(whole.rows.select(~whole.rows.validate))
    plain = posterior(fitted)
    return whole, plain, posterior(fitted, [Term(effect, None, neutral + typical, typical, neutral)], plain)


def check(found: Gain, before: np.ndarray, after: np.ndarray, rows: Measurements) -> None:
    """Residuals (n, 3) of the rows held out; each pose counts as many readings as it has, and is drawn anew as a whole."""
    visits = {f"line {rows.line[rows.visit == number][0]}": rows.visit == number for number in range(POSES)}
    assert set(found.poses) == set(visits)
    squares = [[np.nansum(residual[visits[name]] ** 2) for name in found.poses] for residual in (before, after)]
    count = [int((~np.isnan(before[visits[name]])).sum()) for name in found.poses]
    assert (found.before, found.after) == pytest.approx([np.sqrt(sum(each) / sum(count)) for each in squares])
    np.testing.assert_allclose(found.by_pose, np.sqrt(np.array(squares) / count))
    assert found.ratio == pytest.approx(found.before / found.after)
    # All ways in which as many poses can be drawn: of them 2.5 % are below the interval and as many above it.
    ratios = [np.sqrt(sum(squares[0][k] for k in drawn) / sum(squares[1][k] for k in drawn))
              for drawn in product(range(POSES), repeat=POSES)]
    assert np.mean(np.array(ratios) < found.interval[0]) == pytest.approx(0.025, abs=0.015)
    assert np.mean(np.array(ratios) > found.interval[1]) == pytest.approx(0.025, abs=0.015)
    assert found.as_dict() == {
        "rms_before_um": 1e6 * found.before, "rms_after_um": 1e6 * found.after, "ratio": found.ratio,
        "interval": list(found.interval), "held_out": found.held_out}


def test_on_validate_rows_it_is_that_of_what_was_fitted(models: tuple[LoadTest, Posterior, Posterior]) -> None:
    """How much likelier they are is by the noise of the model with the name, for both, with no tails."""
    whole, plain, extended = models
    found = gain(whole, plain, extended, np.random.default_rng(0))
    held = whole.with_rows(whole.rows.select(whole.rows.validate))
    before, after = plain.residual_of(held), extended.residual_of(held)
    check(found, before, after, held.rows)
    assert found.held_out == "validate"
    assert found.before > 1.5 * found.after
    noise = noise_model(held, extended.compliance)
    size = 3 * len(held.rows)
    inverse = noise.weights(extended.components).apply(np.eye(size).reshape(-1, 3, size)).reshape(size, size)
    squared = [(noise.whitening @ np.nan_to_num(each)[:, :, None]).ravel() for each in (before, after)]
    assert found.support == pytest.approx(0.5 * (squared[0] @ inverse @ squared[0] - squared[1] @ inverse @ squared[1]))
    assert found.support > 0


def test_without_such_rows_each_pose_is_predicted_from_the_others(models: tuple[LoadTest, Posterior, Posterior]) -> None:
    _, plain, extended = models
    found = gain(plain.data, plain, extended, np.random.default_rng(0))
    groups = poses(plain.data.rows)
    (before, without), (after, with_it) = (left_out_with_density(model, groups) for model in (plain, extended))
    check(found, before, after, plain.data.rows)
    assert found.held_out == "cross-validation by pose"
    assert found.support == pytest.approx(with_it - without)


def test_nothing_left_is_no_division_by_nothing() -> None:
    assert Gain(3e-6, 0.0, (1.0, 2.0), "validate", 1.0, np.zeros((2, 1)), ("P",)).ratio == pytest.approx(3e6)


def test_many_poses_are_drawn_in_parts_as_at_once() -> None:
    """A ratio of alike poses is that of each, however often they are drawn and in how many parts."""
    for count in (3, AT_ONCE // RESAMPLES - 1, AT_ONCE // RESAMPLES + 1):
        ratios = _ratios(np.array([[9.0] * count, [4.0] * count]), np.random.default_rng(0))
        np.testing.assert_allclose(ratios, np.full(RESAMPLES, 1.5))

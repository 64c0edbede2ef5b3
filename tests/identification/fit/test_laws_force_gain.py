"""A load cell whose scale is off: what is delivered knows it, as refits with other forces tell."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from numpy.testing import assert_allclose

from compstiff.cli.identify import identify
from identification.diagnosis.left_open import RobotPart, left_open
from identification.fit.fitted_model import Term
from identification.fit.force_gain import by_force_gain, delivered
from identification.fit.load_test import LoadTest
from identification.fit.posterior import Posterior, posterior
from identification.measurements import read_measurements
from identification.model.cell import read_cell
from identification.model.effects import effects
from tests.virtual_cell.cell import Hidden, simulate

GAIN = 0.03


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> LoadTest:
    cell_file, table = simulate(3, "poses20", (Hidden("base_rocking"),)).write(tmp_path_factory.mktemp("gain"))
    text = cell_file.read_text().replace("measurement:\n", f"measurement:\n  force_gain_std: {GAIN}\n")
    assert "force_gain_std" in text
    cell_file.write_text(text)
    cell = read_cell(cell_file)
    return LoadTest.of(cell, read_measurements(table, cell.robot))


def as_larger(data: LoadTest, share: float) -> LoadTest:
    """The same readings under forces that were larger by so much, ln."""
    return data.with_rows(replace(data.rows, wrench=np.exp(share) * data.rows.wrench))


def terms(data: LoadTest) -> list[Term]:
    state = data.load_state(1 / data.cell.prior.stiffness)
    effect = effects()["base_rocking"]
    return [Term(effect, None, effect.neutral(state), effect.typical(state, None), effect.neutral(state))]


@pytest.fixture(scope="module")
def fitted(data: LoadTest) -> Posterior:
    return posterior(data, terms(data))


def test_all_compliances_are_off_together(data: LoadTest) -> None:
    """Springs that the readings tell well: larger forces with the same readings are smaller compliances by as much."""
    moved = by_force_gain(posterior(data))
    well = np.sqrt(np.diag(posterior(data).covariance)) < 0.05
    assert well.sum() >= 3
    assert_allclose(moved[well], -GAIN, rtol=0.05)


def test_it_is_what_a_fit_to_other_forces_comes_to(data: LoadTest, fitted: Posterior) -> None:
    """With an effect beside the springs, that is a compliance too, and joints that the prior holds in part."""
    more, less = (posterior(as_larger(data, sign * 0.01), fitted.terms, fitted) for sign in (1, -1))
    moved = (more.map - less.map) / 0.02 * GAIN
    std = np.sqrt(np.diag(fitted.covariance))
    assert np.all(np.abs(by_force_gain(fitted) - moved) < 0.02 * np.abs(moved) + 0.02 * std)
    assert moved[6] / fitted.map[6] == pytest.approx(-GAIN, rel=0.1)


def test_what_is_delivered_is_wider_along_that_and_no_other_way(fitted: Posterior) -> None:
    draws, moved = delivered(fitted), by_force_gain(fitted)
    std = np.sqrt(np.diag(fitted.covariance))
    expected = fitted.covariance + np.outer(moved, moved)
    most = np.max((moved / std) ** 2)
    assert_allclose(draws.covariance / np.outer(std, std), expected / np.outer(std, std), atol=0.05 * most)
    assert_allclose(draws.mean, fitted.mean, atol=0.03 * np.abs(moved).max())
    covariance, interval = left_open(RobotPart.of(fitted), ())
    assert_allclose(covariance, draws.covariance)
    assert np.all(np.diff(interval)[:6] > np.diff(fitted.draws.interval(0.95))[:6])


def test_the_scale_is_drawn_once_either_way(fitted: Posterior) -> None:
    """Along what a larger scale does and no other way, by normal draws, each with its opposite: no mean moves."""
    moved, draws = by_force_gain(fitted), fitted.draws
    shift = (delivered(fitted).x - draws.x)[:, :6]
    drawn = shift @ moved[:6] / (moved[:6] @ moved[:6])
    assert_allclose(shift, np.outer(drawn, moved[:6]), atol=1e-9)
    half = len(drawn) // 2
    assert_allclose(drawn[:half], -drawn[half: 2 * half], atol=1e-9)
    assert_allclose(drawn[2 * half:], 0, atol=1e-12)
    assert np.mean(drawn**2) == pytest.approx(1, abs=5 * np.sqrt(2 / half))
    assert np.mean(drawn[:half] ** 4) == pytest.approx(3, abs=5 * np.sqrt(96 / half))
    assert abs(drawn[:half].mean()) < 5 / np.sqrt(half)


def test_what_the_same_load_cell_loads_is_predicted_without_it(data: LoadTest, fitted: Posterior) -> None:
    """Nor is a fit another one for it: no row tells the scale."""
    exact = replace(data.cell, noise=replace(data.cell.noise, force_gain=0.0))
    same = posterior(replace(data, cell=exact), fitted.terms)
    assert_allclose(same.map, fitted.map)
    assert_allclose(same.covariance, fitted.covariance)
    assert delivered(same) is same.draws


# Long: how far the gain widens what is fitted is held above.
@pytest.mark.long
def test_the_file_of_identify_has_it(data: LoadTest, tmp_path: Path) -> None:
    """By the commands, as it is read from cell.yaml: the standard deviations, in shares, grow by the square sum."""
    cell_file, table = data.cell.source, data.rows.source
    found = {}
    for name in ("stated", "exact"):
        cell = cell_file.parent / f"{name}.yaml"
        text = cell_file.read_text()
        cell.write_text(text if name == "stated" else text.replace(f"force_gain_std: {GAIN}", "force_gain_std: 0"))
        out = tmp_path / f"{name}.json"
        done = CliRunner().invoke(identify, [str(cell), str(table), "-o", str(out), "-q"])
        assert out.exists(), done.output
        found[name] = json.loads(out.read_text())
    stated, exact = (np.array([one["std"] / one["estimate"] for one in found[name]["parameters"]]) for name in found)
    assert_allclose(np.sqrt(stated**2 - exact**2)[exact < 0.05], GAIN, rtol=0.15)
    assert found["stated"]["fit"]["noise"]["force_gain_std"] == GAIN

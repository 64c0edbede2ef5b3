"""Parts of the rows that want other springs: which are compared, how far they are apart by a fit of both, and what is said."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.stats import chi2

from identification.fit.fit import Fit, fit_stiffness
from identification.fit.sag import sag_columns
from identification.fit.subsets import partitions
from identification.model.compliance import equilibrium
from tests.identification.fit.test_laws_posterior import TRUE, simulate


@pytest.fixture(scope="module")
def fit(tmp_path_factory: pytest.TempPathFactory) -> Fit:
    """Joint 3 is 40 % softer under positive loads."""
    cell, rows = simulate(tmp_path_factory.mktemp("subsets"), np.random.default_rng(3), poses=8, loads=5)
    here, there = (equilibrium(cell.robot, rows.theta, cell.flange_from_tcp, rows.wrench, 1 / k).position
                   for k in (TRUE, TRUE * [1, 1, 0.6, 1, 1, 1]))
    positive = rows.wrench[:, :3].sum(axis=1) > 0
    return fit_stiffness(cell, replace(rows, deflection=rows.deflection + np.where(positive[:, None], there - here, 0.0)))


def test_a_part_is_as_far_off_as_a_fit_of_its_own_springs_beside_the_others_says(fit: Fit) -> None:
    """Both together, and what the arm's weight may do: by one system with all covariances written out. A direction of the
    difference is compared that is known to a factor e or better."""
    model = fit.posterior
    at, rows = model.at_map, model.data.rows
    size = 3 * len(rows)
    inverse = model.weights.apply(np.eye(size).reshape(-1, 3, size)).reshape(size, size)
    sag = sag_columns(model.load_state, at.noise).reshape(size, -1)
    springs, residual = at.design.reshape(size, 6), at.residual.ravel()
    common = np.hstack([springs, sag])
    prior = block_diag(model.prior.precision(model.map), np.eye(sag.shape[1]))
    gradient = np.append(model.prior.gradient(model.map), np.zeros(sag.shape[1]))
    q, eigenvalues_seen = common.shape[1], []
    masks = {part: mask for part, _, mask in partitions(rows)}
    for found in fit.conflicts:
        mask = masks[found.part]
        assert found.rows == (mask.sum(), (~mask).sum())        # every row is loaded
        own = springs * np.repeat(mask, 3)[:, None]
        every = np.hstack([common, own])
        information = every.T @ inverse @ every
        information[:q, :q] += prior
        eigenvalues, vectors = np.linalg.eigh(
            information[q:, q:] - information[q:, :q] @ np.linalg.solve(information[:q, :q], information[:q, q:]))
        eigenvalues_seen += eigenvalues.tolist()
        kept = vectors[:, eigenvalues > 1.0]
        assert found.directions == kept.shape[1]
        chosen = block_diag(np.eye(q), kept)
        pull = chosen.T @ every.T @ inverse @ residual
        pull[:q] -= gradient
        reduced = chosen.T @ information @ chosen
        alone = np.linalg.solve(information[:q, :q], pull[:q])
        both = np.linalg.solve(reduced, pull)
        assert found.distance == pytest.approx(np.sqrt(pull @ both - pull[:q] @ alone), rel=2e-3, abs=2e-3)
        np.testing.assert_allclose(found.difference, -kept @ both[q:], atol=2e-3 * max(1.0, np.abs(both[q:]).max()))
        chance = chi2.sf(found.distance**2, found.directions)
        # What is rarer than one in a hundred is held against what is known of the noise, and is less rare.
        assert (found.p_value == pytest.approx(chance, rel=1e-2, abs=0)) == (chance >= 0.01)
        assert found.p_value >= chance * (1 - 1e-9)
        assert found.corrected == pytest.approx(min(1.0, len(fit.conflicts) * found.p_value))
        assert found.is_conflict == (found.corrected < 0.05)
        assert found.as_dict()["p_corrected"] == found.corrected
    assert any(1.0 < one < 2.0 for one in eigenvalues_seen)
    assert any(0.5 < one < 1.0 for one in eigenvalues_seen)
    assert [one.p_value for one in fit.conflicts] == sorted(one.p_value for one in fit.conflicts)


def test_a_conflict_is_told_with_the_joint_that_differs_most(fit: Fit) -> None:
    first = fit.conflicts[0]
    assert (first.part, first.rest) == ("positive loads", "negative loads")
    said = [one for one in fit.findings if one.code == "CS1016"]
    assert len(said) == sum(one.corrected < 0.05 for one in fit.conflicts)
    assert (said[0].level, said[0].file) == ("warning", fit.measurements.source)
    told = re.fullmatch(r"positive loads and negative loads want different stiffnesses: Mahalanobis distance (\S+) over (\d) "
                        r"directions \(p = (\S+)\), most in k3: by positive loads (\S+) times as stiff as by negative "
                        r"loads", said[0].message)
    assert told
    assert float(told[1]) == pytest.approx(first.distance, abs=0.051)
    assert int(told[2]) == first.directions
    assert float(told[3]) == pytest.approx(first.corrected, rel=0.06)
    # Softer by 40 % than under the others.
    assert float(told[4]) == pytest.approx(0.6, abs=0.06)


def test_parts_are_compared_by_axis_sign_history_half_size_and_pose() -> None:
    """Nine rows at three poses, by hand; what has no load is in no part that is told by loads."""
    force = np.zeros((9, 6))
    force[:, :3] = [(0, 0, 0), (100, 0, 0), (200, 0, 0), (0, -300, 0), (0, -50, 0), (0, -60, 70), (0, 0, 0), (5, 5, 400),
                    (0, 30, 80)]
    rows: Any = SimpleNamespace(wrench=force, visit=np.repeat([0, 1, 2], 3), line=np.arange(2, 11))
    told = {part: np.flatnonzero(mask).tolist() for part, _, mask in partitions(rows)}
    assert told == {
        "loads along base x": [1, 2], "loads along base y": [3, 4], "loads along base z": [7, 8],
        "positive loads": [1, 2, 5, 7, 8],
        "loads while loading": [1, 2, 3, 5, 7],                 # a pose begins without a load
        "the first half of the visits": [0, 1, 2, 3, 4, 5],
        "the larger loads": [2, 3, 7],                          # over 92 and 100: the middle of seven is 100
        "the pose from line 2": [0, 1, 2], "the pose from line 5": [3, 4, 5], "the pose from line 8": [6, 7, 8]}
    assert {rest for _, rest, _ in partitions(rows)} == {
        "the other loads", "negative loads", "loads while unloading", "the second half", "the smaller loads", "the other poses"}
    aslant = force.copy()
    aslant[1, 1], aslant[2, 1] = 47.0, 98.0         # 0.905 and 0.898 of the load
    along = {part: np.flatnonzero(mask).tolist() for part, _, mask in partitions(SimpleNamespace(
        wrench=aslant, visit=rows.visit, line=rows.line))}
    assert along["loads along base x"] == [1]

"""What all points are off by along their normals, how large set-up and drift are thought to be, columns along other axes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from compensator.correction.settings import Estimate
from compensator.learned.learned import DRIFT, SETUP
from compensator.learning.cutter_size import common_amount, said_of_cutter
from compensator.learning.rows import Rows
from compensator.learning.sizes import Sizes
from compensator.learning.wrong_axes import refuse_wrong_axes
from identification.common.findings import Refused
from tests.compensator.learning.test_laws_learning import terms

SIGMA_UM = 4.0


@pytest.mark.parametrize("cutter_um", [0.0, 10.0, 200.0])
@pytest.mark.parametrize("springs", [1, 6])
def test_the_common_amount_is_that_of_the_normal_equations(cutter_um: float, springs: int) -> None:
    """A column of ones of 0.2 mm beforehand beside springs, set-up and drift, whatever the terms had assumed of it; its sigma
    is that of the same equations, next to nothing of the 0.2 mm or much of it."""
    rng = np.random.default_rng(8)
    given = terms(rng, springs=springs)
    given = replace(given, residual=given.residual + 35e-6, cutter=1e-6 * cutter_um,
                    rows=replace(given.rows, direction=rng.normal(size=given.rows.direction.shape)))
    given = replace(given, of_job=given.rows.along(given.frame.columns(given.rows.position, given.rows.time)))
    for noise in (Sizes(1.5, 3e-6, 0.0), Sizes(300.0, 3e-6, 0.0)):
        found = common_amount(given, noise)
        along = given.rows.length[given.rows.place]
        alike = np.exp(-np.abs(along[:, None] - along) / 8e-3) * (given.rows.direction @ given.rows.direction.T)
        covariance = (3e-6) ** 2 * alike + np.diag(np.full(len(along), (noise.noise * 1e-6 * SIGMA_UM) ** 2))
        columns = np.column_stack([given.by_x, given.of_job, np.ones(len(along))])
        prior = np.concatenate([np.full(springs, 0.02), [1e-3] * 3, [2e-3 * 0.05] * 3, [0.2e-3] * 3, [0.2e-3]])
        information = columns.T @ np.linalg.solve(covariance, columns) + np.diag(prior**-2.0)
        mean = np.linalg.solve(information, columns.T @ np.linalg.solve(covariance, given.residual))
        assert found.value == pytest.approx(mean[-1], rel=1e-6)
        assert found.std == pytest.approx(np.sqrt(np.linalg.inv(information)[-1, -1]), rel=1e-4)
    assert found.std > 20e-6


@pytest.mark.parametrize(("value", "words"), [(42.4e-6, "the points stand 42 +- 6.2 um (2 sigma) out of the planned surface"),
                                              (-17.6e-6, "the points stand 18 +- 6.2 um (2 sigma) within the planned surface")])
def test_on_which_side_a_common_amount_is_is_told(value: float, words: str) -> None:
    (found,) = said_of_cutter(Estimate(value, 3.1e-6), "points.csv")
    assert (found.code, found.level, found.file) == ("CS5334", "warning", "points.csv")
    assert words in found.message
    assert said_of_cutter(None, "points.csv") == []


def test_set_up_and_drift_are_thought_to_be_as_large_as_the_manual_says() -> None:
    """docs/formats.md: 1 mm, 2 mrad at the points' radius, 0.2 mm; what is not in the model has none."""
    given = terms(np.random.default_rng(1))
    given = replace(given, frame=replace(given.frame, radius=0.2))
    prior = given.physical_prior
    np.testing.assert_allclose(np.sqrt(np.diag(prior))[6:], 1e-3 * np.repeat([1.0, 0.4, 0.2], 3), rtol=1e-12)
    assert np.count_nonzero(prior) == len(prior) == 6 + SETUP + DRIFT
    job = np.diag([1.0, 0, 0, 0, 0, 0, 1, 1, 1])
    np.testing.assert_allclose(np.sqrt(np.diag(replace(given, job=job).physical_prior))[6:],
                               1e-3 * np.array([1, 0, 0, 0, 0, 0, 0.2, 0.2, 0.2]), rtol=1e-12)


def rows_along(axes: np.ndarray, more: int = 0) -> Rows:
    """Rows along three axes (3, 3) at each of 40 places, and of `more` further ones along the first alone."""
    given = terms(np.random.default_rng(2), places=40 + more)
    kept = (given.rows.place < 40) | (np.arange(len(given.rows)) % 3 == 0)
    rows = given.rows.select(kept)
    return replace(rows, direction=np.tile(axes, (len(rows), 1))[:len(rows)], sigma=np.full(len(rows), 1e-6))


AXES = Rotation.from_euler("zyx", [40, -25, 110], degrees=True).as_matrix()


@pytest.mark.parametrize(("change", "name"), [
    (np.eye(3), ""), (AXES.T, "the base frame"), (np.diag([1.0, -1.0, 1.0]), "y with the other sign"),
    (np.eye(3)[[0, 2, 1]], "y and z exchanged"), (Rotation.from_euler("z", 50, degrees=True).as_matrix(), "turned")])
@pytest.mark.parametrize("more", [0, 7])
def test_points_along_other_axes_teach_nothing_and_are_told_which(change: np.ndarray, name: str, more: int) -> None:
    """Of the places with a number along each of three axes that stand square; what is left by these and as they stand."""
    rng = np.random.default_rng(3)
    rows = rows_along(AXES, more)
    told = rng.normal(0, 80e-6, (40, 3))
    noise = rng.normal(0, 2e-6, (40, 3))
    beyond = rng.normal(0, 1.0, more)           # single numbers of further places are none's business
    measured = np.concatenate([(told @ change.T + noise).ravel(), beyond])
    given = np.concatenate([told.ravel(), rng.normal(0, 1.0, more)])
    if not name:
        refuse_wrong_axes(rows, measured, given, "points.csv")
        return
    with pytest.raises(Refused) as stopped:
        refuse_wrong_axes(rows, measured, given, "points.csv")
    (found,) = stopped.value.findings
    assert (found.code, found.file) == ("CS5330", "points.csv")
    assert name in found.message
    left, as_is = (float(words.split()[0]) for words in found.message.split("would leave ")[1].split("in place of "))
    assert 1 < left < 5
    assert as_is > 30


def test_rows_that_stand_askew_are_not_asked_for_their_axes() -> None:
    """Means of turning directions are along no axes: from a volume of 0.9 on."""
    rng = np.random.default_rng(3)
    told = rng.normal(0, 80e-6, (40, 3))
    for volume, asked in ((0.91, True), (0.89, False)):
        askew = AXES * np.array([1.0, 1.0, volume])[:, None]
        rows = rows_along(askew)
        measured = (told * [1, -1, 1]).ravel()
        if asked:
            with pytest.raises(Refused, match="y with the other sign"):
                refuse_wrong_axes(rows, measured, told.ravel(), "points.csv")
        else:
            refuse_wrong_axes(rows, measured, told.ravel(), "points.csv")

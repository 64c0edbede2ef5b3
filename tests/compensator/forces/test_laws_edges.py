"""A target in whose stretch a cut begins or ends: how far the force at it is from the mean over the stretch."""

from __future__ import annotations

import numpy as np
import pytest

from compensator.forces.edges import at_edges
from compensator.forces.target_rows import TargetRows

FORCE = np.array([120.0, -60.0, 30.0])


def stretches(share: float, ripple: float = 0.0) -> tuple[TargetRows, np.ndarray, np.ndarray]:
    """Eight targets of 40 samples each: air up to `share` of the third one's stretch before its end, then the force, which
    goes up and down by `ripple` of itself from sample to sample. Rows, force (m, 3) and means (N, 3)."""
    target = np.repeat(np.arange(8), 40)
    cut = np.arange(len(target)) >= 120 - round(40 * share)
    force = np.where(cut[:, None], FORCE * (1 + ripple * (-1.0) ** np.arange(len(target)))[:, None], 0.0)
    return TargetRows(8, target, np.ones(len(target))), force, force.reshape(8, 40, 3).mean(axis=1)


@pytest.mark.parametrize("share", [0.1, 0.25, 0.5, 0.9])
def test_the_force_of_an_edge_is_as_unsure_as_two_values_are(share: float) -> None:
    """F over the share w of a stretch, nothing over the rest: F sqrt(w (1 - w)), at that target; under half of its neighbour's
    it is the neighbour that has the edge, whose samples are alike. Inside the cut, and in the air, nothing."""
    rows, force, mean = stretches(share)
    found = at_edges(rows, force, mean, np.linalg.norm(mean, axis=1) > 0)
    expected = np.zeros((8, 3))
    expected[2] = np.abs(FORCE) * np.sqrt(share * (1 - share))
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-5)


def test_what_the_force_does_inside_the_cut_is_no_edge() -> None:
    """A ripple of a fifth has its share of the scatter at the edge as inside the cut: what is beyond that is the edge's."""
    rows, force, mean = stretches(0.5, 0.2)
    found = at_edges(rows, force, mean, np.linalg.norm(mean, axis=1) > 0)
    # Half of the stretch ripples: its variance is F^2/4 + (0.2 F)^2/2, inside the cut (0.2 F)^2.
    np.testing.assert_allclose(found[2], np.abs(FORCE) * np.sqrt(0.25 + 0.02 - 0.04), rtol=1e-9)
    np.testing.assert_allclose(np.delete(found, 2, axis=0), 0.0, atol=1e-5)


def test_the_scatter_inside_a_cut_is_that_of_targets_with_force_and_several_rows() -> None:
    """Of two such, where more are in the air, and more have one row."""
    target = np.concatenate([np.repeat(np.arange(9), 40), [9, 10, 11, 12]])
    cut = np.arange(len(target)) >= 6 * 40 + 20
    force = np.where(cut[:, None], FORCE * (1 + 0.2 * (-1.0) ** np.arange(len(target)))[:, None], 0.0)
    rows = TargetRows(13, target, np.ones(len(target)))
    mean = rows.mean(force)
    found = at_edges(rows, force, mean, np.linalg.norm(mean, axis=1) > 0)
    np.testing.assert_allclose(found[6], np.abs(FORCE) * np.sqrt(0.25 + 0.02 - 0.04), rtol=1e-9)


@pytest.mark.parametrize("air", [1, 40])
def test_a_neighbour_in_the_air_has_an_edge_beside_it_however_few_samples_show_it(air: int) -> None:
    """The first target, and a second one whose cut begins half way and is all there is of it; behind it is no sample."""
    target = np.concatenate([np.zeros(air, dtype=int), np.ones(40, dtype=int)])
    force = np.where(np.arange(air + 40)[:, None] >= air + 20, FORCE, 0.0)
    rows = TargetRows(3, target, np.ones(air + 40))
    mean = rows.mean(force)
    found = at_edges(rows, force, mean, np.linalg.norm(mean, axis=1) > 0)
    np.testing.assert_allclose(found, [[0, 0, 0], np.abs(FORCE) / 2, [0, 0, 0]], rtol=1e-9)
    # Where nothing was logged beside it either, nobody knows.
    alone = TargetRows(3, np.ones(40, dtype=int), np.ones(40))
    mean = alone.mean(force[air:])
    np.testing.assert_array_equal(at_edges(alone, force[air:], mean, np.linalg.norm(mean, axis=1) > 0), 0.0)


@pytest.mark.parametrize(("weaker", "edge"), [(0.45, True), (0.55, False)])
def test_an_edge_is_where_a_neighbour_has_under_half_of_the_force(weaker: float, edge: bool) -> None:
    """A step between two targets of many samples, of which the stronger has a sample of the other side; a target without
    samples is no neighbour without force, and one of a single row tells nothing of the scatter inside a cut."""
    target = np.concatenate([np.repeat([0, 1, 2, 3], 20), [5]])
    force = np.where(np.arange(81)[:, None] < 41, weaker, 1.0) * FORCE
    force[80] = FORCE
    rows = TargetRows(6, target, np.ones(81))
    mean = rows.mean(force)
    found = at_edges(rows, force, mean, np.linalg.norm(mean, axis=1) > 0)
    expected = np.zeros((6, 3))
    if edge:
        expected[2] = np.abs(FORCE) * (1 - weaker) * np.sqrt(0.05 * 0.95)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-5)

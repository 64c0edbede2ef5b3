"""The engine of a ball that leans against closed forms, and against itself turned round."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.virtual_cell.leaning_ball import LeaningBall, mean_force, tilted

BLOCK = ((-60.0, -60.0, -60.0), (60.0, 60.0, 0.0))


def test_half_a_ball_in_a_slot_has_the_closed_form() -> None:
    """Sunk by its radius, chips alone: the integrals over a quarter of a turn of the edge and half a turn of the tool."""
    chip, radius, teeth = 0.05, 8.0, 3
    ktc, krc, kac = 767.0, 169.0, 222.0
    ball = LeaningBall((0.0, 0.0, 1.0), shear_n_mm2=(ktc, krc, kac), edge_n_mm=(0.0, 0.0, 0.0))
    force = mean_force(ball, np.zeros(3), np.array([chip, 0.0, 0.0]), BLOCK)
    # Over kappa the means of sin^2, sin cos are pi / 4, 1 / 2; over phi of cos^2, cos pi / 2, 2; times z R f / 2 pi.
    scale = teeth * radius * chip / (2 * np.pi)
    expected = scale * np.array([-0.5 * np.pi * (krc * np.pi / 4 + kac / 2), 0.5 * np.pi * ktc,
                                 2 * (krc / 2 - kac * np.pi / 4)])
    assert force == pytest.approx(expected, abs=0.01 * np.linalg.norm(expected))


def test_it_turns_with_axis_and_feed() -> None:
    turn = Rotation.from_euler("z", 40, degrees=True)
    axis = np.array(tilted(10.0, -15.0))
    feed = np.array([0.1, 0.0, 0.0])
    one = mean_force(LeaningBall(tuple(axis)), np.array([0.0, 0.0, 7.0]), feed, BLOCK)
    x, y, z = turn.apply(axis)
    other = mean_force(LeaningBall((x, y, z)), np.array([0.0, 0.0, 7.0]), turn.apply(feed), BLOCK)
    assert other == pytest.approx(turn.apply(one), abs=0.01 * np.linalg.norm(one))


def test_what_a_ball_went_over_is_no_more() -> None:
    """On its own way nothing is left; beside it by a millimetre less than alone."""
    ball, middle, feed = LeaningBall(tilted(5.0, 5.0)), np.array([0.0, 0.0, 7.0]), np.array([0.1, 0.0, 0.0])
    way = np.array([[-50.0, 0.0, 7.0], [50.0, 0.0, 7.0]])
    assert not mean_force(ball, middle, feed, BLOCK, [way]).any()
    aside = middle + np.array([0.0, 1.0, 0.0])
    beside, alone = (np.linalg.norm(mean_force(ball, aside, feed, BLOCK, ways)) for ways in ([way], []))
    assert 0.02 * alone < beside < 0.6 * alone


def test_straight_down_it_has_the_closed_form() -> None:
    """All of a ball that sinks along its axis cuts, chips alone: round about they cancel but along the axis."""
    chip, radius, teeth = 0.05, 8.0, 3
    krc = 169.0
    ball = LeaningBall((0.0, 0.0, 1.0), shear_n_mm2=(0.0, krc, 0.0), edge_n_mm=(0.0, 0.0, 0.0))
    force = mean_force(ball, np.array([0.0, 0.0, -0.2]), np.array([0.0, 0.0, -chip]), BLOCK)
    # h = f cos(kappa), and over kappa the mean of cos^2; up, along -n.
    expected = teeth * radius * chip * krc * np.pi / 4
    assert force == pytest.approx([0.0, 0.0, expected], abs=0.01 * abs(expected))


def test_above_a_way_the_shank_went() -> None:
    """A wall over a way at a depth is gone as high as it stands; the ball alone would have left it."""
    ball, feed = LeaningBall((0.0, 0.0, 1.0)), np.array([0.1, 0.0, 0.0])
    deep = np.array([[-50.0, 0.0, -20.0], [50.0, 0.0, -20.0]])
    high, beside = np.array([[0.0, 0.0, 2.0], [0.0, 9.0, 2.0]])
    assert not mean_force(ball, high, feed, BLOCK, [deep]).any()
    assert np.linalg.norm(mean_force(ball, beside, feed, BLOCK, [deep])) > 50

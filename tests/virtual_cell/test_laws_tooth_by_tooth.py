"""The engine tooth by tooth against the textbook's closed forms, and against itself turned round."""

from __future__ import annotations

import numpy as np
import pytest

from tests.virtual_cell.tooth_by_tooth import ToothedMill, Ways, box, mean_forces

MILL = ToothedMill()
BLOCK = box((-60, -60, -20), (60, 60, 0))


def test_a_full_slot_has_the_textbooks_mean_forces() -> None:
    """N a / 4 of the chip's, N a / pi of the edge's; trochoids differ from circles by a part of the feed over the radius."""
    depth, chip = 2.0, 0.08
    ways = Ways(np.array([[-80.0, 0.0], [80.0, 0.0]]), np.array([-depth]))
    (ktc, krc, kac), (kte, kre, kae) = MILL.shear_n_mm2, MILL.edge_n_mm
    expected = MILL.teeth * depth * np.array([-krc * chip / 4 - kre / np.pi, ktc * chip / 4 + kte / np.pi,
                                              -kac * chip / np.pi - kae / 2])
    assert mean_forces(MILL, ways, BLOCK, np.array([80.0]), chip)[0] == pytest.approx(expected, rel=0.02)


def test_it_turns_with_the_path() -> None:
    """The same cut along y has the same force, turned."""
    along_x, along_y = (mean_forces(MILL, Ways(np.array(corners), np.array([-3.0])), BLOCK, np.array([80.0]), 0.1)[0]
                        for corners in ([[-80.0, 65.0], [80.0, 65.0]], [[-65.0, -80.0], [-65.0, 80.0]]))
    assert along_y == pytest.approx([-along_x[1], along_x[0], along_x[2]], rel=0.01)


def test_what_was_gone_over_is_no_more() -> None:
    """Back over its own slot the cutter meets nothing; half a diameter aside it meets half."""
    there_and_back = Ways(np.array([[-80.0, 0.0], [80.0, 0.0], [-80.0, 0.0]]), np.array([-2.0, -2.0]))
    assert not mean_forces(MILL, there_and_back, BLOCK, np.array([240.0]), 0.1).any()
    aside = Ways(np.array([[-80.0, 0.0], [80.0, 0.0], [80.0, 8.0], [-80.0, 8.0]]), np.array([-2.0] * 3))
    shoulder = Ways(np.array([[80.0, 60.0], [-80.0, 60.0]]), np.array([-2.0]))
    # Stock on the right of the way, from the axis on.
    again, alone = (mean_forces(MILL, ways, BLOCK, np.array([place]), 0.1)[0] for ways, place in (
        (aside, 160.0 + 8.0 + 80.0), (Ways(shoulder.corner_mm[::-1], shoulder.tip_mm), 80.0)))
    assert again == pytest.approx([-alone[0], -alone[1], alone[2]], rel=0.02)

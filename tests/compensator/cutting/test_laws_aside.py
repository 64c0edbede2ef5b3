"""One going through tells what the forces are with the tool aside: by a sum over the edge, and by milling anew."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from compensator.cutting.removal import mill_through
from compensator.cutting.stock_file import read_stock
from tests.compensator.cutting.milled import FLAT, MILL, TRUE, block, track_along
from tests.compensator.cutting.solids import binary, prism, stock_of, summed_force
from tests.support import long

LOW, HIGH, STEP = (-60.0, -40.0, -20.0), (60.0, 40.0, 0.0), 0.1


def forces(weights: np.ndarray) -> np.ndarray:
    return np.asarray(weights @ (TRUE * np.array([1e-4] * 3 + [1.0] * 3)))


def box_moved(aside: np.ndarray):
    """The block as a tool that is `aside` (3,) [mm] sees it."""
    return lambda points: np.asarray(((points > LOW - aside) & (points < HIGH - aside)).all(axis=-1))


@pytest.mark.parametrize("y", [46.0, 33.0, -47.0])
def test_the_change_is_that_of_a_sum_over_the_edge(y: float) -> None:
    """Entry, plateau and exit of a shoulder and of a slot, the tool moved by 0.1 mm along x, y and up: to 4 % of the largest
    change on the plateau, and to 3 % of the force at entry and exit, which change within a step."""
    track = track_along(np.array([[-80.0, y, -4.0], [80.0, y, -4.0]]))
    engaged, _ = mill_through(block(LOW, HIGH, (-4.0,)), track, FLAT, 1e-3 * STEP)
    assert engaged.moved is not None
    some = np.arange(20, len(track), 29)
    middle = 0.5e3 * (track.start + track.end)[some]
    change = []
    for aside in (np.zeros(3), *(STEP * np.eye(3))):
        inside = box_moved(aside)
        change.append([summed_force(inside, place, 0.0, 8.0, MILL.teeth, 0.0 - aside[2], 0.1, MILL.shear_n_mm2, MILL.edge_n_mm,
                                    0.02, 0.1)
                       for place in middle])
    truth = np.array(change)[1:] - np.array(change)[0]
    own = forces(engaged.moved)[:, some] - forces(engaged.weights)[some]
    plateau = np.linalg.norm(forces(engaged.weights), axis=1).max()
    for axis in range(3):
        most = np.abs(truth[axis]).max()
        off = np.abs(own[axis] - truth[axis]).max(axis=1)
        assert off[np.abs(middle[:, 0]) < 48].max() < 0.04 * most + 0.005, "xyz"[axis]
        assert off.max() < 0.03 * plateau, "xyz"[axis]
    assert np.abs(truth[2]).max() > 1


def test_a_pass_under_another_does_not_feel_where_the_top_stands() -> None:
    """Both passes of a tool that is raised stand higher by the same."""
    legs = [[-80.0, 30.0, -2.0], [80.0, 30.0, -2.0], [80.0, 30.0, 10.0], [-80.0, 30.0, 10.0], [-80.0, 30.0, -5.0],
            [80.0, 30.0, -5.0]]
    track = track_along(np.array(legs))
    engaged, _ = mill_through(block(LOW, HIGH, (-2.0, -5.0)), track, FLAT, 1e-3 * STEP)
    assert engaged.moved is not None
    tip = 1e3 * track.start[:, 2]
    change = forces(engaged.moved[2]) - forces(engaged.weights)
    within = np.abs(track.start[:, 0]) < 0.05
    first, second = within & (tip == -2) & engaged.cuts, within & (tip == -5) & engaged.cuts
    assert change[first] == pytest.approx(-0.05 * forces(engaged.weights)[first], rel=1e-6)
    assert np.abs(change[second]).max() < 1e-9


# Long: the change is held against a sum over the edge above, blanks that lean in test_laws_solid.py.
@pytest.mark.long
@pytest.mark.parametrize("shift", [long((0.0, 6.0)), (5.0, -8.0)], ids=["one way", "another"])
def test_a_leaning_blank_moved_is_milled_anew(tmp_path: Path, shift: tuple[float, float]) -> None:
    """Along every axis, to 2 % of the largest change; its layers are 0.1 mm thick."""
    outline = np.array([[0.0, -10.0], [60.0, -10.0], [60.0, 40.0], [0.0, 40.0]])
    faces, tips = prism(outline, -20.0, 0.0, shift), np.array([-4e-3])
    file = stock_of(tmp_path, binary(faces))
    track = track_along(np.array([[-15.0, 42.0, -4.0], [50.0, 44.0, -4.0], [75.0, 20.0, -4.0]]))
    engaged, _ = mill_through(read_stock(file).stock(tips, 0.0), track, FLAT, 1e-3 * STEP)
    assert engaged.moved is not None
    for axis in range(3):
        (tmp_path / "blank.stl").write_bytes(binary(faces - STEP * np.eye(3)[axis]))
        anew = forces(mill_through(read_stock(file).stock(tips, 0.0), track, FLAT)[0].weights) - forces(engaged.weights)
        own = forces(engaged.moved[axis]) - forces(engaged.weights)
        assert np.abs(anew).max() > 1
        assert np.median(np.abs(own - anew)) < 0.002 * np.abs(anew).max()
        assert np.quantile(np.abs(own - anew), 0.98) < 0.05 * np.abs(anew).max(), "xyz"[axis]


def test_without_a_step_nothing_is_worked_out() -> None:
    track = track_along(np.array([[-80.0, 46.0, -4.0], [80.0, 46.0, -4.0]]))
    plain, _ = mill_through(block(LOW, HIGH, (-4.0,)), track, FLAT)
    assert plain.moved is None
    again, _ = mill_through(replace(block(LOW, HIGH, (-4.0,))), track, FLAT, 1e-3 * STEP)
    assert np.array_equal(again.weights, plain.weights)

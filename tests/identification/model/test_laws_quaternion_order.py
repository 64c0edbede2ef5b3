"""A quaternion in the order x y z w is asked about where it shows, and no frame as cells have them is."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from compensator.path.robot_path import RobotPath
from compstiff.quaternion_orders import _other, _reached
from identification.model.quaternion_order import as_written, in_words, other_order, said_of_order
from identification.model.rotations import quaternion_to_matrix


def asked(turn: Rotation) -> bool:
    return bool(said_of_order("workobject.quaternion", turn.as_matrix(), "cell.yaml"))


def written_last(turn: Rotation) -> Rotation:
    """What a reader of w x y z makes of x y z w (SciPy's own order)."""
    x, y, z, w = turn.as_quat(canonical=True)
    return Rotation.from_quat([y, z, w, x])


def test_frames_as_they_are_surveyed_tilted_or_hung_are_not_asked_about() -> None:
    rng = np.random.default_rng(31)
    frames = [*Rotation.random(3000, rng=rng),
              *Rotation.from_euler("zyx", np.column_stack([rng.uniform(-180, 180, 3000), rng.normal(0, 0.1, (3000, 2))]),
                                   degrees=True),
              *(Rotation.from_euler(axis, angle, degrees=True) for axis in "xyz" for angle in range(0, 360, 5)
                if (axis, angle) != ("z", 180)),
              *(Rotation.from_euler("zx", [yaw, 180], degrees=True) for yaw in (0, 30, 45, 200))]
    assert [one.as_quat() for one in frames if asked(one)] == []


def test_a_frame_turned_about_z_alone_is_asked_about_with_w_last() -> None:
    told = [asked(written_last(Rotation.from_euler("z", angle, degrees=True))) for angle in range(0, 360, 5)]
    assert told.count(False) == 1, "180 deg reads as 0 1 0 0 ... a half turn about x or y is an upside down frame"
    assert told.index(False) == 36


def test_what_is_said() -> None:
    turned = written_last(Rotation.from_euler("z", 30, degrees=True)).as_matrix()
    (finding,) = said_of_order("workobject.quaternion", turned, "cell.yaml")
    assert (finding.code, finding.level) == ("CS0117", "note")
    assert "180 deg about (0, 0.26, 0.97)" in finding.message
    assert "read as x y z w it would be 30 deg about z" in finding.message
    (nothing,) = said_of_order("tool.quaternion", quaternion_to_matrix([0, 0, 0, 1]), "cell.yaml")
    assert "[0, 0, 0, 1] is 180 deg about z; read as x y z w it would be no turn" in nothing.message


@pytest.mark.parametrize(("turn", "words"), [
    ([1, 0, 0, 0], ""), ([0, 1, 0, 0], "180 deg about x"), ([0.8, 0, 0.6, 0], "73.74 deg about y"),
    ([0.8, 0, 0, -0.6], "73.74 deg about -z"), ([0.5, 0.5, 0.5, 0.5], "120 deg about (0.58, 0.58, 0.58)"),
])
def test_turns_in_words(turn: list[float], words: str) -> None:
    assert in_words(quaternion_to_matrix(turn)) == words
    assert in_words(quaternion_to_matrix(np.negative(turn))) == words


def test_the_other_order_is_the_other_order() -> None:
    for turn in Rotation.random(50, rng=np.random.default_rng(3)):
        np.testing.assert_allclose(other_order(written_last(turn).as_matrix()), turn.as_matrix(), atol=1e-12)
        x, y, z, w = turn.as_quat(canonical=True)
        written = as_written(turn.as_matrix()).strip("[]").split(",")
        np.testing.assert_allclose(np.array(written, float), [w, x, y, z], atol=1e-6)


def test_a_program_s_own_frames_are_turned_as_the_cell_s() -> None:
    """SciPy's own order is x y z w."""
    for turn in Rotation.random(20, rng=np.random.default_rng(5)):
        assert_allclose(quaternion_to_matrix(_other(turn.as_quat())), turn.as_matrix(), atol=1e-12)
    for nothing in (np.array([1.0, 0, 0, 0]), None):
        assert _other(nothing) is nothing


@pytest.mark.parametrize(("known", "reached", "all_of_them"), [
    ("yyn", "yyn", True), ("yyn", "ynn", False), ("nnn", "nnn", False), ("nyy", "nyy", True), ("yyy", "nnn", False)])
def test_a_program_is_reached_where_every_known_target_is(known: str, reached: str, all_of_them: bool) -> None:
    path = SimpleNamespace(known=np.array(list(known)) == "y", reached=np.array(list(reached)) == "y")
    assert _reached(cast(RobotPath, path)) == all_of_them

"""A frame that all poses share is as many equal frames, and is held once, also where some are picked or inverted."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from identification.model.rotations import Frame

TURN, PLACE = Rotation.from_rotvec([0.3, -1.1, 0.7]), np.array([0.2, -0.4, 1.3])
SHARED = Frame.shared(Frame(TURN.as_matrix(), PLACE), 5)


@pytest.mark.parametrize(("rows", "count"), [
    (np.array([4, 0, 0]), 3), (np.array([True, False, True, True, False]), 3), (slice(1, 5), 4),
    (np.array([], dtype=np.intp), 0)])
def test_some_of_them_are_so_many(rows: slice | np.ndarray, count: int) -> None:
    some = SHARED[rows]
    assert some.rotation.shape == (count, 3, 3)
    assert_allclose(some.rotation, np.repeat(TURN.as_matrix()[None], count, axis=0))
    assert_allclose(some.position, np.repeat(PLACE[None], count, axis=0))
    assert some.rotation.strides[0] == some.position.strides[0] == 0 or not count


def test_its_inverse_brings_every_point_back() -> None:
    points = np.random.default_rng(3).normal(size=(5, 3))
    moved = TURN.apply(points) + PLACE
    assert_allclose(SHARED.apply(points), moved)
    assert_allclose(SHARED.inverse().apply(moved), points, atol=1e-15)
    assert SHARED.inverse().rotation.strides[0] == 0


def test_frames_that_are_no_longer_one_are_not_taken_for_one() -> None:
    """Frames of their own, of which one is changed: the change is there in what is picked and inverted."""
    own = Frame(SHARED.rotation.copy(), SHARED.position.copy())
    own.position[2] += 1.0
    assert_allclose(own[np.array([2, 1])].position, [PLACE + 1.0, PLACE])
    assert_allclose(own.inverse().apply(own.position), np.zeros((5, 3)), atol=1e-15)
    mixed = Frame(SHARED.rotation, own.position)           # one rotation, several places
    assert_allclose(mixed[np.array([2, 1])].position, [PLACE + 1.0, PLACE])
    assert_allclose(mixed.inverse().apply(own.position), np.zeros((5, 3)), atol=1e-15)

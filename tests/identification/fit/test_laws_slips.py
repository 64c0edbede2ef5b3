"""Slips that are tried at a visit: each of them, made on purpose, is among those that undo it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np

from identification.fit.slips import Slip, slips_of
from identification.measurements import Measurements

ANGLES = np.radians([[10.0, 20.0, 30.0, 40.0, 50.0, 60.0], [11.0, 22.0, 33.0, 44.0, 55.0, 66.0],
                     [12.0, 24.0, 36.0, 48.0, 60.0, 72.0]])
FORCE = np.array([[100.0, 20.0, -30.0], [200.0, 40.0, -60.0], [300.0, 60.0, -90.0]])


def slips(theta: np.ndarray) -> list[Slip]:
    """Three visits of three rows, the first of them tried."""
    visit = np.repeat(np.arange(3), 3)
    rows = SimpleNamespace(
        theta=theta, wrench=np.hstack([np.tile(FORCE, (3, 1)), np.zeros((9, 3))]), deflection=np.zeros((9, 3)), visit=visit,
        pose=np.array([f"P{number}" for number in visit], dtype=object), line=np.arange(2, 11), row=np.arange(1, 10))
    return list(slips_of(cast(Measurements, rows), visit == 0, frozenset(), np.zeros((3, 3))))


def test_a_load_with_the_wrong_sign_is_turned_and_nothing_else() -> None:
    tried = [slip.force for slip in slips(np.repeat(ANGLES, 3, axis=0)) if slip.kind == "sign of a load"]
    signs = [force / FORCE for force in tried if force is not None]
    meant = [-np.ones((3, 3)), *(np.where(np.arange(3) == axis, -1.0, 1.0) * np.ones((3, 3)) for axis in range(3)),
             *(np.where(np.arange(3) == row, -1.0, 1.0)[:, None] * np.ones((3, 3)) for row in range(3))]
    assert len(signs) == len(meant) == len(tried)
    assert all(any(np.allclose(one, other) for other in signs) for one in meant)


def test_what_is_of_the_pose_is_not_of_rows() -> None:
    """A visit is given another pose for the one, its rows other loads or readings for the other."""
    of_rows = {slip.kind for slip in slips(np.repeat(ANGLES, 3, axis=0)) if slip.in_rows}
    of_pose = {slip.kind for slip in slips(np.repeat(ANGLES, 3, axis=0)) if not slip.in_rows}
    assert of_rows == {"sign of a load", "size of the loads", "readings slipped", "readings exchanged"}
    assert "columns exchanged" in of_pose
    assert not of_rows & of_pose


def test_the_angles_of_another_visit_are_those_of_one_that_stood_still() -> None:
    """One that moved an axis between its rows has no pose that could have been written for another."""
    theta = np.repeat(ANGLES, 3, axis=0)
    theta[7, 4] += 1e-3
    from_others = [slip.theta for slip in slips(theta) if "the angles of" in slip.what]
    assert len(from_others) == 1
    np.testing.assert_array_equal(from_others[0], ANGLES[1])

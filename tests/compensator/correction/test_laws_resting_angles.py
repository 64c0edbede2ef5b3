"""The search for the angles at which the springs hold the robot, on a made-up arm whose tool stands where its angles say, under
an effect that moves it by so many times what its angles are off: the angles sought are known."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from compensator.correction import forward
from identification.model.rotations import Frame


@pytest.mark.parametrize("slopes", [
    [0.0, 0.003], [0.5], [-0.5, 0.9], [1.0], [1.6, 0.0, -0.5], [2.2], [2.97]], ids=str)
def test_targets_whose_effects_are_steep_are_found_and_hold_up_no_other(
    monkeypatch: pytest.MonkeyPatch, slopes: list[float],
) -> None:
    """A whole step brings a target 1 + slope times as far as it is off: beyond 2 it swings farther and farther, and at 2 for
    ever to and fro. Found within the rounds of a search that halves such steps, and in four where none is needed."""
    count = len(slopes)
    sought, start = np.full((count, 6), 0.2), np.zeros((count, 6))
    sought[:, 3:] = 0.0
    rounds = []

    def state(_, rest):
        rounds.append(rest)
        return SimpleNamespace(rest=rest, tool=np.broadcast_to(np.eye(3), (count, 3, 3)), tcp=rest[:, :3],
                               serial_jacobian=np.broadcast_to(np.eye(6), (count, 6, 6)))

    def added(rows):
        return np.array(slopes)[:, None] * (rows.rest - sought)

    model = SimpleNamespace(added=added, robot=SimpleNamespace(uncoupling=np.eye(6)))
    loaded = SimpleNamespace(model=model, targets=np.arange(count), theta=start,
                             goal=Frame(np.broadcast_to(np.eye(3), (count, 3, 3)), sought[:, :3]))
    monkeypatch.setattr(forward, "load_state_of", state)
    assert_allclose(forward.resting_angles(loaded), sought, atol=1e-10)
    if np.max(np.abs(slopes)) <= 0.01:
        assert len(rounds) <= 6
    assert len(rounds) < forward.MAX_ROUNDS

"""Effects that turn with the flange, and those that hold from a row on: against rotations and rows written down by hand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from identification.model.effects import Effect, effects
from identification.model.effects.encoder_zero import EncoderZero
from identification.model.effects.transmission_error import FEWEST_POSES, BetweenPoses
from identification.model.load_state import LoadState, load_state
from identification.model.rotations import Frame
from tests.support import random_poses, robot


def rows(count: int, references: np.ndarray | None = None) -> LoadState:
    """One load a pose; references (n,) of the unloaded reading, one for all where there are none."""
    rng, model = np.random.default_rng(5), robot()
    wrench = np.concatenate([rng.uniform(-300, 300, (count, 3)), np.zeros((count, 3))], axis=1)
    plain = load_state(model, Frame(np.eye(3), np.array([0.1, 0.0, 0.3])), random_poses(model, count, rng), wrench,
                       np.full(6, 4e-7))
    return replace(plain, visit=np.arange(count), reference=np.zeros(count, int) if references is None else references)


def on_flange(name: str) -> Effect:
    return next(law for law in effects()[name].other_laws if law.law == "flange")


@pytest.mark.parametrize(("name", "values", "own"), [
    ("force_axis_gain", [0.02, -0.05], lambda force: force * [1.02, 0.95, 1.03]),
    ("force_crosstalk", [0.01, 0.02, -0.03], lambda force: force @ [[1, 0.01, 0.02], [0.01, 1, -0.03], [0.02, -0.03, 1]]),
    ("force_offset", [1.0, -2.0, 3.0], lambda force: force + np.array([1.0, -2.0, 3.0])),
])
def test_a_sensor_on_the_flange_errs_in_its_own_axes(name: str, values: list[float],
                                                     own: Callable[[np.ndarray], np.ndarray]) -> None:
    """What really acted, seen from the flange, is the reported force with the error that the sensor's own axes have."""
    state, law = rows(6), on_flange(name)
    flange = Rotation.from_matrix(state.flange)
    real = law.true_wrench(state, None, np.array(values))
    assert real is not None
    expected = flange.apply(own(flange.inv().apply(state.wrench[:, :3])))
    np.testing.assert_allclose(real[:, :3], expected, atol=1e-9)
    still = effects()[name].true_wrench(state, None, np.array(values))
    assert still is not None
    np.testing.assert_allclose(still[:, :3], own(state.wrench[:, :3]), atol=1e-9)


def test_an_unloaded_row_has_no_offset() -> None:
    state = rows(4)
    unloaded = replace(state, wrench=state.wrench * np.array([1, 0, 1, 1])[:, None])
    for law in (effects()["force_offset"], on_flange("force_offset")):
        added = law.contribution(unloaded, None, np.array([5.0, 5.0, 5.0]))
        assert not added[1].any()
        assert np.all(np.any(added[[0, 2, 3]] != 0, axis=1))


def test_a_zero_stays_moved_until_the_reference_is_taken_anew() -> None:
    references = np.array([0, 0, 0, 0, 1, 1])
    state = rows(6, references)
    moved = EncoderZero(3).contribution(state, 2, np.array([1e-4]))
    assert [bool(row.any()) for row in moved] == [False, False, True, True, False, False]
    assert [shape.effect.where["row"] for shape in EncoderZero().signatures(state, 2)] == [1, 2, 3, 4, 5, 6]


def test_what_every_pose_has_a_reference_of_its_own_for_cannot_show() -> None:
    apart, shared = rows(12, np.arange(12)), rows(12)
    for name in ("encoder_zero", "transmission_error"):
        assert effects()[name].missing(apart)
        assert not effects()[name].missing(shared)
    assert effects()["transmission_error"].missing(rows(FEWEST_POSES - 1))


def test_a_wave_over_the_angle_turns_the_tool_about_the_joint() -> None:
    """Forward kinematics of the joint turned by the wave at its own angle."""
    state, sine, cosine, cycles = rows(9), 3e-5, -2e-5, 7.75
    for joint in (1, 4):
        angle = state.theta[:, joint - 1]
        wave = sine * np.sin(cycles * angle) + cosine * np.cos(cycles * angle)
        turned = replace(state, theta=state.theta + wave[:, None] * np.eye(6)[joint - 1])
        added = BetweenPoses().contribution(state, joint, np.array([sine, cosine, cycles]))
        np.testing.assert_allclose(added[:, :3], turned.tcp - state.tcp, atol=2e-8)

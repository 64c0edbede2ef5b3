"""What an arm's own weight may do to its deflections: by the independent arm's own equilibrium, its weight as a potential."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from numpy.typing import NDArray

from identification.fit.sag import sag_columns
from identification.model.cell import read_cell
from identification.model.load_state import load_state
from tests.identification.fit.test_laws_posterior import TRUE
from tests.support import CELL, random_poses, write_cell
from tests.virtual_cell.arm import IRB6660

Array = NDArray[np.float64]
STEP = 1e-5
TCP = np.array([0.12, 0.0, 0.25])
UP = np.array([0.0, 0.0, 1.0])


def slopes(of: Callable[[Array], Array], theta: Array) -> Array:
    """Of values (n, ...) by each of the six angles (n, ..., 6)."""
    each = [(of(theta + STEP * axis) - of(theta - STEP * axis)) / (2 * STEP) for axis in np.eye(6)]
    return np.stack(each, axis=-1)


def place(theta: Array) -> Array:
    return np.asarray(IRB6660.pose(theta, TCP)[0])


def directions(theta: Array) -> Array:
    """The flange's axes in the base (n, 3, 3), in columns."""
    return np.asarray(IRB6660.pose(theta, TCP)[1].as_matrix())


def stands(theta: Array, force: Array, torque: Callable[[Array], Array]) -> Array:
    """Where the tool stands (n, 3) under forces (n, 3) and further torques (n, 6) at the springs."""
    q = theta
    for _ in range(3):
        q = theta + (np.einsum("nij,ni->nj", slopes(place, q), force) + torque(q)) / TRUE
    return place(q)


def does(theta: Array, force: Array, torque: Callable[[Array], Array]) -> Array:
    """By how much further a load deflects the tool (n, 3) under such torques, to first order in these."""
    share = 1e-2

    def deflection(times: float) -> Array:
        under, bare = (stands(theta, load, lambda q: times * torque(q)) for load in (force, 0 * force))
        return under - bare

    return (deflection(share) - deflection(-share)) / (2 * share)


def only(joint: int, values: Array | float, count: int) -> Array:
    torque = np.zeros((count, 6))
    torque[:, joint] = values
    return torque


def test_each_weight_is_as_large_as_an_arm_of_six_hundred_kilograms_makes_it(tmp_path: Path) -> None:
    """4000 N m at joints 2 and 3, constant, or with the angle of joint 2, which its balancer holds; as much of the forearm, in
    both directions across axis 3; and 250 N m of what the flange carries, in all three. Directions may be turned."""
    cell = read_cell(write_cell(tmp_path, CELL))
    count = 6
    theta = random_poses(cell.robot, count, np.random.default_rng(7), share=0.5)
    force = np.random.default_rng(8).normal(0, 30, (count, 3))
    wrench = np.concatenate([force, np.zeros((count, 3))], axis=1)
    state = load_state(cell.robot, cell.flange_from_tcp, theta, wrench, 1 / TRUE)
    assert state.robot.link_mass is None
    columns = sag_columns(state, SimpleNamespace(whitened=lambda moved: moved))
    assert columns.shape == (count, 3, 11)

    def of_moment(size: float, axis: Callable[[Array], Array]) -> Callable[[Array], Array]:
        """Torques of a first moment along a direction (n, 3) that turns with the arm: down the slope of its height."""
        return lambda q: -size * slopes(lambda angles: axis(angles) @ UP, q)

    def alike(found: Array, told: list[Array]) -> None:
        mine, theirs = (each.reshape(3 * count, -1) for each in (found, np.stack(told, axis=2)))
        scale = np.abs(theirs @ theirs.T).max()
        np.testing.assert_allclose(mine @ mine.T / scale, theirs @ theirs.T / scale, atol=0.02)

    for k, joint in enumerate((1, 2)):
        alike(columns[:, :, [k]], [does(theta, force, lambda q, j=joint: only(j, 4000.0, count))])
    # A torque that goes with the sine of an angle changes by the cosine where that yields: both are free by themselves.
    alike(columns[:, :, [2]] + columns[:, :, [5]], [does(theta, force, lambda q: only(1, 4000 * np.sin(q[:, 1]), count))])
    alike(columns[:, :, [3]] - columns[:, :, [4]], [does(theta, force, lambda q: only(1, 4000 * np.cos(q[:, 1]), count))])
    move = slopes(place, theta)[:, :, 1] / TRUE[1]
    spring = move * np.sum(move * force, axis=1, keepdims=True)
    alike(columns[:, :, 4:6], [4000 * spring * wave(theta[:, 1])[:, None] for wave in (np.sin, np.cos)])
    alike(columns[:, :, 8:], [does(theta, force, of_moment(250.0, lambda q, a=axis: directions(q)[:, :, a]))
                              for axis in range(3)])
    # With the wrist held the flange's two directions across axis 3 are the forearm's.
    held = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    alike(columns[:, :, 6:8], [does(theta, force, of_moment(4000.0, lambda q, a=axis: directions(held * q)[:, :, a]))
                               for axis in (0, 2)])

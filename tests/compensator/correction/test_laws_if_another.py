"""What another stock, cutter or material would mean for the part, on targets made here, by differences of the kinematics."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from compensator.correction.if_another import IfAnother, if_another
from identification.model.kinematics import forward
from identification.model.rotations import Frame
from tests.support import robot

COMPLIANCE = 1e-6 * np.array([0.2, 0.3, 0.25, 1.0, 1.5, 2.0])
TOOL = Frame(np.eye(3), np.array([0.1, 0.0, 0.25]))
RNG = np.random.default_rng(12)
THETA = np.array([0.1, 0.2, -0.3, 0.2, 0.8, 0.1]) + 0.1 * np.arange(5)[:, None]
FOLLOWS, EDGES = 1e4 * RNG.standard_normal((5, 3, 3)), 30 * RNG.standard_normal((5, 3))
TOP = 1e4 * RNG.standard_normal((5, 3))
OBJECT = Rotation.from_rotvec([0.3, -0.2, 0.5]).as_matrix()
DEVIATION = 1e-4 * RNG.standard_normal((4, 3))
TARGETS = np.array([0, 2, 3, 4])
# Of a cutter of 16 mm: a shoulder, less than half a millimetre, a slot.
WIDTH = 1e-3 * np.array([3.0, 9, 0.4, 14.5, 9])


def moves(force: np.ndarray) -> np.ndarray:
    """What these forces (5, 3) [N] move the tool by."""
    found = []
    for angles, one in zip(THETA, force, strict=True):
        there = forward(robot(), angles[None], TOOL).position[0]
        moved = [forward(robot(), (angles + 1e-6 * axis)[None], TOOL).position[0] for axis in np.eye(6)]
        columns = (np.array(moved) - there) / 1e-6
        found.append(columns.T @ (COMPLIANCE * (columns @ one)))
    return np.array(found)


def rms(vectors: np.ndarray) -> float:
    return float(1e6 * np.sqrt(np.mean(np.sum(vectors**2, axis=1))))


def job(**more: Any) -> Any:
    cut = SimpleNamespace(of_edges=EDGES, of_top=TOP, width=WIDTH, diameter=16e-3, words="a cut")
    told = {"predicted": SimpleNamespace(cut=cut), "follows": FOLLOWS, "targets": TARGETS} | more
    log = SimpleNamespace(predicted=told["predicted"])
    return SimpleNamespace(
        forces=SimpleNamespace(log=log, follows=told["follows"]), targets=told["targets"],
        planned_theta=THETA[TARGETS], model=SimpleNamespace(robot=robot(), compliance=COMPLIANCE),
        path=SimpleNamespace(base_from_object=SimpleNamespace(rotation=np.tile(OBJECT, (5, 1, 1)))),
        each_tool=lambda: [(TOOL, np.arange(len(TARGETS)))])


def test_each_figure_is_what_the_robot_would_yield_more() -> None:
    """A millimetre of stock aside along its worse axis, or higher; a tenth more force; edges that need half more; a millimetre
    of cutter, of which one side is nearer by half, in a slot both, and never more than all of the cut."""
    found = if_another(job(), DEVIATION)
    assert found is not None
    aside = [rms(moves(np.einsum("nij,j->ni", FOLLOWS, 1e-3 * OBJECT[:, axis]))[TARGETS]) for axis in (0, 1)]
    assert found.aside == pytest.approx(max(aside), rel=1e-4)
    assert found.higher == pytest.approx(rms(moves(1e-3 * TOP)[TARGETS]), rel=1e-4)
    assert found.worn == pytest.approx(rms(moves(0.5 * EDGES)[TARGETS]), rel=1e-4)
    assert found.larger == pytest.approx(0.1 * rms(DEVIATION))
    shares = np.array([0.5 / 3, 1.0, 1 / 14.5, 0.5 / 9])
    assert found.thicker == pytest.approx(rms(DEVIATION * shares[:, None]))


@pytest.mark.parametrize("more", [
    {"predicted": None}, {"predicted": SimpleNamespace(cut=None)}, {"follows": None}, {"targets": np.arange(0)}])
def test_of_a_log_or_without_a_cut_nothing_is_said(more: dict[str, Any]) -> None:
    assert if_another(job(**more), DEVIATION) is None


def test_it_is_said_in_one_sentence() -> None:
    cut: Any = SimpleNamespace(words="An end mill of 16 mm")
    assert IfAnother(cut, 12.4, 3.6, 7.2, 8.8, 1.2).words == (
        "An end mill of 16 mm. The correction would be another by about 12 um RMS were the stock 1 mm aside, by 4 um were its "
        "top 1 mm higher, by 7 um were the cutter 1 mm thicker, by 9 um for each 10 % of force that the material takes more, "
        "by 1 um were the edges worn by half since the log")

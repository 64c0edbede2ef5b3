"""Forces of slots and thin cuts all round, written in one frame, order and sign and read in another: the stock tells which."""

from __future__ import annotations

from itertools import permutations, product

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from compensator.cutting.coefficients import Coefficients
from compensator.cutting.cutter import Cutter
from compensator.cutting.misread import Reading, misread
from compensator.cutting.posterior import ForceRows

MEAN = np.array([800.0, 300, 120, 20, 18, 1])
# By the linear-edge model's mean over a revolution, in the work plane (x along the feed): a slot, and a quarter of the way in.
SLOT = np.array([[0, -1.0, 0, -4, 0, 0], [1.0, 0, 0, 0, 4, 0], [0, 0, 0.6, 0, 0, 5]]) * 0.02
QUARTER = np.array([[0.5, -0.8, 0, 3, -3, 0], [0.8, 0.5, 0, 3, 3, 0], [0, 0, 0.6, 0, 0, 3]]) * 0.015


def cuts(count: int = 120) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Weights (n, 3, 6) in the base frame, the feed going all round, and the axes of the frames a log may be in."""
    rng = np.random.default_rng(3)
    feed = Rotation.from_euler("z", np.linspace(0, 300, count)[:, None], degrees=True).as_matrix()
    kind = np.where(np.arange(count)[:, None, None] % 40 < 20, SLOT, QUARTER)
    sensor = Rotation.from_euler("zyx", [35, 8, 172], degrees=True).as_matrix()
    tool = Rotation.from_euler("zx", [-60, 180], degrees=True).as_matrix()
    axes = {"base": np.eye(3), "tool": tool, "sensor": sensor}
    return (feed @ kind) * rng.uniform(0.7, 1.3, (count, 1, 1)), {
        name: np.broadcast_to(turn, (count, 3, 3)) for name, turn in axes.items()}


def rows_of(weight: np.ndarray, force: np.ndarray) -> ForceRows:
    aside = np.random.default_rng(5).normal(0, 2, (len(weight), 3, 3))
    return ForceRows(weight, force, np.full(force.shape, 0.4), aside, np.arange(len(force)) * 1e-3)


def coefficients(share: float) -> Coefficients:
    spread = share * np.repeat([np.abs(MEAN[:3]).max(), np.abs(MEAN[3:]).max()], 3) * [1, 0.4, 0.2, 1, 0.9, 0.1]
    return Coefficients(MEAN, np.diag(spread**2), 0.03, Cutter(0.016, 3), None, None, {})


def expected(weight: np.ndarray) -> np.ndarray:
    return weight @ (MEAN * [1.02, 0.97, 1.1, 0.9, 1.1, 1]) + np.random.default_rng(7).normal(0, 1.5, (len(weight), 3))


READINGS = [(frame, order, signs) for frame in ("base", "tool", "sensor") for order in permutations(range(3))
            for signs in product((1, -1), repeat=3)]


@pytest.mark.parametrize("share", [0.03, 0.2])
def test_every_other_reading_is_told(share: float) -> None:
    """The log stands in the sensor's axes; read in any frame, its columns in any order and sign, it is named how they stood."""
    weight, axes = cuts()
    force = expected(weight)
    wrong = 0
    for frame, order, signs in READINGS[1::2]:
        columns = np.einsum("nji,nj->ni", axes["sensor"], force)[:, order] * signs
        read = np.einsum("nij,nj->ni", axes[frame], columns)
        off = np.linalg.norm(read - force) / np.linalg.norm(force)
        told = misread(rows_of(weight, read), axes, frame, coefficients(share), 1e-4, 1e-4)
        # One that is next to the right one may pass; what is told is right.
        assert told is not None or off < 0.4, (frame, order, signs)
        if told is None:
            continue
        as_told = np.einsum("nij,nj->ni", axes[told.frame], columns[:, told.order] * told.signs)
        wrong += np.linalg.norm(as_told - force) > 0.25 * np.linalg.norm(force)
    assert wrong == 0


@pytest.mark.parametrize("factor", [1.0, 0.6, 1.8])
def test_a_right_reading_is_not_doubted(factor: float) -> None:
    """Nor that of a worn tool, another material or a stock that stands aside."""
    weight, axes = cuts()
    rows = rows_of(weight, factor * expected(weight))
    assert misread(rows, axes, "sensor", coefficients(0.03), 1e-4, 1e-4) is None
    aside = rows.aside @ np.array([3.0, -2.0, 1.0])
    assert misread(rows_of(weight, expected(weight) + aside), axes, "sensor", coefficients(0.03), 1e-4, 1e-4) is None


@pytest.mark.parametrize(("frame", "order", "signs", "words"), [
    ("base", (0, 1, 2), (-1, -1, -1), "read with the other sign the log"),
    ("tool", (0, 1, 2), (1, 1, 1), "read in the frame tool the log"),
    ("base", (1, 0, 2), (1, 1, 1), "read with the columns fy_n fx_n fz_n in this order the log"),
    ("base", (0, 1, 2), (1, -1, -1), "read with y and z turned over the log"),
    ("sensor", (1, 2, 0), (-1, -1, -1),
     "read in the frame sensor, with the columns fy_n fz_n fx_n in this order, with the other sign")])
def test_a_reading_is_told_in_words(frame: str, order: tuple[int, ...], signs: tuple[int, ...], words: str) -> None:
    """What is as stated is not said."""
    told = Reading(frame, order, signs, 3.04, 91.0).words("base")
    assert told.startswith(words)
    assert told.endswith("would be off what the stock lets expect by 3.0 N RMS, as it is read by 91.0 N")

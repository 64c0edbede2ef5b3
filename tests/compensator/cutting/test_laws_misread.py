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


ONE = np.array([1.0, 0, 0, 0, 0, 0])


def read_of(
    expected: np.ndarray, read: np.ndarray, scale: float = 1.0, width: float = 1e-6, frame: str = "base", model: float = 0.0,
    aside: np.ndarray | None = None, position_std: float = 1e-4
) -> Reading | None:
    """What is told of a log that reads `read` (n, 3) where `expected` is, each component known to `scale` [N], all of the
    expected force to the share `width`, the model to `model`; in the base frame or in the tool's, whose x is its y."""
    count = len(read)
    weight, turned = np.zeros((count, 3, 6)), np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    weight[:, :, 0] = expected
    error = np.full((count, 3), np.sqrt(scale**2 - 0.2**2))
    rows = ForceRows(weight, read, error, np.zeros((count, 3, 3)) if aside is None else aside, np.arange(count) * 1e-3)
    axes = {name: np.broadcast_to(turn, (count, 3, 3)) for name, turn in (("base", np.eye(3)), ("tool", turned))}
    known = Coefficients(ONE, width**2 * np.diag(ONE) + 1e-12 * np.eye(6), model, Cutter(8e-3, 3), None, None, {})
    return misread(rows, axes, frame, known, position_std, 1e-4)


def to_and_fro(count: int, *size: float) -> np.ndarray:
    """Forces (count, 3) [N] of these sizes whose means are zero, none of which another makes."""
    return np.array(size) * np.resize([[1.0, 1, 1], [-1, 1, 1], [1, -1, 1], [-1, -1, 1], [1, 1, -1], [-1, 1, -1], [1, -1, -1],
                                       [-1, -1, -1]], (count, 3))


@pytest.mark.parametrize(("times", "told"), [(2.9, True), (3.1, False), (0.34, True), (0.33, False)])
def test_a_reading_is_told_that_halves_what_the_log_is_off(times: float, told: bool) -> None:
    """The force so many times as large as expected, with the other sign: off by |t - 1| against t + 1 times the force."""
    force = to_and_fro(80, 100, 60, 30)
    found = read_of(force, -times * force, width=0.1)
    assert (found is not None) == told
    if found is not None:
        assert found[:3] == ("base", (0, 1, 2), (-1, -1, -1))
        size = np.sqrt(100**2 + 60**2 + 30**2)
        assert found[3:] == pytest.approx((abs(times - 1) * size, (times + 1) * size), rel=1e-9)


@pytest.mark.parametrize(("share", "told"), [(0.34, True), (0.36, False)])
def test_a_reading_is_told_that_leaves_about_a_third_of_the_force(share: float, told: bool) -> None:
    """Of all the force that the log has; the rest of it is none of the cut's, and nothing else that is known explains it."""
    force, other = to_and_fro(64, 100, 60, 30), np.resize([1.0, 1, 1, 1, 1, 1, 1, 1, -1, -1, -1, -1, -1, -1, -1, -1], 64)
    rest = np.outer(other * np.resize([1.0, -1], 64), [0, 1, 0]) * np.sqrt(14500) * share / np.sqrt(1 - share**2)
    assert (read_of(force, -(force + rest), 20.0) is not None) == told


@pytest.mark.parametrize(("zero", "aside_mm", "scale", "told"), [
    (50.0, 0.1, 1.0, True), (0.0, 0.2, 1.0, True), (0.0, 2e-4, 1.0, False), (900.0, 0.1, 1.0, False), (120.0, 0.1, 1.0, True),
    (120.0, 0.1, 20.0, False), (60.0, 0.1, 4.0, True), (50.0, 0.1, 20.0, True)])
def test_the_sensor_s_zero_and_where_the_stock_stands_explain_what_they_can(
        zero: float, aside_mm: float, scale: float, told: bool) -> None:
    """50 N more than the cut has: as of a zero, which may be off by 2 N, of 64 rows whose mean is known to an eighth of one; or
    as of a stock that stands aside by half a millimetre, of which the file says that it may be 0.2 mm, or next to nothing. Not
    where that is far more than all of the force; rows that are known to 4 N tell a zero too, those to 20 N two fifths of it."""
    force, other = to_and_fro(64, 100, 60, 30), np.resize([1.0, 1, 1, 1, 1, 1, 1, 1, -1, -1, -1, -1, -1, -1, -1, -1], 64)
    aside = np.zeros((64, 3, 3))
    aside[:, 1, 0] = 10 * other * np.resize([1.0, -1], 64)
    rest = [0, zero, 0] if zero else 5 * aside[:, :, 0]
    assert (read_of(force, -(force + rest), scale, aside=aside, position_std=1e-3 * aside_mm) is not None) == told


@pytest.mark.parametrize(("second", "scale", "told"), [
    # 80 rows, of which the other sign of y would be off by twice its size: 60 for 20 to 1, ten neighbours for one.
    (9.0, 50.0, True), (11.0, 50.0, False), (11.0, 25.5, False), (11.0, 25.0, True)])
def test_a_reading_is_told_that_is_likelier_than_all_that_are_another(second: float, scale: float, told: bool) -> None:
    """One whose forces are off its own by a fifth of the force may be as likely, and so may what is 20 to 1 less likely."""
    size = np.hypot(100.0, second)
    force = to_and_fro(80, 100 * 100 / size, second * 100 / size, 0)
    found = read_of(force, -force, scale)
    assert (found is not None) == told


@pytest.mark.parametrize(("scale", "model", "told"), [
    (20.4, 0.0, True), (21.0, 0.0, False), (1.0, 0.203 * 3**0.5, True), (1.0, 0.21 * 3**0.5, False)])
def test_a_reading_is_told_that_is_twenty_times_as_likely_as_the_stated_one(scale: float, model: float, told: bool) -> None:
    """Though the forces of both are alike: y turned over, of 9 N beside 100. What the model leaves is a share of the whole
    force, of which each component has a third of the squares, as where the share is found and where it is predicted by."""
    force = to_and_fro(80, 100, 9, 0)
    found = read_of(force, force * [1, -1, 1], scale, model=model)
    assert (found is not None) == told


@pytest.mark.parametrize(("expected", "stated", "reading"), [
    ((100, 0, 0), "base", ("base", (0, 1, 2), (-1, -1, -1))), ((0, 100, 0), "tool", ("tool", (0, 1, 2), (-1, -1, -1))),
    # Its z, of which the log has a trace, is as it is stated; 20 to 1 for that are not enough to say so.
    ((100, 40, 3), "base", ("base", (0, 1, 2), (-1, -1, -1))), ((100, 40, 8), "base", ("base", (0, 1, 2), (-1, -1, 1)))])
def test_of_readings_that_are_alike_the_plainest_is_told(
        expected: tuple[float, ...], stated: str, reading: tuple[object, ...]) -> None:
    """The other sign of all, where that of single axes, or another frame in another order, does as well."""
    force = to_and_fro(80, *expected)
    found = read_of(force, force * [-1, -1, 1], 10.0, frame=stated)
    assert found is not None
    assert found[:3] == reading

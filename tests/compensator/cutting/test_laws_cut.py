"""What a cut is of its steps and targets: means by time, what counts, figures and their line, on steps that are made here; and
how finely a program is cut, and what the top of its stock does to its force."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import compstiff
from compensator.cutting.cut import Cut, _heights, _sideways, cut_of
from compensator.cutting.cutter import Cutter
from compensator.cutting.removal import Engagement
from compensator.cutting.track import Track
from compensator.path.robot_path import robot_path
from tests.compensator.cutting.milled import FLAT, TRUE, track_along
from tests.compensator.cutting.test_contract_asked import CELL, job

STEPS, TARGETS = 12, 5


def steps(seed: int = 4, **changed: Any) -> Any:
    """A cut of 12 steps of the first four of five targets, each target's work object turned otherwise; changed: of `feed` (5,)
    [m/s], `chip` (12,) [m], `depth` (12,) [m], `unknown` (12,)."""
    rng = np.random.default_rng(seed)
    target = np.sort(rng.permutation(np.arange(STEPS) % 4))
    point = rng.normal(size=(STEPS + 1, 3))
    place = np.linspace(0.5, STEPS - 0.5, STEPS)
    track = Track(point[:-1], point[1:], place, rng.uniform(0.2e-3, 0.5e-3, STEPS), target, target + 1,
                  changed.get("chip", rng.uniform(4e-5, 9e-5, STEPS)), np.zeros(STEPS, dtype=bool), np.zeros((STEPS, 3)))
    engaged = Engagement(rng.normal(size=(STEPS, 3, 6)), rng.uniform(-1.5, -0.2, STEPS), rng.uniform(-0.1, 1.5, STEPS),
                         changed.get("depth", rng.uniform(1e-3, 3e-3, STEPS)), rng.uniform(1e-3, 9e-3, STEPS),
                         changed.get("unknown", np.zeros(STEPS, dtype=bool)), rng.normal(size=(3, STEPS, 3, 6)))
    turned = Rotation.random(TARGETS, random_state=rng).as_matrix()
    feed = changed.get("feed", np.array([0.02, 0.01, 0.04, 0.02, 0.08]))
    toolpath = type("Targets", (SimpleNamespace,), {"__len__": lambda self: TARGETS})(feed=feed)
    path: Any = SimpleNamespace(toolpath=toolpath, base_from_object=SimpleNamespace(rotation=turned))
    blank: Any = SimpleNamespace(bounds=np.array([[0, 0, 0], [1, 1, 1.0]]))
    left: Any = None
    return Cut(path, FLAT, 0.01, blank, track, engaged, left)


def mean_by(time: np.ndarray, target: np.ndarray, values: np.ndarray) -> np.ndarray:
    return np.array([sum(time[k] * values[k] for k in np.flatnonzero(target == n)) / sum(time[target == n])
                     if (target == n).any() else 0 * values[0] for n in range(TARGETS)])


def test_the_mean_force_of_a_target_is_that_of_its_steps_by_their_time() -> None:
    """The chip's three coefficients by the feed a tooth, in the base; none where it is not known, or no tooth's feed is."""
    chip, unknown = np.full(STEPS, 6e-5), np.zeros(STEPS, dtype=bool)
    chip[2], unknown[7] = np.nan, True
    cut = steps(chip=chip, unknown=unknown)
    track, engaged = cut.track, cut.engagement
    time = track.length / cut.path.toolpath.feed[track.move]
    np.testing.assert_allclose(cut.time, time)
    force = np.zeros((STEPS, 3))
    for k in range(STEPS):
        per_chip = [0.0 if k == 2 else 6e-5] * 3 + [1.0] * 3
        force[k] = cut.path.base_from_object.rotation[track.target[k]] @ engaged.weights[k] @ (per_chip * TRUE) * (k != 7)
    np.testing.assert_allclose(cut.per_step @ TRUE, force)
    np.testing.assert_allclose(cut.per_target @ TRUE, mean_by(time, track.target, force), atol=1e-12)
    np.testing.assert_array_equal(cut.mean(np.ones(STEPS)), [1, 1, 1, 1, 0])
    assert cut.unknown.tolist() == [n == track.target[7] for n in range(TARGETS)]
    assert cut.cuts.tolist() == [True] * 4 + [False]


@pytest.mark.parametrize(("feed", "usual"), [
    ([9.0, np.nan, 0.04, 0.02, 0.01], [9.0, 0.02, 0.04, 0.02, 0.01]), ([9.0, 0.0, 0.04, 0.04, 0.04], [9.0] + [0.04] * 4),
    ([np.nan] * 5, [1.0] * 5)])
def test_a_move_without_a_feed_counts_as_one_at_the_middle_of_the_others(feed: list[float], usual: list[float]) -> None:
    """Of the moves that have steps, all but the first; where none is known, by length."""
    cut = steps(feed=np.array(feed))
    np.testing.assert_allclose(cut.time, cut.track.length / np.array(usual)[cut.track.move])


def test_a_tool_aside_changes_the_force_by_what_other_weights_make_of_it() -> None:
    """Columns are x, y and z of the work object; and a top that is higher is a tool that is lower, where the cut ends within a
    tenth of a millimetre of it: deeper, whichever end of a step is."""
    depth = np.zeros(STEPS)
    cut = steps(depth=depth)
    tip = np.minimum(cut.track.start[:, 2], cut.track.end[:, 2])
    below = np.array([0.05e-3, 0.15e-3, 0.0] * 4)
    depth = 1.0 - below - tip
    cut = steps(depth=depth)
    track, engaged, change = cut.track, cut.engagement, np.zeros((STEPS, 3, 3))
    for k in range(STEPS):
        own = TRUE * ([track.chip[k]] * 3 + [1.0] * 3)
        turned = cut.path.base_from_object.rotation[track.target[k]]
        for axis in range(3):
            change[k, :, axis] = turned @ ((engaged.moved[axis, k] - engaged.weights[k]) @ own)
    np.testing.assert_allclose(cut.change(TRUE), change, rtol=1e-9, atol=1e-9)
    higher = np.where((below < 0.1e-3)[:, None], -change[:, :, 2] / 2e-4, 0.0)
    np.testing.assert_allclose(cut.by_top(TRUE, 2e-4), mean_by(cut.time, track.target, higher), rtol=1e-9)
    lost = steps(depth=depth, unknown=np.arange(STEPS) == 3, chip=np.where(np.arange(STEPS) == 5, np.nan, track.chip))
    assert not lost.change(TRUE)[3].any()
    edges = np.where(np.arange(6) < 3, 0.0, TRUE)
    np.testing.assert_allclose(lost.change(TRUE)[5], steps(depth=depth).change(edges)[5])


def test_the_figures_of_a_cut_are_means_over_its_time() -> None:
    """Of the steps that cut; a step climbs whose cut lies more to the right of the feed than to its left."""
    depth = np.where(np.isin(np.arange(STEPS), [0, 5]), 0.0, np.linspace(1e-3, 4e-3, STEPS))
    unknown = np.arange(STEPS) == 11
    cut = steps(depth=depth, unknown=unknown)
    track, engaged, some = cut.track, cut.engagement, np.setdiff1d(np.arange(STEPS), [0, 5])
    time = track.length[some] / cut.path.toolpath.feed[track.move[some]]
    climbs = [engaged.low[k] + engaged.high[k] < 0 for k in some]
    assert 0 < sum(climbs) < len(some)
    figures = cut.figures()
    assert figures == pytest.approx({
        "cutting_targets": 4, "unknown_targets": 1, "depth_mm": 1e3 * sum(time * depth[some]) / sum(time),
        "width_mm": 1e3 * sum(time * engaged.width[some]) / sum(time),
        "feed_a_tooth_mm": 1e3 * np.median(track.chip[some]), "climb_share": sum(time * climbs) / sum(time)})
    assert cut.line() == (
        f"engagement: 4 targets cut, on average {figures['depth_mm']:.2f} mm deep along the axis and {figures['width_mm']:.2f} "
        f"mm across the feed, {100 * figures['climb_share']:.0f} % climb, {figures['feed_a_tooth_mm']:.3g} mm a tooth")
    air = steps(depth=np.zeros(STEPS))
    assert air.figures() == {"cutting_targets": 0, "unknown_targets": 0}
    assert air.line() == "engagement: the program touches its stock nowhere"


@pytest.mark.parametrize(("y", "x", "counts"), [
    (13.1, 5.0, False), (12.9, 5.0, True), (-8.1, 5.0, False), (-7.9, 5.0, True), (2.0, -8.1, False), (2.0, -7.9, True),
    (2.0, 18.1, False), (2.0, 17.9, True)])
def test_a_tip_that_goes_sideways_beside_the_stock_makes_a_level(y: float, x: float, counts: bool) -> None:
    """Within 8 mm of a stock of 10 x 5 mm; not where it goes up or down alone."""
    box = 1e-3 * np.array([[0, 0, 0], [10, 5, 3.0]])
    way = np.array([[x, y, -1.0], [x, y, -2.0], [x + (1 if x > 10 else -1), y + (y > 5) - (y < 0), -3.0]])
    track = track_along(way, step_mm=9.0)
    found = _sideways(track, box, 8e-3)
    assert found.tolist() == [False, counts]
    np.testing.assert_allclose(1e3 * _heights(track, np.array([False, True])), [-2, -3])


@pytest.mark.parametrize(("diameter", "longest"), [(4.0, 0.125), (16.0, 0.5), (40.0, 0.5)])
def test_steps_are_a_sixteenth_of_the_radius_and_half_a_millimetre_at_most(
    tmp_path: Path, diameter: float, longest: float
) -> None:
    """Of moves of 2 mm, so many alike, beside a stock that stands away from them."""
    job(tmp_path, cell=CELL.replace("diameter_mm: 16", f"diameter_mm: {diameter:g}"),
        stock="box: {from_mm: [0, 0, 0], to_mm: [5, 5, 5]}\n")
    cell = compstiff.read_cell(tmp_path / "cell.yaml")
    path = robot_path(compstiff.read_toolpath(tmp_path / "slot.mod", cell).toolpath, cell)
    cut = cut_of(path, tmp_path / "stock.yaml", None)
    inside = (cut.track.move > 2) & (cut.track.move < len(path.toolpath) - 2)
    np.testing.assert_allclose(1e3 * cut.track.length[inside], longest)
    assert np.bincount(cut.track.move[inside])[3:].tolist() == [2.0 / longest] * (len(path.toolpath) - 5)
    assert cut.revolution == pytest.approx(1 / 150)
    np.testing.assert_allclose(cut.track.chip[inside], 0.018 / 150 / 3)


@pytest.mark.parametrize(("corner", "words"), [
    (0.0, "flat end mill, diameter 16 mm, 3 teeth"), (2e-3, "bull-nose R2 end mill, diameter 16 mm, 3 teeth"),
    (8e-3, "ball end mill, diameter 16 mm, 3 teeth"), (7.995e-3, "ball end mill, diameter 16 mm, 3 teeth"),
    (7.98e-3, "bull-nose R7.98 end mill, diameter 16 mm, 3 teeth")])
def test_a_cutter_is_called_what_it_is_taken_for(corner: float, words: str) -> None:
    """A rounding within a hundredth of a millimetre of the radius is a ball."""
    cutter = Cutter(8e-3, 3, corner)
    assert cutter.words() == words
    assert cutter.ball == words.startswith("ball")

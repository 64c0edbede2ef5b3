"""The forces of a log on the points of a grid: what a point without a sample of its own gets, how sure a mean is, and what the
targets of a program take of it, on points that are made here."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from compensator.correction.grid_forces import (
    _between_samples,
    _centred,
    _on_their_moves,
    _still_at_touch,
    _unsure_at_steps,
    _without_short_gaps,
    along_chords,
    among_others,
    averaged,
    forces_on,
    noise_of,
    place_of,
    weight_of,
)
from compensator.forces.target_forces import TargetForces
from compensator.toolpath import Move

WAYS = np.array([1.0, -2.0, 0.5, 0.1, -0.1, 0.2])


def forces(size: list[float], samples: list[int] | None = None, *, named: bool = False, **more: Any) -> TargetForces:
    """Of points at which the force has these sizes along WAYS; none where it is 0."""
    count, log = len(size), SimpleNamespace(key="target" if named else "path_mm")
    return replace(TargetForces(np.array(size)[:, None] * WAYS, np.array(samples or [1] * count), np.full((count, 3), 0.5),
                                np.array(size) != 0, None, (), log), **more)


def sizes(found: TargetForces) -> list[float]:
    """Along WAYS; that it is along them is looked at too."""
    size = found.wrench[:, 0] / WAYS[0]
    assert found.wrench == pytest.approx(size[:, None] * WAYS)
    return size.tolist()


@pytest.mark.parametrize(("closest", "filled"), [(2.0, True), (1.9, False)])
def test_a_gap_in_which_no_target_could_stand_gets_what_lies_between(closest: float, filled: bool) -> None:
    """Of 2 mm, three parts of which lie before the point in it; and one of 5 mm that stays, as what is outside does."""
    place = np.array([0.0, 1, 2.5, 3, 4, 8, 9, 10])
    found = _without_short_gaps(forces([0, 20, 0, 60, 50, 0, 30, 0]), 1e-3 * place, np.full(8, 1e-3 * closest))
    assert sizes(found) == pytest.approx([0, 20, 50 if filled else 0, 60, 50, 0, 30, 0])
    assert found.forced.tolist() == [False, True, filled, True, True, False, True, False]


def test_what_is_closest_is_that_of_the_move_behind_the_gap() -> None:
    closest = np.full(5, 1e-3)
    closest[3] = 3e-3
    given = forces([10, 0, 0, 40, 40])
    assert sizes(_without_short_gaps(given, 1e-3 * np.arange(5), closest)) == pytest.approx([10, 20, 30, 40, 40])
    assert sizes(_without_short_gaps(given, 1e-3 * np.arange(5), np.full(5, 2e-3))) == pytest.approx([10, 0, 0, 40, 40])


@pytest.mark.parametrize(("size", "wanted"), [
    ([10, 0, 0, 40, 0], [10, 17.5, 25, 40, 40]), ([0, 0, 0, 40, 0], [0, 10, 20, 40, 40]),
    ([10, 0, 0, 0, 0], [10, 7.5, 5, 0, 0]), ([0, 0, 0, 0, 0], [0, 0, 0, 0, 0])])
def test_a_point_without_a_sample_gets_what_lies_between_those_that_have_one(size: list[float], wanted: list[float]) -> None:
    """Where either of them has a force; behind the last of them what that has. Only those that are asked for."""
    place = np.array([0.0, 1, 2, 4, 5])
    for stay in ([1, 2, 4], [2]):
        found = _between_samples(forces(size, [3, 0, 0, 2, 0]), place, np.array(stay))
        expected = [wanted[k] if k in stay else size[k] for k in range(5)]
        assert sizes(found) == pytest.approx(expected)
        beside = [any(size), any(size), any(size), bool(size[3]), bool(size[3])]
        assert found.forced.tolist() == [bool(size[k]) or (k in stay and beside[k]) for k in range(5)]


def test_a_point_with_a_sample_or_a_force_keeps_it_and_without_samples_all_do() -> None:
    place, every = np.arange(4.0), np.arange(4)
    assert sizes(_between_samples(forces([10, 0, 5, 40], [3, 1, 0, 2]), place, every)) == pytest.approx([10, 0, 5, 40])
    assert sizes(_between_samples(forces([10, 0, 5, 40], [0] * 4), place, every)) == pytest.approx([10, 0, 5, 40])
    # Behind a sampled point of no force a force that was carried over is none of its own.
    carried = replace(forces([10, 0, 0, 40], [3, 0, 1, 2]), wrench=np.array([10.0, 0, 7, 40])[:, None] * WAYS)
    assert sizes(_between_samples(carried, place, np.array([1])))[1] == pytest.approx(5)


def test_a_step_lies_anywhere_between_the_samples_on_either_side() -> None:
    """A component of 20 between 10 and 50 is one or the other: a quarter of the time 50, with a variance of 300, three quarters
    of which are 10. Beyond both it is no step."""
    given = replace(forces([10, 0, 20, 50, 60], [1, 0, 1, 1, 1]), standard_error=np.array(
        [[1.0] * 3, [2.0] * 3, [3.0] * 3, [4.0] * 3, [np.nan] * 3]))
    found = _unsure_at_steps(given, np.array([2, 3, 4]))
    chance = np.random.default_rng(3).random(200_000) < 0.25
    step = np.std(np.where(chance, 50, 10))
    assert found.standard_error[2] == pytest.approx(np.hypot(3, step * np.abs(WAYS[:3])), rel=0.01)
    assert found.standard_error[3] == pytest.approx(np.hypot(4, np.sqrt(30 * 10) * np.abs(WAYS[:3])))
    assert found.standard_error[4] == pytest.approx(0.0)
    assert found.standard_error[:2] == pytest.approx(given.standard_error[:2])
    alone = forces([10, 20, 5], [0, 0, 0])
    assert _unsure_at_steps(alone, np.array([1])) is alone
    peak = _unsure_at_steps(forces([10, 60, 20]), np.array([1]))
    assert peak.standard_error[1] == pytest.approx(0.5)


def test_beside_the_air_a_step_is_from_no_force() -> None:
    given = replace(forces([0, 20, 50]), wrench=np.array([7.0, 20, 50])[:, None] * WAYS)
    found = _unsure_at_steps(given, np.array([1])).standard_error[1]
    assert found == pytest.approx(np.hypot(0.5, np.sqrt(20 * 30) * np.abs(WAYS[:3])))


def test_the_noise_of_a_mean_is_that_of_one_sample_by_its_number() -> None:
    """Scatter of 4 N a sample about a ramp; points without samples tell nothing, nor does a log that names targets."""
    rng, count = np.random.default_rng(9), 900
    samples = rng.integers(0, 9, count)
    scatter = np.zeros((count, 6))
    scatter[:, :3] = 4 * rng.standard_normal((count, 3)) / np.sqrt(np.maximum(samples, 1))[:, None]
    given = replace(forces([1.0] * count, samples.tolist()), wrench=np.arange(count)[:, None] * WAYS + scatter)
    found = noise_of(given)
    assert found[samples > 0] == pytest.approx(4 / np.sqrt(samples[samples > 0])[:, None] * np.ones(3), rel=0.15)
    assert not found[samples == 0].any()
    assert weight_of(given).tolist() == samples.tolist()
    named = replace(given, log=SimpleNamespace(key="target"))
    assert not weight_of(named).any()
    assert not noise_of(named).any()


def test_the_place_of_a_point_without_one_is_that_of_the_one_before() -> None:
    path: Any = SimpleNamespace(length=np.array([np.nan, 0.0, 1, np.nan, 3]))
    assert place_of(path).tolist() == [0, 0, 1, 1, 3]


@pytest.mark.parametrize("by_place", [False, True])
def test_targets_take_the_mean_over_half_the_way_to_the_nearer_one(by_place: bool) -> None:
    """Targets of the program at 0, 6, 7 and 12 of 13 points, one added at 3, which takes points 2 to 4, of samples 1, 2, 3; two
    that have none but their own beside them keep what was planned, or take what is at their place."""
    size = np.array([10.0, 12, 20, 30, 40, 44, 50, 55, 60, 62, 64, 66, 70])
    samples = np.array([1, 1, 1, 2, 3, 1, 1, 1, 1, 1, 1, 1, 4])
    placed = replace(forces(size.tolist(), samples.tolist()), standard_error=np.outer(np.arange(1.0, 14), np.ones(3)),
                     unknown=np.arange(13.0), follows=np.arange(13.0) + 20, weight_std=np.arange(13.0) + 40)
    own = np.array([0, 6, 7, 12])
    further = ~np.isin(np.arange(13), own)
    grid: Any = SimpleNamespace(further=further, owner=np.searchsorted(own, np.arange(13)))
    planned = forces([1.0, 2, 0, 4], [11, 12, 13, 14], standard_error=np.outer([5.0, 6, 7, 8], np.ones(3)))
    chosen = np.zeros(13, dtype=bool)
    chosen[12] = by_place
    found = averaged(planned, placed, grid, np.arange(13.0), np.array([0, 3, 6, 7, 12]), chosen)
    assert sizes(found) == pytest.approx([10, (20 + 2 * 30 + 3 * 40) / 6, 50, 0, 70 if by_place else 4])
    assert found.samples.tolist() == [1, 6, 1, 13, 4 if by_place else 14]
    assert found.forced.tolist() == [True, True, True, False, True]
    error = np.sqrt((1 * 3) ** 2 + (2 * 4) ** 2 + (3 * 5) ** 2) / 6
    assert found.standard_error[:, 0] == pytest.approx([1, error, 7, 7, 13 if by_place else 8])
    assert (found.unknown.tolist(), found.follows.tolist()) == ([0, 3, 6, 7, 12], [20, 23, 26, 27, 32])
    assert found.weight_std.tolist() == [40, 43, 46, 47, 52]


def test_a_point_without_samples_is_as_unsure_in_a_mean_as_one_sample() -> None:
    """Points 3 to 5, of no sample, of three and of one; a target that has none itself keeps its own error."""
    placed = replace(forces([10.0] * 8, [1, 1, 1, 0, 3, 1, 1, 1]), standard_error=np.outer(np.arange(1.0, 9), np.ones(3)))
    grid: Any = SimpleNamespace(further=np.arange(8) > 0, owner=np.zeros(8, dtype=int))
    found = averaged(placed, placed, grid, np.arange(8.0), np.array([1, 4, 7]), np.zeros(8, dtype=bool))
    assert found.standard_error[1] == pytest.approx(np.sqrt(4**2 + (3 * 5) ** 2 + 6**2) / 4)
    none = averaged(placed, placed, grid, np.arange(8.0), np.array([0, 3, 6]), np.zeros(8, dtype=bool))
    assert none.standard_error[1] == pytest.approx(4)


def test_targets_without_force_have_none_however_much_is_beside_them() -> None:
    placed = replace(forces([10, 0, 10, 10, 10, 10, 10]), wrench=np.full((7, 1), 10.0) * WAYS)
    grid: Any = SimpleNamespace(further=np.array([False, True, False, False, False, False, False]), owner=np.arange(7))
    place = np.array([0.0, 1, 2, 3, 4, 5, 6])
    found = averaged(placed, placed, grid, place, np.arange(7), np.arange(7) == 5)
    assert sizes(found)[1] == 0
    alone = averaged(placed, replace(placed, forced=np.arange(7) != 5), grid, place, np.arange(7), np.arange(7) == 5)
    assert sizes(alone)[5] == 0


def test_targets_that_were_looked_at_take_their_place_among_all() -> None:
    """Three planned, which stand at 0, 2 and 3 of four now; of the last three is said what was found."""
    kept, number = np.array([0, 2, 3]), np.array([1, 2, 3])
    more = {name: np.arange(3.0) for name in ("unknown", "follows", "weight_std")}
    planned = forces([1.0, 0, 3], [7, 8, 9], **more)
    some = forces([0.0, 6, 7], [1, 2, 3], **{name: values + 10 for name, values in more.items()})
    found = among_others(planned, kept, some, number)
    assert sizes(found) == pytest.approx([1, 0, 6, 7])
    assert (found.samples.tolist(), found.forced.tolist()) == ([7, 1, 2, 3], [True, False, True, True])
    for name in more:
        assert getattr(found, name).tolist() == [0, 10, 11, 12]
    bare = among_others(replace(planned, weight_std=None), kept, replace(some, unknown=None, follows=None), number)
    assert (bare.unknown, bare.follows, bare.weight_std) == (None, None, None)


@pytest.mark.parametrize(("forced", "still"), [([False, False, False], [2]), ([True, False, False], [2]),
                                               ([False, True, False], []), ([False, False, True], [])])
def test_a_target_reached_by_the_air_feed_is_still_where_the_sample_before_was(forced: list[bool], still: list[int]) -> None:
    """The air leads to the first and the third target; only the third has no sample, and behind one without force it has as
    good as one, unless it has a force by itself."""
    path: Any = SimpleNamespace(toolpath=SimpleNamespace(
        move=np.full(3, Move.LINEAR), feed=np.array([0.5, 0.02, 0.5]), by_joints=np.zeros(3, dtype=bool),
        block=np.full(3, "", dtype=object)))
    grid: Any = SimpleNamespace(kept=np.arange(3), targets=np.arange(3))
    given = replace(forces([1.0] * 3, [1, 1, 0]), forced=np.array(forced))
    found = _still_at_touch(given, SimpleNamespace(path=path), grid)
    assert np.flatnonzero(found.samples != given.samples).tolist() == still
    nothing = replace(given, samples=np.zeros(3, dtype=int))
    assert _still_at_touch(nothing, SimpleNamespace(path=path), grid) is nothing
    # Behind the first one that has a sample, whatever those behind it show; before that one nothing is known.
    first = _still_at_touch(replace(given, samples=np.array([0, 1, 0])), SimpleNamespace(path=path), grid)
    assert first.samples.tolist() == [0, 1, int(bool(still))]


def test_rows_of_moves_that_a_call_leads_to_are_taken_elsewhere() -> None:
    """Driven 0 1 2, then 5, then 3 4: rows at 2, 5 and 3, where the calls begin and end, tell of no place; those that tell the
    zero stay, and so do all where nothing else would be left."""
    class Log:
        def __init__(self, place: list[float]) -> None:
            self.place = np.array(place)

        def rows(self, chosen: np.ndarray) -> Log:
            return Log(self.place[chosen].tolist())

    def kept(place: list[float], tare: tuple[tuple[int, int], ...] = (), driven: list[int] | None = None) -> list[float]:
        order = None if driven is None else np.array(driven)
        planned: Any = SimpleNamespace(path=SimpleNamespace(toolpath=SimpleNamespace(driven=order), length=np.arange(6.0)),
                                       settings=SimpleNamespace(log=SimpleNamespace(tare=tare)))
        log: Any = Log(place)
        return _on_their_moves(log, planned).place.tolist()

    order, every = [0, 1, 2, 5, 3, 4], [0, 0.5, 1, 2, 2.5, 3, 4, 5]
    assert kept(every, driven=order) == [0, 0.5, 1, 2.5, 4]
    assert kept(every) == every
    assert kept(every, driven=[0, 1, 2, 3, 4, 5]) == every
    assert kept(every, ((2, 2),), order) == [0, 0.5, 1, 2, 2.5, 4]
    assert kept(every, ((2, 4),), order) == [0, 0.5, 1, 2, 2.5, 3, 4]
    assert kept([2, 3, 5], driven=order) == [2, 3, 5]


def test_a_log_along_an_arc_is_carried_onto_its_chords() -> None:
    """Targets every 20 degrees of an arc between two straight moves, two points on each piece: every target's sample is at the
    target again, those between are in proportion, and before and behind all of it they keep their distance."""
    on, around = np.radians(np.arange(0, 181, 20)), 0.05
    given = np.concatenate([[0.0], 0.1 + around * on, [0.1 + around * np.pi + 0.2]])
    chord = 3 * 2 * around * np.sin(np.radians(20 / 6))
    now = np.concatenate([[0.0], 0.1 + chord * np.arange(10), [0.1 + 9 * chord + 0.2]])
    np.testing.assert_allclose(along_chords(given, given, now), now, atol=1e-15)
    middle = 0.5 * (given[1:] + given[:-1])
    np.testing.assert_allclose(along_chords(middle, given, now), 0.5 * (now[1:] + now[:-1]), atol=1e-15)
    beyond = along_chords(np.array([-0.01, given[-1] + 0.02]), given, now)
    np.testing.assert_allclose(beyond, [-0.01, now[-1] + 0.02], atol=1e-15)


def test_forces_that_name_targets_are_straight_from_one_to_the_next() -> None:
    """Two further points on the move to the second target of three, none on the one after: between targets with force alone."""
    rng = np.random.default_rng(4)
    wrench, error = rng.normal(0, 90, (3, 6)), rng.uniform(1, 3, (3, 3))
    further = np.array([False, True, True, False, False])
    grid = SimpleNamespace(kept=np.flatnonzero(~further), further=further, targets=np.arange(3))
    for forced, at in (([True] * 3, [True] * 5), ([True, False, True], [True, False, False, False, True])):
        given = TargetForces(np.where(np.array(forced)[:, None], wrench, 0), np.array([7, 8, 9]), error, np.array(forced), None,
                             (), SimpleNamespace(key="target"))
        found = forces_on(SimpleNamespace(forces=given), None, grid, None)
        along = np.interp([0, 1, 2, 3, 6], [0, 3, 6], [0, 1, 2])
        wanted = np.column_stack([np.interp(along, range(3), axis) for axis in given.wrench.T])
        assert found.forced.tolist() == at
        assert np.allclose(found.wrench, np.where(np.array(at)[:, None], wanted, 0.0))
        assert np.allclose(found.standard_error, np.column_stack([np.interp(along, range(3), axis) for axis in error.T]))
        assert found.samples.tolist() == [7, 0, 0, 8, 9]


def test_a_mean_is_moved_to_where_its_point_stands() -> None:
    """Samples that lie unevenly about their points: a force that grows along the path comes out as it is there, but for the
    points at the ends of what has force; a step stays as steep and as high as it is."""
    rng, length = np.random.default_rng(8), 10e-3 * np.arange(30)
    place = np.sort(np.concatenate([length + aside for aside in rng.uniform(-4e-3, 4e-3, (5, 30))]))
    place = place[place >= 0]
    forced = (np.arange(30) > 3) & (np.arange(30) < 26)
    owner = np.rint(place / 10e-3).astype(int)
    for law in (lambda s: 50.0 + 900.0 * s, lambda s: np.where(s > 0.145, 80.0, 20.0)):
        means = np.array([law(place[owner == k]).mean() for k in range(30)])
        wrench = np.column_stack([means * size for size in (1.0, -2.0, 0.5, 0.0, 0.1, -0.1)]) * forced[:, None]
        log = SimpleNamespace(place=np.append(place, [np.nan, -1.0, 9.0]), weight=np.ones(len(place) + 3))
        found = _centred(TargetForces(wrench, np.bincount(owner), np.ones((30, 3)), forced, None, (), log),
                         SimpleNamespace(length=length))
        there = law(length)[:, None] * np.array([1.0, -2.0, 0.5, 0.0, 0.1, -0.1])
        inner = np.flatnonzero(forced)[1:-1]
        assert np.allclose(found.wrench[inner], there[inner], atol=1e-9)
        assert np.array_equal(np.delete(found.wrench, inner, axis=0), np.delete(wrench, inner, axis=0))

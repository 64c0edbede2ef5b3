"""What the direction of a force against the travel is told by, at each of its limits: made-up travels, forces by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from compensator.forces.cut_direction import CutDirection, Travel, said_of_direction, travel
from compensator.forces.swapped_columns import swapped_columns, turns_over
from tests.compensator.forces.test_contract_placement import plan

COUNT = 40


def driven(angles_deg: np.ndarray | float = 0.0, side: np.ndarray | int = 0, weight: np.ndarray | float = 1.0) -> Travel:
    """Moves along these angles about the spindle, which stands along z."""
    angle = np.radians(np.broadcast_to(angles_deg, COUNT).astype(float))
    feed = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    up = np.tile([0.0, 0.0, 1.0], (COUNT, 1))
    return Travel(np.arange(COUNT), feed, np.cross(up, feed), up, np.broadcast_to(weight, COUNT).astype(float),
                  np.broadcast_to(side, COUNT).astype(np.intp))


def push(cuts: Travel, along: float, left: float, up: float, scatter: float = 0.0, turned: float = 0.0) -> np.ndarray:
    """Forces (COUNT, 3) [N] of this mean against the travel, to and fro by so much along the spindle and across it."""
    wave = (-1.0) ** np.arange(COUNT)
    local = np.column_stack([along + turned * wave, np.full(COUNT, left), up + scatter * wave])
    return np.asarray(local[:, :1] * cuts.feed + local[:, 1:2] * cuts.left + local[:, 2:] * cuts.up)


def at(degrees: float, size: float = 100.0) -> tuple[float, float]:
    return size * np.cos(np.radians(degrees)), size * np.sin(np.radians(degrees))


def codes(cuts: Travel | None, force: np.ndarray, **frames: np.ndarray) -> list[tuple[str, str]]:
    found = said_of_direction(cuts, {"base": force, **frames}, "base", "log.csv")
    assert all(one.file == "log.csv" for one in found)
    return [(one.code, one.level) for one in found]


def test_the_mean_against_the_travel_is_by_its_length() -> None:
    """Three quarters of the way along x, the rest along y, with forces of their own."""
    weight = np.where(np.arange(COUNT) < 20, 3.0, 1.0)
    cuts = driven(np.where(np.arange(COUNT) < 20, 0.0, 90.0), weight=weight)
    force = np.where(np.arange(COUNT)[:, None] < 20, [10.0, 20.0, 5.0], [-40.0, 30.0, 5.0])
    seen = cuts.against(force)
    # Along y the force (-40, 30) is 30 forwards and 40 to the left.
    assert (seen.along, seen.left, seen.up) == pytest.approx((0.75 * 10 + 0.25 * 30, 0.75 * 20 + 0.25 * 40, 5.0))
    square = np.array([0.75 * 100 + 0.25 * 900, 0.75 * 400 + 0.25 * 1600, 25.0])
    assert seen.share == pytest.approx(np.hypot(seen.along, seen.left) / np.sqrt(square[0] + square[1]))
    assert seen.follows == pytest.approx((seen.along**2 + seen.left**2 + 25) / square.sum())
    assert seen.turns == pytest.approx(1 - abs(0.75 - 0.25))
    assert (seen.targets, seen.angle) == (COUNT, pytest.approx(np.arctan2(25, 15)))
    assert seen.words == "+15 N along the feed and +25 N to its left, +5 N towards the spindle"


@pytest.mark.parametrize(("degrees", "said"), [
    (65, "climb milling of little engagement"), (67, "climb milling of half the diameter"),
    (96, "climb milling of half the diameter"), (98, "a slot"), (135, "a slot"),
    (137, "conventional milling of half the diameter"), (169, "conventional milling of half the diameter"),
    (171, "conventional milling of little engagement"), (-121, "conventional milling of little engagement"), (-119, ""),
    (-1, ""), (1, "climb milling of little engagement")])
def test_a_kind_of_cut_is_one_up_to_its_angle(degrees: float, said: str) -> None:
    along, left = at(degrees)
    assert CutDirection(along, left, 0.0, 0.2, 0.5, 0.5, 40).looks == said
    assert CutDirection(along, left, 0.0, 0.19, 0.5, 0.5, 40).looks == ""


@pytest.mark.parametrize(("degrees", "up", "why"), [
    (-1, 0.0, "forwards and to the right"), (-119, 0.0, "forwards and to the right"), (1, 0.0, ""), (-121, 0.0, ""),
    (90, -101.0, "out of the spindle by more than it is pushed aside"), (90, -99.0, ""), (90, 400.0, "")])
def test_no_cutter_is_pulled_forwards_to_the_right_or_out_of_the_spindle(degrees: float, up: float, why: str) -> None:
    cuts = driven()
    found = said_of_direction(cuts, {"base": push(cuts, *at(degrees), up)}, "base", "log.csv")
    told = [one for one in found if one.code == "CS3068"]
    along, left = at(degrees)
    assert [(one.level, one.message) for one in told] == ([(
        "warning", f"over 40 targets that cut the force on the tool is on average {along:+.0f} N along the feed and "
        f"{left:+.0f} N to its left, {up:+.0f} N towards the spindle: no cutter that turns clockwise is pulled {why}")]
        if why else [])
    assert all(one.hint.startswith("is force_log.sign wrong") for one in told)


@pytest.mark.parametrize(("share", "said"), [(0.21, [("CS3068", "warning")]), (0.19, [("CS3071", "note")])])
def test_what_points_all_ways_tells_nothing(share: float, said: list[tuple[str, str]]) -> None:
    """The mean as a share of the root mean square across the spindle."""
    cuts = driven()
    scatter = 100 * np.sqrt(1 / share**2 - 1)
    assert codes(cuts, push(cuts, *at(-60), 0.0, turned=scatter)) == said
    if share < 0.2:
        force = push(cuts, *at(-60), 0.0, turned=scatter)
        [found] = said_of_direction(cuts, {"base": force}, "base", "log.csv", sign_stated=False)
        assert (found.level, found.message) == (
            "warning", "this log does not tell whether force_log.sign is right: against the feed it points all ways")
        assert found.hint.endswith("; then state force_log.sign in cell.yaml")


@pytest.mark.parametrize("degrees", [61, 59, 20, 170, 179, -179, 100])
def test_a_sign_that_the_other_way_round_no_cutter_feels_is_right(degrees: float) -> None:
    """Turned over by 180 degrees it lies between -120 and 0 where it lies between 60 and 180."""
    cuts = driven()
    found = said_of_direction(cuts, {"base": push(cuts, *at(degrees), 0.0)}, "base", "log.csv")
    fits_both = not 60 < degrees < 180
    assert [one.code for one in found] == ["CS3071"] * fits_both
    if fits_both:
        along, left = at(degrees)
        kinds = ("climb", "conventional") if along > 0 else ("conventional", "climb")
        assert found[0].message == (
            "force_log.sign is taken as cell.yaml states it, this log does not tell: over 40 targets that cut the force on the "
            f"tool is on average {along:+.0f} N along the feed and {left:+.0f} N to its left, +0 N towards the spindle, as in "
            f"{kinds[0]} milling of little engagement; with the other sign as in {kinds[1]}")


def test_frames_that_a_thin_cut_does_not_tell_apart_are_named() -> None:
    """Not one that reads the log alike, nor one that no cutter feels, nor one that points all ways."""
    cuts = driven()
    frames = {"base": push(cuts, *at(20), 0.0), "tool": push(cuts, *at(30), 0.0), "sensor": push(cuts, *at(20), 0.0),
              "other": push(cuts, *at(-30), 0.0), "loose": push(cuts, *at(30), 0.0, turned=500.0)}
    [found] = said_of_direction(cuts, frames, "base", "log.csv")
    assert found.message.endswith("with the other sign as in conventional; nor does it tell the frame base from tool")


@pytest.mark.parametrize(("side", "degrees", "words"), [
    (1, 161, "climbs"), (1, 159, ""), (1, -11, "CS3068"), (1, -121, "climbs"), (-1, 79, "mills conventionally"), (-1, 81, ""),
    (-1, 1, "mills conventionally"), (-1, -121, "")])
def test_the_side_of_the_stock_tells_a_thin_cut_too(side: int, degrees: float, words: str) -> None:
    """Climbing the force lies from forwards to the left of backwards, and conventional from the left to backwards and right."""
    cuts = driven(side=np.where(np.arange(COUNT) < 10, side, 0))
    found = said_of_direction(cuts, {"base": push(cuts, *at(degrees), 0.0)}, "base", "log.csv")
    if words == "CS3068":
        assert [one.code for one in found] == ["CS3068"]
        return
    along, left = at(degrees)
    assert [(one.code, one.message) for one in found if one.code != "CS3071"] == ([(
        "CS3074", f"by the order of the passes the tool {words} at 10 places; there the force on it is on average {along:+.0f} "
        f"N along the feed and {left:+.0f} N to its left, +0 N towards the spindle: no cutter turning clockwise is pushed so")]
        if words else [])
    # Nine places tell nothing.
    few = driven(side=np.where(np.arange(COUNT) < 9, side, 0))
    assert "CS3074" not in dict(codes(few, push(few, *at(degrees), 0.0)))


def test_of_two_sides_that_are_wrong_the_one_of_more_places_is_told() -> None:
    """Twelve where it climbs, pushed backwards; twenty where it does not, pushed forwards; the mean of all is no impossible."""
    cuts = driven(side=np.where(np.arange(COUNT) < 12, 1, np.where(np.arange(COUNT) < 32, -1, 0)))
    force = np.where((np.arange(COUNT) < 12)[:, None], push(cuts, -100, 40, 0), push(cuts, 90, 40, 0))
    [found] = said_of_direction(cuts, {"base": force}, "base", "log.csv")
    assert found.message.startswith("by the order of the passes the tool mills conventionally at 20 places; there the force on "
                                    "it is on average +90 N along")


@pytest.mark.parametrize(("turn_deg", "here", "other", "told"), [
    (47, 0.1, 0.5, True), (44, 0.1, 0.5, False),            # 1 - cos of it is 0.3 at 45.6 degrees
    (90, 0.1, 0.41, True), (90, 0.1, 0.39, False), (90, 0.39, 0.8, True), (90, 0.41, 0.8, False)])
def test_a_frame_in_which_far_more_of_the_force_follows_the_path_is_told(
    turn_deg: float, here: float, other: float, told: bool
) -> None:
    """Half of the path along x, half at an angle to it; the shares of the energy that keep their direction, in percent."""
    cuts = driven(np.where(np.arange(COUNT) < 20, 0.0, turn_deg))
    # Of a mean of 100 N and a scatter s along the spindle 100^2 / (100^2 + s^2) follows.
    force, better = (push(cuts, *at(100), 0.0, scatter=100 * np.sqrt(1 / share - 1)) for share in (here, other))
    found = [one for one in said_of_direction(cuts, {"base": force, "tool": better, "sensor": force}, "base", "log.csv")
             if one.code == "CS3069"]
    assert [(one.level, one.message) for one in found] == ([(
        "warning", f"as the path turns, {100 * here:.0f} % of the force keeps its direction against the feed; read in the "
        f"frame tool it would be {100 * other:.0f} %")] if told else [])
    assert all(one.hint.startswith("is force_log.frame base in cell.yaml right?") for one in found)


@pytest.mark.parametrize(("degrees", "follows", "named"), [(100, 0.42, True), (100, 0.38, False), (-60, 0.9, False)])
def test_another_frame_is_named_that_a_cutter_may_feel_and_that_follows_as_well(
    degrees: float, follows: float, named: bool
) -> None:
    """At least 0.8 of what follows in the stated one, which is half of its energy; one that is the stated one is no other."""
    cuts = driven()
    force = push(cuts, *at(-60), 0.0, scatter=100.0)
    other = push(cuts, *at(degrees), 0.0, scatter=100 * np.sqrt(1 / follows - 1))
    [found] = said_of_direction(cuts, {"base": force, "tool": other, "sensor": force.copy()}, "base", "log.csv")
    along, left = at(degrees)
    assert found.code == "CS3068"
    assert found.message.endswith(
        f"; read in the frame tool it would be {along:+.0f} N along the feed and {left:+.0f} N to its left, +0 N towards the "
        "spindle, as a cutter may feel it" if named else "is pulled forwards and to the right")
    assert found.hint.startswith("is force_log.frame base in cell.yaml right? Else, is" if named else "is force_log.sign wrong")


@pytest.mark.parametrize(("count", "told"), [(11, True), (10, False)])
def test_ten_moves_that_cut_are_enough(tmp_path: Path, count: int, told: bool) -> None:
    """Of eleven targets ten are reached by a move; by fewer nothing is told."""
    path = plan(tmp_path, count=count)
    cuts = travel(path, np.ones(count, dtype=bool))
    assert (cuts is not None) == told
    if cuts is None:
        [found] = said_of_direction(cuts, {"base": np.ones((count, 3))}, "base", "log.csv")
        assert found.message.endswith("this log does not tell: fewer than 10 targets cut across the spindle's axis")
        return
    assert cuts.which.tolist() == list(range(1, 11))
    np.testing.assert_allclose(cuts.weight, 10e-3, rtol=2e-3)       # the tool leans by 3 degrees
    np.testing.assert_allclose(np.cross(cuts.feed, cuts.left), cuts.up, atol=1e-12)
    assert (cuts.feed[:, 0] > 0.998).all()
    assert (cuts.up[:, 2] > 0.99).all()


def columns(cuts: Travel, axial: float, steady: float, across: float) -> np.ndarray:
    """An axial force in passes to and fro that turns with the travel by so much beside a steady part, and one to the left."""
    sense = np.sign(cuts.feed[:, 0])
    return np.column_stack([0 * sense, across * sense, axial * sense + steady])


@pytest.mark.parametrize(("axial", "steady", "across", "told"), [
    (31.0, 0.0, 94.9, True), (29.0, 0.0, 95.7, False),      # 0.3 of the whole, 100 N
    (100.0, 57.0, 50.0, True), (100.0, 58.5, 50.0, False)])     # a mean of half the RMS: tan 30 degrees of what turns
def test_an_axial_force_turns_over_that_is_large_and_of_either_sign(
    axial: float, steady: float, across: float, told: bool
) -> None:
    cuts = driven(np.where(np.arange(COUNT) % 2 == 0, 0.0, 180.0))
    assert turns_over(cuts, columns(cuts, axial, steady, across)) == told


@pytest.mark.parametrize(("follows", "told"), [(0.72, True), (0.69, False)])
def test_an_axial_force_turns_over_where_the_travel_explains_half_of_its_energy(follows: float, told: bool) -> None:
    """So large a part of the axial force goes with the travel, the rest to and fro twice as slowly."""
    cuts = driven(np.where(np.arange(COUNT) % 2 == 0, 0.0, 180.0))
    slow = np.where(np.arange(COUNT) // 2 % 2 == 0, 1.0, -1.0)
    force = columns(cuts, 100 * follows, 0.0, 50.0) + 100 * np.sqrt(1 - follows**2) * slow[:, None] * [0, 0, 1]
    assert turns_over(cuts, force) == told


@pytest.mark.parametrize(("wander", "told"), [(130.0, True), (137.0, False)])
def test_columns_are_in_another_order_where_more_follows(wander: float, told: bool) -> None:
    """An axial column of 100 N that turns with the travel, read as the one to the left; what stands in the others goes to and
    fro more slowly, with less of it in the first. 0.6 of the root mean square is its share with 133 N beside it."""
    cuts = driven(np.where(np.arange(COUNT) % 2 == 0, 0.0, 180.0))
    sense, number = np.sign(cuts.feed[:, 0]), np.arange(COUNT)
    slow, slower = (np.where(number // by % 2 == 0, 1.0, -1.0) for by in (2, 4))
    force = np.column_stack([wander * slower, 160 * slow, 100 * sense])
    found = swapped_columns(cuts, force, np.broadcast_to(np.eye(3), (COUNT, 3, 3)), "log.csv")
    assert [(one.code, one.level, one.file, one.message) for one in found] == ([(
        "CS3078", "warning", "log.csv", "the force along the tool's axis turns its sign with the travel, and of that across it "
        f"only 0 % follow; with the columns fx_n fz_n fy_n in this order {100 * 100 / np.hypot(100, wander):.0f} % would")]
        if told else [])


@pytest.mark.parametrize(("mixed", "told"), [(0.71, True), (0.73, False)])
def test_columns_are_in_another_order_where_the_stated_one_has_under_four_fifths_of_that(mixed: float, told: bool) -> None:
    """So large a part of 80 N to the left follows; with the axial 100 N along the feed hypot(100, 80 m) of hypot(100, 80)
    would: m is 0.8 of it at 0.72."""
    cuts = driven(np.where(np.arange(COUNT) % 2 == 0, 0.0, 180.0))
    sense, slow = np.sign(cuts.feed[:, 0]), np.where(np.arange(COUNT) // 2 % 2 == 0, 1.0, -1.0)
    force = np.column_stack([0 * sense, 80 * (mixed * sense + np.sqrt(1 - mixed**2) * slow), 100 * sense])
    # With either of both along the feed; and logged in axes that are turned about x by a quarter: y is -z, z is y.
    axes = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    for turn, named in ((np.eye(3), {"fz_n fy_n fx_n", "fy_n fz_n fx_n"}), (axes, {"fy_n fx_n fz_n", "fz_n fx_n fy_n"})):
        found = swapped_columns(cuts, force, np.broadcast_to(turn, (COUNT, 3, 3)), "log.csv")
        told_in = [one.message.split("with the columns ")[1].split(" in this order")[0] for one in found]
        assert [order in named for order in told_in] == [True] * told
        assert all("only 71 % follow; " in one.message and one.message.endswith(" 90 % would") for one in found)


@pytest.mark.parametrize("cuts", [None, driven()])
def test_no_order_of_columns_is_told_by_nothing(cuts: Travel | None) -> None:
    """Of too few moves, or of moves all one way."""
    force = np.tile([5.0, 80.0, 100.0], (COUNT, 1))
    assert swapped_columns(cuts, force, np.broadcast_to(np.eye(3), (COUNT, 3, 3)), "log.csv") == []

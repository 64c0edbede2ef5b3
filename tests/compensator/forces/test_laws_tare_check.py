"""What speaks for a tare and against it, each at its limit: forces that differ within it, moves at the air feed, witnesses."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from compensator.forces.tare_check import TaredLog, doubts
from compensator.forces.target_rows import TargetRows

ROWS = 4
NONE, ZERO = np.zeros((0, 3)), np.array([7.0, -20, 3])


def tared(
    mean: np.ndarray, scatter: float | Sequence[float] = 0.1, air: Sequence[int] = (), *, empty: Sequence[int] = (),
    before: np.ndarray = NONE, after: np.ndarray = NONE, stated: Sequence[float] | None = None,
) -> TaredLog:
    """Four rows at each target but the empty ones: its mean (N, 3), to and fro along z by its scatter (N,) [N]. What the
    sensor's zero is, is no matter."""
    count = len(mean)
    seen = np.delete(np.arange(count), list(empty))
    target = np.repeat(seen, ROWS)
    off = np.outer(np.tile([1.0, -1, 1, -1], len(seen)) * np.broadcast_to(scatter, (count,))[target], [0, 0, 1])
    return TaredLog("log.csv", ZERO + mean[target] + off, TargetRows(count, target, np.ones(len(target))),
                    np.isin(np.arange(count), air), ZERO + before, ZERO + after,
                    None if stated is None else ZERO + np.array(stated, dtype=float))


def along(axis: int, *values: float) -> np.ndarray:
    """Forces (n, 3) [N] along one axis."""
    return np.array(values)[:, None] * np.eye(3)[axis]


def said(log: TaredLog, *tare: tuple[int, int]) -> list[tuple[str, str]]:
    found = doubts(log, tare)
    assert all((one.level, one.file) == ("error", "log.csv") for one in found)
    assert all("--trust-tare" in one.hint for one in found)
    return [(one.code, one.message) for one in found]


@pytest.mark.parametrize(("odd", "largest", "scatter", "told"), [
    # 5 N; a fifth of the largest force; 8 standard errors of a mean of four, the usual one of all targets at least.
    (4.9, 10.0, 0.1, False), (5.1, 10.0, 0.1, True), (19.9, 100.0, 0.1, False), (20.1, 100.0, 0.1, True),
    (39.5, 100.0, 10.0, False), (40.5, 100.0, 10.0, True)])
@pytest.mark.parametrize("own", [1.0, 0.2])
def test_a_target_that_is_off_the_others_of_its_stretch_is_no_air(
    odd: float, largest: float, scatter: float, own: float, told: bool
) -> None:
    """Target 3 of the targets 1 to 4, behind which others cut; its own samples scatter as the others do, or less."""
    mean = along(1, 0, 0, 0, odd, 0, *[largest] * 7)
    log = tared(mean, np.where(np.arange(12) == 3, own * scatter, scatter), stated=(0, 0, 0))
    found = said(log, (1, 4))
    assert found == ([("CS3039", f"the targets 1 to 4 of --tare are not all in air: target 3 shows {odd:.1f} N more than the "
                       f"middle of them, the largest force of the log is {largest:.1f} N")] if told else [])


def test_the_standard_error_of_a_target_that_scatters_more_is_its_own() -> None:
    """41 N of 10 N an error are told, 5.5 of 7.5 are not."""
    mean = along(1, 0, 0, 0, 41, 0, *[100.0] * 7)
    assert said(tared(mean, 10.0, stated=(0, 0, 0)), (1, 4))
    assert not said(tared(mean, np.where(np.arange(12) == 3, 15.0, 10.0), stated=(0, 0, 0)), (1, 4))


def test_of_two_targets_that_differ_neither_is_named() -> None:
    [found] = said(tared(along(1, 0, 0, 40, *[100.0] * 7)), (1, 2))
    assert found == ("CS3039", "the targets 1 and 2 of --tare are not both in air: their forces are 40.0 N apart, the largest "
                     "force of the log is 80.0 N")
    [three] = said(tared(along(1, 0, 0, 0, 30, *[100.0] * 7)), (1, 3))
    assert "target 3 shows 30.0 N more than the middle" in three[1]


def test_a_tare_of_all_targets_differs_from_nothing() -> None:
    log = tared(along(1, 0, 50, 100), stated=(0, 0, 0))
    assert not said(log, (0, 2))
    assert "targets 0 and 1 of --tare are not both in air" in said(log, (0, 2), (0, 1))[0][1]


AIR = range(7)          # target 6 is left for a cut: 0 to 5 have air on either side


def of_air(bias: float, *others: float) -> np.ndarray:
    """A tare at target 0 that shows a bias along y, five air moves that show so much along x, and a cut."""
    return np.concatenate([along(1, bias), along(0, *others), along(1, *[300.0] * 6)])


@pytest.mark.parametrize(("bias", "spread", "scatter", "tare_scatter", "allowed"), [
    # 5 N; three times the middle distance of the air moves from their middle; three standard errors of four samples.
    (5.1, 0.0, 0.1, 0.1, 5.0), (11.4, 4.0, 0.1, 0.1, 12.0), (30.5, 0.0, 20.0, 20.0, 30.0), (50.0, 0.0, 20.0, 10.1, 30.0)])
def test_a_tare_that_a_quarter_of_the_air_moves_contradicts_is_no_air(
    bias: float, spread: float, scatter: float, tare_scatter: float, allowed: float
) -> None:
    """The second of five is a quarter of them; a tare that is quieter by more than a factor of two is what lies in the air."""
    places = np.array([-2, -1, 0, 1, 2]) * spread
    quiet = np.where(np.arange(12) == 0, tare_scatter, scatter)
    [found] = doubts(tared(of_air(bias, *places), quiet, AIR), [(0, 0)])
    off = np.hypot(bias, places)
    assert (found.code, found.message) == (
        "CS3039", f"the targets 0 to 0 of --tare are not in air: with their mean as the bias, {sum(off > allowed)} of 5 moves "
        f"at the air feed would show a force, {np.median(off):.1f} N in the middle, at most {allowed:.1f} N are drift and "
        "noise")
    assert "touches nothing, such as --tare 1:5; if" in found.hint


@pytest.mark.parametrize(("bias", "spread", "scatter", "tare_scatter"), [
    (4.9, 0.0, 0.1, 0.1), (11.2, 4.0, 0.1, 0.1), (29.5, 0.0, 20.0, 20.0), (50.0, 0.0, 20.0, 9.9)])
def test_a_tare_within_what_the_air_moves_show_is_air(
    bias: float, spread: float, scatter: float, tare_scatter: float
) -> None:
    quiet = np.where(np.arange(12) == 0, tare_scatter, scatter)
    assert not said(tared(of_air(bias, *(np.array([-2, -1, 0, 1, 2]) * spread)), quiet, AIR), (0, 0))


@pytest.mark.parametrize(("agree", "told"), [(1, True), (2, False)])
def test_two_of_five_air_moves_are_enough_to_agree(agree: int, told: bool) -> None:
    """Those that agree with the tare at 40 N along y."""
    mean = of_air(40.0, *[0.0] * 5)
    mean[[2, 4][:agree]] += [0, 40, 0]
    # The middle of them is that of the three others, and more than half of them stand there.
    assert bool(said(tared(mean, air=AIR), (0, 0))) == told


@pytest.mark.parametrize("bias", [5.1, 12.0, 50.0, 200.0])
def test_the_air_moves_that_are_named_may_be_taken(bias: float) -> None:
    """All but the first target, which is no air, so that no other air move is left to speak for them."""
    log = tared(of_air(bias, *[0.0] * 5), air=AIR)
    assert "such as --tare 1:5;" in doubts(log, [(0, 0)])[0].hint
    assert not said(log, (1, 5))
    # Where the last of them has a cut behind it, or one of them is no air move, they do not speak for themselves.
    assert not said(tared(of_air(50.0, *[0.0] * 5), air=[1, 2, 3, 4, 5, 6]), (1, 5))
    for air in ([1, 2, 3, 4, 5], [1, 2, 4, 5, 6]):
        assert [code for code, _ in said(tared(of_air(50.0, *[0.0] * 5), air=air), (1, 5))] == ["CS3066"]


def test_air_moves_are_named_up_to_the_first_that_is_none() -> None:
    """Moves 1, 2, 3 and 8 to 11 have air on either side; what the tare names is no other."""
    mean = np.concatenate([along(1, 40), np.zeros((3, 3)), along(1, *[300.0] * 4), np.zeros((4, 3))])
    [found] = doubts(tared(mean, air=[0, 1, 2, 3, 4, 8, 9, 10, 11]), [(0, 0)])
    assert "such as --tare 1:3;" in found.hint
    assert "7 of 7 moves at the air feed would show a force, 40.0 N in the middle" in found.message


def slot(tare: float, others: float, count: int = 12) -> np.ndarray:
    """The targets 5 and 6 show so much along y, all others what they show; the tare is not at an end."""
    return along(1, *[tare if k in (5, 6) else others for k in range(count)])


ENDS = (0, 11)
SHOW = ("the targets 5 to 6 of --tare are not in air: with their mean as the bias, {} would show a force of {:.1f} N, at most "
        "{:.1f} N are drift and noise")


@pytest.mark.parametrize(("stated", "others", "told"), [
    (4.9, 0.0, ""), (5.1, 0.0, SHOW.format("the bias stated in cell.yaml", 5.1, 5.0)),
    (9.9, 100.0, ""), (10.1, 100.0, SHOW.format("the bias stated in cell.yaml", 10.1, 10.0))])
def test_a_stated_bias_agrees_to_five_newtons_and_a_tenth_of_the_largest_force(stated: float, others: float, told: str) -> None:
    """Of a log that begins and ends in the cut, or nowhere."""
    found = said(tared(slot(0.0, others), 1.0, empty=ENDS, stated=(0, stated, 0)), (5, 6))
    assert found == ([("CS3039", told)] if told else [])


@pytest.mark.parametrize(("rows", "newton", "told"), [
    (3, 40.0, "CS3039"), (2, 40.0, "CS3066"), (3, 4.0, ""), (2, 4.0, "CS3066")])
@pytest.mark.parametrize("side", ["before", "after"])
def test_three_rows_beside_the_program_witness_what_lies_in_the_air(side: str, rows: int, newton: float, told: str) -> None:
    """At 40 N beside a tare that shows nothing, in a log of 100 N; fewer say nothing, and then nothing shows it."""
    beside = {side: np.repeat(along(1, newton), rows, axis=0)}
    found = said(tared(slot(0.0, 100.0), 1.0, empty=ENDS, **beside), (5, 6))
    named = SHOW.format(f"the 3 rows of the log {side} the program", newton, 10.0)
    assert found == ([] if not told else [("CS3039", named)] if told == "CS3039" else [(
        "CS3066", "nothing in the log shows that the targets 5 to 6 of --tare are in air: no other sample of the log is in air "
        "for certain")])


@pytest.mark.parametrize(("newton", "scatter", "told"), [
    (20.0, 11.4, "CS3039"), (20.0, 11.7, "CS3066"), (0.0, 5.7, ""), (0.0, 5.8, "CS3066")])
def test_a_witness_is_as_sure_as_its_rows_scatter(newton: float, scatter: float, told: str) -> None:
    """By three standard errors of both means, of three rows that scatter by so much and of the tare's eight, by 1 N: 20 N are
    sure of 11.5 N, and of 5.8 N are 10, twice what is allowed of a log without a force."""
    rows = along(1, *[newton] * 3) + np.array([[1.0, 0, 0], [-1, 0, 0], [0, 0, 0]]) * np.sqrt(1.5) * scatter
    found = said(tared(slot(0.0, 0.0), 1.0 if newton else 0.1, empty=ENDS, before=rows), (5, 6))
    assert [code for code, _ in found] == ([told] if told else [])


@pytest.mark.parametrize(("scatter", "told"), [(4.9, ""), (5.1, "CS3066")])
def test_a_tare_that_is_calmer_by_half_than_the_others_is_air(scatter: float, told: str) -> None:
    quiet = np.where(np.isin(np.arange(12), (5, 6)), scatter, 10.0)
    assert [code for code, _ in said(tared(slot(0.0, 0.0), quiet, empty=ENDS), (5, 6))] == ([told] if told else [])


@pytest.mark.parametrize(("scatter", "usual", "others", "told"), [
    (9.9, 9.9, 0.0, "CS3066"), (10.1, 10.1, 0.0, "CS3039"), (14.9, 14.9, 100.0, "CS3066"), (15.1, 15.1, 100.0, "CS3039"),
    (15.1, 30.0, 100.0, "CS3039"), (15.1, 30.4, 100.0, "")])
def test_a_tare_as_restless_as_a_cut_is_one(scatter: float, usual: float, others: float, told: str) -> None:
    """By 10 N, by 0.15 of the largest force, and by half of what the others do; of less it is the calmer."""
    restless = np.where(np.isin(np.arange(12), (5, 6)), scatter, usual)
    found = said(tared(slot(0.0, others), restless, empty=ENDS), (5, 6))
    assert [code for code, _ in found] == ([told] if told else [])
    if told == "CS3039":
        assert found == [("CS3039", f"the targets 5 to 6 of --tare are not in air: their samples scatter by {scatter:.1f} N, "
                          "as those of a cut do")]


@pytest.mark.parametrize(("tare", "empty", "taken"), [
    ((1, 2), [0], True), ((2, 3), [], False), ((9, 10), [11], True), ((8, 9), [], False), ((1, 2), [10, 11], False),
    ((9, 10), [0, 1], False)])
def test_a_program_begins_and_ends_in_air_where_the_log_reaches_over_both(
    tare: tuple[int, int], empty: list[int], taken: bool
) -> None:
    """The first two targets or the last two; nothing else tells, of a log without a force."""
    mean = along(1, *[0.0] * 12)
    # What lies at the ends agrees with the tare by itself: it is left out here, or far away from it as the ends of a cut are.
    found = said(tared(mean, 10.0, empty=[*empty, *{0, 11} - set(empty)] if taken else empty or ENDS), tare)
    assert [code for code, _ in found] == ([] if taken else ["CS3066"])


@pytest.mark.parametrize(("near", "taken"), [(71.0, True), (69.0, False)])
def test_a_tare_at_an_end_is_air_where_the_bulk_of_the_log_is_as_far_from_it_as_any(near: float, taken: bool) -> None:
    """A log that ends within the cut: a quarter of its targets is over 0.7 of the largest force from the tare, or is not."""
    mean = np.concatenate([along(1, 0, 0), along(1, near, near, near, 100, 100, 100, 100), np.zeros((3, 3))])
    found = said(tared(mean, 10.0, empty=[9, 10, 11]), (0, 1))
    assert [code for code, _ in found] == ([] if taken else ["CS3066"])


def test_witnesses_that_agree_with_each_other_stand_together() -> None:
    """The first target and the rows behind the program at 50 N, the stated bias, alone, at 20: against a tare at nothing. Their
    mean is by their rows, four and three."""
    mean = slot(0.0, 100.0)
    mean[0], mean[11] = [0, 50, 0], [0, 100, 0]
    log = tared(mean, 1.0, empty=[11], after=along(1, 57, 57, 57), stated=(0, 20, 0))
    assert said(log, (5, 6)) == [(
        "CS3039", SHOW.format("the 3 rows of the log after the program and the first target", 53.0, 10.0))]


@pytest.mark.parametrize(("air", "name"), [((), ""), ((7, 8), "target 7, an air move,")])
def test_one_air_move_is_a_witness_where_there_is_air_on_either_side(air: tuple[int, ...], name: str) -> None:
    mean = slot(0.0, 100.0)
    mean[7] = [0, 40, 0]
    found = said(tared(mean, 1.0, air, empty=ENDS), (5, 6))
    assert found == ([("CS3039", SHOW.format(name, 40.0, 10.0))] if name else [(
        "CS3066", "nothing in the log shows that the targets 5 to 6 of --tare are in air: no other sample of the log is in air "
        "for certain")])


def test_stretches_of_a_tare_witness_for_each_other_and_against() -> None:
    """Two that agree are taken; of two that do not each is told of the other, once however often it is named."""
    mean = slot(0.0, 100.0)
    mean[8] = [0, 4, 0]
    assert not said(tared(mean, 10.0, empty=ENDS), (5, 6), (8, 8))
    mean[8] = [0, 40, 0]
    one, other = said(tared(mean, 10.0, empty=ENDS), (5, 6), (8, 8), (5, 6))
    assert one == ("CS3039", SHOW.format("the targets 8 to 8 of --tare", 40.0, 10.0))
    assert other == ("CS3039", "the targets 8 to 8 of --tare are not in air: with their mean as the bias, the targets 5 to 6 "
                     "of --tare would show a force of 40.0 N, at most 6.0 N are drift and noise")


@pytest.mark.parametrize(("witness", "others", "scatter", "told"), [
    (40.0, 79.0, 1.0, "CS3066"), (40.0, 81.0, 1.0, "CS3039"), (-40.0, 41.0, 0.4, "CS3066"), (-40.0, 39.0, 0.4, "CS3039")])
def test_the_bulk_of_the_targets_is_twice_as_far_from_air_as_from_a_point_in_the_cut(
    witness: float, others: float, scatter: float, told: str
) -> None:
    """Where it is so of the tare, at nothing, that is as much for it as one witness is against it; of the witness, it is more
    than that a calm tare is calm."""
    quiet = np.where(np.isin(np.arange(12), (5, 6)), scatter, 1.0)
    found = said(tared(slot(0.0, others), quiet, empty=ENDS, stated=(0, witness, 0)), (5, 6))
    assert [code for code, _ in found] == [told]

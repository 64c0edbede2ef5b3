"""A channel that stands still is found where it does, however the samples come in blocks."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from compensator.forces.health import Health
from compensator.forces.packet_counter import PacketCounter
from compensator.forces.source import Samples
from identification.common.findings import Finding

COUNT = 4000


@pytest.mark.parametrize("seed", range(6))
def test_a_run_over_the_borders_of_blocks_has_its_first_line_and_its_length(seed: int) -> None:
    """Readings in steps, which repeat by chance now and then, and one channel held: its first line, how long, by hand."""
    rng = np.random.default_rng(seed)
    load = np.round(rng.normal(0, 30.0, (COUNT, 3))) + np.array([400.0, -700.0, 200.0])
    first, length, axis = int(rng.integers(500, 3000)), int(rng.integers(150, 600)), int(rng.integers(3))
    load[first:first + length, axis] = load[first, axis]
    load[first - 1, axis], load[first + length, axis] = load[first, axis] + [1.0, -1.0]
    told = []
    for most in (COUNT + 1, 700, 60):
        health, start = Health("a.csv", (None, None), None), 0
        while start < COUNT:
            stop = start + int(rng.integers(most // 2, most)) if most < COUNT else COUNT
            lines = np.arange(COUNT)[start:stop] + 2
            health.look(Samples(load[start:stop], np.zeros((len(lines), 0)), None, None, lines))
            start = stop
        told.append([(finding.code, finding.line, finding.message) for finding in health.findings()])
        (code, line, message), = told[-1]
        assert (code, line) == ("CS3024", first + 2)
        assert f"{length} samples" in message
    assert told[1:] == told[:1] * 2


def moving(count: int, channels: int = 3) -> np.ndarray:
    """Readings none of which comes twice, far from zero."""
    rng, about = np.random.default_rng(count), np.array([400.0, -700, 200, 9, 8, 7])[:channels]
    return np.asarray(np.cumsum(rng.normal(0, 2, (count, channels)), axis=0) + about)


def looked(load: np.ndarray, most: int = 10**6, **stated: Any) -> tuple[Health, np.ndarray, list[Finding]]:
    """The log in blocks of so many, its samples in lines 2, 3 ...; their flags."""
    health = Health("a.csv", stated.pop("limit", (None, None)), stated.pop("period", None))
    time, sequence, flags = stated.pop("time", None), stated.pop("sequence", None), []
    for start in range(0, len(load), most):
        part = slice(start, start + most)
        lines = np.arange(len(load))[part] + 2
        flags.append(health.look(Samples(load[part], np.zeros((len(lines), 0)), None if time is None else time[part],
                                         None if sequence is None else sequence[part], lines))[0])
    health.close()
    return health, np.concatenate(flags), health.findings()


def said(load: np.ndarray, most: int = 10**6, **stated: Any) -> list[tuple[str, str, int | None, str]]:
    return [(one.code, one.level, one.line, one.message) for one in looked(load, most, **stated)[2]]


STOOD = "fy_n stood still while others moved: {} samples, the longest run {}"


@pytest.mark.parametrize("most", [10**6, 50])
@pytest.mark.parametrize(("length", "others", "value", "told"), [
    (64, 64, 5.0, True), (63, 63, 5.0, False), (100, 50, 5.0, True), (100, 49, 5.0, False), (200, 200, 0.0, False)])
def test_a_run_is_one_of_64_readings_while_another_channel_moves_for_half_of_it(
    most: int, length: int, others: int, value: float, told: bool
) -> None:
    """From reading 300 on; the others stand still behind the first `others` of its repeats. Zeros may be no reading."""
    load = moving(1000)
    load[300:300 + length, 1] = value
    still = slice(300 + others, 300 + length)
    load[still] = load[300 + others] if others < length else load[still]
    load[300 + length] = load[299 + length] + 1.0
    found = [one for one in said(load, most) if "fy_n" in one[3]]
    assert found == ([("CS3024", "warning", 302, STOOD.format(length, length))] if told else [])


def test_runs_are_counted_and_the_longest_told() -> None:
    load = moving(3000)
    for start, length in ((400, 70), (900, 150), (2000, 80)):
        load[start:start + length, 1] = load[start, 1]
    health, _, _ = looked(load, 170)
    assert said(load, 170) == [("CS3024", "warning", 402, STOOD.format(300, 150))]
    # Rows of ten samples that hold one of these, or one within five of them, hold no force.
    number, weight = np.arange(0, 3000, 10), np.full(300, 10.0)
    for beside in (0, 5, 13):
        bad = np.zeros(3000, dtype=bool)
        for start, length in ((400, 70), (900, 150), (2000, 80)):
            bad[max(start - beside, 0):start + length + beside] = True
        assert health.no_forces(number, weight, beside).tolist() == bad.reshape(300, 10).any(axis=1).tolist()
    # Of single samples each is told.
    assert np.flatnonzero(health.no_forces(np.arange(3000), np.ones(3000), 0)).tolist() == [
        *range(400, 470), *range(900, 1050), *range(2000, 2080)]


@pytest.mark.parametrize(("beside", "told"), [(200, True), (199, False)])
def test_a_run_is_told_beside_two_hundred_other_readings(beside: int, told: bool) -> None:
    load = moving(beside + 100)
    load[50:150, 1] = 3.0
    assert bool([one for one in said(load) if "stood still" in one[3]]) == told


@pytest.mark.parametrize(("again", "told"), [(51, True), (52, False)])
def test_a_channel_that_repeats_itself_anyhow_has_not_stood_still(again: int, told: bool) -> None:
    """A thousand readings beside a run of a hundred, of which so many repeat the one before: a twentieth may."""
    load = moving(1100)
    load[900:1000, 1] = 3.0
    where = 10 + 16 * np.arange(again)
    load[where, 1] = load[where - 1, 1]
    health, _, found = looked(load)
    assert bool([one for one in found if "fy_n stood still" in one.message]) == told
    assert health.no_forces(np.arange(1100), np.ones(1100), 0).sum() == 100 * told


@pytest.mark.parametrize("most", [10**6, 97])
@pytest.mark.parametrize(("turns", "told"), [(0.25, True), (0.15, False)])
def test_readings_of_all_channels_that_stood_still_are_a_logger_s_where_it_has_noise(
    most: int, turns: float, told: bool
) -> None:
    """A hundred readings repeated, beside 2000 whose sum turns up and down at so many of them; a fifth is noise."""
    step = np.ones(2101)
    count, at = 0, 0
    while at < 2100:            # up by two, down by one, as often as is asked for
        if count < turns * at:
            step[at] = -step[at - 1]
            count += 1
        else:
            step[at] = step[at - 1] if at else 1.0
        at += 1
    load = np.column_stack([5000 + np.cumsum(step), 0 * step + 50, 0 * step + 70]) + np.zeros((2101, 1))
    load[1000:1100] = load[1000]
    load[:, 1] += np.arange(2101) * 1e-3
    load[1000:1100, 1] = load[1000, 1]
    found = [one for one in said(load, most) if "together" in one[3]]
    assert [one[:3] for one in found] == ([("CS3024", "warning", 1002)] if told else [])
    assert all(one[3] == "all channels stood still together: 100 samples, the longest run 100" for one in found)


@pytest.mark.parametrize("most", [10**6, 50])
@pytest.mark.parametrize(("side", "run", "axis", "told"), [
    (1, 3, 0, True), (1, 2, 1, False), (1, 3, 5, True), (-1, 3, 2, True), (-1, 2, 1, False), (-1, 3, 3, True)])
def test_three_readings_at_the_end_of_all_are_a_clipped_peak(most: int, side: int, run: int, axis: int, told: bool) -> None:
    """Two such peaks; a reading by itself at the end is none, nor are runs before the end was reached."""
    load = moving(1000, 6)
    end = side * 900.0
    load[100:104, axis] = side * 800.0
    load[[300, 600], axis] = end
    load[450:450 + run, axis] = load[710:710 + run, axis] = end
    health, flags, _ = looked(load, most)
    name = ("fx_n", "fy_n", "fz_n", "mx_nm", "my_nm", "mz_nm")[axis]
    expected = [("CS3023", "warning", 452, f"{name}: {2 * run} samples in runs of exactly {end:g}, its "
                 f"{'largest' if side > 0 else 'smallest'} value: saturated")]
    assert said(load, most) == (expected if told else [])
    bad = np.isin(np.arange(1000), [*range(450, 450 + run), *range(710, 710 + run)]) & told
    assert health.unsound(flags, np.arange(1000)).tolist() == bad.tolist()


@pytest.mark.parametrize("most", [10**6, 50])
@pytest.mark.parametrize(("count", "again", "told"), [(300, 10, True), (299, 10, False), (300, 12, False)])
def test_a_channel_that_stands_still_at_its_end_is_counted_once(most: int, count: int, again: int, told: bool) -> None:
    """A hundred readings at the largest value of all, beside two hundred of which a twentieth repeat the one before."""
    load = moving(count)
    load[100:200, 1] = 900.0
    where = 2 + 5 * np.arange(again)
    load[where, 1] = load[where - 1, 1]
    assert said(load, most) == ([
        ("CS3023", "warning", 102, "fy_n: 100 samples in runs of exactly 900, its largest value: saturated"),
        ("CS3024", "warning", 102, STOOD.format(100, 100))] if told else [])


@pytest.mark.parametrize(("still", "told"), [(1, True), (2, False)])
def test_a_peak_at_which_all_channels_stand_still_is_none(still: int, told: bool) -> None:
    """Of the two repeats in it one has another channel move."""
    load = moving(1000)
    load[500:503, 0] = 3000.0
    load[501:501 + still, 1:] = load[500, 1:]
    assert bool([one for one in said(load) if one[0] == "CS3023"]) == told


@pytest.mark.parametrize(("limit", "line", "many"), [
    ((720.0, None), None, 0), ((650.0, None), 102, 3), ((None, 9.5), 402, 2), ((650.0, 9.5), 102, 5)])
def test_what_is_beyond_the_stated_range_is_told(limit: tuple[float | None, float | None], line: int | None, many: int) -> None:
    """Forces of 650 N and more on any axis, moments of 9.5 Nm and more."""
    rng = np.random.default_rng(2)
    load = rng.uniform(-5, 5, (1000, 6))
    load[[100, 200], [0, 2]], load[300, 1] = [650.0, -700.0], 680.0
    load[[400, 401], [3, 5]] = [-9.5, 20.0]
    health, flags, _ = looked(load, 333, limit=limit)
    found = [one for one in said(load, 333, limit=limit) if "range" in one[3]]
    assert found == ([("CS3023", "warning", line, f"{many} samples at or beyond the sensor's range stated in cell.yaml")]
                     if many else [])
    expected = [100, 200, 300] * (limit[0] == 650.0) + [400, 401] * (limit[1] is not None)
    assert np.flatnonzero(health.unsound(flags, np.arange(1000))).tolist() == expected


def test_just_under_the_stated_range_is_within_it() -> None:
    load = moving(500)
    load[100, 0] = 999.9
    assert said(load, limit=(1000.0, None)) == []
    load[100, 0] = 1000.0
    assert said(load, limit=(1000.0, None))[0][3].startswith("1 sample at or beyond")


@pytest.mark.parametrize("most", [10**6, 100])
@pytest.mark.parametrize(("wide", "lost", "level"), [(1.4, 0, ""), (1.6, 1, "note"), (3.0, 2, "warning"), (2.4, 1, "note")])
def test_a_step_in_time_of_over_one_and_a_half_samples_is_a_gap(most: int, wide: float, lost: int, level: str) -> None:
    """Of 1000 samples; a thousandth of them and fewer are a note."""
    step = np.full(1000, 2e-3)
    step[500] = wide * 2e-3
    found = said(moving(1000), most, time=np.cumsum(step), period=2e-3)
    assert found == ([("CS3025", level, 502, f"{lost} sample{'s' * (lost > 1)} of {1000 + lost} lost in 1 gap, the longest "
                       f"{2e-3 * wide:.3g} s")] if level else [])


@pytest.mark.parametrize("most", [10**6, 100])
def test_numbers_that_count_samples_tell_what_is_lost_and_what_stands_twice(most: int) -> None:
    """Three lost and one, two repeated; beside times that show gaps the loss is not counted twice."""
    step = np.ones(1000)
    step[[200, 300, 600, 700]] = [4, 2, 0, 0]
    sequence = np.cumsum(step)
    lost = ("CS3025", "warning", 202, "4 samples of 1004 lost in 2 gaps")
    twice = ("CS3025", "warning", 602, "2 samples with the sequence number of the one before")
    assert said(moving(1000), most, sequence=sequence) == [lost, twice]
    time = np.arange(1000) * 2e-3
    assert said(moving(1000), most, sequence=sequence, time=time, period=2e-3) == [twice]
    assert said(moving(1000), most, sequence=sequence, time=time) == [lost, twice]


@pytest.mark.parametrize("most", [10**6, 3, 4])
@pytest.mark.parametrize(("counts", "taken"), [
    ([5, 6, 7, 8, 9], [0, 1, 2, 3, 4]), ([5, 6, 9, 10, 11, 12], [0, 1, 4, 5, 6, 7]),
    ([5, 6, 7, 7, 7, 8, 9, 10], [0, 1, 2, 2, 2, 3, 4, 5]),
    # One that came late, with the packet that overtook it; a counter that ran over, or was set anew; one of every third.
    ([5, 6, 7, 9, 8, 10, 11, 12], [0, 1, 2, 4, 4, 5, 6, 7]), ([254, 255, 0, 1, 3, 4], [0, 1, 2, 3, 5, 6]),
    ([200, 201, 202, 203, 104, 105], [0, 1, 2, 3, 3, 3]), ([200, 201, 202, 203, 103, 104], [0, 1, 2, 3, 4, 5]),
    ([5, 8, 11, 14, 23, 26, 29, 32], [0, 1, 2, 3, 4, 5, 6, 7])])
def test_a_counter_tells_when_a_sample_was_taken(counts: list[int], taken: list[int], most: int) -> None:
    """In samples from the first one on, however the rows come in blocks."""
    counter, found = PacketCounter(), []
    for start in range(0, len(counts), most):
        part = np.array(counts[start:start + most], dtype=float)
        found += (start + np.arange(len(part)) + counter.read(part)[1]).tolist()
    assert found == taken


@pytest.mark.parametrize("most", [10**6, 100])
def test_time_that_runs_back_is_told_with_how_often(most: int) -> None:
    time = np.arange(1000) * 2e-3
    time[[300, 700]] -= 4e-3
    assert said(moving(1000), most, time=time) == [
        ("CS3025", "warning", 302, "time runs back 2 times: more than one log in this file, or a clock that was set")]


@pytest.mark.parametrize(("columns", "told"), [
    ((0, 1), ["fx_n and fy_n"]), ((0, 2), ["fx_n and fz_n"]), ((1, 2), ["fy_n and fz_n"]), ((3, 4), [])])
def test_two_forces_that_are_the_same_are_told(columns: tuple[int, int], told: list[str]) -> None:
    load = moving(400, 6)
    load[:, columns[1]] = load[:, columns[0]]
    assert said(load, 77) == [("CS3024", "warning", None, f"{pair} are the same in all 400 samples") for pair in told]
    assert said(load[:200], 77) == [("CS3024", "warning", None, f"{pair} are the same in all 200 samples") for pair in told]
    assert said(load[:199], 77) == []
    load[77, columns[1]] += 1.0
    assert said(load, 77) == []


@pytest.mark.parametrize(("channel", "value", "count", "level"), [
    (2, 4.5, 200, "warning"), (2, 4.5, 199, ""), (2, 0.0, 200, "warning"), (4, 0.0, 200, "note"), (4, 3.0, 200, "warning")])
def test_a_channel_of_one_value_is_dead(channel: int, value: float, count: int, level: str) -> None:
    """A moment of zeros may just not be there; one of three forces that a sensor with noise reads is lost."""
    load = moving(count, 6)
    load[:, channel] = value
    name = {2: "fz_n", 4: "my_nm"}[channel]
    assert said(load, 77) == ([("CS3024", level, 2, f"{name} is {value:g} in all {count} samples")] if level else [])


def test_two_forces_of_zeros_are_of_a_sensor_of_one_axis() -> None:
    load = moving(400)
    load[:, 1:] = 0.0
    assert [(one[1], one[3].split(" in all")[0]) for one in said(load)] == [("note", "fy_n is 0"), ("note", "fz_n is 0")]

"""A force log with time alone: placed where it was cut, or refused.

The truth is a clock made in the benchmark: the sample's log with its positions taken away, shifted, at another override, slowed
in corners by a law that is not the package's; and a raster of passes that are alike.
"""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from benchmarks.foreign_logs import foreign, played
from benchmarks.time_placement import clock, other_lengths, passes, passes_log, raster, raster_log, stood_still
from benchmarks.time_placement import sample as sample_once
from compensator.correction.correct import Corrected
from compensator.correction.files import Inputs, predict_files
from compensator.correction.settings import Settings
from compensator.forces import time_alignment
from compensator.forces.alignment_regression import binned, plateau_share
from compensator.forces.program_time import ProgramTime, air_moves, program_time
from compensator.forces.time_alignment import TimeAlignment, align
from compensator.forces.time_log import _not_believed, _placed
from compensator.path.robot_path import robot_path
from compensator.rapid import read_rapid
from identification.common.findings import CompstiffError
from identification.model.cell import read_cell
from tests.support import compstiff

sample_log, program_time = cache(sample_once), cache(program_time)


@pytest.mark.parametrize(("override", "shift", "slowing", "first", "last"), [
    pytest.param(1.1, -4.0, 0.7, 0.0, 1.0, marks=pytest.mark.long), (0.6, 40.0, 0.0, 0.1, 0.7)])
def test_the_sample_is_placed_within_millimetres(
    override: float, shift: float, slowing: float, first: float, last: float
) -> None:
    plan, force, place = sample_log()
    program = program_time(plan)
    part = slice(int(first * len(place)), int(last * len(place)))
    logged = clock(plan, place, override, shift, slowing)[part]
    alignment = align(program, logged, force[part])
    assert alignment.believed, (alignment.score, alignment.share)
    error = 1e3 * np.abs(alignment.length - place[part])
    assert np.isnan(error).mean() < 0.01
    assert np.nanmedian(error) < 4
    assert np.nanquantile(error, 0.95) < 15
    # Late or early by planned time, against the stated sigma.
    late = np.interp(alignment.length, program.length, program.time) - np.interp(place[part], program.length, program.time)
    good = ~np.isnan(alignment.length)
    assert np.mean(np.abs(late[good]) <= 1.96 * alignment.std[good]) >= 0.9
    assert np.median(alignment.std) < 0.3


# Long: logs of other jobs and of another raster are refused below.
@pytest.mark.long
def test_another_programs_log_is_not_believed() -> None:
    plan, force, place = sample_log()
    program = program_time(plan)
    logged = clock(plan, place, 0.9, 10.0, 0.5)
    assert not align(other_lengths(program, np.random.default_rng(5)), logged, force).believed


# Long: each of its three doubts refuses alone in test_each_doubt_alone_refuses, and what it explains as one plateau is held
# in test_the_best_plateau_is_the_best_of_all.
@pytest.mark.long
def test_one_long_cut_of_another_job_has_no_rival_and_is_refused() -> None:
    """A stretched turning log: air, 820 N in one direction for 264 s, air. It explains four fifths of its own variance and is
    alone in its place, so that nothing was compared; the program's air moves would lie under 820 N."""
    plan, _, _ = sample_log()
    rng = np.random.default_rng((77, 13))
    time, force = played([(50.0, np.zeros(3)), (264.0, np.array([[0.6, 0.0, 0.8], [0.66, 0.0, 0.88]])), (48.0, np.zeros(3))])
    alignment = align(program_time(plan), time, 820 * force + rng.normal(0, 5, force.shape))
    assert alignment.share > 0.5
    assert alignment.plateau > 0.97
    assert alignment.in_air > 0.9
    assert alignment.spread_on_cuts > 20e-3
    assert not alignment.believed
    said = "; ".join(alignment.against)
    assert "hardly better" in said
    assert "force on air moves" in said
    assert "1 sigma of the place" in said


@pytest.mark.parametrize(("score", "share", "plateau", "in_air", "spread", "override", "words"), [
    (np.inf, 0.9, 0.1, 0.05, 3e-3, 1.0, "no other place"), (40.0, 0.9, 0.85, 0.05, 3e-3, 1.0, "hardly better"),
    (40.0, 0.9, 0.1, 0.6, 3e-3, 1.0, "60 % of that on cuts"), (40.0, 0.9, 0.1, 0.05, 32e-3, 1.0, "32 mm"),
    (40.0, 0.9, 0.1, 0.05, 3e-3, 0.38, "38 %"), (40.0, 0.9, 0.1, np.nan, 3e-3, 1.0, "")])
def test_each_doubt_alone_refuses(score: float, share: float, plateau: float, in_air: float, spread: float, override: float,
                                  words: str) -> None:
    """A log without air moves in it has no force there to speak against it."""
    alignment = TimeAlignment(np.zeros(1), 0.0, override, 0.0, score, share, 5.0, (), plateau, in_air, np.zeros(1), np.zeros(1),
                              spread)
    assert alignment.believed is not bool(words)
    assert words in "; ".join(alignment.against)
    assert len(alignment.against) == bool(words)


def test_stretches_whose_force_is_another_refuse() -> None:
    """One may be, such as a pass over air; two are not."""
    def with_odd(*odd: tuple[float, float]) -> TimeAlignment:
        return TimeAlignment(np.zeros(1), 0.0, 1.0, 0.0, 40.0, 0.9, 5.0, odd, 0.1, 0.05, np.zeros(1), np.zeros(1), 3e-3)
    assert with_odd((10.0, 14.0)).believed
    assert "in 2 stretches" in "; ".join(with_odd((10.0, 14.0), (20.0, 24.0)).against)


@pytest.mark.parametrize(("count", "words"), [
    (2, "in 2 stretches the force does not follow the program, at most 1 may be so (targets 1 to 3, 3 to 5)"),
    (6, "at most 1 may be so (targets 1 to 3, 3 to 5, 5 to 7, 7 to 9, 9 to 9 ...)")])
@pytest.mark.parametrize("covered", [1.0, 0.5])
def test_stretches_that_refuse_are_named_by_their_targets(count: int, words: str, covered: float) -> None:
    """Of a program of ten targets a second apart, beside whatever else refuses; behind the last target there is none."""
    program = ProgramTime(np.arange(10.0), np.arange(10.0), np.zeros(10, bool), np.zeros(10, int), np.zeros((10, 3)))
    odd = tuple((0.5 + 2 * k, 2.5 + 2 * k) for k in range(count))
    alignment = TimeAlignment(np.zeros(1), 0.0, 1.0, 0.0, 40.0, 0.9, 5.0, odd, 0.1, 0.05, np.zeros(1), np.zeros(1), 3e-3,
                              leaps=((4.0, -1.0),) if covered < 1 else (), covered=covered)
    log: Any = SimpleNamespace(place=np.arange(10.0), source="log.csv")
    path: Any = SimpleNamespace(toolpath=SimpleNamespace(source="part.mod"))
    found = _not_believed(log, path, program, alignment)
    assert (found.code, found.level, found.file) == ("CS3061", "error", "log.csv")
    assert words in found.message
    assert ("50 % of the program alone" in found.message) == (covered < 1)


@pytest.mark.parametrize(("rival", "words"), [(5.25, "score 41 against the best other place 5.2 s away"),
                                              (np.inf, "and no other place is possible")])
def test_how_surely_a_log_is_placed_by_time_is_told_in_its_units(rival: float, words: str) -> None:
    """Half of the places are known to 0.4 mm, all but a twentieth to 2.5 mm; 1 sigma of a time is 20 ms."""
    spread = np.r_[np.full(51, 0.4e-3), np.full(46, 2.5e-3), np.full(3, 9e-3), np.full(20, np.nan)]
    alignment = TimeAlignment(np.zeros(120), 7.5, 0.85, 0.4, 41.2 if rival < 10 else np.inf, 0.912, rival, (), 0.1, 0.05,
                              np.full(120, 0.02), spread, 3e-3)
    log: Any = SimpleNamespace(source="log.csv")
    said = _placed(log, alignment)
    assert (said.code, said.level, said.file) == ("CS3064", "warning", "log.csv")
    assert said.message == (
        "placed by time alone: the program starts at 7.50 s of the log's clock, override 85.0 %, stretches slip by up to 0.40 "
        f"s; 91 % of the force follows the program, {words}; 1 sigma of a sample's place is up to 2.5 mm, of half of them 0.4 "
        "mm, and of its time 0.020 s")


def test_the_best_plateau_is_the_best_of_all() -> None:
    """Against least squares for every pair of edges."""
    rng = np.random.default_rng(0)
    force = rng.standard_normal((30, 3))
    force[7:19] += [2, 0, -1]
    bins = binned(np.arange(30.0), force, 1.0)
    energy, best = np.sum((force - force.mean(axis=0)) ** 2), 0.0
    for first in range(30):
        for last in range(first + 1, 31):
            inside = (np.arange(30) >= first) & (np.arange(30) < last)
            design = np.column_stack([np.ones(30), inside])
            left = force - design @ np.linalg.lstsq(design, force, rcond=None)[0]
            best = max(best, 1 - np.sum(left**2) / energy)
    assert plateau_share(bins) == pytest.approx(best)


@pytest.mark.parametrize("begun", [1.3, 1000.0, 36_000.7])
def test_when_the_clock_began_moves_no_sample_to_another_bin(begun: float) -> None:
    time, force = np.arange(600) / 100, np.arange(1800.0).reshape(600, 3)
    # Two samples a bin, the first of which lies on its edge.
    here, there = binned(time, force, 0.02), binned(time + begun, force, 0.02)
    np.testing.assert_array_equal(here.force, force.reshape(300, 2, 3).mean(axis=1))
    np.testing.assert_array_equal(there.force, here.force)


@pytest.mark.parametrize(("job", "seed"), [
    pytest.param("turning", 21, marks=pytest.mark.long), pytest.param("one cut", 22, marks=pytest.mark.long),
    ("pocketing", 23), pytest.param("drilling", 24, marks=pytest.mark.long)])
def test_logs_of_other_jobs_are_refused(job: str, seed: int) -> None:
    """Stretched, cut, scaled; the benchmark has the figures over many."""
    program = raster()
    assert not align(program, *foreign(job, program.duration, np.random.default_rng(seed))).believed


def test_a_program_of_many_passes_is_seen_pass_by_pass(monkeypatch: pytest.MonkeyPatch) -> None:
    """As few bins for forty passes as otherwise for a thousand: three a pass do not tell its ends from the air."""
    monkeypatch.setattr(time_alignment, "FINE", 120)
    program = passes(40, 4, np.random.default_rng(7))
    time, force, place = passes_log(program, np.random.default_rng(9))
    alignment = align(program, time, force)
    assert alignment.believed, alignment.against
    assert 1e3 * np.nanmedian(np.abs(alignment.length - place)) < 2


# Long: a shorter stop is noticed below, and stretches whose force is another refuse above.
@pytest.mark.long
def test_a_program_that_stood_still_is_noticed() -> None:
    """Six seconds in air after a tenth of the program: most of it fits, the passes before would be one pass off."""
    plan, force, place = sample_log()
    program = program_time(plan)
    logged = clock(plan, place, 0.9, 5.0, 0.3)
    time, values, _ = stood_still(program, logged, force, place, 0.1, 6.0)
    alignment = align(program, time, values)
    assert len(alignment.odd) > 1
    assert not alignment.believed


def test_a_stop_that_the_slips_took_up_is_noticed() -> None:
    """Three seconds in the air at four tenths: it was placed at a score of 39, a ninth of the samples over 10 mm off."""
    plan, force, place = sample_log()
    program = program_time(plan)
    time, values, _ = stood_still(program, clock(plan, place, 0.9, 5.0, 0.3), force, place, 0.4, 3.0)
    alignment = align(program, time[::10], values[::10])
    [(at, lost)] = alignment.leaps
    # What stands in the program's own time goes by 0.9 of it, and a little less in its corners.
    assert lost == pytest.approx(-0.85 * 3.0, abs=0.4)
    assert 0.35 < at / program.duration < 0.45
    assert not alignment.believed
    assert "stood still" in "; ".join(alignment.against)


def test_a_part_of_another_raster_is_refused() -> None:
    """It was placed at a score of 55: some of its passes are like some of this raster's, and it has no others."""
    program = raster()
    rng = np.random.default_rng((41, 8))
    rng.choice(4, p=[0.4, 0.2, 0.2, 0.2])       # the benchmark's draw of the program, which was this raster
    alignment = align(program, *foreign("another raster", program.duration, rng))
    assert alignment.score > 15
    assert alignment.covered < 0.5
    assert not alignment.believed


def test_a_raster_of_equal_passes_needs_its_ends() -> None:
    """Logged whole, the first and the last pass fix it; from the middle of it any pass may be any other."""
    rng = np.random.default_rng(3)
    time, force, truth = raster_log(raster(), rng, 0.0, 1.0)
    alignment = align(raster(), time, force)
    assert alignment.believed
    assert 1e3 * np.nanmedian(np.abs(alignment.length - truth)) < 2
    assert abs(alignment.override - 0.9) < 0.002
    time, force, _ = raster_log(raster(), rng, 0.2, 0.7)
    middle = align(raster(), time, force)
    assert not middle.believed
    assert middle.score < 1


def test_what_counts_as_air() -> None:
    feed, joint = np.array([0.25, 0.25, 0.04, 0.045, np.nan, 0.25]), np.array([True, False, False, False, False, False])
    assert air_moves(feed, joint).tolist() == [True, True, False, False, False, True]
    assert air_moves(np.array([0.04, 0.05, 0.06]), np.zeros(3, dtype=bool)).tolist() == [False] * 3


# Long: the same is asked of a log of a program with a branch in test_laws_time_branches.py.
@pytest.mark.long
def test_the_doubt_of_the_place_is_part_of_the_prediction(sample_inputs: Inputs, sample: Corrected, tmp_path: Path) -> None:
    """The correction by time differs from that by position by no more than it says."""
    log, plan = pq.read_table(sample_inputs.forces), sample.predicted.path
    _, _, place = sample_log()
    time = clock(plan, place, 0.85, 7.5, 0.4)
    names = ["fx_n", "fy_n", "fz_n"]
    path = tmp_path / "time.parquet"
    pq.write_table(pa.table({"time_s": time} | {name: log[name] for name in names}), path)
    inputs = Inputs(sample_inputs.cell, sample_inputs.toolpath, sample_inputs.stiffness, path)
    predicted = predict_files(inputs, Settings.of(tare=(0, 2)))
    assert "CS3064" in {finding.code for finding in predicted.findings}
    both, here, there = np.intersect1d(predicted.prediction.targets, sample.planned.prediction.targets, return_indices=True)
    assert len(both) > 2500
    difference = predicted.prediction.position[here] - sample.planned.prediction.position[there]
    assert np.mean(np.abs(difference) <= 1.96 * predicted.prediction.std[here]) > 0.9
    assert np.median(np.linalg.norm(difference, axis=1)) < 10e-6
    # Beside entries and exits the force is uncertain, in the middle of a pass it is not.
    assert predicted.prediction.std.max() > 3 * np.median(predicted.prediction.std)


def test_a_feed_that_nobody_knows_is_refused_on_the_command_line(sample_inputs: Inputs, tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    rows = "\n".join(f"{0.1 * i:.1f},{x:.3f},{y:.3f},{z:.3f}" for i, (x, y, z) in enumerate(rng.standard_normal((500, 3))))
    (tmp_path / "noise.csv").write_text("time_s,fx_n,fy_n,fz_n\n" + rows + "\n")
    common = ["--stiffness", sample_inputs.stiffness, "--forces", tmp_path / "noise.csv", "-o", tmp_path / "out.mod", "--json"]
    unknown = tmp_path / "unknown.mod"
    unknown.write_bytes(sample_inputs.toolpath.read_bytes().replace(b"speeddata v45cut:=", b"speeddata v45gone:="))
    stopped = compstiff("correct", sample_inputs.cell, unknown, *common)
    assert stopped.returncode == 1
    finding = json.loads(stopped.stdout)["findings"][0]
    assert finding["code"] == "CS3060"
    assert "its feed is not known" in finding["message"]
    assert not (tmp_path / "out.mod").exists()


@pytest.mark.parametrize(("place", "old", "new", "target", "words", "hint"), [
    (2, "v20", "vGone", 2, r"its feed is not known \(1 such target\)", "declare the speed"),
    (2, "L pOn", "L pGone", 2, r"the robot's way to it is not known: .* \(2 such targets\)", "declare the target"),
    (2, "L pOn", "J pGone", 2, r"the robot's way to it is not known: .* \(2 such targets\)", "declare the target"),
    (0, "L pOn", "J pGone", 1, r"the robot's way to it is not known: .* \(1 such target\)", "declare the target"),
])
def test_a_move_of_unknown_time_is_named_with_what_is_missing(
    tmp_path: Path, place: int, old: str, new: str, target: int, words: str, hint: str
) -> None:
    """A target of unknown place leaves the way from it open, too; the speed of the first move counts for nothing."""
    moves = ["MoveL pOn,v20,z0,tSpindle;"] * 5
    moves[place] = moves[place].replace(old, new)
    if place:
        moves[0] = moves[0].replace("v20", "vGone")
    rest = ",700],[0.02522428,-0.00054983,-0.99944426,0.02178562],[-1,-1,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]]"
    text = "\n".join(move.replace("pOn", f"[[{1000 + 4 * k},0{rest}") for k, move in enumerate(moves))
    (tmp_path / "cell.yaml").write_text("robot: irb6660-205-1.90\ntool: {position_mm: [120, 0, 250]}\n")
    program = f"MODULE M\nPROC main()\n{text}\nENDPROC\nENDMODULE\n"
    with pytest.raises(CompstiffError, match=words) as stopped:
        program_time(robot_path(read_rapid(program.encode(), "m.mod").toolpath, read_cell(tmp_path / "cell.yaml")))
    [said] = stopped.value.findings
    assert (said.code, said.file, said.target, said.line) == ("CS3060", "m.mod", target, 3 + target)
    assert said.hint.startswith(hint)


def test_a_pass_over_air_is_named_and_left_out(sample_inputs: Inputs, tmp_path: Path) -> None:
    """One pass of the log has no force but the sensor's noise: a warning at its targets, which get no sample; the rest is
    placed all the same."""
    plan, force, place = sample_log()
    program = program_time(plan)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], ~program.air, [False]]).astype(int)))
    first, last = edges[::2][12], edges[1::2][12] - 1        # targets of one stretch that cuts
    over_air = (place > program.length[first - 1]) & (place < program.length[last])
    force = np.where(over_air[:, None], np.random.default_rng(2).normal(0, 2.0, force.shape), force)
    path = tmp_path / "air.parquet"
    columns = {f"f{axis}_n": force[:, i] for i, axis in enumerate("xyz")}
    pq.write_table(pa.table({"time_s": clock(plan, place, 0.9, 3.0, 0.2)} | columns), path)
    inputs = Inputs(sample_inputs.cell, sample_inputs.toolpath, sample_inputs.stiffness, path)
    predicted = predict_files(inputs, Settings.of(tare=((0, 2),)))
    [finding] = [finding for finding in predicted.findings if finding.code == "CS3065"]
    low, high = (int(text) for text in finding.message.removeprefix("between targets ").split(" the ")[0].split(" and "))
    # The stretch reaches half way into the air on either side.
    assert edges[1::2][11] - 1 <= low <= first
    assert last <= high <= edges[::2][13]
    assert not predicted.forces.samples[first + 1:last].any()
    assert np.mean(predicted.forces.samples > 0) > 0.9
    assert (finding.target, finding.line) == (low, plan.toolpath.line[low])
    assert finding.file == str(sample_inputs.toolpath)


@pytest.mark.parametrize("share", [0.0, pytest.param(1.0, marks=pytest.mark.long)])
def test_how_much_the_robot_speeds_up_and_brakes_is_estimated_too(share: float) -> None:
    """A cut of three layers with a stop at each target, driven by a robot without inertia or as the program's timing has it:
    the places are right to a fraction of what the stops take, and the override is that which was set."""
    layer = 1e-3 * np.array([0.0, 40.0, 9.0, 6.0, 29.0, 37.0, 32.0, 10.0, 9.0, 35.0, 8.0, 40.0, 177.0, 42.0])
    length = np.cumsum(np.tile(layer, 4))[:-13]
    feed = np.tile([0.25, 0.25, 0.25, *[0.06] * 9, 0.25, 0.25], 4)[:len(length)]
    ideal = np.cumsum(np.diff(length, prepend=0.0) / feed)
    slowed = np.cumsum(np.where(feed < 0.1, 0.011, 0.045))
    angle = np.cumsum(np.random.default_rng(8).normal(0, 0.3, len(length)))
    direction = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    program = ProgramTime(ideal + slowed, length, feed > 0.1, np.zeros(len(length), dtype=np.intp), direction, slowed)
    driven, time = ideal + share * slowed, np.arange(-3, ideal[-1] + 4, 0.01)
    place = np.interp(time, driven, length)
    move = np.clip(np.searchsorted(driven, time), 1, len(driven) - 1)
    inside = (time > driven[0]) & (time < driven[-1])
    turned = np.column_stack([120 * direction[move, 0] - 140 * direction[move, 1],
                              140 * direction[move, 0] + 120 * direction[move, 1], 0 * time - 38])
    noise = np.random.default_rng(4).normal([20, -7, 3], 8, (len(time), 3))
    force = turned * ((feed[move] < 0.1) & inside)[:, None] + noise
    found = align(program, time + 12.5, force)
    on = inside & np.isfinite(found.length) & (feed[move] < 0.1)
    assert found.override == pytest.approx(1.0, abs=0.012)
    off = 1e3 * np.abs(found.length - place)[on]
    assert np.quantile(off, 0.9) < 1.3
    assert np.mean(off <= 2e3 * found.spread[on]) > 0.9

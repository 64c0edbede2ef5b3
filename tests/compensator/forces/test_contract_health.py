"""Saturation, stuck channels and lost samples are found where they are, and nowhere else."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from compensator.forces.log import ForceLog, read_force_log
from compensator.forces.placement import place_forces
from identification.common import number_blocks
from identification.common.findings import CompstiffError
from identification.model.cell_file import ForceLogFile
from tests.compensator.forces.test_contract_placement import place, plan

RATE, COUNT = 2000.0, 6000
FAULTS = {"CS3023", "CS3024", "CS3025", "CS3026", "CS3036"}


def noisy(seed: int = 0, step: float = 1 / 32) -> np.ndarray:
    """A cut between two air moves, as a sensor reports it, in steps of 1/32 N."""
    rng = np.random.default_rng(seed)
    t = np.arange(COUNT) / RATE
    cut = np.interp(t, [0.5, 0.55, 2.4, 2.5], [0, 1, 1, 0])[:, None] * [150.0, -90, 60] * (1 + 0.4 * np.sin(900 * t))[:, None]
    bias = np.array([3.0, -4, 2])
    return step * np.round((cut + bias + rng.normal(0, 1.5, (COUNT, 3))) / step)


def read(path: Path, force: np.ndarray, rows: np.ndarray | None = None, form: ForceLogFile | None = None, **extra) -> ForceLog:
    data = {"time_s": np.arange(COUNT) / RATE, "target": np.arange(COUNT) // 2000} | extra
    frame = pd.DataFrame(data | {f"f{axis}_n": force[:, k] for k, axis in enumerate("xyz")})
    (frame if rows is None else frame.iloc[rows]).to_csv(path / "a.csv", index=False)
    return read_force_log(path / "a.csv", form or ForceLogFile())


def faults(log: ForceLog) -> list[tuple[str, int | None]]:
    return [(finding.code, finding.line) for finding in log.findings if finding.code in FAULTS]


@pytest.fixture(params=[1 << 22, 5000], ids=["whole", "in blocks"])
def blocks(request, monkeypatch) -> None:
    monkeypatch.setattr(number_blocks, "BLOCK_BYTES", request.param)


@pytest.mark.parametrize("seed", range(10))
def test_a_sound_log_is_left_in_peace(tmp_path, seed: int) -> None:
    log = read(tmp_path, noisy(seed))
    assert not faults(log)
    assert not log.saturated.any()


@pytest.mark.parametrize("kind", ["constant", "pieces", "zero", "plateau", "one axis"])
def test_a_simulation_without_noise_is_left_in_peace(tmp_path, kind: str) -> None:
    t = np.arange(COUNT) / RATE
    force = {"constant": np.tile([10.0, 20, 30], (COUNT, 1)),
             "pieces": np.repeat([[0.0, 0, 0], [100, -50, 20], [0, 0, 0]], COUNT // 3, axis=0),
             "zero": np.zeros((COUNT, 3)),
             "plateau": np.outer(np.interp(t, [0, 1, 2, 3], [0, 200, 200, 0]), [1, 2, -1]),
             "one axis": np.column_stack([100 + 50 * np.sin(40 * t), 0 * t, np.where(t < 1, 0.0, 30.0)])}[kind]
    log = read(tmp_path, force)
    assert [finding for finding in log.findings if finding.code in FAULTS and finding.level == "warning"] == []


@pytest.mark.parametrize("seed", range(3))
def test_channels_that_are_clipped_together_are_told(tmp_path, seed: int) -> None:
    """A sensor of too small a range, under a spindle's weight and a cut: often all three channels stand at its end at once."""
    rng = np.random.default_rng((3023, seed))
    load = np.repeat([[185.0, -150, 250], [260, -260, 205], [195, -205, 192]], COUNT // 3, axis=0)
    force = np.clip(load + rng.normal(0, 25, (COUNT, 3)), -200, 200)
    still = (np.diff(force, axis=0) == 0).all(axis=1)
    assert 0.05 < still.mean() < 0.5
    log = read(tmp_path, force)
    assert "CS3023" in {code for code, _ in faults(log)}
    assert log.saturated.mean() > 0.4


@pytest.mark.usefixtures("blocks")
def test_clipped_peaks(tmp_path) -> None:
    force = noisy()
    clipped = np.minimum(force, [180, 1e9, 1e9])
    runs = np.flatnonzero(np.convolve(force[:, 0] >= 180, np.ones(3), mode="valid") == 3)
    log = read(tmp_path, clipped)
    assert faults(log) == [("CS3023", int(runs[0]) + 2)]
    within = np.zeros(COUNT, dtype=bool)
    for first in runs:
        within[first:first + 3] = True
    # A run over the border of two blocks, 4 MB each but here of 5 kB, may lose a sample or two.
    assert not np.any(log.saturated & ~within)
    assert log.saturated.sum() > 0.9 * within.sum()
    assert f"fx_n: {log.saturated.sum()} samples in runs of exactly 180" in str(log.findings)
    stated = read(tmp_path, clipped, form=ForceLogFile(saturation_n=180))
    assert np.array_equal(stated.saturated, clipped[:, 0] >= 180)


def test_targets_that_depend_on_saturated_samples_are_warned_about(tmp_path) -> None:
    force = np.minimum(noisy(), [180, 1e9, 1e9])
    rows = "\n".join(f"{k // 2000},{x},{y},{z}" for k, (x, y, z) in enumerate(force))
    found = [f for f in place(tmp_path, "target,fx_n,fy_n,fz_n\n" + rows + "\n").findings if f.code == "CS3026"]
    hit = {k // 2000 for k in range(COUNT) if force[k, 0] >= 180}
    assert len(found) == 1
    assert f"of {len(hit)} target" in found[0].message
    assert found[0].target == min(hit)


@pytest.mark.usefixtures("blocks")
def test_a_channel_that_sticks(tmp_path) -> None:
    force = noisy()
    force[3000:3200, 1] = force[3000, 1]
    log = read(tmp_path, force)
    assert faults(log) == [("CS3024", 3002)]
    assert "fy_n stood still while others moved: 200 samples" in str(log.findings)


@pytest.mark.usefixtures("blocks")
@pytest.mark.parametrize("ends", [True, False])
def test_a_logger_that_repeats_its_last_reading(tmp_path, ends: bool) -> None:
    """All channels together, in the middle or up to the end; while they hold nothing they are in the air of a simulation."""
    force = noisy()
    stop = len(force) if ends else 3200
    force[3000:stop] = force[3000]
    log = read(tmp_path, force)
    assert faults(log) == [("CS3024", 3002)]
    assert f"all channels stood still together: {stop - 3000} samples" in str(log.findings)
    force[3000:stop] = 0
    assert faults(read(tmp_path, force)) == []


@pytest.mark.usefixtures("blocks")
@pytest.mark.parametrize("channels", [[1], [0, 1, 2]], ids=["one", "all"])
def test_a_reading_that_is_repeated_is_no_force(tmp_path, channels: list[int]) -> None:
    """Targets of half a second each: one of which everything is repeated stays as it is and is named, of one in which half is
    repeated the other half is the mean, and where nothing is repeated all is as it was."""
    force, target = noisy(), np.arange(COUNT) // 1500
    force[2900:4600, channels] = force[2900, channels]
    rows = "\n".join(f"{k},{x},{y},{z}" for k, (x, y, z) in zip(target, force, strict=True))
    forces = place(tmp_path, "target,fx_n,fy_n,fz_n\n" + rows + "\n")
    assert forces.samples.tolist() == [1500, 1400, 0, 1400, 0]
    np.testing.assert_allclose(forces.wrench[1, :3], force[1500:2900].mean(axis=0), atol=1e-9)
    assert not forces.forced[2]
    assert forces.held.tolist() == [2]
    (named,) = [finding for finding in forces.findings if finding.code == "CS3070"]
    assert named.target == 2
    assert named.level == "warning"
    assert "1 target left where planned" in named.message


def test_a_log_that_only_stands_still_is_refused(tmp_path) -> None:
    """One target, all of whose rows come from a run: nothing is left to correct by."""
    log = read(tmp_path, noisy())
    everything = replace(log, held=np.ones(len(log.line), dtype=bool))
    here = plan(tmp_path)
    with pytest.raises(CompstiffError, match="nothing in it is a force"):
        place_forces(everything, here, here.cell)


def test_a_channel_that_is_dead(tmp_path) -> None:
    force = noisy()
    force[:, 2] = 4.5
    found = [f for f in read(tmp_path, force).findings if f.code == "CS3024"]
    assert [(f.level, f.message) for f in found] == [("warning", "fz_n is 4.5 in all 6000 samples")]
    force[:, 2] = 0
    assert [f.level for f in read(tmp_path, force).findings if f.code == "CS3024"] == ["warning"]


@pytest.mark.usefixtures("blocks")
@pytest.mark.parametrize(("columns", "level"), [((0, 1, 2), None), ((0, 0, 2), "warning"), ((0, 1, 1), "warning"),
                                                ((-1, 1, 2), "warning"), ((-1, -1, 2), "note")])
def test_a_force_that_is_missing_or_stands_twice(tmp_path, blocks, columns: tuple[int, ...], level: str | None) -> None:
    """-1: zeros. A sensor of one axis has two such columns; of three axes none."""
    force = np.column_stack([noisy()[:, k] if k >= 0 else np.zeros(COUNT) for k in columns])
    said = {finding.level for finding in read(tmp_path, force).findings if finding.code == "CS3024"}
    assert said == ({level} if level else set())


@pytest.mark.parametrize("told", ["time", "sequence"])
def test_lost_samples(tmp_path, told: str) -> None:
    rows = np.delete(np.arange(COUNT), [700, *range(2500, 2540)])
    extra = {"sequence": np.arange(COUNT) + 17}
    if told == "sequence":
        extra["time_s"] = np.round(np.arange(COUNT) / RATE, 2)      # too coarse to tell
    log = read(tmp_path, noisy(), rows, **(extra if told == "sequence" else {}))
    found = [finding for finding in log.findings if finding.code == "CS3025"]
    assert len(found) == 1
    assert found[0].line == 702
    assert "41 samples of 6000 lost in 2 gaps" in found[0].message
    assert ("CS3036" in {finding.code for finding in log.findings}) == (told == "sequence")


@pytest.mark.usefixtures("blocks")
@pytest.mark.parametrize("key", ["time", "target"])
@pytest.mark.parametrize(("first", "most", "every"), [(17, 1 << 32, 1), (65_000, 1 << 16, 1), (17, 1 << 32, 5)])
def test_a_counter_tells_what_a_clock_tells(tmp_path, key: str, first: int, most: int, every: int) -> None:
    """Rows that were lost, and rows that stand twice, in a log with times and in one with a counter and a rate: the same times
    and places, and the same means over a revolution, none of which reaches over what is lost. So too where the counter runs
    over, and where it counts samples that were never to be logged, of which none is lost: there the rows tell the time."""
    kept = np.arange(COUNT) if every > 1 else np.concatenate([
        np.arange(700), np.arange(701, 2500), np.arange(2540, 4000), [3999, 3999], np.arange(4000, COUNT)])
    force = {f"f{axis}_n": noisy()[kept, k] for k, axis in enumerate("xyz")}
    placed = {} if key == "time" else {"target": kept // 2000}
    form, logs = ForceLogFile(rate_hz=RATE), []
    for name, column in (("time_s", kept / RATE), ("sequence", (first + every * kept) % most)):
        pd.DataFrame({name: column} | placed | force).to_csv(tmp_path / "a.csv", index=False)
        logs.append(read_force_log(tmp_path / "a.csv", form, spindle_rpm=6000))
    timed, counted = logs
    assert (timed.key, counted.key) == (key, key)
    assert timed.time is not None
    assert counted.time is not None
    np.testing.assert_allclose(counted.time, timed.time, rtol=0, atol=1e-9)
    np.testing.assert_allclose(counted.place, timed.place, rtol=0, atol=1e-9)
    np.testing.assert_allclose(counted.force, timed.force, rtol=0, atol=1e-9)


def test_time_that_runs_back(tmp_path) -> None:
    time = np.arange(COUNT) / RATE
    time[4000:] -= 1.0
    assert faults(read(tmp_path, noisy(), time_s=time)) == [("CS3025", 4002)]


@pytest.mark.parametrize(("again", "words"), [
    ([], ""), ([700], "1 sample with the sequence number of the one before"),
    ([700, 2500, 2501], "3 samples with the sequence number of the one before")])
def test_samples_that_stand_twice(tmp_path, blocks, again: list[int], words: str) -> None:
    """As a logger writes them that sends a packet again; told with the line of the first, in whatever blocks it is read."""
    rows = np.sort(np.concatenate([np.arange(COUNT), again]).astype(int))
    found = [one for one in read(tmp_path, noisy(), rows, sequence=np.arange(COUNT) + 17).findings if one.code == "CS3025"]
    assert [(one.level, one.message, one.file) for one in found] == (
        [("warning", words, str(tmp_path / "a.csv"))] if words else [])
    # The header is line 1, sample 700 line 702, and what stands there again is the next.
    assert [one.line for one in found] == ([703] if words else [])

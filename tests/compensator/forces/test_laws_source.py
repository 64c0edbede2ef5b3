"""What a log's columns become: load, place and time of each sample in SI units, by the columns that count first."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from compensator.forces.source import ForceSource, Samples, open_force_log, placed_by
from identification.common import number_blocks
from identification.common.findings import CompstiffError
from identification.model.cell_file import ForceLogFile

COUNT = 60
RNG = np.random.default_rng(8)
FORCES, MOMENTS = ("fx_n", "fy_n", "fz_n"), ("mx_nm", "my_nm", "mz_nm")
COUNTS, MOMENT_COUNTS = ("fx_counts", "fy_counts", "fz_counts"), ("mx_counts", "my_counts", "mz_counts")
POSITION, JOINTS = ("x_mm", "y_mm", "z_mm"), ("q1_deg", "q2_deg", "q3_deg", "q4_deg", "q5_deg", "q6_deg")
TABLE: dict[str, Any] = {name: RNG.normal(0, 100, COUNT).round(3) for name in (
    *FORCES, *MOMENTS, *COUNTS, *MOMENT_COUNTS, *POSITION, *JOINTS, "path_mm")} | {
    "target": np.arange(COUNT) // 4, "time_s": 5 + np.arange(COUNT) / 64, "time_ms": 125.0 * np.arange(COUNT),
    "sequence": 900 + 2 * np.arange(COUNT)}


def opened(folder: Path, names: tuple[str, ...], suffix: str = "csv", changed: dict[str, Any] | None = None, **form: Any
           ) -> ForceSource:
    """A log of these columns."""
    table, file = TABLE | (changed or {}), folder / f"a.{suffix}"
    frame = pd.DataFrame({name: table[name] for name in names})
    if suffix == "csv":
        frame.to_csv(file, index=False)
    else:
        frame.to_parquet(file)
    return open_force_log(file, ForceLogFile(**form))


def all_of(source: ForceSource) -> Samples:
    """Its blocks in one."""
    blocks = list(source.blocks())
    joined = {name: None if getattr(blocks[0], name) is None else np.concatenate([getattr(block, name) for block in blocks])
              for name in ("load", "place", "time", "sequence", "line")}
    return Samples(**joined)


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
@pytest.mark.parametrize(("names", "form", "key", "place", "said"), [
    ((*FORCES, "target", "path_mm"), {}, "target", TABLE["target"], "target number; not used: path length"),
    ((*FORCES, "path_mm", *POSITION, *JOINTS, "time_s"), {}, "path_mm", 1e-3 * TABLE["path_mm"],
     "path length; not used: TCP position, joint angles"),
    ((*JOINTS, *POSITION, *FORCES), {}, "position", 1e-3 * np.column_stack([TABLE[name] for name in POSITION]),
     "TCP position; not used: joint angles"),
    ((*FORCES, *JOINTS, "time_ms"), {}, "joints", np.pi / 180 * np.column_stack([TABLE[name] for name in JOINTS]),
     "joint angles"),
    ((*FORCES, "time_ms"), {}, "time", np.zeros((COUNT, 0)), "time alone"),
    ((*FORCES, "time_s", "time_ms"), {}, "time", np.zeros((COUNT, 0)), "time alone"),
    (FORCES, {"rate_hz": 50}, "time", np.zeros((COUNT, 0)), "time alone")])
def test_a_sample_is_placed_by_the_first_column_that_says_where(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str, names: tuple[str, ...], form: dict[str, Any], key: str,
    place: np.ndarray, said: str
) -> None:
    """In metres and radians; times in seconds of the first that there is; with the lines of the file, or as if it had any."""
    monkeypatch.setattr(number_blocks, "BLOCK_BYTES", 900)
    monkeypatch.setattr(number_blocks, "BATCH_ROWS", 25)
    source = opened(tmp_path, names, suffix, **form)
    found = all_of(source)
    assert (source.key, placed_by(source)) == (key, said)
    assert (source.has_moment, source.forces, source.moments) == (False, FORCES, None)
    assert_allclose(found.load, np.column_stack([TABLE[name] for name in FORCES]), rtol=1e-15)
    assert_allclose(found.place, place if place.ndim > 1 else place[:, None], rtol=1e-12)
    time = TABLE["time_s"] if "time_s" in names else 1e-3 * TABLE["time_ms"] if "time_ms" in names else None
    assert (found.time is None) == (time is None)
    if found.time is not None:
        assert_allclose(found.time, time, rtol=1e-12)
    assert found.sequence is None
    assert found.line.tolist() == list(range(2, COUNT + 2))


@pytest.mark.parametrize(("names", "per", "forces", "moments"), [
    ((*FORCES, *MOMENTS), (None, None), (FORCES, 1.0), (MOMENTS, 1.0)),
    ((*COUNTS, *MOMENTS), (8.0, None), (COUNTS, 8.0), (MOMENTS, 1.0)),
    ((*FORCES, *MOMENT_COUNTS), (None, 20.0), (FORCES, 1.0), (MOMENT_COUNTS, 20.0)),
    ((*COUNTS, *MOMENT_COUNTS), (8.0, 20.0), (COUNTS, 8.0), (MOMENT_COUNTS, 20.0)),
    # What is there in its unit is taken, with a scale of counts or without.
    ((*COUNTS, *FORCES, *MOMENT_COUNTS, *MOMENTS), (8.0, 20.0), (FORCES, 1.0), (MOMENTS, 1.0)),
    ((*COUNTS, *FORCES, *MOMENT_COUNTS, *MOMENTS), (None, None), (FORCES, 1.0), (MOMENTS, 1.0))])
def test_a_load_is_in_its_unit_or_so_many_counts_of_it(
    tmp_path: Path, names: tuple[str, ...], per: tuple[float | None, float | None], forces: tuple, moments: tuple
) -> None:
    form = {key: value for key, value in zip(("counts_per_n", "counts_per_nm"), per, strict=True) if value}
    source = opened(tmp_path, (*names, "target", "sequence"), **form)
    found = all_of(source)
    assert (source.has_moment, source.forces, source.moments) == (True, forces[0], moments[0])
    expected = [TABLE[name] / scale for group, scale in (forces, moments) for name in group]
    assert_allclose(found.load, np.column_stack(expected), rtol=1e-15)
    assert_allclose(found.sequence, TABLE["sequence"])
    part = found.part(slice(7, 9))
    assert (len(part), part.line.tolist(), part.time) == (2, [9, 10], None)
    assert_allclose(part.load, np.column_stack(expected)[7:9], rtol=1e-15)
    assert_allclose(part.place[:, 0], TABLE["target"][7:9])
    assert_allclose(part.sequence, TABLE["sequence"][7:9])


@pytest.mark.parametrize(("row", "value", "words"), [
    (7, 2.5, "target 2.5 is not a target number"), (9, -1, "target -1 is not a target number"), (9, 0, "")])
def test_what_is_no_target_number_is_told_where_it_stands(tmp_path: Path, row: int, value: float, words: str) -> None:
    """The first of two, with its line and its column."""
    target = TABLE["target"].astype(float)
    target[row] = value
    target[40] = -3 if words else 0
    source = opened(tmp_path, ("time_s", "target", *FORCES), changed={"target": target})
    if not words:
        assert_allclose(all_of(source).place[:, 0], target)
        return
    with pytest.raises(CompstiffError, match=words) as stopped:
        all_of(source)
    [found] = stopped.value.findings
    assert (found.code, found.file, found.line, found.column) == ("CS3004", str(tmp_path / "a.csv"), row + 2, 2)


def held(rows: int, columns: tuple[str, ...] = (*FORCES, *MOMENTS)) -> ForceSource:
    """A log that is there as arrays."""
    table = {name: TABLE[name][:rows] for name in columns}
    return ForceSource(Path("a.lvm"), ForceLogFile(rate_hz=100), columns, columns, None, table, rows, "time", ())


@pytest.mark.parametrize(("rows", "first"), [(60, [0, 12, 24, 48]), (13, [0, 0, 0, 1]), (12, [0, 0, 0, 0]), (5, [0, 0, 0, 0])])
def test_stretches_of_a_log_are_from_as_far_through_it_as_is_asked(rows: int, first: list[int]) -> None:
    """Twelve rows each, or all there are: the last ends with the log."""
    load = np.column_stack([TABLE[name] for name in (*FORCES, *MOMENTS)])
    found = list(held(rows).stretches([0.0, 0.25, 0.5, 1.0], 12))
    assert [len(one) for one in found] == [min(rows, 12)] * 4
    for one, begin in zip(found, first, strict=True):
        assert_allclose(one, load[begin:begin + min(rows, 12)])


def test_a_log_of_arrays_comes_in_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(number_blocks, "BATCH_ROWS", 25)
    source = held(60)
    assert [len(block) for block in source.blocks()] == [25, 25, 10]
    assert all_of(source).line.tolist() == list(range(1, 61))
    assert_allclose(all_of(source).load[:, 4], TABLE["my_nm"])


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_both_places_of_a_log_that_has_them_are_those_of_the_same_samples(tmp_path: Path, suffix: str) -> None:
    """TCP and joint angles, of places from beginning to end; none of a log that has one alone, or one row of both."""
    shares = [0.0, 0.3, 0.6, 0.9]
    found = opened(tmp_path, (*FORCES, *POSITION, *JOINTS), suffix).both_places(shares)
    assert found is not None
    assert len(found.position) == len(found.joints) > 1
    position = 1e-3 * np.column_stack([TABLE[name] for name in POSITION])
    joints = np.pi / 180 * np.column_stack([TABLE[name] for name in JOINTS])
    rows = [int(np.argmin(np.linalg.norm(position - one, axis=1))) for one in found.position]
    assert_allclose(found.position, position[rows], rtol=1e-12)
    assert_allclose(found.joints, joints[rows], rtol=1e-12)
    assert rows == sorted(rows)
    assert np.ptp(rows) > COUNT / 2
    assert opened(tmp_path, (*FORCES, *POSITION), suffix).both_places(shares) is None
    assert opened(tmp_path, (*FORCES, *JOINTS), suffix).both_places(shares) is None


@pytest.mark.parametrize(("rows", "lost", "kept"), [(60, (), [0, 28, 57]), (60, (28,), [0, 57]), (60, (0, 28), None)])
def test_a_sample_one_of_whose_places_is_lost_says_nothing_of_both(
    rows: int, lost: tuple[int, ...], kept: list[int] | None
) -> None:
    """A single one tells nothing either."""
    source = held(rows, (*FORCES, *POSITION, *JOINTS))
    assert source.held is not None
    source.held["q4_deg"] = source.held["q4_deg"].copy()
    source.held["q4_deg"][list(lost)] = np.nan
    found = source.both_places([0.0, 0.5, 1.0])
    assert (found is None) == (kept is None)
    if found is not None:
        assert_allclose(found.position, 1e-3 * np.column_stack([TABLE[name] for name in POSITION])[kept], rtol=1e-12)
        assert_allclose(found.joints[:, 5], np.pi / 180 * TABLE["q6_deg"][kept], rtol=1e-12)


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_columns_that_are_not_read_are_told(tmp_path: Path, suffix: str) -> None:
    """A name that is all but one that is missing as a warning; one that is read anyhow is not meant by another."""
    names = ("target", *FORCES, "path_m", "temperature", "fx_nm")
    source = opened(tmp_path, names, suffix, dict.fromkeys(names[4:], 0.0))
    assert [(one.code, one.level, one.message, one.line) for one in source.findings] == [
        ("CS0204", "warning", "column 'path_m' is not read; is 'path_mm' meant?", 1),
        ("CS0204", "warning", "column 'fx_nm' is not read; is 'mx_nm' meant?", 1),
        ("CS0204", "note", "columns that are not read: temperature", 1)]
    assert opened(tmp_path, ("target", *FORCES), suffix).findings == ()
    with pytest.raises(CompstiffError, match="without my_nm") as stopped:
        opened(tmp_path, ("target", *FORCES, "mx_nm", "mz_nm"), suffix)
    assert stopped.value.findings[0].line == 1
    with pytest.raises(CompstiffError, match="no column says where .* belongs: found fx_n, fy_n, fz_n") as stopped:
        opened(tmp_path, FORCES, suffix)
    assert [(one.code, one.line) for one in stopped.value.findings] == [("CS3001", 1)]

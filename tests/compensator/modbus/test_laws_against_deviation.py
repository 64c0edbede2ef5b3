"""Offsets against the deviation of their own file: those that `correct` writes pass, whatever the work object; what a
spreadsheet or a slip makes of them does not."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from compensator.correction.correct import Corrected
from compensator.correction.files import Inputs
from compensator.correction.offsets import offsets_csv
from compensator.modbus.against_deviation import check_deviation
from compensator.modbus.offset_file import Offsets, read_offsets
from compstiff.offsets_of_program import check_offsets_of
from identification.common.findings import Refused
from identification.model.cell import read_cell
from identification.model.rotations import quaternion_to_matrix

COLUMNS = ("ox_mm", "oy_mm", "oz_mm")


def drawn(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Offsets (N, 3), deviation (N, 3) [m] and work object (N, 3, 3) as a correction may have them: air moves, a force that
    follows the cut by up to half, corrections held back to nothing, a few per cent of another direction."""
    count = int(rng.integers(20, 400))
    turn = np.tile(quaternion_to_matrix((q := rng.normal(size=4)) / np.linalg.norm(q)), (count, 1, 1))
    deviation = np.cumsum(rng.normal(0, 3e-6, (count, 3)), axis=0) + rng.normal(0, 1e-4, 3)
    cut = np.repeat(rng.random(-(-count // 10)) < 0.7, 10)[:count]
    cut[:5] = True
    deviation *= cut[:, None]
    share = rng.uniform(1.0, 1.5) * np.where(rng.random(count) < 0.2, rng.random(count), 1.0)
    offset = -share[:, None] * np.einsum("nji,nj->ni", turn, deviation) * (1 + rng.normal(0, 0.05, (count, 3)))
    return np.round(offset, 9), np.round(deviation, 10), turn


def offsets_of(offset: np.ndarray, deviation: np.ndarray) -> Offsets:
    return Offsets("offsets.csv", 0, offset, np.zeros(len(offset)), np.arange(len(offset)) + 2, (), predicted=deviation)


def middle(offset: np.ndarray, deviation: np.ndarray) -> float:
    """How many times the deviation the offsets are, in the middle."""
    size = np.linalg.norm(deviation, axis=1)
    used = np.any(offset != 0, axis=1) & (size > 2e-6)
    return float(np.median(np.linalg.norm(offset[used], axis=1) / size[used]))


@pytest.mark.parametrize("seed", range(40))
def test_without_the_program_an_upright_work_object_tells_the_sign(seed: int) -> None:
    """A work object turned about the vertical by any angle and tilted by up to 30 degrees, a robot that hangs or stands."""
    rng = np.random.default_rng((5027, seed))
    count, tilt, turned = int(rng.integers(20, 400)), np.radians(rng.uniform(-30, 30)), rng.uniform(-np.pi, np.pi)
    c, s = np.cos([turned, tilt]), np.sin([turned, tilt])
    object_in_world = np.array([[c[0], -s[0], 0], [s[0], c[0], 0], [0, 0, 1]]) @ np.array(
        [[1, 0, 0], [0, c[1], -s[1]], [0, s[1], c[1]]])
    up = np.array([0, 0, -1.0]) if seed % 2 else np.array([0, 0, 1.0])          # in the robot's base
    in_world = rng.normal(0, 3e-5, (count, 3)) + np.array([0.5e-4, -0.5e-4, 2e-4])
    deviation = in_world * (np.array([1, -1, -1.0]) if seed % 2 else 1.0)       # hanging: turned about x
    offset = -in_world @ object_in_world
    assert check_deviation(offsets_of(offset, deviation), None, up) == ()
    told = check_deviation(offsets_of(-offset, deviation), None, up)
    assert [one.code for one in told] == ["CS5027"]
    assert "sign" in told[0].message


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_offsets_along_one_axis_alone_are_looked_at(axis: int) -> None:
    """As against a force that only pushes along it."""
    offset = np.zeros((10, 3))
    offset[:, axis] = -1e-4
    assert check_deviation(offsets_of(offset, -offset), np.tile(np.eye(3), (10, 1, 1))) == ()
    with pytest.raises(Refused, match="they are 900 um RMS, the deviation that it predicts there 100"):
        check_deviation(offsets_of(9 * offset, -offset), None)
    still = -offset
    still[3] = 0
    with pytest.raises(Refused, match="1 target would be moved where it predicts no deviation"):
        check_deviation(offsets_of(offset, still), None)


@pytest.mark.parametrize("seed", range(40))
def test_a_correction_is_left_in_peace_and_a_slip_is_refused(seed: int) -> None:
    offset, deviation, turn = drawn(np.random.default_rng((5025, seed)))
    assert check_deviation(offsets_of(offset, deviation), turn) == ()
    check_deviation(offsets_of(offset, deviation), None)
    check_deviation(offsets_of(0 * offset, deviation), turn)
    for factor in (2.0, 0.5):
        told = check_deviation(offsets_of(factor * offset, deviation), turn)
        assert [one.code for one in told] == (["CS5027"] if not 0.6 <= factor * middle(offset, deviation) <= 1.6 else [])
    for wrong in (-offset, 1e3 * offset, 1e-3 * offset):
        with pytest.raises(Refused, match="CS5025"):
            check_deviation(offsets_of(wrong, deviation), turn)


def test_a_file_without_deviation_says_nothing() -> None:
    check_deviation(Offsets("offsets.csv", 0, np.full((3, 3), 1e-4), np.zeros(3), np.arange(3), ()), None)


def test_the_samples_offsets_as_a_spreadsheet_may_leave_them(
    sample: Corrected, sample_inputs: Inputs, tmp_path: Path
) -> None:
    cell, program = read_cell(sample_inputs.cell), sample_inputs.toolpath
    rows = list(csv.DictReader(offsets_csv(sample).decode().splitlines()))

    def pushed(name: str, change) -> None:
        file = tmp_path / f"{name}.csv"
        with file.open("w", newline="") as out:
            writer = csv.DictWriter(out, rows[0])
            writer.writeheader()
            for k, row in enumerate(rows):
                writer.writerow(row | change(k, row))
        check_offsets_of(read_offsets(file, 10.0), program, cell)

    pushed("right", lambda k, row: {})
    slips = {"sign": lambda k, row: {c: -float(row[c]) for c in COLUMNS},
             "swapped": lambda k, row: {"ox_mm": row["oy_mm"], "oy_mm": row["ox_mm"]},
             "a row on": lambda k, row: {c: rows[max(k - 1, 0)][c] for c in COLUMNS},
             "metres": lambda k, row: {c: 1e-3 * float(row[c]) for c in COLUMNS}}
    for name, change in slips.items():
        with pytest.raises(Refused, match="CS5025"):
            pushed(name, change)

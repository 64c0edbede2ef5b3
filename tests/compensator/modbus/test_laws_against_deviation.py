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


# Two rows that are not moved, then three that push along x, y and both; targets from 10, lines from 4.
DEVIATION = 1e-4 * np.array([[5, 5, 5], [np.nan] * 3, [3, 0, 0], [0, 5.2, 0], [3, 4, 0], [0, 0, 2.0]])
MOVED = np.array([0, 0, 1, 1, 1, 0])[:, None]
SAME = np.tile(np.eye(3), (22, 1, 1))


def heard(offset: np.ndarray, turn: np.ndarray | None = SAME, deviation: np.ndarray = DEVIATION, up: np.ndarray | None = None
          ) -> tuple[str, str, int | None, int | None]:
    """Code, sentence, line and target of the first that is said, warned or refused."""
    offsets = Offsets("offsets.csv", 10, offset, np.zeros(len(offset)), np.arange(len(offset)) + 4, (), predicted=deviation)
    try:
        found = check_deviation(offsets, turn, up)
    except Refused as refused:
        found = refused.findings
    return (found[0].code, found[0].message, found[0].line, found[0].target) if found else ("", "", None, None)


def times(factor: float) -> np.ndarray:
    return np.where(MOVED, -factor * DEVIATION, 0.0)


@pytest.mark.parametrize(("factor", "code", "said"), [
    (0.099, "CS5025", "they are 44.66 um RMS, the deviation that it predicts there 451.1"),
    (0.101, "CS5027", "the offsets are 0.10 times the deviation"),
    (0.594, "CS5027", "the offsets are 0.59 times the deviation"),
    (0.606, "", ""), (1.0, "", ""), (1.595, "", ""), (1.604, "CS5027", "the offsets are 1.60 times the deviation"),
    (2.996, "CS5027", "the offsets are 3.00 times the deviation"),
    (3.004, "CS5025", "they are 1355 um RMS, the deviation that it predicts there 451.1")])
def test_how_many_times_the_deviation_offsets_may_be(factor: float, code: str, said: str) -> None:
    """Over the targets that are moved: sqrt((3^2 + 5.2^2 + 5^2) / 3) of 100 um; at the largest, the second of them."""
    found = heard(times(factor))
    assert (found[0], found[2:]) == ((code, (7, 13)) if code else ("", (None, None)))
    assert said in found[1]
    assert heard(times(factor), None)[0] == code, "no program, and nothing said of the vertical"


def test_the_middle_of_the_targets_counts() -> None:
    """Of those whose deviation can be told: one in three that is five times it is none of the others' business."""
    factor = np.array([0, 0, 1, 1, 1.9, 0])[:, None]
    assert heard(np.where(MOVED, -factor * DEVIATION, 0.0))[0] == ""
    assert heard(np.where(MOVED, -(2.6 - factor) * DEVIATION, 0.0))[0] == ""
    assert heard(np.where(MOVED, -np.array([0, 0, 1, 1.7, 1.9, 0])[:, None] * DEVIATION, 0.0))[:1] == ("CS5027",)
    slight = np.vstack([DEVIATION, 1e-6 * np.eye(3), 1e-6 * np.eye(3)])
    offset = np.vstack([times(1.0), np.zeros((6, 3))])
    offset[6:] = -9e-6 * np.eye(3).repeat(2, axis=0)[[0, 2, 4, 1, 3, 5]]
    assert heard(offset, deviation=slight)[0] == ""
    offset[:6] = times(1.7)
    assert heard(offset, deviation=slight)[:1] == ("CS5027",)


@pytest.mark.parametrize(("angle", "said"), [
    (0, ""), (45, ""), (-45, ""), (46, "axes swapped"), (90, "axes swapped"), (134, "axes swapped"), (136, "turned over"),
    (180, "turned over")])
def test_offsets_point_against_the_deviation_within_45_degrees(angle: float, said: str) -> None:
    """In the work object as it stands at each target of the program; the cosine is 0.7."""
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    turned = DEVIATION @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]).T
    rng = np.random.default_rng(4)
    turn = np.array([quaternion_to_matrix(q / np.linalg.norm(q)) for q in rng.normal(size=(16, 4))])
    offset = np.where(MOVED, -np.einsum("nji,nj->ni", turn[10:], turned), 0.0)
    found = heard(offset, turn)
    assert found[0] == ("CS5025" if said else "")
    if said:
        assert found[1].endswith("they do not point against the deviation that it predicts there")
        with pytest.raises(Refused, match=said):
            check_deviation(Offsets("o.csv", 10, offset, np.zeros(6), np.arange(6), (), predicted=DEVIATION), turn)


@pytest.mark.parametrize(("size", "code"), [(1.9e-6, ""), (2.1e-6, "CS5025")])
def test_what_is_rounded_is_not_judged(size: float, code: str) -> None:
    """Under 2 um RMS, both: here with the wrong sign, and six times too large."""
    one = np.tile([size, 0, 0], (3, 1))
    assert heard(one, deviation=one)[0] == code
    assert heard(-one, deviation=one / 12)[0] == code
    assert heard(-one / 12, deviation=one)[0] == code
    assert heard(np.zeros((3, 3)), deviation=1e3 * one)[0] == ""


def test_a_deviation_that_is_not_known_whole_says_nothing() -> None:
    partly = DEVIATION.copy()
    partly[2, 1] = np.nan
    offset = times(1.0)
    offset[2] = [0, 9e-3, 0]
    assert heard(offset, deviation=partly)[0] == ""
    assert heard(offset)[0] == "CS5025"


def test_a_target_that_is_moved_where_nothing_gives_way_is_named() -> None:
    offset = times(1.0)
    offset[5] = [0, 0, -1e-5]
    still = DEVIATION.copy()
    still[4:] = 0
    assert heard(offset, deviation=still) == (
        "CS5025", "the offsets do not undo the deviation of this file: 2 targets would be moved where it predicts no deviation",
        8, 14)


@pytest.mark.parametrize(("rise", "code"), [(0.69, ""), (0.71, "CS5027"), (1.0, "CS5027"), (-1.0, "")])
def test_along_the_vertical_offsets_do_not_go_with_the_deviation(rise: float, code: str) -> None:
    """Two targets: one is moved along its deviation, the other against it, so that the two correlate by `rise`; where the
    vertical is not known, or is another axis, nothing is said."""
    a, b = (1 + rise) / 2, (1 - rise) / 2
    up = np.array([[0, 0, 1e-4]])
    deviation = np.vstack([np.sqrt(a) * up, np.sqrt(b) * up])
    offset = np.vstack([np.sqrt(a) * up, -np.sqrt(b) * up])
    keep = np.abs(offset[:, 2]) > 0
    vertical = np.array([0, 0, 1.0])
    found = heard(offset[keep], None, deviation[keep], vertical)
    assert found[0] == code
    assert ("along z the offsets point with the deviation" in found[1]) == bool(code)
    assert found[2] == (4 if code else None)
    assert heard(offset[keep], None, deviation[keep])[0] == ""
    assert heard(offset[keep], None, deviation[keep], np.array([1.0, 0, 0]))[0] == ""


@pytest.mark.parametrize(("size", "code"), [(1.9e-6, ""), (2.1e-6, "CS5027")])
def test_a_height_that_is_rounded_is_not_judged(size: float, code: str) -> None:
    deviation = np.tile([1e-4, 0, size], (5, 1))
    assert heard(deviation * [-1, 1, 1], None, deviation, np.array([0, 0, 1.0]))[0] == code


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

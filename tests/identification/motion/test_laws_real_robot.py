"""The two public records of a real KUKA KR300 (docs/real-data.md), read from the folder COMPSTIFF_REAL_DATA names."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from identification.motion.band import BAND
from identification.motion.log_file import MotionLog, read_motion_log
from identification.motion.prediction import held_out
from identification.motion.procedure import diagnose_axes
from identification.motion.stiffness import DISAGREE, axis_stiffness
from identification.motion.transmission import find_transmission


@pytest.fixture(scope="module")
def records() -> tuple[MotionLog, MotionLog]:
    named = os.environ.get("COMPSTIFF_REAL_DATA")
    if not named:
        pytest.skip("COMPSTIFF_REAL_DATA names no folder with measured records; they are not part of the project")
    found = sorted(Path(named).rglob("data_[AB].mat"))
    if len(found) != 2:
        pytest.skip(f"no data_A.mat and data_B.mat under COMPSTIFF_REAL_DATA={named}")
    return read_motion_log(found[0]), read_motion_log(found[1])


def test_axes_with_link_encoder(records: tuple[MotionLog, MotionLog]) -> None:
    assert [list(record.joints) for record in records] == [[1, 2, 3], [1, 2, 3]]


# Long: such a delay is named in test_laws_hidden_effects.py; of these records the other tests here say what is found in them.
@pytest.mark.long
@pytest.mark.parametrize("order", [(0, 1), pytest.param((1, 0), marks=pytest.mark.long)])
def test_the_link_encoders_were_recorded_late(records: tuple[MotionLog, MotionLog], order: tuple[int, int]) -> None:
    for one in diagnose_axes([records[order[0]]], records[order[1]], replicates=49):
        assert one.verdict == "named"
        delay = next(cause for cause in one.causes if cause.shape.name == "channel_delay (link)")
        assert delay.probability > 0.99
        assert 2.4e-3 < delay.values[0] < 3.2e-3
        assert one.gain is not None
        assert one.gain.explained[0] < 0.7
        assert one.gain.explained[1] > 0.98
        assert one.gain.interval[0] > 3
        moved = records[order[1]].less(one.joint, np.full(len(records[order[1]].time), np.radians(0.14)))
        again = held_out(one.joint, BAND, one.named, one.transmission, list(one.records), moved)[0]
        assert again.ratio == pytest.approx(one.gain.ratio, rel=1e-6)
        assert again.with_zero[0] / again.with_zero[1] < 1.2


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
@pytest.mark.parametrize(("joint", "cycles", "urad"), [(2, [412.6, 826.3, 1239.6, 1652.9], 91), (3, [678.2, 1356.2], 28)])
def test_lines_of_one_record_are_found_again_in_the_other(
    records: tuple[MotionLog, MotionLog], order: tuple[int, int], joint: int, cycles: list[float], urad: float
) -> None:
    found = find_transmission(joint, [records[order[0]]], records[order[1]])
    for each in cycles:
        assert np.min(np.abs(found.cycles - each)) < 2.5
    assert np.max(np.abs(found.amplitudes([records[order[1]]]))) == pytest.approx(1e-6 * urad, rel=0.1)


def test_the_smooth_part_of_one_axis_goes_on_where_the_record_was_not(records: tuple[MotionLog, MotionLog]) -> None:
    a, b = records
    assert [find_transmission(joint, [a], b).smooth is not None for joint in (1, 2, 3)] == [True, False, False]
    assert b.joints[1].angle.max() < a.joints[1].angle.min() + 0.01


def test_a_stiffness_that_is_refused_otherwise(records: tuple[MotionLog, MotionLog]) -> None:
    both = list(records)
    found = find_transmission(2, both, None)
    assert axis_stiffness(2, both).refused
    beside = axis_stiffness(2, both, found)
    assert not beside.refused
    assert beside.apart < 1.96


def test_records_agree_within_what_they_state(records: tuple[MotionLog, MotionLog]) -> None:
    for joint in (1, 2, 3):
        one = axis_stiffness(joint, list(records))
        assert one.apart < DISAGREE
        assert one.grade != "reliable"

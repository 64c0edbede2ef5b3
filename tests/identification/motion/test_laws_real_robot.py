"""The two public records of a real KUKA KR300 (docs/real-data.md), read from the folder COMPSTIFF_REAL_DATA names."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from identification.motion.log_file import MotionLog, read_motion_log
from identification.motion.procedure import diagnose_axes
from identification.motion.stiffness import DISAGREE, axis_stiffness


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


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_the_link_encoders_were_recorded_late(records: tuple[MotionLog, MotionLog], order: tuple[int, int]) -> None:
    for one in diagnose_axes([records[order[0]]], records[order[1]]):
        assert one.verdict == "named"
        delay = next(cause for cause in one.causes if cause.shape.name == "channel_delay (link)")
        assert delay.probability > 0.99
        assert 2.4e-3 < delay.values[0] < 3.2e-3
        assert one.gain is not None
        assert one.gain.explained[0] < 0.7
        assert one.gain.explained[1] > 0.95
        assert one.gain.interval[0] > 1.5


def test_records_agree_within_what_they_state(records: tuple[MotionLog, MotionLog]) -> None:
    for joint in (1, 2, 3):
        one = axis_stiffness(joint, list(records))
        assert one.apart < DISAGREE
        assert one.grade != "reliable"

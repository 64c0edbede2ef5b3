"""Posture advice: what it promises of another turn about the tool's axis is what the independent arm does there."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.runs.command_line import user_files as kit
from tests.runs.command_line.test_placement import line
from tests.runs.command_line.user_files import IRB6660, TOOL, Frame, Job, K, Rotation

FORCE = np.array([250.0, 60.0, -40.0])


def test_the_gain_is_what_the_turned_tool_gets(tmp_path: Path) -> None:
    path = line(8, 10)
    forces = "target,fx_n,fy_n,fz_n\n" + "".join(f"{i},{FORCE[0]},{FORCE[1]},{FORCE[2]}\n" for i in range(8))
    job = Job(tmp_path, program=path.program(), forces=forces)
    plain = job.correct("--json")
    result = job.correct("--json", "--force", "--advise")
    assert result.code == 0
    assert "posture" not in plain.json["result"]
    told = result.json["result"]["posture"]
    low, high = told["possible_deg"]
    assert low <= told["turn_deg"] <= high
    assert told["targets"] == 8

    def rms(degrees: float) -> float:
        about, q, squares = Rotation.from_euler("z", degrees, degrees=True), kit.START, []
        for frame in path.frames:
            for share in (0.25, 0.5, 0.75, 1.0) if q is kit.START else (1.0,):
                part = Rotation.from_rotvec(share * about.as_rotvec())
                q = kit.solve(IRB6660, kit.work_object() @ Frame(frame.p, frame.r * part) @ TOOL.inv(), q)
            squares.append(np.sum(kit.deviation(IRB6660, q, TOOL.p, np.r_[FORCE, 0, 0, 0], K) ** 2))
        return float(1e6 * np.sqrt(np.mean(squares)))

    assert told["rms_um"][0] == pytest.approx(rms(0.0), rel=1e-3)
    assert told["rms_um"][1] == pytest.approx(rms(told["turn_deg"]), rel=1e-3)
    assert told["gain"] == pytest.approx(1 - told["rms_um"][1] / told["rms_um"][0], abs=1e-3)
    for other in np.linspace(max(low, told["turn_deg"] - 10), min(high, told["turn_deg"] + 10), 3):
        assert rms(other) >= told["rms_um"][1] - 0.1
    assert "Posture:" in job.correct("--force", "--advise").out


def test_turns_end_where_a_joint_does(tmp_path: Path) -> None:
    """The range ends by a reason, and one step beyond it the arm is outside its limits, out of reach or at the singularity."""
    path = line(3, 10)
    job = Job(tmp_path, program=path.program(), forces="target,fx_n,fy_n,fz_n\n0,0,100,0\n1,0,100,0\n2,0,100,0\n")
    told = job.correct("--json", "--advise").json["result"]["posture"]
    for end, why in zip(told["possible_deg"], told["ends_by"], strict=True):
        assert abs(end) <= 180
        assert (abs(end) == 180) == (why == "half a turn")

"""Logs along the path that hold two passes, or metres: refused, where their forces would be the mean of both or of nothing."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.runs.command_line import user_files as kit
from tests.runs.command_line.test_placement import line
from tests.runs.command_line.user_files import Job

PLACE = np.arange(0.0, 190.1, 0.5)


def log(header: str, places: np.ndarray, share: float = 1.0) -> str:
    rows = "".join(",".join(f"{value:.6f}" for value in np.atleast_1d(place)) + f",{90 * share},{-150 * share},{60 * share}\n"
                   for place in places)
    return f"{header},fx_n,fy_n,fz_n\n{rows}" if header else rows


def test_two_passes_by_path_length_are_not_averaged(tmp_path: Path) -> None:
    """The second pass feels 0.4 of the force: the mean is the force of neither. A path length that flickers is one pass."""
    path = line(20, 10)
    twice = log("path_mm", PLACE) + log("", PLACE, 0.4)
    result = Job(tmp_path, program=path.program(), forces=twice).correct("--json")
    assert result.code == 1
    assert "CS3119" in kit.codes(result)
    flickers = log("path_mm", PLACE + 1.5 * np.sin(40 * PLACE))
    assert Job(tmp_path, program=path.program(), forces=flickers).correct().code == 0


@pytest.mark.parametrize("header", ["path_mm", "x_mm,y_mm,z_mm"])
def test_metres_are_told_where_some_samples_lie_on_the_path(tmp_path: Path, header: str) -> None:
    """Samples near the zero of the path, or of a work object that stands on it, lie on the path in any unit."""
    path = line(20, 10)
    places, program = PLACE / 1e3, path.program()
    if header != "path_mm":
        start, end = path.at(path.xyz[0])[0], path.at(path.xyz[-1])[0]
        middle = 0.5 * (start + end)
        frames = [kit.Frame(frame.p - middle / 1e3, frame.r) for frame in path.frames]
        program = kit.module([kit.move(kit.robtarget(f, kit.confdata(q), digits=8))
                              for f, q in zip(frames, path.q, strict=True)])
        places = (start - middle) / 1e3 + np.multiply.outer(PLACE / PLACE[-1], (end - start) / 1e3)
    result = Job(tmp_path, program=program, forces=log(header, places)).correct("--json")
    assert result.code == 1
    found = next(finding for finding in result.json["findings"] if finding["code"] == "CS3005")
    assert "in metres" in found["hint"]

"""Places of a toolpath: right ones are left in peace, metres and a column rapid that is the wrong way round are told."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.passes import SAFE_MM, drawn
from compensator.posting.campath import CamPath
from compensator.posting.odd_places import said_of_places
from identification.model.rotations import Frame

TOOL = Frame(np.eye(3), np.array([0.12, 0, 0.25]))


def path(points_mm: np.ndarray, rapid: np.ndarray, unit: float = 1e-3) -> CamPath:
    """The tool upright, its z down into the part."""
    count = len(points_mm)
    return CamPath("path.csv", "CSV", np.ones(count, dtype=np.uint8), np.arange(count) + 2, unit * points_mm, None,
                   np.tile([0.0, 1, 0, 0], (count, 1)), rapid, np.where(rapid, np.nan, 0.04), np.zeros(count, dtype=bool),
                   None, None, {}, ())


def codes(cam_path: CamPath) -> list[str]:
    return [finding.code for finding in said_of_places(cam_path, TOOL)]


@pytest.mark.parametrize("seed", range(40))
def test_right_paths_are_left_in_peace_and_slips_are_told(seed: int) -> None:
    """Rasters and spirals over a surface that rises and falls, with their clearance above its highest place."""
    rng = np.random.default_rng((4308, seed))
    points = drawn(rng).points.copy()
    rapid = points[:, 2] == SAFE_MM
    x, y = points[:, 0] / rng.uniform(5, 60), points[:, 1] / rng.uniform(5, 60)
    points[~rapid, 2] += rng.uniform(0, 5) * (np.sin(x) * np.cos(y))[~rapid]
    assert codes(path(points, rapid)) == []
    assert codes(path(points, rapid, unit=1e-6)) == (["CS4308"] if len(points) >= 10 else [])
    if rapid.sum() >= 5:
        assert codes(path(points, ~rapid)) == ["CS4309"]

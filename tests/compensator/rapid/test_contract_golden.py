"""Whole programs in the styles of several producers, corrected, against files that were checked by eye.

programs/NAME holds what was posted (made up for these tests), programs/NAME.corrected what is written for the offsets here.
"""

from pathlib import Path

import numpy as np
import pytest

from compensator.rapid import read_rapid, rewrite

PROGRAMS = Path(__file__).parent / "programs"
# targets, their offsets [mm], and a turn by 2 mrad about z for the last of them
CASES = {
    "robodk.mod": ([2, 3, 4, 5], [[0.012, -0.034, 0.1], [0.012, -0.034, 0.1], [0, -0.05, 0.09], [-0.02, 0, 0.08]]),
    "robotstudio.mod": ([2, 3, 4, 5], [[0.01, 0, 0], [0.02, 0.01, 0.03], [0.03, 0, 0], [0, 0, 0.5]]),
    "handwritten.sys": ([0, 1, 2], [[0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]]),
    "powermill.prg": ([0, 2], [[0.00004, 0.1, -4], [2, 0, 0]]),
}


def corrected(name: str):
    data = (PROGRAMS / name).read_bytes()
    program = read_rapid(data, name)
    targets, offsets = CASES[name]
    position = program.toolpath.position[targets] + np.array(offsets) / 1e3
    quaternion = program.toolpath.quaternion[targets].copy()
    w, x, y, z = quaternion[-1]
    c, s = np.cos(0.001), np.sin(0.001)
    quaternion[-1] = [c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w]
    return program, rewrite(program, targets, position, quaternion), position, quaternion


@pytest.mark.parametrize("name", CASES)
def test_written_program(name):
    _, written, _, _ = corrected(name)
    assert written.content.decode() == (PROGRAMS / f"{name}.corrected").read_bytes().decode()


@pytest.mark.parametrize("name", CASES)
def test_it_reads_back(name):
    program, written, position, quaternion = corrected(name)
    targets = CASES[name][0]
    before, after = program.toolpath, read_rapid(written.content, name).toolpath
    others = np.setdiff1d(np.arange(len(before)), targets)
    np.testing.assert_allclose(after.position[targets], position, rtol=0, atol=0.5e-7 + 1e-12)
    np.testing.assert_allclose(after.quaternion[targets], quaternion, rtol=0, atol=1e-8)
    np.testing.assert_array_equal(after.position[others], before.position[others])
    np.testing.assert_array_equal(after.quaternion[others], before.quaternion[others])
    for column in ("move", "confdata", "external", "joints", "tool", "workobject", "feed", "zone"):
        np.testing.assert_array_equal(getattr(after, column), getattr(before, column))
    assert after.block.tolist() == before.block.tolist()


@pytest.mark.parametrize(("name", "moves", "feeds"), [
    ("robodk.mod", [4, 0, 1, 1, 2, 3, 1], [0.5, 0.5, 0.02, 0.02, 0.02, 0.02, 0.02]),
    ("robotstudio.mod", [4, 0, 1, 1, 1, 1], [1, 1, 0.05, 0.05, 0.05, 1]),
    ("handwritten.sys", [1, 1, 1, 1], [0.015, 0.015, 0.015, 0.1]),
    ("powermill.prg", [1, 1, 1], [np.nan, 0.0333, np.nan]),
])
def test_moves_and_feeds(name, moves, feeds):
    toolpath = read_rapid((PROGRAMS / name).read_bytes(), name).toolpath
    assert toolpath.move.tolist() == moves
    np.testing.assert_allclose(toolpath.feed, feeds, rtol=1e-12)

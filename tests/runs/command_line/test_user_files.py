"""The kit's fast arm is the arm of tests/virtual_cell."""

from __future__ import annotations

import numpy as np
import pytest

from tests.runs.command_line import user_files as kit
from tests.virtual_cell.arm import ARMS


@pytest.mark.parametrize("name", sorted(ARMS))
def test_the_fast_arm_is_the_arm(name: str) -> None:
    arm, rng = ARMS[name], np.random.default_rng(1)
    q, tcp = rng.uniform(-0.6, 0.6, 6) + np.array([0, 0, 0.3, 0, 0.9, 0]), np.array([0.1, -0.05, 0.3])
    wrench = np.array([200.0, -300, 150, 20, -10, 30])
    np.testing.assert_allclose(kit.point(arm, q, tcp)[0], arm.pose(q, tcp)[0], atol=1e-14)
    np.testing.assert_allclose(kit.point(arm, q, tcp)[1], arm.pose(q, tcp)[1].as_matrix(), atol=1e-14)
    np.testing.assert_allclose(kit.deviation(arm, q, tcp, wrench, kit.K), arm.deviation(q, tcp, wrench, kit.K)[0], atol=2e-11)
    many = np.array([q, q + 0.1, q - 0.2]), np.array([wrench, 2 * wrench, -wrench])
    one_by_one = [kit.deviation(arm, angles, tcp, load, kit.K) for angles, load in zip(*many, strict=True)]
    np.testing.assert_allclose(kit.deviation(arm, many[0], tcp, many[1], kit.K), one_by_one, atol=1e-14)
    pose = kit.tcp_pose(arm, q, kit.TOOL)
    np.testing.assert_allclose(kit.solve(arm, pose @ kit.TOOL.inv(), q + 0.05), q, atol=1e-10)

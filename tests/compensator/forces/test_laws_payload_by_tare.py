"""A payload that stretches of a tare tell: its weight and moment are gone from the cut, whatever tool the first move names."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import compstiff
from tests.runs.command_line import user_files as kit
from tests.runs.command_line.user_files import IRB6660, TOOL

MASS, CENTRE = 6.0, np.array([0.03, -0.05, -0.12])
BIAS, FORCE = np.array([3, -4, 5, 0.3, -0.2, 0.1]), np.array([60.0, -90, 40])
AIR = [[10, 20, 20, 5, 30, 10], [10, 20, 20, 5, 100, 10], [10, 20, 20, 90, 80, 10], [10, 20, 20, 5, 30, 100]]
CUT = [[10 + 0.2 * k, 20, 20, 5, 30, 10] for k in range(6)]
HOME = f"    MoveAbsJ [[0,0,0,0,30,0],{kit.E}],v50,fine,tool0;"
SENSOR = kit.Frame.mm([10.0, 20.0, 90.0], kit.quaternion(Rotation.from_euler("zx", [30, 10], degrees=True)))


@pytest.mark.parametrize("home", [(), (HOME,)])
@pytest.mark.parametrize("frame", ["tool", "sensor"])
def test_the_payload_s_moment_is_gone_from_the_cut(tmp_path: Path, home: tuple[str, ...], frame: str) -> None:
    """By the independent arm: the moment about the log's own origin of what hangs at its centre, and a force of the cut at the
    tip that has none about it."""
    rng, moves, rows = np.random.default_rng(1), list(home), []
    of_tool = kit.Frame(np.zeros(3), Rotation.identity()) if frame == "tool" else TOOL.inv() @ SENSOR
    for k, degrees in enumerate(AIR + CUT):
        q = np.radians(degrees)
        pose = kit.tcp_pose(IRB6660, q, TOOL)
        moves.append(kit.move(kit.robtarget(kit.work_object(base=kit.IDENTITY).inv() @ pose, kit.confdata(q), digits=9),
                              "MoveJ" if k < len(AIR) else "MoveL"))
        to_log = (pose @ of_tool).r.inv()
        weight = to_log.apply([0, 0, -9.80665 * MASS])
        load = np.concatenate([weight, np.cross(CENTRE, weight)]) + BIAS
        if k >= len(AIR):
            force = to_log.apply(FORCE)
            load += np.concatenate([force, np.cross(of_tool.inv().p, force)])
        rows += [f"{k + len(home)}," + ",".join(f"{v:.5f}" for v in load + rng.normal(0, [0.3] * 3 + [0.01] * 3))
                 for _ in range(60)]
    (tmp_path / "forces.csv").write_text("target,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm\n" + "\n".join(rows) + "\n")
    (tmp_path / "part.mod").write_text(kit.module(moves))
    (tmp_path / "stiffness.json").write_text(kit.stiffness_text())
    stands = "" if frame == "tool" else (f", sensor_position_mm: {(1e3 * SENSOR.p).tolist()}, sensor_quaternion: "
                                         f"{kit.quaternion(SENSOR.r).tolist()}")
    (tmp_path / "cell.yaml").write_text(kit.cell_text(
        base=kit.IDENTITY, extra=f"force_log: {{frame: {frame}, sign: on_tool{stands}}}\n"))
    cell = compstiff.read_cell(tmp_path / "cell.yaml")
    stretches = [(k + len(home), k + len(home)) for k in range(len(AIR))]
    stretches[0] = (0, len(home))           # from the move home on, at which the log was not yet running
    settings = compstiff.Settings.of(tare=tuple(stretches))
    found = compstiff.predict(cell, compstiff.read_toolpath(tmp_path / "part.mod", cell),
                              compstiff.read_stiffness(tmp_path / "stiffness.json", cell), tmp_path / "forces.csv", settings)
    wrench = found.forces.wrench[-len(CUT):]
    np.testing.assert_allclose(wrench[:, :3], np.tile(FORCE, (len(CUT), 1)), atol=0.3)
    np.testing.assert_allclose(wrench[:, 3:], 0, atol=0.1)
    (told,) = [finding for finding in found.findings if finding.code == "CS3033"]
    assert told.message.startswith("payload 6.0")
    assert "centre 30.0, -50.0, -1" in told.message
    assert not found.forces.forced[:len(home) + len(AIR)].any()

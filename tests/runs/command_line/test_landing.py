"""The loaded arm, commanded to the corrected target, lands on the planned pose: whatever frame the force was logged in."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.runs.command_line import user_files as kit
from tests.runs.command_line.user_files import BASE, IRB6660, OBJECT, TOOL, USER, Frame, Job, K
from tests.virtual_cell.arm import IRB6700

COUNT = 24
POSITION, ANGLE = 0.2e-6, 1e-7
SENSOR = Frame.mm([15.0, -25.0, 60.0], kit.quaternion(Rotation.from_euler("zyx", [120, 10, -5], degrees=True)))


@pytest.fixture(scope="module")
def path() -> np.ndarray:
    return kit.rod_path(COUNT)


@pytest.fixture(scope="module")
def wrench() -> np.ndarray:
    rng = np.random.default_rng(11)
    return np.concatenate([rng.uniform(-250, 250, (COUNT, 3)), rng.uniform(-25, 25, (COUNT, 3))], axis=1)


def planned(path: np.ndarray) -> list[Frame]:
    return [kit.work_object().inv() @ kit.tcp_pose(IRB6660, q, TOOL) for q in path]


def program(path: np.ndarray) -> str:
    return kit.module([kit.move(kit.robtarget(p, kit.confdata(q))) for p, q in zip(planned(path), path, strict=True)])


def log(values: np.ndarray) -> str:
    head = "target,fx_n,fy_n,fz_n" + (",mx_nm,my_nm,mz_nm" if values.shape[1] == 6 else "")
    return head + "\n" + "".join(f"{i}," + ",".join(f"{v:.9f}" for v in row) + "\n" for i, row in enumerate(values))


def check(job: Job, path: np.ndarray, wrench: np.ndarray, k: np.ndarray = K) -> None:
    result = job.correct()
    assert result.code == 0, result
    before, after = (kit.targets_of(t) for t in (str(job.program), job.out.read_text()))
    assert len(before) == len(after) == COUNT
    for plan, command, q, w in zip(before, after, path, wrench, strict=True):
        distance, angle = kit.lands(command, plan, q, w, k=k)
        assert distance < POSITION
        assert angle < ANGLE


def as_logged(path: np.ndarray, wrench: np.ndarray, frame: str) -> np.ndarray:
    """The wrench [N, N m] a sensor in that frame shows: about the TCP for base and tool, about its own origin for sensor."""
    out = []
    for q, w in zip(path, wrench, strict=True):
        flange = kit.tcp_pose(IRB6660, q, kit.IDENTITY)
        turn = {"base": Rotation.identity(), "tool": flange.r * TOOL.r, "sensor": flange.r * SENSOR.r}[frame]
        force, moment = w[:3], w[3:]
        if frame == "sensor":
            moment = moment + np.cross(flange.r.apply(TOOL.p - SENSOR.p), force)
        out.append(np.concatenate([turn.inv().apply(force), turn.inv().apply(moment)]))
    return np.array(out)


@pytest.mark.parametrize("sign", ["on_tool", "by_tool"])
@pytest.mark.parametrize("moments", [False, True])
@pytest.mark.parametrize("frame", ["base", "tool"])
def test_frames(tmp_path: Path, path: np.ndarray, wrench: np.ndarray, frame: str, moments: bool, sign: str) -> None:
    w = wrench.copy()
    if not moments:
        w[:, 3:] = 0
    values = as_logged(path, w, frame)[:, : 6 if moments else 3]
    cell = kit.cell_text(extra=f"force_log: {{frame: {frame}, sign: {sign}}}\n")
    check(Job(tmp_path, cell, program(path), forces=log(values if sign == "on_tool" else -values)), path, w)


@pytest.mark.parametrize("sign", ["on_tool", "by_tool"])
def test_sensor_frame_with_moments(tmp_path: Path, path: np.ndarray, wrench: np.ndarray, sign: str) -> None:
    """Moments are `at the TCP` in the log whatever the frame: only the axes are the sensor's."""
    flange = [kit.tcp_pose(IRB6660, q, kit.IDENTITY).r * SENSOR.r for q in path]
    values = np.array(
        [np.concatenate([r.inv().apply(w[:3]), r.inv().apply(w[3:])]) for r, w in zip(flange, wrench, strict=True)]
    )
    about_sensor = as_logged(path, wrench, "sensor")
    cell = kit.cell_text(
        extra=f"""force_log:
  frame: sensor
  sign: {sign}
  sensor_position_mm: [{", ".join(f"{v:.9f}" for v in SENSOR.p * 1e3)}]
  sensor_quaternion: [{", ".join(f"{v:.12f}" for v in kit.quaternion(SENSOR.r))}]
"""
    )
    assert not np.allclose(values, about_sensor)
    factor = 1 if sign == "on_tool" else -1
    check(Job(tmp_path, cell, program(path), forces=log(factor * about_sensor)), path, wrench)


def test_sensor_frame_forces_only(tmp_path: Path, path: np.ndarray, wrench: np.ndarray) -> None:
    w = wrench.copy()
    w[:, 3:] = 0
    cell = kit.cell_text(
        extra=f"""force_log:
  frame: sensor
  sensor_position_mm: [{", ".join(f"{v:.9f}" for v in SENSOR.p * 1e3)}]
  sensor_quaternion: [{", ".join(f"{v:.12f}" for v in kit.quaternion(SENSOR.r))}]
"""
    )
    check(Job(tmp_path, cell, program(path), forces=log(as_logged(path, w, "sensor")[:, :3])), path, w)


def test_a_stiffness_file_with_covariance_only(tmp_path: Path, path: np.ndarray, wrench: np.ndarray) -> None:
    check(Job(tmp_path, program=program(path), forces=log(wrench), stiffness=kit.stiffness_text(log=False)), path, wrench)


def test_log_compliance_wins_over_the_reader_s_numbers(tmp_path: Path, path: np.ndarray, wrench: np.ndarray) -> None:
    """`log_compliance` is what predict and correct use; estimate and covariance are for readers."""
    soft = K * 0.7
    text = kit.stiffness_text(log_compliance={"mean": (-np.log(soft)).tolist(), "covariance": (4e-4 * np.eye(6)).tolist()})
    job = Job(tmp_path, program=program(path), forces=log(wrench), stiffness=text).write()
    result = kit.run(*job.arguments())
    if result.code == 0:  # a file that contradicts itself may be refused, but not read the other way
        for plan, command, q, w in zip(planned(path), kit.targets_of(job.out.read_text()), path, wrench, strict=True):
            assert kit.lands(command, plan, q, w, k=soft)[0] < POSITION + 1e-9
    else:
        assert result.code == 1


def test_heavy_load(tmp_path: Path, path: np.ndarray, wrench: np.ndarray) -> None:
    """Kilonewtons on a soft arm: the fixed point is converged, not one mirrored step."""
    soft = K / 8
    cell = kit.cell_text(extra="limits: {max_offset_mm: 50, max_tilt_deg: 10}\n")
    check(
        Job(tmp_path, cell, program(path), forces=log(wrench * 4), stiffness=kit.stiffness_text(soft)), path, wrench * 4, soft
    )


def test_cell_s_tool_and_work_object_for_a_module_without(tmp_path: Path, path: np.ndarray, wrench: np.ndarray) -> None:
    moves = [kit.move(kit.robtarget(p, kit.confdata(q))) for p, q in zip(planned(path), path, strict=True)]
    merged = USER @ OBJECT
    cell = kit.cell_text(extra=f"workobject: {kit.yaml_frame(merged)}\n")
    job = Job(tmp_path, cell, kit.module(moves, data=[]), forces=log(wrench))
    check(job, path, wrench)
    assert kit.run(*job.arguments("--force", "--json")).json["findings"], "a finding says that cell.yaml's were taken"


def test_module_wins_over_the_cell(tmp_path: Path, path: np.ndarray, wrench: np.ndarray) -> None:
    other = Frame.mm([0, 0, 300])
    cell = kit.cell_text(tool=other, extra="workobject: {position_mm: [5, 6, 7]}\n")
    stiff = kit.stiffness_text(tool=None)
    check(Job(tmp_path, cell, program(path), forces=log(wrench), stiffness=stiff), path, wrench)


def test_serial_robot(tmp_path: Path) -> None:
    arm, tool = IRB6700, Frame.mm([0, 50, 300], kit.quaternion(Rotation.from_euler("y", 20, degrees=True)))
    first = np.radians([-35.0, 20.0, 12.0, 40.0, -50.0, 100.0])
    start = kit.tcp_pose(arm, first, tool)
    moves, path = [], []
    q = first
    for s in range(6):
        at = Frame(start.p + np.array([0.0, 0.02, 0.01]) * s, start.r)
        q = kit.solve(arm, at @ tool.inv(), q)
        path.append(q)
        moves.append(f"MoveL {kit.robtarget(at, kit.confdata(q))},v50,z0,tMill;")
    w = np.random.default_rng(2).uniform(-300, 300, (6, 3))
    text = kit.module(moves, [kit.tooldata(tool)])
    stiff = kit.stiffness_text(robot="irb6700-200-2.60", load_path="serial", tool=None)
    job = Job(tmp_path, kit.cell_text("irb6700-200-2.60", tool, None), text, stiff, log(w))
    result = job.correct()
    assert result.code == 0, result
    for plan, command, q, f in zip(kit.targets_of(text), kit.targets_of(job.out.read_text()), path, w, strict=True):
        distance, angle = kit.lands(command, plan, q, np.r_[f, 0, 0, 0], obj=kit.IDENTITY, tool=tool, arm=arm)
        assert distance < POSITION
        assert angle < ANGLE


def test_offsets_columns(tmp_path: Path, path: np.ndarray, wrench: np.ndarray) -> None:
    """Signs, frames and the covariance, each worked out again."""
    wrench = wrench * (np.arange(COUNT) != 4)[:, None]
    correlation = 0.5
    job = Job(tmp_path, program=program(path), forces=log(wrench), stiffness=kit.stiffness_text(correlation=correlation))
    assert job.correct().code == 0
    rows = job.offsets()
    assert [int(r["target"]) for r in rows] == list(range(COUNT))
    assert [int(r["line"]) for r in rows] == [5 + i for i in range(COUNT)]
    plan, command = kit.targets_of(str(job.program)), kit.targets_of(job.out.read_text())
    np.testing.assert_allclose(kit.column(rows, "x_mm", "y_mm", "z_mm"), [p.p * 1e3 for p in plan], atol=2e-6)
    np.testing.assert_allclose(
        kit.column(rows, "ox_mm", "oy_mm", "oz_mm"), [(c.p - p.p) * 1e3 for c, p in zip(command, plan, strict=True)], atol=1e-4
    )
    turns = [np.degrees((c.r * p.r.inv()).as_rotvec()) for c, p in zip(command, plan, strict=True)]
    np.testing.assert_allclose(kit.column(rows, "orx_deg", "ory_deg", "orz_deg"), turns, atol=5e-6)
    assert rows[4]["ox_mm"] == "0"
    relative = 0.02**2 * (correlation + (1 - correlation) * np.eye(6))
    for row, q, w in zip(rows, path, wrench, strict=True):
        deviation = kit.deviation(IRB6660, q, TOOL.p, w, K) * 1e6
        np.testing.assert_allclose(kit.column([row], "dx_um", "dy_um", "dz_um")[0], deviation, atol=2e-3)
        slope = np.array(
            [
                (
                    kit.deviation(IRB6660, q, TOOL.p, w, K * (1 - 1e-3 * e))
                    - kit.deviation(IRB6660, q, TOOL.p, w, K * (1 + 1e-3 * e))
                )
                / 2e-3
                for e in np.eye(6)
            ]
        ).T
        # And 0.2 % of the deviation for the arm's own weight, of which the robot file says nothing.
        sigma = np.sqrt(np.diag(slope @ relative @ slope.T) * 1e12 + (0.002 * np.linalg.norm(deviation)) ** 2 / 3)
        np.testing.assert_allclose(kit.column([row], "sx_um", "sy_um", "sz_um")[0], sigma, rtol=0.02, atol=2e-3)


def test_predict_says_what_correct_says(tmp_path: Path, path: np.ndarray, wrench: np.ndarray) -> None:
    job = Job(tmp_path, program=program(path), forces=log(wrench))
    assert job.correct().code == 0
    assert job.predict().code == 0
    names = ["target", "line", "x_mm", "y_mm", "z_mm", "dx_um", "dy_um", "dz_um", "sx_um", "sy_um", "sz_um"]
    both = [kit.table(f) for f in (job.offsets_file, tmp_path / "deviation.csv")]
    assert [[r[n] for n in names] for r in both[0]] == [[r[n] for n in names] for r in both[1]]


def test_covariance_only_and_log_compliance_give_one_sigma(tmp_path: Path, path: np.ndarray, wrench: np.ndarray) -> None:
    sigma = []
    for log_compliance in (True, False):
        job = Job(tmp_path, program=program(path), forces=log(wrench), stiffness=kit.stiffness_text(log=log_compliance))
        assert job.correct("--force").code == 0
        sigma.append(kit.column(job.offsets(), "sx_um", "sy_um", "sz_um"))
    np.testing.assert_allclose(sigma[0], sigma[1], rtol=2e-3)


def test_nothing_but_the_base_frame_moved(tmp_path: Path, path: np.ndarray, wrench: np.ndarray) -> None:
    """The whole world turned, base frame and user frame alike: the corrected numbers in the work object stay."""
    world = Frame.mm([-300, 700, 90], kit.quaternion(Rotation.from_euler("zx", [70, 12], degrees=True)))
    texts = []
    for index, (base, user) in enumerate([(BASE, USER), (world @ BASE, world @ USER)]):
        folder = tmp_path / str(index)
        folder.mkdir()
        moves = [kit.move(kit.robtarget(p, kit.confdata(q))) for p, q in zip(planned(path), path, strict=True)]
        job = Job(folder, kit.cell_text(base=base), kit.module(moves, [kit.tooldata(), kit.wobjdata(user)]), forces=log(wrench))
        assert job.correct().code == 0
        texts.append(kit.targets_of(job.out.read_text()))
    for a, b in zip(*texts, strict=True):
        np.testing.assert_allclose(a.p, b.p, atol=3e-9 * 100)

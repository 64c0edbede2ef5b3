"""Which samples a target gets: by number, path length, position and joint angles, checked through the predicted deviation."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from tests.runs.command_line import user_files as kit
from tests.runs.command_line.user_files import IRB6660, TOOL, Frame, Job, K

ORIGIN = kit.work_object().inv() @ kit.tcp_pose(IRB6660, kit.START, TOOL)
G = np.array([40.0, -25.0, 15.0])  # force per place: F = F0 + G * s / 10 mm
F0 = np.array([60.0, 90.0, -120.0])


@dataclass
class Path3:
    """Points in a plane of the work object [mm], all of one orientation, and their joint angles."""

    xyz: np.ndarray

    def __post_init__(self) -> None:
        self.frames = [Frame(ORIGIN.p + ORIGIN.r.apply(p / 1e3), ORIGIN.r) for p in self.xyz]
        q, self.q = kit.START, []
        for frame in self.frames:
            q = kit.solve(IRB6660, kit.work_object() @ frame @ TOOL.inv(), q)
            self.q.append(q)
        self.text = [kit.robtarget(f, kit.confdata(q), digits=8) for f, q in zip(self.frames, self.q, strict=True)]

    def program(self) -> str:
        return kit.module([kit.move(t) for t in self.text])

    def at(self, xyz: np.ndarray) -> np.ndarray:
        """Position in the work object [mm] of a point given in the plane."""
        return np.asarray([(ORIGIN.p + ORIGIN.r.apply(p / 1e3)) * 1e3 for p in np.atleast_2d(xyz)])


def force(s: float | np.ndarray) -> np.ndarray:
    return F0 + np.multiply.outer(np.asarray(s) / 10, G)


def expect(
    job: Job, q: list[np.ndarray], forces: list[np.ndarray | None], *options: str, atol: float = 0.05
) -> list[dict[str, str]]:
    """The deviation of each target is that of the force named (None: not judged, no deviation)."""
    result = job.correct(*options)
    assert result.code == 0, result
    rows = job.offsets()
    assert len(rows) == len(q)
    for row, joints, f in zip(rows, q, forces, strict=True):
        seen = kit.column([row], "dx_um", "dy_um", "dz_um")[0]
        if f is None:
            assert not np.any(np.nan_to_num(seen)), row
            assert not np.any(np.nan_to_num(kit.column([row], "ox_mm", "oy_mm", "oz_mm"))), row
        else:
            np.testing.assert_allclose(
                seen, kit.deviation(IRB6660, joints, TOOL.p, np.r_[f, 0, 0, 0], K) * 1e6, atol=atol, err_msg=str(row)
            )
    return rows


def line(count: int, step: float) -> Path3:
    return Path3(np.array([[i * step, 0, 0] for i in range(count)], dtype=float))


def test_mean_of_the_samples_of_a_target(tmp_path: Path) -> None:
    path = line(4, 10)
    rows = [(1, 100, 0, 0), (0, 10, 20, 30), (1, 200, -30, 0), (3, 0, 0, 50), (1, 300, 0, 90)]
    text = "target,fx_n,fy_n,fz_n\n" + "".join(",".join(map(str, r)) + "\n" for r in rows)
    out = expect(
        Job(tmp_path, program=path.program(), forces=text),
        path.q,
        [np.array([10, 20, 30]), np.array([200, -10, 30]), None, np.array([0, 0, 50])],
    )
    assert [int(r["samples"]) for r in out] == [1, 3, 0, 1]


@pytest.mark.parametrize("moves", ["uniform", "uneven"])
def test_path_mm_half_a_segment_on_either_side(tmp_path: Path, moves: str) -> None:
    steps = np.array([0, 10, 10, 10, 10] if moves == "uniform" else [0, 12, 4, 20, 8], dtype=float)
    places = np.cumsum(steps)
    path = Path3(np.array([[s, 0, 0] for s in places]))
    s = np.arange(0.13, places[-1], 0.25)
    text = "path_mm,fx_n,fy_n,fz_n\n" + "".join(
        f"{a:.4f},{f[0]:.6f},{f[1]:.6f},{f[2]:.6f}\n" for a, f in zip(s, force(s), strict=True)
    )
    middle = (places[1:] + places[:-1]) / 2
    low, high = np.r_[-1, middle], np.r_[middle, 1e9]
    inside = [(s >= a) & (s < b) for a, b in zip(low, high, strict=True)]
    rows = expect(Job(tmp_path, program=path.program(), forces=text), path.q, [force(s[i]).mean(axis=0) for i in inside])
    assert [int(r["samples"]) for r in rows] == [int(i.sum()) for i in inside]


def test_path_mm_counts_arcs_joint_moves_and_air(tmp_path: Path) -> None:
    """MoveJ, MoveL, MoveC (two targets, arc lengths), MoveAbsJ (chord), MoveL; samples at the targets only."""
    r = 20.0
    xyz = np.array([[0, 0, 0], [10, 0, 0], [10 + r, r, 0], [10, 2 * r, 0], [0, 2 * r, 0], [0, 2 * r, 15], [0, 2 * r, 30]])
    path = Path3(xyz)
    degrees = ",".join(f"{v:.10f}" for v in np.degrees(path.q[5]))
    moves = [
        kit.move(path.text[0], "MoveJ"),
        kit.move(path.text[1]),
        f"    MoveC {path.text[2]},{path.text[3]},v50,z1,tMill\\WObj:=wPart;",
        kit.move(path.text[4]),
        f"    MoveAbsJ [[{degrees}],{kit.E}],v50,z1,tMill\\WObj:=wPart;",
        kit.move(path.text[6]),
    ]
    quarter = math.pi * r / 2
    s = np.cumsum([0, 10, quarter, quarter, 10, 15, 15])
    # three samples close round each target; the joint move's target has none
    rows, forces = ["path_mm,fx_n,fy_n,fz_n"], []
    for i, a in enumerate(s):
        f = force(5.0 * i)
        forces.append(f if i not in (0, 5) else None)
        if i not in (0, 5):
            rows += [f"{a + d:.4f},{f[0]},{f[1]},{f[2]}" for d in (-2.0, 0.0, 2.0) if 0 <= a + d <= s[-1]]
    job = Job(tmp_path, program=kit.module(moves), forces="\n".join(rows) + "\n")
    out = expect(job, path.q, forces, "--keep-targets")
    assert [int(r["samples"]) for r in out] == [0, 3, 3, 3, 3, 0, 2]
    plan, command = kit.targets_of(str(job.program)), kit.targets_of(job.out.read_text())
    order = [0, 1, 2, 3, 4, 6]
    for p, c, i in zip(plan, command, order, strict=True):
        f = forces[i]
        if f is None:
            assert np.array_equal(p.p, c.p)
        else:
            distance, angle = kit.lands(c, p, path.q[i], np.r_[f, 0, 0, 0])
            assert distance < 0.2e-6
            assert angle < 1e-7
    joint = next(text for text in str(job.program).splitlines() if "MoveAbsJ" in text)
    assert joint in job.out.read_text().splitlines()


def xyz_log(path: Path3, points: np.ndarray, forces: np.ndarray) -> str:
    at = path.at(points)
    return "x_mm,y_mm,z_mm,fx_n,fy_n,fz_n\n" + "".join(
        ",".join(f"{v:.6f}" for v in (*a, *f)) + "\n" for a, f in zip(at, forces, strict=True)
    )


def along(xyz: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Points every `step` mm along a polyline, offset from its corners, and their path lengths."""
    s = np.r_[0, np.cumsum(np.linalg.norm(np.diff(xyz, axis=0), axis=1))]
    at = np.arange(0.31 * step, s[-1], step)
    return np.array([np.interp(at, s, xyz[:, i]) for i in range(3)]).T, at


def windows(xyz: np.ndarray, s: np.ndarray) -> list[np.ndarray]:
    place = np.r_[0, np.cumsum(np.linalg.norm(np.diff(xyz, axis=0), axis=1))]
    middle = (place[1:] + place[:-1]) / 2
    return [(s >= a) & (s < b) for a, b in zip(np.r_[-1, middle], np.r_[middle, 1e9], strict=True)]


SHAPES = {
    # passes that cross: a figure of eight of straight lines
    "crossing": [[0, 0, 0], [20, 20, 0], [40, 40, 0], [40, 0, 0], [20, 20, 0], [0, 40, 0], [0, 60, 0]],
    # there and back over the same line, as a zigzag with no stepover does at its ends
    "there and back": [[0, 0, 0], [15, 0, 0], [30, 0, 0], [45, 0, 0], [30, 0, 0], [15, 0, 0], [0, 0, 0]],
    "zigzag": [[0, 0, 0], [40, 0, 0], [40, 2, 0], [0, 2, 0], [0, 4, 0], [40, 4, 0], [40, 6, 0], [0, 6, 0]],
    "two depths": [[0, 0, 0], [30, 0, 0], [30, 0, 30], [0, 0, 30], [0, 0, -1], [30, 0, -1], [60, 0, -1]],
}


@pytest.mark.parametrize("shape", sorted(SHAPES))
def test_xyz_in_time_order(tmp_path: Path, shape: str) -> None:
    xyz = np.array(SHAPES[shape], dtype=float)
    path = Path3(xyz)
    points, s = along(xyz, 0.5)
    forces = force(s / 4)
    expect(
        Job(tmp_path, program=path.program(), forces=xyz_log(path, points, forces)),
        path.q,
        [forces[w].mean(axis=0) for w in windows(xyz, s)],
        atol=0.5,
    )


def test_xyz_with_noise_and_a_dwell(tmp_path: Path) -> None:
    """The robot waits 2 s on a corner, and the positions carry 20 um of noise: the dwell's samples stay on their corner."""
    xyz = np.array(SHAPES["zigzag"], dtype=float)
    path = Path3(xyz)
    points, s = along(xyz, 0.5)
    i = int(np.searchsorted(s, 42))
    points, s = np.r_[points[:i], np.repeat([[40.0, 2, 0]], 300, axis=0), points[i:]], np.r_[s[:i], np.full(300, 42.0), s[i:]]
    noisy = points + np.random.default_rng(3).normal(0, 0.02, points.shape)
    forces = force(s / 4)
    expect(
        Job(tmp_path, program=path.program(), forces=xyz_log(path, noisy, forces)),
        path.q,
        [forces[w].mean(axis=0) for w in windows(xyz, s)],
        atol=2.5,
    )


def test_xyz_log_that_starts_and_ends_within_the_path(tmp_path: Path) -> None:
    xyz = np.array(SHAPES["zigzag"], dtype=float)
    path = Path3(xyz)
    points, s = along(xyz, 0.5)
    forces = force(s / 4)
    keep = (s > 64) & (s < 100)  # from the middle of the second pass to the middle of the third
    chosen = [w & keep for w in windows(xyz, s)]
    expect(
        Job(tmp_path, program=path.program(), forces=xyz_log(path, points[keep], forces[keep])),
        path.q,
        [forces[w].mean(axis=0) if w.any() else None for w in chosen],
        atol=0.5,
    )


def test_joint_angles(tmp_path: Path) -> None:
    xyz = np.array(SHAPES["crossing"], dtype=float)
    path = Path3(xyz)
    points, s = along(xyz, 2.0)
    forces = force(s / 4)
    q, lines = kit.START, ["q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,fx_n,fy_n,fz_n"]
    for p, f in zip(points, forces, strict=True):
        q = kit.solve(IRB6660, kit.work_object() @ Frame(ORIGIN.p + ORIGIN.r.apply(p / 1e3), ORIGIN.r) @ TOOL.inv(), q)
        lines.append(",".join(f"{v:.8f}" for v in (*np.degrees(q), *f)))
    expect(
        Job(tmp_path, program=path.program(), forces="\n".join(lines) + "\n"),
        path.q,
        [forces[w].mean(axis=0) for w in windows(xyz, s)],
        atol=0.5,
    )


def test_all_placements_agree(tmp_path: Path) -> None:
    """One pass logged four ways gives the same corrected program to a micrometre."""
    path = line(6, 10)
    f = force(np.arange(6) * 10.0)
    s = np.arange(6) * 10.0
    q = np.degrees(path.q)
    at = path.at(path.xyz)
    logs = {
        "target": "target,fx_n,fy_n,fz_n\n" + "".join(f"{i},{a[0]},{a[1]},{a[2]}\n" for i, a in enumerate(f)),
        "path": "path_mm,fx_n,fy_n,fz_n\n" + "".join(f"{b},{a[0]},{a[1]},{a[2]}\n" for b, a in zip(s, f, strict=True)),
        "xyz": "x_mm,y_mm,z_mm,fx_n,fy_n,fz_n\n"
        + "".join(",".join(map(str, (*b, *a))) + "\n" for b, a in zip(at, f, strict=True)),
        "joints": ",".join(f"q{i}_deg" for i in range(1, 7))
        + ",fx_n,fy_n,fz_n\n"
        + "".join(",".join(f"{v:.9f}" for v in (*b, *a)) + "\n" for b, a in zip(q, f, strict=True)),
    }
    for name, text in logs.items():
        folder = tmp_path / name
        folder.mkdir()
        expect(Job(folder, program=path.program(), forces=text), path.q, list(f))


def test_offs_reltool_and_run_time_targets_count(tmp_path: Path) -> None:
    """`target` counts what move instructions name, in the order of the text, a loop once."""
    path = line(6, 10)
    data = [kit.tooldata(), kit.wobjdata(), f"CONST robtarget pA:={path.text[1]};", "VAR robtarget pRun;"]
    moves = [
        kit.move(path.text[0]),
        kit.move("Offs(pA,0,0,50)"),
        kit.move("RelTool(pA,0,0,-10)"),
        "pRun:=CRobT();",
        kit.move("pRun"),
        "FOR i FROM 1 TO 3 DO",
        kit.move(path.text[4]),
        "ENDFOR",
        kit.move(path.text[5]),
    ]
    text = "target,fx_n,fy_n,fz_n\n4,10,20,30\n5,100,0,0\n"
    job = Job(tmp_path, program=kit.module(moves, data), forces=text)
    result = job.correct()
    assert result.code == 0, result
    rows = job.offsets()
    assert len(rows) == 6
    moved = np.nonzero(np.abs(np.nan_to_num(kit.column(rows, "ox_mm", "oy_mm", "oz_mm"))).max(axis=1))[0]
    assert moved.tolist() == [4, 5]
    changed = [
        i
        for i, (a, b) in enumerate(zip(str(job.program).splitlines(), job.out.read_text().splitlines(), strict=True))
        if a != b
    ]
    assert [str(job.program).splitlines()[i] for i in changed] == [kit.move(path.text[4]), kit.move(path.text[5])]


def test_offs_and_reltool_land(tmp_path: Path) -> None:
    """A move to Offs(p, ...) or RelTool(p, ...) in contact is corrected, or said not to be: never moved wrongly."""
    path = line(3, 10)
    data = [kit.tooldata(), kit.wobjdata(), f"CONST robtarget pA:={path.text[1]};"]
    moves = [kit.move(path.text[0]), kit.move("Offs(pA,1,2,3)"), kit.move("RelTool(pA,1,2,3\\Rz:=4)")]
    f = np.array([150.0, -100, 60])
    text = "target,fx_n,fy_n,fz_n\n" + "".join(f"{i},{f[0]},{f[1]},{f[2]}\n" for i in range(3))
    job = Job(tmp_path, program=kit.module(moves, data), forces=text)
    result = job.correct()
    if result.code == 3:
        job.nothing_written()
        return
    assert result.code == 0, result
    a = path.frames[1]
    plans = [
        path.frames[0],
        Frame(a.p + np.array([1, 2, 3]) / 1e3, a.r),
        a @ Frame(np.array([1, 2, 3]) / 1e3, kit.Rotation.from_euler("z", 4, degrees=True)),
    ]
    rows = job.offsets()
    for i, (row, plan) in enumerate(zip(rows, plans, strict=True)):
        np.testing.assert_allclose(kit.column([row], "x_mm", "y_mm", "z_mm")[0], plan.p * 1e3, atol=1e-4)
        offset = kit.column([row], "ox_mm", "oy_mm", "oz_mm")[0] / 1e3
        turn = kit.Rotation.from_rotvec(np.radians(kit.column([row], "orx_deg", "ory_deg", "orz_deg")[0]))
        q = kit.solve(IRB6660, kit.work_object() @ plan @ TOOL.inv(), path.q[1])
        distance, _ = kit.lands(Frame(plan.p + offset, turn * plan.r), plan, q, np.r_[f, 0, 0, 0])
        assert distance < 0.2e-6, i
    written = job.out.read_text()
    assert written != job.program


def test_a_named_target_used_twice_becomes_two(tmp_path: Path) -> None:
    path = line(3, 10)
    data = [kit.tooldata(), kit.wobjdata(), *(f"LOCAL CONST robtarget p{i}:={t};" for i, t in enumerate(path.text))]
    names = ["p0", "p1", "p2", "p1", "p0", "p1"]
    f = [F0, F0 + 50, None, F0 - 80, None, F0 + 50]
    text = "target,fx_n,fy_n,fz_n\n" + "".join(f"{i},{v[0]},{v[1]},{v[2]}\n" for i, v in enumerate(f) if v is not None)
    job = Job(tmp_path, program=kit.module([kit.move(n) for n in names], data), forces=text)
    result = job.correct()
    assert result.code == 0, result
    import re

    out = job.out.read_text()
    declared = dict(re.findall(r"robtarget (\w+)\s*:=\s*(\[.*\]);", out))
    used = re.findall(r"MoveL (\w+|\[.*?\]\]),v50", out)
    assert len(used) == 6
    for i, (name, force_) in enumerate(zip(used, f, strict=True)):
        commanded = kit.targets_of(declared.get(name, name))[0]
        j = int(names[i][1])
        if force_ is None:
            np.testing.assert_allclose(commanded.p, kit.targets_of(path.text[j])[0].p, atol=1e-12)
        else:
            assert kit.lands(commanded, path.frames[j], path.q[j], np.r_[force_, 0, 0, 0])[0] < 0.2e-6


def noisy(means: list[float], seed: int = 0) -> str:
    """A log by target: forces along one line of those means [N], the standard error of each mean 4.2 N."""
    pattern = np.random.default_rng(seed).normal(0, 1, 50)
    pattern = (pattern - pattern.mean()) / pattern.std(ddof=1) * 30
    rows = ["target,fx_n,fy_n,fz_n"]
    for i, mean in enumerate(means):
        rows += [f"{i},0,{mean + n:.6f},0" for n in pattern]
    return "\n".join(rows) + "\n"


def test_a_weaker_force_within_a_cut_makes_no_step(tmp_path: Path) -> None:
    """`A target takes the mean of the samples`: in the middle of a cut, too, where that mean falls below some threshold."""
    path = line(7, 1)
    means = [24.0, 22, 20, 12, 20, 22, 24]
    job = Job(tmp_path, program=path.program(), forces=noisy(means))
    result = job.correct()
    assert result.code == 0, result
    rows = job.offsets()
    size = np.linalg.norm(kit.column(rows, "ox_mm", "oy_mm", "oz_mm"), axis=1) * 1e3
    expected = [
        np.linalg.norm(kit.deviation(IRB6660, q, TOOL.p, np.array([0, m, 0, 0, 0, 0]), K)) * 1e6
        for q, m in zip(path.q, means, strict=True)
    ]
    np.testing.assert_allclose(size, expected, atol=0.5)


def test_air_stays_air_under_noise(tmp_path: Path) -> None:
    path = line(3, 1)
    job = Job(tmp_path, program=path.program(), forces=noisy([0.0, 3.0, -2.0]))
    result = job.correct()
    assert (result.code, "CS3086" in result.err) == (3, True), result
    job.nothing_written()


def test_the_noise_of_the_force_is_in_sigma(tmp_path: Path) -> None:
    """Posterior, and force noise where it is known: here almost nothing but noise."""
    path = line(3, 10)
    rng = np.random.default_rng(8)
    noise = rng.normal(0, 40, (4000, 3))
    text = "target,fx_n,fy_n,fz_n\n" + "".join(f"1,{60 + a:.4f},{90 + b:.4f},{c - 120:.4f}\n" for a, b, c in noise)
    job = Job(tmp_path, program=path.program(), forces=text, stiffness=kit.stiffness_text(relative=1e-6))
    assert job.correct().code == 0
    unit = np.array([kit.deviation(IRB6660, path.q[1], TOOL.p, np.r_[e, 0, 0, 0], K) for e in np.eye(3)]).T * 1e6
    sigma = np.sqrt(unit**2 @ (noise.std(axis=0) ** 2 / len(noise)))
    ratio = kit.column([job.offsets()[1]], "sx_um", "sy_um", "sz_um")[0] / sigma
    assert np.all((ratio > 0.3) & (ratio < 3)), ratio


def test_arcs_by_position(tmp_path: Path) -> None:
    """Samples along a MoveC lie on its arc, not on its chords (9 mm off here)."""
    r = 30.0
    turn = np.linspace(0, np.pi, 3)
    xyz = np.array([[-20, 0, 0], [0, 0, 0], *([r * np.sin(a), r - r * np.cos(a), 0] for a in turn[1:]), [-20, 2 * r, 0]])
    path = Path3(xyz)
    moves = [
        kit.move(path.text[0]),
        kit.move(path.text[1]),
        f"    MoveC {path.text[2]},{path.text[3]},v50,z1,tMill\\WObj:=wPart;",
        kit.move(path.text[4]),
    ]
    a = np.arange(0.004, np.pi, 0.01)
    before, after = np.arange(-19.8, 0, 0.3), np.arange(-0.2, -20, -0.3)
    points = np.concatenate(
        [
            np.c_[before, 0 * before, 0 * before],
            np.c_[r * np.sin(a), r - r * np.cos(a), 0 * a],
            np.c_[after, 2 * r + 0 * after, 0 * after],
        ]
    )
    s = np.r_[before + 20, 20 + r * a, 20 + r * np.pi - after]
    forces = force(s / 4)
    place = np.cumsum([0, 20, r * np.pi / 2, r * np.pi / 2, 20])
    middle = (place[1:] + place[:-1]) / 2
    inside = [(s >= lo) & (s < hi) for lo, hi in zip(np.r_[-1, middle], np.r_[middle, 1e9], strict=True)]
    job = Job(tmp_path, program=kit.module(moves), forces=xyz_log(path, points, forces))
    expect(job, path.q, [forces[i].mean(axis=0) for i in inside], atol=0.5)


def test_a_joint_move_that_swings_off_its_chord(tmp_path: Path) -> None:
    """The robot's swing on a MoveJ lies off the path; the cuts after it keep their samples."""
    cut = np.array(SHAPES["zigzag"], dtype=float)
    xyz = np.concatenate([[[-80.0, 0, 0]], cut])
    path = Path3(xyz)
    points, s = along(cut, 0.5)
    forces = force(s / 4)
    a = np.linspace(0, 1, 60)
    swing = np.c_[-80 + 80 * a, 0 * a, -40 * np.sin(np.pi * a)]
    moves = [kit.move(path.text[0], "MoveJ"), kit.move(path.text[1], "MoveJ"), *(kit.move(t) for t in path.text[2:])]
    text = xyz_log(path, np.concatenate([swing[:-1], points]), np.concatenate([np.zeros((59, 3)), forces]))
    job = Job(tmp_path, program=kit.module(moves), forces=text)
    assert job.correct().code == 0
    rows = job.offsets()
    for row, q, w in zip(rows[2:], path.q[2:], windows(cut, s)[1:], strict=True):
        expected = kit.deviation(IRB6660, q, TOOL.p, np.r_[forces[w].mean(axis=0), 0, 0, 0], K) * 1e6
        np.testing.assert_allclose(kit.column([row], "dx_um", "dy_um", "dz_um")[0], expected, atol=0.5)

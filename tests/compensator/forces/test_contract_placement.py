"""From a log to one wrench a target: means, their error, bias, frames, and what is refused."""

import re
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from compensator.correction.files import Inputs, predict_files
from compensator.correction.predict import _without_zero
from compensator.correction.settings import Settings
from compensator.forces.log_path import on_path
from compensator.forces.placement import _without_force, place_forces, read_force_log
from compensator.forces.target_forces import TargetForces
from compensator.forces.target_rows import TargetRows
from compensator.forces.zero import zero_of
from compensator.path.arc_length import nearest_target
from compensator.path.robot_path import RobotPath, robot_path
from compensator.rapid import read_rapid
from identification.common.findings import CompstiffError
from identification.model.cell import read_cell
from identification.model.rotations import quaternion_to_matrix

QUATERNION = (0.02522428, -0.00054983, -0.99944426, 0.02178562)
CELL = """\
robot: irb6660-205-1.90
tool: {position_mm: [120, 0, 250]}
"""


def plan(folder: Path, cell_text: str = CELL, count: int = 5) -> RobotPath:
    """`count` targets 10 mm apart along x."""
    moves = "\n".join(
        f"Move{'J' if i == 0 else 'L'} [[{1000 + 10 * i},0,700],[{','.join(map(str, QUATERNION))}],[-1,-1,-1,0],"
        "[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,tSpindle;" for i in range(count))
    text = f"MODULE M\nPROC main()\n{moves}\nENDPROC\nENDMODULE\n"
    (folder / "cell.yaml").write_text(cell_text)
    return robot_path(read_rapid(text.encode(), "m.mod").toolpath, read_cell(folder / "cell.yaml"))


def place(folder: Path, text: str, cell_text: str = CELL, **options) -> TargetForces:
    path = folder / "forces.csv"
    path.write_text(text)
    here = plan(folder, cell_text)
    return place_forces(read_force_log(path), here, here.cell, **options)


def log_text(header: str, rows: np.ndarray) -> str:
    return header + "\n" + "\n".join(",".join(f"{x:.9g}" for x in row) for row in rows) + "\n"


def test_by_target(tmp_path) -> None:
    forces = place(tmp_path, "target,fx_n,fy_n,fz_n\n1,10,0,0\n1,20,0,0\n3,0,0,-5\n")
    assert forces.samples.tolist() == [0, 2, 0, 1, 0]
    assert forces.forced.tolist() == [False, True, False, True, False]
    assert_allclose(forces.wrench[1], [15, 0, 0, 0, 0, 0])
    assert_allclose(forces.wrench[3], [0, 0, -5, 0, 0, 0])
    assert {finding.code for finding in forces.findings} == {"CS3003", "CS3011", "CS3012", "CS3071"}


@pytest.mark.parametrize(("header", "step", "lost", "said"), [
    ("path_mm", 0.1, (12.0, 18.5), ["6 mm"]), ("x_mm,y_mm,z_mm", 0.1, (12.0, 18.5), ["6 mm"]),
    ("path_mm", 0.1, (12.0, 17.2), ["5 mm"]), ("path_mm", 0.1, (12.0, 16.8), []), ("path_mm", 0.1, (27.0, 33.5), []),
    ("path_mm", 2.0, (12.1, 17.9), []), ("path_mm", 0.1, (99.0, 99.0), [])])
def test_a_stretch_of_a_cut_without_a_sample_is_told(
    tmp_path, header: str, step: float, lost: tuple[float, float], said: list[str]
) -> None:
    """In a move of 10 mm: what is short, or shared by two moves, or usual for a slow logger is not."""
    way = np.arange(0, 40.001, step)
    way = way[(way <= lost[0]) | (way >= lost[1])]
    place_of = way[:, None] if header == "path_mm" else np.column_stack([1000 + way, 0 * way, 700 + 0 * way])
    rows = np.column_stack([place_of, np.tile([30.0, -20, 5], (len(way), 1))])
    found = [one for one in place(tmp_path, log_text(f"{header},fx_n,fy_n,fz_n", rows)).findings if one.code == "CS3134"]
    assert [f"leaves out {words}" in one.message for one, words in zip(found, said, strict=True)] == [True] * len(said)
    assert all(one.target == 2 for one in found)


@pytest.mark.parametrize(("feed", "loaded", "lost", "said"), [
    ("v100", (0, 40), (12.0, 18.5), True), ("v500", (0, 40), (12.0, 18.5), False), ("v100", (26, 40), (12.0, 18.5), False),
    ("v100", (18.5, 40), (12.0, 18.5), True), ("v100", (0, 40), (12.0, 26.0), False)])
def test_what_is_left_out_of_the_air_or_with_a_whole_target_is_not_told(
    tmp_path: Path, feed: str, loaded: tuple[float, float], lost: tuple[float, float], said: bool
) -> None:
    """The third move at a feed of its own, a force over so much of the path, a part of which has no sample: in the air, between
    targets without force, or around a target, which is told as one without a sample."""
    moves = "\n".join(f"MoveL [[{1000 + 10 * i},0,700],[{','.join(map(str, QUATERNION))}],[-1,-1,-1,0],"
                      f"[9E9,9E9,9E9,9E9,9E9,9E9]],{feed if i == 2 else 'v100'},fine,tSpindle;" for i in range(5))
    (tmp_path / "cell.yaml").write_text(CELL)
    path = robot_path(read_rapid(f"MODULE M\nPROC main()\n{moves}\nENDPROC\nENDMODULE\n".encode(), "m.mod").toolpath,
                      read_cell(tmp_path / "cell.yaml"))
    way = np.arange(0, 40.001, 0.1)
    way = way[(way <= lost[0]) | (way >= lost[1])]
    force = np.outer((way >= loaded[0]) & (way <= loaded[1]), [30.0, -20, 5])
    (tmp_path / "forces.csv").write_text(log_text("path_mm,fx_n,fy_n,fz_n", np.column_stack([way, force])))
    found = place_forces(read_force_log(tmp_path / "forces.csv"), path, path.cell).findings
    assert [(one.level, one.target, one.line) for one in found if one.code == "CS3134"] == [("warning", 2, 5)] * said
    assert bool({"CS3012", "CS3014"} & {one.code for one in found}) == (lost[1] > 25)


def test_a_cut_that_is_not_in_the_log_is_a_warning(tmp_path) -> None:
    """Of passes from the air into the air the last one was added to the program since: nothing beside it has a force. Moves
    in the air that the log left out stay a note."""
    def passes(count: int, more: str = "") -> str:
        lines = [f"    MoveL [[{x},{60 * k},{z}],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],{speed},z0,tool0;"
                 for k in range(count) for x, z, speed in ((800, 940, "v200"), (800, 900, "v200"), (860, 900, "v20"),
                                                           (860, 940, "v200"))]
        return "MODULE m\n  PROC main()\n" + "\n".join(lines) + "\n" + more + "  ENDPROC\nENDMODULE\n"

    rows = "".join(f"{target},{force},0,0\n" for target in range(8) for force in ((50, 51) if target % 4 == 2 else (0, 0)))
    home = "    MoveL [[700,0,950],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v200,z0,tool0;\n"
    for text, level, said in ((passes(2), None, ""), (passes(2, home), "note", "left where planned"),
                              (passes(3), "warning", "1 of them reached at the cutting feed, from line 13 on")):
        (tmp_path / "cell.yaml").write_text(CELL)
        path = robot_path(read_rapid(text.encode(), "m.mod").toolpath, read_cell(tmp_path / "cell.yaml"))
        (tmp_path / "forces.csv").write_text("target,fx_n,fy_n,fz_n\n" + rows)
        found = [one for one in place_forces(read_force_log(tmp_path / "forces.csv"), path, path.cell).findings
                 if one.code == "CS3011"]
        assert [one.level for one in found] == ([level] if level else [])
        assert not said or found[0].message.endswith(said)


@pytest.mark.parametrize("header", ["path_mm", "x_mm,y_mm,z_mm"])
def test_half_a_segment_on_either_side(tmp_path, header: str) -> None:
    places = np.array([0, 4.9, 5.1, 14.9, 15.1, 24, 36, 40.0])
    columns = places[:, None] if header == "path_mm" else np.column_stack([1000 + places, 0 * places, 700 + 0 * places])
    rows = np.column_stack([columns, np.arange(1, 9), np.zeros(8), np.zeros(8)])
    forces = place(tmp_path, log_text(header + ",fx_n,fy_n,fz_n", rows))
    assert forces.samples.tolist() == [2, 2, 2, 0, 2]
    assert_allclose(forces.wrench[:, 0], [1.5, 3.5, 5.5, 0, 7.5])


def test_standard_error_covers_the_mean_of_a_correlated_force(tmp_path) -> None:
    """Tooth passing and noise about a steady force: the error of the mean is stated neither at zero nor at the scatter."""
    rng = np.random.default_rng(1)
    count = 4000
    along = np.linspace(0, 40, count)
    wave = 60 * np.sin(2 * np.pi * 0.37 * np.arange(count))
    drift = np.convolve(rng.standard_normal(count + 49), np.ones(50) / 7, mode="valid")       # correlated over 50 samples
    rows = np.column_stack([along, 200 + wave + 5 * drift, np.zeros(count), np.zeros(count)])
    forces = place(tmp_path, log_text("path_mm,fx_n,fy_n,fz_n", rows))
    assert np.all(np.abs(forces.wrench[:, 0] - 200) < 5 * forces.standard_error[:, 0])
    assert np.all(forces.standard_error[:, 0] < 3)
    assert np.all(forces.standard_error[:, 0] > 0.1)


def test_noise_in_air_is_no_force_and_a_bias_is_subtracted(tmp_path) -> None:
    rng = np.random.default_rng(2)
    along = np.repeat(np.arange(5) * 10.0, 200)
    force = np.where(along[:, None] >= 20, [0.0, 150, 0], 0.0)
    rows = np.column_stack([along, force + [3, -4, 5] + 2 * rng.standard_normal((1000, 3))])
    biased = place(tmp_path, log_text("path_mm,fx_n,fy_n,fz_n", rows))
    assert biased.forced.all()
    forces = place(tmp_path, log_text("path_mm,fx_n,fy_n,fz_n", rows), tare=(0, 1))
    assert forces.forced.tolist() == [False, False, True, True, True]
    assert not forces.wrench[:2].any()
    assert_allclose(forces.wrench[2:, :3], [[0, 150, 0]] * 3, atol=1)
    assert forces.tare is not None
    assert_allclose(forces.tare[:3], [3, -4, 5], atol=0.5)


@pytest.mark.parametrize(("frame", "sign"), [("base", 1), ("tool", 1), ("tool", -1), ("sensor", 1)])
def test_frames_and_sign(tmp_path, frame: str, sign: int) -> None:
    """The wrench at the TCP in the base frame, worked out by hand from rotation matrices."""
    base_from_tool = quaternion_to_matrix(QUATERNION)
    force, moment = np.array([30.0, -20, 10]), np.array([1.0, 2, -3])
    log_force, log_moment = force, moment
    text = CELL
    if frame == "tool":
        log_force, log_moment = base_from_tool.T @ force, base_from_tool.T @ moment
    if frame == "sensor":
        flange_from_sensor, place_in_flange = quaternion_to_matrix([0.9, 0.1, 0.3, -0.2]), np.array([0.01, 0.02, 0.05])
        text += ("force_log: {frame: sensor, sensor_quaternion: [0.92318602, 0.10257622, 0.30772867, -0.20515245], "
                 "sensor_position_mm: [10, 20, 50]}\n")
        base_from_sensor = base_from_tool @ flange_from_sensor          # the tool's orientation is the flange's
        lever = base_from_tool @ (np.array([0.12, 0, 0.25]) - place_in_flange)
        log_force = base_from_sensor.T @ force
        log_moment = base_from_sensor.T @ (moment + np.cross(lever, force))         # moment about the sensor's origin
    else:
        text += f"force_log: {{frame: {frame}, sign: {'on_tool' if sign > 0 else 'by_tool'}}}\n"
    values = sign * np.concatenate([log_force, log_moment])
    forces = place(tmp_path, log_text("target,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm", np.array([[2, *values]])), text)
    assert_allclose(forces.wrench[2], [*force, *moment], atol=1e-5)


def test_by_joint_angles(tmp_path) -> None:
    here = plan(tmp_path)
    rows = np.column_stack([np.degrees(here.theta), np.arange(1, 6), np.zeros(5), np.zeros(5)])
    forces = place(tmp_path, log_text("q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,fx_n,fy_n,fz_n", rows))
    assert_allclose(forces.wrench[:, 0], [1, 2, 3, 4, 5])


def test_the_target_ahead_is_the_place_on_the_way(tmp_path) -> None:
    """Samples named after the target that the tool moves to give what the same samples with their places give."""
    places = np.arange(0.5, 40, 1.0)
    force = np.column_stack([np.sin(places / 5), places, places**2])
    ahead = np.column_stack([np.ceil(places / 10), force])
    cell = CELL + "force_log: {target: ahead}\n"
    by_target = place(tmp_path, log_text("target,fx_n,fy_n,fz_n", ahead), cell)
    by_place = place(tmp_path, log_text("path_mm,fx_n,fy_n,fz_n", np.column_stack([places, force])))
    assert_allclose(by_target.wrench, by_place.wrench, atol=1e-9)
    assert by_target.samples.tolist() == [5, 10, 10, 10, 5]
    assert "CS3040" in {finding.code for finding in by_target.findings}
    nearest = place(tmp_path, log_text("target,fx_n,fy_n,fz_n", ahead))
    assert nearest.samples.tolist() == [0, 10, 10, 10, 10]
    with pytest.raises(CompstiffError, match="CS3004.*beyond"):
        place(tmp_path, "target,fx_n,fy_n,fz_n\n5,1,0,0\n", cell)


@pytest.mark.parametrize(("text", "code", "words"), [
    ("target,fx_n,fy_n,fz_n\n5,1,0,0\n", "CS3004", "beyond the program, which has 5 targets"),
    ("target,fx_n,fy_n,fz_n\n-1,1,0,0\n", "CS3004", "not a target number"),
    ("target,fx_n,fy_n,fz_n\n1.5,1,0,0\n", "CS3004", "not a target number"),
    ("target,fx_n,fy_n,fz_n\n1,inf,0,0\n", "CS0203", "'inf'"),
    ("target,fx_n,fy_n,fz_n\n", "CS3002", "no samples"),
    ("fx_n,fy_n,fz_n\n1,0,0\n", "CS3001", "no column says where"),
    ("time_s,fx_n,fy_n,fz_n\n0,1,0,0\n", "CS3063", "1 sample is too few"),
    ("time_s,fx_n,fy_n,fz_n\n" + "".join(f"{i},{i},0,0\n" for i in range(99)), "CS3063", "99 samples are too few"),
    ("time_s,fx_n,fy_n,fz_n\n" + "".join(f"{i},1,0,0\n" for i in range(100)), "CS3063", "never changes"),
    ("time_s,fx_n,fy_n,fz_n\n" + "".join(f"0,{i},0,0\n" for i in range(100)), "CS3063", "or time does not"),
    ("time_s,fx_n,fy_n,fz_n\n" + "".join(f"{i},1,0,0\n" for i in range(200)), "CS3063", "never changes"),
    ("time_s,fx_n,fy_n,fz_n\n" + "".join(f"{i if i < 150 else i - 1.5},{i},0,0\n" for i in range(200)), "CS3062",
     "time_s 148.5 stands before the one above it, 149"),
    ("path_mm,fx_n,fy_n,fz_n\n900,1,0,0\n", "CS3005", "none of the 1 samples"),
    ("x_mm,y_mm,z_mm,fx_n,fy_n,fz_n\n0,0,0,1,0,0\n", "CS3005", "none of the 1 samples"),
])
def test_refusals(tmp_path, text: str, code: str, words: str) -> None:
    with pytest.raises(CompstiffError, match=f"{code}.*{words}"):
        place(tmp_path, text)


@pytest.mark.parametrize("odd", ["", "MoveJ in the cut", "a touch at the air feed", "a light one"])
def test_a_move_in_air_that_cuts_is_no_drift_of_the_zero(tmp_path, odd: str) -> None:
    """A zero that is off by 2 N behind the cut and by nothing before it: 1 sigma of an axis over the time of the program is
    sqrt(mean of the ramp squared / 3), whatever one or two of 26 moves do beside that."""
    plan(tmp_path)
    cuts = set(range(4, 20))
    kind = {i: "J" if i == 0 or (odd.startswith("MoveJ") and i in (10, 11)) else "L" for i in range(26)}
    moves = "\n".join(f"Move{kind[i]} [[{1000 + 10 * i},0,700],[{','.join(map(str, QUATERNION))}],[-1,-1,-1,0],"
                      f"[9E9,9E9,9E9,9E9,9E9,9E9]],{'v100' if i in cuts else 'v500'},fine,tSpindle;" for i in range(26))
    path = robot_path(read_rapid(f"MODULE M\nPROC main()\n{moves}\nENDPROC\nENDMODULE\n".encode(), "m.mod").toolpath,
                      read_cell(tmp_path / "cell.yaml"))
    force = np.random.default_rng(5).normal(0, 0.3, (26, 40, 3))
    force[list(cuts), :, 1] += 200
    force[20:, :, 0] += 2
    force[23, :, 2] += {"a touch at the air feed": 120, "a light one": 15}.get(odd, 0)
    rows = np.column_stack([np.repeat(np.arange(26), 40), force.reshape(-1, 3)])
    (tmp_path / "forces.csv").write_text(log_text("target,fx_n,fy_n,fz_n", rows))
    forces = place_forces(read_force_log(tmp_path / "forces.csv"), path, path.cell, tare=(0, 1))
    ramp = np.interp(np.arange(26), [2, 21], [0, 2])
    assert forces.zero_std == pytest.approx(np.sqrt(np.mean(ramp**2) / 3), rel=0.25)


def test_tare_over_a_cut_or_beyond_the_program(tmp_path) -> None:
    """A bias with a cutting force in it would be taken off everywhere."""
    rows = np.column_stack([np.repeat(np.arange(5), 20), np.random.default_rng(4).normal(0, 2, (100, 3))])
    rows[60:, 2] += 100
    text = log_text("target,fx_n,fy_n,fz_n", rows)
    assert place(tmp_path, text, tare=(0, 2)).forced.tolist() == [False] * 3 + [True] * 2
    with pytest.raises(CompstiffError, match="CS3039.*target 3 shows 9"):
        place(tmp_path, text, tare=(0, 3))
    # Two are as far from their middle as each other: which of them cuts is not told by it.
    with pytest.raises(CompstiffError, match=r"CS3039.*the targets 2 and 3 of --tare are not both.* (99|10[01])\.. N apart"):
        place(tmp_path, text, tare=(2, 3))
    with pytest.raises(CompstiffError, match="CS3006.*beyond the program, which has 5 targets"):
        place(tmp_path, text, tare=(0, 5))


def test_a_tare_inside_a_cut_of_the_sample_is_refused(sample_inputs: Inputs) -> None:
    """All stretches of three targets: where the log shows a cut none is taken, where it shows air all are.

    The truth is the log itself against its rest at either end; 5 N is what a tare may be off.
    """
    cell = read_cell(sample_inputs.cell)
    path = robot_path(read_rapid(sample_inputs.toolpath.read_bytes(), "insert.mod").toolpath, cell)
    log = on_path(read_force_log(sample_inputs.forces, cell.force_log.form), path)
    target = nearest_target(path.length, log.place)
    mean = TargetRows(len(path.toolpath), target, log.weight).mean(log.plain)[:, :3]
    # Every seventh sample will do, and is no stroboscope to the spindle.
    loads, rows = log.plain[::7], TargetRows(len(path.toolpath), target[::7], log.weight[::7])
    force = np.linalg.norm(mean - mean[:3].mean(axis=0), axis=1)
    smallest, largest = (np.array([pick(force[k:k + 3]) for k in range(len(force) - 2)]) for pick in (min, max))
    cuts, airs = np.flatnonzero(smallest > 5), np.flatnonzero(largest < 1)
    assert len(cuts) > 2000
    assert len(airs) > 400
    for first in cuts[::60]:
        with pytest.raises(CompstiffError, match="CS3039"):
            zero_of(log, path, cell, loads, rows, [(int(first), int(first) + 2)])
    for first in airs[::25]:
        assert zero_of(log, path, cell, loads, rows, [(int(first), int(first) + 2)]).bias is not None


def milled_and_back(rng: np.random.Generator, drift: float, inertia: float, cut: float) -> tuple[str, str]:
    """A program of 12 cuts of four targets, each between air moves, and its log: noise of 2 N, a cutting force that swings by
    half of itself, a zero that drifts by so much [N] over the program, an inertia [N] that comes and goes in air."""
    moves, rows = [], []
    fast = np.tile([True, True, True, False, False, False, False, True, True], 12)
    for k, air in enumerate(fast):
        moves.append(f"Move{'L' if k else 'J'} [[{1000 + 2 * k},0,700],[{','.join(map(str, QUATERNION))}],[-1,-1,-1,0],"
                     f"[9E9,9E9,9E9,9E9,9E9,9E9]],{'v200' if air else 'v20'},fine,tSpindle;")
        # At the border of a cut half of the samples lie in the move behind.
        cuts = not air and (k + 1 == len(fast) or not fast[k + 1])
        force = np.outer(cuts * cut * (1 + 0.5 * np.sin(np.arange(40) + k)), [0.8, -0.6, 0.0])
        shown = force + drift * k / len(fast) * np.array([0.0, 0.6, 0.8]) + rng.normal(0, 2, (40, 3))
        shown += air * inertia * rng.normal(0, 1, 3)
        rows += [[k, *row] for row in shown]
    program = "MODULE M\nPROC main()\n" + "\n".join(moves) + "\nENDPROC\nENDMODULE\n"
    return program, log_text("target,fx_n,fy_n,fz_n", np.array(rows))


@pytest.mark.parametrize(("drift", "inertia"), [(0.0, 0.0), (12.0, 0.0), (-40.0, 0.0), (0.0, 8.0), (15.0, 5.0)])
def test_drift_and_inertia_do_not_make_a_cut_of_air(tmp_path: Path, drift: float, inertia: float) -> None:
    """The first or the last air moves, cold or warm, are a tare; a cut of 120 N is none, whichever."""
    rng = np.random.default_rng(11)
    program, log = milled_and_back(rng, drift, inertia, 120.0)
    (tmp_path / "cell.yaml").write_text(CELL)
    (tmp_path / "forces.csv").write_text(log)
    path = robot_path(read_rapid(program.encode(), "m.mod").toolpath, read_cell(tmp_path / "cell.yaml"))
    logged = read_force_log(tmp_path / "forces.csv")
    for tare in ((0, 2), (52, 55), (106, 107)):
        assert place_forces(logged, path, path.cell, tare=tare).tare is not None
    for first in range(3, 108, 9):
        with pytest.raises(CompstiffError, match="CS3039.*are not in air.*at the air feed"):
            place_forces(logged, path, path.cell, tare=(first, first + 2))


def test_where_nothing_tells_air_the_tare_is_refused_unless_it_is_trusted(tmp_path: Path) -> None:
    """One feed throughout, and no sample at either end of the program."""
    rows = np.column_stack([np.repeat(np.arange(5), 20), np.random.default_rng(4).normal(0, 2, (100, 3))])
    text = log_text("target,fx_n,fy_n,fz_n", rows)
    inner = log_text("target,fx_n,fy_n,fz_n", rows[20:80] + np.array([0, 60, 0, 0]))
    with pytest.raises(CompstiffError, match="CS3066: nothing in the log shows"):
        place(tmp_path, inner, tare=(2, 2))
    trusted = place(tmp_path, inner, tare=(2, 2), trust_tare=True)
    [said] = [finding for finding in trusted.findings if finding.code == "CS3066"]
    assert said.level == "warning"
    assert "CS3066" not in {finding.code for finding in place(tmp_path, text, tare=(0, 2)).findings}


def test_a_tare_ends_at_its_last_target(tmp_path: Path) -> None:
    """The stretch of a target reaches half way into the move behind it, which cuts: with it the bias would be 25 N off."""
    along = np.linspace(0, 40, 4001)
    force = np.random.default_rng(6).normal([3, -4, 5], 1, (4001, 3)) + np.where(along[:, None] > 20, [0.0, 150, 0], 0.0)
    text = log_text("path_mm,fx_n,fy_n,fz_n", np.column_stack([along, force]))
    forces = place(tmp_path, text, tare=(0, 2), trust_tare=True)
    assert forces.tare is not None
    assert_allclose(forces.tare[:3], [3, -4, 5], atol=0.2)


def test_moves_at_the_air_feed_that_cut_are_said(tmp_path: Path) -> None:
    """Beside them the tare is quiet."""
    (tmp_path / "cell.yaml").write_text(CELL)
    program, log = milled_and_back(np.random.default_rng(5), 0.0, 0.0, 120.0)
    swapped = program.replace("v200", "v2").replace("v20,", "v200,").replace("v2,", "v20,")
    (tmp_path / "forces.csv").write_text(log)
    path = robot_path(read_rapid(swapped.encode(), "m.mod").toolpath, read_cell(tmp_path / "cell.yaml"))
    fast = place_forces(read_force_log(tmp_path / "forces.csv"), path, path.cell, tare=(0, 2))
    assert fast.tare is not None
    [said] = [finding for finding in fast.findings if finding.code == "CS3041"]
    assert "the bias that was taken off is not theirs" in said.message


def test_the_log_of_another_program_is_refused(tmp_path) -> None:
    """19 of 20 samples lie elsewhere, as where two parts touch."""
    rows = np.column_stack([1000 + 60 * np.arange(20.0), np.zeros(20), np.full(20, 700.0), np.full((20, 3), 50.0)])
    with pytest.raises(CompstiffError, match="CS3005.*only 1 of the 20 samples lies on this path"):
        place(tmp_path, log_text("x_mm,y_mm,z_mm,fx_n,fy_n,fz_n", rows))


def test_a_bias_that_nobody_took_off_is_said(sample_inputs: Inputs) -> None:
    """The sample's sensor shows 6 N in air: without --tare its rapid moves show a force, with it they do not."""
    codes = [{finding.code for finding in predict_files(sample_inputs, Settings.of(tare=tare)).findings}
             for tare in ((), ((0, 2),))]
    assert "CS3041" in codes[0]
    assert "CS3041" not in codes[1]


def test_tare_without_samples(tmp_path) -> None:
    with pytest.raises(CompstiffError, match="CS3006.*0 to 1"):
        place(tmp_path, "target,fx_n,fy_n,fz_n\n3,1,0,0\n", tare=(0, 1))


def hop(feed_between: str = "v500") -> str:
    """Ten targets: a cut, three moves over to the next one, a cut."""
    moves = [f"Move{'J' if i == 0 else 'L'} [[{1000 + 10 * i},0,{720 if i in (0, 4, 5) else 700}],"
             f"[{','.join(map(str, QUATERNION))}],[-1,-1,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],"
             f"{feed_between if i in (0, 4, 5, 6) else 'v30'},fine,tSpindle;" for i in range(10)]
    return "MODULE M\nPROC main()\n" + "\n".join(moves) + "\nENDPROC\nENDMODULE\n"


def hop_forces(folder: Path, feed_between: str, between: float, noise: np.ndarray) -> TargetForces:
    """Ten targets with 200 samples each: 60 N in the cuts, `between` on the two targets between them, tare on the first."""
    (folder / "cell.yaml").write_text(CELL)
    here = robot_path(read_rapid(hop(feed_between).encode(), "m.mod").toolpath, read_cell(folder / "cell.yaml"))
    target = np.repeat(np.arange(10), 200)
    level = np.select([target == 0, np.isin(target, (4, 5))], [0.0, between], 60.0)
    force = np.column_stack([0 * level, level, -level]) + noise
    (folder / "hop.csv").write_text(log_text("target,fx_n,fy_n,fz_n", np.column_stack([target, force])))
    return place_forces(read_force_log(folder / "hop.csv"), here, here.cell, tare=(0, 0), trust_tare=True)


@pytest.mark.parametrize("feed", ["v500", "v30"])
@pytest.mark.parametrize("noise", [0.0, 10.0])
def test_an_air_move_between_two_cuts_is_no_gap_in_a_cut(tmp_path, feed: str, noise: float) -> None:
    """Not at the air feed, and not at the cutting feed either: a move without force never moves."""
    forces = hop_forces(tmp_path, feed, 0.0, noise * np.random.default_rng(3).standard_normal((2000, 3)))
    assert forces.forced.tolist() == [False, True, True, True, False, False, True, True, True, True]
    assert not forces.wrench[4:6].any()
    assert "CS3041" not in {finding.code for finding in forces.findings}


def test_a_light_force_that_dips_at_the_cutting_feed_stays_with_its_cut(tmp_path) -> None:
    """32 N between 60 N, in noise that hides them: within the cut they are a force, on the way through the air they are not."""
    noise = 110 * np.random.default_rng(4).standard_normal((10, 200, 3))
    noise = (noise - noise.mean(axis=1, keepdims=True)).reshape(-1, 3)
    dips = hop_forces(tmp_path, "v30", 32.0, noise)
    assert dips.forced[1:].all()
    assert_allclose(dips.wrench[4:6, 1], 32, atol=1e-6)
    assert not hop_forces(tmp_path, "v500", 32.0, noise).forced[4:6].any()


def test_positions_that_come_late(tmp_path: Path) -> None:
    """30 ms late at 100 mm/s: each sample gets the place that the log has 3 mm later. The force is that place, in newtons."""
    time = np.arange(0.0, 0.4, 1e-3)
    true = 100 * time
    logged = np.maximum(true - 3.0, 0.0)
    rows = np.column_stack([time, logged, 10 + true, 0 * time, 0 * time])
    text, cell = log_text("time_s,path_mm,fx_n,fy_n,fz_n", rows), CELL + "force_log: {position_late_ms: 30}\n"
    here = place(tmp_path, text, cell)
    assert_allclose(here.wrench[1:4, 0], [20, 30, 40], atol=0.1)
    left_out = place(tmp_path, text)
    assert_allclose(left_out.wrench[1:4, 0], [23, 33, 43], atol=0.1)
    with pytest.raises(CompstiffError, match="CS3121.*position_late_ms is 30 in cell.yaml, and the log has no time"):
        place(tmp_path, log_text("path_mm,fx_n,fy_n,fz_n", rows[:, 1:]), cell)
    # As its hint says: at a rate that is stated it has.
    timed = plan(tmp_path, cell.replace("ms: 30", "ms: 30, rate_hz: 1000"))
    log = read_force_log(tmp_path / "forces.csv", timed.cell.force_log.form)
    assert_allclose(place_forces(log, timed, timed.cell).wrench[:4, 0], here.wrench[:4, 0], atol=1e-6)


@pytest.mark.parametrize(("rows_each", "share"), [(3, 0.05), (12, 0.01), pytest.param(40, 0.003, marks=pytest.mark.long)])
def test_a_short_tare_does_not_make_forces_of_noise(tmp_path, rows_each: int, share: float) -> None:
    """Nothing but noise, and a tare of two targets: of 24 others that are as long or three times as long, whose means are off
    by their own noise and by the tare's, next to none shows a force, and one of 14 sigma does. (All of them had with three
    samples each, one in twelve with twelve.)"""
    path = plan(tmp_path, count=26)
    wrong = missed = 0
    for seed in range(60):
        count = np.where(np.arange(26) < 2, rows_each, np.where(np.arange(26) < 14, rows_each, 3 * rows_each))
        force = np.random.default_rng((7, seed)).normal(0, 2, (int(count.sum()), 3))
        target = np.repeat(np.arange(26), count)
        sigma = 2 * np.sqrt(1 / rows_each + 1 / (2 * rows_each))
        force[target == 5] += [0, 14 * sigma, 0]
        (tmp_path / "forces.csv").write_text(log_text("target,fx_n,fy_n,fz_n", np.column_stack([target, force])))
        forces = place_forces(read_force_log(tmp_path / "forces.csv"), path, path.cell, tare=(0, 1), trust_tare=True)
        missed += not forces.forced[5]
        wrong += int(np.delete(forces.forced, 5).sum())
    assert wrong <= share * 60 * 25
    assert missed <= 2


@pytest.mark.parametrize(("lost", "listed"), [
    (range(8, 14), "6 targets of the cut.*: 8 to 13$"), (range(16, 26), "4 targets of the cut.*: 16 to 19$"),
    ([7, 9, 10, 11, 12], "5 targets of the cut.*: 7, 9 to 12$"), ([7, 9, 10], ""), ([2, 23], "")])
def test_all_targets_of_a_gap_in_the_cut_are_told(tmp_path, lost: Sequence[int], listed: str) -> None:
    """Not the two at its ends alone; what is reached at the air feed has no force to miss, and short gaps are filled."""
    plan(tmp_path)
    moves = "\n".join(f"Move{'L' if i else 'J'} [[{1000 + 10 * i},0,700],[{','.join(map(str, QUATERNION))}],[-1,-1,-1,0],"
                      f"[9E9,9E9,9E9,9E9,9E9,9E9]],{'v100' if 4 <= i < 20 else 'v500'},fine,tSpindle;" for i in range(26))
    path = robot_path(read_rapid(f"MODULE M\nPROC main()\n{moves}\nENDPROC\nENDMODULE\n".encode(), "m.mod").toolpath,
                      read_cell(tmp_path / "cell.yaml"))
    force = np.random.default_rng(5).normal(0, 0.3, (26, 10, 3))
    force[4:20, :, 1] += 200
    rows = np.column_stack([np.repeat(np.arange(26), 10), force.reshape(-1, 3)])
    rows = rows[~np.isin(rows[:, 0], list(lost))]
    (tmp_path / "forces.csv").write_text(log_text("target,fx_n,fy_n,fz_n", rows))
    forces = place_forces(read_force_log(tmp_path / "forces.csv"), path, path.cell, tare=(0, 1))
    told = [finding.message for finding in forces.findings if finding.code == "CS3012"]
    assert [bool(re.search(listed, message)) for message in told] == ([True] if listed else [])


@pytest.mark.parametrize(("lost", "count", "between"), [
    ([7], 26, [7]), ([7, 8, 12], 26, [7, 8, 12]), (list(range(8, 12)), 26, []), ([4], 26, []), ([7], 8, [])])
def test_a_short_gap_takes_what_lies_between_its_ends_and_says_so(
    tmp_path: Path, lost: Sequence[int], count: int, between: list[int]
) -> None:
    """Up to three targets, between two with force, in a cut four times as long as the stretch; the force is that of a smooth
    law to what the stated error says, which covers a step in the gap as well."""
    number = np.arange(26)

    def law(step: bool) -> np.ndarray:
        force = np.column_stack([0 * number, 150 + 30 * np.sin(number / 3), -40 + 0.0 * number])
        force[:, 1] += np.where(number >= 7, 120.0, 0.0) * step
        return force * ((number >= 4) & (number < 20))[:, None]

    path = plan(tmp_path, count=26)
    for step in (False, True):
        here = law(step) * (number < count)[:, None]
        rows = np.column_stack([np.repeat(number, 3), np.repeat(here, 3, axis=0)])
        (tmp_path / "forces.csv").write_text(log_text("target,fx_n,fy_n,fz_n", rows[~np.isin(rows[:, 0], lost)]))
        forces = place_forces(read_force_log(tmp_path / "forces.csv"), path, path.cell)
        assert forces.forced[lost].tolist() == [one in between for one in lost]
        told = [finding.code for finding in forces.findings if finding.code in ("CS3012", "CS3014")]
        assert told == ["CS3014" if between else "CS3012"]
        off = np.abs(forces.wrench[between, :3] - here[between])
        assert (off <= 2.5 * forces.standard_error[between] + 1e-9).all()
        assert step or not len(between) or off.max() < 8


@pytest.mark.parametrize(("tare", "force", "said"), [
    ((0, 1), 0.43, "within what the sensor shows in air"), ((0, 1), 0.55, ""), ((0, 1), 0.0, ""),
    (None, 0.3, "that is not told apart from zero"), (None, 0.7, "")])
def test_a_force_that_is_taken_for_none_is_told(
    tmp_path: Path, tare: tuple[int, int] | None, force: float, said: str
) -> None:
    """Noise of 2 N in 500 samples of three targets: 5 sigma of a mean are 0.45 N, 3 of a zero by two of these 0.19, together
    0.49. Without a tare each target is told from zero by its own scatter, of which 5 sigma are 0.45 N. The noise adds up to
    nothing; targets without a sample are no matter."""
    rng, rows = np.random.default_rng(1), []
    for target in (0, 1, 2):
        noise = rng.normal(0, 2.0, (500, 3))
        rows += [[target, *row] for row in noise - noise.mean(axis=0) + [0, force if target == 2 else 0.0, 0]]
    forces = place(tmp_path, log_text("target,fx_n,fy_n,fz_n", np.array(rows)), tare=tare, trust_tare=True)
    found = [one for one in forces.findings if one.code == "CS3009"]
    if tare is not None:
        assert [(one.level, one.file, one.line, one.target) for one in found] == ([("note", "m.mod", 5, 2)] if said else [])
        assert all(one.message.startswith("1 target with a mean force") for one in found)
    words = f"with a mean force {said or 'that is not told apart from zero'} (5 sigma) taken as without force"
    assert all(one.message.endswith(words) for one in found)
    assert forces.forced.tolist() == [False, False, bool(force) and not said, False, False]
    assert forces.wrench[2, 1] == pytest.approx(0.0 if said else force, abs=1e-6)


def test_a_force_within_the_noise_is_said_to_be_none() -> None:
    """A log without moments, and forces along one axis alone, too; not where there was no sample, or nothing but zeros."""
    forces: Any = SimpleNamespace(samples=np.array([9, 9, 9, 0, 9]), forced=np.array([True, False, False, False, False]))
    mean = np.zeros((5, 6))
    mean[[0, 1, 3, 4], :3] = [[80, 20, 5], [1, -2, 1], [1, 1, 1], [0, 0, 2]]
    path: Any = SimpleNamespace(toolpath=SimpleNamespace(source="a.mod", line=np.arange(10, 15)))
    zero: Any = SimpleNamespace(noise=None)
    [said] = _without_force(path, forces, mean, zero)
    assert (said.code, said.target, said.line) == ("CS3009", 1, 11)
    assert said.message.startswith("2 targets with a mean force that is not told apart from zero")
    assert not _without_force(path, forces, np.zeros((5, 6)), zero)


@pytest.mark.parametrize(("count", "largest", "least", "tare", "said"), [
    (5, 100.0, 22.0, (), True), (4, 100.0, 30.0, (), False), (5, 100.0, 19.0, (), False), (5, 100.0, 30.0, ((0, 1),), False),
    (5, 8.0, 5.5, (), True), (5, 8.0, 4.5, (), False)])
def test_a_program_that_cuts_on_every_move_shows_no_zero(
    count: int, largest: float, least: float, tare: tuple[tuple[int, int], ...], said: bool,
) -> None:
    """Five moves or more, all with more than a fifth of the largest force, and than 5 N, and no tare."""
    wrench = np.zeros((count, 6))
    wrench[:, 1], wrench[1, 1] = largest, least
    placed: Any = SimpleNamespace(forced=np.ones(count, dtype=bool), wrench=wrench, unknown=None,
                                  log=SimpleNamespace(source="log.csv"))
    path: Any = SimpleNamespace(cell=SimpleNamespace(force_log=SimpleNamespace(bias=None)))
    settings: Any = SimpleNamespace(log=SimpleNamespace(tare=tare))
    assert [finding.code for finding in _without_zero(placed, path, settings)] == ["CS3087"] * said


@pytest.mark.parametrize(("end", "back", "begins", "said"), [
    (400.0, False, True, False), (400.0, False, False, True), (400.0, True, True, False), (400.0, True, False, True),
    (150.0, False, True, True)])
def test_a_log_by_path_length_counts_from_a_move_to_joint_angles_or_from_the_first_robtarget(
    tmp_path: Path, end: float, back: bool, begins: bool, said: bool
) -> None:
    """As far as its end tells: the force, between 94 and 306 mm of the robtargets' path, is that of the targets there. A
    MoveAbsJ at the end may be counted or not."""
    home = "MoveAbsJ [[0,-5,5,0,40,0],[9E9,9E9,9E9,9E9,9E9,9E9]]\\NoEOffs,v100,fine,tSpindle;"
    moves = "\n".join(f"Move{'L' if i else 'J'} [[1000,{10 * i - 120},700],[{','.join(map(str, QUATERNION))}],[-1,-1,-1,0],"
                      "[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,tSpindle;" for i in range(41))
    text = f"MODULE M\nPROC main()\n{home}\n{moves}\n{home if back else ''}\nENDPROC\nENDMODULE\n"
    (tmp_path / "cell.yaml").write_text(CELL)
    path = robot_path(read_rapid(text.encode(), "m.mod").toolpath, read_cell(tmp_path / "cell.yaml"))
    lead = 1e3 * float(np.linalg.norm(path.base_from_tcp.position[1] - path.base_from_tcp.position[0]))
    assert lead > 100
    place = np.arange(0 if not begins else -lead, end, 1.0)
    rows = np.column_stack([place - place[0], 0 * place, 100.0 * ((place > 94) & (place < 306)), 0 * place])
    (tmp_path / "forces.csv").write_text(log_text("path_mm,fx_n,fy_n,fz_n", rows))
    forces = place_forces(read_force_log(tmp_path / "forces.csv"), path, path.cell)
    found = [one for one in forces.findings if one.code == "CS3129"]
    assert [(one.level, one.file) for one in found] == ([("warning", str(tmp_path / "forces.csv"))] if said else [])
    taken = (", where neither count ends: it is taken as counted from the MoveAbsJ on" if begins else
             ": it is taken as counted from the robtarget on")
    assert all(one.message == f"the program begins with a MoveAbsJ, {lead:.1f} mm from the first robtarget, and path_mm ends "
               f"at {rows[-1, 0]:.1f} mm{taken}" for one in found)
    assert np.flatnonzero(forces.wrench[:, 1] > 99).tolist() == [1 + i for i in range(10, 31) if 10 * i <= end]


TURN = f"[{','.join(map(str, QUATERNION))}],[-1,-1,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]]"
HOMES = {
    "none": "", "to joint angles": "MoveAbsJ [[0,0,0,0,30,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,tool0;\n",
    "in the air": f"MoveJ [[1000,-200,900],{TURN},v100,fine,tool0;\n"}


@pytest.mark.parametrize(("cuts", "forced", "newton", "said"), [
    (50, 5, 9.5, "5 with a force, 9.5 N in the middle"), (50, 6, 9.5, ""), (50, 5, 10.5, ""), (49, 4, 9.5, ""),
    (50, 0, 0.0, "none with a force")])
def test_a_pass_with_a_force_at_a_tenth_of_its_targets_cut_next_to_nothing(
    tmp_path: Path, cuts: int, forced: int, newton: float, said: str
) -> None:
    """Of fifty targets at the cutting feed, and of under ten newtons in the middle."""
    text = "".join(f"MoveL [[{1000 + 5 * i},0,700],{TURN},{'v500' if i < 6 else 'v20'},fine,tSpindle;\n"
                   for i in range(cuts + 6))
    (tmp_path / "cell.yaml").write_text(CELL)
    path = robot_path(read_rapid(f"MODULE M\nPROC main()\n{text}ENDPROC\nENDMODULE\n".encode(), "m.mod").toolpath,
                      read_cell(tmp_path / "cell.yaml"))
    force = np.random.default_rng(5).normal(0, 0.1, (cuts + 6, 40, 3))
    force[10:10 + 8 * forced:8, :, 1] += newton
    rows = np.column_stack([np.repeat(np.arange(cuts + 6), 40), force.reshape(-1, 3)])
    (tmp_path / "forces.csv").write_text(log_text("target,fx_n,fy_n,fz_n", rows))
    placed = place_forces(read_force_log(tmp_path / "forces.csv"), path, path.cell, tare=(0, 4))
    assert placed.forced.sum() == forced
    assert [(one.level, one.message) for one in placed.findings if one.code == "CS3077"] == ([(
        "warning", f"of 50 targets at the cutting feed {said}: was this pass driven in the air?")] if said else [])


@pytest.mark.parametrize("home", HOMES)
@pytest.mark.parametrize("key", ["positions", "joint angles"])
def test_a_home_of_another_tool_and_work_object_does_not_stop_a_log(tmp_path: Path, home: str, key: str) -> None:
    """Positions are those in the work object of the linear moves, joint angles carry their tool. Each target has a force of its
    own, from samples about it."""
    def planned(second: str, tool: str = "tSpindle") -> RobotPath:
        moves = "\n".join(
            f"MoveL [[{1000 + 10 * i},0,700],{TURN},v100,fine,{tool if i == 3 else 'tSpindle'}\\WObj:="
            f"{second if i == 4 else 'wPart'};" for i in range(5))
        data = "".join(f"PERS tooldata {name}:=[TRUE,[[120,0,{z}],[1,0,0,0]],[5,[0,0,90],[1,0,0,0],0,0,0]];\n"
                       for name, z in (("tSpindle", 250), ("tOther", 240)))
        data += "".join(
            f"PERS wobjdata {name}:=[FALSE,TRUE,\"\",[[0,0,0],[1,0,0,0]],[[0,50,100],[1,0,0,0]]];\n"
            for name in ("wPart", "wTwo"))
        (tmp_path / "cell.yaml").write_text(CELL)
        text = f"MODULE M\n{data}PROC main()\n{HOMES[home]}{moves}\nENDPROC\nENDMODULE\n"
        return robot_path(read_rapid(text.encode(), "m.mod").toolpath, read_cell(tmp_path / "cell.yaml"))

    here, along = planned("wPart"), np.linspace(0.0, 4.0, 81)
    if key == "positions":
        head, where = "x_mm,y_mm,z_mm", np.column_stack([1000 + 10 * along, 0 * along, 700 + 0 * along])
    else:
        theta = np.degrees(here.theta[-5:])
        head = ",".join(f"q{k}_deg" for k in range(1, 7))
        where = np.column_stack([np.interp(along, np.arange(5), axis) for axis in theta.T])
    force = np.column_stack([50 + 10 * np.round(along), np.zeros((81, 2))])
    log = tmp_path / "forces.csv"
    log.write_text(log_text(f"{head},fx_n,fy_n,fz_n", np.column_stack([where, force])))
    forces = place_forces(read_force_log(log), here, here.cell)
    assert_allclose(forces.wrench[-5:, 0], [50, 60, 70, 80, 90], atol=0.6)
    assert forces.samples[:-5].sum() <= 1
    if key == "positions":
        with pytest.raises(CompstiffError, match="CS3010.*needs one work object, the program uses 2"):
            place_forces(read_force_log(log), planned("wTwo"), here.cell)
        return
    place_forces(read_force_log(log), planned("wTwo"), here.cell)
    with pytest.raises(CompstiffError, match="CS3010.*joint angles needs one tool, the program uses 2"):
        place_forces(read_force_log(log), planned("wPart", "tOther"), here.cell)

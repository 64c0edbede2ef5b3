"""One axis of the force turned over, a mirrored part, moments of another force: told by the cuts of the virtual cell."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from benchmarks.turned_over import drawn
from compensator.forces.cut_direction import travel
from compensator.forces.placement import place_forces, read_force_log
from compensator.forces.turned_over import said_of_axial, said_of_mirror, said_of_moments
from compensator.path.robot_path import robot_path
from compensator.rapid import read_rapid
from identification.model.cell import read_cell
from identification.model.cell_file import CuttingFile
from tests.compensator.forces.test_contract_placement import CELL, log_text
from tests.virtual_cell.endmill import EndMill


@pytest.fixture(scope="module")
def jobs(tmp_path_factory: pytest.TempPathFactory) -> list:
    """A slot and the wall of a pocket, whose feed turns."""
    return [drawn("slot and pocket", np.random.default_rng((9, number)), tmp_path_factory.mktemp("job")) for number in range(6)]


def test_a_mirrored_part_is_told_where_the_path_turns(jobs: list) -> None:
    told = []
    for path, force in jobs:
        cuts = travel(path, np.any(force != 0, axis=1))
        assert cuts is not None
        assert said_of_mirror(cuts, force, "log") == []
        across = np.cross(cuts.up[0], [1.0, 0, 0])
        across /= np.linalg.norm(across)
        told.append(bool(said_of_mirror(cuts, force - 2 * np.outer(force @ across, across), "log")) or cuts.turns < 0.3)
    assert np.mean(told) > 0.6


@pytest.mark.parametrize(("degrees", "over", "stray", "said"), [
    (80.5, True, 0.0, None), (85, True, 0.0, "45 % of the force keeps its direction against the feed; on the path of the "
                              "mirrored part it would be 100 %"),
    (180, True, 0.0, "path turns, 0 % of the force"), (180, False, 0.0, None),
    (180, True, 1.1, "it would be 45 %"), (180, True, 1.3, None)])
def test_placed_forces_say_that_one_axis_is_turned_over(
    tmp_path: Path, degrees: float, over: bool, stray: float, said: str | None
) -> None:
    """An arc that a lying spindle cuts, with a force that keeps to the feed and so many times as much that keeps to nothing.
    With y turned over it stands by twice the turn t otherwise, so that (sin t / t)^2 of it follows. Told where t is over 81
    degrees, so that its doubled angle is spread by three tenths, and where over four tenths follow the mirrored path."""
    turn = np.radians(degrees)
    angle = turn * np.arange(121) / 120
    path_mm = 300 / turn * np.column_stack([np.sin(angle), 1 - np.cos(angle)]) + [0, 900]
    (tmp_path / "cell.yaml").write_text(CELL)
    cell = read_cell(tmp_path / "cell.yaml")
    moves = "\n".join(f"MoveL [[1500,{y:.4f},{z:.4f}],[0.70710678,0,0.70710678,0],[-1,-1,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],"
                      "v100,fine,tSpindle;" for y, z in path_mm)
    path = robot_path(read_rapid(f"MODULE M\nPROC main()\n{moves}\nENDPROC\nENDMODULE\n".encode(), "m.mod").toolpath, cell)
    feed = np.diff(path_mm, axis=0) / np.linalg.norm(np.diff(path_mm, axis=0), axis=1)[:, None]
    force = np.zeros((121, 3))
    force[1:, 1:] = -60 * feed + 80 * feed[:, ::-1] * [1, -1]
    force[1:, 1] *= -1 if over else 1
    force[1:, 1:] += 100 * stray * np.column_stack([np.cos(np.arange(120)), np.sin(np.arange(120))])
    (tmp_path / "forces.csv").write_text(log_text("target,fx_n,fy_n,fz_n", np.column_stack([np.arange(121), force])))
    found = [one for one in place_forces(read_force_log(tmp_path / "forces.csv"), path, cell).findings if one.code == "CS3125"]
    assert [(one.level, one.file) for one in found] == ([("warning", str(tmp_path / "forces.csv"))] if said else [])
    assert all(str(said) in one.message for one in found)


def test_a_flat_end_mill_is_not_pushed_into_its_holder(jobs: list) -> None:
    told = []
    for path, force in jobs:
        cuts = travel(path, np.any(force != 0, axis=1))
        assert cuts is not None
        assert said_of_axial(cuts, path, force, "log") == []
        up = cuts.up[0]
        turned = force - 2 * np.outer(force @ up, up)
        told.append(bool(said_of_axial(cuts, path, turned, "log")))
        for cutter in (CuttingFile(tool_diameter_mm=16), CuttingFile(tool_diameter_mm=16, corner_radius_mm=8), CuttingFile()):
            unknown = replace(path, cell=replace(path.cell, cutting=cutter))
            assert said_of_axial(cuts, unknown, turned, "log") == []        # a ball may be pushed in
    assert any(told)        # benchmarks/turned_over.py has how often


def load_of(gain: float = 1.0, signs: tuple[float, ...] = (1, 1, 1), off: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """What a sensor 250 mm behind the tip reads (N, 6) of a cutter of 8 mm radius that cuts 10 mm deep, with its forces times
    `gain` and `signs` and its place `off` [m] along the tool; and the way (N, 3) [m] to the tip that is stated."""
    rng = np.random.default_rng(5)
    mill = EndMill(runout_mm=(0.0, 0.0, 0.0))
    along, left, up = mill.mean_force(mill.coverage(-2.0 - mill.rim_mm[:, 1]), 10.0)
    angle = rng.uniform(0, 2 * np.pi, 60)
    force = np.column_stack([along * np.cos(angle) - left * np.sin(angle), along * np.sin(angle) + left * np.cos(angle),
                             np.full(60, -up)])
    touch = np.column_stack([0.006 * np.cos(angle), 0.006 * np.sin(angle), np.full(60, -0.005)])
    arm = np.tile([0.02, -0.01, 0.25], (60, 1))
    load = np.concatenate([force, np.cross(arm + touch, force)], axis=1) + rng.normal(0, [1, 1, 1, 0.05, 0.05, 0.05], (60, 6))
    return load * [*(gain * np.array(signs)), 1, 1, 1], arm + np.array([0, 0, off])


@pytest.mark.parametrize(("gain", "signs", "off", "said"), [
    (1.0, (1, 1, 1), 0.0, None), (1.1, (1, 1, 1), 0.0, None), (1.0, (1, 1, 1), 0.03, None),
    (0.5, (1, 1, 1), 0.0, "they are 1.9"), (2.0, (1, 1, 1), 0.0, "they are 0.4"), (1e-3, (1, 1, 1), 0.0, "they are 9"),
    (1.0, (1, -1, 1), 0.0, "with fy turned over"), (1.0, (-1, -1, 1), 0.0, "they are -0.9"),
    (1.0, (1, 1, 1), 0.25, "they are 0.4"),
])
def test_moments_are_those_of_the_force_at_the_tip(
    tmp_path: Path, gain: float, signs: tuple[float, ...], off: float, said: str | None
) -> None:
    (tmp_path / "cell.yaml").write_text(CELL + "force_log: {frame: sensor, sensor_quaternion: [1, 0, 0, 0], "
                                        "sensor_position_mm: [0, 0, 0]}\n")
    cell = read_cell(tmp_path / "cell.yaml")
    load, arm = load_of(gain, signs, off)
    # Behind the cut the cable pulls in the air, which is nobody's cutting force.
    load, arm = np.vstack([load, np.tile([0, 0, 5.0, 9.0, 0, 0], (40, 1))]), np.vstack([arm, arm[:40]])
    axes, cuts = np.broadcast_to(np.eye(3), (len(load), 3, 3)), np.arange(len(load)) < len(load) - 40
    found = said_of_moments(load, axes, arm, cuts, cell, "log")
    assert [finding.code for finding in found] == ([] if said is None else ["CS3127"])
    assert all(str(said) in finding.message for finding in found)
    assert said_of_moments(load, axes, 0.1 * arm, cuts, cell, "log") == []      # too near to tell
    assert said_of_moments(load, axes, arm, ~cuts & False, cell, "log") == []


def told_of(
    tmp_path: Path, share: float, along: float = 0.0, length: float = 0.25, flipped: bool = False, times: float = 1.0,
    rest: float = 0.0
) -> list[str]:
    """What is said of moments that are so many times those of forces (fx, +-fy, along) of 100 N across an arm along z: fx has
    such a share of their energy, and of the moments' energy `rest` is about the arm itself, which no force makes."""
    (tmp_path / "cell.yaml").write_text(CELL + "force_log: {frame: sensor, sensor_quaternion: [1, 0, 0, 0], "
                                        "sensor_position_mm: [0, 0, 0]}\n")
    signs = np.tile([[1.0, 1], [1, -1], [-1, 1], [-1, -1]], (10, 1))
    force = np.column_stack([100 * signs * np.sqrt([share, 1 - share]), np.full(40, 100 * along)])
    made = times * length * np.column_stack([force[:, 1] * (1 if flipped else -1), force[:, 0]])
    about = times * length * 100 * np.sqrt(rest / (1 - rest)) * np.tile([1.0, 1, -1, -1, -1, -1, 1, 1], 5)
    load = np.column_stack([force, made, about])
    found = said_of_moments(load, np.broadcast_to(np.eye(3), (40, 3, 3)), np.tile([0, 0, length], (40, 1)), np.ones(40, bool),
                            read_cell(tmp_path / "cell.yaml"), "log")
    assert all((one.code, one.level, one.file) == ("CS3127", "warning", "log") for one in found)
    return [one.message.split("at the tool's tip: ")[1] for one in found]


@pytest.mark.parametrize(("given", "said"), [
    # How far the sensor is, and how much of the force stands across the way to the tip.
    ({"length": 0.101, "times": 2.0}, ["they are 2.00 times those"]), ({"length": 0.099, "times": 2.0}, []),
    ({"along": 3.17, "times": 2.0}, ["they are 2.00 times those"]), ({"along": 3.19, "times": 2.0}, []),
    ({"times": 0.69}, ["they are 0.69 times those"]), ({"times": 0.71}, []),
    ({"times": 1.39}, []), ({"times": 1.41}, ["they are 1.41 times those"]),
    ({"rest": 0.149}, []), ({"rest": 0.151}, ["15 % of them is not"]), ({"rest": 0.149, "times": 2.0},
                                                                        ["they are 2.00 times those"]),
    # Half of the force along each axis: with one of them turned over nothing of the moments is that of the forces.
    ({"flipped": True, "rest": 0.149, "times": 1.3}, ["with fy turned over they would be, 1.30 times"]),
    ({"flipped": True, "rest": 0.151}, ["100 % of them is not"]),
    # Of the moments 0.1 are left with fy turned over, and 1 - 0.9 (2 s - 1)^2 without.
    ({"flipped": True, "rest": 0.1, "share": 0.907}, ["with fy turned over they would be, 1.00 times"]),
    ({"flipped": True, "rest": 0.1, "share": 0.909}, ["40 % of them is not"])])
def test_moments_are_held_against_forces_to_the_stated_shares(tmp_path: Path, given: dict, said: list[str]) -> None:
    """A tenth of a metre away at least, three tenths of the force across; within 0.7 to 1.4 times, but for 0.15 of the energy;
    another reading is named that leaves a quarter of what the stated one does."""
    assert told_of(tmp_path, **({"share": 0.5} | given)) == said


@pytest.mark.parametrize(("degrees", "aside", "said"), [
    (10, 0.3, ["turned by +10 degrees more"]), (9, 0.3, []), (-10, 0.3, ["turned by -10 degrees more"]), (-9, 0.3, []),
    (170, 0.3, ["turned by +170 degrees more"]),
    # A tip near the sensor's axis: by ten degrees hardly a fiftieth of the moments is another.
    (10, 0.13, []), (10, 0.15, ["turned by +10 degrees more"])])
def test_a_sensor_turned_about_its_axis_is_told_from_ten_degrees_and_a_fiftieth_on(
    tmp_path: Path, degrees: int, aside: float, said: list[str]
) -> None:
    """The tip lies 100 mm before the sensor and so far [m] beside its axis; forces of all directions."""
    (tmp_path / "cell.yaml").write_text(CELL + "force_log: {frame: sensor, sensor_quaternion: [1, 0, 0, 0], "
                                        "sensor_position_mm: [0, 0, 0]}\n")
    force = 100 * np.vstack([np.eye(3), -np.eye(3)] * 4)
    arm = np.array([aside, 0, 0.1])
    moment = np.cross(Rotation.from_euler("z", -degrees, degrees=True).apply(arm), force)
    found = said_of_moments(np.hstack([force, moment]), np.broadcast_to(np.eye(3), (24, 3, 3)), np.tile(arm, (24, 1)),
                            np.ones(24, dtype=bool), read_cell(tmp_path / "cell.yaml"), "log")
    assert [one.message.split("the sensor ")[1].split(" about")[0] for one in found] == said


@pytest.mark.parametrize("gain", [1.0, 0.5])
def test_placed_forces_ask_the_moments(tmp_path: Path, gain: float) -> None:
    """A log by targets in the sensor's axes, which stand as the robot's; the tip is 120 and 250 mm away."""
    (tmp_path / "cell.yaml").write_text(CELL + "force_log: {frame: sensor, sensor_quaternion: [1, 0, 0, 0], "
                                        "sensor_position_mm: [0, 0, 0]}\n")
    moves = "\n".join(f"MoveL [[{1000 + 10 * k},0,700],[1,0,0,0],[-1,-1,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,tSpindle;"
                      for k in range(12))
    cell = read_cell(tmp_path / "cell.yaml")
    path = robot_path(read_rapid(f"MODULE M\nPROC main()\n{moves}\nENDPROC\nENDMODULE\n".encode(), "m.mod").toolpath, cell)
    force = np.array([-40.0, 90, 20])
    row = [*(gain * force), *np.cross([0.12, 0, 0.25], force)]
    rows = np.array([[k, *row] for k in range(12)])
    (tmp_path / "forces.csv").write_text(log_text("target,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm", rows))
    found = place_forces(read_force_log(tmp_path / "forces.csv"), path, cell).findings
    assert ("CS3127" in {finding.code for finding in found}) == (gain != 1.0)


def test_moments_of_no_force_are_told(tmp_path: Path) -> None:
    (tmp_path / "cell.yaml").write_text(CELL + "force_log: {frame: tool}\n")
    load = np.zeros((20, 6))
    load[:, 5] = 1.5
    [found] = said_of_moments(load, np.broadcast_to(np.eye(3), (20, 3, 3)), np.zeros((20, 3)), np.ones(20, dtype=bool),
                              read_cell(tmp_path / "cell.yaml"), "log")
    assert (found.code, found.message) == (
        "CS3127", "the moments in this log are 1.5 N m and its forces nothing (RMS), and in the frame tool about the tool's "
        "tip: no cutting edge is so far from it")


def test_a_torque_about_the_tool_alone_is_none_of_the_forces(tmp_path: Path) -> None:
    """A sensor on the tool's axis that logs the spindle's torque, and zeros about the two axes across: no arm makes that."""
    (tmp_path / "cell.yaml").write_text("robot: irb6660-205-1.90\ntool: {position_mm: [0, 0, 250]}\nforce_log: {frame: sensor, "
                                        "sensor_quaternion: [1, 0, 0, 0], sensor_position_mm: [0, 0, 0]}\n")
    moves = "\n".join(f"MoveL [[{1000 + 10 * k},0,700],[1,0,0,0],[-1,-1,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,tSpindle;"
                      for k in range(12))
    cell = read_cell(tmp_path / "cell.yaml")
    path = robot_path(read_rapid(f"MODULE M\nPROC main()\n{moves}\nENDPROC\nENDMODULE\n".encode(), "m.mod").toolpath, cell)
    rows = np.array([[k, -40, 90, 20, 0, 0, 1.5 + 0.1 * k] for k in range(12)])
    (tmp_path / "forces.csv").write_text(log_text("target,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm", rows))
    placed = place_forces(read_force_log(tmp_path / "forces.csv"), path, cell)
    assert placed.wrench[3, 5] == pytest.approx(1.8)
    assert [one.message for one in placed.findings if one.code == "CS3127"] == [
        "the moments in this log are not those of its forces at the tool's tip: 100 % of them is not"]


@pytest.mark.parametrize(("stated", "said"), [
    ("[0.8660254, 0, 0, 0.5]", None), ("[0.8660254, 0, 0, -0.5]", "turned the other way"),
    ("[0, 0, 0.5, 0.8660254]", "read as x y z w"),
])
def test_a_sensor_that_is_turned_otherwise_is_told_by_its_moments(tmp_path: Path, stated: str, said: str | None) -> None:
    """It stands turned by 60 degrees about the flange's z; the tip lies aside of its axis."""
    (tmp_path / "cell.yaml").write_text(CELL + f"force_log: {{frame: sensor, sensor_quaternion: {stated}, "
                                        "sensor_position_mm: [0, 0, 0]}\n")
    cell = read_cell(tmp_path / "cell.yaml")
    sensor = Rotation.from_euler("z", 60, degrees=True).as_matrix()
    load, arm = load_of()
    arm = arm + np.array([0.1, 0, 0])
    load[:, 3:] += np.cross([0.1, 0, 0], load[:, :3])
    logged = np.concatenate([load[:, :3] @ sensor, load[:, 3:] @ sensor], axis=1)
    assert cell.force_log.flange_from_sensor is not None
    axes = np.broadcast_to(cell.force_log.flange_from_sensor.rotation, (len(load), 3, 3))
    found = said_of_moments(logged, axes, arm, np.ones(len(load), dtype=bool), cell, "log")
    assert [finding.code for finding in found] == ([] if said is None else ["CS3127"])
    assert all(str(said) in finding.message for finding in found)


@pytest.mark.parametrize(("kind", "away", "said"), [("tool", 0.0, False), ("base", 0.0, False), ("tool", 0.25, True)])
def test_about_the_tip_no_moment_has_a_long_arm(tmp_path: Path, kind: str, away: float, said: bool) -> None:
    """A cutter of 8 mm radius; moments that are about the tip, and about a sensor 250 mm behind it."""
    (tmp_path / "cell.yaml").write_text(CELL + f"force_log: {{frame: {kind}}}\n")
    load, arm = load_of()
    load[:, 3:] -= np.cross(arm, load[:, :3])
    load[:, 3:] += np.cross([0, 0, away], load[:, :3])
    axes = np.broadcast_to(np.eye(3), (len(load), 3, 3))
    found = said_of_moments(load, axes, 0 * arm, np.ones(len(load), dtype=bool), read_cell(tmp_path / "cell.yaml"), "log")
    assert [finding.code for finding in found] == (["CS3127"] if said else [])


@pytest.mark.parametrize(("stated_deg", "radius_m", "said"), [
    (30, 0.0, None), (30, 0.025, None), (24, 0.0, None), (0, 0.0, "turned by +30 degrees more"),
    (60, 0.0, "turned by -30 degrees more"), (0, 0.01, "turned by +3"), (60, 0.01, "turned by -3"), (55, 0.0, "turned by -25")])
def test_a_turn_about_the_sensors_own_axis_is_told_in_degrees(
    tmp_path: Path, stated_deg: float, radius_m: float, said: str | None
) -> None:
    """It stands turned by 30 degrees about the flange's z, the tip 127 mm aside of it; the force works at the cutter's side."""
    w, z = np.cos(np.radians(stated_deg / 2)), np.sin(np.radians(stated_deg / 2))
    (tmp_path / "cell.yaml").write_text(CELL + f"force_log: {{frame: sensor, sensor_quaternion: [{w:.9f}, 0, 0, {z:.9f}], "
                                        "sensor_position_mm: [0, 0, 55]}\n")
    cell = read_cell(tmp_path / "cell.yaml")
    rng = np.random.default_rng(30)
    arm, count = np.array([0.118, -0.047, 0.25]), 400
    way = rng.uniform(0, 2 * np.pi, count)
    force = np.column_stack([200 * np.cos(way) - 90 * np.sin(way), 200 * np.sin(way) + 90 * np.cos(way), np.full(count, -40.0)])
    side = radius_m * np.column_stack([np.cos(way), np.sin(way), 0 * way])
    moment = np.cross(arm + side, force) + rng.normal(0, 0.5, (count, 3))
    sensor = Rotation.from_euler("z", 30, degrees=True).as_matrix()
    logged = np.concatenate([force @ sensor, moment @ sensor], axis=1)
    assert cell.force_log.flange_from_sensor is not None
    axes = np.broadcast_to(cell.force_log.flange_from_sensor.rotation, (count, 3, 3))
    found = said_of_moments(logged, axes, np.tile(arm, (count, 1)), np.ones(count, dtype=bool), cell, "log")
    assert [finding.code for finding in found] == ([] if said is None else ["CS3127"])
    assert all(str(said) in finding.message for finding in found)


@pytest.mark.parametrize(("upward", "diameter", "corner", "climb", "count", "said"), [
    (15.5, 16, 0, 0.0, 12, True), (14.5, 16, 0, 0.0, 12, False), (-40, 16, 0, 0.0, 12, False),
    (15.5, 16, 0.8, 0.0, 12, True), (15.5, 16, 0.81, 0.0, 12, False), (15.5, 16, None, 0.0, 12, False),
    (15.5, None, 0, 0.0, 12, False), (15.5, 16, 0, 0.019, 12, True), (15.5, 16, 0, 0.021, 12, False),
    (15.5, 16, 0, 0.0, 10, True), (15.5, 16, 0, 0.0, 9, False)])
def test_placed_forces_say_that_a_flat_end_mill_is_pushed_in(
    tmp_path: Path, upward: float, diameter: float | None, corner: float | None, climb: float, count: int, said: bool
) -> None:
    """100 N across a tool that stands upright, and so much upwards: 0.15 of it is the limit. A corner of a tenth of the radius
    is that of a flat cutter yet; ways that climb by over 0.02, and fewer than ten of them, tell nothing. The first target is
    where the cut begins."""
    keys = ["teeth: 3", *([f"tool_diameter_mm: {diameter}"] if diameter else []),
            *([f"corner_radius_mm: {corner}"] if corner is not None else [])]
    (tmp_path / "cell.yaml").write_text(CELL + f"cutting: {{{', '.join(keys)}}}\n")
    moves = "\n".join(f"MoveL [[{1000 + 10 * k},0,{700 + 10 * climb * k:.3f}],[0,0,1,0],[-1,-1,-1,0],"
                      "[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,tSpindle;" for k in range(count + 1))
    cell = read_cell(tmp_path / "cell.yaml")
    path = robot_path(read_rapid(f"MODULE M\nPROC main()\n{moves}\nENDPROC\nENDMODULE\n".encode(), "m.mod").toolpath, cell)
    rows = np.array([[k, *(np.array([-60.0, 80, upward]) * (k > 0))] for k in range(count + 1)])
    (tmp_path / "forces.csv").write_text(log_text("target,fx_n,fy_n,fz_n", rows))
    found = [one for one in place_forces(read_force_log(tmp_path / "forces.csv"), path, cell).findings if one.code == "CS3126"]
    assert [(one.level, one.file) for one in found] == ([("warning", str(tmp_path / "forces.csv"))] if said else [])
    assert all("pushed into its holder, by 16 N at 100 N across it" in one.message for one in found)

"""Bias and weight of what hangs on the sensor: found from still readings, and taken off at each orientation."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from time import process_time
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from numpy.testing import assert_allclose
from scipy.optimize import brentq

from compensator.correction.correct import correct
from compensator.correction.files import Inputs, predict_files
from compensator.correction.prediction import predict_path
from compensator.correction.settings import Settings
from compensator.forces.payload import Payload, estimate_payload, interval_factor, turns
from compensator.forces.placement import place_forces, read_force_log
from compensator.forces.tare import SAME, _groups
from compensator.forces.zero import _estimated
from compensator.path.robot_path import RobotPath, robot_path
from compensator.rapid import read_rapid
from compstiff.cli.main import compstiff
from identification.common.findings import CompstiffError, Finding
from identification.model.cell import FARTHEST_CENTRE, read_cell
from tests.runs.command_line import user_files as kit
from tests.runs.command_line.user_files import IRB6660

MASS, CENTRE = 12.4, np.array([0.012, -0.008, 0.143])       # flange frame [m]
SENSOR_PLACE, SENSOR_TURN = np.array([0.0, 0.004, 0.03]), kit.Rotation.from_euler("zyx", [40, 3, -2], degrees=True)
BIAS = np.array([14.0, -31.0, 55.0, 0.6, -1.4, 0.25])
SENSOR = (f"{{frame: sensor, sensor_position_mm: {(1e3 * SENSOR_PLACE).tolist()}, "
          f"sensor_quaternion: {kit.quaternion(SENSOR_TURN).tolist()}, %s}}")
CELL = "robot: irb6660-205-1.90\ntool: {position_mm: [120, 0, 250]}\nforce_log: "
WRIST = np.array([[0, 0], [60, 90], [60, -90], [-60, 30], [-60, 180], [90, 45], [90, -60], [-90, 0]])


def reading(rotation: kit.Rotation) -> np.ndarray:
    """Force and moment (6,) the sensor shows with the flange turned so in the world: weight by statics, and its bias."""
    sensor = rotation * SENSOR_TURN
    force = sensor.inv().apply([0, 0, -MASS * 9.80665])
    arm = SENSOR_TURN.inv().apply(CENTRE - SENSOR_PLACE)
    return BIAS + np.concatenate([force, np.cross(arm, force)])


def still_log(folder: Path, rng: np.random.Generator, wrist: np.ndarray = WRIST, samples: int = 30, sign: float = 1.0) -> Path:
    """The robot still at several wrist angles, with samples on the way between them."""
    rows = []
    for k, (q5, q6) in enumerate(wrist):
        q = np.array([10.0, 10, 5, 0, q5, q6])
        pose = kit.tcp_pose(IRB6660, np.radians(q), kit.IDENTITY).r
        noise = rng.normal(0, 1, (samples, 6)) * [1.5, 1.5, 1.5, 0.05, 0.05, 0.05]
        rows += [[*q, *(sign * (reading(pose) + e))] for e in noise]
        if k + 1 < len(wrist):
            rows += [[*(q + np.array([0, 0, 0, 0, 2 + step, 3 * step])), *rng.normal(0, 300, 6)] for step in range(2)]
    header = ",".join([*(f"q{k}_deg" for k in range(1, 7)), "fx_n", "fy_n", "fz_n", "mx_nm", "my_nm", "mz_nm"])
    path = folder / "still.csv"
    path.write_text(header + "\n" + "\n".join(",".join(f"{x:.6f}" for x in row) for row in rows) + "\n")
    return path


def tare(folder: Path, still: Path, cell: str) -> tuple[int, dict]:
    (folder / "cell.yaml").write_text(cell)
    run = CliRunner().invoke(compstiff, ["tare", str(folder / "cell.yaml"), str(still), "-o", str(folder / "payload.yaml"),
                                         "--force", "--json"])
    return run.exit_code, json.loads(run.stdout)


@pytest.mark.parametrize("sign", ["on_tool", "by_tool"])
def test_the_ten_parameters_come_back(tmp_path, sign: str) -> None:
    still = still_log(tmp_path, np.random.default_rng(1), sign=1.0 if sign == "on_tool" else -1.0)
    code, said = tare(tmp_path, still, CELL + SENSOR % f"sign: {sign}")
    assert code == 0, said
    found = said["result"]
    assert found["orientations"] == len(WRIST)
    bias = BIAS if sign == "on_tool" else -BIAS
    truth = [MASS, *(1e3 * CENTRE), *bias]
    estimates = [found["mass_kg"], *found["centre_of_mass_mm"], *found["bias_n"], *found["bias_nm"]]
    for one, true in zip(estimates, truth, strict=True):
        assert abs(one["estimate"] - true) < 5 * one["std"]
        assert one["std"] > 0
    assert found["mass_kg"]["std"] < 0.05
    assert [finding["message"] for finding in said["findings"] if finding["code"] == "CS3038"] == [
        "14 samples not used: between the orientations, or of one that has less than 10 % of the samples of the longest"]
    # What it writes is what cell.yaml takes.
    keys = "\n".join((tmp_path / "payload.yaml").read_text().splitlines()[3:])
    extra = ", ".join(line.strip() for line in keys.splitlines())
    (tmp_path / "full.yaml").write_text(CELL + SENSOR % f"sign: {sign}, {extra}")
    cell = read_cell(tmp_path / "full.yaml").force_log
    assert cell.mass == pytest.approx(found["mass_kg"]["estimate"], abs=1e-4)
    assert_allclose(cell.bias, [one["estimate"] for one in (*found["bias_n"], *found["bias_nm"])], atol=1e-4)


@pytest.mark.parametrize(("first", "rate", "orientations"), [
    (300, "", 8), (310, "", 1), (310, ", rate_hz: 28", 8), (310, ", rate_hz: 30", 1)])
def test_an_orientation_counts_however_long_the_robot_waited_at_another_one(
    tmp_path: Path, first: int, rate: str, orientations: int
) -> None:
    """Seven poses of 30 samples behind one of so many more. A tenth of these counts; less of it where the log's time shows that
    the robot stood for a second, from the first of 30 samples to the last at 28 of them a second."""
    rng, rows = np.random.default_rng(1), []
    for number, (q5, q6) in enumerate(WRIST):
        q = [10.0, 10, 5, 0, q5, q6]
        shown = reading(kit.tcp_pose(IRB6660, np.radians(q), kit.IDENTITY).r)
        rows += [[*q, *(shown + noise)] for noise in rng.normal(0, 0.1, (30 if number else first, 6))]
    still = tmp_path / "still.csv"
    still.write_text("q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm\n"
                     + "\n".join(",".join(f"{x:.6f}" for x in row) for row in rows) + "\n")
    code, said = tare(tmp_path, still, CELL + SENSOR % f"sign: on_tool{rate}")
    if orientations == 1:
        [stopped] = said["findings"]
        assert (code, stopped["code"]) == (1, "CS3034")
        assert stopped["hint"].endswith("; 210 samples not used: between the orientations, or of one that has less than 10 % "
                                        "of the samples of the longest")
        return
    assert (code, said["result"]["orientations"]) == (0, 8), said
    assert abs(said["result"]["mass_kg"]["estimate"] - MASS) < 5 * said["result"]["mass_kg"]["std"]
    assert "CS3038" not in {finding["code"] for finding in said["findings"]}


def test_stated_intervals_cover() -> None:
    """95 % of the intervals hold the truth, over 400 sensors and sets of orientations; binomial bounds at 4 sigma."""
    rng = np.random.default_rng(7)
    inside = []
    for _ in range(400):
        fall = kit.Rotation.random(6, random_state=rng).apply([0, 0, -9.80665])
        mass, arm, bias = rng.uniform(2, 60), rng.uniform(-0.3, 0.3, 3), rng.normal(0, 30, 6)
        load = np.concatenate([mass * fall, np.cross(arm, mass * fall)], axis=1) + bias
        load += rng.normal(0, 1, (6, 6)) * [0.5] * 3 + rng.normal(0, 1, (6, 6)) * [0, 0, 0, 0.03, 0.03, 0.03]
        found = estimate_payload(fall, load, has_moment=True)
        if found is None or found.centre is None:
            continue
        wide, narrow = interval_factor(found.moment_dof), interval_factor(found.force_dof)
        inside.append([abs(found.mass - mass) < narrow * found.mass_std,
                       *(np.abs(found.bias - bias) < np.r_[[narrow] * 3, [wide] * 3] * found.bias_std),
                       *(np.abs(found.centre - arm) < wide * found.centre_std)])
    share = np.mean(inside, axis=0)
    assert len(inside) > 350
    assert np.all(np.abs(share - 0.95) < 4 * np.sqrt(0.95 * 0.05 / len(inside))), share


def test_a_centre_is_as_unsure_as_the_mass_that_it_is_divided_by() -> None:
    """Forces with 5 N of noise, moments that are all but exact: the centre scatters as 1 / mass."""
    rng = np.random.default_rng(11)
    fall = kit.Rotation.random(8, random_state=rng).apply([0, 0, -9.80665])
    noise = np.tile([5.0, 5, 5, 1e-4, 1e-4, 1e-4], (8, 1))
    load = np.concatenate([12 * fall, np.cross([0.05, -0.1, 0.2], 12 * fall)], axis=1)
    found = [estimate_payload(fall, load + noise * each, has_moment=True, noise=noise)
             for each in rng.standard_normal((400, 8, 6))]
    centres = np.array([one.centre for one in found])
    stated = np.sqrt(np.mean([one.centre_std**2 for one in found], axis=0))
    assert_allclose(centres.std(axis=0), stated, rtol=0.15)
    assert_allclose(stated / np.abs(centres.mean(axis=0)), np.mean([one.mass_std / one.mass for one in found]), rtol=0.1)


@pytest.mark.parametrize(("wrist", "mass"), [([[0, 0], [0, 90], [2, 0]], False), ([[0, 0], [40, 0], [-40, 0], [60, 0]], True)])
def test_what_the_orientations_do_not_separate_is_refused(tmp_path, wrist: list, mass: bool) -> None:
    """Spindle upright in all: no mass. Tilted about one axis alone: the mass, and a centre only where g turns enough."""
    q = np.radians([[10.0, 10, 5, 0, q5, q6] for q5, q6 in wrist])
    fall = np.array([(kit.tcp_pose(IRB6660, one, kit.IDENTITY).r * SENSOR_TURN).inv().apply([0, 0, -9.80665]) for one in q])
    code, said = tare(tmp_path, still_log(tmp_path, np.random.default_rng(2), np.array(wrist)), CELL + SENSOR % "sign: on_tool")
    if not mass and turns(fall)[0] < 0.1:
        assert code == 1
        assert said["findings"][0]["code"] == "CS3034"
        assert not (tmp_path / "payload.yaml").exists()
    else:
        assert code == 0
        assert said["result"]["mass_kg"]["estimate"] == pytest.approx(MASS, abs=5 * said["result"]["mass_kg"]["std"])


def test_a_wrong_sign_makes_the_payload_negative(tmp_path) -> None:
    still = still_log(tmp_path, np.random.default_rng(1))
    code, said = tare(tmp_path, still, CELL + SENSOR % "sign: by_tool")
    assert code == 1
    assert said["findings"][0]["code"] == "CS3042"


def test_an_uncertain_payload_is_said(tmp_path) -> None:
    """The sensor's zero wanders by 10 N from orientation to orientation, and they turn gravity by 14 degrees at most."""
    still = still_log(tmp_path, np.random.default_rng(1), np.array([[0.0, 0], [14, 0], [-14, 0]]))
    head, *rows = still.read_text().splitlines()
    values = np.array([[float(cell) for cell in row.split(",")] for row in rows])
    _, orientation = np.unique(values[:, :6], axis=0, return_inverse=True)
    values[:, 6:9] += np.random.default_rng(3).normal(0, 10, (orientation.max() + 1, 3))[orientation.ravel()]
    still.write_text("\n".join([head, *(",".join(f"{x:.6f}" for x in row) for row in values)]) + "\n")
    code, said = tare(tmp_path, still, CELL + SENSOR % "sign: on_tool")
    assert code == 3        # most of what changes is the zero's wandering: CS3048
    assert "CS3045" in {finding["code"] for finding in said["findings"]}
    assert said["result"]["mass_kg"]["std"] * 9.80665 > 10


@pytest.mark.parametrize(("stated", "said"), [(MASS / 1.24, False), (MASS / 1.26, True), (MASS / 0.205, False),
                                              (MASS / 0.195, True)])
def test_a_mass_far_from_the_stated_one_is_said(tmp_path: Path, stated: float, said: bool) -> None:
    """A fifth to five quarters of it are the tool's parts before and behind the sensor."""
    still = still_log(tmp_path, np.random.default_rng(1))
    code, found = tare(tmp_path, still, CELL + SENSOR % f"payload: {{mass_kg: {stated:.4f}}}")
    assert code == 0
    assert [(one["level"], one["message"]) for one in found["findings"] if one["code"] == "CS3049"] == (
        [("warning", f"a mass of 12.4 kg hangs on the sensor; cell.yaml states {float(f'{stated:.4f}'):g} kg")] if said else [])


@pytest.mark.parametrize(("away_m", "said"), [(0.98, False), (1.02, True)])
def test_a_centre_too_far_from_the_flange_is_moments_in_another_unit(tmp_path: Path, away_m: float, said: bool) -> None:
    """The moments so many times as large that the centre stands so far off, as multiples of the limit."""
    still, limit = still_log(tmp_path, np.random.default_rng(1)), 1e-3 * FARTHEST_CENTRE
    arm, place = CENTRE - SENSOR_PLACE, SENSOR_PLACE
    # |place + s arm| = away, by the positive root.
    b, c = float(arm @ place), float(place @ place) - (away_m * limit) ** 2
    scale = (-b + np.sqrt(b**2 - float(arm @ arm) * c)) / float(arm @ arm)
    rows = np.loadtxt(still, delimiter=",", skiprows=1)
    rows[:, 9:] *= scale
    np.savetxt(still, rows, delimiter=",", fmt="%.6f", comments="",
               header="q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm")
    code, found = tare(tmp_path, still, CELL + SENSOR % "sign: on_tool")
    told = [one for one in found["findings"] if one["code"] == "CS3047"]
    assert (code, len(told)) == (int(said), int(said))
    if said:
        shown = float(told[0]["message"].removeprefix("the centre of mass would be ").split(" m from the flange")[0])
        assert shown == pytest.approx(away_m * limit, rel=0.01)


@pytest.mark.parametrize(("newton", "said"), [(9.7, False), (10.3, True)])
def test_a_payload_that_is_uncertain_by_ten_newtons_is_said(tmp_path: Path, newton: float, said: bool) -> None:
    """1 sigma by the least squares of the eight orientations, whose forces have an error each that makes it so."""
    poses = [kit.tcp_pose(IRB6660, np.radians([10.0, 10, 5, 0, *wrist]), kit.IDENTITY).r for wrist in WRIST]
    down = np.array([(pose * SENSOR_TURN).inv().apply([0, 0, -9.80665]) for pose in poses])
    design = np.column_stack([np.tile(np.eye(3), (8, 1)), down.ravel()])
    off = np.random.default_rng(4).normal(0, 1, 24)
    left = off - design @ np.linalg.lstsq(design, off, rcond=None)[0]
    std = 9.80665 * np.sqrt(left @ left / 20 * np.linalg.inv(design.T @ design)[3, 3])
    off *= newton / std
    rows = [[10, 10, 5, 0, *wrist, *(reading(pose) + np.r_[error, 0, 0, 0])]
            for wrist, pose, error in zip(WRIST, poses, off.reshape(8, 3), strict=True) for _ in range(3)]
    still = tmp_path / "still.csv"
    np.savetxt(still, rows, delimiter=",", fmt="%.6f", comments="",
               header="q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm")
    found = tare(tmp_path, still, CELL + SENSOR % "sign: on_tool")[1]
    assert [one["message"] for one in found["findings"] if one["code"] == "CS3045"] == (
        ["the payload is uncertain by 21 N (2 sigma): as much false cutting force"] if said else [])


def test_two_orientations_leave_the_centre_open(tmp_path) -> None:
    still = still_log(tmp_path, np.random.default_rng(1), WRIST[:2])
    code, said = tare(tmp_path, still, CELL + SENSOR % "sign: on_tool")
    assert code == 0
    assert said["result"]["centre_of_mass_mm"] is None
    codes = {finding["code"] for finding in said["findings"]}
    assert "CS3044" in codes
    assert "CS3034" not in codes


def test_one_direction_of_turn_does_not_give_the_centre() -> None:
    """Small turns about one axis: the arm along g's mean does not show, and neither does the one along the axis of turning."""
    tilt = np.radians([-20, -10, 0, 10, 20])
    fall = -9.80665 * np.column_stack([np.sin(tilt), 0 * tilt, np.cos(tilt)])
    near = fall * [1, 1, 0] + [0, 0, -9.80665]              # one direction exactly
    load = np.concatenate([MASS * near, np.cross([0.1, 0.2, 0.3], MASS * near)], axis=1)
    load += np.random.default_rng(0).normal(0, 0.01, load.shape)
    found = estimate_payload(near, load, has_moment=True)
    assert found is not None
    assert found.centre is None
    assert found.mass == pytest.approx(MASS, rel=0.01)


def test_readings_under_load_are_no_still_readings(tmp_path) -> None:
    """Load tests at joints that stand still: 200 N on and off."""
    still = still_log(tmp_path, np.random.default_rng(1))
    head, *rows = still.read_text().splitlines()
    cells = [row.split(",") for row in rows]
    loaded = [[*one[:6], f"{float(one[6]) + 200 * (i % 2):.6f}", *one[7:]] for i, one in enumerate(cells)]
    still.write_text("\n".join([head, *(",".join(one) for one in loaded)]) + "\n")
    code, said = tare(tmp_path, still, CELL + SENSOR % "sign: on_tool")
    assert code == 1
    assert said["findings"][0]["code"] == "CS3037"
    assert "100 N" in said["findings"][0]["message"]


HEAD = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm"


@pytest.mark.parametrize(("newton", "said"), [(29.9, False), (30.1, True)])
def test_forces_that_vary_by_thirty_newtons_while_the_joints_stand_still_are_a_load(
    tmp_path: Path, newton: float, said: bool
) -> None:
    """To and fro by (0.6, 0, 0.8) of it in one of eight orientations, by a tenth of it in the others."""
    rows = []
    for k, wrist in enumerate(WRIST):
        shown = reading(kit.tcp_pose(IRB6660, np.radians([10.0, 10, 5, 0, *wrist]), kit.IDENTITY).r)
        off = newton * (1.0 if k == 4 else 0.1) * np.array([0.6, 0, 0.8, 0, 0, 0])
        rows += [[10, 10, 5, 0, *wrist, *(shown + (-1) ** j * off)] for j in range(20)]
    still = tmp_path / "still.csv"
    np.savetxt(still, rows, delimiter=",", fmt="%.6f", comments="", header=HEAD)
    code, found = tare(tmp_path, still, CELL + SENSOR % "sign: on_tool")
    assert (code, found["findings"][0]["code"] == "CS3037") == (int(said), said)
    if said:
        assert found["findings"][0]["message"].startswith("the force varies by 30 N (1 sigma) while the joints stand still, at "
                                                          "most 30 N are those")
    else:
        assert found["result"]["mass_kg"]["estimate"] == pytest.approx(MASS, abs=1e-6)


@pytest.mark.parametrize(("least", "said"), [(0.099, True), (0.101, False)])
def test_a_centre_needs_gravity_to_turn_about_a_second_axis(tmp_path: Path, least: float, said: bool) -> None:
    """Tilted by ten degrees one way and the other, and turned by so much: an arm in the worst direction sees the two least of
    the three spreads of g, in the root of their sum."""
    def turn(across: float) -> tuple[np.ndarray, float]:
        wrist = np.array([[50.0, 0], [60, 0], [70, across], [60, -across]])
        down = np.array([kit.tcp_pose(IRB6660, np.radians([10.0, 10, 5, 0, *one]), kit.IDENTITY).r.inv().apply([0, 0, -1.0])
                         for one in wrist])
        return wrist, float(np.sqrt(np.sum(np.sort(np.linalg.eigvalsh(np.cov(down.T, ddof=0)))[:2])))

    across = brentq(lambda angle: turn(angle)[1] - least, 1, 60)
    wrist, _ = turn(across)
    still = still_log(tmp_path, np.random.default_rng(1), wrist)
    code, found = tare(tmp_path, still, CELL + SENSOR % "sign: on_tool")
    told = [(one["level"], one["message"]) for one in found["findings"] if one["code"] == "CS3044"]
    assert (code, told) == (0, [(
        "warning", f"the centre of mass is not estimated: 4 orientations, the least turn {np.degrees(least):.1f} deg over two "
        "directions, 5.7 deg are needed")] if said else [])
    assert (found["result"]["centre_of_mass_mm"] is None) == said


def test_a_payload_that_is_not_told_from_none_is_not_written(tmp_path) -> None:
    rng, rows = np.random.default_rng(4), []
    for q5, q6 in WRIST:
        rows += [[10.0, 10, 5, 0, q5, q6, *(BIAS + noise)] for noise in rng.normal(0, 1.5, (30, 6))]
    header = ",".join([*(f"q{k}_deg" for k in range(1, 7)), "fx_n", "fy_n", "fz_n", "mx_nm", "my_nm", "mz_nm"])
    still = tmp_path / "still.csv"
    still.write_text(header + "\n" + "\n".join(",".join(f"{x:.6f}" for x in row) for row in rows) + "\n")
    code, said = tare(tmp_path, still, CELL + SENSOR % "sign: on_tool")
    assert code == 0
    assert "CS3043" in {finding["code"] for finding in said["findings"]}
    written = (tmp_path / "payload.yaml").read_text()
    assert "bias_n" in written
    assert "payload:" not in written


def test_tare_needs_a_sensor_and_joint_angles(tmp_path) -> None:
    still = still_log(tmp_path, np.random.default_rng(1))
    assert tare(tmp_path, still, CELL + "{frame: base}")[1]["findings"][0]["code"] == "CS3037"
    still.write_text("target,fx_n,fy_n,fz_n\n0,1,2,3\n")
    assert tare(tmp_path, still, CELL + SENSOR % "sign: on_tool")[1]["findings"][0]["code"] == "CS3037"


def tilted_plan(folder: Path, cell: str, count: int = 12, step: float = 5.0) -> RobotPath:
    """Targets `step` [mm] apart, the tool tilting to and fro by 50 deg and on by 60 deg on the way."""
    moves = moves_of(count, step)
    (folder / "cell.yaml").write_text(cell)
    text = "MODULE M\nPROC main()\n" + "\n".join(moves) + "\nENDPROC\nENDMODULE\n"
    return robot_path(read_rapid(text.encode(), "m.mod").toolpath, read_cell(folder / "cell.yaml"))


def moves_of(count: int, step: float = 5.0) -> list[str]:
    moves = []
    for k in range(count):
        share = k / (count - 1)
        turn = kit.Rotation.from_euler("yx", [180 - 50 * np.sin(np.pi * share), 60 * share], degrees=True)
        text = ",".join(f"{v:.9f}" for v in kit.quaternion(turn))
        moves.append(f"Move{'L' if k else 'J'} [[{1200 + step * k},0,900],[{text}],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],"
                     "v50,fine,t1;")
    return moves


def pass_log(folder: Path, plan: RobotPath, cut: np.ndarray, noise: float = 0.0, tool_on: bool = True) -> Path:
    """What the sensor logs along the plan: cut (N, 6) in the base frame at the TCP, the tool's weight, its bias."""
    rng, rows = np.random.default_rng(0), []
    for k, wrench in enumerate(cut):
        flange = kit.Rotation.from_matrix(plan.base_from_flange.rotation[k])
        sensor = flange * SENSOR_TURN
        lever = flange.apply(np.array([0.12, 0, 0.25]) - SENSOR_PLACE)
        shown = np.concatenate([sensor.inv().apply(wrench[:3]), sensor.inv().apply(wrench[3:] + np.cross(lever, wrench[:3]))])
        shown = shown + (reading(flange) if tool_on else 0)
        rows += [[k, *(shown + noise * rng.normal(0, 1, 6) * [1, 1, 1, 0.05, 0.05, 0.05])] for _ in range(40)]
    path = folder / "forces.csv"
    path.write_text("target,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm\n" + "\n".join(",".join(f"{x:.9f}" for x in row) for row in rows))
    return path


CUT = np.zeros((12, 6))
CUT[5:9] = [150, -80, 40, 3, -2, 1]
STATED = ("bias_n: [14, -31, 55], bias_nm: [0.6, -1.4, 0.25], weight: in_log, "
          "payload: {mass_kg: 12.4, centre_of_mass_mm: [12, -8, 143]}")


def test_bias_and_weight_are_taken_off_at_every_orientation(tmp_path) -> None:
    plan = tilted_plan(tmp_path, CELL + SENSOR % STATED)
    forces = place_forces(read_force_log(pass_log(tmp_path, plan, CUT)), plan, plan.cell)
    assert_allclose(forces.wrench, CUT, atol=1e-5)
    assert [finding.level for finding in forces.findings if finding.code == "CS3031"] == ["note"]


def test_a_log_without_moments_gets_none_from_bias_or_weight(tmp_path) -> None:
    plan = tilted_plan(tmp_path, CELL + SENSOR % STATED)
    path = pass_log(tmp_path, plan, CUT)
    path.write_text("\n".join(",".join(line.split(",")[:4]) for line in path.read_text().splitlines()))
    forces = place_forces(read_force_log(path), plan, plan.cell)
    assert_allclose(forces.wrench[:, :3], CUT[:, :3], atol=1e-5)
    assert not forces.wrench[:5].any()
    assert not forces.wrench[9:].any()


@pytest.mark.parametrize(("centre", "moments", "weight", "said"), [
    ("", True, "in_log", True), (", centre_of_mass_mm: [12, -8, 143]", True, "in_log", False), ("", False, "in_log", False),
    ("", True, "removed", False)])
def test_a_mass_without_its_centre_is_taken_from_the_forces_and_not_from_the_moments(
    tmp_path, centre: str, moments: bool, weight: str, said: bool
) -> None:
    """The moment that stays is that of the weight about the tool's tip, by statics. Nothing is said where the centre is known,
    where no moment was logged, or where the log holds no weight."""
    stated = STATED.replace(", centre_of_mass_mm: [12, -8, 143]", centre).replace("in_log", weight)
    plan = tilted_plan(tmp_path, CELL + SENSOR % stated)
    path = pass_log(tmp_path, plan, CUT)
    if not moments:
        path.write_text("\n".join(",".join(line.split(",")[:4]) for line in path.read_text().splitlines()))
    forces = place_forces(read_force_log(path), plan, plan.cell)
    found = [one for one in forces.findings if one.code == "CS3013"]
    assert [(one.level, one.file) for one in found] == ([("warning", str(path))] if said else [])
    if not said:
        return
    assert found[0].message.startswith("the moment of the payload of 12.4 kg is not subtracted")
    assert found[0].hint == "state centre_of_mass_mm"
    flange = plan.base_from_flange.rotation
    # The weight's force was taken off at the sensor's origin, its moment about that place not.
    arm = flange @ (CENTRE - SENSOR_PLACE)
    assert_allclose(forces.wrench[5:9], (CUT + np.hstack([np.zeros((12, 3)), np.cross(arm, [0, 0, -MASS * 9.80665])]))[5:9],
                    atol=1e-4)


def test_an_air_stretch_gives_the_bias_beside_the_known_weight(tmp_path) -> None:
    plan = tilted_plan(tmp_path, CELL + SENSOR % STATED[STATED.index("weight"):])
    log = read_force_log(pass_log(tmp_path, plan, CUT, noise=1.0))
    forces = place_forces(log, plan, plan.cell, tare=(0, 2))
    assert forces.forced.tolist() == (CUT != 0).any(axis=1).tolist()
    assert_allclose(forces.wrench[5:9, :3], CUT[5:9, :3], atol=1.0)
    assert_allclose(forces.tare, BIAS, atol=0.5)


def test_air_stretches_of_other_orientations_give_mass_and_centre(tmp_path) -> None:
    """Nothing about the payload in cell.yaml: three air moves, as the spindle tilts, tell it and the bias."""
    plan = tilted_plan(tmp_path, CELL + SENSOR % "sign: on_tool")
    log = read_force_log(pass_log(tmp_path, plan, CUT, noise=0.5))
    forces = place_forces(log, plan, plan.cell, tare=[(0, 0), (1, 1), (2, 2), (3, 3), (4, 4), (9, 9), (10, 10), (11, 11)])
    assert "CS3033" in {finding.code for finding in forces.findings}
    assert forces.forced[5:9].all()
    assert_allclose(forces.wrench[5:9, :3], CUT[5:9, :3], atol=1.0)
    assert_allclose(forces.wrench[5:9, 3:], CUT[5:9, 3:], atol=0.6)
    # One stretch cannot: the weight that tilts away from it is left in the cut.
    left = place_forces(log, plan, plan.cell, tare=(0, 0), trust_tare=True).wrench[5:9, :3] - CUT[5:9, :3]
    assert np.linalg.norm(left, axis=1).min() > 20


@pytest.mark.parametrize(("stretches", "first"), [([(0, 0), (1, 1)], 40), ([(0, 0), (2, 2)], 4),
                                                  ([(0, 0), (2, 2), (11, 11)], 40)])
def test_what_a_payload_is_off_that_the_stretches_told_is_in_the_sigma_of_each_force(
    tmp_path: Path, stretches: list[tuple[int, int]], first: int
) -> None:
    """Over 40 logs: two stretches 15 or 29 degrees apart tell the mass badly, and a cut far from their orientation, whose own
    samples have no noise here, is off by as much of its weight; three in which the tool tilts further tell it well. What is
    left of the weight in the air is no cut."""
    plan = tilted_plan(tmp_path, CELL + SENSOR % "sign: on_tool")
    quiet = read_force_log(pass_log(tmp_path, plan, CUT))
    quiet = quiet.rows(np.flatnonzero((quiet.place != 0) | (np.arange(len(quiet.place)) < first)))
    off, stated, told, in_air = [], [], 0, 0
    for seed in range(40):
        noise = np.random.default_rng((seed, 8)).normal(0, 4.0, quiet.force.shape)
        noise[np.isin(quiet.place, [5, 6, 7, 8])] = 0
        log = replace(quiet, force=quiet.force + noise, plain=quiet.force + noise, moment=0 * noise, has_moment=False)
        forces = place_forces(log, plan, plan.cell, tare=stretches, trust_tare=True)
        told += "CS3033" in {one.code for one in forces.findings}
        off.append(np.linalg.norm((forces.wrench - CUT)[5:9, :3], axis=1))
        stated.append(np.sqrt(np.sum(forces.of_zero, axis=1))[5:9])
        in_air += int(forces.forced[[0, 1, 2, 3, 10, 11]].any())
        assert forces.forced[5:9].all()
    assert told == 40
    assert 0.7 < np.sqrt(np.mean(np.square(off)) / np.mean(np.square(stated))) < 1.1
    assert in_air <= 3


def test_how_badly_stretches_tell_a_payload_is_in_the_sigma_on_the_part(tmp_path: Path) -> None:
    """Springs known well, and an arm of its own that yields to the stated sigmas of each force. Targets that are added have
    it, too."""
    cell = CELL + SENSOR % "sign: on_tool"
    plan = tilted_plan(tmp_path, cell, step=30)
    log = pass_log(tmp_path, plan, 3 * CUT, noise=4.0)
    program = "MODULE M\nPROC main()\n" + "\n".join(moves_of(12, 30)) + "\nENDPROC\nENDMODULE\n"
    job = kit.Job(tmp_path, cell=cell, program=program, stiffness=kit.stiffness_text(relative=1e-6), forces=log.read_text())
    job.write()
    inputs = Inputs(*(job.folder / name for name in ("cell.yaml", "part.mod", "stiffness.json", "forces.csv")))
    predicted = predict_files(inputs, Settings.of(tare=((0, 0), (1, 1)), trust_tare=True))
    forces = predicted.forces
    square = forces.standard_error**2 + forces.of_zero
    exact = replace(forces, weight_std=None, zero_std=0.0, standard_error=0 * forces.standard_error)
    of_springs = predict_path(replace(predicted.loaded, forces=exact)).covariance
    for k, with_all, alone in zip(predicted.targets, predicted.prediction.covariance, of_springs, strict=True):
        yields = np.array([kit.deviation(IRB6660, plan.theta[k], plan.flange_from_tcp[k].position, unit, kit.K)
                           for unit in np.eye(6)[:3]])
        of_force = np.sqrt(np.trace(with_all - alone))
        assert of_force == pytest.approx(np.sqrt(np.sum(square[k][:, None] * yields**2)), rel=0.01)
    more, own = correct(predicted).predicted.forces, forces.weight_std
    assert more.weight_std is not None
    assert own is not None
    assert len(more.weight_std) > len(own)
    assert (more.weight_std[5:-3].min(axis=0) > 0.99 * own[4:10].min(axis=0)).all()
    assert (more.weight_std[5:-3].max(axis=0) < 1.01 * own[4:10].max(axis=0)).all()


@pytest.mark.parametrize(("newton", "off", "zeroed", "said"), [
    (1.0, 0.0, False, None), (1.0, 0.0, True, None), (9.80665, 0.0, False, "kgf"), (4.44822, 0.0, False, "lbf"),
    (1.0, 0.7, False, "70 % of the weight of 12.4 kg back: the log shows 36 of 122 N"), (9.80665, 0.0, True, None),
    (1.0, 0.49, False, None), (1.0, 0.51, False, "51 % of"), (1.0, 0.96, False, "96 % of"), (1.0, 0.98, False, None),
    # Over 0.13 or under 0.07 of it is no weight in kilograms, over 0.29 none in pounds.
    (1.0, 0.86, False, "log shows 17 of 122 N"), (1.0, 0.875, False, "log shows 15 of 122 N; forces in kgf would be so"),
    (1.0, 0.7, False, "log shows 36 of 122 N"), (1.0, 0.72, False, "log shows 34 of 122 N; forces in lbf would be so"),
])
def test_a_weight_that_the_tare_takes_back_is_said(
    tmp_path: Path, newton: float, off: float, zeroed: bool, said: str | None
) -> None:
    """A tool of 12.4 kg on a sensor without a bias, whose log is in units of so many newtons; one that weighs less by a share
    `off`; one that was zeroed with the tool on, which holds no weight."""
    plan = tilted_plan(tmp_path, CELL + SENSOR % STATED.replace("bias_n: [14, -31, 55], bias_nm: [0.6, -1.4, 0.25], ", ""))
    log = read_force_log(pass_log(tmp_path, plan, 0 * CUT, noise=0.2))
    fall = SENSOR_TURN.inv().apply(kit.Rotation.from_matrix(plan.base_from_flange.rotation[0]).inv().apply([0, 0, -9.80665]))
    logged = (log.force - BIAS[:3] - (zeroed + off) * MASS * fall) / newton
    said_of = place_forces(replace(log, force=logged, plain=logged, moment=0 * logged, has_moment=False), plan, plan.cell,
                           tare=(0, 0), trust_tare=True).findings
    found = [finding.message for finding in said_of if finding.code == "CS3130"]
    assert len(found) == (said is not None)
    assert all(str(said) in message for message in found)
    assert all(("forces in" in message) == ("forces in" in str(said) or str(said) in ("kgf", "lbf")) for message in found)


def weighed(folder: Path, mass: float, shown: Callable[[np.ndarray], np.ndarray]) -> tuple[Finding, ...]:
    """What is said of a tool of so many kilograms, whose log shows what this makes of its weight [N], sensor's axes."""
    plan = tilted_plan(folder, CELL + SENSOR % f"payload: {{mass_kg: {mass}, centre_of_mass_mm: [12, -8, 143]}}")
    log = read_force_log(pass_log(folder, plan, 0 * CUT))
    flange = kit.Rotation.from_matrix(plan.base_from_flange.rotation[0])
    weight = SENSOR_TURN.inv().apply(flange.inv().apply([0, 0, -mass * 9.80665]))
    logged = np.tile(shown(weight), (len(log.force), 1))
    return place_forces(replace(log, force=logged, plain=logged, moment=0 * logged, has_moment=False), plan, plan.cell,
                        tare=(0, 0), trust_tare=True).findings


def across(weight: np.ndarray) -> np.ndarray:
    """As long as this, square to it."""
    other = np.cross(weight, [1.0, 0, 0])
    return np.asarray(np.linalg.norm(weight) * other / np.linalg.norm(other))


@pytest.mark.parametrize(("mass", "aside", "said"), [(5.0, 0.0, ""), (5.2, 0.0, "15 of 51 N"), (12.4, 0.14, "36 of 122 N"),
                                                     (12.4, 0.16, "")])
def test_a_weight_is_taken_back_that_is_one_and_by_a_bias_along_it(
    tmp_path: Path, mass: float, aside: float, said: str
) -> None:
    """Seven tenths of it; less than 50 N, or more than 0.15 of it to the side, may be any sensor's own zero."""
    found = [one for one in weighed(tmp_path, mass, lambda weight: 0.3 * weight + aside * across(weight))
             if one.code == "CS3130"]
    assert [(one.level, one.file) for one in found] == ([("warning", str(tmp_path / "forces.csv"))] if said else [])
    assert all(f"70 % of the weight of {mass:g} kg back: the log shows {said}" in one.message for one in found)
    assert all("the payload's mass_kg" in one.hint for one in found)


@pytest.mark.parametrize(("mass", "degrees", "size", "said"), [
    (20.3, 90, 1.0, ""), (20.5, 90, 1.0, "90 degrees from plumb: 201 N of 201, and a bias of 284 N"),
    (62, 40, 1.0, ""), (62, 42, 1.0, "42 degrees from plumb: 608 N of 608, and a bias of 436 N"),
    (62, 149, 1.0, "149 degrees from plumb: 608"), (62, 151, 1.0, "pointing upwards: 608 N of 608, and a bias of 1177 N"),
    (62, 90, 0.89, ""), (62, 90, 0.91, "553 N of 608"), (62, 90, 1.09, "663 N of 608"), (62, 90, 1.11, "")])
def test_a_weight_stands_along_another_line_that_is_one_and_has_its_size(
    tmp_path: Path, mass: float, degrees: float, size: float, said: str
) -> None:
    """Of 200 N and more, of its size to a tenth, and where the bias is more than seven tenths of it: a turn by 41 degrees."""
    angle = np.radians(degrees)
    found = [one for one in weighed(tmp_path, mass, lambda weight: size * (
        np.cos(angle) * weight + np.sin(angle) * across(weight))) if one.code == "CS3131"]
    assert [(one.level, one.file) for one in found] == ([("warning", str(tmp_path / "forces.csv"))] if said else [])
    assert all(f"the log shows the weight of {mass:g} kg" in one.message and said in one.message for one in found)


@pytest.mark.parametrize(("sign", "turn_deg", "bias_n", "said"), [
    ("on_tool", 0, [14, -31, 55], None), ("by_tool", 0, [14, -31, 55], "pointing upwards"),
    ("on_tool", 90, [14, -31, 20], "degrees from plumb"), ("on_tool", 15, [14, -31, 55], None),
    ("on_tool", 0, [0, 0, 700], None),
])
def test_a_weight_along_another_line_is_said(
    tmp_path: Path, sign: str, turn_deg: float, bias_n: list[float], said: str | None
) -> None:
    """A tool of 62 kg on a sensor that sits turned by so much about its own x, whose log is read with `sign` and as not turned;
    a large zero of the sensor alone says nothing."""
    plan = tilted_plan(tmp_path, CELL + SENSOR % f"sign: {sign}, payload: {{mass_kg: 62, centre_of_mass_mm: [12, -8, 143]}}")
    log = read_force_log(pass_log(tmp_path, plan, 0 * CUT, noise=0.2))
    sensor = SENSOR_TURN * kit.Rotation.from_euler("x", turn_deg, degrees=True)
    fall = sensor.inv().apply(kit.Rotation.from_matrix(plan.base_from_flange.rotation[0]).inv().apply([0, 0, -9.80665]))
    logged = np.tile(62 * fall + bias_n, (len(log.force), 1))
    found = place_forces(replace(log, force=logged, plain=logged, moment=0 * logged, has_moment=False), plan, plan.cell,
                         tare=(0, 0), trust_tare=True).findings
    messages = [finding.message for finding in found if finding.code == "CS3131"]
    assert len(messages) == (said is not None)
    assert all(str(said) in message for message in messages)


def test_air_stretches_that_say_nothing_or_contradict_are_said(tmp_path) -> None:
    """One code a doubt: alike orientations, a log without weight, a stated mass that the stretches contradict."""
    plan = tilted_plan(tmp_path, CELL + SENSOR % "sign: on_tool")
    stretches = [(0, 0), (1, 1), (2, 2), (3, 3), (4, 4), (9, 9), (10, 10), (11, 11)]
    with_tool, without = (read_force_log(pass_log(tmp_path, plan, 0 * CUT, noise=0.5, tool_on=on)) for on in (True, False))

    def codes(log, plan, tare) -> set[str]:
        # The weight that is not known, or wrongly, speaks against the tare itself, too.
        return {finding.code for finding in place_forces(log, plan, plan.cell, tare=tare, trust_tare=True).findings}

    assert codes(with_tool, plan, [(0, 0), (0, 0)]) & {"CS3033", "CS3034", "CS3043"} == {"CS3034"}
    assert codes(without, plan, stretches) & {"CS3033", "CS3034", "CS3043"} == {"CS3043"}


@pytest.mark.parametrize(("mass", "share", "noise", "said"), [
    (MASS, 0.9, 0.02, False), (MASS, 1.1, 0.02, True), (0.3, 0.0, 3.0, False), (0.3, 3.0, 0.02, True),
    (MASS, 0.0, 0.02, False)])
def test_stretches_of_air_that_another_mass_would_make_alike_are_said(
    tmp_path: Path, mass: float, share: float, noise: float, said: bool
) -> None:
    """The log's tool weighs so much less than the stated mass that a stretch differs from their mean by this share of a tenth
    of the stated weight. What the noise of 40 samples makes of a light tool is no contradiction."""
    plan, stretches = tilted_plan(tmp_path, CELL + SENSOR % f"payload: {{mass_kg: {mass}}}"), [(0, 0), (5, 5), (11, 11)]
    log = read_force_log(pass_log(tmp_path, plan, 0 * CUT))
    down = np.array([(kit.Rotation.from_matrix(turn) * SENSOR_TURN).inv().apply([0, 0, -9.80665])
                     for turn in plan.base_from_flange.rotation])
    off = np.linalg.norm(down[[0, 5, 11]] - down[[0, 5, 11]].mean(axis=0), axis=1).max()
    hung = mass - share * 0.1 * mass * 9.80665 / off
    rng = np.random.default_rng(3)
    logged = hung * down[log.place.astype(int)] + rng.normal(0, noise, log.force.shape)
    found = [one for one in place_forces(replace(log, force=logged, plain=logged, moment=0 * logged, has_moment=False), plan,
                                         plan.cell, tare=stretches, trust_tare=True).findings if one.code == "CS3046"]
    assert [(one.level, one.file) for one in found] == ([("warning", str(tmp_path / "forces.csv"))] if said else [])
    assert all(one.message == f"with a payload of {mass:g} kg taken off, the stretches of --tare differ from their mean by up "
               f"to {share * 0.1 * mass * 9.80665:.1f} N" for one in found)


def test_a_log_that_holds_no_weight_is_not_made_to_hold_one(tmp_path) -> None:
    stated = "payload: {mass_kg: 12.4, centre_of_mass_mm: [12, -8, 143]}"
    plan = tilted_plan(tmp_path, CELL + SENSOR % stated)
    log = read_force_log(pass_log(tmp_path, plan, CUT, tool_on=False))
    with pytest.raises(CompstiffError, match="CS3032.*weighs 122 N.*not in the log"):
        place_forces(log, plan, plan.cell)
    plan = tilted_plan(tmp_path, CELL + SENSOR % (stated + ", weight: removed"))
    assert_allclose(place_forces(log, plan, plan.cell).wrench, CUT, atol=1e-5)


@pytest.mark.parametrize(("share", "tare", "said"), [(0.19, None, "23.1 N"), (0.21, None, ""), (0.19, (0, 0), "")])
def test_a_log_that_shows_a_fifth_of_the_weight_holds_some(
    tmp_path: Path, share: float, tare: tuple[int, int] | None, said: str
) -> None:
    """Under that its quietest targets do not hold it, where taking it off leaves them the rest. A tare gives back what is not
    there."""
    plan = tilted_plan(tmp_path, CELL + SENSOR % "payload: {mass_kg: 12.4, centre_of_mass_mm: [12, -8, 143]}")
    log = read_force_log(pass_log(tmp_path, plan, 0 * CUT))
    down = np.array([(kit.Rotation.from_matrix(turn) * SENSOR_TURN).inv().apply([0, 0, -9.80665])
                     for turn in plan.base_from_flange.rotation])
    shown = share * MASS * down[log.place.astype(int)]
    log = replace(log, force=shown, plain=shown, moment=0 * shown, has_moment=False)
    if not said:
        found = place_forces(log, plan, plan.cell, tare=tare, trust_tare=True).findings
        assert [one.level for one in found if one.code == "CS3031"] == ["warning" if tare is None else "note"]
        return
    with pytest.raises(CompstiffError, match=f"CS3032.*12.4 kg weighs 122 N, and the quietest targets of the log show {said}"):
        place_forces(log, plan, plan.cell, tare=tare)


def test_a_mass_alone_in_the_cell_is_subtracted_with_a_warning(tmp_path) -> None:
    """tool.mass_kg, and nothing that says whether the log holds its weight, or where its zero is."""
    text = CELL.replace("250]}", "250], mass_kg: 12.4, centre_of_mass_mm: [12, -8, 143]}") + SENSOR % "bias_n: [0, 0, 0]"
    plan = tilted_plan(tmp_path, text.replace(", bias_n: [0, 0, 0]", ""))
    path = pass_log(tmp_path, plan, CUT)
    rows = np.loadtxt(path, delimiter=",", skiprows=1)
    rows[:, 1:] -= BIAS
    path.write_text("target,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm\n" + "\n".join(",".join(f"{x:.9f}" for x in row) for row in rows))
    forces = place_forces(read_force_log(path), plan, plan.cell)
    assert_allclose(forces.wrench, CUT, atol=1e-5)
    assert [finding.level for finding in forces.findings if finding.code == "CS3031"] == ["warning"]


@pytest.mark.parametrize("step", [0.0, 0.02, 0.09, 0.4, 3.0])
def test_an_orientation_ends_where_a_joint_is_off_its_first_row(step: float) -> None:
    """Row by row as it is stated: stillness with an encoder's noise, creep by any step, and moves."""
    rng = np.random.default_rng(12)
    theta = np.cumsum(rng.normal(0, step * SAME, (900, 6)), axis=0) + 0.05 * SAME * rng.standard_normal((900, 6))
    theta[300:] += 0.1
    first, number, expected = theta[0], 0, []
    for row in theta:
        if np.abs(row - first).max() > SAME:
            first, number = row, number + 1
        expected.append(number)
    assert _groups(theta).tolist() == expected


@pytest.mark.parametrize("per_row", [SAME / 12, SAME / 5, 0.0], ids=["creep", "steps", "still, but for noise"])
def test_the_time_for_orientations_grows_with_the_rows(per_row: float) -> None:
    """Eight times the rows take about eight times as long, where a search of all that came before took 64 times."""
    def seconds(count: int) -> float:
        theta = per_row * np.arange(count)[:, None] * np.ones(6) + 0.2 * SAME * (np.arange(count)[:, None] % 2)
        times = []
        for _ in range(3):
            begun = process_time()
            _groups(theta)
            times.append(process_time() - begun)
        return min(times)

    assert seconds(80_000) < 25 * seconds(10_000) + 0.02


@pytest.mark.parametrize(("mass", "std", "code"), [(-4.0, 0.3, "CS3042"), (-0.1, 0.3, "CS3043"), (0.2, 0.3, "CS3043")])
def test_stretches_of_air_that_hold_no_weight_say_so(mass: float, std: float, code: str) -> None:
    payload: Any = Payload(np.zeros(6), np.zeros(6), mass, std, None, None, 5, 0, 1.0, 1.0, np.ones(2), np.eye(4))
    log: Any = SimpleNamespace(source="log.csv")
    air: Any = None
    said = _estimated(payload, air, log)
    assert (said.code, said.file) == (code, "log.csv")
    assert said.message.startswith(f"payload {mass:.2f} +- ")

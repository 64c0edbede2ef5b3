"""A model with effects: its file there and back, what it predicts, and how uncertain it says that is."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from identification.common.findings import CompstiffError
from identification.model.cell import Cell, read_cell
from identification.model.effects import effects
from identification.model.robot import read_robot
from identification.model.rotations import Frame
from identification.model.stiffness import EffectInForce, IdentifiedModel
from identification.model.stiffness_file import read_stiffness
from tests.support import CELL, random_poses, write_cell
from tests.virtual_cell.arm_model import Tool
from tests.virtual_cell.cell import Case, Hidden, simulate
from tests.virtual_cell.files import robot_yaml

STIFFNESS = np.array([1.6e6, 5.1e6, 1.5e6, 0.5e6, 0.2e6, 0.08e6])
IN_FORCE = [("backlash", 1), ("hysteresis", 2), ("spindle_compliance", None)]
VALUES = [7.3e-5, 4e-5, 60.0, 5e-8]
NAMES = ["backlash[1].half_gap_rad", "hysteresis[2].amplitude_rad", "hysteresis[2].torque_nm",
         "spindle_compliance.radial_m_per_n"]


def in_force(*names: tuple[str, int | None]) -> tuple[EffectInForce, ...]:
    return tuple(EffectInForce(effects()[name], joint) for name, joint in names)


@pytest.fixture
def cell(tmp_path: Path) -> Cell:
    return read_cell(write_cell(tmp_path))


@pytest.fixture
def model(cell: Cell) -> IdentifiedModel:
    rng = np.random.default_rng(1)
    size = np.array([0.02, 0.03, 0.02, 0.05, 0.04, 0.1, 4e-6, 3e-6, 8.0, 4e-9])
    mixed = size[:, None] * np.linalg.qr(rng.standard_normal((10, 10)))[0] * rng.uniform(0.3, 1, 10)
    covariance = mixed @ mixed.T
    return IdentifiedModel(cell.robot, cell.flange_from_tcp, np.concatenate([-np.log(STIFFNESS), VALUES]),
                           0.5 * (covariance + covariance.T), ("reliable",) * 6, {"rows": 7}, effects=in_force(*IN_FORCE))


def written(folder: Path, content: dict[str, Any]) -> Path:
    path = folder / "stiffness.json"
    path.write_text(json.dumps(content))
    return path


def test_write_read_write(tmp_path: Path, cell: Cell, model: IdentifiedModel) -> None:
    content = model.as_dict()
    again = read_stiffness(written(tmp_path, content), cell)
    assert again.as_dict() == content
    assert_array_equal(again.mean, model.mean)
    assert [one.label for one in again.effects] == ["backlash[1]", "hysteresis[2]", "spindle_compliance"]


def test_the_file_is_the_contracts(model: IdentifiedModel) -> None:
    content = model.as_dict()
    assert [item["name"] for item in content["parameters"]] == ["k1", "k2", "k3", "k4", "k5", "k6", *NAMES]
    assert [item["unit"] for item in content["parameters"][6:]] == ["rad", "rad", "N*m", "m/N"]
    assert [item["estimate"] for item in content["parameters"][6:]] == VALUES
    assert content["effects"] == [{"effect": "backlash", "joint": 1}, {"effect": "hysteresis", "joint": 2},
                                  {"effect": "spindle_compliance", "joint": None}]
    assert np.shape(content["covariance"]) == np.shape(content["log_compliance"]["covariance"]) == (10, 10)
    assert_allclose([item["std"] ** 2 for item in content["parameters"]], np.diag(content["covariance"]))
    assert model.stiffness.shape == model.compliance.shape == model.log_std.shape == (6,)


def test_covariance_is_that_of_draws(model: IdentifiedModel) -> None:
    """Of k and the parameters, whatever ln c does: the moments of the log-normal, and their covariance with a normal."""
    draws = np.random.default_rng(2).multivariate_normal(model.mean, model.covariance, 400_000)
    draws[:, :6] = np.exp(-draws[:, :6])
    stated, scale = model.parameter_covariance, np.sqrt(np.diag(model.parameter_covariance))
    assert_allclose(np.cov(draws.T) / np.outer(scale, scale), stated / np.outer(scale, scale), atol=0.01)
    assert np.abs(stated / np.outer(scale, scale) - np.eye(10)).max() > 0.2


def test_a_file_with_covariance_only(tmp_path: Path, cell: Cell, model: IdentifiedModel) -> None:
    content = model.as_dict()
    del content["log_compliance"]
    again = read_stiffness(written(tmp_path, content), cell)
    assert_allclose(again.mean, model.mean, rtol=1e-14)
    scale = np.sqrt(np.diag(model.covariance))
    assert_allclose(again.covariance / np.outer(scale, scale), model.covariance / np.outer(scale, scale), atol=1e-12)


def test_intervals_and_values_stay_inside_the_physical_bounds(cell: Cell) -> None:
    mean = np.concatenate([-np.log(STIFFNESS), [-1e-6]])
    covariance = np.diag([*[0.02**2] * 6, 1e-10])
    model = IdentifiedModel(cell.robot, cell.flange_from_tcp, mean, covariance, effects=in_force(("backlash", 1)))
    written = model.as_dict()["parameters"][6]
    assert written["estimate"] == 0.0
    assert written["interval_95"] == [0.0, pytest.approx(-1e-6 + 1.96e-5, rel=1e-3)]


def swapped(content: dict[str, Any]) -> None:
    content["parameters"][6], content["parameters"][7] = content["parameters"][7], content["parameters"][6]


def put(path: str, value: Any) -> Callable[[dict[str, Any]], None]:
    def change(content: dict[str, Any]) -> None:
        *way, last = path.split("/")
        for step in way:
            content = content[int(step) if isinstance(content, list) else step]
        if isinstance(content, list):
            content[int(last)] = value
        else:
            content[last] = value

    return change


@pytest.mark.parametrize(("change", "says"), [
    (put("effects/0/effect", "backlsh"), r"CS1204.*effect 'backlsh', which this version does not know.*nearest.*'backlash'"),
    (put("effects/0/effect", "drift"), "CS1204.*'drift' is an effect of the measurement.*never carried on"),
    (put("effects/0/joint", 7), "CS1204.*'backlash' sits at joint 1, 2, 3, 4, 5, 6; the file has joint 7"),
    (put("effects/0/joint", None), "CS1204.*'backlash' sits at joint 1, .* the file has joint null"),
    (put("effects/2/joint", 3), "CS1204.*'spindle_compliance' belongs to no joint; the file has joint 3"),
    (put("effects/0/joint", "1"), r"CS1201.*effects\.0\.joint: Input should be a valid integer"),
    (put("effects/0", {"joint": 1}), r"CS1201.*effects\.0\.effect: Field required"),
    (lambda content: content["effects"].append({"effect": "backlash", "joint": 1}), "CS1204.*names backlash.1. twice"),
    (lambda content: content["effects"].pop(), "CS1204.*parameters beyond k1 ... k6 are .*spindle.* by its effects"),
    (put("effects", []), r"CS1204.*parameters beyond k1 ... k6 are .* by its effects \[\] are expected"),
    (lambda content: content["parameters"].pop(), "CS1204.*parameters beyond k1 ... k6"),
    (lambda content: content["parameters"].append(content["parameters"][6]), "CS1204.*parameters beyond"),
    (swapped, "CS1204.*expected, in this order"),
    (lambda content: content["parameters"].insert(0, content["parameters"].pop(6)), "CS1201.*parameters are.*in this order"),
    (put("parameters/6/unit", "deg"), r"CS1201.*backlash\[1\].half_gap_rad is in deg, expected rad"),
    (put("parameters/6/estimate", 1.0), r"CS1203.*half_gap_rad is 1 rad, outside its physical bounds 0 to 0\.0015"),
    (put("log_compliance/mean/6", -1e-5), r"CS1203.*half_gap_rad is -1e-05 rad, outside its physical bounds 0 to 0\.0015"),
    (put("parameters/6/estimate", 7.5e-5), r"CS1203.*half_gap_rad is 7.5e-05 rad in parameters, 7.3e-05 in log_compliance"),
    (lambda content: content["covariance"].pop(), "CS1203.*covariance has 9 rows of .10. values, expected 10 of 10"),
    (put("log_compliance/covariance", np.eye(6).tolist()), "CS1203.*log_compliance.covariance has 6 rows .*expected 10 of 10"),
    (lambda content: content["log_compliance"]["mean"].pop(), "CS1203.*log_compliance.mean has 9 values, expected 10"),
    (put("fit/noise", {"setup_relative": -0.1}), r"CS1203.*fit.noise.setup_relative is -0.1, a share from 0 to 10"),
    (put("fit/noise", {"setup_relative": "0.1"}), "CS1203.*setup_relative is '0.1', a share"),
    (put("tool/position_mm", [120, 0]), r"CS1201.*tool\.position_mm"),
    (put("covariance/9/9", -1.0), "CS1203.*covariance is not positive semidefinite"),
])
def test_files_that_are_refused(
    tmp_path: Path, cell: Cell, model: IdentifiedModel, change: Callable[[dict[str, Any]], None], says: str
) -> None:
    content = json.loads(json.dumps(model.as_dict()))
    change(content)
    with pytest.raises(CompstiffError, match=says):
        read_stiffness(written(tmp_path, content), cell)


@pytest.mark.parametrize(("robot", "geometry", "read"), [
    ("", "", True), ("0", "", True), ("", "0", True), ("0", "0", False), (None, "0", True), ("0", None, False)])
def test_a_robot_file_is_the_same_by_its_bytes_or_by_its_geometry(
    tmp_path: Path, cell: Cell, model: IdentifiedModel, robot: str | None, geometry: str | None, read: bool,
) -> None:
    """Whatever its comments say; a file that states neither is taken by the robot's name. Here "" is what was written."""
    content = json.loads(json.dumps(model.as_dict()))
    for key, value in (("robot_sha256", robot), ("geometry_sha256", geometry)):
        content[key] = content[key] if value == "" else value and 64 * value
    if read:
        assert read_stiffness(written(tmp_path, content), cell).stiffness == pytest.approx(STIFFNESS)
        return
    with pytest.raises(CompstiffError, match=f"CS1202.*another robot file of the name '{cell.robot.name}': SHA-256 0{{12}}"):
        read_stiffness(written(tmp_path, content), cell)


@pytest.mark.parametrize(("correlation", "says"), [(-0.9, "CS1203: covariance: a correlation no positive stiffnesses can have"),
                                                   (0.9, None)])
def test_wide_stiffnesses_can_hardly_be_against_each_other(
    tmp_path: Path, cell: Cell, model: IdentifiedModel, correlation: float, says: str | None
) -> None:
    """Numbers above zero of which each spreads by three times its mean are never far below both means, so E[k1 k2] > 0 sets a
    bound to the covariance: above -E[k1] E[k2]."""
    content = json.loads(json.dumps(model.as_dict()))
    del content["log_compliance"]
    covariance = np.array(content["covariance"])
    size = [content["parameters"][k]["estimate"] * 30 for k in (0, 1)]
    covariance[:2], covariance[:, :2] = 0, 0
    covariance[0, 0], covariance[1, 1] = size[0] ** 2, size[1] ** 2
    covariance[0, 1] = covariance[1, 0] = correlation * size[0] * size[1]
    content["covariance"] = covariance.tolist()
    if says is None:
        read = read_stiffness(written(tmp_path, content), cell)
        variance = np.diag(read.covariance)[:2]
        # The moments of a log-normal law are the file's again.
        mean = np.exp(-read.mean[:2] + 0.5 * variance)
        np.testing.assert_allclose(mean**2 * np.expm1(variance), np.square(size))
        assert mean.prod() * np.expm1(read.covariance[0, 1]) == pytest.approx(covariance[0, 1])
        return
    with pytest.raises(CompstiffError, match=says):
        read_stiffness(written(tmp_path, content), cell)


def test_another_tool_is_refused_where_an_effect_depends_on_it(tmp_path: Path, cell: Cell, model: IdentifiedModel) -> None:
    content = model.as_dict()
    longer = CELL.replace("120, 0, 250", "120, 0, 251")
    other = read_cell(write_cell(tmp_path, longer))
    with pytest.raises(CompstiffError, match=r"CS1202.*spindle_compliance was identified with the tool at \[120, 0, 250\] mm"):
        read_stiffness(written(tmp_path, content), other)
    calibrated = read_cell(write_cell(tmp_path, CELL.replace("120, 0, 250", "120.05, 0, 249.9")))
    assert read_stiffness(written(tmp_path, content), calibrated).effects
    del content["tool"]
    assert read_stiffness(written(tmp_path, content), other).effects
    with pytest.raises(CompstiffError, match=r"CS1201.*tool\.position_mm: Field required"):
        read_stiffness(written(tmp_path, content | {"tool": {}}), other)
    geared = IdentifiedModel(cell.robot, cell.flange_from_tcp, model.mean[:7], model.covariance[:7, :7],
                             effects=in_force(("backlash", 1)))
    assert read_stiffness(written(tmp_path, geared.as_dict()), other).effects


def test_gravity_and_payload_are_the_cells(tmp_path: Path, model: IdentifiedModel) -> None:
    text = CELL.replace("}", ", mass_kg: 60, centre_of_mass_mm: [0, 0, 100]}")
    turned = "base_frame: {quaternion: [0.70710678118654752, 0.70710678118654752, 0, 0]}\n"      # about x: base y points up
    again = read_stiffness(written(tmp_path, model.as_dict()), read_cell(write_cell(tmp_path, text + turned)))
    assert_allclose(again.fall, [0, -9.80665, 0], atol=1e-9)
    assert again.tool_mass == 60
    assert_allclose(again.tool_centre, [0, 0, 0.1])


# ---- prediction, against the virtual cell ----------------------------------------------------------------------------------

def model_of(folder: Path, case: Case, parameters: list[str]) -> IdentifiedModel:
    """The package's model of the virtual cell's robot, with the case's true springs and its effect at the true parameters."""
    (folder / "robot.yaml").write_text(robot_yaml())
    values = [truth["parameters"][name] for truth in case.truth for name in parameters]
    return IdentifiedModel(
        read_robot(folder / "robot.yaml"), Frame(np.eye(3), np.array(Tool().tcp)),
        np.concatenate([-np.log(case.stiffness), values]), np.eye(6 + len(values)),
        effects=in_force(*((truth["effect"], truth["joint"]) for truth in case.truth)),
        tool_mass=Tool().mass, tool_centre=np.array(Tool().centre))


# The laws of gears differ on purpose (tests/virtual_cell/test_laws_dictionary.py); what is linear agrees but for second order.
@pytest.mark.parametrize(("effect", "joint", "off"), [
    ("backlash", 1, 0.05), ("backlash", 5, 0.05), ("spindle_compliance", None, 0.01), ("bearing_tilt", 2, 0.01),
    ("parallelogram", None, 0.01), ("link_bending", 3, 0.01), ("gravity_compensator", 2, 0.01), ("hysteresis", 1, 0.2)])
def test_prediction_is_the_independent_plants(tmp_path: Path, effect: str, joint: int | None, off: float) -> None:
    case = simulate(4, "ladder12", [Hidden(effect, joint)], "none", stiffness=STIFFNESS)
    model = model_of(tmp_path, case, [parameter.name for parameter in effects()[effect].parameters])
    predicted = np.empty((len(case.theta), 3))
    for pose in np.unique(case.design.pose):
        rows = case.design.pose == pose
        predicted[rows] = 1e6 * model.predict(case.theta[rows], case.wrench[rows])[0]
    size = np.sqrt(np.mean(case.effect_um**2))
    assert size > 0.5
    assert np.sqrt(np.mean((predicted - case.robot_um) ** 2)) < off * size


def test_the_robots_own_weight_is_in_the_prediction(tmp_path: Path) -> None:
    """It sags before it is loaded, and the load moves its weight: a thousandth of the deflection, and no error is left."""
    case = simulate(9, "ladder12", [], "none")
    model = model_of(tmp_path, case, [])
    weightless = replace(model, robot=replace(model.robot, link_mass=None, link_centre=None))
    off, without = (1e6 * one.predict(case.theta, case.wrench)[0] - case.robot_um for one in (model, weightless))
    assert np.sqrt(np.mean(without**2)) > 1e-4 * np.sqrt(np.mean(case.robot_um**2))
    assert np.sqrt(np.mean(off**2)) < 0.01 * np.sqrt(np.mean(without**2))
    # Where it is not known the covariance has it; with exact springs, which take none of it up, nothing else is in it.
    blind = replace(weightless, covariance=np.zeros((6, 6)))
    sigma = 1e6 * np.sqrt(np.diagonal(blind.predict(case.theta, case.wrench)[2], axis1=1, axis2=2)[:, :3])
    loaded = np.any(case.wrench != 0, axis=1)
    assert np.mean((np.abs(without) < 1.96 * sigma)[loaded]) > 0.75
    assert np.sqrt(np.mean(sigma**2)) < 8 * np.sqrt(np.mean(without**2))
    assert not replace(model, covariance=np.zeros((6, 6))).predict(case.theta, case.wrench)[2].any()


def test_what_differs_from_pose_to_pose_is_read(tmp_path: Path, cell: Cell, model: IdentifiedModel) -> None:
    plain = replace(model, effects=(), mean=model.mean[:6], covariance=model.covariance[:6, :6])
    assert read_stiffness(written(tmp_path, plain.as_dict()), cell).differs == 0.0
    content = replace(plain, fit={"noise": {"setup_relative": 0.004}}).as_dict()
    assert read_stiffness(written(tmp_path, content), cell).differs == 0.004


def test_the_covariance_is_that_of_predictions_by_drawn_models(model: IdentifiedModel) -> None:
    rng = np.random.default_rng(5)
    theta = random_poses(model.robot, 12, rng, 0.6)
    wrench = np.concatenate([rng.uniform(-300, 300, (12, 3)), np.zeros((12, 3))], axis=1)
    # What real laws add beside the dictionary's is no draw of x.
    model = replace(model, unknown_law=0.0)
    _, _, stated = model.predict(theta, wrench)
    predictions = []
    for x in rng.multivariate_normal(model.mean, 0.04 * model.covariance, 1500):
        drawn = replace(model, mean=x)
        pose = drawn.loaded_pose(theta, wrench, model.flange_from_tcp)
        predictions.append(pose.position)
    variance = np.var(np.array(predictions), axis=0) / 0.04
    assert_allclose(variance, np.diagonal(stated, axis1=1, axis2=2)[:, :3], rtol=0.15, atol=1e-14)


def test_without_effects_nothing_is_added(model: IdentifiedModel) -> None:
    plain = IdentifiedModel(model.robot, model.flange_from_tcp, model.mean[:6], model.covariance[:6, :6])
    absent = IdentifiedModel(model.robot, model.flange_from_tcp, np.append(model.mean[:6], 0.0),
                             np.pad(model.covariance[:6, :6], (0, 1)), effects=in_force(("spindle_compliance", None)))
    rng = np.random.default_rng(6)
    theta, wrench = random_poses(model.robot, 8, rng), rng.uniform(-200, 200, (8, 6))
    for ours, theirs in zip(plain.predict(theta, wrench), absent.predict(theta, wrench), strict=True):
        assert_allclose(ours, theirs, rtol=1e-9, atol=1e-16)
    assert plain.as_dict()["effects"] == []


def test_rows_are_a_history(model: IdentifiedModel) -> None:
    """A gear with friction inside stands elsewhere when the same load is reached from above."""
    theta = np.repeat(random_poses(model.robot, 1, np.random.default_rng(7), 0.5), 3, axis=0)
    wrench = np.zeros((3, 6))
    wrench[:, 2] = [100.0, 300.0, 100.0]
    position = model.predict(theta, wrench)[0]
    assert np.linalg.norm(position[2] - position[0]) > 2e-6
    assert_allclose(model.predict(theta[:2], wrench[:2])[0], position[:2], atol=1e-15)

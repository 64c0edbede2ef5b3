"""The dictionary's effects (identification/model/effects) against the virtual cell's physics, parameter by parameter.

Linear and geometric effects agree to second order in the deflection. The laws of gears, creep and drift differ on purpose,
by a fraction of the effect: what a fit of the dictionary cannot take out.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from identification.model.effects import effects
from identification.model.load_state import LoadState, load_state
from identification.model.robot import RobotModel, read_robot
from identification.model.rotations import Frame
from tests.runs.hidden_effects.oracle import at_its_place
from tests.virtual_cell.cell import DICTIONARY, Case, Hidden, simulate
from tests.virtual_cell.designs import Design
from tests.virtual_cell.files import robot_yaml
from tests.virtual_cell.hidden import EFFECTS

ROUGH = {"backlash": 0.15, "soft_zone": 0.25, "hysteresis": 0.25, "lost_motion": 0.15, "creep": 0.1,
         "drift": 0.1, "stand_compliance": 0.2}
PLACES = [(name, joint) for name in DICTIONARY for joint in EFFECTS[name].joints or (None,)]


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> RobotModel:
    path: Path = tmp_path_factory.mktemp("robot") / "robot.yaml"
    path.write_text(robot_yaml())
    return read_robot(path)


def rows(robot: RobotModel, case: Case) -> LoadState:
    plain = load_state(robot, Frame(np.eye(3), np.array(case.tool.tcp)), case.theta, case.wrench, 1 / case.stiffness,
                      tool_mass=case.tool.mass, tool_centre=np.array(case.tool.centre))
    return LoadState(**{**vars(plain), "visit": case.design.pose - 1, "time": case.time, "dwell": case.dwell,
                        "labels": np.array(case.pose, dtype=object)})


@cache
def ladder() -> Design:
    """Its poses take longer to find than all that is hidden there."""
    return simulate(1, "ladder12", noise="none").design


@pytest.mark.parametrize(("name", "joint"), PLACES, ids=[f"{name}{joint or ''}" for name, joint in PLACES])
def test_dictionary_is_the_physics(robot: RobotModel, name: str, joint: int | None) -> None:
    given = {"x_m": 1e-5, "y_m": 0.0, "z_m": 2e-6, "row": 40} if name == "sensor_step" else None
    case = simulate(1, ladder(), [Hidden(name, joint, parameters=given)], "none")
    truth = case.truth[0]["parameters"]
    entry = at_its_place(effects()[EFFECTS[name].known_as], truth)
    situated = rows(robot, case)
    values = np.array([truth[parameter.name] for parameter in entry.parameters])
    neutral = np.where([parameter.shape for parameter in entry.parameters], values, entry.neutral(situated))
    added = entry.contribution(situated, joint, values) - entry.contribution(situated, joint, neutral)
    off = np.sqrt(np.mean((1e6 * added[:, :3] - case.effect_um) ** 2))
    size = np.sqrt(np.mean(case.effect_um**2))
    print(f"{name}[{joint}]: {size:.2f} um, {off:.3f} um off")
    assert off < max(ROUGH.get(EFFECTS[name].known_as, 0.01) * size, 0.02)

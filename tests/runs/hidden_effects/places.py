"""For every effect of the dictionary: where the ladder design can see it (visible.py), and what looks most like it there."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from identification.common.arrays import Array
from identification.fit.load_test import LoadTest
from identification.fit.posterior import posterior
from identification.measurements import read_measurements
from identification.model.cell import read_cell
from identification.model.compliance import equilibrium
from identification.model.stiffness_file import read_stiffness
from tests.runs.hidden_effects.hide_and_diagnose import Place, Run, check_answer, complaints, place, run
from tests.runs.hidden_effects.judge import label, truth_names
from tests.runs.hidden_effects.visible import visible
from tests.virtual_cell.cell import Hidden

GEARS = (
    place("backlash", 5, 1, "soft_zone", 5, long=True),
    place("soft_zone", 4, 0, "backlash", 4, long=True),
    place("hysteresis", 4, 2, "soft_zone", 4, long=True),
    place("gear_friction", 5, 3, "backlash", 5, half=0),
    place("lost_motion", None, 5, "hysteresis", 4, half=2),
    place("parallelogram", None, 0, "force_misalignment", half=0),
    place("gravity_compensator", 2, 2, "parallelogram", half=1),
    place("wrist_coupling", None, 1, "soft_zone", 5, long=True),
)
STRUCTURE = (
    place("bearing_tilt", 1, 0, "base_rocking", long=True),
    place("link_bending", 3, 1, "bearing_tilt", 3, half=0),
    place("base_rocking", None, 3, "bearing_tilt", 1, long=True),
    place("base_shift", None, 1, "base_rocking", long=True),
    place("force_sensor_compliance", None, 2, "bearing_tilt", 5, half=0),
    place("spindle_compliance", None, 3, "tool_point", long=True),
    place("tool_point", None, 1, "link_bending", 3, long=True),
    place("creep", None, 1, "drift", long=True),
)
MEASUREMENT = (
    place("force_misalignment", None, 1, "deflection_sensor_rotation", long=True),
    place("side_load", None, 2, "force_misalignment", half=2),
    place("deflection_sensor_gain", None, 3, "force_gain", long=True),
    place("deflection_sensor_rotation", None, 2, "force_misalignment", long=True),
    place("target_curvature", None, 0, "drift", half=0),
    place("drift", None, 2, "target_curvature", long=True),
    place("sensor_step", None, 3, "drift", long=True),
    place("force_axis_gain", None, 1, "stand_compliance", long=True),
    place("force_crosstalk", None, 2, "force_misalignment", half=2),
    place("force_offset", None, 0, "side_load", long=True),
    place("deflection_sensor_crosstalk", None, 3, "deflection_sensor_rotation", long=True),
    place("encoder_zero", 2, 2, "sensor_step", long=True),
    place("transmission_error", 3, 2, "encoder_zero", 3),
)
# An effect that no deflection shows (docs/effects.md): hidden, it must be missed.
NEVER_SEEN = (place("force_gain", None, 1, "deflection_sensor_gain", factor=2.0),)
# Effects that only logs taken in motion show: tests/identification/motion hides them there.
IN_MOTION = ("channel_delay", "joint_friction", "motor_inertia", "gear_damping", "encoder_slip", "lost_samples",
             "torque_crosstalk")
# What a wider law can do as well, with more numbers than it takes: the narrow one is likelier by far, and is named.
WIDER = {"base_shift": ("stand_compliance",), "side_load": ("force_crosstalk",), "force_misalignment": ("force_crosstalk",),
         "deflection_sensor_rotation": ("deflection_sensor_crosstalk",)}
ALL = (*GEARS, *STRUCTURE, *MEASUREMENT, *NEVER_SEEN)
# Of each effect for a confounder the first place at a joint where it has none of its own: at its own it is named right, and so
# taken for nothing else. benchmarks/confounders.py goes through all.
CONFOUNDED = tuple({where.confounder.effect: where for where in reversed(ALL) if label(
    where.confounder.effect, where.confounder.joint) not in {own.label for own in ALL}}.values())
# What the dictionary does not know, at sizes and seeds where it shows. Those that take longest are the benchmark's alone.
OUTSIDE = ((Hidden("hose_pull", None, 2.0), 65),)
OUTSIDE_LONG = ((Hidden("gear_ripple", 1, 2.0), 0), (Hidden("floor_bolt", None, 2.0), 3))


# Of those the ones that are looked at without `--long`.
CONFOUNDED_FAST = ("transmission_error[3]",)


def each(*places: Place, long: Callable[[Place], bool] = lambda where: where.long) -> pytest.MarkDecorator:
    """One test a place; long: which of them run with `--long` alone."""
    return pytest.mark.parametrize("where", [
        pytest.param(where, id=where.label, marks=[pytest.mark.long] * long(where)) for where in places])


def each_confounded(*places: Place) -> pytest.MarkDecorator:
    """One test for each of these that is confounded, all but a few of them long."""
    return each(*(where for where in CONFOUNDED if where in places), long=lambda where: where.label not in CONFOUNDED_FAST)


def answered(seed: int, hidden: Hidden, straight_tool: bool = False, few: bool = True) -> Run:
    """A run whose answer does not contradict itself."""
    found = run(seed, hidden, straight_tool=straight_tool, few=few)
    check_answer(found.content)
    return found


def check_named(where: Place) -> None:
    """Hidden at a clear size: the right name, parameters within their uncertainty, the gain of the true model."""
    found = where.run
    check_answer(found.content)
    (seen,) = visible(found.case)
    assert seen.identifiable or seen.others == WIDER.get(where.hidden.effect), f"the design cannot tell it: {seen}"
    assert complaints(found) == []


def check_confounder(where: Place, few: bool = True) -> None:
    """Its nearest confounder hidden instead: no wrong name, and if a set is given the truth is in it."""
    found = answered(where.seed, where.confounder, few=few)
    truth = truth_names(found.case.truth)
    assert where.label not in truth
    assert where.label not in found.answer.names
    assert found.outcome not in ("wrong", "ambiguous out"), found.answer


def check_unknown(hidden: Hidden, seed: int, few: bool = True) -> None:
    """What the dictionary does not know is unknown: no name, no gain, nothing in force."""
    found = answered(seed, hidden, few=few)
    assert found.content["verdict"] == "unknown", found.answer
    assert found.content["gain"] is None
    assert found.extended["effects"] == []


def predicted_afresh(found: Run) -> tuple[Array, Array, Array]:
    """What the extended model's predictions are off at the poses that were not fitted [m], their sigmas, and what those of six
    springs alone are off."""
    fresh = found.case.validate
    with tempfile.TemporaryDirectory() as name:
        cell_file, file = found.case.write(name)
        cell = read_cell(cell_file)
        measured = read_measurements(file, cell.robot)
        extended = Path(name) / "extended.json"
        extended.write_text(json.dumps(found.extended))
        model = read_stiffness(extended, cell)
    loads = found.case.theta[fresh], found.case.wrench[fresh]
    position, _, covariance = model.predict(*loads)
    springs = posterior(LoadTest.of(cell, measured.select(~measured.validate)))
    true = 1e-6 * found.case.robot_um[fresh]
    sigma = np.sqrt(np.einsum("nii->ni", covariance[:, :3, :3]))
    return position - true, sigma, equilibrium(cell.robot, loads[0], cell.flange_from_tcp, loads[1],
                                               np.exp(springs.mean)).position - true


def check_ambiguous(seed: int, hidden: Hidden, twin: Hidden, straight_tool: bool = False) -> None:
    """What the data cannot tell apart is said to be so, with the truth and its twin in the set."""
    found = answered(seed, hidden, straight_tool)
    (seen,) = visible(found.case)
    assert seen.detectable
    assert label(twin.effect, twin.joint) in seen.others
    assert found.outcome == "ambiguous in", found.answer
    assert label(twin.effect, twin.joint) in found.answer.alternatives
    # The model that goes on is the likeliest of them; what it predicts at fresh poses is as sure as it says.
    carried = found.extended["effects"][0]
    assert label(carried["effect"], carried["joint"]) in found.answer.alternatives
    assert not found.extended["fit"]["model_check"]["rejected"]
    assert "cannot tell which" in found.extended["fit"]["model_check"]["seen"]
    off, sigma, plain = predicted_afresh(found)
    assert np.mean(np.abs(off) < 2 * sigma) > 0.9
    assert np.sqrt(np.mean(off**2)) < np.sqrt(np.mean(plain**2))

"""The dictionary's effects of the robot: gears, structure, base, tool and load path, as physics of the virtual cell.

Typical sizes are the dictionary's (docs/effects.md); where that gives a range, the geometric mean of its ends.
"""

from __future__ import annotations

import numpy as np

from tests.virtual_cell.arm_model import FOREARM, LOWER_ARM
from tests.virtual_cell.hidden import ARCMIN, Draw, Parameters, effect
from tests.virtual_cell.laws import AngleDependent, Backlash, Creep, Hysteresis, SoftZone, iwan_slip
from tests.virtual_cell.plant import Plant

ALL = range(1, 7)
# Torque of the friction that hides the play, and how large the small gears' torques are: made up for tests [N m], [-].
FRICTION_NM = (4.0, 4.0, 4.0, 2.0, 2.0, 1.0)
SHARE = (1.0, 1.0, 1.0, 0.6, 0.6, 0.4)


def _backlash(draw: Draw) -> Parameters:
    return {"half_gap_rad": draw.factor * 0.5 * np.sqrt(0.1 * 1.0) * ARCMIN}


@effect("backlash", _backlash, ALL)
def backlash(plant: Plant, joint: int, parameters: Parameters) -> None:
    plant.laws.append(Backlash(plant.drive(joint), parameters["half_gap_rad"], FRICTION_NM[joint - 1]))


def _soft_zone(draw: Draw) -> Parameters:
    """K3/K1 = 1 + 0.8 factor, up to 50-200 N m (less on the wrist's smaller gears)."""
    threshold = draw.rng.uniform(50, 200) * SHARE[draw.joint - 1]
    return {"extra_rad": draw.factor * 0.8 * threshold / draw.plant.stiffness[draw.joint - 1], "torque_nm": threshold}


@effect("soft_zone", _soft_zone, ALL)
def soft_zone(plant: Plant, joint: int, parameters: Parameters) -> None:
    plant.laws.append(SoftZone(plant.drive(joint), parameters["extra_rad"], parameters["torque_nm"]))


def _hysteresis(draw: Draw) -> Parameters:
    return {"amplitude_rad": draw.factor * 0.15 * ARCMIN, "torque_nm": draw.rng.uniform(20, 100) * SHARE[draw.joint - 1]}


@effect("hysteresis", _hysteresis, ALL)
def hysteresis(plant: Plant, joint: int, parameters: Parameters) -> None:
    """The dictionary's law and sign (see laws.Hysteresis; `gear_friction` is the other sign).

    `torque_nm` is amplitude over initial slope, as in the dictionary's single slip element.
    """
    plant.laws.append(Hysteresis(plant.drive(joint), parameters["amplitude_rad"], iwan_slip(parameters["torque_nm"])))


def _friction(draw: Draw) -> Parameters:
    """amplitude_rad is minus half the width of the loop, friction torque over stiffness."""
    friction = draw.factor * 60.0 * SHARE[draw.joint - 1]
    return {"amplitude_rad": -friction / draw.plant.stiffness[draw.joint - 1], "torque_nm": 90.0 * max(draw.factor, 1.0)
            * SHARE[draw.joint - 1]}


@effect("gear_friction", _friction, ALL, known_as="hysteresis")
def gear_friction(plant: Plant, joint: int, parameters: Parameters) -> None:
    """Friction beside the gear's spring: the twist lags behind the torque. The dictionary's `hysteresis` with its sign
    turned round: no passive gear runs ahead."""
    plant.laws.append(Hysteresis(plant.drive(joint), parameters["amplitude_rad"], iwan_slip(parameters["torque_nm"])))


def _lost_motion(draw: Draw) -> Parameters:
    """Every gear lags behind, each by an amplitude of its own, and slips once it is wound up by the same angle."""
    return {"wind_up_rad": draw.rng.uniform(5e-5, 2e-4)} | {
        f"amplitude_{joint}_rad": -draw.factor * 0.15 * ARCMIN * draw.rng.uniform(0.5, 1.5) for joint in ALL}


@effect("lost_motion", _lost_motion)
def lost_motion(plant: Plant, joint: None, parameters: Parameters) -> None:
    """Eight elements that slip evenly up to a torque T together yield as one that slips at 9/16 T."""
    for gear in ALL:
        slip = iwan_slip(9 / 16 * parameters["wind_up_rad"] * plant.stiffness[gear - 1])
        plant.laws.append(Hysteresis(plant.drive(gear), parameters[f"amplitude_{gear}_rad"], slip))


TILTED = {1: ("tilt1_x", "tilt1_y"), 2: ("tilt2_x", "tilt2_z"), 3: ("tilt3_x", "tilt3_z"), 4: ("tilt4_z",),
          5: ("tilt5_x", "tilt5_z")}


@effect("bearing_tilt", lambda draw: {"compliance_rad_per_nm": draw.factor / np.sqrt(0.8e7 * 1.5e7)}, range(1, 6))
def bearing_tilt(plant: Plant, joint: int, parameters: Parameters) -> None:
    for name in TILTED[joint]:
        plant.yields(name, parameters["compliance_rad_per_nm"])


@effect("link_bending", lambda draw: {"flexibility_per_nm2": draw.factor / np.sqrt(0.8e7 * 2e7)}, (2, 3))
def link_bending(plant: Plant, joint: int, parameters: Parameters) -> None:
    """Cantilever, both planes: end shift and slope from force and moment at the end (shift, slope, sign of the slope)."""
    length, planes = {2: (LOWER_ARM, (("bend2_x", "slope2_y", 1), ("bend2_y", "slope2_x", -1))),
                      3: (FOREARM, (("bend3_y", "slope3_z", 1), ("bend3_z", "slope3_y", -1)))}[joint]
    for shift, slope, sign in planes:
        block = [plant.at(shift), plant.at(slope)]
        cantilever = np.array([[length**3 / 3, sign * length**2 / 2], [sign * length**2 / 2, length]])
        plant.compliance[np.ix_(block, block)] += parameters["flexibility_per_nm2"] * cantilever


@effect("base_rocking", lambda draw: {"compliance_rad_per_nm": draw.factor / 2e7})
def base_rocking(plant: Plant, joint: None, parameters: Parameters) -> None:
    for name in ("rock_x", "rock_y"):
        plant.yields(name, parameters["compliance_rad_per_nm"])


@effect("base_shift", lambda draw: {"compliance_m_per_n": draw.factor / 2e7})
def base_shift(plant: Plant, joint: None, parameters: Parameters) -> None:
    for name in ("base_x", "base_y"):
        plant.yields(name, parameters["compliance_m_per_n"])


@effect("force_sensor_compliance", lambda draw: {"tilt_rad_per_nm": draw.factor / 3.3e5})
def force_sensor_compliance(plant: Plant, joint: None, parameters: Parameters) -> None:
    for name in ("sensor_x", "sensor_y"):
        plant.yields(name, parameters["tilt_rad_per_nm"])


@effect("spindle_compliance", lambda draw: {"radial_m_per_n": draw.factor / 1.5e7})
def spindle_compliance(plant: Plant, joint: None, parameters: Parameters) -> None:
    for name in ("tool_x", "tool_y"):
        plant.yields(name, parameters["radial_m_per_n"])


@effect("parallelogram", lambda draw: {"ratio": 1.0 - min(draw.factor, 1.0)})
def parallelogram(plant: Plant, joint: None, parameters: Parameters) -> None:
    """Typical is the other reading, ratio 0: gear 3 at the elbow. A size factor under 1 stands in between."""
    plant.rod_ratio = parameters["ratio"]


@effect("gravity_compensator", lambda draw: {"amplitude": draw.factor * np.sqrt(0.15 * 0.5), "phase_rad": draw.phase()}, (2,))
def gravity_compensator(plant: Plant, joint: int, parameters: Parameters) -> None:
    plant.laws.append(AngleDependent(plant.drive(joint), joint - 1, 1 / plant.stiffness[joint - 1], parameters["amplitude"], 2,
                                     parameters["phase_rad"]))


@effect("wrist_coupling", lambda draw: {"compliance_rad_per_nm": draw.factor * 1e-6})
def wrist_coupling(plant: Plant, joint: None, parameters: Parameters) -> None:
    five, six = plant.drive(5), plant.drive(6)
    plant.compliance[five, six] += parameters["compliance_rad_per_nm"]
    plant.compliance[six, five] += parameters["compliance_rad_per_nm"]


@effect("tool_point", lambda draw: draw.vector("x_m y_m z_m", np.sqrt(3 * 20) * 1e-3))
def tool_point(plant: Plant, joint: None, parameters: Parameters) -> None:
    plant.offset = np.array([parameters[name] for name in ("x_m", "y_m", "z_m")])


def _creep(draw: Draw) -> Parameters:
    """In half of the cases what crept under earlier loads is still there, else the robot rested before each."""
    return {"ratio": draw.factor * np.sqrt(0.01 * 0.03), "time_s": float(np.exp(draw.rng.uniform(np.log(1), np.log(10)))),
            "memory": float(draw.rng.integers(2))}


@effect("creep", _creep)
def creep(plant: Plant, joint: None, parameters: Parameters) -> None:
    plant.laws.append(Creep(plant.compliance, parameters["ratio"], parameters["time_s"], not parameters.get("memory", 0.0)))

"""Effects that the dictionary does not know: a diagnosis should call them `unknown`, or at least none of its names.

All sizes are made up for tests: some 10 to 60 um at 300 N.
"""

from __future__ import annotations

import numpy as np

from tests.virtual_cell.effects_measurement import BURST, STAND
from tests.virtual_cell.hidden import Draw, Parameters, effect
from tests.virtual_cell.laws import AngleDependent, Backlash, Hysteresis, Lifting, Row, Stiffening, Warming
from tests.virtual_cell.plant import Plant


def _stiffening(draw: Draw) -> Parameters:
    return {"torque_nm": {1: 1000.0, 6: 60.0}[draw.joint] / np.sqrt(max(draw.factor, 1e-9))}


@effect("gear_stiffening", _stiffening, (1, 6), known_as="soft_zone")
def gear_stiffening(plant: Plant, joint: int, parameters: Parameters) -> None:
    """A cubic gear. On joints that carry no weight only: under 2000 N m of gravity it would be another gear altogether."""
    plant.laws.append(Stiffening(plant.drive(joint), 1 / plant.stiffness[joint - 1], parameters["torque_nm"]))


@effect("gear_ripple", lambda draw: {"amplitude": draw.factor * 0.2, "phase_rad": draw.phase()}, (1,))
def gear_ripple(plant: Plant, joint: int, parameters: Parameters) -> None:
    """Joint 1's stiffness changes three times a turn: worn where the cell always works."""
    plant.laws.append(AngleDependent(plant.drive(joint), joint - 1, 1 / plant.stiffness[joint - 1], parameters["amplitude"], 3,
                                     parameters["phase_rad"]))


@effect("warm_gears", lambda draw: {"rise": draw.factor * 0.12, "time_s": 2400.0})
def warm_gears(plant: Plant, joint: None, parameters: Parameters) -> None:
    """All joints soften while the cell warms up."""
    plant.laws.append(Warming(plant.compliance, parameters["rise"], parameters["time_s"]))


@effect("tool_play", lambda draw: {"half_gap_m": draw.factor * 20e-6})
def tool_play(plant: Plant, joint: None, parameters: Parameters) -> None:
    """A loose clamp: the tool rattles in the spindle along the flange's x axis."""
    plant.laws.append(Backlash(plant.at("tool_x"), parameters["half_gap_m"], 10.0))


@effect("hose_pull", lambda draw: {"ratio": draw.factor * 0.08, "angle_rad": draw.phase()})
def hose_pull(plant: Plant, joint: None, parameters: Parameters) -> None:
    """The cylinder's hose stiffens under pressure and pulls at the tool towards a hook, as joint 1 slackens or tightens it."""
    def pull(force: np.ndarray, row: Row) -> np.ndarray:
        angle, pressure = parameters["angle_rad"], np.linalg.norm(row.force)
        towards = np.array([np.cos(angle), np.sin(angle), -0.5]) / np.sqrt(1.25)
        return np.asarray(force + parameters["ratio"] * pressure * (1 - np.cos(row.q[0] - angle)) / 2 * towards)

    plant.force_faults.append(pull)


@effect("floor_bolt", lambda draw: {"compliance_rad_per_nm": draw.factor / 1e7, "angle_rad": draw.phase()})
def floor_bolt(plant: Plant, joint: None, parameters: Parameters) -> None:
    """One floor bolt is loose: the base lifts for moments of one sign about one horizontal axis and sits for the other."""
    plant.laws.append(Lifting((plant.at("rock_x"), plant.at("rock_y")), parameters["compliance_rad_per_nm"],
                              parameters["angle_rad"], preload=30.0))


@effect("rod_stretch", lambda draw: {"compliance_m_per_n": draw.factor * 8e-9}, known_as="parallelogram")
def rod_stretch(plant: Plant, joint: None, parameters: Parameters) -> None:
    """The parallel rod and its bearings yield along the rod: the softer for joint 3, the flatter the parallelogram."""
    plant.yields("rod_length", parameters["compliance_m_per_n"])


@effect("load_cell_hysteresis", lambda draw: {"force_n": draw.factor * 12.0}, known_as="hook_weight")
def load_cell_hysteresis(plant: Plant, joint: None, parameters: Parameters) -> None:
    """The force cell shows too little on the way up and too much on the way down."""
    lag = Hysteresis(0, parameters["force_n"], np.array([60.0, 120.0, 240.0]))
    memory: dict[str, int] = {"pose": -1}

    def lagging(force: np.ndarray, row: Row) -> np.ndarray:
        """The cylinder's line turns between axes only through zero, so its signed load is the sum of the components."""
        load, back = np.array([row.force.sum()]), np.zeros(1)
        if row.pose != memory["pose"] or row.number == 0:
            memory["pose"] = row.pose
            lag.begin()
            lag.settle(np.zeros(1), row)
        lag.add(back, load, None, row)
        lag.settle(load, row)
        size = np.linalg.norm(row.force)
        return force if size == 0 else np.asarray(force + back[0] * row.force / load[0])

    plant.force_faults.append(lagging)


@effect("stand_moves", lambda draw: draw.vector("x_m_per_n y_m_per_n z_m_per_n", 1.2e-7), known_as="stand_compliance")
def stand_moves(plant: Plant, joint: None, parameters: Parameters) -> None:
    """The lasers' stand is screwed to the cylinder's frame and moves with loads along y, only then."""
    give = np.array([parameters[f"{axis}_m_per_n"] for axis in "xyz"])
    plant.reading_faults.append((STAND, lambda seen, row, force: seen + give * force[1]))


@effect("laser_bursts", lambda draw: {"relative": draw.factor * 0.1, "seed": int(draw.rng.integers(2**31))})
def laser_bursts(plant: Plant, joint: None, parameters: Parameters) -> None:
    """Now and then (one reading in six) a laser loses its spot, the further off the larger the error."""
    def burst(seen: np.ndarray, row: Row, force: np.ndarray) -> np.ndarray:
        rng = np.random.default_rng([parameters["seed"], row.number])
        return np.asarray(seen + (rng.random(3) < 1 / 6) * parameters["relative"] * np.abs(seen) * rng.standard_normal(3))

    plant.reading_faults.append((BURST, burst))

"""The dictionary's effects of the measurement: what falsifies the force or the deflection, as finite geometry.

Typical sizes are the dictionary's (docs/effects.md); where that gives a range, the geometric mean of its ends.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from tests.virtual_cell.hidden import Draw, Parameters, effect
from tests.virtual_cell.laws import Row
from tests.virtual_cell.plant import Plant

# In this order the faults of the reading act: first what moves the target, last what the sensors and their log add.
ANGLE, STAND, CURVATURE, ROTATION, GAIN, DRIFT, STEP, BURST = range(8)
WARM_UP_S = 36000.0     # after which a drift levels off; made up for tests


def _turn(parameters: Parameters) -> np.ndarray:
    return np.asarray(Rotation.from_rotvec([parameters[f"r{axis}_rad"] for axis in "xyz"]).as_matrix())


@effect("force_gain", lambda draw: {"relative": draw.factor * 0.05})
def force_gain(plant: Plant, joint: None, parameters: Parameters) -> None:
    plant.force_faults.append(lambda force, row: (1 + parameters["relative"]) * force)


@effect("force_misalignment", lambda draw: draw.vector("rx_rad ry_rad rz_rad", np.radians(np.sqrt(1.5))))
def force_misalignment(plant: Plant, joint: None, parameters: Parameters) -> None:
    turn = _turn(parameters)
    plant.force_faults.append(lambda force, row: turn @ force)


def _axis_gains(draw: Draw) -> Parameters:
    about = draw.phase()
    return {"x": draw.factor * 0.02 * float(np.cos(about)), "y": draw.factor * 0.02 * float(np.sin(about))}


@effect("force_axis_gain", _axis_gains)
def force_axis_gain(plant: Plant, joint: None, parameters: Parameters) -> None:
    """Three load cells, each with an amplifier of its own; the third is off by what makes their mean right."""
    gains = 1 + np.array([parameters["x"], parameters["y"], -parameters["x"] - parameters["y"]])
    plant.force_faults.append(lambda force, row: gains * force)


@effect("force_crosstalk", lambda draw: draw.vector("xy xz yz", 0.01 * np.sqrt(3)))
def force_crosstalk(plant: Plant, joint: None, parameters: Parameters) -> None:
    """Each axis answers to the two others."""
    def seen(force: np.ndarray, row: Row) -> np.ndarray:
        x, y, z = force
        xy, xz, yz = (parameters[pair] for pair in ("xy", "xz", "yz"))
        return np.array([x + xy * y + xz * z, y + xy * x + yz * z, z + xz * x + yz * y])

    plant.force_faults.append(seen)


@effect("force_offset", lambda draw: draw.vector("x_n y_n z_n", 3.0 * np.sqrt(3)))
def force_offset(plant: Plant, joint: None, parameters: Parameters) -> None:
    """The sensor's zero was read before the cylinder's head was screwed on; without a load nobody looks at it."""
    zero = np.array([parameters[f"{axis}_n"] for axis in "xyz"])
    plant.force_faults.append(lambda force, row: force + zero if np.any(row.force) else force)


@effect("side_load", lambda draw: {"ratio": draw.factor * np.sqrt(0.02 * 0.05), "angle_rad": draw.phase()})
def side_load(plant: Plant, joint: None, parameters: Parameters) -> None:
    """The rod leans against its guide, across its line, and changes side when the load's change does."""
    def lean(force: np.ndarray, row: Row) -> np.ndarray:
        size, change = float(np.linalg.norm(row.force)), row.force - row.before
        if size == 0.0:
            return force
        line = row.force * np.sign(row.force[np.argmax(np.abs(row.force))]) / size
        up = np.array([1.0, 0, 0]) if abs(line[2]) > 0.99 else np.array([0.0, 0, 1])
        across = np.cross(line, up) / np.linalg.norm(np.cross(line, up))
        side = Rotation.from_rotvec(parameters["angle_rad"] * line).apply(across)
        return np.asarray(force + parameters["ratio"] * size * np.sign(change @ line) * side)

    plant.force_faults.append(lean)


def _gains(draw: Draw) -> Parameters:
    gains = draw.factor * np.sqrt(0.01 * 0.02) * draw.rng.choice([-1.0, 1.0], 3) * draw.rng.uniform(0.5, 1.5, 3)
    return dict(zip("xyz", gains.tolist(), strict=True))


@effect("deflection_sensor_gain", _gains)
def deflection_sensor_gain(plant: Plant, joint: None, parameters: Parameters) -> None:
    gains = 1 + np.array([parameters[axis] for axis in "xyz"])
    plant.reading_faults.append((GAIN, lambda seen, row, force: gains * seen))


@effect("deflection_sensor_rotation", lambda draw: draw.vector("rx_rad ry_rad rz_rad", np.radians(np.sqrt(2))))
def deflection_sensor_rotation(plant: Plant, joint: None, parameters: Parameters) -> None:
    turn = _turn(parameters)
    plant.reading_faults.append((ROTATION, lambda seen, row, force: turn @ seen))


@effect("deflection_sensor_crosstalk", lambda draw: draw.vector("xy xz yz", 0.014 * np.sqrt(3)))
def deflection_sensor_crosstalk(plant: Plant, joint: None, parameters: Parameters) -> None:
    """Each laser's line leans towards the two others'."""
    lines = np.array([[1.0, parameters["xy"], parameters["xz"]], [parameters["xy"], 1.0, parameters["yz"]],
                      [parameters["xz"], parameters["yz"], 1.0]])
    plant.reading_faults.append((ROTATION, lambda seen, row, force: lines @ seen))


def _curvatures(draw: Draw) -> Parameters:
    """Balls of 10 mm radius; each laser looks from the plus or the minus side."""
    sides = draw.rng.choice([-1.0, 1.0], 3)
    return dict(zip(("x_per_m", "y_per_m", "z_per_m"), (draw.factor / 0.01 * sides).tolist(), strict=True))


@effect("target_curvature", _curvatures)
def target_curvature(plant: Plant, joint: None, parameters: Parameters) -> None:
    """A beam meets a ball of radius R off its pole: the surface stands back by `R - sqrt(R^2 - t^2)`."""
    curvature = np.array([parameters[f"{axis}_per_m"] for axis in "xyz"])
    def meet(seen: np.ndarray, row: Row, force: np.ndarray) -> np.ndarray:
        aside = seen @ seen - seen**2
        return np.asarray(seen + curvature * aside / (1 + np.sqrt(1 - curvature**2 * aside)))

    plant.reading_faults.append((CURVATURE, meet))


@effect("drift", lambda draw: draw.vector("x_m_per_s y_m_per_s z_m_per_s", 30e-6 / 3600))
def drift(plant: Plant, joint: None, parameters: Parameters) -> None:
    """The parameter is the rate at first; over hours it levels off (30 um/h stands for "20 um/h and more")."""
    rate = np.array([parameters[f"{axis}_m_per_s"] for axis in "xyz"])
    plant.reading_faults.append(
        (DRIFT, lambda seen, row, force: seen + rate * WARM_UP_S * -np.expm1(-row.time / WARM_UP_S)))


def _stand(draw: Draw) -> Parameters:
    """Each axis gives by 0.5 to 1.5 times 5e-8 m/N; the frame turns the motion by 8 degrees about an axis on the floor."""
    gives = draw.factor * 5e-8 * draw.rng.uniform(0.5, 1.5, 3)
    return dict(zip(("x_m_per_n", "y_m_per_n", "z_m_per_n"), gives.tolist(), strict=True)) | {"about_rad": draw.phase()}


@effect("stand_compliance", _stand)
def stand_compliance(plant: Plant, joint: None, parameters: Parameters) -> None:
    """The cylinders push against the frame that the lasers stand on: it goes back, turned a little."""
    gives = np.array([parameters[f"{axis}_m_per_n"] for axis in "xyz"])
    about = parameters["about_rad"]
    turned = Rotation.from_rotvec(np.radians(8) * np.array([np.cos(about), np.sin(about), 0])).as_matrix()
    plant.reading_faults.append((STAND, lambda seen, row, force: seen + turned @ (gives * force)))


def _step(draw: Draw) -> Parameters:
    """One of: from `row` on, all rows of one `pose` (label), or the `single_row`; rows count from 1."""
    rows = np.flatnonzero(~draw.design.validate)
    row = int(draw.rng.integers(len(rows) // 5, len(rows) - len(rows) // 5))
    scope = ("row", "pose", "single_row")[int(draw.rng.integers(3))]
    if {"row", "pose", "single_row"} & set(draw.given):
        return draw.vector("x_m y_m z_m", 10e-6)
    return draw.vector("x_m y_m z_m", 10e-6) | {scope: f"P{draw.design.pose[row]}" if scope == "pose" else row + 1}


@effect("sensor_step", _step)
def sensor_step(plant: Plant, joint: None, parameters: Parameters) -> None:
    step = np.array([parameters[f"{axis}_m"] for axis in "xyz"])

    def stepped(seen: np.ndarray, row: Row, force: np.ndarray) -> np.ndarray:
        on = (f"P{row.pose}" == parameters["pose"] if "pose" in parameters else row.number + 1 == parameters["single_row"]
              if "single_row" in parameters else row.number + 1 >= parameters["row"])
        return seen + step if on else seen

    plant.reading_faults.append((STEP, stepped))


def _stands_off(plant: Plant, joint: int, row: Row, angle: float) -> np.ndarray:
    """How far the unloaded tool is off (3,) [m] where a joint stands off by an angle [rad]."""
    turned = row.q + angle * (np.arange(6) == joint - 1)
    return np.asarray(plant.at_rest(replace(row, q=turned), np.zeros(3), None).tcp
                      - plant.at_rest(row, np.zeros(3), None).tcp)


def _zero(draw: Draw) -> Parameters:
    """From a pose on that lies between a fifth and four fifths of the way; `row` is its first row, from 1."""
    fitted = draw.design.pose[~draw.design.validate]
    first = np.flatnonzero(np.diff(fitted)) + 1
    row = int(first[draw.rng.integers(len(first) // 5, len(first) - len(first) // 5)]) + 1
    return {"zero_rad": draw.factor * 2e-5 * float(draw.rng.choice([-1, 1])), "row": row}


@effect("encoder_zero", _zero, range(1, 7))
def encoder_zero(plant: Plant, joint: int, parameters: Parameters) -> None:
    """The brake let go for a moment."""
    plant.reading_faults.append((ANGLE, lambda seen, row, force: seen + _stands_off(plant, joint, row, parameters["zero_rad"])
                                 if row.number + 1 >= parameters["row"] else seen))


def _wave(draw: Draw) -> Parameters:
    phase, size = draw.phase(), draw.factor * 1e-5 * np.sqrt(2)
    return {"sin_rad": float(size * np.cos(phase)), "cos_rad": float(size * np.sin(phase)),
            "cycles_per_turn": float(draw.rng.uniform(2, 36))}


@effect("transmission_error", _wave, range(1, 7))
def transmission_error(plant: Plant, joint: int, parameters: Parameters) -> None:
    """A wheel of the gear runs out of true, some times a turn of the joint."""
    def seen(reading: np.ndarray, row: Row, force: np.ndarray) -> np.ndarray:
        at = parameters["cycles_per_turn"] * row.q[joint - 1]
        return reading + _stands_off(plant, joint, row, parameters["sin_rad"] * np.sin(at) + parameters["cos_rad"] * np.cos(at))

    plant.reading_faults.append((ANGLE, seen))

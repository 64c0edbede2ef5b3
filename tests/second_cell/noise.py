"""What a measurement adds at random, in strata from "as its sheet says" to what real cells have; and what cell.yaml says."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tests.second_cell.plans import Plan


@dataclass(frozen=True)
class Stated:
    """The `measurement` of cell.yaml: sensor [um], force [N] and relative, re-seating [um], standard deviations."""

    sensor: float
    force: float
    relative: float
    seating: float


@dataclass(frozen=True)
class Noise:
    """True errors, standard deviations: sensor and seating (one draw a visit and component) [um]; relative and absolute [N]
    force error of each component, `by_visit` one relative error a visit; degrees of freedom of Student's t (None: normal) of
    sensor and re-seating; `memory`: autocorrelation of the sensor from row to row of a visit; `digit` [um]: the readings' last
    one. stated: None where cell.yaml says nothing."""

    sensor: float = 0.0
    seating: float = 0.0
    relative: float = 0.0
    absolute: float = 0.0
    sensor_degrees: int | None = None
    seating_degrees: int | None = None
    memory: float = 0.0
    digit: float = 0.0
    by_visit: bool = False
    stated: Stated | None = None


def draw_noise(stratum: str, rng: np.random.Generator) -> Noise:
    """The noise of a data set of that stratum; sizes are drawn, `STRATA` says which."""
    if stratum == "none":
        return Noise(stated=Stated(1.0, 0.0, 0.0, 0.0))
    sensor, seating = float(rng.uniform(1, 4)), float(rng.uniform(1, 4))
    relative, absolute = float(rng.uniform(0.003, 0.01)), float(rng.uniform(0.5, 1.0))
    sheet = Noise(sensor, seating, relative, stated=Stated(sensor, 0.0, relative, seating))
    nominal = Stated(sensor, 0.0, 0.006, 3.0)
    near = Noise(sensor * float(rng.uniform(0.75, 1.35)), float(rng.uniform(0.5, 5)), relative, absolute,
                 sensor_degrees=4 if rng.random() < 0.25 else None, digit=0.1, stated=nominal)
    if stratum == "worse":
        return replace(near, sensor=sensor * float(rng.uniform(1, 1.6)), relative=float(rng.uniform(0.006, 0.014)),
                       seating=float(rng.uniform(2, 6)))
    return {
        "sheet": sheet,
        "near": near,
        "tails": replace(sheet, sensor_degrees=3, seating_degrees=3),
        "autocorrelated": replace(sheet, memory=0.6),
        "quantised": replace(sheet, digit=1.0),
        "visit_force": replace(sheet, by_visit=True),
        "unstated": replace(near, stated=None),
    }[stratum]


STRATA = {
    "sheet": "everything normal and exactly as stated",
    "near": "a quarter Student-4, 0.1 um steps, 0.3 to 1 % and 0.5 to 1 N of force, of which the newtons are not stated",
    "worse": "sensor 1 to 1.6 times its sheet, 0.6 to 1.4 % and 0.5 to 1 N, re-seating 2 to 6 um",
    "tails": "Student-3 sensor and re-seating, standard deviations as stated",
    "autocorrelated": "the sensor's error is 0.6 of that of the row before in the visit and a new part",
    "quantised": "steps of 1 um",
    "visit_force": "one relative force error a visit and component",
    "unstated": "as near, and cell.yaml says nothing of noise",
}


def _student(rng: np.random.Generator, degrees: int | None, shape: tuple[int, ...]) -> np.ndarray:
    """Unit variance."""
    if degrees is None:
        return rng.standard_normal(shape)
    return np.asarray(rng.standard_t(degrees, shape) * np.sqrt((degrees - 2) / degrees))


def real_force(noise: Noise, plan: Plan, rng: np.random.Generator) -> np.ndarray:
    """What really pushes (n, 3) [N] where the table reports `plan.load`; nothing pushes where nothing is reported."""
    share = rng.standard_normal(plan.load.shape)
    if noise.by_visit:
        share = rng.standard_normal((plan.visits, 3))[plan.visit]
    loaded = (plan.load != 0).any(axis=1, keepdims=True)
    return np.asarray(plan.load * (1 + noise.relative * share) + loaded * noise.absolute * rng.standard_normal(plan.load.shape))


def reading(noise: Noise, plan: Plan, seen: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """What the table shows (n, 3) [um] of what the sensors see (n, 3) [um]."""
    error = _student(rng, noise.sensor_degrees, seen.shape)
    if noise.memory:
        for i in range(1, len(error)):
            if plan.visit[i] == plan.visit[i - 1]:
                error[i] = noise.memory * error[i - 1] + np.sqrt(1 - noise.memory**2) * error[i]
    seating = _student(rng, noise.seating_degrees, (plan.visits, 3))[plan.visit]
    shown = seen + noise.sensor * error + noise.seating * seating
    return np.asarray(np.round(shown / noise.digit) * noise.digit if noise.digit else shown)

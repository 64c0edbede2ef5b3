"""What the measurement adds at random, and what the cell file says of it (which is not the same)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tests.virtual_cell.designs import Design


@dataclass(frozen=True)
class Noise:
    """True random errors of a case, standard deviations; and the nominal ones that its cell.yaml states.

    sensor_um: one reading of one laser; degrees_of_freedom: of its Student t, None for a Gaussian; force_relative and force_n:
    each component of the real force against the force cell's, loaded rows only; pose_offset_um: re-seating, one draw a pose and
    component, Student too with offset_degrees; quantum_um: the reading's last digit (0: none). setup_relative: of each pose,
    how far its forces are stretched and turned, one 3 x 3 matrix of such numbers a pose. memory: how alike neighbouring
    readings of a pose are (AR(1)). stated_*: what the file says, None where it is silent.
    """

    sensor_um: float = 0.0
    degrees_of_freedom: int | None = None
    force_relative: float = 0.0
    force_n: float = 0.0
    pose_offset_um: float = 0.0
    quantum_um: float = 0.0
    offset_degrees: int | None = None
    setup_relative: float = 0.0
    memory: float = 0.0
    stated_sensor_um: float | None = 1.0
    stated_force_n: float | None = 0.0
    stated_force_relative: float | None = 0.0
    stated_pose_offset_um: float | None = 0.0


# What real cells have beyond the realistic one; each is a kind of `draw_noise`.
STRATA = ("sheet", "unstated force", "worse", "heavy tails", "heavy re-seating", "wandering", "coarse", "set-ups", "bare")


def draw_noise(kind: str, rng: np.random.Generator) -> Noise:
    """The noise of a case: "realistic", "white" (5 um, exactly stated), "none", or one of STRATA: as the sheet says; an
    absolute force error of which the file says nothing; a sensor and a force cell worse than their sheets; heavy tails of
    the readings; of the re-seating; readings that remember the one before; steps of 1 um; forces stretched and turned anew at
    each pose; a file that says nothing of noise."""
    if kind == "none":
        return Noise()
    if kind == "white":
        return Noise(sensor_um=5.0, stated_sensor_um=5.0)
    if kind != "realistic" and kind not in STRATA:
        raise ValueError(f"noise is realistic, white, none or one of {', '.join(STRATA)}, not {kind!r}")
    sensor = float(rng.uniform(1, 5))
    realistic = Noise(
        sensor_um=sensor, degrees_of_freedom=4 if rng.random() < 0.25 else None, force_relative=float(rng.uniform(0.003, 0.01)),
        force_n=float(rng.uniform(0.5, 1.0)), pose_offset_um=float(rng.uniform(3, 5)), quantum_um=0.1,
        stated_sensor_um=round(sensor * float(rng.uniform(0.7, 1.4)), 1), stated_force_n=0.7, stated_force_relative=0.005,
        stated_pose_offset_um=4.0)
    return realistic if kind == "realistic" else replace(realistic, **_beyond(kind, sensor, rng))


def _beyond(kind: str, sensor: float, rng: np.random.Generator) -> dict[str, float | int | None]:
    """What a stratum changes of the realistic noise."""
    if kind == "sheet":
        return {"degrees_of_freedom": None, "force_relative": 0.005, "force_n": 0.7, "pose_offset_um": 4.0,
                "stated_sensor_um": sensor}
    if kind == "unstated force":
        return {"stated_force_n": None, "pose_offset_um": float(rng.uniform(0.5, 5))}
    if kind == "worse":
        return {"stated_sensor_um": sensor / float(rng.uniform(1.2, 1.6)), "force_relative": float(rng.uniform(0.006, 0.014)),
                "pose_offset_um": float(rng.uniform(2, 6)), "stated_force_n": None}
    if kind == "heavy tails":
        return {"degrees_of_freedom": 3}
    if kind == "heavy re-seating":
        return {"offset_degrees": 3}
    if kind == "wandering":
        return {"memory": float(rng.uniform(0.4, 0.8))}
    if kind == "coarse":
        return {"quantum_um": 1.0, "sensor_um": float(rng.uniform(0.2, 0.6)), "stated_sensor_um": 0.5}
    if kind == "set-ups":
        return {"setup_relative": float(rng.uniform(0.002, 0.006))}
    return {"stated_sensor_um": None, "stated_force_n": None, "stated_force_relative": None, "stated_pose_offset_um": None}


def force_errors(noise: Noise, design: Design, rng: np.random.Generator) -> np.ndarray:
    """Real minus shown force (N, 3) [N]; none where nothing pushes."""
    relative, absolute = rng.standard_normal((2, *design.load.shape))
    loaded = (design.load != 0).any(axis=1)[:, None]
    drawn = loaded * (noise.force_relative * relative * design.load + noise.force_n * absolute)
    if noise.setup_relative:
        turned = noise.setup_relative * rng.standard_normal((int(design.pose.max()) + 1, 3, 3))
        drawn = drawn + (turned[design.pose] @ design.load[:, :, None])[:, :, 0]
    return np.asarray(drawn)


def readings(noise: Noise, design: Design, seen_um: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """What the log shows (N, 3) [um] of what the lasers see."""
    offsets = noise.pose_offset_um * _student(rng, (int(design.pose.max()) + 1, 3), noise.offset_degrees)
    scatter = _student(rng, seen_um.shape, noise.degrees_of_freedom)
    for row in range(1, len(scatter)) if noise.memory else ():
        if design.pose[row] == design.pose[row - 1]:
            scatter[row] = noise.memory * scatter[row - 1] + np.sqrt(1 - noise.memory**2) * scatter[row]
    shown = seen_um + offsets[design.pose] + noise.sensor_um * scatter
    return np.round(shown / noise.quantum_um) * noise.quantum_um if noise.quantum_um else shown


def _student(rng: np.random.Generator, shape: tuple[int, ...], degrees: int | None) -> np.ndarray:
    """Of unit variance; normal where there are no degrees of freedom. With 3 the scale is that of 4: their variance is three
    times their scale squared, which nobody reads off a sheet."""
    drawn = rng.standard_normal(shape)
    if degrees:
        drawn *= np.sqrt((max(degrees, 4) - 2) / rng.chisquare(degrees, shape))
    return drawn

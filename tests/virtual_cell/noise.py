"""What the measurement adds at random, and what the cell file says of it (which is not the same)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tests.virtual_cell.designs import Design


@dataclass(frozen=True)
class Noise:
    """True random errors of a case, standard deviations; and the nominal ones that its cell.yaml states.

    sensor_um: one reading of one laser; degrees_of_freedom: of its Student t, None for a Gaussian; force_relative and force_n:
    each component of the real force against the force cell's, loaded rows only; pose_offset_um: re-seating, one draw a pose and
    component; quantum_um: the reading's last digit (0: none).
    """

    sensor_um: float = 0.0
    degrees_of_freedom: int | None = None
    force_relative: float = 0.0
    force_n: float = 0.0
    pose_offset_um: float = 0.0
    quantum_um: float = 0.0
    stated_sensor_um: float = 1.0
    stated_force_n: float = 0.0
    stated_force_relative: float = 0.0
    stated_pose_offset_um: float = 0.0


def draw_noise(kind: str, rng: np.random.Generator) -> Noise:
    """The noise of a case: "realistic", "white" (5 um, exactly stated) or "none"."""
    if kind == "none":
        return Noise()
    if kind == "white":
        return Noise(sensor_um=5.0, stated_sensor_um=5.0)
    if kind != "realistic":
        raise ValueError(f"noise is realistic, white or none, not {kind!r}")
    sensor = float(rng.uniform(1, 5))
    return Noise(
        sensor_um=sensor, degrees_of_freedom=4 if rng.random() < 0.25 else None, force_relative=float(rng.uniform(0.003, 0.01)),
        force_n=float(rng.uniform(0.5, 1.0)), pose_offset_um=float(rng.uniform(3, 5)), quantum_um=0.1,
        stated_sensor_um=round(sensor * float(rng.uniform(0.7, 1.4)), 1), stated_force_n=0.7, stated_force_relative=0.005,
        stated_pose_offset_um=4.0)


def force_errors(noise: Noise, design: Design, rng: np.random.Generator) -> np.ndarray:
    """Real minus shown force (N, 3) [N]; none where nothing pushes."""
    relative, absolute = rng.standard_normal((2, *design.load.shape))
    loaded = (design.load != 0).any(axis=1)[:, None]
    return np.asarray(loaded * (noise.force_relative * relative * design.load + noise.force_n * absolute))


def readings(noise: Noise, design: Design, seen_um: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """What the log shows (N, 3) [um] of what the lasers see."""
    offsets = noise.pose_offset_um * rng.standard_normal((int(design.pose.max()) + 1, 3))
    scatter = rng.standard_normal(seen_um.shape)
    if noise.degrees_of_freedom:
        dof = noise.degrees_of_freedom
        scatter *= np.sqrt((dof - 2) / rng.chisquare(dof, seen_um.shape))
    shown = seen_um + offsets[design.pose] + noise.sensor_um * scatter
    return np.round(shown / noise.quantum_um) * noise.quantum_um if noise.quantum_um else shown

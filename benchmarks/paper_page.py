"""What the sections of docs/paper.md share: how they are written, every effect at once, and the errors at other poses."""

from __future__ import annotations

import textwrap

import numpy as np

from benchmarks.paper_model import FORCE_N, TABLE_1, TOOL, Design, World, one_step, orientations, readings


def text(paragraph: str) -> list[str]:
    """A paragraph and the empty line after it."""
    return [*textwrap.wrap(" ".join(paragraph.split()), 125, break_long_words=False, break_on_hyphens=False), ""]


def table(head: list[str], rows: list[list[str]]) -> list[str]:
    """A Markdown table."""
    return ["| " + " | ".join(head) + " |", "|" + "---|" * len(head), *("| " + " | ".join(row) + " |" for row in rows), ""]


def in_millions(k: np.ndarray) -> list[str]:
    return [f"{value / 1e6:.3f}" for value in k]


JOINTS = [f"k{i}" for i in range(1, 7)]
EVERYTHING = World(noise_m=10e-6, reseating_m=20e-6, force_noise=0.02, base=1.0, spindle=1.0, misalignment_deg=(1.0, 2.0),
                   side_load=(0.02, 0.05), backlash_arcmin=(0.05, 0.5), tool_mm=10.0)


def factor(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """How far apart two stiffnesses are, as a factor >= 1."""
    return np.exp(np.abs(np.log(one / other)))


def validation_poses(count: int, rng: np.random.Generator, tool: np.ndarray = TOOL) -> Design:
    """Poses over the work space in front of the robot, any orientation with |phi| <= 80 deg; forces along X and Y."""
    theta = np.empty((0, 6))
    while len(theta) < count:
        position = np.array([rng.uniform(1.2, 1.7), rng.uniform(-0.5, 0.5), rng.uniform(0.5, 1.2)])
        theta = np.concatenate([theta, orientations(position, tool, 8, rng)[:1]])
    force = np.zeros((count, 3))
    force[np.arange(count), np.arange(count) % 2] = FORCE_N * np.where(np.arange(count) % 4 < 2, 1, -1)
    return Design(theta, force, np.arange(count) % 4, tool)


def validation_errors(
    found: dict[str, np.ndarray], k: np.ndarray, world: World, rng: np.random.Generator
) -> dict[str, np.ndarray]:
    """RMS error (S, 3) [m] by axis of the predicted deviation over 40 other poses, by parameter set."""
    poses = validation_poses(40, np.random.default_rng(77))
    measured = readings(poses, k, world, rng)
    sets = {"literature": np.broadcast_to(TABLE_1, k.shape), **found}
    error = {name: one_step(poses.theta, poses.force, 1 / values, poses.tool)[0] - measured for name, values in sets.items()}
    result = {name: np.sqrt(np.mean(value**2, axis=1)) for name, value in error.items()}
    result["deviation itself"] = np.sqrt(np.mean(measured**2, axis=1))
    return result

"""The virtual cell: measurements of a simulated robot that may hide an effect, and the truth behind them.

    python -m tests.virtual_cell.cell SEED DESIGN EFFECT[:JOINT[:FACTOR]][+EFFECT…] FOLDER

writes a case's files (EFFECT `none`: nothing hidden) with truth.json beside them. Shares no physics code with the packages.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

# The effect modules register what they hold.
from tests.virtual_cell import (
    effects_at_poses,
    effects_hung,
    effects_measurement,
    effects_other_laws,
    effects_outside,
    effects_robot,
    effects_track,
    files,
)
from tests.virtual_cell.arm_model import Tool
from tests.virtual_cell.designs import DESIGNS, Design
from tests.virtual_cell.hidden import EFFECTS, Hidden, install
from tests.virtual_cell.noise import Noise, draw_noise, force_errors, readings
from tests.virtual_cell.plant import Plant

__all__ = ["AT_POSES", "DICTIONARY", "OUTSIDE", "Case", "Hidden", "draw", "simulate"]


def _of(*modules: object) -> tuple[str, ...]:
    """The effects that these modules register."""
    return tuple(name for name, entry in EFFECTS.items() if entry.build.__module__ in [module.__name__ for module in modules])


# The dictionary (docs/effects.md) but for those of logs taken in motion; what dead weights bring, and only they can show;
# what a track under the robot brings; effects of some poses alone; and effects that are in no dictionary.
TRACK = _of(effects_track)
DICTIONARY, HUNG, AT_POSES = _of(effects_robot, effects_measurement), _of(effects_hung), _of(effects_at_poses)
OUTSIDE = tuple(name for name in _of(effects_outside) if EFFECTS[name].known_as == name)
# Not in the dictionary, but rightly called by one of its names: a gear that stiffens is softer under small torques; and the
# dictionary's effects under laws that are not its own.
NEAR = tuple(name for name in _of(effects_outside, effects_other_laws) if name not in OUTSIDE)
assert {*DICTIONARY, *HUNG, *TRACK, *AT_POSES, *OUTSIDE, *NEAR} == set(EFFECTS)
LOG_STD = 0.5       # of the true stiffnesses about the prior's medians


@dataclass(frozen=True)
class Case:
    """One simulated measurement campaign; arrays have one row a reading, in the order taken, validate rows last.

    seed, design_name, hidden, noise: what was asked for and drawn. stiffness (6,) [N m/rad] is the truth; truth: one
    `{"effect", "joint", "parameters"}` per hidden effect. theta (N, 6) [rad]; wrench (N, 6) [N, N m] as reported, base
    frame, moments zero; deflection_um (N, 3) as reported; time, dwell (N,) [s]; pose (N,) labels; validate (N,) bool.
    """

    seed: int
    design_name: str
    hidden: tuple[Hidden, ...]
    noise: Noise
    tool: Tool
    gravity: bool
    stiffness: np.ndarray
    truth: list[dict[str, Any]]
    design: Design
    deflection_um: np.ndarray
    plant: Plant = field(repr=False)

    @property
    def theta(self) -> np.ndarray:
        return self.design.theta

    @cached_property
    def wrench(self) -> np.ndarray:
        return np.concatenate([self.design.load, np.zeros_like(self.design.load)], axis=1)

    @property
    def time(self) -> np.ndarray:
        return self.design.time

    @property
    def dwell(self) -> np.ndarray:
        return self.design.dwell

    @cached_property
    def pose(self) -> list[str]:
        return [f"P{number}" for number in self.design.pose]

    @property
    def validate(self) -> np.ndarray:
        return self.design.validate

    @cached_property
    def tcp(self) -> np.ndarray:
        """TCP of the rigid arm (N, 3) [m], base frame."""
        return np.array([self.plant.solver.tcp_pose(self.plant.solver.place(q))[0] for q in self.theta])

    @cached_property
    def plain_um(self) -> np.ndarray:
        """Deflection (N, 3) [um] under the reported forces without the hidden effects and without noise."""
        return 1e6 * Plant(self.stiffness, self.tool, self.gravity).displacement(self.design)[0]

    @cached_property
    def clean_um(self) -> np.ndarray:
        """What the lasers would see (N, 3) [um] with the hidden effects, under the reported forces, without noise."""
        return 1e6 * self.plant.displacement(self.design)[1]

    @cached_property
    def robot_um(self) -> np.ndarray:
        """How the robot really moves (N, 3) [um] under the reported forces: with its effects, without sensor faults."""
        return 1e6 * self.plant.displacement(self.design)[0]

    @property
    def effect_um(self) -> np.ndarray:
        """What the hidden effects change in the readings (N, 3) [um]."""
        return self.clean_um - self.plain_um

    def write(self, folder: Path | str) -> tuple[Path, Path]:
        """Writes cell.yaml, robot.yaml and measurements.csv (docs/formats.md); returns the first's and the last's path."""
        return files.write(self, Path(folder))


def simulate(
    seed: int, design: str | Design = "ladder12", hidden: Sequence[Hidden] = (), noise: str | Noise = "realistic", *,
    validation: int = 0, tool: Tool | None = None, gravity: bool = True, stiffness: np.ndarray | None = None
) -> Case:
    """A case, the same for the same arguments.

    design: paper5, poses20, ladder12, hung12, or rows of one's own. hidden: what to hide, in any number.
    noise: realistic, white, none or a Noise.
    validation: so many further poses with loads of their own, marked `validate`. stiffness (6,) [N m/rad]:
    drawn log-normally about the prior's medians when not given. Poses, stiffness and noise do not depend on what is hidden.
    """
    streams = [np.random.default_rng([seed, i]) for i in range(5)]
    tool = tool or Tool()
    plan = design if isinstance(design, Design) else DESIGNS[design](streams[0], tool, validation)
    drawn = np.array(files.PRIOR) * np.exp(LOG_STD * streams[1].standard_normal(6))
    true = drawn if stiffness is None else np.asarray(stiffness, dtype=float)
    plant = Plant(true, tool, gravity)
    truth = [install(plant, each, streams[2], plan) for each in hidden]
    errors = draw_noise(noise, streams[3]) if isinstance(noise, str) else noise
    quiet = errors.force_n == 0 and errors.force_relative == 0
    seen = plant.displacement(plan, None if quiet else force_errors(errors, plan, streams[4]))[1]
    return Case(seed, design if isinstance(design, str) else "own", tuple(hidden), errors, tool, gravity, true, truth, plan,
                readings(errors, plan, 1e6 * seen, streams[4]), plant)


def draw(rng: np.random.Generator, names: Sequence[str] | None = None) -> Hidden:
    """An effect of `names` (the dictionary when None), a joint it can sit at and a size factor, log-uniform in 0.5 … 2.

    Not every draw shows: play or softness around zero torque of a joint that gravity holds on one side does not
    (`Case.effect_um` says by how much).
    """
    choice = names or DICTIONARY
    name = choice[int(rng.integers(len(choice)))]
    joints = EFFECTS[name].joints
    joint = joints[int(rng.integers(len(joints)))] if joints else None
    return Hidden(name, joint, float(np.exp(rng.uniform(np.log(0.5), np.log(2)))))


def parse(text: str) -> tuple[Hidden, ...]:
    """Hidden effects of `EFFECT[:JOINT[:FACTOR]]`, several joined by `+`; `none` and an empty text hide nothing."""
    found = []
    for item in text.split("+") if text not in ("", "none") else []:
        name, joint, factor = ([*item.split(":"), "", ""])[:3]
        entry = EFFECTS.get(name)
        sits = int(joint) if joint else entry.joints[0] if entry and entry.joints else None
        found.append(replace(Hidden(name, sits), factor=float(factor) if factor else 1.0))
    return tuple(found)


def main(arguments: Sequence[str]) -> None:
    if len(arguments) != 4:
        sys.exit(f"{__doc__}\neffects: {', '.join(DICTIONARY)}\nbeyond the dictionary: {', '.join(OUTSIDE)}")
    seed, design, effects, folder = arguments
    case = simulate(int(seed), design, parse(effects), validation=6)
    cell, measurements = case.write(folder)
    truth = {"stiffness_nm_per_rad": case.stiffness.tolist(), "hidden": case.truth,
             "effect_rms_um": float(np.sqrt(np.mean(case.effect_um**2)))}
    (Path(folder) / "truth.json").write_text(json.dumps(truth, indent=1) + "\n")
    print(f"{cell}\n{measurements}\n{json.dumps(truth)}")


if __name__ == "__main__":
    main(sys.argv[1:])

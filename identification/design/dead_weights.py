"""Dead weights as loads: levels of hung mass that point straight down, and the order in which they are hung on and taken off.

A level is the set of weights that hang together. At each pose the levels are hung on by rising mass, then taken off again:
each step down only takes weights off, so that its load is really reached from above and a gear's hysteresis shows in what
differs between the way up and the way down. Where the next heavier level is another weight, the lighter one comes off first.
Every pose begins and ends without weights: the robot never drives with a weight that hangs.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from identification.common.arrays import Array
from identification.common.findings import error
from identification.common.yaml_source import read_yaml
from identification.model.cell import Cell
from identification.model.robot_file import RobotFile

HEAVIEST_KG = 5000.0
Level = tuple[float, ...]
EMPTY: Level = ()


@dataclass(frozen=True)
class DeadWeights:
    """levels: what hangs together [kg], each a tuple of weights. Raises ValueError for none, for masses that are not between
    0 and 5000 kg, and for two levels of one mass."""

    levels: tuple[Level, ...]

    @classmethod
    def of(cls, text: str) -> DeadWeights:
        """From "20,40,20+40": levels separated by commas, weights that hang together joined by +, in kilograms. Its steps are
        0, 20, 40, 60, 40, 0 kg."""
        return cls(tuple(tuple(float(mass) for mass in level.split("+")) for level in text.split(",")))

    def __post_init__(self) -> None:
        totals = [sum(level) for level in self.levels]
        if not totals or not all(level and all(0 < mass <= HEAVIEST_KG for mass in level) for level in self.levels):
            raise ValueError(f"weights are masses between 0 and {HEAVIEST_KG:g} kg")
        if len(set(totals)) < len(totals):
            raise ValueError("two levels have the same mass")

    @cached_property
    def rising(self) -> tuple[Level, ...]:
        """The levels by rising mass."""
        return tuple(sorted(self.levels, key=sum))

    @cached_property
    def steps(self) -> tuple[Level, ...]:
        """What hangs at each row of a pose: nothing, up through all levels, down through those that taking off alone leads
        to, nothing."""
        down = [self.rising[-1]]
        for level in self.rising[-2::-1]:
            if _within(level, down[-1]):
                down.append(level)
        return (EMPTY, *self.rising, *down[1:], EMPTY)

    @staticmethod
    def handled(before: Level, after: Level) -> tuple[Level, Level]:
        """The weights that are taken off, and those that are hung on, between two rows."""
        return _without(before, after), _without(after, before)

    @classmethod
    def lifted(cls, steps: tuple[Level, ...]) -> float:
        """Mass [kg] that is hung on and taken off along the steps of one pose, from nothing to nothing."""
        rows = (EMPTY, *steps, EMPTY)
        return float(sum(sum(part) for pair in pairwise(rows) for part in cls.handled(*pair)))

    @staticmethod
    def forces(steps: tuple[Level, ...], fall: Array) -> Array:
        """Forces (L, 3) [N] of the steps in the base frame; fall (3,): acceleration of free fall there [m/s^2]."""
        return np.outer([sum(step) for step in steps], fall)


def check_payload(weights: DeadWeights, cell: Cell) -> None:
    """Raises CompstiffError (CS1512) where the heaviest level and the tool are more than the data sheet lets a robot carry."""
    payload = read_yaml(cell.robot.source, RobotFile).data_sheet.payload_kg
    heaviest, tool = sum(weights.rising[-1]), cell.tool_mass or 0.0
    if payload is not None and heaviest + tool > payload:
        of_tool = f" of {tool:g} kg" if tool else ""
        raise error("CS1512", f"{heaviest:g} kg hung on the tool{of_tool} are over the {payload:g} kg that {cell.robot.name} "
                    "carries", file=str(cell.source), hint="take lighter weights; masses are in kilograms")


def _without(these: Level, those: Level) -> Level:
    """The weights of the first that the second has not, each as often as it is missing."""
    left = list(those)
    missing = []
    for mass in these:
        if mass in left:
            left.remove(mass)
        else:
            missing.append(mass)
    return tuple(missing)


def _within(level: Level, other: Level) -> bool:
    return not _without(level, other)


def in_words(level: Level) -> str:
    """20 + 40 kg."""
    return " + ".join(f"{mass:g}" for mass in level) + " kg"

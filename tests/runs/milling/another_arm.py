"""Parts milled by another arm than the virtual cell's: the second cell's robots push into the virtual cell's cut.

Load tests, mechanics and stiffnesses are those of tests/second_cell (screws, rest as a minimum of energy), engagement, end mill
and sensor those of tests/virtual_cell.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from tests.runs.milling.learning_job import ErringJob
from tests.second_cell.cell import Case, drawn, simulate
from tests.second_cell.effects import DICTIONARY
from tests.second_cell.machine import Machine

# Where the part lies before each robot [m]: within reach of a level forearm, made up.
PLACES = {"irb6660-205-1.90": (1.35, -0.1, 0.75), "irb6700-200-2.60": (1.7, -0.1, 0.8), "irb6640-235-2.55": (1.7, -0.1, 0.8),
          "irb4400-60": (1.3, -0.1, 0.7)}


@dataclass(frozen=True)
class LoadTested:
    """A case of the second cell, as a milling job asks for it."""

    case: Case

    @property
    def stiffness(self) -> np.ndarray:
        return self.case.stiffness

    @property
    def tool(self) -> SimpleNamespace:
        return SimpleNamespace(tcp=tuple(self.case.tool))

    @property
    def plant(self) -> Machine:
        return self.plant_in(1.0)

    def plant_in(self, motion: float) -> Machine:
        """The machine whose springs give way so many times as much."""
        return Machine(self.case.plain_arm(self.case.stiffness / motion), PLACES[self.case.robot.name])

    def write(self, folder: Path) -> tuple[Path, Path]:
        return self.case.write(folder)


@dataclass
class AnotherArmJob(ErringJob):
    """One of the second cell's robots, its weight in robot.yaml or not, load-tested by ten load cycles, and one part."""

    arm: str = "irb6700-200-2.60"

    def load_tested(self) -> LoadTested:
        _, weight = drawn(self.seed, "cycles", DICTIONARY)
        return LoadTested(simulate(self.seed, "cycles", name=self.arm, weight=weight))

    @cached_property
    def moving(self) -> Machine:
        return self.case.plant_in(self.motion)

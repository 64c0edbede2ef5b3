"""A cell that errs beside yielding: milled, measured, learned, corrected and milled again in the virtual cell.

Truth is tests/virtual_cell alone: springs that give way more in motion than in the load test, a smooth kinematic error and a
spindle that warms up (tests/virtual_cell/astray.py), none of which the model has.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

import compstiff
from compensator.learning.learning import Learning
from tests.runs.milling.milling_job import TARE, Correction, MillingJob, settings
from tests.virtual_cell import milling
from tests.virtual_cell.astray import Astray, drawn
from tests.virtual_cell.hidden import Hidden, install
from tests.virtual_cell.milled_part import Part
from tests.virtual_cell.milling import Commands, Pass
from tests.virtual_cell.plant import Plant

MOTION = 1.2        # how much more the springs give way in motion


@dataclass
class ErringJob(MillingJob):
    """One robot, one part. motion: factor on the compliance in motion; astray: what else is off, None: nothing; since:
    effects that came to the robot after its load test, came: what they are, known once it milled."""

    motion: float = MOTION
    astray: Astray | None = None
    since: Sequence[Hidden] = ()
    came: list[dict[str, Any]] = field(default_factory=list)

    @cached_property
    def moving(self) -> Plant:
        """The plant as it is while it mills."""
        plant = Plant(self.case.stiffness / self.motion, self.case.tool, self.case.gravity)
        for each in self.since:
            self.came.append(install(plant, each, np.random.default_rng([self.seed, 94]), self.case.design))
        return plant

    def mill(self, commands: Commands, given_n: np.ndarray | None = None, part: Part | None = None) -> Pass:
        return milling.mill(self.moving, part or self.part, commands, self.cutter, given_n, astray=self.astray)

    def measure(self, done: Pass, name: str, std_um: float = 3.0, *, part: Part | None = None, along_normal: bool = False,
                seed: int = 0, values_um: np.ndarray | None = None) -> Path:
        """What a measuring machine says of the pass at every step that cuts: of all components where the tool's centre was
        planned, or of the machined faces along their normal. values_um (S, 3) in place of the pass's own."""
        rng = np.random.default_rng([self.seed, 91, seed])
        cut = done.cutting
        plan = done.steps.between((part or self.part).target_mm)[cut]
        off = (done.off_um if values_um is None else values_um)[cut]
        if along_normal:
            # Climb milling: the wall is on the left of the feed, its normal points to the tool.
            normal = -done.steps.left[cut]
            value = np.einsum("si,si->s", off, normal) + std_um * rng.standard_normal(len(off))
            rows = np.column_stack([plan - self.cutter.radius_mm * normal, normal, value])
            header = "x_mm,y_mm,z_mm,nx,ny,nz,dn_um,std_um"
        else:
            rows = np.column_stack([plan, off + std_um * rng.standard_normal(off.shape)])
            header = "x_mm,y_mm,z_mm,dx_um,dy_um,dz_um,std_um"
        output = self.folder / name
        output.write_text("\n".join([header, *(",".join(f"{v:.6g}" for v in [*row, std_um]) for row in rows)]) + "\n")
        return output

    def learn(self, stiffness: Path, log: Path, points: Path, **options: float) -> tuple[Learning, Path]:
        """What compstiff learns, and its file."""
        cell = compstiff.read_cell(self.cell)
        learning = compstiff.learn(cell, compstiff.read_toolpath(self.program, cell),
                                   compstiff.read_stiffness(stiffness, cell), log, points, settings(), **options)
        output = self.folder / "learned.json"
        compstiff.write({output: learning.content()}, overwrite=True)
        return learning, output


@dataclass
class Both:
    """One cell and two programs on it: the part that is measured and another one. job_of: what makes the cell's jobs."""

    folder: Path
    seed: int
    first_part: Part
    other_part: Part
    motion: float = MOTION
    size_mm: float = 0.2
    growth_mm: float = 0.04
    job_of: Callable[..., ErringJob] = ErringJob
    first: ErringJob = field(init=False)
    other: ErringJob = field(init=False)

    def __post_init__(self) -> None:
        astray = drawn(self.seed, self.size_mm, self.growth_mm) if self.size_mm or self.growth_mm else None
        for name, part in (("first", self.first_part), ("other", self.other_part)):
            place = self.folder / name
            place.mkdir(parents=True)
            setattr(self, name, self.job_of(place, self.seed, part=part, motion=self.motion, astray=astray))


def mirrored(job: ErringJob, done: Pass, std_um: float, seed: int = 0) -> Commands:
    """What shops do: the planned targets less what was measured there, with the noise of the measurement."""
    rng = np.random.default_rng([job.seed, 92, seed])
    off = np.zeros_like(done.off_um)
    off[done.cutting] = done.off_um[done.cutting] + std_um * rng.standard_normal((int(done.cutting.sum()), 3))
    place = np.arange(len(job.part.target_mm))
    along = done.steps.segment - 1 + done.steps.share
    at = np.column_stack([np.interp(place, along, axis) for axis in off.T])
    return Commands(job.part.target_mm - 1e-3 * at, job.planned.turn)


def off_um(first: Pass, done: Pass) -> np.ndarray:
    """Distance from plan (n,) [um] at the steps that cut in either pass."""
    return np.asarray(np.linalg.norm(done.off_um, axis=1)[first.cutting | done.cutting])


def corrected(job: ErringJob, log: Path, stiffness: Path, learned: Path | None = None, repeats: str = "nothing",
              cut: str = "") -> Correction:
    """The program corrected with its log; cut: lines more in cell.yaml."""
    chosen = settings(learned=learned, repeats=repeats) if learned else settings()
    return job.correct(log, stiffness, chosen, job.cell_with("cell_cut.yaml", cut) if cut else None)


__all__ = ["TARE", "Both", "ErringJob", "corrected", "mirrored", "off_um"]

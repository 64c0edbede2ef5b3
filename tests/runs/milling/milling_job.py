"""The chain on a part milled in the virtual cell: load tests, identify or diagnose, a logged pass, correct, mill again."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from compensator.correction.correct import Corrected, correct
from compensator.correction.files import Inputs, predict_files
from compensator.correction.offsets import offsets_csv
from compensator.correction.settings import Settings
from identification.model.cell import read_cell
from identification.model.stiffness import IdentifiedModel
from tests.runs.command_line import user_files as kit
from tests.virtual_cell import milling
from tests.virtual_cell.cell import Case, Hidden, simulate
from tests.virtual_cell.endmill import EndMill
from tests.virtual_cell.milled_part import AIR, AIR_FEED_MM_S, Part, slot_and_pocket
from tests.virtual_cell.milling import BASE_FROM_OBJECT, Commands, Pass, Sensor, angles, planned

TARE = (0, 2)       # the air move before the slot
ROUNDING_UM = 0.1   # of the written numbers
TRUTH_STD = 1e-4    # of ln k in a stiffness file that is said to be true


def settings(**wanted: Any) -> Settings:
    """Settings with the tare and the wanted fields."""
    return Settings.of(**({"tare": (TARE,)} | wanted))


@dataclass(frozen=True)
class Correction:
    """What `correct` gave: the job itself, the part with a target for each that was written, their commands, and the sigma
    (N,) [um] that is stated for their deviation, and for what is left on the part, and how likely (N,) each gets worse."""

    job: Corrected
    part: Part
    commands: Commands
    sigma_um: np.ndarray
    left_um: np.ndarray
    worse: np.ndarray

    @property
    def at_own(self) -> np.ndarray:
        """The sigma of the targets of the program as it was given."""
        return self.sigma_um[self.job.kept]


@dataclass
class MillingJob:
    """One robot, one part, one folder of files. design: of the load tests; twenty single loads ("poses20") are fitted in a
    fifth of the time that the ladders take."""

    folder: Path
    seed: int
    hidden: Sequence[Hidden] = ()
    design: str = "ladder12"
    part: Part = field(default_factory=slot_and_pocket)
    cutter: EndMill = field(default_factory=EndMill)
    sensor: Sensor = field(default_factory=Sensor)
    _passes: dict[bytes, Pass] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.case = self.load_tested()
        self.cell, self.measurements = self.case.write(self.folder)
        self.cell.write_text(self.cell.read_text() + self.sensor.cell_yaml())
        self.program = self.folder / "part.mod"
        self.program.write_text(milling.rapid(self.part, angles(self.planned, self.case.plant), self.cutter,
                                       tuple(1e3 * np.array(self.case.tool.tcp)), self.case.plant.object_m))

    def load_tested(self) -> Case:
        """The robot, and what was measured of it."""
        return simulate(self.seed, self.design, self.hidden, validation=6)

    @cached_property
    def planned(self) -> Commands:
        return planned(self.part)

    @cached_property
    def first(self) -> Pass:
        """The pass without correction."""
        return self.mill(self.planned)

    def first_with(self, part: Part) -> Pass:
        """The same with the part's own targets, which may be more."""
        key = part.target_mm.tobytes()
        if key not in self._passes:
            self._passes[key] = self.first if part is self.part else self.mill(planned(part), part=part)
        return self._passes[key]

    def mill(self, commands: Commands, given_n: np.ndarray | None = None, part: Part | None = None) -> Pass:
        return milling.mill(self.case.plant, part or self.part, commands, self.cutter, given_n)

    def identify(self) -> Path:
        """stiffness.json by the command line."""
        output = self.folder / "stiffness.json"
        done = kit.run("identify", self.cell, self.measurements, "-o", output)
        assert done.code == 0, done
        return output

    def diagnose(self) -> tuple[Path, dict[str, Any]]:
        """The extended stiffness file and diagnosis.json by the command line."""
        output, extended = self.folder / "diagnosis.json", self.folder / "extended.json"
        done = kit.run("diagnose", self.cell, self.measurements, "-o", output, "--extended", extended)
        assert done.code == 0, done
        return extended, json.loads(output.read_text())

    def springs(self, name: str, stiffness: np.ndarray) -> Path:
        """A stiffness file with these springs [N m/rad]."""
        cell = read_cell(self.cell)
        model = IdentifiedModel(cell.robot, cell.flange_from_tcp, -np.log(stiffness), np.eye(6) * TRUTH_STD**2)
        output = self.folder / name
        output.write_text(json.dumps(model.as_dict()))
        return output

    def log(self, done: Pass, commands: Commands, name: str, *, part: Part | None = None, by_target: bool = False,
            revolutions: int = 0) -> Path:
        """The log of a pass, as the sensor gives it, or filtered by a moving mean over so many revolutions."""
        rng = np.random.default_rng([self.seed, 77])
        log = milling.log_of(done, part or self.part, commands, self.cutter, self.sensor, rng)
        if revolutions:
            log = log.averaged(round(revolutions * self.sensor.rate_hz / self.cutter.turns_per_s))
        output = self.folder / name
        output.write_text(log.csv(by_target))
        return output

    def perfect_log(self, name: str) -> Path:
        """The first pass without any error, by position, base frame: the mean force of every eighth of a millimetre."""
        done = milling.mill(self.case.plant, self.part, self.planned, self.cutter, step_mm=0.125)
        rows = np.concatenate([done.steps.between(self.part.target_mm), BASE_FROM_OBJECT.apply(done.force_n)], axis=1)
        output = self.folder / name
        output.write_text("\n".join(["x_mm,y_mm,z_mm,fx_n,fy_n,fz_n", *(",".join(f"{v:.9g}" for v in row) for row in rows)])
                          + "\n")
        return output

    def correct(self, log: Path, stiffness: Path, chosen: Settings | None = None, cell: Path | None = None) -> Correction:
        """Corrects the planned program; the written numbers are read by a reader of the virtual cell's own."""
        inputs = Inputs(cell or self.cell, self.program, stiffness, log)
        job = correct(predict_files(inputs, chosen or settings()))
        written = milling.read_commands(job.content.decode())
        assert np.array_equal(milling.read_commands(self.program.read_text()).position_mm, self.part.target_mm)
        path, prediction = job.predicted.path, job.predicted.prediction
        sigma, left, worse = np.zeros((3, len(path.toolpath)))
        sigma[prediction.targets] = 1e6 * np.linalg.norm(prediction.std, axis=1)
        left[job.correction.targets], worse[job.correction.targets] = 1e6 * job.left.std, job.worse
        part = self.part
        if len(written.position_mm) != len(part.target_mm):
            # What refines a move says of its own targets where they were planned.
            part = part.with_targets(1e3 * path.toolpath.position)
        return Correction(job, part, written, sigma, left, worse)

    def offsets(self, found: Correction, name: str) -> Path:
        """offsets.csv of a correction."""
        output = self.folder / name
        output.write_bytes(offsets_csv(found.job))
        return output

    def cell_with(self, name: str, lines: str) -> Path:
        """The cell with these lines more."""
        output = self.folder / name
        output.write_text(self.cell.read_text() + lines)
        return output

    def cell_in_base(self) -> Path:
        """The cell with a log in the base frame."""
        output = self.folder / "cell_base.yaml"
        output.write_text(self.cell.read_text().split("force_log:")[0])
        return output

    def cell_ahead(self) -> Path:
        """The cell that says that the log names the target the tool moves to."""
        output = self.folder / "cell_ahead.yaml"
        output.write_text(self.cell.read_text() + "  target: ahead\n")
        return output

    def mirrored(self, log: Path, stiffness: Path) -> Commands:
        """One mirrored step: the planned positions less the deviation that is predicted there; orientation as planned."""
        predicted = predict_files(Inputs(self.cell, self.program, stiffness, log), settings())
        position = self.part.target_mm.copy()
        deviation = predicted.prediction.position.copy()        # SciPy's rotations want arrays they could write into
        position[predicted.targets] -= 1e3 * BASE_FROM_OBJECT.apply(deviation, inverse=True)
        return Commands(position, self.planned.turn)

    def with_the_truth(self, wrench: np.ndarray, rounds: int = 4) -> Commands:
        """Commands at which the cell itself, its hidden effects included, would hold the tool on plan under the forces of
        wrench (N, 6) [N, base], one a target."""
        length = np.linalg.norm(np.diff(self.part.target_mm, axis=0, prepend=self.part.target_mm[:1]), axis=1)
        time = np.cumsum(length / np.where(self.part.feature == AIR, AIR_FEED_MM_S, self.cutter.feed_mm_s))
        position = self.part.target_mm.copy()
        for _ in range(rounds):
            theta = angles(Commands(position, self.planned.turn), self.case.plant)
            off, _ = self.case.plant.pushed(theta, time, lambda i, moved: wrench[i, :3])
            position = self.part.target_mm - 1e3 * BASE_FROM_OBJECT.apply(off, inverse=True)
        return Commands(position, self.planned.turn)


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def grown(first: Pass, after: Pass) -> np.ndarray:
    """How much further off the steps (S,) are than without correction [um]."""
    return np.asarray(np.linalg.norm(after.off_um, axis=1) - np.linalg.norm(first.off_um, axis=1))


def made_worse(first: Pass, after: Pass, sigma_um: np.ndarray) -> np.ndarray:
    """Steps (S,) that cut and that have grown by more than 2 sigma_um (N,) of their targets, and by more than the rounding. A
    target without force states no sigma: beside it that of the other end counts alone."""
    start, end = sigma_um[first.steps.segment - 1], sigma_um[first.steps.segment]
    stated = np.where((start > 0) & (end > 0), first.steps.between(sigma_um), np.maximum(start, end))
    return np.asarray(after.cutting & (grown(first, after) > 2 * stated + ROUNDING_UM))

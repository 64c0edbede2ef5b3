"""Programs of a batch or of a watched folder, each corrected by itself: a JSON document, a line of text, an exit code."""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from compensator.correction.files import Inputs, correct_files
from compensator.correction.settings import DEFAULTS, Settings
from compensator.cutting.settings import CuttingSettings
from compensator.cutting.stock_file import named_by
from compensator.forces.settings import LogSettings
from compstiff.batch.pairing import ProgramFiles, no_log, programs_in
from compstiff.outcome import DEFECT, DONE, FAILED, INTERRUPTED, REFUSED, Outcome, Session, attempt, document
from identification.common.files import sha256
from identification.common.findings import CompstiffError, Finding, counted, error
from identification.common.quantities import two_sigma
from identification.model.cell import read_cell

# An interrupt ends the whole call; a defect is worse than what could not be done, and that is worse than a refusal.
WORST_FIRST = (INTERRUPTED, DEFECT, FAILED, REFUSED, DONE)


@dataclass(frozen=True)
class Shared:
    """What all programs share. session: the options of the call (verbose, overwrite). logs: the folder of the force logs, None
    where each lies beside its program.

    >>> from pathlib import Path
    >>> compstiff.Shared(Path("cell.yaml"), Path("stiffness.json")).settings == compstiff.Settings()
    True
    """

    cell: Path
    stiffness: Path
    settings: Settings = DEFAULTS
    session: Session = field(default_factory=lambda: Session("correct"))
    logs: Path | None = None

    @property
    def predicted(self) -> bool:
        """Whether forces are predicted where a program has a stock."""
        return self.settings.cutting.predict_force is not None

    @property
    def files(self) -> tuple[Path, ...]:
        """What is read for every program."""
        return (self.cell, self.stiffness, *(path for _, path in self.settings.files()))

    def of(self, files: ProgramFiles) -> Settings:
        """The settings of one program: forces are predicted with its own stock, and not where it has none; what is said of logs
        (the tare) is for those that have one."""
        cutting = replace(self.settings.cutting, stock=files.stock) if files.stock else CuttingSettings()
        log = self.settings.log if files.logs else LogSettings(spindle_rpm=self.settings.log.spindle_rpm)
        return replace(self.settings, cutting=cutting, log=log)


@dataclass(frozen=True)
class ProgramResult:
    """A program that was dealt with. status: "ok", "left" or "waiting" without a log, or what stopped it. findings: as shown;
    document: as `--json` prints it, on one line."""

    files: ProgramFiles
    code: int
    status: str
    findings: tuple[Finding, ...]
    document: dict[str, Any]

    @classmethod
    def of(cls, files: ProgramFiles, shared: Shared, outcome: Outcome, status: str, code: int) -> ProgramResult:
        """A program with what there is to say of it."""
        session = replace(shared.session, inputs=[shared.cell, files.program, shared.stiffness, *files.own[1:]])
        written = str(files.outputs.program) if status == "ok" else None
        shown = document(session, outcome, status, code) | {"program": str(files.program), "output": written}
        return cls(files, code, status, outcome.findings, shown)

    def as_dict(self) -> dict[str, Any]:
        """JSON values."""
        return self.document

    def lines(self) -> list[str]:
        """The program in one line."""
        program = self.files.program
        if self.status in ("left", "waiting"):
            return [f"{program}: {self.findings[0].message}"]
        if self.code != DONE:
            stop = next((finding for finding in self.findings if finding.level == "error"), None)
            return [f"{program}: {self.status} (exit {self.code})" + (f", {stop.code}" if stop else "")]
        figures = self.document["result"]
        added = f" ({figures['corrected_added']} of them added)" if figures["corrected_added"] else ""
        left = figures["expected_left_um"]
        unstated = ("; most of that is the force that follows the cut, which nobody stated (cutting in cell.yaml, "
                    "--depth-of-cut)"
                    if figures["cutting_stiffness"] is None and left["cut"] > 0.5 * left["rms"] else "")
        return [f"{program} -> {self.files.outputs.program}: {counted(figures['corrected'], 'target')} corrected{added}, "
                f"largest {figures['offset_mm']['largest']:.4f} mm; expected to be left on the part, 2 sigma: "
                f"{two_sigma(left['rms']):.1f} um RMS{unstated}"]

    def with_finding(self, finding: Finding) -> ProgramResult:
        """The same with one more thing to say."""
        shown = {**self.document, "findings": [*self.document["findings"], finding.as_dict()]}
        return replace(self, findings=(*self.findings, finding), document=shown)


def worst(codes: Sequence[int]) -> int:
    """The exit code of a call of several programs."""
    return next((code for code in WORST_FIRST if code in codes), DONE)


def programs_of(paths: Sequence[Path]) -> list[Path]:
    """The programs named, and those of the folders named. Raises CompstiffError: CS0005, CS6003 there is none."""
    programs = [program for path in paths for program in (programs_in(path) if path.is_dir() else [path])]
    if not programs:
        raise error("CS6003", "has no program in it", file=str(paths[0]), hint="name the folder of the programs (.mod ...)")
    return programs


def correct_as_new(shared: Shared, files: ProgramFiles, own: bool) -> ProgramResult:
    """`correct_program`, for workers. own: outputs that exist are what a lost process of this call left."""
    return correct_program(files, shared, overwrite=own)


def content_key(files: ProgramFiles, shared: Shared, digests: Sequence[str]) -> str:
    """What makes a program another one: names and content (digests: of its own files), cell, robot, stiffness and settings.
    Raises OSError."""
    robot = ""
    with contextlib.suppress(CompstiffError):
        robot = read_cell(shared.cell).robot.sha256
    chosen = shared.settings.values()
    named = [sha256(path) for stock in files.stocks for path in named_in(stock)]
    parts = [files.program.name, *digests, *named, str(files.rival), sha256(shared.cell), robot, sha256(shared.stiffness),
             *(f"{name}={value!r}" for name, value in chosen.items()),
             *(sha256(value) for value in chosen.values() if isinstance(value, Path) and value.is_file())]
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


def named_in(stock: Path) -> list[Path]:
    """The files that a stock file names and that are there."""
    with contextlib.suppress(CompstiffError, OSError):
        return [path for path in named_by(stock) if path.is_file()]
    return []


def correct_program(
    files: ProgramFiles, shared: Shared, *, overwrite: bool = False, before_writing: Callable[[], None] | None = None
) -> ProgramResult:
    """Corrects one program; whatever stops it is in what it returns.

    overwrite: existing outputs are this call's own. before_writing: called once everything is computed; what it raises stops
    the correction, and nothing is written.
    """
    if not files.logs and not files.stocks:
        left = Outcome(findings=(no_log(files.program, shared.logs, "it is left alone", shared.predicted),))
        return ProgramResult.of(files, shared, left, "left", DONE)

    def body() -> Outcome:
        inputs = Inputs(shared.cell, files.program, shared.stiffness, files.forces)
        corrected = correct_files(inputs, files.outputs, shared.of(files), overwrite=overwrite or shared.session.overwrite,
                                  before_writing=before_writing)
        return Outcome(corrected.as_dict(), (*corrected.findings, *_alone(files, shared)))

    return ProgramResult.of(files, shared, *attempt(replace(shared.session, jobs=False), body))


def _alone(files: ProgramFiles, shared: Shared) -> list[Finding]:
    """A note (CS4737) of a log that was not held against a stock, where that was asked for."""
    if not shared.predicted or files.stocks:
        return []
    return [Finding("CS4737", "note", "has a force log and no stock beside it: it was corrected by its log, which was held "
                    "against nothing", str(files.program), hint="state what it starts from, as PROGRAM.stock.yaml")]

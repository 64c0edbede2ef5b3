"""Diagnosis: everything `diagnose` has to say of one set of measurements."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

from identification.common.findings import CompstiffError, Finding
from identification.diagnosis.detect import REPLICATES
from identification.diagnosis.extended_model import extended_model
from identification.diagnosis.in_words import answer, judgement_findings
from identification.diagnosis.judgement import Cause, Judgement, Verdict
from identification.diagnosis.mended import MendedFile, mended_file
from identification.diagnosis.procedure import ALARM, judge
from identification.diagnosis.record import record
from identification.fit.mistakes.judge import Mistaken
from identification.measurements import Measurements
from identification.model.cell import Cell
from identification.model.stiffness import IdentifiedModel


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """What the plain model gets wrong on these measurements, and why. judgement: what the procedure found, with the fits."""

    cell: Cell
    measurements: Measurements
    judgement: Judgement

    @property
    def verdict(self) -> Verdict:
        """adequate, named, ambiguous, unknown or mistake."""
        return self.judgement.verdict

    @property
    def causes(self) -> tuple[Cause, ...]:
        """The causes that are named, the likeliest first."""
        return self.judgement.causes

    @property
    def alternatives(self) -> tuple[Cause, ...]:
        """What else it may be, the likeliest first."""
        return self.judgement.alternatives

    @cached_property
    def findings(self) -> tuple[Finding, ...]:
        """What a user must know beside the answer."""
        return (*self.measurements.findings, *judgement_findings(self.judgement))

    def as_dict(self) -> dict[str, Any]:
        """The content of diagnosis.json."""
        return record(self.judgement)

    def lines(self) -> list[str]:
        """The answer in plain words."""
        return answer(self.judgement)

    def mended(self) -> MendedFile | None:
        """The table or the cell file without its mistake; None where none is named. Raises CS1705."""
        if self.verdict != "mistake":
            return None
        return mended_file(self.cell, self.measurements, self.judgement.mistakes[0])

    def extended(self) -> IdentifiedModel:
        """The model to correct with: effects of the robot in force, the plain springs where nothing is named."""
        return extended_model(self.judgement)


class Unfitted(CompstiffError):
    """Measurements that no springs fit (CS1010), whose mistake is known. check: what settles that it is this one.

    >>> from dataclasses import replace
    >>> cell = compstiff.read_cell("cell.yaml")
    >>> rows = compstiff.read_measurements("measurements.csv", cell.robot)
    >>> try:
    ...     compstiff.diagnose(cell, replace(rows, deflection=-rows.deflection))
    ... except compstiff.Unfitted as stopped:
    ...     stopped.mended().source.name
    'measurements.csv'
    """

    def __init__(self, stopped: Mistaken, cell: Cell, measurements: Measurements) -> None:
        self.cell, self.measurements, self.mistake = cell, measurements, stopped.mistake
        self.check = stopped.mistake.candidate.mistake.settles
        super().__init__(*stopped.findings)

    def mended(self) -> MendedFile:
        """The table or the cell file without its mistake. Raises CS1705."""
        return mended_file(self.cell, self.measurements, self.mistake)


def diagnose(
    cell: Cell, measurements: Measurements, *, alarm: float = ALARM, replicates: int = REPLICATES, seed: int = 0
) -> Diagnosis:
    """Finds out what the plain model gets wrong on these measurements, names the cause and measures the gain.

    alarm: family-wise rate of false alarms. replicates: simulated data sets behind the p-value. Raises CompstiffError: CS1009
    no loaded row, CS1010 data that prefer all compliances negative (Unfitted where it is clear which mistake does that), CS1011
    no convergence.

    >>> cell = compstiff.read_cell("cell.yaml")
    >>> diagnosis = compstiff.diagnose(cell, compstiff.read_measurements("measurements.csv", cell.robot))
    >>> diagnosis.as_dict()["verdict"]
    'adequate'
    """
    try:
        return Diagnosis(cell, measurements, judge(cell, measurements, alarm=alarm, replicates=replicates, seed=seed))
    except Mistaken as stopped:
        raise Unfitted(stopped, cell, measurements) from None

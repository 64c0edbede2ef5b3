"""DesignPlan: what `design` answers, as JSON values, for the terminal, as a measurement file and as a RAPID program."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from identification.common.findings import Finding, counted
from identification.design.causes import ByCauses
from identification.design.comparison import Comparison
from identification.design.discrimination import Discrimination
from identification.design.forecast import Forecast
from identification.design.loads import AXES
from identification.design.milling import USUAL_FORCE_N
from identification.design.program import RapidProgram, rapid_program
from identification.design.request import Prepared
from identification.design.search import Design
from identification.design.sheet import Sheet, sheet_text
from identification.design.stated_covariance import stated_covariance
from identification.design.unseen import Sideways
from identification.model.controller import check_rapid

CRITERIA = {"D": "the volume of the confidence ellipsoid of ln k", "A": "the mean variance of ln k",
            "A in raw k": "the mean variance of k, as published", "E": "the longest axis of the confidence ellipsoid of ln k",
            "I": "the mean variance of the deflection predicted along the program",
            "C": "what the runs tell of the six stiffnesses and of every cause of typical size together"}


@dataclass(frozen=True, eq=False)
class DesignPlan:
    """A plan and all that there is to say of it: the task, the design that was found for it, its rows, what they will tell.
    aim: the rival causes, or all causes (criterion C), that the runs were chosen for, None where it was the criterion alone.
    gain: over plainer loads, None where that was not asked for. further: rows were measured before, and the forecast is of
    them together. seed: of the random starts. unseen: for each joint that the loads cannot show, the load that would, and at
    which pose."""

    prepared: Prepared
    design: Design
    sheet: Sheet
    forecast: Forecast
    aim: Discrimination | ByCauses | None
    gain: Comparison | None
    further: bool
    seed: int
    findings: tuple[Finding, ...]
    unseen: tuple[tuple[Sideways, str], ...] = ()

    @property
    def prediction_std_um(self) -> tuple[float, float] | None:
        """RMS uncertainty [um] of the deflection predicted along the program before and after the plan, None without one."""
        weight = self.prepared.weight
        if weight is None:
            return None
        before, after = np.linalg.inv(self.prepared.task.prior), stated_covariance(self.design.task, self.design.runs)
        first, last = (float(1e6 * np.sqrt(np.sum(weight * covariance))) for covariance in (before, after))
        return first, last

    @property
    def criterion(self) -> str:
        """Its name, as the user asked for it."""
        return "C" if isinstance(self.aim, ByCauses) else self.design.task.criterion.name

    @property
    def certified(self) -> str:
        """The certificate in words; of runs that were chosen for causes it judges what they were not chosen for."""
        certified = self.design.certificate.sentence
        if self.aim is None:
            return certified
        return f"by criterion {self.design.task.criterion.name} alone, for which they were not chosen, the runs are {certified}"

    def as_dict(self) -> dict[str, Any]:
        """JSON values."""
        design, prediction = self.design, self.prediction_std_um
        return {
            "format": "compstiff-design", "version": 1, "criterion": self.criterion, "seed": self.seed,
            "measurements": len(design.task.demand), "replicates": design.task.replicates, "rows": len(self.sheet.visit),
            "place": self.prepared.place, "before": self.prepared.before,
            "certificate": design.certificate.as_dict(),
            "search": {"tried": design.tried, "ended_infeasible": design.failed, "ended_as_good": design.same,
                       "pool": len(design.pool),
                       "sampled_pool_exchange_efficiency": design.single / design.certificate.bound},
            "prediction_std_um": None if prediction is None else {"before": prediction[0], "after": prediction[1]},
            "settles": self.aim.as_dict() if isinstance(self.aim, Discrimination) else None,
            "by_causes": self.aim.as_dict() if isinstance(self.aim, ByCauses) else None,
            "gain": None if self.gain is None else self.gain.as_dict(),
            "unseen": [one.as_dict(label) for one, label in self.unseen],
            "forecast": self.forecast.as_dict(),
            "visits": self.sheet.visits_as_dicts(),
        }

    def lines(self) -> list[str]:
        """The visits, then what the plan is worth and what it will tell."""
        return [*self.sheet.lines(), *self.worth()]

    def worth(self, tables: bool = False) -> list[str]:
        """What the plan is worth and what it will tell, in words; tables: without what tables beside it say of joints and
        causes."""
        sheet, criterion = self.sheet, self.criterion
        kept = int(sheet.validate.sum())
        lines = [
            counted(len(sheet.label), "pose") + (f" ({kept} of them never fitted)" if kept else "")
            + f", {counted(len(sheet.visit), 'row')}, about {sheet.time[-1] / 60:.0f} min; {self.prepared.place}"]
        if sheet.hung:
            lines.append(f"{sheet.lifted_kg:g} kg are lifted in all to hang the weights on and take them off; every pose "
                         "begins and ends without them")
        if isinstance(self.aim, Discrimination):
            lines += self.aim.lines()
        lines.append(f"criterion {criterion}: {CRITERIA[criterion]}{self._about}")
        if isinstance(self.aim, ByCauses):
            lines += self.aim.lines()
        lines.append(self.certified)
        if self.gain is not None:
            lines += self.gain.lines()
        if not tables:
            lines += [f"expected, starting from {self.prepared.before}:", *self.forecast.joint_lines()]
        prediction = self.prediction_std_um
        if prediction is not None:
            lines.append(f"deflection along the program (under {USUAL_FORCE_N:g} N along each base axis where no force log was "
                         f"given): uncertain by {prediction[1]:.2g} um RMS, before {prediction[0]:.3g} um")
        causes = self.forecast.cause_lines(", with what was measured before," if self.further else "")
        lines += causes[:1] if tables else causes
        if self.aim is None and 2 * self.forecast.counts["identifiable"] < len(self.forecast.causes):
            axes = [slot.name for slot in self.design.task.domain.slots]
            lines.append("most causes would stay without a name: --criterion C plans for them, most in a --box" + (
                "; --every-axis names more at each pose" if len(axes) > 1 and set(axes) <= set(AXES) else ""))
        return lines + (self.forecast.length_lines() if self.aim is None else [])

    @property
    def _about(self) -> str:
        """What the criterion leaves out."""
        names = " and ".join(f"k{one.joint}" for one, _ in self.unseen)
        return f"; of what these loads can show, {names} left out" if names else ""

    def csv(self) -> bytes:
        """The measurement file, its deflection columns still empty."""
        return sheet_text(self.sheet, self._head()).encode()

    def rapid(self, name: str) -> RapidProgram:
        """The program that drives through the visits; name: of its module, made an identifier. Raises CS0060 where the robot's
        controller does not run RAPID."""
        check_rapid(self.prepared.task.domain.rig.cell.robot, "--rapid writes RAPID")
        return rapid_program(self.prepared.task.domain, self.sheet, name, self._head())

    def _head(self) -> list[str]:
        """The head of the written files."""
        task = self.design.task
        kept = int(self.sheet.validate.sum())
        lines = [
            f"Measurement plan by compstiff design, {counted(len(task.demand), 'run')}"
            + (f" and {kept} that are never fitted (purpose validate)" if kept else "")
            + f", criterion {self.criterion}; {self.prepared.place}",
            self.certified,
            "Deflection: loaded minus unloaded TCP, base frame. Fill in dx_um dy_um dz_um of every row, the zero readings too,",
            "with the sensors set to zero anew at each pose, and put the true times in time_s; planned ones stand there.",
            "Collisions were not checked: drive the poses in manual mode first.",
        ]
        if self.sheet.hung:
            lines += [
                "mass_kg: what hangs at the tool point beyond the zero reading; put in what really hangs, hook and rope too.",
                "On the way up take the lighter weight off before the heavier is hung on; on the way down only take off.",
                "Let it hang still before reading. Never drive with a weight that hangs.",
                "Leave the controller's load data as they are without weights.",
            ]
        if self.sheet.hung and self.further:
            lines.append("To a file of forces add the column mass_kg first, empty in its rows; fx_n fy_n fz_n stay empty here.")
        if isinstance(self.aim, Discrimination):
            lines += ["Append the rows to what was measured before, then diagnose again.", *self.aim.lines()]
        return lines

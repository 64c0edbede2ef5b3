"""JointLogFit: the stiffnesses of the joints that have encoders on both sides of their gears, from logs in motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from identification.common.findings import Finding
from identification.model.cell import Cell
from identification.model.effects_in_force import EffectInForce
from identification.model.gravity import fall_in_base
from identification.model.stiffness import IdentifiedModel
from identification.motion.band import BAND
from identification.motion.causes import LogCause
from identification.motion.leaps import find_leaps, without
from identification.motion.log_file import MotionLog, check_distinct
from identification.motion.stiffness import DISAGREE, AxisStiffness, axis_stiffness, log_posterior
from identification.motion.transmission import find_transmission

# Effects that the robot shows at rest too: `correct` can use them.
AT_REST = ("backlash", "soft_zone", "hysteresis")
# Relative standard deviation of a value that was picked from a grid of doubled values.
BETWEEN = 0.2


@dataclass(frozen=True, eq=False)
class JointLogFit:
    """From these logs of this cell. model: the posterior as stiffness.json carries it, joints without link encoder, or refused,
    at their prior. joints: those the logs have, refused or not."""

    cell: Cell
    logs: tuple[MotionLog, ...]
    model: IdentifiedModel
    joints: tuple[AxisStiffness, ...]
    findings: tuple[Finding, ...]

    def as_dict(self) -> dict[str, Any]:
        """The content of stiffness.json."""
        return self.model.as_dict()

    def lines(self) -> list[str]:
        """The fit as a table, then what each joint's log says."""
        model = self.model
        lines = ["joint   stiffness k [N m/rad]   95 % interval                grade"]
        for joint, (k, (low, high), grade) in enumerate(
                zip(model.stiffness, model.interval_95, model.grades, strict=True), start=1):
            interval = f"{low:.3g} ... {high:.3g}"
            lines.append(f"k{joint}      {k:<22.3g}  {interval:<27}  {grade}")
        return lines + [line for joint in self.joints for line in joint.lines()]


def fit_joint_logs(cell: Cell, logs: Sequence[MotionLog]) -> JointLogFit:
    """Identifies the stiffnesses from one or more joint deflection logs; the cell's robot needs no geometry.

    >>> cell = compstiff.read_cell("cell.yaml")
    >>> fit = compstiff.fit_joint_logs(cell, [compstiff.read_motion_log("log_a.csv")])
    >>> print(fit.lines()[2])
    k2      5.02e+06                4.98e+06 ... 5.05e+06        reliable
    """
    check_distinct(logs)
    numbers = sorted({joint for log in logs for joint in log.joints})
    leaps = {joint: find_leaps(joint, logs) for joint in numbers}
    joints = tuple(_stiffness(joint, without(leaps[joint], list(logs))) for joint in numbers)
    findings = (*stiffness_findings(logs, joints), *(leap.finding for joint in numbers for leap in leaps[joint]))
    return JointLogFit(cell, tuple(logs), identified_model(cell, joints, logs), joints, findings)


def _stiffness(joint: int, records: list[MotionLog]) -> AxisStiffness:
    return axis_stiffness(joint, records, find_transmission(joint, records, None))


def identified_model(
    cell: Cell, joints: Sequence[AxisStiffness], logs: Sequence[MotionLog], causes: Sequence[LogCause] = (),
    residual_urad: float | None = None,
) -> IdentifiedModel:
    """stiffness.json's model: joints without link encoder, or refused, at their prior; causes: effects in force."""
    known = {joint.joint: joint for joint in joints}
    moments = [log_posterior(known.get(number), cell.prior, number) for number in range(1, 7)]
    grades = tuple(known[number].grade if number in known else "not identifiable" for number in range(1, 7))
    kept = [cause for cause in causes if cause.shape.name in AT_REST]
    mean = [m for m, _ in moments]
    variance = [v for _, v in moments]
    for cause in kept:
        mean += cause.values.tolist()
        variance += [(std if np.isfinite(std) else BETWEEN * value) ** 2
                     for std, value in zip(cause.std, cause.values, strict=True)]
    fit = {"rows": max((joint.samples for joint in joints), default=0), "measured": "joint deflection log", "band_hz": BAND,
           "residual_rms_urad": residual_urad, "joints": [joint.as_dict() for joint in joints]}
    return IdentifiedModel(cell.robot, cell.flange_from_tcp, np.array(mean), np.diag(variance), grades, fit,
                           tuple(EffectInForce(cause.shape.effect, cause.joint) for cause in kept),
                           fall_in_base(cell.world_from_base), cell.tool_mass, cell.tool_centre,
                           made_from=tuple({"file": Path(log.source).name, "sha256": log.sha256} for log in logs if log.sha256))


def stiffness_findings(logs: Sequence[MotionLog], joints: Sequence[AxisStiffness]) -> tuple[Finding, ...]:
    """What a user must know before trusting the stiffnesses."""
    source = logs[0].source
    findings = [finding for log in logs for finding in log.findings]
    missing = [f"k{number}" for number in range(1, 7) if number not in {joint.joint for joint in joints}]
    if missing:
        findings.append(Finding("CS1504", "note", f"{', '.join(missing)}: no link encoder in the log; the value is the prior's",
                                file=source))
    for joint in joints:
        if joint.refused:
            findings.append(Finding("CS1502", "warning", f"k{joint.joint} is not identifiable from this log, its value is the "
                                    f"prior's: {joint.reason}", file=source,
                                    hint="load the joint while it stands still or moves slowly"))
        if joint.records and joint.apart > DISAGREE:
            values = ", ".join(f"{name}: {1 / c:.3g}" for name, c, _ in joint.records)
            findings.append(Finding("CS1503", "warning", f"the records disagree on k{joint.joint} by {joint.apart:.1f} "
                                    "standard "
                                    f"deviations ({values} N m/rad)", file=source, hint="compstiff diagnose, on each record"))
    return tuple(findings)

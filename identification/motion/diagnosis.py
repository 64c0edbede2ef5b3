"""JointLogDiagnosis: what the plain springs get wrong in joint deflection logs, as diagnosis.json and in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from identification.common.arrays import rms
from identification.common.findings import Finding
from identification.common.quantities import cause_words
from identification.model.cell import Cell
from identification.model.stiffness import IdentifiedModel
from identification.motion.axis_diagnosis import MICRO, AxisDiagnosis, Verdict
from identification.motion.band import BAND
from identification.motion.causes import group_as_dict, over_joints
from identification.motion.fit import identified_model, stiffness_findings
from identification.motion.log_file import MotionLog, check_distinct
from identification.motion.procedure import ALARM, REPLICATES, diagnose_axes

HINT = ("a controller that takes the link encoder's word is off by as much at the same motor angle; the deflection of each "
        "record counts from its own zero")


@dataclass(frozen=True, eq=False)
class JointLogDiagnosis:
    """What was found at each joint of the logs. p_resolution: the smallest that the p-value can be."""

    cell: Cell
    logs: tuple[MotionLog, ...]
    axes: tuple[AxisDiagnosis, ...]
    p_resolution: float

    @property
    def verdict(self) -> Verdict:
        """Over all joints: what is certain at one stays so whatever another shows; each joint's own stands beside it."""
        verdicts = [axis.verdict for axis in self.axes]
        order: tuple[Verdict, ...] = ("named", "unknown", "ambiguous", "adequate")
        return next(verdict for verdict in order if verdict in verdicts)

    @cached_property
    def findings(self) -> tuple[Finding, ...]:
        """What a user must know beside the answer."""
        source = self.logs[0].source
        findings = list(stiffness_findings(self.logs, [axis.stiffness for axis in self.axes]))
        for axis in self.axes:
            follows = [f"{name} ({100 * share:.0f} % of it, p = {p:.2g})" for name, share, p in axis.left.patterns]
            # What open causes explain, or the gear's damping, leaves no pattern.
            if follows and axis.verdict in ("named", "unknown"):
                findings.append(Finding("CS1505", "warning", f"joint {axis.joint}: what is left follows "
                                        f"{' and '.join(follows)}; no cause in the dictionary has that law", file=source,
                                        hint="a transmission or encoder error repeats with the angle: measure it by moving "
                                        "slowly"))
            alone = [f"{line.cycles:.1f}" for line in axis.transmission.lines if not line.confirmed]
            if alone:
                findings.append(Finding("CS1611", "note", f"joint {axis.joint}: what repeats {', '.join(alone)} times a turn "
                                        f"is not found again in {axis.transmission.again_on}: it is not named", file=source))
            findings += [leap.finding for leap in axis.leaps]
            findings += [Finding("CS1610", "warning", zero.sentence, file=zero.record, hint=HINT)
                         for zero in axis.zeros if zero.moved]
        if self.verdict == "unknown":
            findings.append(Finding("CS1401", "warning", "something is wrong that no cause in the dictionary explains",
                                    file=source, hint="no cause is carried into the model; look at what is left by angle, "
                                    "torque and frequency in the report (--report)"))
        if self.verdict == "ambiguous":
            names = dict.fromkeys(cause_words(cause.label) for axis in self.axes for cause in axis.alternatives)
            findings.append(Finding("CS1402", "warning", f"the log cannot tell several causes apart: {', '.join(names)}",
                                    file=source))
        return tuple(findings)

    def as_dict(self) -> dict[str, Any]:
        """The content of diagnosis.json."""
        plain, extended = (np.concatenate([axis.residuals[:, k] for axis in self.axes]) for k in range(2))
        robot = self.cell.robot
        alternatives = over_joints(sorted((cause for axis in self.axes for cause in axis.alternatives),
                                          key=lambda cause: -cause.probability))
        return {
            "format": "compstiff-diagnosis", "version": 1, "robot": robot.name, "load_path": robot.load_path,
            "measured": "joint deflection log", "verdict": self.verdict,
            "misfit": {"rms_urad": MICRO * rms(plain), "left_rms_urad": MICRO * rms(extended),
                       "p_value": min(axis.p_value for axis in self.axes), "p_resolution": self.p_resolution},
            "causes": [group_as_dict(group) for group in over_joints(cause for axis in self.axes for cause in axis.causes)],
            "alternatives": [group[0].as_dict() | {"probability": max(cause.probability for cause in group)}
                             for group in alternatives],
            "gain": self._gain(), "next_measurements": self._next(),
            "joints": [axis.as_dict() for axis in self.axes],
            "band_hz": BAND, "records": [log.source for log in self.logs],
        }

    def lines(self) -> list[str]:
        """The answer, joint by joint."""
        return [f"verdict: {self.verdict}", *(line for axis in self.axes for line in axis.lines())]

    def extended(self) -> IdentifiedModel:
        """The model to correct with: the stiffnesses and, of the named causes, those that the robot shows at rest too."""
        left = rms(np.concatenate([axis.residuals[:, 1] for axis in self.axes]))
        return identified_model(self.cell, [axis.stiffness for axis in self.axes], self.logs,
                                [cause for axis in self.axes for cause in axis.causes], MICRO * left)

    def _gain(self) -> dict[str, Any] | None:
        """Over all joints with a named cause: mean square of all their samples; by joint beside it."""
        gains = {axis.joint: axis.gain for axis in self.axes if axis.gain is not None}
        if not gains:
            return None
        before = rms(np.array([gain.before for gain in gains.values()]))
        after = rms(np.array([gain.after for gain in gains.values()]))
        low, high = min(gain.interval[0] for gain in gains.values()), max(gain.interval[1] for gain in gains.values())
        return {"rms_before_urad": MICRO * before, "rms_after_urad": MICRO * after, "ratio": before / after,
                "interval": [low, high], "held_out": next(iter(gains.values())).held_out,
                "by_joint": {str(joint): gain.as_dict() for joint, gain in gains.items()}}

    def _next(self) -> list[dict[str, Any]]:
        """Checks that would settle what is open."""
        texts = {(cause.shape.effect.settles, cause.label): None for axis in self.axes for cause in axis.alternatives
                 if cause.probability >= 0.05}
        checks = [{"kind": "check", "what": text, "about": label} for text, label in texts]
        return checks + [
            {"kind": "check", "what": "hang known weights on the arm at standstill, up and down: torque without speed",
             "about": f"k{axis.joint}"} for axis in self.axes if axis.stiffness.refused]


def diagnose_joint_logs(
    cell: Cell, logs: Sequence[MotionLog], held_out: MotionLog | None = None, *, alarm: float = ALARM,
    replicates: int = REPLICATES,
) -> JointLogDiagnosis:
    """Finds out what the plain springs get wrong in the logs. The gain is measured on `held_out`, else on each log predicted
    from the others, of a single log on blocks of time.

    alarm: rate of false alarms over the whole dictionary and all joints; replicates: simulated data sets behind the p-values.
    Raises CompstiffError: CS1501 where the held-out log lacks a joint, CS1616 where a log is there twice.

    >>> cell = compstiff.read_cell("cell.yaml")
    >>> log, other = compstiff.read_motion_log("log_a.csv"), compstiff.read_motion_log("log_b.csv")
    >>> diagnosis = compstiff.diagnose_joint_logs(cell, [log], other, replicates=49)
    >>> diagnosis.as_dict()["verdict"]
    'named'
    """
    check_distinct([*logs, *([held_out] if held_out else [])])
    axes = diagnose_axes(list(logs), held_out, alarm=alarm, replicates=replicates)
    return JointLogDiagnosis(cell, tuple(logs), axes,
                             min(1 / (replicates + 1), *(axis.transmission.p_resolution for axis in axes)))

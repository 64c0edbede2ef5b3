"""The HTML reports of joint deflection logs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from identification.common.chart import Axis, Bars, Figure, Panel, Points
from identification.common.command_line import call
from identification.common.report import Key, Level, Page, ReportTable, Step, Verdict, render
from identification.motion.axis_diagnosis import MICRO, AxisDiagnosis
from identification.motion.diagnosis import JointLogDiagnosis
from identification.motion.fit import JointLogFit
from identification.motion.stiffness import AxisStiffness

MOST_POINTS = 1500


def diagnosis_report(diagnosis: JointLogDiagnosis) -> str:
    """The report of `diagnose` on a log."""
    rows = [[f"joint {axis.joint}", cause.shape.name, cause.sentence, cause.estimates, f"{cause.probability:.3f}"]
            for axis in diagnosis.axes for cause in (*axis.causes, *axis.alternatives)]
    tables = [ReportTable("Causes by probability", ["where", "effect", "in words", "parameters", "probability"], rows, (4,)),
              _stiffnesses([axis.stiffness for axis in diagnosis.axes])]
    # What is wrong is seen first.
    seen = sorted(diagnosis.axes, key=lambda axis: ("named", "unknown", "ambiguous", "adequate").index(axis.verdict))
    figures = [figure for axis in seen for figure in (_torque(axis), _time(axis), _spectrum(axis))]
    content = diagnosis.as_dict()
    logs = diagnosis.logs
    again = call("identify", diagnosis.cell.source, logs[0].source, *(
        word for log in logs[1:] for word in ("--also", log.source)), "-o", "stiffness.json")
    return render(Page(f"Diagnosis: {Path(logs[0].source).name}", _verdict(diagnosis), _keys(diagnosis, content),
                       [Step("The stiffnesses from these logs:", again)], diagnosis.lines(), tables, figures[:1], figures[1:],
                       diagnosis.findings, content))


def stiffness_report(fit: JointLogFit) -> str:
    """The report of `identify` on logs."""
    refused = [f"k{joint.joint}" for joint in fit.joints if joint.refused]
    stated = [f"k{joint.joint}" for joint in fit.joints if not joint.refused]
    if refused:
        verdict = Verdict("caution" if stated else "bad", "NOT ALL STIFFNESSES CAN BE STATED", f"{', '.join(refused)} refused: "
                          "these logs do not tell the stiffness from what else moves with the load; stated: "
                          f"{', '.join(stated) or 'none'}.")
    else:
        rest = "the other joints stay at what was known before"
        verdict = Verdict("good" if len(stated) == 6 else "caution", f"{len(stated)} OF 6 STIFFNESSES IDENTIFIED",
                          f"{', '.join(stated)} {'comes' if len(stated) == 1 else 'come'} from these logs"
                          + ("." if len(stated) == 6 else f"; {rest}."))
    model = fit.model
    # The file's own values: the logs' with what was known before.
    keys = [Key(f"k{joint.joint}", "refused" if joint.refused else f"{model.stiffness[joint.joint - 1]:.3g}",
                "" if joint.refused else "N m/rad", joint.grade) for joint in fit.joints]
    rows = [[f"k{i}", f"{k:.3g}", f"{low:.3g} ... {high:.3g}", grade] for i, (k, (low, high), grade) in enumerate(zip(
        model.stiffness, model.interval_95, model.grades, strict=True), 1)]
    written = ReportTable("What the stiffness file says", ["joint", "k [N m/rad]", "95 % interval", "grade"], rows, (1,))
    words = [line for joint in fit.joints for line in joint.lines()]
    step = Step("Ask what else moves with the load:", call("diagnose", fit.cell.source, fit.logs[0].source, *(
        word for log in fit.logs[1:] for word in ("--also", log.source)), "-o", "diagnosis.json"))
    return render(Page("Stiffness from joint deflection logs", verdict, keys, [step], words, [written], [], [], fit.findings,
                       fit.as_dict()))


def _verdict(diagnosis: JointLogDiagnosis) -> Verdict:
    said: dict[str, tuple[Level, str, str]] = {
        "adequate": ("good", "ADEQUATE", "Plain springs explain the logs to their noise"),
        "named": ("caution", "CAUSE NAMED", "The logs show more than springs, and its cause has a name"),
        "ambiguous": ("caution", "AMBIGUOUS", "The logs show more than springs; several causes would explain it"),
        "unknown": ("bad", "UNKNOWN", "The logs show more than springs, and no cause in the dictionary explains it")}
    level, word, sentence = said[diagnosis.verdict]
    names = list(dict.fromkeys(cause.sentence for axis in diagnosis.axes for cause in axis.causes))
    return Verdict(level, word, sentence + (": " + "; ".join(names[:3]) if names else "") + ".")


def _keys(diagnosis: JointLogDiagnosis, content: dict[str, Any]) -> list[Key]:
    misfit = content["misfit"]
    keys = [Key("left by plain springs", f"{misfit['rms_urad']:.0f} → {misfit['left_rms_urad']:.0f}", "µrad",
                "RMS; with the named causes")]
    gain = content["gain"]
    if gain is not None:
        keys.append(Key("on rows not fitted", f"{gain['rms_before_urad']:.0f} → {gain['rms_after_urad']:.0f}", "µrad",
                        f"RMS, {_held_out(gain['held_out'])}"))
    return [*keys, *(Key(f"joint {axis.joint}", axis.verdict, "", ", ".join(cause.shape.name for cause in axis.causes))
                     for axis in diagnosis.axes[:3])]


def _held_out(rows: str) -> str:
    """Which rows, a log by its name alone."""
    kind, colon, file = rows.partition(": ")
    return f"{kind}{colon}{Path(file).name}" if colon else rows


def _stiffnesses(joints: Sequence[AxisStiffness]) -> ReportTable:
    """Stiffness of each joint, refused or not."""
    rows = [[f"k{joint.joint}", f"{1 / joint.compliance:.3g}",
             f"{joint.interval_95[0]:.3g} ... {joint.interval_95[1]:.3g}", joint.grade, joint.reason] for joint in joints]
    return ReportTable("Stiffness", ["joint", "k [N m/rad]", "95 % interval", "grade", "why"], rows, (1,))


def _points(x: Any, y: Any, name: str, colour: str) -> Points:
    some = slice(None, None, max(1, len(x) // MOST_POINTS))
    return Points(name, x[some], y[some], colour, size=4)


def _torque(diagnosis: AxisDiagnosis) -> Figure:
    torque = np.concatenate([log.torque for log in diagnosis.axis.logs])
    spring = diagnosis.stiffness.compliance * (torque - torque.mean())
    series = [_points(torque, MICRO * (diagnosis.deflection - diagnosis.deflection.mean()), "as measured", "before"),
              _points(torque, MICRO * (spring + diagnosis.residuals[:, 1]), "without the named causes", "after")]
    return Figure(f"Joint {diagnosis.joint}: deflection against torque", "A spring is a line; a cloud is not the spring alone.",
                  [Panel(series, Axis("gear-side torque [N m]"), Axis("motor minus link [urad]"), height=360)])


def _time(diagnosis: AxisDiagnosis) -> Figure:
    time = np.concatenate([log.time for log in diagnosis.axis.logs])
    series = [_points(time, MICRO * diagnosis.residuals[:, k], name, colour) for k, (name, colour) in enumerate(
        (("plain spring", "before"), ("extended model", "after")))]
    return Figure(f"Joint {diagnosis.joint}: what is left, over time", "", [
        Panel(series, Axis("time [s]"), Axis("residual [urad]"))])


def _spectrum(diagnosis: AxisDiagnosis) -> Figure:
    names = [f"{low:g}-{high:g} Hz" for low, high, _ in diagnosis.left.spectrum]
    frequency, share = diagnosis.left.line
    bars = Bars("share", [100 * share for _, _, share in diagnosis.left.spectrum], "after")
    return Figure(f"Joint {diagnosis.joint}: spectrum of what is left",
                  f"Strongest narrow line: {frequency:.1f} Hz with {100 * share:.0f} % of the variance.",
                  [Panel([bars], Axis(categories=names), Axis("share of the variance [%]"), height=240)])

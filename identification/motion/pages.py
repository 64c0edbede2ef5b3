"""The HTML reports of joint deflection logs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from identification.common.report import Figure, ReportTable, render
from identification.motion.axis_diagnosis import MICRO, AxisDiagnosis
from identification.motion.diagnosis import JointLogDiagnosis
from identification.motion.fit import JointLogFit
from identification.motion.stiffness import AxisStiffness

GRID = {"gridcolor": "#eee", "zerolinecolor": "#888"}
BEFORE, AFTER = "#c0392b", "#2b6ca3"
MOST_POINTS = 1500


def diagnosis_report(diagnosis: JointLogDiagnosis) -> str:
    """The report of `diagnose` on a log."""
    rows = [[f"joint {axis.joint}", cause.shape.name, cause.sentence, cause.estimates, f"{cause.probability:.3f}"]
            for axis in diagnosis.axes for cause in (*axis.causes, *axis.alternatives)]
    tables = [ReportTable("Causes by probability", ["where", "effect", "in words", "parameters", "probability"], rows, (4,)),
              _stiffnesses([axis.stiffness for axis in diagnosis.axes])]
    figures = [figure for axis in diagnosis.axes for figure in (_torque(axis), _time(axis), _spectrum(axis))]
    return render(f"Diagnosis: {diagnosis.logs[0].source}", diagnosis.lines(), tables, figures, diagnosis.findings,
                  diagnosis.as_dict())


def stiffness_report(fit: JointLogFit) -> str:
    """The report of `identify` on logs."""
    return render("Stiffness from joint deflection logs", fit.lines(), [_stiffnesses(fit.joints)], [], fit.findings,
                  fit.as_dict())


def _stiffnesses(joints: Sequence[AxisStiffness]) -> ReportTable:
    """Stiffness of each joint, refused or not."""
    rows = [[f"k{joint.joint}", f"{1 / joint.compliance:.3g}",
             f"{joint.interval_95[0]:.3g} ... {joint.interval_95[1]:.3g}", joint.grade, joint.reason] for joint in joints]
    return ReportTable("Stiffness", ["joint", "k [N m/rad]", "95 % interval", "grade", "why"], rows, (1,))


def _every(count: int) -> slice:
    return slice(None, None, max(1, count // MOST_POINTS))


def _points(x: Any, y: Any, name: str, colour: str) -> dict[str, Any]:
    some = _every(len(x))
    return {"type": "scatter", "mode": "markers", "x": x[some], "y": y[some], "name": name,
            "marker": {"size": 4, "color": colour}}


def _torque(diagnosis: AxisDiagnosis) -> Figure:
    torque = np.concatenate([log.torque for log in diagnosis.axis.logs])
    spring = diagnosis.stiffness.compliance * (torque - torque.mean())
    data = [_points(torque, MICRO * (diagnosis.deflection - diagnosis.deflection.mean()), "as measured", BEFORE),
            _points(torque, MICRO * (spring + diagnosis.residuals[:, 1]), "without the named causes", AFTER)]
    return Figure(f"Joint {diagnosis.joint}: deflection against torque",
                  "A spring is a line; a cloud is not the spring alone.", data, {
        "xaxis": {"title": {"text": "gear-side torque [N m]"}, **GRID},
        "yaxis": {"title": {"text": "motor minus link [urad]"}, **GRID}})


def _time(diagnosis: AxisDiagnosis) -> Figure:
    time = np.concatenate([log.time for log in diagnosis.axis.logs])
    data = [_points(time, MICRO * diagnosis.residuals[:, k], name, colour) for k, (name, colour) in enumerate(
        (("plain spring", BEFORE), ("extended model", AFTER)))]
    return Figure(f"Joint {diagnosis.joint}: what is left, over time", "", data, {
        "xaxis": {"title": {"text": "time [s]"}, **GRID}, "yaxis": {"title": {"text": "residual [urad]"}, **GRID}})


def _spectrum(diagnosis: AxisDiagnosis) -> Figure:
    names = [f"{low:g}-{high:g} Hz" for low, high, _ in diagnosis.left.spectrum]
    shares = [100 * share for _, _, share in diagnosis.left.spectrum]
    frequency, share = diagnosis.left.line
    data = [{"type": "bar", "x": names, "y": shares, "marker": {"color": AFTER}}]
    return Figure(f"Joint {diagnosis.joint}: spectrum of what is left",
                  f"Strongest narrow line: {frequency:.1f} Hz with {100 * share:.0f} % of the variance.", data,
                  {"yaxis": {"title": {"text": "share of the variance [%]"}, **GRID}}, height=300)

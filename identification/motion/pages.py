"""The HTML reports of joint deflection logs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from identification.common.findings import Finding
from identification.common.report import Figure, ReportTable, render
from identification.motion.procedure import AxisDiagnosis, LogDiagnosis
from identification.motion.record import MICRO, sentence
from identification.motion.stiffness import AxisStiffness
from identification.motion.words import values

GRID = {"gridcolor": "#eee", "zerolinecolor": "#888"}
BEFORE, AFTER = "#c0392b", "#2b6ca3"
MOST_POINTS = 1500


def diagnosis_report(found: LogDiagnosis, lines: Sequence[str], findings: Sequence[Finding], content: dict[str, Any]) -> str:
    """The report of `diagnose` on a log."""
    rows = [[f"joint {one.joint}", cause.shape.name, sentence(cause), values(cause), f"{cause.probability:.3f}"]
            for one in found.axes for cause in (*one.causes, *one.alternatives)]
    tables = [ReportTable("Causes by probability", ["where", "effect", "in words", "parameters", "probability"], rows, (4,)),
              stiffness_rows([one.stiffness for one in found.axes])]
    figures = [figure for one in found.axes for figure in (_torque(one), _time(one), _spectrum(one))]
    return render(f"Diagnosis: {found.records[0].source}", lines, tables, figures, findings, content)


def stiffness_report(
    lines: Sequence[str], findings: Sequence[Finding], content: dict[str, Any], joints: list[AxisStiffness]
) -> str:
    """The report of `identify` on logs."""
    return render("Stiffness from joint deflection logs", lines, [stiffness_rows(joints)], [], findings, content)


def stiffness_rows(joints: list[AxisStiffness]) -> ReportTable:
    """Stiffness of each joint, refused or not."""
    rows = [[f"k{one.joint}", f"{1 / one.compliance:.3g}", f"{one.interval_95[0]:.3g} ... {one.interval_95[1]:.3g}", one.grade,
             one.reason] for one in joints]
    return ReportTable("Stiffness", ["joint", "k [N m/rad]", "95 % interval", "grade", "why"], rows, (1,))


def _every(count: int) -> slice:
    return slice(None, None, max(1, count // MOST_POINTS))


def _points(x: Any, y: Any, name: str, colour: str) -> dict[str, Any]:
    some = _every(len(x))
    return {"type": "scatter", "mode": "markers", "x": x[some], "y": y[some], "name": name,
            "marker": {"size": 4, "color": colour}}


def _torque(one: AxisDiagnosis) -> Figure:
    torque = np.concatenate([log.torque for log in one.axis.logs])
    spring = one.stiffness.compliance * (torque - torque.mean())
    data = [_points(torque, MICRO * (one.deflection - one.deflection.mean()), "as measured", BEFORE),
            _points(torque, MICRO * (spring + one.residuals[:, 1]), "without the named causes", AFTER)]
    return Figure(f"Joint {one.joint}: deflection against torque", "A spring is a line; a cloud is not the spring alone.",
                  data, {"xaxis": {"title": {"text": "gear-side torque [N m]"}, **GRID},
                         "yaxis": {"title": {"text": "motor minus link [urad]"}, **GRID}})


def _time(one: AxisDiagnosis) -> Figure:
    time = np.concatenate([log.time for log in one.axis.logs])
    data = [_points(time, MICRO * one.residuals[:, k], name, colour) for k, (name, colour) in enumerate(
        (("plain spring", BEFORE), ("extended model", AFTER)))]
    return Figure(f"Joint {one.joint}: what is left, over time", "", data, {
        "xaxis": {"title": {"text": "time [s]"}, **GRID}, "yaxis": {"title": {"text": "residual [urad]"}, **GRID}})


def _spectrum(one: AxisDiagnosis) -> Figure:
    names = [f"{low:g}-{high:g} Hz" for low, high, _ in one.left.spectrum]
    data = [{"type": "bar", "x": names, "y": [100 * share for _, _, share in one.left.spectrum], "marker": {"color": AFTER}}]
    return Figure(f"Joint {one.joint}: spectrum of what is left", f"Strongest narrow line: {one.left.line[0]:.1f} Hz with "
                  f"{100 * one.left.line[1]:.0f} % of the variance.", data,
                  {"yaxis": {"title": {"text": "share of the variance [%]"}, **GRID}}, height=300)

"""The report of `identify`: stiffnesses with grades, residuals, agreement of parts of the data, correlations."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from identification.common.report import AXES, AXIS_COLOURS, Figure, ReportTable, render
from identification.fit.fit import Fit
from identification.fit.visit_findings import mending
from identification.measurements import Measurements
from identification.model.cell import Cell


def identification_report(fit: Fit) -> str:
    """The report of `identify`."""
    cell, measurements, model = fit.cell, fit.measurements, fit.model
    grades = {grade: [f"k{i}" for i, g in enumerate(model.grades, start=1) if g == grade] for grade in model.grades}
    graded = "; ".join(f"{grade}: {', '.join(names)}" for grade, names in grades.items())
    noise = model.fit["noise"]
    offset = float(np.mean(noise["pose_offset_um"]))
    lead = [
        f"Six joint stiffnesses of {cell.robot.name} from {model.fit['rows']} rows ({graded}). The model leaves "
        f"{model.fit['residual_rms_um']:.2f} um RMS of the measured deflections unexplained. Noise, estimated: sensor "
        f"{noise['sensor_scale']:.2f} times what cell.yaml states, re-seating {offset:.1f} um a pose; the intervals use it. "
        f"{fit.ellipsoid.sentence[0].upper()}{fit.ellipsoid.sentence[1:]}.",
    ]
    conflicts = [conflict for conflict in fit.conflicts if conflict.is_conflict]
    if conflicts:
        lead.append(f"One set of linear springs does not explain all rows: {conflicts[0].part} and {conflicts[0].rest} want "
                    "different stiffnesses. See the table of subsets.")
    if fit.held_out is not None:
        lead.append(f"On the validation rows, which were not fitted: {1e6 * fit.held_out[0]:.1f} um RMS with the prior's "
                    f"stiffnesses, {1e6 * fit.held_out[1]:.1f} um with the identified ones.")
    rows = [[f"k{i}", f"{k:.4g}", f"{low:.4g} ... {high:.4g}", f"{100 * s:.1f} %", f"{p:.3g}", grade.grade,
             grade.reason + (f"; {grade.helpful}" if grade.helpful else "")]
            for i, (k, (low, high), s, p, grade) in enumerate(zip(
                model.stiffness, model.interval_95, model.log_std, cell.prior.stiffness, fit.grades, strict=True), 1)]
    tables = [
        ReportTable("Stiffnesses", ["joint", "k [N m/rad]", "95 % interval", "std of ln k", "prior median", "grade", "why"],
                    rows, numbers=(1, 2, 3, 4)),
        ReportTable("Do parts of the data agree?",
                    ["rows", "against", "Mahalanobis distance", "directions", "p, corrected", ""],
                    [[c.part, c.rest, f"{c.distance:.1f}", f"{c.directions}", f"{c.corrected:.2g}",
                      "conflict" if c.is_conflict else "agree"] for c in fit.conflicts], numbers=(2, 3, 4)),
    ]
    if fit.bad_visits:
        tables.append(ReportTable("Poses left out: their readings fit no stiffness that fits the others",
                                  ["pose", "first line", "p", "share of the misfit", "what would mend it"],
                                  [[bad.score.name, f"{bad.score.line}", f"{bad.score.p_value:.2g}",
                                    f"{100 * bad.score.share:.0f} %", mending(bad)] for bad in fit.bad_visits],
                                  numbers=(1, 2, 3)))
    light = np.flatnonzero(fit.row_weight < 0.999)
    if len(light):
        order = light[np.argsort(fit.row_weight[light])][:20]
        tables.append(ReportTable("Rows that count less", ["line", "weight"], [
            [f"{measurements.line[i]}", f"{100 * fit.row_weight[i]:.0f} %"] for i in order], numbers=(0, 1)))
    figures = [_intervals(cell, fit), _residuals(measurements, fit), _by_pose(measurements, fit), _against(measurements, fit),
               _correlations(fit), _spectrum(fit)]
    if fit.profiles:
        figures.insert(1, _profiles(fit))
    return render(f"Identified stiffnesses: {Path(measurements.source).name}", lead, tables, figures, fit.findings,
                  fit.as_dict())


def _intervals(cell: Cell, fit: Fit) -> Figure:
    model, joints = fit.model, [f"k{i}" for i in range(1, 7)]
    low, high = model.interval_95.T
    spread = np.exp(1.96 * cell.prior.log_std)
    prior = cell.prior.stiffness
    data = [
        {"type": "scatter", "mode": "markers", "x": joints, "y": prior, "name": "prior, 95 %",
         "marker": {"color": "#bbb", "size": 9, "symbol": "line-ew-open"},
         "error_y": {"type": "data", "symmetric": False, "array": prior * spread - prior,
                     "arrayminus": prior - prior / spread, "color": "#ccc", "thickness": 6, "width": 0}},
        {"type": "scatter", "mode": "markers", "x": joints, "y": model.stiffness, "name": "identified, 95 %",
         "marker": {"color": "#2b6ca3", "size": 9},
         "error_y": {"type": "data", "symmetric": False, "array": high - model.stiffness,
                     "arrayminus": model.stiffness - low, "color": "#2b6ca3"}},
    ]
    layout = {"yaxis": {"type": "log", "title": {"text": "stiffness [N m/rad]"}, "gridcolor": "#eee"}}
    return Figure("Stiffness with its interval", "Grey: what was known before. Blue: after the measurements.", data, layout)


def _residuals(measurements: Measurements, fit: Fit) -> Figure:
    row = np.arange(len(measurements))
    thinned = row if len(row) <= 5000 else np.unique(np.linspace(0, len(row) - 1, 5000).astype(int))
    data: list[dict[str, Any]] = [
        {"type": "scatter", "mode": "markers", "x": measurements.line[thinned], "y": 1e6 * fit.residual[thinned, axis],
         "name": f"{AXES[axis]}", "marker": {"size": 6, "color": AXIS_COLOURS[axis]}} for axis in range(3)]
    share = fit.residual / fit.std
    inside = 100 * float(np.nanmean(np.abs(share) <= 1.96))
    data += [{"type": "scatter", "mode": "lines", "x": measurements.line[thinned], "y": sign * 1.96e6 * fit.std[thinned, 2],
              "line": {"color": "#2b6ca3", "width": 1, "shape": "hvh"}, "showlegend": sign > 0, "name": "95 %, z",
              "hoverinfo": "skip"} for sign in (1, -1)]
    layout = {
        "xaxis": {"title": {"text": "line of the measurement file"}, "gridcolor": "#eee"},
        "yaxis": {"title": {"text": "measured minus predicted [um]"}, "gridcolor": "#eee", "zerolinecolor": "#888"},
    }
    note = "" if len(thinned) == len(row) else f" {len(thinned)} of {len(row)} rows are drawn, evenly spaced."
    return Figure("Residuals in the order of the rows", "Lines: 95 % of the estimated noise (sensor, force error, "
                  f"re-seating), drawn for z; {inside:.0f} % of all components are inside their own." + note, data, layout)


def _by_pose(measurements: Measurements, fit: Fit) -> Figure:
    visits = np.unique(measurements.visit)[:2000]
    names = [f"{int(measurements.line[measurements.visit == visit][0])}" for visit in visits]
    data = []
    for axis in range(3):
        rms = [1e6 * float(np.sqrt(np.mean(np.nan_to_num(fit.residual[measurements.visit == visit, axis]) ** 2)))
               for visit in visits]
        data.append({"type": "bar", "x": names, "y": rms, "name": AXES[axis], "marker": {"color": AXIS_COLOURS[axis]}})
    layout = {"barmode": "group", "xaxis": {"title": {"text": "pose, by the line of its first row"}, "type": "category"},
              "yaxis": {"title": {"text": "residual RMS [um]"}, "gridcolor": "#eee"}}
    return Figure("Residual by pose and axis", "A pose or an axis that stands out points to what the model leaves out.", data,
                  layout)


def _correlations(fit: Fit) -> Figure:
    std, joints = fit.model.log_std, [f"k{i}" for i in range(1, 7)]
    matrix = fit.model.covariance / np.outer(std, std)
    data = [{"type": "heatmap", "x": joints, "y": joints, "z": matrix, "zmin": -1, "zmax": 1, "colorscale": "RdBu",
             "reversescale": True, "text": [[f"{value:.2f}" for value in row] for row in matrix], "texttemplate": "%{text}"}]
    return Figure("Correlations of ln k", fit.ellipsoid.sentence[0].upper() + fit.ellipsoid.sentence[1:] + ".", data,
                  {"yaxis": {"autorange": "reversed"}})


def _spectrum(fit: Fit) -> Figure:
    data = [{"type": "bar", "x": [f"{i}" for i in range(1, 7)], "y": np.maximum(fit.spectrum, 1e-6),
             "marker": {"color": "#2b6ca3"}}]
    layout = {"yaxis": {"type": "log", "title": {"text": "information of the data over the prior's"}, "gridcolor": "#eee"},
              "xaxis": {"title": {"text": "direction, best known first"}},
              "shapes": [{"type": "line", "xref": "paper", "x0": 0, "x1": 1, "y0": 1, "y1": 1,
                          "line": {"color": "#b33", "dash": "dot"}}]}
    return Figure("Information spectrum", "Below the dotted line the prior says more than the data.", data, layout)


def _profiles(fit: Fit) -> Figure:
    data: list[dict[str, Any]] = [
        {"type": "scatter", "mode": "lines", "x": profile.stiffness, "y": np.minimum(profile.drop, 10),
         "name": f"k{profile.joint}: {profile.kind}"} for profile in fit.profiles]
    layout = {"xaxis": {"type": "log", "title": {"text": "stiffness [N m/rad]"}, "gridcolor": "#eee"},
              "yaxis": {"title": {"text": "drop of ln likelihood"}, "gridcolor": "#eee"},
              "shapes": [{"type": "line", "xref": "paper", "x0": 0, "x1": 1, "y0": 1.92, "y1": 1.92,
                          "line": {"color": "#b33", "dash": "dot"}}]}
    return Figure("Profile likelihood", "What the data alone say, without the prior; the dotted line bounds the 95 % interval.",
                  data, layout)


def _against(measurements: Measurements, fit: Fit) -> Figure:
    predicted = measurements.deflection - fit.residual
    data: list[dict[str, Any]] = []
    for name, rows, symbol in (("fitted", ~measurements.validate, "circle"), ("validation", measurements.validate, "x")):
        picked = np.flatnonzero(rows)[:: max(1, int(rows.sum()) // 3000)]
        data += [{"type": "scatter", "mode": "markers", "x": 1e6 * predicted[picked, axis],
                  "y": 1e6 * measurements.deflection[picked, axis], "name": f"{AXES[axis]}, {name}",
                  "marker": {"size": 6, "symbol": symbol, "color": AXIS_COLOURS[axis]}} for axis in range(3) if len(picked)]
    reach = 1.05e6 * float(np.nanmax(np.abs(predicted), initial=0.0))
    data.append({"type": "scatter", "mode": "lines", "x": [-reach, reach], "y": [-reach, reach], "showlegend": False,
                 "line": {"color": "#999", "width": 1}})
    layout = {"xaxis": {"title": {"text": "predicted deflection [um]"}, "gridcolor": "#eee"},
              "yaxis": {"title": {"text": "measured deflection [um]"}, "gridcolor": "#eee"}}
    return Figure("Measured against predicted", "Points on the line are explained by the model.", data, layout)

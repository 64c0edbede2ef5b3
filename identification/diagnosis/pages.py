"""The report of `diagnose`: what is wrong, the cause in plain words, its signature in the residual, the gain, what is next."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.common.findings import Finding
from identification.common.report import AXES, AXIS_COLOURS, Figure, ReportTable, render
from identification.diagnosis.gain import pose_names, poses
from identification.diagnosis.procedure import Diagnosis
from identification.diagnosis.record import (
    conflicts,
    expected_std,
    extended_residual,
    next_words,
    plain_residual,
    record,
    summary,
    value,
)
from identification.fit.fitted_model import added, situation_of
from identification.measurements import Measurements
from identification.model.cell import Cell

Array = NDArray[np.float64]
GRID = {"gridcolor": "#eee", "zerolinecolor": "#888"}
BEFORE, AFTER = "#c0392b", "#2b6ca3"
MOST_POINTS = 3000


def diagnosis_report(cell: Cell, measurements: Measurements, found: Diagnosis, findings: Sequence[Finding]) -> str:
    """The report of `diagnose`."""
    content = record(cell, measurements, found)
    before, after = plain_residual(cell, found), extended_residual(cell, found)
    allowed = expected_std(cell, found)
    tables = [table for table in (_causes(content), _ranking(found), _next(content), _parts(cell, found)) if table is not None]
    named = found.verdict == "named"
    figures = [_in_order(found, before, after if named else None, allowed),
               _by_pose(found, before, after if named else None, allowed), _by_load(found, before)]
    if named:
        figures.insert(0, _signature(cell, found))
    if found.gain is not None:
        figures.append(_held_out(found))
    figures.append(_patterns(found))
    return render(f"Diagnosis: {Path(measurements.source).name}", summary(cell, found), tables, figures, findings, content)


def _causes(content: dict[str, Any]) -> ReportTable | None:
    rows = [[cause["effect"] + (f" of joint {cause['joint']}" if cause["joint"] else ""), cause["sentence"], name, value(item),
             "corrected along the path" if cause["of_robot"] else "taken out of the data, not carried into the correction"]
            for cause in content["causes"] for name, item in cause["parameters"].items()]
    return ReportTable("The cause", ["effect", "in words", "parameter", "estimate", "what is done"], rows) if rows else None


def _ranking(found: Diagnosis) -> ReportTable | None:
    ranked = [*found.causes, *found.alternatives][:12]
    if not ranked:
        return None
    title = {"unknown": "Nearest names, none of which is enough", "ambiguous": "What it may be"}.get(
        found.verdict, "Causes by probability")
    return ReportTable(title, ["effect", "probability", "family", "in words"], [
        [cause.label, f"{cause.probability:.3f}", cause.effect.family, cause.sentence] for cause in ranked], numbers=(1,))


def _next(content: dict[str, Any]) -> ReportTable | None:
    rows = [list(next_words(item)) for item in content["next_measurements"]]
    return ReportTable("What to measure next", ["do", "it tells"], rows) if rows else None


def _parts(cell: Cell, found: Diagnosis) -> ReportTable | None:
    rows = [[one.part, one.rest, f"{one.distance:.1f}", f"{one.corrected:.2g}"]
            for one in conflicts(cell, found) if one.is_conflict][:8]
    header = ["rows", "against", "Mahalanobis distance", "p, corrected"]
    return ReportTable("Parts of the data that want different springs", header, rows, numbers=(2, 3)) if rows else None


def _thinned(count: int) -> NDArray[np.intp]:
    return np.arange(0, count, max(1, count // MOST_POINTS), dtype=np.intp)


def _in_order(found: Diagnosis, before: Array, after: Array | None, allowed: Array) -> Figure:
    """Residuals by row, one panel an axis."""
    rows = _thinned(len(before))
    line = found.rows.line[rows]
    data: list[dict[str, Any]] = []
    layout: dict[str, Any] = {"grid": {"rows": 3, "columns": 1, "pattern": "independent"},
                              "xaxis3": {"title": {"text": "line of the measurement file"}}}
    for axis in range(3):
        place = {"xaxis": f"x{axis + 1}", "yaxis": f"y{axis + 1}", "showlegend": axis == 0}
        edge = 1.96e6 * allowed[rows, axis]
        data += [
            {"type": "scatter", "mode": "lines", "x": line, "y": edge, "line": {"width": 0}, "hoverinfo": "skip", **place,
             "showlegend": False},
            {"type": "scatter", "mode": "lines", "x": line, "y": -edge, "line": {"width": 0}, "fill": "tonexty",
             "fillcolor": "#e8e8e8", "name": "95 % of the noise", "hoverinfo": "skip", **place},
            {"type": "scatter", "mode": "markers", "x": line, "y": 1e6 * before[rows, axis], "name": "plain model",
             "marker": {"size": 5, "color": BEFORE}, **place}]
        if after is not None:
            data.append({"type": "scatter", "mode": "markers", "x": line, "y": 1e6 * after[rows, axis],
                         "name": "extended model", "marker": {"size": 5, "color": AFTER}, **place})
        layout[f"yaxis{axis + 1}"] = {"title": {"text": f"{AXES[axis]} [um]"}, **GRID}
    return Figure("What the model leaves, in the order of the rows", "Grey: what the noise allows.", data, layout, height=620)


def _by_pose(found: Diagnosis, before: Array, after: Array | None, allowed: Array) -> Figure:
    groups, names = poses(found.rows), pose_names(found.rows)
    # P2 before P10.
    order = sorted(names, key=lambda name: [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", name)])

    def grouped(values: Array) -> list[float]:
        return [1e6 * float(np.sqrt(np.nanmean(values[groups == g] ** 2))) for g in range(len(names))]

    data: list[dict[str, Any]] = [{"type": "bar", "x": names, "y": grouped(before), "name": "plain model",
                                   "marker": {"color": BEFORE}}]
    if after is not None:
        data.append({"type": "bar", "x": names, "y": grouped(after), "name": "extended model", "marker": {"color": AFTER}})
    data.append({"type": "scatter", "mode": "lines+markers", "x": names, "y": grouped(allowed), "name": "the noise allows",
                 "line": {"color": "#888", "dash": "dot"}})
    return Figure("By pose", "RMS of what is left at each pose.", data, {
        "barmode": "group", "xaxis": {"type": "category", "categoryorder": "array", "categoryarray": order},
        "yaxis": {"title": {"text": "RMS [um]"}, **GRID}})


def _by_load(found: Diagnosis, before: Array) -> Figure:
    """Residual against the load with the sign of its largest component."""
    force = found.rows.wrench[:, :3]
    axis = np.argmax(np.abs(force), axis=1)
    along = force[np.arange(len(force)), axis]
    rows = _thinned(len(before))
    data = [{"type": "scatter", "mode": "markers", "x": along[rows], "y": 1e6 * before[rows, k], "name": f"reading {AXES[k]}",
             "marker": {"size": 6, "color": AXIS_COLOURS[k]},
             "text": [f"load along {AXES[a]}" for a in axis[rows]]} for k in range(3)]
    return Figure("By load", "What the plain model leaves against the load: a bend is a gear that is not linear, a loop "
                  "one that does not come back the way it went.", data, {
                      "xaxis": {"title": {"text": "load along its main axis [N]"}, **GRID},
                      "yaxis": {"title": {"text": "measured minus plain model [um]"}, **GRID}})


def _signature(cell: Cell, found: Diagnosis) -> Figure:
    """The named causes' contribution against what the springs alone leave."""
    model = found.extended
    here = situation_of(cell, found.rows, np.exp(model.map[:6]))
    expected = added(here, model.terms, model.map)
    left = extended_residual(cell, found) + expected
    rows = _thinned(len(left))
    data: list[dict[str, Any]] = [
        {"type": "scatter", "mode": "markers", "x": 1e6 * expected[rows, k], "y": 1e6 * left[rows, k],
         "name": f"reading {AXES[k]}", "marker": {"size": 6, "color": AXIS_COLOURS[k]}} for k in range(3)]
    reach = 1.05e6 * float(np.abs(expected).max(initial=1e-9))
    data.append({"type": "scatter", "mode": "lines", "x": [-reach, reach], "y": [-reach, reach], "showlegend": False,
                 "line": {"color": "#999", "width": 1}})
    return Figure("The cause over what the springs leave", "On the line: explained by "
                  + " and ".join(cause.label for cause in found.causes) + ". The scatter about it is noise.", data, {
                      "xaxis": {"title": {"text": "the named cause gives [um]"}, **GRID},
                      "yaxis": {"title": {"text": "measured minus springs [um]"}, **GRID}})


def _held_out(found: Diagnosis) -> Figure:
    gain = found.gain
    assert gain is not None
    data = [{"type": "bar", "x": gain.poses, "y": 1e6 * gain.by_pose[k], "name": name, "marker": {"color": colour}}
            for k, (name, colour) in enumerate((("plain model", BEFORE), ("extended model", AFTER)))]
    return Figure("On rows that were not fitted", f"{gain.held_out}: {1e6 * gain.before:.2f} um RMS with the plain model, "
                  f"{1e6 * gain.after:.2f} um with the extended one (ratio {gain.ratio:.2f}, 95 % {gain.interval[0]:.2f} to "
                  f"{gain.interval[1]:.2f}).", data, {
                      "barmode": "group", "xaxis": {"type": "category"}, "yaxis": {"title": {"text": "RMS [um]"}, **GRID}})


def _patterns(found: Diagnosis) -> Figure:
    """How surprising each pattern is, plain and extended, with the level that 5 % of noise reaches."""
    names = sorted(found.detection.patterns, key=lambda name: found.detection.patterns[name])
    shown = [("plain model", found.detection, BEFORE)]
    if found.adequacy is not None:
        shown.append(("best extended model", found.adequacy, AFTER))
    data = [{"type": "bar", "orientation": "h", "y": names, "x": [one.patterns.get(name, 0.0) for name in names], "name": title,
             "marker": {"color": colour}} for title, one, colour in shown]
    layout = {"barmode": "group", "margin": {"l": 380, "r": 20, "t": 30, "b": 50},
              "xaxis": {"title": {"text": "surprise: -log10 of its probability"}, **GRID},
              "shapes": [{"type": "line", "yref": "paper", "y0": 0, "y1": 1, "x0": found.detection.critical,
                          "x1": found.detection.critical, "line": {"color": "#888", "dash": "dot"}}]}
    return Figure("Patterns that noise does not make", "Dotted: what 5 % of data sets without any fault would show in the "
                  "largest of all tests.", data, layout, height=460)

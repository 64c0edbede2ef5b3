"""The report of `diagnose`: what is wrong, the cause in plain words, how it shows in the residual, the gain, what is next."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.common.arrays import rms
from identification.common.report import AXES, AXIS_COLOURS, Figure, ReportTable, render
from identification.diagnosis.diagnose import Diagnosis
from identification.diagnosis.gain import Gain
from identification.diagnosis.judgement import Judgement
from identification.diagnosis.record import next_words, value
from identification.fit.held_out import pose_names, poses
from identification.measurements import Measurements
from identification.model.effects_in_force import EFFECTS, added

Array = NDArray[np.float64]
GRID = {"gridcolor": "#eee", "zerolinecolor": "#888"}
BEFORE, AFTER = "#c0392b", "#2b6ca3"
MOST_POINTS = 3000


def diagnosis_report(diagnosis: Diagnosis) -> str:
    """The report of `diagnose`."""
    content, judgement = diagnosis.as_dict(), diagnosis.judgement
    named = diagnosis.verdict == "named"
    before, allowed = judgement.plain.residual, judgement.expected_std
    after = judgement.extended.residual if named else None
    tables = [table for table in (_mistakes(judgement), _causes(content), _ranking(judgement), _next(content),
                                  _parts(judgement)) if table]
    figures = [_in_order(judgement.rows, before, after, allowed), _by_pose(judgement.rows, before, after, allowed),
               _by_load(judgement.rows, before)]
    if named:
        figures.insert(0, _explained(judgement))
    if judgement.gain is not None:
        figures.append(_held_out(judgement.gain))
    figures.append(_patterns(judgement))
    return render(f"Diagnosis: {Path(diagnosis.measurements.source).name}", diagnosis.lines(), tables, figures,
                  diagnosis.findings, content)


def _mistakes(judgement: Judgement) -> ReportTable | None:
    rows = [[mistake.key, mistake.sentence, f"{1e6 * mistake.before:.2f}", f"{1e6 * mistake.after:.2f}",
             mistake.candidate.mistake.settles] for mistake in judgement.mistakes]
    header = ["mistake", "in words", "RMS of poses predicted from the others [um]", "with it mended", "what settles it"]
    return ReportTable("Mistakes in the files", header, rows, numbers=(2, 3)) if rows else None


def _causes(content: dict[str, Any]) -> ReportTable | None:
    rows = [[cause["effect"] + (f" of joint {cause['joint']}" if cause["joint"] else ""), cause["sentence"], name, value(item),
             "corrected along the path" if cause["of_robot"] else "taken out of the data, not carried into the correction"]
            for cause in content["causes"] for name, item in cause["parameters"].items()]
    return ReportTable("The cause", ["effect", "in words", "parameter", "estimate", "what is done"], rows) if rows else None


def _ranking(judgement: Judgement) -> ReportTable | None:
    ranked = [*judgement.causes, *judgement.alternatives][:12]
    if not ranked:
        return None
    title = {"unknown": "Nearest names, none of which is enough", "ambiguous": "What it may be"}.get(
        judgement.verdict, "Causes by probability")
    return ReportTable(title, ["effect", "probability", "family", "in words"], [
        [cause.label, f"{cause.probability:.3f}", cause.effect.family, cause.sentence] for cause in ranked], numbers=(1,))


def _next(content: dict[str, Any]) -> ReportTable | None:
    rows = [list(next_words(item)) for item in content["next_measurements"]]
    return ReportTable("What to measure next", ["do", "it tells"], rows) if rows else None


def _parts(judgement: Judgement) -> ReportTable | None:
    rows = [[conflict.part, conflict.rest, f"{conflict.distance:.1f}", f"{conflict.corrected:.2g}"]
            for conflict in judgement.conflicts][:8]
    header = ["rows", "against", "Mahalanobis distance", "p, corrected"]
    return ReportTable("Parts of the data that want different springs", header, rows, numbers=(2, 3)) if rows else None


def _thinned(count: int) -> NDArray[np.intp]:
    return np.arange(0, count, max(1, count // MOST_POINTS), dtype=np.intp)


def _in_order(rows: Measurements, before: Array, after: Array | None, allowed: Array) -> Figure:
    """Residuals by row, one panel an axis."""
    shown = _thinned(len(before))
    line = rows.line[shown]
    data: list[dict[str, Any]] = []
    layout: dict[str, Any] = {"grid": {"rows": 3, "columns": 1, "pattern": "independent"},
                              "xaxis3": {"title": {"text": "line of the measurement file"}}}
    for axis in range(3):
        place = {"xaxis": f"x{axis + 1}", "yaxis": f"y{axis + 1}", "showlegend": axis == 0}
        edge = 1.96e6 * allowed[shown, axis]
        data += [
            {"type": "scatter", "mode": "lines", "x": line, "y": edge, "line": {"width": 0}, "hoverinfo": "skip", **place,
             "showlegend": False},
            {"type": "scatter", "mode": "lines", "x": line, "y": -edge, "line": {"width": 0}, "fill": "tonexty",
             "fillcolor": "#e8e8e8", "name": "95 % of the noise", "hoverinfo": "skip", **place},
            {"type": "scatter", "mode": "markers", "x": line, "y": 1e6 * before[shown, axis], "name": "plain model",
             "marker": {"size": 5, "color": BEFORE}, **place}]
        if after is not None:
            data.append({"type": "scatter", "mode": "markers", "x": line, "y": 1e6 * after[shown, axis],
                         "name": "extended model", "marker": {"size": 5, "color": AFTER}, **place})
        layout[f"yaxis{axis + 1}"] = {"title": {"text": f"{AXES[axis]} [um]"}, **GRID}
    return Figure("What the model leaves, in the order of the rows", "Grey: what the noise allows.", data, layout, height=620)


def _by_pose(rows: Measurements, before: Array, after: Array | None, allowed: Array) -> Figure:
    groups, names = poses(rows), pose_names(rows)
    # P2 before P10.
    order = sorted(names, key=lambda name: [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", name)])

    def grouped(values: Array) -> list[float]:
        return [1e6 * rms(values[groups == g]) for g in range(len(names))]

    data: list[dict[str, Any]] = [{"type": "bar", "x": names, "y": grouped(before), "name": "plain model",
                                   "marker": {"color": BEFORE}}]
    if after is not None:
        data.append({"type": "bar", "x": names, "y": grouped(after), "name": "extended model", "marker": {"color": AFTER}})
    data.append({"type": "scatter", "mode": "lines+markers", "x": names, "y": grouped(allowed), "name": "the noise allows",
                 "line": {"color": "#888", "dash": "dot"}})
    return Figure("By pose", "RMS of what is left at each pose.", data, {
        "barmode": "group", "xaxis": {"type": "category", "categoryorder": "array", "categoryarray": order},
        "yaxis": {"title": {"text": "RMS [um]"}, **GRID}})


def _by_load(rows: Measurements, before: Array) -> Figure:
    """Residual against the load with the sign of its largest component."""
    force = rows.wrench[:, :3]
    axis = np.argmax(np.abs(force), axis=1)
    along = force[np.arange(len(force)), axis]
    shown = _thinned(len(before))
    data = [{"type": "scatter", "mode": "markers", "x": along[shown], "y": 1e6 * before[shown, k], "name": f"reading {AXES[k]}",
             "marker": {"size": 6, "color": AXIS_COLOURS[k]},
             "text": [f"load along {AXES[a]}" for a in axis[shown]]} for k in range(3)]
    return Figure("By load", "What the plain model leaves against the load: a bend is a gear that is not linear, a loop "
                  "one that does not come back the way it went.", data, {
                      "xaxis": {"title": {"text": "load along its main axis [N]"}, **GRID},
                      "yaxis": {"title": {"text": "measured minus plain model [um]"}, **GRID}})


def _explained(judgement: Judgement) -> Figure:
    """The named causes' contribution against what the springs alone leave."""
    model = judgement.extended
    expected = added(model.load_state, model.terms, model.map[EFFECTS])[:, :3]
    left = model.residual + expected
    shown = _thinned(len(left))
    data: list[dict[str, Any]] = [
        {"type": "scatter", "mode": "markers", "x": 1e6 * expected[shown, k], "y": 1e6 * left[shown, k],
         "name": f"reading {AXES[k]}", "marker": {"size": 6, "color": AXIS_COLOURS[k]}} for k in range(3)]
    reach = 1.05e6 * float(np.abs(expected).max(initial=1e-9))
    data.append({"type": "scatter", "mode": "lines", "x": [-reach, reach], "y": [-reach, reach], "showlegend": False,
                 "line": {"color": "#999", "width": 1}})
    return Figure("The cause over what the springs leave", "On the line: explained by "
                  + " and ".join(cause.label for cause in judgement.causes) + ". The scatter about it is noise.", data, {
                      "xaxis": {"title": {"text": "the named cause gives [um]"}, **GRID},
                      "yaxis": {"title": {"text": "measured minus springs [um]"}, **GRID}})


def _held_out(gain: Gain) -> Figure:
    data = [{"type": "bar", "x": gain.poses, "y": 1e6 * gain.by_pose[k], "name": name, "marker": {"color": colour}}
            for k, (name, colour) in enumerate((("plain model", BEFORE), ("extended model", AFTER)))]
    return Figure("On rows that were not fitted", f"{gain.held_out}: {1e6 * gain.before:.2f} um RMS with the plain model, "
                  f"{1e6 * gain.after:.2f} um with the extended one (ratio {gain.ratio:.2f}, 95 % {gain.interval[0]:.2f} to "
                  f"{gain.interval[1]:.2f}).", data, {
                      "barmode": "group", "xaxis": {"type": "category"}, "yaxis": {"title": {"text": "RMS [um]"}, **GRID}})


def _patterns(judgement: Judgement) -> Figure:
    """How surprising each pattern is, plain and extended, with the level that 5 % of noise reaches."""
    names = sorted(judgement.detection.patterns, key=lambda name: judgement.detection.patterns[name])
    shown = [("plain model", judgement.detection, BEFORE)]
    if judgement.adequacy is not None:
        shown.append(("best extended model", judgement.adequacy, AFTER))
    data = [{"type": "bar", "orientation": "h", "y": names, "x": [detection.patterns.get(name, 0.0) for name in names],
             "name": title, "marker": {"color": colour}} for title, detection, colour in shown]
    layout = {"barmode": "group", "margin": {"l": 380, "r": 20, "t": 30, "b": 50},
              "xaxis": {"title": {"text": "surprise: -log10 of its probability"}, **GRID},
              "shapes": [{"type": "line", "yref": "paper", "y0": 0, "y1": 1, "x0": judgement.detection.critical,
                          "x1": judgement.detection.critical, "line": {"color": "#888", "dash": "dot"}}]}
    return Figure("Patterns that noise does not make", "Dotted: what 5 % of data sets without any fault would show in the "
                  "largest of all tests.", data, layout, height=460)

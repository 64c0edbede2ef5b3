"""The report of `verify`: the deviation along the path before and after, and measured against predicted."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from compensator.verification.comparison import Figures, Scale
from compensator.verification.verify import Verification
from identification.common.report import AXIS_COLOURS, Figure, ReportTable, render

BEFORE, AFTER = "#c0392b", "#2b6ca3"
GRID = {"gridcolor": "#eee", "zerolinecolor": "#888"}
# What a browser draws fluently; of more points every so-manieth is drawn.
MOST_POINTS = 20_000


def verify_report(result: Verification) -> str:
    """The report of one pair of measured passes."""
    comparison = result.comparison
    rows = [_row("size", comparison.before, comparison.after)]
    rows += [_row(f"along {name}", *pair) for name, pair in comparison.by_axis.items()]
    tables = [ReportTable("Before and after [um]", ["deviation", "places", "RMS", "mean", "95 % are below", "largest"], rows,
                          numbers=(1, 2, 3, 4, 5))]
    figures = [_along(result)]
    if result.scale is not None:
        scales = {"overall": result.scale, **{f"along {name}": scale for name, scale in result.axis_scales.items()}}
        tables.append(ReportTable(
            "Measured before against predicted", ["", "places", "scale (95 %)", "explained as it stands", "with the scale",
                                                  "left, RMS [um]"],
            [_scale_row(name, scale) for name, scale in scales.items()], numbers=(1, 2, 3, 4, 5)))
        figures.append(_against(result))
    return render(f"Verified: {Path(result.before.source).name} and {Path(result.after.source).name}", result.lines(), tables,
                  figures, result.findings, result.as_dict())


def _row(name: str, before: Figures, after: Figures) -> list[str]:
    return [name, f"{before.points}", *(f"{x:.1f} → {y:.1f}" for x, y in (
        (before.rms_um, after.rms_um), (before.mean_um, after.mean_um), (before.p95_um, after.p95_um),
        (before.max_um, after.max_um)))]


def _scale_row(name: str, scale: Scale) -> list[str]:
    between = f" ({scale.interval[0]:.3f} ... {scale.interval[1]:.3f})" if scale.interval else ""
    return [name, f"{scale.points}", f"{scale.scale:.3f}{between}", f"{100 * scale.share:.1f} %",
            f"{100 * scale.share_scaled:.1f} %", f"{scale.residual_rms_um:.1f}"]


def _along(result: Verification) -> Figure:
    before, after = result.before.select(result.rows_before), result.after.select(result.rows_after)
    step = -(-len(before) // MOST_POINTS)
    if before.key == "x_mm y_mm z_mm":
        place, title = np.arange(len(before), dtype=float), "place, in the order of the first file"
    else:
        unit, title = (1.0, "target") if before.key == "target" else (1e3, "path length [mm]")
        place = unit * before.place[:, 0]
    data: list[dict[str, Any]] = [
        {"type": "scatter", "mode": "lines", "x": place[::step], "y": 1e6 * readings.size[::step], "name": name,
         "line": {"color": colour, "width": 1.5}}
        for readings, name, colour in ((before, "before", BEFORE), (after, "after", AFTER))]
    layout: dict[str, Any] = {"xaxis": {"title": {"text": title}, **GRID},
                              "yaxis": {"title": {"text": "size of the deviation [um]"}, "rangemode": "tozero", **GRID}}
    if result.tolerance_um is not None:
        layout["shapes"] = [{"type": "line", "xref": "paper", "x0": 0, "x1": 1, "y0": result.tolerance_um,
                             "y1": result.tolerance_um, "line": {"color": "#222", "width": 1, "dash": "dash"}}]
    caption = "Size of the measured components at the places measured in both passes." + (
        " Dashed: the tolerance." if result.tolerance_um is not None else "") + (
        f" Every {step}th place is drawn." if step > 1 else "")
    return Figure("Measured deviation along the path", caption, data, layout)


def _against(result: Verification) -> Figure:
    assert result.predicted is not None
    assert result.scale is not None
    predicted, measured = 1e6 * result.predicted, 1e6 * result.before.deviation
    step = -(-len(predicted) // MOST_POINTS)
    data: list[dict[str, Any]] = [
        {"type": "scatter", "mode": "markers", "x": predicted[::step, axis], "y": measured[::step, axis], "name": name,
         "marker": {"size": 4, "color": AXIS_COLOURS[axis], "opacity": 0.6}} for axis, name in enumerate(result.before.axes)]
    known = predicted[np.isfinite(predicted)]
    ends = np.array([known.min(), known.max()])
    for slope, name, dash in ((1.0, "as predicted", "dot"), (result.scale.scale, f"scale {result.scale.scale:.3f}", "solid")):
        data.append({"type": "scatter", "mode": "lines", "x": ends, "y": slope * ends, "name": name,
                     "line": {"color": "#222", "width": 1.5, "dash": dash}})
    layout = {"xaxis": {"title": {"text": "predicted deviation [um]"}, **GRID},
              "yaxis": {"title": {"text": "measured before [um]"}, **GRID}}
    caption = "Every measured component before the correction against its prediction." + (
        f" Every {step}th place is drawn." if step > 1 else "")
    return Figure("Measured against predicted", caption, data, layout)

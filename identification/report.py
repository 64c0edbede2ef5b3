"""The report frame both packages use, and the report of `identify`: one HTML file that opens offline."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.cell import Cell
from identification.findings import Finding, fold
from identification.inference import Fit
from identification.measurements import Measurements

Array = NDArray[np.float64]
TEMPLATE = Path(__file__).parent / "report.html.j2"
AXES = "xyz"
AXIS_COLOURS = ("#1f77b4", "#e07b00", "#2a9d4a")


@dataclass(frozen=True)
class Figure:
    """A plotly figure as plain data: title above, caption below it."""

    title: str
    caption: str
    data: list[dict[str, Any]]
    layout: dict[str, Any]
    height: int = 420

    @property
    def json(self) -> str:
        """The figure for the page; NaN becomes null."""
        base = {"margin": {"l": 70, "r": 20, "t": 30, "b": 50}, "plot_bgcolor": "#fff", "height": self.height}
        return _embedded({"data": self.data, "layout": base | self.layout})


@dataclass(frozen=True)
class ReportTable:
    """A real HTML table; `numbers` are the columns set right-aligned."""

    title: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    numbers: Sequence[int] = field(default=())


def _embedded(content: Any) -> str:
    """JSON that may stand inside a script element."""
    def plain(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: plain(item) for key, item in value.items()}
        if isinstance(value, np.ndarray):
            return plain(value.tolist())
        if isinstance(value, list | tuple):
            return [plain(item) for item in value]
        if isinstance(value, float | np.floating):
            return float(value) if np.isfinite(value) else None
        return value.item() if isinstance(value, np.generic) else value

    return json.dumps(plain(content), allow_nan=False).replace("</", "<\\/")


def render(
    title: str, lead: Sequence[str], tables: Sequence[ReportTable], figures: Sequence[Figure],
    findings: Sequence[Finding], result: dict[str, Any],
) -> str:
    """The page: plain words first, then tables, figures, findings; the JSON result embedded."""
    import jinja2
    from plotly.offline import get_plotlyjs

    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined)
    return environment.from_string(TEMPLATE.read_text(encoding="utf-8")).render(
        title=title, lead=lead, tables=tables, figures=figures, findings=fold(tuple(findings)), result=_embedded(result),
        plotly_script=get_plotlyjs(), version=version("compstiff"))


def identification_report(cell: Cell, measurements: Measurements, fit: Fit) -> str:
    """The report of `identify`."""
    model = fit.model
    grades = {grade: [f"k{i}" for i, g in enumerate(model.grades, start=1) if g == grade] for grade in model.grades}
    told = "; ".join(f"{grade}: {', '.join(names)}" for grade, names in grades.items())
    lead = [
        f"Six joint stiffnesses of {cell.robot.name} from {model.fit['rows']} rows ({told}). The model leaves "
        f"{model.fit['residual_rms_um']:.2f} um RMS of the measured deflections unexplained; the noise was estimated at "
        f"{fit.noise_scale:.2f} times what cell.yaml states, and the intervals use that estimate.",
    ]
    if fit.held_out is not None:
        lead.append(f"On the validation rows, which were not fitted: {1e6 * fit.held_out[0]:.1f} um RMS with the prior's "
                    f"stiffnesses, {1e6 * fit.held_out[1]:.1f} um with the identified ones.")
    rows = [[f"k{i}", f"{k:.4g}", f"{low:.4g} ... {high:.4g}", f"{100 * s:.1f} %", f"{p:.3g}", grade]
            for i, (k, (low, high), s, p, grade) in enumerate(zip(
                model.stiffness, model.interval_95, model.log_std, cell.prior.stiffness, model.grades, strict=True), 1)]
    table = ReportTable("Stiffnesses", ["joint", "k [N m/rad]", "95 % interval", "std of ln k", "prior median", "grade"],
                        rows, numbers=(1, 2, 3, 4))
    return render(f"Identified stiffnesses: {Path(measurements.source).name}", lead, [table],
                  [_intervals(cell, fit), _residuals(measurements, fit), _against(measurements, fit)], fit.findings,
                  model.as_dict())


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
    band = 1.96e6 * fit.noise_scale * float(np.max(
        _deviation_std(measurements, fit)))
    layout = {
        "xaxis": {"title": {"text": "line of the measurement file"}, "gridcolor": "#eee"},
        "yaxis": {"title": {"text": "measured minus predicted [um]"}, "gridcolor": "#eee", "zerolinecolor": "#888"},
        "shapes": [{"type": "rect", "xref": "paper", "x0": 0, "x1": 1, "y0": -band, "y1": band, "layer": "below",
                    "fillcolor": "#2b6ca3", "opacity": 0.08, "line": {"width": 0}}],
    }
    note = "" if len(thinned) == len(row) else f" {len(thinned)} of {len(row)} rows are drawn, evenly spaced."
    return Figure("Residuals in the order of the rows", "Band: 95 % of a single reading's sensor noise, as estimated; force "
                  "error and re-seating come on top." + note, data, layout)


def _deviation_std(measurements: Measurements, fit: Fit) -> Array:
    given = measurements.sigma[~np.isnan(measurements.sigma)]
    return given if given.size else fit.sensor_std


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

"""The report frame both packages use: one HTML file that opens offline."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from identification.common.findings import Finding, fold

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
    """JSON that may stand inside a script element, whatever it holds: no `<` is left in it."""
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

    return json.dumps(plain(content), allow_nan=False).replace("<", "\\u003c")


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

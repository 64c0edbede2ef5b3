"""The numbers of a chart as a table: what a picture of few bars or marks shows, to read and to copy."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identification.common.chart import Axis, Bars, Figure, Line, Panel, Points
from identification.common.chart_svg import number

# A longer table is not read: its picture says more.
MOST_ROWS = 100
Table = tuple[list[str], list[list[str]]]


def chart_numbers(figure: Figure) -> Table | None:
    """Header and rows, one a category or a place on x; None where a table would say less than the picture: clouds, and long
    lines. Panels over the same categories share their rows."""
    tables = [_panel_numbers(panel) for panel in figure.panels]
    if not tables or any(table is None for table in tables):
        return None
    alike = len({_quantity(panel) for panel in figure.panels}) == 1
    headed = [(header, rows) if alike else _of_panel(panel, header, rows)
              for panel, (header, rows) in zip(figure.panels, (table for table in tables if table is not None), strict=True)]
    (header, rows), *others = headed
    header = [next((names[0] for names, _ in headed if names[0]), ""), *header[1:]]
    for more, beside in others:
        if [row[0] for row in beside] != [row[0] for row in rows]:
            return None
        header = header + more[1:]
        rows = [one + other[1:] for one, other in zip(rows, beside, strict=True)]
    return header, rows


def _quantity(panel: Panel) -> str:
    """What a panel shows: its axis' title without the unit."""
    return (panel.x if panel.sideways else panel.y).title.partition("[")[0].strip()


def _of_panel(panel: Panel, header: list[str], rows: list[list[str]]) -> Table:
    """The table of one of several panels of other quantities: its columns have the panel's before the series' name."""
    quantity = _quantity(panel)
    named = [name if not quantity or name.startswith(quantity) or name in ("from", "to") else f"{quantity}, {name}"
             for name in header[1:]]
    return [header[0], *named], rows


def _panel_numbers(panel: Panel) -> Table | None:
    names, of_value = (panel.y, panel.x) if panel.sideways else (panel.x, panel.y)
    series = [item for item in panel.series if isinstance(item, Bars | Points | Line)]
    if names.categories:
        few = len(names.categories) <= MOST_ROWS
        return _by_category(list(names.categories), names.title, series, of_value) if few else None
    places = [np.asarray(item.x, dtype=float) for item in series if not isinstance(item, Bars)]
    if len(places) != len(series) or not places or len(places[0]) > MOST_ROWS or any(
            not np.array_equal(place, places[0]) for place in places):
        return None
    shown: list[tuple[str, list[str]]] = []
    for item in series:
        told = [_value(value) for value in np.asarray([] if isinstance(item, Bars) else item.y, dtype=float)]
        # A line through marks has the same numbers.
        same = next((k for k, (name, others) in enumerate(shown)
                     if told == others and (not name or not item.name or name == item.name)), None)
        if same is None:
            shown.append((item.name, told))
        else:
            shown[same] = (shown[same][0] or item.name, told)
    header = [panel.x.title, *(_title(name, of_value) for name, _ in shown)]
    return header, [[number(place), *(told[i] for _, told in shown)] for i, place in enumerate(places[0].tolist())]


def _by_category(names: list[str], title: str, series: Sequence[Bars | Points | Line], of_value: Axis) -> Table | None:
    header, columns = [title], []
    for item in series:
        values = np.asarray(item.values if isinstance(item, Bars) else item.y, dtype=float)
        if len(values) != len(names):
            return None
        header.append(_title(item.name, of_value))
        columns.append([_value(value) for value in values])
        if isinstance(item, Points) and item.interval is not None:
            low, high = (np.asarray(end, dtype=float) for end in item.interval)
            header += ["from", "to"]
            columns += [[_value(value) for value in low], [_value(value) for value in high]]
    return (header, [list(row) for row in zip(names, *columns, strict=True)]) if columns else None


def _title(name: str, axis: Axis) -> str:
    """The series' name with the unit of the axis; the axis' title where the series has no name."""
    _, bracket, unit = axis.title.rpartition("[")
    return f"{name} [{unit}" if name and bracket else name or axis.title


def _value(value: float) -> str:
    return number(float(f"{value:.4g}")) if np.isfinite(value) else ""

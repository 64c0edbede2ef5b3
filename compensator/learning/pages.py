"""The report of `learn`: what each part took of the measured deviation, and what is gained where it was not learned."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from compensator.learning.learning import PARTS, Learning
from identification.common.report import AXES, Figure, ReportTable, render

# Places farther apart along the path [m] are not joined in a figure.
GAP = 15e-3
GRID = {"gridcolor": "#eee", "zerolinecolor": "#888"}
COLOURS = dict(zip(PARTS, ("#2b6ca3", "#6aa9d8", "#7d5ba6", "#c0392b", "#e07b00", "#222222"), strict=True))


def learn_report(learning: Learning) -> str:
    """The report of one measured part."""
    figures = learning.as_dict()
    rows, gone = [], figures["gone"]
    for name, words in PARTS.items():
        rows.append([words, f"{figures['parts_um'][name]:.1f}", f"{100 * gone[name]:.1f} %" if name in gone else ""])
    rows.append(["measured", f"{figures['measured_um']:.1f}", ""])
    tables = [ReportTable("What each part took", ["part", "RMS [um]", "gone of the measured RMS, with this and those above"],
                          rows, numbers=(1, 2))]
    tried = figures["held_out"]
    if tried is not None:
        tables.append(ReportTable(
            f"On {tried['stretches']} stretches of the path, each left out once", ["with", "left, RMS [um]"], [
                ["the model as it was", f"{tried['known_um']:.1f}"],
                ["springs, set-up and warming learned", f"{tried['physical_um']:.1f}"],
                ["the smooth remainder too", f"{tried['learned_um']:.1f}"]], numbers=(1,)))
    springs = figures["stiffness"]
    tables.append(ReportTable(
        "Joint stiffness [N m/rad]", ["joint", "by the load test", "in motion, learned", "1 sigma"],
        [[f"{joint}", f"{before:.3g}", f"{after:.3g}", f"{100 * std:.1f} %"] for joint, (before, after, std) in enumerate(
            zip(springs["before"], springs["in_motion"], springs["relative_std"], strict=True), start=1)], numbers=(1, 2, 3)))
    source = Path(learning.source).name
    return render(f"Learned: {source}", learning.lines(), tables, [_along(learning), *_space(learning)], learning.findings,
                  figures)


def _along(learning: Learning) -> Figure:
    """Each part along the path, by the size at a place."""
    rows = learning.terms.rows
    order = np.argsort(rows.length)
    # No line is drawn over a stretch that was not measured.
    gaps = 1 + np.flatnonzero(np.diff(rows.length[order]) > GAP)
    length = np.insert(1e3 * rows.length[order], gaps, np.nan)
    data: list[dict[str, Any]] = []
    for name, words in {"measured": "measured", **PARTS}.items():
        values = learning.measured if name == "measured" else learning.parts[name]
        square = np.bincount(rows.place, values**2, minlength=len(rows.length))
        data.append({"type": "scatter", "mode": "lines", "x": length,
                     "y": np.insert(1e6 * np.sqrt(square)[order], gaps, np.nan),
                     "name": words, "line": {"color": COLOURS.get(name, "#999999"), "width": 2 if name == "measured" else 1.5}})
    layout = {"xaxis": {"title": {"text": "path length [mm]"}, **GRID},
              "yaxis": {"title": {"text": "size of the measured components [um]"}, "rangemode": "tozero", **GRID}}
    return Figure("The measured deviation along the path, and what each part took",
                  "Size over the numbers measured at a place; the parts are vectors, so their sizes do not add up.",
                  data, layout)


def _space(learning: Learning) -> list[Figure]:
    """The smooth remainder where it was learned."""
    remainder = learning.learned.remainder
    if not len(remainder.places):
        return []
    rows, size = learning.terms.rows, learning.learned.springs
    weights = learning.learned.mean[size + 9:].reshape(-1, 3)
    vectors = 1e6 * remainder.basis(rows.position, rows.posture) @ weights
    where = 1e3 * rows.position
    data: list[dict[str, Any]] = [{
        "type": "cone", **dict(zip("xyz", where.T, strict=True)), **dict(zip("uvw", vectors.T, strict=True)),
        "colorscale": "Viridis", "sizemode": "scaled", "sizeref": 1.5, "colorbar": {"title": {"text": "um"}}}]
    axes = {f"{axis}axis": {"title": {"text": f"{axis} [mm]"}} for axis in AXES}
    return [Figure("The smooth remainder", "Base frame; which way the tool stands beside its plan, and how far.", data,
                   {"scene": {"aspectmode": "data", **axes}}, height=520)]

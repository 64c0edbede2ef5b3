"""The feed check in the report of `correct`: speed over the path, what the joints can hold, and where they cannot."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from compensator.path.feasibility import Feasibility, FeedCheck
from identification.common.report import AXES, Figure, ReportTable
from identification.model.inverse import NEARLY_SINGULAR

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
# Of so many equal stretches of the path the slowest move is drawn.
STRETCHES = 4000
COLOURS = {"planned": "#888", "corrected": "#b3261e"}


def feed_table(check: FeedCheck) -> ReportTable:
    """The figures before and after correction."""
    programs = check.as_dict()
    names = {"time_s": "time [s]", "programmed_time_s": "path over feed [s]", "joint_moves_s": "moves by joint angles [s]",
             "judged": "moves judged by their feed", "held_back": "moves that cannot hold it",
             "held_back_with_force": "of them with force", "lowest_feed_ratio": "lowest share of the feed",
             "lowest_feed_ratio_with_force": "lowest share, moves with force",
             "lost_held_back_s": "lost in held-back moves [s]",
             "lost_ramps_s": "lost in other ramps [s]", "wrist_margin_deg": "nearest to the wrist singularity [deg]"}
    rows = [[what, *(f"{figures[key]:g}" for figures in programs.values())] for key, what in names.items()]
    return ReportTable("Can the robot hold the feed?", ["what", *programs], rows, numbers=tuple(range(1, 1 + len(programs))))


def feed_figures(check: FeedCheck) -> list[Figure]:
    """The share of the feed along the path, and the places on the path."""
    return [_along(check), _places(check.last, "as planned" if check.after is None else "as corrected")]


def _along(check: FeedCheck) -> Figure:
    data: list[dict[str, Any]] = []
    thinned = len(check.last.ratio) > STRETCHES
    for name, program in (("planned", check.before), ("corrected", check.after)):
        if program is None:
            continue
        length = 1e3 * program.path.length
        shares = np.where(np.isnan(program.ratio), np.inf, np.minimum(program.ratio, 1.0))
        stretches = np.array_split(np.arange(len(shares)), min(STRETCHES, len(shares)))
        kept = np.array([part[np.argmin(shares[part])] for part in stretches])
        drawn = np.where(np.isinf(shares[kept]), np.nan, 100 * shares[kept])
        data.append({"type": "scatter", "mode": "lines+markers", "x": length[kept], "y": drawn, "name": name,
                     "marker": {"size": 3}, "line": {"color": COLOURS[name], "width": 1.2}, "connectgaps": False})
    layout = {"xaxis": {"title": {"text": "path length [mm]"}, "gridcolor": "#eee"},
              "yaxis": {"title": {"text": "share of the programmed feed [%]"}, "gridcolor": "#eee", "rangemode": "tozero"}}
    caption = ("The lowest share of the programmed feed that the joints can hold at constant speed on the way to each target. "
               "Moves by joint angles are left out.")
    if thinned:
        caption += f" Of each of {STRETCHES} equal stretches the lowest is drawn."
    return Figure("The feed the joints can hold", caption, data, layout)


def _places(program: Feasibility, when: str) -> Figure:
    path, where = program.path, 1e3 * program.path.rest_from_tcp.position
    where = np.where(path.known[:, None], where, np.nan)
    kept = np.unique(np.linspace(0, len(where) - 1, min(len(where), 5 * STRETCHES)).astype(np.intp))
    drawn = where[kept]
    data: list[dict[str, Any]] = [
        {"type": "scatter3d", "mode": "lines", "x": drawn[:, 0], "y": drawn[:, 1], "z": drawn[:, 2], "name": "path",
         "line": {"color": "#bbb", "width": 1}, "hoverinfo": "skip"}]
    joints = program.drive.route.legs
    for name, mask, colour in (
        ("cut below its feed", program.slow & program.cutting, "#b3261e"),
        ("air move below its feed", program.slow & ~program.cutting, "#e0a100"),
        ("near the wrist singularity", program.wrist < NEARLY_SINGULAR, "#6a3d9a"),
        ("outside a joint limit", program.outside, "#000"),
        ("joint move", joints.joint, "#3878b0"), ("not judged", program.drive.route.lost, "#0a0"),
    ):
        targets = np.flatnonzero(mask & path.known)
        if len(targets):
            shown = targets[np.argsort(np.nan_to_num(program.ratio[targets], nan=1.0), kind="stable")[:STRETCHES]]
            shares = ["" if np.isnan(program.ratio[i]) else f", {100 * min(program.ratio[i], 1.0):.0f} %" for i in shown]
            data.append({"type": "scatter3d", "mode": "markers", "x": where[shown, 0], "y": where[shown, 1],
                         "z": where[shown, 2], "name": f"{name} ({program.moves(targets)})", "hoverinfo": "text",
                         "marker": {"size": 3, "color": colour},
                         "text": [f"target {path.toolpath.number[i]}, line {path.toolpath.line[i]}{share}"
                                  for i, share in zip(shown, shares, strict=True)]})
    axes = {f"{axis}axis": {"title": {"text": f"{axis} [mm]"}} for axis in AXES}
    camera = {"eye": {"x": 1.3, "y": -1.6, "z": 1.3}}
    layout = {"scene": {"aspectmode": "data", "camera": camera, **axes}, "showlegend": True}
    return Figure("Where the robot cannot hold the feed, and other places to look at",
                  f"Base frame, the program {when}; numbers and lines of targets are those of the program as given. At most "
                  f"{STRETCHES} places of a kind are drawn, the slowest first.", data, layout, height=560)

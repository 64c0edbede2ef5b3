"""The feed check in the report of `correct`: speed over the path, what the joints can hold, and where they cannot."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from compensator.path.feasibility import Feasibility, FeedCheck
from identification.common.chart import Axis, Figure, Line, Panel
from identification.common.report import ReportTable, View
from identification.common.scene import SpaceLine, scene
from identification.model.inverse import NEARLY_SINGULAR

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
# So many places of a kind are listed, and so many drawn.
LISTED, DRAWN = 30, 2000
Mask = NDArray[np.bool_]
COLOUR_WORDS = {"before": "red", "warn": "amber", "s5": "violet", "ink": "black or white", "s1": "blue", "s3": "green"}


def feed_tables(check: FeedCheck) -> list[ReportTable]:
    """The figures before and after correction, and the places to look at."""
    programs = check.as_dict()
    names = {"time_s": "time [s]", "programmed_time_s": "path over feed [s]", "joint_moves_s": "moves by joint angles [s]",
             "judged": "moves judged by their feed", "held_back": "moves that cannot hold it",
             "held_back_with_force": "of them with force", "lowest_feed_ratio": "lowest share of the feed",
             "lowest_feed_ratio_with_force": "lowest share, moves with force",
             "lost_held_back_s": "lost in held-back moves [s]",
             "lost_ramps_s": "lost in other ramps [s]", "wrist_margin_deg": "nearest to the wrist singularity [deg]"}
    rows = [[what, *(f"{figures[key]:g}" for figures in programs.values())] for key, what in names.items()]
    tables = [ReportTable("Can the robot hold the feed?", ["what", *programs], rows, numbers=tuple(range(1,
                                                                                                         1 + len(programs))))]
    program = check.last
    toolpath, places = program.path.toolpath, []
    for name, _, mask in _kinds(program):
        for i in _slowest(program, mask)[:LISTED]:
            share = "" if np.isnan(program.ratio[i]) else f"{100 * min(program.ratio[i], 1.0):.0f} %"
            places.append([name, f"target {toolpath.number[i]}, line {toolpath.line[i]}", share])
    if places:
        tables.append(ReportTable("Where the robot cannot hold the feed, and other places to look at",
                                  ["what", f"where, the slowest {LISTED} of a kind first", "share of the feed"], places,
                                  numbers=(2,)))
    return tables


def feed_figures(check: FeedCheck) -> list[Figure | View]:
    """The share of the feed along the path, and the places on the path."""
    return [_along(check), _places(check.last, "as planned" if check.after is None else "as corrected")]


def _along(check: FeedCheck) -> Figure:
    series = []
    for name, program, colour in (("planned", check.before, "muted"), ("corrected", check.after, "before")):
        if program is not None:
            series.append(Line(name, 1e3 * program.path.length, 100 * np.minimum(program.ratio, 1.0), colour))
    caption = ("The lowest share of the programmed feed that the joints can hold at constant speed on the way to each target. "
               "Moves by joint angles are left out. Of very many moves the lowest of each stretch is drawn.")
    return Figure("The feed the joints can hold", caption, [
        Panel(series, Axis("path length [mm]"), Axis("share of the programmed feed [%]", from_zero=True))])


def _kinds(program: Feasibility) -> list[tuple[str, str, Mask]]:
    """What to look at: words, colour, and which targets (N,)."""
    joints = program.drive.route.legs
    found = [("cut below its feed", "before", program.slow & program.cutting),
             ("air move below its feed", "warn", program.slow & ~program.cutting),
             ("near the wrist singularity", "s5", program.wrist < NEARLY_SINGULAR),
             ("outside a joint limit", "ink", program.outside),
             ("joint move", "s1", joints.joint), ("not judged", "s3", program.drive.route.lost)]
    return [(name, colour, np.asarray(mask & program.path.known)) for name, colour, mask in found]


def _slowest(program: Feasibility, mask: Mask) -> Indices:
    """Targets of a kind, the slowest first."""
    targets = np.flatnonzero(mask)
    return targets[np.argsort(np.nan_to_num(program.ratio[targets], nan=1.0), kind="stable")]


def _places(program: Feasibility, when: str) -> View:
    where = np.where(program.path.known[:, None], 1e3 * program.path.rest_from_tcp.position, np.nan)
    kept = np.unique(np.linspace(0, len(where) - 1, min(len(where), 10 * DRAWN)).astype(np.intp))
    path = where[kept][np.isfinite(where[kept]).all(axis=1)]
    lines, words = [SpaceLine(path, "muted", 1.0)], []
    for name, colour, mask in _kinds(program):
        targets = _slowest(program, mask)[:DRAWN]
        if len(targets):
            lines.append(SpaceLine(where[targets], colour, 0.0, dots=7.0))
            words.append(f"{COLOUR_WORDS[colour]}: {name} ({program.moves(np.flatnonzero(mask))})")
    return scene("The places on the path", f"Base frame, millimetres, the program {when}. {'; '.join(words)}. At most "
                 f"{DRAWN} places of a kind are drawn, the slowest first.", lines)

"""The report of `learn`: whether the part taught something, what each cause took, what is gained elsewhere."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from compensator.learning.learning import PARTS, Learning
from compensator.posting.suffixes import rapid_suffix, toolpath_stem
from identification.common.chart import Axis, Figure, Line, Panel
from identification.common.command_line import call
from identification.common.report import Key, Page, ReportTable, Step, Verdict, View, count_words, render
from identification.common.scene import SpaceLine, scene

# Places farther apart along the path [m] are not joined in a figure, nor than so many times the usual distance.
GAP, USUAL = 15e-3, 3.0
COLOURS = dict(zip(PARTS, ("s1", "s3", "s5", "s4", "s2", "ink"), strict=True))
# The longest arrow of the remainder as a share of the part's size, and so many arrows at most.
LONGEST, MOST_ARROWS = 0.12, 600


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
        "Joint stiffness [N m/rad]", ["joint", "by the load test", "in motion, learned", "2 sigma"],
        [[f"{joint}", f"{before:.3g}", f"{after:.3g}", f"{200 * std:.1f} %"] for joint, (before, after, std) in enumerate(
            zip(springs["before"], springs["in_motion"], springs["relative_std"], strict=True), start=1)], numbers=(1, 2, 3)))
    source = Path(learning.source).name
    return render(Page(f"Learned: {source}", _verdict(learning), _keys(learning), _steps(learning), learning.lines(), tables,
                       [_along(learning)], _space(learning), learning.findings, figures))


def _verdict(learning: Learning) -> Verdict:
    figures = learning.as_dict()
    tried, gone = figures["held_out"], list(figures["gone"].values())
    before = f"{figures['measured_um']:.0f} µm RMS were measured on the part"
    if tried is None:
        return Verdict("caution", "LEARNED, NOT TESTED", f"{before}; what was learned explains {100 * gone[-1]:.0f} % of it, "
                                                         f"but "
                       "the points are too few to test that on stretches that were left out.")
    known, learned = tried["known_um"], tried["learned_um"]
    sentence = (f"{before}. On stretches of the path that were left out {known:.0f} µm RMS stay with the model as it was, "
                f"{learned:.0f} µm with what was learned.")
    if learned >= known:
        return Verdict("bad", "NOTHING GAINED", f"{sentence} Do not use it.")
    doubts = count_words(learning.findings, "error", "warning")
    if doubts or learned > 0.8 * known:
        return Verdict("caution", f"LEARNED, WITH {doubts.upper()} TO READ FIRST" if doubts else "LEARNED LITTLE", sentence)
    return Verdict("good", "LEARNED", sentence)


def _keys(learning: Learning) -> list[Key]:
    figures = learning.as_dict()
    motion, tried = figures["motion"], figures["held_out"]
    keys = [Key("measured on the part", f"{figures['measured_um']:.0f}", "µm", f"RMS over {figures['places']} places"),
            Key("left when all is learned", f"{figures['parts_um']['left']:.0f}", "µm", "RMS, where it was learned")]
    if tried is not None:
        keys.append(Key("where it was not learned", f"{tried['known_um']:.0f} → {tried['learned_um']:.0f}", "µm",
                        f"RMS, {tried['stretches']} stretches left out"))
    return [*keys, Key("the moving robot gives way", f"{motion['scale']:.2f}", "times", f"as at rest; 2 sigma "
                                                                                        f"{2 * motion['std']:.2g}")]


def _steps(learning: Learning) -> list[Step]:
    planned = learning.predicted
    program, cell, model = planned.program.source, planned.cell.source, planned.model.source
    if program is None or model is None:
        return []
    files = (cell, program, "--stiffness", model, "--forces", planned.forces.log.source, *planned.settings.as_options(),
             "--learned", "learned.json")
    out = ("-o", f"{toolpath_stem(program)}_second{rapid_suffix(program)}")
    return [Step("The same part again, set up alike and started as cold:", call("correct", *files, "--repeats", "job", *out)),
            Step("Another set-up, or another program: what belongs to the job is left out.", call("correct", *files, *out))]


def _along(learning: Learning) -> Figure:
    """Each part along the path, by the size at a place."""
    rows = learning.terms.rows
    order = np.argsort(rows.length)
    # No line is drawn over a stretch that was not measured.
    steps = np.diff(rows.length[order])
    gaps = 1 + np.flatnonzero(steps > max(GAP, USUAL * float(np.median(steps)) if len(steps) else GAP))
    length = np.insert(1e3 * rows.length[order], gaps, np.nan)
    series = []
    for name, words in {"measured": "measured", **PARTS}.items():
        values = learning.measured if name == "measured" else learning.parts[name]
        square = np.bincount(rows.place, values**2, minlength=len(rows.length))
        series.append(Line(words, length, np.insert(1e6 * np.sqrt(square)[order], gaps, np.nan), COLOURS.get(name, "muted"),
                           2.4 if name == "measured" else 1.4))
    return Figure("The measured deviation along the path, and what each part took",
                  "Size over the numbers measured at a place; the parts are vectors, so their sizes do not add up.",
                  [Panel(series, Axis("path length [mm]"), Axis("size of the measured components [um]", from_zero=True))])


def _space(learning: Learning) -> list[Figure | View]:
    """The smooth remainder where it was learned, as arrows."""
    remainder = learning.learned.remainder
    if not len(remainder.places):
        return []
    rows, size = learning.terms.rows, learning.learned.springs
    weights = learning.learned.mean[size + 9:].reshape(-1, 3)
    some = slice(None, None, -(-len(rows.position) // MOST_ARROWS))
    vectors = (1e6 * remainder.basis(rows.position, rows.posture) @ weights)[some]
    where = 1e3 * rows.position[some]
    largest = float(np.linalg.norm(vectors, axis=1).max(initial=0.0)) or 1.0
    reach = LONGEST * float(np.linalg.norm(np.ptp(where, axis=0))) / largest
    arrows = [SpaceLine(np.array([start, start + reach * vector]), "s4", 1.6) for start, vector in zip(where, vectors,
                                                                                                       strict=True)]
    return [scene("The smooth remainder", "Base frame, millimetres: which way the tool stands beside its plan, and how far. "
                                          "The "
                  f"dots are on the path; the longest arrow is {largest:.1f} um.", [SpaceLine(where, "muted", 0.0, 4.0),
                                                                                    *arrows])]

"""The report of `verify`: accepted or not, the deviation along the path before and after, and measured against predicted."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from compensator.verification.comparison import Figures, Scale
from compensator.verification.readings import Readings
from compensator.verification.verify import Verification
from identification.common.chart import Axis, Figure, Line, Panel, Points, Rule, Series
from identification.common.command_line import call
from identification.common.report import Key, Page, ReportTable, Step, Verdict, render

# So many points a cloud; of more every so-manieth is drawn.
MOST_POINTS = 4000
COLOURS = ("x", "y", "z")


def verify_report(result: Verification) -> str:
    """The report of one pair of measured passes."""
    comparison = result.comparison
    rows = [_row("size", comparison.before, comparison.after)]
    rows += [_row(f"along {name}", *pair) for name, pair in comparison.by_axis.items()]
    tables = [ReportTable("Before and after [um]", ["deviation", "places", "RMS", "mean", "95 % are below", "largest"], rows,
                          numbers=(1, 2, 3, 4, 5))]
    figures = []
    if result.scale is not None:
        scales = {"overall": result.scale, **{f"along {name}": scale for name, scale in result.axis_scales.items()}}
        tables.append(ReportTable(
            "Measured before against predicted", ["what", "places", "scale (95 %)", "explained as it stands", "with the scale",
                                                  "left, RMS [um]"],
            [_scale_row(name, scale) for name, scale in scales.items()], numbers=(1, 2, 3, 4, 5)))
        figures.append(_against(result))
    return render(Page(f"Verified: {Path(result.before.source).name} and {Path(result.after.source).name}", _verdict(result),
                       _keys(result), _steps(result), result.lines(), tables, [_along(result)], figures, result.findings,
                       result.as_dict()))


def _verdict(result: Verification) -> Verdict:
    before, after = result.comparison.before, result.comparison.after
    sentence = (f"Measured: {before.rms_um:.1f} µm RMS before, {after.rms_um:.1f} µm after the correction; the largest "
                f"{before.max_um:.1f} and {after.max_um:.1f} µm")
    if result.accepted is False:
        return Verdict("bad", "NOT ACCEPTED", f"{sentence}. {result.over} of {len(result.after.each)} readings exceed the "
                       f"tolerance of {result.tolerance_um:g} µm, the worst at {_worst(result.after.each)}.")
    if result.comparison.verdict == "worse":
        return Verdict("bad", "WORSE THAN BEFORE", f"{sentence}. Do not use this correction.")
    if result.accepted:
        return Verdict("good", "ACCEPTED", f"{sentence}. All {len(result.after.each)} readings are within "
                       f"{result.tolerance_um:g} µm.")
    if result.comparison.verdict == "better":
        return Verdict("good", "BETTER", f"{sentence}. No tolerance was stated.")
    return Verdict("caution", "NO CLEAR DIFFERENCE", f"{sentence}: these readings do not show that one is better.")


def _keys(result: Verification) -> list[Key]:
    comparison, scale = result.comparison, result.scale
    before, after = comparison.before, comparison.after
    between = "" if comparison.interval is None else f"95 %: {comparison.interval[0]:.2g} to {comparison.interval[1]:.2g}"
    keys = [Key("deviation, RMS", f"{before.rms_um:.1f} → {after.rms_um:.1f}", "µm", f"{before.points} places in both passes"),
            Key("smaller by a factor", "–" if comparison.ratio is None else f"{comparison.ratio:.2g}", "", between
                or "no interval can be given"),
            Key("largest after", f"{after.max_um:.1f}", "µm",
                f"before {before.max_um:.1f} µm; at {_worst(result.after.select(result.rows_after))}")]
    if result.tolerance_um is not None:
        keys.append(Key("share of the tolerance",
                        f"{100 * 1e6 * float(np.nanmax(result.after.each.size)) / result.tolerance_um:.0f}",
                        "%", f"of {result.tolerance_um:g} µm, largest reading after"))
    if scale is not None:
        keys.append(Key("measured over predicted", f"{scale.scale:.3f}", "", "" if scale.interval is None else
                        f"95 %: {scale.interval[0]:.3f} to {scale.interval[1]:.3f}"))
    return keys


def _worst(readings: Readings) -> str:
    """The place of the largest reading, as the file names it."""
    place = readings.place[int(np.nanargmax(readings.size))]
    if readings.key == "target":
        return f"target {place[0]:.0f}"
    if readings.key == "path_mm":
        return f"path length {1e3 * place[0]:.1f} mm"
    return f"x y z {', '.join(f'{1e3 * x:.1f}' for x in place)} mm"


def _steps(result: Verification) -> list[Step]:
    """The next part, with the scale where it is known; of a part that is accepted the proof first."""
    if result.comparison.verdict == "worse":
        return [Step("Check the sign and frame of the force log, and that the two files are not exchanged. A second log tells:",
                     call("correct", "cell.yaml", "PART.mod", "--stiffness", "stiffness.json", "--forces", "PART.forces.csv",
                          "--other-forces", "SECOND.forces.csv", "-o", "PART_corrected.mod"))]
    before, after = result.before, result.after.source
    at_places = before.key == "x_mm y_mm z_mm"
    step = Step("Teach the next part what this one showed (springs in motion, set-up, warming)"
                + (":" if at_places else "; each point needs its x_mm y_mm z_mm:"),
                call("learn", "cell.yaml", "PART.mod", before.source if at_places else "POINTS.csv", "--stiffness",
                     "stiffness.json", "--forces", "PART.forces.csv", "-o", "learned.json"))
    # What the findings ask to look at goes before anything that builds on these readings.
    hints = [Step(f"First: {finding.hint}.") for finding in result.findings if finding.level == "warning" and finding.hint]
    advice = [Step(line) for line in result.lines() if "correct --scale" in line]
    if result.scale is None:
        tolerance = () if result.tolerance_um is None else ("--tolerance-um", f"{result.tolerance_um:g}")
        advice.append(Step("See whether a scale would help: compare with what was predicted (what correct --offsets wrote):",
                           call("verify", "cell.yaml", before.source, after, "--predicted", "PART.offsets.csv", *tolerance)))
    kept = [Step("Keep these files with the part: they are its proof.")] if result.accepted else []
    return [*hints, *kept, *advice, step]


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
    if before.key == "x_mm y_mm z_mm":
        place, title = np.arange(len(before), dtype=float), "place, in the order of the first file"
    else:
        unit, title = (1.0, "target") if before.key == "target" else (1e3, "path length [mm]")
        place = unit * before.place[:, 0]
    series: list[Series] = [Line(name, place, 1e6 * readings.size, colour)
                            for readings, name, colour in ((before, "before", "before"), (after, "after", "after"))]
    if result.tolerance_um is not None:
        series.append(Rule(result.tolerance_um, "tolerance"))
    return Figure("Measured deviation along the path", "Size of the measured components at the places measured in both passes.",
                  [Panel(series, Axis(title), Axis("size of the deviation [um]", from_zero=True))])


def _against(result: Verification) -> Figure:
    assert result.predicted is not None
    assert result.scale is not None
    predicted, measured = 1e6 * result.predicted, 1e6 * result.before.deviation
    step = -(-len(predicted) // MOST_POINTS)
    series: list[Series] = [
        Points(name, predicted[::step, axis], measured[::step, axis], COLOURS["xyz".find(name)] if name in "xyz"
               else f"s{axis + 1}",
               size=5) for axis, name in enumerate(result.before.axes)]
    known = predicted[np.isfinite(predicted)]
    ends = np.array([known.min(), known.max()])
    for slope, name, dashed in ((1.0, "as predicted", True), (result.scale.scale, f"scale {result.scale.scale:.3f}", False)):
        series.append(Line(name, ends, slope * ends, "ink", dashed=dashed))
    caption = "Every measured component before the correction against its prediction." + (
        f" One place in {step} is drawn." if step > 1 else "")
    return Figure("Measured against predicted", caption, [
        Panel(series, Axis("predicted deviation [um]"), Axis("measured before [um]"), height=380)])

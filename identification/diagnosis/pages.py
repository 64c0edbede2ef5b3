"""The report of `diagnose`: what is wrong, the cause in plain words and where it sits, how it shows, the gain, what is next."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.common.arrays import rms
from identification.common.chart import AXES, AXIS_COLOURS, Axis, Band, Bars, Figure, Line, Panel, Points, Rule, Series
from identification.common.quantities import parameter_words, readable_unit, two_places
from identification.common.report import Key, Page, ReportTable, Verdict, View, render
from identification.diagnosis.arm_drawing import arm_drawing, sound_arm
from identification.diagnosis.diagnose import Diagnosis
from identification.diagnosis.gain import Gain
from identification.diagnosis.in_words import more_at_work, no_cause, value
from identification.diagnosis.judgement import Judgement
from identification.diagnosis.next_steps import steps_of
from identification.diagnosis.procedure import ALARM
from identification.diagnosis.record import checks_of, next_words
from identification.fit.held_out import pose_names, poses
from identification.measurements import Measurements
from identification.model.effects_in_force import EFFECTS, added

Array = NDArray[np.float64]
MOST_POINTS = 3000
# Beside each other no more poses have bars; rivals that are marked in the drawing.
MOST_POSES, MOST_MARKED = 40, 4
# A sentence that begins with the name of a column.
COLUMN = re.compile(r"(?:[dfm][xyz]|q\d)(?:_\w+)?,?$")


def diagnosis_report(diagnosis: Diagnosis, extended: Path | None = None) -> str:
    """The report of `diagnose`."""
    content, judgement = diagnosis.as_dict(), diagnosis.judgement
    named = bool(judgement.causes)
    before, allowed = judgement.plain.residual, judgement.expected_std
    after = judgement.extended.residual if named else None
    tables = [table for table in (_mistakes(judgement), _causes(content), _ranking(judgement), _next(content),
                                  _parts(judgement), _showing(judgement)) if table]
    first: list[Figure | View] = [*_where(judgement), *_probabilities(judgement)]
    if judgement.gain is not None and judgement.causes:
        first.append(_held_out(judgement.gain, judgement))
    if judgement.causes and named:
        first.append(_explained(judgement))
    in_order = _in_order(judgement.rows, before, after, allowed)
    others = [_by_pose(judgement.rows, before, after, allowed),
              _by_load(judgement.rows, before), _patterns(judgement)]
    # What the noise allows is the whole answer where there is no cause.
    if first and diagnosis.verdict != "adequate":
        others.insert(0, in_order)
    else:
        first.append(in_order)
    return render(Page(f"Diagnosis: {Path(diagnosis.measurements.source).name}", _verdict(diagnosis), _keys(judgement, content),
                       steps_of(diagnosis, extended), _words(diagnosis), tables, first, others, diagnosis.findings, content))


def _words(diagnosis: Diagnosis) -> list[str]:
    """The answer as the terminal has it, without what the steps say."""
    return [line for line in diagnosis.lines() if not line.startswith("next: ")]


def _verdict(diagnosis: Diagnosis) -> Verdict:
    judgement = diagnosis.judgement
    before, allowed = 1e6 * rms(judgement.plain.residual), 1e6 * rms(judgement.expected_std)
    sizes = f"six springs leave {before:.1f} µm RMS, the noise allows {allowed:.1f} µm"
    if diagnosis.verdict == "adequate":
        return Verdict("good", "ADEQUATE", f"Six springs explain these measurements to their noise: they leave {before:.1f} µm "
                       f"RMS, the noise allows {allowed:.1f} µm. Of {len(judgement.showing)} possible causes of typical size "
                       f"these rows would have shown {len(judgement.showing) - len(judgement.overlooked)}, four times in five.")
    if before <= allowed and judgement.detection.p_value <= ALARM:
        sizes += f": its size would pass, but noise does not make such a pattern ({_probability(judgement)})"
    if diagnosis.verdict == "mistake":
        mistake = judgement.mistakes[0]
        # The name of a column stays as the table has it.
        first, _, rest = mistake.sentence.partition(" ")
        name = COLUMN.match(first)
        told = f"{first if name else first[:1].upper() + first[1:]} {rest}".replace("+-", "±")
        return Verdict("bad", "A MISTAKE IN THE FILES", f"{told}. Each pose is predicted from the others to "
                       f"{1e6 * mistake.before:.1f} µm RMS as it stands, to {1e6 * mistake.after:.1f} µm with it mended.")
    if diagnosis.verdict == "unknown":
        seen = f": {'; '.join(judgement.patterns[:2])}" if judgement.patterns else ""
        return Verdict("bad", "UNKNOWN", f"Something is wrong{no_cause(judgement)}{seen}. Nothing is "
                       f"corrected for it. {sizes[0].upper()}{sizes[1:]} as estimated from the same rows.")
    if diagnosis.verdict == "ambiguous":
        more = len(judgement.alternatives[3:])
        names = [cause.sentence for cause in judgement.alternatives[:3]] + [one.sentence for one in judgement.mistakes]
        names += [f"one of {more} more, less likely"] if more else []
        return Verdict("caution", "AMBIGUOUS", f"These measurements cannot tell apart: {'; or '.join(names)}. "
                       f"{sizes[0].upper()}{sizes[1:]}.")
    gain = judgement.gain
    causes = [cause.sentence for cause in judgement.causes]
    if not causes and judgement.scatters:
        scatter = judgement.scatters[0]
        return Verdict("caution", scatter.short, f"{scatter.sentence[0].upper()}{scatter.sentence[1:]}; {scatter.rows} count "
                       f"for that much less. {sizes[0].upper()}{sizes[1:]}.")
    if not causes:
        return Verdict("caution", "READINGS LEFT OUT", f"Left out, for they do not fit the others: {judgement.dropped[0]}. "
                       f"Of the rest {sizes}.")
    words = "; ".join(causes)
    leave = "it leaves" if len(causes) == 1 else "they leave"
    better = "" if gain is None else (f". Named, {leave} {1e6 * gain.after:.1f} µm in place of {1e6 * gain.before:.1f} µm "
                                      "on poses that were not fitted")
    dropped, count = judgement.dropped
    left_out = f" Left out, for they do not fit the others: {dropped}." if count else ""
    return Verdict("caution", "CAUSE NAMED", f"{words[0].upper()}{words[1:]}{better}.{left_out}")


def _probability(judgement: Judgement) -> str:
    """Of the misfit, by chance: no smaller than the replicates tell."""
    detection = judgement.detection
    return f"p {'≤' if detection.p_value <= detection.resolution else '='} {detection.p_value:.2g}"


def _percent(judgement: Judgement) -> str:
    """The same in per cent, for a card."""
    detection = judgement.detection
    return f"{'≤ ' if detection.p_value <= detection.resolution else ''}{100 * detection.p_value:.2g}"


def _ratio(gain: Gain) -> str:
    """The factor with its interval, to so many places as tell its ends apart."""
    low, high = gain.interval
    places = int(np.clip(1 - np.floor(np.log10(max(high - low, 1e-3))), 1, 3)) if np.isfinite(high - low) else 1
    return f"{gain.ratio:.{places}f}, 95 % {low:.{places}f} to {high:.{places}f}"


def _keys(judgement: Judgement, content: dict[str, Any]) -> list[Key]:
    keys = [Key("left by six springs", f"{1e6 * rms(judgement.plain.residual):.1f}", "µm",
                f"RMS; the noise allows {1e6 * rms(judgement.expected_std):.1f} µm"),
            Key("by chance", _percent(judgement), "%", "probability of such a misfit without any fault")]
    names, count = judgement.dropped
    if count:
        keys.append(Key("left out", str(count), "reading" if count == 1 else "readings", names))
    missed = judgement.overlooked
    if missed and not judgement.causes:
        keys.append(Key("most that may hide", f"{1e6 * missed[0].typical_largest:.0f}", "µm", "in these rows, by a cause of "
                        f"typical size that they would not have shown: {missed[0].entry.sentence}"))
    gain = judgement.gain
    if gain is not None and judgement.causes:
        keys.append(Key("on poses not fitted", f"{1e6 * gain.before:.1f} → {1e6 * gain.after:.1f}", "µm",
                        f"RMS; factor {_ratio(gain)}"))
    ranked = [*judgement.causes, *judgement.alternatives]
    # Of an unknown cause the nearest names are none: their probabilities are among themselves.
    if ranked and judgement.verdict != "unknown":
        keys.append(Key("likeliest cause", f"{100 * ranked[0].probability:.0f}", "%", ranked[0].sentence))
    if judgement.robot_difference is not None:
        keys.append(Key("a wrong choice costs", f"{1e6 * judgement.robot_difference:.1f}", "µm",
                        "RMS, in a correction under the measured loads"))
    elif content["causes"] and "largest_um" in content["causes"][0]:
        keys.append(Key("the cause makes up to", f"{content['causes'][0]['largest_um']:.0f}", "µm", "in these measurements"))
    return keys


def _where(judgement: Judgement) -> list[View]:
    """The arm with the place of the causes, or of the likeliest of those that are open."""
    causes, rod = judgement.causes or judgement.alternatives[:MOST_MARKED], judgement.plain.data.cell.robot.rod is not None
    if judgement.verdict == "adequate":
        return [View("Where it gives way", "Not to scale. A spring in each gear is all that these measurements show.", "", {},
                     sound_arm(rod))]
    if not causes or judgement.verdict == "unknown":
        return []
    certain = bool(judgement.causes)
    marked = "The ring marks what is to blame." if certain else "Broken rings mark what these measurements cannot tell apart."
    return [View("Where it sits" if certain else "Where it may sit", f"Not to scale. {marked}", "", {},
                 arm_drawing(causes, certain, rod))]


def _probabilities(judgement: Judgement) -> list[Figure]:
    ranked = [*judgement.causes, *judgement.alternatives][:8]
    if len(ranked) < 2 or judgement.verdict == "unknown":
        return []
    matters = "" if judgement.robot_difference is None else (
        f" For a correction the choice makes {1e6 * judgement.robot_difference:.1f} um RMS under the measured loads.")
    bars = Bars("probability", [cause.probability for cause in ranked], "after")
    return [Figure("How likely each cause is", "Of being at work, alone or with others." + matters, [
        Panel([bars], Axis("probability", from_zero=True, limits=(0.0, 1.0)), Axis(categories=[one.sentence for one in ranked]),
              height=60 + 26 * len(ranked), sideways=True)])]


def _mistakes(judgement: Judgement) -> ReportTable | None:
    rows = [[mistake.key, mistake.sentence, f"{1e6 * mistake.before:.2f}", f"{1e6 * mistake.after:.2f}",
             mistake.candidate.mistake.settles] for mistake in judgement.mistakes]
    header = ["mistake", "in words", "RMS of poses predicted from the others [um]", "with it mended", "what settles it"]
    return ReportTable("Mistakes in the files", header, rows, numbers=(2, 3)) if rows else None


def _causes(content: dict[str, Any]) -> ReportTable | None:
    small = [cause | {"sentence": f"{cause['sentence']} (small beside the cause: no name)"} for cause in content["companions"]]
    rows = [[cause["sentence"], parameter_words(name), value(item),
             f"{cause['largest_um']:.0f}" if "largest_um" in cause else "",
             "corrected along the path" if cause["of_robot"] else "taken out of the data, not carried into the correction",
             cause["effect"] + (f"[{cause['joint']}]" if cause["joint"] else "")]
            for cause in [*content["causes"], *small] for name, item in cause["parameters"].items()]
    return ReportTable("The cause", ["cause", "of it", "estimate ± 2 sigma", "makes up to [um]", "what is done", "name"], rows,
                       numbers=(3,)) if rows else None


def _ranking(judgement: Judgement) -> ReportTable | None:
    ranked = [*judgement.causes, *judgement.alternatives][:12]
    if not ranked:
        return None
    title = {"unknown": "Nearest names, none of which is enough: shares among them", "ambiguous": "What it may be"}.get(
        judgement.verdict, "Causes by probability")
    return ReportTable(title, ["cause", "probability", "family", "name"], [
        [cause.sentence, f"{cause.probability:.3f}", cause.effect.family, cause.label] for cause in ranked], numbers=(1,))


def _next(content: dict[str, Any]) -> ReportTable | None:
    rows = [list(next_words(item)) for item in content["next_measurements"] if item["kind"] == "load"]
    rows += [list(check) for check in checks_of(content["next_measurements"])]
    return ReportTable("What to measure next", ["do", "it tells"], rows) if rows else None


def _parts(judgement: Judgement) -> ReportTable | None:
    rows = [[conflict.part, conflict.rest, f"{conflict.distance:.1f}", f"{conflict.corrected:.2g}"]
            for conflict in judgement.conflicts][:8]
    header = ["rows", "against", "how far apart [sigma]", "by chance"]
    return ReportTable("Parts of the data that want different springs", header, rows, numbers=(2, 3)) if rows else None


def _showing(judgement: Judgement) -> ReportTable | None:
    rows = []
    for each in sorted(judgement.showing, key=lambda each: (each.of_typical_size, -each.typical_largest)):
        said, (factor, unit) = each.as_dict(), readable_unit(each.typical, each.entry.effect.size_parameter.unit)
        shows = ["never", "never"]
        if said["noticed_from"] is not None:
            shows = [f"{two_places(said['noticed_from'] / factor)} {unit}".rstrip(), f"{said['noticed_from_um']:.1f}"]
        unless = " (unless the arm's weight presses its teeth to one side)" if each.weighed else ""
        rows.append([each.entry.sentence + unless, "yes" if each.of_typical_size else "no",
                     f"{two_places(each.typical / factor)} {unit}".rstrip(), f"{said['typical_um']:.1f}", *shows,
                     each.leaves_off(), each.entry.label])
    header = ["cause", "typical one would have shown", "typical size", "moves the tool by [um]", "shows from",
              "shows from [um]", "unnoticed, leaves off", "name"]
    return ReportTable("What these rows would have shown, four times in five", header, rows,
                       numbers=(2, 3, 4, 5)) if rows else None


def _thinned(count: int) -> NDArray[np.intp]:
    return np.arange(0, count, max(1, -(-count // MOST_POINTS)), dtype=np.intp)


def _in_order(rows: Measurements, before: Array, after: Array | None, allowed: Array) -> Figure:
    """Residuals by row, one panel an axis."""
    shown = _thinned(len(before))
    line = rows.line[shown]
    # No noise is drawn over rows that were left out.
    gaps = np.flatnonzero(np.diff(rows.row[shown]) > (shown[1] - shown[0] if len(shown) > 1 else 1)) + 1
    along = np.insert(line.astype(float), gaps, np.nan)
    panels = []
    for axis in range(3):
        edge = np.insert(1.96e6 * allowed[shown, axis], gaps, np.nan)
        series: list[Series] = [Band("95 % of the noise", along, -edge, edge),
                                Points("plain model", line, 1e6 * before[shown, axis], "before", size=5)]
        if after is not None:
            series.append(Points("extended model", line, 1e6 * after[shown, axis], "after", size=5))
        panels.append(Panel(series, Axis("line of the measurement file" if axis == 2 else ""), Axis(f"{AXES[axis]} [um]"),
                            height=210))
    return Figure("What the model leaves, in the order of the rows", "Band: what the noise allows.", panels)


def _ordered(names: list[str]) -> list[int]:
    """Places of the names as people order them: P2 before P10."""
    def key(i: int) -> list[int | str]:
        return [int(part) if k % 2 else part for k, part in enumerate(re.split(r"(\d+)", names[i]))]

    return sorted(range(len(names)), key=key)


def _by_pose(rows: Measurements, before: Array, after: Array | None, allowed: Array) -> Figure:
    groups, names = poses(rows), list(pose_names(rows))
    order = _ordered(names)

    def grouped(values: Array) -> Array:
        return 1e6 * np.array([rms(values[groups == g]) for g in order])

    place = np.arange(len(names))
    series: list[Series] = [Bars("plain model", grouped(before), "before")]
    if after is not None:
        series.append(Bars("extended model", grouped(after), "after"))
    series.append(Line("the noise allows", place, grouped(allowed), "ink", 1.5, dashed=True))
    return Figure("By pose", "RMS of what is left at each pose.", [
        Panel(series, Axis(categories=[names[g] for g in order]), Axis("RMS [um]"))])


def _by_load(rows: Measurements, before: Array) -> Figure:
    """Residual against the load with the sign of its largest component."""
    force = rows.wrench[:, :3]
    axis = np.argmax(np.abs(force), axis=1)
    along = force[np.arange(len(force)), axis]
    shown = _thinned(len(before))
    labels = [f"line {line}, load along {AXES[a]}" for line, a in zip(rows.line[shown], axis[shown], strict=True)]
    series = [Points(f"reading {AXES[k]}", along[shown], 1e6 * before[shown, k], AXIS_COLOURS[k], labels=labels)
              for k in range(3)]
    return Figure("By load", "What the plain model leaves against the load: a bend is a gear that is not linear, a loop "
                  "one that does not come back the way it went.", [
                      Panel(series, Axis("load along its main axis [N]"), Axis("measured minus plain model [um]"))])


def _explained(judgement: Judgement) -> Figure:
    """The named causes' contribution against what the springs alone leave, and over the rows."""
    model = judgement.extended
    expected = added(model.load_state, model.terms, model.map[EFFECTS])[:, :3]
    left = model.residual + expected
    shown = _thinned(len(left))
    reach = 1.05e6 * float(np.abs(expected).max(initial=1e-9))
    cloud: list[Series] = [Line("explained", [-reach, reach], [-reach, reach], "muted", 1.0)]
    cloud += [Points(f"reading {AXES[k]}", 1e6 * expected[shown, k], 1e6 * left[shown, k], AXIS_COLOURS[k], size=5)
              for k in range(3)]
    # The reading in which the cause shows the most.
    k = int(np.argmax(np.abs(expected).max(axis=0)))
    line = judgement.rows.line[shown]
    over: list[Series] = [Points("what the springs leave", line, 1e6 * left[shown, k], "before", size=5),
                          Line("what the cause gives", line, 1e6 * expected[shown, k], "after", 1.6)]
    names = "it" if len(judgement.causes) == 1 else "them"
    scatter = "The scatter about it is more than noise makes: see in words." if more_at_work(judgement) else (
        "The scatter about it is noise.")
    caption = (f"What lies on the line is explained by {names}: first in all readings, then in the order of the rows, reading "
               f"{AXES[k]}, where it shows the most. {scatter}")
    return Figure("The signature of the cause over what the springs leave", caption, [
        Panel(cloud, Axis("the named cause gives [um]"), Axis("measured minus springs [um]")),
        Panel(over, Axis("line of the measurement file"), Axis(f"reading {AXES[k]} [um]"))], beside=True)


def _held_out(gain: Gain, judgement: Judgement) -> Figure:
    """The poses before and after, side by side over the same scale."""
    names = list(gain.poses)
    shown = [i for i in _ordered(names) if i in set(np.argsort(-gain.by_pose[0], kind="stable")[:MOST_POSES].tolist())]
    top = 1.06e6 * float(np.nanmax(gain.by_pose, initial=1e-9))
    noise = 1e6 * rms(judgement.expected_std)
    panels = [Panel([Bars(name, 1e6 * gain.by_pose[k][shown], colour), Rule(noise, "the noise allows")],
                    Axis("pose", categories=[names[i] for i in shown]), Axis("RMS [um]", limits=(0.0, max(top, 1.06 * noise))),
                    height=260, words=f"{title}: {1e6 * size:.2f} um RMS") for k, (name, colour, title, size) in enumerate((
                        ("plain model", "before", "Before, six springs", gain.before),
                        ("extended model", "after", "After, with the cause", gain.after)))]
    note = f" The {MOST_POSES} of {len(names)} poses with the largest are drawn." if len(shown) < len(names) else ""
    return Figure("On rows that were not fitted", f"Rows: {gain.held_out}. What is left is smaller by a factor {_ratio(gain)}."
                  + note, panels, beside=True)


def _patterns(judgement: Judgement) -> Figure:
    """How surprising each pattern is, plain and extended, with the level that 5 % of noise reaches."""
    names = sorted(judgement.detection.patterns, key=lambda name: -judgement.detection.patterns[name])
    shown = [("plain model", judgement.detection, "before")]
    if judgement.adequacy is not None:
        shown.append(("best extended model", judgement.adequacy, "after"))
    series: list[Series] = [Bars(title, [detection.patterns.get(name, 0.0) for name in names], colour)
                            for title, detection, colour in shown]
    series.append(Rule(judgement.detection.critical, "level of 5 % of data sets without fault", upright=True))
    return Figure("Patterns that noise does not make", "Dashed: what 5 % of data sets without any fault would show in the "
                  "largest of all tests.", [Panel(series, Axis("surprise: -log10 of its probability", from_zero=True),
                                                  Axis(categories=names), height=80 + 24 * len(names), sideways=True)])

"""The report of `identify`: whether the stiffnesses can be used, their intervals, residuals, agreement of parts of the data."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from identification.common.chart import (
    AXES,
    AXIS_COLOURS,
    Axis,
    Band,
    Bars,
    Cells,
    Figure,
    Line,
    Panel,
    Points,
    Rule,
    Series,
)
from identification.common.command_line import call
from identification.common.findings import counted
from identification.common.report import Key, Page, ReportTable, Step, Verdict, count_words, render
from identification.fit.fit import Fit
from identification.fit.identifiability import LOOK_FOR_IT
from identification.fit.visit_findings import evidence, mending
from identification.measurements import Measurements
from identification.model.cell import Cell
from identification.model.controller import runs_rapid, use_of_stiffnesses

JOINTS = [f"k{i}" for i in range(1, 7)]
# Two standard deviations of a stiffness from which a factor says more than per cent do.
WIDE = 0.3
# More points a cloud are thinned evenly; more poses have no bar.
MOST_POINTS, MOST_POSES = 3000, 60


def identification_report(fit: Fit) -> str:
    """The report of `identify`."""
    cell, measurements, model = fit.cell, fit.measurements, fit.model
    grades = {grade: [f"k{i}" for i, g in enumerate(model.grades, start=1) if g == grade] for grade in model.grades}
    graded = "; ".join(f"{grade}: {', '.join(names)}" for grade, names in grades.items())
    noise = model.fit["noise"]
    offset = float(np.mean(noise["pose_offset_um"]))
    lead = [
        f"Six joint stiffnesses of {cell.robot.name} from {model.fit['rows']} rows ({graded}). The model leaves "
        f"{model.fit['residual_rms_um']:.2f} um RMS of the measured deflections unexplained. Noise, estimated: sensor "
        f"{noise['sensor_scale']:.2f} times what cell.yaml states, re-seating {offset:.1f} um a pose; the intervals use it. "
        f"{fit.ellipsoid.sentence[0].upper()}{fit.ellipsoid.sentence[1:]}.",
    ]
    conflicts = [conflict for conflict in fit.conflicts if conflict.is_conflict]
    if conflicts:
        lead.append(f"One set of linear springs does not explain all rows: {conflicts[0].part} and {conflicts[0].rest} want "
                    "different stiffnesses. See the table of subsets.")
    if fit.held_out is not None:
        lead.append(f"On the validation rows, which were not fitted: {1e6 * fit.held_out[0]:.1f} um RMS with the prior's "
                    f"stiffnesses, {1e6 * fit.held_out[1]:.1f} um with the identified ones.")
    rows = [[f"k{i}", f"{k:.4g}", f"{low:.4g} ... {high:.4g}", _two_sigma(s), f"{p:.3g}", grade.grade,
             grade.reason + (f"; {grade.helpful}" if grade.helpful not in ("", LOOK_FOR_IT) else "")]
            for i, (k, (low, high), s, p, grade) in enumerate(zip(
                model.stiffness, model.interval_95, model.log_std, cell.prior.stiffness, fit.grades, strict=True), 1)]
    tables = [
        ReportTable("Stiffnesses", ["joint", "k [N m/rad]", "95 % interval", "2 sigma", "known before", "grade", "why"],
                    rows, numbers=(1, 2, 3, 4)),
        ReportTable("Do parts of the data agree?",
                    ["rows", "against", "how far apart [sigma]", "directions", "by chance", "verdict"],
                    [[c.part, c.rest, f"{c.distance:.1f}", f"{c.directions}", f"{c.corrected:.2g}",
                      "conflict" if c.is_conflict else "agree"] for c in fit.conflicts], numbers=(2, 3, 4)),
    ]
    if fit.bad_visits:
        tables.append(ReportTable("Poses left out: their readings fit no stiffness that fits the others",
                                  ["pose", "first line", "evidence", "share of the misfit", "what would mend it"],
                                  [[bad.score.name, f"{bad.score.line}", evidence(bad.score),
                                    f"{100 * bad.score.share:.0f} %", mending(bad)] for bad in fit.bad_visits],
                                  numbers=(1, 3)))
    light = np.flatnonzero(fit.row_weight < 0.999)
    if len(light):
        order = light[np.argsort(fit.row_weight[light])][:20]
        tables.append(ReportTable("Rows that count less", ["line", "weight"], [
            [f"{measurements.line[i]}", f"{100 * fit.row_weight[i]:.0f} %"] for i in order], numbers=(0, 1)))
    others = [_residuals(measurements, fit), _by_pose(measurements, fit), _correlations(fit), _spectrum(fit)]
    if fit.profiles:
        others.insert(0, _profiles(fit))
    return render(Page(f"Identified stiffnesses: {Path(measurements.source).name}", _verdict(fit), _keys(fit), _steps(fit),
                       lead,
                       tables, [_intervals(cell, fit), _against(measurements, fit)], others, fit.findings, fit.as_dict()))


def _verdict(fit: Fit) -> Verdict:
    model = fit.model
    left = f"{model.fit['residual_rms_um']:.1f} µm RMS of the measured deflections are left unexplained"
    if model.rejected:
        return Verdict("bad", "DO NOT USE YET", f"Six springs do not explain these measurements ({model.rejected}): find out "
                                                f"why "
                       "first.")
    weak = [name for name, grade in zip(JOINTS, model.grades, strict=True) if grade != "reliable"]
    doubts = count_words(fit.findings, "error", "warning")
    if len(weak) == 6:
        return Verdict("bad", "NO STIFFNESS IS RELIABLE", f"These measurements tell no joint well; {left}.")
    if weak:
        return Verdict("caution", "USE WITH CARE", f"{', '.join(weak)} {'is' if len(weak) == 1 else 'are'} not known well from "
                       f"these measurements, the others are reliable; {left}.")
    if doubts:
        return Verdict("caution", f"IDENTIFIED, WITH {doubts.upper()} TO READ FIRST", f"All six stiffnesses are graded "
                                                                                      f"reliable; {left}.")
    return Verdict("good", "RELIABLE", f"All six stiffnesses are known; {left}.")


def _keys(fit: Fit) -> list[Key]:
    model = fit.model
    noise, worst = model.fit["noise"], int(np.argmax(model.log_std))
    keys = [Key("left unexplained", f"{model.fit['residual_rms_um']:.1f}", "µm", f"RMS of {model.fit['rows']} rows; sensor "
                                                                                 f"noise "
                f"{noise['sensor_scale']:.2f} times the stated")]
    if fit.held_out is not None:
        keys.append(Key("on rows not fitted", f"{1e6 * fit.held_out[0]:.1f} → {1e6 * fit.held_out[1]:.1f}", "µm",
                        "RMS, with what was known before and now"))
    return [*keys, Key("least certain joint", JOINTS[worst], "", f"2 sigma: {_two_sigma(model.log_std[worst])}"),
            Key("reliable joints", f"{sum(grade == 'reliable' for grade in model.grades)} of 6", "",
                f"{counted(len(fit.bad_visits), 'pose')} left out" if fit.bad_visits else "no pose left out")]


def _two_sigma(log_std: float) -> str:
    """Of a stiffness: per cent, and a factor where these would be over thirty."""
    wide = 2 * float(log_std)
    return f"{100 * wide:.1f} %" if wide < WIDE else f"a factor {np.exp(wide):.2g}"


def _steps(fit: Fit) -> list[Step]:
    diagnose = Step("Ask whether springs are all there is, and what else the robot does:",
                    call("diagnose", fit.cell.source, fit.measurements.source, "-o", "diagnosis.json", "--extended",
                         "stiffness_extended.json", "--report", "diagnose.html"))
    correct = Step(f"{'Correct a program' if runs_rapid(fit.cell.robot) else 'Predict a path'} with these stiffnesses:",
                   use_of_stiffnesses(fit.cell.robot, fit.cell.source, "stiffness.json", report=True))
    more = Step("Plan three more runs for the joints that are not known well:",
                call("design", fit.cell.source, "--add", 3, fit.measurements.source, *fit.measurements.weights, "-o",
                     "more.csv"))
    if fit.model.rejected:
        return [diagnose]
    return [diagnose, correct] if all(grade == "reliable" for grade in fit.model.grades) else [more, diagnose, correct]


def _some(count: int) -> slice:
    return slice(None, None, max(1, -(-count // MOST_POINTS)))


def _intervals(cell: Cell, fit: Fit) -> Figure:
    """Each stiffness on one logarithmic axis, with what was known before."""
    model, prior = fit.model, cell.prior.stiffness
    low, high = model.interval_95.T
    spread, place = np.exp(1.96 * cell.prior.log_std), np.arange(6)
    labels = [f"{name}: {k:.4g} N m/rad, 95 % {a:.4g} to {b:.4g}, {grade}" for name, k, a, b, grade in zip(
        JOINTS, model.stiffness, low, high, model.grades, strict=True)]
    series: list[Series] = [
        Points("known before, 95 %", place, prior, "possible", "dash", interval=(prior / spread, prior * spread)),
        Points("identified, 95 %", place, model.stiffness, "after", size=9, labels=labels, interval=(low, high))]
    return Figure("Stiffness with its interval", "Where a dot hides its blue bar the interval is narrower than the dot; "
                  "point at it for its numbers.",
                  [Panel(series, Axis(categories=JOINTS), Axis("stiffness [N m/rad]", log=True))])


def _residuals(measurements: Measurements, fit: Fit) -> Figure:
    some = _some(len(measurements))
    line = measurements.line[some]
    edge = 1.96e6 * fit.std[some, 2]
    series: list[Series] = [Band("95 % of the noise, z", line, -edge, edge)]
    series += [Points(AXES[axis], line, 1e6 * fit.residual[some, axis], AXIS_COLOURS[axis], size=5) for axis in range(3)]
    read = ~np.isnan(fit.residual)
    inside = 100 * float(np.mean(np.abs(fit.residual[read]) <= 1.96 * fit.std[read]))
    note = "" if len(line) == len(measurements) else f" {len(line)} of {len(measurements)} rows are drawn, evenly spaced."
    return Figure("Residuals in the order of the rows", "Band: 95 % of the estimated noise (sensor, force error, re-seating), "
                  f"drawn for z; {inside:.0f} % of all components are inside their own." + note, [
                      Panel(series, Axis("line of the measurement file"), Axis("measured minus predicted [um]"))])


def _by_pose(measurements: Measurements, fit: Fit) -> Figure:
    visits = np.unique(measurements.visit)
    _, first = np.unique(measurements.visit, return_index=True)
    place, read = np.searchsorted(visits, measurements.visit), ~np.isnan(fit.residual)
    square, count = (np.array([np.bincount(place, each) for each in values.T]) for values in (
        np.nan_to_num(fit.residual) ** 2, read.astype(float)))
    sizes = 1e6 * np.sqrt(square / np.maximum(count, 1))
    shown = np.sort(np.argsort(-np.max(sizes, axis=0), kind="stable")[:MOST_POSES])
    bars = [Bars(AXES[axis], sizes[axis][shown], AXIS_COLOURS[axis]) for axis in range(3)]
    names = [f"{measurements.line[first[visit]]}" for visit in shown]
    note = f" The {MOST_POSES} of {len(visits)} poses with the largest are drawn." if len(shown) < len(visits) else ""
    return Figure("Residual by pose and axis", "A pose or an axis that stands out points to what the model leaves out." + note,
                  [
        Panel(bars, Axis("pose, by the line of its first row", categories=names), Axis("residual RMS [um]"))])


def _correlations(fit: Fit) -> Figure:
    std = fit.model.log_std
    sentence = fit.ellipsoid.sentence
    return Figure("Which stiffnesses trade off (correlations of ln k)", f"{sentence[0].upper()}{sentence[1:]}.", [
        Panel([Cells(fit.model.covariance / np.outer(std, std))], Axis(categories=JOINTS), Axis(categories=JOINTS),
              height=290)])


def _spectrum(fit: Fit) -> Figure:
    series: list[Series] = [Bars("information", np.maximum(fit.spectrum, 1e-6), "after"),
                            Rule(1.0, "as much as was known before")]
    return Figure("How much the data say, direction by direction", "Each direction is a mixture of the six stiffnesses. Below "
                  "the dashed line what was known before says more than the data.", [
        Panel(series, Axis("direction, best known first", categories=[f"{i}" for i in range(1, 7)]),
              Axis("information of the data over the prior's", log=True))])


def _profiles(fit: Fit) -> Figure:
    series: list[Series] = [Line(f"k{profile.joint}: {profile.kind}", profile.stiffness, np.minimum(profile.drop, 10),
                                 f"s{profile.joint}") for profile in fit.profiles]
    series.append(Rule(1.92, "bound of the 95 % interval"))
    return Figure("Profile likelihood", "What the data alone say, without the prior.",
                  [Panel(series, Axis("stiffness [N m/rad]", log=True), Axis("drop of ln likelihood", from_zero=True))])


def _against(measurements: Measurements, fit: Fit) -> Figure:
    predicted = measurements.deflection - fit.residual
    series: list[Series] = []
    reach = 1.05e6 * float(np.nanmax(np.abs(predicted), initial=0.0))
    series.append(Line("explained", [-reach, reach], [-reach, reach], "muted", 1.0))
    for name, rows in (("fitted", ~measurements.validate), ("validation", measurements.validate)):
        picked = np.flatnonzero(rows)[_some(int(rows.sum()))]
        series += [Points(f"{AXES[axis]}, {name}", 1e6 * predicted[picked, axis], 1e6 * measurements.deflection[picked, axis],
                          AXIS_COLOURS[axis], "dot" if name == "fitted" else "cross", 5 if name == "fitted" else 7)
                   for axis in range(3) if len(picked)]
    return Figure("Measured against predicted", "Points on the line are explained by the model.", [
        Panel(series, Axis("predicted deflection [um]"), Axis("measured deflection [um]"), height=360)])

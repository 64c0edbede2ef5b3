"""The report of `design`: the plan, what it is worth, what it will tell, and what more runs would bring."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from identification.common.chart import AXIS_COLOURS, Axis, Bars, Figure, Line, Panel, Points, Series
from identification.common.command_line import call
from identification.common.findings import counted
from identification.common.quantities import parameter_words, two_sigma
from identification.common.report import Key, Page, ReportTable, Step, Verdict, View, count_words, render
from identification.common.scene import SpaceLine, scene
from identification.design.discrimination import Discrimination
from identification.design.domain import Domain
from identification.design.forecast import Forecast, spread
from identification.design.loads import FREE
from identification.design.plan import DesignPlan
from identification.design.program import RapidProgram
from identification.design.search import Design
from identification.design.sheet import Sheet
from identification.model.kinematics import chain

Array = NDArray[np.float64]
MOST_POINTS = 1500
# Half the length of the bar that shows the line of a load [m].
BAR_M = 0.15


def design_report(plan: DesignPlan, program: RapidProgram | None = None) -> str:
    """The report of `design`; program: the one that was written with it, whose findings it shows."""
    design, expected = plan.design, plan.forecast
    figures = [_shares(design, plan.sheet), _certificate(design)]
    if expected.runs and plan.aim is None:
        figures.append(_by_length(expected))
    tables = [_visits(plan.sheet), _joints(expected, plan.prepared.before), _causes(expected)]
    if isinstance(plan.aim, Discrimination):
        tables.insert(1, _pairs(plan.aim))
    findings = (*plan.findings, *(program.findings if program else ()))
    return render(Page(f"Measurement plan: {counted(len(design.task.demand), 'run')}, criterion {plan.criterion}",
                       _verdict(plan, count_words(findings, "error", "warning")), _keys(plan), _steps(plan),
                       [*plan.worth(tables=True), "Collisions were not checked: drive the poses in manual mode first."],
                       tables, [_arms(design.task.domain, plan.sheet)], figures, findings, plan.as_dict()))


def _verdict(plan: DesignPlan, doubts: str) -> Verdict:
    weak = [f"k{joint.joint}" for joint in plan.forecast.joints if joint.grade != "reliable"]
    efficiency = 100 * plan.design.certificate.efficiency
    known = "all six stiffnesses will be known well" if not weak else "none of the six stiffnesses will be known well"
    if 0 < len(weak) < 6:
        known = f"{', '.join(weak)} will not be known well, the others will"
    told = f" It names {plan.forecast.counts['identifiable']} of {len(plan.forecast.causes)} possible causes." * (
        plan.criterion == "C")
    sentence = (f"{counted(len(plan.sheet.label), 'pose')}, about {plan.sheet.time[-1] / 60:.0f} min: {known}.{told} At least "
                f"{np.floor(efficiency):.0f} % as good as any plan of this length with the same loads"
                f"{'' if plan.aim is None else ' by the stiffnesses alone'}.")
    if len(weak) == 6:
        return Verdict("bad", "THIS PLAN TELLS NO STIFFNESS WELL", sentence)
    if weak or doubts:
        return Verdict("caution", "PLANNED, BUT NOT EVERY JOINT WILL BE KNOWN" if weak else
                       f"PLANNED, WITH {doubts.upper()} TO READ FIRST", sentence)
    return Verdict("good", "PLANNED", sentence)


def _keys(plan: DesignPlan) -> list[Key]:
    joints = plan.forecast.joints
    worst = max(joints, key=lambda joint: joint.after)
    counts = plan.forecast.counts
    minutes, efficiency = plan.sheet.time[-1] / 60, np.floor(100 * plan.design.certificate.efficiency)
    keys = [Key("poses", f"{len(plan.sheet.label)}", "", f"{len(plan.sheet.visit)} rows, about {minutes:.0f} min"),
            Key("least certain afterwards", f"k{worst.joint}", "", f"{spread(worst.after)} (2 sigma)"),
            Key("of the best possible", f"{efficiency:.0f}", "%", "at least, by its certificate" if plan.aim is None else
                "at least, by the stiffnesses alone"),
            Key("causes it can name", f"{counts.get('identifiable', 0)}", "",
                f"of {len(plan.forecast.causes)}, at their typical size")]
    prediction = plan.prediction_std_um
    if prediction is not None:
        keys[2:2] = [Key("along the program", f"{prediction[0]:.3g} → {prediction[1]:.2g}", "µm",
                         "uncertainty of the deflection, RMS")]
    return keys[:5]


def _steps(plan: DesignPlan) -> list[Step]:
    cell = plan.design.task.domain.rig.cell.source
    if plan.further:
        return [Step("Drive the poses in manual mode first: collisions were not checked. Measure them, append the rows to your "
                     "measurements, and diagnose again:",
                     call("diagnose", cell, "measurements.csv", "-o", "diagnosis.json", "--force"))]
    return [Step("Drive the poses in manual mode first: collisions were not checked. Measure, fill in dx_um dy_um dz_um of "
                 "the plan, save it as measurements.csv, then:",
                 call("identify", cell, "measurements.csv", "-o", "stiffness.json", "--report", "identify.html"))]


def _visits(sheet: Sheet) -> ReportTable:
    table = []
    for number, (label, theta) in enumerate(zip(sheet.label, np.degrees(sheet.theta), strict=True)):
        forces = sheet.force[sheet.visit == number]
        # Signed along the load's line: positive where its largest component is.
        line = forces[np.argmax(np.linalg.norm(forces, axis=1))]
        line = line * np.sign(line[np.argmax(np.abs(line))])
        signs = np.where(forces @ line < 0, -1, 1) if len(sheet.axes[number]) == 1 or sheet.axes[number] == FREE else np.sign(
            forces[np.arange(len(forces)), np.abs(forces).argmax(axis=1)])
        loads = ", ".join(f"{size:g}" for size in np.round(signs * np.linalg.norm(forces, axis=1), 1) + 0.0)
        if sheet.hung:
            loads = ", ".join(f"{mass:g} kg" for mass in sheet.masses(number))
        table.append([label, sheet.along(number), sheet.purpose(number),
                      *(f"{angle:.3f}" for angle in np.round(theta, 3) + 0.0), loads])
    header = ["pose", "along", "purpose", *(f"q{i} [deg]" for i in range(1, 7)), "loads" if sheet.hung else "loads [N]"]
    return ReportTable("The plan, in the order of the runs", header, table, numbers=tuple(range(3, 9)))


def _pairs(discrimination: Discrimination) -> ReportTable:
    return ReportTable("Which causes it tells apart", ["one", "other", "expected difference [sigma]"],
                       [[first, second, f"{sigmas:.1f}"] for first, second, sigmas in discrimination.pairs], numbers=(2,))


def _joints(expected: Forecast, before: str) -> ReportTable:
    header = ["stiffness", "before", "after (2 sigma)", "grade", "trades off with"]
    return ReportTable(f"What it will tell of the joints, starting from {before}", header, [
        [f"k{joint.joint}", spread(joint.before), spread(joint.after), joint.grade,
         f"k{joint.partner} ({joint.correlation:+.2f})" if joint.partner else ""] for joint in expected.joints])


def _causes(expected: Forecast) -> ReportTable:
    ranked = sorted(expected.causes, key=lambda cause: cause.identifiable)
    return ReportTable("What it will tell of causes beyond the springs: the smallest size found, and named, in 4 of 5 cases",
                       ["cause", "found from", "named from", "typical", "unit", "parameter", "at its typical size",
                        "not told from"],
                       [[cause.entry.label, cause.shown(cause.detectable), cause.shown(cause.identifiable),
                         cause.shown(1.0), cause.read_in[1], parameter_words(cause.parameter), cause.grade,
                         ", ".join(cause.alike)] for cause in ranked], numbers=(1, 2, 3))


def _arms(domain: Domain, sheet: Sheet) -> View:
    """The arm at each pose as lines through its joints, the load's axis at the TCP."""
    robot = domain.rig.cell.robot
    frames = chain(robot, np.ascontiguousarray(robot.serial_angles(sheet.theta).T))
    tcp = domain.look(sheet.theta).tcp
    lines = []
    for i in range(len(sheet.label)):
        # Axis 2 after its lateral offset, axis 3, wrist centre, flange, TCP.
        points = np.vstack([[0, 0, 0], frames.origins[0, :, i], frames.origins[1, :, i], frames.origins[2, :, i],
                            frames.origins[3, :, i], frames.origins[5, :, i], tcp[i]])
        force = np.abs(sheet.force[sheet.visit == i]).max(axis=0)
        colour = "muted" if sheet.validate[i] else AXIS_COLOURS[int(np.argmax(force))]
        lines.append(SpaceLine(points, colour, 3.0, dots=5.0))
        lines += [SpaceLine(tcp[i] + np.outer([-BAR_M, BAR_M], line), colour, 8.0)
                  for line in _lines(sheet.force[sheet.visit == i])]
    return scene("The poses", "The arm from its base to the TCP, base frame, metres. Colour: the base axis nearest to its "
                 "load (x blue, y orange, z green), grey: kept back for validation. The thick bar at the TCP is the line of "
                 "the load. Collisions were not checked.", lines)


def _lines(forces: Array) -> list[Array]:
    """The directions (3,) along which a visit is loaded."""
    lines: list[Array] = []
    for force in forces[np.linalg.norm(forces, axis=1) > 0]:
        line = force / np.linalg.norm(force)
        if not any(abs(line @ other) > 0.999 for other in lines):
            lines.append(line)
    return lines


def _shares(design: Design, sheet: Sheet) -> Figure:
    """What each run adds to what is known of each stiffness: the precision of ln k with the others known."""
    fitted = sheet.of_purpose(validate=False)
    gains = np.diagonal(design.runs.information[fitted.run], axis1=1, axis2=2)
    share = 100 * gains / (np.diag(design.task.prior) + gains.sum(axis=0))
    bars = [Bars(f"{label} {fitted.along(n)}", share[n], f"s{1 + n % 8}") for n, label in enumerate(fitted.label)]
    return Figure("Which run tells of which joint", "Each run's share of the information on a stiffness, the others held.", [
        Panel(bars, Axis(categories=[f"k{i}" for i in range(1, 7)]), Axis("share [%]"), stacked=True)])


def _certificate(design: Design) -> Figure:
    """The sensitivity function over all runs looked at: nothing may rise above 1 at the optimum."""
    certificate = design.certificate
    support = certificate.support
    slope = design.task.criterion.slope(
        design.task.approximate_information(support, certificate.weights))
    pool = certificate.pool
    gain = np.einsum("ij,nij->n", slope, pool.information)
    level = float(np.average(np.einsum("ij,nij->n", slope, support.information), weights=certificate.weights))
    order = np.argsort(-gain)
    rows = order[np.unique(np.geomspace(1, len(order), min(MOST_POINTS, len(order))).astype(int) - 1)]
    plan = np.einsum("ij,nij->n", slope, design.runs.information)
    series: list[Series] = [
        Line("possible runs", 1 + np.searchsorted(-gain[order], -gain[rows]), gain[rows] / level, "possible", 3.0),
        # One that is among the possible has the rank that it has there, whatever its last digit.
        Points("this plan's runs", 1 + np.searchsorted(-gain[order], -plan * (1 + 1e-9)), plan / level, "before", size=9)]
    return Figure("The certificate", "Worth of every run that was looked at, the best first, in units of the runs of the "
                  "continuous optimum. No run above 1 means that no plan is better than that optimum (equivalence theorem).", [
                      Panel(series, Axis("rank of the run", log=True), Axis("worth of a run", from_zero=True))])


def _by_length(expected: Forecast) -> Figure:
    stds = [100 * two_sigma(std) for std in expected.stds]
    labels = [f"{counted(runs, 'run')}: {std:.2g} %" for runs, std in zip(expected.runs, stds, strict=True)]
    series: list[Series] = [Line("", expected.runs, stds, "before"), Points("", expected.runs, stds, "before", labels=labels)]
    return Figure("More or fewer runs", "Largest uncertainty of a stiffness after plans of other lengths, from the same search "
                  "without refinement.", [Panel(series, Axis("runs"), Axis("2 sigma of ln k [%]", log=True))])

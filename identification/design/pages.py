"""The report of `design`: the plan, what it is worth, what it will tell, and what more runs would bring."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.common.report import AXIS_COLOURS, Figure, ReportTable, render
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
GRID = {"gridcolor": "#eee", "zerolinecolor": "#888"}
PLAN, POSSIBLE, KEPT = "#c0392b", "#b8c4d0", "#777777"
MOST_POINTS = 1500
# Half the length of the bar that shows the line of a load [m].
BAR_M = 0.15
# Room below for the axis' title.
ROOMY = {"l": 70, "r": 20, "t": 30, "b": 75}


def design_report(plan: DesignPlan, program: RapidProgram | None = None) -> str:
    """The report of `design`; program: the one that was written with it, whose findings it shows."""
    design, expected, discrimination = plan.design, plan.forecast, plan.discrimination
    figures = [_arms(design.task.domain, plan.sheet), _shares(design, plan.sheet), _certificate(design)]
    if expected.runs and discrimination is None:
        figures.append(_by_length(expected))
    tables = [_visits(plan.sheet), _joints(expected, plan.prepared.before), _causes(expected)]
    if discrimination is not None:
        tables.insert(1, _pairs(discrimination))
    return render(f"Measurement plan: {len(design.task.demand)} runs, criterion {design.task.criterion.name}",
                  [*plan.worth(joints=False), "Collisions were not checked: drive the poses in manual mode first."], tables,
                  figures, (*plan.findings, *(program.findings if program else ())), plan.as_dict())


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
                      *(f"{angle:.3f}" for angle in theta), loads])
    header = ["pose", "along", "purpose", *(f"q{i} [deg]" for i in range(1, 7)), "loads" if sheet.hung else "loads [N]"]
    return ReportTable("The plan, in the order of the runs", header, table, numbers=tuple(range(3, 9)))


def _pairs(discrimination: Discrimination) -> ReportTable:
    return ReportTable("Which causes it tells apart", ["one", "other", "expected difference [sigma]"],
                       [[first, second, f"{sigmas:.1f}"] for first, second, sigmas in discrimination.pairs], numbers=(2,))


def _joints(expected: Forecast, before: str) -> ReportTable:
    header = ["stiffness", "before", "after (1 sigma)", "grade", "trades off with"]
    return ReportTable(f"What it will tell of the joints, starting from {before}", header, [
        [f"k{joint.joint}", spread(joint.before), spread(joint.after), joint.grade,
         f"k{joint.partner} ({joint.correlation:+.2f})" if joint.partner else ""] for joint in expected.joints])


def _causes(expected: Forecast) -> ReportTable:
    ranked = sorted(expected.causes, key=lambda cause: cause.identifiable)
    return ReportTable("What it will tell of causes beyond the springs: the smallest size found, and named, in 4 of 5 cases",
                       ["cause", "found from", "named from", "typical", "unit", "parameter", "at its typical size",
                        "not told from"],
                       [[cause.entry.label, cause.shown(cause.detectable), cause.shown(cause.identifiable),
                         f"{cause.typical:.2g}", "" if cause.unit == "1" else cause.unit, cause.parameter, cause.grade,
                         ", ".join(cause.alike)] for cause in ranked], numbers=(1, 2, 3))


def _arms(domain: Domain, sheet: Sheet) -> Figure:
    """The arm at each pose as lines through its joints, the load's axis at the TCP."""
    robot = domain.rig.cell.robot
    frames = chain(robot, np.ascontiguousarray(robot.serial_angles(sheet.theta).T))
    tcp = domain.look(sheet.theta).tcp
    data: list[dict[str, Any]] = []
    for i, label in enumerate(sheet.label):
        # Axis 2 after its lateral offset, axis 3, wrist centre, flange, TCP.
        points = np.vstack([[0, 0, 0], frames.origins[0, :, i], frames.origins[1, :, i], frames.origins[2, :, i],
                            frames.origins[3, :, i], frames.origins[5, :, i], tcp[i]])
        force = np.abs(sheet.force[sheet.visit == i]).max(axis=0)
        colour = KEPT if sheet.validate[i] else AXIS_COLOURS[int(np.argmax(force))]
        data.append({"type": "scatter3d", "mode": "lines+markers", "x": points[:, 0], "y": points[:, 1], "z": points[:, 2],
                     "name": f"{label} {sheet.along(i)}", "line": {"color": colour, "width": 5}, "marker": {"size": 2.5}})
        data += [_load(tcp[i], force, colour) for force in _lines(sheet.force[sheet.visit == i])]
    caption = ("The arm from its base to the TCP. Colour: the base axis nearest to its load (x blue, y orange, z green), grey: "
            "kept back for validation. The thick bar at the TCP is the line of the load. Collisions were not checked.")
    return Figure("The poses", caption, data,
                  {"scene": {"aspectmode": "data", "xaxis": {"title": {"text": "x [m]"}}, "yaxis": {"title": {"text": "y [m]"}},
                             "zaxis": {"title": {"text": "z [m]"}}}}, height=620)


def _lines(forces: Array) -> list[Array]:
    """The directions (3,) along which a visit is loaded."""
    lines: list[Array] = []
    for force in forces[np.linalg.norm(forces, axis=1) > 0]:
        line = force / np.linalg.norm(force)
        if not any(abs(line @ other) > 0.999 for other in lines):
            lines.append(line)
    return lines


def _load(tcp: Array, line: Array, colour: str) -> dict[str, Any]:
    ends = tcp + np.outer([-BAR_M, BAR_M], line)
    return {"type": "scatter3d", "mode": "lines", "x": ends[:, 0], "y": ends[:, 1], "z": ends[:, 2], "showlegend": False,
            "hoverinfo": "skip", "line": {"color": colour, "width": 14}, "opacity": 0.5}


def _shares(design: Design, sheet: Sheet) -> Figure:
    """What each run adds to what is known of each stiffness: the precision of ln k with the others known."""
    fitted = sheet.of_purpose(validate=False)
    gains = np.diagonal(design.runs.information[fitted.run], axis1=1, axis2=2)
    share = 100 * gains / (np.diag(design.task.prior) + gains.sum(axis=0))
    data = [{"type": "bar", "x": [f"k{i}" for i in range(1, 7)], "y": share[n], "name": f"{label} {fitted.along(n)}"}
            for n, label in enumerate(fitted.label)]
    return Figure("Which run tells of which joint", "Each run's share of the information on a stiffness, the others held.",
                  data, {
        "barmode": "stack", "yaxis": {"title": {"text": "share [%]"}, **GRID}})


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
    plan = np.einsum("ij,nij->n", slope, design.runs.information) / level
    return Figure("The certificate", "Worth of every run that was looked at, the best first, in units of the runs of the "
                  "continuous optimum. No run above 1 means that no plan is better than that optimum (equivalence theorem).", [
                      {"type": "scatter", "mode": "lines", "x": 1 + np.searchsorted(-gain[order], -gain[rows]),
                       "y": gain[rows] / level, "name": "possible runs", "line": {"color": POSSIBLE, "width": 3}},
                      {"type": "scatter", "mode": "markers", "x": 1 + np.searchsorted(-gain[order], -plan * level), "y": plan,
                       "name": "this plan's runs", "marker": {"color": PLAN, "size": 9}}], {
                      "xaxis": {"type": "log", "title": {"text": "rank of the run"}, **GRID}, "margin": ROOMY,
                      "yaxis": {"title": {"text": "worth of a run"}, "rangemode": "tozero", **GRID}})


def _by_length(expected: Forecast) -> Figure:
    return Figure("More or fewer runs", "Largest uncertainty of a stiffness after plans of other lengths, from the same search "
                  "without refinement.", [
                      {"type": "scatter", "mode": "lines+markers", "x": list(expected.runs),
                       "y": [100 * std for std in expected.stds], "line": {"color": PLAN}}], {
                      "xaxis": {"title": {"text": "runs"}, **GRID}, "margin": ROOMY,
                      "yaxis": {"type": "log", "title": {"text": "1 sigma of ln k [%]"}, **GRID}})

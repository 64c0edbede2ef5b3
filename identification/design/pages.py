"""The report of `design`: the plan, what it is worth, what it will tell, and what more runs would bring."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.common.findings import Finding
from identification.common.report import AXIS_COLOURS, Figure, ReportTable, render
from identification.design.discrimination import Settled
from identification.design.domain import Domain
from identification.design.forecast import Forecast
from identification.design.loads import FREE
from identification.design.procedure import Design, approximate_information
from identification.design.record import Plan, along, spread, worth
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


def design_report(plan: Plan, findings: Sequence[Finding], content: dict[str, Any]) -> str:
    """The report of `design`."""
    found, rows, expected = plan.found, plan.rows, plan.expected
    figures = [_arms(plan.prepared.task.domain, rows), _shares(found, rows), _certificate(found)]
    if expected.runs and plan.settled is None:
        figures.append(_by_length(expected))
    tables = [_visits(rows), _joints(expected, plan.prepared.before), _causes(expected)]
    if plan.settled is not None:
        tables.insert(1, _pairs(plan.settled))
    return render(f"Measurement plan: {len(found.task.demand)} runs, criterion {found.task.criterion.name}",
                  [*worth(plan, joints=False), "Collisions were not checked: drive the poses in manual mode first."], tables,
                  figures, findings, content)


def _visits(rows: Sheet) -> ReportTable:
    table = []
    for number, (label, theta) in enumerate(zip(rows.label, np.degrees(rows.theta), strict=True)):
        forces = rows.force[rows.visit == number]
        # Signed along the load's line: positive where its largest component is.
        line = forces[np.argmax(np.linalg.norm(forces, axis=1))]
        line = line * np.sign(line[np.argmax(np.abs(line))])
        signs = np.where(forces @ line < 0, -1, 1) if len(rows.axes[number]) == 1 or rows.axes[number] == FREE else np.sign(
            forces[np.arange(len(forces)), np.abs(forces).argmax(axis=1)])
        loads = ", ".join(f"{size:g}" for size in np.round(signs * np.linalg.norm(forces, axis=1), 1) + 0.0)
        table.append([label, along(rows, number), "validate" if rows.validate[number] else "identify",
                      *(f"{angle:.3f}" for angle in theta), loads])
    header = ["pose", "along", "purpose", *(f"q{i} [deg]" for i in range(1, 7)), "loads [N]"]
    return ReportTable("The plan, in the order of the runs", header, table, numbers=tuple(range(3, 9)))


def _pairs(settled: Settled) -> ReportTable:
    return ReportTable("Which causes it tells apart", ["one", "other", "expected difference [sigma]"],
                       [[one, other, f"{sigmas:.1f}"] for one, other, sigmas in settled.pairs], numbers=(2,))


def _joints(expected: Forecast, before: str) -> ReportTable:
    header = ["stiffness", "before", "after (1 sigma)", "grade", "trades off with"]
    return ReportTable(f"What it will tell of the joints, starting from {before}", header, [
        [f"k{one.joint}", spread(one.before), spread(one.after), one.grade,
         f"k{one.partner} ({one.correlation:+.2f})" if one.partner else ""] for one in expected.joints])


def _causes(expected: Forecast) -> ReportTable:
    ranked = sorted(expected.causes, key=lambda one: one.identifiable)
    return ReportTable("What it will tell of causes beyond the springs: the smallest size found, and named, in 4 of 5 cases",
                       ["cause", "found from", "named from", "typical", "unit", "parameter", "at its typical size",
                        "not told from"],
                       [[one.entry.label, one.shown(one.detectable), one.shown(one.identifiable),
                         f"{one.typical:.2g}", "" if one.unit == "1" else one.unit, one.parameter, one.grade,
                         ", ".join(one.alike)] for one in ranked], numbers=(1, 2, 3))


def _arms(domain: Domain, rows: Sheet) -> Figure:
    """The arm at each pose as lines through its joints, the load's axis at the TCP."""
    robot = domain.rig.cell.robot
    frames = chain(robot, np.ascontiguousarray(robot.serial_angles(rows.theta).T))
    tcp = domain.look(rows.theta).tcp
    data: list[dict[str, Any]] = []
    for i, label in enumerate(rows.label):
        # Axis 2 after its lateral offset, axis 3, wrist centre, flange, TCP.
        points = np.vstack([[0, 0, 0], frames.origins[0, :, i], frames.origins[1, :, i], frames.origins[2, :, i],
                            frames.origins[3, :, i], frames.origins[5, :, i], tcp[i]])
        force = np.abs(rows.force[rows.visit == i]).max(axis=0)
        colour = KEPT if rows.validate[i] else AXIS_COLOURS[int(np.argmax(force))]
        data.append({"type": "scatter3d", "mode": "lines+markers", "x": points[:, 0], "y": points[:, 1], "z": points[:, 2],
                     "name": f"{label} {along(rows, i)}", "line": {"color": colour, "width": 5}, "marker": {"size": 2.5}})
        data += [_load(tcp[i], force, colour) for force in _lines(rows.force[rows.visit == i])]
    said = ("The arm from its base to the TCP. Colour: the base axis nearest to its load (x blue, y orange, z green), grey: "
            "kept back for validation. The thick bar at the TCP is the line of the load. Collisions were not checked.")
    return Figure("The poses", said, data,
                  {"scene": {"aspectmode": "data", "xaxis": {"title": {"text": "x [m]"}}, "yaxis": {"title": {"text": "y [m]"}},
                             "zaxis": {"title": {"text": "z [m]"}}}}, height=620)


def _lines(forces: Array) -> list[Array]:
    """The directions (3,) along which a visit is loaded."""
    found: list[Array] = []
    for force in forces[np.linalg.norm(forces, axis=1) > 0]:
        line = force / np.linalg.norm(force)
        if not any(abs(line @ other) > 0.999 for other in found):
            found.append(line)
    return found


def _load(tcp: Array, line: Array, colour: str) -> dict[str, Any]:
    ends = tcp + np.outer([-BAR_M, BAR_M], line)
    return {"type": "scatter3d", "mode": "lines", "x": ends[:, 0], "y": ends[:, 1], "z": ends[:, 2], "showlegend": False,
            "hoverinfo": "skip", "line": {"color": colour, "width": 14}, "opacity": 0.5}


def _shares(found: Design, rows: Sheet) -> Figure:
    """What each run adds to what is known of each stiffness: the precision of ln k with the others known."""
    task = found.task
    rows = rows.of_purpose(validate=False)
    gains = np.diagonal(found.runs.information[rows.run], axis1=1, axis2=2)
    share = 100 * gains / (np.diag(task.prior) + gains.sum(axis=0))
    data = [{"type": "bar", "x": [f"k{i}" for i in range(1, 7)], "y": share[n], "name": f"{label} {along(rows, n)}"}
            for n, label in enumerate(rows.label)]
    return Figure("Which run tells of which joint", "Each run's share of the information on a stiffness, the others held.",
                  data, {
        "barmode": "stack", "yaxis": {"title": {"text": "share [%]"}, **GRID}})


def _certificate(found: Design) -> Figure:
    """The sensitivity function over all runs looked at: nothing may rise above 1 at the optimum."""
    certificate = found.certificate
    support = certificate.support
    slope = found.task.criterion.slope(approximate_information(found.task, certificate))
    pool = certificate.pool
    gain = np.einsum("ij,nij->n", slope, pool.information)
    level = float(np.average(np.einsum("ij,nij->n", slope, support.information), weights=certificate.weights))
    order = np.argsort(-gain)
    rows = order[np.unique(np.geomspace(1, len(order), min(MOST_POINTS, len(order))).astype(int) - 1)]
    plan = np.einsum("ij,nij->n", slope, found.runs.information) / level
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

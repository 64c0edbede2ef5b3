"""The report of `predict` and `correct`: the answer, the path in space, and what stands behind both."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from compensator.correction.budget import Budget
from compensator.correction.budget_pages import budget_figure, budget_sentence, budget_tables
from compensator.correction.correct import Corrected
from compensator.correction.expected_left import CAUSES
from compensator.correction.feed_pages import feed_figures, feed_tables
from compensator.correction.first_screen import keys_of, micrometres, name_of, steps_of, verdict_of
from compensator.correction.path_view import Quantity, components, path_view, spread
from compensator.correction.predict import Predicted
from compensator.correction.settings import EXACTLY_ONE
from identification.common.chart import AXES, AXIS_COLOURS, Axis, Figure, Line, Panel
from identification.common.findings import counted
from identification.common.report import Page, ReportTable, View, render


def budget_report(budget: Budget) -> str:
    """The report of a predicted program with its error budget."""
    return path_report(budget.corrected.planned, budget)


def path_report(job: Predicted | Corrected, budget: Budget | None = None, offsets: Path | None = None) -> str:
    """The report of one program, predicted or corrected; budget: of a predicted one; offsets: the file written of a corrected
    one's."""
    corrected = job if isinstance(job, Corrected) else None
    predicted = job.predicted if isinstance(job, Corrected) else job
    figures = job.as_dict()
    name = name_of(predicted)
    # Of the program as given: what the correction adds between its targets is told of by itself.
    given = (corrected.planned if corrected is not None else predicted).as_dict()
    deviation, std = given["deviation_um"], given["deviation_std_um"]
    lead = [
        f"{given['with_force']} of {given['targets']} targets of {name} carry force. Without correction the tool is pushed "
        f"off its path by up to {micrometres(deviation['largest'])} um ({micrometres(deviation['rms'])} um RMS); that "
        f"prediction is uncertain by up to {2 * std['largest']:.1f} um (2 sigma)."]
    rows = [["targets", f"{given['targets']}"], ["with force", f"{given['with_force']}"],
            ["without a sample", f"{given['without_sample']}"],
            ["predicted deviation, largest / RMS [um]", f"{deviation['largest']:.1f} / {deviation['rms']:.1f}"],
            ["its 2 sigma, largest / RMS [um]", f"{2 * std['largest']:.1f} / {2 * std['rms']:.1f}"]]
    if corrected is not None:
        offset, residual = figures["offset_mm"], figures["residual_um"]
        lead.append(
            f"Corrected: {corrected.corrected_words()}, by up to {offset['largest']:.3f} mm. With the written "
            f"numbers the same model leaves {residual['largest']:.2f} um at most. "
            f"{corrected.left.sentence()} "
            f"Of {counted(figures['corrected'], 'target')} {figures['expected_worse']:.1f} are expected to end up farther off "
            "than uncorrected. "
            + (f"The force follows the cut: {corrected.stiffness.words()} ({corrected.stiffness.origin})."
               if corrected.left_as_logged is None and corrected.stiffness is not None else
               f"The forces are predicted from the stock, for a tool on its plan: {corrected.as_logged()}."
               if corrected.logged.on_plan else
               "The forces are taken as logged. A corrected path cuts a little more, and the force changes with it: "
               f"{corrected.as_logged()}."))
        if predicted.settings.correction.scale == EXACTLY_ONE:
            lead.append("The stiffnesses come from load tests at rest. In motion robots have been measured to give way more: "
                        "measure a corrected pass, and let verify set --scale.")
        waits = figures["waiting"]
        if waits["targets"]:
            lead.append(f"{counted(waits['targets'], 'target')} wait for the log of this pass: by it up to "
                        f"{waits['two_sigma_um']:.0f} um (2 sigma) fall to about {waits['two_sigma_then_um']:.0f}. Log it, and "
                        "correct the planned program with --forces that log, --logged-with the offsets.csv of this correction "
                        f"and --first-forces {predicted.forces.log.source}.")
        if corrected.advice is not None:
            lead += corrected.advice.lines()
        rows += [["intermediate targets", f"{figures['added_targets']}"],
                 *([] if corrected.stiffness is None else [[
                     f"cutting stiffness ({corrected.stiffness.origin}), 2 sigma [N/mm]",
                     f"{1e-3 * corrected.stiffness.value:.3g}, {2e-3 * corrected.stiffness.std:.2g}"]]),
                 ["corrections held back", f"{figures['held_back']}"],
                 ["largest correction [mm]", f"{offset['largest']:.4f}"],
                 ["largest rotation [deg]", f"{figures['turn_deg']['largest']:.4f}"],
                 ["left at targets by the same model, largest / RMS [um]",
                  f"{residual['largest']:.2f} / {residual['rms']:.2f}"]]
        for cause, words in CAUSES.items():
            rows.append([f"expected to be left on the part: {words}, 2 sigma, RMS [um]",
                         f"{2 * figures['expected_left_um'][cause]:.2f}"])
        if figures["between_um"]:
            between = figures["between_um"]
            rows.append(["left between targets, largest / RMS [um]", f"{between['largest']:.2f} / {between['rms']:.2f}"])
            lead.append(f"Between the targets of the {between['moves']} moves that were looked at it leaves "
                        f"{between['largest']:.1f} um at most; zones are not counted.")
    taken = (corrected.planned if corrected is not None else predicted).taken.words
    lead += [f"No file proves this, compare it with what you know: {words}." for words in taken]
    tables = [ReportTable("In figures", ["what", "value"], rows, numbers=(1,))]
    # Absurd numbers overflow on their way to a picture; the findings say so, NumPy need not.
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        first = [_space(job, budget)]
    others: list[Figure | View] = [_along(predicted, corrected)]
    findings = job.findings
    if budget is not None:
        lead.append(budget_sentence(budget))
        tables += budget_tables(budget)
        others.insert(0, budget_figure(budget))
        findings, figures = (*findings, *budget.findings), figures | {"budget": budget.as_dict()}
    if corrected is not None and corrected.feed is not None:
        tables += feed_tables(corrected.feed)
        others += feed_figures(corrected.feed)
    return render(Page(f"{'Corrected' if corrected else 'Predicted'}: {name}", verdict_of(job, budget), keys_of(job, budget),
                       steps_of(job, budget, offsets), lead, tables, first, others, findings, figures))


def _space(job: Predicted | Corrected, budget: Budget | None) -> View:
    """The path, with all that can be shown along it; of a budget that of the correction it is about."""
    corrected = budget.corrected if budget is not None else job if isinstance(job, Corrected) else None
    predicted = corrected.predicted if corrected is not None else job
    assert isinstance(predicted, Predicted)
    path, targets, prediction = predicted.path, predicted.targets, predicted.prediction
    count = len(path.toolpath)
    size = np.linalg.norm(prediction.at_rest, axis=1)
    shown = [Quantity("deviation", "Deviation", "um", spread(1e6 * size, targets, count),
                      "Predicted deviation of the tool without correction, its size."),
             *components(predicted, prediction.at_rest),
             Quantity("sigma", "Uncertainty", "um", spread(
                 2e6 * np.sqrt(np.trace(prediction.at_rest_covariance, axis1=1, axis2=2)), targets, count),
                 "How uncertain the predicted deviation is: 2 sigma of its size.")]
    if corrected is not None:
        offset = 1e3 * np.linalg.norm(corrected.correction.offset, axis=1)
        shown += [Quantity("correction", "Correction", "mm", spread(offset, corrected.correction.targets, count),
                           "How far the written target is from the planned one.", digits=4)]
        # Where the part will not be good: shown first, at the place where it is largest.
        shown.insert(0, Quantity(
            "left", "Expected left", "um", spread(2e6 * corrected.left.std, targets, count),
            "What is expected to be left on the part after the correction, 2 sigma, all causes together."))
    if budget is not None:
        shown.insert(0, Quantity(
            "share", "Share of tolerance", "%", spread(1e2 * budget.two_sigma / budget.tolerance, targets, count),
            f"Two sigma of what is expected on the part after the correction, as a share of {1e6 * budget.tolerance:g} µm.",
            "share", tolerance=100.0))
    planned = corrected.planned if corrected is not None else predicted
    findings = (*job.findings, *(budget.findings if budget is not None else ()))
    title = "The path and where the tool is pushed" if corrected is None else "The path and what is expected to be left on it"
    return path_view(title, "Base frame, millimetres. Lines and targets are those of the program as given. Thin grey: no "
                     "force. Marks: findings that name a line.", path, shown, planned.program.text, findings)


def _along(predicted: Predicted, corrected: Corrected | None) -> Figure:
    """The components of the deviation along the path."""
    targets, count = predicted.targets, len(predicted.path.toolpath)
    length = 1e3 * predicted.path.length
    series = []
    for axis, colour in enumerate(AXIS_COLOURS):
        value, sigma = 1e6 * predicted.prediction.at_rest[:, axis], 1e6 * predicted.prediction.at_rest_std[:, axis]
        series.append(Line(f"d{AXES[axis]}", length, spread(value, targets, count), colour))
        series += [Line("", length, spread(value + sign * sigma, targets, count), colour, 0.6, dashed=True, legend=False)
                   for sign in (-2, 2)]
    if corrected is not None:
        series.append(Line("left, same model", length, spread(1e6 * corrected.residual, targets, count), "ink"))
    return Figure("Deviation along the path", "Predicted deviation of the uncorrected program, base frame; dashed: 2 sigma, "
                  "where it is wide enough to see. Of very many targets the lowest and highest of each stretch are drawn.",
                  [Panel(series, Axis("path length [mm]"), Axis("deviation [um]"))])

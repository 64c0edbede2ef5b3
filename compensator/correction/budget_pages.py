"""The error budget in the report of `predict`: what spends the tolerance along the path, where it fails, what would help."""

from __future__ import annotations

from compensator.correction.budget import SIGMAS, Budget
from compensator.correction.expected_left import CAUSES
from compensator.correction.path_view import spread
from identification.common.chart import Axis, Figure, Line, Panel, Rule, Series
from identification.common.findings import verb
from identification.common.report import ReportTable

# So many places are listed; the JSON result holds all.
SHOWN = 20
# Of causes that go together the second is dashed.
COLOURS = {"model": "s1", "force": "s7", "scatter": "s8", "sensor": "s3", "mounting": "s3", "motion": "s2", "cut": "s4",
           "learned": "s6", "accuracy": "s6", "between": "s5"}
DASHED = ("mounting", "accuracy")


def budget_sentence(budget: Budget) -> str:
    """For the top of the page."""
    figures = budget.as_dict()
    cause, most = max(figures["causes"].items(), key=lambda item: item[1]["share_of_tolerance"])
    first = figures["remedies"][0] if figures["remedies"] else None
    return (f"Error budget for a tolerance of {figures['tolerance_um']:g} um: uncorrected {figures['uncorrected_over']} of "
            f"{figures['targets']} targets with force, those that the correction adds among them, would be over it. "
            f"Corrected, {figures['over']} {verb(figures['over'], 'are')} expected over it by two sigma; the largest cause is "
            f"{CAUSES[cause]}, "
            f"{100 * most['share_of_tolerance']:.0f} % of the tolerance."
            + (f" What would help most: {first['do']} ({first['gain_um']:.1f} um of {figures['two_sigma_um']['rms']:.1f} um "
               "RMS)." if first else ""))


def budget_tables(budget: Budget) -> list[ReportTable]:
    """Causes, places and remedies."""
    figures = budget.as_dict()
    causes = [[CAUSES[cause], f"{of['two_sigma_um']['rms']:.1f}", f"{of['two_sigma_um']['largest']:.1f}",
               f"{100 * of['share_of_tolerance']:.1f} %", f"{100 * of['share_of_square']:.0f} %"]
              for cause, of in figures["causes"].items() if of["two_sigma_um"]["largest"]]
    two = figures["two_sigma_um"]
    causes.append(["all together", f"{two['rms']:.1f}", f"{two['largest']:.1f}",
                   f"{100 * two['rms'] / figures['tolerance_um']:.1f} %", "100 %"])
    tables = [ReportTable("Error budget", ["cause", "two sigma, RMS [um]", "largest [um]", "of the tolerance", "share of all"],
                          causes, numbers=(1, 2, 3, 4))]
    if figures["remedies"]:
        header = ["what", "takes", "gains [um]", "then RMS / largest [um]", "then over the tolerance"]
        tables.append(ReportTable("What would help", header, [
            [remedy["do"], remedy["effort"], f"{remedy['gain_um']:.1f}",
             f"{remedy['two_sigma_um']['rms']:.1f} / {remedy['two_sigma_um']['largest']:.1f}", f"{remedy['over']}"]
            for remedy in figures["remedies"]], numbers=(2, 3, 4)))
    if figures["places"]:
        more = f": the {SHOWN} worst of {len(figures['places'])}" if len(figures["places"]) > SHOWN else ""
        tables.append(ReportTable(f"Places that may fail{more}", ["lines", "targets", "two sigma, largest [um]", "mostly"], [
            [f"{place['first_line']}" + (f" to {place['last_line']}" if place["last_line"] > place["first_line"] else ""),
             f"{place['targets']}", f"{place['two_sigma_um']:.1f}",
             CAUSES[place["cause"]]] for place in figures["places"][:SHOWN]], numbers=(1, 2)))
    return tables


def budget_figure(budget: Budget) -> Figure:
    """Two sigma by cause along the path, with the tolerance."""
    corrected = budget.corrected
    path, targets = corrected.predicted.path, corrected.predicted.targets
    length, count = 1e3 * path.length, len(path.toolpath)
    # No line where there is no force.
    series: list[Series] = [Line(words, length, spread(1e6 * SIGMAS * getattr(corrected.left, cause), targets, count),
                                 COLOURS[cause], 1.2, dashed=cause in DASHED)
                            for cause, words in CAUSES.items() if getattr(corrected.left, cause).any()]
    series += [Line("all together", length, spread(1e6 * budget.two_sigma, targets, count), "ink", 1.6),
               Rule(1e6 * budget.tolerance, "tolerance", "bad")]
    return Figure("What the tolerance is spent on", "Expected on the part after the correction, by cause; causes are added as "
                  "independent.", [Panel(series, Axis("path length [mm]"), Axis("two sigma on the part [um]", from_zero=True))])

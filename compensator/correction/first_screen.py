"""The top of the report of `predict` and `correct`: the answer, the figures that matter, and what to do next."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from compensator.correction.budget import Budget
from compensator.correction.correct import Corrected
from compensator.correction.expected_left import CAUSES
from compensator.correction.if_another import IfAnother
from compensator.correction.predict import Predicted
from compensator.correction.settings import EXACTLY_ONE
from compensator.posting.suffixes import rapid_suffix, toolpath_stem
from identification.common.arrays import Array, rms
from identification.common.command_line import call
from identification.common.findings import counted, verb
from identification.common.report import Key, Step, Verdict, count_words
from identification.model.controller import runs_rapid

# From here [um] a tenth of a micrometre tells nobody anything.
WHOLE_UM = 9.95


def micrometres(value: float) -> str:
    """A size [um] of the first screen: whole micrometres, and tenths where these are all there is.

    >>> micrometres(64.7), micrometres(0.42)
    ('65', '0.4')
    """
    return f"{value:.0f}" if value >= WHOLE_UM or not value else f"{value:.1f}"


def verdict_of(job: Predicted | Corrected, budget: Budget | None) -> Verdict:
    """Of a program: with a tolerance whether it is kept, without one what is expected."""
    figures = job.as_dict()
    before = _given(job).as_dict()["deviation_um"]
    if not figures["predicted"]:
        return Verdict("caution", "NOTHING PREDICTED", "No target of this program has a force that counts.")
    if budget is not None:
        return _against(budget)
    if isinstance(job, Predicted):
        sentence = (f"Without correction the tool is pushed off its path by up to {micrometres(before['largest'])} µm "
                    f"({micrometres(before['rms'])} µm RMS).")
        unsure = 2 * figures["deviation_std_um"]["rms"]
        if unsure > before["rms"]:
            return Verdict("caution", "NOT CORRECTED, AND NOT KNOWN WELL", f"{sentence} That is uncertain by "
                           f"{micrometres(unsure)} µm RMS (2 sigma): a stiffness, or the force, is not known well.")
        return Verdict("open", "NOT CORRECTED", sentence)
    left = figures["expected_left_um"]
    sentence = (f"The tool was pushed off its path by {micrometres(before['rms'])} µm RMS, "
                f"{micrometres(before['largest'])} µm at most. After this correction {micrometres(2 * left['rms'])} µm RMS are "
                f"expected on the part, {micrometres(2 * left['largest'])} µm at most (2 sigma).")
    held = len(job.planned.forces.held)
    if held:
        sentence += f" {counted(held, 'target', 'are')} not among them: the log stood still there, left as planned."
    slow = job.feed is not None and (job.feed.last.slow & job.feed.last.cutting).any()
    doubts = count_words(job.findings, "error", "warning")
    largest = max(CAUSES, key=lambda cause: left[cause])
    for holds, word, why in (
            (held, "BUT NOT ALL OF THE CUT", ""),
            (slow, "BUT THE FEED CANNOT BE HELD EVERYWHERE", ""),
            (2 * left["rms"] > before["rms"], "BUT MORE IS UNCERTAIN THAN WAS CORRECTED", f" Mostly: {CAUSES[largest]}."),
            (job.left.mostly_unknown_cut, "BUT THE CUT IS NOT STATED",
             " The unknown cut makes most of that: see the next step.")):
        if holds:
            return Verdict("caution", f"CORRECTED, {word}" + (f"; {doubts.upper()}" if doubts else ""), f"{sentence}{why}")
    if doubts:
        return Verdict("caution", f"CORRECTED, WITH {doubts.upper()} TO READ FIRST", sentence)
    return Verdict("good", "CORRECTED", sentence)


def _against(budget: Budget) -> Verdict:
    figures = budget.as_dict()
    limit, over, targets = figures["tolerance_um"], figures["over"], figures["targets"]
    if not over:
        return Verdict("good", "WITHIN THE TOLERANCE ONCE CORRECTED", f"Corrected, all {targets} targets with force are "
                       f"expected within {limit:g} µm by two sigma; uncorrected {figures['uncorrected_over']} would not be.")
    place = max(budget.places, key=lambda one: one.two_sigma)
    return Verdict("bad" if over > 0.05 * targets else "caution", "THE TOLERANCE MAY FAIL EVEN CORRECTED",
                   f"{over} of {targets} targets {verb(over, 'are')} expected over {limit:g} µm by two sigma, the worst at "
                   f"{place.words().replace(' um', ' µm')}.")


def keys_of(job: Predicted | Corrected, budget: Budget | None) -> list[Key]:
    """Deviation before and after, the worst place, what is uncertain, the share of the tolerance."""
    given_job = _given(job)
    figures, given = job.as_dict(), given_job.as_dict()
    before, std = given["deviation_um"], given["deviation_std_um"]
    keys = [Key("pushed off, uncorrected", micrometres(before["largest"]), "µm",
                f"largest; RMS {micrometres(before['rms'])} µm")]
    corrected = budget.corrected if budget is not None else job if isinstance(job, Corrected) else None
    if corrected is None:
        assert isinstance(job, Predicted)
        keys += _worst(job, np.linalg.norm(job.prediction.at_rest, axis=1), "largest at")
        return [*keys, Key("uncertainty of that", micrometres(2 * std["largest"]), "µm", "2 sigma, largest"),
                _aside(job.another) or Key("targets with force", f"{given['with_force']}", "", f"of {given['targets']}")]
    left = corrected.left
    keys.append(Key("expected on the part, corrected", micrometres(2e6 * rms(left.std) if len(left.std) else 0.0), "µm",
                    f"2 sigma, RMS; {micrometres(2e6 * float(left.std.max(initial=0.0)))} µm at the worst place"))
    if budget is not None:
        share = 1e2 * float(budget.two_sigma.max(initial=0.0)) / budget.tolerance
        keys.append(Key("share of the tolerance", f"{share:.0f}", "%", f"of {1e6 * budget.tolerance:g} µm, at the worst place"))
    else:
        keys.append(Key("largest correction", f"{figures['offset_mm']['largest']:.3f}", "mm",
                        f"{figures['corrected']} targets" + (f", {figures['held_back']} held back" if figures["held_back"]
                                                             else "")))
    aside = _aside(given_job.another)
    return [*keys, *_worst(corrected.predicted, left.std, "most is left at"), *([aside] if aside else [])]


def _aside(another: IfAnother | None) -> Key | None:
    """Of predicted forces: what a stock that stands aside would mean."""
    return None if another is None else Key("were the stock 1 mm aside", f"{another.aside:.0f}", "µm",
                                            "RMS, so much off: compare the cut in words below")


def _given(job: Predicted | Corrected) -> Predicted:
    """The prediction of the program as given, without the targets that its correction adds."""
    return job.planned if isinstance(job, Corrected) else job


def _worst(predicted: Predicted, sizes: Array, label: str) -> list[Key]:
    """Where something is largest: its line in the program as given."""
    if not len(sizes):
        return []
    target = predicted.targets[int(np.argmax(sizes))]
    toolpath = predicted.path.toolpath
    return [Key(label, f"line {toolpath.line[target]}", "", f"target {toolpath.number[target]}")]


def steps_of(job: Predicted | Corrected, budget: Budget | None, offsets: Path | None) -> list[Step]:
    """What to do now, with the files of this job; offsets: where those of a correction are written."""
    planned = budget.corrected.planned if budget is not None else job.planned if isinstance(job, Corrected) else job
    program, cell = planned.program.source, planned.cell.source
    if program is None or cell is None or planned.model.source is None:
        return []
    if not len(planned.targets):
        return [Step("There is nothing to correct. Is it the log of the pass that cut, with its forces in newtons?"
                     if planned.forces.log.predicted is None else
                     "There is nothing to correct. Where does the stock stand in the program's work object?")]
    stem = toolpath_stem(program)
    # Forces that were predicted are named by --predict-force.
    log = () if planned.forces.log.predicted is not None else ("--forces", planned.forces.log.source)
    inputs = (cell, program, "--stiffness", planned.model.source, *log, *planned.settings.as_options())
    correct = call("correct", *inputs, "-o", f"{stem}_corrected{rapid_suffix(program)}", "--offsets", f"{stem}.offsets.csv",
                   "--report", f"{stem}.correct.html")
    tolerance = call("predict", *inputs, "-o", f"{stem}.deviation.csv", "--budget", "--tolerance-um", 100, "--report",
                     f"{stem}.budget.html")
    if isinstance(job, Corrected):
        scale = " and which --scale the moving robot needs" if planned.settings.correction.scale == EXACTLY_ONE else ""
        unstated = [Step("Most of what is left is force that changes with the cut, and nobody stated the cut: put it into "
                         f"{Path(cell).name}, such as cutting: {{material: aluminium, tool_diameter_mm: 16, contact_mm: 4}}, "
                         "and correct again.")] if job.left.wall_decides else []
        if job.left.slots_decide:
            unstated.append(Step("Most of what is left is force that changes with the depth of the slots, and nobody stated "
                                 "it: correct again with --slot-depth MM."))
        left = job.left.as_dict()
        if left["model"] > 0.7 * left["rms"] and 2 * left["rms"] > job.planned.as_dict()["deviation_um"]["rms"]:
            unstated = [Step("Most of what is left is a stiffness that is not known well: its grade says of which joint; "
                             "compstiff design --add plans loads that tell it. Measure them, identify, and correct again.")]
        return [*unstated,
                Step("Drive the corrected program in the air first, at low speed. Then mill, measure before and after at the "
                     f"same places, and ask what the correction was worth{scale}"
                     + ("" if offsets else f" ({Path(stem).name}.offsets.csv: what --offsets writes)") + ":",
                     call("verify", cell, "before.csv", "after.csv", "--predicted", offsets or f"{stem}.offsets.csv",
                          "--tolerance-um", 100, "--report", f"{stem}.verify.html")),
                Step("No tolerance was stated. Put yours in place of 100, and see before milling whether it will be kept:",
                     tolerance)]
    if not runs_rapid(planned.path.cell.robot):
        return [Step(f"Programs of {planned.path.cell.robot.name} are not written here: its controller runs no RAPID. The "
                     "deviation file says, target by target and in the base frame, how far the tool is pushed off.")]
    if budget is None:
        return [Step("Write the corrected program:", correct),
                Step("Or see first whether your tolerance will be kept (put it in place of 100):", tolerance)]
    remedies = budget.as_dict()["remedies"]
    if budget.as_dict()["over"] and remedies:
        first = first_of(remedies)
        return [Step(f"First what leaves the least over the tolerance: {first['do']} ({first['effort']}; gains "
                     f"{first['gain_um']:.1f} µm). Then correct; {counted(first['over'], 'target')} would be left over the "
                     "tolerance:", correct)]
    return [Step("Write the corrected program:", correct)]


def first_of(remedies: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Of a budget's remedies (JSON values) the one to begin with: it leaves the fewest targets over the tolerance; of those
    that leave as few the one whose worst place is the best. What gains most on average may be another."""
    return min(remedies, key=lambda remedy: (remedy["over"], remedy["two_sigma_um"]["largest"]))


def name_of(planned: Predicted) -> str:
    """The program's name."""
    return Path(planned.program.source or planned.path.toolpath.source).name

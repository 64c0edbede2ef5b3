"""A judgement in plain words: the answer on the terminal, and the findings beside it."""

from __future__ import annotations

from typing import Any

import numpy as np

from identification.common.arrays import rms
from identification.common.findings import Finding
from identification.common.quantities import cause_words, parameter_words, quantity
from identification.diagnosis.gross import BadRow
from identification.diagnosis.judgement import Cause, Judgement
from identification.diagnosis.odds import NAMING
from identification.diagnosis.procedure import ALARM
from identification.diagnosis.record import cause_content, checks_of, decades_of, next_measurements
from identification.diagnosis.slight import brought_along
from identification.fit.mending import BadVisit
from identification.fit.misfit import needed
from identification.fit.mistakes.judge import common_factor_findings, mistake_finding
from identification.fit.seating import moving_zero
from identification.fit.visit_findings import (
    evidence,
    mending,
    not_independent,
    sentence,
    told_of,
    validation_findings,
    visit_findings,
)
from identification.model.effects import effects
from identification.model.effects.kinds import OF_THE_KIND, UnderUnknownWeight
from identification.model.effects_in_force import SPRINGS
from identification.model.gravity import FREE_FALL
from identification.model.load_state import PACE_S, LoadState

# So many checks, and causes that would not have been noticed, are told on the terminal.
MOST_CHECKS, MOST_OVERLOOKED = 4, 6
# Odds of more powers of ten than this are only said to be over that.
CERTAIN = 12
# Standard deviations of a stiffness that its interval of 95 % reaches.
TWO_SIGMA = 1.96
# Of many names that cannot be told apart so many are printed.
MOST_TOLD = 8


def _seen_of(judgement: Judgement) -> str:
    """What is seen of an unknown cause, in a few words."""
    if judgement.patterns:
        return "; ".join(judgement.patterns[:2])
    if judgement.withdrawn:
        return "; ".join(f"{cause_words(label)} is withdrawn: {why}" for label, why in judgement.withdrawn.items())
    if judgement.scatter or not judgement.alternatives:
        return "the readings scatter more than the stated noise"
    return f"what is left looks most like {cause_words(judgement.alternatives[0].label)}, which does not explain it"


def _chance(judgement: Judgement) -> str:
    """The p-value in words; one that is no alarm beside a misfit is that of a noise which has grown."""
    p_value = judgement.detection.p_value
    grown = p_value > ALARM and judgement.verdict in ("unknown", "ambiguous", "mistake")
    return (f"p {'<=' if p_value <= judgement.detection.resolution else '='} {p_value:.3g}"
            f"{' if it is as large as these rows would need' if grown else ''}")


def answer(judgement: Judgement) -> list[str]:
    """The answer in plain words."""
    before, allowed = 1e6 * rms(judgement.plain.residual), 1e6 * rms(judgement.expected_std)
    others = " of the other rows" if judgement.bad_visits or judgement.bad_rows else ""
    lines = [*_verdict(judgement),
             f"the plain model leaves {before:.2f} um RMS{others}, the noise allows {allowed:.2f} um "
             f"({_chance(judgement)})"]
    lines += [*_beside_the_names(judgement), *_overlooked(judgement)]
    decades = decades_of(judgement)
    if decades is not None and judgement.detection.p_value > NAMING:
        name = "the name" if judgement.verdict == "named" else "the likeliest of them"
        lines.append(f"  a noise large enough would show as much (p above); with how large noise usually is {name} is "
                     f"{f'10^{decades:.0f}' if decades < CERTAIN else f'over 10^{CERTAIN}'} times likelier than nothing")
    lines += [f"  {needed(part, factor)}" for part, factor in judgement.scatter.items()]
    if judgement.gain is not None:
        gain = judgement.gain
        low, high = gain.interval
        lines.append(f"gain on rows that were not fitted ({gain.held_out}): {1e6 * gain.before:.2f} -> "
                     f"{1e6 * gain.after:.2f} um RMS, ratio {gain.ratio:.2f} ({low:.2f} ... {high:.2f})")
    for load in judgement.next_loads:
        angles = ", ".join(f"{angle:.1f}" for angle in np.degrees(load.theta))
        size = float(np.abs(load.forces).max())
        what = f"weights up to {size / FREE_FALL:.3g} kg" if load.axis is None else (
            f"load cycle along base {'xyz'[load.axis]} up to {size:.0f} N")
        lines.append(f"next: {what} at joints ({angles}) deg "
                     f"{'separate' if load.axis is None else 'separates'} {' from '.join(map(cause_words, load.separates))} "
                     f"by {load.distance:.1f} sigma")
    return lines + [f"next: check: {what} ({about})" for what, about in checks_of(next_measurements(judgement))[:MOST_CHECKS]]


def no_cause(judgement: Judgement) -> str:
    """Why an unknown cause has no name, in words that go on from "something is wrong"."""
    return ", and what is not certain" if judgement.withdrawn else " that no cause in the dictionary explains"


def _verdict(judgement: Judgement) -> list[str]:
    """The verdict with its names."""
    if judgement.verdict == "adequate":
        return ["adequate: six springs explain the data to their noise"]
    # Where the other rows are adequate and the verdict is not, the poses left out are what is wrong.
    alone = judgement.verdict == "unknown" and judgement.detection.p_value > ALARM
    left_out = [*(_bad_visit_line(bad, "seen" if alone else "named") for bad in judgement.bad_visits),
                *map(_bad_row_line, judgement.bad_rows)]
    if judgement.verdict == "named":
        return [*(_cause_line(judgement, cause) for cause in judgement.causes), *left_out,
                *(f"named: {scatter.line}" for scatter in judgement.scatters)]
    if judgement.verdict == "mistake":
        return [line for mistake in judgement.mistakes for line in mistake.lines()]
    if judgement.verdict == "unknown":
        else_ = " else" if left_out and not alone else ""
        return [*left_out, f"unknown: something{else_} is wrong{no_cause(judgement)}",
                *(f"  seen: {pattern}" for pattern in judgement.patterns[:4]),
                *(f"  withdrawn: {cause_words(label)} ({label}): {why}" for label, why in judgement.withdrawn.items())]
    told, more = judgement.alternatives[:MOST_TOLD], judgement.alternatives[MOST_TOLD:]
    lines = ["ambiguous: these data cannot tell apart:",
             *(f"  {cause.sentence} ({cause.label}, probability {cause.probability:.2f})" for cause in told),
             *([f"  and {len(more)} more, each with a probability of {more[0].probability:.2g} at most"] if more else []),
             *(f"  {mistake.sentence} ({mistake.key}, a mistake in the {mistake.candidate.mistake.of})"
               for mistake in judgement.mistakes), *left_out]
    if judgement.robot_difference is not None:
        lines.append(f"for a correction the choice makes {1e6 * judgement.robot_difference:.1f} um RMS under the measured "
                     f"loads{': small beside these, no further load is needed for it' if judgement.choice_is_small else ''}")
    return lines


def _beside_the_names(judgement: Judgement) -> list[str]:
    """What is at work beside the causes named, or may be."""
    lines, brought = [], brought_along(judgement.extended)
    for cause in judgement.companions:
        content = cause_content(judgement, cause)
        values = ", ".join(f"{parameter_words(name)} {value(item)}" for name, item in content["parameters"].items())
        why = f"{cause_words(brought[cause.label])} brings so much of it along" if cause.label in brought else (
            "too small against its typical size to be a name")
        lines.append(f"  beside it something smaller is at work, up to {content['largest_um']:.0f} um: "
                     f"{cause_words(cause.label)} ({cause.label}: {values}, 2 sigma) is in the model; {why}")
    if judgement.law_differs:
        lines.append("  it explains nearly all of the misfit, but not to the noise: the real law differs a little from the "
                     "dictionary's, or something smaller is at work beside it")
    elif judgement.adequacy and more_at_work(judgement):
        further = ", ".join(f"{cause_words(cause.label)}, probability {cause.probability:.2f}"
                            for cause in judgement.alternatives[:4])
        lines.append(f"  what is left then is more than {100 * (1 - judgement.adequacy.p_value):.1f} % of data sets show "
                     f"without a further cause: something more may be at work{f' ({further})' if further else ''}")
    return lines


def more_at_work(judgement: Judgement) -> bool:
    """Whether the causes named leave more than noise does."""
    return judgement.law_differs or (judgement.verdict == "named" and bool(judgement.causes)
                                     and judgement.adequacy is not None and judgement.adequacy.p_value <= ALARM)


def _overlooked(judgement: Judgement) -> list[str]:
    """What the answer is worth where nothing more is seen."""
    every, missed = judgement.showing, judgement.overlooked
    if not every:
        return []
    names = ", ".join(f"{cause_words(each.entry.label)}: {1e6 * each.typical_largest:.0f}" for each in missed[:MOST_OVERLOOKED])
    more = f" and {len(missed) - MOST_OVERLOOKED} more" if missed[MOST_OVERLOOKED:] else ""
    causes = "other possible causes" if judgement.causes else "possible causes"
    lines = [f"  these rows would have shown {len(every) - len(missed)} of {len(every)} {causes} of typical size, four times "
             f"in five{f'; not (um they move the tool here): {names}{more}' if missed else ''}"]
    off = np.array([each.unnoticed for each in every])
    worst, std = np.argmax(off, axis=0), np.sqrt(np.diag(judgement.extended.covariance))[SPRINGS]
    beyond = [f"{every[k].leaves_off(joint)} ({cause_words(every[k].entry.label)})"
              for joint, k in enumerate(worst) if off[k, joint] > TWO_SIGMA * std[joint]]
    if beyond:
        lines.append("  a cause that these rows would not show, of typical size at most, may leave stiffnesses off by more "
                     f"than their intervals say: {', '.join(beyond)}")
    held = sorted({each.entry.joint for each in every if each.weighed and each.entry.joint})
    if held:
        gears = f"gear{'s' if held[1:] else ''} {', '.join(map(str, held))}"
        lines.append(f"  of play and soft zones of {gears} this holds where the "
                     "arm's weight does not press the teeth to one side: the robot file states no links")
    return lines


def _cause_line(judgement: Judgement, cause: Cause) -> str:
    content = cause_content(judgement, cause)
    values = ", ".join(f"{parameter_words(name)} {value(item)}" for name, item in content["parameters"].items())
    line = (f"named: {cause.sentence}. In these measurements it makes up to {content['largest_um']:.0f} um "
            f"({cause.label}: {values}, 2 sigma; probability {cause.probability:.3f})")
    if cause.open_laws and judgement.robot_difference is not None:
        laws = ", ".join(f"{cause_words(name)} {probability:.2f}" for name, probability in cause.open_laws.items())
        line += (f"; its law is open ({laws} would do as well): for a correction the choice makes "
                 f"{1e6 * judgement.robot_difference:.1f} um RMS under the measured loads")
    return line


def _bad_row_line(bad: BadRow) -> str:
    off = ", ".join("-" if np.isnan(component) else f"{1e6 * component:.1f}" for component in bad.off)
    told = f"; {told_of([bad.mend])}" if bad.mend else ""
    return (f"named: row {bad.row} (line {bad.line}) is a bad reading, off by ({off}) um (p = {bad.p_value:.2g}); it was left "
            f"out{told}")


def _bad_visit_line(bad: BadVisit, said: str) -> str:
    return f"{said}: {sentence(bad)}; {'it was' if len(bad.score.rows) == 1 else 'they were'} left out. {mending(bad)}"


def value(item: dict[str, Any]) -> str:
    """A parameter with its uncertainty, two sigma, and unit."""
    estimate, std = item["estimate"], item["std"]
    return quantity(estimate, std, item.get("unit", "1")) if std else str(estimate)


def judgement_findings(judgement: Judgement) -> list[Finding]:
    """What a user must know beside the answer."""
    source, robot = judgement.rows.source, judgement.plain.data.cell.robot
    findings = []
    if judgement.verdict == "unknown":
        findings.append(Finding("CS1401", "warning", f"something is wrong{no_cause(judgement)}: {_seen_of(judgement)}",
                                file=source, hint="no effect is carried into the model, and correct refuses the plain springs; "
                                "look at the residuals in the report (--report)"))
    if judgement.verdict != "mistake":
        findings += common_factor_findings(judgement.plain)
    else:
        findings += [mistake_finding(mistake, source, "warning") for mistake in judgement.mistakes]
    if judgement.verdict == "ambiguous":
        labels = [*(cause.label for cause in judgement.alternatives[:6]), *(mistake.key for mistake in judgement.mistakes)]
        more = len(judgement.alternatives[6:])
        hint = ("compstiff design --add 3 MEASUREMENTS --diagnosis DIAGNOSIS plans loads that tell them apart; compstiff "
                "explain NAME tells a check without a load") if judgement.loads_settle else (
                    "do the checks: no load tells a mistake in a file from a cause, or from another mistake")
        findings.append(Finding("CS1402", "warning", "the data cannot tell several causes apart: "
                                f"{', '.join(map(cause_words, labels))}{f', and {more} more' if more else ''}", file=source,
                                hint=hint))
    if judgement.verdict in ("adequate", "named"):
        findings += not_independent(judgement.extended)
    findings += [*_visit_findings(judgement), *moving_zero(judgement.extended),
                 *validation_findings(judgement.validation, source)]
    for bad in judgement.bad_rows:
        largest = 1e6 * float(np.nanmax(np.abs(bad.off)))
        findings.append(Finding("CS1407", "warning", f"row {bad.row} is a bad reading, {largest:.1f} um off; it was left out",
                                file=source, line=bad.line,
                                hint=(f"{told_of([bad.mend])}; else " if bad.mend else "") + "measure it again: what comes "
                                     "back is no slip, but a cause that shows there alone, such as a gear that crosses its "
                                     "play under that load"))
    for scatter in judgement.scatters:
        findings.append(Finding(scatter.code, "warning", f"{scatter.sentence}; {scatter.rows} count for that much less",
                                file=source, hint=scatter.effect.settles))
    if judgement.thinning is not None:
        thin = judgement.thinning
        length = thin.autocorrelation_time
        findings.append(Finding("CS1408", "note", f"{thin.rows} rows of machined passes were averaged over {thin.blocks} "
                                f"blocks: neighbouring rows share their noise over {length:.1f} rows, so they are worth "
                                f"about {thin.rows / length:.0f} independent ones", file=source))
    if judgement.share is not None:
        findings.append(Finding("CS1024", "note", f"the diagnosis is made from {judgement.share.rows} of {judgement.share.of} "
                                "rows, taken evenly over the file; so are the stiffnesses of --extended", file=source,
                                hint="identify uses all rows"))
    for label in judgement.lost:
        findings.append(Finding("CS1020", "note", f"{cause_words(label)} is no candidate: its fit did not converge",
                                file=source,
                                hint="if it is what you suspect, do its check by hand; otherwise nothing need be done"))
    for part, factor in judgement.scatter.items():
        findings.append(Finding("CS1403", "warning", needed(part, factor), file=source,
                                hint="state the noise as it is, or look for what scatters"))
    if robot.link_mass is None:
        joints = [joint for law in effects()["backlash"].other_laws if isinstance(law, UnderUnknownWeight)
                  for joint in law.joints if law.turns(judgement.plain.load_state, joint)]
        findings.append(Finding("CS1404", "note", "the robot file has no links: what gravity holds gears to is not known, so "
                                f"backlash and soft zones of joints {', '.join(map(str, sorted(joints)))} were tried without "
                                "it and under many weights", file=str(robot.source),
                                hint="add links (mass and centre) to a robot file of your own"))
    for name, why in judgement.left_out.items():
        if name in effects() and why not in OF_THE_KIND:
            findings.append(Finding("CS1405", "note", f"{cause_words(name)} was not looked for: {why}", file=source))
    findings += _times_assumed(judgement.plain.load_state, source)
    if judgement.verdict == "adequate" and not judgement.plain.data.cell.noise.force_gain:
        # The hook is no candidate where nothing hangs.
        loads, hint = ("force sensor", effects()["force_gain"].settles) if "hook_offset" in judgement.left_out else (
            "weights", "weigh what hangs, hook and rope too")
        findings.append(Finding("CS1406", "note", f"a wrong scale of the {loads} (force_gain) can never be seen in deflections "
                                "alone: it is the same as all stiffnesses changed together", file=source, hint=hint))
    return findings


def _times_assumed(rows: LoadState, source: str) -> list[Finding]:
    """What was taken of times that no row states (CS1409)."""
    no_times, found = bool(np.isnan(rows.time).all()), []
    if no_times:
        found.append(f"drift and softening were looked for in the order of the rows, {PACE_S:.0f} s each: time_s is not given")
    if np.isnan(rows.dwell).all():
        held = f"for {PACE_S:.0f} s" if no_times else "since the reading before"
        found.append(f"creep was looked for as if each load had been on {held}: dwell_s is not given")
    return [Finding("CS1409", "note", text, file=source) for text in found]


def _visit_findings(judgement: Judgement) -> list[Finding]:
    """What is wrong at single visits, left out or not."""
    test, source = judgement.visits, judgement.rows.source
    if test is None or (judgement.bad_rows and not judgement.bad_visits):
        return []
    found = visit_findings(test, judgement.bad_visits, source, f"the rest was judged: {len(judgement.rows)} rows")
    found += visit_findings(test, judgement.suspects, source, "a sensor that was bumped there explains them, and so may the "
                            "table of poses") if judgement.suspects else []
    if test.bad and not judgement.bad_visits:
        names = ", ".join(score.name for score in test.bad)
        found.append(Finding("CS1735", "warning", f"the readings at {names} stand out from the other poses "
                             f"({evidence(test.bad[0])}), but without them the others have no name: all were kept", file=source,
                             line=test.bad[0].line, hint="look at these poses first: pose, loads, what drags or sticks there"))
    return found

"""What is said of visits and validation rows that do not fit: the words, for `identify` and `diagnose` alike."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identification.common.findings import Finding
from identification.common.quantities import two_sigma
from identification.fit.load_test import LoadTest
from identification.fit.mending import WORTH_TELLING, BadVisit, Mend
from identification.fit.noise_parts import MEMORY, SETUP, SetUp
from identification.fit.posterior import Posterior
from identification.fit.validation import Validation
from identification.fit.visits import VisitScore, VisitTest
from identification.model.gravity import fall_in_base

# Rows are counted in words up to here.
WORDS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve")
# A load is plumb where it stands off the vertical by under this share of it.
PLUMB = 0.02
# How the forces of set-ups differ, and what to do about it.
SET_UP_IN_WORDS = {
    SetUp.SIZED: ("larger or smaller", "zero the load cell unloaded at each pose, let it warm up, and load along its axis"),
    SetUp.STRETCHED: ("stretched", "the sensor's readings are off by another share at each pose: let it warm up, and load "
                      "along one of its axes"),
    SetUp.TURNED: ("stretched and turned", "align the loading device anew at each pose with a level or a square")}


def sentence(bad: BadVisit) -> str:
    """What is wrong with a visit: its readings, and what would mend it."""
    count = len(bad.score.rows)
    number = WORDS[count] if count < len(WORDS) else str(count)
    readings = "reading of" if count == 1 else f"{number} readings of"
    return (f"the {readings} {bad.score.name} {'does' if count == 1 else 'do'} not fit any stiffness that fits the other poses "
            f"({evidence(bad.score)})")


def evidence(score: VisitScore) -> str:
    """What speaks against a visit, in words: how rarely chance makes as much, or how much likelier a wrong angle is."""
    wrong = score.wrong_angle
    if wrong is None:
        return f"p = {score.p_value:.2g}"
    return (f"odds of e^{wrong.log_odds:.0f} that axis {wrong.joint} stood {np.degrees(wrong.missing):+.2f} +- "
            f"{np.degrees(two_sigma(wrong.std)):.2f} degrees from where the table has it")


def mending(bad: BadVisit) -> str:
    """What would mend a visit, or what to look for."""
    likely = [mend for mend in bad.mends if mend.probability >= WORTH_TELLING]
    if likely:
        told = told_of(likely)
    elif bad.score.wrong_angle is not None:
        told = f"drive there again and read axis {bad.score.wrong_angle.joint}: no slip of the pen is likelier than others"
    else:
        told = ("is its pose written rightly? No single slip in its angles or loads is likely; does something drag or stick "
                "there, was the tool or a sensor touched?")
    return told if not bad.copied else f"its angles are those of {bad.copied}: were they copied? {told}"


def told_of(mends: Sequence[Mend]) -> str:
    """What would mend something, each with its probability."""
    return "; or ".join(f"{mend.what} ({100 * mend.probability:.0f} % of what was tried)" for mend in mends)


def visit_findings(test: VisitTest, bad: tuple[BadVisit, ...], source: str, effect: str) -> list[Finding]:
    """The bad visits (CS1730), or that there are too many to be single mistakes (CS1731); effect: what was done."""
    if test.too_many:
        return [Finding("CS1731", "warning", "more than a third of the poses do not fit the stiffnesses of the others: no pose "
                        "was left out, since these are no single mistakes", file=source,
                        hint="are all poses, loads and units in the columns they belong to? compstiff diagnose looks for a "
                        "common cause")]
    return [Finding("CS1730", "warning", f"{sentence(one)}; {effect}", file=source, line=one.score.line, hint=mending(one))
            for one in bad]


def kinds_apart(bad: Sequence[BadVisit], data: LoadTest) -> list[Finding]:
    """A warning (CS1736) where all poses that do not fit are loaded sideways, two or more, and all others by what hangs, or the
    other way round: no slips at single poses, but masses or forces in another unit."""
    rows, fall = data.rows, fall_in_base(data.cell.world_from_base)
    force = rows.wrench[:, :3]
    size = np.linalg.norm(force, axis=1)
    hangs = np.linalg.norm(np.cross(force, fall / np.linalg.norm(fall)), axis=1) < PLUMB * size
    out = np.isin(rows.row, [number for one in bad for number in one.score.rows])
    loaded = size > 0
    for these, others, words, rest in ((~hangs, hangs, "loaded sideways", "hang"), (hangs, ~hangs, "loaded by what hangs",
                                                                                    "are loaded sideways")):
        if len(bad) > 1 and (loaded & others).any() and np.array_equal(loaded & these, loaded & out):
            return [Finding(
                "CS1736", "warning", f"all {len(bad)} poses that do not fit are {words}, and none of those that {rest}: one "
                "kind of load contradicts the other", file=data.rows.source, line=bad[0].score.line,
                hint="are mass_kg in kilograms (a pound is 0.4536) and fx_n fy_n fz_n in newtons (a kilogram-force is 9.81), "
                "and is all that hangs weighed? The stiffnesses are those of one kind, and may be off by as much as its unit")]
    return []


def validation_findings(validation: Validation | None, source: str) -> list[Finding]:
    """Outliers among the validation rows, single ones (CS1732) and whole visits (CS1733), with what they do to the figure; or
    that the model does not predict them (CS1737)."""
    if validation is not None and validation.fails:
        return [Finding("CS1737", "warning", f"{validation.missed} of {validation.count} validation rows are off by more than "
                        f"chance allows, too many to be single mistakes: {1e6 * validation.rms:.1f} um RMS over all of them, "
                        f"where their uncertainty expects {1e6 * validation.expected:.1f} um", file=source,
                        hint="do not trust a correction there. What have these poses that the others have not: reach, load, "
                        "another day or set-up, columns of their own?")]
    if validation is None or not len(validation.numbers):
        return []
    figure = (f"the validation figure is {1e6 * validation.rms:.1f} um RMS with all rows, "
              f"{1e6 * validation.rms_without:.1f} um without the outliers")
    found = [Finding("CS1732", "warning", f"validation row {row.row} is {1e6 * float(np.nanmax(np.abs(row.off))):.0f} um off "
                     f"its prediction, {row.sigmas:.0f} times its uncertainty; {figure}", file=source, line=row.line,
                     hint="a slip of the pen? Look at the row's readings, load and angles, or measure it again")
             for row in validation.rows]
    return found + [Finding("CS1733", "warning", f"validation: {sentence(bad)}; {figure}", file=source, line=bad.score.line,
                            hint=mending(bad)) for bad in validation.visits]


def not_independent(fitted: Posterior) -> list[Finding]:
    """What the rows of a visit share beyond its re-seating (CS1040, CS1041)."""
    source, components, active = fitted.data.rows.source, fitted.components, fitted.at_map.noise.active
    findings = []
    if active[MEMORY]:
        findings.append(Finding("CS1040", "note", "neighbouring readings of a visit are alike beyond what they share "
                                f"(correlation {components.rho:.2f}): they tell less than so many readings of their own",
                                file=source, hint="wait longer between readings, or take more poses"))
    if active[SETUP]:
        words, hint = SET_UP_IN_WORDS[components.set_up]
        findings.append(Finding("CS1041", "note", f"the forces of one visit are {words} against those of the next, "
                                f"by {100 * components.setup_relative:.2g} % of the load", file=source, hint=hint))
    return findings

"""What is said of visits and validation rows that do not fit: the words, for `identify` and `diagnose` alike."""

from __future__ import annotations

import numpy as np

from identification.common.findings import Finding
from identification.fit.mending import WORTH_TELLING, BadVisit
from identification.fit.validation import Validation
from identification.fit.visits import VisitTest

# Rows are counted in words up to here.
WORDS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve")


def sentence(bad: BadVisit) -> str:
    """What is wrong with a visit: its readings, and what would mend it."""
    count = len(bad.score.rows)
    number = WORDS[count] if count < len(WORDS) else str(count)
    readings = "reading of" if count == 1 else f"{number} readings of"
    return (f"the {readings} {bad.score.name} {'does' if count == 1 else 'do'} not fit any stiffness that fits the other poses "
            f"(p = {bad.score.p_value:.2g})")


def mending(bad: BadVisit) -> str:
    """What would mend a visit, or what to look for."""
    likely = [mend for mend in bad.mends if mend.probability >= WORTH_TELLING]
    if likely:
        told = "; or ".join(f"{mend.what} ({100 * mend.probability:.0f} % of what was tried)" for mend in likely)
    else:
        told = ("is its pose written rightly? No single slip in its angles or loads is likely; does something drag or stick "
                "there, was the tool or a sensor touched?")
    return told if not bad.copied else f"its angles are those of {bad.copied}: were they copied? {told}"


def visit_findings(test: VisitTest, bad: tuple[BadVisit, ...], source: str, effect: str) -> list[Finding]:
    """The bad visits (CS1730), or that there are too many to be single mistakes (CS1731); effect: what was done."""
    if test.too_many:
        return [Finding("CS1731", "warning", "more than a third of the poses do not fit the stiffnesses of the others: no pose "
                        "was left out, since these are no single mistakes", file=source,
                        hint="are all poses, loads and units in the columns they belong to? compstiff diagnose looks for a "
                        "common cause")]
    return [Finding("CS1730", "warning", f"{sentence(one)}; {effect}", file=source, line=one.score.line, hint=mending(one))
            for one in bad]


def validation_findings(validation: Validation | None, source: str) -> list[Finding]:
    """Outliers among the validation rows, single ones (CS1732) and whole visits (CS1733), with what they do to the figure."""
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

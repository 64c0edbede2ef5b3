"""How sure a set of causes is: against other sets, against nothing, and against chance."""

from __future__ import annotations

import numpy as np

from identification.diagnosis.detect import Detection
from identification.diagnosis.gain import AGAINST, Gain
from identification.diagnosis.judgement import Cause, Judgement
from identification.diagnosis.naming import CERTAIN
from identification.diagnosis.search import log_prior
from identification.fit.mistakes.evidence import log_evidence
from identification.fit.mistakes.search import Search
from identification.fit.posterior import Posterior, posterior

# A name needs more than an alarm does: of data sets without any cause one in two hundred shows as much, or it is likelier than
# nothing by so much (ln odds), all parameters and the noise's sizes integrated out; and never less likely than nothing.
NAMING = 0.005
CERTAINLY = float(np.log(1000.0))
# The same where nothing means forces that differ from one set-up to the next, a noise that explains much by chance.
THAN_SET_UPS = float(np.log(100.0))
# Several causes may each be certain while what else is at work is not: they are named if so much is on them alone.
POSSIBLE = 0.5
CHANCE_IN_WORDS = "{:.1%} of data sets without any cause show as much: too many for a name"
NO_LIKELIER = "a larger noise explains the readings as well as it does"
NO_BETTER = "a large noise shows as much (p = {:.3g}), and readings that were not fitted ({}) are hardly likelier with it"
# Beyond this power of e how much likelier something is needs no figure.
MOST_LOG = 50.0


def certain(together: float, causes: tuple[Cause, ...]) -> bool:
    """Whether the set of causes is certain, or each of them while what else is at work is not."""
    return together >= CERTAIN or (together >= POSSIBLE and all(cause.probability >= CERTAIN for cause in causes))


def log_posterior(found: Search, extended: Posterior, entries: int) -> float:
    """ln posterior of a set of causes among `entries`, on the rows in which mistakes were looked for."""
    if not extended.terms:
        return found.log_evidence
    if found.plain.data is not extended.data:
        extended = posterior(found.plain.data, extended.terms, extended)
    return log_evidence(extended) + log_prior(len(extended.terms), entries)


def doubt_of(detection: Detection, odds: float, least: float = CERTAINLY) -> str:
    """Why what is named may be nothing, in words, "" where it may not. odds: ln, against nothing; least: what they must be
    where chance shows as much."""
    if detection.p_value > max(NAMING, detection.resolution) and odds < least:
        return CHANCE_IN_WORDS.format(detection.p_value)
    return NO_LIKELIER if odds < 0 else ""


def doubt_by(detection: Detection, measured: Gain) -> str:
    """Why what is named may be nothing by readings that were not fitted, in words, "" where it may not: it makes them less
    likely, or not clearly likelier where chance shows as much as the detection did."""
    if measured.support <= AGAINST:
        return (f"it makes readings that were not fitted ({measured.held_out}) less likely, by a factor "
                f"{np.exp(min(-measured.support, MOST_LOG)):.2g}")
    if detection.p_value > max(NAMING, detection.resolution) and measured.support < -AGAINST:
        return NO_BETTER.format(detection.p_value, measured.held_out)
    return ""


def log_odds(judgement: Judgement, entries: int) -> float:
    """ln odds of the extended model, one set among `entries`, against the plain one, all parameters and the noise's sizes
    integrated out."""
    extended = judgement.extended
    return log_evidence(extended) + log_prior(len(extended.terms), entries) - log_evidence(judgement.plain)

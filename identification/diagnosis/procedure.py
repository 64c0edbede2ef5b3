"""The procedure of docs/effects.md: fit, detect, name, extend, test again, measure the gain."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from math import comb

import numpy as np

from identification.diagnosis.blocks import in_blocks
from identification.diagnosis.detect import REPLICATES, goodness_of_fit
from identification.diagnosis.discrimination import next_loads, rivals_of, robot_difference
from identification.diagnosis.gain import gain
from identification.diagnosis.gross import bad_rows
from identification.diagnosis.judgement import Judgement
from identification.diagnosis.naming import (
    AGAINST,
    CERTAIN,
    converged,
    credible,
    inclusion,
    only_local,
    with_free_laws,
    without_slight,
)
from identification.diagnosis.scatter import GRANTED, GRANTED_AFTER_NAMING, beyond_stated, explained
from identification.diagnosis.search import PRIOR_OF_SIZE, Hypothesis, Survey
from identification.diagnosis.swing import allowed_for, swing_of
from identification.fit.load_test import LoadTest
from identification.fit.mistakes.evidence import log_evidence
from identification.fit.mistakes.judge import RIVAL, Mistakes, beyond_the_fit, fitted_or_mistaken, mistakes_in
from identification.fit.mistakes.search import Search
from identification.fit.posterior import Posterior, posterior
from identification.measurements import Measurements
from identification.model.cell import Cell
from identification.model.effects import Effect, effects

# Family-wise false alarms of the detection, and of the test whether the extended model is enough.
ALARM = 0.05
INADEQUATE = 0.005
# Several causes may each be certain while what else is at work is not: they are named if so much is on them alone.
POSSIBLE = 0.5
MOST_CAUSES = 3
# ln Bayes factor against the plain model under which no cause explains anything.
SUPPORT = 1.0
# A misfit of so many times the noise's chi-squared, explained to this share, has its cause though not its exact law.
GROSS = 2.0
NEARLY_ALL = 0.97
# How many of the nearest names go with an unknown cause.
NEAREST = 5
WORTH_NAMING = 0.01


def judge(
    cell: Cell, measurements: Measurements, *, catalogue: dict[str, Effect] | None = None, alarm: float = ALARM,
    replicates: int = REPLICATES, seed: int = 0,
) -> Judgement:
    """Finds out what the plain model gets wrong on these measurements.

    Rows of machined passes are averaged over blocks first (blocks.py). Where single rows are bad, they are named and the rest
    is judged without them. catalogue: the effects to choose from (all known ones). alarm: family-wise rate of false alarms.
    Raises what `posterior` raises.
    """
    averaged, thinning = in_blocks(cell, measurements)
    procedure = Procedure(LoadTest.of(cell, averaged), effects() if catalogue is None else catalogue, alarm, replicates, seed)
    return replace(procedure.allowing_for_swing(procedure.without_bad_rows()), thinning=thinning)


@dataclass(frozen=True, eq=False)
class Procedure:
    """The procedure on rows taken as they are, validate rows among them; the rest as the arguments of `judge`."""

    data: LoadTest
    catalogue: dict[str, Effect]
    alarm: float
    replicates: int
    seed: int

    @cached_property
    def rng(self) -> np.random.Generator:
        """Of all that is drawn, in the order of the procedure."""
        return np.random.default_rng(self.seed)

    def allowing_for_swing(self, judgement: Judgement) -> Judgement:
        """The judgement; where weights swung, of the rows with that in their sigmas, if that explains them."""
        swing = None if judgement.verdict == "mistake" else swing_of(judgement.extended)
        if swing is None:
            return judgement
        again = replace(self, data=allowed_for(self.data, swing, judgement.plain)).without_bad_rows()
        if again.verdict == "unknown":
            return judgement
        return replace(again, swing=swing, verdict="named" if again.verdict == "adequate" else again.verdict)

    def without_bad_rows(self) -> Judgement:
        """The judgement; where single rows are bad, of the others."""
        judgement = self.judged()
        if judgement.verdict == "mistake":
            return judgement
        bad = bad_rows(judgement.extended)
        if not bad:
            return judgement
        rows = self.data.rows
        good = self.data.with_rows(rows.select(~np.isin(rows.row, [row.row for row in bad])))
        again = replace(self, data=good).judged()
        if again.verdict == "adequate":
            measured = gain(good, again.plain, again.extended, np.random.default_rng(self.seed))
            return replace(again, verdict="named", gain=measured, bad_rows=bad)
        if again.verdict == "named" or judgement.verdict != "named":
            return replace(again, bad_rows=bad)
        return judgement

    def judged(self) -> Judgement:
        """Fit, detect, and where something is wrong, name it."""
        plain = fitted_or_mistaken(self.data.with_rows(self.data.rows.select(~self.data.rows.validate)))
        missing = {effect.name: effect.missing(plain.load_state) for effect in self.catalogue.values()}
        detection = goodness_of_fit(plain, self.catalogue, self.rng, self.replicates)
        judgement = Judgement("adequate", plain, plain, detection, scatter=beyond_stated(plain, GRANTED),
                              left_out={name: why for name, why in missing.items() if why})
        if detection.p_value <= self.alarm or judgement.scatter:
            return self.named(judgement)
        unseen = beyond_the_fit(plain)
        return judgement if unseen is None else replace(judgement, verdict="mistake", mistakes=(unseen,))

    def named(self, judgement: Judgement) -> Judgement:
        """The judgement of a plain model that does not explain the rows: a mistake in the files, or a physical cause."""
        plain = judgement.plain
        mistakes = mistakes_in(plain)
        # Springs that are off by a unit mean nothing beside a gross mistake of another kind.
        clear = mistakes.sure or beyond_the_fit(plain)
        if clear is not None:
            return replace(judgement, verdict="mistake", mistakes=(clear,))
        seen, best, extended = converged(plain, self.catalogue, 2)
        adequacy = goodness_of_fit(extended, self.catalogue, self.rng, self.replicates)
        if adequacy.p_value <= INADEQUATE:
            seen, best, extended = converged(extended, self.catalogue, MOST_CAUSES)
            adequacy = goodness_of_fit(extended, self.catalogue, self.rng, self.replicates)
        scatter = beyond_stated(extended, GRANTED_AFTER_NAMING)
        extended = extended if best is None else without_slight(self.data, extended, self.rng)
        physics = log_posterior(mistakes.found, extended, len(seen.dictionary.entries)) if mistakes.possible else 0.0
        if mistakes.clearly(physics):
            return replace(judgement, verdict="mistake", mistakes=mistakes.possible)
        share = explained(plain, extended)
        to_the_noise = adequacy.p_value > INADEQUATE and not scatter
        nearly = share.excess >= GROSS and share.share >= NEARLY_ALL
        judgement = replace(judgement, extended=extended, adequacy=adequacy, scatter=scatter,
                            law_differs=nearly and not to_the_noise)
        supported = best is not None and best.log_evidence >= SUPPORT
        if best is None or not supported or not (to_the_noise or nearly):
            left = adequacy if supported else judgement.detection
            judgement = replace(judgement, verdict="unknown", extended=plain, alternatives=inclusion(seen)[:NEAREST],
                                patterns=left.seen_patterns)
        else:
            judgement = self.with_names(judgement, seen, best)
        return beside(judgement, mistakes, physics)

    def with_names(self, judgement: Judgement, seen: Survey, best: Hypothesis) -> Judgement:
        """Names where they are certain and of use on rows that were not fitted, else the set of them."""
        extended, names = judgement.extended, inclusion(seen)
        together = sum(hypothesis.probability for hypothesis in seen.hypotheses if hypothesis.key == best.key)
        labels = {term.label for term in extended.terms}
        causes = tuple(cause for cause in names if cause.label in labels)
        sure = together >= POSSIBLE and all(cause.probability >= CERTAIN for cause in causes)
        if together < CERTAIN and not sure:
            return self.ambiguous(judgement, seen)
        measured = gain(self.data, judgement.plain, extended, self.rng)
        if measured.support <= AGAINST and not only_local(seen, best):
            return replace(self.ambiguous(judgement, seen), withdrawn=tuple(cause.label for cause in causes))
        others = tuple(cause for cause in names if cause.label not in labels and cause.probability >= WORTH_NAMING)
        return replace(judgement, verdict="named", causes=causes, alternatives=others, gain=measured,
                       carried=with_free_laws(extended))

    def ambiguous(self, judgement: Judgement, seen: Survey) -> Judgement:
        """The set of names with the loads that would settle it, and what the choice means for a correction."""
        rivals = rivals_of(judgement.plain.data, seen, judgement.extended.log_compliance)
        return replace(judgement, verdict="ambiguous", alternatives=credible(seen), next_loads=next_loads(rivals, self.rng),
                       robot_difference=robot_difference([model for model, _ in rivals.values()]))


def log_posterior(found: Search, extended: Posterior, entries: int) -> float:
    """ln posterior of a set of causes among `entries`, on the rows in which mistakes were looked for."""
    if not extended.terms:
        return found.log_evidence
    if found.plain.data is not extended.data:
        extended = posterior(found.plain.data, extended.terms, extended.log_compliance)
    size = min(len(extended.terms), len(PRIOR_OF_SIZE))
    return log_evidence(extended) + float(np.log(PRIOR_OF_SIZE[size - 1] / comb(entries, size)))


def beside(judgement: Judgement, mistakes: Mistakes, physics: float) -> Judgement:
    """The judgement, ambiguous where mistakes are about as likely as physics of this ln posterior, or likelier."""
    rivals = mistakes.against(physics)
    if not rivals:
        return judgement
    causes = judgement.causes if judgement.verdict == "named" else judgement.alternatives
    likelier = max(each.candidate.log_posterior for each in rivals) > physics + RIVAL
    return replace(judgement, verdict="ambiguous", mistakes=rivals, causes=(), gain=None, carried=None,
                   alternatives=() if likelier or judgement.verdict == "unknown" else causes)

"""The procedure of docs/effects.md: fit, detect, name, extend, test again, measure the gain."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from identification.common.arrays import rms
from identification.diagnosis.blocks import in_blocks
from identification.diagnosis.detect import REPLICATES, Detection, goodness_of_fit
from identification.diagnosis.discrimination import Rivals, next_loads, rivals_of, robot_difference
from identification.diagnosis.explained import explained
from identification.diagnosis.explaining import INADEQUATE, SET_UP_ANEW, Explaining, louder, strained
from identification.diagnosis.extended_model import with_free_laws
from identification.diagnosis.gain import gain
from identification.diagnosis.gross import bad_rows, with_crowded
from identification.diagnosis.judgement import Judgement, Rival
from identification.diagnosis.naming import (
    CERTAIN,
    credible,
    inclusion,
    kindred,
    only_local,
    told_by_one_visit,
    with_open_laws,
)
from identification.diagnosis.odds import (
    CERTAINLY,
    NO_LIKELIER,
    POSSIBLE,
    THAN_SET_UPS,
    certain,
    doubt_by,
    doubt_of,
    log_odds,
    log_posterior,
)
from identification.diagnosis.power import showing
from identification.diagnosis.search import Hypothesis, Survey
from identification.diagnosis.share import share_of
from identification.diagnosis.slight import no_names, of_nothing, without_slight
from identification.diagnosis.slips_rather import suspected, wrong_angles_rather
from identification.diagnosis.swing import swing_of
from identification.diagnosis.unsettled import unsettled_zero_of
from identification.fit.bad_visits import bad_visits
from identification.fit.load_test import LoadTest
from identification.fit.mending import with_mends
from identification.fit.misfit import GRANTED, beyond_stated, far_off
from identification.fit.mistakes.judge import RIVAL, Mistakes, beyond_the_fit, fitted_or_mistaken, mistakes_in
from identification.fit.posterior import Posterior
from identification.fit.validation import judge_validation
from identification.fit.visits import VisitTest
from identification.measurements import Measurements
from identification.model.cell import Cell
from identification.model.effects import Effect, effects

# Family-wise false alarms of the detection.
ALARM = 0.05
# Up to this probability of the detection a cause is looked for all the same, and must be that much likelier than nothing.
LOOKED_AT = 0.3
# Readings that are so many times off what the noise allows, heavy tails with it, are no noise (misfit.far_off).
FAR_OFF = 1.3
FAR_IN_WORDS = ("the readings are off by {:.1f} times what the noise allows, however heavy its tails: those that are far off "
                "count for little, and hold something else")
# ln of how much likelier causes may become by looking further, where they explain nothing at first.
BEYOND_SEARCH = 100.0
# Laws of one gear that differ in a correction by less than so many times the noise may stay open under one name.
OPEN_LAWS_DIFFER = 1.0
# ln Bayes factor against the plain model under which no cause explains anything.
SUPPORT = 1.0
# A misfit of so many times the noise's chi-squared, explained to this share, has its cause though not its exact law.
GROSS = 2.0
NEARLY_ALL = 0.97
# How many of the nearest names go with an unknown cause.
NEAREST = 5
NOTHING_IN_WORDS = "all its parameters lie within two of their standard deviations of nothing"
SCATTER_IN_WORDS = "several of one kind without a significant misfit stand for scatter, not for causes"
# So many poses that do not fit the others, none by a slip that is likely, are no chance: something depends on the pose.
SEVERAL = 3
SEVERAL_IN_WORDS = ("{} do not fit the other poses, and no likely slip explains any: rather a cause that depends on the pose "
                    "than so many mistakes")
LEAST_IN_WORDS = "{} fit least of all poses the springs of the others, which are not explained either"
WORTH_NAMING = 0.01


def judge(
    cell: Cell, measurements: Measurements, *, catalogue: dict[str, Effect] | None = None, alarm: float = ALARM,
    replicates: int = REPLICATES, seed: int = 0,
) -> Judgement:
    """Finds out what the plain model gets wrong on these measurements.

    Rows of machined passes are averaged over blocks first (blocks.py); of very many rows a share is looked at (share.py). Where
    whole visits or single rows are bad, they are named and the rest is judged without them. catalogue: the effects to choose
    from (all known ones). alarm: family-wise rate of false alarms. Raises what `posterior` raises for the plain model.
    """
    averaged, thinning = in_blocks(cell, measurements)
    looked_at, share = share_of(averaged)
    catalogue = effects() if catalogue is None else catalogue
    procedure = Procedure(LoadTest.of(cell, looked_at), catalogue, alarm, replicates, seed)
    found = replace(procedure.allowing_for_scatter(procedure.of_good_rows()), thinning=thinning, share=share)
    enough = found.adequacy if found.causes else found.detection
    if found.verdict not in ("adequate", "named") or enough is None or enough.p_value <= alarm:
        return found
    return replace(found, showing=showing(found.extended, catalogue, enough.critical))


@dataclass(frozen=True, eq=False)
class Procedure:
    """The procedure on rows taken as they are, validate rows among them; the rest as the arguments of `judge`. sound: a look at
    these rows and a few more found a cause and no mistake."""

    data: LoadTest
    catalogue: dict[str, Effect]
    alarm: float
    replicates: int
    seed: int
    sound: bool = False

    @cached_property
    def rng(self) -> np.random.Generator:
        """Of all that is drawn, in the order of the procedure."""
        return np.random.default_rng(self.seed)

    @cached_property
    def search(self) -> Explaining:
        """The search for causes that explain the rows."""
        return Explaining(self.catalogue, self.alarm, self.replicates, self.rng)

    def allowing_for_scatter(self, judgement: Judgement) -> Judgement:
        """The judgement; where weights swung, or zero readings lie aside of rows that springs do not explain, of the rows with
        that in their noise, if that explains them."""
        data = self.data
        for scatter_of, no_use in ((swing_of, ("mistake",)), (unsettled_zero_of, ("mistake", "adequate"))):
            left = judgement.tried or judgement.extended
            scatter = None if judgement.verdict in no_use else scatter_of(left)
            if scatter is None:
                continue
            allowed = scatter.allowed_for(data, judgement.plain)
            again = replace(self, data=allowed).of_good_rows()
            if again.verdict not in ("unknown", "mistake"):
                data = allowed
                judgement = replace(again, scatters=(*judgement.scatters, scatter),
                                    verdict="named" if again.verdict == "adequate" else again.verdict)
        return judgement

    def of_good_rows(self) -> Judgement:
        """The judgement; where whole visits or single rows are bad, of the others."""
        judgement = self.judged()
        if judgement.verdict == "mistake":
            return judgement
        first, doubted = judgement, suspected(judgement, self.seed)
        test = wrong_angles_rather(judgement, self.seed) or doubted.rather or bad_visits(judgement.extended, self.seed)
        if not test.bad:
            test = with_crowded(test, judgement.extended)
        judgement = self.without_bad_visits(judgement, test) if test.bad else self.without_bad_rows(judgement)
        if judgement.verdict == "adequate" and test.too_many:
            judgement = replace(judgement, verdict="unknown", patterns=(
                "the readings at more than a third of the poses fit no stiffness that fits the others", *judgement.patterns))
        doubted = doubted if judgement is first else suspected(judgement, self.seed)
        return replace(judgement, visits=test, suspects=doubted.visits,
                       validation=judge_validation(judgement.extended, self.data, self.seed))

    def without_bad_visits(self, judgement: Judgement, test: VisitTest) -> Judgement:
        """The judgement of the other visits; of all of them where those have a name, or a few to choose from, and the others
        have none."""
        assert test.rest is not None
        bad, rows = with_mends(test, test.rest, judgement.rows), self.data.rows
        out = np.isin(rows.row, np.concatenate([score.rows for score in test.bad]))
        rest = replace(self, data=self.data.with_rows(rows.select(~out)), sound=sound(judgement))
        again = rest.without_bad_rows(rest.judged())
        if again.verdict == "unknown" and judgement.verdict in ("named", "ambiguous"):
            return self.without_bad_rows(judgement)
        slips = all(visit.score.wrong_angle is not None for visit in bad)
        if again.verdict == "unknown" and judgement.verdict == "unknown" and not slips:
            # What depends on the pose shows most at some: no slip there, while nothing explains the others.
            names = ", ".join(visit.score.name for visit in bad)
            return self.without_bad_rows(replace(judgement, patterns=(LEAST_IN_WORDS.format(names), *judgement.patterns)))
        if again.verdict == "adequate" and len(bad) >= SEVERAL and not any(
                mend.probability >= POSSIBLE for visit in bad for mend in visit.mends):
            names = ", ".join(visit.score.name for visit in bad)
            return replace(again, verdict="unknown", patterns=(SEVERAL_IN_WORDS.format(names),), bad_visits=bad)
        return replace(again, verdict="named" if again.verdict == "adequate" else again.verdict, bad_visits=bad)

    def without_bad_rows(self, judgement: Judgement) -> Judgement:
        """The judgement; where single rows are bad, of the others."""
        if judgement.verdict == "mistake":
            return judgement
        bad = bad_rows(judgement.extended)
        if not bad:
            return judgement
        rows = self.data.rows
        good = self.data.with_rows(rows.select(~np.isin(rows.row, [row.row for row in bad])))
        again = replace(self, data=good, sound=sound(judgement)).judged()
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
        far, odd = far_off(plain), strained(plain) or louder(plain)
        if detection.p_value <= LOOKED_AT or far > FAR_OFF or odd:
            found = self.named(judgement)
            if found.log_odds is not None and found.log_odds >= least_odds(plain):
                return found
            if (far > FAR_OFF or odd) and found.verdict == "mistake":
                return found
            if far > FAR_OFF:
                return found.as_unknown((FAR_IN_WORDS.format(far), *found.patterns))
        unseen = beyond_the_fit(plain)
        return judgement if unseen is None else replace(judgement, verdict="mistake", mistakes=(unseen,))

    def named(self, judgement: Judgement) -> Judgement:
        """The judgement of a plain model that does not explain the rows: a mistake in the files, or a physical cause."""
        plain = judgement.plain
        mistakes = Mistakes() if self.sound else mistakes_in(plain)
        # Springs that are off by a unit mean nothing beside a gross mistake of another kind.
        clear = mistakes.sure or beyond_the_fit(plain)
        if clear is not None:
            return replace(judgement, verdict="mistake", mistakes=(clear,))
        # The parts of the noise that came in for want of a cause must not hide it from the search.
        usual = plain.with_usual_noise
        first = self.search.searched(usual)
        physics = physics_of(mistakes, first.named.seen, first.fitted)
        if mistakes.possible and not first.enough and mistakes.clearly(physics + BEYOND_SEARCH):
            return replace(judgement, verdict="mistake", mistakes=mistakes.possible)
        found = self.search.likeliest(usual, first)
        if found.enough and strained(plain):
            found = self.search.held_against_noise(plain, found)
        seen, best, extended, adequacy, scatter = found.named.seen, found.best, found.fitted, found.adequacy, found.scatter
        # A name that leaves the alarm as it was has explained nothing.
        alarmed = judgement.detection.p_value <= self.alarm
        enough = max(INADEQUATE, judgement.detection.p_value) if alarmed else INADEQUATE
        to_the_noise = adequacy.p_value > enough and not scatter
        slight: frozenset[str] = frozenset()
        if best is not None and (to_the_noise or nearly_all(plain, extended)):
            extended, slight = without_slight(self.data, extended, len(seen.dictionary.entries), self.rng)
        physics = physics_of(mistakes, seen, extended)
        if mistakes.clearly(physics):
            return replace(judgement, verdict="mistake", mistakes=mistakes.possible)
        nearly = nearly_all(plain, extended)
        judgement = replace(judgement, extended=extended, adequacy=adequacy, scatter=scatter, lost=found.named.lost,
                            law_differs=nearly and not to_the_noise)
        supported = best is not None and best.log_evidence >= SUPPORT
        if best is None or not supported or not (to_the_noise or nearly):
            judgement = self.unknown(judgement, seen, adequacy if supported else judgement.detection)
        else:
            judgement = self.with_names(judgement, seen, best, slight)
        return beside(judgement, mistakes, physics)

    def with_names(self, judgement: Judgement, seen: Survey, best: Hypothesis, slight: frozenset[str]) -> Judgement:
        """Names where they are certain and of use on rows that were not fitted, else the set of them; slight: labels of the
        extended model that are none."""
        extended, names, choices = judgement.extended, inclusion(seen), len(seen.dictionary.entries)
        slight = no_names(slight, names, judgement.plain, extended, choices)
        labels = {term.label for term in extended.terms} - slight
        # Of what the model can do without, or what is none, it matters not which it was.
        named = {k for k in best.key if seen.dictionary.entries[k].label in labels}
        together = sum(hypothesis.probability for hypothesis in seen.hypotheses
                       if hypothesis.key == best.key or (len(named) < len(best.key) and named <= hypothesis.key))
        causes = tuple(cause for cause in names if cause.label in labels)
        difference = None
        if not certain(together, causes):
            kin = kindred(seen, best)
            causes = with_open_laws(seen, causes)
            if not certain(sum(hypothesis.probability for hypothesis in kin), causes):
                return self.ambiguous(judgement, seen, best)
            # Which of its laws the gear follows is open: that matters where a correction would be another.
            laws = rivals_of(judgement.plain.data, replace(seen, hypotheses=kin), extended)
            difference = robot_difference([with_free_laws(model) for model, _ in laws.values()])
            if difference > OPEN_LAWS_DIFFER * rms(judgement.expected_std):
                return self.ambiguous(judgement, seen, best)
        far = far_off(extended)
        if far > FAR_OFF:
            return self.unknown(judgement, seen, judgement.detection,
                                dict.fromkeys((cause.label for cause in causes), FAR_IN_WORDS.format(far)))
        nothing = of_nothing(extended)
        if nothing:
            return self.unknown(judgement, seen, judgement.detection, dict.fromkeys(sorted(nothing), NOTHING_IN_WORDS))
        if judgement.detection.p_value > self.alarm and len({cause.effect.name for cause in causes}) < len(causes):
            return self.unknown(judgement, seen, judgement.detection,
                                dict.fromkeys((cause.label for cause in causes), SCATTER_IN_WORDS))
        odds = log_odds(judgement, choices)
        # What touches one pose alone a tail that is heavier than the rows can show explains as well.
        doubt = doubt_of(judgement.detection, odds, np.inf if only_local(seen, best) else least_odds(judgement.plain))
        if doubt:
            return self.unknown(judgement, seen, judgement.detection, {cause.label: doubt for cause in causes})
        measured = gain(self.data, judgement.plain, extended, self.rng)
        against = "" if only_local(seen, best) or told_by_one_visit(extended) else doubt_by(judgement.detection, measured)
        if against:
            return self.unknown(judgement, seen, judgement.detection, {cause.label: against for cause in causes})
        companions = with_open_laws(seen, tuple(cause for cause in names if cause.label in slight))
        given = labels | slight | {f"{law}[{cause.joint}]" for cause in (*causes, *companions) for law in cause.open_laws}
        others = tuple(cause for cause in names if cause.label not in given and cause.probability >= WORTH_NAMING)
        in_force = {term.label: term.effect for term in extended.terms}
        causes = tuple(replace(cause, effect=in_force[cause.label]) for cause in causes)
        return replace(judgement, verdict="named", causes=causes, companions=companions, alternatives=others, gain=measured,
                       log_odds=odds, robot_difference=difference, carried=with_free_laws(extended))

    def unknown(
        self, judgement: Judgement, seen: Survey, left: Detection, withdrawn: dict[str, str] | None = None,
    ) -> Judgement:
        """No name: the nearest ones, what is seen of the cause in what is left, and what spoke against names that were all but
        given."""
        return replace(judgement, verdict="unknown", extended=judgement.plain, alternatives=inclusion(seen)[:NEAREST],
                       patterns=left.seen_patterns, withdrawn=withdrawn or {}, law_differs=False, tried=judgement.extended)

    def ambiguous(self, judgement: Judgement, seen: Survey, best: Hypothesis) -> Judgement:
        """The set of names with the loads that would settle it, and what the choice means for a correction."""
        names = credible(seen, best)
        if len(names) < 2:
            return self.unknown(judgement, seen, judgement.detection)
        odds = log_odds(judgement, len(seen.dictionary.entries))
        doubt = self.doubt_of_all(judgement, seen, best, odds)
        if doubt:
            return self.unknown(judgement, seen, judgement.detection, {cause.label: doubt for cause in names[:NEAREST]})
        rivals = rivals_of(judgement.plain.data, seen, judgement.extended)
        candidates = with_their_laws(rivals)
        difference = robot_difference([model for model, _ in rivals.values()])
        return replace(judgement, verdict="ambiguous", alternatives=names, log_odds=odds, robot_difference=difference,
                       next_loads=next_loads(rivals, self.rng), rivals=candidates[1:],
                       carried=candidates[0].fitted if candidates else None)

    def doubt_of_all(self, judgement: Judgement, seen: Survey, best: Hypothesis, odds: float) -> str:
        """Why what is left open may be nothing, in words, "" where it may not. odds: ln, of the best set against nothing."""
        # All of them together: many that are alike may each be less likely than nothing.
        if odds < np.log(max(best.probability, 1e-300)):
            return NO_LIKELIER
        if judgement.detection.p_value <= self.alarm:
            return ""
        least = np.inf if only_local(seen, best) else least_odds(judgement.plain)
        doubt = doubt_of(judgement.detection, odds, least)
        return doubt if doubt or told_by_one_visit(judgement.extended) else doubt_by(
            judgement.detection, gain(self.data, judgement.plain, judgement.extended, self.rng))


def sound(judgement: Judgement) -> bool:
    """Whether it names causes, and no mistake beside them."""
    return judgement.verdict == "named" and not judgement.mistakes


def physics_of(mistakes: Mistakes, seen: Survey, extended: Posterior) -> float:
    """ln posterior of the causes of a model on the rows in which mistakes were looked for; 0 where there is none to hold it
    against."""
    if mistakes.found is None or not (mistakes.possible or mistakes.slight):
        return 0.0
    return log_posterior(mistakes.found, extended, len(seen.dictionary.entries))


def least_odds(plain: Posterior) -> float:
    """ln of how much likelier a name must be than nothing, where chance shows as much."""
    return THAN_SET_UPS if plain.components.setup > SET_UP_ANEW else CERTAINLY


def with_their_laws(rivals: Rivals) -> tuple[Rival, ...]:
    """The candidates that hold CERTAIN of the probability together, the likeliest first, each with the laws of its effects
    free."""
    held = np.cumsum([probability for _, probability in rivals.values()])
    few = list(rivals.values())[:np.count_nonzero(held < CERTAIN * held[-1:]) + 1]
    total = sum(probability for _, probability in few)
    return tuple(Rival(with_free_laws(model), probability / total) for model, probability in few)


def nearly_all(plain: Posterior, extended: Posterior) -> bool:
    """Whether a gross misfit of the plain model has its cause in the extended one, though not its exact law."""
    share = explained(plain, extended)
    return share.excess >= GROSS and share.share >= NEARLY_ALL


def beside(judgement: Judgement, mistakes: Mistakes, physics: float) -> Judgement:
    """The judgement, ambiguous where mistakes are about as likely as physics of this ln posterior, or likelier."""
    rivals = mistakes.against(physics, judgement.verdict == "named")
    causes = judgement.causes if judgement.verdict == "named" else judgement.alternatives
    if not rivals or len(rivals) + len(causes) < 2:
        return judgement
    likelier = len(rivals) > 1 and max(each.candidate.log_posterior for each in rivals) > physics + RIVAL
    return replace(judgement, verdict="ambiguous", mistakes=rivals, causes=(), companions=(), gain=None, withdrawn={},
                   alternatives=() if likelier else causes, next_loads=() if likelier else judgement.next_loads, carried=None,
                   rivals=(), robot_difference=None)

"""The procedure of docs/effects.md: fit, detect, name, extend, test again, measure the gain."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from identification.diagnosis.blocks import Thinning, in_blocks
from identification.diagnosis.detect import REPLICATES, Detection, detect
from identification.diagnosis.dictionary import dictionary
from identification.diagnosis.discrepancy import discrepancies, uncertain
from identification.diagnosis.discrimination import NextLoad, next_loads, rivals_of
from identification.diagnosis.gain import Gain, gain
from identification.diagnosis.gross import BadRow, bad_rows
from identification.diagnosis.patterns import patterns
from identification.diagnosis.projection import Base
from identification.diagnosis.sag import sag_columns
from identification.diagnosis.scatter import GRANTED, GRANTED_AFTER_NAMING, beyond_stated, explained
from identification.diagnosis.search import Hypothesis, Survey, survey
from identification.fit.fitted_model import Term, predicted_deflection, situation_of, split
from identification.fit.posterior import Posterior, posterior
from identification.fit.priors import PriorModel
from identification.measurements import Measurements
from identification.model.cell import Cell
from identification.model.effects import Effect, effects
from identification.model.effects_in_force import EffectInForce

Array = NDArray[np.float64]
Verdict = Literal["adequate", "named", "ambiguous", "unknown"]

# Family-wise false alarms of the detection, and of the test whether the extended model is enough.
ALARM = 0.05
INADEQUATE = 0.005
# A name is given when this much probability is on it; the set of names holds as much.
CERTAIN = 0.95
# Several causes may each be certain while what else is at work is not: they are named if so much is on them alone.
POSSIBLE = 0.5
MOST_CAUSES = 3
# ln Bayes factor against the plain model under which no cause explains anything.
SUPPORT = 1.0
# An effect under this share of its typical size is no cause beside others.
SLIGHT = 0.4
# Nor is one of this share of the signal of an effect whose law is uncertain by more.
BESIDE = 0.15
# ln of how much likelier rows that were not fitted must be without a name for it to be withdrawn.
AGAINST = -3.0
# A misfit of so many times the noise's chi-squared, explained to this share, has its cause though not its exact law.
GROSS = 2.0
NEARLY_ALL = 0.97
# How many of the nearest names go with an unknown cause.
NEAREST = 5
WORTH_NAMING = 0.01
# How often the best set of causes is fitted and the dictionary looked through again from there.
MAX_ROUNDS = 4


@dataclass(frozen=True, eq=False)
class Cause(EffectInForce):
    """One effect with its probability (of being at work, alone or with others)."""

    probability: float

    @property
    def sentence(self) -> str:
        """The cause in plain words."""
        return self.effect.sentence.format(joint=self.joint)


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """What is wrong. rows: those that were fitted. plain: the fit without effects; extended: with the likeliest ones (the plain
    fit where none was found). detection: of the plain model, adequacy: of the extended one. causes, alternatives: as in
    docs/formats.md#diagnose. rivals: fitted models of the alternatives. scatter: parts of the noise beyond what was stated.
    patterns: what is seen of an unknown cause. matters: by how much [m, RMS] the rivals differ in what the robot does under the
    largest load, None where nothing is ambiguous. left_out: effects these rows cannot show, and why. law_differs: the causes
    explain nearly all of the misfit, and what is left is still more than noise. bad_rows: not among `rows`.
    thinning: how the rows of machined passes were averaged. carried: the extended model with the laws of its effects free
    within what real ones differ by, None where nothing is named: its springs are the ones to use."""

    verdict: Verdict
    rows: Measurements
    plain: Posterior
    extended: Posterior
    detection: Detection
    adequacy: Detection | None
    causes: tuple[Cause, ...] = ()
    alternatives: tuple[Cause, ...] = ()
    gain: Gain | None = None
    next_loads: tuple[NextLoad, ...] = ()
    matters: float | None = None
    scatter: dict[str, float] | None = None
    patterns: tuple[str, ...] = ()
    left_out: dict[str, str] | None = None
    withdrawn: tuple[str, ...] = ()
    law_differs: bool = False
    bad_rows: tuple[BadRow, ...] = ()
    thinning: Thinning | None = None
    carried: Posterior | None = None


def diagnose(
    cell: Cell, measurements: Measurements, *, catalogue: dict[str, Effect] | None = None, alarm: float = ALARM,
    replicates: int = REPLICATES, seed: int = 0,
) -> Diagnosis:
    """Finds out what the plain model gets wrong on these measurements.

    Rows of machined passes are averaged over blocks first (blocks.py). Where single rows are bad, they are named and the rest
    is judged without them. catalogue: the effects to choose from (all known ones). alarm: family-wise rate of false alarms.
    Raises what `fit_stiffness` raises.
    """
    catalogue = effects() if catalogue is None else catalogue
    measurements, thinning = in_blocks(cell, measurements)
    return replace(_without_bad_rows(cell, measurements, catalogue, alarm, replicates, seed), thinning=thinning)


def _without_bad_rows(
    cell: Cell, measurements: Measurements, catalogue: dict[str, Effect], alarm: float, replicates: int, seed: int
) -> Diagnosis:
    found = judge(cell, measurements, catalogue, alarm, replicates, np.random.default_rng(seed))
    bad = bad_rows(cell, found.rows, found.extended)
    if not bad:
        return found
    good = measurements.select(~np.isin(measurements.row, [one.row for one in bad]))
    again = judge(cell, good, catalogue, alarm, replicates, np.random.default_rng(seed))
    if again.verdict == "adequate":
        measured = gain(cell, good, again.plain, again.extended, np.random.default_rng(seed))
        return replace(again, verdict="named", gain=measured, bad_rows=bad)
    if again.verdict == "named" or found.verdict != "named":
        return replace(again, bad_rows=bad)
    return found


def judge(
    cell: Cell, measurements: Measurements, catalogue: dict[str, Effect], alarm: float, replicates: int,
    rng: np.random.Generator,
) -> Diagnosis:
    """The procedure on rows taken as they are; arguments as `diagnose`."""
    rows = measurements.select(~measurements.validate)
    prior = PriorModel(cell.prior)
    plain = posterior(cell, rows, prior)
    where = situation_of(cell, rows, np.exp(plain.map))
    missing = {effect.name: effect.missing(where) for effect in catalogue.values()}
    detection = test(cell, rows, plain, catalogue, rng, replicates)
    scattered = beyond_stated(cell, rows, plain, GRANTED)
    base = Diagnosis("adequate", rows, plain, plain, detection, None, scatter=scattered,
                     left_out={name: why for name, why in missing.items() if why})
    if detection.p_value > alarm and not scattered:
        return base
    seen, best, extended = converged(cell, rows, prior, plain, catalogue, 2)
    adequacy = test(cell, rows, extended, catalogue, rng, replicates)
    if adequacy.p_value <= INADEQUATE:
        seen, best, extended = converged(cell, rows, prior, extended, catalogue, MOST_CAUSES)
        adequacy = test(cell, rows, extended, catalogue, rng, replicates)
    scattered = beyond_stated(cell, rows, extended, GRANTED_AFTER_NAMING)
    slight = slight_terms(cell, measurements, prior, extended, rng)
    if best is not None and slight and len(slight) < len(extended.terms):
        # They stand for what the others' laws do not give exactly; a cause is not that small beside another.
        kept = tuple(term for term in extended.terms if term.label not in slight)
        extended = posterior(cell, rows, prior, kept, extended.map[:6])
    names = inclusion(seen)
    found = replace(base, extended=extended, adequacy=adequacy, scatter=scattered)
    told = explained(cell, rows, plain, extended)
    to_the_noise = adequacy.p_value > INADEQUATE and not scattered
    nearly = told.excess >= GROSS and told.share >= NEARLY_ALL
    found = replace(found, law_differs=nearly and not to_the_noise)
    if best is None or best.log_evidence < SUPPORT or not (to_the_noise or nearly):
        left = adequacy if best is not None and best.log_evidence >= SUPPORT else detection
        return replace(found, verdict="unknown", extended=plain, alternatives=names[:NEAREST],
                       patterns=left.seen_patterns)
    together = sum(one.probability for one in seen.hypotheses if one.key == best.key)
    labels = {term.label for term in extended.terms}
    causes = tuple(cause for cause in names if cause.label in labels)
    sure = together >= POSSIBLE and all(cause.probability >= CERTAIN for cause in causes)
    if together < CERTAIN and not sure:
        return ambiguous(cell, found, prior, seen, rng)
    measured = gain(cell, measurements, plain, extended, rng)
    if measured.support <= AGAINST and not only_local(seen, best):
        return replace(ambiguous(cell, found, prior, seen, rng), withdrawn=tuple(cause.label for cause in causes))
    others = tuple(cause for cause in names if cause.label not in labels and cause.probability >= WORTH_NAMING)
    return replace(found, verdict="named", causes=causes, alternatives=others, gain=measured,
                   carried=with_free_laws(cell, rows, prior, extended))


def with_free_laws(cell: Cell, rows: Measurements, prior: PriorModel, extended: Posterior) -> Posterior:
    """The extended model fitted again with the laws of its effects free within what real ones differ by."""
    where = situation_of(cell, rows, np.exp(extended.map[:6]))
    terms = tuple(replace(term, start=values) for term, values in zip(
        extended.terms, split(extended.map, extended.terms), strict=True))
    free = discrepancies(where, terms)
    return posterior(cell, rows, prior, (*terms, *free), extended.map[:6]) if free else extended


def slight_terms(
    cell: Cell, measurements: Measurements, prior: PriorModel, extended: Posterior, rng: np.random.Generator
) -> set[str]:
    """Labels of the terms that stand for what the others' laws do not give exactly: small against their typical size, or small
    in these rows beside an effect whose law is uncertain and of no use on rows that were not fitted."""
    rows = measurements.select(~measurements.validate)
    where = situation_of(cell, rows, np.exp(extended.map[:6]))
    at, found, strength = extended.at_map, set(), {}
    for term, values in zip(extended.terms, split(extended.map, extended.terms), strict=True):
        if size_of(term, values) < SLIGHT:
            found.add(term.label)
        added = at.noise.rotation @ term.effect.contribution(where, term.joint, values)[:, :3, None]
        strength[term.label] = float(np.sqrt(at.weights.inner(added, added)[0, 0]))
    for term in extended.terms:
        if not uncertain(term.effect):
            continue
        for label in [label for label, value in strength.items() if value < BESIDE * strength[term.label]]:
            others = tuple(one for one in extended.terms if one.label != label)
            without = posterior(cell, rows, prior, others, extended.map[:6])
            if gain(cell, measurements, without, extended, rng).support < -AGAINST:
                found.add(label)
    return found


def ambiguous(cell: Cell, found: Diagnosis, prior: PriorModel, seen: Survey, rng: np.random.Generator) -> Diagnosis:
    """The set of names with the loads that would settle it, and what the choice means for a correction."""
    rows = found.rows
    rivals = rivals_of(cell, rows, prior, seen, found.extended.map[:6])
    return replace(found, verdict="ambiguous", alternatives=credible(seen), next_loads=next_loads(cell, rows, rivals, rng),
                   matters=robot_difference(cell, rows, [model for model, _ in rivals.values()]))


def robot_difference(cell: Cell, rows: Measurements, models: list[Posterior]) -> float:
    """Largest RMS [m] by which two models differ in what the robot itself does under the measured loads."""
    loaded = rows.select(np.any(rows.wrench != 0, axis=1))
    moved = []
    for model in models:
        kept = [k for k, term in enumerate(model.terms) if term.effect.of_robot]
        values = split(model.map, model.terms)
        x = np.concatenate([model.map[:6], *(values[k] for k in kept)])
        moved.append(predicted_deflection(cell, loaded, x, tuple(model.terms[k] for k in kept)))
    return max((float(np.sqrt(np.mean((a - b) ** 2))) for a, b in combinations(moved, 2)), default=0.0)


def test(
    cell: Cell, rows: Measurements, fitted: Posterior, catalogue: dict[str, Effect], rng: np.random.Generator, replicates: int
) -> Detection:
    """Whether the fitted model explains the rows, the laws of its terms free within their shapes."""
    where = situation_of(cell, rows, np.exp(fitted.map[:6]))
    at = fitted.at_map
    words = dictionary(where, at.noise, catalogue)
    precision = fitted.prior.precision(fitted.map)
    shift = np.asarray(-np.linalg.solve(precision, fitted.prior.gradient(fitted.map)))
    base = Base(at.design, at.residual, at.weights, precision, shift).extended(sag_columns(where, at.noise))
    for term in fitted.terms:
        entry = next(k for k, one in enumerate(words.entries) if one.label == term.label)
        places = [k for k in words.entries[entry].signatures if words.signatures[k].effect.where == term.effect.where]
        base = base.extended(words.shapes(entry, places[0]))
        undecided = words.undecided(where, at.noise, term.joint)
        if undecided.shape[2]:
            base = base.extended(undecided)
    return detect(base, words, patterns(where, at.noise), at.noise, fitted.size, fitted.size_spread, fitted.row_weight, rng,
                  replicates)


def size_of(term: Term, values: Array) -> float:
    """How large the effect is, in typical sizes: the norm of the parameters that say how large it is."""
    told = np.array([not parameter.shape for parameter in term.effect.parameters])
    return float(np.linalg.norm((values - term.neutral)[told] / term.scale[told]))


def converged(
    cell: Cell, rows: Measurements, prior: PriorModel, fitted: Posterior, catalogue: dict[str, Effect], levels: int
) -> tuple[Survey, Hypothesis | None, Posterior]:
    """The best set of causes, fitted, and everything seen from there: fitted and looked at again until it stays the best."""
    tried: set[frozenset[int]] = set()
    best = None
    for _ in range(MAX_ROUNDS):
        seen = survey(cell, rows, prior, fitted, catalogue, levels)
        if not seen.hypotheses or (best is not None and seen.hypotheses[0].key == best.key):
            break
        best = seen.hypotheses[0]
        if best.key in tried:
            break
        tried.add(best.key)
        fitted = posterior(cell, rows, prior, seen.terms(best), fitted.map[:6])
    return seen, best, fitted


def inclusion(seen: Survey) -> tuple[Cause, ...]:
    """Every entry with the probability that it is at work, alone or with others; the likeliest first."""
    total = np.zeros(len(seen.words.entries))
    for one in seen.hypotheses:
        total[list(one.entries)] += one.probability
    order = np.argsort(-total)
    return tuple(Cause(seen.words.entries[k].effect, seen.words.entries[k].joint, float(min(total[k], 1.0))) for k in order)


def credible(seen: Survey) -> tuple[Cause, ...]:
    """The names in the likeliest hypotheses that hold CERTAIN of the probability together."""
    held = 0.0
    names: set[int] = set()
    for one in seen.hypotheses:
        names |= one.key
        held += one.probability
        if held >= CERTAIN:
            break
    labels = {seen.words.entries[k].label for k in names}
    return tuple(cause for cause in inclusion(seen) if cause.label in labels)


def only_local(seen: Survey, best: Hypothesis) -> bool:
    """Whether every effect touches one pose only, so that no other pose can tell of it."""
    return all(seen.words.signatures[signature].local for signature in best.signatures)



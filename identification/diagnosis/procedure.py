"""The procedure of EFFECTS.md: fit, detect, name, extend, test again, measure the gain."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from identification.cell import Cell
from identification.diagnosis.detect import REPLICATES, Detection, detect
from identification.diagnosis.dictionary import dictionary
from identification.diagnosis.gain import Gain, gain
from identification.diagnosis.patterns import patterns
from identification.diagnosis.projection import Base
from identification.diagnosis.search import Hypothesis, Survey, survey
from identification.extension import situation_of
from identification.inference import Posterior, posterior
from identification.measurements import Measurements
from identification.model.effects import Effect, effects
from identification.priors import PriorModel

Array = NDArray[np.float64]
Verdict = Literal["adequate", "named", "ambiguous", "unknown"]

# Family-wise false alarms of the detection, and of the test whether the extended model is enough.
ALARM = 0.05
INADEQUATE = 0.01
# A name is given when this much probability is on it; the set of names holds as much.
CERTAIN = 0.95
# Several causes may each be certain while what else is at work is not: they are named if so much is on them alone.
POSSIBLE = 0.5
MOST_CAUSES = 3
# How often the best set of causes is fitted and the dictionary looked through again from there.
MAX_ROUNDS = 4


@dataclass(frozen=True, eq=False)
class Cause:
    """One effect with its probability (of being at work, alone or with others)."""

    effect: Effect
    joint: int | None
    probability: float

    @property
    def label(self) -> str:
        """backlash[1], or the effect's name where it belongs to no joint."""
        return self.effect.name if self.joint is None else f"{self.effect.name}[{self.joint}]"


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """What is wrong. plain: the fit without effects; extended: with the named ones (the plain fit where none is named).
    detection: of the plain model, adequacy: of the extended one. causes, alternatives: FORMATS.md, diagnosis.json."""

    verdict: Verdict
    plain: Posterior
    extended: Posterior
    detection: Detection
    adequacy: Detection | None
    causes: tuple[Cause, ...]
    alternatives: tuple[Cause, ...]
    gain: Gain | None
    left_out: dict[str, str]
    withdrawn: tuple[str, ...]
    reason: str


def diagnose(
    cell: Cell, measurements: Measurements, *, catalogue: dict[str, Effect] | None = None, alarm: float = ALARM,
    replicates: int = REPLICATES, seed: int = 0,
) -> Diagnosis:
    """Finds out what the plain model gets wrong on these measurements.

    catalogue: the effects to choose from (all known ones). alarm: family-wise rate of false alarms. Raises what
    `inference.posterior` raises.
    """
    rng = np.random.default_rng(seed)
    catalogue = effects() if catalogue is None else catalogue
    rows = measurements.select(~measurements.validate)
    prior = PriorModel(cell.prior)
    plain = posterior(cell, rows, prior)
    detection = test(cell, rows, plain, catalogue, rng, replicates)
    left_out = {effect.name: effect.missing(situation_of(cell, rows, np.exp(plain.map)))
                for effect in catalogue.values()}
    left_out = {name: why for name, why in left_out.items() if why}

    def answer(verdict: Verdict, extended: Posterior = plain, adequacy: Detection | None = None,
               causes: tuple[Cause, ...] = (), alternatives: tuple[Cause, ...] = (), measured: Gain | None = None,
               withdrawn: tuple[str, ...] = (), reason: str = "") -> Diagnosis:
        return Diagnosis(verdict, plain, extended, detection, adequacy, causes, alternatives, measured, left_out, withdrawn,
                         reason)

    if detection.p_value > alarm:
        return answer("adequate")
    seen, best, extended = converged(cell, rows, prior, plain, catalogue, 2)
    adequacy = test(cell, rows, extended, catalogue, rng, replicates)
    if adequacy.p_value <= INADEQUATE:
        seen, best, extended = converged(cell, rows, prior, extended, catalogue, MOST_CAUSES)
        adequacy = test(cell, rows, extended, catalogue, rng, replicates)
    if best is None or adequacy.p_value <= INADEQUATE:
        return answer("unknown", plain, adequacy, (), inclusion(seen)[:5], reason="no cause of the dictionary explains it")
    names = inclusion(seen)
    together = sum(one.probability for one in seen.hypotheses if one.key == best.key)
    causes = tuple(cause for cause in names if any(
        cause.effect is seen.words.entries[k].effect and cause.joint == seen.words.entries[k].joint for k in best.entries))
    sure = together >= POSSIBLE and all(cause.probability >= CERTAIN for cause in causes)
    if together < CERTAIN and not sure:
        return answer("ambiguous", extended, adequacy, (), credible(seen))
    measured = gain(cell, measurements, plain, extended, rng)
    if measured.support <= 0 and not only_local(seen, best):
        return answer("ambiguous", extended, adequacy, (), credible(seen), None, tuple(cause.label for cause in causes),
                      "the name was withdrawn: it does not predict poses that were not fitted")
    others = tuple(cause for cause in names if cause not in causes and cause.probability >= 0.001)
    return answer("named", extended, adequacy, causes, others, measured)


def test(
    cell: Cell, rows: Measurements, fitted: Posterior, catalogue: dict[str, Effect], rng: np.random.Generator, replicates: int
) -> Detection:
    """Whether the fitted model explains the rows."""
    where = situation_of(cell, rows, np.exp(fitted.map[:6]))
    at = fitted.at_map
    words = dictionary(where, at.noise, catalogue)
    precision = fitted.prior.precision(fitted.map)
    shift = np.asarray(-np.linalg.solve(precision, fitted.prior.gradient(fitted.map)))
    base = Base(at.design, at.residual, at.weights, precision, shift)
    return detect(base, words, patterns(where, at.noise), at.noise, fitted.size, fitted.size_spread, fitted.row_weight, rng,
                  replicates)


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



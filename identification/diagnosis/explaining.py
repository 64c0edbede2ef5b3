"""The likeliest causes that explain the rows: where those that were found do not, what another noise, what the visits begin
with, or more causes make of them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from identification.diagnosis.begun import named_by_fits
from identification.diagnosis.by_own_fits import held_against, likelier_fit, likeliest_fit
from identification.diagnosis.detect import Detection, goodness_of_fit
from identification.diagnosis.naming import LIKELIER, Named, converged, with_plainer_effects
from identification.diagnosis.search import Hypothesis, log_prior
from identification.fit.misfit import GRANTED_AFTER_NAMING, ONE_SIDED_95, beyond_stated
from identification.fit.mistakes.evidence import log_evidence, under_ordinary_noise
from identification.fit.noise_parts import SENSOR
from identification.fit.posterior import Posterior
from identification.model.effects import Effect

# Family-wise false alarms of the test whether the extended model is enough.
INADEQUATE = 0.005
# Forces that differ from one set-up to the next by so many times what is usual may stand for a cause.
SET_UP_ANEW = 3.0
# ln of how much likelier other causes must be than ones that explain the rows: real laws are none of the dictionary's.
FAR_LIKELIER = 10.0
# Or sensors that scatter by so many times what is stated, with 95 % confidence: data sheets are seldom off by as much.
LOUDER = 1.5
# So may sensors that remember so many times what is usual, and tails so heavy.
REMEMBERS, HEAVY = 10.0, 3.0
MOST_CAUSES = 3


@dataclass(frozen=True, eq=False)
class Explanation:
    """The likeliest set of causes and how it explains the rows: the test of the fit with them, and the parts of the noise that
    are larger than granted."""

    named: Named
    adequacy: Detection
    scatter: dict[str, float]

    @property
    def fitted(self) -> Posterior:
        """The model with the causes."""
        return self.named.fitted

    @property
    def best(self) -> Hypothesis | None:
        """The causes."""
        return self.named.best

    @property
    def enough(self) -> bool:
        """Whether they explain the rows."""
        return self.adequacy.p_value > INADEQUATE and not self.scatter

    def likelier_than(self, other: Explanation) -> bool:
        """Whether these causes are likelier than the other ones, by their fits; than ones that explain the rows they must be
        far likelier, and explain them too."""
        return self.enough >= other.enough and self._value > other._value + (FAR_LIKELIER if other.enough else LIKELIER)

    @property
    def _value(self) -> float:
        terms = len(self.fitted.terms)
        return log_evidence(self.fitted) + (log_prior(terms, len(self.named.seen.dictionary.entries)) if terms else 0.0)


@dataclass(frozen=True, eq=False)
class Explaining:
    """The search over a catalogue of effects; each set of causes that it comes to is tested with so many replicates, drawn from
    rng. alarm: family-wise rate of false alarms."""

    catalogue: dict[str, Effect]
    alarm: float
    replicates: int
    rng: np.random.Generator

    def likeliest(self, usual: Posterior, found: Explanation) -> Explanation:
        """The likeliest set of causes: what was found, or where that does not explain the rows what another noise, or more
        causes, make of them."""
        if not found.enough or found.best is None or strained(found.fitted):
            # Nor must parts that there are and that have grown, which they do without end where the cause is large.
            quiet = self.searched(likeliest_fit(under_ordinary_noise(usual), self.catalogue, 2))
            if (quiet.enough and not found.enough) or quiet.likelier_than(found):
                found = quiet
        if not found.enough and found.best is not None:
            other = likelier_fit(found.named)
            rival = None if other is None else self.searched(other, rejected=found.best.key)
            found = rival if rival is not None and rival.enough else found
        if not found.enough or strained(found.fitted):
            # What every visit begins anew the look at all effects does not know.
            named = named_by_fits(usual, self.catalogue)
            begun = None if named is None else self.tested(named)
            found = begun if begun is not None and begun.likelier_than(found) else found
        if not found.enough:
            lost = found.named.lost
            found = self.searched(found.fitted, MOST_CAUSES)
            found = replace(found, named=replace(found.named, lost=tuple(dict.fromkeys((*lost, *found.named.lost)))))
        if not found.enough and found.best is not None and len(found.best.entries) > 1:
            # What several together do not explain one alone may, with another noise.
            alone = self.searched(usual, 1)
            if alone.adequacy.p_value > self.alarm:
                found = alone
        return found

    def held_against_noise(self, plain: Posterior, found: Explanation) -> Explanation:
        """Causes that explain the rows, with others as likely as they are where the noise of a plain model that explains much
        is theirs; or those of them that are likelier."""
        named, likelier = held_against(found.named, plain, self.catalogue)
        other = None if likelier is None else self.searched(likelier, len(likelier.terms))
        return other if other is not None and other.enough and other.likelier_than(found) else replace(found, named=named)

    def searched(self, start: Posterior, levels: int = 2, rejected: frozenset[int] | None = None) -> Explanation:
        """The likeliest set of up to so many causes, seen from a fitted model, and whether it explains the rows."""
        return self.tested(with_plainer_effects(converged(start, self.catalogue, levels, rejected)))

    def tested(self, named: Named) -> Explanation:
        """Causes with the test whether they explain the rows."""
        return Explanation(named, goodness_of_fit(named.fitted, self.catalogue, self.rng, self.replicates),
                           beyond_stated(named.fitted, GRANTED_AFTER_NAMING))


def strained(fitted: Posterior) -> bool:
    """Whether parts of the noise that need not be there are large beside the causes: there may be likelier ones."""
    return fitted.components.setup > SET_UP_ANEW or fitted.components.memory > REMEMBERS or fitted.components.degrees <= HEAVY


def louder(fitted: Posterior) -> bool:
    """Whether the sensors scatter by far more than is stated: there may be something beside their noise."""
    least = fitted.components.sensor * float(np.exp(-ONE_SIDED_95 * fitted.components_log_std[SENSOR]))
    return bool(fitted.at_map.noise.stated[SENSOR]) and least > LOUDER

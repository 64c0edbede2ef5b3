"""The search for causes on the numbers of a machined part: a linear model with all that a part has beside the load.

The detection, the dictionary and the search are those of load tests; what differs is how a row sees the arm, what else is free
beside the springs, and which effects a part can show at all.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from identification.common.arrays import Array, rms
from identification.diagnosis.detect import REPLICATES, Detection, detect
from identification.diagnosis.dictionary import Dictionary, dictionary_of
from identification.diagnosis.explaining import INADEQUATE, MOST_CAUSES
from identification.diagnosis.judgement import Cause
from identification.diagnosis.naming import credible, inclusion, kindred, with_open_laws
from identification.diagnosis.odds import NAMING, certain
from identification.diagnosis.procedure import ALARM, OPEN_LAWS_DIFFER, SUPPORT
from identification.diagnosis.projection import PRIOR_SIZES, Base
from identification.diagnosis.search import Hypothesis, Survey, searched
from identification.diagnosis.slight import beyond_nothing
from identification.fit.discrepancy import discrepancies, other_ways
from identification.fit.fitted_model import Term
from identification.fit.sag import sag_columns
from identification.model.effects import Effect, effects
from identification.model.effects.kinds import InMotion
from identification.model.load_state import LoadState

Verdict = Literal["adequate", "named", "ambiguous", "unknown"]
# What a part cannot show: it is measured by another instrument than a load test; its load comes from the cutter; no load stands
# long enough to creep under; a scale of the force is the factor in motion, and a zero of it a smooth error like any other.
OF_LOAD_TESTS = ("deflection measurement", "load path")
NOT_ON_A_PART = ("creep", "force_gain", "force_offset")


def effects_of_parts() -> dict[str, Effect]:
    """The effects that a machined part may show."""
    return {name: effect for name, effect in effects().items() if effect.family not in OF_LOAD_TESTS
            and name not in NOT_ON_A_PART and not isinstance(effect, InMotion)}


@dataclass(frozen=True, eq=False)
class PartRows:
    """n numbers of a part and the arm while it was cut. state: N rows in the order of the loads; see: displacements (N, 3, k)
    [m] -> what the numbers see of them (n, k) [m]; factor (n, n): Cholesky factor of the noise's covariance, all that is smooth
    or shared in it; residual (n,) [m]: measured less the model without effects; free (n, q) [m]: what else is free, in
    units of its 1 sigma before the part was measured."""

    state: LoadState
    see: Callable[[Array], Array]
    factor: Array
    residual: Array
    free: Array

    @property
    def readings(self) -> int:
        """n."""
        return len(self.residual)

    def whitened(self, moved: Array) -> Array:
        """As `Sight`: (n, 1, k)."""
        return self._white(self.see(moved))

    def apply(self, columns: Array) -> Array:
        """As `Weighing`: the noise is white already."""
        return columns

    def freed(self, moved: Array) -> WithFreeVisits:
        """As `Weighing`."""
        return WithFreeVisits(self, np.zeros((self.readings, 1, 0))).freed(moved)

    def draw(self, rng: np.random.Generator, count: int) -> Array:
        """As `Drawn` (n, 1, count)."""
        return rng.standard_normal((self.readings, 1, count))

    @cached_property
    def base(self) -> Base:
        """The model without effects."""
        free = self._white(self.free)
        size = free.shape[2]
        plain = Base(free, self._white(self.residual[:, None])[:, :, 0], self, np.eye(size), np.zeros(size))
        return plain.extended(sag_columns(self.state, self))

    def dictionary(self, catalogue: dict[str, Effect]) -> Dictionary:
        """As these numbers would show it."""
        return dictionary_of(self.state, self, catalogue)

    def _white(self, columns: Array) -> Array:
        from scipy.linalg import solve_triangular

        if not columns.shape[1]:
            return np.zeros((self.readings, 1, 0))
        return np.asarray(solve_triangular(self.factor, columns, lower=True, check_finite=False))[:, None, :]


@dataclass(frozen=True, eq=False)
class WithFreeVisits:
    """The noise of a part's numbers with columns (n, 1, m) of 1 sigma each in it: what its few visits may do by themselves."""

    rows: PartRows
    columns: Array

    @cached_property
    def _inverse(self) -> Array:
        columns = self.columns[:, 0]
        return np.asarray(np.linalg.inv(np.eye(columns.shape[1]) + columns.T @ columns), dtype=float)

    def apply(self, columns: Array) -> Array:
        """As `Weighing`."""
        mine = self.columns[:, 0]
        return np.asarray(columns - (mine @ (self._inverse @ (mine.T @ columns[:, 0])))[:, None])

    def freed(self, moved: Array) -> WithFreeVisits:
        """As `Weighing`."""
        visit = self.rows.state.visit
        each = [self.rows.whitened(moved * (visit == number)[:, None, None])
                for number in np.unique(visit[np.any(moved, axis=(1, 2))])]
        return WithFreeVisits(self.rows, np.concatenate([self.columns, *each], axis=2))


@dataclass(frozen=True, eq=False)
class Found:
    """What a search says. verdict; causes: named, or the set that cannot be told apart; terms: the named ones, to be fitted.
    clear: chance so seldom shows as much that it would be enough for a name."""

    verdict: Verdict
    causes: tuple[Cause, ...] = ()
    terms: tuple[Term, ...] = ()
    clear: bool = False


def alarm(rows: PartRows, dictionary: Dictionary, rng: np.random.Generator, replicates: int = REPLICATES) -> Detection:
    """Is there anything that acts with the force and that the model without effects does not explain?"""
    return detect(rows.base, dictionary, (), (rows,), rng, replicates)


def adequate(detection: Detection) -> bool:
    """Whether chance shows as much too often for an alarm."""
    return detection.p_value > ALARM


def best_of(rows: PartRows, dictionary: Dictionary) -> Survey:
    """All sets of causes."""
    return searched(rows.base, dictionary, rows.state, rows, MOST_CAUSES)


def columns_of(rows: PartRows, seen: Survey, chosen: Hypothesis) -> Array:
    """What a set's effects do to the numbers (n, p) [m], in units of their 1 sigma before."""
    shapes = [seen.dictionary.signatures[k] for k in chosen.signatures]
    return np.concatenate([rows.see(PRIOR_SIZES * shape.scale * shape.rows) for shape in shapes], axis=1)


def moved_by(rows: PartRows, seen: Survey, chosen: Hypothesis) -> list[Array]:
    """What each effect of a set does to the tool (N, 3) [m] in all states, as large as the numbers say."""
    return [term.contribution(rows.state, term.start)[:, :3] for term in seen.terms(chosen)]


def enough(
    rows: PartRows, seen: Survey, chosen: Hypothesis, rng: np.random.Generator, replicates: int = REPLICATES,
) -> Detection:
    """Detection with a set of causes in the model, their laws free within their shapes."""
    dictionary, base = seen.dictionary, rows.base
    for entry, signature in zip(chosen.entries, chosen.signatures, strict=True):
        base = base.extended(dictionary.shapes(entry, signature))
        base = base.freed(dictionary.undecided(rows.state, dictionary.entries[entry].joint), rows.state.visit)
    base = base.unsure_of(other_ways(rows.state, rows, seen.terms(chosen)))
    return detect(base, dictionary, (), (rows,), rng, replicates)


def judged(rows: PartRows, seen: Survey, first: Detection, after: Detection) -> Found:
    """Names by the rules of load tests: certain, enough, likelier than none, and a detection that chance seldom shows."""
    if adequate(first):
        return Found("adequate")
    clear = first.p_value <= max(NAMING, first.resolution)
    if not seen.hypotheses:
        return Found("unknown", clear=clear)
    best = seen.hypotheses[0]
    too_little = best.log_evidence < SUPPORT or after.p_value <= max(INADEQUATE, min(first.p_value, ALARM))
    if too_little or not clear:
        return Found("unknown", inclusion(seen)[:MOST_CAUSES], clear=clear)
    labels = {seen.dictionary.entries[k].label for k in best.key}
    causes = tuple(cause for cause in inclusion(seen) if cause.label in labels)
    together = sum(one.probability for one in seen.hypotheses if one.key == best.key)
    if not certain(together, causes):
        kin = kindred(seen, best)
        causes = with_open_laws(seen, causes)
        if not certain(sum(one.probability for one in kin), causes) or _apart(seen, kin) > OPEN_LAWS_DIFFER:
            return Found("ambiguous", credible(seen, best), clear=clear)
    return Found("named", causes, seen.terms(best), clear)


def free_laws(state: LoadState, terms: tuple[Term, ...], values: Array) -> tuple[Term, ...]:
    """What is to be carried beside named terms of these values (P,): how far their real laws may be off the dictionary's, as
    for load tests."""
    ends = np.cumsum([len(term.effect.parameters) for term in terms])
    return discrepancies(state, tuple(replace(term, start=own) for term, own in zip(terms, np.split(values, ends[:-1]),
                                                                                    strict=True)))


def of_nothing(terms: tuple[Term, ...], off: Array, covariance: Array) -> tuple[str, ...]:
    """Labels of terms whose parameters, but for those that only shape them, all lie within two standard deviations of nothing;
    off (P,), covariance (P, P): of all their parameters from where the effects are absent."""
    nothing, place = [], 0
    for term in terms:
        of_size = place + np.flatnonzero([not parameter.shape for parameter in term.effect.parameters])
        place += len(term.effect.parameters)
        if not beyond_nothing(off[of_size], covariance[np.ix_(of_size, of_size)]):
            nothing.append(term.label)
    return tuple(nothing)


def _apart(seen: Survey, kin: tuple[Hypothesis, ...]) -> float:
    """By how much the laws that a gear may follow differ in what they leave of the numbers, in their noise (largest RMS)."""
    left = []
    for one in kin:
        base = seen.base.extended(seen.dictionary.of(*one.signatures))
        left.append(base.residual - base.design @ base.step(base.residual))
    return max((rms(one - left[0]) for one in left[1:]), default=0.0)

"""Is something at work on the part that the model lacks: the dictionary of causes, asked about the measured numbers.

Set-up, drift, springs, what neighbours share and a smooth remainder are free beside every cause, so that a geometric error is
not taken for play of a gear. Their sizes are by evidence, estimated anew with each set of causes that is the likeliest until
it stays so: where an effect is at work they would be too large without it, where none is they are what explains the part.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compensator.correction.forward import load_state_of
from compensator.correction.predict import Predicted
from compensator.correction.settings import Estimate
from compensator.learning.fitted_part import Believed, FittedPart
from compensator.learning.held_out import HeldOut
from compensator.learning.rows import Rows, slope_along, steep_at
from compensator.learning.sizes import Sizes, noise_covariance, with_remainder
from compensator.learning.terms import Terms
from identification.common.arrays import Array
from identification.common.findings import Finding
from identification.common.quantities import cause_words
from identification.diagnosis.part_rows import (
    Found,
    PartRows,
    adequate,
    alarm,
    best_of,
    columns_of,
    effects_of_parts,
    enough,
    free_laws,
    judged,
    moved_by,
    of_nothing,
)
from identification.fit.fitted_model import Term
from identification.model.law_of import uncertain
from identification.model.load_state import LoadState
from identification.model.stiffness import UNKNOWN_LAW

ROUNDS, TRIES = 4, 12
# Rows whose place of the force is worth more than so many sigmas of their reading tell no cause.
PLACED = 12.0
# Every effect is worked out at all targets of a program, since gears remember their load: of longer ones nothing is asked [-].
MOST_TARGETS = 20_000


@dataclass(frozen=True, eq=False)
class Asked:
    """found: the verdict, None: it was not asked, and why_not says why; rows: of the part, the place of the force as uncertain
    for the causes as for the springs. p_value: of the detection without causes, after: with the likeliest set. gained:
    stretches left out, without the named causes and with them; withdrawn: why a name was taken back; values: parameters of the
    named causes by the dictionary's own laws, one a label and unit."""

    found: Found | None
    rows: Rows
    why_not: str = ""
    p_value: float = 1.0
    after: float = 1.0
    gained: tuple[HeldOut, HeldOut] | None = None
    withdrawn: str = ""
    values: tuple[tuple[str, str, Estimate], ...] = ()

    @property
    def verdict(self) -> str:
        """adequate, named, ambiguous, unknown, or not asked."""
        return "not asked" if self.found is None else "unknown" if self.withdrawn else self.found.verdict

    @property
    def terms(self) -> tuple[Term, ...]:
        """The effects to be learned with the rest: none where none is named, or where one of them is the measurement's."""
        carried = self.found is not None and self.verdict == "named" and not self.of_measurement
        return self.found.terms if self.found is not None and carried else ()

    @property
    def of_measurement(self) -> tuple[str, ...]:
        """Named causes that are the force sensor's, which no correction follows."""
        causes = self.found.causes if self.found is not None else ()
        return tuple(cause.label for cause in causes if not cause.effect.of_robot)

    def as_dict(self) -> dict[str, Any]:
        """JSON values."""
        causes = self.found.causes if self.found is not None else ()
        return {"verdict": self.verdict, "why_not": self.why_not, "p_value": self.p_value, "p_value_after": self.after,
                "carried": bool(self.terms), "withdrawn": self.withdrawn,
                "causes": [{"effect": cause.effect.name, "joint": cause.joint, "probability": cause.probability,
                            "sentence": cause.sentence, "open_laws": cause.open_laws} for cause in causes],
                "parameters": [{"name": label, "unit": unit, "estimate": each.value, "std": each.std}
                               for label, unit, each in self.values if self.terms],
                "left_out_um": None if self.gained is None else [1e6 * tried.learned for tried in self.gained]}


def ask(fitted: FittedPart, predicted: Predicted, seed: int = 0) -> Asked:
    """What the dictionary says of the numbers that a model without causes was fitted to."""
    count, plain = len(predicted.path.toolpath), fitted.all_terms.rows
    if fitted.tried is None:
        return Asked(None, plain, "too few places to try a cause on stretches left out")
    if count > MOST_TARGETS:
        return Asked(None, plain, f"the program has {count} targets, causes are looked for in up to {MOST_TARGETS}")
    rng = np.random.default_rng(seed)
    whole, start = fitted.all_terms, replace(fitted.sizes, length=fitted.length)
    placed = _placed(whole, start)
    terms = whole.select(placed)
    state, targets = _state(fitted, predicted), predicted.targets
    prior = terms.physical_prior
    rows = PartRows(state, lambda moved: terms.rows.seen(moved[targets]), _factor(terms, _sizes(terms, start)),
                    terms.residual, terms.physical @ np.linalg.cholesky(prior + 1e-18 * np.eye(len(prior))))
    catalogue = effects_of_parts()
    first = alarm(rows, rows.dictionary(catalogue), rng)
    if adequate(first):
        return Asked(Found("adequate"), plain, p_value=first.p_value, after=first.p_value)
    tried: set[frozenset[int]] = set()
    blurred = whole
    while True:
        seen = best_of(rows, rows.dictionary(catalogue))
        if not seen.hypotheses or seen.hypotheses[0].key in tried or len(tried) == ROUNDS:
            break
        chosen = seen.hypotheses[0]
        tried.add(chosen.key)
        blurred = _blurred(whole, predicted, [moved[targets] for moved in moved_by(rows, seen, chosen)])
        terms = blurred.select(placed)
        sizes = _sizes(_with(terms, columns_of(rows, seen, chosen)), start)
        rows = replace(rows, factor=_factor(terms, sizes))
    after = enough(rows, seen, seen.hypotheses[0], rng) if seen.hypotheses else first
    return Asked(judged(rows, seen, first, after), blurred.rows, p_value=first.p_value, after=after.p_value)


def tested(asked: Asked, without: FittedPart, fitted: FittedPart) -> Asked:
    """The names, withdrawn where they are of no use on stretches left out, or where what was fitted is nothing."""
    if without.tried is None or fitted.tried is None:
        return asked
    asked = replace(asked, gained=(without.tried, fitted.tried))
    size = len(without.believed.mean)
    off = fitted.absolute[size:len(fitted.x)] - fitted.believed.mean[size:]
    covariance = fitted.posterior.covariance[size:len(fitted.x), size:len(fitted.x)]
    asked = replace(asked, values=_values(asked.terms, fitted.absolute[size:len(fitted.x)], covariance))
    nothing = of_nothing(asked.terms, off, covariance)
    if nothing:
        return replace(asked, withdrawn=f"{', '.join(nothing)}: within two standard deviations of nothing")
    if fitted.tried.learned >= without.tried.learned:
        return replace(asked, withdrawn=f"on stretches left out {1e6 * fitted.tried.learned:.1f} um are left with it, "
                                        f"{1e6 * without.tried.learned:.1f} um without")
    return asked


def _values(terms: tuple[Term, ...], values: Array, covariance: Array) -> tuple[tuple[str, str, Estimate], ...]:
    """Parameters (P,) of the terms with their covariance (P, P), as they are said: their laws were taken for the real ones in
    the fit, so how far these may be off is in the standard errors."""
    said = [(label, parameter) for term in terms for label, parameter in zip(term.names, term.effect.parameters, strict=True)]
    of_law = UNKNOWN_LAW * values * [uncertain(term.effect) for term in terms for _ in term.effect.parameters]
    std = np.sqrt(np.diag(covariance) + of_law**2)
    return tuple((label, parameter.unit, Estimate(float(value), float(sigma)))
                 for (label, parameter), value, sigma in zip(said, values, std, strict=True))


def with_free_laws(asked: Asked, without: FittedPart, fitted: FittedPart, predicted: Predicted) -> Believed | None:
    """What is believed of the model that is carried: the named effects as they were fitted, and beside each how far its real
    law may be off the dictionary's; None where no law is uncertain."""
    size = len(without.believed.mean)
    laws = free_laws(_state(without, predicted), asked.terms, fitted.absolute[size:len(fitted.x)])
    return fitted.believed.extended(laws, fitted.x) if laws else None


def _state(fitted: FittedPart, predicted: Predicted) -> LoadState:
    """Where the arm stood while it cut, yielding as it was fitted; rows are the targets in their order."""
    loaded = replace(predicted.loaded, model=replace(fitted.believed.model, mean=fitted.x))
    return load_state_of(loaded, loaded.path.theta[loaded.targets])


def said_of_causes(asked: Asked, source: str) -> list[Finding]:
    """What the user should know of them."""
    found = asked.found
    if found is None:
        return [Finding("CS4615", "note", f"the causes of `diagnose` were not asked: {asked.why_not}", file=source)]
    names = ", ".join(cause_words(cause.label) for cause in found.causes)
    if asked.withdrawn:
        return [Finding("CS4614", "warning", f"{names} was all but named and is taken back: {asked.withdrawn}", file=source,
                        hint="something acts with the force that is not in the model: load tests tell more (diagnose)")]
    if asked.verdict == "named" and asked.of_measurement:
        return [Finding("CS4612", "warning", f"{names}: {'; '.join(cause.sentence for cause in found.causes)}: not carried",
                        file=source, hint="mend force_log in cell.yaml, then learn again")]
    if asked.verdict == "named":
        gained = "" if asked.gained is None else (
            f"; on stretches left out {1e6 * asked.gained[0].learned:.1f} um without it, "
            f"{1e6 * asked.gained[1].learned:.1f} um with it")
        words = "; ".join(f"{cause.sentence} ({cause.label}), {100 * cause.probability:.0f} %" for cause in found.causes)
        return [Finding("CS4610", "warning", f"the part shows {words}{gained}: carried in the learned file", file=source,
                        hint="measure the springs again (diagnose) before other programs rely on it")]
    if asked.verdict == "ambiguous":
        return [Finding("CS4611", "warning", f"the part shows one of {names}, and not which: none is carried", file=source,
                        hint="compstiff diagnose on load tests names the loads that tell them apart")]
    if asked.verdict == "unknown":
        return [Finding("CS4613", "warning" if found.clear else "note", "something acts with the force that neither the model "
                        f"nor a cause that can be named explains (chance shows as much in "
                        f"{100 * asked.p_value:.1f} % of parts): nothing is carried",
                        file=source, hint="compstiff diagnose on load tests tells more")]
    return []


def _placed(terms: Terms, sizes: Sizes) -> NDArray[np.bool_]:
    """The rows (n,) where it matters little at which place the force came: at a sharp corner a law that bends there and nowhere
    else would be told by where the log has the corner."""
    rows = terms.rows
    return sizes.smear * rows.steep < PLACED * sizes.noise * rows.sigma


def _sizes(terms: Terms, start: Sizes) -> Sizes:
    """Noise and remainder, the likeliest; there is always one."""
    return max((with_remainder(terms, start, factor * start.length, TRIES) for factor in (0.5, 1.0, 2.0)),
               key=lambda one: one.evidence)


def _factor(terms: Terms, sizes: Sizes) -> Array:
    """Cholesky factor (n, n) of the covariance of noise and remainder."""
    _, slopes = terms.remainder(sizes.length)
    own = sizes.amplitude * slopes @ terms.free(slopes)
    return np.asarray(np.linalg.cholesky(noise_covariance(terms, sizes) + own @ own.T))


def _blurred(terms: Terms, predicted: Predicted, moved: list[Array]) -> Terms:
    """The place of the force is as uncertain for the effects, each with its displacement (M, 3) [m] of the targets, as for the
    springs."""
    rows = terms.rows
    steep = [steep_at(rows.of_targets, slope_along(predicted, each)) for each in moved]
    return replace(terms, rows=replace(rows, steep=np.sqrt(rows.steep**2 + np.sum(np.square(steep), axis=0))))


def _with(terms: Terms, columns: Array) -> Terms:
    """The terms with effects beside the springs, columns (n, p) in units of their 1 sigma."""
    size = terms.by_x.shape[1]
    before = np.eye(size + columns.shape[1])
    before[:size, :size] = terms.before
    return replace(terms, by_x=np.concatenate([terms.by_x, columns], axis=1), before=before)

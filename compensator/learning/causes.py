"""Is something at work on the part that the model lacks: the dictionary of causes, asked about the measured numbers.

Set-up, drift, springs, what neighbours share and a smooth remainder are free beside every cause, so that a geometric error is
not taken for play of a gear. Their sizes are by evidence, estimated anew with each set of causes that is the likeliest until
it stays so: where an effect is at work they would be too large without it, where none is they are what explains the part.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from compensator.correction.predict import Predicted
from compensator.learning.rows import slope_along
from compensator.learning.sizes import Sizes, noise_covariance, with_remainder
from compensator.learning.terms import Terms
from identification.common.arrays import Array
from identification.diagnosis.part_rows import (
    Found,
    PartRows,
    alarm,
    best_of,
    columns_of,
    effects_of_parts,
    enough,
    judged,
    moved_by,
)
from identification.fit.fitted_model import Term
from identification.model.stiffness import IdentifiedModel

ROUNDS, TRIES = 4, 12


@dataclass(frozen=True, eq=False)
class Asked:
    """found: the verdict; p_value: of the detection without causes, after: with the likeliest set."""

    found: Found
    p_value: float
    after: float = 1.0

    @property
    def terms(self) -> tuple[Term, ...]:
        """The effects to be learned with the rest: none where none is named, or where one of them is the measurement's."""
        return self.found.terms if self.found.verdict == "named" and not self.of_measurement else ()

    @property
    def of_measurement(self) -> tuple[str, ...]:
        """Named causes that are the force sensor's, which no correction follows."""
        return tuple(cause.label for cause in self.found.causes if not cause.effect.of_robot)

    def as_dict(self) -> dict[str, Any]:
        """JSON values."""
        return {"verdict": self.found.verdict, "p_value": self.p_value, "p_value_after": self.after,
                "causes": [{"effect": cause.effect.name, "joint": cause.joint, "probability": cause.probability,
                            "sentence": cause.sentence, "open_laws": cause.open_laws} for cause in self.found.causes]}


def asked(terms: Terms, start: Sizes, predicted: Predicted, model: IdentifiedModel, seed: int = 0) -> Asked:
    """What the dictionary says of the numbers; terms: of the model without causes, linearised where `model` stands; start: sizes
    of noise and remainder."""
    from compensator.correction.forward import load_state_of

    rng = np.random.default_rng(seed)
    terms = replace(terms, job=np.eye(len(terms.job)))
    loaded = replace(predicted.loaded, model=model)
    state = load_state_of(loaded, loaded.path.theta[loaded.targets])
    sizes = _sizes(terms, start)
    rows = PartRows(state, lambda moved: terms.rows.seen(moved[loaded.targets]), _factor(terms, sizes), terms.residual,
                    terms.physical @ np.linalg.cholesky(terms.physical_prior + 1e-18 * np.eye(len(terms.physical_prior))))
    catalogue = effects_of_parts()
    first = alarm(rows, rows.dictionary(catalogue), rng)
    tried = set()
    while True:
        seen = best_of(rows, rows.dictionary(catalogue))
        if not seen.hypotheses or seen.hypotheses[0].key in tried or len(tried) == ROUNDS:
            break
        tried.add(seen.hypotheses[0].key)
        chosen = seen.hypotheses[0]
        blurred = _blurred(terms, predicted, [moved[loaded.targets] for moved in moved_by(rows, seen, chosen)])
        sizes = _sizes(_with(blurred, columns_of(rows, seen, chosen)), start)
        rows = replace(rows, factor=_factor(blurred, sizes))
    after = enough(rows, seen, seen.hypotheses[0], rng) if seen.hypotheses else first
    return Asked(judged(rows, seen, first, after), first.p_value, after.p_value)


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
    steep = [abs(rows.of_targets) @ slope_along(predicted, each).ravel() for each in moved]
    return replace(terms, rows=replace(rows, steep=np.sqrt(rows.steep**2 + np.sum(np.square(steep), axis=0))))


def _with(terms: Terms, columns: Array) -> Terms:
    """The terms with effects beside the springs, columns (n, p) in units of their 1 sigma."""
    size = terms.by_x.shape[1]
    before = np.eye(size + columns.shape[1])
    before[:size, :size] = terms.before
    return replace(terms, by_x=np.concatenate([terms.by_x, columns], axis=1), before=before)

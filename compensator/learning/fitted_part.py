"""FittedPart: everything that one model makes of a measured part, and how it does on stretches left out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from compensator.correction.predict import Predicted
from compensator.correction.settings import Estimate
from compensator.learned.learned import DRIFT, SETUP, JobFrame
from compensator.learning.chance import FALSE_RATE, chance_of_remainder
from compensator.learning.cutter_size import ANY, ASSUMED, common_amount
from compensator.learning.held_out import HeldOut, held_out
from compensator.learning.posterior import Posterior, posterior
from compensator.learning.rows import Rows
from compensator.learning.sizes import Sizes, with_remainder, without_remainder
from compensator.learning.terms import Terms, frame_of, terms_of
from compensator.learning.unshown import UNSHOWN
from compensator.learning.wrong_factor import refuse_wrong_factor
from identification.common.arrays import Array
from identification.fit.fitted_model import WIDE, Term
from identification.model.effects_in_force import SPRINGS
from identification.model.law_of import LawOf
from identification.model.stiffness import IdentifiedModel

ROUNDS = 3
# Before the part was measured, 1 sigma: the size of an effect that it showed, in typical sizes, and what only shapes it, as a
# share of where the search found it. Laws of real gears differ by some ten per cent.
SIZE, SHAPE = 1.5, 0.3
# What all rows are off by along their normals is taken for more than is assumed anyhow from so many sigmas on.
CLEARLY = 3.0


@dataclass(frozen=True, eq=False)
class Believed:
    """A model before the part is seen. model: with the effects in force; mean (S,), covariance (S, S) of its parameters in
    motion; start (S,): where it is linearised first."""

    model: IdentifiedModel
    mean: Array
    covariance: Array
    start: Array

    def within(self, x: Array) -> Array:
        """x (S,) with the effects' parameters inside their physical bounds."""
        return np.concatenate([x[SPRINGS], replace(self.model, mean=x).values])

    def extended(self, terms: tuple[Term, ...], found: Array) -> Believed:
        """With effects that the part showed, or what their laws may be off by; found (S,): the parameters without them."""
        own, mean = list(terms), [self.mean]
        std: list[Array] = []
        for term in own:
            shape = np.array([parameter.shape for parameter in term.effect.parameters])
            mean.append(np.where(shape, term.start, term.neutral))
            wide = WIDE if isinstance(term.effect, LawOf) else SIZE
            std.append(np.where(shape, SHAPE * np.abs(term.start), wide * term.scale))
        size, every = len(self.mean), np.concatenate(mean)
        covariance = np.diag(np.concatenate([np.zeros(size), *std]) ** 2)
        covariance[:size, :size] = self.covariance
        model = replace(self.model, effects=(*self.model.effects, *own), mean=every, covariance=covariance, interval=None)
        return Believed(model, every, covariance, np.concatenate([found, *(term.start for term in own)]))


@dataclass(frozen=True, eq=False)
class FittedPart:
    """believed: before; terms, sizes: linearised at the end, with what chance and points let in; all_terms: with all of set-up
    and drift; posterior of z less its prior mean; chance: of a remainder as clear as this without one, length [m] at which it
    is the clearest; tried: stretches left out. beside [m]: what all rows are off by along their normals, where that is more
    than is assumed anyhow; the terms have it taken off."""

    believed: Believed
    terms: Terms
    all_terms: Terms
    sizes: Sizes
    posterior: Posterior
    chance: float
    length: float
    tried: HeldOut | None
    beside: Estimate | None = None

    @property
    def x(self) -> Array:
        """The parameters (S,)."""
        size = len(self.believed.mean)
        return self.believed.within(self.believed.mean + self.posterior.mean[:size])

    @property
    def absolute(self) -> Array:
        """All of z (Z,)."""
        return np.concatenate([self.x, self.posterior.mean[len(self.believed.mean):]])


def fitted_part(
    rows: Rows, predicted: Predicted, believed: Believed, motion: Estimate, source: str, beside: Estimate | None = None,
) -> FittedPart:
    """source: the file of the points; beside: where the rows have been fitted before, and what was taken off them.

    Raises Refused (CS5310) where the measured deviation does not follow the predicted.
    """
    frame, mean, size = frame_of(rows, predicted), believed.mean, len(believed.mean)
    cutter = ANY if rows.along_normals else 0.0
    linearised = _linearised(rows, predicted, believed, frame, cutter)
    terms = linearised(believed.start, np.eye(SETUP + DRIFT))
    noise = without_remainder(terms)
    refuse_wrong_factor(terms, noise, rows.seen(predicted.prediction.position)[:, 0] * motion.value, source)
    if cutter and beside is None:
        amount = common_amount(terms, noise)
        if abs(amount.value) > CLEARLY * np.hypot(amount.std, ASSUMED):
            beside, rows = amount, replace(rows, value=rows.value - amount.value)
        else:
            cutter = ASSUMED
        linearised = _linearised(rows, predicted, believed, frame, cutter)
    for _ in range(ROUNDS - 1):
        terms = linearised(believed.within(mean + posterior(terms, noise).mean[:size]), terms.job)
        noise = without_remainder(terms, noise)
    every = terms
    chance, length = chance_of_remainder(terms, noise)
    sizes = noise
    if chance <= FALSE_RATE:
        # The length that stood out before the noise was sized anew, and those beside it.
        sizes = max((with_remainder(terms, noise, factor * length) for factor in (1.0, 0.5, 2.0)), key=lambda one: one.evidence)
    terms = _seen_of_the_job(terms, sizes)
    found = posterior(terms, sizes)
    terms = linearised(believed.within(mean + found.mean[:size]), terms.job)
    found = posterior(terms, sizes)
    return FittedPart(believed, terms, every, sizes, found, chance, length, held_out(terms, sizes), beside)


def _linearised(
    rows: Rows, predicted: Predicted, believed: Believed, frame: JobFrame, cutter: float,
) -> Callable[[Array, Array], Terms]:
    """The terms at parameters (S,), with a projector (9, 9) on set-up and drift; cutter [m] as in `Terms`."""
    def terms(x: Array, job: Array) -> Terms:
        there = replace(believed.model, mean=x)
        return replace(terms_of(rows, predicted, there, believed.mean, believed.covariance, frame, job), cutter=cutter)

    return terms


def _seen_of_the_job(terms: Terms, sizes: Sizes) -> Terms:
    """Without the displacements of set-up and drift that the points do not show (a plane of walls alone says nothing of their
    height), and without all of drift or set-up where chance would show as much (Wald, at the false rate)."""
    from scipy.special import chdtrc

    size = terms.by_x.shape[1]
    for part in (slice(SETUP, SETUP + DRIFT), slice(0, SETUP)):
        found = posterior(terms, sizes)
        where, std = size + np.arange(SETUP + DRIFT)[part], terms.of_job_std[part]
        value, covariance = found.mean[where] / std, found.covariance[np.ix_(where, where)] / np.outer(std, std)
        known, directions = np.linalg.eigh(covariance)
        shown, variance = directions[:, known < UNSHOWN**2], known[known < UNSHOWN**2]
        chi2 = float(np.sum((shown.T @ value) ** 2 / variance))
        job = terms.job.copy()
        job[part, part] = shown @ shown.T if shown.shape[1] and chdtrc(shown.shape[1], chi2) <= FALSE_RATE else 0.0
        terms = replace(terms, job=job)
    return terms

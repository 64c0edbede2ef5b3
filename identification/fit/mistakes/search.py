"""Every mistake of the list, tried: the real fit of the few that a quick look finds to mend something (look.py)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from identification.common.findings import CompstiffError
from identification.fit.fitted_model import WIDE, response
from identification.fit.held_out import left_out, poses
from identification.fit.load_test import LoadTest
from identification.fit.mistakes.evidence import log_evidence, ordinary
from identification.fit.mistakes.look import WORTH, Guess, Look, log_lost
from identification.fit.mistakes.mistake import Mistake
from identification.fit.mistakes.sizes import Size
from identification.fit.noise_parts import OPTIONAL
from identification.fit.posterior import Posterior, posterior
from identification.fit.sag import BesideWeight
from identification.model.effects_in_force import EFFECTS

Array = NDArray[np.float64]
# Rows that are looked at: a mistake of all rows shows in a part of them, taken as whole visits.
MOST_ROWS = 1500
MOST_WITH_SIZE = 3
# ln of how much likelier than none one with a size must be near none to be fitted: a name needs 10 (judge.py).
HOPELESS = -3.0


@dataclass(frozen=True, eq=False)
class FoundSize:
    """The size of a mistake that has one. values (P,), of which the model tells what is beyond its start."""

    size: Size
    joint: int | None
    values: Array
    model: Posterior

    @cached_property
    def std(self) -> Array:
        """Standard deviations (P,) of the values."""
        return np.sqrt(np.diag(self.model.covariance)[EFFECTS])

    @property
    def moved(self) -> float:
        """The norm of the values over the smallest worth a name."""
        return float(np.linalg.norm(self.values)) / self.size.smallest

    @property
    def sigmas(self) -> float:
        """The size over its own uncertainty."""
        covariance = self.model.covariance[EFFECTS, EFFECTS]
        return float(np.sqrt(self.values @ np.linalg.solve(covariance, self.values)))

    def shown(self) -> dict[str, tuple[float, float]]:
        """name -> (estimate, std), in the units of docs/formats.md."""
        each = zip(self.size.parameters, self.size.shown(self.values), self.size.shown(self.std), strict=True)
        return {parameter.name: (float(value), float(spread)) for parameter, value, spread in each}


@dataclass(frozen=True, eq=False)
class Candidate:
    """A mistake that mends something; guessed: as the quick look has it; data: the rows as they are. rows (n,): where it
    stands, None in all. models: the fit of the mended rows, two where the rows are of two robots. log_posterior: ln evidence
    and ln prior. left (n, 3) [m]: residual of each pose predicted from the others. found: of one with a size."""

    guessed: Mistake
    data: LoadTest
    rows: NDArray[np.bool_] | None
    models: tuple[Posterior, ...]
    log_posterior: float
    left: Array
    found: FoundSize | None = None

    @cached_property
    def mistake(self) -> Mistake:
        """The mistake, with its size and how well that is known; most candidates are never asked."""
        found = self.found
        return found.size.mistake(self.data, found.joint, found.values, found.std) if found else self.guessed


@dataclass(frozen=True, eq=False)
class Search:
    """plain: the fit of the rows as they are; its ln evidence; candidates, the likeliest first; how many were tried; apart:
    what is worth a fit and was not fitted, rows that want springs of their own."""

    plain: Posterior
    log_evidence: float
    candidates: tuple[Candidate, ...]
    tried: int
    apart: tuple[Guess, ...] = ()

    def with_those_apart(self) -> Search:
        """With the fits of rows that want springs of their own, two for each, among the candidates."""
        return replace(self, candidates=_likeliest_first([*self.candidates, *_fits(self.plain, self.apart)]), apart=())


def search(plain: Posterior) -> Search:
    """All mistakes that mend something in the rows of this fit; those apart are left to who asks for them."""
    fitted = _portion(plain)
    look = Look(fitted.data)
    guesses = look.guesses()
    alone, apart = (tuple(guess for guess in guesses if guess.split == split) for split in (False, True))
    return Search(fitted, log_evidence(fitted), _likeliest_first(_fits(fitted, alone)), look.tried, apart)


def _likeliest_first(candidates: list[Candidate]) -> tuple[Candidate, ...]:
    return tuple(sorted(candidates, key=lambda each: -each.log_posterior))


def _fits(plain: Posterior, guesses: tuple[Guess, ...]) -> list[Candidate]:
    sized = _hopeful(plain, tuple(guess for guess in guesses if guess.size is not None))
    rest = [guess for guess in guesses if guess.size is None]
    return [candidate for guess in (*rest, *sized) if (candidate := _fitted(plain, guess)) is not None]


def _hopeful(plain: Posterior, sized: tuple[Guess, ...]) -> list[Guess]:
    """Of those with a size the likeliest near none, each mistake once, under ordinary noise of the usual parts: what is larger,
    and the others, may be there for want of a cause."""
    if not sized:
        return []
    usual = plain
    if any(plain.at_map.noise.active[part] for part in OPTIONAL):
        usual = plain.with_usual_noise
    weights = BesideWeight(usual.at_map.noise.weights(ordinary(usual), usual.at_map.row_weight), usual.beside)
    support = [_support_near_none(usual, weights, guess) for guess in sized]
    best: dict[str, Guess] = {}
    for k in np.argsort(support)[::-1]:
        if support[k] > HOPELESS:
            best.setdefault(sized[k].mistake.key, sized[k])
    return list(best.values())[:MOST_WITH_SIZE]


def _portion(plain: Posterior) -> Posterior:
    """The fit itself, or where there are many rows that of whole visits, or of rows, evenly over them."""
    part = _thinned(plain.data)
    return plain if part is plain.data else posterior(part)


def _thinned(data: LoadTest) -> LoadTest:
    rows = data.rows
    every = int(np.ceil(len(rows) / MOST_ROWS))
    if every == 1:
        return data
    number = np.unique(rows.visit, return_inverse=True)[1]
    kept = number if number.max() >= 4 * every else np.arange(len(rows))
    return data.with_rows(rows.select(kept % every == 0))


def likeliest_at_a_glance(data: LoadTest) -> Mistake | None:
    """The mistake that the quick look finds clearly likelier than any other, for rows that have no plain fit."""
    found = [guess for guess in Look(_thinned(data)).guesses()
             if guess.size is None and not guess.split and guess.rows is None]
    clear = found and (len(found) == 1 or found[0].score > found[1].score + WORTH)
    return found[0].mistake if clear else None


def _fitted(plain: Posterior, guess: Guess) -> Candidate | None:
    """The real fit; None where it has no solution."""
    data, lost = plain.data, 0.0
    try:
        if guess.size is not None:
            return _with_size(plain, guess)
        if guess.split:
            assert guess.rows is not None
            models = tuple(posterior(data.with_rows(data.rows.select(part))) for part in (guess.rows, ~guess.rows))
            left = np.empty((len(data.rows), 3))
            for model, part in zip(models, (guess.rows, ~guess.rows), strict=True):
                left[part] = left_out(model, poses(model.data.rows))
        else:
            models = (posterior(guess.mistake.mended(data, guess.rows)),)
            left = left_out(models[0], poses(data.rows))
            lost = log_lost(data, models[0].data, np.einsum("nii->ni", plain.at_map.noise.whitening))
    except CompstiffError:
        return None
    mended = slice(None) if guess.rows is None else guess.rows
    volume = float((~np.isnan(data.rows.deflection[mended]) * np.log(guess.mistake.scale)).sum())
    evidence = sum(log_evidence(model) for model in models) + volume + lost
    return Candidate(guess.mistake, data, guess.rows, models, evidence + guess.log_prior, left / guess.mistake.scale)


def _support_near_none(plain: Posterior, weights: BesideWeight, guess: Guess) -> float:
    """ln of how much likelier than none a mistake with a size is, prior included, linearised at none under noise of these
    weights: the quick look knows nothing of what the readings of a visit share."""
    assert guess.size is not None
    assert guess.start is not None
    term = guess.size.term(guess.joint, np.zeros(len(guess.start)))
    at, wide = plain.at_map, WIDE * term.scale
    _, slope = response(plain.data, np.concatenate([plain.map, term.start]), (*plain.terms, term))
    columns = at.noise.whitening @ slope
    columns[:, :, len(plain.map):] *= wide
    residual = at.residual[:, :, None]
    precision = weights.inner(columns, columns)
    precision[:len(plain.map), :len(plain.map)] += at.prior.precision(plain.map)
    own = np.arange(len(plain.map), len(precision))
    springs = np.linalg.slogdet(precision[:len(plain.map), :len(plain.map)])[1]
    precision[own, own] += 1.0
    pull = weights.inner(columns, residual)[:, 0]
    pull[:len(plain.map)] -= at.prior.gradient(plain.map)
    gained = 0.5 * pull @ np.linalg.solve(precision, pull)
    return float(gained - 0.5 * (np.linalg.slogdet(precision)[1] - springs) + guess.log_prior)


def _with_size(plain: Posterior, guess: Guess) -> Candidate:
    """The fit of one with a size; a large one is fitted again from the mended rows, where the noise is what it is there."""
    assert guess.size is not None
    assert guess.start is not None
    size, data, moved = guess.size, plain.data, np.zeros(len(guess.start))
    term = size.term(guess.joint, guess.start)
    model = posterior(data, [term], plain)
    if np.max(np.abs(model.map[EFFECTS]) / term.scale) > 1:
        moved = model.map[EFFECTS]
        mended = size.mistake(data, guess.joint, moved, moved).mended(data)
        model = posterior(mended, [size.term(guess.joint, np.zeros(len(moved)))], model)
    off, width = model.map[EFFECTS], model.prior.term_std
    values = moved + off
    # The prior of the size is about none, wherever the second fit began.
    prior = guess.log_prior + 0.5 * float(np.sum((off / width) ** 2 - (values / width) ** 2))
    # Its size is the one beside the arm's unknown weight.
    return Candidate(guess.mistake, data, None, (model,), log_evidence(model) + prior, left_out(model, poses(data.rows)),
                     FoundSize(size, guess.joint, moved + model.likeliest[EFFECTS], model))

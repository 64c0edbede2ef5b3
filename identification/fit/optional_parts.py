"""Set-ups and memory: parts of the noise that need not be there, and that no cell file states (noise.py).

The fit takes one in where the rows ask for it. What is told of the stiffnesses does not hang on that: rows that are too few to
ask for a part do not rule it out. There the posterior is an average over all ways in which the parts may be there.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from identification.fit.linearised import Linearised
from identification.fit.noise import NoiseModel
from identification.fit.noise_parts import (
    ABSOLUTE,
    FORCE,
    MEMORY,
    OFFSET,
    OPTIONAL,
    PARTS,
    SETUP,
    SMALLEST_LOG,
    SetUp,
    VarianceComponents,
)
from identification.fit.variance_components import ComponentPosterior, Trials, likeliest, log_covariance, trial_components

Array = NDArray[np.float64]

# ln likelihood that an optional part must bring to be asked for.
WORTH_A_PART = 3.0
# Sizes of such a part that are tried, as multiples of the usual one, and what is left beside it of the parts that have taken it
# for theirs: forces that are wrong by visits pass for forces that are wrong by rows, a memory for that and for re-seating.
SIZES = (0.5, 1.5, 3.0, 5.0, 9.0, 15.0, 27.0, 50.0)
LEFT = (1.0, 0.5, 0.2)
TAKEN_FOR = {SETUP: (FORCE, ABSOLUTE), MEMORY: (FORCE, ABSOLUTE, OFFSET)}
# Visits from which on the rows tell whether the parts are there.
MANY_VISITS = 40
# A way that is less likely than another by so much in ln counts for nothing.
NEGLIGIBLE = 6.0
# Where the search for the size of a part begins that the fit has left out.
BEGIN = 2.0


class Way(NamedTuple):
    """One way in which the optional parts may be there: which are; how set-ups differ."""

    parts: tuple[int, ...]
    set_up: SetUp

    def noise(self, model: NoiseModel) -> NoiseModel:
        """The noise with these of the optional parts and no other."""
        usual = tuple(known and part not in OPTIONAL for part, known in enumerate(model.active))
        return replace(model, active=usual).with_parts(*self.parts, set_up=self.set_up)


def possible(noise: NoiseModel) -> tuple[int, ...]:
    """The optional parts that the rows could show: set-ups where visits have several loaded rows, a memory where visits have
    several rows."""
    loaded = np.bincount(noise.visit, np.any(noise.setups != 0, axis=(1, 2)))
    rows = np.bincount(noise.visit)
    return tuple(part for part, company in ((SETUP, loaded), (MEMORY, rows)) if np.sum(company > 2) > 1)


def asked_for(at: Linearised, components: VarianceComponents, beside: Array) -> Way:
    """The parts that the rows ask for beyond the usual ones; beside (n, 3, m): as in ComponentPosterior, since set-ups that
    turn the force explain the arm's own weight as well. What it brings to have less of the other parts, which a cell file may
    state larger than they are, is not the part's."""
    usual = ComponentPosterior(at, beside)
    asked, set_up = [], SetUp.TURNED
    for part in possible(at.noise):
        left = np.repeat(components.logs[None], len(LEFT), axis=0)
        left[:, TAKEN_FOR[part]] += np.log(LEFT)[:, None]
        plain = float(usual.likelihood(left).max())
        logs = np.repeat(left, len(SIZES), axis=0)
        logs[:, part] = np.tile(np.log(SIZES), len(LEFT))
        likely = {}
        for way in SetUp if part == SETUP else (SetUp.TURNED,):
            of_way = ComponentPosterior(replace(at, noise=at.noise.with_parts(part, set_up=way)), beside)
            likely[way] = float(of_way.likelihood(logs).max())
        best = max(likely, key=lambda way: likely[way])
        if likely[best] > plain + WORTH_A_PART:
            asked.append(part)
            set_up = best if part == SETUP else set_up
    return Way(tuple(asked), set_up)


def averaged_trials(at: Linearised, components: VarianceComponents, beside: Array) -> Trials:
    """Components spread over their posterior and over the ways in which the optional parts may be there; each part as likely
    as not beforehand. beside (n, 3, m): as in ComponentPosterior. Where there are many visits, or so many rows that only a part
    is looked at, the fit's own way stands alone."""
    fitted = ComponentPosterior(at, beside)
    if not fitted.whole or at.noise.visits > MANY_VISITS:
        return trial_components(fitted, components, log_covariance(fitted, components))
    tops = []
    for way in _ways(possible(at.noise)):
        of_way = ComponentPosterior(replace(at, noise=way.noise(at.noise)), beside)
        top = likeliest(of_way, components.with_values(
            np.where([part in way.parts and not components.values[part] for part in range(len(PARTS))], BEGIN,
                     components.values)))
        tops.append((float(of_way(top.logs[None])[0][0]) + _log_prior(way), of_way, top, way))
    best = max(value for value, *_ in tops)
    likely = [(of_way, top, way) for value, of_way, top, way in tops if value > best - NEGLIGIBLE]
    each = [(trial_components(of_way, top, log_covariance(of_way, top), len(likely)), way) for of_way, top, way in likely]
    log_weight = np.array([trials.log_evidence + _log_prior(way) for trials, way in each])
    total = float(np.logaddexp.reduce(log_weight))
    logs = [np.where([part in OPTIONAL and part not in way.parts for part in range(len(PARTS))], SMALLEST_LOG, trials.logs)
            for trials, way in each]
    weight = [np.exp(value - total) * trials.weight for value, (trials, _) in zip(log_weight, each, strict=True)]
    return Trials(np.concatenate(logs), np.concatenate(weight), np.concatenate([trials.gram for trials, _ in each]), total,
                  np.concatenate([trials.set_up for trials, _ in each]))


def _ways(parts: tuple[int, ...]) -> list[Way]:
    setups = [Way((), SetUp.TURNED), *(Way((SETUP,), each) for each in SetUp if SETUP in parts)]
    return setups + [Way((*way.parts, MEMORY), way.set_up) for way in setups if MEMORY in parts]


def _log_prior(way: Way) -> float:
    """ln of how likely a way is beforehand, without the constant: set-ups differ in any of the ways alike."""
    return -float(np.log(len(SetUp))) if SETUP in way.parts else 0.0

"""Does one angle of one pose differ from the table's? By how much likelier the rows are with that than as they are.

A visit's own response (visits.py) asks whether anything is wrong there, in all its directions at once; one angle that is off is
one number more, which the readings of all loads there tell together. All angles of all visits are looked at in the model
linearised at the fit, under noise no larger than ordinary and all rows counting alike: heavy tails may be there for want of the
slip. Few are worth a fit of their own, whose evidence is held against that of the rows as they are: the sizes of the noise, its
tails and what the robot's weight does integrated out, and averaged over the ways in which the forces of one set-up may differ
from those of the next, which make of a visit what a small angle does.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from identification.common.findings import CompstiffError
from identification.fit.discrepancy import discrepancies
from identification.fit.fitted_model import WIDE, Term
from identification.fit.mistakes.evidence import averaged_evidence, ordinary
from identification.fit.posterior import Posterior, posterior
from identification.fit.visits import WrongAngle, score_visits
from identification.model.effects import Effect, Parameter
from identification.model.load_state import LoadState

Array = NDArray[np.float64]
# One pose of a hundred has an angle that is not the table's (engineering judgement): ln, of each of its six.
RARE = -np.log(600.0)
# ln of how much likelier a wrong angle must be than none, of a visit that is left out, and before it is fitted.
SUPPORT, HOPEFUL = 5.0, 4.0
# With it the visit must fit as chance has it so often, family-wise.
FITS = 0.05
# Only so many visits are fitted, the likeliest.
MOST_FITTED = 3
# The fit of one begins no farther off [rad].
MOST_AT_FIRST = 0.3


class AngleOfVisit(Effect):
    """At one visit the robot stood at q + delta [rad]."""

    name = "angle_of_visit"
    family = "force measurement"
    of_robot = False
    joints = (1, 2, 3, 4, 5, 6)
    parameters = (Parameter("delta", "rad", 0.03, -1.6, 1.6,
                            source="engineering judgement: a digit of the degrees, or a pose that was not quite reached",
                            bounds_source="a right angle"),)
    sentence = "axis {joint} stood elsewhere"
    settles = "drive there again and read the axis"

    def __init__(self, visit: int) -> None:
        self.visit = visit

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        theta = rows.theta.copy()
        theta[rows.visit == self.visit, (joint or 1) - 1] += values[0]
        moved = replace(rows, theta=theta).elastic_position - rows.elastic_position
        return np.concatenate([moved, np.zeros_like(moved)], axis=1)

    def term(self, joint: int, start: float) -> Term:
        """To be fitted from a start [rad]."""
        return Term(self, joint, np.array([start]), np.array([self.parameters[0].typical]), np.zeros(1))


def wrong_angles(fitted: Posterior, visits: NDArray[np.intp], most: int) -> tuple[list[WrongAngle], Posterior]:
    """Wrong angles at these visits (numbers in the rows), one after the other, each looked for in the fit without the visits of
    those before, and that fit of the rest; none where there would be more than `most`: those are no single slips."""
    found: list[WrongAngle] = []
    rest = fitted
    while (one := likeliest_wrong_angle(rest, visits)) is not None:
        found.append(one)
        if len(found) > most:
            return [], fitted
        try:
            rest = posterior(rest.data.with_rows(rest.data.rows.select(rest.data.rows.visit != one.visit)), fitted.terms, rest)
        except CompstiffError:
            # Without these visits there is no fit to judge them by.
            return [], fitted
    return found, rest


def likeliest_wrong_angle(fitted: Posterior, visits: NDArray[np.intp]) -> WrongAngle | None:
    """The likeliest wrong angle at one of these visits (numbers in the rows), None where none is likely enough."""
    found = None
    try:
        fitted = _with_free_laws(fitted)
    except CompstiffError:
        return None
    for visit, joint, start in _hopeful(fitted, visits):
        try:
            model = posterior(fitted.data, [*fitted.terms, AngleOfVisit(visit).term(joint, start)], fitted)
        except CompstiffError:
            continue
        odds = averaged_evidence(model) - averaged_evidence(fitted) + RARE
        if odds >= SUPPORT and (found is None or odds > found.log_odds) and _fits(model, visit):
            found = WrongAngle(visit, joint, float(model.likeliest[-1]), float(np.sqrt(model.laplace[-1, -1])), odds)
    return found


def _with_free_laws(fitted: Posterior) -> Posterior:
    """The fit with the laws of the robot's causes free within what real ones differ by: that shows most at some pose."""
    terms = tuple(replace(term, start=values) for term, values in zip(fitted.terms, fitted.term_values, strict=True))
    free = discrepancies(fitted.load_state, tuple(term for term in terms if term.effect.of_robot))
    return posterior(fitted.data, (*terms, *free), fitted) if free else fitted


def _fits(model: Posterior, visit: int) -> bool:
    """Whether the readings of a visit fit those of the others in a model with its angle."""
    rows = model.data.rows
    line = rows.line[np.argmax(rows.visit == visit)]
    scores = score_visits(model, model.data, np.random.default_rng(0), 0).scores
    return next(score.p_value for score in scores if score.line == line) > FITS


def _hopeful(fitted: Posterior, visits: NDArray[np.intp]) -> Iterator[tuple[int, int, float]]:
    """Visit, joint and angle [rad] of the likeliest wrong angle at each of a few visits, linearised at the fit."""
    support, angle = _near_none(fitted)
    best = np.argmax(support, axis=1)
    numbers = np.unique(fitted.data.rows.visit)
    score = np.where(np.isin(numbers, visits), support[np.arange(len(numbers)), best], -np.inf)
    for k in np.argsort(-score)[:MOST_FITTED]:
        if score[k] >= HOPEFUL:
            yield int(numbers[k]), int(best[k]) + 1, float(np.clip(angle[k, best[k]], -MOST_AT_FIRST, MOST_AT_FIRST))


def _near_none(fitted: Posterior) -> tuple[Array, Array]:
    """Of each angle of each visit (V, 6): ln of how much likelier the rows are with it free than as they are, and its size
    [rad] then, linearised where it is none."""
    at, own = fitted.at_map, 6
    state = fitted.data.load_state(fitted.compliance)
    wide = WIDE * AngleOfVisit.parameters[0].typical
    slopes = at.noise.whitening @ np.stack([state.slope_by_angle(axis) for axis in range(own)], axis=2) * wide
    design = np.concatenate([at.design, fitted.beside, slopes], axis=2)
    weighted = at.noise.weights(ordinary(fitted).of_the_usual_parts()).apply(design)
    of_visits = at.noise.products(weighted, np.concatenate([design, at.residual[:, :, None]], axis=2))
    every, parameters = of_visits[:, :-own].sum(axis=0), at.design.shape[2]
    common, pull = every[:, :-own - 1], every[:, -1]
    common[:parameters, :parameters] += at.prior.precision(at.x)
    common[parameters:, parameters:] += np.eye(len(common) - parameters)
    pull[:parameters] -= at.prior.gradient(at.x)
    beside = of_visits[:, :-own, -own - 1:-1]                                                 # (V, q, 6)
    by_common = np.linalg.solve(common, beside)
    left = of_visits[:, -own:, -1] - np.einsum("vqi,q->vi", by_common, pull)
    precision = 1.0 + np.einsum("vii->vi", of_visits[:, -own:, -own - 1:-1]) - np.einsum("vqi,vqi->vi", beside, by_common)
    return 0.5 * (left**2 / precision - np.log(precision)), wide * left / precision

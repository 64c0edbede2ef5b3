"""Which visits are left out: those that stand out from the others (visits.py), and those with a wrong angle (wrong_angle.py).

The first are taken out one after the other, the fit and its noise worked out anew without them, and each is judged by the last
of these fits. What is left is searched for angles that are not the table's.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from identification.common.findings import CompstiffError
from identification.fit.load_test import LoadTest
from identification.fit.noise_parts import SETUP
from identification.fit.posterior import Posterior, posterior
from identification.fit.visits import VisitScore, VisitTest, WrongAngle, score_visits, testable
from identification.fit.wrong_angle import likeliest_wrong_angle, wrong_angles

# A visit is left out only on evidence that is rarer by chance than this, family-wise over the visits.
ALARM = 0.005
# No visit is looked at further where even the whole fit makes its largest misfit so likely.
SCREEN = 0.1
# Visits without which none can be called bad, and the share of them beyond which they are no single mistakes.
FEWEST, MOST = 6, 1 / 3
SCREENING, REPLICATES = 199, 399
# A visit of a few readings whose others fit without one of them, to this probability, has one bad reading.
FEW_READINGS, UNSUSPICIOUS = 6, 0.05
# A zero that is off by so many of its standard deviations has moved.
MOVED_ZERO = 4.0


def bad_visits(fitted: Posterior, seed: int = 0) -> VisitTest:
    """The visits that the fit of the others does not explain: taken out one after the other, the fit and its noise worked out
    anew without them, and each of them judged by the last of these fits. Forces that differ from one set-up to the next explain
    two visits that are off: where they came in, visits are taken out as if there were none, and judged by a fit that may have
    them again."""
    test = _taken_out(fitted, seed, usual_noise=False)
    if fitted.at_map.noise.active[SETUP]:
        other = _taken_out(fitted.with_usual_noise, seed, usual_noise=True)
        test = other if len(other.bad) > len(test.bad) else test
    return test if test.too_many else _with_wrong_angles(test, fitted, seed)


def _with_wrong_angles(test: VisitTest, fitted: Posterior, seed: int) -> VisitTest:
    """The test with those visits of the rest that have a wrong angle, by its evidence, and with those of the bad ones."""
    rows, rest = fitted.data.rows, test.rest or fitted
    known = {score.line: _angle_of(score, fitted, rest) for score in test.bad}
    found, rest = wrong_angles(rest, _under_load(rest.data), int(MOST * len(test.scores)) - len(test.bad))
    if found:
        known |= {int(rows.line[rows.visit == one.visit][0]): one for one in found}
        test = score_visits(rest, fitted.data, np.random.default_rng([seed, 1731]), REPLICATES)
    elif not known:
        return test
    bad = [replace(score, wrong_angle=known[score.line]) for score in test.scores if score.line in known]
    return replace(test, bad=tuple(sorted(bad, key=lambda score: -score.surprise)), rest=rest)


def _angle_of(score: VisitScore, fitted: Posterior, rest: Posterior) -> WrongAngle | None:
    """The angle of a bad visit that is not the table's, if that is what is wrong there; rest: the fit without bad visits."""
    rows = fitted.data.rows
    mine = np.isin(rows.row, score.rows)
    data = fitted.data.with_rows(rows.select(mine | np.isin(rows.row, rest.data.rows.row)))
    try:
        return likeliest_wrong_angle(posterior(data, rest.terms, rest), np.unique(rows.visit[mine]))
    except CompstiffError:
        return None


def _under_load(data: LoadTest) -> NDArray[np.intp]:
    """Numbers of the visits that are one pose under load."""
    rows = data.rows
    visits = np.unique(rows.visit)
    return visits[[testable(rows, np.flatnonzero(rows.visit == visit)) for visit in visits]]


def _taken_out(fitted: Posterior, seed: int, usual_noise: bool) -> VisitTest:
    """`bad_visits` by fits with the usual parts of the noise alone, or with all that the rows ask for."""
    rng = np.random.default_rng([seed, 1730])
    rows = fitted.data.rows
    test = score_visits(fitted, fitted.data, rng, SCREENING)
    if len(test.scores) < FEWEST or test.p_value > SCREEN:
        return test
    out: list[VisitScore] = []
    rest = fitted
    while True:
        taken = {score.line for score in out}
        inside = [score for score in test.scores if score.line not in taken]
        worst = max(inside, key=lambda score: score.surprise)
        if out and worst.p_value > ALARM:
            break
        out.append(worst)
        if len(out) > MOST * len(test.scores):
            return replace(test, too_many=True)
        kept = ~np.isin(rows.row, np.concatenate([score.rows for score in out]))
        try:
            rest = posterior(fitted.data.with_rows(rows.select(kept)), fitted.terms, fitted, usual_noise=usual_noise)
        except CompstiffError:
            # Without these visits there is no fit to judge them by.
            return test
        test = score_visits(rest, fitted.data, rng, REPLICATES)
    if usual_noise:
        rest = posterior(rest.data, fitted.terms, rest)
        test = score_visits(rest, fitted.data, rng, REPLICATES)
    taken = {score.line for score in out}
    bad = sorted((score for score in test.scores if score.line in taken and score.p_value <= ALARM
                  and not _one_reading(rest, fitted.data, score)), key=lambda score: -score.surprise)
    if bad and len(bad) < len(out):
        kept = ~np.isin(rows.row, np.concatenate([score.rows for score in bad]))
        rest = posterior(fitted.data.with_rows(rows.select(kept)), fitted.terms, fitted)
    return replace(test, bad=tuple(bad), rest=rest if bad else None)


def _one_reading(rest: Posterior, data: LoadTest, score: VisitScore) -> bool:
    """Whether a visit of a few readings fits without one of them, which is then no matter of the visit; visits of many are
    robust against one. Where another unloaded reading says that its zero stayed, the others are not all off from it."""
    rows = data.rows
    unloaded = rows.row[~np.any(rows.wrench != 0, axis=1)]
    if not 2 < len(score.rows) <= FEW_READINGS:
        return False
    for number in score.rows:
        left = data.with_rows(rows.select(rows.row != number))
        others = set(score.rows.tolist()) - {int(number)}
        test = score_visits(rest, left, np.random.default_rng(0), 0)
        again = next((other for other in test.scores if set(other.rows.tolist()) == others), None)
        zero_stayed = bool(set(unloaded.tolist()) & others)
        if again is not None and again.p_value > UNSUSPICIOUS and not (zero_stayed and again.offset_sigmas > MOVED_ZERO):
            return True
    return False

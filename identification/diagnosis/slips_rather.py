"""Poses that are written wrongly, where the causes that were found explain no more than that: an angle that is off at some
pose, or a slip in the row of one for which a bumped sensor was named."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identification.diagnosis.judgement import Judgement
from identification.diagnosis.naming import CERTAIN
from identification.fit.bad_visits import bad_visits
from identification.fit.fitted_model import Term
from identification.fit.mending import BadVisit, with_mends
from identification.fit.mistakes.judge import RIVAL
from identification.fit.posterior import Posterior, posterior
from identification.fit.visits import VisitTest, visit_name


def wrong_angles_rather(judgement: Judgement, seed: int) -> VisitTest | None:
    """The visits that do not fit the plain model, where wrong angles there make the rows clearly likelier than the causes that
    were named or left open do."""
    if judgement.log_odds is None or judgement.verdict not in ("named", "ambiguous"):
        return None
    test = bad_visits(judgement.plain, seed)
    angles = sum(score.wrong_angle.log_odds for score in test.bad if score.wrong_angle is not None)
    return test if angles > judgement.log_odds + RIVAL else None


@dataclass(frozen=True, eq=False)
class Suspected:
    """visits: those for which a sensor is named that was bumped there, while something wrong with the whole pose explains their
    readings as well; test: of all visits, without these causes."""

    test: VisitTest | None = None
    visits: tuple[BadVisit, ...] = ()

    @property
    def rather(self) -> VisitTest | None:
        """The test, where each visit that does not fit is one of these and one slip in its row is all but certain: it explains
        the readings without a number of its own, a bump has three."""
        mended = [bad for bad in self.visits if bad.mends and bad.mends[0].probability >= CERTAIN]
        return self.test if self.test is not None and self.visits and len(mended) == len(self.test.bad) else None


def suspected(judgement: Judgement, seed: int) -> Suspected:
    """The visits all of whose readings a named cause touches that touches none of another."""
    extended = judgement.extended
    places = [_pose_of_all(term, extended) for term in extended.terms]
    if judgement.verdict not in ("named", "ambiguous") or not any(places):
        return Suspected()
    others = [term for term, place in zip(extended.terms, places, strict=True) if not place]
    test = bad_visits(posterior(extended.data, others, extended), seed)
    if test.rest is None:
        return Suspected()
    every = with_mends(test, test.rest, judgement.rows)
    return Suspected(test, tuple(bad for bad in every if bad.score.name in places))


def _pose_of_all(term: Term, fitted: Posterior) -> str:
    """The pose of which a cause that has its place among the readings touches all of them, and none of another; "" where there
    is none."""
    if not term.effect.where:
        return ""
    rows = fitted.data.rows
    touched = np.any(term.effect.contribution(fitted.load_state, term.joint, term.scale) != 0, axis=1)
    visits = np.unique(rows.visit[touched])
    whole = len(visits) == 1 and touched[rows.visit == visits[0]].all()
    return visit_name(rows, np.flatnonzero(touched)) if whole else ""

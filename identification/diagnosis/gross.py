"""Single bad rows, and visits crowded with them: readings that even the heavy tails of the other rows' noise do not explain.

The smallest case of `sensor_step`. A row's distance from the fitted model is held against the Student distributions that the
other rows leave open, family-wise over the rows; rows in which a force error decides what a named gear does are left out of it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.common.findings import CompstiffError
from identification.fit.bad_visits import MOST as MOST_VISITS
from identification.fit.mending import Mend
from identification.fit.noise import residual_std
from identification.fit.posterior import Posterior, posterior
from identification.fit.row_slips import row_mend
from identification.fit.student import distances, probability_beyond
from identification.fit.visits import VisitTest

Array = NDArray[np.float64]
# Rare on purpose: such a row counts little in the fit anyway.
ALARM = 0.0005
# Rows at one pose without which none of them can be called bad.
COMPANY = 3
# Rows without which nothing is said of any.
FEWEST = 10
# So many bad rows may hide each other: tails that hold the second make the first no rarity.
HIDDEN = 3
# More bad rows than this share are no single mistakes, nor are more than so many in one visit, which is bad itself then.
MOST = 0.05
MOST_IN_A_VISIT = 2


@dataclass(frozen=True, eq=False)
class BadRow:
    """row: number in the file from 1; line there; off (3,) [m]: measured minus predicted, std (3,) what was allowed; p_value:
    family-wise over the rows; mend: the slip of the pen that explains it, None where none does."""

    row: int
    line: int
    off: Array
    std: Array
    p_value: float
    mend: Mend | None = None

    def as_dict(self) -> dict[str, Any]:
        """A cause of diagnosis.json."""
        values: dict[str, Any] = {f"{axis}_m": {"estimate": float(value), "std": float(std), "unit": "m"}
                                  for axis, value, std in zip("xyz", self.off, self.std, strict=True) if not np.isnan(value)}
        values["single_row"] = {"estimate": self.row, "std": 0.0}
        return {"effect": "sensor_step", "joint": None, "probability": 1.0 - ALARM, "family": "deflection measurement",
                "of_robot": False, "sentence": f"row {self.row} (line {self.line}) is a bad reading", "parameters": values,
                "p_value": self.p_value, "mends": [self.mend.as_dict()] if self.mend else []}


def bad_rows(fitted: Posterior) -> tuple[BadRow, ...]:
    """The bad rows, the worst first; none where there would be too many, nor of visits that are crowded with them."""
    rows, visit = fitted.data.rows, fitted.at_map.noise.visit
    bad = rare(*_distances(fitted), MOST * len(rows))
    crowd = np.flatnonzero(np.bincount(visit[list(bad)], minlength=1) > MOST_IN_A_VISIT)
    std = residual_std(fitted.data, fitted.components, fitted.compliance, fitted.at_map.noise.further)
    return tuple(BadRow(int(rows.row[k]), int(rows.line[k]), fitted.residual[k], std[k], p_value,
                        row_mend(rows, fitted.residual, std, k)) for k, p_value in bad.items() if visit[k] not in crowd)


def with_crowded(test: VisitTest, fitted: Posterior) -> VisitTest:
    """The test of the visits, those that are crowded with bad rows among the bad ones: what is wrong in a part of a visit, like
    readings that slipped, leaves the response that its other readings tell as it is."""
    rows, visit = fitted.data.rows, fitted.at_map.noise.visit
    chance = crowded(visit, *_distances(fitted))
    numbers = {number: set(rows.row[visit == number].tolist()) for number in chance}
    bad = [replace(score, p_value=chance[number]) for score in test.scores for number in chance
           if numbers[number] <= set(score.rows.tolist())]
    if not bad or len(bad) > MOST_VISITS * len(test.scores):
        return test
    kept = ~np.isin(rows.row, np.concatenate([score.rows for score in bad]))
    try:
        rest = posterior(fitted.data.with_rows(rows.select(kept)), fitted.terms, fitted)
    except CompstiffError:
        return test
    return replace(test, bad=tuple(sorted(bad, key=lambda score: score.p_value)), rest=rest)


def crowded(visit: NDArray[np.intp], distance: Array, count: NDArray[np.int_], kept: NDArray[np.bool_]) -> dict[int, float]:
    """Visits with more bad rows than are single mistakes, and the probability of the least of these in the tails that the other
    visits leave open: as many as there are in one hide each other from `rare`. Arguments as there; visit (n,)."""
    found = {}
    for number in np.unique(visit[kept]):
        mine = np.flatnonzero(kept & (visit == number))
        others = kept & (visit != number)
        if len(mine) <= MOST_IN_A_VISIT or others.sum() < FEWEST:
            continue
        least = mine[np.argsort(-distance[mine])[MOST_IN_A_VISIT]]
        p_value = kept.sum() * probability_beyond(float(distance[least]), int(count[least]), distance[others], count[others])
        if p_value <= ALARM:
            found[int(number)] = p_value
    return found


def _distances(fitted: Posterior) -> tuple[Array, NDArray[np.int_], NDArray[np.bool_]]:
    """Squared distances (n,) of the rows from the model, of how many components (n,), and which may be called bad (n,)."""
    visit = fitted.at_map.noise.visit
    distance, count = distances(fitted.at_map.noise, fitted.components, fitted.weights, fitted.at_map.residual)
    # A row that is alone at its pose may be off for any reason that pose has.
    kept = (count > 0) & (np.bincount(visit)[visit] >= COMPANY)
    for term, values in zip(fitted.terms, fitted.term_values, strict=True):
        kept &= ~term.effect.loose(fitted.load_state, term.joint, values)
    return distance, count, kept


def rare(distance: Array, count: NDArray[np.int_], kept: NDArray[np.bool_], most: float) -> dict[int, float]:
    """Rows that the others do not explain, the farthest first, with their probabilities: squared distances (n,) of `count`
    components, of the rows `kept` (n,). Taken out one by one (B. Rosner, Percentage points for a generalized ESD many-outlier
    procedure, Technometrics 25, 1983): those up to the last that is rare, also where it had hidden the ones before it. None
    where there would be more than `most`."""
    taken: dict[int, float] = {}
    left, found = kept.copy(), 0
    while len(taken) < found + HIDDEN:
        candidates = np.flatnonzero(left)
        if len(candidates) < FEWEST:
            return {}
        worst = int(candidates[np.argmax(distance[candidates])])
        left[worst] = False
        others = np.flatnonzero(left)
        taken[worst] = len(candidates) * probability_beyond(float(distance[worst]), int(count[worst]), distance[others],
                                                            count[others])
        found = len(taken) if taken[worst] <= ALARM else found
        if found > most:
            return {}
    chance = list(taken.values())[:found]
    return {row: min(chance[k:]) for k, row in enumerate(list(taken)[:found])}

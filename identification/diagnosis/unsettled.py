"""Zero readings that lie aside of the loaded ones, anew at each pose: told from what the loads leave by loads of both signs.

At a pose whose loads cancel, what any law of the arm does that turns round with the load goes out of the place where the loaded
readings meet: that place, by least squares over 1 and the force, against the mean of the readings without load.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from identification.common.arrays import Array
from identification.common.tails import f_tail
from identification.diagnosis.scatter import Scatter
from identification.fit.load_test import LoadTest
from identification.fit.noise import sensor_sigma
from identification.fit.posterior import Posterior
from identification.model.effects.unsettled_zero import UnsettledZero

EFFECT = UnsettledZero()
# Probability by chance under which zero readings are said to lie aside, and that without the pose that speaks most for it.
ALARM, WITHOUT_ONE = 1e-3, 0.01
# Poses that it must be seen at.
FEWEST_VISITS = 4
# Loads of a pose cancel where the place at which their readings meet is known nearly as well as their mean.
CANCEL = 2.0
# So many repeated zero readings tell their own scatter.
ENOUGH_ZEROS = 10
# Readings of a computer scatter by less than so much of the sensor's variance.
NOTHING = 1e-12


class Unsettled(Scatter):
    """size, largest [m]: 1 sigma of each component by which the zero readings of a pose lie aside."""

    effect, code, rows, short = EFFECT, "CS1410", "the zero readings", "ZERO READINGS LIE ASIDE"

    @property
    def sentence(self) -> str:
        """In plain words."""
        return f"{EFFECT.sentence}, by {1e6 * self.size:.2g} um"

    def allowed_for(self, data: LoadTest, fitted: Posterior) -> LoadTest:
        """The same rows with that in the noise that a pose's zero readings share."""
        return replace(data, rest=self.size)


@dataclass(frozen=True)
class _Visit:
    """aside (3,): mean of the zero readings less where the loaded ones meet, in the sensor's sigmas; parts (2,): of the squared
    scatter of either in its variance; squares, degrees (2,): sums of squares of either, and of how many. sigma (3,) [m]."""

    aside: Array
    parts: Array
    squares: Array
    degrees: Array
    sigma: Array


def unsettled_zero_of(fitted: Posterior) -> Unsettled | None:
    """The zero readings that lie aside in what a fitted model leaves, None where none do or where that cannot be told."""
    visits = _visits(fitted)
    if len(visits) < FEWEST_VISITS:
        return None
    squares, degrees = (np.sum([getattr(each, name) for each in visits], axis=0) for name in ("squares", "degrees"))
    scatter = squares / np.maximum(degrees, 1)
    if degrees[0] < ENOUGH_ZEROS:
        scatter[0] = scatter[1]
    variance = np.maximum([each.parts @ scatter for each in visits], NOTHING)
    aside, sigma = (np.array([getattr(each, name) for each in visits]) for name in ("aside", "sigma"))
    larger = aside**2 / variance[:, None]
    rest = np.ones(len(visits), dtype=bool)
    rest[np.argmax(larger.sum(axis=1))] = False

    def by_chance(some: NDArray[np.bool_]) -> float:
        return float(f_tail(larger[some].mean(), larger[some].size, degrees[1]))

    size = float(np.sqrt(max(np.mean((aside**2 - variance[:, None]) * sigma**2), 0.0)))
    if size == 0.0 or by_chance(rest | True) > ALARM or by_chance(rest) > WITHOUT_ONE:
        return None
    log_std = float(np.sqrt(0.5 / larger.size) / max(1 - 1 / larger.mean(), 0.1))
    return Unsettled(size, log_std, by_chance(rest | True), size)


def _visits(fitted: Posterior) -> list[_Visit]:
    """The visits whose loads cancel and that have zero readings."""
    data, force = fitted.data, fitted.data.rows.wrench[:, :3]
    sigma = sensor_sigma(data)
    residual = fitted.residual / sigma
    whole, unloaded = ~np.isnan(residual).any(axis=1), ~np.any(data.rows.wrench != 0, axis=1)
    found = []
    for visit in np.unique(data.rows.visit):
        mine = whole & (data.rows.visit == visit)
        zeros, loaded = residual[mine & unloaded], residual[mine & ~unloaded]
        columns = np.column_stack([np.ones(len(loaded)), force[mine & ~unloaded]])
        degrees = len(loaded) - np.linalg.matrix_rank(columns) if len(loaded) else 0
        if not len(zeros) or degrees < 1:
            continue
        meet = np.linalg.pinv(columns)
        if len(loaded) * np.sum(meet[0] ** 2) > CANCEL:
            continue
        left, apart = loaded - columns @ (meet @ loaded), zeros - zeros.mean(axis=0)
        found.append(_Visit(zeros.mean(axis=0) - meet[0] @ loaded, np.array([1 / len(zeros), np.sum(meet[0] ** 2)]),
                            np.array([np.sum(apart**2), np.sum(left**2)]), 3.0 * np.array([len(zeros) - 1, degrees]),
                            sigma[mine].mean(axis=0)))
    return found

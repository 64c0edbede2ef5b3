"""The linear model of the rows: residual = H z + noise, z the parameters of the springs, of set-up, drift and remainder.

The remainder's prior is taken on the condition that the set-up sees nothing of it: G^T W Phi w = 0 with its columns G at the
rows and the weights W = 1 / sigma^2 (Plumlee and Joseph, Statistica Sinica 28 (2018) 601, orthogonal Gaussian process models).
What it can explain is its own, and is not carried elsewhere in the remainder's name. That costs nothing, since a rigid
displacement is itself smooth over the places: remainder and set-up together are all that they were. The drift's columns go with
the time and are not, and smooth errors go with the time as the path does: made orthogonal to the drift, the remainder could not
be a stretch of the work space along the path, and what acts with the force was taken for it. The springs have a prior of their
own, the load test's, and columns that follow the force. So drift and springs are weighed against the remainder together;
docs/benchmarks/parts.md has what it costs to make it orthogonal to them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from compensator.correction.predict import Predicted
from compensator.correction.prediction import deviation_slopes, predict_path
from compensator.learned.learned import DRIFT, SETUP, JobFrame
from compensator.learned.remainder import Remainder, spread_out
from compensator.learning.rows import Rows
from identification.common.arrays import Array
from identification.model.stiffness import IdentifiedModel

# 1 sigma before anything was measured: shift [m] and turn [rad] of a work object that was probed, drift [m] of what warms up.
# Engineering judgement, wide.
SHIFT_STD, TURN_STD, DRIFT_STD = 1e-3, 2e-3, 0.2e-3
# By how much [m] 1 sigma of a set-up must move the rows, root mean square, to be told from the remainder, which is expected to
# be about as large (sizes.py).
LEAST_SETUP = 30e-6
# So many places carry the remainder.
MOST_CARRIERS = 48


@dataclass(frozen=True, eq=False)
class Terms:
    """residual (n,) [m]: measured less what is known at the prior's mean, linearised where `mean` (S,) stands; by_x (n, S)
    slopes by the model's parameters, of_job (n, 9) by set-up and drift; before (S, S): the prior's covariance of x; job (9, 9):
    projector on what is in the model of set-up and drift, each in shares of its sigma before. cutter [m]: 1 sigma of what all
    rows along normals are off by alike (cutter_size.py), 0: nothing."""

    rows: Rows
    frame: JobFrame
    residual: Array
    by_x: Array
    of_job: Array
    before: Array
    job: Array
    cutter: float = 0.0

    @property
    def physical(self) -> Array:
        """H (n, S + 9) of the physical terms."""
        return np.concatenate([self.by_x, self.of_job], axis=1)

    @property
    def of_job_std(self) -> Array:
        """1 sigma (9,) [m] of set-up and drift before anything was measured."""
        return np.repeat([SHIFT_STD, TURN_STD * self.frame.radius, DRIFT_STD], 3)

    @property
    def physical_prior(self) -> Array:
        """Covariance (S + 9, S + 9) of their parameters; what the model does not have of the job has none."""
        size = len(self.before)
        prior = np.zeros((size + SETUP + DRIFT, size + SETUP + DRIFT))
        prior[:size, :size] = self.before
        prior[size:, size:] = self.of_job_std[:, None] * self.job * self.of_job_std
        return prior

    def select(self, chosen: NDArray[np.bool_]) -> Terms:
        """These rows (n,) alone."""
        return replace(self, rows=self.rows.select(chosen), residual=self.residual[chosen], by_x=self.by_x[chosen],
                       of_job=self.of_job[chosen])

    def remainder(self, length: float, amplitude: float = 1.0) -> tuple[Remainder, Array]:
        """The remainder carried by places of these rows, and its slopes (n, 3 m) by its weights."""
        rows = self.rows
        used = np.unique(rows.place)
        chosen = used[spread_out(rows.position[used], rows.posture[used], length, MOST_CARRIERS)]
        remainder = Remainder(rows.position[chosen], rows.posture[chosen], length, amplitude)
        return remainder, rows.spread(remainder.basis(rows.position, rows.posture))

    def free(self, slopes: Array) -> Array:
        """An orthonormal basis (3 m, r) of the weights of which the set-up sees nothing here, by the slopes (n, 3 m). What a
        set-up moves the rows by less than LEAST_SETUP is the remainder's: points along the normals of upright walls hardly see
        a turn about a level axis, and would keep the remainder from what depends on the height."""
        setup = slice(0, SETUP)
        seen = self.of_job[:, setup] * self.of_job_std[setup] @ self.job[setup, setup]
        moved, size, _ = np.linalg.svd(seen, full_matrices=False)
        moved = moved[:, size >= LEAST_SETUP * np.sqrt(len(seen))]
        _, size, right = np.linalg.svd((moved / self.rows.sigma[:, None] ** 2).T @ slopes)
        rank = int((size > 1e-9 * size.max(initial=0.0)).sum())
        return np.asarray(right[rank:].T)


def frame_of(rows: Rows, predicted: Predicted) -> JobFrame:
    """What set-up and drift of this job are counted by."""
    centre = rows.on_part.mean(axis=0)
    radius = float(np.sqrt(np.mean(np.sum((rows.on_part - centre) ** 2, axis=1)))) or 1.0
    path, first = predicted.path, predicted.targets[:1]
    return JobFrame(path.axes.to_rest(path.base_from_object[first], first)[0], centre, radius, float(rows.time.max()))


def terms_of(rows: Rows, predicted: Predicted, model: IdentifiedModel, mean: Array, before: Array,
             frame: JobFrame, job: Array) -> Terms:
    """Linearised at the parameters of `model`: rows less the deviation there.
    mean (S,), before (S, S): the prior of x."""
    loaded = replace(predicted.loaded, model=model)
    deviation, slopes = predict_path(loaded).position, deviation_slopes(loaded)[:, :3]
    by_x = rows.seen(slopes)
    residual = rows.value - rows.seen(deviation)[:, 0] + by_x @ (model.mean - mean)
    return Terms(rows, frame, residual, by_x, rows.along(frame.columns(rows.on_part, rows.time, rows.to_base)), before, job)

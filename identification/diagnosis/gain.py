"""What the extension gains on rows that were not fitted: validate rows, or every pose predicted from the others."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.common.arrays import read_only
from identification.fit.held_out import left_out_with_density, pose_names, poses
from identification.fit.load_test import LoadTest
from identification.fit.noise import noise_model
from identification.fit.posterior import Posterior

Array = NDArray[np.float64]
RESAMPLES = 999
# ln of how much likelier rows that were not fitted must be without a name for it to be withdrawn; by as much with a term for it
# to be of use.
AGAINST = -3.0
# Poses that are drawn at once.
AT_ONCE = 1_000_000


@dataclass(frozen=True, eq=False)
class Gain:
    """RMS [m] over all measured components of rows that were not fitted, plain and extended; interval: 95 % of their ratio,
    over poses drawn anew; held_out: which rows. support: how much likelier the extended model makes them, ln: each model
    with its own noise and what is left open of its parameters, or on validate rows both by the noise of the extended one.
    by_pose (2, poses): RMS [m] before and after of each of `poses`."""

    before: float
    after: float
    interval: tuple[float, float]
    held_out: str
    support: float
    by_pose: Array
    poses: tuple[str, ...]

    def __post_init__(self) -> None:
        read_only(self.by_pose)

    @property
    def ratio(self) -> float:
        """RMS before over RMS after."""
        return self.before / max(self.after, 1e-12)

    def as_dict(self) -> dict[str, Any]:
        """JSON values."""
        return {"rms_before_um": 1e6 * self.before, "rms_after_um": 1e6 * self.after, "ratio": self.ratio,
                "interval": list(self.interval), "held_out": self.held_out}


def gain(data: LoadTest, plain: Posterior, extended: Posterior, rng: np.random.Generator) -> Gain:
    """The gain on the validate rows where there are any, else by cross-validation: each pose predicted from the others."""
    if data.rows.validate.any():
        kept = data.with_rows(data.rows.select(data.rows.validate))
        groups, held_out = poses(kept.rows), "validate"
        residuals = [model.residual_of(kept) for model in (plain, extended)]
        support = _misfit(extended, kept, residuals[0]) - _misfit(extended, kept, residuals[1])
    else:
        kept = plain.data
        groups, held_out = poses(kept.rows), "cross-validation by pose"
        without, with_it = (left_out_with_density(model, groups) for model in (plain, extended))
        residuals, support = [without[0], with_it[0]], with_it[1] - without[1]
    squares = np.array([_by_group(residual**2, groups) for residual in residuals])
    counts = _by_group((~np.isnan(kept.rows.deflection)).astype(float), groups)
    before, after = np.sqrt(squares.sum(axis=1) / counts.sum())
    low, high = np.quantile(_ratios(squares, rng), [0.025, 0.975])
    by_pose = np.sqrt(squares / np.maximum(counts, 1))
    return Gain(float(before), float(after), (float(low), float(high)), held_out, support, by_pose, pose_names(kept.rows))


def _misfit(model: Posterior, data: LoadTest, residual: Array) -> float:
    """Half the chi-squared of a residual (n, 3) [m] of rows that were not fitted, by the noise of this model: no tails were
    weighed there, and an outlier would speak against whichever model has the smaller noise."""
    noise = noise_model(data, model.compliance)
    whitened = np.einsum("nij,nj->ni", noise.whitening, np.nan_to_num(residual))[:, :, None]
    return 0.5 * float(noise.weights(model.components).inner(whitened, whitened)[0, 0])


def _ratios(squares: Array, rng: np.random.Generator) -> Array:
    """Root of the first squares over the second (2, poses), over poses drawn anew (RESAMPLES,)."""
    count, ratios = squares.shape[1], []
    for some in np.array_split(np.arange(RESAMPLES), min(RESAMPLES, 1 + RESAMPLES * count // AT_ONCE)):
        before, after = squares[:, rng.integers(0, count, (len(some), count))].sum(axis=2)
        ratios.append(np.sqrt(before / np.maximum(after, 1e-30)))
    return np.concatenate(ratios)


def _by_group(values: Array, groups: NDArray[np.intp]) -> Array:
    """Sums over the components of each group's rows."""
    return np.asarray(np.bincount(groups, np.nansum(values, axis=1)), dtype=float)

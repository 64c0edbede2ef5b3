"""What is expected to be left on the part: 1 sigma at each corrected target, by cause.

The covariance of a prediction is that of the robot under the force as logged. On the part there is more:

    model     the prediction's covariance: stiffnesses, effects, the arm's weight where it is not known, the scatter of the
              mean force; and what a correction that is held back leaves
    sensor    the gain of the force sensor: so large a share of the deviation
    cut       where no cutting stiffness is known: the corrected tool stands deeper in the cut by e . n, the force grows by
              g = (e . n) / 2 a with a depth of cut a (--depth-of-cut), and |d| g / (1 + g) is left (engagement.py)
    learned   with --learned: how far what is learned beside the springs is known, and the width of the remainder where no part
              was measured. The springs learned have the sensor's gain in them: then `sensor` is nothing
    between   what is left between targets on the moves beside one (between_targets.py); on moves that asked for nothing, evenly
              distributed up to half the tolerance

Each is a size, not a direction, and they are added as independent. Left out: chatter, zones, warming, the robot in motion.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compensator.correction.between_targets import BetweenTargets
from compensator.correction.engagement import CorrectedPass, LoggedPass, left_at_depth
from compensator.correction.predict import Predicted
from identification.common.arrays import Array, read_only, rms

Indices = NDArray[np.intp]
CAUSES = {"model": "the model", "sensor": "gain of the force sensor", "cut": "force that follows the cut",
          "learned": "what was learned", "between": "between targets"}


@dataclass(frozen=True, eq=False)
class ExpectedLeft:
    """1 sigma (M,) [m] of how far the tool is off the plan at the corrected targets, by cause."""

    model: Array
    sensor: Array
    cut: Array
    learned: Array
    between: Array

    def __post_init__(self) -> None:
        read_only(*(getattr(self, cause) for cause in CAUSES))

    @property
    def std(self) -> Array:
        """Of all causes (M,) [m]."""
        return np.asarray(np.sqrt(np.sum([getattr(self, cause) ** 2 for cause in CAUSES], axis=0)))

    def as_dict(self) -> dict[str, Any]:
        """JSON values, micrometres."""
        if not len(self.model):
            return {"largest": 0.0, "rms": 0.0, **dict.fromkeys(CAUSES, 0.0)}
        return {"largest": 1e6 * float(self.std.max()), "rms": 1e6 * rms(self.std),
                **{cause: 1e6 * rms(getattr(self, cause)) for cause in CAUSES}}

    def line(self, depth: float) -> str:
        """The same for the terminal; depth [m]: the depth of cut that was taken."""
        figures = self.as_dict()
        parts = ", ".join(f"{words} {figures[cause]:.1f}" for cause, words in CAUSES.items())
        return (f"expected to be left on the part, 1 sigma: {figures['rms']:.1f} um RMS, {figures['largest']:.1f} um at most "
                f"({parts}){self._remedy(depth)}")

    def sentence(self, depth: float) -> str:
        """The same for the report."""
        figures = self.as_dict()
        return (f"On the part {figures['rms']:.1f} um RMS are expected to be left, {figures['largest']:.1f} um at most (1 "
                "sigma): by the model's uncertainty, the force sensor's gain, the force that follows the cut, what was "
                f"learned where it is not sure, and between targets{self._remedy(depth)}.")

    def _remedy(self, depth: float) -> str:
        """What to state where the unknown cut is most of it."""
        figures = self.as_dict()
        if figures["cut"] <= 0.5 * figures["rms"]:
            return ""
        return f"; the cut for a depth of {1e3 * depth:g} mm (--depth-of-cut; or --cutting-stiffness)"


def expected_left(
    predicted: Predicted, kept: Indices, cut: CorrectedPass, logged: LoggedPass, residual: Array,
    between: BetweenTargets | None,
) -> ExpectedLeft:
    """Of a corrected program whose targets as given stand at `kept` (N,); residual (M,) [m]: what its correction leaves by the
    model."""
    targets, prediction = predicted.targets, cut.prediction
    size = np.linalg.norm(prediction.position, axis=1)
    follows = np.zeros(len(targets)) if logged.stiffness is not None else left_at_depth(predicted, kept, logged)
    # What is learned of the rest may be known better together with the springs than the springs by themselves.
    whole = np.trace(prediction.covariance, axis1=1, axis2=2)
    of_learned = np.clip(prediction.of_learned, 0.0, whole)
    gain = 0.0 if predicted.loaded.learned is not None else predicted.path.cell.force_log.form.gain_std
    return ExpectedLeft(np.sqrt(whole - of_learned + residual**2), gain * size, follows, np.sqrt(of_learned),
                        _between(predicted, kept, between)[targets])


def _between(predicted: Predicted, kept: Indices, between: BetweenTargets | None) -> Array:
    """What is left beside each target (N + added,) [m], root mean square over the moves to and from it."""
    count = len(predicted.path.toolpath)
    nothing = 0.5 * predicted.settings.correction.tolerance / np.sqrt(3.0)
    of_move = np.full(len(kept), nothing**2)
    if between is not None and len(between.left):
        weight = np.bincount(between.owner, minlength=len(kept))
        squares = np.bincount(between.owner, between.left**2, minlength=len(kept))
        of_move = np.where(weight > 0, squares / np.maximum(weight, 1), of_move)
    # The move as given that each target of the program ends, or lies in.
    owner = np.minimum(np.searchsorted(kept, np.arange(count)), len(kept) - 1)
    behind = np.minimum(owner + (kept[owner] == np.arange(count)), len(kept) - 1)
    return np.asarray(np.sqrt(0.5 * (of_move[owner] + of_move[behind])))
